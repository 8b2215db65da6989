// SPDX-License-Identifier: MIT
// Emission of a chunk: recursive bisection from the parent's two triangles. Below a triangle that the
// parent draws whole, a new vertex lies on that triangle: its target is the mean of the hypotenuse's
// targets, exact in fixed point, so that a chunk drawn at its targets is its parent's surface. The order is a
// Sierpinski curve's, which serves the vertex cache and the index codec as it is.
//
// Triangles that cross the field's border are cut there. The cut meets every edge of the mesh at a whole
// grid position (edges are axis-parallel or diagonal), so neighbours and levels agree on it.
#include "methods/chunked/mesh.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace lodlab::chunked {
namespace {

constexpr int64_t kOne = int64_t{1} << 32;
constexpr size_t kTable = 16384;  // a full leaf of 65 x 65 vertices fits

int32_t rounded(int64_t fixed) { return static_cast<int32_t>((fixed + kOne / 2) >> 32); }

}  // namespace

ChunkMesher::ChunkMesher(const Grid& grid, const Levels& levels, const Envelope& envelope)
    : grid_(grid),
      levels_(levels),
      envelope_(envelope),
      keys_(kTable, UINT32_MAX),
      slots_(kTable),
      mask_(kTable - 1) {}

uint32_t ChunkMesher::find(int32_t x, int32_t y) const {
  const uint32_t key = static_cast<uint32_t>(y - y_) << 16 | static_cast<uint32_t>(x - x_);
  size_t i = (key * 0x9E3779B1u) >> 7 & mask_;
  while (keys_[i] != key && keys_[i] != UINT32_MAX) i = (i + 1) & mask_;
  return keys_[i] == key ? slots_[i] : UINT32_MAX;
}

uint32_t ChunkMesher::vertex(int32_t x, int32_t y, int32_t z, int64_t target) {
  if (const uint32_t known = find(x, y); known != UINT32_MAX) return known;
  if (mesh_.vertices.size() * 2 >= keys_.size()) {  // grow and place again
    keys_.assign(keys_.size() * 2, UINT32_MAX);
    slots_.resize(keys_.size());
    mask_ = keys_.size() - 1;
    for (size_t v = 0; v < mesh_.vertices.size(); ++v) {
      const uint32_t key = static_cast<uint32_t>(mesh_.vertices[v].y) << 16 | mesh_.vertices[v].x;
      size_t i = (key * 0x9E3779B1u) >> 7 & mask_;
      while (keys_[i] != UINT32_MAX) i = (i + 1) & mask_;
      keys_[i] = key;
      slots_[i] = static_cast<uint32_t>(v);
    }
  }
  const uint32_t key = static_cast<uint32_t>(y - y_) << 16 | static_cast<uint32_t>(x - x_);
  size_t i = (key * 0x9E3779B1u) >> 7 & mask_;
  while (keys_[i] != UINT32_MAX) i = (i + 1) & mask_;
  const auto index = static_cast<uint32_t>(mesh_.vertices.size());
  keys_[i] = key;
  slots_[i] = index;
  const int32_t t = rounded(target);
  mesh_.rounded |= (target & (kOne - 1)) != 0;
  mesh_.vertices.push_back({static_cast<uint16_t>(x - x_), static_cast<uint16_t>(y - y_),
                            static_cast<uint16_t>(z), static_cast<uint16_t>(t)});
  mesh_.low = std::min({mesh_.low, z, t});
  mesh_.high = std::max({mesh_.high, z, t});
  return index;
}

ChunkMesher::Corner ChunkMesher::corner(int32_t x, int32_t y) const {
  return {x, y, grid_.k(x, y) * kOne, 0};
}

const ChunkMesh& ChunkMesher::build(int level, int32_t x, int32_t y) {
  const Layout& layout = grid_.layout();
  mesh_.vertices.clear();
  mesh_.indices.clear();
  mesh_.error = 0.0;
  mesh_.rounded = false;
  mesh_.low = 65535;
  mesh_.high = 0;
  if (keys_.size() > kTable) keys_.resize(kTable);  // after a huge chunk
  mask_ = keys_.size() - 1;
  std::fill(keys_.begin(), keys_.end(), UINT32_MAX);
  level_ = level;
  x_ = x;
  y_ = y;
  side_ = layout.side(level);
  limit_ = levels_.limit[static_cast<size_t>(level)];
  parent_limit_ = level > 0 ? levels_.limit[static_cast<size_t>(level) - 1] : limit_;
  worst_ = 0.0f;

  const int32_t side = level > 0 ? 2 * side_ : side_;
  const int32_t px = x / side * side, py = y / side * side;
  const Corner nw = corner(px, py), ne = corner(px + side, py), sw = corner(px, py + side),
               se = corner(px + side, py + side);
  if (main_diagonal(px, py, side)) {
    split(ne, nw, se, false, true);
    split(sw, se, nw, false, true);
  } else {
    split(nw, sw, ne, false, true);
    split(se, ne, sw, false, true);
  }
  mesh_.surface_vertices = static_cast<uint32_t>(mesh_.vertices.size());
  mesh_.surface_indices = static_cast<uint32_t>(mesh_.indices.size());
  const Quantizer& q = grid_.quantizer();
  // Planes over more than 64 cells were scanned in single precision: a 64th of a quantum covers that.
  mesh_.error = worst_ * q.quantum + q.residual + (worst_ > 0.0f && side_ > 64 ? q.quantum / 64 : 0.0);
  if (mesh_.rounded) mesh_.error += 0.5 * q.quantum * (x + side_ > layout.width || y + side_ > layout.height);
  skirt(true, x, y, false);
  skirt(true, x + side_, y, true);
  skirt(false, y, x, false);
  skirt(false, y + side_, x, true);
  return mesh_;
}

