// SPDX-License-Identifier: MIT
// The cut and its moves. Every move keeps the counts, goes into the journal, and can be undone.
#include "methods/multigrain/adapt.h"

#include <algorithm>
#include <cmath>

namespace lodlab::multigrain {
namespace {

/// Whether the box lies inside all planes of the frustum.
bool contains(const Camera& camera, const Box& box) {
  const glm::dvec3 half = 0.5 * (box.hi - box.lo);
  const glm::dvec3 middle = box.center() - camera.eye;
  for (size_t i = 0; i < camera.planes.size(); ++i) {
    const double reach = glm::dot(glm::abs(camera.planes[i]), half);
    if (glm::dot(camera.planes[i], middle) - reach < (i == 4 ? camera.near_plane : 0.0)) return false;
  }
  return true;
}

}  // namespace

Adapter::Adapter(const Forest& forest, Projection projection, Paging* paging)
    : forest_(forest),
      projection_(projection),
      paging_(paging != nullptr && paging->streams() ? paging : nullptr),
      projector_(projection, make_camera({})),
      spot_(forest.node.size()),
      split_(forest.node.size()),
      merge_(forest.node.size()),
      refine_(forest.node.size()),
      coarsen_(forest.node.size()),
      owner_(static_cast<size_t>(forest.layout.blocks_x() * forest.layout.blocks_y()), kNone) {
  count_fewest();
}

/// For every node and resolution, the fewest triangles that its subtree needs for the same error, all of it
/// seen and equally far.
void Adapter::count_fewest() {
  fewest_.resize(forest_.resolution.size());
  for (size_t id = forest_.node.size(); id-- > 0;) {
    const Node& n = forest_.node[id];
    for (int k = n.least; k <= n.most; ++k) {
      const Resolution& own = forest_.at(n, k);
      uint32_t below = 0;
      bool reached = n.children > 0;
      for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) {
        const Node& child = node(c);
        int child_k = child.least;
        while (child_k < child.most && forest_.at(child, child_k).error > own.error) ++child_k;
        below += fewest(c, child_k);
        reached = reached && forest_.at(child, child_k).error <= own.error;
      }
      fewest_[n.first_resolution + static_cast<size_t>(k - n.least)] =
          reached ? std::min(own.triangles, below) : own.triangles;
    }
  }
}

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

/// The last frame's cut under this frame's view: culled nodes fall back to their least resolution, nodes
/// whose heights went to the finest one that is left.
void Adapter::begin() {
  moves_.clear();
  queues_up_ = false;
  if (cut_.empty()) {
    start_coarsest();
    return;
  }
  triangles_ = nodes_ = 0;
  for (const uint32_t id : cut_) {
    if (spot_[id].k < 0) continue;
    Spot& spot = look(id);
    if (spot.visible) {
      set_resolution(id, std::min(spot.k, spot.most));
      triangles_ += triangles(id, spot.k);
      ++nodes_;
    } else {
      set_resolution(id, node(id).least);
    }
  }
}

/// The roots; where they break a hard budget, the cheapest cut.
void Adapter::start_coarsest() {
  forget();
  moves_.clear();
  queues_up_ = false;
  const auto place = [this](const auto& self, uint32_t id) -> void {
    const Node& n = node(id);
    if (!std::binary_search(least_.begin(), least_.end(), id)) return put(id, n.least);
    for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) self(self, c);
  };
  for (uint32_t id = 0; id < forest_.roots; ++id) place(place, id);
}

