// Files of other formats that assimp reads: OBJ, Collada, FBX.
#include <assimp/scene.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <assimp/Exporter.hpp>
#include <assimp/Importer.hpp>
#include <glm/geometric.hpp>

#include "import_support.h"
#include "render/ray_tracer.h"

namespace icbench {
namespace {

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
