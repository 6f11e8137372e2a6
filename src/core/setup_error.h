// How set-up code reports that it cannot go on: one line that says what, where and how to mend it.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <stdexcept>

namespace icbench {

/// Throws std::runtime_error(line); in a program built without exceptions, prints the line and aborts.
[[noreturn]] inline void fail_setup(const char* line) {
#if defined(__cpp_exceptions)
  throw std::runtime_error(line);
#else
  std::fprintf(stderr, "%s\n", line);
  std::abort();
#endif
}

}  // namespace icbench
