// What the build instantiates for every cache (subject_instance.cpp.in): its steps under count.
#pragma once

#include "caches/registry.h"
#include "stress/progress/subject.h"

namespace icbench::stress {

template <template <class> class CacheTemplate>
ProgressSubject make_progress_subject() {
  return progress_subject<Stepped<CacheTemplate<NoCounters>>>();
}

}  // namespace icbench::stress
