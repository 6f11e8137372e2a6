#include "scene/import_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "scene/import_placing.h"
#include "scene/import_thin_glass.h"

namespace icbench::importing {
namespace {

constexpr double kFar = std::numeric_limits<double>::max();
// A scene is brought to the origin if it is farther from it than this many of its own radii.
constexpr double kFarAway = 4.0;
// Distance of the two sheets of thin glass, as a share of the scene's radius: ten epsilons at the least.
constexpr double kGlassThickness = 2.0 * kFarAway * 1e1 * kEpsilonShare;
// A matrix flattens if its determinant is below this share of its axes' lengths multiplied: a pose's floats could not
// tell whether it mirrors.
constexpr double kFlatShare = 1e-6;
// A moving shape whose radius is more than so many metres in its own space, or less than its inverse, is of odd units.
constexpr double kOddUnits = 1024.0;
// Most poses that the motion of a scene may need.
constexpr std::size_t kMaxPoses = 4'000'000;
// Most steps up the hierarchy that these may take, with those of lamps and of the camera; each is a product of matrices.
constexpr std::size_t kMaxSteps = 8'000'000;

struct Box {
  glm::dvec3 lower{kFar}, upper{-kFar};
  void extend(const glm::dvec3& p) {
    lower = glm::min(lower, p);
    upper = glm::max(upper, p);
  }
  bool empty() const { return !(lower.x <= upper.x); }
  glm::dvec3 centre() const { return 0.5 * lower + 0.5 * upper; }
  double radius() const { return glm::length(0.5 * upper - 0.5 * lower); }
};

bool mirrors(const glm::dmat4& m) { return glm::determinant(glm::dmat3(m)) < 0.0; }

// Whether a matrix leaves no volume, as does a scale of 0 that hides a node; only animated scales are kept from that.
bool flattens(const glm::dmat4& m) {
  const glm::dmat3 axes(m);
  const double most = glm::length(axes[0]) * glm::length(axes[1]) * glm::length(axes[2]);
  return !(std::abs(glm::determinant(axes)) >
           std::max(kFlatShare * most, double{std::numeric_limits<float>::min()}));
}

// A mesh of single precision in the making.
struct Part {
  Mesh mesh;
  glm::dvec3 origin{0.0};  // subtracted from every position

  // Appends a shape where a matrix puts it.
  void append(const Shape& shape, const glm::dmat4& m) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (const glm::dvec3& p : shape.positions) mesh.positions.emplace_back(transform(m, p) - origin);
    const bool mirrored = mirrors(m);
    for (const glm::uvec3& t : shape.triangles)
      mesh.triangles.push_back(first + (mirrored ? glm::uvec3(t.x, t.z, t.y) : t));
    mesh.uvs.insert(mesh.uvs.end(), shape.uvs.begin(), shape.uvs.end());
    append_normals(shape, m, mirrored);
  }

 private:
  void append_normals(const Shape& shape, const glm::dmat4& m, bool mirrored) {
    if (shape.normals.empty()) return;
    const glm::dmat3 turn = (mirrored ? -1.0 : 1.0) * cofactors(m);
    std::vector<glm::dvec3> faces;  // for those without a direction
    for (std::size_t v = 0; v < shape.normals.size(); ++v) {
      glm::dvec3 n = unit_or(turn * glm::dvec3(shape.normals[v]), glm::dvec3(0.0));
      if (n == glm::dvec3(0.0)) {
        if (faces.empty()) faces = face_sums(shape);
        n = unit_or(turn * faces[v], {0.0, 0.0, 1.0});
      }
      mesh.normals.push_back(glm::normalize(glm::vec3(n)));
    }
  }
};

class Assembly {
 public:
  explicit Assembly(Model model)
      : model_(std::move(model)), rig_(std::make_shared<Rig>(std::move(model_.rig))) {}

