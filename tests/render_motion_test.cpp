// Moving geometry: after go_to, rays hit what they would hit in a scene built for that frame; what go_to reports is
// exact. And the built-in scenes seen with rays: rooms are closed, surfaces do not coincide, nothing moves through
// anything.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/random.h"
#include "render/camera.h"
#include "render/ray_tracer.h"
#include "render/sampling.h"
#include "render_support.h"
#include "scene/motion.h"
#include "scene/registry.h"
#include "scene/room.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

// The scene as it is at the tracer's frame, every mesh with vertices of its own and none moving.
Scene rebuilt(const RayTracer& rays) {
  Scene s;
  s.name = "rebuilt";
  s.materials = rays.scene().materials;
  s.camera = rays.scene().camera;
  for (std::uint32_t i = 0; i < rays.scene().meshes.size(); ++i) {
    Mesh mesh = rays.scene().shape(i);
    mesh.material = rays.scene().meshes[i].material;
    mesh.deform = {};
    if (mesh.pose) place(mesh, rays.pose(i));
    mesh.pose = {};
    s.meshes.push_back(std::move(mesh));
  }
  return s;
}

std::vector<Ray> camera_rays(const RayTracer& rays, int size) {
  const CameraView view(rays.scene().camera, size, size);
  std::vector<Ray> out;
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x)
      out.push_back(view.ray(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f));
  return out;
}

std::vector<Hit> hits_of(const RayTracer& rays, const std::vector<Ray>& asked) {
  std::vector<Hit> hits(asked.size());
  rays.intersect(asked, hits);
  return hits;
}

bool same_bits(const Hit& a, const Hit& b) {
  return a.p == b.p && a.n == b.n && a.ng == b.ng && a.t == b.t && a.material == b.material &&
         a.mesh == b.mesh && a.uv == b.uv && a.front == b.front;
}

// A room with two turning, sheared and squashed balls of one shape.
Scene tumbling_balls() {
  Scene s;
  s.name = "tumbling_balls";
  const auto wall = s.add_material({.albedo = glm::vec3(0.5f)});
  const auto lamp = s.add_material({.emission = glm::vec3(5.0f)});
  add_room(s, {{-3, 0, -3}, {3, 3, 3}}, {wall, wall, wall, wall, wall, wall});
  s.meshes.push_back(quad("lamp", {-0.5f, 2.99f, -0.5f}, {1, 0, 0}, {0, 0, 1}, lamp));
  const auto first = static_cast<std::uint32_t>(s.meshes.size());
  for (int i = 0; i < 2; ++i) {
    Mesh mesh = i == 0 ? ball("ball", {0.2f, 0.1f, 0.0f}, 0.5f, 3, wall) : Mesh{"other", {}, {}, {}, wall};
    if (i > 0) mesh.instance_of = first;
    const float side = i == 0 ? -1.2f : 1.2f;
    mesh.pose = [side](float frame) {
      const Pose turn =
          turned(loop_angle(frame) + side, {side, 1.2f + 0.5f * std::sin(loop_angle(frame)), side});
      return Pose{turn.linear * glm::mat3(1.2f, 0.3f, 0, 0, 0.7f, 0, 0.1f, 0, 1.0f), turn.shift};
    };
    s.meshes.push_back(std::move(mesh));
  }
  s.camera = {.eye = {0, 1.5f, 2.9f}, .target = {0, 1.2f, 0}, .up = {0, 1, 0}, .fov_y = 1.2f};
  s.frames = kLoopFrames;
  return s;
}

// Compares the tracer with one that was built for its frame. A ray that grazes the edge of a shape may meet it in one
// and pass it in the other, for an instance is met by a ray that was transformed, hence rounded.
void expect_hits_of_a_rebuilt_scene(const RayTracer& rays, const std::string& what) {
  const RayTracer fresh(rebuilt(rays));
  const std::vector<Ray> asked = camera_rays(rays, 64);
  const std::vector<Hit> moved = hits_of(rays, asked), built = hits_of(fresh, asked);
  std::size_t grazing = 0, on_moving = 0;
  for (std::size_t i = 0; i < asked.size(); ++i) {
    const Hit &a = moved[i], &b = built[i];
    if (a.mesh != b.mesh || glm::distance(a.p, b.p) > 10.0f * rays.epsilon()) {
      ++grazing;
      continue;
    }
    if (a.missed()) continue;
    on_moving += rays.scene().meshes[a.mesh].moves();
    ASSERT_EQ(a.material, b.material) << what;
    ASSERT_EQ(a.front, b.front) << what;
    // Neighbouring triangles meet in an edge: there the one or the other is hit.
    ASSERT_GT(glm::dot(a.n, b.n), rays.scene().shape(a.mesh).normals.empty() ? 0.9f : 0.999f) << what;
    ASSERT_NEAR(glm::length(a.n), 1.0f, 1e-5f) << what;
    ASSERT_GE(glm::dot(a.n, a.ng), 0.0f) << what;
  }
  EXPECT_LE(grazing, 4u) << what;
  EXPECT_GT(on_moving, 30u) << what << ": nothing that moves is in view";
}

