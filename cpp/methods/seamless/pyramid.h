// SPDX-License-Identifier: MIT
// Heights of lattice points of every stride while rows go by in bands: those of strides of four samples and
// more are kept for the whole field, a sixteenth of it (a twelfth where they are averages), so that a patch
// of any size knows its vertices while only a band of its samples is there.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/height_rows.h"
#include "methods/seamless/layout.h"

namespace lodlab::seamless {

class Pyramid {
 public:
  Pyramid(const FieldFrame& frame, bool averaged);

  bool averaged() const { return averaged_; }
  /// Keeps what it needs of rows [first, end), of which `first` is a multiple of four; then finish().
  void take(const HeightRows& band, int64_t first, int64_t end);
  void finish();

  /// The height of the lattice point at a sample, in the lattice of this stride. Where the stride is below
  /// four samples the band holds its row, and that after it.
  float at(const HeightRows& band, int stride_log2, int64_t row, int64_t col) const;

  /// The (segments + 1)^2 heights of a patch with this resolution (of averages: with the stride of it, and as
  /// many points as it has), row by row.
  void fill(const HeightRows& band, const Layout& layout, const Patch& p, int resolution, float* out) const;

 private:
  static constexpr int kKept = 2;  ///< log2 of the least stride that is kept
  struct Plane {
    int64_t rows, cols;
    std::vector<float> z;
  };
  const Plane& plane(int stride_log2) const { return planes_[static_cast<size_t>(stride_log2 - kKept)]; }

  bool averaged_;
  int64_t rows_, cols_;
  std::vector<Plane> planes_;  ///< averages: of stride 4, 8 and so on; else one of stride 4
};

}  // namespace lodlab::seamless
