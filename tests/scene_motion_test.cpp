// The built-in animations: what each one promises (frames, size), that it is a loop without jumps, that nothing leaves
// its room, and that its solids are solids at every frame.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "scene/motion.h"
#include "scene/registry.h"
#include "scene/shapes.h"
#include "scene_solid.h"

namespace icbench {
namespace {

struct Animation {
  std::string_view name;
  std::size_t fewest, most;  // triangles stored, instances not counted again
  float step;                // no vertex moves further from one frame to the next, metres; 0: no mesh moves
};

constexpr Animation kAnimations[] = {
    {"cornell_box", 140'000, 160'000, 0.18f},
    {"wobble", 20'000, 30'000, 0.05f},
    {"desk", 15'000, 30'000, 0.08f},
    {"bunnies_1", 69'000, 70'500, 0.15f},
    {"bunnies_2", 69'000, 70'500, 0.15f},
    {"bunnies_4", 69'000, 70'500, 0.15f},
    {"bunnies_9", 69'000, 70'500, 0.15f},
    {"cornell_specular", 105'000, 120'000, 0.15f},
    {"cornell_indirect", 140'000, 160'000, 0.18f},
    {"cornell_camera", 140'000, 160'000, 0.0f},
    {"cornell_lamp", 140'000, 160'000, 0.0f},
    {"cornell_paint", 140'000, 160'000, 0.0f},
};

// The vertices of mesh i at a frame, not wrapped round. Of what moves rigidly the corners of its box stand for all: no
// vertex moves further than one of them.
std::vector<glm::vec3> vertices_at(const Scene& s, std::size_t i, float frame) {
  const Mesh& mesh = s.meshes[i];
  const Mesh& shape = s.shape(i);
  if (mesh.deform) {
    std::vector<glm::vec3> positions = mesh.positions, normals = mesh.normals;
    mesh.deform(frame, positions, normals);
    return positions;
  }
  const Bounds rest = bounds_of(shape);
  std::vector<glm::vec3> corners;
  for (int c = 0; c < 8; ++c) corners.push_back(mesh.pose(frame)(corner(rest, c)));
  return corners;
}

float largest_step(const std::vector<glm::vec3>& a, const std::vector<glm::vec3>& b) {
  float largest = 0.0f;
  for (std::size_t v = 0; v < a.size(); ++v) largest = std::max(largest, glm::distance(a[v], b[v]));
  return largest;
}

// Materials and point lights at a frame.
struct Lighting {
  std::vector<Material> materials;
  std::vector<PointLight> lights;
};

Lighting lighting_at(const Scene& s, float frame) {
  Lighting at{s.materials, s.point_lights};
  s.change_light(frame, at.materials, at.lights);
  return at;
}

// Largest change of any channel of albedo or emission, relative to the largest emission, and of any light's place.
float largest_change(const Lighting& a, const Lighting& b) {
  const auto largest = [](const glm::vec3& v) {
    return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  };
  float change = 0.0f;
  for (std::size_t i = 0; i < a.materials.size(); ++i) {
    change = std::max(change, largest(a.materials[i].albedo - b.materials[i].albedo));
    change = std::max(change, largest(a.materials[i].emission - b.materials[i].emission) /
                                  std::max(1.0f, largest(a.materials[i].emission)));
  }
  for (std::size_t i = 0; i < a.lights.size(); ++i) {
    change = std::max(change, glm::distance(a.lights[i].p, b.lights[i].p));
    change = std::max(change, glm::distance(a.lights[i].axis, b.lights[i].axis));
  }
  return change;
}

TEST(SceneMotion, EveryAnimationHasItsFramesAndItsSize) {
  for (const Animation& a : kAnimations) {
    Scene s = make_scene(a.name);
    prepare(s);
    EXPECT_EQ(s.frames, kLoopFrames) << a.name;
    EXPECT_TRUE(s.is_animated()) << a.name;
    EXPECT_EQ(s.moves(), a.step > 0.0f) << a.name;
    EXPECT_EQ(s.dropped_triangles, 0u) << a.name;
    std::size_t stored = 0;
    for (const Mesh& mesh : s.meshes) stored += mesh.triangles.size();
    EXPECT_GE(stored, a.fewest) << a.name;
    EXPECT_LE(stored, a.most) << a.name;
  }
}

TEST(SceneMotion, MeshesMoveRoundALoopWithoutAJump) {
  for (const Animation& a : kAnimations) {
    const Scene s = make_scene(a.name);
    for (std::size_t i = 0; i < s.meshes.size(); ++i) {
      if (!s.meshes[i].moves()) continue;
      const std::vector<glm::vec3> start = vertices_at(s, i, 0.0f);
      std::vector<glm::vec3> before = start;
      float travelled = 0.0f;
      for (std::uint32_t frame = 1; frame <= s.frames; ++frame) {
        std::vector<glm::vec3> now = vertices_at(s, i, static_cast<float>(frame));
        const float step = largest_step(before, now);
        ASSERT_LE(step, a.step) << a.name << " mesh " << i << " frame " << frame;
        travelled += step;
        before = std::move(now);
      }
      EXPECT_LT(largest_step(start, before), 1e-4f)
          << a.name << " mesh " << i << " is elsewhere after a loop";
      EXPECT_GT(travelled, 10.0f * a.step) << a.name << " mesh " << i << " hardly moves";
    }
  }
}

TEST(SceneMotion, TheCameraFliesALoopWithoutAJump) {
  const Scene s = make_scene("cornell_camera");
  ASSERT_TRUE(s.camera_path);
  float travelled = 0.0f;
  for (std::uint32_t frame = 1; frame <= s.frames; ++frame) {
    const Camera a = s.camera_path(static_cast<float>(frame - 1)),
                 b = s.camera_path(static_cast<float>(frame));
    ASSERT_LT(glm::distance(a.eye, b.eye), 0.3f);
    ASSERT_LT(glm::distance(a.target, b.target), 0.3f);
    travelled += glm::distance(a.eye, b.eye);
  }
  EXPECT_GT(travelled, 5.0f);
  EXPECT_LT(glm::distance(s.camera_path(0.0f).eye, s.camera_path(static_cast<float>(s.frames)).eye), 1e-4f);
}

TEST(SceneMotion, LightAndPaintChangeInALoopWithoutAJump) {
  for (const char* name : {"cornell_lamp", "cornell_paint"}) {
    const Scene s = make_scene(name);
    ASSERT_TRUE(s.change_light) << name;
    const Lighting start = lighting_at(s, 0.0f);
    float most = 0.0f;
    for (std::uint32_t frame = 1; frame <= s.frames; ++frame) {
      const Lighting a = lighting_at(s, static_cast<float>(frame - 1)),
                     b = lighting_at(s, static_cast<float>(frame));
      ASSERT_LT(largest_change(a, b), 0.15f) << name << " frame " << frame;
      most = std::max(most, largest_change(start, b));
    }
    EXPECT_GT(most, 0.4f) << name << " hardly changes";
    EXPECT_LT(largest_change(start, lighting_at(s, static_cast<float>(s.frames))), 1e-4f) << name;
  }
}

TEST(SceneMotion, LampsNeverGoOutAndWallsNeverGlow) {
  for (const char* name : {"cornell_lamp", "cornell_paint"}) {
    const Scene s = make_scene(name);
    for (std::uint32_t frame = 0; frame < s.frames; ++frame) {
      const Lighting at = lighting_at(s, static_cast<float>(frame));
      for (std::size_t i = 0; i < s.materials.size(); ++i)
        EXPECT_EQ(at.materials[i].emits(), s.materials[i].emits()) << name << " material " << i;
    }
  }
}

TEST(SceneMotion, NothingLeavesItsRoom) {
  for (const Animation& a : kAnimations) {
    const Scene s = make_scene(a.name);
    // Of its sides alone where they are meshes of their own: what stands in a wall would make room for itself.
    const auto is_side = [](const Mesh& m) {
      return m.name == "floor" || m.name == "ceiling" || m.name == "left" || m.name == "right" ||
             m.name == "back" || m.name == "front";
    };
    const bool has_sides = std::any_of(s.meshes.begin(), s.meshes.end(), is_side);
    Bounds room{glm::vec3(std::numeric_limits<float>::max()), glm::vec3(-std::numeric_limits<float>::max())};
    for (const Mesh& mesh : s.meshes) {
      if (mesh.moves() || is_side(mesh) != has_sides) continue;
      const Bounds b = bounds_of(mesh);
      room = {glm::min(room.lower, b.lower), glm::max(room.upper, b.upper)};
    }
    for (const Mesh& mesh : s.meshes) {
      if (mesh.moves()) continue;
      const Bounds b = bounds_of(mesh);
      EXPECT_TRUE(room.contains(b.lower) && room.contains(b.upper)) << a.name << " " << mesh.name;
    }
    const glm::vec3 gap(0.0009f);
    const Bounds inside{room.lower + gap, room.upper - gap};
    for (std::size_t i = 0; i < s.meshes.size(); ++i) {
      if (!s.meshes[i].moves()) continue;
      for (std::uint32_t half = 0; half < 2 * s.frames; ++half) {
        // All vertices: the corners of a turned box reach further than the shape does.
        const float frame = 0.5f * static_cast<float>(half);
        const Mesh& shape = s.shape(i);
        std::vector<glm::vec3> positions = shape.positions, normals = shape.normals;
        if (s.meshes[i].deform) s.meshes[i].deform(frame, positions, normals);
        const Pose pose = s.meshes[i].pose ? s.meshes[i].pose(frame) : Pose{};
        for (const glm::vec3& p : positions)
          ASSERT_TRUE(inside.contains(pose(p))) << a.name << " mesh " << i << " frame " << frame;
      }
    }
  }
}

TEST(SceneMotion, AlbedosArePlausible) {
  for (const Animation& a : kAnimations)
    for (const Material& m : make_scene(a.name).materials) {
      if (m.is_specular()) continue;
      EXPECT_LE(std::max({m.albedo.x, m.albedo.y, m.albedo.z}), 0.85f) << a.name;
    }
}

// Single triangles and quads are walls, lamps and pictures; all else is solid.
TEST(SceneMotion, SolidsAreClosedFaceOutwardAndHaveNormalsOfTheirOwnSide) {
  std::set<std::string> seen;  // the bunny and the statue are in many scenes
  for (const Animation& a : kAnimations) {
    const Scene s = make_scene(a.name);
    for (const Mesh& mesh : s.meshes) {
      if (mesh.triangles.size() <= 2) continue;
      const bool scanned = mesh.name == "bunny" || mesh.name == "venus";
      if (scanned && !seen.insert(mesh.name).second) continue;
      EXPECT_TRUE(is_closed(mesh)) << a.name << ": " << mesh.name;
      EXPECT_GT(smallest_piece(mesh), 0.0) << a.name << ": " << mesh.name;
      if (mesh.normals.empty()) continue;
      for (const glm::vec3& n : mesh.normals) ASSERT_TRUE(is_unit(n)) << a.name << ": " << mesh.name;
      // Scanned and sculpted surfaces are rougher than their triangles are small.
      EXPECT_LE(share_of_normals_astray(mesh), scanned ? 1e-3 : 0.0) << a.name << ": " << mesh.name;
    }
  }
}

// The shear of the rows keeps the volume, and central differences give the normals once more.
TEST(SceneMotion, TheWobblingColumnStaysASolidWithTheNormalsOfItsSurface) {
  const Scene s = make_scene("wobble");
  const auto column =
      std::find_if(s.meshes.begin(), s.meshes.end(), [](const Mesh& m) { return !!m.deform; });
  ASSERT_NE(column, s.meshes.end());
  const double at_rest = volume(*column);
  Mesh mesh = *column;
  for (const float frame : {0.0f, 12.25f, 33.0f, 66.0f, 99.5f}) {
    mesh.deform(frame, mesh.positions, mesh.normals);
    EXPECT_TRUE(is_closed(mesh)) << frame;
    EXPECT_NEAR(volume(mesh), at_rest, 1e-3 * at_rest) << frame;
    EXPECT_EQ(share_of_normals_astray(mesh), 0.0) << frame;
    std::vector<glm::vec3> around(mesh.positions.size(), glm::vec3(0.0f));
    for (const glm::uvec3& t : mesh.triangles) {
      const glm::vec3 ng =
          glm::cross(mesh.positions[t.y] - mesh.positions[t.x], mesh.positions[t.z] - mesh.positions[t.x]);
      for (const std::uint32_t v : {t.x, t.y, t.z}) around[v] += ng;
    }
    for (std::size_t v = 0; v < around.size(); ++v) {
      ASSERT_TRUE(is_unit(mesh.normals[v]));
      ASSERT_GT(glm::dot(glm::normalize(around[v]), mesh.normals[v]), 0.999f)
          << "frame " << frame << " vertex " << v;
    }
  }
}

TEST(SceneMotion, BunniesKeepApart) {
  for (const char* name : {"bunnies_2", "bunnies_4", "bunnies_9"}) {
    const Scene s = make_scene(name);
    std::vector<Bounds> footprints;  // over the whole loop
    for (std::size_t i = 0; i < s.meshes.size(); ++i) {
      if (!s.meshes[i].moves()) continue;
      Bounds all{glm::vec3(std::numeric_limits<float>::max()), glm::vec3(-std::numeric_limits<float>::max())};
      const Pose pose = s.meshes[i].pose(0.0f);
      for (const glm::vec3& p : s.shape(i).positions)
        all = {glm::min(all.lower, pose(p)), glm::max(all.upper, pose(p))};
      for (std::uint32_t frame = 0; frame < s.frames; ++frame) {
        const Pose later = s.meshes[i].pose(static_cast<float>(frame));
        ASSERT_EQ(later.linear, pose.linear);
        ASSERT_EQ(glm::vec2(later.shift.x, later.shift.z), glm::vec2(pose.shift.x, pose.shift.z));
      }
      footprints.push_back(all);
    }
    for (std::size_t i = 0; i < footprints.size(); ++i)
      for (std::size_t k = i + 1; k < footprints.size(); ++k) {
        const Bounds &a = footprints[i], &b = footprints[k];
        EXPECT_TRUE(a.upper.x < b.lower.x || b.upper.x < a.lower.x || a.upper.z < b.lower.z ||
                    b.upper.z < a.lower.z)
            << name << " " << i << " " << k;
      }
  }
}

TEST(SceneMotion, BunniesShareOneShapeRoomAndCamera) {
  const Scene one = make_scene("bunnies_1");
  for (const auto& [name, count] :
       {std::pair{"bunnies_1", 1}, {"bunnies_2", 2}, {"bunnies_4", 4}, {"bunnies_9", 9}}) {
    const Scene s = make_scene(name);
    EXPECT_EQ(std::count_if(s.meshes.begin(), s.meshes.end(), [](const Mesh& m) { return m.moves(); }),
              count);
    EXPECT_EQ(std::count_if(s.meshes.begin(), s.meshes.end(),
                            [](const Mesh& m) { return m.instance_of != kOwnShape; }),
              count - 1);
    EXPECT_EQ(s.camera, one.camera);
    for (std::size_t i = 0; !one.meshes[i].moves(); ++i) {
      EXPECT_EQ(s.meshes[i].positions, one.meshes[i].positions);
      EXPECT_EQ(s.materials[s.meshes[i].material], one.materials[one.meshes[i].material]);
    }
  }
}

}  // namespace
}  // namespace icbench
