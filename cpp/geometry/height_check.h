// SPDX-License-Identifier: MIT
// What making a height field checks and computes, for fields in memory and for those that are read by rows.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <string>

#include "geometry/height_field.h"

namespace lodlab {

/// InvalidInput for a frame that no field has; heights are not looked at.
void check_frame(const FieldFrame& frame);

struct HeightRange {
  double lo = std::numeric_limits<double>::infinity(), hi = -std::numeric_limits<double>::infinity();
};

/// Widens `range` by these rows; refuses the first height that is not finite or that drawing could not
/// subtract from.
void widen(HeightRange& range, const FieldFrame& frame, const float* heights, int64_t first_row,
           int64_t rows);

/// Sets z_min and z_max; refuses a planet whose lowest sample reaches its centre.
void set_range(FieldFrame& frame, const HeightRange& range);

/// Hash of heights and of a mask that come piece by piece, each in order, and of a frame.
class HeightHash {
 public:
  HeightHash();
  ~HeightHash();
  void add(const float* heights, int64_t count);
  void add_mask(const uint8_t* valid, int64_t count);
  /// 32 hex digits. `masked`: with the mask, which has voids.
  std::string finish(const FieldFrame& frame, bool masked) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace lodlab
