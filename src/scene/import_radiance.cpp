// Radiance scene descriptions as `xform -e` flattens them (Ward & Shakespeare 1998; the Radiance reference
// manual).
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>
#include <set>

#include "files/input_file.h"
#include "scene/import_model.h"
#include "scene/import_polygon.h"
#include "scene/import_radiance_shapes.h"
#include "scene/import_radiance_words.h"
#include "scene/import_text.h"

namespace icbench::importing {
namespace {

// A curved surface strays by this share of its radius, or of the scene's size if that is more.
constexpr double kChordOfRadius = 2e-3, kChordOfScene = 2e-5;

struct Primitive {
  std::string modifier, type, name;
  std::vector<std::string> words;
  std::vector<double> reals;
  std::size_t line = 1;
};

class RadianceReader {
 public:
  RadianceReader(const std::filesystem::path& file, std::string_view text)
      : file_(file), scan_(file.string(), text) {
    model_.file = file.string();
    model_.up = {0.0, 0.0, 1.0};
    model_.front = {0.0, -1.0, 0.0};
    model_.rig.add("scene", -1, {});
  }

  Model read() {
    const auto keep_view = [&](std::string_view comment) {
      const std::size_t word = comment.find_first_not_of("# \t");
      if (word == comment.npos || !comment.substr(word).starts_with("view ")) return;
      if (comment.find(" -v") == comment.npos) return;
      view_ = comment.substr(word + 4);
      view_line_ = scan_.line();
    };
    while (scan_.more(keep_view)) read_primitive();
    add_surfaces();
    for (std::uint32_t s = 0; s < model_.shapes.size(); ++s) model_.placed_shapes.push_back({0, s});
    find_view();
    if (!unknown_.empty()) model_.notes.add(listed("primitives of types that are not known:", unknown_));
    if (!grey_.empty()) model_.notes.add(listed("grey stands for the modifiers", grey_));
    return std::move(model_);
  }

 private:
  // A modifier: the material it comes to.
  struct Definition {
    std::uint32_t material = 0;
    bool invisible = false;     // void all along
    std::string grey_stands{};  // for this modifier; empty: it is known
  };
  struct Kept {
    Primitive primitive;
    std::uint32_t material;
  };

  static std::string listed(std::string line, const std::set<std::string>& names) {
    std::size_t left = kMostNamed;
    for (const std::string& name : names) {
      if (left-- == 0) return line + fmt::format(" and {} more", names.size() - kMostNamed);
      line += fmt::format(" {}", name);
    }
    return line;
  }

  void read_primitive() {
    Primitive p;
    p.modifier = scan_.word("a modifier");
    p.line = scan_.line();
    p.type = scan_.word("a type");
    p.name = scan_.word("a name");
    if (p.type == "alias") {
      const std::string of(scan_.word("the name that an alias stands for"));
      definitions_[p.name] = resolve(of);
      return;
    }
    for (std::size_t n = scan_.count("the number of strings"); n > 0; --n)
      p.words.emplace_back(scan_.word("a string argument"));
    if (scan_.count("the number of integers") != 0)
      scan_.fail(p.line, fmt::format("{} '{}' has integer arguments, which no type takes", p.type, p.name));
    for (std::size_t n = scan_.count("the number of real arguments"); n > 0; --n)
      p.reals.push_back(scan_.number("a real argument"));
    if (read_surface(p) || read_material(p)) return;
    if (p.type == "source" || p.type == "instance" || p.type == "mesh") {
      unknown_.insert(p.type);
      return;
    }
    // A pattern, texture or mixture, or a material of another kind: whatever it modifies shows through.
    unknown_.insert(p.type);
    if (p.modifier == "void") {
      definitions_[p.name] = grey(p.name);
    } else {
      definitions_[p.name] = resolve(p.modifier);
    }
  }

  [[noreturn]] void fail(const Primitive& p, const std::string& what) const {
    scan_.fail(p.line, fmt::format("{} '{}' {}", p.type, p.name, what));
  }

  void need(const Primitive& p, std::size_t least, std::size_t most) const {
    if (p.reals.size() < least || p.reals.size() > most)
      fail(p, fmt::format("has {} real arguments; it {} {}", p.reals.size(),
                          p.reals.size() < least || least == most ? "needs" : "takes at most",
                          p.reals.size() < least ? least : most));
  }

  Definition resolve(const std::string& modifier) {
    if (modifier == "void") return {.invisible = true};
    const auto known = definitions_.find(modifier);
    return known != definitions_.end() ? known->second : grey(modifier);
  }

  Definition grey(const std::string& name) {
    if (grey_material_ == ~0u) grey_material_ = add({.albedo = glm::vec3(0.5f)}, false);
    return {.material = grey_material_, .grey_stands = name};
  }

  std::uint32_t add(const Material& material, bool thin) {
    model_.materials.push_back({material, thin});
    return static_cast<std::uint32_t>(model_.materials.size() - 1);
  }

