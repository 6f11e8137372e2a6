// Containers on large pages, for what is built once and read at random ever after.
#pragma once

#include <sys/mman.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>

#include "core/large_pages.h"
#include "core/setup_error.h"

namespace icbench {

/// Allocator for standard containers. Blocks of at least a large page start at one and ask the system to be on them;
/// smaller ones are ordinary memory. Fails at set-up with one line.
template <class T>
struct LargePageAllocator {
  using value_type = T;

  LargePageAllocator() noexcept = default;
  template <class U>
  explicit(false) LargePageAllocator(const LargePageAllocator<U>&) noexcept {}

  T* allocate(std::size_t n) {
    const std::size_t bytes = n * sizeof(T);
    const bool is_large = bytes >= kLargePage;
    const std::size_t unit = is_large ? kLargePage : std::max(alignof(T), alignof(std::max_align_t));
    void* memory = std::aligned_alloc(unit, (bytes + unit - 1) / unit * unit);
    if (memory == nullptr) fail_setup("cannot get memory; free some, or ask for fewer records");
#if defined(MADV_HUGEPAGE)
    if (is_large) ::madvise(memory, bytes, MADV_HUGEPAGE);  // advice: may be refused
#endif
    return static_cast<T*>(memory);
  }
  void deallocate(T* memory, std::size_t) noexcept { std::free(memory); }

  friend bool operator==(const LargePageAllocator&, const LargePageAllocator&) noexcept { return true; }
};

}  // namespace icbench
