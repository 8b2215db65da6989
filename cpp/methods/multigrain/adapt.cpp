// SPDX-License-Identifier: MIT
// The cut and its moves. Every move keeps the counts, goes into the journal, and can be undone.
#include "methods/multigrain/adapt.h"

#include <algorithm>
#include <cmath>

namespace lodlab::multigrain {

Adapter::Adapter(const Forest& forest, Projection projection)
    : forest_(forest),
      projection_(projection),
      projector_(projection, make_camera({})),
      spot_(forest.node.size()),
      split_(forest.node.size()),
      merge_(forest.node.size()),
      refine_(forest.node.size()),
      coarsen_(forest.node.size()),
      owner_(static_cast<size_t>(forest.layout.blocks_x() * forest.layout.blocks_y()), kNone) {}

void Adapter::forget() {
  for (const uint32_t id : cut_) {
    Spot& spot = spot_[id];
    if (spot.k >= 0 && node(id).parent >= 0) spot_[static_cast<size_t>(node(id).parent)].children_on = 0;
    spot.k = -1;
    spot.listed = false;
  }
  cut_.clear();
  sorted_ = 0;
  triangles_ = nodes_ = active_ = 0;
}

/// The last frame's cut under this frame's view: culled nodes fall back to their least resolution.
void Adapter::begin() {
  moves_.clear();
  if (cut_.empty()) {
    start_at_roots();
    return;
  }
  triangles_ = nodes_ = 0;
  for (const uint32_t id : cut_) {
    if (spot_[id].k < 0) continue;
    Spot& spot = look(id);
    if (spot.visible) {
      triangles_ += triangles(id, spot.k);
      ++nodes_;
      spot.rho = project(id, spot.k);
    } else {
      spot.k = static_cast<int8_t>(node(id).least);
      spot.rho = 0.0;
    }
  }
}

void Adapter::start_at_roots() {
  forget();
  moves_.clear();
  for (uint32_t id = 0; id < forest_.roots; ++id) put(id, node(id).least);
}

/// Whether the coarsest cut keeps the hard budgets; if not, it is what is drawn.
bool Adapter::roots_fit() {
  int64_t sum = 0, count = 0;
  for (uint32_t id = 0; id < forest_.roots; ++id) {
    if (!look(id).visible) continue;
    sum += triangles(id, node(id).least);
    ++count;
  }
  return sum <= frame_.triangles && count <= frame_.nodes;
}

/// Whether the node is seen, and from where: once a frame.
Adapter::Spot& Adapter::look(uint32_t id) {
  Spot& spot = spot_[id];
  if (spot.seen == frames_) return spot;
  spot.seen = frames_;
  const Node& n = node(id);
  spot.visible = frame_.camera->sees({{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}});
  if (spot.visible) spot.place = projector_.place(n.lo, n.hi);
  return spot;
}

double Adapter::project(uint32_t id, int k) const {
  return projector_.project(forest_.at(node(id), k).error, spot_[id].place);
}

/// The largest error of a visible node that is within so many pixels. Where the view cannot see any
/// displacement, or the pixels are endless, the inverse is no number: any error is.
double Adapter::allowed(uint32_t id, double pixels) const {
  const double error = projector_.inverse(pixels, spot_[id].place);
  return std::isnan(error) ? std::numeric_limits<double>::infinity() : error;
}

/// The coarsest resolution within so many pixels, else the finest. Culled nodes: the coarsest.
int Adapter::first_within(uint32_t id, double pixels) {
  const Node& n = node(id);
  int k = n.least;
  if (!look(id).visible) return k;
  const double error = allowed(id, pixels);
  const Resolution* row = &forest_.resolution[n.first_resolution];
  while (k < n.most && row->error > error) ++k, ++row;
  return k;
}

void Adapter::put(uint32_t id, int k) {
  Spot& spot = look(id);
  spot.k = static_cast<int8_t>(k);
  spot.rho = 0.0;
  if (spot.visible) {
    spot.rho = project(id, k);
    triangles_ += triangles(id, k);
    ++nodes_;
  }
  ++active_;
  if (node(id).parent >= 0) ++spot_[static_cast<size_t>(node(id).parent)].children_on;
  if (!spot.listed) cut_.push_back(id);
  spot.listed = true;
}

void Adapter::take(uint32_t id) {
  Spot& spot = spot_[id];
  if (spot.visible) {
    triangles_ -= triangles(id, spot.k);
    --nodes_;
  }
  spot.k = -1;
  --active_;
  if (node(id).parent >= 0) --spot_[static_cast<size_t>(node(id).parent)].children_on;
}

/// Gives a node on the cut another resolution.
void Adapter::resolve(uint32_t id, int k) {
  Spot& spot = spot_[id];
  if (spot.k == k) return;
  moves_.push_back({id, spot.k, false, {}});
  if (spot.visible) {
    triangles_ += triangles(id, k) - triangles(id, spot.k);
    spot.rho = project(id, k);
  }
  spot.k = static_cast<int8_t>(k);
}

void Adapter::merge(uint32_t id, int k) {
  const Node& n = node(id);
  Move move{id, -1, false, {}};
  for (uint32_t c = 0; c < n.children; ++c) {
    move.children[c] = spot_[n.first_child + c].k;
    take(n.first_child + c);
  }
  put(id, k);
  moves_.push_back(move);
}

/// Takes back all moves but the first so many. The queues are not told.
void Adapter::undo(size_t moves) {
  while (moves_.size() > moves) {
    const Move move = moves_.back();
    const Node& n = node(move.node);
    if (move.k < 0) {
      take(move.node);
      for (uint32_t c = 0; c < n.children; ++c) put(n.first_child + c, move.children[c]);
    } else if (move.split) {
      for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) take(c);
      put(move.node, move.k);
    } else {
      resolve(move.node, move.k);
      moves_.pop_back();  // the way back is no move
    }
    moves_.pop_back();
  }
}

/// Brings `cut_` in order: sorted, without stale ids.
void Adapter::list_cut() {
  const auto stale = [this](uint32_t id) {
    if (spot_[id].k >= 0) return false;
    spot_[id].listed = false;
    return true;
  };
  const auto middle = cut_.begin() + static_cast<std::ptrdiff_t>(sorted_);
  const auto old_end = std::remove_if(cut_.begin(), middle, stale);
  const auto new_end = std::remove_if(middle, cut_.end(), stale);
  std::sort(middle, new_end);
  scratch_.resize(static_cast<size_t>((old_end - cut_.begin()) + (new_end - middle)));
  std::merge(cut_.begin(), old_end, middle, new_end, scratch_.begin());
  cut_.swap(scratch_);
  sorted_ = cut_.size();
}

/// A node can be bettered when its error is above the target and it has a finer stride or children of one.
Adapter::Score Adapter::score() const {
  Score score{0.0, triangles_, active_};
  for (const uint32_t id : cut_) {
    const Spot& spot = spot_[id];
    if (spot.k < 0 || spot.rho <= std::max(frame_.target, score.worst)) continue;
    const Node& n = node(id);
    if (spot.k < n.most || (n.children > 0 && (!local_ || stride(id) > 0))) score.worst = spot.rho;
  }
  return score;
}

}  // namespace lodlab::multigrain
