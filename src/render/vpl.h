// Virtual point lights (Keller 1997): light paths from the lamps leave one wherever a diffuse surface reflects them.
//
// A path starts at a lamp and is followed from surface to surface. At a diffuse surface Russian roulette decides, by
// the albedo, whether it is absorbed or reflected, so that VPLs lie where light is and carry about equal flux; there is
// no bounce limit. Mirrors and dielectrics are followed and keep no VPL. The sum over VPLs of what they send to a point
// is an unbiased estimate of its indirect irradiance, but for light that comes to it straight from a specular surface,
// and for what little a shading normal loses that is tilted far against its surface where light comes in flat.
//
// How many paths there are is fixed when the set is made, from a pilot of other paths, so that they leave about as many
// VPLs as wanted. Random numbers depend on the seed and the path's index alone, not on the frame: while nothing cuts a
// path, tracing it anew gives the same path bit for bit. The start of a path and what becomes of it at the first
// surface come from a randomly shifted Halton sequence over the paths, the rest from the path's own stream.
//
// VPLs live in *slots*, numbered from 0; sums over VPLs run in the order of the slots. A path keeps its slots when it
// is traced anew; a free slot has no flux and no normal, so that it lights nothing. Where a set had no VPLs, its first
// are ordered by where they lie and face, so that those of a word are a region of their own: often all of it lies below
// a horizon, out of sight or past what moved, and rays to it run side by side.
//
// *Samples* of 64 VPLs, from which compensation draws, follow the order of the paths instead: a run of a Halton
// sequence stands for all of it, and samples are the same whatever frames went before, wherever their VPLs have their
// slots.
//
// Costs: 36 bytes a slot, 36 a VPL in samples, 16 a path vertex, 8 a path; tracing is parallel, taking over what was
// traced is one short serial loop in the order of the paths, so that nothing depends on the threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "render/ray_tracer.h"

namespace icbench {

struct Vpl {
  glm::vec3 p{0.0f};     ///< metres
  glm::vec3 n{0.0f};     ///< unit geometric normal, on the side that is lit
  glm::vec3 flux{0.0f};  ///< reflected, W; diffuse: radiant intensity flux cos / pi

  bool operator==(const Vpl&) const = default;
};
static_assert(sizeof(Vpl) == 36);

/// VPLs by slot, one array per component, for SIMD.
class VplArrays {
 public:
  /// Slots come in whole words of this many: a bit each in std::uint64_t.
  static constexpr std::size_t kWord = 64;

  VplArrays() = default;
  /// All slots free; their number is rounded up to whole words.
  explicit VplArrays(std::size_t slots);

  std::size_t slots() const noexcept { return slots_; }
  std::size_t words() const noexcept { return slots_ / kWord; }

  Vpl operator[](std::size_t slot) const noexcept;
  void set(std::size_t slot, const Vpl& vpl) noexcept;
  void grow(std::size_t slots);  ///< keeps what there is

  enum Component : std::size_t { kPx, kPy, kPz, kNx, kNy, kNz, kRed, kGreen, kBlue, kComponents };

  /// Values of all slots; valid until grow.
  const float* of(Component c) const noexcept { return values_.data() + c * slots_; }

  /// Copies the VPLs of these slots, in this order, into samples of kWord each; what the last has too few sends
  /// nothing. Samples stay what they are until this is called again.
  void arrange_samples(std::span<const std::uint32_t> slots);
  std::size_t samples() const noexcept { return samples_.size() / (kComponents * kWord); }
  /// Values of the kWord VPLs of a sample; valid until arrange_samples.
  const float* sample_of(Component c, std::size_t sample) const noexcept {
    return samples_.data() + (sample * kComponents + c) * kWord;
  }

 private:
  std::size_t slots_ = 0;
  std::vector<float> values_;   // by component, then by slot
  std::vector<float> samples_;  // by sample, then by component
};

struct VplParams {
  std::uint32_t wanted = 1024;  ///< VPLs, about; >= 1
  std::uint64_t seed = 0;
  std::uint32_t paths = 0;  ///< as they were planned; 0: for the scene as it stands when the set is made
};

/// Light paths that leave about as many VPLs as are wanted in the scene as it stands, by a pilot of 4096: at most 64
/// times as many, where light hardly ever meets a surface.
std::uint32_t plan_paths(const RayTracer& rays, const VplParams& params);

/// The same of a whole animation: as planned for its first frame, unless a quarter, half or three quarters on these
/// would leave over 1.5 times as many VPLs as there, as where a lamp turns into a room; then as for that frame. The
/// scene is at the first frame afterwards.
std::uint32_t plan_paths_of_animation(RayTracer& rays, const VplParams& params);

/// Which slots an update changed, one bit a slot; exact: what is bitwise as it was is not in it.
struct VplChange {
  std::vector<std::uint64_t> moved;    ///< position or normal: visibility has to be asked anew
  std::vector<std::uint64_t> changed;  ///< anything: sums have to be taken anew
  bool grew = false;                   ///< there are more slots than before, at the end

