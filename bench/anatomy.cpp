// Takes a query apart: what it costs in one structure after another, each with one thing more than the last, and what
// each has to read for it. One thread, read-only; for why the packed octree is faster than Ward's, and what is left.
//
//   wait_free         Ward's structure: a record is stored once, so a query looks into all cells whose records may
//                     reach it
//   replicated        copies of whole records in all cells that they reach, so that a query looks along one path
//   packed_scalar     packed_wait_free without vectors: copies of 8 bytes, whole records for what they leave
//   packed_wait_free  with vectors
//   packed_batch      the same, 16 queries under way at once
//   packed_frozen     what is left when nothing can change any more
//   told              what is left when the valid records are known beforehand
//
// Beside it the latency of memory, what a load costs that waits for the one before, in blocks of several sizes: from
// the smallest it is that of a near cache, from the largest that of memory itself; and two roofs over whatever one
// thread does: the lines a nanosecond that memory gives it, and the instructions a nanosecond that it executes.
//
// Results go to a file in Google Benchmark's format: real_time is the wall time of a repetition, ns_per_query what
// counts. Of the structures of the caches it also says, as means over all points: cache_lines of the structure that a
// query reads, lists that it looks into, items (records, or copies) that it tests there, records_read whole, and how
// many of them are valid; and, for one point, which records these are (`example`). Of memory: block_bytes, ns_per_load;
// of the roofs lines_per_ns, instructions_per_ns.
//
// --counting measures no time: it asks every structure the same queries once, for bench/instructions to count what they
// execute.
//
// Exit status: 0 done, 2 bad usage.
#include <fmt/format.h>
#include <tbb/global_control.h>
#include <valgrind/callgrind.h>

#include <CLI/CLI.hpp>
#include <numeric>
#include <unordered_set>

#include "cli/options.h"
#include "files/standard_streams.h"
#include "harness/environment.h"
#include "harness/progress.h"
#include "harness/results.h"
#include "roofs.h"
#include "rows/read_only_structures.h"

namespace icbench {
namespace {

using Json = nlohmann::ordered_json;

/// What queries to a structure of NotedSync have read since the last start.
struct Noted {
  std::unordered_set<std::uintptr_t> lines;
  std::uint64_t lists = 0, items = 0;
  std::vector<const Record*> records;  // each once; they stay where they are while their structure lives

