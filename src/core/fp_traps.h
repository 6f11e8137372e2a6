// Floating-point traps for invalid operations: 0 / 0, inf - inf, the root of a negative number, and an ordered
// comparison (<, <=, >, >=, not == or std::isless) with a NaN. None of our own code is to make one, and the tests of
// hard cases have the processor see to that (tests/trap_invalid.h).
//
// Libraries may, and Embree does: it lets lanes that are not in use compute what they will. Where we call one, a
// LibraryCall masks the traps meanwhile. Outside of those tests nothing is trapped, and a call costs a load and a
// branch that is never taken: one or two for each packet of rays, not for each ray.
#pragma once

#include <atomic>
#include <cfenv>

namespace icbench {

// glibc alone has feenableexcept. clang evaluates both sides of conditionals beforehand unless it is told that this
// may trap, so that its programs trap where the source asks for nothing.
#if defined(__GLIBC__) && defined(__x86_64__) && !defined(__clang__)
inline constexpr bool kCanTrapInvalid = true;
inline int trap_invalid() noexcept { return feenableexcept(FE_INVALID); }
inline int mask_invalid() noexcept { return fedisableexcept(FE_INVALID); }
#else
inline constexpr bool kCanTrapInvalid = false;
inline int trap_invalid() noexcept { return 0; }
inline int mask_invalid() noexcept { return 0; }
#endif

/// Whether any thread may trap. Set while one thread runs, by tests alone.
inline std::atomic<bool> invalid_may_trap{false};

/// While it lives, invalid operations of this thread do not trap.
class LibraryCall {
 public:
  LibraryCall() noexcept {
    // Relaxed: whoever set it did so before it started the threads that trap.
    if (kCanTrapInvalid && invalid_may_trap.load(std::memory_order_relaxed)) [[unlikely]] {
      trapped_ = (mask_invalid() & FE_INVALID) != 0;
    }
  }
  ~LibraryCall() {
    if (!trapped_) [[likely]] {
      return;
    }
    std::feclearexcept(FE_INVALID);  // or the x87 unit traps belatedly
    trap_invalid();
  }
  LibraryCall(const LibraryCall&) = delete;
  LibraryCall& operator=(const LibraryCall&) = delete;

 private:
  bool trapped_ = false;
};

}  // namespace icbench
