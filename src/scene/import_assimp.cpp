// Every format that assimp reads. assimp trusts what it reads, so it reads in a child process first
// (import_trial.h).
#include <assimp/GltfMaterial.h>
#include <assimp/commonMetaData.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>
#include <map>
#include <new>
#include <optional>
#include <set>
#include <stdexcept>
#include <string_view>

#include "core/fp_traps.h"
#include "files/input_file.h"
#include "scene/import_model.h"
#include "scene/import_text.h"
#include "scene/import_trial.h"

namespace icbench::importing {
namespace {

constexpr unsigned kSteps = aiProcess_Triangulate | aiProcess_JoinIdenticalVertices |
                            aiProcess_GenSmoothNormals | aiProcess_SortByPType |
                            aiProcess_ValidateDataStructure | aiProcess_GlobalScale | aiProcess_GenUVCoords;
// assimp's share: this much at least, or so many times the file.
constexpr std::size_t kMemory = std::size_t{1} << 30, kMemoryPerByte = 100;
constexpr unsigned kSeconds = 2;  // of processor time, and one more for each
constexpr std::size_t kBytesPerSecond = 50'000;
// Below this many radians a camera's angle is one that assimp failed to read.
constexpr double kLeastAngle = 0.02;
constexpr glm::vec3 kGrey(0.8f);  // where a file says no colour

glm::dvec3 vec(const aiVector3D& v) { return {v.x, v.y, v.z}; }

glm::vec3 colour(const aiColor3D& c) { return {c.r, c.g, c.b}; }

glm::dmat4 matrix(const aiMatrix4x4& m) {
  return {m.a1, m.b1, m.c1, m.d1, m.a2, m.b2, m.c2, m.d2, m.a3, m.b3, m.c3, m.d3, m.a4, m.b4, m.c4, m.d4};
}

bool is_finite(const glm::dvec3& v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

class AssimpReader {
 public:
  AssimpReader(const aiScene& from, const std::filesystem::path& file)
      : from_(from), folder_(file.parent_path()) {
    model_.file = file.string();
    aiString importer;
    if (from.mMetaData && from.mMetaData->Get(AI_METADATA_SOURCE_FORMAT, importer))
      format_ = importer.C_Str();
  }

  Model read() {
    for (unsigned m = 0; m < from_.mNumMaterials; ++m) read_material(*from_.mMaterials[m]);
    if (model_.materials.empty()) model_.materials.push_back({.material = {.albedo = kGrey}});
    for (unsigned m = 0; m < from_.mNumMeshes; ++m) read_mesh(m, *from_.mMeshes[m]);
    read_nodes();
    for (unsigned a = 0; a < from_.mNumAnimations; ++a) read_animation(*from_.mAnimations[a]);
    note_without(absent_, "not there");
    note_without(foreign_, "neither PNG nor JPEG images");
    if (from_.mNumAnimations > 1)
      model_.notes.add(fmt::format("has {} animations; they are played at once", from_.mNumAnimations));
    if (from_.mNumCameras > 1)
      model_.notes.add(fmt::format("has {} cameras; the first is used", from_.mNumCameras));
    return std::move(model_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(fmt::format("{}: {}", model_.file, what));
  }

  void read_material(const aiMaterial& material) {
    Surfacing to;
    Material& m = to.material;
    aiColor3D diffuse(kGrey.x, kGrey.y, kGrey.z), emitted(0.0f, 0.0f, 0.0f);
    if (material.Get(AI_MATKEY_BASE_COLOR, diffuse) != AI_SUCCESS)
      material.Get(AI_MATKEY_COLOR_DIFFUSE, diffuse);
    material.Get(AI_MATKEY_COLOR_EMISSIVE, emitted);
    const auto number = [&](const char* key, unsigned type, unsigned index, float fallback) {
      float value = fallback;
      material.Get(key, type, index, value);
      return std::isfinite(value) ? value : fallback;
    };
    const float strength = number(AI_MATKEY_EMISSIVE_INTENSITY, 1.0f);
    for (int c = 0; c < 3; ++c)
      m.albedo[c] = std::isfinite(colour(diffuse)[c]) ? std::clamp(colour(diffuse)[c], 0.0f, 1.0f) : 0.0f;
    m.emission = emitted_radiance(static_cast<double>(strength) * glm::dvec3(colour(emitted)), model_.notes);
    const float opacity = number(AI_MATKEY_OPACITY, 1.0f), ior = number(AI_MATKEY_REFRACTI, 1.5f);
    const float metallic = number(AI_MATKEY_METALLIC_FACTOR, 0.0f);
    const bool glass =
        opacity < 0.5f || number(AI_MATKEY_TRANSMISSION_FACTOR, 0.0f) * (1.0f - metallic) >= 0.5f;
    if (m.emits()) {
      m.surface = Surface::diffuse;
    } else if (glass) {
      m.surface = Surface::dielectric;
      // assimp says 1 where a file says nothing.
      m.ior = ior == 1.0f ? 1.5f : refracting_index(ior, model_.notes);
      // Such formats often leave the colour of glass black.
      if (m.albedo == glm::vec3(0.0f)) m.albedo = glm::vec3(1.0f);
    } else if (metallic >= 0.5f && number(AI_MATKEY_ROUGHNESS_FACTOR, 1.0f) <= 0.1f) {
      m.surface = Surface::mirror;
    }
    aiColor3D gloss(0.0f, 0.0f, 0.0f);
    if (m.surface == Surface::diffuse && material.Get(AI_MATKEY_COLOR_SPECULAR, gloss) == AI_SUCCESS &&
        !gloss.IsBlack())
      model_.notes.drop("gloss");
    paintings_.push_back(read_textures(material, m));
    model_.materials.push_back(to);
  }

  // Textures that a file names and that are not to be had.
  struct Without {
    std::string first;
    std::size_t count = 0;
  };

  // What makes of a mesh's texture coordinates those of its material's texture.
  struct Painting {
    unsigned set = 0;
    glm::dmat3 transform{1.0};
  };

  Painting read_textures(const aiMaterial& material, Material& m) {
    if (material.GetTextureCount(aiTextureType_NORMALS) + material.GetTextureCount(aiTextureType_HEIGHT) > 0)
      model_.notes.drop("normal maps");
    if (material.GetTextureCount(aiTextureType_EMISSIVE) > 0) model_.notes.drop("emissive textures");
    if (material.GetTextureCount(aiTextureType_OPACITY) > 0) model_.notes.drop("opacity maps");
    if (m.surface != Surface::diffuse) {
      if (material.GetTextureCount(aiTextureType_BASE_COLOR) +
              material.GetTextureCount(aiTextureType_DIFFUSE) >
          0)
        model_.notes.drop("base-colour textures of mirrors and glass");
      return {};
    }
    for (const aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE}) {
      aiString path;
      unsigned set = 0;
      aiTextureMapMode ways[3] = {aiTextureMapMode_Wrap, aiTextureMapMode_Wrap, aiTextureMapMode_Wrap};
      if (material.GetTexture(type, 0, &path, nullptr, &set, nullptr, nullptr, ways) != AI_SUCCESS ||
          path.length == 0)
        continue;
      m.texture = texture(path.C_Str());
      // A texture stands for the colour where formats give both.
      if (m.albedo == glm::vec3(0.0f)) m.albedo = m.texture != kNoTexture ? glm::vec3(1.0f) : kGrey;
      if (m.texture == kNoTexture) break;
      if (ways[0] != aiTextureMapMode_Wrap || ways[1] != aiTextureMapMode_Wrap)
        model_.notes.drop("wrap modes (textures repeat)");
      // assimp numbers the sets of Collada as the file does, but keeps them without gaps.
      return {is_of("Collada") ? 0 : set, uv_transform(material, type)};
    }
    return {};
  }

  bool is_of(std::string_view importer) const { return format_.find(importer) != std::string::npos; }

  glm::dmat3 uv_transform(const aiMaterial& material, aiTextureType type) const {
    aiUVTransform t;
    if (material.Get(AI_MATKEY_UVTRANSFORM(type, 0), t) != AI_SUCCESS ||
        !std::isfinite(t.mTranslation.x + t.mTranslation.y + t.mScaling.x + t.mScaling.y + t.mRotation))
      return glm::dmat3(1.0);
    const double cos = std::cos(t.mRotation), sin = std::sin(t.mRotation);
    const auto shift = [](double u, double v) { return glm::dmat3(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, u, v, 1.0); };
    const glm::dmat3 scale(t.mScaling.x, 0.0, 0.0, 0.0, t.mScaling.y, 0.0, 0.0, 0.0, 1.0);
    const glm::dmat3 turn = shift(0.5, 0.5) * glm::dmat3(cos, sin, 0.0, -sin, cos, 0.0, 0.0, 0.0, 1.0);
    // 3D Studio shifts first and scales around the centre, others scale from the corner and shift then.
    if (is_of("3DS") || is_of("ASE"))
      return turn * scale * shift(t.mTranslation.x - 0.5, t.mTranslation.y - 0.5);
    return shift(t.mTranslation.x, t.mTranslation.y) * turn * shift(-0.5, -0.5) * scale;
  }

  // kNoTexture where a model that has come around names an image that is not there, or not of a format that is read.
  std::uint32_t texture(const std::string& path) {
    const auto [known, first] = textures_.try_emplace(path, kNoTexture);
    if (!first) return known->second;
    try {
      std::optional<Texture> loaded = load(path);
      if (!loaded) return kNoTexture;
      known->second = static_cast<std::uint32_t>(model_.textures.size());
      model_.textures.push_back(std::move(*loaded));
      texels_ += model_.textures.back().texels.size() / 3;
      if (texels_ > kMaxTexels)
        throw std::runtime_error(fmt::format("is one too many: all have more than {} texels", kMaxTexels));
    } catch (const std::runtime_error& error) {
      fail(fmt::format("texture '{}' {}", path, error.what()));
    }
    return known->second;
  }

  std::optional<Texture> load(const std::string& path) {
    const aiTexture* embedded = from_.GetEmbeddedTexture(path.c_str());
    if (!embedded) {
      std::string name = path;
      std::replace(name.begin(), name.end(), '\\', '/');
      const std::filesystem::path given = folder_ / name,
                                  beside = folder_ / std::filesystem::path(name).filename();
      std::error_code ignored;
      for (const std::filesystem::path& file : {given, beside})
        if (std::filesystem::exists(file, ignored) && !std::filesystem::is_directory(file, ignored))
          return decoded(load_file(file), path);
      return without(absent_, path);
    }
    if (embedded->mHeight == 0)
      return decoded({reinterpret_cast<const char*>(embedded->pcData), embedded->mWidth}, path);
    const std::size_t count = std::size_t{embedded->mWidth} * embedded->mHeight;
    Texture to{path, static_cast<int>(embedded->mWidth), static_cast<int>(embedded->mHeight), {}};
    for (std::size_t i = 0; i < count; ++i) {
      const aiTexel& t = embedded->pcData[i];
      to.texels.insert(to.texels.end(), {t.r, t.g, t.b});
    }
    return to;
  }

  std::optional<Texture> decoded(std::string_view bytes, const std::string& path) {
    if (!is_texture(bytes)) return without(foreign_, path);
    return decode_texture(bytes, path);
  }

  static std::nullopt_t without(Without& some, const std::string& path) {
    if (some.count++ == 0) some.first = short_name(path);
    return std::nullopt;
  }

  void note_without(const Without& some, std::string_view which) {
    if (some.count == 0) return;
    const std::string others = some.count > 1 ? fmt::format(" and {} more", some.count - 1) : "";
    model_.notes.add(
        fmt::format("has textures that are {}, '{}'{}; colours stand for them", which, some.first, others));
  }

  void read_mesh(unsigned index, const aiMesh& mesh) {
    Shape shape;
    shape.name = mesh.mName.length > 0 ? short_name(mesh.mName.C_Str()) : fmt::format("mesh {}", index);
    shape.material =
        std::min<std::uint32_t>(mesh.mMaterialIndex, static_cast<std::uint32_t>(model_.materials.size() - 1));
    if (mesh.HasBones()) model_.notes.drop("skinning");
    if (mesh.mNumAnimMeshes > 0) model_.notes.drop("morph targets");
    if (mesh.HasVertexColors(0)) model_.notes.drop("vertex colours");
    const bool textured = model_.materials[shape.material].material.texture != kNoTexture;
    const Painting painting = textured ? paintings_[shape.material] : Painting{};
    const aiVector3D* uvs = mesh.mTextureCoords[mesh.HasTextureCoords(painting.set) ? painting.set : 0];
    if (textured && !uvs) model_.notes.drop(kNoCoordinates);
    for (unsigned v = 0; v < mesh.mNumVertices; ++v) {
      shape.positions.push_back(vec(mesh.mVertices[v]));
      if (!is_finite(shape.positions.back()))
        fail(fmt::format("vertex {} of mesh '{}' is not finite", v, shape.name));
      if (mesh.HasNormals()) shape.normals.emplace_back(vec(mesh.mNormals[v]));
      if (textured)
        shape.uvs.emplace_back(uvs ? glm::dvec2(painting.transform * glm::dvec3(uvs[v].x, uvs[v].y, 1.0))
                                   : glm::dvec2(0.0));
    }
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices != 3) {
        model_.notes.drop("points and lines");
        break;
      }
      const glm::uvec3 t(face.mIndices[0], face.mIndices[1], face.mIndices[2]);
      if (std::max({t.x, t.y, t.z}) >= mesh.mNumVertices)
        fail(fmt::format("face {} of mesh '{}' names a vertex beyond {}", f, shape.name, mesh.mNumVertices));
      shape.triangles.push_back(t);
    }
    model_.shapes.push_back(std::move(shape));
  }

