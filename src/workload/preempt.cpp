#include "workload/preempt.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <thread>

#include "core/random.h"
#include "harness/held_thread.h"
#include "scene/registry.h"
#include "workload/names.h"
#include "workload/trial_entry.h"

namespace icbench {
namespace {

using namespace std::chrono_literals;

constexpr auto kTryAgain = 50us;  // after a tick that found the thread between two operations

/// Holds the thread until the region is over.
void hold_again_and_again(HeldThread& held, double pause_ms, std::uint64_t seed) {
  if (!held.await_attached()) return;
  Pcg32 random(seed);
  const auto drawn = [&] {
    return std::chrono::nanoseconds(static_cast<std::int64_t>(1e6 * pause_ms * (0.5 + random.uniform())));
  };
  for (auto pause = drawn(); held.pause(pause);) {
    if (held.hold())
      pause = drawn();
    else
      pause = kTryAgain;
  }
}

}  // namespace

Preempt::~Preempt() = default;

Preempt::Preempt(PreemptRequest request, const Topology& topology)
    : request_(std::move(request)),
      topology_(topology),
      work_(Work::calibrate()),
      tick_rate_(calibrate_ticks()) {
  const WorkloadSpec& spec = request_.workload;
  if (spec.kind == WorkloadKind::ray_traced || spec.kind == WorkloadKind::trace) {
    throw std::runtime_error(fmt::format(
        "workload '{}' is not a synthetic one; choose read_only, insert_only, a mix or miss_driven",
        spec.name));
  }
  if (request_.threads < 2)
    throw std::runtime_error("--threads 1: one thread is held and the others are measured; give 2 or more");
  for (const std::string& name : request_.caches) {
    const CacheEntry& cache = find_cache(name);
    if (spec.tidied && !cache.can_tidy)
      throw std::runtime_error(fmt::format("cache '{}' cannot be tidied; choose layout=as_inserted", name));
    if (cache.traits.single_thread)
      throw std::runtime_error(fmt::format("cache '{}' serves a single thread; choose a shared one", name));
  }
  const RayTracer rays(make_scene(spec.scene));
  plan_ = std::make_unique<SyntheticPlan>(spec, rays, request_.seed);
  team_ = std::make_unique<ThreadTeam>(topology_, request_.placement, request_.threads);
}

std::vector<Preempt::Point> Preempt::points(unsigned repetition) const {
  std::vector<Point> out;
  for (const std::string& name : request_.caches)
    for (const bool is_held : {false, true}) out.push_back({&find_cache(name), is_held});
  Pcg32 random(hash_keys(request_.seed, repetition, 11));
  std::shuffle(out.begin(), out.end(), random);
  return out;
}

std::string Preempt::name_of(const Point& p) const {
  return fmt::format("preempt/{}/{}/threads:{}/{}", request_.workload.name, p.cache->traits.name,
                     request_.threads, p.is_held ? "held" : "free");
}

Entry Preempt::run(const Point& point, unsigned repetition) {
  // Held or not, thread 0 is the victim and keeps an account like all others: only the holds differ.
  std::optional<HeldThread> held;
  if (point.is_held) held.emplace(request_.hold_ms);
  std::vector<ThreadAccount> accounts;
  accounts.reserve(request_.threads);
  for (unsigned t = 0; t < request_.threads; ++t)
    accounts.emplace_back(tick_rate_, 0, held ? &*held : nullptr, held.has_value() && t == 0);
  TrialSetup setup{*team_, work_, repetition_seed(request_.seed, repetition), 1};
  setup.accounts = accounts;
  setup.latencies_from = 1;
  std::thread holder;
  if (held)
    holder = std::thread(
        [&] { hold_again_and_again(*held, request_.pause_ms, hash_keys(request_.seed, repetition, 12)); });
  struct Joined {
    std::thread& thread;
    HeldThread* held;
    ~Joined() {
      if (!thread.joinable()) return;
      held->ended();  // if no thread of the team came so far
      thread.join();
    }
  };
  const TrialOutcome o = [&] {
    const Joined joined{holder, held ? &*held : nullptr};
    return point.cache->synthetic(*plan_, setup);
  }();
  if (!o.error.empty())
    throw InvalidTrial(fmt::format("{} (repetition {}): {}", name_of(point), repetition, o.error));

  double others_ns = 0.0;
  for (unsigned t = 1; t < request_.threads; ++t)
    others_ns += tick_rate_.to_ns(accounts[t].thread_ticks().sum());
  const std::uint64_t half = static_cast<std::uint64_t>(0.5e6 * request_.hold_ms / tick_rate_.ns_per_tick);
  const double stalled_ns = tick_rate_.to_ns(o.query_ticks.sum_above(half) + o.insert_ticks.sum_above(half));

  Entry entry = entry_of(name_of(point), request_.repetitions, repetition, request_.threads, o);
  auto& c = entry.counters;
  add_subject(c, point.cache, request_.workload);
  c["placement"] = to_string(request_.placement);
  c["oversubscribed"] = topology_.oversubscribed(request_.threads);
  c["held"] = point.is_held;
  c["hold_ms"] = request_.hold_ms;
  c["holds"] = held ? held->holds() : 0;
  c["held_ms"] = held ? 1e-6 * held->held_ns() : 0.0;
  c["found_between_operations"] = held ? held->missed() : 0;
  // While the others ran: with a thread that is held the trial as a whole takes longer in any case.
  std::int64_t begin = o.threads.at(1).begin_ns, end = begin;
  for (unsigned t = 1; t < request_.threads; ++t) {
    begin = std::min(begin, o.threads[t].begin_ns);
    end = std::max(end, o.threads[t].end_ns);
  }
  c["others_operations_per_second"] = 1e9 *
                                      static_cast<double>(o.query_ticks.count() + o.insert_ticks.count()) /
                                      std::max(1.0, static_cast<double>(end - begin));
  c["stalled_share"] = std::min(1.0, stalled_ns / others_ns);
  add_latency(c, "query", o.query_ticks, tick_rate_);
  add_latency(c, "insert", o.insert_ticks, tick_rate_);
  return entry;
}

}  // namespace icbench
