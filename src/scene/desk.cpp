// A study: a desk with a monitor, a lamp, books and a mug on it, and a swivel chair that rolls about before it, as in
// the Desk animation of Dubla 2012, section 6.3.2.
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>
#include <vector>

#include "scene/motion.h"
#include "scene/registry.h"
#include "scene/room.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

using glm::vec3;

constexpr float kPi = std::numbers::pi_v<float>;
constexpr Bounds kRoom{{-2.1f, 0.0f, -2.0f}, {2.1f, 2.7f, 2.2f}};
constexpr Bounds kTop{{-0.95f, 0.715f, -1.93f}, {0.85f, 0.75f, -1.13f}};  // of the desk
constexpr float kOnDesk = 0.75f + kStandingGap;

struct Materials {
  std::uint32_t white, floor, left, right, rug, wood, dark_wood, metal, plastic, cloth, paper, screen, window,
      glow, lamp, brass, mug, leaf, clay, red, blue, green, ochre;
};

Materials add_materials(Scene& s) {
  const auto paint = [&](float r, float g, float b) { return s.add_material({.albedo = {r, g, b}}); };
  Materials m{};
  m.white = paint(0.76f, 0.74f, 0.70f);
  m.floor = paint(0.40f, 0.27f, 0.17f);
  m.left = paint(0.42f, 0.52f, 0.50f);
  m.right = paint(0.70f, 0.60f, 0.44f);
  m.rug = paint(0.46f, 0.15f, 0.13f);
  m.wood = paint(0.56f, 0.38f, 0.22f);
  m.dark_wood = paint(0.28f, 0.17f, 0.10f);
  m.metal = paint(0.42f, 0.42f, 0.43f);
  m.plastic = paint(0.09f, 0.09f, 0.10f);
  m.cloth = paint(0.14f, 0.22f, 0.42f);
  m.paper = paint(0.82f, 0.80f, 0.74f);
  m.screen = s.add_material({.albedo = vec3(0.05f), .emission = {0.10f, 0.22f, 0.42f}});
  m.window = s.add_material({.albedo = vec3(0.05f), .emission = vec3(0.75f)});
  m.glow = s.add_material({.emission = {60.0f, 47.0f, 28.0f}});
  m.lamp = s.add_material({.emission = {24.0f, 22.0f, 19.0f}});
  m.brass = paint(0.62f, 0.46f, 0.18f);
  m.mug = paint(0.74f, 0.28f, 0.14f);
  m.leaf = paint(0.12f, 0.34f, 0.10f);
  m.clay = paint(0.58f, 0.30f, 0.19f);
  m.red = paint(0.56f, 0.10f, 0.09f);
  m.blue = paint(0.11f, 0.22f, 0.50f);
  m.green = paint(0.13f, 0.38f, 0.20f);
  m.ochre = paint(0.66f, 0.48f, 0.14f);
  return m;
}

Mesh rod(const char* name, const vec3& a, const vec3& b, float radius, std::uint32_t material) {
  const vec3 path[] = {a, b};
  return tube(name, path, radius, 20, material);
}

Bounds cuboid(const vec3& foot, const vec3& size) {
  return {foot - vec3(0.5f * size.x, 0.0f, 0.5f * size.z), foot + vec3(0.5f * size.x, size.y, 0.5f * size.z)};
}

void add_desk(Scene& s, const Materials& m) {
  s.meshes.push_back(rounded_box("desk top", kTop, 0.008f, 3, m.wood));
  Mesh legs{"desk legs", {}, {}, {}, m.metal};
  const float under = kTop.lower.y - kStandingGap;
  for (const float z : {kTop.lower.z + 0.08f, kTop.upper.z - 0.08f})
    append(legs, rod("leg", {kTop.lower.x + 0.08f, kStandingGap, z}, {kTop.lower.x + 0.08f, under, z}, 0.025f,
                     m.metal));
  s.meshes.push_back(std::move(legs));
  const Bounds drawers{{0.38f, 0.03f, -1.90f}, {0.82f, under, -1.17f}};
  s.meshes.push_back(rounded_box("drawers", drawers, 0.006f, 2, m.dark_wood));
  Mesh fronts{"drawer fronts", {}, {}, {}, m.wood}, handles{"drawer handles", {}, {}, {}, m.brass};
  for (int i = 0; i < 3; ++i) {
    const float low = drawers.lower.y + 0.02f + 0.22f * static_cast<float>(i),
                z = drawers.upper.z + kStandingGap;
    append(fronts,
           rounded_box("front", {{0.395f, low, z}, {0.805f, low + 0.20f, z + 0.018f}}, 0.004f, 2, m.wood));
    const float y = low + 0.13f, out = z + 0.045f;
    const vec3 handle[] = {{0.53f, y, z + 0.019f}, {0.53f, y, out - 0.012f}, {0.54f, y, out},
                           {0.66f, y, out},        {0.67f, y, out - 0.012f}, {0.67f, y, z + 0.019f}};
    append(handles, tube("handle", handle, 0.006f, 12, m.brass));
  }
  s.meshes.push_back(std::move(fronts));
  s.meshes.push_back(std::move(handles));
  s.meshes.push_back(box("plinth", {{0.40f, kStandingGap, -1.88f}, {0.80f, 0.029f, -1.20f}}, m.dark_wood));
}

