// SPDX-License-Identifier: MIT
// Cuts by hand, where patches must agree on the edges that they share; the cuts that an audit draws; random
// ones.
#include <algorithm>
#include <limits>
#include <random>

#include "base/errors.h"
#include "method/hand_cut.h"
#include "methods/seamless/selector.h"
#include "methods/seamless/session.h"

namespace lodlab::seamless {
namespace {

/// Which patch of a cut covers each patch of the last level.
class Cover {
 public:
  explicit Cover(const Layout& layout)
      : layout_(layout),
        last_(layout.levels - 1),
        across_(layout.across(last_)),
        down_(layout.down(last_)),
        owner_(static_cast<size_t>(across_ * down_), -1) {}

  /// InvalidInput when something is covered already.
  void add(int64_t id) {
    const Patch p = layout_.at(id);
    for_cells(p, [&](int64_t cell) {
      int64_t& owner = owner_[static_cast<size_t>(cell)];
      if (owner >= 0) {
        throw InvalidInput("cut: node " + std::to_string(id) + " overlaps node " + std::to_string(owner) +
                           ", which is also given");
      }
      owner = id;
    });
  }
  void check_full() const {
    const auto gap = std::find(owner_.begin(), owner_.end(), -1);
    if (gap == owner_.end()) return;
    const int64_t cell = gap - owner_.begin();
    const Patch p{last_, cell / across_, cell % across_};
    throw InvalidInput("cut: gap: nothing given covers leaf node " + std::to_string(layout_.id(p)) +
                       " at row " + std::to_string(layout_.row(p)) + ", column " +
                       std::to_string(layout_.col(p)));
  }
  /// Calls visit(id) for the patches across an edge; one that is met twice in a row is told once.
  template <class Visit>
  void across(const Patch& p, Edge e, Visit&& visit) const {
    const int shift = (last_ - p.level) * layout_.branch_log2();
    const int64_t y0 = p.y << shift, x0 = p.x << shift;
    const int64_t y1 = std::min((p.y + 1) << shift, down_), x1 = std::min((p.x + 1) << shift, across_);
    const bool row_wise = e == kNorth || e == kSouth;
    const int64_t line = e == kNorth ? y0 - 1 : e == kWest ? x0 - 1 : e == kSouth ? y1 : x1;
    if (line < 0 || line >= (row_wise ? down_ : across_)) return;
    int64_t before = -1;
    for (int64_t i = row_wise ? x0 : y0; i < (row_wise ? x1 : y1); ++i) {
      const int64_t id = owner_[static_cast<size_t>(row_wise ? line * across_ + i : i * across_ + line)];
      if (id != before) visit(id);
      before = id;
    }
  }

 private:
  template <class Visit>
  void for_cells(const Patch& p, Visit&& visit) const {
    const int shift = (last_ - p.level) * layout_.branch_log2();
    const int64_t y1 = std::min((p.y + 1) << shift, down_), x1 = std::min((p.x + 1) << shift, across_);
    for (int64_t y = p.y << shift; y < y1; ++y) {
      for (int64_t x = p.x << shift; x < x1; ++x) visit(y * across_ + x);
    }
  }

