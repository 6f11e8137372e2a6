#include "any_cache.h"

#include "caches/registry.h"

namespace icbench {

std::vector<AnyCache::Maker> registered_caches() {
#define ICBENCH_MAKER(name, Type) tested<Type<WithCounters>>(),
  return {ICBENCH_CACHES(ICBENCH_MAKER)};
#undef ICBENCH_MAKER
}

}  // namespace icbench
