// glTF 2.0, text and binary (Khronos, "glTF 2.0 Specification").
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/gtc/type_ptr.hpp>
#include <map>
#include <numbers>
#include <set>
#include <stdexcept>
#include <string>

#include "scene/import_gltf_data.h"
#include "scene/import_gltf_material.h"
#include "scene/import_json.h"
#include "scene/import_model.h"
#include "scene/import_text.h"

namespace icbench::importing {
namespace {

// What a file may require and be read all the same; what is not read of it is named where it is used.
constexpr std::array<std::string_view, 14> kKnownExtensions = {
    "KHR_lights_punctual",       "KHR_materials_emissive_strength",
    "KHR_materials_ior",         "KHR_materials_transmission",
    "KHR_materials_volume",      "KHR_materials_unlit",
    "KHR_materials_specular",    "KHR_materials_clearcoat",
    "KHR_materials_sheen",       "KHR_texture_transform",
    "KHR_mesh_quantization",     "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_iridescence", "KHR_materials_anisotropy"};

constexpr const char* kInstancing = "EXT_mesh_gpu_instancing";  // named where it is used, too

constexpr std::size_t kMaxPlaced = 1'000'000;
// Channels may share a sampler, and each keeps its keys: most of these, beyond those that the file's bytes hold.
constexpr std::size_t kMostSharedKeys = 1'000'000, kBytesPerKey = 4 + 6;

struct Chunks {
  std::string_view json, binary;
};

std::uint32_t little_endian(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 4; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

// The parts of a file, binary or not.
Chunks chunks_of(std::string_view bytes) {
  if (!bytes.starts_with("glTF")) return {bytes, {}};
  if (bytes.size() < 20) throw std::runtime_error("the header ends too early");
  if (const std::uint32_t version = little_endian(bytes, 4); version != 2)
    throw std::runtime_error(
        fmt::format("is binary glTF {}; of binary files 2 is read, convert it", version));
  Chunks chunks;
  std::size_t at = 12;
  // Chunks begin within the length that the header states; other bytes may follow them.
  const std::size_t end = std::min<std::size_t>(bytes.size(), std::max(little_endian(bytes, 8), 13u));
  while (at < end) {
    if (bytes.size() - at < 8 || little_endian(bytes, at) > bytes.size() - at - 8)
      throw std::runtime_error(fmt::format("the chunk at byte {} ends too early", at));
    const std::size_t length = little_endian(bytes, at);
    const std::string_view type = bytes.substr(at + 4, 4), body = bytes.substr(at + 8, length);
    if (at == 12) {
      if (type != "JSON") throw std::runtime_error("the first chunk is not JSON");
      chunks.json = body;
    } else if (type == std::string_view("BIN\0", 4) && chunks.binary.empty()) {
      chunks.binary = body;
    }
    at += 8 + length;
  }
  return chunks;
}

class GltfReader {
 public:
  GltfReader(const Element& document, std::string_view binary, const std::filesystem::path& file)
      : document_(document), data_(document, binary, file) {
    model_.file = file.string();
  }

  Model read() {
    check_extensions();
    uses_ = read_gltf_materials(document_, data_, model_);
    read_nodes();
    read_animations();
    if (cameras_ > 1) model_.notes.add(fmt::format("has {} cameras; the first is used", cameras_));
    return std::move(model_);
  }

 private:
  void check_extensions() {
    const auto known = [](const std::string& name) {
      return std::find(kKnownExtensions.begin(), kKnownExtensions.end(), name) != kKnownExtensions.end();
    };
    for (std::size_t i = 0; i < document_.items("extensionsRequired"); ++i) {
      const Element name = document_.at("extensionsRequired")[i];
      if (!known(name.text()))
        name.fail(fmt::format("is {}, which is not read; export the scene without it", name.text()));
    }
    std::set<std::string> unknown;
    for (std::size_t i = 0; i < document_.items("extensionsUsed"); ++i) {
      const std::string name = document_.at("extensionsUsed")[i].text();
      if (known(name) || name == kInstancing || !unknown.insert(name).second) continue;
      if (unknown.size() <= kMostNamed) model_.notes.drop(name);
    }
    if (unknown.size() > kMostNamed)
      model_.notes.drop(fmt::format("{} more extensions", unknown.size() - kMostNamed));
  }

  // From the roots down, without recursion, each node once.
  void read_nodes() {
    const std::size_t count = document_.items("nodes");
    node_of_.assign(count, -1);
    struct Step {
      std::uint32_t node;
      int parent;
    };
    std::vector<Step> left;
    if (document_.items("scenes") > 1) model_.notes.drop("scenes beside the one that is shown");
    for (const std::uint32_t root : roots(count)) left.push_back({root, -1});
    std::reverse(left.begin(), left.end());
    while (!left.empty()) {
      const Step step = left.back();
      left.pop_back();
      const Element node = document_.at("nodes")[step.node];
      if (node_of_[step.node] >= 0) node.fail("is reached twice; give each node one parent");
      const auto added =
          static_cast<int>(model_.rig.add(node.text("name", node.place()), step.parent, local(node)));
      node_of_[step.node] = added;
      place(node, static_cast<std::uint32_t>(added));
      for (std::size_t i = node.items("children"); i-- > 0;)
        left.push_back({node.at("children")[i].index(count), added});
    }
  }

  std::vector<std::uint32_t> roots(std::size_t count) const {
    std::vector<std::uint32_t> roots;
    if (const std::size_t scenes = document_.items("scenes"); scenes > 0) {
      const auto chosen = document_.find("scene");
      const Element scene = document_.at("scenes")[chosen ? chosen->index(scenes) : 0];
      for (std::size_t i = 0; i < scene.items("nodes"); ++i)
        roots.push_back(scene.at("nodes")[i].index(count));
      return roots;
    }
    std::vector<bool> child(count);
    for (std::size_t n = 0; n < count; ++n) {
      const Element node = document_.at("nodes")[n];
      for (std::size_t i = 0; i < node.items("children"); ++i)
        child[node.at("children")[i].index(count)] = true;
    }
    for (std::size_t n = 0; n < count; ++n)
      if (!child[n]) roots.push_back(static_cast<std::uint32_t>(n));
    return roots;
  }

  static Local local(const Element& node) {
    Local local;
    double m[16];
    if (node.numbers("matrix", m, 16)) {
      local.matrix = glm::make_mat4(m);
      return local;
    }
    double r[4] = {0.0, 0.0, 0.0, 1.0};
    node.numbers("translation", glm::value_ptr(local.translation), 3);
    node.numbers("scale", glm::value_ptr(local.scale), 3);
    if (node.numbers("rotation", r, 4)) {
      const double length = std::sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3]);
      if (!(length > 0.0 && std::isfinite(length))) node.at("rotation").fail("is no quaternion of length 1");
      local.rotation = glm::dquat(r[3] / length, r[0] / length, r[1] / length, r[2] / length);
    }
    return local;
  }

