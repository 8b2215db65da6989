// SPDX-License-Identifier: MIT
// Errors of a block of a flat field. Every triangle has a base along a line of samples and an apex on a line
// parallel to it, so that it is scanned row by row from the apex, in 32-bit floats about the middle height.
//
// A whole block is symmetric: its four quarters, turned so that their outer corners lie at (0, 0), are cut by
// the same triangles, and so are the strips along its four edges, turned so that the edge is row 0. So four
// of them are measured at once, one in each lane of a vector. Clamped blocks are measured lane by lane.
#include <algorithm>
#include <vector>

#include "methods/multigrain/measure.h"
#include "multigrain/stitch.h"

namespace lodlab::multigrain {
namespace {

typedef float Four __attribute__((vector_size(16)));

/// Rounding in 32 bits: no surface below needs more than this many half steps of the largest height about the
/// middle, for heights, their differences (up to four times as large), products and sums.
constexpr float kRounding = 40.0f * 0x1p-24f;

float largest(float v) { return v; }
float largest(const Four& v) { return std::max(std::max(v[0], v[1]), std::max(v[2], v[3])); }

/// Samples in lanes, turned so that what is measured starts in row 0.
template <class Lanes>
struct Samples {
  std::vector<Lanes> z;
  int pitch = 0;

