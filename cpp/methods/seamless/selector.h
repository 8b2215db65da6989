// SPDX-License-Identifier: MIT
// One view's way through the implicit hierarchy: what its patches are at a given precision, and the least
// precision that a pixel error or a hard budget asks for. select.cpp makes cuts of it.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "geometry/view.h"
#include "method/least_cut.h"
#include "method/projector.h"
#include "methods/seamless/mesh.h"
#include "methods/seamless/metric.h"

namespace lodlab::seamless {

class Selector {
 public:
  /// A patch on the way down; bits of `planes` are planes of the frustum that may cut it.
  struct Step {
    Patch patch;
    uint8_t planes;
  };
  /// Memory that frames use again.
  struct Scratch {
    std::vector<Step> here, parted;
    size_t leaves = 0;  ///< of the last cut
  };

  /// `camera`: null sees everything.
  Selector(const Hierarchy& hierarchy, const PatchMesh& mesh, const Metric& metric,
           const Projector& projector, const Camera* camera, Scratch& scratch);

  struct Active {
    Patch patch;
    int64_t id;
    Resolutions k;
    bool visible;
    double weight;  ///< the largest of its edges
  };
  enum class Scope { kWhole, kVisible };
  /// Calls leaf(Active) for every patch of the cut at a precision, or every visible one, until it returns
  /// false.
  template <class Leaf>
  void traverse(const Precision& precision, Scope scope, Leaf&& leaf);

  /// The least fineness at which no visible patch projects to more than tau, but for what the last level
  /// cannot better.
  double fineness_for(double tau);
  using Limits = LeastCut::Limits;
  struct Cheapest {
    double fineness;
    bool fits;  ///< it keeps the hard budgets
    LeastCut::Cost cost;
  };
  /// Visible patches at a fineness, until they break the limits.
  LeastCut::Cost count(double fineness, const Limits& limits);
  /// By bisection a great fineness, at most `most`, that keeps the hard budgets; where the coarsest cut does
  /// not, either, there may be none, or one that was passed over.
  Cheapest within(const Limits& limits, double most);
  using Missing = std::function<bool(const Patch&)>;
  /// Of all that keep the hard budgets the greatest fineness that is at most `most`, or the least above it;
  /// where none does, the one whose cut is the cheapest, in the order of LeastCut. `missing`: null, or
  /// patches that cannot be drawn; no block is heeded.
  Cheapest cheapest(const Limits& limits, double most, const Missing* missing);

  /// Bound of a patch as drawn, source units, and as pixels. With `metric=distance` what is typical.
  double error(const Patch& p, const Resolutions& k) const;
  /// The same of a patch that nobody sees: a bound at any resolutions, which its weights are, and cheap.
  double unseen_error(const Active& a) const;
  /// The larger of `most` and what an error projects to.
  double pixels(const Patch& p, double error, double most);
  /// Everything at its coarsest: the root alone.
  double coarsest() const;
  /// Half as fine.
  double coarser(double fineness) const;

  /// Keeps a patch from splitting at this precision or a coarser one, for want of its children's heights:
  /// what is missing counts as farther away. METHOD.md, Paging, says why all edges still agree.
  void block(const Patch& p, const Precision& precision);
  void unblock() { blocks_.clear(); }
  size_t blocks() const { return blocks_.size(); }
  /// What is drawn stands in for the cut at this precision.
  void stand_in_for(const Precision& precision) { wanted_ = precision; }
  /// Whether a patch would split if nothing were blocked, or in the cut that it stands in for.
  bool blocked(const Patch& p, const Precision& precision) const;

  int64_t traversed = 0;  ///< patches looked at, by all of the above

 private:
  static constexpr uint8_t kOutside = 0xff;
  class Sweep;  // cheapest.cpp

  /// What loops over patches look up: copied there, so that nothing can alter it in between.
  struct Tables {
    const uint16_t* codes;  ///< null: the paper's weights
    const double* by_code;  ///< weights, by codes & mask
    unsigned mask;
    double base;
    Distances distances;

