// The modelled rooms: their solids are closed, apart and well shaped, their motion stays in the room, and nobody looks
// out of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "core/random.h"
#include "render/ray_tracer.h"
#include "render/sampling.h"
#include "scene/architecture.h"
#include "scene/furniture.h"
#include "scene/registry.h"
#include "scene/shapes.h"
#include "scene_solid.h"

namespace icbench {
namespace {

using glm::dvec3, glm::vec3;

constexpr float kPi = std::numbers::pi_v<float>;
constexpr const char* kRooms[] = {"conference", "sibenik", "office"};

// Corners whose normal leaves that of their triangle by 60 degrees or more.
std::size_t astray_normals(const Mesh& mesh) {
  std::size_t astray = 0;
  for (const glm::uvec3& t : mesh.triangles) {
    const dvec3 a(mesh.positions[t.x]), b(mesh.positions[t.y]), c(mesh.positions[t.z]);
    const dvec3 face = glm::normalize(glm::cross(b - a, c - a));
    for (int k = 0; k < 3; ++k) astray += !(glm::dot(face, dvec3(mesh.normals[t[k]])) > 0.5);
  }
  return astray;
}

void expect_solid(const std::string& what, const Mesh& mesh) {
  EXPECT_GT(mesh.triangles.size(), 0u) << what;
  EXPECT_TRUE(is_closed(mesh)) << what;
  EXPECT_GT(smallest_piece(mesh), 0.0) << what;
  EXPECT_EQ(mesh.normals.empty() ? 0u : astray_normals(mesh), 0u) << what;
}

void expect_solid(const std::string& what, const Parts& parts, std::uint32_t sheets = ~0u) {
  for (const auto& [material, mesh] : parts.meshes())
    if (material != sheets) expect_solid(what + ", material " + std::to_string(material), mesh);
}

double area(const std::vector<glm::uvec3>& triangles, const std::vector<glm::vec2>& points) {
  double sum = 0.0;
  for (const glm::uvec3& t : triangles) {
    const double one = doubled_area({points[t.x], points[t.y], points[t.z]});
    EXPECT_GT(one, 0.0);
    sum += 0.5 * one;
  }
  return sum;
}

TEST(ScenePolygon, TriangulationCoversAPolygonWithHolesExactlyOnce) {
  const Polygon outline = rectangle({-3.0f, 0.0f}, {3.0f, 4.0f});
  std::vector<Polygon> holes{arched_opening(-1.5f, 1.0f, 0.5f, 2.0f, 17),
                             arched_opening(1.5f, 1.0f, 0.5f, 2.0f, 17), circle({0.0f, 3.0f}, 0.5f, 24),
                             rectangle({-0.3f, 0.5f}, {0.3f, 2.0f})};
  std::vector<glm::vec2> points(outline);
  double expected = 24.0;
  for (const Polygon& hole : holes) {
    expected -= 0.5 * doubled_area(hole);
    points.insert(points.end(), hole.begin(), hole.end());
  }
  // n corners and h holes make n + 2 h - 2 triangles.
  const auto triangles = triangulate(outline, holes);
  EXPECT_EQ(triangles.size(), points.size() + 2 * holes.size() - 2);
  EXPECT_NEAR(area(triangles, points), expected, 1e-5);
}

TEST(ScenePolygon, HolesInEitherDirectionAndOfOneHeightAreCutOut) {
  const Polygon outline = rectangle({0.0f, 0.0f}, {10.0f, 3.0f});
  std::vector<Polygon> holes;
  std::vector<glm::vec2> points(outline);
  for (int i = 0; i < 9; ++i) {  // side by side: all bridges in line
    const float x = 0.5f + static_cast<float>(i);
    holes.push_back(rectangle({x, 1.0f}, {x + 0.5f, 2.0f}));
    if (i % 2) std::reverse(holes.back().begin(), holes.back().end());
    points.insert(points.end(), holes.back().begin(), holes.back().end());
  }
  EXPECT_NEAR(area(triangulate(outline, holes), points), 30.0 - 9 * 0.5, 1e-5);
}

TEST(ScenePolygon, AFigureThatCrossesItselfIsRefused) {
  EXPECT_THROW(triangulate({{0, 0}, {1, 1}, {1, 0}, {0, 1}}), std::runtime_error);
  EXPECT_THROW(triangulate(rectangle({0, 0}, {1, 1}), std::array{rectangle({5, 0}, {6, 1})}),
               std::runtime_error);
}

TEST(SceneSolids, VolumesAreThoseOfGeometry) {
  EXPECT_NEAR(volume(extrude(rectangle({0, 0}, {2, 3}), 4.0f, std::array{rectangle({0.5f, 1}, {1.5f, 2})})),
              20.0, 1e-4);
  EXPECT_NEAR(volume(tube({{1, 1, 1}, {1, 4, 1}}, 0.5f, 64)), 0.75 * kPi, 0.01);
  EXPECT_NEAR(volume(rounded_box({{0, 0, 0}, {1, 2, 3}}, 1e-3f)), 6.0, 1e-3);
  const double ball = volume(rounded_box({vec3(-1.0f), vec3(1.0f)}, 0.999f, 16));
  EXPECT_NEAR(ball, 4.0 / 3.0 * kPi, 0.03);
  // Pappus: the area of the profile times the way of its centroid.
  const Path ring = lift(circle({0.0f, 0.0f}, 2.0f, 256), vec3(5.0f), {1, 0, 0}, {0, 0, -1});
  const Mesh torus = sweep(ring, circle({0.0f, 0.0f}, 0.5f, 64), {0, 1, 0}, true);
  EXPECT_NEAR(volume(torus), 2.0 * kPi * 2.0 * kPi * 0.25, 0.02);
  EXPECT_TRUE(is_closed(torus));
}

TEST(SceneSolids, ASweepIsMitredAtItsCornersAndFullyWideBetween) {
  const Mesh frame = sweep({{0, 0, 0}, {4, 0, 0}, {4, 3, 0}, {0, 3, 0}},
                           rectangle({-0.5f, -0.25f}, {0.5f, 0.25f}), {0, 0, 1}, true);
  expect_solid("frame", frame);
  EXPECT_NEAR(volume(frame), 0.5 * (5.0 * 4.0 - 3.0 * 2.0), 1e-4);
  const Bounds b = bounds_of(frame);
  EXPECT_NEAR(b.lower.x, -0.5f, 1e-5f);
  EXPECT_NEAR(b.upper.y, 3.5f, 1e-5f);
}

TEST(SceneSolids, MirroredAndTurnedSolidsStillFaceOutward) {
  const Mesh solid = shade(extrude(arched_opening(2.0f, 1.0f, 0.0f, 1.0f, 12), 0.3f));
  expect_solid("mirrored", mirrored(solid));
  expect_solid("turned", moved(solid, turned(2.0f, {1, 2, 3})));
  EXPECT_NEAR(volume(mirrored(solid)), volume(solid), 1e-5);
}

TEST(SceneSolids, ShadingKeepsEdgesAndRoundsTheRest) {
  const Mesh box = shade(extrude(rectangle({0, 0}, {1, 1}), 1.0f));
  EXPECT_EQ(box.positions.size(), 24u);  // three normals at each of eight corners
  const Mesh bar = shade(tube({{0, 0, 0}, {0, 1, 0}}, 0.5f, 24));
  for (std::size_t v = 0; v < bar.positions.size(); ++v) {
    if (std::abs(bar.normals[v].y) > 0.5f) continue;  // an end
    const vec3 radial = glm::normalize(vec3(bar.positions[v].x, 0.0f, bar.positions[v].z));
    EXPECT_GT(glm::dot(bar.normals[v], radial), 0.9999f);
  }
}

TEST(SceneFurniture, EveryPieceIsSolid) {
  const std::array<std::uint32_t, 3> books{1, 2, 3};
  expect_solid("conference chair", conference_chair({0, 1, 2}));
  expect_solid("swivel chair", swivel_chair({0, 1, 2}));
  expect_solid("table", conference_table(5.0f, 1.5f, 0.74f, 0, 1));
  expect_solid("desk", desk_with_drawers(1.8f, 0.8f, 0, 1));
  expect_solid("computer", computer(0, 1));
  expect_solid("lamp", table_lamp(0, 1));
  expect_solid("bookcase", bookcase({1.5f, 2.0f, 0.3f}, 5, 0, books));
  expect_solid("basket", waste_basket(0));
  expect_solid("mug", mug(0));
  expect_solid("plant", pot_plant(0, 1));
  expect_solid("picture", picture(0.8f, 0.6f, 0, 1, 2));
  expect_solid("whiteboard", whiteboard(2.0f, 1.0f, 0, 1, 2));
  expect_solid("door", door(0.9f, 2.0f, 0, 1, 2));
  expect_solid("window", window_frame(2.0f, 1.2f, 3, 2, 0));
  expect_solid("blind", venetian_blind(1.5f, 1.2f, 0.021f, 0.6f, 0));
  expect_solid("skirting", skirting({{0, 0, 0}, {-3, 0, 0}, {-3, 0, 4}}, 0.1f));
}

TEST(SceneFurniture, PiecesStandOnTheFloorAtTheirHeight) {
  const auto span = [](const Parts& parts) {
    Bounds all = bounds_of(parts.meshes().begin()->second);
    for (const auto& [material, mesh] : parts.meshes()) {
      all.lower = glm::min(all.lower, bounds_of(mesh).lower);
      all.upper = glm::max(all.upper, bounds_of(mesh).upper);
    }
    return all;
  };
  const auto expect_height = [&](const Parts& parts, float height) {
    EXPECT_NEAR(span(parts).lower.y, kGap, 1e-4f);
    EXPECT_NEAR(span(parts).upper.y, height, 0.02f);
  };
  expect_height(conference_chair({0, 1, 2}), 0.95f);
  expect_height(swivel_chair({0, 1, 2}), 1.08f);
  expect_height(conference_table(5.0f, 1.5f, 0.74f, 0, 1), 0.74f);
  expect_height(desk_with_drawers(1.8f, 0.8f, 0, 1), 0.75f);
  expect_height(waste_basket(0), 0.32f);
  expect_height(table_lamp(0, 1), 0.45f);
  expect_height(column(0.36f, 4.3f, 0), 4.3f);
  expect_height(colonnette(0.1f, 3.0f, 0), 3.0f);
}

TEST(SceneArchitecture, EveryPartIsSolid) {
  const std::array<Polygon, 1> opening{arched_opening(0.0f, 0.8f, 6.0f, 7.0f, 12)};
  expect_solid("column", column(0.4f, 4.0f, 0));
  expect_solid("colonnette", colonnette(0.1f, 4.0f, 0));
  expect_solid("arcade", shade(wall(arcade(3, 4.0f, 1.5f, 4.0f, 8.0f, 0.3f, 16), 0.6f, opening)));
  expect_solid("archivolt", shade(archivolt({0.0f, 3.0f}, 1.5f, 0.3f, 0.5f, 16)));
  expect_solid("archivolt without stilts", shade(archivolt({0.0f, 3.0f}, 1.5f, 0.3f, 0.0f, 16)));
  expect_solid("vault", shade(barrel_vault(3.0f, 10.0f, 0.3f, 0.2f, 24)));
  expect_solid("rib", shade(vault_rib(3.0f, 0.4f, 0.2f, 0.2f, 24)));
  expect_solid("half dome", shade(half_dome(3.0f, 0.3f, 0.2f, 12)));
  expect_solid("cornice", shade(cornice({{0, 1, 0}, {0, 1, 5}, {3, 1, 5}}, 0.3f)));
  expect_solid("window", arched_window(0.0f, 0.8f, 1.0f, 2.0f, 0.3f, 12, {0, 1, 2}), 2);
  expect_solid("rose", rose_window({0.0f, 5.0f}, 1.5f, 0.4f, {0, 1, 2}), 2);
}

TEST(SceneArchitecture, ArchesSpanTheirOpeningAndVaultsTheirRadius) {
  // An arch of radius r lacks half a disc for each bay.
  const double solid = 0.5 * doubled_area(arcade(3, 4.0f, 1.5f, 4.0f, 8.0f, 0.0f, 256));
  EXPECT_NEAR(solid, 12.0 * 4.0 - 3.0 * 0.5 * kPi * 1.5 * 1.5, 1e-2);
  const Bounds vault = bounds_of(barrel_vault(3.0f, 10.0f, 0.3f, 0.2f, 24));
  EXPECT_NEAR(vault.upper.y, 3.3f, 1e-4f);
  EXPECT_NEAR(vault.lower.y, -0.2f, 1e-4f);
  EXPECT_NEAR(vault.lower.z, -10.0f, 1e-4f);
  EXPECT_NEAR(vault.upper.z, 0.0f, 1e-4f);
  const Bounds dome = bounds_of(half_dome(3.0f, 0.3f, 0.2f, 12));
  EXPECT_NEAR(dome.upper.y, 3.3f, 1e-4f);
  EXPECT_NEAR(dome.upper.z, 0.0f, 1e-4f);
  EXPECT_NEAR(dome.lower.z, -3.3f, 1e-4f);
}

std::size_t triangles_of(const Scene& s) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < s.meshes.size(); ++i) count += s.shape(i).triangles.size();
  return count;
}

