// Which of the records that answer a query it cannot do without: what temporal instant caching tells superfluous
// records by (render/temporal.h).
#pragma once

#include <cstdint>
#include <optional>

#include "core/types.h"
#include "render/record_source.h"
#include "render/record_table.h"

namespace icbench {

/// Which record a query cannot do without. Any one that covers its point would do; it is the first by the hash of its
/// place, so that queries which share records agree on few, in whatever order they find them.
class NeededRecord {
 public:
  void offer(const Record& r, std::uint64_t order) noexcept {
    if (r.id == RecordTable::kNone) return;  // not kept whatever is told
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