    std::array<double, 4> weights(const Level& level, const Patch& p) const;
    Edges edges(const Level& level, const Patch& p, const std::array<double, 4>& weight,
                const Precision& precision) const {
      return {reach(level, weight, precision.rho), distances.of(level, p), precision.away};
    }
    Reach reach(const Level& level, const std::array<double, 4>& weight, double rho) const;
  };
  Edges edges(const Tables& tables, const Level& level, const Patch& p, const std::array<double, 4>& weight,
              const Precision& precision) const {
    if (blocks_.empty()) return tables.edges(level, p, weight, precision);
    return {tables.reach(level, weight, precision.rho), pushed_away(p), precision.away};
  }
  /// Squared distances of a patch's edges, with what is blocked.
  std::array<double, 4> pushed_away(const Patch& p) const;
  /// Of planes that cut what a patch is a part of: inside all of them it is, too (section 4).
  uint8_t planes_cutting(const Patch& p, uint8_t planes) const {
    return planes == 0 || planes == kOutside ? planes : planes_of(p, planes);
  }
  uint8_t planes_of(const Patch& p, uint8_t planes) const;
  bool parts_for(const Patch& p, double tau, double safe, double& fineness) const;
  std::array<double, 4> edge_errors(const Patch& p, const Resolutions& k) const;
  /// The fineness at which an edge's epsilon exceeds a threshold.
  double needed(const Patch& p, double weight, double distance, double threshold) const;
  /// What a visible patch at this precision asks for in order to be within tau; nothing when it is.
  std::optional<double> asks(const Patch& p, const std::array<double, 4>& weight, const Edges& edges,
                             double tau, double safe) const;
  /// To `here_`, those of `parted_`, a row of patches after the other.
  void push_children();
  void push_children(const Step& step, int64_t y);
  struct Bounds {
    double lo[3], hi[3];
  };
  Bounds bounds(const Patch& p) const;
  /// Whether a patch is at least as far from the eye.
  bool beyond(const Bounds& b, double distance) const {
    const std::array<double, 3> square = axis_squares(projector_.eye, b.lo, b.hi);
    return square[0] + square[1] + square[2] >= distance * distance;
  }

  /// What makes a fineness one of about 1.
  double gain() const { return metric_.roughness ? std::max(hierarchy_.book().largest(), 1e-300) : 1024.0; }

  const Level& level_of(const Patch& p) const { return levels_[p.level]; }

  const Hierarchy& hierarchy_;
  const Layout& layout_;
  const Level* levels_;
  const PatchMesh& mesh_;
  Metric metric_;
  Projector projector_;
  Tables tables_;
  /// Of the frustum's planes: normal, and the distance of the field's nearer and farther height range.
  struct Plane {
    double x, y, near_z, far_z;
  };
  std::array<Plane, 5> planes_;
  uint8_t all_planes_;
  std::vector<Step>&here_, &parted_;
  /// A place that counts as so far away, other places as nearer by their distance from it. Source units, from
  /// the field's first sample.
  struct Block {
    double east, south, distance;
  };
  std::vector<Block> blocks_;
  std::optional<Precision> wanted_;
  double most_pixels_ = -1.0, safe_ = 0.0;  ///< of pixels()
};

inline std::array<double, 4> Selector::Tables::weights(const Level& level, const Patch& p) const {
  if (codes == nullptr) return Metric::kPaperWeights;
  const uint16_t* across = codes + level.first_edge + p.y * level.across + p.x;
  const uint16_t* down =
      codes + level.first_edge + level.across * (level.down + 1) + p.y * (level.across + 1) + p.x;
  return {by_code[across[0] & mask], by_code[down[1] & mask], by_code[across[level.across] & mask],
          by_code[down[0] & mask]};
}

inline Reach Selector::Tables::reach(const Level& level, const std::array<double, 4>& w, double rho) const {
  Reach out;
  for (size_t i = 0; i < 4; ++i) out[i] = (base + rho * w[i]) * level.length;
  return out;
}

inline Selector::Bounds Selector::bounds(const Patch& p) const {
  const FieldFrame& f = hierarchy_.frame;
  return {{f.x0 + static_cast<double>(layout_.col(p)) * f.dx,
           f.y0 - static_cast<double>(layout_.end_row(p)) * f.dy, f.z_min},
          {f.x0 + static_cast<double>(layout_.end_col(p)) * f.dx,
           f.y0 - static_cast<double>(layout_.row(p)) * f.dy, f.z_max}};
}

inline double Selector::unseen_error(const Active& a) const {
  if (!metric_.roughness) return error(a.patch, a.k);
  return a.weight * level_of(a.patch).length;
}

/// Level by level, each row by row: leaves come in the order of their ids.
template <class Leaf>
void Selector::traverse(const Precision& precision, Scope scope, Leaf&& leaf) {
  const Patch root{0, 0, 0};
  const Tables tables = tables_;
  here_.assign(1, {root, planes_cutting(root, all_planes_)});
  while (!here_.empty()) {
    parted_.clear();
    const Level level = level_of(here_.front().patch);  // of all that are here
    const bool last = here_.front().patch.level + 1 == layout_.levels;
    for (const Step& step : here_) {
      if (scope == Scope::kVisible && step.planes == kOutside) continue;
      ++traversed;
      const Patch& p = step.patch;
      const std::array<double, 4> weight = tables.weights(level, p);
      const Edges seen = edges(tables, level, p, weight, precision);
      if (!last && seen.split()) {
        parted_.push_back(step);
        continue;
      }
      const double most = std::max(std::max(weight[0], weight[1]), std::max(weight[2], weight[3]));
      Active active{p, level.id(p), {}, step.planes != kOutside, most};
      for (size_t i = 0; i < 4; ++i) active.k[i] = seen.resolution(i, layout_.resolutions);
      if (!leaf(active)) return;
    }
    here_.clear();
    push_children();
  }
}

}  // namespace lodlab::seamless
