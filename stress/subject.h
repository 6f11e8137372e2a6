// The caches under stress, by name: those of the registry, as they ship and with delays at their atomic
// steps.
#pragma once

#include <span>

#include "core/cache.h"
#include "stress/round.h"

namespace icbench::stress {

struct Subject {
  CacheTraits traits;
  RoundRecord (*run)(const RoundPlan&);
  RoundRecord (*run_delayed)(const RoundPlan&);
};

/// Instantiated once per cache in a translation unit of its own (subject_instance.cpp.in).
template <template <class> class CacheTemplate>
Subject make_subject();

/// All caches, in the order of the registry.
std::span<const Subject> all_subjects();

}  // namespace icbench::stress