/// apex, b, c run clockwise in (column, row), which is counter-clockwise seen from above.
void ChunkMesher::split(const Corner& a, const Corner& b, const Corner& c, bool in_parent, bool from_b) {
  const auto [x0, x1] = std::minmax({a.x, b.x, c.x});
  const auto [y0, y1] = std::minmax({a.y, b.y, c.y});
  const Layout& layout = grid_.layout();
  const int32_t x_end = x_ + side_, y_end = y_ + side_;
  if (x0 >= std::min(x_end, layout.width) || y0 >= std::min(y_end, layout.height) || x1 <= x_ || y1 <= y_)
    return;
  const bool in_chunk = x0 >= x_ && x1 <= x_end && y0 >= y_ && y1 <= y_end;
  if (in_chunk && x1 <= layout.width && y1 <= layout.height) {
    const auto place = [&](Corner p) {
      p.index = vertex(p.x, p.y, grid_.k(p.x, p.y), p.target);
      return p;
    };
    bisect(place(a), place(b), place(c), in_parent, from_b);
    return;
  }
  const int32_t mx = (b.x + c.x) / 2, my = (b.y + c.y) / 2;
  const float error = ((b.x ^ c.x) | (b.y ^ c.y)) & 1 ? 0.0f : grid_.error(mx, my);
  if (in_chunk && !(error > limit_)) {
    worst_ = std::max(worst_, error);
    emit_clipped(a, b, c);
    return;
  }
  in_parent = in_parent || !(error > parent_limit_);
  const Corner m{mx, my, in_parent ? (b.target + c.target) / 2 : grid_.k(mx, my) * kOne, 0};
  if (from_b) split(m, a, b, in_parent, false);
  split(m, c, a, in_parent, !from_b);
  if (!from_b) split(m, a, b, in_parent, true);
}

/// The same for a triangle inside chunk and field: nothing to test but the error.
void ChunkMesher::bisect(const Corner& a, const Corner& b, const Corner& c, bool in_parent, bool from_b) {
  const bool divisible = (((b.x ^ c.x) | (b.y ^ c.y)) & 1) == 0;
  const int32_t mx = (b.x + c.x) / 2, my = (b.y + c.y) / 2;
  const float error = divisible ? grid_.error(mx, my) : 0.0f;
  if (!(error > limit_)) {
    worst_ = std::max(worst_, error);
    mesh_.indices.push_back(a.index);
    mesh_.indices.push_back(b.index);
    mesh_.indices.push_back(c.index);
    return;
  }
  in_parent = in_parent || !(error > parent_limit_);
  const int32_t z = grid_.k(mx, my);
  Corner m{mx, my, in_parent ? (b.target + c.target) / 2 : z * kOne, 0};
  m.index = vertex(mx, my, z, m.target);
  if (from_b) bisect(m, a, b, in_parent, false);
  bisect(m, c, a, in_parent, !from_b);
  if (!from_b) bisect(m, a, b, in_parent, true);
}

