// SPDX-License-Identifier: MIT
// Quantization, and the error pass: every sample against every ancestor triangle, bottom-up, so that
// errors nest. O(n log n): each of the 2 log2(side) layers of triangles sees every sample once.
#include "methods/chunked/grid.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <mutex>

#include "base/errors.h"
#include "base/parallel.h"

namespace lodlab::chunked {
namespace {

constexpr int32_t kLargestRoot = 1 << 15;
constexpr double kSteps = 65000.0;  // of the 16 bits; the rest is room for rounding
constexpr int64_t kFloor = 16;      // quanta kept free below the lowest sample, for skirts

/// The quantum: a binary fraction of the source's own step where it has one (whole heights stay exact),
/// else the smallest power of two that spans the range in 16 bits.
Quantizer make_quantizer(const HeightField& field) {
  Quantizer q;
  const double range = field.z_max - field.z_min;
  const double magnitude = std::max(std::abs(field.z_min), std::abs(field.z_max));
  const double least = std::max(range / kSteps, std::ldexp(magnitude, -22));
  if (field.height_step > 0.0) {
    q.quantum = field.height_step;
    while (q.quantum < least) q.quantum *= 2.0;
    for (int i = 0; i < 8 && 0.5 * q.quantum >= least; ++i) q.quantum *= 0.5;
  } else {
    q.quantum = least > 0.0 ? std::exp2(std::ceil(std::log2(least))) : std::ldexp(1.0, -10);
  }
  q.base = std::llround(field.z_min / q.quantum) - kFloor;
  return q;
}

/// Rows shorter than this are not worth the call into the vectorized loop.
constexpr int32_t kShortRow = 12;

/// Largest |k[i] - (p + g i)| for i in [0, count).
__attribute__((target_clones("avx2", "default"))) float row_error(const uint16_t* k, int32_t count, float p,
                                                                  float g) {
  float worst = 0.0f;
#pragma omp simd reduction(max : worst)
  for (int32_t i = 0; i < count; ++i) {
    const float d = std::fabs(static_cast<float>(k[i]) - (p + g * static_cast<float>(i)));
    worst = d > worst ? d : worst;
  }
  return worst;
}

}  // namespace

Layout make_layout(int64_t rows, int64_t cols, int32_t leaf) {
  Layout layout;
  layout.width = static_cast<int32_t>(cols - 1);
  layout.height = static_cast<int32_t>(rows - 1);
  layout.leaf = leaf;
  layout.root = leaf;
  layout.levels = 1;
  while (layout.root < std::max(layout.width, layout.height) && layout.root < kLargestRoot) {
    layout.root *= 2;
    ++layout.levels;
  }
  layout.roots_x = (layout.width + layout.root - 1) / layout.root;
  layout.roots_y = (layout.height + layout.root - 1) / layout.root;
  return layout;
}

/// Computes the errors of a grid, layer by layer from the finest triangles up.
class ErrorPass {
 public:
  explicit ErrorPass(Grid& grid)
      : grid_(grid),
        layout_(grid.layout_),
        extent_x_(layout_.roots_x * layout_.root),
        extent_y_(layout_.roots_y * layout_.root) {}

  void run() {
    for (int32_t s = 1; s <= layout_.root / 2; s *= 2) {
      edge_layer(s);
      center_layer(s);
    }
  }

 private:
  // A triangle as rows of samples: first row, direction, count, and per row the range [left, right].
  struct Rows {
    int32_t y, dy, count;
    int32_t left, dleft, right, dright;
  };
  // The plane through the triangle: value at (x, y) and gradients, in quanta.
  struct Plane {
    float z, gx, gy;
    int32_t x, y;
  };

  float scan(const Rows& t, const Plane& plane) const {
    float worst = 0.0f;
    for (int32_t i = 0; i < t.count; ++i) {
      const int32_t y = t.y + i * t.dy;
      if (y > layout_.height) continue;
      const int32_t left = t.left + i * t.dleft;
      const int32_t right = std::min(t.right + i * t.dright, layout_.width);
      if (right < left) continue;
      const float p = plane.z + plane.gx * static_cast<float>(left - plane.x) +
                      plane.gy * static_cast<float>(y - plane.y);
      const uint16_t* k = grid_.row(y) + left;
      if (right - left + 1 >= kShortRow) {
        worst = std::max(worst, row_error(k, right - left + 1, p, plane.gx));
        continue;
      }
      for (int32_t x = 0; x <= right - left; ++x) {
        worst = std::max(worst, std::fabs(static_cast<float>(k[x]) - (p + plane.gx * static_cast<float>(x))));
      }
    }
    return worst;
  }

