// SPDX-License-Identifier: MIT
// Mode 2 by levels: one error for all nodes, the smallest at which the fewest triangles that dual queues find
// are within the budget, and the cut as drawn, stitched, is within the error. So triangles are kept back for
// neighbours that edges need finer. A frame starts from the last one's level, a step lower: the step grows
// while that succeeds.
//
// It ends: a frame makes at most kBisections + 1 + kMostSteps attempts, and otherwise is the quad-queue's.
#include <algorithm>
#include <cmath>
#include <utility>

#include "methods/multigrain/adapt.h"

namespace lodlab::multigrain {
namespace {

constexpr int kBisections = 6;  // where nothing is known
constexpr int kMostSteps = 7;   // upwards, each twice the one before: to six times the level
constexpr double kUp = 1.03, kDown = 0.02, kMostDown = 0.5;

}  // namespace

/// The dual queues at this level, stitched. The largest error as drawn; infinite when a budget is broken.
double Adapter::attempt(double level) {
  undo(stitched_from_);
  frame_.target = level;
  local_ = false;
  select_dual();
  local_ = true;
  stitched_from_ = moves_.size();
  if (nodes_ > frame_.nodes || triangles_ > frame_.triangles) return std::numeric_limits<double>::infinity();
  stitch_it();
  return drawn_worst();
}

double Adapter::attempt_quad(double wanted) {
  undo(stitched_from_);
  frame_.target = wanted;
  select_quad();
  stitched_from_ = moves_.size();
  stitch_it();
  return drawn_worst();
}

double Adapter::drawn_worst() const {
  double worst = 0.0;
  for (const uint32_t id : cut_) {
    if (spot_[id].k >= 0 && spot_[id].visible)
      worst = std::max(worst, projector_.project(drawn_error(id), spot_[id].place));
  }
  return worst;
}

/// Of the nodes that do not show every sample: 0 when all do.
double Adapter::own_worst() const {
  double worst = 0.0;
  for (const uint32_t id : cut_) {
    if (spot_[id].k >= 0 && spot_[id].stride > 0) worst = std::max(worst, spot_[id].rho);
  }
  return worst;
}

/// By bisection from half the quad-queue's largest error to all of it, as drawn; that one's cut is the
/// answer, and 0 the level, when it is what is wanted.
double Adapter::first_level(double wanted) {
  double high = attempt_quad(wanted);
  if (high <= wanted || own_worst() <= 0.0) return 0.0;
  double low = std::max(wanted, 0.3 * own_worst());
  for (int i = 0; i < kBisections; ++i) {
    const double middle = low > 0.0 ? std::sqrt(low * high) : 0.5 * high;
    (attempt(middle) <= middle ? high : low) = middle;
  }
  return high;
}

/// Leaves the cut stitched.
void Adapter::select_level() {
  const double wanted = frame_.target;
  const Camera& camera = *frame_.camera;
  const Level now{0.0,
                  kDown,
                  false,
                  camera.eye,
                  camera.forward,
                  camera.K,
                  frame_.triangles,
                  frame_.nodes,
                  paging_ != nullptr ? paging_->residency().admitted() : 0};
  const Level last = std::exchange(last_level_, now);
  moves_.clear();
  stitched_from_ = 0;
  Level& next = last_level_;
  const bool still = last.same_view(now);
  double level = last.level, drawn = std::numeric_limits<double>::infinity();
  if (level > 0.0 && !still) level = last.finest ? 0.0 : level * (1.0 - last.down);
  const bool new_heights = still && last.heights != now.heights;
  if (last.level > 0.0 && !new_heights) {
    level = std::max(level, wanted);
    drawn = attempt(level);
    if (drawn <= level) next.down = std::min(2.0 * last.down, kMostDown);
    if (drawn > level && level < last.level) level = std::max(level, (1.0 - kDown) * last.level);
  } else {
    level = first_level(wanted);
    if (level > 0.0) {
      level = std::max(level, wanted);
      drawn = attempt(level);
    }
  }
  double step = kUp;
  for (int i = 0; level > 0.0 && drawn > level && i < kMostSteps; ++i, step *= step) {
    level *= step;
    drawn = attempt(level);
  }
  if (level > 0.0 && drawn > level) {
    attempt_quad(wanted);
    level = 0.0;
  }
  next.level = level;
  next.finest = own_worst() <= 0.0;
  if (still) next.down = last.down;
  frame_.target = wanted;
}

}  // namespace lodlab::multigrain
