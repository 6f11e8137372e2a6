// Which of the records that answer a query it cannot do without: what temporal instant caching tells superfluous records
// by (render/temporal.h).
#pragma once

#include <bit>
#include <cstdint>
#include <optional>

#include "core/random.h"
#include "core/types.h"
#include "render/record_source.h"

namespace icbench {

/// A number for a place, by which records can be put in an order that has nothing to do with how they are found.
/// Coordinates alone would not do: all records of a wall may share one.
inline std::uint64_t hash_of(const glm::vec3& p) noexcept {
  const auto bits = [](float x) { return std::uint64_t{std::bit_cast<std::uint32_t>(x)}; };
  return mix64(mix64(bits(p.x) << 32 | bits(p.y)) ^ bits(p.z));
}

/// Which record a query cannot do without. Any one that covers its point would do; it is the first by the hash of its
/// place, so that queries which share records agree on few, in whatever order they find them.
class NeededRecord {
 public:
  void offer(const Record& r, std::uint64_t order) noexcept {
    if (record_ && order >= order_) return;
    record_ = r;
    order_ = order;
  }
  void tell(RecordSource& source) const noexcept {
    if (record_) source.used(*record_);
  }

 private:
  std::optional<Record> record_;
  std::uint64_t order_ = 0;
};

}  // namespace icbench
