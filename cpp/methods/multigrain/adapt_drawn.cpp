// SPDX-License-Identifier: MIT
// From the queues' cut to what is drawn. A node's edge is drawn with the stride of a coarser neighbour, which
// may cost it more than its own error (BlockErrors::strip): such neighbours are made finer, culled ones for
// nothing, others within the hard budgets. Strides only fall and nodes are only split: it ends.
#include <algorithm>
#include <cmath>

#include "methods/multigrain/adapt.h"

namespace lodlab::multigrain {

void Adapter::own_blocks(uint32_t id) {
  const Layout& layout = forest_.layout;
  const Node& n = node(id);
  const int q = layout.block_log2(), side = 1 << (layout.levels - 1 - n.level);
  const int64_t x0 = n.col >> q, y0 = n.row >> q;
  const int64_t x1 = std::min(x0 + side, layout.blocks_x()), y1 = std::min(y0 + side, layout.blocks_y());
  for (int64_t y = y0; y < y1; ++y) {
    const auto row = owner_.begin() + y * layout.blocks_x();
    std::fill(row + x0, row + x1, id);
  }
  spot_[id].owns = true;
}

/// visit(block across, edge, block, stride across) for each block along the node's edges beside a coarser
/// neighbour.
template <class Visit>
void Adapter::beside_coarser(uint32_t id, Visit&& visit) const {
  const Layout& layout = forest_.layout;
  const Node& n = node(id);
  const int q = layout.block_log2(), side = 1 << (layout.levels - 1 - n.level);
  const BlockField field = layout.blocks();
  const int64_t wide = field.blocks_x;
  const int x0 = n.col >> q, y0 = n.row >> q;
  const int x1 = std::min(x0 + side, field.blocks_x), y1 = std::min(y0 + side, field.blocks_y);
  const int own = stride(id);
  const auto along = [&](Edge edge, int64_t block, int64_t other, int64_t count, int64_t pitch) {
    uint32_t fine = kNone;  // strides only fall: what is no coarser stays so
    for (int64_t i = 0; i < count; ++i) {
      const uint32_t neighbour = owner_[static_cast<size_t>(other + i * pitch)];
      if (neighbour == fine) continue;
      const int coarse = stride(neighbour);
      if (coarse > own) {
        visit(other + i * pitch, edge, block + i * pitch, coarse);
      } else {
        fine = neighbour;
      }
    }
  };
  const auto from = [&](Edge edge, int x, int y, int count, int64_t pitch) {
    const BlockAt beside = field.across({x, y}, edge);
    if (beside.x >= 0) along(edge, y * wide + x, beside.y * wide + beside.x, count, pitch);
  };
  from(kNorth, x0, y0, x1 - x0, 1);
  from(kSouth, x0, y1 - 1, x1 - x0, 1);
  from(kEast, x1 - 1, y0, y1 - y0, wide);
  from(kWest, x0, y0, y1 - y0, wide);
}

double Adapter::drawn_error(uint32_t id) const {
  const int own = stride(id);
  float error = forest_.at(node(id), spot_[id].k).error;
  beside_coarser(id, [&](int64_t, Edge edge, int64_t block, int coarse) {
    error = std::max(error, forest_.errors.strip_error(block, edge, own, coarse));
  });
  return error;
}

/// Gives the node a stride no larger than wanted, or splits it. False: it cannot be, or the budgets forbid
/// it, or its heights are not there.
bool Adapter::finer(uint32_t id, int wanted_stride) {
  const Node& n = node(id);
  const Spot& spot = spot_[id];
  if (starved(id)) return false;
  const int k = std::min<int>(forest_.layout.node_log2(n.level) - wanted_stride, spot.most);
  if (!spot.visible && k > spot.k) {
    resolve(id, k);
    return true;
  }
  // Children with the same stride are as many triangles, and those that are not beside can stay as they are.
  const int own = spot.k - 1;
  int64_t more_nodes = spot.visible ? -1 : 0, more = spot.visible ? -triangles(id, spot.k) : 0;
  bool splits = n.children > 0;
  for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) {
    splits = splits && most(c) >= own;
    if (!splits || !look(c).visible) continue;
    more += triangles(c, std::max<int>(node(c).least, own));
    ++more_nodes;
  }
  if (splits && triangles_ + more <= frame_.triangles && nodes_ + more_nodes <= frame_.nodes) {
    spot_[id].owns = false;
    split(id, [&](uint32_t c) { return std::max<int>(node(c).least, own); });
    for (uint32_t c = n.first_child; c < n.first_child + n.children; ++c) {
      own_blocks(c);
      work_.push_back(c);
    }
    return true;
  }
  if (k <= spot.k || triangles_ + triangles(id, k) - triangles(id, spot.k) > frame_.triangles) return false;
  resolve(id, k);
  work_.push_back(id);
  return true;
}

