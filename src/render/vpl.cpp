#include "render/vpl.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <iterator>
#include <limits>
#include <numeric>
#include <utility>

#include "core/random.h"
#include "render/sampling.h"
#include "render/specular.h"
#include "render/transport.h"

namespace icbench {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// Where shading normals are tilted against the surface, light particles carry the ratio of the cosines to the two
// (Veach 1997, section 5.3). It is unbounded at grazing incidence; beyond this ratio there is next to no light.
constexpr float kMaxTilt = 8.0f;

// What random numbers are for.
enum Stream : std::uint64_t { kPathStream = 0x76706c, kShiftStream, kPilotStream };

// Value in [0, 1) of a point of the Halton sequence in one base, shifted by `shift` around the unit interval.
float halton(std::uint32_t i, std::uint32_t base, float shift) noexcept {
  double value = shift, digit = 1.0 / base;
  for (; i > 0; i /= base, digit /= base) value += digit * (i % base);
  const auto u = static_cast<float>(value < 1.0 ? value : value - 1.0);
  return std::min(u, kBelowOne);
}

// The numbers of a path: the first from a Halton sequence over the paths, the rest its own.
class PathNumbers {
 public:
  PathNumbers(std::uint64_t seed, std::uint32_t path) noexcept
      : path_(path), shifts_(hash_keys(seed, kShiftStream)), own_(hash_keys(seed, kPathStream, path)) {}

  float uniform() noexcept {
    constexpr std::uint32_t kBases[] = {2, 3, 5, 7, 11, 13, 17, 19};
    return drawn_ < std::size(kBases) ? halton(path_, kBases[drawn_++], shifts_.uniform()) : own_.uniform();
  }

