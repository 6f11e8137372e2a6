// What operations cost: the calibration's figures, which the engine adds up.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <unordered_map>
#include <vector>

#include "core/random.h"
#include "simulate/locks.h"
#include "simulate/machine.h"

namespace icbench {

/// Nanoseconds of an operation as a function of how many records are there.
class SizeCost {
 public:
  /// By floor(log2(records + 1)); not empty, each >= 0.
  explicit SizeCost(std::vector<double> ns = {0.0}) : ns_(std::move(ns)) {}

  /// Linear in log2 between the middles of its classes.
  double at(std::uint64_t records) const noexcept;
  const std::vector<double>& ns() const noexcept { return ns_; }
  void scale(double by) {
    for (double& x : ns_) x *= by;
  }

 private:
  std::vector<double> ns_;
};

/// How single operations lie about their mean: factors, of mean 1, each as likely as the others. Waiting depends on it:
/// operations that all take equally long fall into step.
class Spread {
 public:
  /// Not empty, each >= 0.
  explicit Spread(std::vector<double> factors = {1.0}) : factors_(std::move(factors)) {}
  /// Of samples over what was expected of them; any order.
  static Spread of(std::vector<double> ratios);

  double draw(Pcg32& random) const noexcept {
    return factors_[random.below(static_cast<std::uint32_t>(factors_.size()))];
  }
  const std::vector<double>& factors() const noexcept { return factors_; }

 private:
  std::vector<double> factors_;
};

/// Queries and inserts of one cache, nanoseconds.
struct OperationCosts {
  SizeCost query, insert;
  Spread query_spread{}, insert_spread{};
  double valid_ns = 0.0;  ///< a query, for each valid record
  /// A query, for each valid record that another core inserted and this one sees first.
  double fresh_ns = 0.0;
};

/// Of one cache under one workload, nanoseconds.
struct CacheCosts {
  OperationCosts operations;
  double outside_query_ns = 0.0;  ///< of the workload's own code around it: outside of any lock
  double outside_insert_ns = 0.0;
  double merge_record_ns = 0.0;  ///< of end_frame, for each record inserted since the last
  double trial_ns = 0.0;  ///< of a whole trial on one thread without work or merge: what the costs add up to
  /// Of that, a query and an insert in the mean, without what is around them.
  double query_ns = 0.0, insert_ns = 0.0;
  /// The same by themselves: from when all before is done until what they wrote is there; 0 if not measured.
  double query_alone_ns = 0.0, insert_alone_ns = 0.0;

  /// What one core does; not merges, nor what was measured of operations by themselves.
  void scale(double by);
  /// The same sum, in which no operation takes longer than by itself: the rest is around it. One who takes a lock has
  /// the processor finish everything first, and what comes after begins late; that is not time that the lock is held.
  /// `least_ns`: what taking the lock and giving it back takes, which an operation never takes less than.
  CacheCosts by_themselves(double least_ns = 0.0) const;

  nlohmann::ordered_json to_json() const;
  /// Throws std::runtime_error with one line if a field is missing or no number >= 0.
  static CacheCosts from_json(const nlohmann::ordered_json& j);
};

/// Who has seen which of the records that were inserted since the last quiescent point.
class FreshRecords {
 public:
  static constexpr unsigned kNobody = ~0u;

  explicit FreshRecords(unsigned cores) : words_((cores + 63) / 64) {}

  void add(std::uint32_t id, unsigned core) {
    const auto [at, is_new] = inserted_.try_emplace(id, Inserted{core, seen_.size()});
    if (is_new) seen_.resize(seen_.size() + words_);
    seen_[at->second.first + core / 64] |= std::uint64_t{1} << core % 64;
  }
  /// Who inserted the record with that id, if `core` sees it for the first time; else kNobody.
  unsigned see(std::uint32_t id, unsigned core) {
    const auto at = inserted_.find(id);
    if (at == inserted_.end()) return kNobody;
    std::uint64_t& word = seen_[at->second.first + core / 64];
    const std::uint64_t bit = std::uint64_t{1} << core % 64;
    if ((word & bit) != 0) return kNobody;
    word |= bit;
    return at->second.core;
  }
  void clear() {
    inserted_.clear();
    seen_.clear();
  }

 private:
  struct Inserted {
    unsigned core;
    std::size_t first;  // of its words in seen_
  };
  std::size_t words_;
  std::unordered_map<std::uint32_t, Inserted> inserted_;
  std::vector<std::uint64_t> seen_;
};

}  // namespace icbench