TEST(SceneRooms, HaveAsManyTrianglesAsTheyClaim) {
  const std::size_t conference = triangles_of(make_scene("conference")),
                    sibenik = triangles_of(make_scene("sibenik")),
                    office = triangles_of(make_scene("office"));
  EXPECT_TRUE(conference > 100'000 && conference < 150'000) << conference;
  EXPECT_TRUE(sibenik > 65'000 && sibenik < 90'000) << sibenik;
  EXPECT_TRUE(office > 30'000 && office < 80'000) << office;
}

TEST(SceneRooms, LoseNothingReflectPlausiblyAndAreLitByAreaLightsAlone) {
  for (const char* name : kRooms) {
    Scene s = make_scene(name);
    prepare(s);
    EXPECT_EQ(s.dropped_triangles, 0u) << name;
    EXPECT_TRUE(s.point_lights.empty()) << name;
    EXPECT_FALSE(s.lights.empty()) << name;
    for (const Material& m : s.materials) {
      EXPECT_LE(std::max({m.albedo.x, m.albedo.y, m.albedo.z}), 0.85f) << name;
      EXPECT_EQ(m.surface, Surface::diffuse) << name;
    }
  }
}

// Floors, ceilings and what shines are sheets; the rest is solid.
bool is_sheet(const Scene& s, const Mesh& m) {
  return s.materials[m.material].emits() || m.name == "floor" || m.name == "ceiling";
}

