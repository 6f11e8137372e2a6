#include "scene/import_rig.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <stdexcept>
#include <utility>

#include "scene/import_text.h"

namespace icbench::importing {
namespace {

bool is_finite(const glm::dmat4& m) {
  for (int c = 0; c < 4; ++c)
    for (int r = 0; r < 4; ++r)
      if (!std::isfinite(m[c][r])) return false;
  return true;
}

glm::dquat unit(const glm::dvec4& q) {
  const double length = glm::length(q);
  return length > 0.0 ? glm::dquat(q.w / length, q.x / length, q.y / length, q.z / length)
                      : glm::dquat(1.0, 0.0, 0.0, 0.0);
}

// Along the shorter arc.
glm::dvec4 mix_rotations(const glm::dvec4& a, const glm::dvec4& b, double share) {
  const glm::dquat q = glm::slerp(unit(a), unit(b), share);
  return {q.x, q.y, q.z, q.w};
}

// Cubic Hermite spline (glTF 2.0, appendix C).
glm::dvec4 hermite(const glm::dvec4* key, double t, double span) {
  const glm::dvec4 &v0 = key[1], &v1 = key[4];
  const glm::dvec4 out = span * key[2], in = span * key[3];
  const double t2 = t * t, t3 = t2 * t;
  return (2.0 * t3 - 3.0 * t2 + 1.0) * v0 + (t3 - 2.0 * t2 + t) * out + (3.0 * t2 - 2.0 * t3) * v1 +
         (t3 - t2) * in;
}

}  // namespace

glm::dvec4 Channel::at(double seconds) const {
  const std::size_t stride = interpolation == Interpolation::cubic ? 3 : 1, middle = stride / 2;
  const double now = interpolation == Interpolation::step ? seconds * (1.0 + 1e-6) : seconds;
  const auto after =
      static_cast<std::size_t>(std::upper_bound(times.begin(), times.end(), now) - times.begin());
  if (after == 0) return values[middle];
  const std::size_t key = after - 1;
  if (after == times.size() || interpolation == Interpolation::step) return values[stride * key + middle];
  const double span = times[after] - times[key], share = (seconds - times[key]) / span;
  if (interpolation == Interpolation::cubic) return hermite(&values[3 * key], share, span);
  if (path == Path::rotation) return mix_rotations(values[key], values[after], share);
  return glm::mix(values[key], values[after], share);
}

bool Channel::is_constant() const {
  if (interpolation != Interpolation::cubic)
    return std::all_of(values.begin(), values.end(),
                       [&](const glm::dvec4& v) { return v == values.front(); });
  for (std::size_t i = 0; i < values.size(); ++i)
    if (values[i] != (i % 3 == 1 ? values[1] : glm::dvec4(0.0))) return false;
  return true;
}

std::uint32_t Rig::add(std::string name, int parent, const Local& local) {
  nodes_.push_back({.name = short_name(std::move(name)), .parent = parent, .local = local});
  return static_cast<std::uint32_t>(nodes_.size() - 1);
}

bool Rig::animate(Channel channel) {
  Node& node = nodes_[channel.node];
  int& slot = node.channels[static_cast<std::size_t>(channel.path)];
  if (slot >= 0) return false;
  slot = static_cast<int>(channels_.size());
  channels_.push_back(std::move(channel));
  return true;
}

void Rig::bound_scale(Node& node) {
  const int slot = node.channels[static_cast<std::size_t>(Path::scale)];
  if (slot < 0) return;
  const Channel& channel = channels_[static_cast<std::size_t>(slot)];
  const std::size_t stride = channel.interpolation == Interpolation::cubic ? 3 : 1;
  for (int axis = 0; axis < 3; ++axis) {
    double largest = 0.0, sign = 0.0, least = std::abs(channel.values[stride / 2][axis]);
    bool turns = false;
    for (std::size_t k = stride / 2; k < channel.values.size(); k += stride) {
      const double s = channel.values[k][axis];
      largest = std::max(largest, std::abs(s));
      least = std::min(least, std::abs(s));
      if (sign == 0.0 && s != 0.0) sign = std::copysign(1.0, s);
      turns = turns || s * sign < 0.0;
    }
    node.least_scale[axis] = (sign == 0.0 ? 1.0 : sign) * kLeastScale * (largest > 0.0 ? largest : 1.0);
    mended_scale_ = mended_scale_ || turns || least < kLeastScale * largest || largest == 0.0;
  }
}

void Rig::finish() {
  for (Node& node : nodes_) {
    for (int& slot : node.channels) {
      if (slot < 0) continue;
      const Channel& channel = channels_[static_cast<std::size_t>(slot)];
      if (!channel.is_constant()) {
        node.moves = true;
        continue;
      }
      const glm::dvec4 value = channel.at(0.0);
      if (channel.path == Path::translation) node.local.translation = glm::dvec3(value);
      if (channel.path == Path::rotation) node.local.rotation = unit(value);
      if (channel.path == Path::scale) node.local.scale = glm::dvec3(value);
      slot = -1;
    }
    bound_scale(node);
    if (node.parent >= 0) {
      const Node& parent = nodes_[static_cast<std::size_t>(node.parent)];
      node.moves = node.moves || parent.moves;
      node.depth = parent.depth + 1;
      if (node.depth > kMaxDepth)
        throw std::runtime_error(fmt::format("node '{}' lies {} levels deep; flatten the hierarchy to {}",
                                             node.name, node.depth, kMaxDepth));
      node.rest = parent.rest * local(node, 0.0);
    } else {
      node.rest = local(node, 0.0);
    }
    if (!is_finite(node.rest))
      throw std::runtime_error(fmt::format(
          "node '{}' stands nowhere finite; mend its translation, rotation and scale", node.name));
  }
}

glm::dmat4 Rig::local(const Node& node, double seconds) const {
  if (node.local.matrix) return *node.local.matrix;
  const auto value = [&](Path path, const glm::dvec4& rest) {
    const int slot = node.channels[static_cast<std::size_t>(path)];
    return slot < 0 ? rest : channels_[static_cast<std::size_t>(slot)].at(seconds);
  };
  const glm::dquat& r = node.local.rotation;
  const glm::dvec3 translation(value(Path::translation, glm::dvec4(node.local.translation, 0.0)));
  const glm::dquat rotation = unit(value(Path::rotation, glm::dvec4(r.x, r.y, r.z, r.w)));
  glm::dvec3 scale(value(Path::scale, glm::dvec4(node.local.scale, 0.0)));
  for (int axis = 0; axis < 3; ++axis) {
    const double least = node.least_scale[axis];
    if (least > 0.0) scale[axis] = std::max(scale[axis], least);
    if (least < 0.0) scale[axis] = std::min(scale[axis], least);
  }
  return glm::scale(glm::translate(glm::dmat4(1.0), translation) * glm::mat4_cast(rotation), scale);
}

glm::dmat4 Rig::world(std::uint32_t index, double seconds) const {
  glm::dmat4 m(1.0);
  for (const Node* node = &nodes_[index];; node = &nodes_[static_cast<std::size_t>(node->parent)]) {
    if (!node->moves) return node->rest * m;
    m = local(*node, seconds) * m;
    if (node->parent < 0) return m;
  }
}

double Rig::duration() const {
  double last = 0.0;
  for (const Channel& channel : channels_) last = std::max(last, channel.times.back());
  return last;
}

}  // namespace icbench::importing