  // What stands at a node.
  void place(const Element& node, std::uint32_t at) {
    if (node.has("skin")) model_.notes.drop("skinning");
    if (const auto mesh = node.find("mesh"))
      for (const std::uint32_t shape : shapes(mesh->index(document_.items("meshes"))))
        model_.placed_shapes.push_back({at, shape});
    if (model_.placed_shapes.size() > kMaxPlaced)
      node.fail(fmt::format("is one too many: more than {} meshes are shown", kMaxPlaced));
    if (const auto camera = node.find("camera")) {
      const Element cameras = document_.at("cameras");
      place_camera(cameras[camera->index(cameras.size())], at);
    }
    if (const auto extensions = node.find("extensions")) {
      if (const auto light = extensions->find("KHR_lights_punctual")) {
        const Element lights = document_.at("extensions").at("KHR_lights_punctual").at("lights");
        place_light(lights[light->at("light").index(lights.size())], at);
      }
      if (extensions->has(kInstancing)) model_.notes.drop(kInstancing);
    }
  }

  void place_camera(const Element& camera, std::uint32_t at) {
    if (camera.at("type").text() != "perspective") return model_.notes.drop("orthographic cameras");
    const Element yfov = camera.at("perspective").at("yfov");
    if (!(yfov.number() > 1e-3 && yfov.number() < 3.14)) yfov.fail("must be an angle between 0.001 and 3.14");
    if (cameras_++ == 0) model_.lens = {at, Lens{.fov_y = static_cast<float>(yfov.number())}};
  }

  void place_light(const Element& light, std::uint32_t at) {
    const std::string type = light.at("type").text();
    double colour[3] = {1.0, 1.0, 1.0};
    light.numbers("color", colour, 3);
    const double intensity = light.number("intensity", 1.0);
    Lamp lamp;
    for (int c = 0; c < 3; ++c) {
      const double of_channel = intensity * std::max(colour[c], 0.0);
      if (!(of_channel >= 0.0 && of_channel <= kMostIntensity))
        light.fail(
            fmt::format("has an intensity of {:.3g}; give each channel 0 to {}", of_channel, kMostIntensity));
      lamp.intensity[c] = static_cast<float>(of_channel);
    }
    lamp.directional = type == "directional";
    if (type == "spot") {
      const Element spot = light.at("spot");
      const double outer =
          std::clamp(spot.number("outerConeAngle", 0.25 * std::numbers::pi), 0.0, std::numbers::pi);
      const double inner = std::clamp(spot.number("innerConeAngle", 0.0), 0.0, outer);
      lamp.cos_inner = static_cast<float>(std::cos(inner));
      lamp.cos_outer = static_cast<float>(std::cos(outer));
    } else if (type != "point" && !lamp.directional) {
      light.at("type").fail(fmt::format("is '{}'; point, spot and directional lights are known", type));
    }
    if (light.has("range")) model_.notes.drop("ranges of lights");
    model_.lamps.push_back({at, lamp});
  }