 private:
  std::uint32_t path_;
  Pcg32 shifts_;  // the same of all paths
  Pcg32 own_;
  std::size_t drawn_ = 0;
};

EmittedRay emit(const LightTable& lights, PathNumbers& random) noexcept {
  const float u_light = random.uniform(), u1 = random.uniform(), u2 = random.uniform();
  const float v1 = random.uniform(), v2 = random.uniform();
  return lights.emit(u_light, u1, u2, v1, v2);
}

// In the order of these, neighbours face alike and lie close: by the axis that the normal is nearest to, then along a
// Z-curve through the bounds.
std::uint64_t place_key(const Vpl& vpl, const Bounds& box) noexcept {
  constexpr int kBits = 10;  // an axis
  const glm::vec3 size = box.upper - box.lower, n = glm::abs(vpl.n);
  const float edge = std::max({size.x, size.y, size.z});
  const glm::length_t axis = n.x >= n.y && n.x >= n.z ? 0 : n.y >= n.z ? 1 : 2;
  std::uint64_t key = 2 * static_cast<std::uint64_t>(axis) + (vpl.n[axis] > 0.0f ? 1 : 0);
  glm::uvec3 cell(0);
  if (edge > 0.0f) {
    const glm::vec3 in_box = glm::clamp((1.0f / edge) * (vpl.p - box.lower), 0.0f, 1.0f - 0x1p-24f);
    cell = glm::uvec3(in_box * static_cast<float>(1 << kBits));
  }
  for (int bit = kBits - 1; bit >= 0; --bit)
    for (glm::length_t a = 0; a < 3; ++a) key = key << 1 | (cell[a] >> bit & 1u);
  return key;
}

bool same_bits(const float* a, const float* b, std::size_t n) noexcept {
  return std::memcmp(a, b, n * sizeof(float)) == 0;
}

// A path as it grows. Out: the vertices, and for each the VPL it left.
template <class Meet>
void follow(Tracer& tracer, std::uint64_t seed, std::uint32_t path, float beyond, Meet&& meet) noexcept {
  const RayTracer& rays = tracer.shared();
  if (rays.scene().lights.empty()) return;
  PathNumbers random(seed, path);
  const EmittedRay start = emit(rays.scene().lights, random);
  meet(start.p, nullptr);
  glm::vec3 weight(1.0f);
  // A point light may lie in a surface, which does not hide it (render/transport.h), or a hair before one.
  Ray ray{rays.leave(start.p, start.n), kInfinity, start.d};
  for (std::uint32_t mirrored = 0;;) {
    const Hit hit = tracer.intersect(ray);
    if (hit.missed()) {
      meet(ray.o + (beyond + glm::length(ray.o)) * ray.d, nullptr);
      return;
    }
    if (rays.material(hit).is_specular()) {
      meet(hit.p, nullptr);
      if (!scatter_specular<Carries::flux>(rays, hit, ray.d, mirrored++, random, weight, ray)) return;
      continue;
    }
    mirrored = 0;
    const float along_n = -glm::dot(ray.d, hit.n), along_ng = -glm::dot(ray.d, hit.ng);
    if (along_n > 0.0f && along_ng > 0.0f)
      weight *= std::min(along_n / along_ng, kMaxTilt) * rays.albedo(hit);
    else
      weight = glm::vec3(0.0f);
    const float q = survival(weight);
    const glm::vec3 flux = q > 0.0f ? start.power * weight / q : glm::vec3(0.0f);
    if (!(random.uniform() < q) || !(std::max({flux.x, flux.y, flux.z}) > 0.0f)) {
      meet(hit.p, nullptr);
      return;
    }
    const Vpl vpl{hit.p, hit.ng, flux};
    meet(hit.p, &vpl);
    weight /= q;
    const float u_elevation = random.uniform(), u_azimuth = random.uniform();
    ray = {rays.leave(hit.p, hit.ng), kInfinity, cosine_direction(Basis(hit.ng), u_elevation, u_azimuth)};
  }
}

// Vertices where paths left the scene lie outside of it whatever the start: at a point light, far off even.
float beyond(const Scene& scene) noexcept {
  return 2.0f * glm::length(glm::max(glm::abs(scene.bounds.lower), glm::abs(scene.bounds.upper)));
}

constexpr std::uint32_t kPilotPaths = 4096;

// VPLs that a path leaves in the scene as it stands, on average.
double vpls_per_path(const RayTracer& rays, std::uint64_t seed) {
  Tracer tracer(rays);
  std::uint64_t left = 0;
  const std::uint64_t pilot_seed = hash_keys(seed, kPilotStream);
  const float far = beyond(rays.scene());
  for (std::uint32_t i = 0; i < kPilotPaths; ++i)
    follow(tracer, pilot_seed, i, far, [&](const glm::vec3&, const Vpl* vpl) { left += vpl != nullptr; });
  return static_cast<double>(left) / kPilotPaths;
}

std::uint32_t paths_for(const RayTracer& rays, std::uint32_t wanted, double per_path) {
  constexpr double kMaxPathsPerVpl = 64.0;
  // Where light hardly ever meets a surface, or the lamps are off, the number of paths stays within reason.
  per_path = rays.scene().lights.empty() ? 1.0 : std::max(per_path, 1.0 / kMaxPathsPerVpl);
  return static_cast<std::uint32_t>(std::max(1.0, std::round(std::max(wanted, 1u) / per_path)));
}

}  // namespace

std::uint32_t plan_paths(const RayTracer& rays, const VplParams& params) {
  return paths_for(rays, params.wanted, vpls_per_path(rays, params.seed));
}

std::uint32_t plan_paths_of_animation(RayTracer& rays, const VplParams& params) {
  constexpr double kMany = 1.5;
  const auto frames = static_cast<float>(rays.scene().frames);
  double most = 0.0, first = 0.0;
  for (const float share : {0.75f, 0.5f, 0.25f, 0.0f}) {
    rays.go_to(std::floor(share * frames));
    first = vpls_per_path(rays, params.seed);
    most = std::max(most, first);
  }
  return paths_for(rays, params.wanted, most > kMany * first ? most : first);
}

