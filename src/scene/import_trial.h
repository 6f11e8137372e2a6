// Reading a file in a process of its own first.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace icbench::importing {

inline constexpr const char* kTooMuchMemory = "takes too much memory to read";

/// Runs `attempt` in a child process with its output closed, that may take `bytes` of memory beyond what this
/// one has (not limited under sanitizers, which reserve address space without measure) and `seconds` of
/// processor time, ten times as many by the clock. Returns what keeps this process from doing the same: the
/// text that `attempt` returned, or one about the child's end; empty if there is nothing. The limits do not
/// outlive the call.
std::string try_apart(const std::function<std::string()>& attempt, std::size_t bytes, unsigned seconds);

}  // namespace icbench::importing
