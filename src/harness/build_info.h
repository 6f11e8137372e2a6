// What this binary was built from, for every results file. Refreshed by each build, also after a mere commit.
#pragma once

#include <string_view>

namespace icbench {

struct BuildInfo {
  std::string_view commit;          ///< full hash, or "unknown" when built outside a git checkout
  bool dirty;                       ///< tracked files differed from the commit
  std::string_view compiler;        ///< e.g. "GNU 12.2.0"
  std::string_view compiler_flags;  ///< flags of the build type and those every target shares
  std::string_view build_type;      ///< CMake's: Release, Debug, RelWithDebInfo
  bool assertions;                  ///< assert() is active, so timings are not to be published
};

BuildInfo build_info() noexcept;

}  // namespace icbench
