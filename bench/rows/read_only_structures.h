// Structures that are asked beside the caches: read-only, made of all records at once.
#pragma once

#include <vector>

#include "caches/packed_frozen.h"
#include "caches/registry.h"
#include "rows/query_ratio.h"
#include "rows/replicated_octree.h"

namespace icbench {

/// Read-only structures are built from all records at once, and asked without a session.
template <class Structure>
class Built {
 public:
  explicit Built(const SyntheticPlan& plan) : structure_(plan.config(1), plan.records()) {}
  const Structure& session() const noexcept { return structure_; }

 private:
  Structure structure_;
};

template <>
class Filled<PackedFrozen> : public Built<PackedFrozen> {
  using Built::Built;
};
template <>
class Filled<ReplicatedOctree> : public Built<ReplicatedOctree> {
  using Built::Built;
};

/// ReplicatedOctree of records in the order of space, in which its cells then lie.
class ReplicatedInOrder : public ReplicatedOctree {
 public:
  ReplicatedInOrder(const CacheConfig& config, std::span<const Record> records)
      : ReplicatedOctree(config, in_order(config, records)) {}

 private:
  static std::vector<Record> in_order(const CacheConfig& config, std::span<const Record> records) {
    std::vector<Record> out;
    for (const std::uint32_t i : order_in_space(records, OctreeAddressing(config.bounds)))
      out.push_back(records[i]);
    return out;
  }
};

template <>
class Filled<ReplicatedInOrder> : public Built<ReplicatedInOrder> {
  using Built::Built;
};

/// What is left of a query to whom the valid records are told: reading, weighing and adding these.
struct ToldRecords {};

template <>
class Filled<ToldRecords> {
 public:
  explicit Filled(const SyntheticPlan& plan)
      : points_(plan.points().data()),
        a_(plan.config(1).a),
        records_(plan.records().begin(), plan.records().end()) {
    Sequential<> oracle(plan.config(1));
    auto session = oracle.open_session(0);
    for (std::uint32_t i = 0; i < records_.size(); ++i) {
      Record r = records_[i];
      r.id = i;
      session.insert(r);
    }
    for (const SurfacePoint& x : plan.points()) {
      begin_.push_back(static_cast<std::uint32_t>(valid_.size()));
      session.visit(x, [&](const Record& r, float) { valid_.push_back(&records_[r.id]); });
    }
    begin_.push_back(static_cast<std::uint32_t>(valid_.size()));
    valid_.resize(valid_.size() + kWeighed, &records_[0]);
  }

  const Filled& session() const noexcept { return *this; }

  /// `x`: one of the plan's points themselves, which tells which records are valid.
  std::optional<Irradiance> query(const SurfacePoint& x) const noexcept {
    const auto at = static_cast<std::size_t>(&x - points_);
    const std::uint32_t end = begin_[at + 1];
    for (std::uint32_t i = begin_[at]; i < end; ++i) __builtin_prefetch(valid_[i]);
    Interpolator interpolator;
    for (std::uint32_t i = begin_[at]; i < end; i += kWeighed)
      kernels_.add(x, a_, &valid_[i], std::min(end - i, kWeighed), interpolator.sums());
    return interpolator.result();
  }

 private:
  const SurfacePoint* points_;
  float a_;
  LaneKernels kernels_ = SimdLanes::best();
  std::vector<Record, LargePageAllocator<Record>> records_;
  std::vector<std::uint32_t> begin_;
  std::vector<const Record*> valid_;
};

}  // namespace icbench
