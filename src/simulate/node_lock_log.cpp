// The caches with a lock per node or region again, with locks that tell which they are: as they ship but for the word.
#include "caches/direct.h"
#include "caches/packed_octree.h"
#include "caches/ward_tree.h"
#include "simulate/engine.h"

namespace icbench {
namespace {

/// A word of one thread that logs where it is when it is taken.
template <class T>
class LoggedAtomic : public PlainAtomic<T> {
 public:
  using PlainAtomic<T>::PlainAtomic;
  bool compare_exchange_strong(T& expected, T desired, std::memory_order success,
                               std::memory_order failure) noexcept {
    LockLog::words().push_back(this);
    return PlainAtomic<T>::compare_exchange_strong(expected, desired, success, failure);
  }
};

struct LoggedSync : NoHooks {
  template <class T>
  using Atomic = LoggedAtomic<T>;
};

}  // namespace

std::vector<const void*>& LockLog::words() {
  static std::vector<const void*> words;
  return words;
}

std::unique_ptr<SteppedCache> make_logged_node_locks(const CacheTraits& traits, const CacheConfig& config) {
  using Locks = SpinNodeLock<LoggedSync>;
  using PackedNodes = Packed<PlainSync, AtFirstSight, SimdLanes, Locks>;
  if (traits.structure == PackedNodes::kStructure)
    return std::make_unique<SteppedOf<Direct<PackedNodes, WithCounters>>>(config);
  return std::make_unique<SteppedOf<Direct<WardTree<PlainSync, Locks>, WithCounters>>>(config);
}

}  // namespace icbench
