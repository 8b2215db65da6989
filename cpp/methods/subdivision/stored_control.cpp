// SPDX-License-Identifier: MIT
#include "methods/subdivision/stored_control.h"

#include <algorithm>
#include <sstream>

#include "base/errors.h"
#include "method/mesh_pages.h"

namespace lodlab::subdivision {
namespace {

constexpr float kLeastReach = 1e-30f;  ///< so that steps of a float are no denormals

/// Moves the higher of two neighbours at one place on by a step until there are none: a vertex moves no more
/// often than it has lower neighbours, once these stay.
void move_apart(std::vector<glm::vec3>& positions, std::span<const Face> faces) {
  float far = 0.0f;
  for (const glm::vec3& p : positions) far = std::max({far, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
  if (!(far >= kLeastReach)) {
    std::ostringstream text;
    text << "subdivision: the control mesh reaches " << far
         << " from its centre; as it is stored in floats, it must reach " << kLeastReach;
    throw InvalidInput(text.str());
  }
  const float step = far * 0x1p-22f;
  for (bool moved = true; moved;) {
    moved = false;
    for (const Face& f : faces) {
      for (size_t k = 0; k < 3; ++k) {
        const auto [lower, higher] = std::minmax({f[k], f[(k + 1) % 3]});
        if (positions[lower] != positions[higher]) continue;
        positions[higher].x += step;
        moved = true;
      }
    }
  }
}

}  // namespace

ControlMesh stored(const ControlMesh& control, const glm::dvec3& centre) {
  const CacheOrder order = cache_order(std::span(control.faces.data()->data(), 3 * control.faces.size()),
                                       control.positions.size());
  // Floats lie in arrays of their own first: of dvec3 = vec3(dvec3) GCC 12's vectorizer leaves out the
  // rounding.
  std::vector<glm::vec3> positions(order.used), normals(order.used);
  for (size_t v = 0; v < order.number.size(); ++v) {
    if (order.number[v] == ~0u) continue;  // no face's
    positions[order.number[v]] = control.positions[v] + (control.centre - centre);
    normals[order.number[v]] = control.normals[v];
  }
  ControlMesh out;
  out.centre = centre;
  out.faces.resize(control.faces.size());
  std::copy(order.indices.begin(), order.indices.end(), out.faces.data()->data());
  move_apart(positions, out.faces);
  out.positions.assign(positions.begin(), positions.end());
  out.normals.assign(normals.begin(), normals.end());
  out.onto = control.onto;
  for (uint32_t& v : out.onto)
    if (v != ~0u) v = order.number[v];
  out.reached_target = control.reached_target;
  return out;
}

}  // namespace lodlab::subdivision
