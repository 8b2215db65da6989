// SPDX-License-Identifier: MIT
// One triangle of a planet against the rays from its centre through the samples. An edge divides rays by
// the plane through it and the centre. The samples to try are those within the triangle's range of latitude
// and longitude: an arc between two corners can reach nearer to the pole than both, longitude goes round,
// and a triangle that holds a pole takes part of every longitude.
#include <cmath>

#include "geometry/angles.h"
#include "instrument/slack.h"
#include "instrument/surface_writer.h"

namespace lodlab::instrument {
namespace {

/// Margin of a range, in samples; candidates are tested, so more only costs time.
constexpr double kMargin = 1e-6;
/// Rays this close to an edge (radians) are on it: the rounding of the test itself.
constexpr double kOnEdge = 4e-15;

/// Positive on the inner side of the plane through the centre and the edge; in lengths times lengths.
struct Edge {
  glm::dvec3 normal;
  double reach;
};

Edge make_edge(const glm::dvec3& from, const glm::dvec3& to, double slack, double sign) {
  const glm::dvec3 normal = sign * glm::cross(from, to - from);
  return {normal, glm::length(normal) * (slack / glm::length(from) + kOnEdge)};
}

}  // namespace

PlanetRasterizer::Corner PlanetRasterizer::corner(const render::CapturedVertex& v) const {
  const FieldFrame& frame = grid_.frame();
  const glm::dvec3 relative(v.x, v.y, v.z);
  Corner out;
  out.at = eye_ + relative;
  const glm::dvec2 place = grid_.coordinates(relative, eye_);
  out.col = place.x;
  out.row = place.y;
  const double radius = glm::length(out.at);
  out.slack = world_slack(glm::length(relative)) + 1e-15 * (glm::length(eye_) + radius);
  const double row = std::nearbyint(place.y);
  double col = std::nearbyint(place.x);
  if (frame.wraps && col == static_cast<double>(frame.cols)) col = 0.0;
  out.pole = false;
  if (row < 0.0 || row >= static_cast<double>(frame.rows)) return out;
  const int64_t sample_row = static_cast<int64_t>(row);
  const bool pole = grid_.is_pole(sample_row);
  if (pole) col = 0.0;
  if (col < 0.0 || col >= static_cast<double>(frame.cols)) return out;
  const glm::dvec3 on_ray = radius * grid_.up(sample_row, static_cast<int64_t>(col));
  if (glm::distance(out.at, on_ray) > out.slack) return out;
  out.at = on_ray;
  out.row = row;
  out.col = col;
  out.slack = 0.0;
  out.pole = pole;
  return out;
}

PlanetRasterizer::Range PlanetRasterizer::range(const Corner (&c)[3]) const {
  const FieldFrame& frame = grid_.frame();
  const double turn = 360.0 / frame.dlon;  // columns once round
  double row_lo = std::min({c[0].row, c[1].row, c[2].row}), row_hi = std::max({c[0].row, c[1].row, c[2].row});
  const Corner& first = c[0].pole ? (c[1].pole ? c[2] : c[1]) : c[0];
  double col_lo = first.col, col_hi = first.col, slack = 0.0, winding = 0.0;
  double high = 0.0, low = 0.0;  // the largest and smallest z / radius of the arcs
  for (int i = 0; i < 3; ++i) {
    const Corner &a = c[i], &b = c[(i + 1) % 3];
    slack = std::max(slack, a.slack);
    winding += std::remainder(b.col - a.col, turn);
    if (!a.pole) {
      const double col = first.col + std::remainder(a.col - first.col, turn);
      col_lo = std::min(col_lo, col);
      col_hi = std::max(col_hi, col);
    }
    // The circle through both corners is nearest to the pole where it runs east-west: at `top`.
    const glm::dvec3 normal = glm::cross(a.at, b.at);
    const double size = glm::length(normal);
    if (!(size > 0.0)) continue;
    const glm::dvec3 top = glm::cross(glm::cross(normal, glm::dvec3(0.0, 0.0, 1.0)), normal);
    for (const double side : {1.0, -1.0}) {
      const glm::dvec3 peak = side * top;
      if (glm::dot(glm::cross(a.at, peak), normal) < 0.0 || glm::dot(glm::cross(peak, b.at), normal) < 0.0)
        continue;
      const double sine = std::sqrt(normal.x * normal.x + normal.y * normal.y) / size;
      if (peak.z > 0.0) high = std::max(high, sine);
      if (peak.z < 0.0) low = std::max(low, sine);
    }
  }
  if (high > 0.0)
    row_lo = std::min(row_lo, (frame.lat0 - std::asin(std::min(high, 1.0)) / kRadiansPerDegree) / frame.dlat);
  if (low > 0.0)
    row_hi = std::max(row_hi, (frame.lat0 + std::asin(std::min(low, 1.0)) / kRadiansPerDegree) / frame.dlat);
  const bool any_pole = c[0].pole || c[1].pole || c[2].pole;
  const bool around = !any_pole && (std::abs(winding) > 0.5 * turn || col_hi - col_lo > 0.5 * turn - 1.0);
  if (around) {  // it holds a pole, or an edge passes over one
    if (c[0].at.z + c[1].at.z + c[2].at.z > 0.0) {
      row_lo = 0.0;
    } else {
      row_hi = static_cast<double>(frame.rows - 1);
    }
    col_lo = 0.0;
    col_hi = turn;
  }
  const double radius = glm::length(c[0].at);
  const double row_margin = kMargin + slack / (radius * frame.dlat * kRadiansPerDegree);
  const double col_margin =
      kMargin +
      2.0 * slack /
          (std::max(std::hypot(first.at.x, first.at.y), slack) * frame.dlon * kRadiansPerDegree + 1e-300);
  const double rows = static_cast<double>(frame.rows), cols = static_cast<double>(frame.cols);
  const auto whole = [](double value, double lo, double hi) {
    return static_cast<int64_t>(std::min(std::max(value, lo), hi));
  };
  Range out{whole(std::ceil(row_lo - row_margin), 0.0, rows),
            whole(std::floor(row_hi + row_margin), -1.0, rows - 1),
            whole(std::ceil(col_lo - col_margin), -2.0 * turn, 2.0 * turn),
            whole(std::floor(col_hi + col_margin), -2.0 * turn, 2.0 * turn)};
  if (frame.wraps) {
    out.col_hi = std::min(out.col_hi, out.col_lo + frame.cols - 1);
  } else {
    out.col_lo = around ? 0 : std::max<int64_t>(out.col_lo, 0);
    out.col_hi = around ? frame.cols - 1 : std::min<int64_t>(out.col_hi, static_cast<int64_t>(cols) - 1);
  }
  return out;
}

void PlanetRasterizer::draw(TriangleVertices vertices, SurfaceWriter& out) const {
  const FieldFrame& frame = grid_.frame();
  const Corner c[3] = {corner(vertices[0]), corner(vertices[1]), corner(vertices[2])};
  const glm::dvec3 b = c[1].at - c[0].at, d = c[2].at - c[0].at;
  const double area = glm::dot(c[0].at, glm::cross(b, d));  // times the distance from the centre
  const double longest = std::max({glm::dot(b, b), glm::dot(d, d), glm::dot(d - b, d - b)});
  if (!(std::abs(area) > 1e-12 * longest * glm::length(c[0].at))) return;
  const double sign = area > 0.0 ? 1.0 : -1.0;
  const double slack = std::max({c[0].slack, c[1].slack, c[2].slack});
  const Edge edges[3] = {make_edge(c[1].at, c[2].at, slack, sign), make_edge(c[2].at, c[0].at, slack, sign),
                         make_edge(c[0].at, c[1].at, slack, sign)};
  const Range where = range(c);
  for (int64_t row = where.row_lo; row <= where.row_hi; ++row) {
    const bool pole = grid_.is_pole(row);  // one place: DrawnSurface copies column 0 to the others
    const int64_t col_lo = pole ? 0 : where.col_lo, col_hi = pole ? 0 : where.col_hi;
    for (int64_t i = col_lo; i <= col_hi; ++i) {
      const int64_t col = frame.wraps ? ((i % frame.cols) + frame.cols) % frame.cols : i;
      const glm::dvec3 ray = grid_.up(row, col);
      double w[3];
      bool inside = true;
      for (int e = 0; e < 3; ++e) {
        w[e] = glm::dot(ray, edges[e].normal);
        inside = inside && w[e] >= -edges[e].reach;
        w[e] = std::max(w[e], 0.0);
      }
      const double sum = w[0] + w[1] + w[2];
      if (!inside || !(sum > 0.0)) continue;  // the sum is negative on the far side of the planet
      const double height = glm::length(c[0].at + (w[1] * b + w[2] * d) / sum) - frame.radius;
      out.put(row, col, height);
    }
  }
}

}  // namespace lodlab::instrument
