// SPDX-License-Identifier: MIT
// The cheapest cut that the metric selects for a view (selector.h). From the coarsest cut the fineness rises
// from one place to the next where an edge changes its resolution or a patch splits, and counts are kept; so
// every cut of the view is met once. What lies inside the frustum as a whole only becomes more from there on:
// where that alone is more than what has been found, the way ends.
#include <algorithm>
#include <array>
#include <limits>
#include <queue>
#include <tuple>

#include "methods/seamless/selector.h"

namespace lodlab::seamless {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

/// A visible patch that is on the cut.
struct OnCut {
  Selector::Step step;
  std::array<std::array<double, 3>, 4>
      due;  ///< of each edge: where it has one resolution more; where it splits
  Resolutions k;
  int64_t triangles;
  bool here;
};

struct Event {
  double fineness;
  uint32_t patch;                             ///< of those on the cut
  bool operator<(const Event& other) const {  // the least on top of a heap
    return std::tie(other.fineness, other.patch) < std::tie(fineness, patch);
  }
};

struct Sum {
  int64_t triangles = 0, nodes = 0, missing = 0;
};

}  // namespace

class Selector::Sweep {
 public:
  Sweep(Selector& selector, const Missing* missing) : selector_(selector), missing_(missing) {
    const Patch root{0, 0, 0};
    add({root, selector.planes_cutting(root, selector.all_planes_)}, selector.coarsest());
    settle(selector.coarsest());
  }

  const Sum& all() const { return all_; }
  /// Of what is seen as a whole: no finer cut has less.
  const Sum& inside() const { return inside_; }
  double fineness() const { return fineness_; }
  /// Where the next change is; infinite: there is none.
  double next() const { return events_.empty() ? kNever : events_.top().fineness; }
  void advance() { settle(next()); }

 private:
  /// All changes up to here.
  void settle(double fineness) {
    fineness_ = fineness;
    while (!events_.empty() && events_.top().fineness <= fineness) {
      const uint32_t at = events_.top().patch;
      events_.pop();
      if (patches_[at].here) change(at);
    }
  }

  void add(const Step& step, double fineness) {
    if (step.planes == kOutside) return;
    ++selector_.traversed;
    const Layout& layout = selector_.layout_;
    const Patch& p = step.patch;
    OnCut patch{step, {}, {}, 0, true};
    const std::array<double, 4> weight = selector_.tables_.weights(selector_.level_of(p), p);
    std::array<double, 4> distance = selector_.tables_.distances.of(selector_.level_of(p), p);
    const int top = layout.resolutions - 1;
    double split = kNever;
    for (size_t i = 0; i < 4; ++i) {
      distance[i] = std::sqrt(distance[i]);
      const double due = selector_.needed(p, weight[i], distance[i], 1.0);
      if (p.level + 1 < layout.levels) split = std::min(split, due);
      patch.due[i].fill(kNever);
      for (int k = 0; k < top; ++k)
        patch.due[i][static_cast<size_t>(k)] =
            selector_.needed(p, weight[i], distance[i], std::ldexp(1.0, k - top));
    }
    for (auto& edge : patch.due) edge[2] = split;
    const auto at = static_cast<uint32_t>(patches_.size());
    patch.k = {};
    patch.triangles = 0;
    patches_.push_back(patch);
    count(patches_[at], 1);
    fineness_ = fineness;
    refresh(at);
  }

  int64_t triangles(const OnCut& patch) const {
    const Patch& p = patch.step.patch;
    return selector_.mesh_.triangles(patch.k, selector_.layout_.clip_x(p), selector_.layout_.clip_y(p));
  }
  void count(OnCut& patch, int sign) {
    const auto tell = [&](Sum& sum) {
      sum.triangles += sign * patch.triangles;
      sum.nodes += sign;
    };
    tell(all_);
    if (patch.step.planes == 0) tell(inside_);
    if (missing_ != nullptr && (*missing_)(patch.step.patch)) all_.missing += sign;
  }

  /// Resolutions as they are here; the next change goes into the queue.
  void refresh(uint32_t at) {
    OnCut& patch = patches_[at];
    double next = patch.due[0][2];
    for (size_t i = 0; i < 4; ++i) {
      int k = 0;
      for (size_t j = 0; j < 2; ++j) {
        if (patch.due[i][j] <= fineness_) {
          ++k;
        } else {
          next = std::min(next, patch.due[i][j]);
        }
      }
      patch.k[i] = k;
    }
    const int64_t now = triangles(patch), more = now - patch.triangles;
    patch.triangles = now;
    all_.triangles += more;
    if (patch.step.planes == 0) inside_.triangles += more;
    if (next < kNever) events_.push({std::max(next, fineness_), at});
  }

  void change(uint32_t at) {
    if (patches_[at].due[0][2] > fineness_) return refresh(at);
    patches_[at].here = false;
    count(patches_[at], -1);
    const Step step = patches_[at].step;
    const int branch = selector_.layout_.branch_log2();
    const Level& below = selector_.levels_[step.patch.level + 1];
    const int64_t last_y = std::min((step.patch.y + 1) << branch, below.down);
    const int64_t last_x = std::min((step.patch.x + 1) << branch, below.across);
    for (int64_t y = step.patch.y << branch; y < last_y; ++y) {
      for (int64_t x = step.patch.x << branch; x < last_x; ++x) {
        const Patch child{step.patch.level + 1, y, x};
        add({child, selector_.planes_cutting(child, step.planes)}, fineness_);
      }
    }
  }

  Selector& selector_;
  const Missing* missing_;
  std::vector<OnCut> patches_;
  std::priority_queue<Event> events_;
  Sum all_, inside_;
  double fineness_ = 0.0;
};

/// Cuts are tried from the best that was met on: what is drawn may differ from what was counted where a
/// stretch of fineness is no longer than rounding.
Selector::Cheapest Selector::cheapest(const Limits& limits, double most, const Missing* missing) {
  constexpr int64_t kMany = std::numeric_limits<int64_t>::max();
  const auto order = [&](const Sum& sum) {  // as LeastCut has it
    if (limits.triangles == kMany) return std::tuple(sum.nodes, sum.triangles);
    return std::tuple(limits.nodes == kMany ? 0 : std::max(sum.nodes, limits.nodes), sum.triangles);
  };
  const auto fits = [&](const Sum& sum) { return limits.keep({sum.triangles, sum.nodes}); };
  std::vector<Cheapest> met;
  auto least = std::tuple(kMany, kMany);
  for (Sweep sweep(*this, missing);; sweep.advance()) {
    const double from = sweep.fineness(), to = sweep.next();
    const bool found = !met.empty() && met.back().fits;
    if (found ? from > most || !fits(sweep.inside()) : order(sweep.inside()) > least) break;
    const Sum& sum = sweep.all();
    const bool better = fits(sum) ? !found || from <= most : !found && order(sum) < least;
    if (better && sum.missing == 0) {
      const double between = from == coarsest() ? from
                             : to < kNever      ? 0.5 * (from + to)
                                                : std::max(2.0 * from, 0.5 * from + 1.0 / gain());
      met.push_back({between, fits(sum), {sum.triangles, sum.nodes}});
      least = order(sum);
    }
    if (to == kNever) break;
  }
  while (met.size() > 1) {
    const LeastCut::Cost drawn = count(met.back().fineness, {});
    if (drawn.triangles == met.back().cost.triangles && drawn.nodes == met.back().cost.nodes) break;
    met.pop_back();
  }
  return met.back();
}

}  // namespace lodlab::seamless
