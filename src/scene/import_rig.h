// A hierarchy of nodes and what moves them, in doubles: from keys to matrices.
#pragma once

#include <cstdint>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <optional>
#include <string>
#include <vector>

namespace icbench::importing {

/// From a node's space to its parent's: a matrix, or scale, then rotation, then translation.
struct Local {
  std::optional<glm::dmat4> matrix{};
  glm::dvec3 translation{0.0};
  glm::dquat rotation{1.0, 0.0, 0.0, 0.0};
  glm::dvec3 scale{1.0};
};

enum class Path : std::uint8_t { translation, rotation, scale };
enum class Interpolation : std::uint8_t { step, linear, cubic };

/// One property of one node over time.
struct Channel {
  std::uint32_t node = 0;
  Path path = Path::translation;
  Interpolation interpolation = Interpolation::linear;
  std::vector<double> times;  ///< seconds, increasing, not empty
  /// One a time, a rotation as (x, y, z, w); cubic: three a time, the tangents per second around the value.
  std::vector<glm::dvec4> values;

  /// The value at a time, that of the first or last key outside. A rotation is not yet normalised. A step comes up to
  /// a millionth of its time early: times in files are rounded, up as well as down.
  glm::dvec4 at(double seconds) const;
  bool is_constant() const;
};

/// Nodes, parents before children, and their channels, at most one for each node and path.
class Rig {
 public:
  /// Returns the new node's index. `parent` is an index or -1.
  std::uint32_t add(std::string name, int parent, const Local& local);

  /// Takes a channel unless the node already has one for that path; a constant one becomes the node's own
  /// pose.
  bool animate(Channel channel);

  /// Call once after the last add and animate. Throws std::runtime_error naming a node that stands nowhere
  /// finite or lies too deep in the hierarchy (kMaxDepth).
  void finish();

  std::size_t size() const noexcept { return nodes_.size(); }
  const std::string& name(std::uint32_t node) const { return nodes_[node].name; }

  /// Whether a node's place in the world depends on time.
  bool moves(std::uint32_t node) const { return nodes_[node].moves; }

  /// Steps to the root, which `world` takes at most.
  int depth(std::uint32_t node) const { return nodes_[node].depth; }

  /// From a node's space to the world's.
  glm::dmat4 world(std::uint32_t node, double seconds) const;

  /// Time of the last key, seconds.
  double duration() const;

  /// Whether a scale was found to reach 0 or change its sign over time; it then stays at kLeastScale of its
  /// largest and keeps its first sign.
  bool mended_scale() const noexcept { return mended_scale_; }

  static constexpr int kMaxDepth = 256;
  static constexpr double kLeastScale = 1e-3;

 private:
  struct Node {
    std::string name;
    int parent;
    Local local;
    int channels[3] = {-1, -1, -1};  // by path
    glm::dvec3 least_scale{0.0};     // with the sign to keep; 0: leave it as it is
    bool moves = false;
    int depth = 0;
    glm::dmat4 rest{1.0};  // to the world, at time 0
  };

  glm::dmat4 local(const Node& node, double seconds) const;
  void bound_scale(Node& node);

  std::vector<Node> nodes_;
  std::vector<Channel> channels_;
  bool mended_scale_ = false;
};

}  // namespace icbench::importing
