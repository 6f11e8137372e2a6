// A stand-in for an office: desk, swivel chair, bookcase, two lights under the ceiling and a window behind venetian
// blinds, whose slats are thinner than a pixel. Nothing moves: Dubla 2012 shows the Office as a still.
#include <array>
#include <numbers>

#include "scene/furniture.h"
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

using glm::vec3;

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kX = 2.1f, kZ = 2.6f, kHeight = 2.7f;  // the room reaches from -kX to kX and from -kZ to kZ
constexpr float kWindowX = 0.25f, kWindowWidth = 2.3f, kWindowHeight = 1.45f, kSill = 0.92f;
constexpr float kDoorZ = 0.35f, kDoorWidth = 0.9f, kDoorHeight = 2.05f;
constexpr float kDesk = 0.75f, kDeskX = 0.35f, kDeskZ = -kZ + 0.52f;

struct Colours {
  std::uint32_t wall, ceiling, floor, white, lamp, sky, oak, walnut, metal, black, screen, green, clay, paper;
  std::array<std::uint32_t, 6> bindings;
  ChairMaterials chair;
};

Colours add_colours(Scene& s) {
  const auto paint = [&](float r, float g, float b) { return s.add_material({.albedo = {r, g, b}}); };
  Colours c;
  c.wall = paint(0.72f, 0.69f, 0.60f);
  c.ceiling = paint(0.82f, 0.82f, 0.80f);
  c.floor = paint(0.33f, 0.27f, 0.22f);
  c.white = paint(0.80f, 0.80f, 0.78f);
  c.lamp = s.add_material({.emission = {23.0f, 21.6f, 19.0f}});
  c.sky = s.add_material({.emission = {2.0f, 2.45f, 3.0f}});
  c.oak = paint(0.52f, 0.34f, 0.17f);
  c.walnut = paint(0.30f, 0.17f, 0.09f);
  c.metal = paint(0.50f, 0.50f, 0.51f);
  c.black = paint(0.06f, 0.06f, 0.07f);
  c.screen = paint(0.10f, 0.13f, 0.18f);
  c.green = paint(0.12f, 0.34f, 0.10f);
  c.clay = paint(0.55f, 0.28f, 0.17f);
  c.paper = paint(0.82f, 0.81f, 0.77f);
  c.bindings = {paint(0.48f, 0.08f, 0.07f), paint(0.09f, 0.19f, 0.40f), paint(0.10f, 0.30f, 0.15f),
                paint(0.60f, 0.44f, 0.14f), paint(0.15f, 0.13f, 0.13f), paint(0.68f, 0.62f, 0.50f)};
  c.chair = {paint(0.10f, 0.16f, 0.32f), c.black, c.black};
  return c;
}

void add_room(Scene& s, Parts& room, const Colours& c) {
  constexpr float kThick = 0.25f;
  s.meshes.push_back(quad("floor", {-kX - 0.1f, 0, -kZ - 0.1f}, {0, 0, 2.0f * kZ + 0.2f},
                          {2.0f * kX + 0.2f, 0, 0}, c.floor));
  s.meshes.push_back(quad("ceiling", {-kX - 0.1f, kHeight, -kZ - 0.1f}, {2.0f * kX + 0.2f, 0, 0},
                          {0, 0, 2.0f * kZ + 0.2f}, c.ceiling));
  const Polygon end = rectangle({-kX - 0.1f, -0.05f}, {kX + 0.1f, kHeight + 0.08f});
  const Polygon side = rectangle({-kZ - 0.12f, -0.06f}, {kZ + 0.12f, kHeight + 0.07f});
  const std::array window{rectangle({kWindowX - 0.5f * kWindowWidth, kSill},
                                    {kWindowX + 0.5f * kWindowWidth, kSill + kWindowHeight})};
  const std::array doorway{
      rectangle({kDoorZ - 0.5f * kDoorWidth, -0.02f}, {kDoorZ + 0.5f * kDoorWidth, kDoorHeight})};
  const vec3 behind(0, 0, -kThick);
  room.add(c.wall, moved(extrude(end, kThick, window), turned(0.0f, vec3(0, 0, -kZ) + behind)));
  room.add(c.wall, moved(extrude(end, kThick), turned(kPi, vec3(0, 0, kZ) - behind)));
  room.add(c.wall, moved(extrude(side, kThick), turned(0.5f * kPi, {-kX - kThick, 0, 0})));
  room.add(c.wall, moved(extrude(side, kThick, doorway), turned(-0.5f * kPi, {kX + kThick, 0, 0})));

  const vec3 foot(kWindowX, kSill, -kZ);
  room.add(window_frame(kWindowWidth, kWindowHeight, 3, 1, c.white), turned(0.0f, foot));
  const float w = kWindowWidth + 0.04f;
  s.meshes.push_back(
      quad("sky", foot + vec3(-0.5f * w, -0.02f, -0.2f), {w, 0, 0}, {0, kWindowHeight + 0.04f, 0}, c.sky));
  room.add(venetian_blind(kWindowWidth - 0.012f, kWindowHeight - 0.05f, 0.021f, 0.75f, c.white),
           turned(0.0f, foot + vec3(0, kWindowHeight - 0.002f, -0.026f)));

  room.add(door(kDoorWidth, kDoorHeight, c.oak, c.white, c.metal), turned(-0.5f * kPi, {kX, 0, kDoorZ}));
  const float before = kDoorZ - 0.5f * kDoorWidth - 0.05f, beyond = kDoorZ + 0.5f * kDoorWidth + 0.05f;
  room.add(
      c.white,
      skirting({{kX, 0, before}, {kX, 0, -kZ}, {-kX, 0, -kZ}, {-kX, 0, kZ}, {kX, 0, kZ}, {kX, 0, beyond}},
               0.09f));
}