VplArrays::VplArrays(std::size_t slots)
    : slots_((slots + kWord - 1) / kWord * kWord), values_(kComponents * slots_) {}

Vpl VplArrays::operator[](std::size_t slot) const noexcept {
  const auto get = [&](Component c) { return of(c)[slot]; };
  return {
      {get(kPx), get(kPy), get(kPz)}, {get(kNx), get(kNy), get(kNz)}, {get(kRed), get(kGreen), get(kBlue)}};
}

void VplArrays::set(std::size_t slot, const Vpl& vpl) noexcept {
  const float values[kComponents] = {vpl.p.x, vpl.p.y,    vpl.p.z,    vpl.n.x,   vpl.n.y,
                                     vpl.n.z, vpl.flux.x, vpl.flux.y, vpl.flux.z};
  for (std::size_t c = 0; c < kComponents; ++c) values_[c * slots_ + slot] = values[c];
}

void VplArrays::grow(std::size_t slots) {
  VplArrays larger(slots);
  for (std::size_t slot = 0; slot < slots_; ++slot) larger.set(slot, (*this)[slot]);
  larger.samples_ = std::move(samples_);
  *this = std::move(larger);
}

void VplArrays::arrange_samples(std::span<const std::uint32_t> slots) {
  samples_.assign((slots.size() + kWord - 1) / kWord * kComponents * kWord, 0.0f);
  for (std::size_t i = 0; i < slots.size(); ++i)
    for (std::size_t c = 0; c < kComponents; ++c)
      samples_[(i / kWord * kComponents + c) * kWord + i % kWord] = values_[c * slots_ + slots[i]];
}

bool VplChange::any() const noexcept {
  return std::any_of(changed.begin(), changed.end(), [](std::uint64_t w) { return w != 0; });
}

VplSet::VplSet(const RayTracer& rays, const VplParams& params)
    : rays_(&rays), seed_(params.seed), beyond_(beyond(rays.scene())) {
  ranges_.resize(params.paths != 0 ? params.paths : plan_paths(rays, params));
  vpls_ = VplArrays(std::max(params.wanted, 1u));  // a free slot costs as much as one in use: few
  used_.resize(vpls_.words());
}

std::size_t VplSet::bytes() const noexcept {
  const std::size_t sampled = vpls_.samples() * VplArrays::kWord;
  return VplArrays::kComponents * (vpls_.slots() + sampled) * sizeof(float) +
         used_.capacity() * sizeof(used_[0]) + ranges_.capacity() * sizeof(ranges_[0]) +
         vertices_.capacity() * sizeof(vertices_[0]) + vertex_slots_.capacity() * sizeof(vertex_slots_[0]);
}

std::uint32_t VplSet::take_slot() {
  std::size_t w = first_free_word_;
  while (w < used_.size() && used_[w] == ~std::uint64_t{0}) ++w;
  if (w == used_.size()) {
    vpls_.grow(vpls_.slots() + std::max(VplArrays::kWord, vpls_.slots() / 128));
    used_.resize(vpls_.words());
  }
  first_free_word_ = w;
  const auto bit = static_cast<std::size_t>(std::countr_one(used_[w]));
  used_[w] |= std::uint64_t{1} << bit;
  ++count_;
  return static_cast<std::uint32_t>(w * VplArrays::kWord + bit);
}

void VplSet::free_slot(std::uint32_t slot) noexcept {
  const std::size_t w = slot / VplArrays::kWord;
  used_[w] &= ~(std::uint64_t{1} << slot % VplArrays::kWord);
  first_free_word_ = std::min(first_free_word_, w);
  vpls_.set(slot, {});
  --count_;
}