  void read_nodes() {
    struct Step {
      const aiNode* node;
      int parent;
    };
    std::set<std::string> animated;
    for (unsigned a = 0; a < from_.mNumAnimations; ++a)
      for (unsigned c = 0; c < from_.mAnimations[a]->mNumChannels; ++c)
        animated.insert(from_.mAnimations[a]->mChannels[c]->mNodeName.C_Str());
    std::vector<Step> left{{from_.mRootNode, -1}};
    while (!left.empty()) {
      const auto [node, parent] = left.back();
      left.pop_back();
      Local local;
      local.matrix = matrix(node->mTransformation);
      if (animated.count(node->mName.C_Str()) > 0) local = decomposed(*node);
      const std::uint32_t at = model_.rig.add(node->mName.C_Str(), parent, local);
      node_of_.try_emplace(node->mName.C_Str(), at);
      for (unsigned m = 0; m < node->mNumMeshes; ++m)
        if (node->mMeshes[m] < model_.shapes.size()) model_.placed_shapes.push_back({at, node->mMeshes[m]});
      place_camera_and_light(*node, at);
      for (unsigned c = node->mNumChildren; c-- > 0;)
        left.push_back({node->mChildren[c], static_cast<int>(at)});
    }
  }

  static Local decomposed(const aiNode& node) {
    aiVector3D scale, translation;
    aiQuaternion rotation;
    node.mTransformation.Decompose(scale, rotation, translation);
    Local local;
    local.translation = vec(translation);
    local.rotation = {rotation.w, rotation.x, rotation.y, rotation.z};
    local.scale = vec(scale);
    return local;
  }

