// SPDX-License-Identifier: MIT
// Triangles over a field that are turned over, mended by swapping diagonals. One that is thin has its third
// corner beyond its longest side, on the triangle that lies there: the other diagonal of the two leaves both
// upright. All is told in whole numbers, the rows and columns of samples.
#include <algorithm>
#include <array>

#include "geometry/mesh_edges.h"
#include "methods/discrete/discrete.h"

namespace lodlab::discrete {
namespace {

constexpr uint32_t kNone = ~0u;

class Triangulation {
 public:
  Triangulation(std::vector<uint32_t> indices, const HeightField& field)
      : cols_(field.cols), corner_(std::move(indices)), twin_(corner_.size(), kNone) {
    const std::span faces(reinterpret_cast<const Face*>(corner_.data()), corner_.size() / 3);
    const std::vector<uint32_t> alike = first_alike(faces, field.rows * field.cols);
    for (uint32_t t = 0; t < faces.size(); ++t) {  // back to back
      if (alike[t] == t || gone(t) || gone(alike[t]) || area(t) + area(alike[t]) != 0) continue;
      drop(t);
      drop(alike[t]);
    }
    const MeshEdges edges = mesh_edges(faces, field.rows * field.cols);
    for (int64_t e = 0; e < edges.count(); ++e) {
      const auto sides = edges.of(e);
      if (sides.size() != 2 || corner_[sides[0]] == corner_[sides[1]]) continue;
      twin_[sides[0]] = sides[1];
      twin_[sides[1]] = sides[0];
    }
  }

  /// Whether all triangles are upright in the end.
  bool unfold() {
    std::vector<uint32_t> open, later;
    for (uint32_t t = 0; t < corner_.size() / 3; ++t) open.push_back(t);
    for (size_t left = open.size() + 1; !open.empty() && open.size() < left;) {
      left = open.size();
      for (const uint32_t t : open) mend(t, later);
      open.clear();
      std::swap(open, later);
    }
    for (const uint32_t t : open) {
      if (!gone(t) && area(t) <= 0 && !collapse_side_of(t)) return false;
    }
    return true;
  }

  std::vector<uint32_t> take() {
    std::vector<uint32_t> out;
    out.reserve(corner_.size());
    for (uint32_t t = 0; t < corner_.size() / 3; ++t) {
      if (!gone(t)) out.insert(out.end(), corner_.begin() + 3 * t, corner_.begin() + 3 * t + 3);
    }
    return out;
  }

 private:
  struct Place {
    int64_t x, y;
  };
  Place place(uint32_t sample) const { return {sample % cols_, -(sample / cols_)}; }
  /// Twice that of the triangle, seen from above.
  int64_t area(uint32_t a, uint32_t b, uint32_t c) const {
    const Place p = place(a), q = place(b), r = place(c);
    return (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
  }
  int64_t area(uint32_t t) const { return area(corner_[3 * t], corner_[3 * t + 1], corner_[3 * t + 2]); }
  bool gone(uint32_t t) const { return corner_[3 * t] == corner_[3 * t + 1]; }

  int64_t squared_length(uint32_t side) const {
    const Place p = place(corner_[side]), q = place(corner_[side_end(side)]);
    return (q.x - p.x) * (q.x - p.x) + (q.y - p.y) * (q.y - p.y);
  }

  void join(uint32_t side, uint32_t other) {
    twin_[side] = other;
    if (other != kNone) twin_[other] = side;
  }

  /// One on a line along the border: its longest side is no more.
  void drop(uint32_t t) {
    for (uint32_t side = 3 * t; side < 3 * t + 3; ++side) {
      if (twin_[side] != kNone) twin_[twin_[side]] = kNone;
      corner_[side] = 0;
    }
  }

  /// Swaps or drops one that is not upright; what is not then either goes to `later`.
  void mend(uint32_t t, std::vector<uint32_t>& later) {
    if (gone(t) || area(t) > 0) return;
    std::array<uint32_t, 3> sides{3 * t, 3 * t + 1, 3 * t + 2};  // the longest first
    std::sort(sides.begin(), sides.end(),
              [&](uint32_t p, uint32_t q) { return squared_length(p) > squared_length(q); });
    if (twin_[sides[0]] == kNone && area(t) == 0) return drop(t);
    for (const uint32_t side : sides) {
      const uint32_t other = twin_[side];
      if (other == kNone || !swap(side, other)) continue;
      if (area(other / 3) <= 0) later.push_back(other / 3);
      break;
    }
    if (area(t) <= 0) later.push_back(t);
  }

  /// The other diagonal of two triangles a b c and b a d; false where that is no better.
  bool swap(uint32_t side, uint32_t other) {
    const uint32_t after = side_end(side), last = side_end(after);
    const uint32_t other_after = side_end(other), other_last = side_end(other_after);
    const uint32_t a = corner_[side], b = corner_[after], c = corner_[last], d = corner_[other_last];
    const int64_t before = std::min(area(a, b, c), area(b, a, d));
    if (c == d || std::min(area(a, d, c), area(d, b, c)) <= before) return false;
    const uint32_t bc = twin_[after], ca = twin_[last], ad = twin_[other_after], db = twin_[other_last];
    corner_[side] = d, corner_[after] = b, corner_[last] = c;               // d b, b c, c d
    corner_[other] = c, corner_[other_after] = a, corner_[other_last] = d;  // c a, a d, d c
    join(side, db);
    join(after, bc);
    join(last, other_last);
    join(other, ca);
    join(other_after, ad);
    return true;
  }

  /// Makes the begin of a side its end, where that leaves all triangles upright round it.
  bool collapse(uint32_t side) {
    const uint32_t b = corner_[side_end(side)];
    fan_.clear();
    for (uint32_t at = side; fan_.empty() || at != side;) {  // sides that begin at a
      fan_.push_back(at);
      at = twin_[side_end(side_end(at))];
      if (at == kNone || fan_.size() > kMostRound) return false;
    }
    for (const uint32_t at : fan_) {
      const uint32_t p = corner_[side_end(at)], q = corner_[side_end(side_end(at))];
      if (p != b && q != b && area(b, p, q) <= 0) return false;
    }
    for (const uint32_t at : fan_) corner_[at] = b;
    for (const uint32_t gone_side : {side, twin_[side]}) {  // the two triangles on it
      const uint32_t after = side_end(gone_side), last = side_end(after);
      const uint32_t one = twin_[after], two = twin_[last];
      if (one != kNone) twin_[one] = two;
      if (two != kNone) twin_[two] = one;
      for (const uint32_t k : {gone_side, after, last}) {
        corner_[k] = 0;
        twin_[k] = kNone;
      }
    }
    return true;
  }

  bool collapse_side_of(uint32_t t) {
    for (uint32_t side = 3 * t; side < 3 * t + 3; ++side) {
      if (collapse(side) || (twin_[side] != kNone && collapse(twin_[side]))) return true;
    }
    return false;
  }

  static constexpr size_t kMostRound = 64;  ///< triangles round a vertex
  int64_t cols_;
  std::vector<uint32_t> fan_;
  std::vector<uint32_t> corner_, twin_;  ///< of side 3 t + k: where it begins; the side that runs back
};

}  // namespace

std::vector<uint32_t> unfolded(std::vector<uint32_t> indices, const HeightField& field) {
  Triangulation triangles(std::move(indices), field);
  return triangles.unfold() ? triangles.take() : std::vector<uint32_t>();
}

}  // namespace lodlab::discrete
