#include "scene/furniture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/random.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

using glm::vec3;

constexpr float kPi = std::numbers::pi_v<float>;

}  // namespace

Parts conference_table(float length, float width, float height, std::uint32_t top, std::uint32_t base) {
  Parts table;
  const Polygon outline = superellipse(0.5f * length, 0.5f * width, 5.0f, 160);
  table.add(top,
            slab(outline, std::array{SlabLevel{0.035f, height - 0.045f}, SlabLevel{0.012f, height - 0.030f},
                                     SlabLevel{0.0f, height - 0.016f}, SlabLevel{0.0f, height - 0.006f},
                                     SlabLevel{0.006f, height}}));
  const float pitch = 0.33f * length;
  for (const float x : {-pitch, 0.0f, pitch}) {
    const Polygon foot = superellipse(0.26f, 0.40f * width, 4.0f, 48),
                  post = superellipse(0.14f, 0.26f * width, 4.0f, 48);
    Parts pedestal;
    pedestal.add(base, slab(foot, std::array{SlabLevel{0.004f, kGap}, SlabLevel{0.0f, 0.02f},
                                             SlabLevel{0.0f, 0.045f}, SlabLevel{0.012f, 0.06f}}));
    pedestal.add(
        base, slab(post, std::array{SlabLevel{-0.03f, 0.05f}, SlabLevel{-0.005f, 0.09f},
                                    SlabLevel{0.0f, 0.16f}, SlabLevel{0.0f, height - 0.12f},
                                    SlabLevel{-0.04f, height - 0.055f}, SlabLevel{-0.04f, height - 0.04f}}));
    table.add(pedestal, turned(0.0f, {x, 0.0f, 0.0f}));
  }
  return table;
}

Parts desk_with_drawers(float width, float depth, std::uint32_t wood, std::uint32_t handles) {
  constexpr float kHeight = 0.75f, kTop = 0.035f, kPedestal = 0.42f;
  const float w = 0.5f * width, d = 0.5f * depth, under = kHeight - kTop - 0.004f;
  Parts desk;
  desk.add(wood, rounded_box({{-w, kHeight - kTop, -d}, {w, kHeight, d}}, 0.006f, 2));
  desk.add(wood, solid_box({-w + kPedestal, 0.22f, -d + 0.05f}, {w - kPedestal, under, -d + 0.07f}));
  for (const float side : {-1.0f, 1.0f}) {
    const float inner = side * (w - kPedestal + 0.005f), outer = side * (w - 0.03f);
    const float left = std::min(inner, outer), right = std::max(inner, outer);
    desk.add(wood, solid_box({left, 0.05f, -d + 0.03f}, {right, under, d - 0.04f}));
    desk.add(wood, solid_box({left + 0.03f, kGap, -d + 0.06f}, {right - 0.03f, 0.06f, d - 0.08f}));
    constexpr int kDrawers = 3;
    const float pitch = (under - 0.06f) / kDrawers;
    for (int i = 0; i < kDrawers; ++i) {
      const float y = 0.06f + pitch * static_cast<float>(i), middle = 0.5f * (left + right);
      desk.add(wood, rounded_box({{left + 0.012f, y + 0.008f, d - 0.05f},
                                  {right - 0.012f, y + pitch - 0.008f, d - 0.022f}},
                                 0.005f, 1));
      const float h = y + 0.62f * pitch, z = d - 0.03f;
      desk.add(handles, tube(fillet({{middle - 0.06f, h, z},
                                     {middle - 0.06f, h, z + 0.035f},
                                     {middle + 0.06f, h, z + 0.035f},
                                     {middle + 0.06f, h, z}},
                                    0.012f, 3),
                             0.005f));
    }
  }
  return desk;
}