  static glm::vec3 colour(const Primitive& p) {
    glm::vec3 rgb;
    for (int c = 0; c < 3; ++c)
      rgb[c] = static_cast<float>(std::clamp(p.reals[static_cast<std::size_t>(c)], 0.0, 1.0));
    return rgb;
  }

  bool read_material(const Primitive& p) {
    Material m;
    bool thin = false;
    if (p.type == "plastic" || p.type == "metal") {
      need(p, 5, 5);
      const auto specular = static_cast<float>(std::clamp(p.reals[3], 0.0, 1.0));
      const bool metal = p.type == "metal";
      m.albedo = metal ? colour(p) : glm::mix(colour(p), glm::vec3(1.0f), specular);
      if (metal && specular >= 0.5f && p.reals[4] <= 0.05)
        m.surface = Surface::mirror;
      else if (specular > 0.0f)
        model_.notes.drop("gloss of plastic and metal");
    } else if (p.type == "light" || p.type == "glow" || p.type == "illum" || p.type == "spotlight") {
      need(p, 3, 7);
      m.emission = emitted_radiance({p.reals[0], p.reals[1], p.reals[2]}, model_.notes);
      if (p.type == "spotlight") model_.notes.drop("cones of spotlights");
      if (p.type == "glow" && p.reals.size() > 3 && p.reals[3] != 0.0) model_.notes.drop("radii of glow");
      if (p.type == "illum") model_.notes.drop("how illum looks when it is seen");
    } else if (p.type == "mirror") {
      need(p, 3, 3);
      m.albedo = colour(p);
      m.surface = Surface::mirror;
    } else if (p.type == "glass") {
      need(p, 3, 4);
      // A share for each of the two sheets.
      for (int c = 0; c < 3; ++c) m.albedo[c] = std::sqrt(colour(p)[c]);
      m.surface = Surface::dielectric;
      m.ior = index_of_refraction(p, p.reals.size() > 3 ? p.reals[3] : 1.52);
      thin = true;
    } else if (p.type == "dielectric") {
      need(p, 5, 5);
      m.albedo = glm::vec3(1.0f);
      m.surface = Surface::dielectric;
      m.ior = index_of_refraction(p, p.reals[3]);
      if (colour(p) != glm::vec3(1.0f)) model_.notes.drop("absorption inside dielectrics");
    } else {
      return false;
    }
    definitions_[p.name] = {.material = add(m, thin)};
    return true;
  }

  float index_of_refraction(const Primitive& p, double n) const {
    if (!(n > 0.0 && n <= 10.0))
      fail(p, fmt::format("has an index of refraction of {}; give one in (0, 10]", n));
    return n == 1.0 ? 1.0001f : static_cast<float>(n);
  }

  static bool is_disc(const std::string& type) { return type == "ring"; }
  static bool is_cone(const std::string& type) { return type == "cone" || type == "cup"; }
  static bool is_cylinder(const std::string& type) { return type == "cylinder" || type == "tube"; }
  static bool is_sphere(const std::string& type) { return type == "sphere" || type == "bubble"; }
  static glm::dvec3 point(const Primitive& p, std::size_t at) {
    return {p.reals[at], p.reals[at + 1], p.reals[at + 2]};
  }

  // Checks a surface and keeps it until the scene's size is known.
  bool read_surface(Primitive& p) {
    if (p.type == "polygon") {
      need(p, 9, 3 * kMaxCorners);
      if (p.reals.size() % 3 != 0)
        fail(p, fmt::format("has {} real arguments, not three for each corner", p.reals.size()));
      for (std::size_t i = 0; i < p.reals.size(); i += 3) extend(point(p, i), 0.0);
    } else if (is_sphere(p.type)) {
      need(p, 4, 4);
      if (p.reals[3] == 0.0) fail(p, "has no radius");
      extend(point(p, 0), std::abs(p.reals[3]));
    } else if (is_cylinder(p.type) || is_cone(p.type)) {
      need(p, is_cone(p.type) ? 8 : 7, is_cone(p.type) ? 8 : 7);
      if (is_cylinder(p.type) && p.reals[6] < 0.0) {
        p.type = p.type == "tube" ? "cylinder" : "tube";
        p.reals[6] = -p.reals[6];
        model_.notes.add("a cylinder of negative radius is taken as a tube, and a tube as a cylinder");
      }
      if (is_cylinder(p.type)) p.reals.push_back(p.reals[6]);
      if (p.reals[6] < 0.0 || p.reals[7] < 0.0 || p.reals[6] + p.reals[7] == 0.0)
        fail(p, "has no positive radius");
      if (!(glm::distance(point(p, 0), point(p, 3)) > 0.0)) fail(p, "has no length");
      for (const std::size_t end : {0u, 1u}) extend(point(p, 3 * end), p.reals[6 + end]);
    } else if (is_disc(p.type)) {
      need(p, 8, 8);
      if (!(glm::length(point(p, 3)) > 0.0)) fail(p, "has no direction");
      if (p.reals[6] < 0.0 || p.reals[7] < 0.0 || p.reals[6] == p.reals[7]) fail(p, "has no area");
      extend(point(p, 0), std::max(p.reals[6], p.reals[7]));
    } else {
      return false;
    }
    const Definition looks = resolve(p.modifier);
    if (looks.invisible) {
      model_.notes.drop("surfaces with the modifier void");
    } else {
      if (!looks.grey_stands.empty()) grey_.insert(looks.grey_stands);
      surfaces_.push_back({std::move(p), looks.material});
    }
    return true;
  }