  void start() {
    lines.clear();
    lists = items = 0;
    records.clear();
  }
  void reads(const void* memory, std::size_t bytes) {
    constexpr std::uintptr_t kLine = 64;
    const auto first = reinterpret_cast<std::uintptr_t>(memory);
    for (std::uintptr_t line = first / kLine; line <= (first + bytes - 1) / kLine; ++line) lines.insert(line);
    // Lanes of padding show a record again.
    const auto* record = static_cast<const Record*>(memory);
    if (bytes == sizeof(Record) && std::find(records.begin(), records.end(), record) == records.end())
      records.push_back(record);
  }
  void extent(std::uint32_t n) {
    ++lists;
    items += n;
  }
};
Noted noted;  // one thread

template <class T>
class NotedAtomic : public PlainAtomic<T> {
 public:
  using PlainAtomic<T>::PlainAtomic;
  T load(std::memory_order order) const {
    noted.reads(this, sizeof *this);
    return PlainAtomic<T>::load(order);
  }
};

/// Ordinary memory, of which it is noted what is read.
struct NotedSync : NoHooks {
  template <class T>
  using Atomic = NotedAtomic<T>;
  static constexpr bool kConcurrent = false;
  static void reads(const void* memory, std::size_t bytes) { noted.reads(memory, bytes); }
  static void extent(std::uint32_t n) { noted.extent(n); }
};

Json to_json(const glm::vec3& v) { return Json::array({v.x, v.y, v.z}); }

/// Means over the plan's points of what a query to `Structure<NotedSync>` reads, and the whole of it for one point.
template <class Structure>
Json what_is_read(const SyntheticPlan& plan, std::size_t example) {
  Direct<Structure, WithCounters> cache(plan.config(1));
  auto session = cache.open_session(0);
  for (const Record& r : plan.records()) session.insert(r);
  double lines = 0.0, lists = 0.0, items = 0.0;
  const auto ask = [&](const SurfacePoint& x) {
    noted.start();
    session.query(x);
  };
  for (const SurfacePoint& x : plan.points()) {
    ask(x);
    lines += static_cast<double>(noted.lines.size());
    lists += static_cast<double>(noted.lists);
    items += static_cast<double>(noted.items);
  }
  const auto n = static_cast<double>(plan.points().size());
  const Counts counts = cache.counters();
  const SurfacePoint& x = plan.points()[example];
  ask(x);
  Json read = Json::array();
  for (const Record* r : noted.records)
    read.push_back(Json{{"p", to_json(r->p)},
                        {"radius", r->R},
                        {"valid", split_sphere_weight(x, *r, plan.config(1).a) > 0.0f}});
  return Json{{"cache_lines", lines / n},
              {"lists", lists / n},
              {"items", items / n},
              {"records_read", static_cast<double>(counts.records_read) / n},
              {"records_valid", static_cast<double>(counts.records_valid) / n},
              {"bytes_per_record",
               static_cast<double>(cache.memory_bytes()) / static_cast<double>(plan.records().size())},
              {"example", Json{{"p", to_json(x.p)},
                               {"n", to_json(x.n)},
                               {"accuracy", plan.config(1).a},
                               {"cache_lines", noted.lines.size()},
                               {"lists", noted.lists},
                               {"items", noted.items},
                               {"records", read}}}};
}

/// The point whose query reads as many records of Ward's structure as the median.
std::size_t usual_point(const SyntheticPlan& plan) {
  Direct<WardTree<NotedSync>> cache(plan.config(1));
  auto session = cache.open_session(0);
  for (const Record& r : plan.records()) session.insert(r);
  constexpr std::size_t kTried = 1001;
  std::vector<std::pair<std::size_t, std::size_t>> read;
  for (std::size_t i = 0; i < std::min(kTried, plan.points().size()); ++i) {
    noted.start();
    session.query(plan.points()[i]);
    read.emplace_back(noted.records.size(), i);
  }
  std::nth_element(read.begin(), read.begin() + static_cast<std::ptrdiff_t>(read.size() / 2), read.end());
  return read[read.size() / 2].second;
}

/// One of the structures that are compared.
class Part {
 public:
  explicit Part(std::string name) : name_(std::move(name)) {}
  virtual ~Part() = default;
  const std::string& name() const noexcept { return name_; }
  /// At so many points from number `first` on, round and round.
  virtual void ask(std::uint32_t first, std::uint32_t queries) = 0;
  double checksum() const noexcept { return checksum_; }

 protected:
  double checksum_ = 0.0;

 private:
  std::string name_;
};

template <class Cache>
class Single : public Part {
 public:
  Single(std::string name, const SyntheticPlan& plan)
      : Part(std::move(name)), points_(plan.points()), cache_(plan) {}
  void ask(std::uint32_t first, std::uint32_t queries) override {
    auto&& session = cache_.session();
    ask_queries(session, points_, first, queries, checksum_);
  }

 private:
  std::span<const SurfacePoint> points_;
  Filled<Cache> cache_;
};

/// ask_queries asks for one point after the other: it is given the answers of batches.
template <class Cache>
class Batched : public Part {
 public:
  Batched(std::string name, const SyntheticPlan& plan)
      : Part(std::move(name)), points_(plan.points()), cache_(plan) {}
  void ask(std::uint32_t first, std::uint32_t queries) override {
    auto&& session = cache_.session();
    InBatches asked{session, points_, {}, 0};
    ask_queries(asked, points_, first, queries, checksum_);
  }

 private:
  using Session = std::remove_cvref_t<decltype(std::declval<Filled<Cache>&>().session())>;
  struct InBatches {
    Session& session;
    std::span<const SurfacePoint> points;
    std::array<std::optional<Irradiance>, 64> answers;
    std::size_t left;

