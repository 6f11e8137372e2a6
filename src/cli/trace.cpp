// icbench trace: captures what a render asks of its cache, tells what a trace holds, and replays it against any cache.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <utility>

#include "cli/cache_list.h"
#include "cli/command.h"
#include "cli/frame_options.h"
#include "cli/options.h"
#include "files/json_file.h"
#include "harness/environment.h"
#include "harness/progress.h"
#include "harness/statistics.h"
#include "workload/names.h"
#include "workload/sweep.h"
#include "workload/trace_capture.h"

namespace icbench {
namespace {

double share(std::uint64_t part, std::uint64_t of) {
  return of == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(of);
}

// ---- capture

struct CaptureOptions : FrameOptions {
  std::string out = "render.trace";
  std::uint32_t frames = 1;
};

TraceContext context_of(const CaptureOptions& o, const FrameRequest& r) {
  TraceContext c;
  c.scene = o.scene;
  c.integrator = o.integrator;
  c.interpolation = o.interpolation;
  c.cache = o.cache;
  c.width = static_cast<std::uint32_t>(r.width);
  c.height = static_cast<std::uint32_t>(r.height);
  c.spp = r.spp;
  (r.integrator.uses_vpls ? c.vpls : c.rays) = r.integrator.uses_vpls ? r.vpls : r.gather;
  c.seed = r.seed;
  c.config = cache_config(r, r.team.size());
  return c;
}

void capture_command(const CaptureOptions& o) {
  require_apart({{"--out", o.out}, {"--json", o.json}}, {{"--scene", o.scene}});
  require_writable("--out", o.out);
  if (!find_integrator(o.integrator).needs_cache()) {
    throw std::runtime_error(fmt::format(
        "--integrator {}: it uses no cache, so there is nothing to capture; irradiance_cache does",
        o.integrator));
  }
  FrameSetup setup(o);
  FrameRequest& request = setup.request();
  TraceWriter writer(o.out, context_of(o, request));
  TraceRecorder recorder(request.team.size(), std::uint64_t{request.spp} *
                                                  static_cast<std::uint64_t>(request.width) *
                                                  static_cast<std::uint64_t>(request.height));
  request.trace = &recorder;
  setup.tell_notes();
  Progress progress("capture", o.frames * frame_work(request));
  request.progress = [&](double work) { progress.advance(work); };
  FrameRenderer renderer(request);
  double seconds = 0.0;
  nlohmann::ordered_json per_frame = nlohmann::ordered_json::array();
  for (std::uint32_t frame = 0; frame < o.frames; ++frame) {
    const FrameCost cost = renderer.render(frame);
    writer.add(recorder.frame(frame, [&](const auto& f) { renderer.for_each_record(f); }));
    add_cost(per_frame.emplace_back(nlohmann::ordered_json{{"frame", frame}}), request.integrator, cost);
    seconds += cost.seconds;
  }
  writer.finish();
  const double bytes_per_query = share(writer.bytes(), writer.operations());
  nlohmann::ordered_json json = setup.asked();
  json["frame_count"] = o.frames;
  json["queries"] = writer.operations();
  json["records_made"] = writer.records();
  json["trace_bytes"] = writer.bytes();
  json["bytes_per_query"] = bytes_per_query;
  json["seconds"] = seconds;
  json["frames"] = std::move(per_frame);
  if (!o.json.empty()) write_json(o.json, json);
  if (!tells_figures(o.json)) return;
  fmt::print("{}: {} queries, {} records made, {} frame{} in {:.2f} s; {:.1f} bytes a query\n", o.out,
             writer.operations(), writer.records(), o.frames, o.frames == 1 ? "" : "s", seconds,
             bytes_per_query);
}

// ---- info

struct InfoOptions {
  std::string file, json;
};

void info_command(const InfoOptions& o) {
  require_apart({{"--json", o.json}}, {{"the trace", o.file}});
  if (!o.json.empty()) require_writable("--json", o.json);
  const Trace trace = read_trace(o.file);
  const TraceContext& c = trace.context;
  std::uint64_t made = 0, refused = 0, cost = 0;
  std::vector<std::uint64_t> costs;
  for (const std::uint32_t place : trace.made) {
    if (place == Trace::kHit) continue;
    const TracedRecord& r = trace.records[place];
    ++made;
    refused += r.result != InsertResult::inserted;
    cost += r.cost_ns;
    costs.push_back(r.cost_ns);
  }
  std::sort(costs.begin(), costs.end());
  const auto cost_us = [&](double q) {
    if (costs.empty()) return 0.0;
    const auto rank = static_cast<std::size_t>(q * static_cast<double>(costs.size() - 1) + 0.5);
    return 1e-3 * static_cast<double>(costs[rank]);
  };
  const std::uint64_t queries = trace.points.size(), hits = queries - made;
  nlohmann::ordered_json j = {{"file", o.file},
                              {"scene", c.scene},
                              {"integrator", c.integrator},
                              {"interpolation", c.interpolation},
                              {"cache", c.cache},
                              {"threads", c.config.max_sessions},
                              {"width", c.width},
                              {"height", c.height},
                              {"spp", c.spp},
                              {"seed", c.seed},
                              {"cache_accuracy", shortest_decimal(c.config.a)},
                              {"cache_accuracy_max", shortest_decimal(c.config.a_max)},
                              {"capacity", c.config.capacity},
                              {c.vpls != 0 ? "vpls" : "rays_per_record", c.vpls != 0 ? c.vpls : c.rays},
                              {"queries", queries},
                              {"hits", hits},
                              {"records_made", made},
                              {"records_refused", refused},
                              {"record_cost_p50_us", cost_us(0.5)},
                              {"record_cost_p99_us", cost_us(0.99)},
                              {"record_cost_max_us", cost_us(1.0)},
                              {"record_cost_seconds", 1e-9 * static_cast<double>(cost)},
                              {"trace_bytes", trace.bytes},
                              {"bytes_per_query", share(trace.bytes, queries)},
                              {"checksum", fmt::format("{:016x}", trace.checksum)}};
  for (int end = 0; end < 2; ++end) {
    const glm::vec3& corner = end == 0 ? c.config.bounds.lower : c.config.bounds.upper;
    j[end == 0 ? "bounds_lower" : "bounds_upper"] = {shortest_decimal(corner.x), shortest_decimal(corner.y),
                                                     shortest_decimal(corner.z)};
  }
  constexpr std::string_view kStarts[] = {"records stay", "records go", "records are replaced"};
  std::map<FrameStart, std::size_t> starts;
  for (const Trace::Frame& f : trace.frames) {
    ++starts[f.start];
    j["frames"].push_back({{"frame", f.number},
                           {"begins", kStarts[static_cast<std::size_t>(f.start)]},
                           {"passes", f.segments.end - f.segments.begin},
                           {"records", f.stored},
                           {"records_digest", fmt::format("{:016x}", f.digest)}});
  }
  if (!o.json.empty()) write_json(o.json, j);
  if (!tells_figures(o.json)) return;
  fmt::print("{}: {} by {}, {}x{} at {} spp, {} frame{}; captured with {}, {} thread{}\n", o.file, c.scene,
             c.integrator, c.width, c.height, c.spp, trace.frames.size(), trace.frames.size() == 1 ? "" : "s",
             c.cache, c.config.max_sessions, c.config.max_sessions == 1 ? "" : "s");
  for (const auto& [start, n] : starts)
    fmt::print("  {} of {} frames begin: {}\n", n, trace.frames.size(),
               kStarts[static_cast<std::size_t>(start)]);
  fmt::print("  queries       {:>12}   answered {:.2f} %\n", queries, 100.0 * share(hits, queries));
  fmt::print("  records made  {:>12}   refused {}\n", made, refused);
  fmt::print("  their cost    {:>9.1f} us   at the median; p99 {:.1f}, most {:.1f}; in all {:.3f} s\n",
             cost_us(0.5), cost_us(0.99), cost_us(1.0), 1e-9 * static_cast<double>(cost));
  fmt::print("  bytes         {:>12}   {:.2f} a query, records and all\n", trace.bytes,
             share(trace.bytes, queries));
}

// ---- replay

struct ReplayOptions {
  std::string file, caches = "packed_wait_free", placement = "compact", json;
  std::vector<unsigned> threads;
  double scale = 1.0;
  bool as_captured = false;
  unsigned repetitions = 3;
  std::uint64_t seed = 1;
  std::uint32_t latency_every = 16;
};

double parse_scale(const std::string& text) {
  const std::optional<double> scale = number_of<double>(text);
  if (!scale || !(*scale >= 0.0 && *scale <= 1e6))
    throw std::runtime_error(fmt::format("--scale '{}' is not a number from 0 to 1e6", text));
  return *scale;
}

SweepRequest request_of(const ReplayOptions& o, const Topology& topology) {
  SweepRequest request;
  request.workloads.push_back(trace_workload(o.file, o.scale, o.as_captured));
  request.caches = names_of(caches_of(o.caches));
  request.threads = o.threads;
  if (request.threads.empty()) request.threads = {static_cast<unsigned>(topology.units().size())};
  request.placement = parse_placement(o.placement);
  request.repetitions = o.repetitions;
  request.seed = o.seed;
  request.latency_every = o.latency_every;
  return request;
}

void print(const SweepPoint& point, const std::vector<Entry>& repetitions) {
  std::vector<double> ms;
  bool same = true;
  for (const Entry& e : repetitions) {
    ms.push_back(e.real_time);
    same = same && e.counters["same_records"].get<bool>();
  }
  const auto counted = [&](const char* name) {
    std::vector<double> all;
    for (const Entry& e : repetitions) all.push_back(e.counters.value(name, 0.0));
    return median(all);
  };
  fmt::print(
      "{:<26} {:>3} thread{} {:>10.2f} ms  {:>9.0f} queries  {:>8.0f} records  {:>6.0f} redundant  {}\n",
      point.cache_name(), point.threads, point.threads == 1 ? " " : "s", median(ms), counted("queries"),
      counted("records"), counted("redundant_records"),
      same ? "the render's records" : "other records than the render's");
}

void replay_command(const ReplayOptions& o) {
  require_apart({{"--json", o.json}}, {{"the trace", o.file}});
  if (!o.json.empty()) require_writable("--json", o.json);
  const Topology topology = Topology::of_this_process();
  const SweepRequest request = request_of(o, topology);
  Sweep sweep(request, topology);
  std::unique_ptr<ResultsWriter> results;
  if (!o.json.empty()) {
    RunInfo info;
    info.command_line = command_line();
    info.seed = o.seed;
    info.placement = request.placement;
    info.thread_counts = request.threads;
    nlohmann::ordered_json context = environment(topology, info);
    context["work_calibration"] = sweep.work().calibration().to_json();
    context["tick_rate"] = sweep.tick_rate().to_json();
    const nlohmann::ordered_json configuration = {
        {"command", "trace replay"},
        {"trace", key_text(sweep.request().workloads.front().checksum)},
        {"workload", request.workloads.front().name},
        {"caches", request.caches},
        {"threads", request.threads},
        {"placement", to_string(request.placement)},
        {"repetitions", request.repetitions},
        {"seed", request.seed},
        {"latency_every", request.latency_every}};
    results = std::make_unique<ResultsWriter>(o.json, context, configuration);
  }
  std::map<std::string, std::vector<Entry>> rows;
  bool warm = false;
  for (unsigned repetition = 0; repetition < request.repetitions; ++repetition) {
    for (const SweepPoint& point : sweep.points(0, repetition)) {
      try {
        if (!std::exchange(warm, true)) sweep.run(point, repetition);  // the first trial runs cold
        Entry entry = sweep.run(point, repetition);
        if (results) results->add(entry);
        rows[entry.name].push_back(std::move(entry));
      } catch (const InvalidTrial& e) {
        throw CheckFailed(e.what());
      }
    }
  }
  if (results) results->finish();
  if (!tells_figures(o.json)) return;
  for (const std::string& cache : request.caches) {
    for (const unsigned threads : request.threads) {
      const SweepPoint point{0, &find_cache(cache), threads};
      const auto at = rows.find(sweep.name_of(point));
      if (at != rows.end()) print(point, at->second);
    }
  }
}

void add_capture(CLI::App& trace) {
  const auto o = std::make_shared<CaptureOptions>();
  CLI::App* capture = trace.add_subcommand("capture", "Render, and keep what was asked of the cache");
  add_frame_options(capture, *o);
  // Pictures are not kept, those in waves ask by no thread of their own, and hash cells ask no cache.
  for (const char* name : {"--exposure", "--deterministic", "--cell-size", "--paths"})
    capture->remove_option(capture->get_option(name));
  add_whole(capture, "--frames", o->frames, 1u, 1u << 24, "Frames from 0 on, one after the other");
  capture->add_option("--out", o->out, "The trace; it appears when it is whole")
      ->type_name("FILE")
      ->capture_default_str();
  capture->callback([o] { capture_command(*o); });
}

void add_info(CLI::App& trace) {
  const auto o = std::make_shared<InfoOptions>();
  CLI::App* info = trace.add_subcommand("info", "Tell what a trace holds");
  info->add_option("file", o->file, "The trace")->type_name("FILE")->required();
  add_file(info, "--json", o->json, "Also write it to this file, frame by frame");
  info->callback([o] { info_command(*o); });
}

void add_replay(CLI::App& trace) {
  const auto o = std::make_shared<ReplayOptions>();
  CLI::App* replay = trace.add_subcommand("replay", "Ask any cache what a render asked, without rays");
  replay->add_option("file", o->file, "The trace")->type_name("FILE")->required();
  replay
      ->add_option("--caches,--cache", o->caches,
                   "Caches, separated by commas; all leaves out brute_force; see\nicbench list caches")
      ->type_name("LIST")
      ->capture_default_str();
  replay
      ->add_option_function<std::string>(
          "--threads", [o](const std::string& text) { o->threads = parse_threads(text); },
          "Thread counts, separated by commas (default: one a processing\nunit)")
      ->type_name("LIST");
  replay->add_option("--placement", o->placement, "How threads are pinned: compact, scatter or none")
      ->capture_default_str();
  replay
      ->add_option_function<std::string>(
          "--scale", [o](const std::string& text) { o->scale = parse_scale(text); },
          "Times the time that records took: 1 as in the render, 0 none")
      ->type_name("X")
      ->default_str("1");
  replay->add_flag(
      "--as-captured", o->as_captured,
      "Make records where the render made them, and nowhere else,\nwhatever queries answer: leaves the "
      "render's records with any\nnumber of threads");
  add_whole(replay, "--repetitions", o->repetitions, 1u, 100'000u, "Repetitions; medians are printed");
  add_whole(replay, "--seed", o->seed, std::uint64_t{0}, ~std::uint64_t{0},
            "Of the order of caches, and of which operations are timed");
  add_whole(replay, "--latency-every", o->latency_every, 0u, 1u << 30,
            "Time one operation in so many; 1 times all, 0 none");
  add_file(replay, "--json", o->json, "Also write rows like those of a sweep to this file");
  replay->callback([o] { replay_command(*o); });
}

}  // namespace

void add_trace(CLI::App& app) {
  CLI::App* trace = app.add_subcommand("trace", "Capture what renders ask of a cache, and replay it");
  add_capture(*trace);
  add_info(*trace);
  add_replay(*trace);
  trace->callback([trace] {
    if (trace->get_subcommands().empty())
      throw std::runtime_error("trace: say what to do, capture, info or replay; see icbench trace --help");
  });
}

}  // namespace icbench
