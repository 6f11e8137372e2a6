#include "stress/campaign.h"

#include <fmt/format.h>

#include <algorithm>

namespace icbench::stress {

namespace {

// Long enough for the largest epochs, short enough that a history stays within some tens of megabytes.
constexpr std::uint64_t kMostRoundOperations = 100'000;
constexpr std::uint64_t kFewestRoundOperations = 2'000;

// Rare delays leave the timing of the shipping code nearly alone; frequent ones stretch every traversal.
constexpr std::uint32_t kDelayEvery[] = {0, 64, 512, 24};

}  // namespace

ClockSource clock_of_round(const CampaignOptions& options, std::uint32_t i) noexcept {
  if (!options.use_tsc) return ClockSource::counter;
  if (!options.use_counter) return ClockSource::tsc;
  return i % 2 == 0 ? ClockSource::counter : ClockSource::tsc;
}

void Totals::add(const Judgement& j, const RoundPlan& plan) {
  judgement.operations += j.operations;
  judgement.concurrent_pairs += j.concurrent_pairs;
  for (std::size_t i = 0; i < kCheckNames.size(); ++i) {
    const Finding& from = j.findings[i];
    Finding& to = judgement.findings[i];
    if (from.violations == 0) continue;
    ++rounds_violated[i];
    if (to.violations == 0) {
      to.witness_operations = from.witness_operations;
      to.witness =
          fmt::format("round {} ({}, stamps by {}, {}): {}", rounds, plan.shape->name,
                      plan.clock == ClockSource::tsc ? "tsc" : "counter",
                      plan.delay_every == 0 ? std::string("no delays")
                                            : fmt::format("one step in {} delayed", plan.delay_every),
                      from.witness);
    }
    to.violations += from.violations;
  }
  ++rounds;
}

Totals run_campaign(const Subject& subject, const CampaignOptions& options, const Advance& advance) {
  const auto shapes = all_shapes();
  // Every shape with either clock, delayed or not, if there are operations enough.
  const std::uint64_t combinations = shapes.size() * std::size(kDelayEvery) * 2;
  const std::uint64_t round_operations =
      std::clamp(options.operations / combinations, kFewestRoundOperations, kMostRoundOperations);
  Totals totals;
  while (totals.judgement.operations < options.operations) {
    const std::uint32_t i = totals.rounds;
    const auto turn = static_cast<std::uint32_t>(i / shapes.size());
    RoundPlan plan;
    plan.shape = &shapes[i % shapes.size()];
    plan.threads = subject.traits.single_thread ? 1 : options.threads;
    plan.operations = static_cast<std::uint32_t>(
        std::min<std::uint64_t>(round_operations, options.operations - totals.judgement.operations));
    plan.seed = hash_keys(options.seed, i);
    plan.delay_every = kDelayEvery[turn % std::size(kDelayEvery)];
    // The two clocks change places after each full turn.
    plan.clock = clock_of_round(options, turn + turn / static_cast<std::uint32_t>(std::size(kDelayEvery)));
    const RoundRecord round = plan.delay_every == 0 ? subject.run(plan) : subject.run_delayed(plan);
    const Judgement judgement = judge(round.history);
    totals.add(judgement, plan);
    advance(static_cast<double>(judgement.operations));
  }
  return totals;
}

}  // namespace icbench::stress
