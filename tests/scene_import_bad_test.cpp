// Scene files that are corrupt, truncated or absurd: one line with the place, no crash, no large allocation.
#include <assimp/scene.h>
#include <gtest/gtest.h>

#include <assimp/Exporter.hpp>
#include <assimp/Importer.hpp>
#include <functional>
#include <random>

#include "files/input_file.h"
#include "largest_request.h"
#include "scene/import_scene.h"
#include "scene_files.h"
#include "temporary_folder.h"

namespace icbench {
namespace {

using nlohmann::json;

// No file below has more than some kilobytes, and none may make one request for more memory than this.
constexpr std::size_t kMostAtOnce = std::size_t{64} << 20;

// The line that a file gives, empty if it makes a scene after all, which then is used in every way.
std::string complaint(const std::filesystem::path& file, std::string_view bytes) {
  std::filesystem::remove(file);  // rewriting one makes some file systems wait for the disk
  write(file, bytes);
  largest_request = 0;
  const std::string said = error_of([&] {
    ImportedScene imported = import_scene(file);
    Scene& scene = imported.scene;
    prepare(scene);
    for (const float frame : {0.0f, 0.5f, static_cast<float>(scene.frames)}) {
      for (const Mesh& mesh : scene.meshes)
        if (mesh.pose) mesh.pose(frame);
      if (scene.camera_path) scene.camera_path(frame);
      if (scene.change_light) scene.change_light(frame, scene.materials, scene.point_lights);
    }
    for (const std::string& note : imported.notes)
      if (note.find('\n') != note.npos) throw std::runtime_error("a note of several\nlines");
  });
  EXPECT_LE(largest_request.load(), kMostAtOnce) << said;
  return said;
}

// Whether there is no error, or it is one line that names the file.
::testing::AssertionResult is_clean(const std::string& said, const std::string& name) {
  return said.empty() ? ::testing::AssertionSuccess() : is_one_line_with(said, name);
}

TEST(ImportBadGltf, TheElementIsNamed) {
  const TemporaryFolder folder;
  const std::pair<std::function<void(json&)>, const char*> cases[] = {
      {[](json& d) { d.erase("asset"); }, "has no 'asset'"},
      {[](json& d) { d["asset"]["version"] = "3.0"; }, "asset.version is '3.0'; 1.0 and 2.0 are read"},
      {[](json& d) { d["asset"]["version"] = 2; }, "asset.version must be a string"},
      {[](json& d) { d["accessors"][0]["count"] = 4000000000u; }, "accessors[0] claims 4000000000 elements"},
      {[](json& d) { d["accessors"][0]["count"] = -1; }, "accessors[0].count is -1"},
      {[](json& d) { d["accessors"][0]["count"] = 1e300; }, "accessors[0].count is 1e+300"},
      {[](json& d) {
         d["accessors"][0].erase("bufferView");
         d["accessors"][0]["count"] = 1000000000;
       },
       "accessors[0] claims 1000000000 elements of nothing"},
      {[](json& d) { d["accessors"][0]["componentType"] = 5130; },
       "accessors[0].componentType is no component type"},
      {[](json& d) { d["accessors"][0]["type"] = "SCALAR"; }, "accessors[0] has 1 components"},
      {[](json& d) { d["accessors"][0]["byteOffset"] = 9007199254740992u; }, "accessors[0] claims"},
      {[](json& d) { d["accessors"][1]["bufferView"] = 99; }, "bufferViews has"},
      {[](json& d) { d["bufferViews"][1]["byteOffset"] = 9007199254740992u; }, "bufferViews[1] reaches"},
      {[](json& d) { d["bufferViews"][1]["byteStride"] = 1; }, "bufferViews[1].byteStride is 1"},
      {[](json& d) { d["buffers"][0]["byteLength"] = 1u << 30; }, "buffers[0] has"},
      {[](json& d) { d["buffers"][0]["uri"] = "absent.bin"; }, "buffers[0].uri: cannot read"},
      {[](json& d) { d["buffers"][0]["uri"] = "https://example.org/a.bin"; }, "is not a local file"},
      {[](json& d) { d["buffers"][0]["uri"] = "data:application/octet-stream;base64,%%%"; }, "is not base64"},
      {[](json& d) {
         d["images"][0] = {{"uri", "absent.png"}};
       },
       "images[0].uri"},
      {[](json& d) { d["images"][0]["bufferView"] = 2; }, "images[0] is neither a PNG nor a JPEG"},
      {[](json& d) { d["textures"][0]["source"] = 5; }, "textures[0].source is 5, but there are 1"},
      {[](json& d) { d["nodes"][4]["mesh"] = 7; }, "nodes[4].mesh is 7"},
      {[](json& d) {
         d["nodes"][4]["translation"] = {0, 0};
       },
       "nodes[4].translation must hold 3"},
      {[](json& d) {
         d["nodes"][4]["translation"] = {1e300, 0, 0};
       },
       "large; scale it"},
      {[](json& d) {
         d["nodes"][4]["rotation"] = {0, 0, 0, 0};
       },
       "nodes[4].rotation is no quaternion"},
      {[](json& d) { d["nodes"][4]["children"] = {4}; }, "nodes[4] is reached twice"},
      {[](json& d) { d["nodes"][3]["children"] = {4}; }, "nodes[4] is reached twice"},
      {[](json& d) { d["scenes"][0]["nodes"].push_back(1000); }, "scenes[0].nodes"},
      {[](json& d) { d["meshes"][0]["primitives"][0]["indices"] = 0; }, "accessors[0] holds indices"},
      {[](json& d) { d["meshes"][0]["primitives"][0]["mode"] = 9; }, "meshes[0].primitives[0].mode is 9"},
      {[](json& d) { d["meshes"][0]["primitives"][0]["material"] = 12; },
       "meshes[0].primitives[0].material is 12"},
      {[](json& d) { d["animations"][0]["channels"][0]["sampler"] = 12; },
       "animations[0].channels[0].sampler is 12"},
      {[](json& d) { d["animations"][0]["channels"][0]["target"]["node"] = 77; }, "target.node is 77"},
      {[](json& d) { d["animations"][0]["samplers"][0]["interpolation"] = "CUBICSPLINE"; },
       "animations[0].samplers[0] has 3 values for 3 times"},
      {[](json& d) { d["animations"][0]["samplers"][0]["interpolation"] = "CATMULLROM"; },
       "animations[0].samplers[0].interpolation is 'CATMULLROM'"},
      {[](json& d) { d["materials"][0]["alphaMode"] = "GREY"; }, "materials[0].alphaMode is 'GREY'"},
      {[](json& d) { d["cameras"][0]["perspective"]["yfov"] = 4; }, "cameras[0].perspective.yfov"},
      {[](json& d) { d["extensions"]["KHR_lights_punctual"]["lights"][0]["type"] = "disco"; }, "is 'disco'"},
      {[](json& d) { d["extensionsRequired"] = {"EXT_meshopt_compression"}; }, "EXT_meshopt_compression"},
      {[](json& d) { d["meshes"] = json::array(); }, "nodes[0].mesh is 0, but there are 0"},
      {[](json& d) { d["scenes"][0]["nodes"] = json::array(); }, "no triangle"},
  };
  for (const auto& [spoil, expected] : cases) {
    json doc = json::parse(spinning_cube().text());
    spoil(doc);
    const std::string said = complaint(folder / "bad.gltf", doc.dump());
    EXPECT_TRUE(is_one_line_with(said, "bad.gltf")) << expected;
    EXPECT_TRUE(is_one_line_with(said, expected));
  }
}

TEST(ImportBadGltf, BytesThatAreNoNumbersOrIndicesAreNamed) {
  const TemporaryFolder folder;
  GltfFile nan = spinning_cube();
  const std::vector<float> bad(24, NAN);
  nan.doc["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = nan.vec3s(bad);
  EXPECT_TRUE(is_one_line_with(complaint(folder / "bad.gltf", nan.text()), "is not finite"));
  GltfFile index = spinning_cube();
  index.doc["meshes"][0]["primitives"][0]["indices"] = index.indices({0, 1, 65535});
  EXPECT_TRUE(is_one_line_with(complaint(folder / "bad.gltf", index.text()), "names vertex 65535 of 8"));
  GltfFile back = spinning_cube();
  back.doc["animations"][0]["samplers"][0]["input"] = back.scalars({0, 2, 1});
  EXPECT_TRUE(is_one_line_with(complaint(folder / "bad.gltf", back.text()), "does not increase at key 2"));
  back.doc["animations"][0]["samplers"][0]["input"] = back.scalars({0, 1, 1});
  EXPECT_TRUE(is_one_line_with(complaint(folder / "bad.gltf", back.text()), "does not increase at key 2"));
  back.doc["animations"][0]["samplers"][0]["input"] = back.scalars({-1, 0, 1});
  EXPECT_TRUE(is_one_line_with(complaint(folder / "bad.gltf", back.text()), "is negative at key 0"));
  back.doc["animations"][0]["samplers"][0]["input"] = back.scalars({0, 1});
  EXPECT_TRUE(is_one_line_with(complaint(folder / "bad.gltf", back.text()), "has 3 values for 2 times"));
}

TEST(ImportBadGltf, DepthIsLimitedInTextAndInTheHierarchy) {
  const TemporaryFolder folder;
  const std::string deep = R"({"asset":)" + std::string(1'000'000, '[');
  EXPECT_TRUE(is_one_line_with(complaint(folder / "deep.gltf", deep), "nests deeper"));
  GltfFile chain = spinning_cube();
  for (int i = 0; i < 5000; ++i) {
    const std::size_t next = chain.doc["nodes"].size();
    chain.doc["nodes"][next == 0 ? 0 : next - 1]["children"] = {next};
    chain.doc["nodes"].push_back({{"name", "a\nlink"}});
  }
  EXPECT_TRUE(is_one_line_with(complaint(folder / "deep.gltf", chain.text()), "levels deep"));
}

TEST(ImportBadGltf, InstancesBeyondAllMeasureAreRefusedBeforeTheyAreMade) {
  const TemporaryFolder folder;
  GltfFile f;
  const auto grid =
      f.mesh(f.vec3s(std::vector<float>(3 * 30'000, 0.5f)), f.indices({0, 1, 2}), f.material(json::object()));
  for (int i = 0; i < 3000; ++i) f.node({{"mesh", grid}});
  EXPECT_TRUE(is_one_line_with(complaint(folder / "many.glb", f.glb()), "instances counted"));
}

TEST(ImportBadGltf, ZerosAreCountedOverAllAccessors) {
  const TemporaryFolder folder;
  GltfFile f = spinning_cube();
  const auto zeros =
      GltfFile::append(f.doc["accessors"], {{"componentType", 5126}, {"count", 40'000}, {"type", "VEC3"}});
  json& primitives = f.doc["meshes"][0]["primitives"];
  const json nothing = {{"attributes", {{"POSITION", zeros}}}};
  primitives.push_back(nothing);
  EXPECT_EQ(complaint(folder / "zeros.gltf", f.text()), "");
  primitives.push_back(nothing);
  EXPECT_TRUE(is_one_line_with(complaint(folder / "zeros.gltf", f.text()), "of nothing"));
}

// A message's text ends at the first NUL.
TEST(ImportBadNames, ANulDoesNotCutTheMessageOff) {
  const TemporaryFolder folder;
  const std::string name("a\0z", 3);
  const auto gltf = [&](const std::function<void(json&)>& spoil) {
    json doc = json::parse(spinning_cube().text());
    spoil(doc);
    return complaint(folder / "nul.gltf", doc.dump());
  };
  EXPECT_TRUE(is_one_line_with(gltf([&](json& d) { d["extensionsRequired"] = {name}; }),
                               "is a?z, which is not read; export the scene without it"));
  EXPECT_TRUE(is_one_line_with(gltf([&](json& d) {
                                 d["nodes"][0]["name"] = name;
                                 d["nodes"][0]["matrix"] = {1e308, 0, 0, 0, 1e308, 1, 0, 0,
                                                            0,     0, 1, 0, 0,     0, 0, 1};
                                 d["nodes"][0]["children"] = {d["nodes"].size()};
                                 json child = d["nodes"][0];
                                 child.erase("children");
                                 d["nodes"].push_back(child);
                               }),
                               "node 'a?z' stands nowhere finite; mend"));
  for (const std::string& uri : {name, std::string("a%00z")})
    EXPECT_TRUE(is_one_line_with(gltf([&](json& d) { d["buffers"][0]["uri"] = uri; }), "a NUL"));
  EXPECT_TRUE(is_one_line_with(complaint(folder / "nul.rad", "red polygon p 0 0 9 0 0 " + name),
                               "line 1: 'a?z' is not a real argument of at most"));
  EXPECT_TRUE(is_one_line_with(complaint(folder / "nul.rad", "red sphere " + name + " 0 0 4 0 0 0 0"),
                               "sphere 'a?z' has no radius"));
}

TEST(ImportBadRadiance, SpheresBeyondAllMeasureAreRefusedBeforeTheyAreMade) {
  const TemporaryFolder folder;
  std::string text;
  for (std::size_t triangles = 0; triangles <= kMaxVertices; triangles += 2600)
    text += "red sphere s 0 0 4 0 0 0 1\n";
  EXPECT_TRUE(is_one_line_with(complaint(folder / "many.rad", text),
                               "sphere 's' is one too many: more than " + std::to_string(kMaxVertices)));
}

TEST(ImportBadRadiance, TheLineIsNamed) {
  const TemporaryFolder folder;
  const std::string good =
      "# comment\nvoid plastic red\n0\n0\n5 .5 0 0 0 0\n\nred polygon p\n0\n0\n9 0 0 0 1 0 0 0 1 0\n";
  const std::pair<std::string, const char*> cases[] = {
      {"!genbox red b 1 1 1\n", "line 11: commands are not carried out"},
      {"red polygon q\n0\n0\n9 0 0 0 1 0 0 0 1\n", "line 15: the file ends where a real argument"},
      {"red polygon q\n0\n0\n8 0 0 0 1 0 0 0 1\n", "line 11: polygon 'q' has 8 real arguments"},
      {"red polygon q\n0\n0\n10 0 0 0 1 0 0 0 1 0 0\n",
       "line 11: polygon 'q' has 10 real arguments, not three"},
      {"red polygon q\n0\n0\n4000000000 0 0 0\n", "line 15: the file ends"},
      {"red polygon q\n0\n0\nnine 0 0 0\n", "line 14: 'nine' is not the number of real arguments"},
      {"red polygon q\n0\n0\n9 0 0 nan 1 0 0 0 1 0\n", "line 14: 'nan' is not a real argument"},
      {"red polygon q\n0\n0\n9 0 0 1e999 1 0 0 0 1 0\n", "line 14: '1e999' is not a real argument"},
      {"red polygon q\n0\n0\n-9 0 0 0\n", "line 14: the number of real arguments is -9"},
      {"red sphere s\n0\n0\n4 0 0 0 0\n", "line 11: sphere 's' has no radius"},
      {"red cylinder c\n0\n0\n7 0 0 0 0 0 0 1\n", "line 11: cylinder 'c' has no length"},
      {"red cone c\n0\n0\n8 0 0 0 0 0 1 0 0\n", "line 11: cone 'c' has no positive radius"},
      {"red ring r\n0\n0\n8 0 0 0 0 0 0 1 0\n", "line 11: ring 'r' has no direction"},
      {"void plastic blue\n0\n0\n4 0 0 0 0\n", "line 11: plastic 'blue' has 4 real arguments"},
      {"void glass g\n0\n0\n4 1 1 1 -3\n", "line 11: glass 'g' has an index of refraction"},
      {"red", "line 11: the file ends where a type should be"},
      {"# view -vp 0 0\n", "line 11: the file ends where a number"},
  };
  for (const auto& [added, expected] : cases) {
    const std::string said = complaint(folder / "bad.rad", good + added);
    EXPECT_TRUE(is_one_line_with(said, "bad.rad")) << added;
    EXPECT_TRUE(is_one_line_with(said, expected)) << added;
  }
  EXPECT_EQ(complaint(folder / "good.rad", good), "");
  EXPECT_TRUE(is_one_line_with(complaint(folder / "empty.rad", ""), "no triangle"));
  write(folder / "good.vf", "rvu -vp 0 0 1\n-vd 0 0 1 -vu 0 0 2\n");
  EXPECT_TRUE(is_one_line_with(complaint(folder / "good.rad", good), "good.vf: line"));
}

TEST(ImportBadImages, SizesThatTheBytesCannotHoldAreRefused) {
  const TemporaryFolder folder;
  const auto with_image = [&](std::string image) {
    GltfFile f = spinning_cube();
    f.doc["images"][0]["bufferView"] = f.view(image);
    return complaint(folder / "bad.glb", f.glb());
  };
  std::string jpeg = quarters_jpeg();
  const std::size_t frame = jpeg.find("\xff\xc0");
  ASSERT_NE(frame, jpeg.npos);
  jpeg.replace(frame + 5, 4, "\xff\xff\xff\xff");
  EXPECT_TRUE(is_one_line_with(with_image(jpeg), "images[0] "));
  std::string png = quarters_png();
  png.replace(16, 8, std::string("\0\0\x40\0\0\0\x40\0", 8));
  EXPECT_TRUE(is_one_line_with(with_image(png), "images[0] "));
  for (std::size_t cut = 3; cut < quarters_jpeg().size(); cut += 5)
    EXPECT_TRUE(is_clean(with_image(quarters_jpeg().substr(0, cut)), "bad.glb"));
}

// Calls f with a good file cut off at about `count` places.
void for_cuts(const std::string& good, std::size_t count, const std::function<void(const std::string&)>& f) {
  for (std::size_t i = 0; i < count; ++i) f(good.substr(0, i * good.size() / count));
}

TEST(ImportFuzz, TruncatedFiles) {
  const TemporaryFolder folder;
  const std::string text = spinning_cube().text(), binary = spinning_cube().glb();
  std::string old = binary;
  old[4] = 1;
  EXPECT_TRUE(is_one_line_with(complaint(folder / "old.glb", old), "is binary glTF 1"));
  for_cuts(text, 400, [&](const std::string& s) {
    EXPECT_TRUE(is_one_line_with(complaint(folder / "cut.gltf", s), "cut.gltf"));
  });
  for_cuts(binary, 400, [&](const std::string& s) {
    EXPECT_TRUE(is_one_line_with(complaint(folder / "cut.glb", s), "cut.glb"));
  });
  for_cuts(kRadianceRoom, 400,
           [&](const std::string& s) { EXPECT_TRUE(is_clean(complaint(folder / "cut.rad", s), "cut.rad")); });
}

TEST(ImportFuzz, BytesChangedAtRandom) {
  const TemporaryFolder folder;
  std::mt19937 random(1);
  const std::pair<std::string, const char*> files[] = {
      {spinning_cube().text(), "a.gltf"}, {spinning_cube().glb(), "a.glb"}, {kRadianceRoom, "a.rad"}};
  for (const auto& [good, name] : files)
    for (int i = 0; i < 600; ++i) {
      std::string bad = good;
      for (unsigned n = 1 + random() % 4; n > 0; --n)
        bad[random() % bad.size()] = static_cast<char>(random());
      EXPECT_TRUE(is_clean(complaint(folder / name, bad), name)) << "trial " << i;
    }
}

// All values of a document that are not its buffers' bytes.
void collect(json& value, std::vector<json*>& all) {
  if (value.is_string() && value.get_ref<const std::string&>().size() > 1000) return;
  all.push_back(&value);
  if (value.is_structured())
    for (json& element : value) collect(element, all);
}

TEST(ImportFuzz, ValuesOfADocumentReplaced) {
  const TemporaryFolder folder;
  std::mt19937 random(2);
  const json good = json::parse(spinning_cube().text());
  const json values[] = {-1,
                         0,
                         1,
                         2,
                         3,
                         7,
                         255,
                         65536,
                         4294967295u,
                         9007199254740992u,
                         0.5,
                         -1e-300,
                         1e30,
                         1e308,
                         nullptr,
                         true,
                         "",
                         "x\ny",
                         "VEC4",
                         "MAT4",
                         "SCALAR",
                         "STEP",
                         "CUBICSPLINE",
                         "scale",
                         "data:;base64,AAAA",
                         json::array(),
                         json::object(),
                         {0, 0, 0},
                         {1e38, -1e38, 0},
                         {0, 0, 0, 1},
                         {{{"index", 0}}},
                         5121,
                         5125,
                         5126};
  for (int i = 0; i < 3000; ++i) {
    json bad = good;
    for (unsigned n = 1 + random() % 3; n > 0; --n) {
      std::vector<json*> all;
      collect(bad, all);
      *all[random() % all.size()] = values[random() % std::size(values)];
    }
    EXPECT_TRUE(is_clean(complaint(folder / "a.gltf", bad.dump()), "a.gltf")) << "trial " << i;
  }
}

TEST(ImportFuzz, WordsOfARadianceFileReplaced) {
  const TemporaryFolder folder;
  std::mt19937 random(3);
  std::vector<std::string> good(1);
  for (const char* c = kRadianceRoom; *c; ++c) {
    if (*c == ' ' || *c == '\n') good.emplace_back();
    good.back() += *c;
  }
  const char* const words[] = {" -1",   " 0",      " 1e308", " 1e-308", " nan", " 4294967296",
                               " void", " #",      " !",     "\n",      " \"",  " alias",
                               " cup",  " bubble", " 1e15",  " 3",      " 12"};
  for (int i = 0; i < 2000; ++i) {
    std::vector<std::string> bad = good;
    for (unsigned n = 1 + random() % 3; n > 0; --n)
      bad[random() % bad.size()] = words[random() % std::size(words)];
    std::string text;
    for (const std::string& word : bad) text += word;
    EXPECT_TRUE(is_clean(complaint(folder / "a.rad", text), "a.rad")) << "trial " << i;
  }
}

// A header that breaks off, on which assimp 5.2 does not come to an end.
TEST(ImportBadAssimp, AReaderThatDoesNotEndIsEnded) {
  const TemporaryFolder folder;
  const std::string header =
      "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nelement face 1\nproperty l";
  EXPECT_TRUE(is_clean(complaint(folder / "endless.ply", header), "endless.ply"));
}

// assimp reads in a process of its own, which takes its time: fewer trials.
TEST(ImportFuzz, FilesForAssimp) {
  const TemporaryFolder folder;
  std::mt19937 random(4);
  write(folder / "good.obj",
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nf 1/1/1 2/1/1 3/1/1 4/1/1\n");
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile((folder / "good.obj").string(), 0);
  ASSERT_TRUE(scene);
  const std::pair<const char*, const char*> formats[] = {{"objnomtl", "a.obj"}, {"stlb", "a.stl"},
                                                         {"3ds", "a.3ds"},      {"fbxa", "a.fbx"},
                                                         {"collada", "a.dae"},  {"x3d", "a.x3d"}};
  for (const auto& [format, name] : formats) {
    Assimp::Exporter exporter;
    ASSERT_EQ(exporter.Export(scene, format, (folder / name).string()), AI_SUCCESS) << format;
    const std::string good = load_file(folder / name);
    EXPECT_EQ(complaint(folder / name, good), "") << format;
    for (int i = 0; i < 25; ++i) {
      std::string bad = good.substr(0, i % 5 == 0 ? random() % good.size() : good.size());
      for (unsigned n = random() % 4; n > 0 && !bad.empty(); --n)
        bad[random() % bad.size()] = static_cast<char>(random());
      EXPECT_TRUE(is_clean(complaint(folder / name, bad), name)) << "trial " << i;
    }
  }
}

}  // namespace
}  // namespace icbench