void ChunkMesher::emit_clipped(const Corner& a, const Corner& b, const Corner& c) {
  struct Point {
    int32_t x, y;
    int64_t z, target;
  };
  const auto point = [&](const Corner& p) { return Point{p.x, p.y, grid_.k(p.x, p.y) * kOne, p.target}; };
  std::array<Point, 8> polygon{point(a), point(b), point(c)}, kept{};
  size_t count = 3;
  // Against x <= width, then y <= height. Lengths along edges are powers of two apart: exact.
  for (int axis = 0; axis < 2; ++axis) {
    const int32_t border = axis == 0 ? grid_.layout().width : grid_.layout().height;
    size_t out = 0;
    for (size_t i = 0; i < count; ++i) {
      const Point &p = polygon[i], &n = polygon[(i + 1) % count];
      const int32_t at = axis == 0 ? p.x : p.y, to = axis == 0 ? n.x : n.y;
      if (at <= border) kept[out++] = p;
      if ((at < border && to > border) || (at > border && to < border)) {
        const long double f = static_cast<long double>(border - at) / (to - at);  // 64 bits: no rounding
        const auto mix = [&](int64_t u, int64_t v) {
          return u + std::llround(f * static_cast<long double>(v - u));
        };
        kept[out++] = {p.x + static_cast<int32_t>(std::lround(f * (n.x - p.x))),
                       p.y + static_cast<int32_t>(std::lround(f * (n.y - p.y))), mix(p.z, n.z),
                       mix(p.target, n.target)};
      }
    }
    polygon = kept;
    count = out;
  }
  std::array<uint32_t, 8> index{};
  for (size_t i = 0; i < count; ++i) {
    const Point& p = polygon[i];
    mesh_.rounded |= (p.z & (kOne - 1)) != 0;
    index[i] = vertex(p.x, p.y, rounded(p.z), p.target);
  }
  for (size_t i = 2; i < count; ++i) {
    const Point &p = polygon[0], &q = polygon[i - 1], &r = polygon[i];
    const int64_t area = int64_t{q.x - p.x} * (r.y - p.y) - int64_t{r.x - p.x} * (q.y - p.y);
    if (area != 0) mesh_.indices.insert(mesh_.indices.end(), {index[0], index[i - 1], index[i]});
  }
}

/// A vertical skirt along one edge of the chunk, its outside away from the chunk. None on the border of
/// the field. Each vertex hangs by the largest drop, over the two segments beside it, from this chunk's
/// morph range to the envelope: so between two vertices the bottom is below every curve.
void ChunkMesher::skirt(bool vertical, int32_t at, int32_t from, bool outward_positive) {
  const Layout& layout = grid_.layout();
  if (at <= 0 || at >= (vertical ? layout.width : layout.height)) return;
  const int32_t end = std::min(from + side_, vertical ? layout.height : layout.width);
  edge_curve(grid_, levels_, level_, vertical, at, from, from + side_, own_);
  if (level_ > 0) {
    const int32_t step = 2 * side_, first = from / step * step;
    edge_curve(grid_, levels_, level_ - 1, vertical, at, first, first + step, parent_);
    parent_.erase(parent_.begin(), parent_.begin() + (from - first));
  } else {
    parent_ = own_;
  }
  const auto drop = [&](int32_t i) {
    const float top = std::ceil(
        std::max(own_[static_cast<size_t>(i - from)], parent_[static_cast<size_t>(i - from)]) + 0.5f);
    return static_cast<int32_t>(top) - envelope_.low(vertical, at, i);
  };
  struct Knot {
    uint32_t top;
    int32_t depth;
  };
  std::vector<Knot> knots;
  int32_t worst = 0;
  for (int32_t i = from; i <= end; ++i) {
    const int32_t d = drop(i) + 2;
    worst = std::max(worst, d);
    const uint32_t top = vertical ? find(at, i) : find(i, at);
    if (top == UINT32_MAX) continue;
    if (!knots.empty()) knots.back().depth = std::max(knots.back().depth, worst);
    knots.push_back({top, worst});
    worst = d;
  }
  bool fits = true;
  for (const Knot& knot : knots) {
    const Vertex& v = mesh_.vertices[knot.top];
    fits = fits && knot.depth <= std::min(v.z, v.target);
  }
  // Bottoms below the 16-bit range: the whole edge hangs to zero, which is below every sample.
  const auto bottom = static_cast<uint32_t>(mesh_.vertices.size());
  for (const Knot& knot : knots) {
    Vertex v = mesh_.vertices[knot.top];
    v.z = static_cast<uint16_t>(fits ? v.z - knot.depth : 0);
    v.target = static_cast<uint16_t>(fits ? v.target - knot.depth : 0);
    mesh_.low = std::min({mesh_.low, int32_t{v.z}, int32_t{v.target}});
    mesh_.vertices.push_back(v);
  }
  // Seen from outside: on the east edge (vertical, positive) north is to the right.
  const bool forward = vertical != outward_positive;
  for (uint32_t i = 0; i + 1 < knots.size(); ++i) {
    uint32_t left = knots[i].top, right = knots[i + 1].top, left_low = bottom + i, right_low = bottom + i + 1;
    if (!forward) {
      std::swap(left, right);
      std::swap(left_low, right_low);
    }
    mesh_.indices.insert(mesh_.indices.end(), {left, left_low, right, right, left_low, right_low});
  }
}

}  // namespace lodlab::chunked
