// SPDX-License-Identifier: MIT
// One triangle of a planet against the rays from its centre through the samples. An edge divides rays by
// the plane through it and the centre. The samples to try are those within the triangle's range of latitude
// and longitude: an arc between two corners can reach nearer to the pole than both, longitude goes round,
// and a triangle that holds a pole takes part of every longitude.
#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/angles.h"
#include "instrument/slack.h"
#include "instrument/surface_writer.h"

namespace lodlab::instrument {
namespace {

/// Margin of a range, in samples; candidates are tested, so more only costs time.
constexpr double kMargin = 1e-6;
/// Rays this close to an edge (radians) are on it: the rounding of the test itself.
constexpr double kOnEdge = 4e-15;
/// Times that, and rounding takes less than a millionth of a triangle's relief from heights within it.
constexpr double kMuchWider = 1e6;

/// Positive on the inner side of the plane through the centre and the edge. Ends are directions, so that no
/// height, however steep, takes digits from a plane that it does not turn.
struct Edge {
  glm::dvec3 normal;
  double reach;
};

Edge make_edge(const glm::dvec3& from, const glm::dvec3& to, double slack, double sign) {
  const glm::dvec3 normal = sign * glm::cross(from, to - from);
  return {normal, glm::length(normal) * (slack + kOnEdge)};
}

}  // namespace

/// Where rays meet the plane of a triangle.
struct PlanetRasterizer::Plane {
  glm::dvec3 normal;
  double volume;  ///< normal times corner, not negative
  double least;   ///< no point of the triangle is nearer to the centre
  double most;    ///< or farther

