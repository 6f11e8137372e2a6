#include "workload/dispatch.h"

#include <stdexcept>

#include "caches/registry.h"
#include "core/names.h"

namespace icbench {

std::span<const CacheEntry> all_caches() {
#define ICBENCH_ENTRY(id, Type)                         \
  CacheEntry{.traits = Type<NoCounters>::kTraits,       \
             .can_tidy = TidyCache<Type<NoCounters>>,   \
             .synthetic = &run_synthetic_trial<Type>,   \
             .ray_traced = &run_ray_traced_trial<Type>, \
             .trace = &run_trace_trial<Type>,           \
             .pass = &make_cached_pass<Type>,           \
             .stepped = &make_stepped_cache<Type>},
  static const CacheEntry entries[] = {ICBENCH_CACHES(ICBENCH_ENTRY)};
#undef ICBENCH_ENTRY
  return entries;
}

const CacheEntry& find_cache(std::string_view name) {
  std::vector<std::string_view> known;
  for (const CacheEntry& entry : all_caches()) {
    if (entry.traits.name == name) return entry;
    known.push_back(entry.traits.name);
  }
  throw std::runtime_error(unknown_name("cache", name, known));
}

}  // namespace icbench
