// SPDX-License-Identifier: MIT
#include "geometry/cube_sphere.h"

#include <array>
#include <cmath>
#include <string>

#include "base/errors.h"
#include "base/mix.h"
#include "base/parallel.h"

namespace lodlab {
namespace {

constexpr int64_t kGrain = 1 << 14;

using Lattice = std::array<int64_t, 3>;  // of a cube's surface: 0 to n, at least one coordinate 0 or n

/// Ids of lattice points: the bottom layer, rings from below, the top layer.
struct Numbering {
  int64_t n;

  int64_t side() const { return n + 1; }
  int64_t rings() const { return side() * side(); }
  int64_t top() const { return rings() + (n - 1) * 4 * n; }
  int64_t count() const { return top() + side() * side(); }

  uint32_t id(const Lattice& p) const {
    const auto [i, j, k] = p;
    if (k == 0) return static_cast<uint32_t>(i * side() + j);
    if (k == n) return static_cast<uint32_t>(top() + i * side() + j);
    const int64_t ring = j == 0 && i < n   ? i
                         : i == n && j < n ? n + j
                         : j == n && i > 0 ? 3 * n - i
                                           : 4 * n - j;
    return static_cast<uint32_t>(rings() + (k - 1) * 4 * n + ring);
  }

  Lattice point(int64_t vertex) const {
    if (vertex < rings()) return {vertex / side(), vertex % side(), 0};
    if (vertex >= top()) return {(vertex - top()) / side(), (vertex - top()) % side(), n};
    const int64_t k = 1 + (vertex - rings()) / (4 * n), at = (vertex - rings()) % (4 * n), along = at % n;
    switch (at / n) {
      case 0:
        return {along, 0, k};
      case 1:
        return {n, along, k};
      case 2:
        return {n - along, n, k};
      default:
        return {0, n - along, k};
    }
  }
};

/// About tan(x pi / 4), which makes cells of equal angle, from -1 to 1.
double warp(double x) {
  const double s = x * x;
  return x * (0.7854 + s * (0.1615 + s * 0.0531));
}

/// The cube's face whose outside is where `axis` is n (or 0), with axes u and v so that u x v points
/// outwards.
struct CubeFace {
  int axis, u, v;
  bool far;
};
constexpr std::array<CubeFace, 6> kCubeFaces = {{{0, 1, 2, true},
                                                 {0, 2, 1, false},
                                                 {1, 2, 0, true},
                                                 {1, 0, 2, false},
                                                 {2, 0, 1, true},
                                                 {2, 1, 0, false}}};

/// Two triangles a cell, along its shorter diagonal: the one that points to the middle of the cube's face.
void face_triangles(const Numbering& numbering, const CubeFace& face, int64_t row, Face* out) {
  const int64_t n = numbering.n;
  const auto corner = [&](int64_t u, int64_t v) {
    Lattice p{};
    p[face.axis] = face.far ? n : 0;
    p[face.u] = u;
    p[face.v] = v;
    return numbering.id(p);
  };
  for (int64_t u = 0; u < n; ++u) {
    const uint32_t a = corner(u, row), b = corner(u + 1, row), c = corner(u + 1, row + 1),
                   d = corner(u, row + 1);
    const bool outwards = (2 * u + 1 - n) * (2 * row + 1 - n) > 0;
    *out++ = outwards ? Face{a, b, c} : Face{a, b, d};
    *out++ = outwards ? Face{a, c, d} : Face{b, c, d};
  }
}

// ---- noise ----------------------------------------------------------------------------------------

/// The product of one of 12 directions (to the middles of a cube's edges) and a vector.
double slope(uint64_t hash, double x, double y, double z) {
  const uint64_t which = (hash >> 32) * 12 >> 32;
  const double first = which < 8 ? x : y, second = which < 4 ? y : z;
  return (hash & 1 ? -first : first) + (hash & 2 ? -second : second);
}

double fade(double t) { return t * t * t * (t * (t * 6.0 - 15.0) + 10.0); }
double blend(double a, double b, double t) { return a + t * (b - a); }

/// Gradient noise of about -1 to 1.
double noise(const glm::dvec3& at, uint64_t seed) {
  const glm::dvec3 cell = glm::floor(at), t = at - cell, u{fade(t.x), fade(t.y), fade(t.z)};
  const auto x = static_cast<uint64_t>(static_cast<int64_t>(cell.x));
  const auto y = static_cast<uint64_t>(static_cast<int64_t>(cell.y));
  const auto z = static_cast<uint64_t>(static_cast<int64_t>(cell.z));
  double lines[2][2];
  for (uint64_t k = 0; k < 2; ++k) {
    for (uint64_t j = 0; j < 2; ++j) {
      const uint64_t row = mix(mix(seed + z + k) + y + j) + x;
      const double ty = t.y - static_cast<double>(j), tz = t.z - static_cast<double>(k);
      lines[k][j] = blend(slope(mix(row), t.x, ty, tz), slope(mix(row + 1), t.x - 1.0, ty, tz), u.x);
    }
  }
  return blend(blend(lines[0][0], lines[0][1], u.y), blend(lines[1][0], lines[1][1], u.y), u.z);
}

}  // namespace

CubeSphere cube_sphere(int64_t size) {
  if (size < 2 || size > kLargestCubeSphere) {
    throw InvalidInput("cube sphere: size " + std::to_string(size) + " is not within 2 to " +
                       std::to_string(kLargestCubeSphere));
  }
  const Numbering numbering{size - 1};
  const int64_t n = numbering.n;
  CubeSphere out;
  out.directions.resize(static_cast<size_t>(numbering.count()));
  out.faces.resize(static_cast<size_t>(12 * n * n));
  parallel_for(numbering.count(), kGrain, [&](int64_t begin, int64_t end) {
    const auto coordinate = [&](int64_t i) {
      return warp(static_cast<double>(2 * i - n) / static_cast<double>(n));
    };
    for (int64_t vertex = begin; vertex < end; ++vertex) {
      const auto [i, j, k] = numbering.point(vertex);
      const glm::dvec3 cube{coordinate(i), coordinate(j), coordinate(k)};
      out.directions[static_cast<size_t>(vertex)] = cube / std::sqrt(glm::dot(cube, cube));
    }
  });
  parallel_for(6 * n, 64, [&](int64_t begin, int64_t end) {
    for (int64_t row = begin; row < end; ++row) {
      face_triangles(numbering, kCubeFaces[static_cast<size_t>(row / n)], row % n,
                     out.faces.data() + row * 2 * n);
    }
  });
  return out;
}

void displace_into_blob(std::vector<glm::dvec3>& directions, uint64_t seed, double finest) {
  constexpr double kWidest = 1.5, kShare = 0.3, kFall = 0.55;  // frequency and amplitude of the widest octave
  parallel_for(static_cast<int64_t>(directions.size()), kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      glm::dvec3& p = directions[static_cast<size_t>(i)];
      double radius = 1.0, amplitude = kShare;
      uint64_t octave = 0;
      for (double frequency = kWidest; frequency * finest <= 1.0; frequency *= 2.0, amplitude *= kFall) {
        radius += amplitude * noise(p * frequency, mix(seed * 0xd1342543de82ef95ull + ++octave));
      }
      p *= radius;
    }
  });
}

}  // namespace lodlab