  void place_camera_and_light(const aiNode& node, std::uint32_t at) {
    for (unsigned c = 0; c < from_.mNumCameras && !model_.lens; ++c) {
      const aiCamera& camera = *from_.mCameras[c];
      if (camera.mName != node.mName) continue;
      // assimp's importers give the whole angle here, whatever its documentation says.
      const double across = camera.mHorizontalFOV,
                   aspect = camera.mAspect > 0.0f ? camera.mAspect : 4.0 / 3.0;
      Lens lens;
      if (across > kLeastAngle && across < 3.1) {
        lens.fov_y = static_cast<float>(2.0 * std::atan(std::tan(0.5 * across) / aspect));
      } else {
        model_.notes.add(fmt::format("the camera's angle is lost; {:.2g} rad stand for it", lens.fov_y));
      }
      lens.eye = vec(camera.mPosition);
      lens.forward = vec(camera.mLookAt);
      lens.up = vec(camera.mUp);
      model_.lens = {at, lens};
    }
    for (unsigned l = 0; l < from_.mNumLights; ++l)
      if (from_.mLights[l]->mName == node.mName) place_light(*from_.mLights[l], at);
  }

  void place_light(const aiLight& light, std::uint32_t at) {
    if (light.mType == aiLightSource_AMBIENT || light.mType == aiLightSource_AREA ||
        light.mType == aiLightSource_UNDEFINED)
      return model_.notes.drop("ambient and area lights");
    Lamp lamp;
    lamp.p = vec(light.mPosition);
    lamp.axis = vec(light.mDirection);
    lamp.directional = light.mType == aiLightSource_DIRECTIONAL;
    // At unit distance; the rest of the fall-off is that of nature.
    const float sum = light.mAttenuationConstant + light.mAttenuationLinear + light.mAttenuationQuadratic;
    const float fall_off = lamp.directional || !(sum > 0.0f) ? 1.0f : sum;
    for (int c = 0; c < 3; ++c) {
      const float value = colour(light.mColorDiffuse)[c] / fall_off;
      lamp.intensity[c] = std::isfinite(value) ? std::max(value, 0.0f) : 0.0f;
      if (lamp.intensity[c] > kMostIntensity)
        fail(fmt::format("has a light '{}' of intensity {:.3g}; give each channel 0 to {}",
                         short_name(light.mName.C_Str()), lamp.intensity[c], kMostIntensity));
    }
    if (light.mType == aiLightSource_SPOT) {
      const float outer = std::clamp(0.5f * light.mAngleOuterCone, 0.0f, 3.14159f);
      lamp.cos_outer = std::cos(outer);
      lamp.cos_inner = std::cos(std::clamp(0.5f * light.mAngleInnerCone, 0.0f, outer));
    }
    model_.lamps.push_back({at, lamp});
  }

