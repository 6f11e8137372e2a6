// What a reader pays while others write: median latency of a query on one unit while all other units insert at a set
// rate together, linearizable queries against regular ones, and queries against the same with nobody inserting.
//
// The inserts are an open loop. Each has a moment at which it is due, whatever became of those before it; a
// thread that was held up catches up. A sample in which they fell behind the rate does not count.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <vector>

#include "caches/registry.h"
#include "core/random.h"
#include "core/sync.h"
#include "harness/thread_team.h"
#include "harness/ticks.h"
#include "rows/rows.h"
#include "scene/registry.h"
#include "workload/synthetic_plan.h"
#include "workload/validation.h"

namespace icbench {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kSeconds = 0.05;               // of one cache in a sample
constexpr double kEnough = 0.95;                // share of the due inserts that must have been made by then
constexpr std::uint32_t kBlock = 64;            // queries between two looks at the clock
constexpr std::uint32_t kFastest = 20'000'000;  // queries a second for which there is room
constexpr std::size_t kOracleSamples = 8;

/// `Above` while others insert, over `Below` likewise or, if `is_idle_below`, while nobody does.
template <class Above, class Below, bool is_idle_below>
class InsertLatency : public Experiment {
 public:
  InsertLatency(const Machine& machine, std::uint32_t inserts_per_second)
      : rate_(inserts_per_second),
        rays_(make_scene("cornell_box")),
        plan_(workload(inserts_per_second), rays_, machine.seed),
        team_(machine.topology, Placement::compact, machine.units()),
        random_(machine.seed),
        latencies_(static_cast<std::size_t>(kSeconds * kFastest)) {}

  Sample sample() override {
    if (team_.size() < 2) return kSingleUnit;
    const std::uint32_t first = random_.below(static_cast<std::uint32_t>(plan_.points().size()));
    const auto [above, below] = in_turns(
        count_++, [&] { return measure<Above>(first, true); },
        [&] { return measure<Below>(first, !is_idle_below); });
    const double reached = is_idle_below ? above.reached : std::min(above.reached, below.reached);
    if (reached < kEnough) {
      return {0.0,
              fmt::format("the other units made only {:.0f} of {} inserts a second", reached * rate_, rate_)};
    }
    return {above.median_ticks / below.median_ticks};
  }

 private:
  struct Measured {
    double median_ticks = 0.0;
    double reached = 0.0;  // inserts made over inserts due
  };

  /// 10^5 records beforehand, and as many more as come due in a sample.
  static WorkloadSpec workload(std::uint32_t rate) {
    return parse_workload(fmt::format("mix_50_50:records=100000:operations={}", 2 * due_by(kSeconds, rate)));
  }

  static std::uint32_t due_by(double seconds, std::uint32_t rate) {
    return static_cast<std::uint32_t>(seconds * rate);
  }

  template <class Cache>
  Measured measure(std::uint32_t first_point, bool do_insert) {
    const unsigned threads = team_.size();
    Cache cache(plan_.config(threads));
    auto main_session = cache.open_session(0);
    for (std::uint32_t i = 0; i < plan_.prefilled(); ++i) main_session.insert(plan_.records()[i]);
    std::vector<typename Cache::Session> sessions(threads, main_session);
    team_.run([&](unsigned t) {
      if (t == 0) return;
      sessions[t] = cache.open_session(t);
      sessions[t].prefault(due_by(kSeconds, rate_) / (threads - 1) + 1);
    });

    std::vector<Inserted> made(threads);
    std::size_t queries = 0;
    team_.run([&](unsigned t) {
      if (t == 0) {
        queries = ask(sessions[0], first_point);
      } else if (do_insert) {
        made[t] = insert_what_is_due(sessions[t], t - 1, threads - 1);
      }
    });

    std::uint64_t inserted = 0, refused = 0;
    for (const Inserted& m : made) {
      inserted += m.inserted;
      refused += m.refused;
    }
    require_valid(cache, main_session, inserted, refused);
    const auto middle = latencies_.begin() + static_cast<std::ptrdiff_t>(queries / 2);
    std::nth_element(latencies_.begin(), middle, latencies_.begin() + static_cast<std::ptrdiff_t>(queries));
    return {static_cast<double>(*middle), static_cast<double>(inserted) / due_by(kSeconds, rate_)};
  }

  /// Asks for kSeconds, point after point; notes every latency. Returns how many.
  template <class Session>
  std::size_t ask(Session session, std::uint32_t point) noexcept {
    const auto end =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(kSeconds));
    const std::vector<SurfacePoint>& points = plan_.points();
    std::size_t n = 0;
    double sum = 0.0;
    do {
      for (std::uint32_t i = 0; i < kBlock; ++i) {
        const std::uint64_t start = ticks();
        const auto E = session.query(points[point]);
        latencies_[n++] = ticks() - start;
        if (E) sum += E->x;
        if (++point == points.size()) point = 0;
      }
    } while (n + kBlock <= latencies_.size() && Clock::now() < end);
    checksum_ += sum;
    return n;
  }

  struct alignas(kNoSharing) Inserted {
    std::uint64_t inserted = 0;
    std::uint64_t refused = 0;
  };

  /// Inserts every `stride`-th of the records to come when it is due, for kSeconds.
  template <class Session>
  Inserted insert_what_is_due(Session session, std::uint32_t next, std::uint32_t stride) noexcept {
    const std::uint32_t all = due_by(kSeconds, rate_);
    const auto begin = Clock::now();
    Inserted made;
    for (;;) {
      const double passed = std::chrono::duration<double>(Clock::now() - begin).count();
      if (passed >= kSeconds) break;
      if (next >= all || next > passed * rate_) continue;
      const bool stored = session.insert(plan_.records()[plan_.prefilled() + next]) == InsertResult::inserted;
      ++(stored ? made.inserted : made.refused);
      next += stride;
    }
    return made;
  }

  template <class Cache, class Session>
  void require_valid(const Cache& cache, Session& session, std::uint64_t inserted, std::uint64_t refused) {
    if (refused != 0) throw InvalidTrial(fmt::format("{} inserts refused", refused));
    const std::string error = validate_records(
        cache, session, plan_.prefilled() + inserted, sample_points(plan_.points(), kOracleSamples),
        [&](std::uint32_t id) { return id < plan_.records().size() ? &plan_.records()[id] : nullptr; });
    if (!error.empty()) throw InvalidTrial(error);
  }

  std::uint32_t rate_;
  RayTracer rays_;
  SyntheticPlan plan_;
  ThreadTeam team_;
  Pcg32 random_;
  std::vector<std::uint64_t> latencies_;  // ticks; written, and so touched, before the first sample
  unsigned count_ = 0;
  double checksum_ = 0.0;
};

}  // namespace

std::unique_ptr<Experiment> snapshot_latency(const Machine& machine, std::uint32_t inserts_per_second) {
  return std::make_unique<InsertLatency<WaitFreeSnapshot<>, WaitFree<>, false>>(machine, inserts_per_second);
}

std::unique_ptr<Experiment> packed_insert_latency(const Machine& machine, std::uint32_t inserts_per_second) {
  return std::make_unique<InsertLatency<PackedWaitFree<>, PackedWaitFree<>, true>>(machine,
                                                                                   inserts_per_second);
}

}  // namespace icbench
