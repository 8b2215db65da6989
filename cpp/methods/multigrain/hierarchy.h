// SPDX-License-Identifier: MIT
// The forest as selection sees it. Nodes are breadth first over all charts: ids rise with the level, children
// of a node are contiguous. A node's resolutions lie in one row of `resolution`, coarsest first.
#pragma once

#include <memory>
#include <vector>

#include "geometry/horizon.h"
#include "method/method.h"
#include "methods/multigrain/errors.h"
#include "methods/multigrain/layout.h"

namespace lodlab::multigrain {

struct Node {
  double lo[3], hi[3];  ///< bounds of its samples in space; everything it is drawn with lies inside
  int32_t row, col;     ///< its first sample
  int32_t parent;       ///< -1: root
  uint32_t first_child;
  uint32_t first_resolution;             ///< index of its coarsest Resolution
  uint8_t children, level, least, most;  ///< resolutions least..most (cells a side: powers of two)
};
static_assert(sizeof(Node) == 72);  // a row of the array "nodes" of the store

struct Resolution {
  float error;         ///< BlockErrors::own over its blocks: for edges not snapped beyond its own stride
  uint32_t triangles;  ///< those that are there: clamped and polar ones left out
};

/// What hides nodes of a planet that closes, wherever they are and whatever is drawn: a sphere below all that
/// any cut draws.
struct Occluder {
  /// Where a node's samples are: directions, and the radius that none of them, nor a triangle, exceeds.
  struct Ground {
    glm::dvec3 axis;
    double angle, highest;
  };

  double radius = 0.0;      ///< 0: none
  std::vector<Cone> nodes;  ///< round all that each is drawn with and the samples there, raised (Horizon)
  std::vector<Ground> ground;
};

/// Which stride is drawn where: log2 of the stride of the node that covers each block.
using StrideMap = std::vector<uint8_t>;

class Forest : public Hierarchy, public std::enable_shared_from_this<Forest> {
 public:
  Forest() = default;  ///< empty: to be filled by hand
  explicit Forest(std::shared_ptr<const Store> store);

  std::vector<NodeInfo> nodes() const override;
  /// Of a planet's positions (lattice.h).
  double quantum() const override;
  int64_t vertices() const override;
  std::unique_ptr<Session> session(const Options& draw_options) const override;

  const Resolution& at(const Node& n, int k) const { return resolution[n.first_resolution + (k - n.least)]; }
  int stride_log2(const Node& n, int k) const { return layout.stride_log2(n.level, k); }

  /// The bound of a node drawn with resolution k beside the strides of the map: own error, and that of each
  /// strip along its edges beside a coarser neighbour.
  double drawn_error(const Node& n, int k, const StrideMap& map) const;
  /// The largest of these over all maps: the stored bound.
  double stored_error(const Node& n, int k) const;
  /// What is hidden in a view: only from an eye above all ground near it, the near plane included.
  Horizon horizon(const Camera& camera) const;
  /// Marks the blocks of a node with its stride.
  void mark(const Node& n, int k, StrideMap& map) const;

  /// The heights of a tile (tiles.h), row by row.
  std::vector<float> tile(int64_t id) const;
  /// The mask of coverage.h.
  Bytes coverage() const;

  std::shared_ptr<const Store> store;
  FieldFrame frame;
  Layout layout;
  BlockErrors errors;  ///< without `low`, and `high` of a planet alone: the nodes' bounds have them
  std::vector<Node> node;
  std::vector<Resolution> resolution;
  uint32_t roots = 0;
  Occluder occluder;
  std::vector<float> fringe;  ///< heights of Layout::fringe_row()
};

}  // namespace lodlab::multigrain
