#include "rows/rows.h"

#include <fmt/format.h>

#include <array>
#include <tuple>
#include <utility>

#include "rows/animations.h"
#include "rows/cached_pictures.h"
#include "simulate/validation.h"

namespace icbench {
namespace {

// What a query waits for strictness while others write.
void add_latencies(std::vector<Row>& rows) {
  std::uint32_t inserts = 1'000;
  for (int power = 3; power <= 6; ++power, inserts *= 10) {
    rows.push_back(
        {fmt::format("snapshot_latency_{}", inserts),
         fmt::format("median latency of a query while all other units insert 10^{} records a second: "
                     "wait_free_snapshot / wait_free (1.15 is this suite's own choice)",
                     power),
         Relation::at_most, 1.15,
         [inserts](const Machine& machine) { return snapshot_latency(machine, inserts); }});
  }
}

// The packed octree against the structure of the thesis, its own parts against each other, and its price.
void add_packed(std::vector<Row>& rows) {
  const auto add = [&](std::string name, std::string what, Relation relation, double target, auto make) {
    rows.push_back({std::move(name), std::move(what), relation, target, make});
  };
  struct Reading {
    std::string_view suffix, words, workload;
    struct Targets {
      double over_ward, over_frozen, over_scalar;
    } targets;
  };
  constexpr Reading kRandom{"", "10^5 records, random points", "read_only", {12.0, 1.25, 3.0}};
  constexpr Reading kCoherent{
      "_coherent", "10^5 records, points of an image", "read_only:order=coherent", {12.0, 1.4, 3.3}};
  constexpr Reading kMillion{
      "_million", "10^6 records, random points", "read_only:records=1000000", {15.0, 1.25, 3.0}};
  constexpr Reading kMillionCoherent{"_million_coherent",
                                     "10^6 records, points of an image",
                                     "read_only:records=1000000:order=coherent",
                                     {15.0, 1.4, 3.3}};
  constexpr std::array kReadings = {kRandom, kCoherent, kMillion, kMillionCoherent};
  const auto add_related = [&](std::string_view name, std::string_view what, const Reading& r,
                               Relation relation, double target, auto make) {
    add(fmt::format("{}{}", name, r.suffix), fmt::format("{}; {}, 1 thread", what, r.words), relation, target,
        [r, make](const Machine& machine) { return make(machine, r.workload); });
  };
  const auto add_reading = [&](std::string_view name, std::string_view what, const Reading& r, double target,
                               auto make) { add_related(name, what, r, Relation::at_least, target, make); };
  for (const Reading& reading : kReadings) {
    add_reading("packed_query_speed", "time of a wait_free query / of a packed_wait_free one", reading,
                reading.targets.over_ward, packed_query_over_ward);
    add_reading("packed_query_bound",
                "time of a wait_free query / of weighing and adding the records that are valid there",
                reading, reading.targets.over_ward, told_query_over_ward);
  }
  for (const Reading& reading : kReadings)
    add_reading("packed_query_replicated",
                "time of a query to a scalar octree of whole records / of a packed_wait_free one", reading,
                3.0, packed_query_over_replicated);
  for (const Reading& reading : kReadings) {
    add_reading("packed_query_tbb_hash_grid", "time of a tbb_hash_grid query / of a packed_wait_free one",
                reading, 1.0, packed_query_over_tbb_hash_grid);
    add_reading(
        "packed_query_append_log",
        "time of an append_log query, all records being in its structure / of a packed_wait_free one; "
        "0.95 is this suite's own choice",
        reading, 0.95, packed_query_over_append_log);
  }
  for (const Reading& reading : kReadings)
    add_related("packed_live_over_frozen",
                "time of a packed_wait_free query / of one to the same records frozen", reading,
                Relation::at_most, reading.targets.over_frozen, packed_query_over_frozen);
  add("packed_insert_latency",
      "median latency of a packed_wait_free query while all other units insert 10^5 records a second / while "
      "they do not",
      Relation::at_most, 1.15,
      [](const Machine& machine) { return packed_insert_latency(machine, 100'000); });
  add("packed_read_only_scaling",
      "read-only throughput of packed_wait_free on all N processing units / N times that on one",
      Relation::at_least, 0.95, packed_read_only_scaling);
  add("packed_frame_share",
      "share of the threads' time of a frame that is spent in packed_wait_free; Cornell box, 256 rays a "
      "record",
      Relation::at_most, 0.03, packed_frame_share);
  const auto add_oversubscribed = [&](std::string_view name, std::string_view what, Relation relation,
                                      double target, Oversubscription figure) {
    add(fmt::format("packed_oversubscribed_{}", name),
        fmt::format("packed_wait_free, mix 90/10, 4 threads a unit: {}", what), relation, target,
        [figure](const Machine& machine) { return packed_oversubscribed(machine, figure); });
  };
  add_oversubscribed("throughput", "throughput / that of a thread a unit", Relation::at_least, 0.95,
                     Oversubscription::throughput);
  add_oversubscribed("slowest", "99.9th percentile of a query / that of a thread a unit", Relation::at_most,
                     1.2, Oversubscription::slowest);
  add_oversubscribed("spread", "99.9th percentile of a query / the median", Relation::at_most, 10.0,
                     Oversubscription::spread);
  for (const Reading& reading : kReadings) {
    add_related("packed_query_over_twin", "time of a packed_wait_free query / of its unsynchronised twin",
                reading, Relation::at_most, 1.05, packed_query_over_twin);
    add_related("packed_snapshot_query",
                "time of a packed_wait_free_snapshot query / of a packed_wait_free one", reading,
                Relation::at_most, 1.08, packed_snapshot_query);
  }
  for (const Reading& reading : kReadings) {
    add_reading("packed_simd_speed", "time of a packed_wait_free query by scalar code / by vectors", reading,
                reading.targets.over_scalar, packed_scalar_over_simd);
    add_reading(
        "packed_simd_kernels",
        "time of the tests of lanes and records in packed_wait_free's queries by scalar code / by vectors",
        reading, reading.targets.over_scalar, packed_scalar_over_vector_kernels);
  }
  // After tidy(): what lies near in space lies near in memory.
  for (const Reading& reading : kReadings) {
    add_reading("packed_tidied_query_speed",
                "time of a wait_free query / of a packed_wait_free one, both tidied", reading,
                reading.targets.over_ward, tidied_query_over_ward);
    add_reading(
        "packed_tidied_query_replicated",
        "time of a query to a scalar octree of whole records, made of them in the order of space / of a "
        "packed_wait_free one, tidied",
        reading, 3.0, tidied_query_over_replicated);
    add_related("packed_tidied_live_over_frozen",
                "time of a packed_wait_free query, tidied / of one to the same records frozen", reading,
                Relation::at_most, reading.targets.over_frozen, tidied_query_over_frozen);
    add_reading("packed_tidied_simd_speed",
                "time of a packed_wait_free query by scalar code / by vectors, both tidied", reading,
                reading.targets.over_scalar, tidied_scalar_over_simd);
    add_reading("packed_tidied_gain",
                "time of a packed_wait_free query / the same, tidied (1 is this suite's own choice)", reading,
                1.0, untidied_query_over_tidied);
  }
  for (const Reading& reading : {kRandom, kMillion})
    add_related("packed_tidy_over_insert",
                "time to tidy packed_wait_free / to insert its records before (3 is this suite's own choice)",
                reading, Relation::at_most, 3.0, packed_tidy_over_insert);
  for (const Reading& reading : kReadings)
    add_reading("packed_batch_speed", "time of single queries of packed_wait_free / of the same in a batch",
                reading, 1.4, packed_single_over_batch);
  for (const auto& [records, words, target] :
       {std::tuple{100'000u, "10^5", 5.0}, std::tuple{1'000'000u, "10^6", 8.0}}) {
    add(fmt::format("packed_insert_over_ward_{}", records),
        fmt::format("time to insert {} records into packed_wait_free / into wait_free; 1 thread", words),
        Relation::at_most, target,
        [records = records](const Machine& machine) { return packed_insert_over_ward(machine, records); });
    add(fmt::format("packed_memory_{}", records),
        fmt::format("bytes a record of packed_wait_free with {} of them / 150", words), Relation::at_most,
        1.0, [records = records](const Machine& machine) { return packed_memory(machine, records); });
    add(fmt::format("packed_memory_resident_{}", records),
        fmt::format("resident bytes a record of packed_wait_free with {} of them, in part taken ahead / 150",
                    words),
        Relation::at_most, 1.0,
        [records = records](const Machine& machine) { return packed_memory_resident(machine, records); });
  }
  add("packed_snapshot_mix",
      "throughput of packed_wait_free_snapshot / of packed_wait_free; mix 90/10 on all processing units",
      Relation::at_least, 0.90, packed_snapshot_mix);
  for (const std::string_view lock :
       {"packed_global_mutex", "packed_global_spin", "packed_queuing_mutex", "packed_shared_mutex",
        "packed_spin_rw_mutex", "packed_distributed_rw", "packed_node_lock"}) {
    add(fmt::format("packed_over_{}", lock.substr(7)),
        fmt::format("miss-driven throughput at 1 us a record, 4 threads a unit: packed_wait_free / {}", lock),
        Relation::at_least, 1.6, [lock](const Machine& machine) { return packed_over_rival(machine, lock); });
  }
  // The rivals as production libraries would build them: a target of this suite's own choice.
  for (const std::string_view rival : {"tbb_hash_grid", "append_log"}) {
    add(fmt::format("packed_over_{}", rival),
        fmt::format("miss-driven throughput at 1 us a record, 4 threads a unit: packed_wait_free / {}",
                    rival),
        Relation::at_least, 1.0,
        [rival](const Machine& machine) { return packed_over_rival(machine, rival); });
  }
}

// The animations' rows: how much of a frame's indirect time is saved by keeping what a motion leaves valid, and whether
// anybody sees it.
void add_animations(std::vector<Row>& rows) {
  constexpr std::string_view kTemporal = "temporal instant caching";
  const auto times = [](const Animation& animation, std::string_view of, std::string_view over) {
    return fmt::format(
        "indirect time of a frame of {} but the first, {} virtual lights, accuracy {}: {} / {}",
        animation.setting.scene, animation.setting.vpls, accuracy_of(animation.setting), of, over);
  };
  for (const Animation& animation : kAnimations) {
    const auto add = [&](std::string_view integrator, std::string_view in_name, std::string_view in_words,
                         double target, std::string_view note = "") {
      rows.push_back({fmt::format("{}_over_tic_{}", in_name, animation.setting.scene),
                      times(animation, in_words, kTemporal) + std::string(note), Relation::at_least, target,
                      [&animation, integrator](const Machine& machine) {
                        return over_temporal(machine, integrator, animation);
                      }});
    };
    add("instant_gi", "igi", "instant global illumination", animation.igi_over_tic);
    add("instant_gi_interleaved", "interleaved", "instant global illumination by interleaved sampling", 1.0,
        " (a bar of this suite's own choice)");
    add("instant_caching", "ic", "instant caching", animation.ic_over_tic);
    if (animation.setting.scene == "bunnies_9")
      rows.push_back({"tic_over_ic_bunnies_9", times(animation, kTemporal, "instant caching"),
                      Relation::at_most, 1.05, [&animation](const Machine& machine) {
                        return temporal_over(machine, "instant_caching", animation);
                      }});
  }
  for (const Setting& setting : judged_scenes()) {
    rows.push_back(
        {fmt::format("tic_visible_{}", setting.scene),
         fmt::format("percent of the pixels of {} told apart (HDR-VDP, P > 75 %), {} virtual lights, {} "
                     "estimates of direct light a pixel: temporal instant caching against instant global "
                     "illumination",
                     setting.scene, setting.vpls, kJudgedLightSamples),
         Relation::at_most, 0.33,
         [setting](const Machine& machine) { return temporal_visible(machine, setting); }});
  }
  rows.push_back(
      {"tic_memory",
       "bytes kept of a record by temporal instant caching beside the cache and the gradients, which "
       "instant caching keeps as well / 64 and a bit a virtual light",
       Relation::at_most, 1.0, temporal_memory});
}

// What cached pictures cost, and how far they are from the truth.
void add_pictures(std::vector<Row>& rows) {
  const auto add = [&](std::string name, std::string what, double target, auto make) {
    rows.push_back({std::move(name), std::move(what), Relation::at_most, target, make});
  };
  for (const Setting& setting : judged_scenes()) {
    const std::string_view scene = setting.scene;
    for (const auto& [suffix, which] :
         {std::pair{"", DeterministicFrame{"irradiance_cache", "gradients", 1}},
          std::pair{"_ic", DeterministicFrame{"instant_caching", "gradients", 1}},
          std::pair{"_ellipses", DeterministicFrame{"irradiance_cache", "occlusion_hessian", 16}},
          std::pair{"_ellipses_once", DeterministicFrame{"irradiance_cache", "occlusion_hessian", 1}}}) {
      add(fmt::format("deterministic{}_{}", suffix, scene),
          fmt::format("indirect time of a frame of {}, {}x{}, by {}{}, {}, {} a pixel: --deterministic / "
                      "left to itself",
                      scene, which.width(), which.height(), which.integrator,
                      which.integrator == "instant_caching"
                          ? fmt::format(" of {} virtual lights", DeterministicFrame::kVpls)
                          : "",
                      which.interpolation,
                      which.spp > 1 ? fmt::format("{} samples", which.spp) : "one sample"),
          1.15, [scene, which = which](const Machine& machine) {
            return deterministic_over_free(machine, scene, which);
          });
    }
  }
  for (const Setting& setting : judged_scenes()) {
    const std::string_view scene = setting.scene;
    for (const auto& [which, in_name, in_words] :
         {std::tuple{Hits::all, "", ""},
          std::tuple{Hits::along_axes, "_flat", " where normals are along axes"}}) {
      add(fmt::format("records{}_{}", in_name, scene),
          fmt::format(
              "records of {} for the same root-mean-square error of irradiance{}: occlusion Hessian / "
              "split sphere",
              scene, in_words),
          0.5, [scene, which = which](const Machine& machine) {
            return records_at_equal_error(machine, scene, which);
          });
    }
    add(fmt::format("records_mended_{}", scene),
        fmt::format("the same of {} if someone who knows every error mended the worst pixels of pictures by "
                    "the occlusion Hessian, for one record each",
                    scene),
        0.5, [scene](const Machine& machine) { return records_mended(machine, scene); });
  }
  for (const std::string_view scene : kDiffuseScenes) {
    for (const std::uint32_t spp : {16u, 64u}) {
      add(fmt::format("error_at_{}_paths_{}", spp, scene),
          fmt::format(
              "relative mean squared error of {} in the time of {} paths a pixel: the best cached picture / "
              "path tracing",
              scene, spp),
          1.0 / 3.0,
          [scene, spp](const Machine& machine) { return error_at_equal_time(machine, scene, spp); });
    }
  }
  for (const Setting& setting : judged_scenes()) {
    const std::string_view scene = setting.scene;
    for (const auto& [suffix, level] : {std::pair{"", Interpolation::gradients},
                                        std::pair{"_ellipses", Interpolation::occlusion_hessian}}) {
      add(fmt::format("mean_off{}_{}", suffix, scene),
          fmt::format("mean of cached {}{} against path tracing at equal hits: the difference as a share",
                      scene, level == Interpolation::occlusion_hessian ? ", occlusion_hessian," : ""),
          0.005, [scene, level = level](const Machine& machine) { return mean_off(machine, scene, level); });
    }
  }
  constexpr std::string_view kFurnace = "mean of the cached white furnace / the truth";
  rows.push_back({"furnace_at_least", std::string(kFurnace), Relation::at_least, 0.999, furnace_mean});
  rows.push_back({"furnace_at_most", std::string(kFurnace), Relation::at_most, 1.001, furnace_mean});
  add("block_error",
      fmt::format("error of means of 4 x 4 pixels of cached Cornell box, 256 rays a record, accuracy {}, as "
                  "a share of "
                  "the picture's mean",
                  kBlockAccuracy),
      0.01, block_error);
}

}  // namespace

std::vector<Row> all_rows() {
  std::vector<Row> rows = {
      Row{"wait_free_query_over_twin",
          "time of a wait_free query / of its unsynchronised twin; read-only, 10^5 records, 1 thread",
          Relation::at_most, 1.15, query_over_twin},
      Row{"wait_free_read_only_scaling",
          "read-only throughput of wait_free on all N processing units / N times that on one",
          Relation::at_least, 0.95, read_only_scaling},
      Row{"wait_free_over_global_mutex",
          "miss-driven throughput at 1 us a record, 4 threads a unit: wait_free / global_mutex",
          Relation::at_least, 1.6, miss_driven_over_mutex},
      // The price of strictness: linearizable queries over regular ones, on the same structure.
      Row{"snapshot_query_over_wait_free",
          "time of a wait_free_snapshot query / of a wait_free one; read-only, 10^5 records, 1 thread",
          Relation::at_most, 1.08, snapshot_query},
      Row{"snapshot_mix_over_wait_free",
          "throughput of wait_free_snapshot / of wait_free; mix 90/10 on all processing units",
          Relation::at_least, 0.85, snapshot_mix},
      Row{"gather_over_bare_rays",
          "rays a second of the hemisphere gather / of a bare loop of single Embree rays over the same rays",
          Relation::at_least, 0.7, gather_over_bare_rays},
      Row{"cached_mean_at_least",
          "mean of cached Cornell box / of the path-traced one, indirect light at equal hits",
          Relation::at_least, 0.99, cached_mean_ratio},
      Row{"cached_mean_at_most",
          "mean of cached Cornell box / of the path-traced one, indirect light at equal hits",
          Relation::at_most, 1.01, cached_mean_ratio},
      Row{"checker_speed",
          "operations judged a second, histories of 4 threads on one core / 500,000: 10^6 in two seconds",
          Relation::at_least, 1.0, checker_speed},
      Row{"vpl_gather_over_bare_rays",
          "shadow rays a second of a gather from virtual point lights / of the fastest bare Embree loop over "
          "the same rays",
          Relation::at_least, 0.85, vpl_gather_over_bare_rays},
  };
  add_latencies(rows);
  add_packed(rows);
  add_animations(rows);
  add_pictures(rows);
  for (const auto& [integrator, suffix] :
       {std::pair{"irradiance_cache", ""}, std::pair{"instant_caching", "_ic"}}) {
    rows.push_back(
        {fmt::format("trace_slowdown{}", suffix),
         fmt::format("time of a frame of cornell_box, 256x256, 1 spp, by {}: its operations captured "
                     "/ left alone",
                     integrator),
         Relation::at_most, 1.05,
         [integrator = integrator](const Machine& machine) { return trace_slowdown(machine, integrator); }});
  }
  rows.push_back({"breakdown_sum",
                  "share of wall time x threads that the parts of the time breakdown miss or count twice; "
                  "miss-driven at 4 us a record, the worst of four caches, with and without oversubscription",
                  Relation::at_most, 0.03, breakdown_sum});
  for (const auto& [name, what, figure] :
       {std::tuple{"throughput", "throughput", &Validation::throughput_error},
        std::tuple{"records", "redundant records", &Validation::records_error},
        std::tuple{"waiting", "waiting for locks", &Validation::waiting_error}}) {
    rows.push_back(
        {fmt::format("simulator_error_{}", name),
         fmt::format("median error of simulated {} against measured, more than one thread; six packed "
                     "caches, five workloads",
                     what),
         Relation::at_most, Validation::kBar,
         [figure = figure](const Machine& machine) { return simulator_error(machine, figure); }});
  }
  rows.push_back({"simulator_speed",
                  "processor time of 10^6 simulated operations on 256 virtual cores, the worst of six packed "
                  "caches, miss-driven / a minute",
                  Relation::at_most, 1.0, simulator_speed});
  return rows;
}

}  // namespace icbench