TEST(RenderMotion, InstancesAreHitLikeARebuiltSceneAtEveryFrame) {
  RayTracer rays(tumbling_balls());
  for (std::uint32_t frame = 0; frame < rays.scene().frames; ++frame) {
    rays.go_to(static_cast<float>(frame));
    expect_hits_of_a_rebuilt_scene(rays, "tumbling_balls " + std::to_string(frame));
  }
}

TEST(RenderMotion, TheBuiltInScenesAreHitLikeRebuiltOnes) {
  for (const char* name : {"desk", "bunnies_2"}) {
    RayTracer rays(make_scene(name));
    for (const float frame : {0.0f, 41.5f}) {
      rays.go_to(frame);
      expect_hits_of_a_rebuilt_scene(rays, name);
    }
  }
}

TEST(RenderMotion, ARefittedMeshIsHitBitForBitLikeARebuiltOneAtEveryFrame) {
  RayTracer rays(make_scene("wobble"));
  const std::vector<Ray> asked = camera_rays(rays, 64);
  for (std::uint32_t frame = 0; frame < rays.scene().frames; ++frame) {
    rays.go_to(static_cast<float>(frame));
    const RayTracer fresh(rebuilt(rays));
    const std::vector<Hit> refitted = hits_of(rays, asked), built = hits_of(fresh, asked);
    for (std::size_t i = 0; i < asked.size(); ++i)
      ASSERT_TRUE(same_bits(refitted[i], built[i])) << "frame " << frame << " ray " << i;
  }
}

TEST(RenderMotion, ThereAndBackAgainIsBitForBitTheSame) {
  for (const char* name : {"wobble", "desk", "bunnies_2"}) {
    RayTracer rays(make_scene(name));
    const std::vector<Ray> asked = camera_rays(rays, 64);
    const std::vector<Hit> start = hits_of(rays, asked);
    std::size_t different = 0;
    for (const float frame : {57.0f, 13.5f, 99.0f}) {
      rays.go_to(frame);
      const std::vector<Hit> now = hits_of(rays, asked);
      for (std::size_t i = 0; i < asked.size(); ++i) different += !same_bits(start[i], now[i]);
    }
    EXPECT_GT(different, 100u) << name << " does not move";
    rays.go_to(0.0f);
    const std::vector<Hit> back = hits_of(rays, asked);
    for (std::size_t i = 0; i < asked.size(); ++i)
      ASSERT_TRUE(same_bits(start[i], back[i])) << name << " ray " << i;
  }
}

TEST(RenderMotion, PosedBoxesHoldAllVerticesBeforeAndAfter) {
  const auto holds = [](const PosedBox& box, const std::vector<glm::vec3>& positions, const Pose& pose) {
    return box.pose == pose && std::all_of(positions.begin(), positions.end(),
                                           [&](const glm::vec3& p) { return box.box.contains(p); });
  };
  for (const char* name : {"wobble", "desk", "bunnies_2"}) {
    RayTracer rays(make_scene(name));
    for (const float frame : {1.0f, 50.0f, 98.5f, 20.0f}) {
      std::vector<std::vector<glm::vec3>> positions;
      std::vector<Pose> poses;
      for (std::uint32_t i = 0; i < rays.scene().meshes.size(); ++i) {
        positions.push_back(rays.scene().shape(i).positions);
        poses.push_back(rays.pose(i));
      }
      const SceneChange change = rays.go_to(frame);
      const auto moving = static_cast<std::size_t>(std::count_if(
          rays.scene().meshes.begin(), rays.scene().meshes.end(), [](const Mesh& m) { return m.moves(); }));
      EXPECT_EQ(change.moved.size(), moving) << name;
      for (const MovedMesh& m : change.moved) {
        EXPECT_TRUE(holds(m.before, positions[m.mesh], poses[m.mesh])) << name << " frame " << frame;
        EXPECT_TRUE(holds(m.after, rays.scene().shape(m.mesh).positions, rays.pose(m.mesh)))
            << name << " frame " << frame;
      }
    }
  }
}