  ImportedScene run() {
    rig_->finish();
    if (rig_->mended_scale()) model_.notes.add("a scale that passes through zero is kept from it");
    check_counts();
    scene_.name = model_.file;
    choose_frames();
    find_bounds();
    thicken_glass();
    for (const Surfacing& s : model_.materials) scene_.materials.push_back(s.material);
    scene_.textures = std::move(model_.textures);
    place_shapes();
    place_lamps();
    place_camera();
    light_if_dark();
    return {std::move(scene_), model_.notes.lines()};
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(fmt::format("{}: {}", model_.file, what));
  }

  void check_counts() const {
    std::size_t vertices = 0, triangles = 0;
    for (const auto& [node, shape] : model_.placed_shapes) {
      vertices += model_.shapes[shape].positions.size();
      triangles += model_.shapes[shape].triangles.size();
      if (std::max(vertices, triangles) > kMaxVertices)
        fail(fmt::format("describes more than {} vertices or triangles, instances counted; reduce it",
                         kMaxVertices));
    }
    if (triangles == 0) fail("holds no triangle");
  }

  // Frames count as long as something depends on them.
  void choose_frames() {
    std::size_t moving = 0, steps = 0;  // of a frame
    const auto count = [&](std::uint32_t node) {
      if (rig_->moves(node)) steps += 1 + static_cast<std::size_t>(rig_->depth(node));
      return rig_->moves(node);
    };
    for (const auto& [node, shape] : model_.placed_shapes) moving += count(node);
    if (model_.lens) count(model_.lens->node);
    std::size_t moving_lamps = 0;
    for (const auto& lamp : model_.lamps) moving_lamps += count(lamp.node);
    // Where a light changes all are looked at, materials as well.
    if (moving_lamps > 0) steps += model_.lamps.size() + model_.materials.size();
    if (steps == 0) return;
    if (moving > kMaxPoses) fail(fmt::format("moves {} meshes; at most {} can", moving, kMaxPoses));
    const double wanted = std::max(1.0, std::round(rig_->duration() * kFramesPerSecond));
    const auto most = static_cast<double>(std::clamp<std::size_t>(
        kMaxSteps / steps, 1,
        std::min<std::size_t>(kMaxFrames, kMaxPoses / std::max<std::size_t>(moving, 1))));
    scene_.frames = static_cast<std::uint32_t>(std::min(wanted, most));
    model_.notes.add(wanted > most ? fmt::format("its animation is cut to {} frames of {:.6g}, {} a second",
                                                 scene_.frames, wanted, kFramesPerSecond)
                                   : fmt::format("its animation has {} frames, {} a second", scene_.frames,
                                                 kFramesPerSecond));
  }

  glm::dmat4 world(std::uint32_t node, double frame = 0.0) const {
    return rig_->world(node, frame / kFramesPerSecond);
  }

  // A pose must have a volume.
  bool is_hidden(std::uint32_t node) const { return rig_->moves(node) && flattens(world(node)); }

  void find_bounds() {
    std::vector<Box>& own = shape_bounds_;
    own.resize(model_.shapes.size());
    for (std::size_t i = 0; i < own.size(); ++i)
      for_each_used(model_.shapes[i], glm::dmat4(1.0), [&](const glm::dvec3& p) { own[i].extend(p); });
    for (const auto& [node, shape] : model_.placed_shapes) {
      if (own[shape].empty() || is_hidden(node)) continue;
      if (!rig_->moves(node)) {
        for_each_used(model_.shapes[shape], world(node), [&](const glm::dvec3& p) { bounds_.extend(p); });
        continue;
      }
      for (std::uint32_t frame = 0; frame < scene_.frames; ++frame) {
        const glm::dmat4 m = world(node, frame);
        for (int c = 0; c < 8; ++c)
          bounds_.extend(transform(m, {c & 1 ? own[shape].upper.x : own[shape].lower.x,
                                       c & 2 ? own[shape].upper.y : own[shape].lower.y,
                                       c & 4 ? own[shape].upper.z : own[shape].lower.z}));
      }
    }
    if (bounds_.empty()) fail("holds no triangle with a surface");
    const double radius = bounds_.radius();
    if (!(radius >= 0.5 * kMinReach && radius <= kMaxReach))
      fail(fmt::format("is {:.6g} m large; scale it to between {} and {} m", 2.0 * radius, kMinReach,
                       kMaxReach));
    const glm::dvec3 centre = bounds_.centre();
    if (!std::isfinite(glm::length(centre))) fail("lies nowhere finite; mend its coordinates");
    if (glm::length(centre) <= kFarAway * radius) return;
    origin_ = centre;
    bounds_ = {bounds_.lower - centre, bounds_.upper - centre};
    model_.notes.add(fmt::format("lies far from its origin and is moved by ({:.9g}, {:.9g}, {:.9g}) m",
                                 -centre.x, -centre.y, -centre.z));
  }

