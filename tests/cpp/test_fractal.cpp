// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/fractal.h"

using namespace lodlab;

namespace {

std::vector<float> window(const Fractal& fractal, int64_t row0, int64_t col0, int64_t rows, int64_t cols) {
  std::vector<float> out(static_cast<size_t>(rows * cols));
  fractal_heights(fractal, row0, col0, rows, cols, out.data());
  return out;
}

double rms_difference(const std::vector<float>& h, int64_t size, int64_t lag) {
  double sum = 0.0;
  int64_t count = 0;
  for (int64_t r = 0; r < size; ++r) {
    for (int64_t c = 0; c + lag < size; ++c, count += 2) {
      const double east = h[r * size + c + lag] - h[r * size + c];
      const double south = h[(c + lag) * size + r] - h[c * size + r];
      sum += east * east + south * south;
    }
  }
  return std::sqrt(sum / static_cast<double>(count));
}

}  // namespace

TEST_CASE("any window agrees with any other bit for bit") {
  const Fractal fractal{7, 0.5};
  const int64_t size = 300;
  const std::vector<float> whole = window(fractal, -100, -57, size, size);
  const std::array<std::array<int64_t, 4>, 6> parts = {{{0, 0, 1, 1},
                                                        {13, 7, 50, 3},
                                                        {0, 299, 300, 1},
                                                        {255, 1, 45, 255},
                                                        {99, 56, 2, 5},
                                                        {100, 57, 129, 131}}};
  for (const auto& [r0, c0, rows, cols] : parts) {
    const std::vector<float> part = window(fractal, r0 - 100, c0 - 57, rows, cols);
    bool same = true;
    for (int64_t r = 0; r < rows; ++r) {
      for (int64_t c = 0; c < cols; ++c) {
        same = same && part[r * cols + c] == whole[(r0 + r) * size + c0 + c];
      }
    }
    CHECK(same);
  }
}

TEST_CASE("the same bits with one thread and with two, and far from the origin") {
  const int64_t far = (int64_t{1} << 40) - 200;
  set_thread_count(1);
  const auto near_one = window({1, 0.5}, 0, 0, 200, 100);
  const auto far_one = window({1, 0.5}, far, -far, 200, 100);
  set_thread_count(2);
  CHECK(window({1, 0.5}, 0, 0, 200, 100) == near_one);
  CHECK(window({1, 0.5}, far, -far, 200, 100) == far_one);
  set_thread_count(0);
  CHECK(near_one != far_one);
  CHECK(std::all_of(far_one.begin(), far_one.end(), [](float z) { return std::abs(z) < 10000.0f; }));
}

TEST_CASE("seed and roughness change the terrain; roughness outside 0 to 1 is refused") {
  const auto base = window({1, 0.5}, 0, 0, 64, 64);
  CHECK(window({2, 0.5}, 0, 0, 64, 64) != base);
  CHECK(window({1, 0.6}, 0, 0, 64, 64) != base);
  CHECK(window({~uint64_t{0}, 0.0}, 0, 0, 64, 64) != base);
  CHECK_THROWS_AS(window({1, 1.01}, 0, 0, 2, 2), InvalidInput);
  CHECK_THROWS_AS(window({1, std::nan("")}, 0, 0, 2, 2), InvalidInput);
  CHECK_THROWS_AS(window({1, 0.5}, (int64_t{1} << 40), 0, 2, 2), InvalidInput);
}

TEST_CASE("roughness and relief are those of real mountains") {
  const int64_t size = 2049;
  // RMS height differences of the SRTM tile N46 W122 (Mt Rainier), both directions, metres.
  const std::array<std::pair<int64_t, double>, 4> rainier = {
      {{1, 20.6}, {4, 72.1}, {16, 197.5}, {64, 372.7}}};
  for (const uint64_t seed : {1, 2}) {
    const auto h = window({seed, 0.5}, 0, 0, size, size);
    for (const auto& [lag, real] : rainier) {
      const double ratio = rms_difference(h, size, lag) / real;
      CAPTURE(lag);
      CHECK(ratio > 0.5);
      CHECK(ratio < 2.0);
    }
    const auto [lo, hi] = std::minmax_element(h.begin(), h.end());
    CHECK(*hi - *lo > 2000.0f);
    CHECK(*hi - *lo < 3000.0f);
  }
}

TEST_CASE("rougher terrain differs more over one sample") {
  const int64_t size = 257;
  double last = 0.0;
  for (const double roughness : {0.0, 0.25, 0.5, 0.75, 1.0}) {
    const double rms = rms_difference(window({1, roughness}, 0, 0, size, size), size, 1);
    CHECK(rms > 1.5 * last);
    last = rms;
  }
}
