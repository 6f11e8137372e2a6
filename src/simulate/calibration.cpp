#include "simulate/calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <numeric>
#include <stdexcept>

#include "core/sync.h"
#include "harness/environment.h"
#include "harness/statistics.h"
#include "harness/thread_team.h"
#include "harness/ticks.h"
#include "scene/registry.h"
#include "simulate/engine.h"
#include "workload/names.h"
#include "workload/trace_trial.h"

namespace icbench {
namespace {

using Json = nlohmann::ordered_json;

// What is so many times longer than the median was interrupted.
constexpr double kInterrupted = 12.0;

/// Samples of one kind of operation.
class Samples {
 public:
  void add(std::uint64_t records, std::uint64_t valid, std::uint64_t fresh, double ns) {
    all_.push_back({static_cast<unsigned>(std::bit_width(records + 1) - 1), static_cast<double>(valid),
                    static_cast<double>(fresh), ns});
  }

  struct Fit {
    SizeCost cost{{0.0}};  ///< at no valid record
    double valid_ns = 0.0, fresh_ns = 0.0;
    Spread spread{};
  };
  /// Mean by class of size at no valid record, and by least squares what each valid one and each one that is seen first
  /// adds; and how samples lie about that. Those that are far longer than others of their class were interrupted.
  Fit fit() {
    if (all_.empty()) return {};
    double valid_ns = 0.0, fresh_ns = 0.0;
    unsigned most = 0;
    for (const One& s : all_) most = std::max(most, s.size_class);
    std::vector<std::vector<double>> by_class(most + 1);
    for (const One& s : all_) by_class[s.size_class].push_back(s.ns);
    std::vector<double> limits;
    for (const auto& ns : by_class) limits.push_back(ns.empty() ? 0.0 : kInterrupted * median(ns));
    std::erase_if(all_, [&](const One& s) { return s.ns > limits[s.size_class]; });

    struct Mean {
      double count = 0.0, valid = 0.0, fresh = 0.0, ns = 0.0;
    };
    std::vector<Mean> means(most + 1);
    for (const One& s : all_) {
      Mean& m = means[s.size_class];
      m.count += 1.0;
      m.valid += s.valid;
      m.fresh += s.fresh;
      m.ns += s.ns;
    }
    for (Mean& m : means) {
      if (m.count == 0.0) continue;
      m.valid /= m.count;
      m.fresh /= m.count;
      m.ns /= m.count;
    }
    double vv = 0.0, ff = 0.0, vf = 0.0, vn = 0.0, fn = 0.0;
    for (const One& s : all_) {
      const Mean& m = means[s.size_class];
      const double v = s.valid - m.valid, f = s.fresh - m.fresh, n = s.ns - m.ns;
      vv += v * v;
      ff += f * f;
      vf += v * f;
      vn += v * n;
      fn += f * n;
    }
    const double determinant = vv * ff - vf * vf;
    if (determinant > 1e-9 * vv * ff) {
      valid_ns = (vn * ff - fn * vf) / determinant;
      fresh_ns = (fn * vv - vn * vf) / determinant;
    } else if (vv > 0.0) {
      valid_ns = vn / vv;
    }
    valid_ns = std::max(valid_ns, 0.0);
    fresh_ns = std::max(fresh_ns, 0.0);
    std::vector<double> out(most + 1, -1.0);
    for (unsigned k = 0; k <= most; ++k) {
      const Mean& m = means[k];
      if (m.count != 0.0) out[k] = std::max(0.0, m.ns - valid_ns * m.valid - fresh_ns * m.fresh);
    }
    // Classes without a sample take the next one's that has some.
    for (unsigned k = most; k-- > 0;)
      if (out[k] < 0.0) out[k] = out[k + 1];
    std::vector<double> ratios;
    for (const One& s : all_) {
      const double expected = out[s.size_class] + valid_ns * s.valid + fresh_ns * s.fresh;
      if (expected > 0.0) ratios.push_back(s.ns / expected);
    }
    return {SizeCost(std::move(out)), valid_ns, fresh_ns, Spread::of(std::move(ratios))};
  }

 private:
  struct One {
    unsigned size_class;
    double valid, fresh, ns;
  };
  std::vector<One> all_;
};

/// Runs a program on one core, or on several that take turns, and times every operation.
class Sampler {
 public:
  Sampler(const SimulatedProgram& program, SteppedCache& cache, const Mechanism& mechanism, ThreadTeam& team)
      : program_(program),
        cache_(cache),
        mechanism_(mechanism),
        team_(team),
        own_(team.size()),
        fresh_(team.size()) {
    for (int i = 0; i < 1000; ++i) {
      const std::uint64_t start = ticks();
      overhead_ = std::min(overhead_, static_cast<double>(ticks() - start));
    }
  }

