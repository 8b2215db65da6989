// SPDX-License-Identifier: MIT
#include "methods/subdivision/bounds.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "base/parallel.h"
#include "geometry/bounds.h"
#include "geometry/mesh_distance.h"
#include "geometry/mesh_walk.h"

namespace lodlab::subdivision {
namespace {

constexpr int64_t kGrain = 256;

/// Cuts of a part that no walk settles, one within another, before its bound is left as it is.
constexpr int kMostCuts = 5;

/// Parts that a walk looks at.
constexpr int64_t kMostParts = 64;

/// Of so many triangles one is measured at its centre, for distances that most others do not exceed.
constexpr int64_t kFirstOf = 4;

/// Affine maps that are subtracted from a window.
constexpr int kMostMaps = 8;

/// Parts that a border may be cut into.
constexpr int64_t kMostPieces = int64_t{1} << 28;

/// Distances below this share of the meshes' extent are as good as none.
constexpr double kNegligible = 1e-7;

void raise(double& value, double to) {
  const std::atomic_ref<double> at(value);
  double seen = at.load(std::memory_order_relaxed);
  while (seen < to && !at.compare_exchange_weak(seen, to, std::memory_order_relaxed)) {
  }
}

/// Bounds of the distance from triangles to a surface whose triangles, `a_share` after one another, are in
/// shares. A triangle walks over the surface (mesh_walk.h) until every part is as near to one share as what
/// was attained in it says. What is left is as close as the farthest of its corners is to any one triangle of
/// the surface, since distance to that is convex; or as its centre is, and its corners from that; or it is
/// cut.
class Covering {
 public:
  Covering(const MeshSurface& to, std::span<const uint32_t> across, const Near& near, std::span<double> bound)
      : to_(to), across_(across), near_(near), bound_(bound) {}

  /// `start`: a triangle of the surface that may be close.
  void cover(const Triangle& triangle, uint32_t start) { cover(triangle, start, kMostCuts); }
  static glm::dvec3 centre_of(const Triangle& t) { return (t[0] + t[1] + t[2]) / 3.0; }

 private:
  void cover(const Triangle& triangle, uint32_t start, int cuts) {
    const size_t first = rest_.size();
    WalkPlace place{start};
    walk_over(to_, across_, near_, triangle, place, kMostParts, rest_);
    while (rest_.size() > first) {
      const Triangle part = rest_.back();
      rest_.pop_back();
      cut(part, place.on, cuts);
    }
  }

  void cut(const Triangle& part, uint32_t hint, int cuts) {
    const glm::dvec3 centre = centre_of(part);
    const Closest middle = to_.closest(centre, hint);
    const Triangle closest = to_.mesh().triangle(middle.triangle);
    double radius = 0.0, farthest = 0.0;
    for (const glm::dvec3& corner : part) {
      radius = std::max(radius, glm::distance(centre, corner));
      farthest = std::max(farthest, closest_on_triangle(closest, corner).distance);
    }
    const double upper = std::min(middle.distance + radius, farthest);
    if (upper <= near_(middle.triangle)) return;
    double& bound = bound_[middle.triangle / near_.in_a_group];
    raise(bound, (1.0 + kSlack) * middle.distance);
    if (upper <= (1.0 + kSlack) * middle.distance) return;
    if (cuts == 0) return raise(bound, upper);
    if (cuts == kMostCuts) return cover(part, middle.triangle, cuts - 1);
    size_t longest = 0;
    double length = -1.0;
    for (size_t k = 0; k < 3; ++k) {
      const double edge = glm::distance(part[k], part[(k + 1) % 3]);
      if (edge > length) length = edge, longest = k;
    }
    const glm::dvec3 &p = part[longest], &q = part[(longest + 1) % 3], &tip = part[(longest + 2) % 3];
    const glm::dvec3 at = 0.5 * (p + q);
    cover({tip, p, at}, middle.triangle, cuts - 1);
    cover({tip, at, q}, middle.triangle, cuts - 1);
  }

