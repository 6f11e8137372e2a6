// Replaces operator new for a test program, to see how much memory is asked for at once.
#pragma once

#include <atomic>
#include <cstddef>

namespace icbench {

/// The largest number of bytes that operator new was asked for since this was last set to 0, by shared
/// libraries too.
extern std::atomic<std::size_t> largest_request;

}  // namespace icbench
