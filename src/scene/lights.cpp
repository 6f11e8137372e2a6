#include "scene/lights.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <numeric>

#include "core/random.h"
#include "scene/directions.h"
#include "scene/scene.h"

namespace icbench {
namespace {

constexpr double kPi = std::numbers::pi;

float smooth_step(float t) noexcept { return t * t * (3.0f - 2.0f * t); }

// t in [0, 1] up to which lies the share u of the area under smooth_step: the root of t^3 (2 - t) = u. Newton's steps
// come down to it from cbrt(u), where the function, convex in between, is no smaller.
float smooth_step_quantile(float u) noexcept {
  if (!(u > 0.0f)) return 0.0f;
  float t = std::cbrt(u);
  for (int i = 0; i < 4; ++i) t -= (t * t * t * (2.0f - t) - u) / (t * t * (6.0f - 4.0f * t));
  return std::clamp(t, 0.0f, 1.0f);
}

// Flux over the intensity along the axis, sr.
double solid_angle(const PointLight& light) noexcept {
  return 2.0 * kPi * (1.0 - 0.5 * (static_cast<double>(light.cos_inner) + light.cos_outer));
}

// A direction with density proportional to the intensity.
glm::vec3 spot_direction(const PointLight& light, float u_cosine, float u_azimuth) noexcept {
  const float full = 1.0f - light.cos_inner, edge = light.cos_inner - light.cos_outer;
  const float u = u_cosine * (full + 0.5f * edge);
  const float versine =
      u <= full ? u : 1.0f - light.cos_outer - edge * smooth_step_quantile(2.0f * (u - full) / edge);
  return direction_at(Basis(light.axis), std::clamp(versine, 0.0f, 2.0f), u_azimuth);
}

// Where the light of a point light is sent that is far off: round the sphere around the scene, or nearly all of it would
// miss the scene. Only where the light shines evenly there, so that all paths carry the same.
LightTable::Aim aim_of(const PointLight& light, const Bounds& bounds) noexcept {
  constexpr float kPad = 1.001f, kRounding = 0x1p-22f;  // of the axis, as a share of the distance
  const glm::vec3 centre = 0.5f * bounds.lower + 0.5f * bounds.upper, to = centre - light.p;
  const float distance = glm::length(to);
  const float radius = kPad * glm::length(bounds.upper - centre) + kRounding * distance;
  if (!(radius > 0.0f && radius < distance && std::isfinite(distance))) return {};
  const float sine = radius / distance, cosine = std::sqrt(1.0f - sine * sine);
  const LightTable::Aim aim{to / distance, sine * sine / (1.0f + cosine), 0.0f};
  if (light.cos_inner > -1.0f) {
    const float inner = std::acos(std::min(light.cos_inner, 1.0f));
    const float off = 2.0f * std::asin(std::min(1.0f, 0.5f * glm::length(aim.axis - light.axis)));
    if (off + std::asin(sine) > inner) return {};
  }
  const auto share = static_cast<float>(2.0 * kPi * static_cast<double>(aim.versine) / solid_angle(light));
  return share < 1.0f ? LightTable::Aim{aim.axis, aim.versine, share} : LightTable::Aim{};
}

}  // namespace

float spot_falloff(const PointLight& light, float cosine) noexcept {
  if (!std::isgreater(cosine, -1.0f)) cosine = -1.0f;
  if (cosine >= light.cos_inner) return 1.0f;
  if (cosine <= light.cos_outer) return 0.0f;
  return smooth_step((cosine - light.cos_outer) / (light.cos_inner - light.cos_outer));
}

LightTable::LightTable(const Scene& scene, float frame) {
  std::vector<double> powers;
  for (std::size_t i = 0; i < scene.meshes.size(); ++i) {
    const Material& material = scene.materials[scene.meshes[i].material];
    if (!material.emits()) continue;
    const Mesh& mesh = scene.shape(i);
    const Pose pose = scene.meshes[i].pose ? scene.meshes[i].pose(frame) : Pose{};
    for (const glm::uvec3& t : mesh.triangles) {
      const glm::vec3 p0 = pose(mesh.positions[t.x]);
      const glm::vec3 e1 = pose(mesh.positions[t.y]) - p0;
      const glm::vec3 e2 = pose(mesh.positions[t.z]) - p0;
      const glm::vec3 cross = glm::cross(e1, e2);
      const float length = glm::length(cross);
      if (!(length > 0.0f)) continue;  // a deforming mesh may have triangles without area for a while
      areas_.push_back({p0, e1, e2, cross / length, material.emission});
      powers.push_back(0.5 * length * channel_sum(material.emission));
    }
  }
  for (const PointLight& light : scene.point_lights) {
    const double power = solid_angle(light) / kPi * channel_sum(light.intensity);
    if (!(power > 0.0)) continue;
    points_.push_back(light);
    aims_.push_back(aim_of(light, scene.bounds));
    powers.push_back(power);
  }
  if (powers.empty()) return;
  table_ = AliasTable(powers);
  if (std::all_of(aims_.begin(), aims_.end(), [](const Aim& aim) { return aim.share == 1.0f; })) return;
  for (std::size_t i = 0; i < aims_.size(); ++i) powers[areas_.size() + i] *= double{aims_[i].share};
  aimed_table_ = AliasTable(powers);
}

LightTable::AliasTable::AliasTable(const std::vector<double>& powers) {
  const double total = std::accumulate(powers.begin(), powers.end(), 0.0);
  inverse_power_ = static_cast<float>(1.0 / total);
  entries_.resize(powers.size());
  std::vector<double> share(powers.size());  // 1 is the average
  std::vector<std::uint32_t> below, above;
  for (std::uint32_t i = 0; i < share.size(); ++i) {
    share[i] = powers[i] / total * static_cast<double>(powers.size());
    entries_[i] = {1.0f, i};
    (share[i] < 1.0 ? below : above).push_back(i);
  }
  while (!below.empty() && !above.empty()) {
    const std::uint32_t small = below.back(), large = above.back();
    below.pop_back();
    entries_[small] = {static_cast<float>(share[small]), large};
    share[large] -= 1.0 - share[small];
    if (share[large] < 1.0) {
      above.pop_back();
      below.push_back(large);
    }
  }  // what is left on either side has share 1 up to rounding and keeps itself
}

std::size_t LightTable::AliasTable::draw(float u_light, float u1, float u2) const noexcept {
  // The place in the table and the fraction that decides between two lights take more than the 24 bits of one number
  // where lights have millions of triangles. What lies between two of its values is told by the others, by a hash, so
  // that it says nothing of where on the light the point is.
  const std::uint64_t between =
      mix64(std::uint64_t{std::bit_cast<std::uint32_t>(u1)} << 32 | std::bit_cast<std::uint32_t>(u2));
  const double u = static_cast<double>(u_light) + 0x1p-24 * (static_cast<double>(between >> 11) * 0x1p-53);
  const double scaled = u * static_cast<double>(entries_.size());
  const auto entry = std::min(static_cast<std::size_t>(scaled), entries_.size() - 1);
  const bool stays = scaled - static_cast<double>(entry) < static_cast<double>(entries_[entry].keep);
  return stays ? entry : entries_[entry].alias;
}

LightPoint LightTable::point_on(std::size_t which, float u1, float u2) const noexcept {
  if (which < areas_.size()) {
    const AreaLight& light = areas_[which];
    const float root = std::sqrt(u1);
    const glm::vec3 p = light.p0 + (root * (1.0f - u2)) * light.e1 + (root * u2) * light.e2;
    return {p, light.n, light.emission, pdf_area(light.emission)};
  }
  const PointLight& light = points_[which - areas_.size()];
  const auto probability =
      static_cast<float>(solid_angle(light) / kPi * channel_sum(light.intensity) * table_.inverse_power());
  return {light.p, light.axis, light.intensity, probability, &light};
}

LightPoint LightTable::sample(float u_light, float u1, float u2) const noexcept {
  return point_on(table_.draw(u_light, u1, u2), u1, u2);
}

EmittedRay LightTable::emit(float u_light, float u1, float u2, float v1, float v2) const noexcept {
  const AliasTable& table = aimed_table_.size() != 0 ? aimed_table_ : table_;
  const LightPoint from = point_on(table.draw(u_light, u1, u2), u1, u2);
  // Lights are drawn by power, so power over probability is the same for all, apart from colour; here it is written
  // with what both kinds share.
  const glm::vec3 power =
      std::numbers::pi_v<float> / (channel_sum(from.emission) * table.inverse_power()) * from.emission;
  if (!from.point) return {from.p, from.n, cosine_direction(Basis(from.n), v1, v2), power, true};
  const Aim& aim = aims_[static_cast<std::size_t>(from.point - points_.data())];
  const bool is_aimed = aim.versine > 0.0f;
  const glm::vec3 d =
      is_aimed ? direction_at(Basis(aim.axis), aim.versine * v1, v2) : spot_direction(*from.point, v1, v2);
  return {from.p, d, d, power, false};
}

}  // namespace icbench