  Plane(const Corner (&c)[3], const glm::dvec3& at, const glm::dvec3& to_b, const glm::dvec3& to_d,
        double longest)
      : normal(glm::cross(to_b, to_d)),
        volume(glm::dot(normal, at)),
        least(std::min({c[0].radius, c[1].radius, c[2].radius}) * (1.0 - 0.5 * longest)),
        most(std::max({c[0].radius, c[1].radius, c[2].radius})) {
    if (volume < 0.0) {
      normal = -normal;
      volume = -volume;
    }
  }
  /// The smallest and largest distance to the centre within an angle of a ray.
  glm::dvec2 within(const glm::dvec3& ray, double angle) const {
    const double along = glm::dot(normal, ray), turned = glm::length(glm::cross(normal, ray)) * angle;
    return {std::max(least, volume / (along + turned)),
            along > turned ? std::min(most, volume / (along - turned)) : most};
  }
};

PlanetRasterizer::Corner PlanetRasterizer::corner(const render::CapturedVertex& v) const {
  const FieldFrame& frame = grid_.frame();
  const glm::dvec3 relative(v.x, v.y, v.z), at = eye_ + relative;
  Corner out;
  const glm::dvec2 place = grid_.coordinates(relative, eye_);
  out.col = place.x;
  out.row = place.y;
  out.radius = glm::length(at);
  out.up = at / out.radius;
  const double slack = vertex_slack(frame, relative, eye_);
  out.slack = slack / out.radius;
  const double row = std::nearbyint(place.y);
  double col = std::nearbyint(place.x);
  if (frame.wraps && col == static_cast<double>(frame.cols)) col = 0.0;
  out.pole = false;
  const int64_t sample_row = static_cast<int64_t>(row);
  const double latitude = std::abs(frame.latitude(sample_row));
  if (latitude > 90.0) return out;
  const bool pole = latitude == 90.0;
  if (pole) col = 0.0;
  if (col < 0.0 || col >= static_cast<double>(frame.cols)) return out;
  const bool here = sample_row >= 0 && sample_row < frame.rows;  // of a band's triangles some corners are not
  const int64_t sample_col = static_cast<int64_t>(col);
  const glm::dvec3 up = here ? grid_.up(sample_row, sample_col) : frame.direction(sample_row, sample_col);
  if (glm::distance(at, out.radius * up) > slack) return out;
  // Near a pole columns may lie closer than the slack, twice what a position is ever off: there rounding may
  // lead to another one, and the corner stays where it is.
  const double columns = std::hypot(up.x, up.y) * frame.dlon * kRadiansPerDegree;
  if (!pole && out.slack > columns) return out;
  out.up = up;
  out.row = row;
  out.col = col;
  out.slack = 0.0;
  out.pole = pole;
  return out;
}

/// The weights of the point of the triangle's border that is nearest to a ray outside: a height within the
/// triangle, never an extrapolation, and not far along an edge where the triangle is thinner than the slack.
/// Returns how far it is, radians.
double PlanetRasterizer::to_nearest(const Corner (&c)[3], const glm::dvec3& ray, double (&w)[3]) {
  double least = std::numeric_limits<double>::infinity();
  double weights[3] = {w[0], w[1], w[2]};
  for (int from = 0; from < 3; ++from) {
    const int to = (from + 1) % 3;
    const glm::dvec3 &a = c[from].up, &b = c[to].up, normal = glm::cross(a, b - a);
    // Where the ray, moved into the plane of the centre and the edge, passes it.
    double at_a = std::max(0.0, glm::dot(glm::cross(ray, b), normal));
    const double at_b = std::max(0.0, glm::dot(glm::cross(a, ray), normal));
    if (!(at_a + at_b > 0.0)) at_a = 1.0;  // both ends are one place
    const glm::dvec3 gap = ray - glm::normalize(at_a * a + at_b * b);
    if (!(glm::dot(gap, gap) < least)) continue;
    least = glm::dot(gap, gap);
    weights[from] = at_a;
    weights[to] = at_b;
    weights[3 - from - to] = 0.0;
  }
  std::copy(weights, weights + 3, w);
  return std::sqrt(least);
}

PlanetRasterizer::Range PlanetRasterizer::range(const Corner (&c)[3]) const {
  const FieldFrame& frame = grid_.frame();
  const double turn = 360.0 / frame.dlon;  // columns once round
  double row_lo = std::min({c[0].row, c[1].row, c[2].row}), row_hi = std::max({c[0].row, c[1].row, c[2].row});
  const Corner& first = c[0].pole ? (c[1].pole ? c[2] : c[1]) : c[0];
  double col_lo = first.col, col_hi = first.col, slack = 0.0, winding = 0.0;
  double high = 0.0, low = 0.0;  // the largest and smallest z / radius of the arcs
  double nearest = 1.0;          // to the axis, among corners but poles, and arcs
  for (int i = 0; i < 3; ++i) {
    const Corner &a = c[i], &b = c[(i + 1) % 3];
    slack = std::max(slack, a.slack);
    winding += std::remainder(b.col - a.col, turn);
    if (!a.pole) {
      const double col = first.col + std::remainder(a.col - first.col, turn);
      col_lo = std::min(col_lo, col);
      col_hi = std::max(col_hi, col);
      nearest = std::min(nearest, std::hypot(a.up.x, a.up.y));
    }
    // The circle through both corners is nearest to the pole where it runs east-west: at `top`.
    const glm::dvec3 normal = glm::cross(a.up, b.up);
    const double size = glm::length(normal);
    if (!(size > 0.0)) continue;
    const glm::dvec3 top = glm::cross(glm::cross(normal, glm::dvec3(0.0, 0.0, 1.0)), normal);
    for (const double side : {1.0, -1.0}) {
      const glm::dvec3 peak = side * top;
      if (glm::dot(glm::cross(a.up, peak), normal) < 0.0 || glm::dot(glm::cross(peak, b.up), normal) < 0.0)
        continue;
      const double sine = std::sqrt(normal.x * normal.x + normal.y * normal.y) / size;
      if (peak.z > 0.0) high = std::max(high, sine);
      if (peak.z < 0.0) low = std::max(low, sine);
      if (!a.pole && !b.pole) nearest = std::min(nearest, std::abs(normal.z) / size);
    }
  }
  if (high > 0.0)
    row_lo = std::min(row_lo, (frame.lat0 - std::asin(std::min(high, 1.0)) / kRadiansPerDegree) / frame.dlat);
  if (low > 0.0)
    row_hi = std::max(row_hi, (frame.lat0 + std::asin(std::min(low, 1.0)) / kRadiansPerDegree) / frame.dlat);
  const bool any_pole = c[0].pole || c[1].pole || c[2].pole;
  const bool around = !any_pole && (std::abs(winding) > 0.5 * turn || col_hi - col_lo > 0.5 * turn - 1.0);
  if (around) {  // it holds a pole, or an edge passes over one
    if (c[0].up.z + c[1].up.z + c[2].up.z > 0.0) {
      row_lo = 0.0;
    } else {
      row_hi = static_cast<double>(frame.rows - 1);
    }
  }
  const double row_margin = kMargin + slack / (frame.dlat * kRadiansPerDegree);
  // So near a pole that any column may be within reach. A corner at the pole is exact, and its edges with it.
  const bool all_columns = around || (slack > 0.0 && nearest <= 2.0 * slack);
  if (all_columns) {
    col_lo = 0.0;
    col_hi = turn;
  }
  const double col_margin =
      all_columns ? 0.0
                  : kMargin + 2.0 * slack / (std::max(nearest, 1e-300) * frame.dlon * kRadiansPerDegree);
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
    out.col_lo = all_columns ? 0 : std::max<int64_t>(out.col_lo, 0);
    out.col_hi = all_columns ? frame.cols - 1 : std::min<int64_t>(out.col_hi, static_cast<int64_t>(cols) - 1);
  }
  return out;
}

