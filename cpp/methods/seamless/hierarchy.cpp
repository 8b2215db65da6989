// SPDX-License-Identifier: MIT
// A store of seamless opened: its layout, its patches as rows of nodes, bounds from the codes of edges.
#include "methods/seamless/hierarchy.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>

#include "base/errors.h"
#include "method/sample_code.h"
#include "methods/seamless/closure.h"
#include "methods/seamless/seamless.h"

namespace lodlab::seamless {
namespace {

bool is_layout(const std::vector<int32_t>& shape) {
  return shape.size() == 4 && (shape[1] == 2 || shape[1] == 3) && shape[0] >= shape[1] && shape[0] <= 7 &&
         shape[2] >= 0 && shape[2] <= 31;
}

}  // namespace

Hierarchy::Hierarchy(std::shared_ptr<const Store> opened)
    : store(std::move(opened)),
      frame(frame_from_json(store->meta().frame)),
      typical(store->array_of<double>("typical")),
      averaged_(store->meta("pyramid") == "average") {
  const std::vector<int32_t> shape = store->array_of<int32_t>("layout");
  const auto refuse = [&](const std::string& why) {
    throw StoreError("seamless: " + store->path() + " " + why);
  };
  if (!is_layout(shape)) refuse("holds no layout of patches");
  layout = make_layout(frame, shape[0], shape[1], shape[2]);
  if (layout.levels != shape[3]) {
    refuse("has " + std::to_string(shape[3]) + " levels of patches where its field has " +
           std::to_string(layout.levels));
  }
  level = make_levels(layout, frame);
  if (typical.size() != static_cast<size_t>(layout.levels * layout.resolutions))
    refuse("does not hold the mean errors of its levels");
  const std::vector<double> scales = store->array_of<double>("scales");
  if (scales.size() != 2 || !(scales[0] >= 0.0) || !std::isfinite(scales[0]) || !(scales[1] >= 0.0) ||
      !std::isfinite(scales[1]))
    refuse("does not hold the scales of its errors");
  largest_weight_ = scales[0];
  last_error = scales[1];
  book_ = std::make_shared<CodeBook>(layout.resolutions, largest_weight_);
}

void Hierarchy::read_codes() const {
  std::call_once(once_, [&] {
    if (store == nullptr) return;  // filled by hand, without errors
    codes_ = store->array_of<uint16_t>("codes");
    if (codes_.size() != static_cast<size_t>(layout.first_edge(layout.levels)))
      throw StoreError("seamless: " + store->path() + " does not hold the errors of its " +
                       std::to_string(layout.first_edge(layout.levels)) + " edges");
    read_ = true;
  });
}

double Hierarchy::bound(const Patch& p, Edge e, int k) const {
  const std::vector<uint16_t>& code = codes();
  const Level& here = level[static_cast<size_t>(p.level)];
  if (k < layout.resolutions - 1) {
    const uint16_t own = code[static_cast<size_t>(here.first_edge + layout.edge(p, e))];
    return k == 0 ? book_->low(own, here.length) : book_->mid(own, here.length);
  }
  if (p.level + 1 == layout.levels) return last_error;
  const Level& next = level[static_cast<size_t>(p.level + 1)];
  double worst = 0.0;
  for_child_edges(layout, p, e, [&](int64_t edge, bool) {
    worst = std::max(worst, book_->low(code[static_cast<size_t>(next.first_edge + edge)], next.length));
  });
  return worst;
}

/// With two resolutions, where no child is clipped away, the three child edges of each tile lie side by side.
bool Hierarchy::look_up(const Patch& p, TileCodes& codes_of) const {
  if (layout.resolutions != 2 || p.level + 1 == layout.levels) return false;
  const Level& here = level[static_cast<size_t>(p.level)];
  const Level& next = level[static_cast<size_t>(p.level) + 1];
  if (2 * p.x + 2 > next.across || 2 * p.y + 2 > next.down) return false;
  const uint16_t* code = codes().data();
  const int64_t pitch = next.across;
  const uint16_t* h = code + next.first_edge + 2 * p.y * pitch + 2 * p.x;
  const uint16_t* v = code + next.first_edge + pitch * (next.down + 1) + 2 * p.y * (pitch + 1) + 2 * p.x;
  const uint16_t* below = v + pitch + 1;
  codes_of.finest = {std::max({h[0], h[1], v[1]}), std::max({v[2], below[2], h[pitch + 1]}),
                     std::max({h[2 * pitch], h[2 * pitch + 1], below[1]}),
                     std::max({v[0], below[0], h[pitch]})};
  const uint16_t* across = code + here.first_edge + p.y * here.across + p.x;
  const uint16_t* down =
      code + here.first_edge + here.across * (here.down + 1) + p.y * (here.across + 1) + p.x;
  codes_of.own = {across[0], down[1], across[here.across], down[0]};
  return true;
}

double Hierarchy::bound(const Patch& p, const Resolutions& k) const {
  TileCodes at;
  if (!look_up(p, at)) {
    double worst = 0.0;
    for (const Edge e : {kNorth, kEast, kSouth, kWest}) worst = std::max(worst, bound(p, e, k[e]));
    return worst;
  }
  const int top = layout.resolutions - 1;
  uint16_t finer = 0, coarser = 0;  // `low` is the upper byte: the larger code has the larger one
  for (size_t i = 0; i < 4; ++i) {
    finer = std::max(finer, k[i] == top ? at.finest[i] : uint16_t{0});
    coarser = std::max(coarser, k[i] == top ? uint16_t{0} : at.own[i]);
  }
  const Level* here = &level[static_cast<size_t>(p.level)];
  return std::max(book_->low(finer, here[1].length), book_->low(coarser, here[0].length));
}

std::array<double, 4> Hierarchy::bounds(const Patch& p, const Resolutions& k) const {
  std::array<double, 4> out;
  TileCodes at;
  if (!look_up(p, at)) {
    for (const Edge e : {kNorth, kEast, kSouth, kWest}) out[e] = bound(p, e, k[e]);
    return out;
  }
  const Level* here = &level[static_cast<size_t>(p.level)];
  for (size_t i = 0; i < 4; ++i)
    out[i] = k[i] == 0 ? book_->low(at.own[i], here[0].length) : book_->low(at.finest[i], here[1].length);
  return out;
}

Box Hierarchy::box(const Patch& p) const {
  Box box;
  box.add(frame.position(layout.row(p), layout.col(p), frame.z_min));
  box.add(frame.position(layout.end_row(p), layout.end_col(p), frame.z_max));
  return box;
}

std::vector<NodeInfo> Hierarchy::nodes() const {
  const PatchMesh mesh(layout.patch_log2, layout.resolutions);
  const int packed = packed_count(layout.resolutions);
  std::vector<NodeInfo> rows;
  rows.reserve(static_cast<size_t>(layout.patches() * packed));
  for (int64_t id = 0; id < layout.patches(); ++id) {
    const Patch p = layout.at(id);
    const int64_t parent = p.level == 0 ? -1 : layout.id(layout.parent(p));
    const int clip_x = layout.clip_x(p), clip_y = layout.clip_y(p);
    const Box box_of_patch = box(p);
    double bounds[4][3];
    for (const Edge e : {kNorth, kEast, kSouth, kWest}) {
      for (int k = 0; k < layout.resolutions; ++k) bounds[e][k] = bound(p, e, k);
    }
    for (int i = 0; i < packed; ++i) {
      const Resolutions k = unpack(i, layout.resolutions);
      const double error = std::max(std::max(bounds[kNorth][k[kNorth]], bounds[kEast][k[kEast]]),
                                    std::max(bounds[kSouth][k[kSouth]], bounds[kWest][k[kWest]]));
      rows.push_back({id, parent, p.level, i, mesh.triangles(k, clip_x, clip_y), error, box_of_patch});
    }
  }
  return rows;
}

/// Of the last level at its finest.
int64_t Hierarchy::vertices() const {
  const int64_t stride = int64_t{1} << layout.finest_log2;
  return ((layout.last_row() + stride - 1) / stride + 1) * ((layout.last_col() + stride - 1) / stride + 1);
}

std::vector<float> Hierarchy::heights(int64_t id) const {
  std::vector<float> heights(static_cast<size_t>(page_samples(layout, averaged_)));
  decode_samples(store->page(kHeights, id), heights.data(), static_cast<int64_t>(heights.size()));
  return heights;
}

Bytes Hierarchy::coverage() const {
  return store->has_page(kCoverage, 0) ? store->page(kCoverage, 0) : Bytes();
}

}  // namespace lodlab::seamless
