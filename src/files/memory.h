// Whether the machine has the memory for what was asked, told before the work starts: a system that
// overcommits grants any request and kills the process when it is used.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>

namespace icbench {

/// Throws std::runtime_error with one line if `bytes` exceed the memory that /proc/meminfo says is available;
/// a system that does not say is trusted. `what` needs the memory. `root` stands in for "/" in tests.
void require_memory(std::string_view what, std::uint64_t bytes, const std::filesystem::path& root = "/");

}  // namespace icbench