  // A shape has one back, right where it is shown largest; where it is smaller its sheets are closer together.
  void thicken_glass() {
    struct Largest {
      double size = 0.0;
      glm::dmat4 matrix{0.0};
      bool is_alone = true;  // shown once, and still
    };
    std::map<std::uint32_t, Largest> largest;  // by shape
    for (const auto& [node, shape] : model_.placed_shapes) {
      if (!model_.materials[model_.shapes[shape].material].thin || is_hidden(node)) continue;
      const auto [known, first] = largest.try_emplace(shape);
      Largest& l = known->second;
      l.is_alone = first && !rig_->moves(node);
      for (std::uint32_t frame = 0; frame < (rig_->moves(node) ? scene_.frames : 1u); ++frame) {
        const glm::dmat4 m = world(node, frame);
        const double size = std::abs(glm::determinant(glm::dmat3(m)));
        if (size > l.size) l = {size, m, l.is_alone};
      }
    }
    const double thickness = kGlassThickness * bounds_.radius();
    std::vector<StandingGlass> standing;
    for (const auto& [shape, l] : largest) {
      if (!flattens(l.matrix))
        standing.push_back({&model_.shapes[shape], l.matrix, l.is_alone ? 0 : 1 + shape});
    }
    if (drop_second_faces(standing, 0.5 * thickness))
      model_.notes.add("thin glass with both its faces counts once");
    for (const StandingGlass& g : standing) add_back(*g.shape, thickness, g.matrix);
    if (standing.size() < largest.size()) model_.notes.add("thin glass of scale 0 has one sheet");
  }

  // What stands still is one mesh for each material and kind of vertex; what moves is one for each shape,
  // shown again by instances.
  void place_shapes() {
    std::map<std::tuple<std::uint32_t, bool, bool>, Part> still;
    std::map<std::pair<std::uint32_t, bool>, std::uint32_t> moving;
    for (const auto& [node, index] : model_.placed_shapes) {
      const Shape& shape = model_.shapes[index];
      if (shape.triangles.empty()) continue;
      if (is_hidden(node)) {
        model_.notes.drop("moving meshes of scale 0");
        continue;
      }
      if (rig_->moves(node)) {
        place_moving(node, index, moving);
        continue;
      }
      Part& part = still[{shape.material, !shape.normals.empty(), !shape.uvs.empty()}];
      if (part.mesh.name.empty()) part.mesh.name = shape.name.empty() ? "mesh" : shape.name;
      part.mesh.material = shape.material;
      part.origin = origin_;
      part.append(shape, world(node));
    }
    for (auto& [key, part] : still) scene_.meshes.push_back(std::move(part.mesh));
  }

