// A stand-in for the conference room of the Lawrence Berkeley Laboratory (Grynberg and Ward): a room of 35.5 by 22 by
// 8.9 feet, a long table with 12 chairs, 20 more along the walls, lit by panels in the ceiling. A green bunny crosses
// the table and comes back, as in the Conference animation of Dubla 2012, section 6.3.2.
#include <cmath>
#include <numbers>

#include "scene/furniture.h"
#include "scene/import_mesh.h"
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

using glm::vec3;

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kFoot = 0.3048f;
constexpr float kLength = 35.5f * kFoot, kWidth = 22.0f * kFoot, kHeight = 8.9f * kFoot;  // along x, z, y
constexpr float kX = 0.5f * kLength, kZ = 0.5f * kWidth;
constexpr float kTableLength = 6.2f, kTableWidth = 1.55f, kTableHeight = 0.74f;
constexpr float kDoorX = 4.1f, kDoorWidth = 0.95f, kDoorHeight = 2.1f;
constexpr float kWindowWidth = 1.5f, kWindowHeight = 1.3f, kSill = 0.98f;
constexpr float kWindows[] = {-2.05f, 0.0f, 2.05f};

struct Colours {
  std::uint32_t wall, ceiling, carpet, white, lamp, sky, top, base, dark, metal, board, red, blue, paper;
  ChairMaterials chair;
};

Colours add_colours(Scene& s) {
  Colours c;
  c.wall = s.add_material({.albedo = {0.70f, 0.62f, 0.49f}});
  c.ceiling = s.add_material({.albedo = {0.80f, 0.79f, 0.76f}});
  c.carpet = s.add_material({.albedo = {0.20f, 0.24f, 0.31f}});
  c.white = s.add_material({.albedo = {0.78f, 0.76f, 0.71f}});
  c.lamp = s.add_material({.emission = {17.0f, 16.0f, 14.0f}});
  c.sky = s.add_material({.emission = {1.7f, 2.1f, 2.7f}});
  c.top = s.add_material({.albedo = {0.47f, 0.24f, 0.10f}});
  c.base = s.add_material({.albedo = {0.24f, 0.12f, 0.06f}});
  c.dark = s.add_material({.albedo = {0.16f, 0.10f, 0.07f}});
  c.metal = s.add_material({.albedo = {0.52f, 0.51f, 0.49f}});
  c.board = s.add_material({.albedo = {0.83f, 0.84f, 0.84f}});
  c.red = s.add_material({.albedo = {0.55f, 0.13f, 0.08f}});
  c.blue = s.add_material({.albedo = {0.12f, 0.25f, 0.48f}});
  c.paper = s.add_material({.albedo = {0.82f, 0.81f, 0.77f}});
  c.chair = {s.add_material({.albedo = {0.46f, 0.09f, 0.08f}}),
             s.add_material({.albedo = {0.12f, 0.12f, 0.13f}}),
             s.add_material({.albedo = {0.30f, 0.15f, 0.07f}})};
  return c;
}

// Two rows of four recessed panels, each of 2 by 4 feet, in a grid of 2 feet.
void add_ceiling(Scene& s, Parts& room, const Colours& c) {
  constexpr float kTile = 2.0f * kFoot, kDeep = 0.10f;
  std::vector<Polygon> recesses;
  for (const float row : {-2.5f, 2.5f})
    for (int i = 0; i < 4; ++i) {
      const glm::vec2 middle(4.0f * kTile * (static_cast<float>(i) - 1.5f), row * kTile);
      const glm::vec2 half(kTile - 0.03f, 0.5f * kTile - 0.03f);
      recesses.push_back(rectangle(middle - half, middle + half));
      const glm::vec2 lamp = half + 0.01f;
      s.meshes.push_back(quad("panel", {middle.x - lamp.x, kHeight + 0.004f, middle.y - lamp.y},
                              {2.0f * lamp.x, 0, 0}, {0, 0, 2.0f * lamp.y}, c.lamp));
    }
  const Polygon outline = rectangle({-kX - 0.05f, -kZ - 0.05f}, {kX + 0.05f, kZ + 0.05f});
  room.add(c.ceiling, moved(extrude(outline, kDeep, recesses),
                            {rotation({1, 0, 0}, 0.5f * kPi), {0, kHeight + kDeep, 0}}));
  for (int i = -8; i <= 8; ++i) {
    const float x = kTile * static_cast<float>(i);
    room.add(
        c.white,
        box("", {{x - 0.012f, kHeight - 0.005f, -kZ - 0.01f}, {x + 0.012f, kHeight + 0.001f, kZ + 0.01f}},
            0));
  }
  for (int i = -5; i <= 5; ++i) {
    const float z = kTile * static_cast<float>(i);
    room.add(
        c.white,
        box("", {{-kX - 0.01f, kHeight - 0.004f, z - 0.012f}, {kX + 0.01f, kHeight + 0.002f, z + 0.012f}},
            0));
  }
}