  void extend(const glm::dvec3& p, double radius) {
    lower_ = glm::min(lower_, p - radius);
    upper_ = glm::max(upper_, p + radius);
  }

  void add_surfaces() {
    const double size = surfaces_.empty() ? 0.0 : glm::distance(lower_, upper_);
    std::size_t triangles = 0;
    for (const auto& [p, material] : surfaces_) {
      const int n = segments_of(p, size);
      triangles += is_sphere(p.type) ? sphere_triangles(n) : n > 0 ? strip_triangles(n) : p.reals.size() / 3;
      if (triangles > kMaxVertices)
        fail(p, fmt::format("is one too many: more than {} triangles", kMaxVertices));
    }
    for (const auto& [p, material] : surfaces_) {
      const int n = segments_of(p, size);
      add_surface(p, n, shape_of(material, n > 0 && !is_disc(p.type), p.name));
    }
  }

  // Of a curved surface in a scene of a size; 0 for a polygon.
  static int segments_of(const Primitive& p, double size) {
    if (p.type == "polygon") return 0;
    const double radius = is_sphere(p.type) ? std::abs(p.reals[3]) : std::max(p.reals[6], p.reals[7]);
    return segments(radius, std::max(kChordOfRadius * radius, kChordOfScene * size));
  }

  static void add_surface(const Primitive& p, int n, Shape& to) {
    const bool inward = p.type == "bubble" || p.type == "tube" || p.type == "cup";
    if (is_sphere(p.type))
      return add_sphere(to, point(p, 0), std::abs(p.reals[3]), n, inward != (p.reals[3] < 0.0));
    if (is_disc(p.type))
      return add_ring(to, point(p, 0), point(p, 3), std::min(p.reals[6], p.reals[7]),
                      std::max(p.reals[6], p.reals[7]), n);
    if (n > 0) return add_cone(to, point(p, 0), point(p, 3), p.reals[6], p.reals[7], n, inward);
    std::vector<glm::dvec3> corners;
    for (std::size_t i = 0; i < p.reals.size(); i += 3) corners.push_back(point(p, i));
    add_polygon(to, corners);
  }

  // The shape that holds the surfaces of a material, smooth or flat.
  Shape& shape_of(std::uint32_t material, bool smooth, const std::string& name) {
    const auto [known, first] = shapes_.try_emplace({material, smooth}, model_.shapes.size());
    if (first) {
      model_.shapes.emplace_back();
      model_.shapes.back().name = short_name(name);
      model_.shapes.back().material = material;
    }
    return model_.shapes[known->second];
  }

  void find_view() {
    std::filesystem::path beside = file_;
    beside.replace_extension(".vf");
    RadianceView view;
    std::error_code ignored;
    if (std::filesystem::exists(beside, ignored)) {
      const std::string text = load_file(beside);
      RadianceWords words(beside.string(), text);
      view = read_view(words);
    } else if (!view_.empty()) {
      RadianceWords words(file_.string(), view_, view_line_);
      view = read_view(words);
    } else {
      return;
    }
    if (!view.perspective) return model_.notes.drop("a view that is not perspective");
    if (view.shifted) model_.notes.drop("shifts of the view (-vs, -vl)");
    model_.lens = {
        0, Lens{static_cast<float>(view.vertical * std::numbers::pi / 180.0), view.p, view.d, view.up}};
  }

  std::filesystem::path file_;
  RadianceWords scan_;
  std::string_view view_;  // of the last comment that gives one
  std::size_t view_line_ = 0;
  Model model_;
  std::map<std::string, Definition> definitions_;  // by name; the last one counts
  std::vector<Kept> surfaces_;
  std::map<std::pair<std::uint32_t, bool>, std::size_t> shapes_;
  std::set<std::string> unknown_, grey_;  // types and names
  std::uint32_t grey_material_ = ~0u;
  glm::dvec3 lower_{1e300}, upper_{-1e300};
};

}  // namespace

Model read_radiance(const std::filesystem::path& file, const std::string& text) {
  return RadianceReader(file, text).read();
}

}  // namespace icbench::importing