void PlanetRasterizer::draw(TriangleVertices vertices, SurfaceWriter& out) const {
  const FieldFrame& frame = grid_.frame();
  const Corner c[3] = {corner(vertices[0]), corner(vertices[1]), corner(vertices[2])};
  const glm::dvec3 b = c[1].up - c[0].up, d = c[2].up - c[0].up;
  const double area = glm::dot(c[0].up, glm::cross(b, d));  // of directions: heights make nothing thin
  const double longest = std::max({glm::dot(b, b), glm::dot(d, d), glm::dot(d - b, d - b)});
  const double narrow = longest > 0.0 ? std::abs(area) / std::sqrt(longest) : 0.0;
  const double slack = std::max({c[0].slack, c[1].slack, c[2].slack});
  const bool thin = !(narrow > std::max(kOnEdge, 1e-12 * std::sqrt(longest)));  // a wall, or as good as one
  const bool rounded = thin || slack > 0.0, exact = !rounded && narrow > kMuchWider * kOnEdge;
  const double sign = area > 0.0 ? 1.0 : -1.0;
  const Edge edges[3] = {make_edge(c[1].up, c[2].up, slack, sign), make_edge(c[2].up, c[0].up, slack, sign),
                         make_edge(c[0].up, c[1].up, slack, sign)};
  const glm::dvec3 at = c[0].radius * c[0].up;
  const glm::dvec3 to_b = c[1].radius * c[1].up - at, to_d = c[2].radius * c[2].up - at;
  const double across[3] = {c[1].radius * c[2].radius, c[2].radius * c[0].radius, c[0].radius * c[1].radius};
  const Plane plane(c, at, to_b, to_d, longest);
  const Range where = range(c);
  for (int64_t row = where.row_lo; row <= where.row_hi; ++row) {
    const bool pole = grid_.is_pole(row);  // one place: DrawnSurface copies column 0 to the others
    const int64_t col_lo = pole ? 0 : where.col_lo, col_hi = pole ? 0 : where.col_hi;
    for (int64_t i = col_lo; i <= col_hi; ++i) {
      const int64_t col = frame.wraps ? ((i % frame.cols) + frame.cols) % frame.cols : i;
      const glm::dvec3 ray = grid_.up(row, col);
      double w[3];
      bool inside = true, off = thin, sure = !thin;
      for (int e = 0; e < 3; ++e) {
        w[e] = glm::dot(ray, edges[e].normal);
        inside = inside && w[e] >= -edges[e].reach;
        off = off || w[e] < 0.0;
        sure = sure && w[e] > edges[e].reach;
      }
      if (!inside) continue;
      const bool far_side = !(w[0] + w[1] + w[2] > 0.0);
      if (far_side && !(off && rounded)) continue;
      const double gap = off ? to_nearest(c, ray, w) : 0.0;
      for (int e = 0; e < 3; ++e) w[e] *= across[e];
      const double sum = w[0] + w[1] + w[2];
      const double height = glm::length(at + (w[1] * to_b + w[2] * to_d) / sum) - frame.radius;
      double low = height, high = height;
      if (!exact) {
        const glm::dvec2 within = plane.within(ray, slack + kOnEdge) - frame.radius;
        low = std::min(within.x, height);
        high = std::max(within.y, height);
      }
      if (sure || !rounded) {
        out.put(row, col, low, high);
      } else if (gap <= slack + kOnEdge) {
        out.put_unsure(row, col, low, high);
      }
    }
  }
}

}  // namespace lodlab::instrument