void add_walls(Scene& s, Parts& room, const Colours& c) {
  constexpr float kThick = 0.25f;
  s.meshes.push_back(
      quad("floor", {-kX - 0.1f, 0, -kZ - 0.1f}, {0, 0, kWidth + 0.2f}, {kLength + 0.2f, 0, 0}, c.carpet));
  const Polygon side = rectangle({-kX - 0.1f, -0.05f}, {kX + 0.1f, kHeight + 0.08f});
  const Polygon end = rectangle({-kZ - 0.12f, -0.06f}, {kZ + 0.12f, kHeight + 0.07f});
  const Polygon doorway =
      rectangle({kDoorX - 0.5f * kDoorWidth, -0.02f}, {kDoorX + 0.5f * kDoorWidth, kDoorHeight});
  room.add(c.wall, moved(extrude(side, kThick, std::span(&doorway, 1)), turned(0.0f, {0, 0, -kZ - kThick})));
  room.add(c.wall, moved(extrude(side, kThick), turned(0.0f, {0, 0, kZ})));
  room.add(c.wall, moved(extrude(end, kThick), turned(0.5f * kPi, {-kX - kThick, 0, 0})));
  std::vector<Polygon> openings;
  for (const float z : kWindows)
    openings.push_back(
        rectangle({-z - 0.5f * kWindowWidth, kSill}, {-z + 0.5f * kWindowWidth, kSill + kWindowHeight}));
  room.add(c.wall, moved(extrude(end, kThick, openings), turned(0.5f * kPi, {kX, 0, 0})));
  for (const float z : kWindows) {
    room.add(window_frame(kWindowWidth, kWindowHeight, 2, 2, c.white), turned(-0.5f * kPi, {kX, kSill, z}));
    const float w = kWindowWidth + 0.04f;
    s.meshes.push_back(quad("sky", {kX + 0.2f, kSill - 0.02f, z - 0.5f * w}, {0, 0, w},
                            {0, kWindowHeight + 0.04f, 0}, c.sky));
  }
  room.add(door(kDoorWidth, kDoorHeight, c.top, c.base, c.metal), turned(0.0f, {kDoorX, 0, -kZ}));
  const float right = kDoorX + 0.5f * kDoorWidth + 0.05f, left = kDoorX - 0.5f * kDoorWidth - 0.05f;
  room.add(c.base,
           skirting({{left, 0, -kZ}, {-kX, 0, -kZ}, {-kX, 0, kZ}, {kX, 0, kZ}, {kX, 0, -kZ}, {right, 0, -kZ}},
                    0.11f));
}

void add_pictures(Parts& room, const Colours& c) {
  room.add(whiteboard(3.0f, 1.2f, c.board, c.metal, c.blue), turned(0.0f, {0.55f, 1.68f, -kZ}));
  room.add(picture(0.75f, 0.95f, c.dark, c.paper, c.blue), turned(0.0f, {-2.2f, 1.66f, -kZ}));
  room.add(picture(0.75f, 0.95f, c.dark, c.paper, c.red), turned(0.0f, {-3.5f, 1.66f, -kZ}));
  room.add(picture(0.75f, 0.95f, c.dark, c.paper, c.top), turned(0.0f, {-4.7f, 1.66f, -kZ}));
  room.add(picture(1.5f, 0.9f, c.dark, c.paper, c.blue), turned(kPi, {1.6f, 1.68f, kZ}));
  room.add(picture(1.5f, 0.9f, c.dark, c.paper, c.carpet), turned(kPi, {-1.6f, 1.68f, kZ}));
  room.add(picture(1.7f, 1.0f, c.dark, c.paper, c.red), turned(0.5f * kPi, {-kX, 1.68f, 0}));
}

