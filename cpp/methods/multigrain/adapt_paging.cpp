// SPDX-License-Identifier: MIT
// Streaming: what the cut draws from is used in this frame, what it would draw from is asked for, and nodes
// that stand in are marked. Everything else in adaptation knows only that a node's finest resolution is the
// finest one whose heights are there.
#include "methods/multigrain/adapt.h"

namespace lodlab::multigrain {
namespace {

/// Of the target: errors from here on ask for finer heights, which are there when they get above it.
constexpr double kAhead = 0.75;

}  // namespace

/// A node asks for all up to its first resolution within so many pixels; the quad-queue, which refines step
/// by step as triangles allow, for the next one.
int Adapter::finest_wanted(uint32_t id, double pixels) const {
  const Node& n = node(id);
  int k = spot_[id].k;
  if (local_) return std::min<int>(k + 1, n.most);
  const double error = allowed(id, pixels);
  while (k < n.most && forest_.at(n, k).error > error) ++k;
  return k;
}

/// Of the tile that a visible node draws from with resolution k: the projected error that the largest node in
/// it would have at the next coarser one. So it is a function of view and tile, whatever is there, and an
/// exchange of tiles for others of more worth comes to an end.
double Adapter::worth(uint32_t id, int k) {
  const int a = forest_.stride_log2(node(id), k);
  while (node(id).parent >= 0) {
    const auto parent = static_cast<uint32_t>(node(id).parent);
    if (forest_.layout.node_log2(node(parent).level) - a > node(parent).most || !look(parent).visible) break;
    id = parent;
  }
  const int own = forest_.layout.node_log2(node(id).level) - a;
  return own > node(id).least ? project(id, own - 1) : std::numeric_limits<double>::infinity();
}

/// A node above the target is split only once the heights are there that it would need itself: they are in
/// use even where its children make do with less.
void Adapter::keep_parents(uint32_t id) {
  for (int32_t parent = node(id).parent; parent >= 0; parent = node(static_cast<uint32_t>(parent)).parent) {
    const auto at = static_cast<uint32_t>(parent);
    Spot& spot = look(at);
    if (spot.kept_in == frames_) break;
    spot.kept_in = frames_;
    if (!spot.visible) continue;
    const int k = first_within(at, frame_.target);
    paging_->touch(paging_->unit(node(at), k), worth(at, k));
  }
}

/// A node is missing heights when its error is above the target; under a budget of triangles, above what the
/// nodes have come to that could be refined, but for the triangles.
void Adapter::page() {
  double level = frame_.target;
  for (const uint32_t id : cut_) {
    if (local_ && spot_[id].k < spot_[id].most) level = std::max(level, spot_[id].rho);
  }
  // Somewhat smaller errors are the next in turn.
  const double asked = local_ ? std::max(frame_.target, 0.5 * level) : kAhead * frame_.target;
  for (const uint32_t id : cut_) {
    Spot& spot = spot_[id];
    const Node& n = node(id);
    // Culled nodes have their least resolution, or what an edge in sight needs.
    paging_->touch(paging_->unit(n, spot.k),
                   spot.visible ? worth(id, spot.k) : std::numeric_limits<double>::infinity());
    if (!local_) keep_parents(id);
    if (!spot.visible || spot.rho <= asked || !frame_.fits) continue;
    const int finest = finest_wanted(id, asked);
    const double share = local_ || spot.rho > level ? 1.0 : 0.5;  // what is not needed yet gives way
    for (int k = spot.k + 1; k <= finest; ++k) paging_->need(paging_->unit(n, k), share * worth(id, k));
    if (starved(id) && spot.rho > level) spot.missing_in = frames_;
  }
  for (const Held& held : held_) {
    const Spot& neighbour = spot_[held.neighbour];
    if (spot_[held.node].k < 0 || neighbour.k < 0 || !starved(held.neighbour)) continue;
    paging_->need(paging_->unit(node(held.neighbour), neighbour.k + 1), held.rho);
    spot_[held.node].missing_in = frames_;
  }
  held_.clear();
  paging_->ask();
}

}  // namespace lodlab::multigrain
