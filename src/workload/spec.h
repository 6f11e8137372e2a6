// What to run: a workload's name and parameters, as typed on the command line and as it stands in results.
//
//   NAME[:key=value]...      e.g. "read_only", "miss_driven:cost=10", "mix_90_10:order=hot_spot",
//   "cornell_box:rays=64"
//
// Synthetic workloads (read_only, insert_only, mix_99_1, mix_90_10, mix_50_50, miss_driven) run cache
// operations on points of a scene's surfaces without rendering; a scene's name is the ray-traced workload on
// that scene; trace:file=PATH replays what a render asked of its cache (icbench trace capture).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "render/tiles.h"

namespace icbench {

enum class WorkloadKind : std::uint8_t { read_only, insert_only, mix, miss_driven, ray_traced, trace };

/// The kind as it stands in results.
std::string_view to_string(WorkloadKind kind) noexcept;

/// Order in which synthetic operations visit the scene.
enum class PointOrder : std::uint8_t {
  uniform,   ///< independent random points
  hot_spot,  ///< nine in ten operations within the hundredth of the points nearest to one spot
  coherent   ///< tile by tile over the image, as a renderer asks
};

/// How a ray-traced workload computes indirect light.
enum class Method : std::uint8_t {
  irradiance_cache,
  path,       ///< path tracing: the rival without a cache
  hash_cells  ///< cells of a spatial hash: the rival that shares, and does not interpolate
};

struct WorkloadSpec {
  /// Canonical: base name, then the parameters that were given, in a fixed order and notation.
  std::string name;
  WorkloadKind kind = WorkloadKind::read_only;
  std::string scene = "cornell_box";
  float a = 0.3f;  ///< accuracy of queries, [kMinAccuracy, 1]

  // Synthetic.
  PointOrder order = PointOrder::uniform;
  std::uint32_t records = 100'000;     ///< stored before the clock starts; for insert_only: inserted
  std::uint32_t operations = 100'000;  ///< cache operations, all threads together
  bool tidied = false;                 ///< what is stored beforehand is put in the order of space (TidyCache)
  std::uint32_t inserts_per_1000 = 0;  ///< share of inserts in a mix
  double cost_us = 1.0;                ///< miss_driven: work per record, microseconds

  // Ray-traced.
  std::uint32_t rays = 64;  ///< gather rays per record
  std::uint32_t width = 256, height = 256;
  TileOrder tiles = TileOrder::morton;
  Method method = Method::irradiance_cache;
  std::uint32_t spp = 16;  ///< path, hash_cells: light paths per pixel
  float cell = 8.0f;       ///< hash_cells: edge of a cell, pixels

  std::vector<std::string> idle{};  ///< parameters that were given though the integrator has no use for them

  // Of a trace.
  std::string file;
  std::uint64_t checksum = 0;  ///< of the file as it was when the run began; 0: not known yet
  double scale = 1.0;          ///< of the time its records took; 0: none
  bool as_captured = false;    ///< records are made where the render made them, whatever queries answer

  bool uses_cache() const noexcept { return method == Method::irradiance_cache; }

  bool starts_filled() const noexcept { return kind == WorkloadKind::read_only || kind == WorkloadKind::mix; }

  /// Records that are stored before the clock starts.
  std::uint32_t prefilled() const noexcept { return starts_filled() ? records : 0; }

  /// Inserts that are known beforehand: all but those that follow from misses.
  std::uint32_t inserts() const noexcept {
    if (kind == WorkloadKind::insert_only) return records;
    return static_cast<std::uint32_t>(std::uint64_t{operations} * inserts_per_1000 / 1000);
  }
};

/// The replay of a trace, whatever its path contains: a name for results.
WorkloadSpec trace_workload(const std::string& file, double scale, bool as_captured);

/// Parses one workload. Throws std::runtime_error with one line that names what is wrong and what is known.
WorkloadSpec parse_workload(std::string_view text);

struct WorkloadEntry {
  std::string name;
  std::string description;
  std::string parameters;  ///< "key=default ..."
};

/// Everything that can be named, for `icbench list workloads`.
std::vector<WorkloadEntry> list_workloads();

}  // namespace icbench