Parts computer(std::uint32_t body, std::uint32_t screen) {
  Parts set;
  const Polygon foot = superellipse(0.13f, 0.10f, 3.0f, 32);
  set.add(body,
          slab(foot, std::array{SlabLevel{0.0f, kGap}, SlabLevel{0.0f, 0.008f}, SlabLevel{0.008f, 0.014f}}));
  set.add(body, rounded_box({{-0.03f, 0.008f, -0.05f}, {0.03f, 0.24f, -0.03f}}, 0.006f, 1));
  set.add(body, rounded_box({{-0.27f, 0.12f, -0.035f}, {0.27f, 0.45f, 0.005f}}, 0.008f, 2));
  set.add(screen, solid_box({-0.255f, 0.14f, 0.0f}, {0.255f, 0.435f, 0.006f}));
  set.add(body, rounded_box({{-0.22f, kGap, 0.17f}, {0.22f, 0.016f, 0.31f}}, 0.004f, 1));
  for (int row = 0; row < 5; ++row)
    for (int i = 0; i < 16; ++i) {
      const vec3 at(-0.205f + 0.0256f * static_cast<float>(i), 0.012f,
                    0.182f + 0.0245f * static_cast<float>(row));
      set.add(screen, solid_box(at, at + vec3(0.022f, 0.011f, 0.020f)));
    }
  set.add(body, moved(rounded_box({{-0.03f, 0.0f, -0.05f}, {0.03f, 0.03f, 0.05f}}, 0.014f, 3),
                      turned(-0.15f, {0.31f, kGap, 0.25f})));
  return set;
}

Parts table_lamp(std::uint32_t metal, std::uint32_t shade_material) {
  Parts lamp;
  static constexpr glm::vec2 kFoot[] = {{0.0f, 0.001f},  {0.085f, 0.001f}, {0.085f, 0.001f}, {0.085f, 0.012f},
                                        {0.075f, 0.02f}, {0.03f, 0.028f},  {0.012f, 0.05f},  {0.008f, 0.10f},
                                        {0.008f, 0.31f}, {0.008f, 0.31f},  {0.0f, 0.31f}};
  lamp.add(metal, revolve("foot", vec3(0.0f), kFoot, 32, metal));
  // Up the outside, over the rim and down the inside.
  static constexpr glm::vec2 kShade[] = {{0.0f, 0.43f},    {0.055f, 0.43f}, {0.055f, 0.43f}, {0.145f, 0.26f},
                                         {0.145f, 0.26f},  {0.148f, 0.26f}, {0.148f, 0.26f}, {0.060f, 0.435f},
                                         {0.060f, 0.435f}, {0.0f, 0.435f}};
  lamp.add(shade_material, revolve("shade", vec3(0.0f), kShade, 48, shade_material));
  lamp.add(metal, tube({{0, 0.30f, 0}, {0, 0.45f, 0}}, 0.005f));
  return lamp;
}

Parts bookcase(const vec3& size, int shelves, std::uint32_t wood, std::span<const std::uint32_t> bindings) {
  constexpr float kBoard = 0.022f;
  const float w = 0.5f * size.x, plinth = 0.07f;
  Parts whole;
  for (const float side : {-1.0f, 1.0f}) {
    const float x = side * (w - 0.5f * kBoard);
    whole.add(wood, solid_box({x - 0.5f * kBoard, kGap, kGap}, {x + 0.5f * kBoard, size.y, size.z}));
  }
  const float in = w - kBoard + 0.004f;  // boards are let into the sides
  whole.add(wood, solid_box({-in, plinth - 0.01f, 2.0f * kGap}, {in, size.y - 0.002f, 0.012f}));
  whole.add(wood, solid_box({-in, 2.0f * kGap, 0.02f}, {in, plinth + 0.002f, size.z - 0.03f}));
  Pcg32 random(20120501);
  const float pitch = (size.y - kBoard - plinth) / static_cast<float>(shelves);
  for (int s = 0; s <= shelves; ++s) {
    const float y = plinth + pitch * static_cast<float>(s), over = y + kBoard + kGap;
    whole.add(wood, solid_box({-in, y, 0.010f},
                              {in, y + kBoard - (s == shelves ? 0.003f : 0.0f), size.z - 0.006f}));
    if (s == shelves) break;
    float x = -w + kBoard + 0.006f;
    const float end = w - kBoard - 0.006f;
    while (true) {
      const float thick = 0.014f + 0.034f * random.uniform(),
                  tall = (0.62f + 0.28f * random.uniform()) * (pitch - kBoard);
      const float deep = std::min(size.z - 0.05f, 0.62f * tall + 0.03f),
                  front = size.z - 0.03f - 0.02f * random.uniform();
      const std::uint32_t binding = bindings[random() % bindings.size()];
      const bool gap = random.uniform() < 0.04f;
      const bool leans = !gap && random.uniform() < 0.06f;
      if (x + thick + (leans ? 0.3f * tall : 0.0f) > end) break;
      Mesh book = rounded_box({{0.0f, 0.0f, 0.0f}, {thick, tall, deep}}, 0.004f, 1);
      const float lean = leans ? 0.16f : 0.0f;
      const vec3 at(x + (leans ? tall * std::sin(lean) : 0.0f), over, front - deep);
      whole.add(binding, moved(std::move(book), {rotation({0, 0, 1}, lean), at}));
      x += thick * (leans ? std::cos(lean) : 1.0f) + (leans ? tall * std::sin(lean) : 0.0f) + 0.0012f +
           (gap ? 0.09f : 0.0f);
    }
  }
  return whole;
}

