// SPDX-License-Identifier: MIT
// Work is cut into blocks whose size depends on its amount alone, and reduced block by block, in order: the
// same figures for any number of threads.
#include "geometry/mesh_distance.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "base/errors.h"
#include "base/parallel.h"

namespace lodlab {
namespace {

/// Rounds of cuts take turns: along an edge, where two are equally far, along an edge, halving the longest
/// edge. The last makes pieces shrink whatever the others do. One surface cut into other triangles takes
/// about 10 pieces a triangle so, and 40 without the cuts along edges.
constexpr int kHalveEvery = 4;

/// Parts of this size, as a share of their distance, see it change little: no smaller ones are integrated
/// over.
constexpr double kSmallPart = 0.1;

/// A cut closer than this to a corner, as a share of the edge, goes through it: rounding would peel off
/// slivers without end. What it leaves over an edge is far below kLeastShare.
constexpr double kSnap = 1e-10;

/// One result a block of [0, count); at least 64 blocks where there is work for them.
template <class Result, class Body>
std::vector<Result> per_block(int64_t count, const Body& body) {
  const int64_t size = std::clamp<int64_t>(count / 64, 1, 256);
  std::vector<Result> out(static_cast<size_t>((count + size - 1) / size));
  parallel_for(static_cast<int64_t>(out.size()), 1, [&](int64_t begin, int64_t end) {
    for (int64_t block = begin; block < end; ++block) {
      for (int64_t i = block * size; i < std::min(count, (block + 1) * size); ++i)
        body(i, out[static_cast<size_t>(block)]);
    }
  });
  return out;
}

double area(const Triangle& t) { return 0.5 * glm::length(glm::cross(t[1] - t[0], t[2] - t[0])); }

glm::dvec3 inside(const Triangle& t, const glm::dvec3& weights) {
  return weights.x * t[0] + weights.y * t[1] + weights.z * t[2];
}

struct RulePoint {
  double weight;
  glm::dvec3 at;
};

/// Radon (1948): exact for polynomials of degree 5.
const std::array<RulePoint, 7>& radon() {
  static const std::array<RulePoint, 7> rule = [] {
    const double root = std::sqrt(15.0);
    std::array<RulePoint, 7> out;
    out[0] = {9.0 / 40.0, glm::dvec3(1.0 / 3.0)};
    for (int group = 0; group < 2; ++group) {
      const double sign = group == 0 ? 1.0 : -1.0, pair = (6.0 + sign * root) / 21.0;
      for (int i = 0; i < 3; ++i) {
        glm::dvec3 at(pair);
        at[i] = 1.0 - 2.0 * pair;
        out[static_cast<size_t>(1 + 3 * group + i)] = {(155.0 + sign * root) / 1200.0, at};
      }
    }
    return out;
  }();
  return rule;
}

struct Corner {
  glm::dvec3 at{0.0};
  double distance = 0.0;
  uint32_t closest = kNoTriangle;
};

/// Part of a triangle of the surface. `best`: the target triangle that gives the lowest upper bound, over
/// what is attained of its share.
struct Piece {
  std::array<Corner, 3> corners;
  double upper = std::numeric_limits<double>::infinity();
  uint32_t best = kNoTriangle;
};

/// What a block of triangles, or of pieces, comes to.
struct Found {
  std::vector<double> attained;  ///< of each share, or none: distances above those of before
  double squares = 0.0;          ///< integral of the squared distance over the area
  std::vector<Piece> open;
};

class Measurer {
 public:
  /// `lower`: of each share the distance attained, one where there are no shares.
  Measurer(const MeshSurface& to, const Shares& shares, std::vector<double> lower, double absolute)
      : to_(to), shares_(shares), lower_(std::move(lower)), absolute_(absolute) {}

  const std::vector<double>& lower() const { return lower_; }
  double lower(uint32_t triangle) const { return lower_[share(triangle)]; }
  void raise(const Found& found) {
    for (size_t i = 0; i < found.attained.size(); ++i) lower_[i] = std::max(lower_[i], found.attained[i]);
  }
  bool open(const Piece& piece) const {
    const double lower = this->lower(piece.best);
    return piece.upper > lower * (1.0 + kMaxTolerance) && piece.upper > lower + absolute_;
  }
  double distance(const glm::dvec3& point, uint32_t triangle) const {
    return closest_on_triangle(to_.mesh().triangle(triangle), point).distance;
  }

