// SPDX-License-Identifier: MIT
// Errors of a block of a planet: along each sample's ray from the centre, against the plane of the triangle
// that the ray meets. Two corners of equal latitude are joined by a great circle, which runs nearer to the
// pole than their row: a triangle meets rays of rows beyond its own, and of other blocks. In double.
//
// A planet's last column of blocks may be clamped and yet have neighbours on both sides. With an odd number
// of cells the diagonal of its corner cells misses the corner, or one cell has two snapped edges: there all
// pairs of snapped edges are measured, and raise the strip of the coarser one.
//
// Vertices are drawn on a lattice (lattice.h): every error has what that can add to it, seen along a ray.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/glm.hpp>
#include <limits>
#include <vector>

#include "geometry/angles.h"
#include "methods/multigrain/lattice.h"
#include "methods/multigrain/measure.h"
#include "multigrain/stitch.h"

namespace lodlab::multigrain {
namespace {

/// Rays this close to an edge (radians) may be on it.
constexpr double kOnEdge = 1e-13;
/// Rounding of a radius, of itself.
constexpr double kRounding = 1e-13;

struct Vertex {
  int row, col;  ///< samples from the block's first
  bool operator==(const Vertex&) const = default;
};

/// For each edge, log2 of the stride that it is snapped to.
using Snaps = std::array<int, 4>;

/// Four functions of the longitude along a row of samples, x cos + y sin + z: how far its ray is inside of a
/// triangle's edges, and along the normal of the triangle's plane.
struct Row {
  double x[4], y[4], z[4];
  double volume;           ///< normal times corner: the ray meets the plane at volume / along
  double moved;            ///< by how much more, as it is drawn
  double lowest, highest;  ///< radii between which the triangle is drawn

  void set(int i, const glm::dvec3& v, const glm::dvec2& lat, double slack) {
    x[i] = lat.x * v.x;
    y[i] = lat.x * v.y;
    z[i] = lat.y * v.z + slack;
  }
};

/// Largest distance between the triangle, as it is drawn, and those of `count` samples whose rays meet it.
/// Where it is as steep as the rays its plane says nothing, and its corners' radii do.
inline double row_error(const Row& row, const double* c, const double* s, const double* radii, int count) {
  double worst = 0.0;
#pragma omp simd reduction(max : worst)
  for (int i = 0; i < count; ++i) {
    const double w0 = row.x[0] * c[i] + row.y[0] * s[i] + row.z[0];
    const double w1 = row.x[1] * c[i] + row.y[1] * s[i] + row.z[1];
    const double w2 = row.x[2] * c[i] + row.y[2] * s[i] + row.z[2];
    const double along = row.x[3] * c[i] + row.y[3] * s[i] + row.z[3];
    double least = w0 < w1 ? w0 : w1;
    least = least < w2 ? least : w2;
    const double plane = std::fabs(row.volume / along - radii[i]) + row.moved;
    const double above = row.highest - radii[i], below = radii[i] - row.lowest;
    const double farthest = above > below ? above : below;
    const double error = plane < farthest ? plane : farthest;
    const double counted = least >= 0.0 ? error : 0.0;
    worst = counted > worst ? counted : worst;
  }
  return worst;
}

/// Of half the longitude across so many columns, rounded down.
double half_cosine(const FieldFrame& frame, int columns) {
  return cos_sin_degrees(0.5 * columns * frame.dlon).x * (1.0 - 1e-12);
}

class PlanetMeasurer : public Measurer {
 public:
  PlanetMeasurer(const HeightRows& field, const Layout& layout)
      : field_(field),
        layout_(layout),
        log2_(layout.block_log2()),
        top_(layout.largest_stride_log2()),
        lattice_error_(Lattice(field).error()) {}

