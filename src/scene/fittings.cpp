// What hangs on walls or is let into them.
#include <array>
#include <cmath>
#include <numbers>

#include "scene/furniture.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

using glm::vec3;

constexpr vec3 kAcross{1, 0, 0}, kUp{0, 1, 0}, kOut{0, 0, 1};

// A frame about the opening |x| <= w, y0 <= y <= y1 in the plane z = 0; the profile's x is measured outwards from
// the opening, its y along +z.
Mesh frame_around(float w, float y0, float y1, const Polygon& profile) {
  return sweep(
      {{-w, y0, 0}, {-w, y1, 0}, {w, y1, 0}, {w, y0, 0}},
      [&] {
        Polygon turned;
        for (const glm::vec2& p : profile) turned.emplace_back(-p.x, p.y);
        return Polygon(turned.rbegin(), turned.rend());
      }(),
      kOut, true);
}

}  // namespace

Parts picture(float width, float height, std::uint32_t frame, std::uint32_t margin, std::uint32_t image) {
  const float w = 0.5f * width, h = 0.5f * height, border = 0.16f * std::min(width, height);
  Parts whole;
  whole.add(frame, frame_around(w, -h, h,
                                {{-0.008f, kGap},
                                 {0.035f, kGap},
                                 {0.035f, 0.018f},
                                 {0.028f, 0.028f},
                                 {0.012f, 0.022f},
                                 {0.0f, 0.016f},
                                 {-0.008f, 0.016f}}));
  whole.add(margin, solid_box({-w - 0.002f, -h - 0.002f, 2.0f * kGap}, {w + 0.002f, h + 0.002f, 0.010f}));
  whole.add(image, solid_box({-w + border, -h + border, 0.005f}, {w - border, h - border, 0.011f}));
  return whole;
}

Parts whiteboard(float width, float height, std::uint32_t board, std::uint32_t frame, std::uint32_t pens) {
  const float w = 0.5f * width, h = 0.5f * height;
  Parts whole;
  whole.add(board, solid_box({-w - 0.002f, -h - 0.002f, 2.0f * kGap}, {w + 0.002f, h + 0.002f, 0.014f}));
  whole.add(frame,
            frame_around(w, -h, h, {{-0.006f, kGap}, {0.022f, kGap}, {0.022f, 0.022f}, {-0.006f, 0.022f}}));
  // The tray, open above: a trough along x.
  const Polygon trough{{0.0f, 0.0f},     {0.075f, 0.0f},   {0.080f, 0.018f}, {0.076f, 0.019f},
                       {0.072f, 0.005f}, {0.003f, 0.005f}, {0.003f, 0.018f}, {0.0f, 0.018f}};
  whole.add(frame, moved(extrude(trough, 0.6f * width),
                         {glm::mat3(kOut, kUp, -kAcross), {0.3f * width, -h - 0.05f, kGap}}));
  for (int i = 0; i < 4; ++i) {
    const float x = -0.22f * width + 0.16f * static_cast<float>(i);
    whole.add(pens, tube({{x, -h - 0.035f, 0.04f}, {x + 0.13f, -h - 0.035f, 0.042f}}, 0.008f));
  }
  whole.add(pens,
            rounded_box({{0.18f * width, -h - 0.044f, 0.012f}, {0.18f * width + 0.12f, -h - 0.012f, 0.062f}},
                        0.006f, 1));
  return whole;
}

