// Whole files in.
#pragma once

#include <filesystem>
#include <string>

namespace icbench {

/// The bytes of a regular file. Throws std::runtime_error with one line.
std::string load_file(const std::filesystem::path& path);

}  // namespace icbench