/// Whether any cut keeps the hard budgets; the cheapest one is what is drawn if not. Its resolutions are the
/// least ones, whose heights are always there.
bool Adapter::coarsest_fits() {
  const LeastCut::Limits limits{frame_.triangles, frame_.nodes};
  std::vector<LeastCut::Item> items;
  const auto add = [&](uint32_t id, int32_t parent) {
    if (look(id).visible) items.push_back({id, parent, triangles(id, node(id).least), node(id).children > 0});
  };
  least_.clear();
  least_cost_ = {};
  for (uint32_t id = 0; id < forest_.roots; ++id) {
    if (!look(id).visible) continue;
    least_cost_.triangles += triangles(id, node(id).least);
    ++least_cost_.nodes;
  }
  if (limits.keep(least_cost_)) return true;
  for (uint32_t id = 0; id < forest_.roots; ++id) add(id, -1);
  for (size_t i = 0; i < items.size(); ++i) {
    const Node& n = node(items[i].node);
    for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) add(c, static_cast<int32_t>(i));
  }
  const LeastCut least(std::move(items), limits);
  least_ = least.split();
  least_cost_ = least.cost();
  return limits.keep(least_cost_);
}

/// Whether the node is seen, from where, and which of its heights are there: once a frame.
Adapter::Spot& Adapter::look(uint32_t id) {
  Spot& spot = spot_[id];
  if (spot.seen == frames_) return spot;
  spot.seen = frames_;
  const Node& n = node(id);
  spot.most = static_cast<int8_t>(paging_ != nullptr ? paging_->available(n) : n.most);
  if (n.parent >= 0) {  // boxes nest
    const Spot& parent = spot_[static_cast<size_t>(n.parent)];
    spot.inside = parent.seen == frames_ && parent.inside;
  } else {
    spot.inside = false;
  }
  if (!spot.inside) {
    const Box box{{n.lo[0], n.lo[1], n.lo[2]}, {n.hi[0], n.hi[1], n.hi[2]}};
    spot.visible = frame_.camera->sees(box);
    spot.inside = spot.visible && contains(*frame_.camera, box);
  } else {
    spot.visible = true;
  }
  if (forest_.occluder.radius > 0.0 && horizon_.hides(forest_.occluder.nodes[id])) spot.visible = false;
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

/// The coarsest resolution within so many pixels, else the finest that is there. Culled nodes: the coarsest.
int Adapter::first_within(uint32_t id, double pixels) {
  const Node& n = node(id);
  int k = n.least;
  if (!look(id).visible) return k;
  const double error = allowed(id, pixels);
  const Resolution* row = &forest_.resolution[n.first_resolution];
  while (k < spot_[id].most && row->error > error) ++k, ++row;
  return k;
}

void Adapter::set_resolution(uint32_t id, int k) {
  Spot& spot = spot_[id];
  spot.k = static_cast<int8_t>(k);
  spot.stride = static_cast<int8_t>(forest_.stride_log2(node(id), k));
  spot.rho = spot.visible ? project(id, k) : 0.0;
  if (queues_up_) changed_.push_back(id);
}

void Adapter::put(uint32_t id, int k) {
  Spot& spot = look(id);
  k = std::min<int>(k, spot.most);
  set_resolution(id, k);
  if (spot.visible) {
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
  if (queues_up_) changed_.push_back(id);
  --active_;
  if (node(id).parent >= 0) --spot_[static_cast<size_t>(node(id).parent)].children_on;
}

/// Gives a node on the cut another resolution.
void Adapter::resolve(uint32_t id, int k) {
  Spot& spot = spot_[id];
  if (spot.k == k) return;
  moves_.push_back({id, spot.k, false, {}});
  if (spot.visible) triangles_ += triangles(id, k) - triangles(id, spot.k);
  set_resolution(id, k);
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

/// What could be better: errors above the target of nodes with a finer resolution, or with children. Nodes
/// that show every sample are left out of the quad-queue's score, where only strides count; so are nodes
/// whose heights are not there. Where a finest_error left out resolutions, coarse leaves count in mode 1: an
/// ancestor may be finer.
Adapter::Score Adapter::score() const {
  Score score{0.0, triangles_, active_};
  for (const uint32_t id : cut_) {
    const Spot& spot = spot_[id];
    if (spot.k < 0 || spot.rho <= std::max(frame_.target, score.worst) || starved(id)) continue;
    const bool below = node(id).children > 0, coarse = spot.stride > 0;
    if (spot.k < node(id).most || (local_ ? below && coarse : below || coarse)) score.worst = spot.rho;
  }
  return score;
}

}  // namespace lodlab::multigrain