  OperationCosts run() {
    bool is_first = true;
    for (const SimulatedSegment& segment : program_.segments()) {
      if (segment.is_fresh) {
        if (!std::exchange(is_first, false)) cache_.clear();
        for (const Record& r : segment.given) cache_.session(0).insert(r);
        cache_.end_frame();
        stored_ = merged_ = segment.given.size();
      }
      if (&segment == &program_.segments().front()) prefault(segment);
      run_segment(segment);
    }
    const Samples::Fit query = queries_.fit(), insert = inserts_.fit();
    return {query.cost, insert.cost, query.spread, insert.spread, query.valid_ns, query.fresh_ns};
  }

 private:
  // So many operations that what the hand-over costs does not count.
  static constexpr std::size_t kTurn = 64;

  /// As trials do: for the inserts that are known, or an eighth of the queries that may lead to some.
  void prefault(const SimulatedSegment& segment) {
    std::uint64_t queries = 0, inserts = 0;
    for (const Trace::Range chunk : segment.chunks) {
      for (std::uint32_t i = chunk.begin; i < chunk.end; ++i) {
        const SimulatedOperation what = program_.operation(i);
        queries += what.inserts;
        inserts += what.query == nullptr;
      }
    }
    const auto each = static_cast<std::uint32_t>((queries / 8 + inserts) / team_.size() + 1);
    for (unsigned t = 0; t < team_.size(); ++t) cache_.prefault(t, each);
  }

  void run_segment(const SimulatedSegment& segment) {
    std::vector<std::uint32_t> operations;
    for (const Trace::Range chunk : segment.chunks)
      for (std::uint32_t i = chunk.begin; i < chunk.end; ++i) operations.push_back(i);
    cache_.begin_frame();
    std::fill(own_.begin(), own_.end(), 0);
    fresh_.clear();
    alignas(kNoSharing) std::atomic<int> turns{0};
    team_.run([&](unsigned t) {
      for (std::size_t turn = t; turn * kTurn < operations.size(); turn += team_.size()) {
        // Acquire, release: whose turn it is has everything to itself, the samples included.
        for (unsigned i = 0; turns.load(std::memory_order_acquire) != static_cast<int>(turn); ++i)
          NoHooks::wait_turn(i);
        const std::size_t end = std::min(operations.size(), (turn + 1) * kTurn);
        for (std::size_t i = turn * kTurn; i < end; ++i) run_operation(t, operations[i]);
        turns.store(static_cast<int>(turn + 1), std::memory_order_release);
      }
    });
    cache_.end_frame();
    merged_ = stored_;
  }

  void run_operation(unsigned t, std::uint32_t i) {
    const SimulatedOperation what = program_.operation(i);
    if (what.query == nullptr) return insert(t, i);
    if (ask(t, *what.query) && !what.refuses_answer) return;
    if (what.asks_neighbours) ask(t, *what.query);
    if (what.inserts) insert(t, i);
  }

  bool ask(unsigned t, const SurfacePoint& x) {
    struct Shown {
      std::array<std::uint32_t, 64> ids;
      std::uint32_t valid = 0;
      Interpolator interpolator;
    } shown;
    const std::uint64_t start = ticks();
    cache_.session(t).visit(x, {[](void* context, const Record& r, float weight) noexcept {
                                  auto& s = *static_cast<Shown*>(context);
                                  s.ids[s.valid++ % s.ids.size()] = r.id;
                                  s.interpolator(r, weight);
                                },
                                &shown});
    const double ns = elapsed(start);
    std::uint64_t fresh = 0;
    for (std::uint32_t k = 0; k < std::min<std::size_t>(shown.valid, shown.ids.size()); ++k)
      fresh += fresh_.see(shown.ids[k], t) != FreshRecords::kNobody;
    queries_.add(visible(t), shown.valid, fresh, ns);
    return shown.valid != 0;
  }

  void insert(unsigned t, std::uint32_t i) {
    const Record record = program_.record(i);
    const std::uint64_t before = visible(t), start = ticks();
    const InsertResult result = cache_.session(t).insert(record);
    inserts_.add(before, 0, 0, elapsed(start));
    if (result != InsertResult::inserted) return;
    ++own_[t];
    ++stored_;
    if (!mechanism_.sees_own_only) fresh_.add(record.id, t);
  }

