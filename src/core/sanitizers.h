// Which sanitizer watches this program.
#pragma once

namespace icbench {

#if defined(__SANITIZE_THREAD__)  // g++
inline constexpr bool kThreadSanitizer = true;
#elif defined(__has_feature)  // clang++
inline constexpr bool kThreadSanitizer = __has_feature(thread_sanitizer);
#else
inline constexpr bool kThreadSanitizer = false;
#endif

#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool kAddressSanitizer = true;
#elif defined(__has_feature)
inline constexpr bool kAddressSanitizer = __has_feature(address_sanitizer);
#else
inline constexpr bool kAddressSanitizer = false;
#endif

}  // namespace icbench