  void resize(int rows, int cols) {
    pitch = cols;
    z.resize(static_cast<size_t>(rows) * cols);
  }
  Lanes* row(int y) { return z.data() + static_cast<size_t>(y) * pitch; }
  const Lanes* row(int y) const { return z.data() + static_cast<size_t>(y) * pitch; }
};

struct Triangle {
  int apex_x, apex_y;
  int base_from, base_to;  ///< on row apex_y + step * height
  int step, height;
  int rows;  ///< to be measured, counted from the apex
};

/// Largest distance of the samples inside from the triangle.
template <class Lanes>
Lanes measure_triangle(const Samples<Lanes>& samples, const Triangle& t, Lanes worst) {
  const Lanes* apex = samples.row(t.apex_y) + t.apex_x;
  const Lanes* base = samples.row(t.apex_y + t.step * t.height);
  const Lanes top = *apex, down = base[t.base_from] - top;
  const Lanes along = (base[t.base_to] - base[t.base_from]) / static_cast<float>(t.base_to - t.base_from);
  const float share = 1.0f / static_cast<float>(t.height);
  const bool binary = (t.height & (t.height - 1)) == 0;
  const int shift = __builtin_ctz(static_cast<unsigned>(t.height));
  const int from = t.base_from - t.apex_x, to = t.base_to - t.apex_x;
  const auto floor_of = [&](int n) {
    return binary ? n >> shift : n >= 0 ? n / t.height : -((t.height - 1 - n) / t.height);
  };
  for (int r = 1; r <= t.rows; ++r) {
    const int left = floor_of(r * from + t.height - 1), right = floor_of(r * to);
    const Lanes* z = samples.row(t.apex_y + t.step * r) + t.apex_x + left;
    const Lanes start = top + down * (static_cast<float>(r) * share);
    float x = static_cast<float>(left * t.height - r * from) * share;
    for (int i = 0; i <= right - left; ++i, x += 1.0f) {
      const Lanes d = z[i] - (start + along * x);
      worst = d > worst ? d : worst;
      worst = -d > worst ? -d : worst;
    }
  }
  return worst;
}

/// All samples of a grid of `width` x `height` cells against its surface of this stride. `odd`: the first
/// cell is cut the other way.
template <class Lanes>
Lanes measure_grid(const Samples<Lanes>& samples, int width, int height, int stride_log2, bool odd) {
  const int stride = 1 << stride_log2;
  Lanes worst{};
  for (int y = 0, j = odd; y < height; y += stride, ++j) {
    const int bottom = std::min(y + stride, height), h = bottom - y;
    const int last = bottom == height ? h : h - 1;  // the line below belongs to the next row of cells
    for (int x = 0, i = j; x < width; x += stride, ++i) {
      const int right = std::min(x + stride, width);
      const bool flipped = (i & 1) != 0;
      worst = measure_triangle(samples, {flipped ? x : right, bottom, x, right, -1, h, h}, worst);
      worst = measure_triangle(samples, {flipped ? right : x, y, x, right, 1, h, last}, worst);
    }
  }
  return worst;
}

/// The one cell of a whole block, of `side` cells, in quarters. Over the unit square it is
/// nw + u (ne - nw) + v (se - ne) + bend max(0, v - u), or, cut the other way,
/// nw + u (ne - nw) + v (sw - nw) - bend max(0, u + v - 1).
Four measure_cell(const Samples<Four>& quarters, const Four& corners, int side, bool odd) {
  const float nw = corners[0], ne = corners[1], sw = corners[2], se = corners[3];
  const float bend = odd ? nw + se - ne - sw : ne + sw - nw - se, down = odd ? sw - nw : se - ne;
  const Four across = Four{} + (ne - nw), fold = Four{} + bend;
  const float unit = 1.0f / static_cast<float>(side);
  Four worst{};
  for (int y = 0; y <= side / 2; ++y) {
    const float v = static_cast<float>(y) * unit;
    const Four vs{v, v, 1.0f - v, 1.0f - v}, start = nw + vs * down, edge = odd ? vs - 1.0f : vs;
    const Four* z = quarters.row(y);
    for (int x = 0; x <= side / 2; ++x) {
      const float u = static_cast<float>(x) * unit;
      const Four us{u, 1.0f - u, u, 1.0f - u};
      Four over = odd ? edge + us : edge - us;
      over = over > 0.0f ? over : Four{};
      const Four d = z[x] - (start + us * across + fold * over);
      worst = d > worst ? d : worst;
      worst = -d > worst ? -d : worst;
    }
  }
  return worst;
}

/// The strip along row 0 of a grid of `length` x `depth` cells, drawn with stride 2^a and snapped to 2^b.
template <class Lanes>
Lanes measure_strip(const Samples<Lanes>& samples, int length, int depth, int a, int b, int block_log2) {
  const int stride = 1 << a, h = std::min(stride, depth);
  Lanes worst{};
  int from = 0;
  for (int x = 0, i = 0; x < length; x += stride, ++i) {
    const int right = std::min(x + stride, length);
    const int to = stitch_along(right, length, a, b, block_log2);
    const bool flipped = (i & 1) != 0;
    if (from < to) worst = measure_triangle(samples, {flipped ? x : right, h, from, to, -1, h, h}, worst);
    // Along the inner line nothing has moved.
    worst = measure_triangle(samples, {flipped ? to : from, 0, x, right, 1, h, h - 1}, worst);
    from = to;
  }
  return worst;
}

class FlatMeasurer : public Measurer {
 public:
  FlatMeasurer(const HeightRows& field, const Layout& layout)
      : field_(field), layout_(layout), log2_(layout.block_log2()), top_(layout.largest_stride_log2()) {}

  void measure(const Block& block, float low, float high, float* own, float* strips) override {
    if (low == high) return;
    middle_ = 0.5f * low + 0.5f * high;
    rounding_ = kRounding * std::max(high - middle_, middle_ - low);
    const int side = 1 << log2_;
    if (block.width == side && block.height == side) {
      measure_whole(block, own, strips);
      return;
    }
    copy(block, kNorth, block.height + 1, block.width + 1);
    for (int a = 1; a <= top_; ++a)
      own[a] = rounded(measure_grid(single_, block.width, block.height, a, is_odd(block, a)));
    for (const Edge edge : {kNorth, kEast, kSouth, kWest}) {
      if (!layout_.meets(block.y, block.x, edge)) continue;
      const bool level = edge == kNorth || edge == kSouth;
      const int length = level ? block.width : block.height, depth = level ? block.height : block.width;
      copy(block, edge, std::min(depth, side / 2) + 1, length + 1);
      float* strip = strips + edge * BlockErrors::pairs(log2_ + 1);
      for_pairs([&](int a, int b) {
        strip[BlockErrors::pair(a, b)] = rounded(measure_strip(single_, length, depth, a, b, log2_));
      });
    }
  }

