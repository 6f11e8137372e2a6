// What the tests of scene files share.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <string>
#include <string_view>

#include "scene/import_scene.h"
#include "scene/scene.h"
#include "scene_files.h"
#include "temporary_folder.h"

namespace icbench {

inline ImportedScene import_text(const char* name, std::string_view text) {
  const TemporaryFolder folder;
  write(folder / name, text);
  return import_scene(folder / name);
}

inline GltfFile grey_cube() {
  GltfFile f;
  f.node({{"name", "cube"}, {"mesh", f.cube(f.material({{"name", "grey"}}))}});
  return f;
}

inline ImportedScene import_gltf(const GltfFile& file) { return import_text("scene.gltf", file.text()); }

inline bool has_note(const ImportedScene& s, const std::string& part) {
  return std::any_of(s.notes.begin(), s.notes.end(),
                     [&](const std::string& n) { return n.find(part) != n.npos; });
}

// By the divergence theorem: positive if the fronts of a closed mesh face outward.
inline double volume(const Mesh& mesh, const Pose& pose = {}) {
  double six = 0.0;
  for (const glm::uvec3& t : mesh.triangles)
    six += glm::dot(glm::dvec3(pose(mesh.positions[t.x])),
                    glm::cross(glm::dvec3(pose(mesh.positions[t.y])), glm::dvec3(pose(mesh.positions[t.z]))));
  return six / 6.0;
}

// Sum of the triangles' area vectors, m^2.
inline glm::dvec3 area(const Mesh& mesh) {
  glm::dvec3 sum(0.0);
  for (const glm::uvec3& t : mesh.triangles) {
    const glm::dvec3 a(mesh.positions[t.x]);
    sum += 0.5 * glm::cross(glm::dvec3(mesh.positions[t.y]) - a, glm::dvec3(mesh.positions[t.z]) - a);
  }
  return sum;
}

inline void expect_near(const glm::vec3& a, const glm::vec3& b, float tolerance) {
  EXPECT_LE(glm::distance(a, b), tolerance)
      << a.x << ' ' << a.y << ' ' << a.z << " is not " << b.x << ' ' << b.y << ' ' << b.z;
}

}  // namespace icbench