// A flat housing under the ceiling with a diffuser that closes it below: the light.
void add_ceiling_light(Scene& s, Parts& room, const Colours& c, const vec3& at) {
  constexpr float kHalf = 0.62f, kWide = 0.16f, kDeep = 0.07f;
  const std::array opening{rectangle({-kHalf + 0.015f, -kWide + 0.015f}, {kHalf - 0.015f, kWide - 0.015f})};
  room.add(c.white, moved(extrude(rectangle({-kHalf, -kWide}, {kHalf, kWide}), kDeep, opening),
                          {rotation({1, 0, 0}, 0.5f * kPi), at + vec3(0, kGap * 5.0f, 0)}));
  const vec3 corner = at + vec3(-kHalf + 0.01f, 0.009f - kDeep, -kWide + 0.01f);
  s.meshes.push_back(
      quad("ceiling light", corner, {2.0f * kHalf - 0.02f, 0, 0}, {0, 0, 2.0f * kWide - 0.02f}, c.lamp));
}

void add_desk(Parts& room, const Colours& c) {
  const auto on_desk = [](float x, float z, float angle = 0.0f) {
    return turned(angle, {kDeskX + x, kDesk, kDeskZ + z});
  };
  const auto lying = [](const vec3& size) {
    return box("", {{-0.5f * size.x, kGap, -0.5f * size.z}, {0.5f * size.x, size.y, 0.5f * size.z}}, 0);
  };
  room.add(desk_with_drawers(1.9f, 0.85f, c.walnut, c.metal), turned(0.0f, {kDeskX, 0, kDeskZ}));
  room.add(computer(c.black, c.screen), on_desk(-0.05f, -0.16f, 0.12f));
  room.add(table_lamp(c.metal, c.bindings[2]), on_desk(-0.74f, -0.20f));
  room.add(mug(c.paper), on_desk(0.48f, 0.12f, 0.7f));
  room.add(c.paper, moved(lying({0.21f, 0.014f, 0.297f}), on_desk(0.68f, 0.10f, 0.2f)));
  room.add(c.paper, moved(lying({0.21f, 0.003f, 0.297f}), on_desk(-0.55f, 0.18f, -0.25f)));
  const float stack[] = {0.035f, 0.025f, 0.045f};
  float y = 0.0f;
  for (int i = 0; i < 3; ++i) {
    Mesh book = rounded_box({{-0.09f, kGap, -0.125f}, {0.09f, stack[i], 0.125f}}, 0.004f, 1);
    Pose pose = on_desk(0.70f, -0.24f, 0.25f * static_cast<float>(i) - 0.2f);
    pose.shift.y += y;
    room.add(c.bindings[static_cast<std::size_t>(i)], moved(std::move(book), pose));
    y += stack[i];
  }
}

}  // namespace

Scene office() {
  Scene s;
  const Colours c = add_colours(s);
  Parts room;
  add_room(s, room, c);
  for (const float z : {-0.9f, 1.1f}) add_ceiling_light(s, room, c, {0.1f, kHeight, z});
  add_desk(room, c);
  room.add(swivel_chair(c.chair), turned(kPi - 0.55f, {0.22f, 0, -1.02f}));
  room.add(bookcase({1.7f, 2.1f, 0.30f}, 6, c.oak, c.bindings),
           turned(-0.5f * kPi, {kX - 0.016f, 0, -1.32f}));
  room.add(waste_basket(c.metal), turned(0.0f, {1.42f, 0, -1.42f}));
  room.add(pot_plant(c.clay, c.green), turned(0.3f, {-1.45f, 0, -2.12f}));
  room.add(picture(0.6f, 0.8f, c.walnut, c.paper, c.bindings[1]), turned(0.0f, {-1.50f, 1.68f, -kZ}));
  room.add(picture(0.9f, 0.6f, c.black, c.paper, c.clay), turned(kPi, {0.3f, 1.6f, kZ}));
  room.build(s, "office");
  s.camera = {
      .eye = {-1.75f, 1.60f, 1.95f}, .target = {0.27f, 1.06f, -1.10f}, .up = {0, 1, 0}, .fov_y = 0.96f};
  return s;
}

}  // namespace icbench
