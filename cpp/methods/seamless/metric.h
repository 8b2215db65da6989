// SPDX-License-Identifier: MIT
// How finely an edge is drawn, from the edge and the eye alone (Livny, Kogan, El-Sana, equation 1, claim 1).
//   epsilon = (base + rho w) l / (d + away)
// Above 1 a patch splits; in (1/2, 1] the edge has its finest resolution, in (1/4, 1/2] the next, and so on.
//   roughness: base just above 1, w the edge's weight. The claim needs base + rho w >= 1, weights that obey
//              closure.h, and distances that obey the triangle inequality. `away` >= 0 keeps all of it, and
//              makes cuts coarser than rho = 0 does.
//   distance:  the paper's: base 0, w = 1, away 0. The claim holds for rho >= 1 and nearest distances only.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "methods/seamless/hierarchy.h"

namespace lodlab::seamless {

struct Metric {
  bool roughness = true;
  bool nearest = true;  ///< distance to the nearest point of an edge; false: to its midpoint
  double rho = 0.0;     ///< as the user asks; 0: as the budget does

  /// The paper's metric weighs all edges alike: with 1, but for what rounding can take from the claim at rho
  /// = 1.
  static constexpr std::array<double, 4> kPaperWeights{1.0 + 0x1p-20, 1.0 + 0x1p-20, 1.0 + 0x1p-20,
                                                       1.0 + 0x1p-20};

  /// Above 1 by more than rounding can take from the claim.
  double base() const { return roughness ? 1.0 + 0x1p-20 : 0.0; }
};

/// What selection turns: one number, larger is finer. Below 0 it is -away, with rho = 0.
struct Precision {
  double rho = 0.0;
  double away = 0.0;

  static Precision of(double fineness) {
    return fineness < 0.0 ? Precision{0.0, -fineness} : Precision{fineness, 0.0};
  }
};

/// Distances of a patch's four edges from the eye. The horizontal nearest distance, and one vertical distance
/// for all edges: conservative, and the triangle inequality along the ground holds. Of an edge that two
/// patches share, and of its parts, the same numbers are compared whoever asks.
class Distances {
 public:
  Distances(const FieldFrame& frame, const glm::dvec3& eye, bool nearest)
      : east_(eye.x - frame.x0),
        south_(frame.y0 - eye.y),
        above_(square(std::max(0.0, eye.z - frame.z_max))),
        nearest_(nearest) {}

  /// Squared. Widths are whole powers of two of a spacing, so that an edge lies at the same number at any
  /// level.
  std::array<double, 4> of(const Level& level, const Patch& p) const {
    const double north = south_ - static_cast<double>(p.y) * level.height;
    const double south = south_ - static_cast<double>(p.y + 1) * level.height;
    const double west = east_ - static_cast<double>(p.x) * level.width;
    const double east = east_ - static_cast<double>(p.x + 1) * level.width;
    const double beside_x = nearest_ ? std::max(std::max(-west, east), 0.0) : 0.5 * (west + east);
    const double beside_y = nearest_ ? std::max(std::max(-north, south), 0.0) : 0.5 * (north + south);
    const std::array<double, 4> across{north, east, south, west},
        along{beside_x, beside_y, beside_x, beside_y};
    std::array<double, 4> out;
    for (size_t i = 0; i < 4; ++i) out[i] = square(across[i]) + square(along[i]) + above_;
    return out;
  }

 private:
  static double square(double x) { return x * x; }

  double east_, south_, above_;
  bool nearest_;
};

/// (base + rho w) l of a patch's edges: epsilon times the distance.
using Reach = std::array<double, 4>;

/// The two sides of epsilon's fraction for each edge of a patch, both squared where that saves the roots.
struct Edges {
  Reach reach;
  std::array<double, 4> from;
  double half;  ///< that of epsilon

  Edges(const Reach& far, const std::array<double, 4>& squares, double away)
      : reach(far), from(squares), half(0.25) {
    if (away == 0.0) {
      for (double& r : reach) r *= r;
    } else {
      half = 0.5;
      for (double& d : from) d = std::sqrt(d) + away;
    }
  }

  bool split() const {
    bool any = false;
    for (size_t i = 0; i < 4; ++i) any |= reach[i] > from[i];
    return any;
  }
  /// The resolution of an edge of a patch that does not split.
  int resolution(size_t i, int resolutions) const {
    const int fine = reach[i] > half * from[i];
    return resolutions == 2 ? fine : fine + (reach[i] > half * half * from[i]);
  }
};

}  // namespace lodlab::seamless
