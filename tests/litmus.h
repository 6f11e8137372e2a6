// What the programs of the schedule explorer's tests are made of.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "stress/explore/model_locks.h"

namespace icbench::stress::explore {

inline constexpr auto kRelaxed = std::memory_order_relaxed;
inline constexpr auto kAcquire = std::memory_order_acquire;
inline constexpr auto kRelease = std::memory_order_release;
inline constexpr auto kAcqRel = std::memory_order_acq_rel;
inline constexpr auto kSeqCst = std::memory_order_seq_cst;

using Word = ModelAtomic<std::uint32_t>;
using Outcome = std::vector<std::uint32_t>;

/// A few words, what the threads have read, and plain memory.
struct Litmus {
  std::array<Word, 4> w{};
  Outcome r = Outcome(6);
  std::uint32_t plain = 0;
  ModelMutex mutex;
};

}  // namespace icbench::stress::explore
