// A stand-in for the Cathedral of St James in Sibenik: a nave of six bays with round arches on columns, a barrel vault
// on ribs, aisles, a polygonal apse; the light comes through small windows. A yellow box moves through the nave, as in
// the Sibenik animation of Dubla 2012, section 6.3.2.
#include <array>
#include <cmath>
#include <numbers>

#include "scene/architecture.h"
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

using glm::vec3;

constexpr float kPi = std::numbers::pi_v<float>;

// The nave runs from z = 0 to z = -kLength; x is measured from its axis.
constexpr int kBays = 6;
constexpr float kPitch = 3.7f, kLength = kBays * kPitch;
constexpr float kNave = 3.25f, kArcade = 0.6f, kAisle = 7.0f,
                kOuter = 0.8f;  // inner faces, thickness of walls
constexpr float kColumn = 0.36f, kArch = 1.42f, kArchSpringing = 4.3f;
constexpr float kString = 6.25f, kVault = 10.2f, kAisleVault = 6.0f;
constexpr float kTriumph = 2.7f, kTriumphSpringing = 6.4f;  // the arch before the apse
constexpr float kApse = 3.0f, kApseZ = -kLength - 0.7f, kPlatform = 0.48f;

struct Stone {
  std::uint32_t light, warm, dark, red, cream, slate, wood, gold, cloth;
  WindowMaterials sky, evening;
};

Stone add_stone(Scene& s) {
  Stone c;
  c.light = s.add_material({.albedo = {0.74f, 0.70f, 0.62f}});
  c.warm = s.add_material({.albedo = {0.68f, 0.60f, 0.48f}});
  c.dark = s.add_material({.albedo = {0.20f, 0.19f, 0.18f}});
  c.red = s.add_material({.albedo = {0.52f, 0.27f, 0.20f}});
  c.cream = s.add_material({.albedo = {0.70f, 0.65f, 0.55f}});
  c.slate = s.add_material({.albedo = {0.38f, 0.37f, 0.36f}});
  c.wood = s.add_material({.albedo = {0.25f, 0.14f, 0.07f}});
  c.gold = s.add_material({.albedo = {0.72f, 0.53f, 0.18f}});
  c.cloth = s.add_material({.albedo = {0.80f, 0.78f, 0.74f}});
  const auto sky = s.add_material({.emission = {10.5f, 11.4f, 12.6f}});
  const auto evening = s.add_material({.emission = {19.0f, 16.0f, 11.5f}});
  c.sky = {c.light, c.dark, sky};
  c.evening = {c.light, c.dark, evening};
  return c;
}

// One plane of half-metre squares, each of two triangles, in a pattern: diamonds in the nave, a chequer in the aisles.
void add_floor(Scene& s, const Stone& c) {
  constexpr float kSquare = 0.5f;
  constexpr int kAcross = 15, kAlong = 54;  // squares on each side of the axis; from z = 0.5
  std::map<std::uint32_t, Mesh> sheets;
  const auto add = [&](std::uint32_t material, const std::array<glm::ivec2, 3>& corners) {
    Mesh& m = sheets[material];
    const auto first = static_cast<std::uint32_t>(m.positions.size());
    for (const glm::ivec2& p : corners)
      m.positions.emplace_back(kSquare * static_cast<float>(p.x), 0.0f,
                               0.5f - kSquare * static_cast<float>(p.y));
    m.triangles.emplace_back(first, first + 1, first + 2);
  };
  for (int i = -kAcross; i < kAcross; ++i)
    for (int j = 0; j < kAlong; ++j) {
      const glm::ivec2 a(i, j), b(i + 1, j), d(i + 1, j + 1), e(i, j + 1);
      const int column = (i + kAcross + 1) / 2, row = j / 2, out = i < 0 ? -1 - i : i;
      std::uint32_t inner = c.cream, outer = c.cream;
      if (out < 6)
        inner = (column + row) & 1 ? c.red : c.dark;
      else if (out == 6 || (out / 2 + row) & 1)
        inner = outer = c.slate;
      // Two by two squares make a diamond: diagonals alternate.
      const bool right = (i + kAcross + 1) & 1, far = j & 1;
      if (right == far) {
        add(right ? inner : outer, {a, b, e});
        add(right ? outer : inner, {b, d, e});
      } else {
        add(right ? inner : outer, {a, d, e});
        add(right ? outer : inner, {a, b, d});
      }
    }
  for (auto& [material, mesh] : sheets) {
    s.meshes.push_back(shade(mesh));
    s.meshes.back().name = "floor";
    s.meshes.back().material = material;
  }
}

