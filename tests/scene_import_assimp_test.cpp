// Files of other formats that assimp reads: OBJ, Collada, FBX.
#include <assimp/scene.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <assimp/Exporter.hpp>
#include <assimp/Importer.hpp>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <numbers>
#include <string>

#include "import_support.h"
#include "render/ray_tracer.h"
#include "scene/shapes.h"

namespace icbench {
namespace {

constexpr double kPi = std::numbers::pi;

TEST(ImportAssimp, AnObjFileComesWithItsMaterialsAndTextures) {
  const TemporaryFolder folder;
  write(folder / "paint.png", quarters_png());
  write(folder / "square.mtl", "newmtl paint\nKd 1 1 1\nmap_Kd paint.png\nnewmtl lamp\nKd 0 0 0\nKe 2 3 4\n");
  write(folder / "square.obj",
        "mtllib square.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 2\nv 1 0 2\nv 1 1 2\nvt 0 0\nvt 1 "
        "0\nvt 1 1\nvt 0 1\n"
        "usemtl paint\nf 1/1 2/2 3/3 4/4\nusemtl lamp\nf 5 7 6\n");
  const tbb::global_control serial(tbb::global_control::max_allowed_parallelism, 1);
  const RayTracer rays(import_scene(folder / "square.obj").scene);
  Tracer tracer(rays);
  expect_near(rays.albedo(tracer.intersect({{0.25f, 0.75f, 1}, 9.0f, {0, 0, -1}})), {1, 0, 0}, 1e-5f);
  expect_near(rays.emitted(tracer.intersect({{0.75f, 0.25f, 1}, 9.0f, {0, 0, 1}})), {2, 3, 4}, 1e-5f);
}

// Of what is seen from above, along -z.
glm::vec3 albedo_at(const Scene& scene, float x, float y) {
  const tbb::global_control serial(tbb::global_control::max_allowed_parallelism, 1);
  const RayTracer rays(scene);
  Tracer tracer(rays);
  const Hit hit = tracer.intersect({{x, y, 2}, 9.0f, {0, 0, -1}});
  return hit.missed() ? glm::vec3(-1.0f) : rays.albedo(hit);
}

TEST(ImportAssimp, TexturesAreTransformedAsTheFileSays) {
  const TemporaryFolder folder;
  write(folder / "paint.png", quarters_png());
  const auto read = [&](const char* transform) {
    write(folder / "square.ac",
          std::string("AC3Db\nMATERIAL \"m\" rgb 1 1 1 amb 0 0 0 emis 0 0 0 spec 0 0 0 shi 0 trans 0\n"
                      "OBJECT world\nkids 1\nOBJECT poly\nname \"square\"\ntexture \"paint.png\"\n") +
              transform +
              "numvert 4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\nnumsurf 1\nSURF 0x20\nmat 0\n"
              "refs 4\n0 0 0\n1 1 0\n2 1 1\n3 0 1\nkids 0\n");
    return import_scene(folder / "square.ac").scene;
  };
  const Scene once = read(""), twice = read("texrep 2 1\n"), shifted = read("texrep 2 1\ntexoff 0.5 0\n");
  const glm::vec3 left = albedo_at(once, 0.25f, 0.75f), right = albedo_at(once, 0.75f, 0.75f);
  ASSERT_GT(glm::distance(left, right), 0.5f);
  for (const float x : {0.125f, 0.625f}) {
    expect_near(albedo_at(twice, x, 0.75f), left, 1e-5f);
    expect_near(albedo_at(twice, x + 0.25f, 0.75f), right, 1e-5f);
    expect_near(albedo_at(shifted, x, 0.75f), right, 1e-5f);
    expect_near(albedo_at(shifted, x + 0.25f, 0.75f), left, 1e-5f);
  }
}

TEST(ImportAssimp, TexturesThatAreNotToBeHadLeaveTheColour) {
  const TemporaryFolder folder;
  write(folder / "paint.tga", std::string(18, '\0'));
  std::filesystem::create_directory(folder / "folder");
  const auto read = [&](const std::string& colour, const std::string& image) {
    write(folder / "square.mtl", "newmtl paint\nKd " + colour + "\nmap_Kd " + image + "\n");
    write(folder / "square.obj",
          "mtllib square.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl "
          "paint\n"
          "f 1/1 2/2 3/3 4/4\n");
    return import_scene(folder / "square.obj");
  };
  for (const auto& [image, why] :
       {std::pair("gone.png", "not there, 'gone.png'; colours"),
        std::pair("folder", "not there, 'folder'; colours"),
        std::pair("paint.tga", "neither PNG nor JPEG images, 'paint.tga'; colours")}) {
    const ImportedScene red = read("1 0 0", image), black = read("0 0 0", image);
    EXPECT_TRUE(has_note(red, why)) << image;
    expect_near(albedo_at(red.scene, 0.25f, 0.75f), {1, 0, 0}, 1e-5f);
    expect_near(albedo_at(black.scene, 0.25f, 0.75f), glm::vec3(0.8f), 1e-5f);
  }
  write(folder / "square.mtl", "newmtl a\nmap_Kd a.png\nnewmtl b\nmap_Kd b.png\nnewmtl c\nmap_Kd a.png\n");
  write(folder / "square.obj",
        "mtllib square.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\nusemtl c\nf 1 2 "
        "3\n");
  EXPECT_TRUE(has_note(import_scene(folder / "square.obj"), "and 1 more; colours"));
  write(folder / "paint.png", quarters_png().substr(0, 40));
  EXPECT_ANY_THROW(read("1 0 0", "paint.png"));
}

// glTF 1.0, of which our own reader knows nothing, by text; and by how it begins where a file has no extension.
TEST(ImportAssimp, WhatAssimpReadsBesidesIsKnownByItsContents) {
  const TemporaryFolder folder;
  const std::string doc = R"({"asset": {"version": VERSION}, "scene": "s", "scenes": {"s": {"nodes": ["n"]}},
    "nodes": {"n": {"meshes": ["m"]}}, "meshes": {"m": {"primitives": [{"attributes": {"POSITION": "a"}}]}},
    "accessors": {"a": {"bufferView": "v", "byteOffset": 0, "componentType": 5126, "count": 3, "type": "VEC3"}},
    "bufferViews": {"v": {"buffer": "b", "byteOffset": 0, "byteLength": 36, "target": 34962}},
    "buffers": {"b": {"byteLength": 36, "type": "arraybuffer", "uri": "b.bin"}}})";
  const float triangle[9] = {0, 0, 0, 1, 0, 0, 1, 1, 0};
  write(folder / "b.bin", std::string(reinterpret_cast<const char*>(triangle), sizeof triangle));
  for (const std::string version : {"\"1.0\"", "1"}) {
    std::string text = doc;
    write(folder / "old.gltf", text.replace(text.find("VERSION"), 7, version));
    EXPECT_EQ(import_scene(folder / "old.gltf").scene.meshes.at(0).triangles.size(), 1u) << version;
  }
  write(folder / "solid",
        "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\n"
        "endfacet\nendsolid s\n");
  EXPECT_EQ(import_scene(folder / "solid").scene.meshes.size(), 1u);
}