  std::uint64_t visible(unsigned t) const noexcept {
    return mechanism_.searches_own ? own_[t] : mechanism_.sees_own_only ? merged_ + own_[t] : stored_;
  }
  double elapsed(std::uint64_t start) const noexcept {
    return std::max(0.0, rate_.ns_per_tick * (static_cast<double>(ticks() - start) - overhead_));
  }

  const SimulatedProgram& program_;
  SteppedCache& cache_;
  const Mechanism& mechanism_;
  ThreadTeam& team_;
  const TickRate& rate_ = tick_rate();
  double overhead_ = 1e9;
  std::vector<std::uint64_t> own_;
  FreshRecords fresh_;
  std::uint64_t stored_ = 0, merged_ = 0;
  Samples queries_, inserts_;
};

/// Ticks between two stamps that wait for each other: a mean, since the counter may count in steps.
double ticks_of_stamp() {
  constexpr int kStamps = 1000;
  std::array<double, kStamps> all;
  for (double& ticks : all) {
    const std::uint64_t start = ticks_in_order();
    ticks = static_cast<double>(ticks_in_order() - start);
  }
  std::sort(all.begin(), all.end());
  constexpr int kUndisturbed = 9 * kStamps / 10;
  return std::accumulate(all.begin(), all.begin() + kUndisturbed, 0.0) / kUndisturbed;
}

/// Nanoseconds in the mean of operations that were timed in order and not interrupted; 0 if there are none.
double mean_ns(const Histogram& timed) {
  if (timed.count() == 0) return 0.0;
  const double most = kInterrupted * static_cast<double>(timed.percentile(0.5));
  return tick_rate().ns_per_tick *
         std::max(0.0, timed.mean_up_to(static_cast<std::uint64_t>(most)) - ticks_of_stamp());
}

TrialOutcome run_trial(const CacheEntry& cache, const CalibratedPlan& plan, const TrialSetup& setup) {
  TrialOutcome o = plan.trace ? cache.trace(*plan.trace, setup) : cache.synthetic(*plan.synthetic, setup);
  if (!o.error.empty())
    throw std::runtime_error(fmt::format("calibration of {}: {}", cache.traits.name, o.error));
  return o;
}

/// What operations take by themselves, of one thread.
void measure_alone(const CacheEntry& cache, const CalibratedPlan& plan, TrialSetup setup, CacheCosts& costs) {
  setup.latency_every = 1;
  setup.is_in_order = true;
  const TrialOutcome o = run_trial(cache, plan, setup);
  costs.query_alone_ns = mean_ns(o.query_ticks);
  costs.insert_alone_ns = mean_ns(o.insert_ticks);
}

double merge_of_record(const TrialOutcome& o) {
  return o.merge_cpu_ns / std::max(1.0, static_cast<double>(o.counts.inserted));
}

}  // namespace

double measured_pace(ThreadTeam& team, const Work& work) {
  const TickRate& rate = tick_rate();
  // The middle one of many pieces: the others may have waited while something else ran.
  constexpr double kNs = 1e6;
  constexpr int kPieces = 21;
  const std::uint64_t units = work.units_for_ns(kNs);
  std::vector<double> paces(team.size());
  team.run([&](unsigned t) {
    std::array<double, kPieces> pieces;
    for (double& pace : pieces) {
      const std::uint64_t start = ticks();
      const std::uint64_t end = do_work(units, t);
      asm volatile("" ::"r"(end));  // the chain ends before the counter is read again
      pace = rate.to_ns(ticks() - start) / kNs;
    }
    paces[t] = median(pieces);
  });
  return std::accumulate(paces.begin(), paces.end(), 0.0) / static_cast<double>(paces.size());
}

Calibration calibrate_machine(const Topology& topology, const Json& environment) {
  Calibration c;
  c.host_name = environment.value("host_name", "");
  c.cpu_model = environment.value("cpu_model", "");
  c.commit = program_of(environment);
  c.date = date_now();
  measure_waits(c.waits);
  const Work work = Work::calibrate();
  ThreadTeam one(topology, Placement::compact, 1);
  c.pace.alone = c.pace.together = measured_pace(one, work);
  if (topology.units().size() >= 2) {
    ThreadTeam two(topology, Placement::compact, 2);
    measure_contention(two, c.transfers, c.waits);
    c.is_transfer_measured = true;
    c.pace.together = measured_pace(two, work);
  }

  const WorkloadSpec spec = parse_workload("read_only:records=1000:operations=200000");
  const RayTracer rays(make_scene(spec.scene));
  const SyntheticPlan plan(spec, rays, 1);
  std::vector<double> samples;
  for (std::uint64_t i = 0; i < 9; ++i) {
    const TrialOutcome o = find_cache("null").synthetic(plan, {one, work, i});
    samples.push_back(o.cpu_ns / static_cast<double>(o.operations));
  }
  c.harness_query_ns = median(samples);
  return c;
}

std::string workload_key(const WorkloadSpec& s) {
  if (s.kind == WorkloadKind::trace)
    return fmt::format("trace {:016x}{}", s.checksum, s.as_captured ? " as captured" : "");
  return fmt::format("{} {}/1000 inserts, {} records, {} operations, order {}, a {}, scene {}",
                     to_string(s.kind), s.inserts_per_1000, s.prefilled() + s.inserts(), s.operations,
                     to_string(s.order), s.a, s.scene);
}

std::string key_of(std::string_view cache, const std::string& workload) {
  return fmt::format("{} under {}", cache, workload);
}

CacheCosts calibrate_cache(const CacheEntry& cache, const CalibratedPlan& plan, ThreadTeam& one,
                           ThreadTeam* two, const Work& work, const Calibration& machine,
                           std::uint64_t seed) {
  const auto trial = [&](const CacheEntry& entry, std::uint64_t repetition) {
    return run_trial(entry, plan, {one, work, repetition_seed(seed, repetition)});
  };
  const auto program = plan.trace ? simulated_program(*plan.trace)
                                  : simulated_program(*plan.synthetic, 1, repetition_seed(seed, 0));

  // The shape: one operation after the other.
  CacheCosts costs;
  const Mechanism mechanism = mechanism_of(cache.traits);
  const auto sampled = [&](ThreadTeam& team) {
    const auto stepped = cache.stepped(program->config(team.size()));
    return Sampler(*program, *stepped, mechanism, team).run();
  };
  costs.operations = sampled(one);
  // Two threads that take turns: only what a first sight adds to a query is taken from there, which compares queries of
  // one run. The rest is too sensitive to what runs in the turns of others.
  if (two != nullptr && !cache.traits.single_thread) costs.operations.fresh_ns = sampled(*two).fresh_ns;
  // Around it: the same with a cache that does nothing.
  constexpr std::uint64_t kTrials = 5;
  std::vector<double> around, whole, merges;
  double inserts_per_query = 0.0;
  for (std::uint64_t i = 0; i < kTrials; ++i) {
    const TrialOutcome nothing = trial(find_cache("null"), i);
    const double queries = static_cast<double>(nothing.counts.queries);
    const double offered = static_cast<double>(nothing.counts.full);
    inserts_per_query = queries == 0.0 ? 0.0 : offered / queries;
    around.push_back(nothing.cpu_ns / std::max(1.0, queries == 0.0 ? offered : queries));
    const TrialOutcome real = trial(cache, i);
    whole.push_back(real.cpu_ns);
    merges.push_back(merge_of_record(real));
  }
  costs.outside_query_ns = std::min(machine.harness_query_ns, median(around));
  costs.outside_insert_ns = inserts_per_query == 0.0
                                ? median(around)
                                : (median(around) - costs.outside_query_ns) / inserts_per_query;
  costs.merge_record_ns = mechanism.merge == Mechanism::Merge::none ? 0.0 : median(merges);

  // The scale: one thread takes as long as it does.
  const MachineModel alone{.cores = 1};
  const auto stepped = cache.stepped(program->config(1));
  const SimulatedOutcome o = simulate(*program, *stepped, {alone, machine.waits, costs, mechanism, seed});
  costs.trial_ns = o.wall_ns - o.merge_ns;
  costs.query_ns = o.query_ns / std::max(1.0, static_cast<double>(o.visits));
  costs.insert_ns = o.insert_ns / std::max(1.0, static_cast<double>(o.inserts + o.refused));
  const double measured = median(whole) - o.merge_ns;
  if (costs.trial_ns > 0.0 && measured > 0.0) costs.scale(measured / costs.trial_ns);
  measure_alone(cache, plan, {one, work, repetition_seed(seed, 0)}, costs);
  return costs;
}

CacheCosts costs_now(CacheCosts costs, const CacheEntry& cache, const CalibratedPlan& plan, ThreadTeam& one,
                     const Work& work, std::uint64_t seed) {
  const TrialOutcome o = run_trial(cache, plan, {one, work, seed});
  if (costs.merge_record_ns != 0.0) costs.merge_record_ns = merge_of_record(o);
  const double measured = o.cpu_ns - o.merge_cpu_ns;
  if (costs.trial_ns > 0.0 && measured > 0.0) costs.scale(measured / costs.trial_ns);
  measure_alone(cache, plan, {one, work, seed}, costs);
  return costs;
}

}  // namespace icbench
