// SPDX-License-Identifier: MIT
// A triangle mesh as a source: positions, faces that index them, and what its vertices carry. Nothing is
// mended here: any topology is a mesh (mesh_census.h says which), and methods refuse what they cannot take.
// Outside is where a triangle's vertices run counter-clockwise.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <string>

#include "geometry/bounds.h"
#include "geometry/source.h"

namespace lodlab {

using Face = std::array<uint32_t, 3>;

/// What a mesh is made of: arrays that `owner` keeps alive.
struct MeshArrays {
  std::span<const glm::dvec3> positions;
  std::span<const Face> faces;
  std::span<const glm::u8vec4> colors;  ///< a vertex's, or none
  std::span<const glm::vec3> normals;   ///< a vertex's, or none
  std::shared_ptr<const void> owner;
};

struct Mesh final : Source, MeshArrays {
  Box box;                 ///< of the vertices that faces use
  bool in_floats = false;  ///< every coordinate is a 32-bit float

  std::string kind() const override { return "mesh"; }
  std::string hash() const override;
  std::string frame() const override;
  int64_t samples() const override { return static_cast<int64_t>(positions.size()); }

  int64_t triangles() const { return static_cast<int64_t>(faces.size()); }
  double extent() const { return glm::distance(box.lo, box.hi); }  ///< the diagonal of its box
};

/// Coordinates, and their differences, fit 32-bit floats with room for their squares' roots.
inline constexpr double kFarthestVertex = 1e30;
inline constexpr int64_t kMostFaces = (int64_t{1} << 31) / 3;

/// InvalidInput, naming triangle or vertex, for no faces or more than kMostFaces, an index out of range, a
/// position that is not finite or beyond kFarthestVertex, and as many colours or normals as there are no
/// vertices.
std::shared_ptr<const Mesh> make_mesh(MeshArrays arrays, std::string spec);

/// Where a mesh lies, from the JSON text of Mesh::frame(): what stores keep of it.
struct MeshFrame {
  int64_t vertices = 0, faces = 0;
  Box box;
  bool in_floats = false;
};
MeshFrame mesh_frame_from_json(const std::string& text);

}  // namespace lodlab