// A square that shows its texture twice from left to right, in 3D Studio's way: around its centre. Its z is up.
constexpr const char* kTiledSquare = R"(*3DSMAX_ASCIIEXPORT 200
*MATERIAL_LIST { *MATERIAL_COUNT 1 *MATERIAL 0 { *MATERIAL_NAME "m" *MATERIAL_DIFFUSE 1 1 1
*MAP_DIFFUSE { *BITMAP "paint.png" *UVW_U_TILING 2.0 *UVW_V_TILING 1.0 } } }
*GEOMOBJECT { *NODE_NAME "square" *MESH { *MESH_NUMVERTEX 4 *MESH_NUMFACES 2
*MESH_VERTEX_LIST { *MESH_VERTEX 0 0 0 0 *MESH_VERTEX 1 1 0 0 *MESH_VERTEX 2 1 0 1 *MESH_VERTEX 3 0 0 1 }
*MESH_FACE_LIST { *MESH_FACE 0: A: 0 B: 1 C: 2
*MESH_FACE 1: A: 0 B: 2 C: 3
}
*MESH_NUMTVERTEX 4
*MESH_TVERTLIST { *MESH_TVERT 0 0 0 0 *MESH_TVERT 1 1 0 0 *MESH_TVERT 2 1 1 0 *MESH_TVERT 3 0 1 0 }
*MESH_NUMTVFACES 2
*MESH_TFACELIST { *MESH_TFACE 0 0 1 2 *MESH_TFACE 1 0 2 3 } }
*MATERIAL_REF 0 }
)";

