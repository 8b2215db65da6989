// SPDX-License-Identifier: MIT
// Claim 1 of Livny, Kogan, El-Sana: two patches agree on the edge that they share without asking one another.
// Here: two neighbours of one size of which one splits and the other does not, for millions of eyes; who the
// proof leaves out is kept as a named case.
#include <doctest/doctest.h>

#include <random>

#include "methods/seamless/metric.h"

using namespace lodlab;
using namespace lodlab::seamless;

namespace {

struct Random {
  std::mt19937_64 engine{7};
  double uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(engine() >> 11) * 0x1p-53;
  }
  bool coin() { return (engine() & 1) != 0; }
};

/// A flat field of 2 x 1 patches of level 0, whose children are level 1.
struct Field {
  FieldFrame frame;
  Layout layout;
  std::vector<Level> levels;

  Field(int resolutions, double dx, double dy) {
    layout.patch_log2 = 4;
    layout.resolutions = resolutions;
    layout.levels = 3;
    const int64_t side = int64_t{1} << layout.side_log2(0);
    layout.rows = side + 1;
    layout.cols = 2 * side + 1;
    frame.rows = layout.rows;
    frame.cols = layout.cols;
    frame.dx = dx;
    frame.dy = dy;
    levels = make_levels(layout, frame);
  }
  double length(int level) const {
    return static_cast<double>(int64_t{1} << layout.side_log2(level)) * std::max(frame.dx, frame.dy);
  }
};

enum class Verdict { kNoPair, kAgree, kDisagree };

/// Weights of an edge and of everything that the claim compares it with.
struct Weights {
  std::array<double, 4> stays, parted;          ///< of the patch that stays whole, of the one that splits
  std::vector<std::array<double, 4>> children;  ///< of those along the shared edge
};

/// The western patch stays, the eastern one splits, or there is no such pair.
Verdict judge(const Field& field, const Metric& metric, double rho, double away, const glm::dvec3& eye,
              const Weights& w) {
  const Layout& layout = field.layout;
  const Distances distances(field.frame, eye, metric.nearest);
  const auto reach = [&](const std::array<double, 4>& weight, int level) {
    Reach out;
    for (size_t i = 0; i < 4; ++i) out[i] = (metric.base() + rho * weight[i]) * field.length(level);
    return out;
  };
  const Patch west{0, 0, 0}, east{0, 0, 1};
  const auto edges = [&](const std::array<double, 4>& weight, const Patch& p) {
    return Edges(reach(weight, p.level), distances.of(field.levels[static_cast<size_t>(p.level)], p), away);
  };
  const Edges whole = edges(w.stays, west);
  if (whole.split() || !edges(w.parted, east).split()) return Verdict::kNoPair;
  const int k = whole.resolution(kEast, layout.resolutions);
  for (size_t i = 0; i < w.children.size(); ++i) {
    const Patch child{1, static_cast<int64_t>(i), int64_t{1} << layout.branch_log2()};
    const Edges part = edges(w.children[i], child);
    if (part.split()) return Verdict::kDisagree;
    const int there = part.resolution(kWest, layout.resolutions);
    if (layout.stride_log2(0, k) != layout.stride_log2(1, there)) return Verdict::kDisagree;
  }
  return Verdict::kAgree;
}

Weights equal(const Field& field) {
  const std::array<double, 4> one = Metric::kPaperWeights;
  return {one, one, std::vector(size_t{1} << field.layout.branch_log2(), one)};
}

/// What the closure allows, and no less: of one patch none is below half another; of a parent's edge a part
/// is not above it.
Weights random_weights(const Field& field, Random& random) {
  const auto of_patch = [&](Edge shared, double weight) {
    std::array<double, 4> w;
    for (double& one : w) one = weight * random.uniform(0.5, 2.0);
    w[shared] = weight;
    const double most = *std::max_element(w.begin(), w.end());
    for (double& one : w) one = std::max(one, 0.5 * most);
    return w;
  };
  const double shared = random.coin() ? random.uniform(0.0, 2.0) : 0.0;
  Weights w{of_patch(kEast, shared), of_patch(kWest, shared), {}};
  for (int i = 0; i < 1 << field.layout.branch_log2(); ++i)
    w.children.push_back(of_patch(kWest, shared * (random.coin() ? 1.0 : random.uniform(0.0, 1.0))));
  return w;
}

/// Inside the field, above it, on the shared edge's line, very near an edge, on a vertex.
glm::dvec3 random_eye(const Field& field, Random& random) {
  const double l = field.length(0);
  glm::dvec3 eye(random.uniform(-3.0, 5.0) * l, random.uniform(-4.0, 3.0) * l, 0.0);
  switch (random.engine() % 5) {
    case 0:
      eye.x = random.uniform(0.0, 2.0) * l, eye.y = -random.uniform(0.0, 1.0) * l;
      break;
    case 1:
      eye.z = random.uniform(0.0, 4.0) * l;
      break;
    case 2:
      eye.x = static_cast<double>(int64_t{1} << field.layout.side_log2(0)) * field.frame.dx;
      break;
    case 3:
      eye.x = random.uniform(0.9999, 1.0001) * l;
      break;
    default:
      eye.x = 0.25 * l * std::floor(random.uniform(0.0, 9.0)),
      eye.y = -0.25 * l * std::floor(random.uniform(0.0, 5.0));
  }
  return eye;
}

}  // namespace