// One side of the nave: the arcade on its columns with the clerestory, and the aisle; +x, to be mirrored.
Parts right_side(const Stone& c) {
  constexpr float kMiddle = -0.5f * kLength, kArcadeTop = kVault + 0.5f;
  const Pose facing = turned(-0.5f * kPi, {kNave, 0, kMiddle}),
             back = turned(0.5f * kPi, {kNave + kArcade, 0, kMiddle});
  const Pose outer = turned(-0.5f * kPi, {kAisle, 0, kMiddle});
  Parts side;
  std::vector<Polygon> clerestory, low;
  for (int i = 0; i < kBays; ++i) {
    const float x = kPitch * (static_cast<float>(i) - 0.5f * (kBays - 1));
    clerestory.push_back(arched_opening(x, 0.75f, 8.3f, 9.2f, 10));
    low.push_back(arched_opening(x, 0.85f, 2.5f, 4.3f, 10));
    side.add(arched_window(x, 0.75f, 8.3f, 9.2f, 0.32f, 10, c.sky), facing);
    side.add(arched_window(x, 0.85f, 2.5f, 4.3f, 0.32f, 10, c.sky), outer);
    side.add(c.light, moved(archivolt({x, kArchSpringing}, kArch, 0.36f, 0.0f, 18), facing));
    side.add(c.light, moved(archivolt({x, kArchSpringing}, kArch, 0.36f, 0.0f, 18), back));
  }
  side.add(c.warm, moved(wall(arcade(kBays, kPitch, kArch, kArchSpringing - 0.03f, kArcadeTop, 0.3f, 24),
                              kArcade, clerestory),
                         facing));
  side.add(
      c.warm,
      moved(wall(rectangle({-0.5f * kLength - 0.4f, -0.15f}, {0.5f * kLength + 0.4f, kAisleVault + 0.6f}),
                 kOuter, low),
            outer));
  const Parts support = column(kColumn, kArchSpringing, c.light);
  const float shaft = kArchSpringing;
  const Parts vaulting_shaft = colonnette(0.12f, kVault - 0.45f - shaft, c.light);
  for (int i = 0; i <= kBays; ++i) {
    const float z = -kPitch * static_cast<float>(i);
    side.add(support, turned(0.0f, {kNave + 0.5f * kArcade, 0, z}));
    if (i == 0 || i == kBays) continue;
    side.add(vaulting_shaft, turned(0.0f, {kNave - 0.02f, shaft + kGap, z}));
    const Mesh rib = vault_rib(0.5f * (kAisle - kNave - kArcade) + 0.01f, 0.42f, 0.16f, 0.4f, 16);
    side.add(c.light, moved(rib, turned(0.0f, {0.5f * (kAisle + kNave + kArcade), kAisleVault, z})));
    side.add(colonnette(0.13f, kAisleVault - 0.35f, c.light), turned(0.0f, {kAisle - 0.03f, 0, z}));
  }
  const float start = 0.15f, end = -kLength - 0.15f;
  side.add(c.light, cornice({{kNave, kString, end}, {kNave, kString, start}}, 0.24f));
  side.add(c.light, cornice({{kNave, kVault - 0.45f, end}, {kNave, kVault - 0.45f, start}}, 0.40f));
  side.add(c.light,
           cornice({{kAisle, kAisleVault - 0.35f, end}, {kAisle, kAisleVault - 0.35f, start}}, 0.24f));
  const float span = 0.5f * (kAisle - kNave - kArcade) + 0.01f;
  side.add(c.warm, moved(barrel_vault(span, kLength + 0.5f, 0.25f, 0.3f, 32),
                         turned(0.0f, {0.5f * (kAisle + kNave + kArcade), kAisleVault, 0.25f})));
  return side;
}

void add_nave(Parts& church, const Stone& c) {
  const Parts side = right_side(c);
  church.add(side);
  for (const auto& [material, mesh] : side.meshes()) church.add(material, mirrored(mesh));
  church.add(c.warm, moved(barrel_vault(kNave + 0.01f, kLength + 0.5f, 0.3f, 0.3f, 48),
                           turned(0.0f, {0, kVault, 0.25f})));
  for (int i = 0; i < kBays; ++i)  // above each vaulting shaft; a thin one amid each bay
    for (const bool between : {false, true}) {
      if (i == 0 && !between) continue;
      const float z = -kPitch * (static_cast<float>(i) + (between ? 0.5f : 0.0f));
      church.add(c.light,
                 moved(vault_rib(kNave + 0.01f, between ? 0.16f : 0.44f, between ? 0.08f : 0.22f, 0.2f, 28),
                       turned(0.0f, {0, kVault, z})));
    }
}

