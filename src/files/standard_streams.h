// The standard streams of a program: closed by who started it, or full.
#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <string_view>
#include <utility>

namespace icbench {

/// Prints to standard error. If that cannot be written nobody is left to tell, and the work goes on.
template <class... Args>
void tell(fmt::format_string<Args...> format, Args&&... args) {
  std::fputs(fmt::format(format, std::forward<Args>(args)...).c_str(), stderr);
}

/// Standard streams that the caller has closed get a descriptor that fails, lest a file that is opened later takes
/// their number and receives what was meant for them. For the beginning of a program.
void occupy_standard_streams() noexcept;

/// `status`, or 2 with a line of `program` if not all that was printed has arrived. For the end of a program.
int status_of_output(std::string_view program, int status);

}  // namespace icbench
