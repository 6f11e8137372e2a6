// Scene files made by the tests that read them: glTF as text or binary, images, small models.
#pragma once

#include <stb_image_write.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace icbench {

inline std::string base64(std::string_view bytes) {
  constexpr std::string_view kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
      bits = bits << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? kAlphabet[bits >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

inline void write(const std::filesystem::path& path, std::string_view bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

/// A glTF document in the making; every accessor has a buffer view of its own.
struct GltfFile {
  nlohmann::json doc = {
      {"asset", {{"version", "2.0"}}}, {"scene", 0}, {"scenes", {{{"nodes", nlohmann::json::array()}}}}};
  std::string binary;

  static std::size_t append(nlohmann::json& to, nlohmann::json element) {
    to.push_back(std::move(element));
    return to.size() - 1;
  }

  std::size_t view(std::string_view bytes) {
    while (binary.size() % 4 != 0) binary += '\0';
    const std::size_t offset = binary.size();
    binary += bytes;
    return append(doc["bufferViews"], {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes.size()}});
  }

  template <class T>
  std::size_t accessor(const std::vector<T>& values, const char* type, std::size_t components,
                       int component_type) {
    const std::string_view bytes(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    return append(doc["accessors"], {{"bufferView", view(bytes)},
                                     {"componentType", component_type},
                                     {"count", values.size() / components},
                                     {"type", type}});
  }
  std::size_t scalars(const std::vector<float>& v) { return accessor(v, "SCALAR", 1, 5126); }
  std::size_t vec2s(const std::vector<float>& v) { return accessor(v, "VEC2", 2, 5126); }
  std::size_t vec3s(const std::vector<float>& v) { return accessor(v, "VEC3", 3, 5126); }
  std::size_t vec4s(const std::vector<float>& v) { return accessor(v, "VEC4", 4, 5126); }
  std::size_t indices(const std::vector<std::uint16_t>& v) { return accessor(v, "SCALAR", 1, 5123); }

  /// Adds a root node.
  std::size_t node(nlohmann::json node) {
    const std::size_t index = append(doc["nodes"], std::move(node));
    doc["scenes"][0]["nodes"].push_back(index);
    return index;
  }
  std::size_t material(nlohmann::json material) { return append(doc["materials"], std::move(material)); }
  std::size_t mesh(std::size_t positions, std::size_t triangles, std::size_t with_material) {
    return append(doc["meshes"], {{"primitives",
                                   {{{"attributes", {{"POSITION", positions}}},
                                     {"indices", triangles},
                                     {"material", with_material}}}}});
  }
  /// A unit square in the plane z = 0 that faces +z.
  std::size_t square(std::size_t with_material) {
    const auto positions = vec3s({-0.5f, -0.5f, 0, 0.5f, -0.5f, 0, 0.5f, 0.5f, 0, -0.5f, 0.5f, 0});
    return mesh(positions, indices({0, 1, 2, 0, 2, 3}), with_material);
  }
  /// A unit cube around the origin.
  std::size_t cube(std::size_t with_material, bool inward = false) {
    std::vector<float> corners;
    for (int c = 0; c < 8; ++c)
      for (int axis = 0; axis < 3; ++axis) corners.push_back(c >> axis & 1 ? 0.5f : -0.5f);
    std::vector<std::uint16_t> faces = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                        2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    if (inward)
      for (std::size_t i = 0; i < faces.size(); i += 3) std::swap(faces[i + 1], faces[i + 2]);
    const auto positions = vec3s(corners);
    return mesh(positions, indices(faces), with_material);
  }
  /// Moves a property of a node through values at times.
  void animate(std::size_t node, const char* path, std::size_t times, std::size_t values,
               const char* interpolation = "LINEAR") {
    if (!doc.contains("animations"))
      doc["animations"] = {{{"channels", nlohmann::json::array()}, {"samplers", nlohmann::json::array()}}};
    nlohmann::json& animation = doc["animations"][0];
    const std::size_t sampler = append(
        animation["samplers"], {{"input", times}, {"output", values}, {"interpolation", interpolation}});
    animation["channels"].push_back({{"sampler", sampler}, {"target", {{"node", node}, {"path", path}}}});
  }

  /// As .gltf, with the buffer inside.
  std::string text() const {
    nlohmann::json whole = doc;
    if (!binary.empty())
      whole["buffers"] = {
          {{"byteLength", binary.size()}, {"uri", "data:application/octet-stream;base64," + base64(binary)}}};
    return whole.dump(1);
  }
  /// As .glb.
  std::string glb() const {
    nlohmann::json whole = doc;
    whole["buffers"] = {{{"byteLength", binary.size()}}};
    std::string json = whole.dump(), body = binary;
    while (json.size() % 4 != 0) json += ' ';
    while (body.size() % 4 != 0) body += '\0';
    const auto word = [](std::size_t value) {
      std::string bytes;
      for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> 8 * i & 0xff);
      return bytes;
    };
    return "glTF" + word(2) + word(28 + json.size() + body.size()) + word(json.size()) + "JSON" + json +
           word(body.size()) + std::string("BIN\0", 4) + body;
  }
};

/// An image of 8 x 8 texels in four quarters: red, green above; blue, white below.
inline std::vector<unsigned char> quarters() {
  std::vector<unsigned char> texels;
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 8; ++x) {
      const bool right = x >= 4, low = y >= 4;
      texels.push_back(right == low ? 255 : 0);
      texels.push_back(right ? 255 : 0);
      texels.push_back(low ? 255 : 0);
    }
  return texels;
}

inline void append_bytes(void* to, void* data, int size) {
  static_cast<std::string*>(to)->append(static_cast<const char*>(data), static_cast<std::size_t>(size));
}
inline std::string quarters_png() {
  std::string bytes;
  stbi_write_png_to_func(append_bytes, &bytes, 8, 8, 3, quarters().data(), 24);
  return bytes;
}
inline std::string quarters_jpeg() {
  std::string bytes;
  stbi_write_jpg_to_func(append_bytes, &bytes, 8, 8, 3, quarters().data(), 100);
  return bytes;
}

/// A room of 4 x 3 x 4 m, open to the camera, under a square lamp, with a textured picture; one cube spins
/// for two seconds, another one of the same mesh circles it.
inline GltfFile spinning_cube() {
  GltfFile f;
  f.doc["extensionsUsed"] = {"KHR_lights_punctual", "KHR_materials_emissive_strength"};
  f.doc["images"] = {{{"bufferView", f.view(quarters_png())}, {"mimeType", "image/png"}}};
  f.doc["textures"] = {{{"source", 0}}};
  const auto grey = f.material(
      {{"pbrMetallicRoughness", {{"baseColorFactor", {0.7, 0.7, 0.7, 1}}, {"metallicFactor", 0}}}});
  const auto orange = f.material(
      {{"pbrMetallicRoughness", {{"baseColorFactor", {0.8, 0.4, 0.1, 1}}, {"metallicFactor", 0}}}});
  const auto lamp =
      f.material({{"emissiveFactor", {1, 1, 0.8}},
                  {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 20}}}}}});
  const auto painted = f.material({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  f.node(
      {{"name", "room"}, {"mesh", f.cube(grey, true)}, {"translation", {0, 1.5, 0}}, {"scale", {4, 3, 4}}});
  f.node({{"name", "lamp"},
          {"mesh", f.square(lamp)},
          {"translation", {0, 2.95, 0}},
          {"rotation", {std::sqrt(0.5), 0, 0, std::sqrt(0.5)}}});
  const auto picture = f.square(painted);
  f.doc["meshes"][picture]["primitives"][0]["attributes"]["TEXCOORD_0"] = f.vec2s({0, 1, 1, 1, 1, 0, 0, 0});
  f.node({{"name", "picture"}, {"mesh", picture}, {"translation", {0, 1.5, -1.98}}});
  const auto cube = f.cube(orange);
  const auto spinner = f.node({{"name", "spinner"}, {"mesh", cube}, {"translation", {0, 0.6, 0}}});
  const auto circling = GltfFile::append(
      f.doc["nodes"],
      {{"name", "circling"}, {"mesh", cube}, {"translation", {1.2, 0.3, 0}}, {"scale", {0.4, 0.4, 0.4}}});
  const auto axle = f.node({{"name", "axle"}, {"children", {circling}}});
  f.doc["cameras"] = {
      {{"type", "perspective"}, {"perspective", {{"yfov", 0.9}, {"aspectRatio", 1.33}, {"znear", 0.1}}}}};
  f.node({{"name", "eye"},
          {"camera", 0},
          {"translation", {0, 1.5, 1.95}},
          {"rotation", {-0.1, 0, 0, std::sqrt(0.99)}}});
  f.doc["extensions"] = {{"KHR_lights_punctual",
                          {{"lights", {{{"type", "point"}, {"intensity", 3}, {"color", {1, 0.5, 0.25}}}}}}}};
  f.node({{"name", "bulb"},
          {"extensions", {{"KHR_lights_punctual", {{"light", 0}}}}},
          {"translation", {-1, 2, 1}}});
  const auto times = f.scalars({0, 1, 2});
  const float h = std::sqrt(0.5f);
  f.animate(spinner, "rotation", times, f.vec4s({0, 0, 0, 1, 0, h, 0, h, 0, 1, 0, 0}));
  f.animate(axle, "rotation", times, f.vec4s({0, 0, 0, 1, 0, -1, 0, 0, 0, 0, 0, -1}));
  return f;
}

/// A room with one of everything that .rad files are read for.
inline const char* const kRadianceRoom = R"(# a room
void plastic walls
0
0
5 .6 .6 .6 0 0
void alias paint walls
void light lamp_light
0
0
3 10 10 8
void metal chrome
0
0
5 .9 .9 .9 .9 .01
void glass pane
0
0
3 .96 .96 .96
paint polygon floor
0
0
12 0 0 0  4 0 0  4 4 0  0 4 0
lamp_light ring lamp
0
0
8 2 2 2.9  0 0 -1  0 .5
chrome sphere ball
0
0
4 1 1 .5 .5
walls cylinder pole
0
0
7 3 3 0 3 3 2 .1
walls cone hat
0
0
8 3 1 0 3 1 1 .5 0
pane polygon window
0
0
12 0 2 1  0 3 1  0 3 2  0 2 2
# view -vtv -vp 2 -6 1.6 -vd 0 1 0 -vu 0 0 1 -vh 40 -vv 35
)";

}  // namespace icbench
