// SPDX-License-Identifier: MIT
// Measuring one block (errors.h), flat or on a planet, before closures. A measurer holds scratch memory: one
// a thread. `own` and `strips` are a block's rows of BlockErrors; entries that are not measured stay as they
// are.
#pragma once

#include <memory>

#include "geometry/height_rows.h"
#include "methods/multigrain/errors.h"

namespace lodlab::multigrain {

/// One block's place in the field.
struct Block {
  int64_t y, x;       ///< among blocks
  int64_t row, col;   ///< its first sample
  int height, width;  ///< cells

  Block(const Layout& layout, int64_t index)
      : y(index / layout.blocks_x()),
        x(index % layout.blocks_x()),
        row(y << layout.block_log2()),
        col(x << layout.block_log2()),
        height(static_cast<int>(layout.cells_y(row, layout.block_log2(), 0))),
        width(static_cast<int>(layout.cells_x(col, layout.block_log2(), 0))) {}
};

/// Rows north and south of a planet's block whose rays its triangles may meet; 0 in a flat field.
struct Reach {
  int above = 0, below = 0;
};
Reach rows_beyond(const FieldFrame& frame, const Block& block);

class Measurer {
 public:
  virtual ~Measurer() = default;
  /// `low` and `high` are the block's range of heights.
  virtual void measure(const Block& block, float low, float high, float* own, float* strips) = 0;
};

std::unique_ptr<Measurer> make_flat_measurer(const HeightRows& field, const Layout& layout);
std::unique_ptr<Measurer> make_planet_measurer(const HeightRows& field, const Layout& layout);
std::unique_ptr<Measurer> make_bilinear_measurer(const HeightRows& field, const Layout& layout);

}  // namespace lodlab::multigrain