 private:
  template <class Body>
  void for_pairs(const Body& body) const {
    for (int b = 1; b <= top_; ++b) {
      for (int a = 0; a < b; ++a) body(a, b);
    }
  }
  /// The one cell of a whole block is cut by the block's place.
  bool is_odd(const Block& block, int a) const { return a == log2_ && ((block.x + block.y) & 1) != 0; }
  template <class Lanes>
  float rounded(const Lanes& worst) const {
    return largest(worst) + rounding_;
  }
  const float* first(const Block& block) const { return field_.row(block.row) + block.col; }

  /// The samples beside this edge, its own line first.
  void copy(const Block& block, Edge edge, int rows, int cols) {
    const int64_t pitch = field_.cols;
    const float* z = first(block);
    if (edge == kSouth) z += block.height * pitch;
    if (edge == kEast) z += block.width;
    const int64_t in = edge == kNorth ? pitch : edge == kSouth ? -pitch : edge == kWest ? 1 : -1;
    const int64_t along = edge == kNorth || edge == kSouth ? 1 : pitch;
    single_.resize(rows, cols);
    for (int y = 0; y < rows; ++y) {
      float* out = single_.row(y);
      for (int x = 0; x < cols; ++x) out[x] = z[y * in + x * along] - middle_;
    }
  }

  void measure_whole(const Block& block, float* own, float* strips) {
    const int side = 1 << log2_, half = side / 2;
    const int64_t pitch = field_.cols;
    const float *north = first(block), *south = north + side * pitch;
    quarters_.resize(half + 1, half + 1);
    edges_.resize(half + 1, side + 1);
    for (int y = 0; y <= half; ++y) {
      const float *n = north + y * pitch, *s = south - y * pitch;
      Four* out = quarters_.row(y);
      for (int x = 0; x <= half; ++x) out[x] = Four{n[x], n[side - x], s[x], s[side - x]} - middle_;
    }
    for (int y = 0; y <= half; ++y) {
      const float *n = north + y * pitch, *s = south - y * pitch, *w = north + y, *e = north + side - y;
      Four* out = edges_.row(y);
      for (int x = 0; x <= side; ++x) out[x] = Four{n[x], e[x * pitch], s[x], w[x * pitch]} - middle_;
    }
    for (int a = 1; a <= std::min(top_, log2_ - 1); ++a)
      own[a] = rounded(measure_grid(quarters_, half, half, a, false));
    if (top_ == log2_) {
      own[log2_] = rounded(measure_cell(quarters_, *quarters_.row(0), side, is_odd(block, log2_)));
    }
    const int pairs = BlockErrors::pairs(log2_ + 1);
    for_pairs([&](int a, int b) {
      const Four worst = measure_strip(edges_, side, side, a, b, log2_);
      for (const Edge edge : {kNorth, kEast, kSouth, kWest}) {
        if (layout_.meets(block.y, block.x, edge))
          strips[edge * pairs + BlockErrors::pair(a, b)] = rounded(worst[edge]);
      }
    });
  }

  const HeightRows& field_;
  const Layout layout_;
  const int log2_, top_;
  float middle_ = 0.0f, rounding_ = 0.0f;
  Samples<float> single_;
  Samples<Four> quarters_, edges_;
};

}  // namespace

std::unique_ptr<Measurer> make_flat_measurer(const HeightRows& field, const Layout& layout) {
  return std::make_unique<FlatMeasurer>(field, layout);
}

}  // namespace lodlab::multigrain