  const MeshSurface& to_;
  std::span<const uint32_t> across_;
  const Near& near_;
  std::span<double> bound_;  ///< of each share, no less than what counts as near to it
  std::vector<Triangle> rest_;
};

double near_of(double attained, double negligible) { return std::max((1.0 + kSlack) * attained, negligible); }

/// From the finest surface to the source, face by face.
void cover_finest(const SourceSurface& source, const WeldedMesh& finest, std::span<const uint32_t> near,
                  uint32_t triangles_a_face, double negligible, std::vector<double>& bound, Count& count) {
  const std::vector<uint32_t> across = across_sides(source.mesh);
  parallel_for(static_cast<int64_t>(bound.size()), 4, [&](int64_t begin, int64_t end) {
    for (int64_t face = begin; face < end; ++face) {
      const int64_t first = face * triangles_a_face, last = first + triangles_a_face;
      const auto start = [&](int64_t t) { return near[finest.faces[static_cast<size_t>(t)][0]]; };
      double attained = 0.0;
      for (int64_t t = first; t < last; t += kFirstOf) {
        const glm::dvec3 centre = Covering::centre_of(finest.triangle(t));
        attained = std::max(attained, source.surface.closest(centre, start(t)).distance);
      }
      double& most = bound[static_cast<size_t>(face)];
      most = near_of(attained, negligible);
      const Near to_source{{&most, 1}, kNoTriangle};  // rises with what is found
      Covering covering(source.surface, across, to_source, {&most, 1});
      for (int64_t t = first; t < last; ++t) covering.cover(finest.triangle(t), start(t));
    }
    count((end - begin) * triangles_a_face);
  });
}

/// From the source to the finest surface: each part is held to the face that it is found close to.
void cover_source(const SourceSurface& source, const MeshSurface& finest,
                  std::span<const Closest> at_vertices, uint32_t triangles_a_face, double negligible,
                  std::vector<double>& bound, Count& count) {
  const std::vector<uint32_t> across = across_sides(finest.mesh());
  for (const auto& f : source.mesh.faces) {
    for (const uint32_t v : f) {
      double& most = bound[at_vertices[v].triangle / triangles_a_face];
      most = std::max(most, near_of(at_vertices[v].distance, negligible));
    }
  }
  const std::vector<double> settled = bound;
  const Near to_finest{settled, triangles_a_face};
  parallel_for(source.mesh.triangles(), kGrain, [&](int64_t begin, int64_t end) {
    Covering covering(finest, across, to_finest, bound);
    for (int64_t t = begin; t < end; ++t)
      covering.cover(source.mesh.triangle(t),
                     at_vertices[source.mesh.faces[static_cast<size_t>(t)][0]].triangle);
    count(end - begin);
  });
}

/// From the finest border to the source's, where there is one: what is drawn of a control edge that only one
/// face has is held to that face.
void cover_borders(const SourceSurface& source, const Samples& samples, const WeldedMesh& finest,
                   double extent, std::vector<double>& bound) {
  const WeldedMesh segments = unmatched_edges(source.mesh);
  if (segments.faces.empty()) return;
  const MeshSurface border(segments);
  const auto inner = static_cast<uint32_t>(samples.pattern().n() - 1);
  for (int64_t e = 0; e < samples.edges().count(); ++e) {
    if (samples.edges().of(e).size() != 1) continue;
    const uint32_t side = samples.edges().of(e)[0];
    const auto [low, high] = samples.ends(e);
    WeldedMesh line;
    line.positions.push_back(finest.positions[low]);
    for (uint32_t k = 0; k <= inner; ++k) {
      const auto next = samples.first_on_edges() + e * inner + k;
      line.positions.push_back(finest.positions[k < inner ? static_cast<size_t>(next) : high]);
      line.faces.push_back({k, k + 1, k + 1});
    }
    double& most = bound[side / 3];
    most = std::max(most, (1.0 + kMaxTolerance) * largest_distance(line, closest_to_vertices(line, border),
                                                                   border, extent, kMostPieces));
  }
}

/// The extents of what a window of samples has left when its least-squares affine map is subtracted, as the
/// diagonal of their box.
class Windows {
 public:
  Windows(const Pattern& pattern, std::span<const glm::dvec3> ends)
      : pattern_(pattern), ends_(ends), weights_(ends.size(), 1.0) {}

  /// All samples with i0 <= i <= i0 + extent, likewise j, and k = n - i - j. Where that is more than
  /// `enough`, maps that weigh the samples farthest off more are tried, too (Lawson 1961).
  double left(int i0, int j0, int k0, int extent, double enough) {
    double least = std::numeric_limits<double>::infinity();
    for (int pass = 0;; ++pass) {
      const Map map = fitted(i0, j0, k0, extent);
      Box box;
      for_window(i0, j0, k0, extent,
                 [&](double u, double v, size_t at) { box.add(map.off(u, v, ends_[at])); });
      least = std::min(least, glm::distance(box.lo, box.hi));
      const bool again = least > enough && pass + 1 < kMostMaps;
      if (!again && pass > 0) weights_.assign(ends_.size(), 1.0);
      if (!again) return least;
      for_window(i0, j0, k0, extent, [&](double u, double v, size_t at) {
        weights_[at] *= glm::distance(map.off(u, v, ends_[at]), box.center());
      });
    }
  }