  // A moving shape lies around its own centre, and one of odd units is brought to the order of a metre, so that single
  // precision serves it well; a mirrored one is mirrored at rest, since a pose may not.
  void place_moving(std::uint32_t node, std::uint32_t index,
                    std::map<std::pair<std::uint32_t, bool>, std::uint32_t>& shown) {
    const bool mirrored = mirrors(world(node));
    const Box& own = shape_bounds_[index];
    const glm::dvec3 centre = own.empty() ? glm::dvec3(0.0) : own.centre();
    const double radius = own.empty() ? 1.0 : own.radius();
    const double scale =
        radius > kOddUnits || radius < 1.0 / kOddUnits ? std::exp2(-std::ilogb(radius)) : 1.0;
    glm::dmat4 to_rest(1.0), from_rest(1.0);
    for (int c = 0; c < 3; ++c) {
      to_rest[c][c] = c == 0 && mirrored ? -scale : scale;
      from_rest[c][c] = 1.0 / to_rest[c][c];
    }
    from_rest[3] = glm::dvec4(centre, 1.0);
    to_rest[3] = glm::dvec4(-glm::dvec3(to_rest * glm::dvec4(centre, 0.0)), 1.0);
    Part part;
    part.mesh.name = fmt::format("{} at {}", model_.shapes[index].name, rig_->name(node));
    part.mesh.material = model_.shapes[index].material;
    const auto mesh = static_cast<std::uint32_t>(scene_.meshes.size());
    const auto [place, first] = shown.try_emplace({index, mirrored}, mesh);
    if (first) {
      part.append(model_.shapes[index], to_rest);
    } else {
      part.mesh.instance_of = place->second;
    }
    part.mesh.pose = [rig = std::shared_ptr<const Rig>(rig_), node = node, from_rest,
                      origin = origin_](float frame) {
      const glm::dmat4 m = rig->world(node, frame / kFramesPerSecond) * from_rest;
      return Pose{glm::mat3(glm::dmat3(m)), glm::vec3(glm::dvec3(m[3]) - origin)};
    };
    scene_.meshes.push_back(std::move(part.mesh));
  }

  void place_lamps() {
    const double distance = kSunDistance * bounds_.radius();
    std::vector<std::pair<std::size_t, Placed<Lamp>>> moving;
    for (const Placed<Lamp>& lamp : model_.lamps) {
      if (rig_->moves(lamp.node)) moving.emplace_back(scene_.point_lights.size(), lamp);
      if (lamp.thing.directional)
        model_.notes.add(fmt::format("a directional light is a point light {:.6g} m away", distance));
      scene_.point_lights.push_back(stand(*rig_, lamp, 0.0f, origin_, bounds_.centre(), distance));
    }
    if (moving.empty()) return;
    scene_.change_light = [moving, rig = std::shared_ptr<const Rig>(rig_), origin = origin_,
                           centre = bounds_.centre(),
                           distance](float frame, std::span<Material>, std::span<PointLight> lights) {
      for (const auto& [i, lamp] : moving) lights[i] = stand(*rig, lamp, frame, origin, centre, distance);
    };
  }

  static PointLight stand(const Rig& rig, const Placed<Lamp>& lamp, float frame, const glm::dvec3& origin,
                          const glm::dvec3& centre, double distance) {
    const glm::dmat4 m = rig.world(lamp.node, frame / kFramesPerSecond);
    const Lamp& l = lamp.thing;
    const glm::dvec3 axis = unit_or(glm::dmat3(m) * l.axis, {0.0, -1.0, 0.0});
    PointLight light;
    light.axis = glm::normalize(glm::vec3(axis));
    // A sun shines on a sphere just larger than the scene's, or nearly all light paths would miss it.
    const double beside = 1.05 / kSunDistance;
    const auto around_scene = static_cast<float>(std::sqrt(1.0 - beside * beside));
    light.cos_inner = l.directional ? around_scene : l.cos_inner;
    light.cos_outer = l.directional ? around_scene : l.cos_outer;
    light.p = glm::vec3(l.directional ? centre - distance * axis : transform(m, l.p) - origin);
    light.intensity = l.directional ? l.intensity * static_cast<float>(distance * distance) : l.intensity;
    return light;
  }

  void place_camera() {
    if (!model_.lens) {
      scene_.camera = framing();
      model_.notes.add("has no camera; a view of the whole scene is used");
      return;
    }
    const auto view = [rig = std::shared_ptr<const Rig>(rig_), lens = *model_.lens, origin = origin_,
                       centre = bounds_.centre(), radius = std::max(bounds_.radius(), 1e-3)](float frame) {
      const glm::dmat4 m = rig->world(lens.node, frame / kFramesPerSecond);
      const glm::dvec3 eye = transform(m, lens.thing.eye) - origin;
      // Far enough away that rounding to floats does not turn the view.
      const double ahead = std::max(radius, glm::distance(eye, centre));
      const glm::dvec3 forward = unit_or(glm::dmat3(m) * lens.thing.forward, {0.0, 0.0, -1.0});
      return Camera{glm::vec3(eye), glm::vec3(eye + ahead * forward),
                    glm::vec3(unit_or(glm::dmat3(m) * lens.thing.up, {0.0, 1.0, 0.0})), lens.thing.fov_y};
    };
    scene_.camera = view(0.0f);
    if (rig_->moves(model_.lens->node)) scene_.camera_path = view;
  }

