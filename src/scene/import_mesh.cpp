#include "scene/import_mesh.h"

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <assimp/Importer.hpp>
#include <stdexcept>

#include "scene/shapes.h"

namespace icbench {
namespace {

constexpr const char* kBunnyFile = "/usr/share/glmark2/models/bunny.obj";

void append(Mesh& to, const aiMesh& from) {
  const auto first = static_cast<std::uint32_t>(to.positions.size());
  for (unsigned v = 0; v < from.mNumVertices; ++v) {
    const aiVector3D &p = from.mVertices[v], &n = from.mNormals[v];
    to.positions.emplace_back(p.x, p.y, p.z);
    to.normals.emplace_back(n.x, n.y, n.z);
  }
  for (unsigned f = 0; f < from.mNumFaces; ++f) {
    const aiFace& face = from.mFaces[f];
    if (face.mNumIndices != 3) continue;  // points and lines have no surface
    to.triangles.emplace_back(first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]);
  }
}

}  // namespace

Mesh import_mesh(const std::filesystem::path& file, std::string name, std::uint32_t material) {
  Assimp::Importer importer;
  const aiScene* scene =
      importer.ReadFile(file.string(), aiProcess_Triangulate | aiProcess_JoinIdenticalVertices |
                                           aiProcess_GenSmoothNormals | aiProcess_PreTransformVertices);
  if (!scene)
    throw std::runtime_error(fmt::format("cannot read {}: {}", file.string(), importer.GetErrorString()));
  Mesh mesh{std::move(name), {}, {}, {}, material};
  for (unsigned m = 0; m < scene->mNumMeshes; ++m)
    if (scene->mMeshes[m]->HasNormals()) append(mesh, *scene->mMeshes[m]);
  if (mesh.triangles.empty()) throw std::runtime_error(fmt::format("{} holds no triangle", file.string()));
  return mesh;
}

namespace {

Mesh load_bunny() {
  if (!std::filesystem::exists(kBunnyFile))
    throw std::runtime_error(
        fmt::format("the bunny is missing at {}; install the Debian package glmark2-data", kBunnyFile));
  Mesh mesh = import_mesh(kBunnyFile, "bunny", 0);
  const Bounds b = bounds_of(mesh);
  const float scale = 1.0f / (b.upper.y - b.lower.y);
  const glm::vec3 foot(0.5f * (b.lower.x + b.upper.x), b.lower.y, 0.5f * (b.lower.z + b.upper.z));
  place(mesh, scale, 0.0f, -scale * foot);
  return mesh;
}

}  // namespace

Mesh stanford_bunny(std::uint32_t material) {
  static const Mesh loaded = load_bunny();
  Mesh mesh = loaded;
  mesh.material = material;
  return mesh;
}

}  // namespace icbench