    std::optional<Irradiance> query(const SurfacePoint& x) {
      if (left == 0) {
        const auto at = static_cast<std::size_t>(&x - points.data());
        left = std::min(answers.size(), points.size() - at);
        session.query_batch(points.subspan(at, left), std::span(answers).first(left));
        std::reverse(answers.begin(), answers.begin() + static_cast<std::ptrdiff_t>(left));
      }
      return answers[--left];
    }
  };

  std::span<const SurfacePoint> points_;
  Filled<Cache> cache_;
};

struct Options {
  std::string out = "anatomy.json", scene = "cornell_box";
  std::uint32_t records = 100'000;
  unsigned repetitions = 25;
  std::uint64_t seed = 1;
  bool counting = false;
};

struct Order {
  std::string_view name, workload;

  SyntheticPlan plan(const Options& o, const RayTracer& rays) const {
    return SyntheticPlan(parse_workload(fmt::format("{}:records={}", workload, o.records)), rays, o.seed);
  }
};
constexpr Order kOrders[] = {{"random", "read_only"}, {"coherent", "read_only:order=coherent"}};

/// What is compared, each with the records of `plan` in it.
std::vector<std::unique_ptr<Part>> all_parts(const SyntheticPlan& plan) {
  using PackedScalar = Direct<Packed<StdSync, AtFirstSight, ScalarLanes>>;
  std::vector<std::unique_ptr<Part>> parts;
  parts.push_back(std::make_unique<Single<WaitFree<>>>("wait_free", plan));
  parts.push_back(std::make_unique<Single<ReplicatedOctree>>("replicated", plan));
  parts.push_back(std::make_unique<Single<PackedScalar>>("packed_scalar", plan));
  parts.push_back(std::make_unique<Single<PackedWaitFree<>>>("packed_wait_free", plan));
  parts.push_back(std::make_unique<Batched<PackedWaitFree<>>>("packed_batch", plan));
  parts.push_back(std::make_unique<Single<PackedFrozen>>("packed_frozen", plan));
  parts.push_back(std::make_unique<Single<ToldRecords>>("told", plan));
  return parts;
}

void check(double checksum) {
  if (!std::isfinite(checksum)) throw std::runtime_error("a query answered with what is no number");
}

constexpr std::size_t kBlocks[] = {1u << 20, 4u << 20, 16u << 20, 64u << 20, 256u << 20};

/// A row of what the machine does while nothing is asked: `items` in `ns`.
void add_row(ResultsWriter& results, const Options& o, std::string name, unsigned repetition, double ns,
             double items, Json counters) {
  Entry entry;
  entry.name = std::move(name);
  entry.repetitions = o.repetitions;
  entry.repetition_index = repetition;
  entry.real_time = entry.cpu_time = ns * 1e-6;
  entry.items_per_second = 1e9 * items / ns;
  entry.counters = std::move(counters);
  results.add(entry);
}

/// What a load costs in blocks of each size.
void measure_memory(const Options& o, ResultsWriter& results) {
  for (const std::size_t bytes : kBlocks) {
    PointerChase chase(bytes, hash_keys(o.seed, 18));
    std::vector<double> ns;
    for (unsigned repetition = 0; repetition < o.repetitions; ++repetition) {
      ns.push_back(chase.ns_per_load());
      add_row(results, o, fmt::format("anatomy/memory/{}MiB", bytes >> 20), repetition,
              ns.back() * PointerChase::kLoads, PointerChase::kLoads,
              Json{{"block_bytes", bytes}, {"ns_per_load", ns.back()}});
    }
    if (chase.at() >= bytes / PointerChase::kLineBytes)
      throw std::runtime_error("a chase through memory has left it");
    fmt::print(tables_stream(o.out), "{:<10} {:<18} {:>9.1f} ns a load\n", "memory",
               fmt::format("{} MiB", bytes >> 20), median(ns));
  }
}

/// What one thread gets at most: cache lines from a block that no cache holds, and instructions.
void measure_roofs(const Options& o, ResultsWriter& results) {
  ScatteredLoads loads(kBlocks[std::size(kBlocks) - 1]);
  std::vector<double> lines, instructions;
  for (unsigned repetition = 0; repetition < o.repetitions; ++repetition) {
    lines.push_back(loads.lines_per_ns());
    instructions.push_back(instructions_per_ns());
    add_row(results, o, "anatomy/roof/lines", repetition, ScatteredLoads::kLoads / lines.back(),
            ScatteredLoads::kLoads, Json{{"lines_per_ns", lines.back()}});
    add_row(results, o, "anatomy/roof/instructions", repetition, kRoofInstructions / instructions.back(),
            kRoofInstructions, Json{{"instructions_per_ns", instructions.back()}});
  }
  if (loads.sum() == 0) throw std::runtime_error("loads from memory found nothing");
  fmt::print(tables_stream(o.out), "{:<10} {:<18} {:>9.3f} a ns\n{:<10} {:<18} {:>9.2f} a ns\n", "roof",
             "lines", median(lines), "roof", "instructions", median(instructions));
}

void run(const Options& o, const std::vector<std::string>& command_line) {
  require_apart({{"--out", o.out}}, {{"--scene", o.scene}});
  const Topology topology = Topology::of_this_process();
  RunInfo info;
  info.command_line = command_line;
  info.seed = o.seed;
  info.thread_counts = {1};
  const Json context = environment(topology, info);
  const RayTracer rays(make_scene(o.scene));  // before results are touched: a scene may be refused
  ResultsWriter results(o.out, context,
                        Json{{"command", "anatomy"},
                             {"scene", o.scene},
                             {"records", o.records},
                             {"repetitions", o.repetitions},
                             {"seed", o.seed},
                             {"environment", environment_identity(context)}});
  const Work work = Work::calibrate();
  const Machine machine{topology, work, o.seed};
  machine.bind();
  Progress progress("anatomy", static_cast<double>(1 + std::size(kOrders) * (o.repetitions + 1)));
  measure_memory(o, results);
  measure_roofs(o, results);
  progress.advance(1.0, "memory");
  fmt::print(tables_stream(o.out), "{:<10} {:<18} {:>9} {:>12} {:>8} {:>14}\n", "points", "structure",
             "ns/query", "cache lines", "tested", "records read");
  for (const Order& order : kOrders) {
    const SyntheticPlan plan = order.plan(o, rays);
    const std::size_t example = usual_point(plan);
    const std::vector<std::unique_ptr<Part>> parts = all_parts(plan);
    std::map<std::string, Json> read;
    read["wait_free"] = what_is_read<WardTree<NotedSync>>(plan, example);
    read["packed_wait_free"] = read["packed_scalar"] =
        what_is_read<Packed<NotedSync, AtFirstSight, ScalarLanes>>(plan, example);
    progress.advance(1.0, order.name);

    std::map<std::string, std::vector<double>> ns;
    Pcg32 random(hash_keys(o.seed, 17));
    std::vector<std::size_t> turn(parts.size());
    std::iota(turn.begin(), turn.end(), std::size_t{0});
    for (unsigned repetition = 0; repetition < o.repetitions; ++repetition) {
      std::shuffle(turn.begin(), turn.end(), random);
      const std::uint32_t first = random.below(static_cast<std::uint32_t>(plan.points().size()));
      for (const std::size_t i : turn) {
        Part& part = *parts[i];
        part.ask(first, kQueriesBefore);
        const auto next = static_cast<std::uint32_t>((first + kQueriesBefore) % plan.points().size());
        const double wall = seconds([&] { part.ask(next, kTimedQueries); });
        const double each = wall / kTimedQueries * 1e9;
        ns[part.name()].push_back(each);
        Entry entry;
        entry.name = fmt::format("anatomy/{}/{}", order.name, part.name());
        entry.repetitions = o.repetitions;
        entry.repetition_index = repetition;
        entry.real_time = entry.cpu_time = wall * 1e3;
        entry.items_per_second = kTimedQueries / wall;
        entry.counters = Json{{"part", part.name()},
                              {"points", order.name},
                              {"records", plan.records().size()},
                              {"ns_per_query", each}};
        // The same for all repetitions: told once.
        if (const auto at = read.find(part.name()); repetition == 0 && at != read.end())
          entry.counters.update(at->second);
        results.add(entry);
      }
      progress.advance(1.0, order.name);
    }
    double checksum = 0.0;
    for (const auto& part : parts) {
      checksum += part->checksum();
      const auto at = read.find(part->name());
      const auto figure = [&](const char* field) {
        return at == read.end() ? std::string("-")
                                : fmt::format("{:.1f}", at->second.at(field).get<double>());
      };
      fmt::print(tables_stream(o.out), "{:<10} {:<18} {:>9.0f} {:>12} {:>8} {:>14}\n", order.name,
                 part->name(), median(ns[part->name()]), figure("cache_lines"), figure("items"),
                 figure("records_read"));
    }
    check(checksum);
  }
  results.finish();
  progress.finish();
}

/// Has callgrind count what the queries to each structure execute, into a file each, and says which these are, in their
/// order. It looks at nothing else, which would take it too long.
void count(const Options& o) {
  if (!RUNNING_ON_VALGRIND) throw std::runtime_error("nobody counts: call bench/instructions");
  // callgrind counts what all threads do: workers that look for work are none of a query.
  const tbb::global_control alone(tbb::global_control::max_allowed_parallelism, 1);
  const RayTracer rays(make_scene(o.scene));
  for (const Order& order : kOrders) {
    const SyntheticPlan plan = order.plan(o, rays);
    for (const auto& part : all_parts(plan)) {
      CALLGRIND_START_INSTRUMENTATION;
      part->ask(0, kQueriesBefore);
      CALLGRIND_ZERO_STATS;
      part->ask(static_cast<std::uint32_t>(kQueriesBefore % plan.points().size()), kTimedQueries);
      CALLGRIND_DUMP_STATS;
      CALLGRIND_STOP_INSTRUMENTATION;
      check(part->checksum());
      fmt::print("{} {} {}\n", order.name, part->name(), kTimedQueries);
    }
  }
}

}  // namespace
}  // namespace icbench

