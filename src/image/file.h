// Whole files in and out.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace icbench {

/// The bytes of a regular file. Throws std::runtime_error with one line.
std::string load_file(const std::filesystem::path& path);

/// Puts `bytes` under `path`: a regular file (or none) is replaced by a complete one in one step, with a
/// temporary file in the same folder; anything else, such as a device or a pipe, is written in place.
/// Symbolic links are followed. Throws std::runtime_error with one line; the temporary file is gone then and
/// an old file is untouched.
void write_file(const std::filesystem::path& path, std::string_view bytes);

}  // namespace icbench