void add_monitor(Scene& s, const Materials& m) {
  const Pose stand = turned(0.12f, {-0.12f, kOnDesk, -1.66f});
  const auto add = [&](Mesh mesh) {
    place(mesh, stand);
    s.meshes.push_back(std::move(mesh));
  };
  Mesh body = rounded_box("monitor", {{-0.30f, 0.13f, 0.0f}, {0.30f, 0.49f, 0.03f}}, 0.008f, 3, m.plastic);
  append(body,
         rounded_box("foot", cuboid({0.0f, 0.0f, -0.02f}, {0.26f, 0.014f, 0.18f}), 0.006f, 3, m.plastic));
  append(body,
         rounded_box("neck", cuboid({0.0f, 0.015f, -0.04f}, {0.06f, 0.25f, 0.03f}), 0.008f, 3, m.plastic));
  add(std::move(body));
  add(quad("screen", {-0.285f, 0.148f, 0.031f}, {0.57f, 0, 0}, {0, 0.328f, 0}, m.screen));
  add(quad("window", {-0.24f, 0.20f, 0.032f}, {0.27f, 0, 0}, {0, 0.22f, 0}, m.window));
  add(quad("window", {0.08f, 0.28f, 0.032f}, {0.16f, 0, 0}, {0, 0.15f, 0}, m.window));
}

void add_keyboard_and_mouse(Scene& s, const Materials& m) {
  const vec3 at(-0.12f, kOnDesk, -1.32f);
  s.meshes.push_back(rounded_box("keyboard", cuboid(at, {0.44f, 0.016f, 0.14f}), 0.006f, 3, m.plastic));
  Mesh keys{"keys", {}, {}, {}, m.paper};
  for (int row = 0; row < 5; ++row)
    for (int column = 0; column < 15; ++column) {
      const bool space = row == 4 && column >= 4 && column <= 9;
      if (space && column > 4) continue;
      const float x = -0.2025f + 0.0289f * (static_cast<float>(column) + (space ? 2.5f : 0.0f));
      const vec3 foot = at + vec3(x, 0.017f, -0.051f + 0.0255f * static_cast<float>(row));
      append(keys, box("key", cuboid(foot, {space ? 0.169f : 0.0245f, 0.006f, 0.021f}), m.paper));
    }
  s.meshes.push_back(std::move(keys));
  Mesh mouse = ball("mouse", vec3(0.0f), 1.0f, 3, m.paper);
  for (vec3& p : mouse.positions) p.y = std::max(p.y, -0.6f);
  mouse.normals.clear();
  place(mouse,
        Pose{{{0.031f, 0, 0}, {0, 0.022f, 0}, {0, 0, 0.055f}}, {0.22f, kOnDesk + 0.6f * 0.022f, -1.31f}});
  s.meshes.push_back(std::move(mouse));
}