TEST(RenderMotion, FramesCountModuloTheScenes) {
  RayTracer rays(make_scene("wobble")), other(make_scene("wobble"));
  const std::vector<Ray> asked = camera_rays(rays, 32);
  rays.go_to(37.5f);
  other.go_to(537.5f);
  EXPECT_EQ(other.frame(), 37.5f);
  EXPECT_FALSE(rays.go_to(100.0f + 37.5f).any());
  const std::vector<Hit> a = hits_of(rays, asked), b = hits_of(other, asked);
  for (std::size_t i = 0; i < asked.size(); ++i) ASSERT_TRUE(same_bits(a[i], b[i]));
}

TEST(RenderMotion, NothingIsReportedIfNothingChanged) {
  for (const char* name :
       {"wobble", "desk", "cornell_camera", "cornell_lamp", "cornell_paint", "lit_floor"}) {
    RayTracer rays(make_scene(name));
    EXPECT_FALSE(rays.go_to(0.0f).any()) << name;
    rays.go_to(20.0f);
    EXPECT_FALSE(rays.go_to(20.0f).any()) << name;
  }
}

TEST(RenderMotion, AChangeIsReportedAsWhatItIs) {
  const auto change_of = [](const char* name) {
    RayTracer rays(make_scene(name));
    return rays.go_to(20.0f);
  };
  const SceneChange camera = change_of("cornell_camera");
  EXPECT_TRUE(camera.camera && camera.moved.empty() && !camera.materials && !camera.lights);
  const SceneChange paint = change_of("cornell_paint");
  EXPECT_TRUE(paint.materials && paint.moved.empty() && !paint.camera && !paint.lights);
  const SceneChange lamp = change_of("cornell_lamp");
  EXPECT_TRUE(lamp.materials && lamp.lights && lamp.moved.empty() && !lamp.camera);
  const SceneChange chair = change_of("desk");
  EXPECT_TRUE(!chair.materials && !chair.lights && !chair.camera);
  EXPECT_EQ(chair.moved.size(), 2u) << "frame and cushions";
}

TEST(RenderMotion, ALampThatDimsIsAChangeOfMaterialAndOfLight) {
  Scene s = tumbling_balls();
  std::erase_if(s.meshes, [](const Mesh& m) { return m.moves(); });
  s.change_light = [](float frame, std::span<Material> materials, std::span<PointLight>) {
    materials[1].emission = glm::vec3(5.0f - 0.04f * frame);
  };
  RayTracer rays(std::move(s));
  const SceneChange change = rays.go_to(50.0f);
  EXPECT_TRUE(change.materials && change.lights && change.moved.empty() && !change.camera);
  EXPECT_EQ(rays.scene().lights.sample(0.5f, 0.5f, 0.5f).emission, glm::vec3(3.0f));
}

TEST(RenderMotion, OnlyWhatMovesIsReported) {
  Scene s = tumbling_balls();
  Mesh& first = s.meshes[s.meshes.size() - 2];
  first.pose = [pose = first.pose](float frame) {
    return pose(std::max(frame, 50.0f));
  };  // waits for its turn
  const auto other = static_cast<std::uint32_t>(s.meshes.size() - 1);
  RayTracer rays(std::move(s));
  const SceneChange early = rays.go_to(30.0f);
  ASSERT_EQ(early.moved.size(), 1u);
  EXPECT_EQ(early.moved[0].mesh, other);
  EXPECT_EQ(rays.go_to(60.0f).moved.size(), 2u);
}

TEST(RenderMotion, ALampThatMovesTakesItsLightAlong) {
  Scene s = tumbling_balls();
  const auto lamp =
      std::find_if(s.meshes.begin(), s.meshes.end(), [](const Mesh& m) { return m.name == "lamp"; });
  lamp->pose = [](float frame) { return Pose{glm::mat3(1.0f), {0.01f * frame, -0.005f * frame, 0.0f}}; };
  RayTracer rays(std::move(s));
  const SceneChange change = rays.go_to(80.0f);
  EXPECT_TRUE(change.lights);
  const LightPoint middle = rays.scene().lights.sample(0.0f, 1.0f, 0.5f);
  EXPECT_NEAR(middle.p.y, 2.99f - 0.4f, 1e-5f);
  EXPECT_GE(middle.p.x, 0.3f - 1e-5f);
  Tracer tracer(rays);
  const Hit hit = tracer.intersect(Ray{{0.8f, 2.0f, 0.0f}, kInfinity, {0, 1, 0}});
  EXPECT_NEAR(hit.p.y, 2.99f - 0.4f, 1e-5f);
  EXPECT_EQ(rays.emitted(hit), glm::vec3(5.0f));
}

TEST(RenderScenes, RoomsAreClosed) {
  for (const char* name : {"wobble", "desk", "bunnies_9"}) {
    RayTracer rays(make_scene(name));
    rays.go_to(25.0f);
    Tracer tracer(rays);
    Pcg32 random(3);
    for (const Ray& ray : camera_rays(rays, 64)) {
      Hit at = tracer.intersect(ray);
      for (int bounce = 0; bounce < 4; ++bounce) {
        ASSERT_FALSE(at.missed()) << name;
        const float u = random.uniform(), v = random.uniform();
        at = tracer.intersect(Ray{rays.leave(at.p, at.ng), kInfinity, cosine_direction(Basis(at.ng), u, v)});
      }
    }
  }
}

