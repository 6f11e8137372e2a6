// Scenes on which nothing may go wrong, and what is expected of their pictures.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
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

// Whether two pictures are the same but for pixels whose rays took another side within rounding: of 400 pixels 5 did
// where this was measured, and means differed by 2e-5 at most.
inline void expect_alike(const Image& one, const Image& other, const std::string& what) {
  constexpr double kOthers = 0.03, kMean = 1e-4;
  std::size_t alike = 0;
  double mean_one = 0.0, mean_other = 0.0;
  for (std::size_t i = 0; i < one.pixels.size(); ++i) {
    alike += glm::distance(one.pixels[i], other.pixels[i]) <= 1e-3f * glm::length(one.pixels[i]);
    mean_one += one.pixels[i].y;
    mean_other += other.pixels[i].y;
  }
  ASSERT_GT(mean_one, 0.0) << what;
  std::printf("%s: %zu of %zu pixels alike, means differ by %.2g\n", what.c_str(), alike, one.pixels.size(),
              mean_other / mean_one - 1.0);
  EXPECT_GE(static_cast<double>(alike), (1.0 - kOthers) * static_cast<double>(one.pixels.size())) << what;
  EXPECT_NEAR(mean_other / mean_one, 1.0, kMean) << what;
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

// Patches that shine with 1e-20 and 1e20, a partition between them, from the bright side.
inline Scene bright_beside_dim() {
  Scene s = closed_room(2.0f);
  add_lamp_at(s, {0.2f, 1.9f, 0.2f}, 0.5f, 1e-20f);
  add_lamp_at(s, {1.2f, 1.9f, 0.2f}, 0.5f, 1e20f);
  s.meshes.push_back(quad("partition", {1, 0, 0}, {0, 0, 2}, {0, 2, 0}, 0));
  s.camera.eye = {1.1f, 1, 1.9f};
  return s;
}

// From the other side.
inline Scene dim_beside_bright() {
  Scene s = bright_beside_dim();
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

// Scenes on which nothing may go wrong, whoever renders them.
struct HardScene {
  const char* name;
  const char* guards_against;
  Scene (*make)();
  // Of a cached picture's mean, against a gather in every pixel, as shares of that: what the mean of `runs` pictures by
  // records of 256 rays may differ by, 2.5 to 4 standard deviations, and of one picture by virtual lights, which have
  // no noise. Of one picture the standard deviation is 1 %, of those by three records or so 3 to 4 %, with the slit
  // 7 %, where the level occlusion_hessian is 6 % too dark besides.
  double tolerance = 0.05;
  unsigned runs = 1;
  double tolerance_by_vpls = 0.05;
  // W/(m^2 sr): where brightness is left to chance, what the mean is at most.
  double most = 0.0;

  bool is_bright() const { return tolerance > 0.0; }
  // Where few shadow rays pass, even the mean over all pixels is noisy.
  bool is_noisy() const { return tolerance > 0.1; }
  unsigned gathers() const { return is_noisy() ? 4 : 1; }
};

inline const HardScene kHardScenes[] = {
    {"speck", "densities that overflow, and offsets that step over the lamp", speck},
    {"slit", "shadow rays that miss a narrow gap or slip past its edges", slit, 0.12, 8},
    {"grazing", "hits, normals and radii that depend on how flat a surface is looked at", grazing, 0.05, 16},
    {"corner", "radii and gradients that explode where all surfaces are near", corner_of_walls, 0.05, 16},
    {"needles", "light counted twice, and holes where triangles have no normal", needles},
    {"hall", "offsets as wide as a gap, and radii that reach through it", hall},
    {"bright_beside_dim", "weights, densities and sums that overflow", bright_beside_dim},
    // Lamps are drawn by power: what the dim one sends is left to chance, of a picture's radiance at most its own.
    {"dim_beside_bright", "light of a bright room that passes a wall, be it a share of 1e-40",
     dim_beside_bright, -1.0, 1, -1.0, 1e-20},
    {"denormal_light", "light that is lost where shares of it are no normal numbers", denormal_light},
    // All that is reflected is less than what the lamp sends.
    {"denormal_lamp", "the inverse of a vanishing power, which is infinite", denormal_lamp, -1.0, 1, -1.0,
     1e-42},
    {"tiny", "offsets and radii whose unit is the metre", [] { return scaled_room(1e-4f); }},
    {"huge", "squares and areas that outgrow their sums", [] { return scaled_room(1e4f); }},
    {"far_file", "coordinates of a file that lose their places", [] { return import_room(1e6); }},
    {"dark", "light from nowhere, and divisions by how much there is", dark, -1.0, 1, -1.0, 0.0}};

inline void expect_an_image(const Image& image, const std::string& what) {
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const glm::vec3& L = image.pixels[i];
    ASSERT_TRUE(is_finite(L) && L.x >= 0.0f && L.y >= 0.0f && L.z >= 0.0f)
        << what << ", pixel " << i << ": " << L.x << ' ' << L.y << ' ' << L.z;
  }
}

}  // namespace icbench
