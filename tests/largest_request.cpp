#include "largest_request.h"

#include <cstdlib>
#include <new>

namespace icbench {
std::atomic<std::size_t> largest_request{0};
}  // namespace icbench

void* operator new(std::size_t size) {
  // Relaxed: a statistic that orders nothing.
  std::size_t largest = icbench::largest_request.load(std::memory_order_relaxed);
  while (size > largest &&
         !icbench::largest_request.compare_exchange_weak(largest, size, std::memory_order_relaxed)) {
  }
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
