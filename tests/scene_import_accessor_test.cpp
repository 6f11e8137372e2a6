// glTF files: the ways in which vertices, indices and chunks may be stored.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "import_support.h"
#include "scene_files.h"

namespace icbench {
namespace {

using nlohmann::json;

template <class T>
std::string bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

// A square whose attributes a test replaces.
struct Square {
  GltfFile f;
  Square() { f.node({{"mesh", f.square(f.material(json::object()))}}); }
  json& primitive() { return f.doc["meshes"][0]["primitives"][0]; }
  json& attributes() { return primitive()["attributes"]; }
  Mesh mesh() const { return import_gltf(f).scene.meshes.at(0); }
};

template <class T>
double area_of(int component_type, bool is_normalised, T low, T high) {
  Square s;
  const std::vector<T> corners = {low, low, 0, high, low, 0, high, high, 0, low, high, 0};
  const auto positions = s.f.accessor(corners, "VEC3", 3, component_type);
  s.f.doc["accessors"][positions]["normalized"] = is_normalised;
  s.attributes()["POSITION"] = positions;
  return area(s.mesh()).z;
}

TEST(ImportAccessor, WholeNumbersAreTakenAsTheyAreOrAsSharesOfTheirLargest) {
  EXPECT_NEAR(area_of<std::int8_t>(5120, true, -127, 127), 4.0, 1e-6);
  EXPECT_NEAR(area_of<std::int8_t>(5120, true, -128, 127), 4.0, 1e-6) << "there is nothing below -1";
  EXPECT_NEAR(area_of<std::int8_t>(5120, false, -3, 2), 25.0, 1e-6);
  EXPECT_NEAR(area_of<std::uint8_t>(5121, true, 0, 255), 1.0, 1e-6);
  EXPECT_NEAR(area_of<std::uint8_t>(5121, false, 0, 200), 4e4, 1e-6);
  EXPECT_NEAR(area_of<std::int16_t>(5122, true, -32768, 32767), 4.0, 1e-6);
  EXPECT_NEAR(area_of<std::int16_t>(5122, false, -300, 200), 2.5e5, 1e-6);
  EXPECT_NEAR(area_of<std::uint16_t>(5123, true, 0, 65535), 1.0, 1e-6);
  EXPECT_NEAR(area_of<std::uint16_t>(5123, false, 0, 60'000), 3.6e9, 1e-3);
}

TEST(ImportAccessor, IndicesMayHaveAnyNumberOfBytes) {
  Square bytes;
  bytes.primitive()["indices"] =
      bytes.f.accessor(std::vector<std::uint8_t>{0, 1, 2, 0, 2, 3}, "SCALAR", 1, 5121);
  EXPECT_NEAR(area(bytes.mesh()).z, 1.0, 1e-6);
  Square words;  // whose low halves name vertices as well
  constexpr std::uint32_t kFirst = 1 << 16;
  std::vector<float> corners(3 * kFirst, 0.0f);
  corners.insert(corners.end(), {0, 0, 0, 2, 0, 0, 2, 2, 0});
  words.attributes()["POSITION"] = words.f.vec3s(corners);
  words.primitive()["indices"] =
      words.f.accessor(std::vector<std::uint32_t>{kFirst, kFirst + 1, kFirst + 2}, "SCALAR", 1, 5125);
  EXPECT_NEAR(area(import_text("scene.glb", words.f.glb()).scene.meshes.at(0)).z, 2.0, 1e-6);
}

// Positions and normals by turns, behind some bytes that are neither.
std::size_t interleaved(GltfFile& f, json& attributes) {
  std::vector<float> numbers = {99, 99};
  for (const auto& [x, y] : {std::pair{0.0f, 0.0f}, {3.0f, 0.0f}, {3.0f, 2.0f}, {0.0f, 2.0f}})
    numbers.insert(numbers.end(), {x, y, 0, 0.6f, 0, 0.8f});
  const auto view = f.view(bytes_of(numbers));
  f.doc["bufferViews"][view]["byteStride"] = 24;
  for (const auto& [name, offset] : {std::pair{"POSITION", 8}, {"NORMAL", 20}}) {
    attributes[name] = GltfFile::append(f.doc["accessors"], {{"bufferView", view},
                                                             {"byteOffset", offset},
                                                             {"componentType", 5126},
                                                             {"count", 4},
                                                             {"type", "VEC3"}});
  }
  return view;
}

TEST(ImportAccessor, AttributesMayLieByTurnsInOneView) {
  Square s;
  interleaved(s.f, s.attributes());
  const Mesh mesh = s.mesh();
  EXPECT_NEAR(area(mesh).z, 6.0, 1e-6);
  ASSERT_EQ(mesh.normals.size(), 4u);
  for (const glm::vec3& n : mesh.normals) expect_near(n, {0.6f, 0, 0.8f}, 1e-6f);
}

TEST(ImportAccessor, SparseElementsReplaceThoseOfAView) {
  Square s;
  interleaved(s.f, s.attributes());
  const auto where = s.f.view(bytes_of(std::vector<std::uint16_t>{0, 0, 1, 2}));
  const auto what = s.f.view(bytes_of(std::vector<float>{9, 9, 9, 5, 0, 0, 5, 2, 0}));
  s.f.doc["accessors"][s.attributes()["POSITION"].get<std::size_t>()]["sparse"] = {
      {"count", 2},
      {"indices", {{"bufferView", where}, {"byteOffset", 4}, {"componentType", 5123}}},
      {"values", {{"bufferView", what}, {"byteOffset", 12}}}};
  EXPECT_NEAR(area(s.mesh()).z, 10.0, 1e-6);
}

TEST(ImportAccessor, NormalsTurnAsTheirSurfaceDoes) {
  const auto normal = [](const json& scale, const glm::vec3& n) {
    Square s;
    s.f.doc["nodes"][0]["scale"] = scale;
    std::vector<float> normals;
    for (int v = 0; v < 4; ++v) normals.insert(normals.end(), {n.x, n.y, n.z});
    s.attributes()["NORMAL"] = s.f.vec3s(normals);
    return s.mesh().normals.at(2);
  };
  const glm::vec3 slanting(0.6f, 0, 0.8f);
  expect_near(normal({1, 1, 1}, slanting), slanting, 1e-6f);
  expect_near(normal({2, 1, 1}, slanting), glm::normalize(glm::vec3(0.3f, 0, 0.8f)), 1e-6f);
  expect_near(normal({-2, 1, 1}, slanting), glm::normalize(glm::vec3(-0.3f, 0, 0.8f)), 1e-6f);
  expect_near(normal({1, 1, -1}, slanting), {0.6f, 0, -0.8f}, 1e-6f);
  expect_near(normal({1, 1, -1}, glm::vec3(0.0f)), {0, 0, -1}, 1e-6f);  // one without a direction
}

// In a strip every other triangle runs the other way round.
TEST(ImportAccessor, TheTrianglesOfStripsAndFansFaceTheSameWay) {
  for (const auto& [mode, order] :
       {std::pair{5, std::vector<std::uint16_t>{0, 1, 3, 2}}, {6, std::vector<std::uint16_t>{0, 1, 2, 3}}}) {
    Square s;
    s.primitive()["mode"] = mode;
    s.primitive()["indices"] = s.f.indices(order);
    const Mesh mesh = s.mesh();
    ASSERT_EQ(mesh.triangles.size(), 2u);
    for (const glm::uvec3& t : mesh.triangles) {
      const glm::vec3 &a = mesh.positions[t.x], &b = mesh.positions[t.y], &c = mesh.positions[t.z];
      EXPECT_NEAR(glm::cross(b - a, c - a).z, 1.0f, 1e-6f) << "mode " << mode;
    }
  }
}

TEST(ImportAccessor, ChunksBehindTheBinaryOneAreNotRead) {
  const std::string good = spinning_cube().glb();
  const auto chunk = [](const char* type, const std::string& body) {
    return std::string{static_cast<char>(body.size()), 0, 0, 0} + std::string(type, 4) + body;
  };
  std::string more = good + chunk("JUNK", "else") + chunk("BIN\0", "more");
  const auto length = static_cast<std::uint32_t>(more.size());
  std::memcpy(more.data() + 8, &length, sizeof length);
  const ImportedScene a = import_text("scene.glb", good), b = import_text("scene.glb", more);
  ASSERT_EQ(a.scene.meshes.size(), b.scene.meshes.size());
  for (std::size_t i = 0; i < a.scene.meshes.size(); ++i)
    EXPECT_EQ(a.scene.meshes[i].positions, b.scene.meshes[i].positions);
}

TEST(ImportAccessor, TheSceneThatTheFileNamesIsShownOrAllRoots) {
  GltfFile f;
  const auto cube = f.cube(f.material(json::object()));
  const auto child = GltfFile::append(f.doc["nodes"], {{"mesh", cube}, {"translation", {0, 2, 0}}});
  for (const int x : {0, 5, 10}) f.node({{"mesh", cube}, {"translation", {x, 0, 0}}});
  f.doc["nodes"][1]["children"] = {child};
  const auto volume_shown = [&] { return volume(import_gltf(f).scene.meshes.at(0)); };
  f.doc["scenes"] = {{{"nodes", {1}}}, {{"nodes", {2}}}, {{"nodes", {1, 2, 3}}}};
  f.doc["scene"] = 1;
  EXPECT_NEAR(volume_shown(), 1.0, 1e-5);
  f.doc["scene"] = 2;
  EXPECT_NEAR(volume_shown(), 4.0, 1e-5);
  f.doc.erase("scene");
  EXPECT_NEAR(volume_shown(), 2.0, 1e-5) << "the first";
  f.doc.erase("scenes");
  EXPECT_NEAR(volume_shown(), 4.0, 1e-5);
}

// Such are skipped (glTF 2.0, meshes).
TEST(ImportAccessor, PrimitivesWithoutPositionsAreLeftOut) {
  GltfFile f = spinning_cube();
  auto& primitives = f.doc["meshes"][0]["primitives"];
  json without = primitives[0];
  without["attributes"].erase("POSITION");
  primitives.push_back(without);
  const ImportedScene imported = import_gltf(f);
  EXPECT_EQ(imported.scene.meshes.size(), import_gltf(spinning_cube()).scene.meshes.size());
  EXPECT_TRUE(has_note(imported, "primitives without positions"));
}

}  // namespace
}  // namespace icbench
