// SPDX-License-Identifier: MIT
// Triangles over a field that are turned over, mended by swapping diagonals. One that is thin has its third
// corner beyond its longest side, on the triangle that lies there: the other diagonal of the two leaves both
// upright. All is told in whole numbers, the rows and columns of samples.
#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

#include "geometry/mesh_edges.h"
#include "methods/discrete/discrete.h"

namespace lodlab::discrete {
namespace {

constexpr uint32_t kNone = ~0u;

class Triangulation {
 public:
  Triangulation(std::vector<uint32_t> indices, const HeightField& field)
      : rows_(field.rows), cols_(field.cols), corner_(std::move(indices)), twin_(corner_.size(), kNone) {
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
      for (size_t i = 1; i < sides.size(); ++i) {  // where sheets touch, any that run opposite ways
        for (size_t k = 0; k < i; ++k) {
          if (twin_[sides[i]] != kNone || twin_[sides[k]] != kNone || corner_[sides[i]] == corner_[sides[k]])
            continue;
          twin_[sides[i]] = sides[k];
          twin_[sides[k]] = sides[i];
        }
      }
    }
  }

  /// Whether all triangles are upright in the end, and cover the field.
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
      if (!gone(t) && area(t) <= 0 && !refill(t)) return false;
    }
    int64_t covered = 0;
    for (uint32_t t = 0; t < corner_.size() / 3; ++t) {
      if (gone(t)) continue;
      if (area(t) <= 0) return false;
      covered += area(t);
    }
    return covered == 2 * (rows_ - 1) * (cols_ - 1);
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

  int64_t squared_distance(uint32_t a, uint32_t b) const {
    const Place p = place(a), q = place(b);
    return (q.x - p.x) * (q.x - p.x) + (q.y - p.y) * (q.y - p.y);
  }
  int64_t squared_length(uint32_t side) const {
    return squared_distance(corner_[side], corner_[side_end(side)]);
  }
  bool on_border(uint32_t side) const {
    const Place p = place(corner_[side]), q = place(corner_[side_end(side)]);
    return (p.x == q.x && (p.x == 0 || p.x == cols_ - 1)) || (p.y == q.y && (p.y == 0 || p.y == 1 - rows_));
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
    if (twin_[sides[0]] == kNone && area(t) == 0 && on_border(sides[0])) return drop(t);
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

  /// The outline of a region, counter-clockwise. False where that is no one loop.
  bool find_outline() {
    std::vector<OutlineEdge> edges;
    for (const uint32_t t : region_) {
      for (uint32_t side = 3 * t; side < 3 * t + 3; ++side) {
        if (twin_[side] == kNone || !in_region(twin_[side] / 3))
          edges.push_back({corner_[side], corner_[side_end(side)], twin_[side]});
      }
    }
    if (edges.empty()) return false;
    outline_.assign(1, edges[0]);
    while (outline_.back().to != outline_[0].from && outline_.size() < edges.size()) {
      const auto next = std::find_if(edges.begin(), edges.end(), [&](const OutlineEdge& edge) {
        return edge.from == outline_.back().to;
      });
      if (next == edges.end()) return false;
      outline_.push_back(*next);
    }
    return outline_.size() == edges.size() && outline_.back().to == outline_[0].from;
  }
  bool in_region(uint32_t t) const { return std::find(region_.begin(), region_.end(), t) != region_.end(); }

  /// An edge of `left` ones whose end is an ear, that with the shortest third side; none: kNone.
  uint32_t find_ear(const std::vector<uint32_t>& left) const {
    uint32_t best = kNone;
    int64_t shortest = std::numeric_limits<int64_t>::max();
    for (uint32_t k = 0; k < left.size(); ++k) {
      const uint32_t p = outline_[left[k]].from, tip = outline_[left[(k + 1) % left.size()]].from,
                     q = outline_[left[(k + 2) % left.size()]].from;
      if (area(p, tip, q) <= 0 || squared_distance(p, q) >= shortest) continue;
      const bool empty = std::none_of(left.begin(), left.end(), [&](uint32_t other) {
        const uint32_t x = outline_[other].from;
        return x != p && x != tip && x != q && area(p, tip, x) >= 0 && area(tip, q, x) >= 0 &&
               area(q, p, x) >= 0;
      });
      if (!empty) continue;
      best = k;
      shortest = squared_distance(p, q);
    }
    return best;
  }

  /// Fills the outline of the region with upright triangles; false where that cannot be.
  bool fill() {
    std::vector<uint32_t> left(outline_.size()), ears;
    std::iota(left.begin(), left.end(), 0u);
    for (std::vector<uint32_t> rest = left; rest.size() > 2;) {
      const uint32_t k = find_ear(rest);
      if (k == kNone) return false;
      ears.push_back(k);
      rest.erase(rest.begin() + (k + 1) % static_cast<uint32_t>(rest.size()));
    }
    if (ears.empty() || ears.size() > region_.size()) return false;
    empty_region();
    for (size_t e = 0; e < ears.size(); ++e) {
      const auto count = static_cast<uint32_t>(left.size());
      const uint32_t side = 3 * region_[e], next = (ears[e] + 1) % count, after = (ears[e] + 2) % count;
      OutlineEdge &first = outline_[left[ears[e]]], &second = outline_[left[next]];
      corner_[side] = first.from;
      corner_[side + 1] = second.from;
      corner_[side + 2] = outline_[left[after]].from;
      join(side, first.beyond);
      join(side + 1, second.beyond);
      if (count == 3) join(side + 2, outline_[left[after]].beyond);
      first.beyond = side + 2;
      left.erase(left.begin() + next);
    }
    return true;
  }

  void empty_region() {
    for (const uint32_t t : region_) {
      for (uint32_t side = 3 * t; side < 3 * t + 3; ++side) {
        corner_[side] = 0;
        twin_[side] = kNone;
      }
    }
  }

  /// Triangulates a triangle and more and more of what is round it anew, until all of that is upright.
  bool refill(uint32_t t) {
    region_.assign(1, t);
    while (region_.size() <= kMostRefilled) {
      if (find_outline() && fill()) return true;
      const size_t before = region_.size();
      for (size_t i = 0; i < before; ++i) {
        for (uint32_t side = 3 * region_[i]; side < 3 * region_[i] + 3; ++side) {
          if (twin_[side] != kNone && !in_region(twin_[side] / 3)) region_.push_back(twin_[side] / 3);
        }
      }
      if (region_.size() == before) {  // closed: sheets back to back, or all there is
        empty_region();
        return true;
      }
    }
    return false;
  }

  struct OutlineEdge {
    uint32_t from, to, beyond;  ///< corners; the side that runs back
  };
  static constexpr size_t kMostRefilled = 512;  ///< triangles
  int64_t rows_, cols_;
  std::vector<uint32_t> region_;
  std::vector<OutlineEdge> outline_;
  std::vector<uint32_t> corner_, twin_;  ///< of side 3 t + k: where it begins; the side that runs back
};

}  // namespace

std::vector<uint32_t> unfolded(std::vector<uint32_t> indices, const HeightField& field) {
  Triangulation triangles(std::move(indices), field);
  return triangles.unfold() ? triangles.take() : std::vector<uint32_t>();
}

}  // namespace lodlab::discrete