  // The shapes of a mesh, read when a node first shows it.
  const std::vector<std::uint32_t>& shapes(std::uint32_t index) {
    const auto [known, first] = shapes_of_.try_emplace(index);
    if (!first) return known->second;
    const Element mesh = document_.at("meshes")[index];
    const Element primitives = mesh.at("primitives");
    for (std::size_t i = 0; i < primitives.size(); ++i) {
      Shape shape;
      shape.name = short_name(mesh.text("name", mesh.place()));
      if (!read_primitive(primitives[i], shape)) continue;
      known->second.push_back(static_cast<std::uint32_t>(model_.shapes.size()));
      model_.shapes.push_back(std::move(shape));
    }
    return known->second;
  }

  bool read_primitive(const Element& primitive, Shape& shape) {
    const std::uint64_t mode = primitive.whole("mode", 4);
    if (mode > 6) primitive.at("mode").fail(fmt::format("is {}; modes are 0 to 6", mode));
    if (mode < 4) {
      model_.notes.drop("points and lines");
      return false;
    }
    const Element attributes = primitive.at("attributes");
    if (!attributes.has("POSITION")) {
      model_.notes.drop("primitives without positions");
      return false;
    }
    if (primitive.has("targets")) model_.notes.drop("morph targets");
    if (attributes.has("COLOR_0")) model_.notes.drop("vertex colours");
    const auto material = primitive.find("material");
    shape.material =
        material ? material->index(uses_.size() - 1) : static_cast<std::uint32_t>(uses_.size() - 1);

    std::size_t count = 0;
    const std::vector<float> p = data_.floats(attributes.at("POSITION"), 3, count);
    vertices_ += count;
    if (vertices_ > kMaxVertices)
      primitive.fail(fmt::format("is one too many: all have more than {} vertices", kMaxVertices));
    for (std::size_t v = 0; v < count; ++v)
      shape.positions.emplace_back(p[3 * v], p[3 * v + 1], p[3 * v + 2]);
    if (const auto normals = attributes.find("NORMAL")) {
      const std::vector<float> n = of_each_vertex(*normals, 3, count);
      for (std::size_t v = 0; v < count; ++v)
        shape.normals.emplace_back(n[3 * v], n[3 * v + 1], n[3 * v + 2]);
    }
    read_uvs(attributes, uses_[shape.material], count, shape);
    read_triangles(primitive, mode, count, shape);
    return true;
  }

  std::vector<float> of_each_vertex(const Element& attribute, int components, std::size_t count) const {
    std::size_t own = 0;
    std::vector<float> values = data_.floats(attribute, components, own);
    if (own != count) attribute.fail(fmt::format("has {} elements for {} vertices", own, count));
    return values;
  }

  void read_uvs(const Element& attributes, const TextureUse& use, std::size_t count, Shape& shape) {
    if (!use.used) return;
    const auto set = attributes.find(fmt::format("TEXCOORD_{}", use.set).c_str());
    if (!set) model_.notes.drop(kNoCoordinates);
    const std::vector<float> uv = set ? of_each_vertex(*set, 2, count) : std::vector<float>(2 * count);
    for (std::size_t v = 0; v < count; ++v)
      shape.uvs.emplace_back(glm::dvec2(use.transform * glm::dvec3(uv[2 * v], uv[2 * v + 1], 1.0)));
  }

  void read_triangles(const Element& primitive, std::uint64_t mode, std::size_t count, Shape& shape) {
    const auto accessor = primitive.find("indices");
    std::vector<std::uint32_t> indices;
    if (accessor) {
      indices = data_.indices(*accessor);
      for (std::size_t i = 0; i < indices.size(); ++i)
        if (indices[i] >= count)
          accessor->fail(fmt::format("names vertex {} of {} at {}", indices[i], count, i));
    } else {
      for (std::size_t v = 0; v < count; ++v) indices.push_back(static_cast<std::uint32_t>(v));
    }
    const std::size_t n = indices.size();
    triangles_ += mode == 4 ? n / 3 : n;
    if (triangles_ > kMaxVertices)
      primitive.fail(fmt::format("is one too many: all have more than {} triangles", kMaxVertices));
    if (mode == 4)
      for (std::size_t i = 0; i + 2 < n; i += 3)
        shape.triangles.emplace_back(indices[i], indices[i + 1], indices[i + 2]);
    if (mode == 5)
      for (std::size_t i = 0; i + 2 < n; ++i)
        shape.triangles.emplace_back(indices[i], indices[i + 1 + i % 2], indices[i + 2 - i % 2]);
    if (mode == 6)
      for (std::size_t i = 1; i + 1 < n; ++i)
        shape.triangles.emplace_back(indices[i], indices[i + 1], indices[0]);
  }