  /// The integral over a triangle that is cut into parts^2 equal parts.
  void integrate(const Triangle& triangle, int64_t parts, const Piece& whole, Found& found) const;
  /// Bounds a piece by the triangles closest to its corners, by `others`, and when that leaves it open by
  /// the one closest to its centroid.
  void bound(Piece& piece, std::array<uint32_t, 2> others, Found& found) const;
  /// Bounds the parts of a piece and keeps those still open.
  void cut(const Piece& piece, int round, Found& found) const;

 private:
  uint32_t share(uint32_t triangle) const { return shares_.of.empty() ? 0 : shares_.of[triangle]; }
  Corner corner(const glm::dvec3& at, uint32_t hint) const;
  void attain(const Corner& point, const Piece& piece, Found& found) const;
  void try_bound(Piece& piece, uint32_t triangle) const;
  double crossing(const glm::dvec3& from, const glm::dvec3& to, uint32_t a, uint32_t b) const;
  template <class Crossing>
  bool cut_off(const Piece& piece, const std::array<double, 3>& values, std::array<uint32_t, 2> others,
               const Crossing& crossing, Found& found) const;
  bool cut_along_edge(const Piece& piece, const Corner& worst, Found& found) const;
  bool cut_between(const Piece& piece, const Corner& worst, Found& found) const;
  void keep(const std::array<Corner, 3>& corners, std::array<uint32_t, 2> others, Found& found) const;

