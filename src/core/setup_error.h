// How set-up code reports that it cannot go on: one line that says what, where and how to mend it.
//
// With exceptions, by std::runtime_error. Without (-fno-exceptions), by a handler and abort: constructors have no other
// way. What can fail is known beforehand: config_error (core/cache.h) tells what is wrong with a configuration; a
// session number must be below max_sessions; and address space for the capacity must be there, which a 64-bit system
// grants unless it was told not to (ulimit -v). Compile all that includes these headers in one of the two ways.
#pragma once

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>

namespace icbench {

/// Called with the line, in a program built without exceptions, before it is aborted; a handler that does not return is
/// the program's own end. May be null: the line goes to standard error.
inline std::atomic<void (*)(const char* line)> setup_failure_handler{nullptr};

/// Throws std::runtime_error(line); in a program built without exceptions, calls the handler and aborts.
[[noreturn]] inline void fail_setup(const char* line) {
#if defined(__cpp_exceptions)
  throw std::runtime_error(line);
#else
  // Acquire: what the handler relies on was written before it was set.
  if (const auto handler = setup_failure_handler.load(std::memory_order_acquire)) {
    handler(line);
  } else {
    std::fprintf(stderr, "%s\n", line);
  }
  std::abort();
#endif
}

}  // namespace icbench
