// SPDX-License-Identifier: MIT
// The sampling pattern (Bauman, Livny, El-Sana, section 3.1) laid over a control mesh. A sample that faces
// share is there once: one a control vertex, then n - 1 an edge (edges in the order of mesh_edges(), samples
// from the lower vertex on), then (n - 1)(n - 2) / 2 inside each face. So what faces share is equal bit for
// bit.
//
// Within a face (i, j) is the point with weights (n - i - j, i, j) / n of its corners 0, 1, 2. A line between
// two samples of a face has a level: the largest L with length <= n 2^(-L/2) for even L, n sqrt(3/4)
// 2^(-(L-1)/2) for odd ones, lengths in steps of the pattern. A control edge has level 0, each bisection of
// it adds 2, and 2 d is a single step.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <utility>
#include <vector>

#include "geometry/mesh.h"
#include "geometry/mesh_edges.h"
#include "methods/subdivision/control_mesh.h"

namespace lodlab::subdivision {

/// What is the same for all faces.
struct Pattern {
  int d;  ///< degree 2^d + 1

  /// InvalidInput where `degree` is not 2^d + 1 with d from 1 to 10.
  static Pattern of_degree(int64_t degree);

  int n() const { return 1 << d; }  ///< steps along an edge
  int levels() const { return 2 * d + 1; }
  int points() const { return (n() + 1) * (n() + 2) / 2; }
  int inside() const { return (n() - 1) * (n() - 2) / 2; }
  /// Of a point within the list of a face's points, row by row: j, then i.
  int point(int i, int j) const { return j * (n() + 1) - j * (j - 1) / 2 + i; }
  /// The level of a line from a point to the one (di, dj) farther, not (0, 0).
  int level(int di, int dj) const;
};

/// Which sample is where.
class Samples {
 public:
  Samples(const ControlMesh& control, Pattern pattern);

  const Pattern& pattern() const { return pattern_; }
  const MeshEdges& edges() const { return edges_; }
  int64_t control_faces() const { return faces_; }
  int64_t count() const { return first_inside_ + faces_ * pattern_.inside(); }
  /// Of vertices below, of edges to first_inside(), of faces' insides from there on.
  int64_t first_on_edges() const { return vertices_; }
  int64_t first_inside() const { return first_inside_; }

  int64_t of(int64_t face, int i, int j) const;
  /// Of all points of a face, in the pattern's order.
  void of_face(int64_t face, std::span<int64_t> out) const;
  /// The lower and the higher vertex of an edge.
  std::pair<uint32_t, uint32_t> ends(int64_t edge) const;
  int64_t edge(int64_t face, int side) const { return edge_of_side_[static_cast<size_t>(3 * face + side)]; }

  /// Where each lies on the control mesh, and the normal there, interpolated and not of unit length, in the
  /// floats of shaders/subdivision/displace.h; shared ones from the lower to the higher vertex. Of a control
  /// mesh as it is stored: others are rounded.
  struct Place {
    glm::vec3 position, normal;
  };
  std::vector<Place> places() const { return places(control_); }
  /// On another control mesh of these faces.
  std::vector<Place> places(const ControlMesh& control) const;

 private:
  const ControlMesh& control_;
  Pattern pattern_;
  int64_t vertices_, faces_, first_inside_;
  MeshEdges edges_;
  std::vector<uint32_t> edge_of_side_;
};

}  // namespace lodlab::subdivision