TEST_CASE("patches agree: the metric of roughness, a million pairs, any precision") {
  Random random;
  for (const int resolutions : {2, 3}) {
    int64_t pairs = 0, wrong = 0;
    while (pairs < 500'000) {
      const Field field(resolutions, 1.0, random.coin() ? 1.0 : random.uniform(0.3, 3.0));
      for (int i = 0; i < 1000; ++i) {
        const double rho = random.coin() ? random.uniform(0.0, 3.0) : random.uniform(0.0, 0.9);
        const double away = random.coin() ? 0.0 : random.uniform(0.0, 2.0) * field.length(0);
        const Verdict verdict =
            judge(field, Metric{}, rho, away, random_eye(field, random), random_weights(field, random));
        pairs += verdict != Verdict::kNoPair;
        wrong += verdict == Verdict::kDisagree;
      }
    }
    CHECK(wrong == 0);
  }
}

TEST_CASE("patches agree: the paper's metric with nearest distances and rho of at least 1") {
  Random random;
  const Metric paper{.roughness = false};
  for (const int resolutions : {2, 3}) {
    int64_t pairs = 0, wrong = 0;
    while (pairs < 500'000) {
      const Field field(resolutions, 1.0, random.coin() ? 1.0 : random.uniform(0.3, 3.0));
      const Weights one = equal(field);
      for (int i = 0; i < 1000; ++i) {
        const double rho = random.coin() ? 1.0 : random.uniform(1.0, 4.0);
        const Verdict verdict = judge(field, paper, rho, 0.0, random_eye(field, random), one);
        pairs += verdict != Verdict::kNoPair;
        wrong += verdict == Verdict::kDisagree;
      }
    }
    CHECK(wrong == 0);
  }
}

TEST_CASE("patches disagree where a premise of the claim fails: how often") {
  Random random;
  const auto share = [&](const Metric& metric, double rho) {
    int64_t pairs = 0, wrong = 0;
    const Field field(2, 1.0, 1.0);
    while (pairs < 20'000) {
      const Verdict verdict = judge(field, metric, rho, 0.0, random_eye(field, random), equal(field));
      pairs += verdict != Verdict::kNoPair;
      wrong += verdict == Verdict::kDisagree;
    }
    return static_cast<double>(wrong) / static_cast<double>(pairs);
  };
  CHECK(share({.roughness = false}, 0.9) > 0.01);
  CHECK(share({.roughness = false, .nearest = false}, 1.0) > 0.01);
  CHECK(share({.roughness = false, .nearest = false}, 2.0) > 0.01);
}

TEST_CASE("a counterexample: rho of 0.9, below the premise") {
  const Field field(2, 1.0, 1.0);  // the patches are squares of 64
  // 57 behind the parted patch's far edge: its epsilon is just above 1; the shared one's just below 1/2.
  const glm::dvec3 eye(128.0 + 57.0, -32.0, 0.0);
  CHECK(judge(field, {.roughness = false}, 0.9, 0.0, eye, equal(field)) == Verdict::kDisagree);
  CHECK(judge(field, {.roughness = false}, 1.0, 0.0, eye, equal(field)) == Verdict::kAgree);
}

TEST_CASE("a counterexample: midpoints, whatever rho") {
  const Field field(2, 1.0, 1.0);
  const Metric midpoint{.roughness = false, .nearest = false};
  CHECK(judge(field, midpoint, 1.0, 0.0, {124.464, -10.1399, 0.0}, equal(field)) == Verdict::kDisagree);
  CHECK(judge(field, midpoint, 2.0, 0.0, {116.76, -143.855, 57.226}, equal(field)) == Verdict::kDisagree);
}

TEST_CASE("a counterexample: weights that a patch is free to choose") {
  const Field field(2, 1.0, 1.0);
  Weights free = equal(field);
  free.parted = {9.0, 9.0, 9.0, 1.0};  // the shared edge, west, is smoother than half of the others
  const glm::dvec3 eye(128.0 + 200.0, -32.0, 0.0);
  CHECK(judge(field, Metric{}, 1.0, 0.0, eye, free) == Verdict::kDisagree);
}

TEST_CASE("an eye on an edge, or on a vertex, is at distance 0: the patch splits") {
  const Field field(2, 1.0, 1.0);
  const Distances distances(field.frame, {64.0, -64.0, 0.0}, true);
  const auto d = distances.of(field.levels[0], {0, 0, 0});
  CHECK(d[kEast] == 0.0);
  CHECK(Edges({1.0, 1.0, 1.0, 1.0}, d, 0.0).split());
}