  const Layout& layout_;
  int last_;
  int64_t across_, down_;
  std::vector<int64_t> owner_;
};

Edge opposite(Edge e) { return static_cast<Edge>((e + 2) % 4); }

const char* name(Edge e) {
  constexpr const char* kNames[4]{"north", "east", "south", "west"};
  return kNames[e];
}

/// The finest resolutions with which a patch agrees with its neighbours: beside a patch of the next coarser
/// level an edge has the least.
Resolutions finest(const Layout& layout, const Cover& cover, const Patch& p) {
  Resolutions k;
  for (const Edge e : {kNorth, kEast, kSouth, kWest}) {
    k[e] = layout.resolutions - 1;
    cover.across(p, e, [&](int64_t id) {
      if (layout.at(id).level < p.level) k[e] = 0;
    });
  }
  return k;
}

/// InvalidInput names the first edge on which two patches do not agree.
void check_agree(const Layout& layout, const Cover& cover, const std::vector<int64_t>& ids,
                 const std::vector<Resolutions>& k_of) {
  const auto stride = [&](const Patch& p, Edge e, const Resolutions& k) {
    return layout.stride_log2(p.level, k[e]);
  };
  for (size_t i = 0; i < ids.size(); ++i) {
    const Patch p = layout.at(ids[i]);
    for (const Edge e : {kNorth, kEast, kSouth, kWest}) {
      cover.across(p, e, [&](int64_t id) {
        const auto at = std::lower_bound(ids.begin(), ids.end(), id) - ids.begin();
        const int here = stride(p, e, k_of[i]),
                  there = stride(layout.at(id), opposite(e), k_of[static_cast<size_t>(at)]);
        if (here == there) return;
        throw InvalidInput("cut: the " + std::string(name(e)) + " edge of node " + std::to_string(ids[i]) +
                           " has a vertex every " + std::to_string(int64_t{1} << here) + " samples, node " +
                           std::to_string(id) + " across it every " + std::to_string(int64_t{1} << there) +
                           ": patches must agree on the edges that they share");
      });
    }
  }
}

}  // namespace

Cut SeamlessSession::cut(const std::vector<int64_t>& ids, const std::vector<int32_t>& resolutions) const {
  const Layout& layout = hierarchy_->layout;
  check_counts(ids, resolutions);
  const int64_t patches = layout.patches();
  const int32_t count = packed_count(layout.resolutions);
  std::vector<std::pair<int64_t, int32_t>> given(ids.size());
  for (size_t i = 0; i < ids.size(); ++i) {
    checked_node(ids[i], patches);
    given[i] = {ids[i], resolutions.empty() ? 0 : resolutions[i]};
    if (given[i].second < 0 || given[i].second >= count) {
      throw InvalidInput("cut: resolution " + std::to_string(given[i].second) + " of node " +
                         std::to_string(ids[i]) + " is not within 0 to " + std::to_string(count - 1));
    }
  }
  std::sort(given.begin(), given.end());
  Cover cover(layout);
  std::vector<int64_t> sorted(ids.size());
  for (size_t i = 0; i < given.size(); ++i) {
    sorted[i] = given[i].first;
    if (i > 0 && sorted[i] == sorted[i - 1])
      throw InvalidInput("cut: node " + std::to_string(sorted[i]) + " is given twice");
    cover.add(sorted[i]);
  }
  cover.check_full();
  std::vector<Resolutions> k(ids.size());
  for (size_t i = 0; i < given.size(); ++i) {
    k[i] = resolutions.empty() ? finest(layout, cover, layout.at(sorted[i]))
                               : unpack(given[i].second, layout.resolutions);
  }
  check_agree(layout, cover, sorted, k);
  Claim claim;
  claim.promises_bound = promises_bound();
  for (size_t i = 0; i < sorted.size(); ++i) add(layout.at(sorted[i]), k[i], claim);
  return cut_by_hand(std::move(claim));
}

void SeamlessSession::add(const Patch& p, const Resolutions& k, Claim& claim) const {
  const Layout& layout = hierarchy_->layout;
  claim.nodes.push_back({static_cast<uint32_t>(layout.id(p)),
                         static_cast<uint32_t>(pack(k, layout.resolutions)), 1.0f, true, false,
                         hierarchy_->bound(p, k)});
  claim.triangles += mesh_.triangles(k, layout.clip_x(p), layout.clip_y(p));
  ++claim.visible_nodes;
}

/// Every level with every four resolutions of a patch: edges take turns from line to line.
std::vector<Cut> SeamlessSession::audit_cuts() const {
  const Layout& layout = hierarchy_->layout;
  std::vector<Cut> out;
  for (int level = 0; level < layout.levels; ++level) {
    for (int packed = 0; packed < packed_count(layout.resolutions); ++packed) {
      const Resolutions k = unpack(packed, layout.resolutions);
      Claim claim;
      claim.promises_bound = promises_bound();
      for (int64_t y = 0; y < layout.down(level); ++y) {
        for (int64_t x = 0; x < layout.across(level); ++x) {
          Resolutions here = k;
          if (y % 2 != 0) std::swap(here[kNorth], here[kSouth]);
          if (x % 2 != 0) std::swap(here[kEast], here[kWest]);
          add({level, y, x}, here, claim);
        }
      }
      out.push_back(cut_by_hand(std::move(claim)));
    }
  }
  return out;
}

/// What the metric selects, with the store's own weights, for a random eye and precision.
std::optional<Cut> SeamlessSession::random_cut(uint64_t seed) const {
  std::mt19937_64 random(seed);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
  };
  const FieldFrame& frame = hierarchy_->frame;
  const double width = frame.dx * static_cast<double>(frame.cols),
               height = frame.dy * static_cast<double>(frame.rows);
  View view;
  view.eye = {frame.x0 + uniform(-0.2, 1.2) * width, frame.y0 - uniform(-0.2, 1.2) * height,
              frame.z_max + uniform(0.0, 1.0) * uniform(0.0, 1.0) * std::max(width, height)};
  view.target = view.eye + glm::dvec3(0.0, height, 0.0);
  const Projector projector(projection_, make_camera(view));
  const Metric metric{};
  Selector::Scratch scratch;
  Selector selector(*hierarchy_, mesh_, metric, projector, nullptr, scratch);
  const double weight = std::max(hierarchy_->book().largest(), 1e-300);
  const double fineness =
      random() % 4 == 0 ? selector.coarsest() * uniform(0.0, 1.0) : std::exp2(uniform(-6.0, 8.0)) / weight;
  Claim claim;
  claim.promises_bound = promises_bound();
  collect(selector, Precision::of(fineness), claim);
  return cut_by_hand(std::move(claim));
}

}  // namespace lodlab::seamless