void add_desk_lamp(Scene& s, const Materials& m) {
  const vec3 foot(-0.82f, kOnDesk, -1.68f), elbow = foot + vec3(-0.10f, 0.36f, -0.05f),
                                            head = elbow + vec3(0.30f, 0.14f, 0.14f);
  static constexpr glm::vec2 kFoot[] = {{0.0f, 0.0f},    {0.09f, 0.0f},  {0.09f, 0.0f},    {0.09f, 0.012f},
                                        {0.082f, 0.02f}, {0.03f, 0.03f}, {0.015f, 0.035f}, {0.0f, 0.035f}};
  Mesh stand = revolve("desk lamp", foot, kFoot, 40, m.brass);
  append(stand, rod("arm", foot + vec3(0, 0.03f, 0), elbow, 0.008f, m.brass));
  append(stand, rod("arm", elbow, head, 0.008f, m.brass));
  append(stand, ball("joint", elbow, 0.016f, 3, m.brass));
  s.meshes.push_back(std::move(stand));
  // The shade is a bell with an inside, open downwards; the bulb is a disc in it.
  static constexpr glm::vec2 kShade[] = {{0.086f, -0.10f}, {0.09f, -0.10f},  {0.09f, -0.10f},
                                         {0.075f, -0.05f}, {0.045f, -0.01f}, {0.025f, 0.005f},
                                         {0.0f, 0.008f}};
  static constexpr glm::vec2 kInside[] = {
      {0.0f, 0.0f}, {0.022f, -0.002f}, {0.042f, -0.015f}, {0.071f, -0.053f}, {0.086f, -0.10f}};
  Mesh shade = revolve("lamp shade", vec3(0.0f), kShade, 48, m.red);
  append(shade, revolve("inside", vec3(0.0f), kInside, 48, m.red));
  Mesh bulb = quad("bulb", {-0.03f, -0.092f, -0.03f}, {0.06f, 0, 0}, {0, 0, 0.06f}, m.glow);
  const Pose tilted{1.35f * glm::mat3(0.94f, 0.342f, 0, -0.342f, 0.94f, 0, 0, 0, 1), head};
  for (Mesh* part : {&shade, &bulb}) {
    place(*part, tilted);
    s.meshes.push_back(std::move(*part));
  }
}

// A closed book lying flat: cover and pages.
void add_book(Scene& s, const vec3& foot, const vec3& size, float angle, std::uint32_t cover,
              std::uint32_t paper) {
  constexpr float kBoard = 0.003f;
  const Bounds all = cuboid(vec3(0.0f), size);
  Mesh boards{"book", {}, {}, {}, cover};
  Bounds part = all;
  part.upper.y = kBoard;
  append(boards, box("board", part, cover));
  part = all;
  part.lower.y = size.y - kBoard;
  append(boards, box("board", part, cover));
  part = {{all.lower.x, kBoard + kStandingGap, all.lower.z},
          {all.lower.x + kBoard, size.y - kBoard - kStandingGap, all.upper.z}};
  append(boards, box("spine", part, cover));
  const Bounds pages{{all.lower.x + kBoard + kStandingGap, kBoard + kStandingGap, all.lower.z + 0.005f},
                     {all.upper.x - 0.005f, size.y - kBoard - kStandingGap, all.upper.z - 0.005f}};
  Mesh leaves = box("pages", pages, paper);
  for (Mesh* mesh : {&boards, &leaves}) {
    place(*mesh, turned(angle, foot));
    s.meshes.push_back(std::move(*mesh));
  }
}

void add_books(Scene& s, const Materials& m) {
  vec3 foot(0.58f, kOnDesk, -1.64f);
  const struct {
    vec3 size;
    float angle;
    std::uint32_t cover;
  } stack[] = {{{0.26f, 0.045f, 0.19f}, 1.50f, m.blue},
               {{0.24f, 0.035f, 0.17f}, 1.75f, m.ochre},
               {{0.22f, 0.030f, 0.15f}, 1.35f, m.green}};
  for (const auto& book : stack) {
    add_book(s, foot, book.size, book.angle, book.cover, m.paper);
    foot.y += book.size.y + kStandingGap;
  }
  add_book(s, {0.40f, kOnDesk, -1.30f}, {0.20f, 0.02f, 0.14f}, 0.35f, m.red, m.paper);
}

void add_mug(Scene& s, const Materials& m) {
  const vec3 foot(-0.52f, kOnDesk, -1.30f);
  static constexpr glm::vec2 kProfile[] = {
      {0.0f, 0.0f},      {0.036f, 0.0f},    {0.036f, 0.0f},    {0.040f, 0.004f},  {0.040f, 0.004f},
      {0.040f, 0.092f},  {0.040f, 0.092f},  {0.0385f, 0.095f}, {0.0365f, 0.092f}, {0.0365f, 0.092f},
      {0.0365f, 0.008f}, {0.0365f, 0.008f}, {0.0f, 0.006f}};
  Mesh mug = revolve("mug", foot, kProfile, 48, m.mug);
  std::vector<vec3> path;
  for (int i = 0; i <= 16; ++i) {
    const float phi = kPi * (static_cast<float>(i) / 16.0f - 0.5f);
    path.push_back(foot + vec3(0.039f + 0.028f * std::cos(phi), 0.05f + 0.03f * std::sin(phi), 0.0f));
  }
  append(mug, tube("handle", path, 0.005f, 16, m.mug));
  s.meshes.push_back(std::move(mug));
}

