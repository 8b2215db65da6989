// SPDX-License-Identifier: MIT
// Band by band of rows: along the rows first, then down the columns of what is left. Colours are taken
// relative to the middle grey, so that variances lose no digits in floats.
#include "instrument/ssim.h"

#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "base/parallel.h"
#include "instrument/picture_difference.h"
#include "instrument/sample_error.h"
#include "instrument/separable.h"

namespace lodlab::instrument {
namespace {

constexpr int kRadius = 5;
constexpr int64_t kBand = 48;  // rows of windows
constexpr float kGrey = 128.0f;
constexpr float kC1 = (0.01f * 255.0f) * (0.01f * 255.0f);
constexpr float kC2 = (0.03f * 255.0f) * (0.03f * 255.0f);

/// Means of a, b, a^2 + b^2 and a b.
constexpr size_t kMoments = 4;
using Rows = std::array<std::vector<float>, kMoments>;

Kernel window() {
  std::array<double, kRadius + 1> exact{};
  double sum = 0.0;
  for (int k = 0; k <= kRadius; ++k) {
    exact[static_cast<size_t>(k)] = std::exp(-0.5 * (k / 1.5) * (k / 1.5));
    sum += exact[static_cast<size_t>(k)] * (k == 0 ? 1.0 : 2.0);
  }
  Kernel out;
  for (const double weight : exact) out.weights.push_back(static_cast<float>(weight / sum));
  return out;
}

void products(const uint8_t* a, const uint8_t* b, int64_t count, Rows& out) {
  for (int64_t i = 0; i < count; ++i) {
    const size_t at = static_cast<size_t>(i);
    const float x = static_cast<float>(a[4 * i]) - kGrey, y = static_cast<float>(b[4 * i]) - kGrey;
    out[0][at] = x;
    out[1][at] = y;
    out[2][at] = x * x + y * y;
    out[3][at] = x * y;
  }
}

/// Equal pictures make numerator and denominator equal to the last bit.
double similarity(const Rows& means, int64_t count) {
  double sum = 0.0;
  for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
    const float x = means[0][i], y = means[1][i], u = x + kGrey, v = y + kGrey;
    const float covariance = means[3][i] - x * y, variances = means[2][i] - (x * x + y * y);
    sum += static_cast<double>((2.0f * (u * v) + kC1) * (2.0f * covariance + kC2)) /
           static_cast<double>((u * u + v * v + kC1) * (variances + kC2));
  }
  return sum;
}

/// The sum over the windows of rows [first, end) of one channel.
double band_of(const render::Picture& a, const render::Picture& b, int channel, const Kernel& kernel,
               int64_t first, int64_t end) {
  const int64_t width = a.width, wide = width - 2 * kRadius, tall = end - first + 2 * kRadius;
  Rows line, along, means;
  for (size_t m = 0; m < kMoments; ++m) {
    line[m].resize(static_cast<size_t>(width));
    along[m].resize(static_cast<size_t>(wide * tall));
    means[m].resize(static_cast<size_t>(wide));
  }
  for (int64_t row = 0; row < tall; ++row) {
    const int64_t pixel = 4 * (first + row) * width + channel;
    products(a.rgba.data() + pixel, b.rgba.data() + pixel, width, line);
    for (size_t m = 0; m < kMoments; ++m) {
      convolve(
          kernel, [&](int k) { return line[m].data() + kRadius + k; }, wide, along[m].data() + row * wide);
    }
  }
  double sum = 0.0;
  for (int64_t row = kRadius; row < tall - kRadius; ++row) {
    for (size_t m = 0; m < kMoments; ++m) {
      convolve(
          kernel, [&](int k) { return along[m].data() + (row + k) * wide; }, wide, means[m].data());
    }
    sum += similarity(means, wide);
  }
  return sum;
}

}  // namespace

double ssim(const render::Picture& a, const render::Picture& b) {
  check_same_size("ssim", a, b);
  const int64_t wide = a.width - 2 * kRadius, tall = a.height - 2 * kRadius;
  if (wide < 1 || tall < 1) return kUndefined;
  const Kernel kernel = window();
  const int64_t bands = (tall + kBand - 1) / kBand;
  std::vector<double> sums(static_cast<size_t>(3 * bands));
  parallel_for(3 * bands, 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const int64_t first = i / 3 * kBand;
      sums[static_cast<size_t>(i)] =
          band_of(a, b, static_cast<int>(i % 3), kernel, first, std::min(tall, first + kBand));
    }
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0) / (3.0 * static_cast<double>(wide * tall));
}

}  // namespace lodlab::instrument
