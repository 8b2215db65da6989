// SPDX-License-Identifier: MIT
// Scan conversion of one triangle over the samples of a flat field, in double, edges inclusive. Corners are
// in grid coordinates (x east in columns, y south in rows), so a triangle whose corners are samples is tested
// in whole numbers, exactly. Per row the edges give a span of columns, a little wider than needed; samples
// are tested from both its ends to the first inside.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

namespace lodlab {

struct GridCorner {
  double col, row, z;
  double slack;  ///< cells by which it may be elsewhere; 0: it is exact
};

inline constexpr int kMostInScan = 32;

namespace scan {

/// Triangles thinner than this share of their length have no area worth the name.
inline constexpr double kThinnest = 1e-12;

/// w(col, row) >= 0 on the inner side; w is twice the area of the triangle with the edge.
struct Edge {
  double col, row, d_col, d_row, reach;
  double at(double c, double r) const { return d_col * (r - row) - d_row * (c - col); }
  bool holds(double w) const { return w >= -reach; }
};

struct Span {
  double lo, hi;
};

/// Narrows the span to the columns of this row that the edge lets in, rounded outwards.
inline bool narrow(Span& span, const Edge& edge, double row) {
  const double rest = edge.d_col * (row - edge.row) + edge.reach;  // rest - d_row (c - col) >= 0
  if (edge.d_row == 0.0) return rest >= 0.0;
  const double limit = edge.col + rest / edge.d_row;
  if (edge.d_row > 0.0) {
    span.hi = std::min(span.hi, std::ceil(limit));
  } else {
    span.lo = std::max(span.lo, std::floor(limit));
  }
  return span.lo <= span.hi;
}

}  // namespace scan

/// Calls put(row, col, z, count) for runs of at most kMostInScan samples that the triangle covers, with its
/// heights there. Triangles without horizontal area cover nothing.
template <class Put>
void scan_triangle(const GridCorner (&corners)[3], int64_t rows, int64_t cols, const Put& put) {
  using scan::Edge;
  const GridCorner &a = corners[0], *b = &corners[1], *c = &corners[2];
  double area = (b->col - a.col) * (c->row - a.row) - (b->row - a.row) * (c->col - a.col);
  if (area < 0.0) {
    std::swap(b, c);
    area = -area;
  }
  const double slack = std::max({a.slack, b->slack, c->slack});
  const double row_lo = std::min({a.row, b->row, c->row}), row_hi = std::max({a.row, b->row, c->row});
  const double col_lo = std::min({a.col, b->col, c->col}), col_hi = std::max({a.col, b->col, c->col});
  const double longest = std::max(row_hi - row_lo, col_hi - col_lo);
  if (!(area > scan::kThinnest * longest * longest)) return;

  const auto make_edge = [slack](const GridCorner& from, const GridCorner& to) {
    const double d_col = to.col - from.col, d_row = to.row - from.row;
    const double reach = slack > 0.0 ? slack * std::sqrt(d_col * d_col + d_row * d_row) : 0.0;
    return Edge{from.col, from.row, d_col, d_row, reach};
  };
  const Edge edges[3] = {make_edge(*b, *c), make_edge(*c, a), make_edge(a, *b)};  // opposite a, b, c
  const double first = std::max(0.0, std::ceil(row_lo - slack));
  const double last = std::min(static_cast<double>(rows - 1), std::floor(row_hi + slack));
  const scan::Span whole{std::max(0.0, std::ceil(col_lo - slack)),
                         std::min(static_cast<double>(cols - 1), std::floor(col_hi + slack))};
  for (double r = first; r <= last; r += 1.0) {
    scan::Span span = whole;
    if (!narrow(span, edges[0], r) || !narrow(span, edges[1], r) || !narrow(span, edges[2], r)) continue;
    const auto inside = [&](double col) {
      return edges[0].holds(edges[0].at(col, r)) && edges[1].holds(edges[1].at(col, r)) &&
             edges[2].holds(edges[2].at(col, r));
    };
    while (span.lo <= span.hi && !inside(span.lo)) span.lo += 1.0;
    while (span.lo < span.hi && !inside(span.hi)) span.hi -= 1.0;
    while (span.lo <= span.hi) {
      double z[kMostInScan];
      const int count = static_cast<int>(std::min(span.hi - span.lo + 1.0, double{kMostInScan}));
      for (int i = 0; i < count; ++i) {
        const double col = span.lo + i;
        // Within the slack outside: the height of the nearest weights, never an extrapolation.
        const double ia = std::max(edges[0].at(col, r), 0.0), ib = std::max(edges[1].at(col, r), 0.0),
                     ic = std::max(edges[2].at(col, r), 0.0);
        z[i] = a.z + (ib * (b->z - a.z) + ic * (c->z - a.z)) / (ia + ib + ic);
      }
      put(static_cast<int64_t>(r), static_cast<int64_t>(span.lo), z, count);
      span.lo += count;
    }
  }
}

}  // namespace lodlab