  void measure(const Block& block, float, float, float* own, float* strips) override {
    load(block);
    const int pairs = BlockErrors::pairs(log2_ + 1);
    const auto raise = [&](Edge edge, int a, int b, float error) {
      float& value = strips[edge * pairs + BlockErrors::pair(a, b)];
      value = std::max(value, error);
    };
    for (int a = 0; a <= top_; ++a) {
      own[a] = std::max(measure_cells(a, {a, a, a, a}, 0, cells_x(a), 0, cells_y(a)), fringe_error(block, a));
    }
    for (int a = 0; a < top_; ++a) {
      const int nx = cells_x(a), ny = cells_y(a);
      for (const Edge edge : {kNorth, kEast, kSouth, kWest}) {
        if (!layout_.meets(block.y, block.x, edge)) continue;
        for (int b = a + 1; b <= top_; ++b) {
          Snaps snaps{a, a, a, a};
          snaps[edge] = b;
          raise(edge, a, b,
                measure_cells(a, snaps, edge == kEast ? nx - 1 : 0, edge == kWest ? 1 : nx,
                              edge == kSouth ? ny - 1 : 0, edge == kNorth ? 1 : ny));
        }
      }
      if (nx % 2 == 0 || !layout_.meets(block.y, block.x, kEast)) continue;
      for (const Edge other : {kNorth, kSouth, kWest}) {
        if (!layout_.meets(block.y, block.x, other) || (other == kWest && nx > 1)) continue;
        for (int b = a + 1; b <= top_; ++b) {
          for (int c = a + 1; c <= top_; ++c) {
            Snaps snaps{a, a, a, a};
            snaps[kEast] = b;
            snaps[other] = c;
            const float error =
                measure_cells(a, snaps, nx - 1, nx, other == kSouth ? ny - 1 : 0, other == kNorth ? 1 : ny);
            raise(b >= c ? kEast : other, a, std::max(b, c), error);
          }
        }
      }
    }
  }

 private:
  int cells_x(int a) const { return (width_ + (1 << a) - 1) >> a; }
  int cells_y(int a) const { return (height_ + (1 << a) - 1) >> a; }
  bool is_pole(int64_t row) const {
    return (layout_.pole_first && row == 0) || (layout_.pole_last && row == layout_.last_row());
  }

  /// Directions and radii of the block's samples, and of the rows beyond that its triangles may meet.
  void load(const Block& block) {
    width_ = block.width;
    height_ = block.height;
    odd_ = ((block.x + block.y) & 1) != 0;
    row0_ = block.row;
    half_cosine_.resize(static_cast<size_t>(width_ + 1));
    for (int i = 0; i <= width_; ++i) half_cosine_[static_cast<size_t>(i)] = half_cosine(field_, i);
    const Reach reach = rows_beyond(field_, block);
    above_ = reach.above;
    below_ = reach.below;
    const int rows = above_ + height_ + below_ + 1;
    lat_.resize(static_cast<size_t>(rows));
    slope_.resize(lat_.size());
    cosine_.resize(static_cast<size_t>(width_ + 1));
    sine_.resize(cosine_.size());
    for (int i = 0; i <= width_; ++i) {
      const glm::dvec2 lon = cos_sin_degrees(field_.longitude(block.col + i));
      cosine_[static_cast<size_t>(i)] = lon.x;
      sine_[static_cast<size_t>(i)] = lon.y;
    }
    radius_.resize(lat_.size() * cosine_.size());
    for (int r = 0; r < rows; ++r) {
      const int64_t row = block.row - above_ + r;
      lat_[static_cast<size_t>(r)] = cos_sin_degrees(field_.latitude(row));
      slope_[static_cast<size_t>(r)] = lat_[static_cast<size_t>(r)].y / lat_[static_cast<size_t>(r)].x;
      double* out = radius_.data() + static_cast<size_t>(r) * cosine_.size();
      for (int i = 0; i <= width_; ++i) {
        const int64_t col = is_pole(row) || block.col + i == field_.cols ? 0 : block.col + i;
        out[i] = field_.radius + static_cast<double>(field_.at(row, col));
      }
    }
  }

  Vertex vertex(int i, int j, int a, const Snaps& snaps) const {
    Vertex v{std::min(j << a, height_), std::min(i << a, width_)};
    const int row = v.row, col = v.col;
    if (row == 0) v.col = stitch_along(col, width_, a, snaps[kNorth], log2_);
    if (row == height_) v.col = stitch_along(col, width_, a, snaps[kSouth], log2_);
    const int poles = is_pole(row0_) + 2 * is_pole(row0_ + height_);
    if (col == 0) v.row = stitch_down(row, height_, a, snaps[kWest], log2_, poles);
    if (col == width_) v.row = stitch_down(row, height_, a, snaps[kEast], log2_, poles);
    return v;
  }

  /// Cells [i0, i1) x [j0, j1) of the block's grid of stride 2^a.
  float measure_cells(int a, const Snaps& snaps, int i0, int i1, int j0, int j1) const {
    double worst = 0.0;
    for (int j = j0; j < j1; ++j) {
      for (int i = i0; i < i1; ++i) {
        const Vertex nw = vertex(i, j, a, snaps), ne = vertex(i + 1, j, a, snaps);
        const Vertex sw = vertex(i, j + 1, a, snaps), se = vertex(i + 1, j + 1, a, snaps);
        if (((i + j + (a == log2_ && odd_)) & 1) == 0) {
          measure_triangle({nw, sw, se}, worst);
          measure_triangle({nw, se, ne}, worst);
        } else {
          measure_triangle({nw, sw, ne}, worst);
          measure_triangle({ne, sw, se}, worst);
        }
      }
    }
    return rounded_up(worst);
  }

