// Spheres inside closed meshes: they lie within, and shadow rays that they answer are those that the mesh blocks.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/random.h"
#include "render/inner_spheres.h"
#include "render/occluders.h"
#include "render/ray_tracer.h"
#include "scene/registry.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

// A mesh and a BVH of it alone.
class Shape {
 public:
  explicit Shape(Mesh mesh)
      : mesh_(std::move(mesh)), device_(embree::new_device()), scene_(rtcNewScene(device_)) {
    const RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    const auto buffer = [&](RTCBufferType type, RTCFormat format, const auto& from) {
      using T = typename std::decay_t<decltype(from)>::value_type;
      std::copy(from.begin(), from.end(),
                static_cast<T*>(rtcSetNewGeometryBuffer(geometry, type, 0, format, sizeof(T), from.size())));
    };
    buffer(RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, mesh_.positions);
    buffer(RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, mesh_.triangles);
    embree::commit(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    embree::commit(scene_);
  }
  ~Shape() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  Shape(const Shape&) = delete;
  Shape& operator=(const Shape&) = delete;

  std::vector<Sphere> spheres() const { return inner_spheres(scene_, mesh_); }
  RTCScene scene() const { return scene_; }

 private:
  Mesh mesh_;
  RTCDevice device_;
  RTCScene scene_;
};

std::vector<Sphere> spheres_of(const Mesh& mesh) { return Shape(mesh).spheres(); }

Mesh bunny() { return make_scene("cornell_box").meshes.back(); }

// A ball with a smaller one inside it left out.
Mesh shell(const glm::vec3& centre, float outer, float inner) {
  Mesh mesh = icosphere("shell", centre, outer, 4, 0);
  Mesh cavity = icosphere("cavity", centre, inner, 4, 0);
  for (glm::uvec3& t : cavity.triangles) std::swap(t.y, t.z);
  append(mesh, cavity);
  return mesh;
}

glm::vec3 in_cube(Pcg32& random) {
  const float x = random.uniform(), y = random.uniform(), z = random.uniform();
  return 2.0f * glm::vec3(x, y, z) - 1.0f;
}

bool passes(const Sphere& s, const glm::vec3& from, const glm::vec3& to) {
  const glm::vec3 d = to - from;
  const float t = std::clamp(glm::dot(s.centre - from, d) / glm::dot(d, d), 0.0f, 1.0f);
  return glm::distance(from + t * d, s.centre) < s.radius;
}

TEST(InnerSpheres, OfTheBunnyLieWithinItAndAnswerMostRaysThatItBlocks) {
  const Mesh mesh = bunny();
  const std::vector<Sphere> spheres = spheres_of(mesh);
  ASSERT_GT(spheres.size(), 8u);
  Pcg32 random(5);
  for (int n = 0; n < 20000; ++n) {
    const glm::uvec3 t = mesh.triangles[random.below(static_cast<std::uint32_t>(mesh.triangles.size()))];
    const float u = random.uniform(), v = (1.0f - u) * random.uniform();
    const glm::vec3 on =
        (1.0f - u - v) * mesh.positions[t.x] + u * mesh.positions[t.y] + v * mesh.positions[t.z];
    for (const Sphere& s : spheres) ASSERT_GT(glm::distance(on, s.centre), s.radius);
  }

  Scene scene = make_scene("cornell_box");
  scene.meshes = {mesh};
  scene.meshes.front().pose = {};
  const RayTracer rays(scene);
  Tracer tracer(rays);
  for (const Sphere& s : spheres)
    for (int n = 0; n < 20; ++n) {
      const Hit hit =
          tracer.intersect(Ray{s.centre + 0.5f * s.radius * in_cube(random), 1e3f, in_cube(random)});
      ASSERT_TRUE(!hit.missed() && !hit.front) << "a sphere is not within the surface";
    }

  const Bounds box = bounds_of(mesh);
  const glm::vec3 centre = 0.5f * (box.lower + box.upper);
  const float reach = glm::distance(box.lower, box.upper);
  int blocked = 0, passed = 0;
  for (int n = 0; n < 20000; ++n) {
    const glm::vec3 from = centre + reach * glm::normalize(in_cube(random) + 1e-3f);
    const glm::vec3 by = centre + 0.5f * (box.upper - box.lower) * in_cube(random);
    const glm::vec3 to = by + reach * glm::normalize(by - from);
    const bool meets = std::ranges::any_of(spheres, [&](const Sphere& s) { return passes(s, from, to); });
    const bool hidden = tracer.occluded(Ray{from, 1.0f, to - from});
    ASSERT_TRUE(hidden || !meets) << "light passes through a sphere";
    blocked += hidden ? 1 : 0;
    passed += meets ? 1 : 0;
  }
  EXPECT_GT(passed, blocked * 7 / 10) << "of " << blocked;
}

TEST(InnerSpheres, AreNoneWhereInsideIsNotKnownOrNotWorthIt) {
  Mesh torn = bunny();
  torn.triangles.pop_back();
  EXPECT_TRUE(spheres_of(torn).empty()) << "light gets in by a hole";
  Mesh turned = bunny();
  std::swap(turned.triangles.front().y, turned.triangles.front().z);
  EXPECT_TRUE(spheres_of(turned).empty()) << "no winding number";
  EXPECT_TRUE(spheres_of(icosphere("few", {}, 1.0f, 1, 0)).empty());
  Mesh plate = icosphere("plate", {}, 1.0f, 4, 0);
  for (glm::vec3& p : plate.positions) p.y *= 0.02f;
  EXPECT_TRUE(spheres_of(plate).empty());
  EXPECT_FALSE(spheres_of(icosphere("ball", {}, 1.0f, 4, 0)).empty());
  Mesh far = icosphere("far", {1e4f, 0.0f, 0.0f}, 1.0f, 4, 0);
  EXPECT_TRUE(spheres_of(far).empty()) << "its coordinates are too coarse";
}

TEST(InnerSpheres, AreNoneInACavity) {
  const std::vector<Sphere> spheres = spheres_of(shell({0.1f, 0.2f, 0.3f}, 1.0f, 0.5f));
  ASSERT_FALSE(spheres.empty());
  for (const Sphere& s : spheres)
    EXPECT_GT(glm::distance(s.centre, glm::vec3(0.1f, 0.2f, 0.3f)), 0.5f + 0.99f * s.radius);
}

// Answers with spheres are those without, to the bit: of segments around a solid and of some within it.
TEST(InnerSpheres, AnswersAreThoseOfTheTrianglesAlone) {
  Pose pose;
  pose.linear = glm::mat3(1.0f, 0, 0, 0.3f, 1.5f, 0, 0, 0, 0.8f);
  pose.shift = {0.5f, 0.5f, 0.5f};
  for (const Mesh& mesh : {bunny(), icosphere("ball", {}, 0.1f, 4, 0), shell({}, 0.1f, 0.05f)}) {
    const Shape shape(mesh);
    const Bounds box = bounds_of(mesh);
    const glm::vec3 centre = 0.5f * (box.lower + box.upper), half = 0.5f * (box.upper - box.lower);
    const std::vector<Sphere> spheres = shape.spheres();
    ASSERT_FALSE(spheres.empty());
    Occluders with, without;
    with.add_moving(shape.scene(), {box, pose}, 2e-6f, spheres);
    without.add_moving(shape.scene(), {box, pose}, 2e-6f, {});
    Pcg32 random(7);
    int hidden = 0;
    for (int n = 0; n < 3000; ++n) {
      const auto somewhere = [&](int i) {
        return pose(centre + (i % 2 == 0 ? 1.2f : 4.0f) * half * in_cube(random));
      };
      const glm::vec3 from = somewhere(n);
      std::array<float, 64> x{}, y{}, z{};
      for (int i = 0; i < 64; ++i) {
        const glm::vec3 to = somewhere(i);
        x[i] = to.x;
        y[i] = to.y;
        z[i] = to.z;
      }
      const auto ask = [&](const Occluders& o) {
        return o.occluded_from(from, x.data(), y.data(), z.data(), ~std::uint64_t{0}, Packing::exact,
                               Shapes::all);
      };
      const std::uint64_t answers = ask(with);
      ASSERT_EQ(answers, ask(without));
      hidden += std::popcount(answers);
    }
    EXPECT_GT(hidden, 3000 * 64 / 10);
    EXPECT_LT(hidden, 3000 * 64 * 9 / 10);
  }
}

// A sphere that is not within the mesh shows that it is what answers.
TEST(InnerSpheres, AreAskedBeforeTheTriangles) {
  const Shape shape(icosphere("ball", {}, 0.1f, 4, 0));
  const Sphere wrong{{0.0f, 0.0f, 0.0f}, 0.5f};
  Occluders with, without;
  const PosedBox posed{{glm::vec3(-1.0f), glm::vec3(1.0f)}, Pose{}};
  with.add_moving(shape.scene(), posed, 2e-6f, {&wrong, 1});
  without.add_moving(shape.scene(), posed, 2e-6f, {});
  const float x[1] = {2.0f}, y[1] = {0.3f}, z[1] = {0.0f};
  const glm::vec3 from(-2.0f, 0.3f, 0.0f);
  EXPECT_EQ(without.occluded_from(from, x, y, z, 1, Packing::exact, Shapes::moving), 0u);
  EXPECT_EQ(with.occluded_from(from, x, y, z, 1, Packing::exact, Shapes::moving), 1u);
}

}  // namespace
}  // namespace icbench
