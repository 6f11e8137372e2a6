// Contention counters: kept per session in plain memory, summed at quiescent points, and compiled out by
// NoCounters.
#pragma once

#include <cstdint>

namespace icbench {

/// What one session did. Counts of operations unless a unit is given.
struct Counts {
  std::uint64_t queries = 0;
  std::uint64_t hits = 0;
  std::uint64_t invalid_queries = 0;  ///< outside the bounds, not finite, or without a unit normal
  std::uint64_t inserted = 0;
  std::uint64_t full = 0;
  std::uint64_t rejected = 0;
  std::uint64_t records_read = 0;   ///< records whose validity a query tested
  std::uint64_t records_valid = 0;  ///< of those, how many were valid
  std::uint64_t lock_acquisitions = 0;
  std::uint64_t lock_contended = 0;  ///< acquisitions that did not succeed at once
  std::uint64_t lock_wait_ns = 0;    ///< nanoseconds between the first try and holding the lock
  std::uint64_t cas_attempts = 0;
  std::uint64_t cas_failures = 0;
  std::uint64_t nodes_allocated = 0;  ///< nodes and list chunks
  std::uint64_t nodes_discarded = 0;  ///< of those, set aside because another thread installed first

  Counts& operator+=(const Counts& o) noexcept {
    queries += o.queries;
    hits += o.hits;
    invalid_queries += o.invalid_queries;
    inserted += o.inserted;
    full += o.full;
    rejected += o.rejected;
    records_read += o.records_read;
    records_valid += o.records_valid;
    lock_acquisitions += o.lock_acquisitions;
    lock_contended += o.lock_contended;
    lock_wait_ns += o.lock_wait_ns;
    cas_attempts += o.cas_attempts;
    cas_failures += o.cas_failures;
    nodes_allocated += o.nodes_allocated;
    nodes_discarded += o.nodes_discarded;
    return *this;
  }
};

/// Counting switched on: add<&Counts::queries>(1).
class WithCounters {
 public:
  static constexpr bool kOn = true;
  template <auto Field>
  void add(std::uint64_t n) noexcept {
    counts_.*Field += n;
  }
  Counts counts() const noexcept { return counts_; }
  void reset() noexcept { counts_ = {}; }

 private:
  Counts counts_;
};

/// Counting compiled out: no memory, no instruction.
class NoCounters {
 public:
  static constexpr bool kOn = false;
  template <auto Field>
  void add(std::uint64_t) noexcept {}
  Counts counts() const noexcept { return {}; }
  void reset() noexcept {}
};

}  // namespace icbench