TEST(SceneRooms, AreMadeOfClosedSolidsWithNormalsThatFollowThem) {
  for (const char* name : kRooms) {
    const Scene s = make_scene(name);
    for (const Mesh& m : s.meshes)
      if (!is_sheet(s, m) && m.instance_of == kOwnShape && m.name != "bunny")
        expect_solid(std::string(name) + " " + m.name + " " + std::to_string(m.material), m);
  }
}

TEST(SceneRooms, TheConferenceRoomHasThePublishedSize) {
  RayTracer rays(make_scene("conference"));
  Tracer tracer(rays);
  // Between the walls, over the table and free of pictures; from floor to ceiling, between its bars.
  const auto across = [&](const vec3& from, const vec3& d) {
    const Hit there = tracer.intersect({from, 1e9f, d}), back = tracer.intersect({from, 1e9f, -d});
    return there.t + back.t;
  };
  constexpr float kFoot = 0.3048f;
  EXPECT_NEAR(across({0, 2.5f, 0.9f}, {1, 0, 0}), 35.5f * kFoot, 1e-3f);
  EXPECT_NEAR(across({3.0f, 2.5f, 0}, {0, 0, 1}), 22.0f * kFoot, 1e-3f);
  EXPECT_NEAR(across({4.9f, 1.2f, 2.05f}, {0, 1, 0}), 8.9f * kFoot, 1e-3f);
}

