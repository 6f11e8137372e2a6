#include "scene/import_gltf_material.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>

namespace icbench::importing {
namespace {

constexpr std::uint64_t kRepeat = 10497;  // the only wrap mode that Texture has
constexpr double kSmooth = 0.1;           // up to that roughness metals are mirrors
constexpr std::uint64_t kNearest = 9728;  // a filter that it has not

std::optional<Element> extension(const Element& element, const char* name) {
  const auto all = element.find("extensions");
  return all ? all->find(name) : std::nullopt;
}

class MaterialReader {
 public:
  MaterialReader(const Element& document, const GltfData& data, Model& model)
      : document_(document), data_(data), model_(model) {}

  TextureUse read(const Element& material) {
    Surfacing to;
    Material& m = to.material;
    double colour[4] = {1.0, 1.0, 1.0, 1.0}, metallic = 1.0, roughness = 1.0;
    std::optional<Element> texture;
    if (const auto pbr = material.find("pbrMetallicRoughness")) {
      pbr->numbers("baseColorFactor", colour, 4);
      metallic = pbr->number("metallicFactor", 1.0);
      roughness = pbr->number("roughnessFactor", 1.0);
      texture = with_picture(pbr->find("baseColorTexture"));
      if (pbr->has("metallicRoughnessTexture"))
        model_.notes.drop("metallic-roughness textures (factors count)");
    } else if (const auto older = extension(material, "KHR_materials_pbrSpecularGlossiness")) {
      older->numbers("diffuseFactor", colour, 4);
      metallic = 0.0;
      texture = with_picture(older->find("diffuseTexture"));
    }
    for (int c = 0; c < 3; ++c) m.albedo[c] = static_cast<float>(std::clamp(colour[c], 0.0, 1.0));
    m.emission = emission(material);
    note_dropped(material, m.emits());
    const Kind kind = surface(material, colour[3], metallic, roughness);
    if (!m.emits()) {
      m.surface = kind.surface;
      to.thin = kind.is_thin;
    }
    if (m.surface == Surface::dielectric) m.ior = index_of_refraction(material);
    TextureUse use;
    if (texture && m.surface == Surface::diffuse) {
      use = texture_use(*texture, m.texture);
    } else if (texture) {
      model_.notes.add("base-colour textures of mirrors and glass count by their mean colour");
      m.albedo *= mean(texture_index(*texture));
    }
    // As much of what is behind it shows as its own colour leaves, and none of that.
    if (m.surface == Surface::dielectric && kind.is_blended)
      m.albedo = glm::mix(glm::vec3(1.0f), m.albedo, static_cast<float>(std::clamp(colour[3], 0.0, 1.0)));
    // A share for each of the two sheets.
    if (to.thin) m.albedo = glm::sqrt(m.albedo);
    model_.materials.push_back(to);
    return use;
  }

 private:
  void note_dropped(const Element& material, bool emits) {
    if (material.has("normalTexture")) model_.notes.drop("normal maps");
    if (material.has("occlusionTexture")) model_.notes.drop("occlusion maps");
    if (material.text("alphaMode", "OPAQUE") == "MASK") model_.notes.drop("cut-outs by alpha");
    const auto doubled = material.find("doubleSided");
    if (doubled && doubled->truth() && emits)
      model_.notes.drop("light from the back of double-sided surfaces");
    const auto extensions = material.find("extensions");
    if (!extensions) return;
    if (const auto older = extensions->find("KHR_materials_pbrSpecularGlossiness")) {
      double specular[3] = {1.0, 1.0, 1.0};
      older->numbers("specularFactor", specular, 3);
      if (std::max({specular[0], specular[1], specular[2]}) > 0.0)
        model_.notes.drop("the specular part of KHR_materials_pbrSpecularGlossiness");
    }
    for (const char* name : {"KHR_materials_clearcoat", "KHR_materials_sheen", "KHR_materials_specular",
                             "KHR_materials_iridescence", "KHR_materials_anisotropy", "KHR_materials_unlit"})
      if (extensions->has(name)) model_.notes.drop(name);
    if (const auto volume = extensions->find("KHR_materials_volume"))
      if (volume->has("attenuationColor")) model_.notes.drop("absorption inside glass");
  }

  struct Kind {
    Surface surface = Surface::diffuse;
    bool is_thin = false;     // glass of two sheets
    bool is_blended = false;  // glass by alpha, not by transmission
  };
  Kind surface(const Element& material, double alpha, double metallic, double roughness) {
    double transmission = 0.0;
    if (const auto t = extension(material, "KHR_materials_transmission")) {
      transmission = t->number("transmissionFactor", 0.0) * (1.0 - metallic);
      if (t->has("transmissionTexture")) model_.notes.drop("transmission textures (factors count)");
    }
    const auto volume = extension(material, "KHR_materials_volume");
    const std::string mode = material.text("alphaMode", "OPAQUE");
    if (mode != "OPAQUE" && mode != "MASK" && mode != "BLEND")
      material.at("alphaMode").fail(fmt::format("is '{}'; OPAQUE, MASK and BLEND are known", mode));
    const bool blends = mode == "BLEND";
    if (transmission >= 0.5 || (blends && alpha < 0.5)) {
      const bool is_thin = !volume || !(volume->number("thicknessFactor", 0.0) > 0.0);
      const bool is_blended = transmission < 0.5;
      if (is_blended) model_.notes.add("surfaces that blend by alpha below 0.5 count as glass");
      if (!is_blended && roughness > kSmooth) model_.notes.drop("roughness of glass");
      return {Surface::dielectric, is_thin, is_blended};
    }
    if (blends) model_.notes.drop("blending by alpha of 0.5 or more");
    if (transmission > 0.0) model_.notes.drop("transmission below 0.5");
    if (metallic < 0.5) return {};
    if (roughness <= kSmooth) return {.surface = Surface::mirror};
    if (roughness < 1.0) model_.notes.drop("gloss of rough metals");
    return {};
  }

