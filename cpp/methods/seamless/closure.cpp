// SPDX-License-Identifier: MIT
// From the last level to the root, everything in codes of weights, which are whole numbers: a level of half
// the length has the same bound at one octave more.
#include "methods/seamless/closure.h"

#include <algorithm>
#include <array>

namespace lodlab::seamless {
namespace {

constexpr std::array<Edge, 4> kEdges{kNorth, kEast, kSouth, kWest};

class Closure {
 public:
  Closure(const Layout& layout, const std::vector<Level>& levels, const PatchErrors& errors)
      : layout_(layout),
        levels_(levels),
        errors_(errors),
        finest_(layout.resolutions - 1),
        book_(layout.resolutions, largest_weight()) {}

  Closed run() {
    Closed out;
    out.largest_weight = book_.largest();
    out.last_error = last_error();
    out.codes.resize(static_cast<size_t>(layout_.first_edge(layout_.levels)));
    out.typical.resize(static_cast<size_t>(layout_.levels * layout_.resolutions));
    for (level_ = layout_.levels - 1; level_ >= 0; --level_) {
      const auto edges = static_cast<size_t>(layout_.edges(level_));
      low_.assign(edges, 0);
      mid_.assign(edges, 0);
      weight_.assign(edges, 0);
      for_patches(level_, [&](const Patch& p) { take(p, out.last_error); });
      add_typical(out.typical);
      close_bounds();
      close_weights();
      uint16_t* codes = out.codes.data() + levels_[static_cast<size_t>(level_)].first_edge;
      for (size_t i = 0; i < edges; ++i) {
        codes[i] = book_.encode(weight_[i], low_[i], mid_[i]);
        low_[i] = static_cast<int>(book_.low_code(codes[i]));  // it may have been raised
      }
      child_low_.swap(low_);
      child_weight_.swap(weight_);
    }
    return out;
  }

 private:
  template <class Visit>
  void for_patches(int level, const Visit& visit) const {
    for (int64_t id = layout_.first(level); id < layout_.first(level + 1); ++id) visit(layout_.at(id));
  }

  /// An error as a weight, rounded up.
  double relative(int level, double error) const {
    return error / levels_[static_cast<size_t>(level)].length * (1.0 + 0x1p-50);
  }

  double largest_weight() const {
    double largest = 0.0;
    for (int level = 0; level < layout_.levels; ++level) {
      for_patches(level, [&](const Patch& p) {
        for (const Edge e : kEdges) {
          for (int k = 0; k <= finest_; ++k)
            largest = std::max(largest, (1 << k) * relative(level, errors_.at(layout_.id(p), e, k)));
        }
      });
    }
    return largest;
  }

  double last_error() const {
    float worst = 0.0f;
    for_patches(layout_.levels - 1, [&](const Patch& p) {
      for (const Edge e : kEdges) worst = std::max(worst, errors_.at(layout_.id(p), e, finest_));
    });
    return worst;
  }

  int code_of(int level, double error) const { return book_.weight_code_of(relative(level, error)); }
  size_t index(const Patch& p, Edge e) const { return static_cast<size_t>(layout_.edge(p, e)); }

  /// What was measured in a patch, and what its children need.
  void take(const Patch& p, double last_error_of) {
    const int64_t id = layout_.id(p);
    for (const Edge e : kEdges) {
      const size_t i = index(p, e);
      low_[i] = std::max(low_[i], code_of(level_, errors_.at(id, e, 0)));
      if (finest_ == 2) mid_[i] = std::max(mid_[i], code_of(level_, errors_.at(id, e, 1)));
      const int octaves = finest_ * book_.steps();  // from a child's length to this one's
      const auto raise = [&](int child_low) {
        if (child_low == 0) return;
        mid_[i] = std::max({mid_[i], child_low - octaves, 1});  // with two resolutions it has no other use
        weight_[i] = std::max(weight_[i], child_low);
      };
      if (level_ + 1 == layout_.levels) {
        const int finest = code_of(level_, last_error_of);
        if (finest > 0) raise(finest + octaves);
        continue;
      }
      for_child_edges(layout_, p, e, [&](int64_t child, bool inner) {
        raise(child_low_[static_cast<size_t>(child)]);
        if (!inner) weight_[i] = std::max(weight_[i], child_weight_[static_cast<size_t>(child)]);
      });
    }
  }

