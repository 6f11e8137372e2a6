// Sculpting with implicit surfaces: signed functions, negative inside, joined smoothly and meshed by surface
// nets.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <string>

#include "scene/scene.h"

namespace icbench {

/// Roughly the signed distance, metres, to a solid: negative inside, smooth near the surface.
using SolidFunction = std::function<float(const glm::vec3&)>;

/// Ellipsoid with semi-axes r.
float ellipsoid(const glm::vec3& p, const glm::vec3& centre, const glm::vec3& r) noexcept;

/// Ball swept from a to b while its radius goes from ra to rb.
float tapered_capsule(const glm::vec3& p, const glm::vec3& a, const glm::vec3& b, float ra,
                      float rb) noexcept;

/// Union of two solids whose seam is filleted over a width of about k; k > 0, metres.
float smooth_union(float a, float b, float k) noexcept;

/// Meshes f = 0 on cubic cells of edge `cell` by surface nets (Gibson 1998): one vertex per cell that the
/// surface crosses, moved onto the surface along the gradient, which also gives its normal. The solid must
/// lie inside `bounds`; a part, or a hollow, that fits between lines four cells apart may be missed. Evaluates f at
/// every fourth corner of the grid each way, once at the corners of those cells, and seven times a vertex.
Mesh mesh_implicit(std::string name, const SolidFunction& f, const Bounds& bounds, float cell,
                   std::uint32_t material);

}  // namespace icbench
