// SPDX-License-Identifier: MIT
// The paper's measure (section 4): heights of the samples against bilinear interpolation of the grid's. No
// bound for what is drawn: triangles have diagonals, and stitching shears those along the edges.
#include <algorithm>
#include <cmath>
#include <limits>

#include "methods/multigrain/measure.h"

namespace lodlab::multigrain {
namespace {

class BilinearMeasurer : public Measurer {
 public:
  BilinearMeasurer(const HeightRows& field, const Layout& layout) : field_(field), layout_(layout) {}

  void measure(const Block& block, float low, float high, float* own, float*) override {
    if (low == high) return;
    for (int a = 1; a <= layout_.largest_stride_log2(); ++a) {
      const int stride = 1 << a;
      double worst = 0.0;
      for (int y = 0; y < block.height; y += stride) {
        for (int x = 0; x < block.width; x += stride)
          worst = std::max(worst, measure_cell(block, x, y, std::min(x + stride, block.width),
                                               std::min(y + stride, block.height)));
      }
      own[a] = std::nextafter(static_cast<float>(worst), std::numeric_limits<float>::infinity());
    }
  }

 private:
  double height(const Block& block, int x, int y) const {
    const int64_t row = block.row + y, col = block.col + x;
    const bool pole = (layout_.pole_first && row == 0) || (layout_.pole_last && row == layout_.last_row());
    return field_.at(row, pole || col == field_.cols ? 0 : col);
  }

  double measure_cell(const Block& block, int x0, int y0, int x1, int y1) const {
    const double nw = height(block, x0, y0), ne = height(block, x1, y0);
    const double sw = height(block, x0, y1), se = height(block, x1, y1);
    double worst = 0.0;
    for (int y = y0; y <= y1; ++y) {
      const double v = static_cast<double>(y - y0) / (y1 - y0);
      const double west = nw + v * (sw - nw), east = ne + v * (se - ne);
      for (int x = x0; x <= x1; ++x) {
        const double u = static_cast<double>(x - x0) / (x1 - x0);
        worst = std::max(worst, std::abs(west + u * (east - west) - height(block, x, y)));
      }
    }
    return worst;
  }

  const HeightRows& field_;
  const Layout layout_;
};

}  // namespace

std::unique_ptr<Measurer> make_bilinear_measurer(const HeightRows& field, const Layout& layout) {
  return std::make_unique<BilinearMeasurer>(field, layout);
}

}  // namespace lodlab::multigrain