  float rounded_up(double error) const {
    const double rounded = error + kRounding * (field_.radius + field_.z_max);
    return std::nextafter(static_cast<float>(rounded), std::numeric_limits<float>::infinity());
  }

  /// Of the fans between the border row's samples and the great circles between those that are drawn.
  float fringe_error(const Block& block, int a) const {
    if (a == 0 || !layout_.has_fringe(block.row, log2_)) return 0.0f;
    const int row = layout_.fringe_first ? 0 : height_;
    double worst = 0.0;
    for (int west = 0; west < width_; west += 1 << a) {
      const int east = std::min(west + (1 << a), width_);
      double fans = 0.0;
      for (int i = west + 1; i < east; ++i)
        measure_triangle({Vertex{row, west}, {row, i}, {row, i + 1}}, fans);
      worst = std::max(worst, std::min(fans, wall_error(row, west, east)));
    }
    return rounded_up(worst);
  }

  double wall_error(int row, int west, int east) const;

  double radius(const Vertex& v) const {
    return radius_[static_cast<size_t>(above_ + v.row) * cosine_.size() + static_cast<size_t>(v.col)];
  }
  glm::dvec3 direction(const Vertex& v) const {
    const glm::dvec2 lat = lat_[static_cast<size_t>(above_ + v.row)];
    return {lat.x * cosine_[static_cast<size_t>(v.col)], lat.x * sine_[static_cast<size_t>(v.col)], lat.y};
  }

  void measure_triangle(const std::array<Vertex, 3>& corners, double& worst) const;

  /// How far along a ray the plane of a triangle moves at most, when its corners go to the lattice: where a
  /// ray meets it, the surface moves by no more than they do, e, and e / cosine(normal, ray) along the ray.
  /// `normal` is the length of the cross product of two sides, `along` its component along any ray that meets
  /// the triangle.
  double moved_by_lattice(const glm::dvec3& u, const glm::dvec3& v, double normal, double along) const {
    const double e = lattice_error_, turned = 2.0 * e * (glm::length(u) + glm::length(v) + 2.0 * e);
    if (!(along > turned)) return std::numeric_limits<double>::infinity();
    return e * (normal + turned) / (along - turned);
  }