  const MeshSurface& to_;
  const Shares& shares_;
  std::vector<double> lower_;
  double absolute_;
};

Corner Measurer::corner(const glm::dvec3& at, uint32_t hint) const {
  const Closest closest = held_to(to_, shares_, at, to_.closest(at, hint));
  return {at, closest.distance, closest.triangle};
}

/// A point of a piece was seen. Its rounding must not lift it above what the piece can hold.
void Measurer::attain(const Corner& point, const Piece& piece, Found& found) const {
  const uint32_t share = this->share(point.closest);
  const bool bounded = piece.best != kNoTriangle && this->share(piece.best) == share;
  const double distance = bounded ? std::min(point.distance, piece.upper) : point.distance;
  if (!(distance > lower_[share])) return;
  found.attained.resize(lower_.size(), 0.0);
  found.attained[share] = std::max(found.attained[share], distance);
}

void Measurer::integrate(const Triangle& triangle, int64_t parts, const Piece& whole, Found& found) const {
  const double n = static_cast<double>(parts);
  const glm::dvec3 u = (triangle[1] - triangle[0]) / n, v = (triangle[2] - triangle[0]) / n;
  double squares = 0.0;
  uint32_t hint = whole.best;
  const auto part = [&](const Triangle& t) {
    for (const RulePoint& point : radon()) {
      const Corner at = corner(inside(t, point.at), hint);
      attain(at, whole, found);
      hint = at.closest;
      squares += point.weight * at.distance * at.distance;
    }
  };
  for (int64_t i = 0; i < parts; ++i) {
    for (int64_t j = 0; i + j < parts; ++j) {
      const glm::dvec3 a = triangle[0] + static_cast<double>(i) * u + static_cast<double>(j) * v;
      part({a, a + u, a + v});
      if (i + j + 1 < parts) part({a + u, a + u + v, a + v});
    }
  }
  found.squares += squares * area(triangle) / (n * n);
}

void Measurer::try_bound(Piece& piece, uint32_t triangle) const {
  double upper = 0.0;
  for (const Corner& c : piece.corners) upper = std::max(upper, distance(c.at, triangle));
  if (piece.best != kNoTriangle) {
    const uint32_t mine = share(triangle), its = share(piece.best);
    if (mine == its ? upper >= piece.upper : upper - lower_[mine] >= piece.upper - lower_[its]) return;
  }
  piece.upper = upper;
  piece.best = triangle;
}

void Measurer::bound(Piece& piece, std::array<uint32_t, 2> others, Found& found) const {
  for (const Corner& c : piece.corners) try_bound(piece, c.closest);
  for (const uint32_t other : others) {
    if (other != kNoTriangle) try_bound(piece, other);
  }
  if (!open(piece)) return;
  const auto& c = piece.corners;
  const glm::dvec3 centroid = (c[0].at + c[1].at + c[2].at) / 3.0;
  const Corner middle = corner(centroid, piece.best);
  try_bound(piece, middle.closest);
  attain(middle, piece, found);
}

void Measurer::keep(const std::array<Corner, 3>& corners, std::array<uint32_t, 2> others,
                    Found& found) const {
  Piece piece;
  piece.corners = corners;
  bound(piece, others, found);
  if (open(piece)) found.open.push_back(piece);
}

/// The share of the way between two points, of which one is closer to a and the other to b, at which both are
/// equally far: regula falsi, Illinois' way. Need not be exact.
double Measurer::crossing(const glm::dvec3& from, const glm::dvec3& to, uint32_t a, uint32_t b) const {
  const auto difference = [&](const glm::dvec3& at) { return distance(at, a) - distance(at, b); };
  double lo = 0.0, hi = 1.0, at_lo = difference(from), at_hi = difference(to);
  int last = 0;
  for (int step = 0; step < 40 && at_lo != at_hi; ++step) {
    const double middle = std::clamp(lo - at_lo * (hi - lo) / (at_hi - at_lo), lo, hi);
    const double value = difference(glm::mix(from, to, middle));
    if (value == 0.0 || middle == lo || middle == hi) return middle;
    if ((value > 0.0) == (at_hi > 0.0)) {
      hi = middle, at_hi = value;
      if (last == 1) at_lo *= 0.5;
      last = 1;
    } else {
      lo = middle, at_lo = value;
      if (last == -1) at_hi *= 0.5;
      last = -1;
    }
  }
  return 0.5 * (lo + hi);
}

/// Cuts off the corner that alone has a positive value, or alone has none; `crossing` gives where between
/// two corners to cut, as a share of the way. False when there is none, or when the cut would leave the piece
/// as it is.
template <class Crossing>
bool Measurer::cut_off(const Piece& piece, const std::array<double, 3>& values,
                       std::array<uint32_t, 2> others, const Crossing& crossing, Found& found) const {
  const auto positive = [&](size_t i) { return values[i] > 0.0; };
  const int count = positive(0) + positive(1) + positive(2);
  if (count == 0 || count == 3) return false;
  size_t lone = 0;
  while (positive(lone) != (count == 1)) ++lone;
  const size_t next = (lone + 1) % 3, last = (lone + 2) % 3;
  const Corner &tip = piece.corners[lone], &p = piece.corners[next], &q = piece.corners[last];
  const auto place = [&](size_t to) {
    const double share = crossing(lone, to);
    if (share < kSnap) return tip.at;
    return share > 1.0 - kSnap ? piece.corners[to].at : glm::mix(tip.at, piece.corners[to].at, share);
  };
  const glm::dvec3 at_p = place(next), at_q = place(last);
  if (at_p == tip.at || at_q == tip.at || (at_p == p.at && at_q == q.at)) return false;
  const Corner on_p = corner(at_p, others[0]), on_q = corner(at_q, others[0]);
  attain(on_p, piece, found);
  attain(on_q, piece, found);
  keep({tip, on_p, on_q}, others, found);
  const bool from_p = glm::distance(p.at, at_q) <= glm::distance(q.at, at_p);  // the shorter diagonal
  if (at_p != p.at) keep({p, from_p ? on_q : q, on_p}, others, found);
  if (at_q != q.at) keep({q, on_q, from_p ? p : on_p}, others, found);
  return true;
}

/// Along the plane through an edge of the best triangle, perpendicular to it, beyond which the worst corner
/// lies farthest.
bool Measurer::cut_along_edge(const Piece& piece, const Corner& worst, Found& found) const {
  const Triangle t = to_.mesh().triangle(piece.best);
  const glm::dvec3 normal = glm::cross(t[1] - t[0], t[2] - t[0]);
  double farthest = 0.0;
  std::array<double, 3> values{};
  for (size_t i = 0; i < 3; ++i) {
    const glm::dvec3 out = glm::cross(t[(i + 1) % 3] - t[i], normal);
    const double beyond = glm::dot(worst.at - t[i], out) / glm::length(out);
    if (!(beyond > farthest)) continue;
    farthest = beyond;
    for (size_t k = 0; k < 3; ++k) values[k] = glm::dot(piece.corners[k].at - t[i], out);
  }
  const auto crossing = [&](size_t from, size_t to) { return values[from] / (values[from] - values[to]); };
  return farthest > 0.0 && cut_off(piece, values, {piece.best, worst.closest}, crossing, found);
}

/// Where the best triangle and the one closest to the worst corner are equally far.
bool Measurer::cut_between(const Piece& piece, const Corner& worst, Found& found) const {
  std::array<double, 3> values;
  for (size_t i = 0; i < 3; ++i)
    values[i] = distance(piece.corners[i].at, piece.best) - distance(piece.corners[i].at, worst.closest);
  const auto place = [&](size_t from, size_t to) {
    return crossing(piece.corners[from].at, piece.corners[to].at, piece.best, worst.closest);
  };
  return cut_off(piece, values, {piece.best, worst.closest}, place, found);
}

void Measurer::cut(const Piece& piece, int round, Found& found) const {
  const auto farther = [&](const Corner& x, const Corner& y) {
    return distance(x.at, piece.best) < distance(y.at, piece.best);
  };
  const Corner& worst = *std::max_element(piece.corners.begin(), piece.corners.end(), farther);
  if (round % kHalveEvery != 0) {
    if (round % 2 == 1 && cut_along_edge(piece, worst, found)) return;
    if (cut_between(piece, worst, found)) return;
  }
  size_t longest = 0;  // the edge from this corner to the next
  double length = -1.0;
  for (size_t i = 0; i < 3; ++i) {
    const double edge = glm::distance(piece.corners[i].at, piece.corners[(i + 1) % 3].at);
    if (edge > length) length = edge, longest = i;
  }
  const Corner &p = piece.corners[longest], &q = piece.corners[(longest + 1) % 3],
               &tip = piece.corners[(longest + 2) % 3];
  const Corner middle = corner(0.5 * (p.at + q.at), piece.best);
  attain(middle, piece, found);
  keep({tip, p, middle}, {piece.best, worst.closest}, found);
  keep({tip, middle, q}, {piece.best, worst.closest}, found);
}

/// Takes over what blocks have found; pieces that distances attained meanwhile settle are dropped.
std::vector<Piece> gather(Measurer& measurer, std::vector<Found>& blocks) {
  for (const Found& block : blocks) measurer.raise(block);
  std::vector<Piece> out;
  for (Found& block : blocks) {
    for (const Piece& piece : block.open) {
      if (measurer.open(piece)) out.push_back(piece);
    }
    block.open = {};
  }
  return out;
}

void refine(Measurer& measurer, std::vector<Piece> open, int64_t most_pieces) {
  int64_t cut = 0;
  for (int round = 1; !open.empty(); ++round) {
    cut += static_cast<int64_t>(open.size());
    if (cut > most_pieces) {
      const auto less = [](const Piece& a, const Piece& b) { return a.upper < b.upper; };
      const Piece& worst = *std::max_element(open.begin(), open.end(), less);
      char text[200];
      std::snprintf(
          text, sizeof text,
          "mesh distance: the largest distance lies within %.9g to %.9g after %lld pieces of surface; "
          "no more than that are tried",
          measurer.lower(worst.best), worst.upper, static_cast<long long>(most_pieces));
      throw Unsupported(text);
    }
    auto blocks = per_block<Found>(static_cast<int64_t>(open.size()), [&](int64_t i, Found& found) {
      measurer.cut(open[static_cast<size_t>(i)], round, found);
    });
    open = gather(measurer, blocks);
  }
}

double farthest(const std::vector<Closest>& at_vertices) {
  double out = 0.0;
  for (const Closest& closest : at_vertices) out = std::max(out, closest.distance);
  return out;
}

/// A triangle as a piece, bounded, and left open where that settles nothing.
Piece whole_triangle(const Measurer& measurer, const WeldedMesh& from,
                     const std::vector<Closest>& at_vertices, int64_t index, Found& found) {
  const Triangle triangle = from.triangle(index);
  Piece piece;
  for (size_t k = 0; k < 3; ++k) {
    const Closest& closest = at_vertices[from.faces[static_cast<size_t>(index)][k]];
    piece.corners[k] = {triangle[k], closest.distance, closest.triangle};
  }
  measurer.bound(piece, {kNoTriangle, kNoTriangle}, found);
  if (measurer.open(piece)) found.open.push_back(piece);
  return piece;
}

/// The maxima, from what whole triangles have found and left open.
const std::vector<double>& settle(Measurer& measurer, std::vector<Found>& blocks, int64_t most_pieces) {
  std::vector<Piece> open = gather(measurer, blocks);
  refine(measurer, std::move(open), most_pieces);
  return measurer.lower();
}

const std::vector<double>& settle(Measurer& measurer, const WeldedMesh& from,
                                  const std::vector<Closest>& at_vertices, int64_t most_pieces) {
  auto blocks = per_block<Found>(from.triangles(), [&](int64_t i, Found& found) {
    whole_triangle(measurer, from, at_vertices, i, found);
  });
  return settle(measurer, blocks, most_pieces);
}

}  // namespace

std::vector<Closest> closest_to_vertices(const WeldedMesh& from, const MeshSurface& to) {
  std::vector<Closest> out(from.positions.size());
  parallel_for(static_cast<int64_t>(out.size()), 1024, [&](int64_t begin, int64_t end) {
    uint32_t hint = kNoTriangle;
    for (int64_t i = begin; i < end; ++i) {
      const auto vertex = static_cast<size_t>(i);
      out[vertex] = to.closest(from.positions[vertex], hint);
      hint = out[vertex].triangle;
    }
  });
  return out;
}

SurfaceDistance surface_distance(const WeldedMesh& from, const std::vector<Closest>& at_vertices,
                                 const MeshSurface& to, double extent, int64_t most_pieces) {
  const Shares none;
  Measurer measurer(to, none, {farthest(at_vertices)}, kLeastShare * extent);
  double whole_area = 0.0;
  for (int64_t i = 0; i < from.triangles(); ++i) whole_area += area(from.triangle(i));
  const double share = whole_area / static_cast<double>(std::max(from.triangles(), to.mesh().triangles()));
  auto blocks = per_block<Found>(from.triangles(), [&](int64_t i, Found& found) {
    const Piece piece = whole_triangle(measurer, from, at_vertices, i, found);
    const Triangle triangle = from.triangle(i);
    const double own = area(triangle);
    if (own == 0.0 || piece.upper == 0.0) return;  // a triangle that lies in one of the target's adds nothing
    double nearest = piece.corners[0].distance, longest = 0.0;
    for (size_t k = 0; k < 3; ++k) {
      nearest = std::min(nearest, piece.corners[k].distance);
      longest = std::max(longest, glm::distance(triangle[k], triangle[(k + 1) % 3]));
    }
    const double wanted = std::min(std::sqrt(own / share), 1.0 + longest / (kSmallPart * nearest));
    const int64_t parts = std::max<int64_t>(1, std::llround(wanted));
    measurer.integrate(triangle, parts, piece, found);
  });
  double squares = 0.0;
  for (const Found& block : blocks) squares += block.squares;
  SurfaceDistance out;
  out.max = settle(measurer, blocks, most_pieces)[0];
  out.rms = whole_area > 0.0 ? std::sqrt(squares / whole_area) : std::numeric_limits<double>::quiet_NaN();
  return out;
}

double largest_distance(const WeldedMesh& from, const std::vector<Closest>& at_vertices,
                        const MeshSurface& to, double extent, int64_t most_pieces, double at_least) {
  const Shares none;
  Measurer measurer(to, none, {std::max(farthest(at_vertices), at_least)}, kLeastShare * extent);
  return settle(measurer, from, at_vertices, most_pieces)[0];
}

Closest held_to(const MeshSurface& to, const Shares& shares, const glm::dvec3& point,
                const Closest& closest) {
  if (shares.of.empty() || closest.distance <= shares.reach[shares.of[closest.triangle]]) return closest;
  const auto reaches = [&](uint32_t triangle, double distance) {
    return distance <= shares.reach[shares.of[triangle]];
  };
  const Closest other = to.closest_within(point, shares.longest, reaches);
  return other.triangle == kNoTriangle ? closest : other;
}

std::vector<double> shared_distances(const WeldedMesh& from, std::vector<Closest> at_vertices,
                                     const MeshSurface& to, const Shares& shares, std::vector<double> seen,
                                     double extent, int64_t most_pieces) {
  parallel_for(static_cast<int64_t>(at_vertices.size()), 1024, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      Closest& closest = at_vertices[static_cast<size_t>(i)];
      closest = held_to(to, shares, from.positions[static_cast<size_t>(i)], closest);
    }
  });
  for (const Closest& closest : at_vertices) {
    double& largest = seen[shares.of[closest.triangle]];
    largest = std::max(largest, closest.distance);
  }
  Measurer measurer(to, shares, std::move(seen), kLeastShare * extent);
  return settle(measurer, from, at_vertices, most_pieces);
}

}  // namespace lodlab