  void read_animation(const aiAnimation& animation) {
    if (animation.mNumMorphMeshChannels > 0) model_.notes.drop("morph targets");
    const double rate = animation.mTicksPerSecond > 0.0 ? animation.mTicksPerSecond : 25.0;
    for (unsigned c = 0; c < animation.mNumChannels; ++c) {
      const aiNodeAnim& moves = *animation.mChannels[c];
      const auto node = node_of_.find(moves.mNodeName.C_Str());
      if (node == node_of_.end()) continue;
      const auto vec4 = [](const auto& key) { return glm::dvec4(vec(key.mValue), 0.0); };
      read_keys(node->second, Path::translation, moves.mPositionKeys, moves.mNumPositionKeys, rate, vec4);
      read_keys(node->second, Path::scale, moves.mScalingKeys, moves.mNumScalingKeys, rate, vec4);
      read_keys(
          node->second, Path::rotation, moves.mRotationKeys, moves.mNumRotationKeys, rate,
          [](const aiQuatKey& k) { return glm::dvec4(k.mValue.x, k.mValue.y, k.mValue.z, k.mValue.w); });
    }
  }

  template <class Key, class Value>
  void read_keys(std::uint32_t node, Path path, const Key* keys, unsigned count, double rate, Value value) {
    Channel channel{node, path, Interpolation::linear, {}, {}};
    for (unsigned k = 0; k < count; ++k) {
      const double seconds = keys[k].mTime / rate;
      const glm::dvec4 v = value(keys[k]);
      if (!std::isfinite(seconds) || !std::isfinite(v.x + v.y + v.z + v.w))
        fail("has an animation key that is not finite");
      if (!channel.times.empty() && seconds <= channel.times.back()) continue;
      channel.times.push_back(seconds);
      channel.values.push_back(v);
    }
    if (!channel.times.empty() && !model_.rig.animate(std::move(channel)))
      model_.notes.add("two animations move the same node; the first does");
  }