// Where a mesh is at a frame.
Bounds posed_bounds(const Scene& s, std::size_t i, float frame) {
  const Pose pose = s.meshes[i].pose(frame);
  Bounds b{vec3(1e9f), vec3(-1e9f)};
  for (const vec3& p : s.shape(i).positions) {
    b.lower = glm::min(b.lower, pose(p));
    b.upper = glm::max(b.upper, pose(p));
  }
  return b;
}

TEST(SceneRooms, WhatMovesStaysOverItsGroundWithATinyGap) {
  struct Ground {
    const char* scene;
    Bounds within;
  };
  const Ground grounds[] = {{"conference", {{-3.1f, 0.74f, -0.75f}, {3.1f, 1.3f, 0.75f}}},
                            {"sibenik", {{-2.9f, 0.0f, -18.6f}, {2.9f, 1.5f, -2.0f}}}};
  for (const auto& [name, within] : grounds) {
    const Scene s = make_scene(name);
    ASSERT_EQ(s.frames, kLoopFrames);
    std::size_t movers = 0;
    for (std::size_t i = 0; i < s.meshes.size(); ++i) {
      if (!s.meshes[i].moves()) continue;
      ++movers;
      float reach = 0.0f;
      for (int frame = 0; frame < 100; frame += 3) {
        const Bounds b = posed_bounds(s, i, static_cast<float>(frame));
        EXPECT_TRUE(within.contains(b.lower) && within.contains(b.upper)) << name << ", frame " << frame;
        EXPECT_GT(b.lower.y, within.lower.y) << name << ", frame " << frame;
        EXPECT_LT(b.lower.y, within.lower.y + 0.005f) << name << ", frame " << frame;
        reach = std::max(reach, glm::distance(b.lower, posed_bounds(s, i, 0.0f).lower));
      }
      EXPECT_GT(reach, 3.0f) << name << ": hardly moves";
    }
    EXPECT_EQ(movers, 1u) << name;
  }
}

