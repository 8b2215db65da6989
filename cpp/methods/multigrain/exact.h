// SPDX-License-Identifier: MIT
// The optimum of a forest for a view and budgets: the smallest largest projected error that any cut with at
// most so many visible triangles and nodes reaches. Errors are the nodes' own; what coarser neighbours cost
// is left out, so it is a lower bound for what is drawn.
//
// Projected errors are finitely many: the smallest that suffices is found by bisection. Whether one does, a
// dynamic program over the trees tells exactly: for each number of nodes the fewest triangles.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "method/projector.h"
#include "methods/multigrain/hierarchy.h"

namespace lodlab::multigrain {

class Exact {
 public:
  struct Limits {
    int64_t triangles = std::numeric_limits<int64_t>::max(), nodes = std::numeric_limits<int64_t>::max();
  };
  struct Choice {
    uint32_t node;
    int k;
  };

  /// The forest outlives it.
  Exact(const Forest& forest, Projection projection, const Camera& camera);
  /// `visible`: by node; a culled node's children are culled. `pixels`: beside Forest::resolution.
  Exact(const Forest& forest, std::vector<uint8_t> visible, std::vector<double> pixels);

  /// No smaller than the target, which is good enough; none when no cut keeps the limits.
  std::optional<double> least_error(const Limits& limits, double target = 0.0);
  /// Of the cuts within this error and number of nodes, of which there must be one, that with the fewest
  /// triangles. Culled nodes have their least resolution. Not sorted.
  std::vector<Choice> cut(double error, int64_t nodes);
  /// Errors that were tried.
  int64_t tried() const { return tried_; }

 private:
  struct Cost {
    int64_t triangles = 0, nodes = 0;
  };
  /// Of a subtree under the error that is tried.
  struct Costs {
    Cost own;     ///< of the node itself at its cheapest resolution within the error
    Cost lean;    ///< the fewest triangles, then the fewest nodes
    Cost sparse;  ///< the fewest nodes, then the fewest triangles
  };
  /// One point of a front: no cut has as few nodes and fewer triangles.
  struct Entry {
    int64_t triangles, nodes;
    uint32_t left, right;  ///< entries that it is the sum of; or a mark below, and the node
  };
  struct Range {
    size_t begin, end;
  };
  static constexpr uint32_t kOwn = 0xffffffffu;      ///< the node itself
  static constexpr uint32_t kLean = 0xfffffffeu;     ///< the cut of `Costs::lean`
  static constexpr uint32_t kNothing = 0xfffffffdu;  ///< nothing is seen

  void list_seen();
  void weigh(double error);
  bool reaches(double error, const Limits& limits);
  int cheapest(const Node& n, double error) const;
  Range front_of(uint32_t id, const Limits& room);
  Range front_of_all(const uint32_t* first, const uint32_t* last, const Limits& room);
  Range sum(const Range& a, const Range& b, const Limits& room);
  Range insert_own(Range front, uint32_t id);
  void choose(const Entry& entry, double error, std::vector<int8_t>& k) const;
  void choose_lean(uint32_t id, double error, std::vector<int8_t>& k) const;
  void list(uint32_t id, const std::vector<int8_t>& k, std::vector<Choice>& out) const;

  const Forest& forest_;
  std::vector<uint8_t> visible_;
  std::vector<double> pixels_;
  std::vector<uint32_t> seen_, seen_roots_;  ///< visible ones, ascending
  std::vector<Costs> costs_;                 ///< by node; 0 where culled
  Cost lean_, sparse_;                       ///< of the whole forest
  std::vector<Entry> entries_;
  std::vector<Entry> sums_;  ///< scratch
  int64_t tried_ = 0;
};

}  // namespace lodlab::multigrain
