// What the build instantiates for every cache (instance.cpp.in): the cache in the hands of the engine.
#pragma once

#include "caches/registry.h"
#include "stress/explore/subject.h"

namespace icbench::stress::explore {

template <template <class> class CacheTemplate>
ExploreSubject make_explore_subject() {
  using Cache = CacheTemplate<NoCounters>;
  using Model = InModel<Cache>;
  if constexpr (std::is_same_v<Cache, Model> || Cache::kTraits.single_thread) {
    return {Cache::kTraits.name, Cache::kTraits, nullptr, nullptr};
  } else {
    return {Cache::kTraits.name, Cache::kTraits, &explore_cache<Model>, &replay_cache<Model>};
  }
}

}  // namespace icbench::stress::explore