void VplSet::sort_slots() {
  struct Place {
    std::uint64_t key;
    std::uint32_t slot;
    auto operator<=>(const Place&) const = default;
  };
  std::vector<Place> order;
  for (std::uint32_t slot = 0; slot < vpls_.slots(); ++slot)
    if (used_[slot / VplArrays::kWord] >> slot % VplArrays::kWord & 1u)
      order.push_back({place_key(vpls_[slot], rays_->scene().bounds), slot});
  std::sort(order.begin(), order.end());
  VplArrays sorted(vpls_.slots());
  std::vector<std::uint32_t> now(vpls_.slots(), kNoSlot);
  used_.assign(used_.size(), 0);
  for (std::uint32_t slot = 0; slot < order.size(); ++slot) {
    sorted.set(slot, vpls_[order[slot].slot]);
    now[order[slot].slot] = slot;
    used_[slot / VplArrays::kWord] |= std::uint64_t{1} << slot % VplArrays::kWord;
  }
  vpls_ = std::move(sorted);
  for (std::uint32_t& slot : vertex_slots_)
    if (slot != kNoSlot) slot = now[slot];
  first_free_word_ = order.size() / VplArrays::kWord;
}

void VplSet::arrange_samples() {
  std::vector<std::uint32_t> order;
  order.reserve(count_);
  for (std::uint32_t path = 0; path < paths(); ++path)
    std::ranges::copy_if(slots(path), std::back_inserter(order),
                         [](std::uint32_t slot) { return slot != kNoSlot; });
  vpls_.arrange_samples(order);
}

void VplSet::make_room(std::uint32_t path, std::size_t count) {
  Range& r = ranges_[path];
  if (count > r.count) {
    unused_vertices_ += r.count;
    r.first = static_cast<std::uint32_t>(vertices_.size());
    vertices_.resize(vertices_.size() + count);
    vertex_slots_.resize(vertices_.size());
  } else {
    unused_vertices_ += r.count - count;
  }
  r.count = static_cast<std::uint32_t>(count);
}

void VplSet::compact() {
  std::vector<glm::vec3> points;
  std::vector<std::uint32_t> kept;
  points.reserve(vertices_.size() - unused_vertices_);
  kept.reserve(points.capacity());
  for (std::uint32_t path = 0; path < paths(); ++path) {
    const std::span<const glm::vec3> at = vertices(path);
    const std::span<const std::uint32_t> left = slots(path);
    ranges_[path].first = static_cast<std::uint32_t>(points.size());
    points.insert(points.end(), at.begin(), at.end());
    kept.insert(kept.end(), left.begin(), left.end());
  }
  vertices_ = std::move(points);
  vertex_slots_ = std::move(kept);
  unused_vertices_ = 0;
}

VplUpdate::VplUpdate(VplSet& set) : VplUpdate(set, std::vector<std::uint32_t>(set.paths())) {
  std::iota(paths_.begin(), paths_.end(), 0u);
}

VplUpdate::VplUpdate(VplSet& set, std::vector<std::uint32_t> paths)
    : set_(&set), paths_(std::move(paths)), chunks_((paths_.size() + kChunk - 1) / kChunk) {}

void VplUpdate::trace(Tracer& tracer, std::size_t chunk) noexcept {
  Traced& out = chunks_[chunk];
  const float share = 1.0f / static_cast<float>(set_->paths());
  const std::size_t end = std::min(paths_.size(), (chunk + 1) * kChunk);
  for (std::size_t i = chunk * kChunk; i < end; ++i) {
    follow(tracer, set_->seed_, paths_[i], set_->beyond_, [&](const glm::vec3& p, const Vpl* vpl) {
      out.vertices.push_back(p);
      out.vpl_of.push_back(vpl ? static_cast<std::uint32_t>(out.vpls.size()) : kNoSlot);
      if (vpl) out.vpls.push_back({vpl->p, vpl->n, share * vpl->flux});
    });
    out.ends.push_back(static_cast<std::uint32_t>(out.vertices.size()));
  }
}

