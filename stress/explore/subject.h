// Caches in the hands of the engine, by name: those of the registry, and the broken ones.
#pragma once

#include <span>

#include "stress/explore/drive.h"

namespace icbench::stress::explore {

struct ExploreSubject {
  std::string_view name;
  CacheTraits traits;
  /// nullptr where the engine has nothing to drive: the cache is for one thread, keeps nothing, or is built on a
  /// foreign container.
  ScenarioOutcome (*explore)(const Scenario&, Stamping, const SearchOptions&, std::uint32_t stop_at);
  std::optional<ReplayOutcome> (*replay)(const Scenario&, Stamping, std::span<const Deviation>);
};

template <class ModelCache>
ScenarioOutcome explore_cache(const Scenario& scenario, Stamping stamping, const SearchOptions& options,
                              std::uint32_t stop_at) {
  return Drive<ModelCache>(scenario, stamping).explore(options, stop_at);
}
template <class ModelCache>
std::optional<ReplayOutcome> replay_cache(const Scenario& scenario, Stamping stamping,
                                          std::span<const Deviation> deviations) {
  return Drive<ModelCache>(scenario, stamping).replay(deviations);
}

/// Instantiated once per cache in a translation unit of its own (explore/instance.cpp.in).
template <template <class> class CacheTemplate>
ExploreSubject make_explore_subject();

/// All caches, in the order of the registry.
std::span<const ExploreSubject> all_explore_subjects();

/// A cache that must be caught.
struct ExploreControl {
  ExploreSubject subject;
  std::string_view fault;  ///< one line
  Check check;             ///< must be violated
  /// Tried in turn, stamped and then unstamped, until it is.
  std::array<std::string_view, 2> scenarios;
};

std::span<const ExploreControl> all_explore_controls();

}  // namespace icbench::stress::explore
