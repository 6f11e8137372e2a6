// The integrators: one entry each.
//
// An integrator either is a pass of its own, or a source of records for the pass through a cache
// (render/irradiance_cache.h).
#pragma once

#include <array>
#include <memory>
#include <string_view>

#include "render/indirect_pass.h"
#include "render/record_source.h"

namespace icbench {

using MakePass = std::unique_ptr<IndirectPass> (*)(const PassSetup&);
using MakeSource = std::unique_ptr<RecordSource> (*)(const PassSetup&);

/// No indirect light: emitted and direct light only (RT of Dubla 2012).
std::unique_ptr<IndirectPass> make_whitted(const PassSetup& setup);

/// All light by path tracing: the reference.
std::unique_ptr<IndirectPass> make_path(const PassSetup& setup);

/// Virtual point lights at every pixel (IGI of Dubla 2012).
std::unique_ptr<IndirectPass> make_instant_gi(const PassSetup& setup);

/// A part of the virtual point lights at every pixel, and a filter over pixels (Wald et al. 2002).
std::unique_ptr<IndirectPass> make_instant_gi_interleaved(const PassSetup& setup);

/// Paths at every pixel, whose light is shared by all points of a cell (Binder et al. 2019).
std::unique_ptr<IndirectPass> make_hash_cells(const PassSetup& setup);

/// Records by hemisphere gathers.
std::unique_ptr<RecordSource> make_irradiance_cache(const PassSetup& setup);

/// Records gathered from virtual point lights, made anew in every frame (IC of Dubla 2012).
std::unique_ptr<RecordSource> make_instant_caching(const PassSetup& setup);

/// The same, kept over frames (TIC of Dubla 2012).
std::unique_ptr<RecordSource> make_temporal_instant_caching(const PassSetup& setup);

struct IntegratorEntry {
  std::string_view name;
  std::string_view description;
  MakePass pass;      ///< null if it needs a cache
  MakeSource source;  ///< null if it needs none
  bool uses_vpls;
  bool uses_cells = false;

  bool needs_cache() const noexcept { return source != nullptr; }
};

inline constexpr std::array kIntegrators{
    IntegratorEntry{"whitted", "direct light only, by ray tracing", make_whitted, nullptr, false},
    IntegratorEntry{"path", "path tracing with next-event estimation: the unbiased reference", make_path,
                    nullptr, false},
    IntegratorEntry{"instant_gi", "every virtual point light at every pixel", make_instant_gi, nullptr, true},
    IntegratorEntry{"instant_gi_interleaved",
                    "virtual point lights shared out among neighbours, then filtered",
                    make_instant_gi_interleaved, nullptr, true},
    IntegratorEntry{"hash_cells", "path-traced light, shared within the cells of a spatial hash",
                    make_hash_cells, nullptr, false, true},
    IntegratorEntry{"irradiance_cache", "hemisphere gathers, interpolated through a cache", nullptr,
                    make_irradiance_cache, false},
    IntegratorEntry{"instant_caching", "records gathered from virtual point lights, anew in every frame",
                    nullptr, make_instant_caching, true},
    IntegratorEntry{"temporal_instant_caching", "the same, of which a change renews only what it touches",
                    nullptr, make_temporal_instant_caching, true},
};

/// Throws std::runtime_error naming the known integrators if there is none of that name.
const IntegratorEntry& find_integrator(std::string_view name);

}  // namespace icbench