/// Every visible node's drawn error within so many pixels, or within its own where that is more.
void Adapter::stitch(double pixels) {
  work_.clear();
  held_.clear();
  for (const uint32_t id : cut_) {
    if (spot_[id].k >= 0 && spot_[id].visible) work_.push_back(id);
  }
  for (size_t head = 0; head < work_.size(); ++head) {
    const uint32_t id = work_[head];
    if (spot_[id].k < 0 || !spot_[id].visible) continue;
    const int own = stride(id);
    const double most = std::max<double>(allowed(id, pixels), forest_.at(node(id), spot_[id].k).error);
    beside_coarser(id, [&](int64_t across, Edge edge, int64_t block, int coarse) {
      int wanted = coarse;
      while (wanted > own && forest_.errors.strip_error(block, edge, own, wanted) > most) --wanted;
      const auto& neighbour = owner_[static_cast<size_t>(across)];
      while (stride(neighbour) > wanted && finer(neighbour, wanted)) {
      }
      if (paging_ == nullptr || stride(neighbour) <= wanted || !starved(neighbour)) return;
      const float error = forest_.errors.strip_error(block, edge, own, stride(neighbour));
      held_.push_back({id, neighbour, projector_.project(error, spot_[id].place)});
    });
  }
}

/// Owners of blocks, and stitching.
void Adapter::stitch_it() {
  for (const uint32_t id : drawn_) {
    if (spot_[id].k < 0) spot_[id].owns = false;
  }
  double worst = frame_.target;
  for (const uint32_t id : cut_) {
    if (spot_[id].k < 0) continue;
    if (!spot_[id].owns) own_blocks(id);
    worst = std::max(worst, spot_[id].rho);
  }
  if (frame_.fits) stitch(worst);
  drawn_.assign(cut_.begin(), cut_.end());
}

/// Spends what is left; then the cut is in order.
void Adapter::draw_it() {
  if (frame_.fits && local_) spend();
  list_cut();
  drawn_.assign(cut_.begin(), cut_.end());
}

void Adapter::write(const Budget& budget, Claim& claim) {
  claim.nodes.resize(cut_.size());
  claim.tau = 0.0;
  for (size_t i = 0; i < cut_.size(); ++i) {
    const uint32_t id = cut_[i];
    const Spot& spot = spot_[id];
    const double error = drawn_error(id);
    const bool missing = spot.missing_in == frames_;
    claim.nodes[i] = {id, static_cast<uint32_t>(spot.k), 1.0f, spot.visible, missing, error};
    if (!spot.visible) continue;
    claim.missing_nodes += missing;
    claim.tau = std::max(claim.tau, spot.rho);
    claim.predicted_px = std::max(claim.predicted_px, projector_.project(error, spot.place));
  }
  claim.triangles = triangles_;
  claim.visible_nodes = nodes_;
  claim.adapt_steps = steps_;
  if (!frame_.fits) {
    claim.least_triangles = least_cost_.triangles;
    claim.least_nodes = least_cost_.nodes;
  }
  claim.budget_met = claim.within(budget);
}

}  // namespace lodlab::multigrain
