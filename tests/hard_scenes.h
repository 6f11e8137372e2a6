// Scenes on which nothing may go wrong, and what is expected of their pictures.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <functional>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "judged_estimates.h"
#include "scene/import_scene.h"
#include "temporary_folder.h"

namespace icbench {

// A box with a ball in it, all lengths times `scale`.
inline Scene scaled_room(float scale) {
  Scene s;
  s.name = "room";
  const auto wall = s.add_material({.albedo = {0.7f, 0.5f, 0.3f}});
  s.meshes.push_back(box("walls", {{-10, 0, -10}, {10, 20, 10}}, wall, true));
  s.meshes.push_back(icosphere("ball", {3, 6, -2}, 4.0f, 2, wall));
  add_lamp(s, 6.0f, 19.0f, 10.0f);
  s.camera = {.eye = {1, 12, 9}, .target = {0, 7, -3}, .up = {0, 1, 0}, .fov_y = 1.0f};
  for (Mesh& mesh : s.meshes)
    for (glm::vec3& p : mesh.positions) p *= scale;
  s.camera.eye *= scale;
  s.camera.target *= scale;
  return s;
}

// Whether two pictures are the same but for pixels whose rays took another side, at most `others` of all.
inline void expect_alike(const Image& one, const Image& other, double others, const std::string& what) {
  std::size_t alike = 0;
  double mean_one = 0.0, mean_other = 0.0;
  for (std::size_t i = 0; i < one.pixels.size(); ++i) {
    alike += glm::distance(one.pixels[i], other.pixels[i]) <= 1e-3f * glm::length(one.pixels[i]);
    mean_one += one.pixels[i].y;
    mean_other += other.pixels[i].y;
  }
  std::printf("%s: %zu of %zu pixels alike, means differ by %.2g\n", what.c_str(), alike, one.pixels.size(),
              mean_other / mean_one - 1.0);
  EXPECT_GE(static_cast<double>(alike), (1.0 - others) * static_cast<double>(one.pixels.size())) << what;
  EXPECT_NEAR(mean_other / mean_one, 1.0, 0.1 * others) << what;
}

// A scene file, moved; 1 m, 12 decimals.
inline std::string radiance_room(double offset) {
  const auto polygon = [&](const char* material, std::initializer_list<glm::dvec3> corners) {
    std::string text = std::string(material) + " polygon p\n0 0 " + std::to_string(3 * corners.size());
    for (const glm::dvec3& c : corners) {
      char line[100];
      std::snprintf(line, sizeof line, "\n%.12g %.12g %.12g", c.x + offset, c.y + offset, c.z + offset);
      text += line;
    }
    return text + "\n";
  };
  char view[200];
  std::snprintf(view, sizeof view, "# view -vtv -vp %.12g %.12g %.12g -vd 0 1 -0.3 -vu 0 0 1 -vh 60 -vv 60\n",
                offset + 0.5, offset + 0.05, offset + 0.6);
  return std::string(view) + "void plastic grey 0 0 5 .6 .5 .4 0 0\nvoid light lamp 0 0 3 9 9 9\n" +
         polygon("grey", {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}) +
         polygon("grey", {{0, 0, 1}, {0, 1, 1}, {1, 1, 1}, {1, 0, 1}}) +
         polygon("grey", {{0, 1, 0}, {1, 1, 0}, {1, 1, 1}, {0, 1, 1}}) +
         polygon("grey", {{0, 0, 0}, {0, 1, 0}, {0, 1, 1}, {0, 0, 1}}) +
         polygon("grey", {{1, 0, 0}, {1, 0, 1}, {1, 1, 1}, {1, 1, 0}}) +
         polygon("grey", {{0.3, 0.6, 0}, {0.7, 0.6, 0}, {0.7, 0.6, 0.4}, {0.3, 0.6, 0.4}}) +
         polygon("lamp", {{0.4, 0.4, 0.99}, {0.4, 0.6, 0.99}, {0.6, 0.6, 0.99}, {0.6, 0.4, 0.99}});
}

inline Scene import_room(double offset) {
  const TemporaryFolder folder;
  std::ofstream(folder / "room.rad") << radiance_room(offset);
  ImportedScene imported = import_scene(folder / "room.rad");
  const auto told = std::count_if(imported.notes.begin(), imported.notes.end(), [](const std::string& note) {
    return note.find("far from its origin") != std::string::npos;
  });
  EXPECT_EQ(told, offset > 100.0 ? 1 : 0);
  return std::move(imported.scene);
}

// Scenes on which nothing may go wrong, whoever renders them.
struct HardScene {
  const char* name;
  std::function<Scene()> make;
  double
      tolerance;  // of a cached picture's mean, against a gather in every pixel, both of which are noisy; < 0: lamps
                  // are drawn by power, and what the dim one sends is left to chance
  double tolerance_by_vpls;  // of one by virtual lights, against the same in every pixel: no noise
};

inline Scene closed_room(float side) {
  Scene s;
  s.name = "closed_room";
  const auto wall = s.add_material({.albedo = glm::vec3(0.6f)});
  s.meshes.push_back(box("walls", {{0, 0, 0}, glm::vec3(side)}, wall, true));
  s.camera = {.eye = side * glm::vec3(0.5f, 0.5f, 0.9f),
              .target = side * glm::vec3(0.5f, 0.2f, 0.0f),
              .up = {0, 1, 0},
              .fov_y = 1.2f};
  return s;
}

inline void add_lamp_at(Scene& s, const glm::vec3& p, float side, float L) {
  const auto glow = s.add_material({.emission = glm::vec3(L)});
  s.meshes.push_back(quad("lamp", p, {side, 0, 0}, {0, 0, side}, glow));
}

// A lamp of a tenth of a millimetre.
inline Scene speck() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {1, 1.8f, 1}, 1e-4f, 1e8f);
  return s;
}