  // From a little to the right of the front and above, at the distance at which the bounding sphere fits the
  // view.
  Camera framing() const {
    Camera camera;
    camera.fov_y = 0.7f;
    const glm::dvec3 right = glm::cross(model_.up, model_.front);
    const glm::dvec3 to_eye = glm::normalize(model_.front + 0.5 * right + 0.4 * model_.up);
    camera.target = glm::vec3(bounds_.centre());
    camera.eye = glm::vec3(bounds_.centre() + bounds_.radius() / std::sin(0.5 * camera.fov_y) * to_eye);
    camera.up = glm::vec3(model_.up);
    return camera;
  }

  void light_if_dark() {
    const bool emits = std::any_of(scene_.meshes.begin(), scene_.meshes.end(),
                                   [&](const Mesh& m) { return scene_.materials[m.material].emits(); });
    if (emits || !scene_.point_lights.empty()) return;
    PointLight light;
    light.p = scene_.camera.eye;
    const double distance =
        std::max(glm::distance(glm::dvec3(light.p), bounds_.centre()), 0.5 * bounds_.radius());
    light.intensity = glm::vec3(static_cast<float>(std::numbers::pi * distance * distance));
    scene_.point_lights.push_back(light);
    model_.notes.add(
        fmt::format("has no light; a point light of {:.4g} W/sr stands at the camera", light.intensity.x));
  }

  Model model_;
  std::shared_ptr<Rig> rig_;
  Scene scene_;
  Box bounds_;
  std::vector<Box> shape_bounds_;  // in their own space
  glm::dvec3 origin_{0.0};
};

}  // namespace

void Notes::add(std::string note) {
  if (std::find(notes_.begin(), notes_.end(), note) == notes_.end()) notes_.push_back(std::move(note));
}

void Notes::drop(std::string_view kind) {
  const auto known =
      std::find_if(dropped_.begin(), dropped_.end(), [&](const Dropped& d) { return d.kind == kind; });
  if (known == dropped_.end()) {
    dropped_.push_back({std::string(kind), 1});
  } else {
    ++known->count;
  }
}

std::vector<std::string> Notes::lines() const {
  std::vector<std::string> lines = notes_;
  std::string dropped;
  for (const Dropped& d : dropped_)
    dropped += fmt::format("{}{}{}", dropped.empty() ? "" : ", ", d.kind,
                           d.count > 1 ? fmt::format(" ({} times)", d.count) : "");
  if (!dropped.empty()) lines.push_back("left out: " + dropped);
  return lines;
}

float refracting_index(double n, Notes& notes) {
  if (!(n >= 1.0 && n <= 10.0)) {
    notes.drop("indices of refraction that are not from 1 to 10 (1.5 counts)");
    return 1.5f;
  }
  return std::max(static_cast<float>(n), 1.0001f);
}

glm::vec3 emitted_radiance(const glm::dvec3& stated, Notes& notes) {
  constexpr double kMost = 1e12;
  glm::vec3 emitted;
  bool is_cut = false;
  for (int c = 0; c < 3; ++c) {
    const double counts = std::min(std::max(0.0, stated[c]), kMost);  // 0 for a NaN
    is_cut |= counts != stated[c];
    emitted[c] = static_cast<float>(counts);
  }
  if (is_cut) notes.drop("emission below 0 or above 1e12");
  return emitted;
}

ImportedScene assemble(Model model) {
  const std::string file = model.file;
  try {
    return Assembly(std::move(model)).run();
  } catch (const std::runtime_error& error) {
    const std::string what = error.what();
    if (what.starts_with(file)) throw;
    throw std::runtime_error(fmt::format("{}: {}", file, what));
  }
}

}  // namespace icbench::importing
