// Many rounds on one cache, and what all of them together say.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "stress/checker.h"
#include "stress/round.h"
#include "stress/subject.h"

namespace icbench::stress {

struct CampaignOptions {
  std::uint32_t threads = 4;           ///< >= 2; caches for one thread are given one
  std::uint64_t operations = 200'000;  ///< per cache, at least; rounded up to whole epochs
  std::uint64_t seed = 1;
  bool use_tsc = true;      ///< stamp every other round by the time-stamp counter
  bool use_counter = true;  ///< stamp the others by a shared counter
};

/// Findings added up; a witness is that of the first violation, with the round it was found in.
struct Totals {
  Judgement judgement;
  std::array<std::uint32_t, kCheckNames.size()> rounds_violated{};
  std::uint32_t rounds = 0;

  void add(const Judgement& j, const RoundPlan& plan);
};

/// Progress of a campaign, in operations done since the last call.
using Advance = std::function<void(double operations)>;

/// Rounds that take turns in shape, clock and delays until the operations are done.
Totals run_campaign(const Subject& subject, const CampaignOptions& options, const Advance& advance);

/// The clock of round `i`.
ClockSource clock_of_round(const CampaignOptions& options, std::uint32_t i) noexcept;

}  // namespace icbench::stress
