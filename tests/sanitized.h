// Whether ThreadSanitizer or AddressSanitizer watches.
#pragma once

#include "core/sanitizers.h"

namespace icbench {

inline constexpr bool kSanitized = kThreadSanitizer || kAddressSanitizer;

}  // namespace icbench