  float index_of_refraction(const Element& material) {
    const auto ior = extension(material, "KHR_materials_ior");
    return refracting_index(ior ? ior->number("ior", 1.5) : 1.5, model_.notes);
  }

  glm::vec3 emission(const Element& material) {
    double factor[3] = {0.0, 0.0, 0.0};
    material.numbers("emissiveFactor", factor, 3);
    const auto strength = extension(material, "KHR_materials_emissive_strength");
    const double scale = strength ? strength->number("emissiveStrength", 1.0) : 1.0;
    const glm::vec3 emitted =
        emitted_radiance(scale * glm::dvec3(factor[0], factor[1], factor[2]), model_.notes);
    if (emitted == glm::vec3(0.0f)) return emitted;
    const auto texture = with_picture(material.find("emissiveTexture"));
    if (!texture) return emitted;
    model_.notes.add("emissive textures count by their mean colour");
    return emitted * mean(texture_index(*texture));
  }

  // Of a texture; many materials may ask for it.
  const glm::vec3& mean(std::uint32_t texture) {
    const auto [known, first] = means_.try_emplace(texture);
    if (first) known->second = mean_colour(model_.textures[texture]);
    return known->second;
  }

  // None where the texture has no picture, or one that only an extension knows.
  std::optional<Element> with_picture(const std::optional<Element>& info) {
    if (!info) return std::nullopt;
    const Element textures = document_.at("textures");
    if (textures[info->at("index").index(textures.size())].has("source")) return info;
    model_.notes.drop("textures without a picture as PNG or JPEG");
    return std::nullopt;
  }

  TextureUse texture_use(const Element& info, std::uint32_t& texture) {
    texture = texture_index(info);
    TextureUse use{true, info.whole("texCoord", 0), glm::dmat3(1.0)};
    if (const auto t = extension(info, "KHR_texture_transform")) {
      double offset[2] = {0.0, 0.0}, scale[2] = {1.0, 1.0};
      t->numbers("offset", offset, 2);
      t->numbers("scale", scale, 2);
      use.set = t->whole("texCoord", use.set);
      const double angle = t->number("rotation", 0.0), cos = std::cos(angle), sin = std::sin(angle);
      use.transform = glm::dmat3(cos * scale[0], -sin * scale[0], 0.0, sin * scale[1], cos * scale[1], 0.0,
                                 offset[0], offset[1], 1.0);
    }
    // glTF counts v from the top.
    use.transform = glm::dmat3(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 1.0) * use.transform;
    return use;
  }

  // Loads a texture's image unless another one has.
  std::uint32_t texture_index(const Element& info) {
    const Element textures = document_.at("textures");
    const Element texture = textures[info.at("index").index(textures.size())];
    if (const auto sampler = texture.find("sampler")) {
      const Element s = document_.at("samplers")[sampler->whole()];
      if (s.whole("wrapS", kRepeat) != kRepeat || s.whole("wrapT", kRepeat) != kRepeat)
        model_.notes.drop("wrap modes (textures repeat)");
      if (s.whole("magFilter", 0) == kNearest)
        model_.notes.drop("nearest filtering (textures are interpolated)");
    }
    const Element images = document_.at("images");
    const std::uint32_t index = texture.at("source").index(images.size());
    const auto [known, first] =
        loaded_.try_emplace(index, static_cast<std::uint32_t>(model_.textures.size()));
    if (first) model_.textures.push_back(load(images[index]));
    return known->second;
  }

  Texture load(const Element& image) {
    const auto view = image.find("bufferView");
    const std::string bytes = view ? std::string(data_.view(*view)) : data_.load(image.at("uri"));
    try {
      Texture texture = decode_texture(bytes, image.text("name", image.place()));
      texels_ += texture.texels.size() / 3;
      if (texels_ > kMaxTexels)
        throw std::runtime_error(
            fmt::format("is one too many: all textures have more than {} texels", kMaxTexels));
      return texture;
    } catch (const std::runtime_error& error) {
      image.fail(error.what());
    }
  }

  const Element& document_;
  const GltfData& data_;
  Model& model_;
  std::map<std::uint32_t, std::uint32_t> loaded_;  // from image to texture
  std::map<std::uint32_t, glm::vec3> means_;       // by texture
  std::size_t texels_ = 0;
};

}  // namespace

std::vector<TextureUse> read_gltf_materials(const Element& document, const GltfData& data, Model& model) {
  MaterialReader reader(document, data, model);
  std::vector<TextureUse> uses;
  const std::size_t count = document.items("materials");
  for (std::size_t i = 0; i < count; ++i) uses.push_back(reader.read(document.at("materials")[i]));
  model.materials.push_back({.material = {.albedo = glm::vec3(0.8f)}});
  uses.emplace_back();
  return uses;
}

}  // namespace icbench::importing
