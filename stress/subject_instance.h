// What the build instantiates for every cache (subject_instance.cpp.in): its rounds of stress.
#pragma once

#include "caches/registry.h"
#include "stress/subject.h"

namespace icbench::stress {

template <template <class> class CacheTemplate>
Subject make_subject() {
  using Cache = CacheTemplate<NoCounters>;
  return {Cache::kTraits, &run_round<Cache>, &run_round<Delayed<Cache>>};
}

}  // namespace icbench::stress
