// ICBENCH_SANITIZED: 1 where ThreadSanitizer or AddressSanitizer watches, else 0.
#pragma once

#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
#define ICBENCH_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(thread_sanitizer) || __has_feature(address_sanitizer)
#define ICBENCH_SANITIZED 1
#endif
#endif
#ifndef ICBENCH_SANITIZED
#define ICBENCH_SANITIZED 0
#endif
