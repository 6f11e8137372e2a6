#include "stress/subject.h"

#include "caches/registry.h"

namespace icbench::stress {

std::span<const Subject> all_subjects() {
#define ICBENCH_SUBJECT(id, Type) make_subject<Type>(),
  static const Subject subjects[] = {ICBENCH_CACHES(ICBENCH_SUBJECT)};
#undef ICBENCH_SUBJECT
  return subjects;
}

}  // namespace icbench::stress
