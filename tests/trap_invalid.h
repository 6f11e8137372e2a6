// A program that includes this runs all its tests with floating-point traps for invalid operations: whatever of our own
// makes a NaN, or compares with one unawares, ends the program. Libraries are masked (core/fp_traps.h).
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <memory>

#include "core/fp_traps.h"

namespace icbench {

/// Traps in this thread, and in those that it starts, which inherit its floating-point environment.
class TrapInvalid {
 public:
  TrapInvalid() {
    if (!kCanTrapInvalid) {
      std::puts("note: invalid floating-point operations are not trapped in this build (core/fp_traps.h)");
      return;
    }
    invalid_may_trap.store(true, std::memory_order_relaxed);  // no other thread of ours is there
    std::feclearexcept(FE_INVALID);
    trap_invalid();
  }
  ~TrapInvalid() {
    mask_invalid();
    invalid_may_trap.store(false, std::memory_order_relaxed);
  }
  TrapInvalid(const TrapInvalid&) = delete;
  TrapInvalid& operator=(const TrapInvalid&) = delete;
};

class TrapInvalidEnvironment final : public ::testing::Environment {
 public:
  void SetUp() override { traps_ = std::make_unique<TrapInvalid>(); }
  void TearDown() override { traps_.reset(); }

 private:
  std::unique_ptr<TrapInvalid> traps_;
};

inline ::testing::Environment* const kTrapInvalid =
    ::testing::AddGlobalTestEnvironment(new TrapInvalidEnvironment);

}  // namespace icbench
