// Enumerators and numbers as they stand in results and on the command line.
#pragma once

#include <charconv>
#include <string_view>

#include "workload/spec.h"

namespace icbench {

constexpr std::string_view to_string(PointOrder order) noexcept {
  switch (order) {
    case PointOrder::uniform:
      return "uniform";
    case PointOrder::hot_spot:
      return "hot_spot";
    case PointOrder::coherent:
      return "coherent";
  }
  return "unknown";
}

constexpr std::string_view to_string(Method method) noexcept {
  switch (method) {
    case Method::irradiance_cache:
      return "irradiance_cache";
    case Method::path:
      return "path";
    case Method::hash_cells:
      return "hash_cells";
  }
  return "unknown";
}

/// The double nearest to the shortest decimal that reads as `x`: 0.3, where x itself is 0.30000001192092896.
inline double shortest_decimal(float x) {
  char text[32];
  const char* const end = std::to_chars(text, text + sizeof text, x).ptr;
  double value = 0.0;
  std::from_chars(text, end, value);
  return value;
}

}  // namespace icbench
