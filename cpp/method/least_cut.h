// SPDX-License-Identifier: MIT
// The cheapest cut of a tree for a view. A culled node costs nothing, so that a split, whose children may be
// out of sight, can cost less than the node. Where hard budgets do not hold the roots, this is what a method
// starts from, and what it draws where nothing fits.
//
// Linear in the nodes that are seen, but where triangles and nodes are both limited and neither the leanest
// nor the sparsest cut keeps both: then fronts (for each number of nodes the fewest triangles) are added up.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

namespace lodlab {

class LeastCut {
 public:
  struct Item {
    uint32_t node;
    int32_t parent;     ///< index of the item of its parent, which comes before it; -1: a root
    int64_t triangles;  ///< of the node, at its coarsest
    bool splits;        ///< its children may take its place; those that are no items cost nothing
  };
  struct Cost {
    int64_t triangles = 0, nodes = 0;
  };
  static constexpr int64_t kNone = std::numeric_limits<int64_t>::max();
  struct Limits {
    int64_t triangles = kNone, nodes = kNone;
    bool any() const { return triangles != kNone || nodes != kNone; }
    bool keep(const Cost& c) const { return c.triangles <= triangles && c.nodes <= nodes; }
  };

  /// Visible nodes, parents before children, numbers ascending. A cut that keeps the limits, if there is one;
  /// else of the cuts within the nodes the one with the fewest triangles; where none is within them, of those
  /// with the fewest nodes.
  LeastCut(std::vector<Item> items, const Limits& limits);

  const Cost& cost() const { return cost_; }
  /// Of the tree's nodes, those that are split for it, ascending.
  const std::vector<uint32_t>& split() const { return split_; }

 private:
  struct Costs {
    Cost lean;    ///< the fewest triangles, then the fewest nodes
    Cost sparse;  ///< the fewest nodes, then the fewest triangles
    bool lean_splits = false, sparse_splits = false;
  };
  /// A point of a front: the sum of two others, or a mark in place of the first, and an item.
  struct Point {
    Cost cost;
    uint32_t left, right;
  };
  using Front = std::vector<uint32_t>;  ///< indices of points: nodes ascend, triangles descend

  void weigh();
  void take(bool lean);
  void take_front(const Limits& limits);
  Front sum(const Front& a, const Front& b, const Limits& limits);
  uint32_t add(const Cost& cost, uint32_t left, uint32_t right);
  /// Keeps of all points those that no other one beats in both.
  Front best(Front points) const;

  std::vector<Item> items_;
  std::vector<Costs> costs_;  ///< by item
  Costs all_;
  std::vector<Point> points_;
  Cost cost_;
  std::vector<uint32_t> split_;
};

}  // namespace lodlab
