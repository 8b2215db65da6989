// SPDX-License-Identifier: MIT
// A store of seamless as selection sees it: the implicit hierarchy, and two bytes an edge for
// `metric=roughness`.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "method/method.h"
#include "methods/seamless/codes.h"
#include "methods/seamless/layout.h"
#include "methods/seamless/mesh.h"

namespace lodlab::seamless {

/// What select.cpp needs of a level, looked up rather than computed.
struct Level {
  int64_t across, down;  ///< patches
  int64_t first, first_edge;
  double width, height;  ///< of a patch, source units, as if nothing were clamped
  double length;         ///< of its edges as the metric has it: the larger of the two

  int64_t id(const Patch& p) const { return first + p.y * across + p.x; }
};
std::vector<Level> make_levels(const Layout& layout, const FieldFrame& frame);

class Hierarchy : public lodlab::Hierarchy, public std::enable_shared_from_this<Hierarchy> {
 public:
  Hierarchy() = default;  ///< empty: to be filled by hand
  explicit Hierarchy(std::shared_ptr<const Store> store);

  std::vector<NodeInfo> nodes() const override;
  double quantum() const override { return 0.0; }
  int64_t vertices() const override;
  std::unique_ptr<Session> session(const Options& draw_options) const override;

  int64_t id(const Patch& p) const { return level[static_cast<size_t>(p.level)].id(p); }
  /// Two bytes an edge, read on first use: the metric `distance` needs none.
  const std::vector<uint16_t>& codes() const {
    if (!read_.load(std::memory_order_acquire)) read_codes();
    return codes_;
  }
  const CodeBook& book() const { return *book_; }

  /// Bound of what is drawn beside an edge of a patch with this resolution, source units.
  double bound(const Patch& p, Edge e, int k) const;
  /// The largest over the four edges.
  double bound(const Patch& p, const Resolutions& k) const;
  /// That of each edge.
  std::array<double, 4> bounds(const Patch& p, const Resolutions& k) const;
  /// Of all heights of the field, over the clamped patch.
  Box box(const Patch& p) const;
  /// The heights of a patch (build.cpp says in which order).
  std::vector<float> heights(int64_t id) const;
  /// The mask of coverage.h.
  Bytes coverage() const;
  /// Heights are averages of four, as in the paper; bounds hold for none then.
  bool averaged() const { return averaged_; }

  std::shared_ptr<const Store> store;
  FieldFrame frame;
  Layout layout;
  std::vector<Level> level;
  /// Mean error of the patches of a level at each resolution: what `metric=distance` is calibrated with.
  std::vector<double> typical;
  double last_error = 0.0;  ///< bound of the last level's finest resolution: 0 where its stride is 1

 private:
  struct TileCodes {
    std::array<uint16_t, 4> finest, own;  ///< an edge's own, and the largest of its tile's child edges
  };
  bool look_up(const Patch& p, TileCodes& codes_of) const;

  bool averaged_ = false;
  double largest_weight_ = 0.0;
  std::shared_ptr<const CodeBook> book_;
  void read_codes() const;
  mutable std::once_flag once_;
  mutable std::atomic<bool> read_ = false;
  mutable std::vector<uint16_t> codes_;
};

}  // namespace lodlab::seamless
