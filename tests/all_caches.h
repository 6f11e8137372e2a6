// Typed tests over the whole registry: TYPED_TEST_SUITE(Suite, AllCaches, CacheNames).
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "caches/registry.h"

namespace icbench {

template <class Ignored, class... Ts>
struct TestedTypes {
  using type = ::testing::Types<Ts...>;
};

/// Every registered cache, with its counters switched on.
#define ICBENCH_TYPE(id, Type) , Type<WithCounters>
using AllCaches = TestedTypes<void ICBENCH_CACHES(ICBENCH_TYPE)>::type;
#undef ICBENCH_TYPE

struct CacheNames {
  template <class Cache>
  static std::string GetName(int) {
    return std::string(Cache::kTraits.name);
  }
};

}  // namespace icbench