  const aiScene& from_;
  std::filesystem::path folder_;
  std::string format_;  // assimp's name for what reads it
  Model model_;
  std::map<std::string, std::uint32_t> textures_;  // by path
  Without absent_, foreign_;
  std::vector<Painting> paintings_;               // by material
  std::map<std::string, std::uint32_t> node_of_;  // by name
  std::size_t texels_ = 0;
};

}  // namespace

Model read_with_assimp(const std::filesystem::path& file) {
  Assimp::Importer importer;
  const std::string extension = file.extension().string();
  // Without an extension assimp looks at how the file begins.
  if (!extension.empty() && !importer.IsExtensionSupported(extension))
    throw std::runtime_error(
        fmt::format("{}: no scene format is known by the extension '{}'; convert the scene to glTF",
                    file.string(), extension));
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  if (error) throw std::runtime_error(fmt::format("cannot read '{}': {}", file.string(), error.message()));
  const auto read = [&]() -> std::string {
    const LibraryCall call;
    if (importer.ReadFile(file.string(), kSteps)) return {};
    const std::string said = importer.GetErrorString();
    if (said == std::bad_alloc().what()) return kTooMuchMemory;
    if (said.starts_with("No suitable reader"))
      return "is of no scene format that is known; convert the scene to glTF";
    return said.empty() ? "cannot be read" : said;
  };
  std::string trouble = try_apart(read, std::max<std::size_t>(kMemory, kMemoryPerByte * size),
                                  kSeconds + static_cast<unsigned>(size / kBytesPerSecond));
  if (trouble.empty()) trouble = read();
  if (!trouble.empty()) throw std::runtime_error(fmt::format("{}: {}", file.string(), trouble));
  return AssimpReader(*importer.GetScene(), file).read();
}

}  // namespace icbench::importing
