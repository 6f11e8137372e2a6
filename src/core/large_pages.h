// Memory on large pages, for what is built once and read at random ever after: a page table's entries then fit where
// the processor keeps them.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "core/setup_error.h"

namespace icbench {

/// Bytes of a large page, as a rule.
inline constexpr std::size_t kLargePage = std::size_t{1} << 21;

/// Whether a cache asks the system for large pages, which it may refuse. They spare address translations, and cost the
/// clearing of a whole one, 2 MiB as a rule, where a little of it is used.
enum class LargePages : std::uint8_t { never, when_large, always };

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
    const std::size_t unit = is_large ? kLargePage : alignof(std::max_align_t);
    void* memory = std::aligned_alloc(unit, (bytes + unit - 1) / unit * unit);
    if (memory == nullptr) fail_setup("cannot get memory for a frozen cache");
#if defined(MADV_HUGEPAGE)
    if (is_large) ::madvise(memory, bytes, MADV_HUGEPAGE);  // advice: may be refused
#endif
    return static_cast<T*>(memory);
  }
  void deallocate(T* memory, std::size_t) noexcept { std::free(memory); }

  friend bool operator==(const LargePageAllocator&, const LargePageAllocator&) noexcept { return true; }
};

}  // namespace icbench
