// SPDX-License-Identifier: MIT
// Blocks are measured one by one, each by itself, and closed; see measure.h for what is measured how.
#include "methods/multigrain/errors.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "base/parallel.h"
#include "methods/multigrain/measure.h"

namespace lodlab::multigrain {
namespace {

std::pair<float, float> height_range(const HeightRows& field, const Block& block) {
  const int64_t count = std::min<int64_t>(block.width + 1, field.cols - block.col);
  float low = field.at(block.row, block.col), high = low;
  for (int64_t row = block.row; row <= block.row + block.height; ++row) {
    const float* z = field.row(row) + block.col;
    float least = z[0], most = z[0];
#pragma omp simd reduction(min : least) reduction(max : most)
    for (int64_t i = 0; i < count; ++i) {
      least = z[i] < least ? z[i] : least;
      most = z[i] > most ? z[i] : most;
    }
    if (count <= block.width) {  // the column that closes a planet
      least = std::min(least, field.at(row, 0));
      most = std::max(most, field.at(row, 0));
    }
    low = std::min(low, least);
    high = std::max(high, most);
  }
  return {low, high};
}

/// Makes a block's errors nest, as errors.h says; `top` is the largest stride that is drawn.
void close(float* own, float* strips, int strides, int top) {
  const int pairs = BlockErrors::pairs(strides);
  for (int edge = 0; edge < 4; ++edge) {
    float* strip = strips + edge * pairs;
    for (int b = 1; b < strides; ++b) {
      for (int a = 0; a < b; ++a) {
        float& value = strip[BlockErrors::pair(a, b)];
        if (b > top && a < b - 1) value = strip[BlockErrors::pair(a, b - 1)];
        if (a > 0) value = std::max(value, strip[BlockErrors::pair(a - 1, b)]);
        if (a < b - 1) value = std::max(value, strip[BlockErrors::pair(a, b - 1)]);
      }
    }
  }
  for (int a = 1; a < strides; ++a) {
    own[a] = std::max(own[a], own[a - 1]);
    for (int edge = 0; edge < 4; ++edge)  // the largest of the strips (a', b), a' < b <= a
      own[a] = std::max(own[a], strips[edge * pairs + BlockErrors::pair(a - 1, a)]);
  }
}

}  // namespace

BlockErrors no_errors(const Layout& layout) {
  BlockErrors out;
  out.strides = layout.block_log2() + 1;
  const int64_t blocks = layout.blocks_x() * layout.blocks_y(), strips = 4 * BlockErrors::pairs(out.strides);
  out.own.resize(static_cast<size_t>(blocks * out.strides));
  out.strips.resize(static_cast<size_t>(blocks * strips));
  out.low.resize(static_cast<size_t>(blocks));
  out.high.resize(static_cast<size_t>(blocks));
  return out;
}

void measure_errors(const HeightRows& rows, const Layout& layout, Bounds bounds, int64_t first, int64_t last,
                    BlockErrors& out, const Progress& progress) {
  const int64_t blocks = last - first, strips = 4 * BlockErrors::pairs(out.strides);
  int64_t done = 0;  // reports come in order
  std::mutex mutex;
  parallel_for(blocks, std::clamp<int64_t>(blocks / 64, 1, 32), [&](int64_t begin, int64_t end) {
    const auto measurer = bounds == Bounds::kBilinear ? make_bilinear_measurer(rows, layout)
                          : rows.planet               ? make_planet_measurer(rows, layout)
                                                      : make_flat_measurer(rows, layout);
    for (int64_t i = first + begin; i < first + end; ++i) {
      const Block block(layout, i);
      const auto [low, high] = height_range(rows, block);
      float* own = out.own.data() + i * out.strides;
      float* strip = out.strips.data() + i * strips;
      measurer->measure(block, low, high, own, strip);
      close(own, strip, out.strides, layout.largest_stride_log2());
      out.low[static_cast<size_t>(i)] = low;
      out.high[static_cast<size_t>(i)] = high;
    }
    const std::lock_guard lock(mutex);
    const int64_t so_far = done += end - begin;
    if (progress) progress("errors", static_cast<double>(so_far) / static_cast<double>(blocks));
  });
}

BlockErrors measure_errors(const HeightField& field, const Layout& layout, Bounds bounds,
                           const Progress& progress) {
  BlockErrors out = no_errors(layout);
  measure_errors(field, layout, bounds, 0, layout.blocks_x() * layout.blocks_y(), out, progress);
  return out;
}

}  // namespace lodlab::multigrain
