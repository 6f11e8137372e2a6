// Orders the operations of one epoch, or finds a cycle that forbids it.
//
// The orders that any linearization must respect are real time (a.ret < b.call) and forced pairs: a record
// that a query saw was inserted before it, one that it missed after it. Real time is never stored as edges:
// an operation is free of it as soon as none with an earlier return is left, so Kahn's topological sort runs
// over the forced pairs alone, with one pointer into the operations by call and one by return.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stress/history.h"

namespace icbench::stress {

/// `before` must come before `after`; indices into the span of operations.
struct ForcedOrder {
  std::uint32_t before;
  std::uint32_t after;
};

/// Work space that is kept from one epoch to the next.
class Linearizer {
 public:
  /// Empty if all orders can be met. Else a cycle in which each operation must precede the next and the last
  /// the first, and of which no operation can be left out. `by_call` lists the operations by call stamp.
  std::vector<std::uint32_t> find_cycle(std::span<const Operation> operations,
                                        std::span<const std::uint32_t> by_call,
                                        std::span<const ForcedOrder> forced);

 private:
  std::vector<std::uint32_t> trace_back(std::uint32_t start) const;
  std::vector<std::uint32_t> without_chords(std::vector<std::uint32_t> cycle) const;

  std::span<const Operation> operations_;
  std::span<const ForcedOrder> forced_;
  std::vector<std::uint32_t> by_return_;
  std::vector<std::uint32_t> first_successor_;
  std::vector<std::uint32_t> successors_;
  std::vector<std::uint32_t> waits_for_;  ///< forced predecessors that are left
  std::vector<std::uint8_t> is_placed_;
  std::vector<std::uint32_t> ready_;
};

}  // namespace icbench::stress