// Wall shelf with books standing on it, and a picture.
void add_wall(Scene& s, const Materials& m) {
  const float wall = kRoom.lower.z + kStandingGap;
  const Bounds board{{-0.85f, 1.52f, wall}, {0.45f, 1.55f, wall + 0.24f}};
  s.meshes.push_back(rounded_box("shelf", board, 0.004f, 2, m.dark_wood));
  const std::uint32_t covers[] = {m.red, m.blue, m.green, m.ochre, m.dark_wood, m.paper, m.cloth};
  float x = board.lower.x + 0.05f;
  for (int i = 0; i < 15; ++i) {
    const auto k = static_cast<float>(i);
    const float thick = 0.030f + 0.014f * std::sin(2.3f * k),
                tall = 0.22f + 0.035f * std::sin(1.7f * k + 1.0f);
    const Bounds book{
        {x, board.upper.y + kStandingGap, wall + 0.012f},
        {x + thick, board.upper.y + kStandingGap + tall, wall + 0.16f + 0.02f * std::sin(3.1f * k)}};
    s.meshes.push_back(rounded_box("book", book, 0.003f, 2, covers[(i * 5) % 7]));
    x += thick + 0.002f;
  }
  static constexpr glm::vec2 kPot[] = {{0.0f, 0.0f},    {0.05f, 0.0f},  {0.05f, 0.0f},  {0.065f, 0.10f},
                                       {0.065f, 0.10f}, {0.07f, 0.10f}, {0.07f, 0.10f}, {0.07f, 0.12f},
                                       {0.07f, 0.12f},  {0.06f, 0.12f}, {0.06f, 0.12f}, {0.055f, 0.10f},
                                       {0.055f, 0.10f}, {0.0f, 0.10f}};
  const vec3 pot(0.28f, board.upper.y + kStandingGap, wall + 0.15f);
  s.meshes.push_back(revolve("pot", pot, kPot, 40, m.clay));
  Mesh plant{"plant", {}, {}, {}, m.leaf};
  for (int i = 0; i < 14; ++i) {  // leaves: flat balls along spreading rods
    const float k = static_cast<float>(i), phi = 2.4f * k, lean = 0.25f + 0.045f * k;
    const vec3 out(std::cos(phi) * std::sin(lean), std::cos(lean), std::sin(phi) * std::sin(lean));
    const vec3 root = pot + vec3(0.0f, 0.105f, 0.0f), tip = root + 0.13f * out;
    append(plant, rod("stem", root, tip, 0.0025f, m.leaf));
    Mesh leaf = ball("leaf", vec3(0.0f), 1.0f, 2, m.leaf);
    const vec3 along = 0.045f * glm::normalize(out + vec3(0.0f, -0.4f, 0.0f));
    const vec3 across = 0.02f * glm::normalize(glm::cross(along, vec3(0, 1, 0)));
    const vec3 thin = 0.003f * glm::normalize(glm::cross(along, across));
    place(leaf, Pose{{across, thin, along}, tip + 0.8f * along});
    append(plant, std::move(leaf));
  }
  s.meshes.push_back(std::move(plant));
  const Bounds frame{{0.66f, 1.25f, wall}, {1.36f, 1.85f, wall + 0.025f}};
  s.meshes.push_back(rounded_box("frame", frame, 0.005f, 2, m.dark_wood));
  const float front = frame.upper.z + kStandingGap;
  s.meshes.push_back(quad("picture", {0.72f, 1.31f, front}, {0.58f, 0, 0}, {0, 0.48f, 0}, m.paper));
  s.meshes.push_back(quad("sea", {0.76f, 1.35f, front + kStandingGap}, {0.50f, 0, 0}, {0, 0.17f, 0}, m.blue));
  s.meshes.push_back(ball("sun", {1.12f, 1.64f, front + 0.005f}, 0.03f, 3, m.red));
}