 private:
  struct Map {
    glm::dvec3 along_u, along_v;
    glm::dvec3 off(double u, double v, const glm::dvec3& at) const { return at - u * along_u - v * along_v; }
  };
  /// By least squares.
  Map fitted(int i0, int j0, int k0, int extent) const {
    double count = 0.0, u1 = 0.0, v1 = 0.0, uu = 0.0, uv = 0.0, vv = 0.0;
    glm::dvec3 sum(0.0), su(0.0), sv(0.0);
    for_window(i0, j0, k0, extent, [&](double u, double v, size_t at) {
      const double w = weights_[at];
      count += w;
      u1 += w * u, v1 += w * v, uu += w * u * u, uv += w * u * v, vv += w * v * v;
      sum += w * ends_[at];
      su += w * u * ends_[at];
      sv += w * v * ends_[at];
    });
    uu -= u1 * u1 / count, uv -= u1 * v1 / count, vv -= v1 * v1 / count;
    su -= (u1 / count) * sum;
    sv -= (v1 / count) * sum;
    const double det = uu * vv - uv * uv;
    return {(vv * su - uv * sv) / det, (uu * sv - uv * su) / det};
  }
  template <class DoSample>
  void for_window(int i0, int j0, int k0, int extent, const DoSample& do_sample) const {
    const int n = pattern_.n();
    for (int j = j0; j <= std::min(j0 + extent, n - i0 - k0); ++j) {
      const int first = std::max(i0, n - j - k0 - extent), last = std::min(i0 + extent, n - j - k0);
      for (int i = first; i <= last; ++i)
        do_sample(i - i0, j - j0, static_cast<size_t>(pattern_.point(i, j)));
    }
  }

  const Pattern& pattern_;
  std::span<const glm::dvec3> ends_;
  std::vector<double> weights_;
};

/// What triangles with sides of 1 and sqrt(3) are off, exactly: these are two sides and the long diagonal of
/// the rhombus round a step of the pattern, farthest off in the middle of the diagonals; and three corners of
/// the hexagon round a sample, farthest off there or in the middle of such diagonals.
double off_diagonals(const Pattern& pattern, std::span<const glm::dvec3> ends) {
  const int n = pattern.n();
  const auto at = [&](int i, int j) -> const glm::dvec3* {
    return i < 0 || j < 0 || i + j > n ? nullptr : &ends[static_cast<size_t>(pattern.point(i, j))];
  };
  constexpr std::array<std::array<int, 2>, 6> kRound{{{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}}};
  double most = 0.0;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i + j <= n; ++i) {
      std::array<const glm::dvec3*, 6> round;
      for (size_t k = 0; k < 6; ++k) round[k] = at(i + kRound[k][0], j + kRound[k][1]);
      const glm::dvec3& here = *at(i, j);
      for (size_t k = 0; k < 6; ++k) {
        const auto *before = round[k], *step = round[(k + 1) % 6], *after = round[(k + 2) % 6];
        if (before != nullptr && step != nullptr && after != nullptr)
          most = std::max(most, 0.5 * glm::distance(*before + *after, here + *step));
      }
      for (size_t k = 0; k < 2; ++k) {
        const auto *a = round[k], *b = round[k + 2], *c = round[k + 4];
        if (a != nullptr && b != nullptr && c != nullptr)
          most = std::max(most, glm::distance((*a + *b + *c) / 3.0, here));
      }
    }
  }
  return most;
}

/// The paper's errors, from the source's vertices.
void measure_vertices(const SourceSurface& source, const ControlMesh& control,
                      std::span<const Closest> at_vertices, uint32_t triangles_a_face, Bounds& out) {
  out.sampling.assign(control.faces.size(), 0.0);
  std::vector<uint8_t> used(source.mesh.positions.size(), 0);
  for (const auto& f : source.mesh.faces) used[f[0]] = used[f[1]] = used[f[2]] = 1;
  double sum = 0.0, count = 0.0;
  for (size_t v = 0; v < used.size(); ++v) {
    if (used[v] == 0) continue;
    const uint32_t face = at_vertices[v].triangle / triangles_a_face;
    Triangle flat;
    for (size_t k = 0; k < 3; ++k) flat[k] = control.positions[control.faces[face][k]];
    out.sampling[face] =
        std::max(out.sampling[face], closest_on_triangle(flat, source.mesh.positions[v]).distance);
    sum += at_vertices[v].distance;
    count += 1.0;
  }
  out.average = sum / std::max(count, 1.0);
}

/// Axes of which the last is across a face's corners: most of what windows leave is along it.
glm::dmat3 frame_of(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const glm::dvec3 normal = glm::cross(b - a, c - a), along = b - a;
  if (!(glm::dot(normal, normal) > 0.0)) return glm::dmat3(1.0);
  const glm::dvec3 z = glm::normalize(normal), x = glm::normalize(along);
  return glm::transpose(glm::dmat3(x, glm::cross(z, x), z));
}

}  // namespace

