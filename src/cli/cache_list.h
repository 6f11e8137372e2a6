// --caches: which caches a command measures.
#pragma once

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "cli/options.h"
#include "workload/dispatch.h"

namespace icbench {

/// Caches by their names, separated by commas, none twice; "all" is without the oracle, which is a hundred times slower
/// than anything of use. Throws std::runtime_error with one line.
inline std::vector<const CacheEntry*> caches_of(const std::string& text) {
  std::vector<const CacheEntry*> out;
  if (text == "all") {
    for (const CacheEntry& e : all_caches())
      if (e.traits.name != "brute_force") out.push_back(&e);
    return out;
  }
  const std::vector<std::string> names = split_list("--caches", text);
  if (std::find(names.begin(), names.end(), "all") != names.end())
    throw std::runtime_error("--caches: all stands for itself; leave the others out");
  for (const std::string& name : names) out.push_back(&find_cache(name));
  require_distinct("--caches", names);
  return out;
}

inline std::vector<std::string> names_of(const std::vector<const CacheEntry*>& caches) {
  std::vector<std::string> out;
  for (const CacheEntry* cache : caches) out.emplace_back(cache->traits.name);
  return out;
}

}  // namespace icbench