VplChange VplUpdate::commit() {
  VplSet& set = *set_;
  const VplArrays before = set.vpls_;
  const bool is_new = set.count_ == 0;
  const auto for_each_path = [&](auto&& f) {
    for (std::size_t i = 0; i < paths_.size(); ++i) {
      const Traced& traced = chunks_[i / kChunk];
      const std::size_t end = traced.ends[i % kChunk];
      const std::size_t first = i % kChunk == 0 ? 0 : traced.ends[i % kChunk - 1];
      f(paths_[i], traced, first, end);
    }
  };
  // All that become free first, so that no slot is added while there are some.
  for_each_path([&](std::uint32_t path, const Traced& traced, std::size_t first, std::size_t end) {
    release_surplus(path, traced, first, end);
  });
  for_each_path([&](std::uint32_t path, const Traced& traced, std::size_t first, std::size_t end) {
    replace(path, traced, first, end);
  });
  if (set.unused_vertices_ > set.vertices_.size() / 2) set.compact();
  if (is_new) set.sort_slots();
  set.arrange_samples();

  VplChange change;
  change.grew = set.vpls_.slots() > before.slots();
  change.moved.resize(set.vpls_.words());
  change.changed.resize(set.vpls_.words());
  for (std::size_t slot = 0; slot < set.vpls_.slots(); ++slot) {
    const Vpl now = set.vpls_[slot], then = slot < before.slots() ? before[slot] : Vpl{};
    const std::uint64_t bit = std::uint64_t{1} << slot % VplArrays::kWord;
    if (!same_bits(&now.p.x, &then.p.x, 6)) change.moved[slot / VplArrays::kWord] |= bit;
    if (!same_bits(&now.p.x, &then.p.x, VplArrays::kComponents))
      change.changed[slot / VplArrays::kWord] |= bit;
  }
  return change;
}

// The slots of a path's VPLs, in order.
void VplUpdate::find_owned(std::uint32_t path) {
  owned_.clear();
  std::ranges::copy_if(set_->slots(path), std::back_inserter(owned_),
                       [](std::uint32_t s) { return s != kNoSlot; });
}

// Frees the slots of a path that it has no VPLs for any more.
void VplUpdate::release_surplus(std::uint32_t path, const Traced& traced, std::size_t first,
                                std::size_t end) {
  find_owned(path);
  const auto vpls =
      static_cast<std::size_t>(std::count_if(traced.vpl_of.begin() + static_cast<std::ptrdiff_t>(first),
                                             traced.vpl_of.begin() + static_cast<std::ptrdiff_t>(end),
                                             [](std::uint32_t vpl) { return vpl != kNoSlot; }));
  for (std::size_t k = vpls; k < owned_.size(); ++k) set_->free_slot(owned_[k]);
}

// The path's k-th VPL stays in the slot of what was its k-th VPL; what it has too many was released before.
void VplUpdate::replace(std::uint32_t path, const Traced& traced, std::size_t first, std::size_t end) {
  VplSet& set = *set_;
  std::vector<std::uint32_t>& owned = owned_;
  find_owned(path);
  set.make_room(path, end - first);
  const VplSet::Range& range = set.ranges_[path];
  std::size_t kept = 0;
  for (std::size_t v = first; v < end; ++v) {
    std::uint32_t slot = kNoSlot;
    if (traced.vpl_of[v] != kNoSlot) {
      slot = kept < owned.size() ? owned[kept] : set.take_slot();
      ++kept;
      set.vpls_.set(slot, traced.vpls[traced.vpl_of[v]]);
    }
    set.vertices_[range.first + (v - first)] = traced.vertices[v];
    set.vertex_slots_[range.first + (v - first)] = slot;
  }
}

VplChange trace_all(VplSet& set, Tracer& tracer) {
  VplUpdate update(set);
  for (std::size_t c = 0; c < update.chunks(); ++c) update.trace(tracer, c);
  return update.commit();
}

}  // namespace icbench