Parts waste_basket(std::uint32_t material) {
  static constexpr glm::vec2 kProfile[] = {
      {0.0f, 0.001f},   {0.105f, 0.001f}, {0.105f, 0.001f}, {0.142f, 0.30f},  {0.142f, 0.30f},
      {0.150f, 0.305f}, {0.150f, 0.318f}, {0.142f, 0.322f}, {0.138f, 0.315f}, {0.138f, 0.315f},
      {0.102f, 0.012f}, {0.102f, 0.012f}, {0.0f, 0.012f}};
  Parts basket;
  basket.add(material, revolve("basket", vec3(0.0f), kProfile, 48, material));
  return basket;
}

Parts mug(std::uint32_t material) {
  static constexpr glm::vec2 kProfile[] = {{0.0f, 0.001f},   {0.030f, 0.001f}, {0.036f, 0.006f},
                                           {0.038f, 0.02f},  {0.039f, 0.088f}, {0.0375f, 0.09f},
                                           {0.036f, 0.088f}, {0.035f, 0.02f},  {0.033f, 0.008f},
                                           {0.033f, 0.008f}, {0.0f, 0.008f}};
  Parts cup;
  cup.add(material, revolve("mug", vec3(0.0f), kProfile, 32, material));
  cup.add(material, tube(lift(arc({0.0365f, 0.047f}, 0.026f, -0.42f * kPi, 0.42f * kPi, 8), vec3(0.0f),
                              {1, 0, 0}, {0, 1, 0}),
                         0.0045f, 8));
  return cup;
}

Parts pot_plant(std::uint32_t pot, std::uint32_t leaves) {
  static constexpr glm::vec2 kPot[] = {{0.0f, 0.001f},  {0.12f, 0.001f}, {0.12f, 0.001f}, {0.165f, 0.27f},
                                       {0.165f, 0.27f}, {0.18f, 0.27f},  {0.18f, 0.27f},  {0.18f, 0.31f},
                                       {0.18f, 0.31f},  {0.155f, 0.31f}, {0.155f, 0.31f}, {0.15f, 0.28f},
                                       {0.15f, 0.28f},  {0.0f, 0.28f}};
  Parts plant;
  plant.add(pot, revolve("pot", vec3(0.0f), kPot, 40, pot));
  Pcg32 random(7);
  constexpr int kLeaves = 26;
  for (int i = 0; i < kLeaves; ++i) {
    const float length = 0.55f + 0.35f * random.uniform(), droop = 0.35f + 1.0f * random.uniform();
    const float width = 0.022f + 0.014f * random.uniform(), angle = 2.39996f * static_cast<float>(i);
    // A leaf grows from its foot upwards and bends over: an arc whose tangent turns by `droop`.
    const Mesh leaf = block({4, 1, 12}, [&](const vec3& u) {
      const float s = u.z, turn = 0.15f + droop * s;
      const float out = length * (std::cos(0.15f) - std::cos(turn)) / droop;
      const float up = length * (std::sin(turn) - std::sin(0.15f)) / droop;
      const float half = width * std::sin(kPi * std::min(0.98f, 0.12f + 0.86f * s)) * (2.0f * u.x - 1.0f);
      const float thick = 0.0012f * (u.y - 0.5f) + 0.3f * std::abs(half);
      return vec3(half, 0.26f + up + thick * std::sin(turn), 0.05f + out - thick * std::cos(turn));
    });
    plant.add(leaves, moved(leaf, turned(angle, vec3(0.0f))));
  }
  return plant;
}

}  // namespace icbench
