// The cache with a lock per node again, with locks that tell which they are: node_lock as it ships but for the word.
#include "caches/direct.h"
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

std::unique_ptr<SteppedCache> make_logged_node_locks(const CacheConfig& config) {
  using Cache = Direct<WardTree<PlainSync, SpinNodeLock<LoggedSync>>, WithCounters>;
  return std::make_unique<SteppedOf<Cache>>(config);
}

}  // namespace icbench
