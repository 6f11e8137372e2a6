// Boxes of what moved: which segments meet them.
#include "render/moved_boxes.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/vec3.hpp>
#include <utility>
#include <vector>

#include "core/random.h"
#include "render/ray_tracer.h"
#include "scene/directions.h"
#include "temporal_scenes.h"

namespace icbench {
namespace {

TEST(MovedBoxes, EverySegmentThatMeetsTheMeshIsTold) {
  Scene scene = animated_room({.rigid = true});
  RayTracer rays(scene);
  const std::uint32_t moving = static_cast<std::uint32_t>(scene.meshes.size() - 1);
  Tracer tracer(rays);
  Pcg32 random(7);
  std::uint64_t meeting = 0, told = 0;
  for (std::uint32_t frame = 1; frame < 16; ++frame) {
    const MovedBoxes boxes(rays.go_to(static_cast<float>(frame)), rays.epsilon());
    for (int i = 0; i < 2000; ++i) {
      const auto point = [&] {
        return glm::vec3(1.98f * random.uniform() - 0.99f, 1.98f * random.uniform() + 0.01f,
                         1.98f * random.uniform() - 0.99f);
      };
      const glm::vec3 from = point(), to = point();
      const Hit hit = tracer.intersect(Ray{from, 1.0f, to - from});
      const bool meets = boxes.meet(from, to);
      told += meets;
      if (hit.missed() || hit.mesh != moving) continue;
      ++meeting;
      ASSERT_TRUE(meets);
      // And where it ends on the mesh, or begins there.
      ASSERT_TRUE(boxes.meet(from, hit.p));
      ASSERT_TRUE(boxes.meet(hit.p, to));
    }
  }
  EXPECT_GT(meeting, 200u);
  EXPECT_LT(told, 15 * 2000 / 3) << "hardly a segment is spared";
}

// Guards against: a path that is kept though it meets a flat mesh, for the rounding of a pose that shifts it far.
TEST(MovedBoxes, FlatMeshesFarFromTheirPivotAreToldToo) {
  Pcg32 random(3);
  std::uint64_t meeting = 0;
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    Scene scene = animated_room({.rigid = true});
    const auto moving = static_cast<std::uint32_t>(scene.meshes.size() - 1);
    const glm::vec3 middle = 1e4f * glm::vec3(0.6f, 0.3f, -0.7f);
    const Basis turned(direction_at(Basis({0, 0, 1}), 2.0f * random.uniform(), random.uniform()));
    Mesh flat = box("flat", {middle - glm::vec3(0.3f), middle + glm::vec3(0.3f)}, 0);
    flat.pose = [=](float frame) {
      const glm::mat3 linear(turned.s, 1e-4f * turned.t, turned.n);
      return Pose{linear, glm::vec3(0.05f * frame - 0.3f, 1.0f, 0.1f) - linear * middle};
    };
    scene.meshes[moving] = flat;
    RayTracer rays(std::move(scene));
    Tracer tracer(rays);
    for (std::uint32_t frame = 1; frame < 8; ++frame) {
      const MovedBoxes boxes(rays.go_to(static_cast<float>(frame)), rays.epsilon());
      const PosedBox now = rays.moving().front();
      for (int i = 0; i < 200; ++i) {
        const auto within = [&] {
          return 0.6f * glm::vec3(random.uniform(), random.uniform(), random.uniform()) - 0.3f;
        };
        const glm::vec3 through = now.pose(middle + within());
        const glm::vec3 d = 0.3f * direction_at(Basis({0, 0, 1}), 2.0f * random.uniform(), random.uniform());
        const Hit hit = tracer.intersect(Ray{through - d, 1.0f, 2.0f * d});
        if (hit.missed() || hit.mesh != moving) continue;
        ++meeting;
        ASSERT_TRUE(boxes.meet(through - d, through + d)) << "turn " << seed << ", frame " << frame;
        ASSERT_TRUE(boxes.meet(through - d, hit.p)) << "turn " << seed << ", frame " << frame;
      }
    }
  }
  EXPECT_GT(meeting, 2000u);
}

// Guards against: a path from a sun or another far lamp that is kept though it meets the mesh, for rounding.
TEST(MovedBoxes, SegmentsFromFarOutsideAreToldToo) {
  RayTracer rays(animated_room({.rigid = true}));
  const MovedBoxes boxes(rays.go_to(5.0f), rays.epsilon());
  const PosedBox now = rays.moving().front();
  const auto corner = [&](int bits) {
    glm::vec3 p;
    for (int c = 0; c < 3; ++c) p[c] = (bits >> c & 1) != 0 ? now.box.upper[c] : now.box.lower[c];
    return now.pose(p);
  };
  Pcg32 random(11);
  for (const double distance : {1.0, 50.0, 1e3, 1e5})
    for (int i = 0; i < 20'000; ++i) {
      // Through an edge of the box as it is.
      const int bits = static_cast<int>(random() % 8), flipped = bits ^ 1 << random() % 3;
      const glm::dvec3 through = glm::mix(glm::dvec3(corner(bits)), glm::dvec3(corner(flipped)),
                                          static_cast<double>(random.uniform()));
      const glm::dvec3 d(direction_at(Basis({0, 0, 1}), 2.0f * random.uniform(), random.uniform()));
      const glm::vec3 from(through - distance * d), to(through + 0.5 * d);
      ASSERT_TRUE(boxes.meet(from, to)) << distance;
      ASSERT_TRUE(boxes.meet(to, from)) << distance;
    }
}

TEST(MovedBoxes, ManySegmentsAtOnceAreJudgedAsOneByOne) {
  RayTracer rays(animated_room({true, true, false, false, false}));
  const MovedBoxes boxes(rays.go_to(3.0f), rays.epsilon());
  Pcg32 random(3);
  std::vector<float> x, y, z;
  // A word to the left, which may be passed by as a whole, one to the right, and two points anywhere.
  for (int i = 0; i < 130; ++i) {
    x.push_back(i < 64    ? 0.3f * random.uniform() - 1.0f
                : i < 128 ? 1.0f - 0.3f * random.uniform()
                          : 2.0f * random.uniform() - 1.0f);
    y.push_back(2.0f * random.uniform());
    z.push_back(2.0f * random.uniform() - 1.0f);
  }
  const SegmentEnds ends(boxes, {x.data(), y.data(), z.data(), x.size()});
  for (int k = 0; k < 500; ++k) {
    const glm::vec3 from(2.0f * random.uniform() - 1.0f, 2.0f * random.uniform(),
                         2.0f * random.uniform() - 1.0f);
    std::vector<std::uint64_t> hits(3);
    ends.mark(from, hits);
    for (std::size_t i = 0; i < x.size(); ++i)
      ASSERT_EQ((hits[i / 64] >> (i % 64)) & 1u, boxes.meet(from, {x[i], y[i], z[i]}));
    ASSERT_EQ(hits[2] >> 2, 0u);
  }
}

// Guards against: a margin that is taken in the box's own space, which the pose scales.
TEST(MovedBoxes, MarginsAreOfTheWorld) {
  const PosedBox small{{glm::vec3(-1.0f), glm::vec3(1.0f)}, {glm::mat3(0.1f), glm::vec3(0.0f)}};
  constexpr float kEpsilon = 0.01f;  // boxes are larger by two of them
  const MovedBoxes boxes({&small, 1}, kEpsilon);
  EXPECT_TRUE(boxes.near({0.5f, 0, 0}, 0.39f));
  EXPECT_FALSE(boxes.near({0.5f, 0, 0}, 0.37f));
  EXPECT_TRUE(boxes.meet({-1, 0.119f, 0}, {1, 0.119f, 0}));
  EXPECT_FALSE(boxes.meet({-1, 0.13f, 0}, {1, 0.13f, 0}));
}

}  // namespace
}  // namespace icbench