TEST(ImportAssimp, ThreeDStudioScalesTexturesAroundTheirCentre) {
  const TemporaryFolder folder;
  write(folder / "paint.png", quarters_png());
  write(folder / "square.ase", kTiledSquare);
  const Scene scene = import_scene(folder / "square.ase").scene;
  expect_near(albedo_at(scene, 0.125f, 0.75f), albedo_at(scene, 0.625f, 0.75f), 1e-5f);
  expect_near(albedo_at(scene, 0.125f, 0.75f), {0, 1, 0}, 1e-5f);
  expect_near(albedo_at(scene, 0.375f, 0.75f), {1, 0, 0}, 1e-5f);
}

TEST(ImportAssimp, ASphereIsPaintedFromPoleToPole) {
  const TemporaryFolder folder;
  write(folder / "paint.png", quarters_png());
  write(folder / "ball.nff", "f 1 1 1 1 0 0 0 1 paint.png\ns 0 0 0 1\n");  // without texture coordinates
  const Scene scene = import_scene(folder / "ball.nff").scene;
  EXPECT_GT(glm::distance(albedo_at(scene, 0.5f, -0.3f), albedo_at(scene, 0.5f, 0.3f)), 0.5f);
}

TEST(ImportAssimp, WhatTexturesCannotDoIsNamed) {
  const TemporaryFolder folder;
  write(folder / "paint.png", quarters_png());
  const auto read = [&](const char* more) {
    write(folder / "square.mtl", std::string("newmtl paint\nKd 1 1 1\n") + more);
    write(folder / "square.obj",
          "mtllib square.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl paint\nf 1/1 2/2 "
          "3/3\n");
    return import_scene(folder / "square.obj");
  };
  EXPECT_FALSE(has_note(read("map_Kd paint.png\n"), "left out"));
  EXPECT_TRUE(has_note(read("map_Kd -clamp on paint.png\n"), "wrap modes"));
  EXPECT_TRUE(has_note(read("map_Kd paint.png\nmap_d paint.png\n"), "opacity maps"));
  write(folder / "square.obj", "mtllib square.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl paint\nf 1 2 3\n");
  EXPECT_TRUE(has_note(import_scene(folder / "square.obj"), "without texture coordinates"));
}

TEST(ImportAssimp, GlassHasTheIndexThatIsGivenOrThatOfGlass) {
  const TemporaryFolder folder;
  const auto read = [&](const char* ior) {
    write(folder / "pane.mtl", std::string("newmtl pane\nKd 1 1 1\nd 0.2\n") + ior + "\n");
    write(folder / "pane.obj", "mtllib pane.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl pane\nf 1 2 3\n");
    return import_scene(folder / "pane.obj");
  };
  const auto ior_of = [](const ImportedScene& s) {
    return s.scene.materials[s.scene.meshes[0].material].ior;
  };
  EXPECT_FLOAT_EQ(ior_of(read("")), 1.5f);
  EXPECT_FLOAT_EQ(ior_of(read("Ni 1.7")), 1.7f);
  const ImportedScene replaced = read("Ni 0.5");
  EXPECT_FLOAT_EQ(ior_of(replaced), 1.5f);
  EXPECT_TRUE(has_note(replaced, "refraction"));
}

TEST(ImportAssimp, GlossIsLeftOutAndNamed) {
  const TemporaryFolder folder;
  const auto read = [&](const char* specular) {
    write(folder / "paint.mtl", std::string("newmtl paint\nKd .5 .5 .5\nKs ") + specular + "\n");
    write(folder / "paint.obj", "mtllib paint.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl paint\nf 1 2 3\n");
    return import_scene(folder / "paint.obj");
  };
  EXPECT_TRUE(has_note(read(".3 .3 .3"), "gloss"));
  EXPECT_FALSE(has_note(read("0 0 0"), "gloss"));
}