  const HeightRows& field_;
  const Layout layout_;
  const int log2_, top_;
  const double lattice_error_;
  // The block that was loaded; tables of rows start `above_` rows before it.
  int width_ = 0, height_ = 0, above_ = 0, below_ = 0;
  int64_t row0_ = 0;
  bool odd_ = false;
  std::vector<double> half_cosine_;  ///< of half the longitude across so many columns
  std::vector<glm::dvec2> lat_;      ///< cosine and sine
  std::vector<double> slope_;        ///< tangent of the latitude
  std::vector<double> cosine_, sine_;
  std::vector<double> radius_;
};

void PlanetMeasurer::measure_triangle(const std::array<Vertex, 3>& corners, double& worst) const {
  if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) return;
  glm::dvec3 p[3], at[3];
  int poles = 0;
  for (size_t i = 0; i < 3; ++i) {
    at[i] = direction(corners[i]);
    p[i] = radius(corners[i]) * at[i];
    poles += is_pole(row0_ + corners[i].row);
  }
  if (poles > 1) return;
  // Of directions: heights, however steep, take no digits from the planes of edges.
  const glm::dvec3 sides[3] = {at[2] - at[1], at[0] - at[2], at[1] - at[0]};
  const double area = glm::dot(at[0], glm::cross(sides[1], sides[2]));
  const double chord =
      std::max({glm::dot(sides[0], sides[0]), glm::dot(sides[1], sides[1]), glm::dot(sides[2], sides[2])});
  if (!(std::abs(area) > 1e-13 * chord)) return;  // it has collapsed
  const double sign = area > 0.0 ? 1.0 : -1.0;
  const glm::dvec3 edges[3] = {sign * glm::cross(at[1], sides[0]), sign * glm::cross(at[2], sides[1]),
                               sign * glm::cross(at[0], sides[2])};
  const glm::dvec3 u = p[1] - p[0], v = p[2] - p[0], normal = sign * glm::cross(u, v);
  const double volume = glm::dot(normal, p[0]);
  const auto [nearest, farthest] = std::minmax({radius(corners[0]), radius(corners[1]), radius(corners[2])});
  double slack[3];
  for (int i = 0; i < 3; ++i)
    slack[i] = (kOnEdge + 2.0 * lattice_error_ / nearest) *
               (std::abs(edges[i].x) + std::abs(edges[i].y) + std::abs(edges[i].z));
  const auto [left, right] = std::minmax({corners[0].col, corners[1].col, corners[2].col});
  auto [top, bottom] = std::minmax({corners[0].row, corners[1].row, corners[2].row});
  // A great circle between two places south of a parallel stays south of the arc between two places on it.
  const double reach = half_cosine_[static_cast<size_t>(right - left)];
  const double north = slope_[static_cast<size_t>(above_ + top)],
               south = -slope_[static_cast<size_t>(above_ + bottom)];
  int first = top, last = bottom;
  while (north > 0.0 && first > -above_ && slope_[static_cast<size_t>(above_ + first - 1)] * reach <= north)
    --first;
  while (south > 0.0 && last < height_ + below_ &&
         -slope_[static_cast<size_t>(above_ + last + 1)] * reach <= south)
    ++last;
  const auto skip = static_cast<size_t>(left);
  Row line{};
  line.volume = volume;
  line.moved = moved_by_lattice(u, v, glm::length(normal), volume / farthest);
  // A mean of unit vectors, no two farther apart than a chord, is at least sqrt(1 - chord^2 / 3) long.
  line.lowest = nearest * std::sqrt(std::max(1.0 - chord / 3.0, 0.0)) - lattice_error_;
  line.highest = farthest + lattice_error_;
  for (int row = first; row <= last; ++row) {
    const auto r = static_cast<size_t>(above_ + row);
    for (int i = 0; i < 3; ++i) line.set(i, edges[i], lat_[r], slack[i]);
    line.set(3, normal, lat_[r], 0.0);
    worst = std::max(worst, row_error(line, cosine_.data() + skip, sine_.data() + skip,
                                      radius_.data() + r * cosine_.size() + skip, right - left + 1));
  }
}

/// A fan that is as thin as steps of the lattice is a wall: a ray that a step moves meets it at any height
/// from that of the great circle to those of the samples. Infinite where the fan is as high as a row of
/// samples.
double PlanetMeasurer::wall_error(int row, int west, int east) const {
  const Vertex ends[] = {{row, west}, {row, east}};
  const glm::dvec3 from = radius(ends[0]) * direction(ends[0]), to = radius(ends[1]) * direction(ends[1]);
  const glm::dvec3 normal = glm::cross(to - from, glm::cross(from, to));
  const auto r = static_cast<size_t>(above_ + row);
  const double latitude = std::abs(std::atan(slope_[r]));
  const double bulge =
      std::atan(std::abs(slope_[r]) / half_cosine_[static_cast<size_t>(east - west)]) - latitude;
  if (bulge >= 0.5 * field_.dlat * kRadiansPerDegree) return std::numeric_limits<double>::infinity();
  double low = 0.0, high = 0.0, step = 0.0;
  for (int i = west; i <= east; ++i) {
    const double beyond = radius({row, i}) - glm::dot(normal, from) / glm::dot(normal, direction({row, i}));
    low = std::min(low, beyond);
    high = std::max(high, beyond);
    if (i > west) step = std::max(step, std::abs(radius({row, i}) - radius({row, i - 1})));
  }
  const double across = glm::distance(direction({row, west}), direction({row, west + 1}));
  const double nearest = field_.radius + field_.z_min;
  return high - low + 4.0 * lattice_error_ * (1.0 + step / (nearest * across));
}

}  // namespace

Reach rows_beyond(const FieldFrame& frame, const Block& block) {
  Reach reach;
  if (!frame.planet) return reach;
  const auto slope = [&](int64_t row) {
    const glm::dvec2 lat = cos_sin_degrees(frame.latitude(row));
    return lat.y / lat.x;
  };
  const double widest = half_cosine(frame, block.width);
  const int64_t last = block.row + block.height;
  const double north = slope(block.row), south = -slope(last);
  while (north > 0.0 && block.row - reach.above > 0 && slope(block.row - reach.above - 1) * widest <= north)
    ++reach.above;
  while (south > 0.0 && last + reach.below < frame.rows - 1 &&
         -slope(last + reach.below + 1) * widest <= south)
    ++reach.below;
  return reach;
}

std::unique_ptr<Measurer> make_planet_measurer(const HeightRows& field, const Layout& layout) {
  return std::make_unique<PlanetMeasurer>(field, layout);
}

}  // namespace lodlab::multigrain