  float k(int32_t x, int32_t y) const { return static_cast<float>(grid_.k(x, y)); }

  /// Hypotenuse horizontal, from (x - s, y) to (x + s, y); apex (x, y + s * dir).
  float horizontal(int32_t x, int32_t y, int32_t s, int32_t dir) const {
    const float b = k(x - s, y), c = k(x + s, y), a = k(x, y + dir * s), inv = 1.0f / static_cast<float>(s);
    const Plane plane{a, 0.5f * (c - b) * inv, (0.5f * (b + c) - a) * inv * static_cast<float>(-dir), x,
                      y + dir * s};
    return scan({y + dir * s, -dir, s + 1, x, -1, x, 1}, plane);
  }

  /// Hypotenuse vertical, from (x, y - s) to (x, y + s); apex (x + s * dir, y).
  float vertical(int32_t x, int32_t y, int32_t s, int32_t dir) const {
    const float b = k(x, y - s), c = k(x, y + s), a = k(x + dir * s, y), inv = 1.0f / static_cast<float>(s);
    const Plane plane{a, (0.5f * (b + c) - a) * inv * static_cast<float>(-dir), 0.5f * (c - b) * inv,
                      x + dir * s, y};
    const bool right = dir > 0;
    const Rows upper = right ? Rows{y, -1, s + 1, x, 0, x + s, -1} : Rows{y, -1, s + 1, x - s, 1, x, 0};
    const Rows lower = right ? Rows{y, 1, s + 1, x, 0, x + s, -1} : Rows{y, 1, s + 1, x - s, 1, x, 0};
    return std::max(scan(upper, plane), scan(lower, plane));
  }

  /// Square of side 2s round (x, y); apex at its corner (x + s * ax, y + s * ay).
  float corner(int32_t x, int32_t y, int32_t s, int32_t ax, int32_t ay) const {
    const int32_t px = x + s * ax, py = y + s * ay;
    const float a = k(px, py), inv = 0.5f / static_cast<float>(s);
    const float gx = (k(x - s * ax, py) - a) * inv * static_cast<float>(-ax);
    const float gy = (k(px, y - s * ay) - a) * inv * static_cast<float>(-ay);
    const Rows rows = ax < 0 ? Rows{py, -ay, 2 * s + 1, px, 0, px + 2 * s, -1}
                             : Rows{py, -ay, 2 * s + 1, px - 2 * s, 1, px, 0};
    return scan(rows, {a, gx, gy, px, py});
  }

  /// Midpoints of axis-parallel hypotenuses of length 2s.
  void edge_layer(int32_t s) {
    const int32_t last = std::min(extent_y_, layout_.height + s);
    parallel_for(last / s + 1, std::max<int64_t>(1, 64 / s), [&](int64_t begin, int64_t end) {
      for (int64_t j = begin; j < end; ++j) edge_row(static_cast<int32_t>(j), s);
    });
  }

  void edge_row(int32_t j, int32_t s) {
    const int32_t y = j * s;
    const bool is_horizontal = j % 2 == 0;
    for (int32_t x = is_horizontal ? s : 0; x <= extent_x_ && x - s < layout_.width; x += 2 * s) {
      float e = 0.0f;
      if (s == 1) {
        if (x > layout_.width || y > layout_.height) continue;
        const float mean = is_horizontal ? k(x - 1, y) + k(x + 1, y) : k(x, y - 1) + k(x, y + 1);
        e = std::fabs(k(x, y) - 0.5f * mean);
      } else {
        for (int32_t dir = -1; dir <= 1; dir += 2) {
          const int32_t apex = (is_horizontal ? y : x) + dir * s;
          if (apex < 0 || apex > (is_horizontal ? extent_y_ : extent_x_)) continue;
          e = std::max(e, is_horizontal ? horizontal(x, y, s, dir) : vertical(x, y, s, dir));
        }
        for (int32_t cy = -1; cy <= 1; cy += 2) {
          for (int32_t cx = -1; cx <= 1; cx += 2) e = std::max(e, below(x + cx * s / 2, y + cy * s / 2));
        }
      }
      place(x, y) = e;
    }
  }