void add_chairs(Parts& room, const Colours& c) {
  const Parts chair = conference_chair(c.chair);
  const float end = 0.5f * kTableLength + 0.30f, side = 0.5f * kTableWidth + 0.22f;
  for (int i = 0; i < 5; ++i) {
    const float x = 1.14f * (static_cast<float>(i) - 2.0f),
                askew = 0.09f * std::sin(2.7f * static_cast<float>(i));
    room.add(chair, turned(askew, {x, 0, -side - 0.03f * std::abs(askew)}));
    room.add(chair, turned(kPi + askew, {x + 0.04f, 0, side}));
  }
  room.add(chair, turned(0.5f * kPi, {-end, 0, 0.03f}));
  room.add(chair, turned(-0.5f * kPi - 0.08f, {end, 0, -0.02f}));
  for (int i = 0; i < 7; ++i) {
    const float x = 0.95f * static_cast<float>(i);
    room.add(chair, turned(0.0f, {-4.25f + x, 0, -kZ + 0.36f}));
    room.add(chair, turned(kPi, {-2.3f + x, 0, kZ - 0.36f}));
  }
  for (int i = 0; i < 3; ++i) {
    const float z = 1.0f * static_cast<float>(i - 1);
    room.add(chair, turned(0.5f * kPi, {-kX + 0.36f, 0, z - 0.2f}));
    room.add(chair, turned(-0.5f * kPi, {kX - 0.40f, 0, 1.3f * z}));
  }
}

void add_papers(Parts& room, const Colours& c) {
  constexpr float kTop = kTableHeight + kGap;
  for (int i = 0; i < 5; ++i)
    for (const float side : {-1.0f, 1.0f}) {
      const float x = 1.14f * (static_cast<float>(i) - 2.0f), askew = 0.25f * std::sin(5.1f * x + side);
      room.add(c.paper, moved(box("", {{-0.105f, 0, -0.14f}, {0.105f, 0.006f, 0.14f}}, 0),
                              turned(askew, {x, kTop, side * 0.57f})));
      room.add(i % 2 ? c.blue : c.red, moved(tube({{0, 0.005f, -0.07f}, {0, 0.005f, 0.07f}}, 0.004f),
                                             turned(0.4f - askew, {x + 0.15f, kTop, side * 0.57f})));
      if ((i + (side > 0.0f)) % 2 == 0)
        room.add(mug(c.board), turned(1.3f * x, {x - 0.19f, kTableHeight, side * 0.58f}));
    }
}

// There and back on a narrow ellipse, looking ahead (the bunny's head is at -x).
Pose across_the_table(float frame) {
  constexpr float kReach = 2.35f, kAside = 0.22f, kTall = 0.45f;
  const float c = std::cos(loop_angle(frame)), s = std::sin(loop_angle(frame));
  return turned(std::atan2(kAside * c, -kReach * s), {-kReach * c, kTableHeight + kGap, kAside * s}, kTall);
}

}  // namespace

Scene conference() {
  Scene s;
  s.frames = kLoopFrames;
  const Colours c = add_colours(s);
  Parts room;
  add_walls(s, room, c);
  add_ceiling(s, room, c);
  add_pictures(room, c);
  add_chairs(room, c);
  room.add(conference_table(kTableLength, kTableWidth, kTableHeight, c.top, c.base));
  add_papers(room, c);
  room.build(s, "conference");
  Mesh bunny = stanford_bunny(s.add_material({.albedo = {0.13f, 0.52f, 0.12f}}));
  bunny.pose = across_the_table;
  s.meshes.push_back(std::move(bunny));
  s.camera = {.eye = {-4.2f, 1.80f, 2.35f}, .target = {0.3f, 0.74f, -0.40f}, .up = {0, 1, 0}, .fov_y = 0.84f};
  return s;
}

}  // namespace icbench