  /// The largest error in a patch with all its edges at one resolution.
  float uniform(const Patch& p, int k) const {
    float worst = 0.0f;
    if (k == finest_ && p.level + 1 < layout_.levels) {
      const int branch = layout_.branch_log2();
      const Level& next = levels_[static_cast<size_t>(p.level + 1)];
      for (int64_t y = p.y << branch; y < std::min((p.y + 1) << branch, next.down); ++y) {
        for (int64_t x = p.x << branch; x < std::min((p.x + 1) << branch, next.across); ++x)
          worst = std::max(worst, uniform({p.level + 1, y, x}, 0));
      }
      return worst;
    }
    for (const Edge e : kEdges) worst = std::max(worst, errors_.at(layout_.id(p), e, k));
    return worst;
  }

  void add_typical(std::vector<double>& out) const {
    const double patches = static_cast<double>(layout_.first(level_ + 1) - layout_.first(level_));
    for (int k = 0; k <= finest_; ++k) {
      double sum = 0.0;
      for_patches(level_, [&](const Patch& p) { sum += uniform(p, k); });
      out[static_cast<size_t>(level_ * layout_.resolutions + k)] = sum / patches;
    }
  }

  void close_bounds() {
    for (size_t i = 0; i < low_.size(); ++i) low_[i] = std::max(low_[i], mid_[i]);
  }

  void close_weights() {
    for (size_t i = 0; i < weight_.size(); ++i) {
      const int of_mid = mid_[i] == 0 || finest_ == 1 ? 0 : mid_[i] + book_.steps();
      weight_[i] = std::max({weight_[i], low_[i], of_mid});
    }
    // From the largest down: what is raised to half of one is raised once.
    const int top = book_.weight_code_of(book_.largest());
    std::vector<std::vector<int64_t>> edges_of(static_cast<size_t>(top + 1));
    for (size_t i = 0; i < weight_.size(); ++i)
      edges_of[static_cast<size_t>(weight_[i])].push_back(static_cast<int64_t>(i));
    for (int code = top; code > 0; --code) {
      const int least = std::max(code - book_.steps(), 1);
      // A list grows while it is read where the least code is passed on.
      std::vector<int64_t>& list = edges_of[static_cast<size_t>(code)];
      for (size_t n = 0; n < list.size(); ++n) {
        if (weight_[static_cast<size_t>(list[n])] != code) continue;
        for_patches_beside(list[n], [&](const Patch& p) {
          for (const Edge e : kEdges) {
            int& weight = weight_[index(p, e)];
            if (weight >= least) continue;
            weight = least;
            edges_of[static_cast<size_t>(least)].push_back(layout_.edge(p, e));
          }
        });
      }
    }
  }

  template <class Visit>
  void for_patches_beside(int64_t edge, const Visit& visit) const {
    const Level& level = levels_[static_cast<size_t>(level_)];
    const int64_t wide = level.across, vertical = edge - wide * (level.down + 1);
    if (vertical < 0) {
      const int64_t y = edge / wide, x = edge % wide;
      if (y > 0) visit(Patch{level_, y - 1, x});
      if (y < level.down) visit(Patch{level_, y, x});
    } else {
      const int64_t y = vertical / (wide + 1), x = vertical % (wide + 1);
      if (x > 0) visit(Patch{level_, y, x - 1});
      if (x < wide) visit(Patch{level_, y, x});
    }
  }

  const Layout& layout_;
  const std::vector<Level>& levels_;
  const PatchErrors& errors_;
  const int finest_;
  const CodeBook book_;
  int level_ = 0;
  std::vector<int> low_, mid_, weight_;  ///< of the edges of the level, as codes of weights
  std::vector<int> child_low_, child_weight_;
};

}  // namespace

Closed close_errors(const Layout& layout, const std::vector<Level>& levels, const PatchErrors& errors) {
  return Closure(layout, levels, errors).run();
}

}  // namespace lodlab::seamless
