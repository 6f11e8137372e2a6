#include "harness/build_info.h"

#include "harness/build_info_values.h"

namespace icbench {

BuildInfo build_info() noexcept {
#ifdef NDEBUG
  constexpr bool kAssertions = false;
#else
  constexpr bool kAssertions = true;
#endif
  return {ICBENCH_COMMIT,         ICBENCH_DIRTY,      ICBENCH_COMPILER,
          ICBENCH_COMPILER_FLAGS, ICBENCH_BUILD_TYPE, kAssertions};
}

}  // namespace icbench
