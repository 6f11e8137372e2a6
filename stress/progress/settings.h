// The settings in which the check of progress looks at one operation.
#pragma once

#include <vector>

#include "stress/progress/trial.h"

namespace icbench::stress::progress {

using Type = Asked;

// Radii whose records lie in the root, near it, half way down and at the bottom (core/octree.h), in the unit cube.
inline constexpr float kRadii[] = {1.0f, 0x1p-1f, 0x1p-5f, 0x1p-20f};
inline constexpr std::uint32_t kSizes = std::size(kRadii);
inline constexpr std::uint32_t kPlaces = 2;
inline constexpr std::uint32_t kKinds = kPlaces * kSizes;
inline constexpr Shape kShape = {"progress", kPlaces, kRadii, 0, 0, 1, 0};

// Lengths of a list before an insert: empty, with room, its first chunk full, its third, and its last.
inline constexpr std::uint32_t kLengths[] = {0, 1, 4, 28, 252};

/// An operation and what is there before it; the records are at place 0.
struct Setting {
  std::vector<Prefill> prefill;
  Request victim;
  bool is_interfered;  ///< in the short form too
  Pool pool = Pool::usual;
};

inline std::vector<Setting> insert_settings() {
  std::vector<Setting> settings;
  for (std::uint32_t kind = 0; kind < kSizes; ++kind) {
    for (const std::uint32_t n : kLengths) settings.push_back({{{kind, n}}, {Type::insert, kind}, n == 0});
  }
  // A path of which the lower part is missing.
  settings.push_back({{{2, 1}}, {Type::insert, 3}, true});
  // Where every allocation has to go to a pool that has no whole piece left.
  for (const std::uint32_t kind : {0u, 3u})
    settings.push_back({{}, {Type::insert, kind}, true, Pool::scarce});
  return settings;
}

/// Of a query or a batch of them; a long list is read by a query alone, for a batch would only take its steps thrice.
inline std::vector<Setting> query_settings(Type type) {
  const Request query{type, 0};
  std::vector<Setting> settings = {{{}, query, false},
                                   {{{0, 1}, {1, 1}, {2, 1}, {3, 1}}, query, true},
                                   {{{0, 5}, {1, 5}, {kSizes + 1, 5}}, query, true}};
  if (type == Type::query) settings.push_back({{{1, 253}}, query, false});
  return settings;
}

}  // namespace icbench::stress::progress
