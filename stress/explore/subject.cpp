#include "stress/explore/subject.h"

#include "caches/registry.h"

namespace icbench::stress::explore {

std::span<const ExploreSubject> all_explore_subjects() {
#define ICBENCH_SUBJECT(id, Type) make_explore_subject<Type>(),
  static const ExploreSubject subjects[] = {ICBENCH_CACHES(ICBENCH_SUBJECT)};
#undef ICBENCH_SUBJECT
  return subjects;
}

}  // namespace icbench::stress::explore
