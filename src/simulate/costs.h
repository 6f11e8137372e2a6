// What operations cost: the calibration's figures, which the engine adds up.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <vector>

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

/// Of one cache under one workload, on one thread that nobody disturbs; nanoseconds.
struct CacheCosts {
  SizeCost query, insert;
  double valid_ns = 0.0;          ///< a query, for each valid record
  double outside_query_ns = 0.0;  ///< of the workload's own code around it: outside of any lock
  double outside_insert_ns = 0.0;
  double merge_record_ns = 0.0;  ///< of end_frame, for each record inserted since the last

  nlohmann::ordered_json to_json() const;
  /// Throws std::runtime_error with one line if a field is missing or no number >= 0.
  static CacheCosts from_json(const nlohmann::ordered_json& j);
};

}  // namespace icbench