TEST(SceneRooms, MotionIsContinuousAndComesBackToItsBeginning) {
  for (const char* name : {"conference", "sibenik"}) {
    const Scene s = make_scene(name);
    for (std::size_t i = 0; i < s.meshes.size(); ++i) {
      if (!s.meshes[i].moves()) continue;
      const Bounds b = bounds_of(s.shape(i));
      float longest = 0.0f;
      for (int frame = 0; frame < 100; ++frame) {  // the last step leads from frame 99 to frame 0
        const Pose from = s.meshes[i].pose(static_cast<float>(frame));
        const Pose to = s.meshes[i].pose(static_cast<float>((frame + 1) % 100));
        for (int c = 0; c < 8; ++c) {
          const float step = glm::distance(from(corner(b, c)), to(corner(b, c)));
          EXPECT_GT(step, 0.0f) << name << ", frame " << frame;
          longest = std::max(longest, step);
        }
      }
      EXPECT_LT(longest, 0.6f) << name;
    }
  }
}

TEST(SceneRooms, TheBunnyLooksWhereItGoes) {
  const Scene s = make_scene("conference");
  const auto bunny = std::find_if(s.meshes.begin(), s.meshes.end(), [](const Mesh& m) { return m.moves(); });
  ASSERT_NE(bunny, s.meshes.end());
  for (int frame = 0; frame < 100; frame += 7) {
    const auto f = static_cast<float>(frame);
    const vec3 way = glm::normalize(bunny->pose(f + 0.1f).shift - bunny->pose(f - 0.1f).shift);
    const vec3 nose = glm::normalize(bunny->pose(f).linear * vec3(-1, 0, 0));
    EXPECT_GT(glm::dot(way, nose), 0.99f) << "frame " << frame;
  }
}