// Calls f(mesh, point, normal) for `count` points spread evenly over all surfaces at the tracer's frame.
template <class F>
void for_surface_points(const RayTracer& rays, int count, F&& f) {
  const Scene s = rebuilt(rays);
  struct Piece {
    double end;  // of its share of the area, summed so far
    std::uint32_t mesh;
    glm::vec3 a, b, c;
  };
  std::vector<Piece> pieces;
  double area = 0.0;
  for (std::uint32_t i = 0; i < s.meshes.size(); ++i)
    for (const glm::uvec3& t : s.meshes[i].triangles) {
      const auto& p = s.meshes[i].positions;
      area += 0.5 * glm::length(glm::cross(p[t.y] - p[t.x], p[t.z] - p[t.x]));
      pieces.push_back({area, i, p[t.x], p[t.y], p[t.z]});
    }
  Pcg32 random(5);
  for (int k = 0; k < count; ++k) {
    const double at = area * (k + random.uniform()) / count;
    const auto piece = std::lower_bound(pieces.begin(), pieces.end() - 1, at,
                                        [](const Piece& p, double x) { return p.end < x; });
    const float root = std::sqrt(random.uniform()), v = random.uniform();
    const glm::vec3 p = (1.0f - root) * piece->a + root * (1.0f - v) * piece->b + root * v * piece->c;
    f(piece->mesh, p, glm::normalize(glm::cross(piece->b - piece->a, piece->c - piece->a)));
  }
}

TEST(RenderScenes, NoTwoSurfacesShareAPlace) {
  constexpr float kNear = 4e-4f;  // metres; things that stand on one another keep 1 mm
  constexpr int kPoints = 50'000;
  for (const char* name :
       {"cornell_box", "cornell_specular", "cornell_indirect", "wobble", "desk", "bunnies_4"}) {
    RayTracer rays(make_scene(name));
    rays.go_to(10.0f);
    Tracer tracer(rays);
    int shared = 0;
    std::string with;
    for_surface_points(rays, kPoints, [&](std::uint32_t mesh, const glm::vec3& p, const glm::vec3& n) {
      for (const glm::vec3& side : {n, -n}) {
        const Hit hit = tracer.intersect(Ray{p + kNear * side, 2.0f * kNear, -side});
        if (hit.missed() || hit.mesh == mesh) continue;
        ++shared;
        with += " " + rays.scene().meshes[mesh].name + "/" + rays.scene().meshes[hit.mesh].name;
      }
    });
    EXPECT_LE(shared, kPoints / 10'000) << name << ":" << with;
  }
}

// Every edge of what moves, against everything that stands still.
TEST(RenderScenes, NothingMovesThroughAnything) {
  for (const char* name :
       {"cornell_box", "cornell_specular", "cornell_indirect", "wobble", "desk", "bunnies_9"}) {
    Scene s = make_scene(name), still = s;
    std::erase_if(still.meshes, [](const Mesh& m) { return m.moves(); });
    const RayTracer rays(std::move(still));
    for (std::uint32_t frame = 0; frame < s.frames; frame += 5)
      for (std::size_t i = 0; i < s.meshes.size(); ++i) {
        if (!s.meshes[i].moves()) continue;
        Mesh mesh = s.shape(i);
        if (mesh.deform) mesh.deform(static_cast<float>(frame), mesh.positions, mesh.normals);
        const Pose pose = s.meshes[i].pose ? s.meshes[i].pose(static_cast<float>(frame)) : Pose{};
        std::vector<Ray> edges;
        const std::size_t stride = 1 + mesh.triangles.size() / 4000;
        for (std::size_t t = 0; t < mesh.triangles.size(); t += stride) {
          const glm::uvec3 v = mesh.triangles[t];
          const glm::vec3 a = pose(mesh.positions[v.x]), b = pose(mesh.positions[v.y]),
                          c = pose(mesh.positions[v.z]);
          edges.insert(edges.end(), {{a, 1.0f, b - a}, {b, 1.0f, c - b}, {c, 1.0f, a - c}});
        }
        const auto cut = std::make_unique<bool[]>(edges.size());
        rays.occluded(edges, {cut.get(), edges.size()});
        ASSERT_EQ(std::count(cut.get(), cut.get() + edges.size(), true), 0)
            << name << ": " << mesh.name << " at frame " << frame;
      }
  }
}

}  // namespace
}  // namespace icbench