Parts door(float width, float height, std::uint32_t leaf, std::uint32_t casing, std::uint32_t metal) {
  const float w = 0.5f * width;
  Parts whole;
  const std::array panels{rectangle({-w + 0.13f, 0.22f}, {-0.05f, 0.95f}),
                          rectangle({0.05f, 0.22f}, {w - 0.13f, 0.95f}),
                          rectangle({-w + 0.13f, 1.12f}, {-0.05f, height - 0.16f}),
                          rectangle({0.05f, 1.12f}, {w - 0.13f, height - 0.16f})};
  whole.add(leaf,
            moved(extrude(rectangle({-w + 0.003f, 0.005f}, {w - 0.003f, height - 0.003f}), 0.040f, panels),
                  turned(0.0f, {0, 0, -0.030f})));
  whole.add(leaf, solid_box({-w + 0.08f, 0.12f, -0.028f}, {w - 0.08f, height - 0.10f, -0.006f}));
  for (const Polygon& panel : panels) {
    const Polygon field = inset(panel, 0.035f);
    whole.add(leaf, moved(slab(field, std::array{SlabLevel{0.0f, -0.004f}, SlabLevel{0.0f, 0.0f},
                                                 SlabLevel{0.02f, 0.009f}}),
                          {rotation(kAcross, 0.5f * std::numbers::pi_v<float>), {0, 0, -0.004f}}));
  }
  const Polygon moulding{{-0.012f, -0.04f}, {0.085f, -0.04f}, {0.085f, 0.020f}, {0.070f, 0.026f},
                         {0.020f, 0.026f},  {0.005f, 0.020f}, {-0.012f, 0.018f}};
  const Path around{{w, 0.002f, 0}, {w, height, 0}, {-w, height, 0}, {-w, 0.002f, 0}};
  whole.add(casing, sweep(around, moulding, kOut));
  const float x = w - 0.065f;
  whole.add(metal, rounded_box({{x - 0.022f, 0.92f, 0.005f}, {x + 0.022f, 1.16f, 0.016f}}, 0.004f, 1));
  whole.add(metal,
            tube(fillet({{x, 1.05f, 0.008f}, {x, 1.05f, 0.062f}, {x - 0.125f, 1.05f, 0.062f}}, 0.018f, 4),
                 0.009f, 10));
  return whole;
}

Parts window_frame(float width, float height, int columns, int rows, std::uint32_t frame) {
  const float w = 0.5f * width;
  Parts whole;
  whole.add(frame, frame_around(w, 0.0f, height,
                                {{-0.045f, -0.12f}, {0.01f, -0.12f}, {0.01f, -0.06f}, {-0.045f, -0.06f}}));
  for (int i = 1; i < columns; ++i) {
    const float x = -w + width * static_cast<float>(i) / static_cast<float>(columns);
    whole.add(frame, solid_box({x - 0.018f, 0.03f, -0.110f}, {x + 0.018f, height - 0.03f, -0.070f}));
  }
  for (int i = 1; i < rows; ++i) {
    const float y = height * static_cast<float>(i) / static_cast<float>(rows);
    whole.add(frame, solid_box({-w + 0.03f, y - 0.015f, -0.108f}, {w - 0.03f, y + 0.015f, -0.073f}));
  }
  whole.add(frame, rounded_box({{-w - 0.06f, -0.035f, -0.10f}, {w + 0.06f, 0.003f, 0.07f}}, 0.010f, 2));
  return whole;
}

Parts venetian_blind(float width, float height, float pitch, float tilt, std::uint32_t slats) {
  constexpr float kSlat = 0.025f, kThick = 0.0008f, kRail = 0.035f;
  const float w = 0.5f * width;
  Parts whole;
  whole.add(slats, rounded_box({{-w, -kRail, -0.02f}, {w, 0.0f, 0.02f}}, 0.004f, 1));
  whole.add(slats, rounded_box({{-w + 0.003f, -height, -0.014f}, {w - 0.003f, -height + 0.018f, 0.014f}},
                               0.004f, 1));
  // Crowned: an arc of 1.0 rad over the width of a slat.
  const float radius = kSlat / (2.0f * std::sin(0.5f)), half_pi = 0.5f * std::numbers::pi_v<float>;
  Polygon section = arc({0.0f, -radius}, radius + kThick, half_pi - 0.5f, half_pi + 0.5f, 5);
  const Polygon below = arc({0.0f, -radius}, radius, half_pi + 0.5f, half_pi - 0.5f, 5);
  section.insert(section.end(), below.begin(), below.end());
  const Mesh slat =
      shade(moved(extrude(section, width - 0.008f), {glm::mat3(-kOut, kUp, kAcross), {-w + 0.004f, 0, 0}}));
  const int count = static_cast<int>((height - kRail - 0.03f) / pitch);
  for (int i = 0; i < count; ++i) {
    const float y = -kRail - 0.02f - pitch * static_cast<float>(i);
    whole.add(slats, moved(slat, {rotation(kAcross, tilt), {0, y, 0}}));
  }
  for (const float x : {-0.36f * width, 0.36f * width})
    for (const float z : {-0.0145f, 0.0145f})
      whole.add(slats, tube({{x, -height + 0.01f, z}, {x, -0.02f, z}}, 0.0008f, 5));
  return whole;
}

Mesh skirting(const Path& path, float height) {
  return sweep(
      path,
      {{-0.01f, -0.005f}, {0.014f, -0.005f}, {0.014f, height - 0.02f}, {0.006f, height}, {-0.01f, height}},
      kUp);
}

}  // namespace icbench
