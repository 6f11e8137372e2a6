// Small scene files that would make much of little: what they may take in memory and time has a bound.
#include <gtest/gtest.h>
#include <unistd.h>

#include <string>

#include "import_support.h"
#include "scene/import_gltf_data.h"
#include "scene/import_trial.h"
#include "scene_files.h"
#include "temporary_folder.h"

namespace icbench {
namespace {

using nlohmann::json;

TEST(ImportMuch, BuffersOfOneFileAreHeldOnceHoweverItIsSpelt) {
  const TemporaryFolder folder;
  write(folder / "a.bin", std::string(1000, 'x'));
  json doc = {{"buffers", json::array()}};
  for (const char* uri : {"a.bin", "./a.bin", "%61.bin", ".//x/../a.bin", "a.bin"})
    doc["buffers"].push_back({{"uri", uri}, {"byteLength", 10}});
  const importing::Element document(doc, "");
  const importing::GltfData data(document, std::string_view("0123456789"), folder / "scene.gltf");
  EXPECT_EQ(data.bytes(), 1010u);
}

TEST(ImportMuch, ChannelsThatShareASamplerCannotHoldMoreKeysThanFilesDo) {
  GltfFile f = grey_cube();
  std::vector<float> times(30'000);
  for (std::size_t k = 0; k < times.size(); ++k) times[k] = static_cast<float>(k);
  const auto input = f.scalars(times), output = f.vec3s(std::vector<float>(3 * times.size()));
  f.animate(0, "translation", input, output);
  for (int i = 0; i < 40; ++i) {
    const auto node = f.node({{"name", "nothing"}});
    f.doc["animations"][0]["channels"].push_back(
        {{"sampler", 0}, {"target", {{"node", node}, {"path", "translation"}}}});
  }
  EXPECT_TRUE(is_one_line_with(error_of([&] { import_gltf(f); }), "channels share more keys"));
}

TEST(ImportMuch, NamesAreCutBetweenLetters) {
  GltfFile f = grey_cube();
  std::string name = "a";  // letters of two bytes then begin at odd places
  for (int i = 0; i < 1000; ++i) name += "\xc3\xa4";
  f.doc["meshes"][0]["name"] = name;
  f.doc["nodes"][0]["name"] = name;
  f.animate(0, "translation", f.scalars({0, 1}), f.vec3s({0, 0, 0, 1, 0, 0}));
  const std::string cut = name.substr(0, 99) + "...";
  EXPECT_EQ(import_gltf(f).scene.meshes.at(0).name, cut + " at " + cut);
}

// Twenty cubes below a chain of nodes, each of which a pose has to go through; or as many lamps.
TEST(ImportMuch, FramesAreFewerWhereTheHierarchyIsDeepOrLampsAreMany) {
  const auto frames = [](int depth, int cubes, int lamps) {
    GltfFile f;
    const auto mesh = f.cube(f.material(json::object()));
    const auto root = f.node({{"name", "root"}});
    f.animate(root, "translation", f.scalars({0, 1000}), f.vec3s({0, 0, 0, 1, 0, 0}));
    std::size_t last = root;
    const auto child = [&](json node) {
      const auto index = GltfFile::append(f.doc["nodes"], std::move(node));
      f.doc["nodes"][last]["children"].push_back(index);
      return index;
    };
    for (int i = 0; i < depth; ++i) last = child({{"name", "link"}});
    for (int i = 0; i < cubes; ++i) child({{"mesh", mesh}});
    if (lamps > 0) f.doc["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", "point"}}};
    for (int i = 0; i < lamps; ++i) child({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
    return import_gltf(f).scene.frames;
  };
  EXPECT_EQ(frames(1, 20, 0), kMaxFrames);
  EXPECT_LT(frames(240, 20, 0), 2'000u);
  EXPECT_LT(frames(0, 1, 4000), 1'000u);
}

TEST(ImportMuch, AJpegImageOfManyScansIsRefused) {
  std::string jpeg = quarters_jpeg();
  for (int i = 0; i < 101; ++i) jpeg.insert(jpeg.size() - 2, "\xff\xda");
  GltfFile f = grey_cube();
  f.doc["images"] = {{{"bufferView", f.view(jpeg)}, {"mimeType", "image/jpeg"}}};
  f.doc["textures"] = {{{"source", 0}}};
  f.doc["materials"][0]["pbrMetallicRoughness"] = {{"baseColorTexture", {{"index", 0}}},
                                                   {"metallicFactor", 0}};
  EXPECT_TRUE(is_one_line_with(error_of([&] { import_gltf(f); }), "102 scans"));
}

// As who reads from a pipe that nobody writes to, which takes no processor time.
TEST(ImportMuch, AReaderThatWaitsForEverIsEnded) {
  const auto wait = []() -> std::string {
    for (;;) ::pause();
  };
  EXPECT_EQ(importing::try_apart(wait, std::size_t{1} << 28, 1), "takes longer than 1 s to read");
  EXPECT_EQ(importing::try_apart([] { return std::string("said"); }, std::size_t{1} << 28, 1), "said");
}

TEST(ImportMuch, LampsWhoseLightWouldOverflowAreNamed) {
  const auto lit = [](const json& light) {
    GltfFile f = grey_cube();
    f.doc["extensions"]["KHR_lights_punctual"]["lights"] = json::array({light});
    f.node({{"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}}});
    return error_of([&] {
      ImportedScene imported = import_gltf(f);
      prepare(imported.scene);
    });
  };
  EXPECT_TRUE(is_one_line_with(lit({{"type", "point"}, {"intensity", 1e20}, {"color", {1, 1, 1e6}}}),
                               "lights[0] has an intensity of 1e+26"));
  EXPECT_TRUE(
      is_one_line_with(lit({{"type", "point"}, {"intensity", 1e19}}), "too bright so close to the scene"));
  EXPECT_EQ(lit({{"type", "point"}, {"intensity", 1e15}}), "");
}

}  // namespace
}  // namespace icbench
