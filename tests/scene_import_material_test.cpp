// glTF files: what becomes of materials, thin glass and textures.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "import_support.h"
#include "png_chunks.h"
#include "render/ray_tracer.h"
#include "scene_files.h"

namespace icbench {
namespace {

using nlohmann::json;

constexpr double kPi = std::numbers::pi;

TEST(ImportGltf, MaterialsAreMappedAsDocumented) {
  const auto read = [](const json& material) {
    GltfFile f;
    f.node({{"mesh", f.square(f.material(material))}});
    return import_gltf(f).scene.materials[0];
  };
  const auto pbr = [](double metallic, double roughness) {
    return json{{"pbrMetallicRoughness",
                 {{"baseColorFactor", {0.2, 0.4, 0.6, 1.0}},
                  {"metallicFactor", metallic},
                  {"roughnessFactor", roughness}}}};
  };
  const auto transmitting = [&](double share, double metallic) {
    json material = pbr(metallic, 0.0);
    material["extensions"] = {{"KHR_materials_transmission", {{"transmissionFactor", share}}}};
    return material;
  };
  EXPECT_EQ(read(transmitting(0.5, 0.0)).surface, Surface::dielectric);
  EXPECT_EQ(read(transmitting(1.0, 0.45)).surface, Surface::dielectric);
  EXPECT_EQ(read(transmitting(0.8, 0.45)).surface, Surface::diffuse);
  EXPECT_EQ(read(transmitting(1.0, 1.0)).surface, Surface::mirror) << "metal lets nothing through";
  EXPECT_EQ(read(json::object()), Material{.albedo = glm::vec3(1.0f)});
  EXPECT_EQ(read(pbr(0.0, 0.05)), (Material{.albedo = {0.2f, 0.4f, 0.6f}}));
  EXPECT_EQ(read(pbr(1.0, 0.2)), (Material{.albedo = {0.2f, 0.4f, 0.6f}}));
  EXPECT_EQ(read(pbr(1.0, 0.1)), (Material{.albedo = {0.2f, 0.4f, 0.6f}, .surface = Surface::mirror}));
  json glass = pbr(0.0, 0.0);
  glass["extensions"] = {{"KHR_materials_transmission", {{"transmissionFactor", 1}}},
                         {"KHR_materials_ior", {{"ior", 1.33}}}};
  const glm::vec3 colour(0.2f, 0.4f, 0.6f);  // in two sheets, unless it is thick
  EXPECT_EQ(read(glass),
            (Material{.albedo = glm::sqrt(colour), .surface = Surface::dielectric, .ior = 1.33f}));
  glass["extensions"]["KHR_materials_volume"] = {{"thicknessFactor", 0.1}};
  EXPECT_EQ(read(glass), (Material{.albedo = colour, .surface = Surface::dielectric, .ior = 1.33f}));
  json blended = pbr(0.0, 1.0);
  blended["alphaMode"] = "BLEND";
  EXPECT_EQ(read(blended).surface, Surface::diffuse);
  blended["pbrMetallicRoughness"]["baseColorFactor"][3] = 0.3;
  // Of what is behind it, as much shows as alpha leaves, and of that what its colour leaves.
  EXPECT_EQ(read(blended).surface, Surface::dielectric);
  expect_near(read(blended).albedo, glm::sqrt(glm::vec3(0.76f, 0.82f, 0.88f)), 1e-6f);
  json lamp = pbr(1.0, 0.0);  // what emits is diffuse
  lamp["emissiveFactor"] = {1, 0.5, 0};
  lamp["extensions"] = {{"KHR_materials_emissive_strength", {{"emissiveStrength", 8}}}};
  EXPECT_EQ(read(lamp), (Material{.albedo = {0.2f, 0.4f, 0.6f}, .emission = {8, 4, 0}}));
}

json thin_glass() {
  return {{"pbrMetallicRoughness", {{"metallicFactor", 0}}},
          {"extensions", {{"KHR_materials_transmission", {{"transmissionFactor", 1}}}}}};
}

TEST(ImportGltf, GlassOfIndexOneHardlyRefractsAndOthersAreReplacedWithANote) {
  const auto read = [](double ior) {
    GltfFile f;
    json glass = thin_glass();
    glass["extensions"]["KHR_materials_ior"] = {{"ior", ior}};
    f.node({{"mesh", f.square(f.material(glass))}});
    return import_gltf(f);
  };
  for (const double one : {1.0, 1.0 + 1e-12}) {
    ImportedScene air = read(one);
    EXPECT_FLOAT_EQ(air.scene.materials[0].ior, 1.0001f);
    EXPECT_FALSE(has_note(air, "refraction"));
    EXPECT_NO_THROW(prepare(air.scene));
  }
  EXPECT_FLOAT_EQ(read(2.4).scene.materials[0].ior, 2.4f);
  for (const double odd : {0.0, 0.9, 11.0, -1.0}) {
    const ImportedScene replaced = read(odd);
    EXPECT_FLOAT_EQ(replaced.scene.materials[0].ior, 1.5f);
    EXPECT_TRUE(has_note(replaced, "refraction")) << odd;
  }
}

// A square of thin glass in a large room, placed by a test.
struct Pane {
  GltfFile f;
  std::size_t mesh;
  Pane() {
    f.node({{"mesh", f.cube(f.material(json::object()), true)}, {"scale", {4, 4, 4}}});
    mesh = f.square(f.material(thin_glass()));
  }
  std::size_t node(json placed = json::object()) {
    placed["mesh"] = mesh;
    return f.node(placed);
  }
};

// From the first corner of the pane that stands last to that of its back, in a frame.
glm::vec3 to_back(const GltfFile& f, float frame = 0.0f) {
  const Scene scene = import_gltf(f).scene;
  for (const Mesh& mesh : scene.meshes) {
    if (!scene.materials[mesh.material].is_specular() || mesh.positions.size() < 8) continue;
    const Pose pose = mesh.pose ? mesh.pose(frame) : Pose{};
    const std::size_t n = mesh.positions.size();
    return pose(mesh.positions[n - 4]) - pose(mesh.positions[n - 8]);
  }
  ADD_FAILURE() << "no back";
  return {};
}

TEST(ImportGltf, TheSheetsOfThinGlassAreAsFarApartHoweverItIsScaled) {
  Pane still;
  still.node();
  const glm::vec3 back = to_back(still.f);
  const float apart = -back.z, tolerance = 1e-3f * apart;
  EXPECT_NEAR(apart, 80.0f * kEpsilonShare * 2.0f * std::sqrt(3.0f), tolerance);
  Pane appears;
  appears.f.animate(appears.node(), "scale", appears.f.scalars({0, 0.5, 1}),
                    appears.f.vec3s({0, 0, 0, 1, 1, 1, 1, 1, 1}), "STEP");
  expect_near(to_back(appears.f, 20.0f), back, tolerance);
  Pane shared;
  shared.node({{"scale", {0.02, 0.02, 0.02}}, {"translation", {1, 1, 1}}});
  shared.node();
  expect_near(to_back(shared.f), back, tolerance);
  for (const json& scale : {json{1, 1, 0.01}, json{-1, 1, 0.01}, json{1, 1, -0.01}, json{0.1, 0.1, 3}}) {
    Pane uneven;
    uneven.node({{"scale", scale}});
    expect_near(to_back(uneven.f), scale[2] < 0 ? -back : back, tolerance);
  }
  // Turned by 45 degrees about x and pressed together along z: its normal comes to lie along (0, -1, 10).
  Pane oblique;
  const auto turned = GltfFile::append(
      oblique.f.doc["nodes"],
      {{"mesh", oblique.mesh}, {"rotation", {std::sin(0.125 * kPi), 0, 0, std::cos(0.125 * kPi)}}});
  oblique.f.node({{"children", {turned}}, {"scale", {1, 1, 0.1}}});
  expect_near(to_back(oblique.f), -apart * glm::normalize(glm::vec3(0, -1, 10)), tolerance);
}

TEST(ImportGltf, GlassThatIsFlatAtAllTimesHasOneSheetAndANote) {
  Pane flat;
  flat.node({{"scale", {1, 1, 0}}});
  ImportedScene imported = import_gltf(flat.f);
  EXPECT_TRUE(has_note(imported, "one sheet"));
  EXPECT_NO_THROW(prepare(imported.scene));
}

TEST(ImportGltf, ThinGlassGetsABackThickGlassDoesNot) {
  GltfFile f;
  const auto thin = f.material(thin_glass());
  json with_volume = thin_glass();
  with_volume["extensions"]["KHR_materials_volume"] = {{"thicknessFactor", 0.1}};
  const auto thick = f.material(with_volume);
  json shining = f.doc["materials"][thin];
  shining["emissiveFactor"] = {1, 1, 1};
  const auto lamp = f.material(shining);
  f.node({{"mesh", f.square(thin)}});
  f.node({{"mesh", f.square(thick)}});
  f.node({{"mesh", f.square(lamp)}});
  const Scene scene = import_gltf(f).scene;
  ASSERT_EQ(scene.meshes.size(), 3u);
  EXPECT_EQ(scene.meshes[0].triangles.size(), 4u);
  EXPECT_NEAR(glm::length(area(scene.meshes[0])), 0.0, 1e-6) << "the sheets do not face away from each other";
  EXPECT_LT(scene.meshes[0].positions[4].z, scene.meshes[0].positions[0].z)
      << "the second is not behind the first";
  EXPECT_EQ(scene.meshes[1].triangles.size(), 2u);
  EXPECT_EQ(scene.meshes[2].triangles.size(), 2u) << "a lamp shines from its front alone";
}

// Triangles of thin glass in a scene, backs included.
std::size_t glass_triangles(const ImportedScene& imported) {
  std::size_t sum = 0;
  for (const Mesh& mesh : imported.scene.meshes) {
    if (imported.scene.materials[mesh.material].is_specular()) sum += mesh.triangles.size();
  }
  return sum;
}

TEST(ImportGltf, ThinGlassWithBothItsFacesIsOneSheet) {
  const auto expect_one_sheet = [](const GltfFile& f) {
    const ImportedScene imported = import_gltf(f);
    EXPECT_EQ(glass_triangles(imported), 4u);
    EXPECT_TRUE(has_note(imported, "both its faces"));
  };
  const auto faces = [](Pane& pane, std::size_t vertices, const std::vector<std::uint16_t>& triangles) {
    GltfFile& f = pane.f;
    std::vector<float> corners;
    for (std::size_t v = 0; v < vertices; ++v) {
      const bool right = v % 4 == 1 || v % 4 == 2, up = v % 4 >= 2;
      corners.insert(corners.end(), {right ? 0.5f : -0.5f, up ? 0.5f : -0.5f, 0.0f});
    }
    const auto positions = f.vec3s(corners);
    pane.mesh = f.mesh(positions, f.indices(triangles), f.doc["materials"].size() - 1);
  };
  Pane shared;
  faces(shared, 4, {0, 1, 2, 0, 2, 3, 0, 2, 1, 0, 3, 2});
  shared.node();
  expect_one_sheet(shared.f);
  for (const bool is_shown_often : {false, true}) {
    Pane apart;  // and cut along the other diagonal
    faces(apart, 8, {0, 1, 2, 0, 2, 3, 5, 4, 7, 5, 7, 6});
    apart.node();
    if (is_shown_often) {
      apart.node({{"translation", {0, 0, 1}}});
      EXPECT_EQ(glass_triangles(import_gltf(apart.f)), 8u);
    } else {
      expect_one_sheet(apart.f);
    }
  }
  Pane turned;  // another node's
  turned.node();
  turned.node({{"rotation", {0, 1, 0, 0}}});
  const ImportedScene twice = import_gltf(turned.f);
  EXPECT_EQ(glass_triangles(twice), 8u) << "a mesh that is shown twice may not lose a face of one";
  faces(turned, 4, {0, 1, 2, 0, 2, 3});
  turned.f.doc["nodes"].back()["mesh"] = turned.mesh;
  expect_one_sheet(turned.f);
  turned.f.doc["nodes"].back()["translation"] = {0, 0, 0.1};
  EXPECT_EQ(glass_triangles(import_gltf(turned.f)), 8u) << "two panes";
  Pane often;  // the second face is one of a mesh that is shown elsewhere as well
  often.node();
  faces(often, 4, {0, 2, 1, 0, 3, 2});
  often.node();
  often.node({{"translation", {0, 0, 1}}});
  EXPECT_EQ(glass_triangles(import_gltf(often.f)), 12u);
}

// The albedo that a ray from z = 1 finds at (x, y) of a unit square with the four-coloured image.
glm::vec3 painted(const std::string& image_uri, const std::function<void(GltfFile&)>& change, float x,
                  float y) {
  const TemporaryFolder folder;
  write(folder / "my picture.png", quarters_png());
  GltfFile f;
  f.doc["images"] = {{{"uri", image_uri}}};
  f.doc["textures"] = {{{"source", 0}}};
  const auto mesh = f.square(f.material({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}));
  f.doc["meshes"][mesh]["primitives"][0]["attributes"]["TEXCOORD_0"] = f.vec2s({0, 1, 1, 1, 1, 0, 0, 0});
  f.node({{"mesh", mesh}});
  change(f);
  write(folder / "scene.gltf", f.text());
  const tbb::global_control serial(tbb::global_control::max_allowed_parallelism, 1);
  const RayTracer rays(import_scene(folder / "scene.gltf").scene);
  Tracer tracer(rays);
  return rays.albedo(tracer.intersect({{x, y, 1}, 10.0f, {0, 0, -1}}));
}

TEST(ImportGltf, TexturesStandUprightWhateverTheyComeFrom) {
  const std::string uris[] = {"my%20picture.png", "%6dy%20p%69cture.pn%67", "%6Dy picture.png",
                              "data:image/png;base64," + base64(quarters_png()),
                              "data:image/jpeg;base64," + base64(quarters_jpeg())};
  for (const std::string& uri : uris) {
    const auto unchanged = [](GltfFile&) {};
    const float tolerance = uri.find("jpeg") != uri.npos ? 0.05f : 1e-5f;
    expect_near(painted(uri, unchanged, -0.25f, 0.25f), {1, 0, 0}, tolerance);
    expect_near(painted(uri, unchanged, 0.25f, 0.25f), {0, 1, 0}, tolerance);
    expect_near(painted(uri, unchanged, -0.25f, -0.25f), {0, 0, 1}, tolerance);
    expect_near(painted(uri, unchanged, 0.25f, -0.25f), {1, 1, 1}, tolerance);
  }
}

TEST(ImportGltf, TextureCoordinatesMayBeNormalisedOrTransformed) {
  const std::string uri = "my%20picture.png";
  const auto bytes = [](GltfFile& f) {
    const auto uv = f.accessor<std::uint8_t>({0, 255, 255, 255, 255, 0, 0, 0}, "VEC2", 2, 5121);
    f.doc["accessors"][uv]["normalized"] = true;
    f.doc["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = uv;
  };
  expect_near(painted(uri, bytes, 0.25f, 0.25f), {0, 1, 0}, 1e-5f);
  const auto shifted = [](GltfFile& f) {
    f.doc["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"] =
        {{"offset", {0.5, 0}}, {"scale", {0.5, 0.5}}};
  };
  expect_near(painted(uri, shifted, -0.25f, 0.25f), {0, 1, 0}, 1e-5f);
}

TEST(ImportGltf, TextureTransformsScaleThenTurnThenShift) {
  const auto at = [](const json& transform, float x, float y) {
    return painted(
        "my%20picture.png",
        [&](GltfFile& f) {
          f.doc["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]
               ["KHR_texture_transform"] = transform;
        },
        x, y);
  };
  constexpr glm::vec3 kRed(1, 0, 0), kGreen(0, 1, 0), kBlue(0, 0, 1), kWhite(1, 1, 1);
  // Coordinates turn counter-clockwise, the picture clockwise.
  const json quarter = {{"rotation", 0.5 * kPi}};
  expect_near(at(quarter, -0.25f, 0.25f), kBlue, 1e-5f);
  expect_near(at(quarter, 0.25f, 0.25f), kRed, 1e-5f);
  expect_near(at(quarter, 0.25f, -0.25f), kGreen, 1e-5f);
  expect_near(at(quarter, -0.25f, -0.25f), kWhite, 1e-5f);
  // Half of the width then lies along the height: (u, v) comes to (v, -u / 2), shifted by half to (v, 1/2 - u / 2).
  const json narrow = {{"rotation", 0.5 * kPi}, {"scale", {0.5, 1}}};
  expect_near(at(narrow, 0.25f, 0.25f), kBlue, 1e-5f);
  expect_near(at(narrow, 0.25f, -0.25f), kWhite, 1e-5f);
  const json shifted = {{"rotation", 0.5 * kPi}, {"scale", {0.5, 1}}, {"offset", {0, 0.5}}};
  expect_near(at(shifted, 0.25f, 0.25f), kRed, 1e-5f);
  expect_near(at(shifted, 0.25f, -0.25f), kGreen, 1e-5f);
}

TEST(ImportGltf, ATextureHasTheSetOfCoordinatesThatItNames) {
  const auto at = [](const json& of_texture) {
    return painted(
        "my%20picture.png",
        [&](GltfFile& f) {
          f.doc["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] =
              f.vec2s({1, 0, 0, 0, 0, 1, 1, 1});  // turned by half
          f.doc["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"].update(of_texture);
        },
        -0.25f, 0.25f);
  };
  const auto transform = [](const json& t) { return json{{"KHR_texture_transform", t}}; };
  constexpr glm::vec3 kRed(1, 0, 0), kWhite(1, 1, 1);
  expect_near(at(json::object()), kRed, 1e-5f);
  expect_near(at({{"texCoord", 1}}), kWhite, 1e-5f);
  expect_near(at({{"texCoord", 1}, {"extensions", transform(json::object())}}), kWhite, 1e-5f);
  expect_near(at({{"texCoord", 1}, {"extensions", transform({{"texCoord", 0}})}}), kRed, 1e-5f);
}

TEST(ImportGltf, MaterialsHaveTheImagesThatTheirTexturesName) {
  GltfFile f;
  std::string grey;
  stbi_write_png_to_func(append_bytes, &grey, 1, 1, 3, std::array<unsigned char, 3>{9, 9, 9}.data(), 3);
  f.doc["images"] = {{{"bufferView", f.view(grey)}}, {{"bufferView", f.view(quarters_png())}}};
  f.doc["textures"] = {{{"source", 1}}, {{"source", 0}}, {{"source", 1}}};
  for (int t = 0; t < 3; ++t)
    f.node(
        {{"mesh", f.square(f.material({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", t}}}}}}))}});
  const Scene scene = import_gltf(f).scene;
  ASSERT_EQ(scene.textures.size(), 2u) << "an image is held once";
  const auto texels_of = [&](std::size_t material) {
    return scene.textures.at(scene.materials[material].texture).texels;
  };
  EXPECT_EQ(texels_of(0), quarters());
  EXPECT_EQ(texels_of(1), (std::vector<std::uint8_t>{9, 9, 9}));
  EXPECT_EQ(texels_of(2), quarters());
}

TEST(ImportGltf, OfSpecularGlossinessTheDiffusePartCounts) {
  const auto older = [](GltfFile& f) {
    f.doc["materials"][0] = {{"extensions",
                              {{"KHR_materials_pbrSpecularGlossiness",
                                {{"diffuseFactor", {0.25, 0.5, 0.75, 1}},
                                 {"specularFactor", {0, 0, 0}},
                                 {"diffuseTexture", {{"index", 0}}}}}}}};
  };
  expect_near(painted("my%20picture.png", older, 0.25f, -0.25f), {0.25f, 0.5f, 0.75f}, 1e-5f);
  expect_near(painted("my%20picture.png", older, -0.25f, 0.25f), {0.25f, 0, 0}, 1e-5f);
}

TEST(ImportGltf, TexturesAreSrgbWhateverTheirImagesSay) {
  std::string png = quarters_png();
  stbi_write_png_to_func(
      [](void* to, void* data, int size) {
        *static_cast<std::string*>(to) =
            std::string(static_cast<const char*>(data), static_cast<std::size_t>(size));
      },
      &png, 1, 1, 3, std::array<unsigned char, 3>{128, 64, 32}.data(), 3);
  const auto read = [&](const std::string& bytes) {
    return painted(
        "data:image/png;base64," + base64(bytes), [](GltfFile&) {}, 0.25f, 0.25f);
  };
  const glm::vec3 plain = read(png);
  EXPECT_NEAR(plain.r, 0.2159f, 1e-4f);
  EXPECT_EQ(read(png.insert(kBehindPngHeader, png_chunk("gAMA", big_endian(100'000)))), plain);
}

TEST(ImportGltf, WhatIsSpecularHasNoTexture) {
  for (const bool is_glass : {false, true}) {
    GltfFile f;
    f.doc["images"] = {{{"bufferView", f.view(quarters_png())}}};
    f.doc["textures"] = {{{"source", 0}}};
    json material = is_glass ? thin_glass() : json{{"pbrMetallicRoughness", {{"roughnessFactor", 0}}}};
    material["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
    f.node({{"mesh", f.square(f.material(material))}});
    const ImportedScene imported = import_gltf(f);
    EXPECT_TRUE(has_note(imported, "mirrors and glass"));
    expect_near(imported.scene.materials[0].albedo, glm::vec3(is_glass ? std::sqrt(0.5f) : 0.5f), 1e-5f);
  }
}

TEST(ImportGltf, EmissiveTexturesCountByTheirMean) {
  GltfFile f;
  f.doc["images"] = {{{"bufferView", f.view(quarters_png())}}};
  f.doc["textures"] = {{{"source", 0}}};
  f.node(
      {{"mesh", f.square(f.material({{"emissiveFactor", {1, 1, 1}}, {"emissiveTexture", {{"index", 0}}}}))}});
  const ImportedScene imported = import_gltf(f);
  expect_near(imported.scene.materials[0].emission, {0.5f, 0.5f, 0.5f}, 1e-5f);
  EXPECT_TRUE(has_note(imported, "mean colour"));
}

TEST(ImportGltf, ExtensionsAndTexturesThatAreNotReadAreNamed) {
  GltfFile f = spinning_cube();
  f.doc["extensionsUsed"] = {"KHR_node_visibility", "KHR_materials_ior", "KHR_materials_dispersion"};
  for (int i = 0; i < 40; ++i) f.doc["extensionsUsed"].push_back("EXT_made_up_" + std::to_string(i));
  json& materials = f.doc["materials"];
  materials[0] = thin_glass();
  materials[0]["extensions"]["KHR_materials_transmission"]["transmissionTexture"] = {{"index", 0}};
  materials[1] = {
      {"extensions", {{"KHR_materials_pbrSpecularGlossiness", {{"specularFactor", {0, 0.5, 0}}}}}}};
  const ImportedScene imported = import_gltf(f);
  EXPECT_TRUE(has_note(imported, "KHR_node_visibility, KHR_materials_dispersion, EXT_made_up_0,"));
  EXPECT_FALSE(has_note(imported, "KHR_materials_ior"));
  EXPECT_FALSE(has_note(imported, "EXT_made_up_30")) << "there may be any number";
  EXPECT_TRUE(has_note(imported, "22 more extensions"));
  EXPECT_TRUE(has_note(imported, "transmission textures"));
  EXPECT_TRUE(has_note(imported, "specular part"));
  f.doc["materials"][1]["extensions"]["KHR_materials_pbrSpecularGlossiness"]["specularFactor"] = {0, 0, 0};
  EXPECT_FALSE(has_note(import_gltf(f), "specular part")) << "there is none";
  f.doc["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = 0;
  for (const char* const note : {"nearest", "roughness of glass", "transmission below"})
    EXPECT_FALSE(has_note(import_gltf(f), note)) << note;
  f.doc["textures"][0]["sampler"] = 0;
  f.doc["samplers"] = {{{"magFilter", 9728}}};
  f.doc["materials"][0]["pbrMetallicRoughness"]["roughnessFactor"] = 0.5;
  EXPECT_TRUE(has_note(import_gltf(f), "nearest filtering"));
  EXPECT_TRUE(has_note(import_gltf(f), "roughness of glass"));
  f.doc["materials"][0]["extensions"]["KHR_materials_transmission"]["transmissionFactor"] = 0.4;
  EXPECT_TRUE(has_note(import_gltf(f), "transmission below 0.5"));
}

TEST(ImportGltf, WhatOfLampsGlassAndTexturesIsNotReadIsNamed) {
  const auto read = [](const json& material, const json& sampler = json::object()) {
    GltfFile f = spinning_cube();
    f.doc["materials"][0] = material;
    f.doc["samplers"] = json::array({sampler});
    f.doc["textures"][0]["sampler"] = 0;
    return import_gltf(f);
  };
  for (const char* const axis : {"wrapS", "wrapT"}) {
    EXPECT_TRUE(has_note(read(json::object(), {{axis, 33071}}), "wrap modes")) << axis;
    EXPECT_FALSE(has_note(read(json::object(), {{axis, 10497}}), "wrap modes")) << axis;
  }
  for (const bool is_doubled : {false, true}) {
    const auto note = "light from the back";
    EXPECT_EQ(has_note(read({{"doubleSided", is_doubled}, {"emissiveFactor", {1, 1, 1}}}), note), is_doubled);
    EXPECT_FALSE(has_note(read({{"doubleSided", is_doubled}}), note));
  }
  json glass = thin_glass();
  glass["extensions"]["KHR_materials_volume"] = {{"thicknessFactor", 0.1}};
  EXPECT_FALSE(has_note(read(glass), "absorption"));
  glass["extensions"]["KHR_materials_volume"]["attenuationColor"] = {1, 0, 0};
  EXPECT_TRUE(has_note(read(glass), "absorption inside glass"));
}

}  // namespace
}  // namespace icbench