void add_basket(Scene& s, const Materials& m) {
  static constexpr glm::vec2 kProfile[] = {
      {0.0f, 0.0f},    {0.11f, 0.0f},   {0.11f, 0.0f},    {0.145f, 0.30f},  {0.145f, 0.30f},
      {0.140f, 0.30f}, {0.140f, 0.30f}, {0.106f, 0.006f}, {0.106f, 0.006f}, {0.0f, 0.006f}};
  s.meshes.push_back(revolve("basket", {1.15f, kStandingGap, -1.62f}, kProfile, 48, m.metal));
}

// Rolls round an oval before the desk and turns once meanwhile.
Pose chair_pose(float frame) {
  const float phi = loop_angle(frame);
  return turned(kPi + 0.6f - phi,
                {-0.12f + 0.62f * std::cos(phi), 0.012f + kStandingGap, -0.20f + 0.42f * std::sin(phi)});
}

void add_chair(Scene& s, const Materials& m) {
  Mesh frame{"chair frame", {}, {}, {}, m.plastic}, cushions{"chair cushions", {}, {}, {}, m.cloth};
  for (int i = 0; i < 5; ++i) {
    const float phi = 0.4f * kPi * static_cast<float>(i);
    const vec3 out(std::cos(phi), 0.0f, std::sin(phi)), across(-out.z, 0.0f, out.x);
    append(frame,
           rod("foot", 0.03f * out + vec3(0, 0.11f, 0), 0.29f * out + vec3(0, 0.075f, 0), 0.018f, m.plastic));
    for (const float side : {-1.0f, 1.0f}) {
      const vec3 hub = 0.285f * out + vec3(0, 0.028f, 0) + 0.012f * side * across;
      append(frame, rod("castor", hub, hub + 0.018f * side * across, 0.028f, m.plastic));
    }
    append(frame, rod("pin", 0.285f * out + vec3(0, 0.02f, 0), 0.285f * out + vec3(0, 0.075f, 0), 0.008f,
                      m.plastic));
  }
  append(frame, rod("hub", {0, 0.08f, 0}, {0, 0.14f, 0}, 0.04f, m.plastic));
  append(frame, rod("column", {0, 0.14f, 0}, {0, 0.40f, 0}, 0.025f, m.plastic));
  append(frame, rounded_box("plate", cuboid({0, 0.40f, 0}, {0.24f, 0.025f, 0.24f}), 0.01f, 3, m.plastic));
  const vec3 spine[] = {{0, 0.412f, 0.10f}, {0, 0.412f, 0.20f}, {0, 0.425f, 0.245f},
                        {0, 0.46f, 0.262f}, {0, 0.56f, 0.270f}, {0, 0.74f, 0.290f}};
  append(frame, tube("spine", spine, 0.016f, 16, m.plastic));
  append(cushions, rounded_box("seat", cuboid({0, 0.426f, 0}, {0.47f, 0.075f, 0.45f}), 0.035f, 6, m.cloth));
  Mesh back = rounded_box("back", {{-0.21f, 0.0f, -0.03f}, {0.21f, 0.46f, 0.03f}}, 0.028f, 6, m.cloth);
  const float lean = 0.14f, c = std::cos(lean), n = std::sin(lean);
  place(back, Pose{{{1, 0, 0}, {0, c, n}, {0, -n, c}}, {0, 0.56f, 0.232f}});
  append(cushions, std::move(back));
  for (Mesh* part : {&frame, &cushions}) {
    part->pose = chair_pose;
    s.meshes.push_back(std::move(*part));
  }
}

}  // namespace

Scene desk() {
  Scene s;
  const Materials m = add_materials(s);
  add_room(s, kRoom, {m.floor, m.white, m.left, m.right, m.white, m.white});
  add_ceiling_panel(s, kRoom.upper.y, {0.2f, 0.1f}, {1.2f, 0.6f}, m.white, m.lamp);
  s.meshes.push_back(
      rounded_box("rug", {{-1.35f, kStandingGap, -0.95f}, {1.10f, 0.012f, 0.85f}}, 0.005f, 2, m.rug));
  add_desk(s, m);
  add_monitor(s, m);
  add_keyboard_and_mouse(s, m);
  add_desk_lamp(s, m);
  add_books(s, m);
  add_mug(s, m);
  add_wall(s, m);
  add_basket(s, m);
  add_chair(s, m);
  s.camera = {
      .eye = {1.45f, 1.75f, 1.75f}, .target = {-0.10f, 0.72f, -1.0f}, .up = {0, 1, 0}, .fov_y = 0.78f};
  s.frames = kLoopFrames;
  return s;
}

}  // namespace icbench