WeldedMesh displaced(const Samples& samples, const Displacement& displacement,
                     std::span<const float> heights) {
  const Pattern& p = samples.pattern();
  WeldedMesh out;
  out.positions.resize(heights.size());
  for (size_t s = 0; s < heights.size(); ++s) out.positions[s] = displacement.end(s, heights[s]);
  const auto a_face = static_cast<size_t>(p.n() * p.n());
  out.faces.resize(a_face * static_cast<size_t>(samples.control_faces()));
  parallel_for(samples.control_faces(), 16, [&](int64_t begin, int64_t end) {
    for (int64_t f = begin; f < end; ++f) {
      auto next = out.faces.begin() + f * static_cast<int64_t>(a_face);
      for (int j = 0; j < p.n(); ++j) {
        for (int i = 0; i + j < p.n(); ++i) {
          const auto at = [&](int di, int dj) {
            return static_cast<uint32_t>(samples.of(f, i + di, j + dj));
          };
          *next++ = {at(0, 0), at(1, 0), at(0, 1)};
          if (i + j + 1 < p.n()) *next++ = {at(1, 0), at(1, 1), at(0, 1)};
        }
      }
    }
  });
  return out;
}

std::vector<double> coarsening(const Pattern& pattern, std::span<const glm::dvec3> ends) {
  const int n = pattern.n();
  const auto corner = [&](int i, int j) { return ends[static_cast<size_t>(pattern.point(i, j))]; };
  const glm::dmat3 frame = frame_of(corner(0, 0), corner(n, 0), corner(0, n));
  std::vector<glm::dvec3> turned(ends.begin(), ends.end());
  for (glm::dvec3& end : turned) end = frame * (end - corner(0, 0));
  Windows windows(pattern, turned);
  std::vector<double> out(static_cast<size_t>(pattern.levels()), 0.0);
  out[static_cast<size_t>(2 * pattern.d - 1)] = off_diagonals(pattern, ends);
  for (int level = 0; level < 2 * pattern.d - 1; ++level) {
    const double length = n * std::exp2(-(level / 2)) * (level % 2 == 0 ? 1.0 : std::sqrt(0.75));
    const int extent = std::min(n, static_cast<int>(length * 2.0 / std::sqrt(3.0) + 1e-9));
    const int most = std::min({n, 2 * extent, static_cast<int>(2.0 * length + 1e-9)});
    double& largest = out[static_cast<size_t>(level)];
    for (int side = extent; side <= most; ++side) {
      for (int i = 0; i + side <= n; ++i) {
        for (int j = 0; i + j + side <= n; ++j)
          largest = std::max(largest, windows.left(i, j, n - side - i - j, extent, largest));
      }
    }
  }
  return out;
}

Bounds bounds(const SourceSurface& source, const ControlMesh& control, const Samples& samples,
              const Displacement& displacement, std::span<const float> heights, const Progress& progress) {
  const Pattern& pattern = samples.pattern();
  const WeldedMesh finest = displaced(samples, displacement, heights);
  const MeshSurface surface(finest);
  const auto faces = static_cast<size_t>(samples.control_faces());
  const auto a_face = static_cast<uint32_t>(pattern.n() * pattern.n());
  Box box;
  for (const glm::dvec3& p : source.mesh.positions) box.add(p);
  for (const glm::dvec3& p : finest.positions) box.add(p);
  const double extent = glm::distance(box.lo, box.hi);

  std::vector<double> distance(faces, 0.0);
  Count count(progress, "bound", 2 * finest.triangles() + source.mesh.triangles());
  cover_finest(source, finest, displacement.near, a_face, kNegligible * extent, distance, count);
  const std::vector<Closest> at_vertices = closest_to_vertices(source.mesh, surface);
  cover_source(source, surface, at_vertices, a_face, kNegligible * extent, distance, count);
  cover_borders(source, samples, finest, extent, distance);

  Bounds out;
  out.levels = pattern.levels();
  const auto levels = static_cast<size_t>(out.levels);
  out.face.resize(faces * levels);
  parallel_for(static_cast<int64_t>(faces), 4, [&](int64_t begin, int64_t end) {
    std::vector<int64_t> of(static_cast<size_t>(pattern.points()));
    std::vector<glm::dvec3> ends(of.size());
    for (auto f = static_cast<size_t>(begin); f < static_cast<size_t>(end); ++f) {
      samples.of_face(static_cast<int64_t>(f), of);
      for (size_t i = 0; i < of.size(); ++i) ends[i] = finest.positions[static_cast<size_t>(of[i])];
      const std::vector<double> coarser = coarsening(pattern, ends);
      double above = 0.0;
      for (size_t level = levels; level-- > 0;) {
        above = std::max(above, coarser[level]);
        out.face[f * levels + level] = distance[f] + above + kLeastShare * extent;
      }
    }
    count((end - begin) * a_face);
  });
  measure_vertices(source, control, at_vertices, a_face, out);
  return out;
}

}  // namespace lodlab::subdivision