// Light through a slit of 2 cm in a ceiling below the lamp.
inline Scene slit() {
  Scene s = closed_room(2.0f);
  s.meshes.push_back(quad("left", {0, 1.5f, 0}, {0, 0, 2}, {0.99f, 0, 0}, 0));
  s.meshes.push_back(quad("right", {1.01f, 1.5f, 0}, {0, 0, 2}, {0.99f, 0, 0}, 0));
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 100.0f);
  return s;
}

// The floor from a tenth of a millimetre above it.
inline Scene grazing() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 1.0f);
  s.camera.eye = {1, 1e-4f, 1.9f};
  s.camera.target = {1, 0, 0.5f};
  s.camera.fov_y = 0.002f;
  return s;
}

// A millimetre from the edges in which three walls meet, of which none has a distance to the next.
inline Scene corner_of_walls() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 1.0f);
  s.camera.eye = {2e-3f, 2e-3f, 2e-3f};
  s.camera.target = glm::vec3(0.0f);
  return s;
}

// A floor of needles, twice, with triangles that are lines and points.
inline Scene needles() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 1.0f);
  Mesh fan;
  fan.name = "fan";
  fan.positions = {{0, 0.1f, 0}};
  for (int i = 0; i <= 200; ++i) fan.positions.push_back({0.01f * static_cast<float>(i), 0.1f, 2});
  for (std::uint32_t i = 1; i <= 200; ++i)
    for (const glm::uvec3 t :
         {glm::uvec3(0, i, i + 1), glm::uvec3(0, i + 1, i), glm::uvec3(0, i, i), glm::uvec3(i, i, i)})
      fan.triangles.push_back(t);
  s.meshes.push_back(fan);
  s.meshes.push_back(fan);
  return s;
}

// In a hall of 100 m a rug that lies a millimetre above the floor.
inline Scene hall() {
  Scene s = closed_room(100.0f);
  add_lamp_at(s, {25, 99, 25}, 50.0f, 1.0f);
  s.meshes.push_back(quad("rug", {40, 1e-3f, 40}, {0, 0, 20}, {20, 0, 0}, 0));
  return s;
}

// Patches that shine with 1e-20 and 1e20.
inline Scene dim_and_bright() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.2f, 1.9f, 0.2f}, 0.5f, 1e-20f);
  add_lamp_at(s, {1.2f, 1.9f, 0.2f}, 0.5f, 1e20f);
  s.meshes.push_back(quad("partition", {1, 0, 0}, {0, 0, 2}, {0, 2, 0}, 0));
  s.camera.eye = {0.9f, 1, 1.9f};
  return s;
}

// Light of which a hundredth is no normal number any more.
inline Scene denormal_light() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 1e-36f);
  return s;
}

// The power of the lamp itself is no normal number, and its inverse none at all.
inline Scene denormal_lamp() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.5f, 1.9f, 0.5f}, 1.0f, 1e-42f);
  return s;
}

inline Scene dark() { return closed_room(2.0f); }

inline const HardScene kHardScenes[] = {{"speck", speck, 0.1, 0.05},
                                        {"slit", slit, 0.25, 0.05},
                                        {"grazing", grazing, 0.1, 0.05},
                                        {"corner", corner_of_walls, 0.1, 0.05},
                                        {"needles", needles, 0.1, 0.05},
                                        {"hall", hall, 0.1, 0.05},
                                        {"dim_and_bright", dim_and_bright, -1.0, -1.0},
                                        {"denormal_light", denormal_light, 0.1, 0.05},
                                        {"denormal_lamp", denormal_lamp, -1.0, -1.0},
                                        {"tiny", [] { return scaled_room(1e-4f); }, 0.1, 0.05},
                                        {"huge", [] { return scaled_room(1e4f); }, 0.1, 0.05},
                                        {"far_file", [] { return import_room(1e6); }, 0.1, 0.05},
                                        {"dark", dark, 0.0, 0.0}};

inline void expect_an_image(const Image& image, const std::string& what) {
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const glm::vec3& L = image.pixels[i];
    ASSERT_TRUE(is_finite(L) && L.x >= 0.0f && L.y >= 0.0f && L.z >= 0.0f)
        << what << ", pixel " << i << ": " << L.x << ' ' << L.y << ' ' << L.z;
  }
}

inline double mean_of(const Image& image) {
  double sum = 0.0;
  for (const glm::vec3& L : image.pixels) sum += L.y;
  return sum / static_cast<double>(image.pixels.size());
}

}  // namespace icbench
