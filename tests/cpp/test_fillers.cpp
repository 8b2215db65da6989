// SPDX-License-Identifier: MIT
// Fillers that hang from the surface are in order; those that stand on it are counted. Triangles by hand.
#include <doctest/doctest.h>

#include "instrument/fillers.h"
#include "synthetic.h"

using namespace lodlab;
using namespace lodlab::instrument;

namespace {

const synthetic::Height kHills = [](int64_t row, int64_t col) {
  return 3.0 * double((row * 7 + col * col) % 5);
};

/// A field and a captured surface of it, 2 too high everywhere; triangles are added to it.
struct Scene {
  explicit Scene(bool round) : Scene(round ? synthetic::planet(19, 36) : synthetic::flat(9, 9, 100.0)) {}
  explicit Scene(const FieldFrame& at)
      : frame(at),
        source(synthetic::field(frame, [this](int64_t r, int64_t c) { return height(r, c); })),
        grid(*source),
        captured(synthetic::mesh(frame, {1300.0, 20.0, 30.0},
                                 [this](int64_t r, int64_t c) { return height(r, c) + 2.0; })) {}

  double height(int64_t row, int64_t col) const {
    return frame.planet && std::abs(frame.latitude(row)) == 90.0 ? 1.0 : kHills(row, col % frame.cols);
  }
  glm::dvec3 at(int64_t row, int64_t col, double above) const {
    return frame.position(row, col, height(row, col) + above);
  }
  void add(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, bool filler = true) {
    for (const glm::dvec3& p : {a, b, c}) {
      captured.vertices.push_back(synthetic::vertex(p, captured.eye));
      captured.vertices.back().bits = filler ? 1 : 0;
    }
  }
  int64_t raised() const {
    return raised_fillers(*source, grid, DrawnSurface(*source, grid, captured), captured);
  }

  FieldFrame frame;
  std::shared_ptr<const HeightField> source;
  SampleGrid grid;
  render::Captured captured;
};

}  // namespace

TEST_CASE("a skirt hangs from the surface, a wall stands on it") {
  for (const bool round : {false, true}) {
    Scene scene(round);
    CHECK(scene.raised() == 0);
    scene.add(scene.at(4, 3, 2.0), scene.at(4, 3, -40.0), scene.at(4, 4, 2.0));
    CHECK(scene.raised() == 0);
    scene.add(scene.at(4, 3, 2.0), scene.at(4, 4, 2.0), scene.at(4, 3, 2.1));
    CHECK(scene.raised() == 1);
    scene.add(scene.at(2, 3, 9.0), scene.at(2, 4, 9.0), scene.at(2, 3, 12.0));
    CHECK(scene.raised() == 2);
  }
}

TEST_CASE("planets: across the seam and at a pole") {
  Scene scene(true);
  scene.add(scene.at(5, 35, 2.0), scene.at(5, 36, 2.0), scene.at(5, 36, -4.0));
  scene.add(scene.at(0, 0, 2.0), scene.at(1, 7, 2.0), scene.at(1, 7, -4.0));
  CHECK(scene.raised() == 0);
  scene.add(scene.at(5, 35, 2.0), scene.at(5, 36, 2.0), scene.at(5, 36, 2.5));
  scene.add(scene.at(0, 0, 2.5), scene.at(1, 7, 2.0), scene.at(1, 7, -4.0));
  CHECK(scene.raised() == 2);
}

TEST_CASE("a surface may peak between samples: what hangs from its very vertices is not above it") {
  Scene scene(false);
  const glm::dvec3 peak =
      0.25 * (scene.at(4, 4, 0.0) + scene.at(4, 5, 0.0) + scene.at(5, 4, 0.0) + scene.at(5, 5, 0.0)) +
      glm::dvec3(0.0, 0.0, 50.0);
  const glm::dvec3 foot = peak - glm::dvec3(0.0, 0.0, 60.0);
  scene.add(peak, scene.at(4, 4, 2.0), foot);
  CHECK(scene.raised() == 1);
  // A surface triangle without an edge between two of its corners is none.
  scene.add(peak, peak, scene.at(4, 4, 2.0), false);
  CHECK(scene.raised() == 1);
  scene.add(peak, scene.at(5, 4, 2.0), scene.at(5, 5, 2.0), false);
  CHECK(scene.raised() == 0);
  scene.add(peak + glm::dvec3(0.0, 0.0, 1.0), scene.at(4, 4, 2.0), foot);
  CHECK(scene.raised() == 1);
}

TEST_CASE("beside a hole nothing is said") {
  Scene scene(false);
  scene.captured.vertices.clear();
  scene.add(scene.at(2, 3, 9.0), scene.at(2, 4, 9.0), scene.at(2, 3, 12.0));
  CHECK(scene.raised() == 0);
}