  void read_animations() {
    const std::size_t count = document_.items("animations");
    if (count > 1) model_.notes.add(fmt::format("has {} animations; they are played at once", count));
    for (std::size_t a = 0; a < count; ++a) {
      const Element animation = document_.at("animations")[a];
      const Element channels = animation.at("channels");
      for (std::size_t c = 0; c < channels.size(); ++c) read_channel(channels[c], animation.at("samplers"));
    }
  }

  void read_channel(const Element& channel, const Element& samplers) {
    const Element target = channel.at("target");
    const std::string path = target.at("path").text();
    if (path == "weights") return model_.notes.drop("morph targets");
    if (!target.has("node")) return model_.notes.drop("animations of other things than nodes");
    const std::uint32_t node = target.at("node").index(node_of_.size());
    if (document_.at("nodes")[node].has("matrix")) target.fail("moves a node that has a matrix");
    Channel to;
    if (path == "rotation") to.path = Path::rotation;
    if (path == "scale") to.path = Path::scale;
    if (to.path == Path::translation && path != "translation")
      target.at("path").fail(fmt::format("is '{}'; translation, rotation and scale are known", path));
    const Element sampler = samplers[channel.at("sampler").index(samplers.size())];
    const std::string way = sampler.text("interpolation", "LINEAR");
    if (way != "LINEAR" && way != "STEP" && way != "CUBICSPLINE")
      sampler.at("interpolation").fail(fmt::format("is '{}'; LINEAR, STEP and CUBICSPLINE are known", way));
    to.interpolation = way == "STEP"          ? Interpolation::step
                       : way == "CUBICSPLINE" ? Interpolation::cubic
                                              : Interpolation::linear;
    std::size_t keys = 0, values = 0;
    const std::vector<float> times = data_.floats(sampler.at("input"), 1, keys);
    const int components = to.path == Path::rotation ? 4 : 3;
    const std::vector<float> v = data_.floats(sampler.at("output"), components, values);
    keys_ += keys;
    if (keys_ > kMostSharedKeys + data_.bytes() / kBytesPerKey)
      channel.fail("is one too many: channels share more keys than its file can hold; bake it anew");
    if (keys == 0 || values != keys * (to.interpolation == Interpolation::cubic ? 3 : 1))
      sampler.fail(fmt::format("has {} values for {} times", values, keys));
    for (std::size_t k = 0; k < keys; ++k) {
      if (times[k] < 0.0f)
        sampler.at("input").fail(fmt::format("is negative at key {}; let times begin at 0", k));
      if (k > 0 && times[k] <= times[k - 1])
        sampler.at("input").fail(fmt::format("does not increase at key {}", k));
      to.times.push_back(times[k]);
    }
    const auto n = static_cast<std::size_t>(components);
    for (std::size_t k = 0; k < values; ++k)
      to.values.emplace_back(v[n * k], v[n * k + 1], v[n * k + 2], n == 4 ? v[4 * k + 3] : 0.0f);
    if (node_of_[node] < 0) return;  // not in this scene
    to.node = static_cast<std::uint32_t>(node_of_[node]);
    if (!model_.rig.animate(std::move(to)))
      model_.notes.add("two animations move the same node; the first does");
  }

  const Element& document_;
  GltfData data_;
  Model model_;
  std::vector<TextureUse> uses_;  // by material
  std::vector<int> node_of_;      // from the file's nodes to the rig's; -1: not in this scene
  std::map<std::uint32_t, std::vector<std::uint32_t>> shapes_of_;  // by mesh
  std::size_t vertices_ = 0, triangles_ = 0;
  int cameras_ = 0;
  std::size_t keys_ = 0;  // of all channels
};

}  // namespace

Model read_gltf(const std::filesystem::path& file, const std::string& bytes) {
  try {
    const Chunks chunks = chunks_of(bytes);
    const nlohmann::json json = parse_json(chunks.json);
    const Element document(json, "");
    const Element version = document.at("asset").at("version");
    const bool is_old =
        json["asset"]["version"] == 1 || version.text().starts_with("1.");  // a number, in some
    if (!is_old && !version.text().starts_with("2."))
      version.fail(fmt::format("is '{}'; 1.0 and 2.0 are read, convert the file to 2.0", version.text()));
    if (!is_old) return GltfReader(document, chunks.binary, file).read();
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  }
  return read_with_assimp(file);
}

}  // namespace icbench::importing
