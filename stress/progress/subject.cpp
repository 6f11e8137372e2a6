#include "stress/progress/subject.h"

#include "caches/registry.h"

namespace icbench::stress {

std::span<const ProgressSubject> all_progress_subjects() {
#define ICBENCH_SUBJECT(id, Type) make_progress_subject<Type>(),
  static const ProgressSubject subjects[] = {ICBENCH_CACHES(ICBENCH_SUBJECT)};
#undef ICBENCH_SUBJECT
  return subjects;
}

}  // namespace icbench::stress