  /// Midpoints of diagonals: centres of squares of side 2s.
  void center_layer(int32_t s) {
    const int32_t last = std::min(extent_y_, layout_.height + s);
    parallel_for((last / s + 1) / 2, std::max<int64_t>(1, 32 / s), [&](int64_t begin, int64_t end) {
      for (int64_t j = begin; j < end; ++j) center_row(static_cast<int32_t>(2 * j + 1) * s, s);
    });
  }

  void center_row(int32_t y, int32_t s) {
    if (y - s >= layout_.height) return;
    for (int32_t x = s; x < extent_x_ && x - s < layout_.width; x += 2 * s) {
      const int32_t flip = main_diagonal(x - s, y - s, 2 * s) ? 1 : -1;
      float e = 0.0f;
      if (s == 1) {  // the leg midpoints are vertices of the layer below, whose errors are taken over
        if (x <= layout_.width && y <= layout_.height) {
          e = std::fabs(k(x, y) - 0.5f * (k(x - 1, y - flip) + k(x + 1, y + flip)));
        }
      } else {
        e = std::max(corner(x, y, s, 1, -flip), corner(x, y, s, -1, flip));
      }
      e = std::max({e, below(x - s, y), below(x + s, y), below(x, y - s), below(x, y + s)});
      place(x, y) = e;
    }
  }

  /// Error of a vertex of the layer below; 0 where it lies outside of all that matters.
  float below(int32_t x, int32_t y) const {
    if (x < 0 || y < 0 || x > extent_x_ || y > extent_y_) return 0.0f;
    return stored(x, y) ? grid_.error(x, y) : 0.0f;
  }
  bool stored(int32_t x, int32_t y) const {
    return (x < grid_.fine_width_ && y < grid_.fine_height_) ||
           (x % layout_.leaf == 0 && y % layout_.leaf == 0);
  }
  float& place(int32_t x, int32_t y) {
    static thread_local float unused;
    return stored(x, y) ? *const_cast<float*>(grid_.error_place(x, y)) : unused;
  }

  Grid& grid_;
  const Layout& layout_;
  int32_t extent_x_, extent_y_;
};

Grid::Grid(const HeightField& field, const Layout& layout)
    : layout_(layout), quantizer_(make_quantizer(field)) {
  stride_ = layout.width + 1;
  samples_.resize(static_cast<size_t>(stride_) * (layout.height + 1));
  std::mutex mutex;
  parallel_for(layout.height + 1, 64, [&](int64_t begin, int64_t end) {
    double worst = 0.0;
    for (int64_t i = begin * stride_; i < end * stride_; ++i) {
      const double h = field.heights[i];
      const double value = std::round(h / quantizer_.quantum) - static_cast<double>(quantizer_.base);
      samples_[static_cast<size_t>(i)] = static_cast<uint16_t>(value);
      // What fills a void is nobody's measurement: it may lie between quanta.
      if (field.valid == nullptr || field.valid[i] != 0)
        worst = std::max(worst, std::abs(h - quantizer_.height(value)));
    }
    const std::lock_guard lock(mutex);
    quantizer_.residual = std::max(quantizer_.residual, worst);
  });
  const auto padded = [&](int32_t cells) {
    return (cells + layout.leaf - 1) / layout.leaf * layout.leaf + 1;
  };
  fine_width_ = padded(layout.width);
  fine_height_ = padded(layout.height);
  coarse_width_ = layout.roots_x * layout.root / layout.leaf + 1;
  fine_.assign(static_cast<size_t>(fine_width_) * fine_height_, 0.0f);
  coarse_.assign(static_cast<size_t>(coarse_width_) * (layout.roots_y * layout.root / layout.leaf + 1), 0.0f);
  ErrorPass(*this).run();
}

std::vector<int64_t> Grid::count_by_class() const {
  std::vector<int64_t> counts(kErrorClasses, 0);
  std::mutex mutex;
  parallel_for(layout_.height + 1, 256, [&](int64_t begin, int64_t end) {
    std::vector<int64_t> mine(kErrorClasses, 0);
    for (int64_t y = begin; y < end; ++y) {
      const float* e = &fine_[static_cast<size_t>(y) * fine_width_];
      for (int32_t x = 0; x <= layout_.width; ++x) ++mine[std::bit_cast<uint32_t>(e[x]) >> kClassShift];
    }
    const std::lock_guard lock(mutex);
    for (size_t i = 0; i < kErrorClasses; ++i) counts[i] += mine[i];
  });
  for (size_t i = kErrorClasses - 1; i-- > 0;) counts[i] += counts[i + 1];
  return counts;
}

}  // namespace lodlab::chunked