// Paths that bounce about from the camera on visit every corner that light can reach.
TEST(SceneRooms, NoRayEscapesAndNoneEndsInsideASolid) {
  for (const char* name : kRooms) {
    RayTracer rays(make_scene(name));
    Tracer tracer(rays);
    Pcg32 random(11);
    std::size_t hits = 0, behind = 0;
    for (int path = 0; path < 20'000; ++path) {
      const Basis any(glm::normalize(rays.scene().camera.target - rays.scene().camera.eye));
      Ray ray{rays.scene().camera.eye, 1e9f, cosine_direction(any, random.uniform(), random.uniform())};
      for (int bounce = 0; bounce < 8; ++bounce) {
        const Hit hit = tracer.intersect(ray);
        ASSERT_FALSE(hit.missed()) << name << ": a ray leaves from " << ray.o.x << " " << ray.o.y << " "
                                   << ray.o.z << " towards " << ray.d.x << " " << ray.d.y << " " << ray.d.z;
        ++hits;
        behind += !hit.front;
        const float u = random.uniform(), v = random.uniform();
        ray = {rays.leave(hit.p, hit.ng), 1e9f, cosine_direction(Basis(hit.ng), u, v)};
      }
    }
    // An edge where two solids meet may let a ray in, by rounding.
    EXPECT_LT(behind, hits / 10'000) << name << ": " << behind << " of " << hits
                                     << " hits from inside a solid";
  }
}

struct Facet {
  dvec3 a, b, c, n;
  double low, high;  // along x + y + z
};

bool inside(const Facet& f, const dvec3& p) {
  constexpr double kMargin = 1e-7;  // m^2: edges that touch do not overlap
  return glm::dot(glm::cross(f.b - f.a, p - f.a), f.n) > kMargin &&
         glm::dot(glm::cross(f.c - f.b, p - f.b), f.n) > kMargin &&
         glm::dot(glm::cross(f.a - f.c, p - f.c), f.n) > kMargin;
}

// Two triangles in one plane, with one front, that overlap in the open would flicker. What is hidden inside a solid
// does no harm: a ray from there sees the back of something first.
TEST(SceneRooms, NoTwoTrianglesOverlapInOnePlaneInTheOpen) {
  for (const char* name : kRooms) {
    RayTracer rays(make_scene(name));
    Tracer tracer(rays);
    std::map<std::array<long, 4>, std::vector<Facet>> planes;
    for (const Mesh& m : rays.scene().meshes) {
      if (m.moves()) continue;
      for (const glm::uvec3& t : m.triangles) {
        Facet f{dvec3(m.positions[t.x]), dvec3(m.positions[t.y]), dvec3(m.positions[t.z]), {}, 0.0, 0.0};
        f.n = glm::normalize(glm::cross(f.b - f.a, f.c - f.a));
        const auto along = [](const dvec3& p) { return p.x + p.y + p.z; };
        f.low = std::min({along(f.a), along(f.b), along(f.c)});
        f.high = std::max({along(f.a), along(f.b), along(f.c)});
        planes[{std::lround(f.n.x * 1e3), std::lround(f.n.y * 1e3), std::lround(f.n.z * 1e3),
                std::lround(glm::dot(f.n, f.a) * 1e4)}]
            .push_back(f);
      }
    }
    Pcg32 random(13);
    std::size_t overlaps = 0;
    std::string where;
    for (auto& [key, facets] : planes) {
      std::sort(facets.begin(), facets.end(), [](const Facet& f, const Facet& g) { return f.low < g.low; });
      for (std::size_t i = 0; i < facets.size(); ++i)
        for (std::size_t j = i + 1; j < facets.size() && facets[j].low < facets[i].high; ++j)
          for (int turn = 0; turn < 8; ++turn) {
            const Facet &f = facets[turn % 2 ? j : i], &g = facets[turn % 2 ? i : j];
            const double u = std::sqrt(random.uniform()), v = random.uniform();
            const dvec3 p = (1.0 - u) * f.a + u * (1.0 - v) * f.b + u * v * f.c;
            if (!inside(g, p)) continue;
            const float x = random.uniform(), y = random.uniform();
            const vec3 n(f.n);
            const Hit seen =
                tracer.intersect({rays.leave(vec3(p), n), 1e9f, cosine_direction(Basis(n), x, y)});
            if (seen.missed() || !seen.front) continue;
            ++overlaps;
            where = std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z);
          }
    }
    EXPECT_EQ(overlaps, 0u) << name << ": the last at " << where;
  }
}

// Nor do two surfaces lie so close, one under the other, that rays leave one beyond the other.
TEST(SceneRooms, NoSurfaceLiesJustUnderAnother) {
  for (const char* name : kRooms) {
    Scene scene = make_scene(name);
    prepare(scene);
    const float nearest = 0.8f * kGap;
    RayTracer rays(std::move(scene));
    Tracer tracer(rays);
    Pcg32 random(12);
    std::size_t doubled = 0, looked = 0;
    std::string where;
    for (int path = 0; path < 20'000; ++path) {
      const Basis any(glm::normalize(rays.scene().camera.target - rays.scene().camera.eye));
      Ray ray{rays.scene().camera.eye, 1e9f, cosine_direction(any, random.uniform(), random.uniform())};
      for (int bounce = 0; bounce < 4; ++bounce) {
        const Hit hit = tracer.intersect(ray);
        if (hit.missed() || !hit.front) break;
        // From just below the surface, inwards: what comes next?
        const Hit next = tracer.intersect({rays.leave(hit.p, -hit.ng), nearest, -hit.ng});
        ++looked;
        if (!next.missed() && next.front && glm::dot(next.ng, hit.ng) > 0.999f) {
          ++doubled;
          where = std::to_string(hit.p.x) + " " + std::to_string(hit.p.y) + " " + std::to_string(hit.p.z);
        }
        const float u = random.uniform(), v = random.uniform();
        ray = {rays.leave(hit.p, hit.ng), 1e9f, cosine_direction(Basis(hit.ng), u, v)};
      }
    }
    EXPECT_EQ(doubled, 0u) << name << ": " << doubled << " of " << looked << ", the last at " << where;
  }
}

}  // namespace
}  // namespace icbench