// A triangle that a node moves by 3 m in a second, under a camera, in centimetres.
constexpr const char* kCollada = R"(<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis></asset>
<library_cameras><camera id="cam"><optics><technique_common><perspective><xfov>60</xfov><aspect_ratio>1</aspect_ratio>
<znear>1</znear><zfar>100</zfar></perspective></technique_common></optics></camera></library_cameras>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 100 0 0 0 100 0</float_array><technique_common>
<accessor source="#pa" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>
<library_animations><animation id="a"><source id="t"><float_array id="ta" count="2">0 1</float_array><technique_common>
<accessor source="#ta" count="2" stride="1"><param name="TIME" type="float"/></accessor></technique_common></source>
<source id="o"><float_array id="oa" count="6">0 0 0 300 0 0</float_array><technique_common>
<accessor source="#oa" count="2" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<sampler id="s"><input semantic="INPUT" source="#t"/><input semantic="OUTPUT" source="#o"/></sampler>
<channel source="#s" target="mover/move"/></animation></library_animations>
<library_visual_scenes><visual_scene id="vs">
<node id="mover" name="mover"><translate sid="move">0 0 0</translate><instance_geometry url="#g"/></node>
<node id="eye" name="eye"><translate>0 0 500</translate><instance_camera url="#cam"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#vs"/></scene></COLLADA>
)";

TEST(ImportAssimp, AColladaFileComesInMetresWithItsAnimationAndCamera) {
  const ImportedScene imported = import_text("move.dae", kCollada);
  ASSERT_EQ(imported.scene.frames, 24u);
  const Mesh& mesh = imported.scene.meshes.at(0);
  const Pose start = mesh.pose(0.0f), later = mesh.pose(12.0f);
  const glm::vec3 edge = start(mesh.positions[1]) - start(mesh.positions[0]);
  EXPECT_NEAR(glm::length(edge), 1.0f, 1e-4f);
  expect_near(later(mesh.positions[0]) - start(mesh.positions[0]), {1.5f, 0, 0}, 1e-4f);
  expect_near(imported.scene.camera.eye, {0, 0, 5}, 1e-4f);
  const Camera& camera = imported.scene.camera;
  expect_near(glm::normalize(camera.target - camera.eye), {0, 0, -1}, 1e-5f);
}

// The same under a lamp.
std::string collada_with(const std::string& lamp) {
  std::string text = kCollada;
  const auto replace = [&](const std::string& what, const std::string& by) {
    const std::size_t at = text.find(what);
    EXPECT_NE(at, text.npos) << what;
    text.replace(at, what.size(), by);
  };
  replace("<library_geometries>", "<library_lights><light id=\"l\"><technique_common>" + lamp +
                                      "</technique_common></light></library_lights><library_geometries>");
  replace("</visual_scene>",
          "<node id=\"lamp\" name=\"lamp\"><translate>0 300 0</translate><instance_light url=\"#l\"/></node>"
          "</visual_scene>");
  return text;
}

TEST(ImportAssimp, CamerasHaveTheVerticalAngleThatBelongsToTheirHorizontalOneOrANote) {
  const std::string camera =
      "*CAMERAOBJECT { *NODE_NAME \"eye\" *CAMERA_TYPE Free *CAMERA_SETTINGS { *CAMERA_FOV 1.2 } }\n";
  const TemporaryFolder folder;
  write(folder / "paint.png", quarters_png());
  write(folder / "square.ase", kTiledSquare + camera);
  const ImportedScene known = import_scene(folder / "square.ase");
  EXPECT_NEAR(known.scene.camera.fov_y, 2.0 * std::atan(0.75 * std::tan(0.6)), 1e-6);  // of pictures of 4 : 3
  EXPECT_FALSE(has_note(known, "angle is lost"));
  const ImportedScene lost = import_text("move.dae", kCollada);  // by assimp 5.2
  EXPECT_NE(has_note(lost, "angle is lost"), std::abs(lost.scene.camera.fov_y - kPi / 3.0) < 1e-5);
}

TEST(ImportAssimp, LampsGiveWhatTheirFallOffLeavesAtOneMetre) {
  const auto light = [](const std::string& lamp) {
    return import_text("lit.dae", collada_with(lamp)).scene.point_lights.at(0);
  };
  const PointLight plain = light("<point><color>2 4 6</color></point>");
  expect_near(plain.intensity, {2, 4, 6}, 1e-6f);
  expect_near(plain.p, {0, 3, 0}, 1e-4f);
  const PointLight weak = light(
      "<point><color>2 4 6</color><constant_attenuation>1</constant_attenuation>"
      "<linear_attenuation>0.5</linear_attenuation><quadratic_attenuation>0.5</quadratic_attenuation></"
      "point>");
  expect_near(weak.intensity, {1, 2, 3}, 1e-6f);
  const PointLight spot = light("<spot><color>1 1 1</color><falloff_angle>60</falloff_angle></spot>");
  EXPECT_NEAR(spot.cos_inner, std::cos(kPi / 6.0), 1e-5) << "the angle is that of the whole cone";
  EXPECT_LT(spot.cos_outer, spot.cos_inner);
  EXPECT_GT(spot.cos_outer, 0.0f);
}