void add_end_walls(Parts& church, const Stone& c) {
  constexpr float kHalf = kAisle + kOuter - 0.1f, kTop = kVault + kNave + 0.9f, kThick = 0.8f;
  const Polygon outline = rectangle({-kHalf, -0.2f}, {kHalf, kTop});
  const Pose west = turned(kPi, vec3(0.0f)), east = turned(0.0f, {0, 0, -kLength});
  const std::array<Polygon, 1> rose{circle({0.0f, 8.4f}, 1.7f, 64)};
  church.add(c.warm, moved(wall(outline, kThick, rose), west));
  church.add(rose_window({0.0f, 8.4f}, 1.7f, 0.5f, c.evening), west);
  church.add(c.light, moved(archivolt({0.0f, 3.2f}, 1.3f, 0.4f, 3.2f - kGap, 32), west));
  church.add(c.wood,
             moved(extrude(arched_opening(0.0f, 2.62f, 0.01f, 3.2f, 32), 0.10f), turned(kPi, {0, 0, 0.05f})));

  const float aisle = 0.5f * (kAisle + kNave + kArcade), oculus = kVault + 1.35f;
  const std::array<Polygon, 4> openings{
      arched_opening(0.0f, 2.0f * kTriumph, -0.1f, kTriumphSpringing, 48), circle({0.0f, oculus}, 0.62f, 48),
      arched_opening(-aisle, 0.9f, 2.3f, 4.2f, 24), arched_opening(aisle, 0.9f, 2.3f, 4.2f, 24)};
  church.add(c.warm, moved(wall(outline, kThick, openings), east));
  church.add(c.light, moved(archivolt({0.0f, kTriumphSpringing}, kTriumph, 0.42f, 0.0f, 48), east));
  church.add(rose_window({0.0f, oculus}, 0.62f, 0.4f, c.sky), east);
  for (const float x : {-aisle, aisle})
    church.add(arched_window(x, 0.9f, 2.3f, 4.2f, 0.32f, 24, c.sky), east);
  for (const float x : {-kTriumph, kTriumph})
    church.add(colonnette(0.17f, kTriumphSpringing - 0.02f, c.light),
               turned(0.0f, {x * 1.02f, 0, -kLength + 0.03f}));
}

// Five sides of a decagon under half a dome.
void add_apse(Parts& church, const Stone& c) {
  constexpr int kSides = 5;
  const float side = 2.0f * kApse * std::sin(0.5f * kPi / kSides),
              deep = kApse * std::cos(0.5f * kPi / kSides);
  const std::array<Polygon, 1> opening{arched_opening(0.0f, 0.75f, 2.5f, 4.9f, 24)};
  Path foot;
  for (int i = 0; i <= kSides; ++i) {
    const float angle = kPi * static_cast<float>(i) / kSides;
    const vec3 corner(kApse * std::cos(angle), 0.0f, kApseZ - kApse * std::sin(angle));
    foot.push_back(corner);
    if (i > 0 && i < kSides) {
      const vec3 inward = glm::normalize(vec3(0, 0, kApseZ) - corner);
      church.add(colonnette(0.10f, kTriumphSpringing - 0.25f, c.light),
                 turned(0.0f, corner + 0.05f * inward));
      Path meridian;
      for (int k = 0; k <= 20; ++k) {
        const float e = 0.5f * kPi * (static_cast<float>(k) - 0.5f) / 20.0f;
        meridian.push_back(vec3(0, kTriumphSpringing, kApseZ) -
                           kApse * (std::cos(e) * inward - std::sin(e) * vec3(0, 1, 0)));
      }
      church.add(c.light, tube(meridian, 0.09f, 8));
    }
    if (i == kSides) break;
    // The wall's front looks back at the axis.
    const float middle = angle + 0.5f * kPi / kSides;
    const vec3 at(deep * std::cos(middle), 0.0f, kApseZ - deep * std::sin(middle));
    const Pose facing = turned(middle - 0.5f * kPi, at);
    // The walls overlap at their ends: tops in planes of their own.
    const float step = 0.01f * static_cast<float>(i);
    const Polygon outline = rectangle({-0.5f * side - 0.25f, -0.25f - step},
                                      {0.5f * side + 0.25f, kTriumphSpringing + 0.2f + step});
    const bool lit = i > 0 && i + 1 < kSides;
    church.add(c.warm, moved(wall(outline, 0.6f,
                                  lit ? std::span<const Polygon>(opening) : std::span<const Polygon>()),
                             facing));
    if (lit) church.add(arched_window(0.0f, 0.75f, 2.5f, 4.9f, 0.3f, 24, c.evening), facing);
  }
  church.add(c.warm, moved(half_dome(kApse, 0.3f, 0.15f, 14), turned(0.0f, {0, kTriumphSpringing, kApseZ})));
  church.add(c.light, moved(cornice(foot, 0.28f), turned(0.0f, {0, kTriumphSpringing - 0.25f, 0})));
}

