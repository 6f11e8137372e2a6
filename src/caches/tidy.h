// Laying a structure out anew in the order of space.
//
// A structure lies in memory in the order in which its records came. Where that has nothing to do with where they are,
// the nodes, cells and records that a query reads lie far apart, and queries of neighbouring pixels share no pages and
// few cache lines. Built from records along a Morton curve, what is near in space is near in memory.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <utility>
#include <vector>

#include "core/counters.h"
#include "core/octree.h"
#include "core/parallel.h"
#include "core/processing_units.h"
#include "core/types.h"

namespace icbench {

/// Indices of the records along a Morton curve; those at one place as they come.
inline std::vector<std::uint32_t> order_in_space(std::span<const Record> records,
                                                 const OctreeAddressing& addressing) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keys(records.size());
  for (std::uint32_t i = 0; i < keys.size(); ++i) {
    const GridPoint u = addressing.quantise(records[i].p);
    std::uint64_t key = 0;
    for (int level = 0; level < kMaxLevel; ++level) key = key << 3 | OctreeAddressing::octant(u, level);
    keys[i] = {key, i};
  }
  std::sort(keys.begin(), keys.end());
  std::vector<std::uint32_t> order(keys.size());
  std::transform(keys.begin(), keys.end(), order.begin(), [](const auto& key) { return key.second; });
  return order;
}

/// Builds a structure anew from its records in that order, by as many threads as there are workspaces and processing
/// units, each a stretch of it. `fresh_workspaces()` empties all workspaces on the structure; `workspace(i)` is one of
/// `workspaces`. Quiescent; returns the number of records. If memory runs out while this is prepared, std::bad_alloc
/// comes out of it and nothing has changed; where it does later, in a library's container, that ends the process, as it
/// does in inserts.
template <class Structure, class FreshWorkspaces, class Workspace>
std::uint64_t lay_out_in_space(Structure& structure, const OctreeAddressing& addressing,
                               std::uint32_t workspaces, FreshWorkspaces&& fresh_workspaces,
                               Workspace&& workspace) {
  constexpr std::size_t kLeastShare = 4096;  // records worth a thread
  std::vector<Record> records;
  structure.for_each([&](const Record& r) { records.push_back(r); });
  const std::vector<std::uint32_t> order = order_in_space(records, addressing);
  structure.clear();
  fresh_workspaces();
  if (records.empty()) return 0;
  const std::size_t threads = std::clamp<std::size_t>(records.size() / kLeastShare, 1,
                                                      std::min<std::size_t>(workspaces, processing_units()));
  parallel_chunks(threads, 1, [&](std::size_t i, std::size_t) noexcept {
    const std::size_t begin = records.size() * i / threads, end = records.size() * (i + 1) / threads;
    auto& own = workspace(i);
    structure.prefault(own, static_cast<std::uint32_t>(end - begin));
    NoCounters uncounted;
    for (std::size_t at = begin; at < end; ++at) {
      // An empty structure has room for all that it promises; a lost record would break that.
      if (!structure.insert(own, records[order[at]], uncounted)) std::abort();
    }
  });
  return records.size();
}

}  // namespace icbench