TEST(ImportAssimp, NodesStandWhereTheirMatricesPutThem) {
  std::string text = kCollada;
  text.insert(text.find("</visual_scene>"),
              "<node id=\"turned\" name=\"turned\"><matrix>0 -1 0 500  1 0 0 0  0 0 1 0  0 0 0 1</matrix>"
              "<instance_geometry url=\"#g\"/></node>");
  const Scene scene = import_text("still.dae", text).scene;
  const auto still =
      std::find_if(scene.meshes.begin(), scene.meshes.end(), [](const Mesh& m) { return !m.pose; });
  ASSERT_NE(still, scene.meshes.end());
  const Bounds box = bounds_of(*still);
  expect_near(box.lower, {4, 0, 0}, 1e-4f);
  expect_near(box.upper, {5, 1, 0}, 1e-4f);
  EXPECT_NEAR(area(*still).z, 0.5, 1e-5);
}

TEST(ImportAssimp, TexturesAreFoundByTheirPathOrBesideTheFile) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "maps");
  write(folder / "maps" / "paint.png", quarters_png());
  write(folder / "beside.png", quarters_png());
  for (const char* const path :
       {"maps/paint.png", "maps\\paint.png", "gone/beside.png", "C:\\gone\\beside.png"}) {
    write(folder / "square.mtl", std::string("newmtl paint\nKd 0 0 0\nmap_Kd ") + path + "\n");
    write(folder / "square.obj",
          "mtllib square.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
          "usemtl paint\nf 1/1 2/2 3/3 4/4\n");
    EXPECT_EQ(
        error_of([&] {
          // The texture stands for the colour, which is black beside it.
          expect_near(albedo_at(import_scene(folder / "square.obj").scene, 0.25f, 0.75f), {1, 0, 0}, 1e-5f);
        }),
        "")
        << path;
  }
}

TEST(ImportAssimp, GlassIsWhatIsMoreThanHalfTransparentAndClearWhereItsColourIsBlack) {
  const TemporaryFolder folder;
  const auto read = [&](const char* looks) {
    write(folder / "pane.mtl", std::string("newmtl pane\n") + looks + "\n");
    write(folder / "pane.obj", "mtllib pane.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl pane\nf 1 2 3\n");
    const Scene scene = import_scene(folder / "pane.obj").scene;
    return scene.materials[scene.meshes[0].material];
  };
  EXPECT_EQ(read("Kd .5 1 1\nd 0.5").surface, Surface::diffuse);
  EXPECT_EQ(read("Kd .5 1 1\nd 0.25").surface, Surface::dielectric);
  expect_near(read("Kd .5 1 1\nd 0.25").albedo, {0.5f, 1, 1}, 1e-6f);
  expect_near(read("Kd 0 0 0\nd 0.25").albedo, {1, 1, 1}, 1e-6f);
  expect_near(read("Kd 0 0 0\nd 1").albedo, {0, 0, 0}, 1e-6f);
}

TEST(ImportAssimp, AnFbxFileComesInMetres) {
  const TemporaryFolder folder;
  write(folder / "move.dae",
        kCollada);  // its sides are 100 long; assimp exports it with centimetres as the unit
  Assimp::Importer importer;
  Assimp::Exporter exporter;
  const aiScene* scene = importer.ReadFile((folder / "move.dae").string(), 0);
  ASSERT_TRUE(scene);
  ASSERT_EQ(exporter.Export(scene, "fbxa", (folder / "move.fbx").string()), AI_SUCCESS);
  const Mesh mesh = import_scene(folder / "move.fbx").scene.meshes.at(0);
  EXPECT_NEAR(glm::length(area(mesh)), 0.5, 1e-5);
}

}  // namespace
}  // namespace icbench