int main(int argc, char** argv) {
  icbench::occupy_standard_streams();
  icbench::survive_file_size_limits();
  icbench::Options o;
  CLI::App app{"Takes a query apart: what it costs in one structure after another, and what it reads",
               "anatomy"};
  app.add_option("--out,--json", o.out, "Results (JSON); written as the work goes on")->capture_default_str();
  app.add_option("--scene", o.scene, "Where the points lie: a scene of the suite, or a file")
      ->capture_default_str();
  icbench::add_whole(&app, "--records", o.records, 1000u, 10'000'000u, "Records in the caches");
  icbench::add_whole(&app, "--repetitions", o.repetitions, 1u, 100'000u,
                     "Times that each structure is asked, in random order");
  icbench::add_whole(&app, "--seed", o.seed, std::uint64_t{0}, ~std::uint64_t{0},
                     "Seed of all random numbers");
  app.add_flag("--counting", o.counting, "Measure no time: ask each structure once, for bench/instructions");
  try {
    app.parse(argc, argv);
    for (const char* const option : {"--out", "--repetitions"})
      if (o.counting && app.count(option) > 0)
        icbench::tell_without_effect("anatomy", option, "with --counting");
    o.counting ? icbench::count(o) : icbench::run(o, {argv, argv + argc});
    return icbench::status_of_output("anatomy", 0);
  } catch (const CLI::Success& e) {
    return icbench::status_of_output("anatomy", app.exit(e));
  } catch (const std::exception& e) {
    icbench::tell("anatomy: {}\n", icbench::line_of(e));
    return 2;
  }
}
