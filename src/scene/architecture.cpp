#include "scene/architecture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "scene/shapes.h"

namespace icbench {
namespace {

using glm::vec3;

constexpr float kPi = std::numbers::pi_v<float>;
constexpr vec3 kAcross{1, 0, 0}, kUp{0, 1, 0}, kOut{0, 0, 1};

void append(Polygon& to, const Polygon& from) { to.insert(to.end(), from.begin(), from.end()); }

// Goes on with a smooth piece of a profile for revolve(): creases at both its ends, a straight line to its beginning.
void append_creased(Polygon& to, const Polygon& piece) {
  to.push_back(to.back());
  if (glm::distance(to.back(), piece.front()) > 1e-5f) to.insert(to.end(), 2, piece.front());
  to.insert(to.end(), piece.begin() + 1, piece.end());
}

// A leaf of a capital that clings to the bell and curls outwards at its tip, in the direction of +z.
Mesh capital_leaf(float bell, float y, float height, float width) {
  return block({2, 4, 1}, [=](const vec3& u) {
    constexpr float kStraight = 0.62f, kCurl = 2.5f;
    const float s = u.y, lobes = 1.0f + 0.12f * std::sin(9.0f * s);
    const float half =
        0.5f * width * lobes * std::sqrt(std::max(0.04f, 1.0f - s * s * s)) * (2.0f * u.x - 1.0f);
    const float coil = 0.2f * height, t = std::max(0.0f, s - kStraight) / (1.0f - kStraight) * kCurl;
    const float out = bell + coil * (1.0f - std::cos(t)) + 0.05f * height * std::min(1.0f, s / kStraight);
    const float up = y + 0.8f * height * std::min(1.0f, s / kStraight) + coil * std::sin(t);
    // Across the thickness: along the normal of the curve (out, up), minus the fall towards the leaf's edges.
    const float thick = 0.07f * height * u.z, fall = 1.2f * half * half / bell;
    return vec3(half, up + thick * -std::sin(t), out - fall + thick * std::cos(t));
  });
}

// The sheet inside a polygon, facing +z.
Mesh sheet(const Polygon& outline, const vec3& shift) {
  Mesh mesh;
  for (const glm::vec2& p : outline) {
    mesh.positions.push_back(vec3(p, 0.0f) + shift);
    mesh.normals.push_back(kOut);
  }
  mesh.triangles = triangulate(outline);
  return mesh;
}

// Up one side of an arched opening, round its head and down the other.
Path around_arch(const glm::vec2& centre, float radius, float stilt, int steps) {
  Polygon line = arc(centre, radius, kPi, 0.0f, steps);
  if (stilt > 0.0f) {
    line.insert(line.begin(), {centre.x - radius, centre.y - stilt});
    line.emplace_back(centre.x + radius, centre.y - stilt);
  }
  return lift(line, vec3(0.0f), kAcross, kUp);
}

}  // namespace

Parts column(float radius, float height, std::uint32_t stone) {
  const float r = radius, plinth = 0.45f * r, abacus = 0.34f * r, capital = 1.5f * r;
  const float bell = height - abacus - capital, top = 0.84f * r;
  Parts whole;
  whole.add(stone, solid_box({-1.36f * r, kGap, -1.36f * r}, {1.36f * r, plinth, 1.36f * r}));
  Polygon profile{{0.0f, plinth - 0.02f}, {1.1f * r, plinth - 0.02f}};
  const auto add_torus = [&](float at, float y, float half) {
    append_creased(profile, arc({at, y}, half, -0.5f * kPi, 0.5f * kPi, 4));
  };
  const float lower = 0.16f * r, upper = 0.10f * r, hollow = 0.11f * r;
  add_torus(1.18f * r, plinth + lower, lower);
  append_creased(profile,
                 arc({1.20f * r, plinth + 2.0f * lower + hollow}, hollow, -0.5f * kPi, -1.5f * kPi, 4));
  const float ring = plinth + 2.0f * (lower + hollow) + upper;
  add_torus(1.10f * r, ring, upper);
  constexpr int kShaft = 4;
  const float foot = ring + 2.0f * upper;
  Polygon shaft{{1.04f * r, ring + upper}};
  for (int i = 0; i <= kShaft; ++i) {  // entasis: the shaft thins faster towards its top
    const float s = static_cast<float>(i) / kShaft;
    shaft.emplace_back(r + (top - r) * s * s, foot + s * (bell - 0.2f * r - foot));
  }
  append_creased(profile, shaft);
  add_torus(top, bell - 0.1f * r, 0.09f * r);
  Polygon basket;
  for (int i = 0; i <= 4; ++i) {
    const float s = static_cast<float>(i) / 4.0f;
    basket.emplace_back(0.80f * r + 0.36f * r * s * s * s, bell + s * (capital + 0.02f));
  }
  append_creased(profile, basket);
  append_creased(profile, {profile.back(), {0.0f, profile.back().y}});
  whole.add(stone, revolve("column", vec3(0.0f), profile, 20, stone));
  for (int i = 0; i < 16; ++i) {
    const bool low = i < 8;
    const Mesh leaf = low ? capital_leaf(0.78f * r, bell + 0.02f, 0.8f * r, 0.56f * r)
                          : capital_leaf(0.84f * r, bell + 0.5f * r, 0.95f * r, 0.55f * r);
    whole.add(stone,
              moved(leaf, turned((static_cast<float>(i) + (low ? 0.0f : 0.5f)) * 0.25f * kPi, vec3(0.0f))));
  }
  const float half = 1.30f * r, base = height - abacus;
  whole.add(stone, slab(rectangle({-half, -half}, {half, half}),
                        std::array{SlabLevel{0.16f * r, base}, SlabLevel{0.12f * r, base + 0.3f * abacus},
                                   SlabLevel{0.0f, base + 0.45f * abacus}, SlabLevel{0.0f, height}}));
  return whole;
}

Parts colonnette(float radius, float height, std::uint32_t stone) {
  const float r = radius;
  Polygon profile{{0.0f, kGap}, {1.8f * r, kGap}};
  append_creased(profile, {{1.8f * r, kGap}, {1.8f * r, 1.2f * r}});
  append_creased(profile, arc({1.3f * r, 1.6f * r}, 0.4f * r, -0.5f * kPi, 0.5f * kPi, 4));
  append_creased(profile, {{r, 2.3f * r}, {r, height - 3.8f * r}});
  append_creased(profile, arc({r, height - 3.3f * r}, 0.3f * r, -0.5f * kPi, 0.5f * kPi, 4));
  append_creased(
      profile,
      {{1.05f * r, height - 2.4f * r}, {1.5f * r, height - 1.2f * r}, {1.9f * r, height - 0.9f * r}});
  append_creased(profile, {{1.9f * r, height - 0.9f * r}, {1.9f * r, height}});
  append_creased(profile, {{1.9f * r, height}, {0.0f, height}});
  Parts whole;
  whole.add(stone, revolve("colonnette", vec3(0.0f), profile, 12, stone));
  return whole;
}

Mesh wall(const Polygon& outline, float thickness, std::span<const Polygon> openings) {
  return moved(extrude(outline, thickness, openings), turned(0.0f, {0, 0, -thickness}));
}

Polygon arcade(int bays, float pitch, float radius, float springing, float top, float overlap, int steps) {
  const float half = 0.5f * pitch * static_cast<float>(bays) + overlap;
  Polygon outline{{-half, top}, {-half, springing}};
  for (int i = 0; i < bays; ++i) {
    const float x = pitch * (static_cast<float>(i) - 0.5f * static_cast<float>(bays - 1));
    append(outline, arc({x, springing}, radius, kPi, 0.0f, steps));
  }
  outline.emplace_back(half, springing);
  outline.emplace_back(half, top);
  return outline;
}

Mesh archivolt(const glm::vec2& centre, float radius, float width, float stilt, int steps) {
  const float w = width;
  return sweep(around_arch(centre, radius, stilt, steps),
               {{0.06f * w, -0.05f},
                {w, -0.05f},
                {w, 0.22f * w},
                {0.80f * w, 0.26f * w},
                {0.62f * w, 0.12f * w},
                {0.36f * w, 0.12f * w},
                {0.30f * w, 0.20f * w},
                {0.16f * w, 0.20f * w},
                {0.06f * w, 0.10f * w}},
               kOut);
}

Mesh barrel_vault(float radius, float length, float thickness, float skirt, int steps) {
  const float outer = radius + thickness;
  Polygon section{{outer, -skirt}};
  append(section, arc({0.0f, 0.0f}, outer, 0.0f, kPi, steps));
  append(section, {{-outer, -skirt}, {-radius, -skirt}});
  append(section, arc({0.0f, 0.0f}, radius, kPi, 0.0f, steps));
  section.emplace_back(radius, -skirt);
  return moved(extrude(section, length), turned(0.0f, {0, 0, -length}));
}

Mesh vault_rib(float radius, float width, float depth, float skirt, int steps) {
  const float w = 0.5f * width, d = depth;
  return sweep(around_arch({0.0f, 0.0f}, radius, skirt, steps),
               {{0.05f, -w},
                {0.05f, w},
                {-0.45f * d, w},
                {-0.6f * d, 0.72f * w},
                {-d, 0.6f * w},
                {-d, -0.6f * w},
                {-0.6f * d, -0.72f * w},
                {-0.45f * d, -w}},
               kOut);
}

Mesh half_dome(float radius, float thickness, float skirt, int steps) {
  return block({2 * steps, steps + 1, 1}, [=](const vec3& u) {
    const float r = radius + thickness * u.z, rows = static_cast<float>(steps + 1);
    if (u.y == 1.0f) return vec3(0.0f, r, 0.0f);
    const float elevation = 0.5f * kPi * std::max(0.0f, u.y * rows - 1.0f) / static_cast<float>(steps);
    const float y = u.y == 0.0f ? -skirt : r * std::sin(elevation), around = kPi * u.x;
    return vec3(r * std::cos(elevation) * std::cos(around), y, -r * std::cos(elevation) * std::sin(around));
  });
}

Mesh cornice(const Path& path, float height) {
  const float h = height;
  return sweep(path,
               {{-0.06f, 0.0f},
                {0.15f * h, 0.0f},
                {0.20f * h, 0.22f * h},
                {0.38f * h, 0.34f * h},
                {0.55f * h, 0.58f * h},
                {0.60f * h, 0.70f * h},
                {0.90f * h, 0.74f * h},
                {0.90f * h, h},
                {-0.06f, h}},
               kUp);
}

Parts arched_window(float x, float width, float sill, float springing, float depth, int steps,
                    const WindowMaterials& m) {
  const float r = 0.5f * width, tall = springing - sill;
  Parts window;
  window.add(m.pane, sheet(arched_opening(x, width + 0.06f, sill - 0.03f, springing, steps), {0, 0, -depth}));
  const Polygon surround{{0.012f, -0.05f}, {0.22f, -0.05f}, {0.22f, 0.05f}, {0.17f, 0.06f}, {0.012f, 0.02f}};
  window.add(m.stone, sweep(around_arch({x, springing}, r, tall, steps), surround, kOut));
  window.add(m.stone,
             solid_box({x - r - 0.26f, sill - 0.14f, -0.06f}, {x + r + 0.26f, sill - 0.004f, 0.10f}));
  const float z = -depth + 0.05f, bar = 0.022f;
  window.add(m.bars, solid_box({x - bar, sill - 0.02f, z - bar}, {x + bar, springing + r + 0.02f, z + bar}));
  const int rows = std::max(2, static_cast<int>(std::lround(tall / 0.45f)));
  for (int i = 1; i <= rows; ++i) {
    const float y = sill + tall * static_cast<float>(i) / static_cast<float>(rows);
    window.add(m.bars, solid_box({x - r - 0.02f, y - 0.8f * bar, z - 0.8f * bar},
                                 {x + r + 0.02f, y + 0.8f * bar, z + 0.8f * bar}));
  }
  return window;
}

Parts rose_window(const glm::vec2& centre, float radius, float depth, const WindowMaterials& m) {
  constexpr int kSpokes = 12;
  const vec3 middle(centre, 0.0f);
  const float z = -0.6f * depth;
  Parts rose;
  rose.add(m.pane, sheet(circle(centre, radius + 0.04f, 64), {0, 0, -depth}));
  const auto ring = [&](float r, float half, float out) {
    Path path = lift(circle({0.0f, 0.0f}, r, 40), middle + vec3(0, 0, out), kAcross, kUp);
    return sweep(path, circle({0.0f, 0.0f}, half, 8), kOut, true);
  };
  rose.add(m.stone, ring(radius + 0.10f, 0.12f, 0.0f));
  rose.add(m.stone, ring(0.30f * radius, 0.06f, z));
  for (int i = 0; i < kSpokes; ++i) {
    const float angle = 2.0f * kPi * static_cast<float>(i) / kSpokes;
    const vec3 along(std::cos(angle), std::sin(angle), 0.0f), at = middle + vec3(0, 0, z);
    rose.add(m.stone, tube({at + 0.28f * radius * along, at + (radius + 0.03f) * along}, 0.045f, 6));
    // Between two spokes: a small arch that springs from both, near the rim.
    const float span = radius * 0.72f * std::sin(kPi / kSpokes);
    const vec3 aside(-along.y, along.x, 0.0f), turn = rotation(kOut, kPi / kSpokes) * along;
    const vec3 across = rotation(kOut, kPi / kSpokes) * aside;
    rose.add(m.stone, tube(lift(arc({0.0f, 0.0f}, span, 0.0f, kPi, 8),
                                at + 0.72f * radius * std::cos(kPi / kSpokes) * turn, across, turn),
                           0.04f, 6));
  }
  return rose;
}

}  // namespace icbench