  bool any() const noexcept;
};

/// VplSet::slots: the vertex left no VPL.
inline constexpr std::uint32_t kNoSlot = ~0u;

/// The VPLs of a scene, and the paths that left them. Changes only in VplUpdate::commit.
class VplSet {
 public:
  /// Plans the paths, unless they were; the set is empty until a VplUpdate of all paths is committed.
  VplSet(const RayTracer& rays, const VplParams& params);

  const VplArrays& vpls() const noexcept { return vpls_; }
  std::uint32_t paths() const noexcept { return static_cast<std::uint32_t>(ranges_.size()); }
  std::size_t count() const noexcept { return count_; }  ///< slots in use
  const RayTracer& rays() const noexcept { return *rays_; }
  std::uint64_t seed() const noexcept { return seed_; }

  /// Ends of the path's segments: the start on the lamp, then every surface met, mirrors included, and where it left
  /// the scene a point beyond the scene's bounds. Its rays run within RayTracer::epsilon() of the segments. Empty for a
  /// path that does not start. Valid until the next commit.
  std::span<const glm::vec3> vertices(std::uint32_t path) const noexcept {
    const Range& r = ranges_[path];
    return {vertices_.data() + r.first, r.count};
  }

  /// The slots of the VPLs that the path left at its vertices; kNoSlot where it left none.
  std::span<const std::uint32_t> slots(std::uint32_t path) const noexcept {
    const Range& r = ranges_[path];
    return {vertex_slots_.data() + r.first, r.count};
  }

  /// Memory of VPLs and paths, bytes.
  std::size_t bytes() const noexcept;

 private:
  friend class VplUpdate;

  struct Range {
    std::uint32_t first = 0, count = 0;  // of the vertices
  };

  std::uint32_t take_slot();  // the lowest free one
  void sort_slots();          // by place; they are the lowest after that
  void arrange_samples();     // of all VPLs, in the order of the paths
  void free_slot(std::uint32_t slot) noexcept;
  void make_room(std::uint32_t path, std::size_t count);  // for so many vertices, of undefined value
  void compact();

  const RayTracer* rays_;
  std::uint64_t seed_;
  // Metres; what lies this far and its distance from the origin from a point is outside the scene.
  float beyond_;
  VplArrays vpls_;
  std::vector<std::uint64_t> used_;  // slots, a bit each
  std::size_t first_free_word_ = 0;  // none before it
  std::size_t count_ = 0;
  std::vector<Range> ranges_;
  std::vector<glm::vec3> vertices_;  // of all paths; those of a path are together
  std::vector<std::uint32_t> vertex_slots_;
  std::size_t unused_vertices_ = 0;  // left behind by paths that moved to the end
};

/// Traces some or all paths of a set anew and replaces their VPLs: build one, trace every chunk in any threads, commit.
///
///     VplUpdate update(set);
///     team: update.trace(tracer, chunk) for every chunk < update.chunks()
///     VplChange change = update.commit();
class VplUpdate {
 public:
  /// Of all paths.
  explicit VplUpdate(VplSet& set);
  /// Of these paths: indices in ascending order.
  VplUpdate(VplSet& set, std::vector<std::uint32_t> paths);

  std::size_t chunks() const noexcept { return chunks_.size(); }

  /// Traces a chunk of the paths; the set is only read. Different chunks may be traced at once. Out of memory ends the
  /// program.
  void trace(Tracer& tracer, std::size_t chunk) noexcept;

  /// Quiescent; all chunks have been traced. Replaces the VPLs of these paths.
  VplChange commit();

 private:
  static constexpr std::size_t kChunk = 32;  // paths: some 100 rays

  // What was traced of some paths, one after the other.
  struct Traced {
    std::vector<std::uint32_t> ends;  // of each path in `vertices`
    std::vector<glm::vec3> vertices;
    std::vector<std::uint32_t> vpl_of;  // of each vertex, into `vpls`, or kNoSlot
    std::vector<Vpl> vpls;
  };

  void find_owned(std::uint32_t path);
  void release_surplus(std::uint32_t path, const Traced& traced, std::size_t first, std::size_t end);
  void replace(std::uint32_t path, const Traced& traced, std::size_t first, std::size_t end);

  VplSet* set_;
  std::vector<std::uint32_t> paths_;
  std::vector<Traced> chunks_;
  std::vector<std::uint32_t> owned_;  // slots of one path, while it is replaced
};

/// All of it in the calling thread.
VplChange trace_all(VplSet& set, Tracer& tracer);

}  // namespace icbench
