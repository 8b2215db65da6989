// SPDX-License-Identifier: MIT
// Positions of a planet's samples, in whole steps of a global lattice: what a tile holds on the GPU in place
// of heights. A shader subtracts the eye's cell without rounding and needs no doubles; a position is a
// function of its sample alone, so that tiles agree bit for bit on those they share.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "geometry/height_field.h"
#include "methods/multigrain/tiles.h"

namespace lodlab::multigrain {

class Lattice {
 public:
  explicit Lattice(const FieldFrame& planet);

  /// The step, source units: FieldFrame::position_step().
  double quantum() const { return quantum_; }
  /// A cell: 2^10 steps.
  double cell() const { return 1024.0 * quantum_; }
  /// The farthest that a position may be from its sample, half the diagonal of a step, and room for rounding.
  double error() const { return quantum_; }

  /// Three cells, and the steps beyond them in 10 bits each.
  using Position = glm::ivec4;
  Position round(const glm::dvec3& position) const;
  /// Of a tile's samples, row by row, which have these heights.
  std::vector<Position> positions(const Tiles& tiles, const Tile& tile,
                                  const std::vector<float>& heights) const;
  /// Of a row, which has these heights; of a planet that wraps, column 0 comes round again.
  std::vector<Position> row(int64_t row, const std::vector<float>& heights) const;

  /// An eye as a cell and what is beyond it, source units. One cell less another never overflows.
  struct Eye {
    glm::ivec3 cell;
    glm::vec3 rest;
  };
  Eye eye(const glm::dvec3& eye) const;

 private:
  FieldFrame frame_;
  double quantum_;
};

}  // namespace lodlab::multigrain