void add_sanctuary(Parts& church, const Stone& c) {
  for (int i = 0; i < 3; ++i) {
    const float f = static_cast<float>(i), x = 2.9f - 0.3f * f;
    church.add(
        i % 2 ? c.slate : c.cream,
        box("", {{-x, -0.2f - 0.01f * f, -26.2f - 0.01f * f}, {x, 0.16f * (f + 1.0f), -19.6f - 0.36f * f}},
            0));
  }
  const float y = kPlatform + kGap;
  const auto altar = [&](float w, float d, float from, float to, std::uint32_t stone) {
    church.add(stone, box("", {{-w, y + from, -23.4f - d}, {w, y + to, -23.4f + d}}, 0));
  };
  altar(1.25f, 0.55f, 0.0f, 0.14f, c.slate);
  altar(1.10f, 0.42f, 0.13f, 0.93f, c.red);
  altar(1.22f, 0.52f, 0.92f, 1.02f, c.cloth);
  static constexpr glm::vec2 kCandlestick[] = {
      {0.0f, 0.0f},    {0.085f, 0.0f},  {0.085f, 0.0f},  {0.08f, 0.03f},  {0.03f, 0.06f},
      {0.018f, 0.10f}, {0.035f, 0.14f}, {0.018f, 0.18f}, {0.018f, 0.36f}, {0.035f, 0.40f},
      {0.05f, 0.44f},  {0.05f, 0.44f},  {0.05f, 0.45f},  {0.05f, 0.45f},  {0.018f, 0.45f},
      {0.018f, 0.45f}, {0.018f, 0.75f}, {0.018f, 0.75f}, {0.0f, 0.75f}};
  for (const float x : {-0.95f, -0.65f, -0.35f, 0.35f, 0.65f, 0.95f})
    church.add(c.gold, revolve("candlestick", {x, y + 1.02f + kGap, -23.55f}, kCandlestick, 20, c.gold));
  const float foot = y + 1.02f + kGap;
  church.add(c.gold, box("", {{-0.14f, foot, -23.65f}, {0.14f, foot + 0.10f, -23.45f}}, 0));
  church.add(c.gold, box("", {{-0.03f, foot + 0.09f, -23.58f}, {0.03f, foot + 1.15f, -23.52f}}, 0));
  church.add(c.gold, box("", {{-0.28f, foot + 0.77f, -23.575f}, {0.28f, foot + 0.83f, -23.525f}}, 0));
}

// Up and down the nave on a narrow ellipse, turning once.
Pose through_the_nave(float frame) {
  const float phase = loop_angle(frame);
  return turned(phase, {1.3f * std::sin(phase), 0.6f + kGap, -11.6f + 5.6f * std::cos(phase)});
}

}  // namespace

Scene sibenik() {
  Scene s;
  s.frames = kLoopFrames;
  const Stone c = add_stone(s);
  Parts church;
  add_floor(s, c);
  add_nave(church, c);
  add_end_walls(church, c);
  add_apse(church, c);
  add_sanctuary(church, c);
  church.build(s, "cathedral");
  const auto yellow = s.add_material({.albedo = {0.78f, 0.62f, 0.06f}});
  s.meshes.push_back(box("yellow box", {{-0.6f, -0.6f, -0.6f}, {0.6f, 0.6f, 0.6f}}, yellow));
  s.meshes.back().pose = through_the_nave;
  s.camera = {.eye = {0.45f, 2.5f, -0.6f}, .target = {0.0f, 5.5f, -14.0f}, .up = {0, 1, 0}, .fov_y = 1.12f};
  return s;
}

}  // namespace icbench
