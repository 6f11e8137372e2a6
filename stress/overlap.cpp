#include "stress/overlap.h"

#include <algorithm>
#include <numeric>

namespace icbench::stress {

void Overlaps::collect(const History& history, const Epoch& epoch) {
  const auto operation = [&](std::uint32_t i) -> const Operation& { return history.operations[i]; };
  by_call_.resize(epoch.end - epoch.first);
  std::iota(by_call_.begin(), by_call_.end(), 0u);
  std::sort(by_call_.begin(), by_call_.end(), [&](std::uint32_t a, std::uint32_t b) {
    return operation(epoch.first + a).call < operation(epoch.first + b).call;
  });
  pairs_.clear();
  running_.clear();
  for (const std::uint32_t local : by_call_) {
    const std::uint32_t i = epoch.first + local;
    std::erase_if(running_, [&](std::uint32_t other) { return operation(other).ret < operation(i).call; });
    for (const std::uint32_t other : running_) {
      if (operation(other).is_query() == operation(i).is_query()) continue;
      const Overlap pair = operation(i).is_query() ? Overlap{i, other} : Overlap{other, i};
      const Operation& insert = operation(pair.insert);
      if (!insert.is_refused() && history.validity->is_valid(operation(pair.query).where, insert.where))
        pairs_.push_back(pair);
    }
    running_.push_back(i);
  }
  std::sort(pairs_.begin(), pairs_.end(),
            [](const Overlap& a, const Overlap& b) { return a.query < b.query; });
}

}  // namespace icbench::stress
