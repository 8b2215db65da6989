// SPDX-License-Identifier: MIT
// Heights of coarse strides, gathered while rows go by: samples, or the paper's averages (pyramid.h).
#include "methods/seamless/pyramid.h"

#include <algorithm>

namespace lodlab::seamless {
namespace {

/// Of what is there of the four at (2 i, 2 j) and after.
template <class At>
float mean_of(int64_t rows, int64_t cols, int64_t i, int64_t j, const At& at) {
  double sum = 0.0;
  const int64_t end_row = std::min(2 * i + 2, rows), end_col = std::min(2 * j + 2, cols);
  for (int64_t r = 2 * i; r < end_row; ++r) {
    for (int64_t c = 2 * j; c < end_col; ++c) sum += at(r, c);
  }
  return static_cast<float>(sum / static_cast<double>((end_row - 2 * i) * (end_col - 2 * j)));
}

int64_t halves(int64_t count) { return (count + 1) / 2; }

}  // namespace

Pyramid::Pyramid(const FieldFrame& frame, bool averaged)
    : averaged_(averaged), rows_(frame.rows), cols_(frame.cols) {
  if (!averaged) {
    // A border that is between two strides has a row or column of its own.
    const int64_t rows = (rows_ + 2) / 4 + 1, cols = (cols_ + 2) / 4 + 1;
    planes_.push_back({rows, cols, std::vector<float>(static_cast<size_t>(rows * cols))});
    return;
  }
  int64_t rows = halves(halves(rows_)), cols = halves(halves(cols_));
  for (;; rows = halves(rows), cols = halves(cols)) {
    planes_.push_back({rows, cols, std::vector<float>(static_cast<size_t>(rows * cols))});
    if (rows == 1 && cols == 1) break;
  }
}

void Pyramid::take(const HeightRows& band, int64_t first, int64_t end) {
  Plane& kept = planes_.front();
  if (!averaged_) {
    for (int64_t i = first / 4; i < kept.rows; ++i) {
      const int64_t row = std::min(4 * i, rows_ - 1);
      if (row < first) continue;
      if (row >= end) break;
      float* out = kept.z.data() + i * kept.cols;
      for (int64_t j = 0; j < kept.cols; ++j) out[j] = band.at(row, std::min(4 * j, cols_ - 1));
    }
    return;
  }
  const int64_t rows = halves(rows_), cols = halves(cols_);
  for (int64_t i = first / 4; i < kept.rows && 4 * i < end; ++i) {
    for (int64_t j = 0; j < kept.cols; ++j)
      kept.z[static_cast<size_t>(i * kept.cols + j)] =
          mean_of(rows, cols, i, j, [&](int64_t r, int64_t c) { return at(band, 1, 2 * r, 2 * c); });
  }
}

void Pyramid::finish() {
  for (size_t a = 1; a < planes_.size(); ++a) {
    const Plane& finer = planes_[a - 1];
    Plane& out = planes_[a];
    for (int64_t i = 0; i < out.rows; ++i) {
      for (int64_t j = 0; j < out.cols; ++j)
        out.z[static_cast<size_t>(i * out.cols + j)] =
            mean_of(finer.rows, finer.cols, i, j,
                    [&](int64_t r, int64_t c) { return finer.z[static_cast<size_t>(r * finer.cols + c)]; });
    }
  }
}

float Pyramid::at(const HeightRows& band, int stride_log2, int64_t row, int64_t col) const {
  if (!averaged_) {
    if (row >= band.first_row && row < band.end_row) return band.at(row, col);
    const Plane& kept = planes_.front();
    return kept.z[static_cast<size_t>((row + 3) / 4 * kept.cols + (col + 3) / 4)];
  }
  if (stride_log2 == 0) return band.at(row, col);
  if (stride_log2 == 1) {
    return mean_of(rows_, cols_, row / 2, col / 2, [&](int64_t r, int64_t c) { return band.at(r, c); });
  }
  const int a = std::min(stride_log2, kKept + static_cast<int>(planes_.size()) - 1);  // one texel is all
  const Plane& kept = plane(a);
  return kept.z[static_cast<size_t>((row >> a) * kept.cols + (col >> a))];
}

void Pyramid::fill(const HeightRows& band, const Layout& layout, const Patch& p, int resolution,
                   float* out) const {
  const int step = averaged_ ? 1 << (layout.resolutions - 1 - resolution) : 1;
  const int stride_log2 = layout.stride_log2(p.level, resolution);
  for (int v = 0; v <= layout.segments(); v += step) {
    const int64_t row = layout.sample_row(p, v);
    for (int u = 0; u <= layout.segments(); u += step)
      *out++ = at(band, stride_log2, row, layout.sample_col(p, u));
  }
}

}  // namespace lodlab::seamless
