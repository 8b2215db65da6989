// SPDX-License-Identifier: MIT
#include "methods/multigrain/lattice.h"

#include <cmath>

namespace lodlab::multigrain {
namespace {

constexpr int kLowBits = 10;
constexpr double kMostCell = (1 << (kPositionBits - kLowBits)) - 1;

}  // namespace

Lattice::Lattice(const FieldFrame& planet) : frame_(planet), quantum_(planet.position_step()) {}

Lattice::Position Lattice::round(const glm::dvec3& position) const {
  Position out(0);
  for (int i = 0; i < 3; ++i) {
    const int64_t steps = std::llround(position[i] / quantum_);  // the quotient is exact
    out[i] = static_cast<int32_t>(steps >> kLowBits);
    out.w |= static_cast<int32_t>(steps & ((1 << kLowBits) - 1)) << (kLowBits * i);
  }
  return out;
}

std::vector<Lattice::Position> Lattice::positions(const Tiles& tiles, const Tile& tile,
                                                  const std::vector<float>& heights) const {
  std::vector<glm::dvec2> lon;
  for (int64_t i = 0; i < tile.cols; ++i)
    lon.push_back(cos_sin_degrees(frame_.longitude(tiles.source_col(tile, i))));
  std::vector<Position> out;
  out.reserve(heights.size());
  for (int64_t j = 0; j < tile.rows; ++j) {
    const glm::dvec2 lat = cos_sin_degrees(frame_.latitude(tiles.source_row(tile, j)));
    for (const glm::dvec2& at : lon) {
      const double radius = frame_.radius + static_cast<double>(heights[out.size()]);
      out.push_back(round(radius * glm::dvec3(lat.x * at.x, lat.x * at.y, lat.y)));
    }
  }
  return out;
}

std::vector<Lattice::Position> Lattice::row(int64_t row, const std::vector<float>& heights) const {
  const glm::dvec2 lat = cos_sin_degrees(frame_.latitude(row));
  std::vector<Position> out;
  for (int64_t col = 0; col < frame_.cols + (frame_.wraps ? 1 : 0); ++col) {
    const glm::dvec2 at = cos_sin_degrees(frame_.longitude(col));
    const double radius =
        frame_.radius + static_cast<double>(heights[static_cast<size_t>(col % frame_.cols)]);
    out.push_back(round(radius * glm::dvec3(lat.x * at.x, lat.x * at.y, lat.y)));
  }
  return out;
}

Lattice::Eye Lattice::eye(const glm::dvec3& eye) const {
  const glm::dvec3 cell = glm::clamp(glm::floor(eye / this->cell()), -kMostCell, kMostCell);
  return {glm::ivec3(cell), glm::vec3(eye - cell * this->cell())};
}

}  // namespace lodlab::multigrain
