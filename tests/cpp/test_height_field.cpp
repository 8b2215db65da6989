// SPDX-License-Identifier: MIT
#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <tuple>
#include <vector>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/height_field.h"

using namespace lodlab;

namespace {

const float kNan = std::numeric_limits<float>::quiet_NaN();

FieldFrame frame_of(int64_t rows, int64_t cols) {
  FieldFrame frame;
  frame.rows = rows;
  frame.cols = cols;
  return frame;
}

FieldFrame earth_frame() {
  FieldFrame frame = frame_of(181, 360);
  frame.planet = true;
  frame.dlon = 1.0;
  frame.dlat = 1.0;
  frame.wraps = true;
  return frame;
}

std::shared_ptr<const HeightField> make(const FieldFrame& frame, const std::vector<float>& heights,
                                        const uint8_t* valid = nullptr) {
  return make_height_field(frame, heights.data(), valid, nullptr, "");
}

/// Largest difference of a filled sample from the mean of its neighbours.
double largest_residual(const std::vector<float>& h, const std::vector<uint8_t>& valid, int64_t rows,
                        int64_t cols) {
  double most = 0.0;
  for (int64_t r = 0; r < rows; ++r) {
    for (int64_t c = 0; c < cols; ++c) {
      if (valid[r * cols + c]) continue;
      double sum = 0.0, count = 0.0;
      const int64_t steps[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
      for (const auto& step : steps) {
        const int64_t i = r + step[0], j = c + step[1];
        if (i < 0 || i >= rows || j < 0 || j >= cols) continue;
        sum += h[i * cols + j];
        count += 1.0;
      }
      most = std::max(most, std::abs(sum / count - h[r * cols + c]));
    }
  }
  return most;
}

}  // namespace

TEST_CASE("flat positions follow row south, column east") {
  FieldFrame frame = frame_of(5, 7);
  frame.dx = 10.0;
  frame.dy = 20.0;
  frame.x0 = 100.0;
  frame.y0 = -50.0;
  const glm::dvec3 p = frame.position(2, 3, 4.5);
  CHECK(p.x == 130.0);
  CHECK(p.y == -90.0);
  CHECK(p.z == 4.5);
}

TEST_CASE("a pole is one point whatever the column, and the seam closes") {
  const FieldFrame frame = earth_frame();
  for (int64_t c = 0; c < 360; ++c) {
    CHECK(frame.direction(0, c) == glm::dvec3(0.0, 0.0, 1.0));
    CHECK(frame.direction(180, c) == glm::dvec3(0.0, 0.0, -1.0));
    CHECK(glm::length(frame.direction(37, c)) == doctest::Approx(1.0).epsilon(1e-15));
  }
  CHECK(frame.direction(90, 0) == glm::dvec3(1.0, 0.0, 0.0));
  CHECK(frame.direction(90, 90) == glm::dvec3(0.0, 1.0, 0.0));
  CHECK(frame.direction(90, 180) == glm::dvec3(-1.0, 0.0, 0.0));
  CHECK(frame.direction(41, 360) == frame.direction(41, 0));
}

TEST_CASE("latitudes that miss the pole by the rounding of a geotransform are at the pole") {
  FieldFrame frame = earth_frame();
  frame.rows = 2161;
  frame.dlat = 0.08333333333333333;
  frame.lat0 = 90.00000000000001;
  CHECK(frame.direction(0, 17) == glm::dvec3(0.0, 0.0, 1.0));
  CHECK(frame.direction(2160, 17) == glm::dvec3(0.0, 0.0, -1.0));
}

TEST_CASE("cosine and sine in degrees agree with radians") {
  for (double d = -725.0; d < 725.0; d += 0.37) {
    const glm::dvec2 cs = cos_sin_degrees(d);
    CHECK(cs.x == doctest::Approx(std::cos(d * 0.017453292519943295)).epsilon(1e-12));
    CHECK(cs.y == doctest::Approx(std::sin(d * 0.017453292519943295)).epsilon(1e-12));
  }
}

TEST_CASE("the frame survives its JSON text bit for bit") {
  HeightField frame;
  static_cast<FieldFrame&>(frame) = earth_frame();
  frame.dx = 0.1;
  frame.x0 = -1.0 / 3.0;
  frame.z_min = -10376.0;
  frame.z_max = 1e-300;
  frame.height_step = 0.3;
  HeightField back;
  static_cast<FieldFrame&>(back) = frame_from_json(frame.frame());
  CHECK(frame.frame().starts_with(R"({"kind":"planet",)"));
  CHECK(back.frame() == frame.frame());
  CHECK(back.x0 == frame.x0);
  CHECK(back.wraps);
  CHECK_THROWS_AS(frame_from_json("{}"), InvalidInput);
  CHECK_THROWS_AS(frame_from_json(R"({"rows":x})"), InvalidInput);
  CHECK_THROWS_AS(frame_from_json(R"({"rows":12)"), InvalidInput);
}

TEST_CASE("making a field finds its range and checks its input") {
  const std::vector<float> heights = {1, -2, 3, 4, 5, 6};
  const auto field = make(frame_of(2, 3), heights);
  CHECK(field->z_min == -2.0);
  CHECK(field->z_max == 6.0);
  CHECK_THROWS_AS(make(frame_of(1, 6), heights), InvalidInput);
  CHECK_THROWS_AS(make(frame_of(int64_t{1} << 20, int64_t{1} << 20), heights), InvalidInput);
  CHECK_THROWS_AS(make(frame_of(2, 3), {1, 2, kNan, 4, 5, 6}), InvalidInput);
  CHECK_THROWS_WITH_AS(make(frame_of(2, 3), {1, 2, 3, 4, INFINITY, 6}),
                       "height field: height inf at row 1, column 1 is not finite", InvalidInput);
  FieldFrame bad = frame_of(2, 3);
  bad.dx = 0.0;
  CHECK_THROWS_AS(make(bad, heights), InvalidInput);
}

TEST_CASE("planets that leave the sphere are refused") {
  const std::vector<float> heights(181 * 360, 0.0f);
  CHECK_NOTHROW(make(earth_frame(), heights));
  FieldFrame frame = earth_frame();
  frame.radius = 0.0;
  CHECK_THROWS_AS(make(frame, heights), InvalidInput);
  frame = earth_frame();
  frame.lat0 = 91.0;
  CHECK_THROWS_AS(make(frame, heights), InvalidInput);
  frame = earth_frame();
  frame.dlon = 1.1;
  CHECK_THROWS_AS(make(frame, heights), InvalidInput);
  CHECK_THROWS_AS(make(earth_frame(), std::vector<float>(181 * 360, -6371000.0f)), InvalidInput);
}

TEST_CASE("cells of a planet that reach so far round that they show their insides are refused") {
  FieldFrame frame = frame_of(2, 2);
  frame.planet = true;
  for (const auto& [dlon, dlat, fits] :
       {std::tuple{120.0, 90.0, true}, {121.0, 1.0, false}, {1.0, 91.0, false}, {250.0, 0.7, false}}) {
    frame.dlon = dlon;
    frame.dlat = dlat;
    if (fits) {
      CHECK_NOTHROW(make(frame, {0.0f, 0.0f, 0.0f, 0.0f}));
    } else {
      CHECK_THROWS_WITH_AS(make(frame, {0.0f, 0.0f, 0.0f, 0.0f}), doctest::Contains("the limit is 120 x 90"),
                           InvalidInput);
    }
  }
}

TEST_CASE("samples beside a pole that cannot be told from each other are refused") {
  FieldFrame frame = frame_of(3, 3);
  const std::vector<float> heights(9, 0.0f);
  frame.planet = true;
  for (const double step : {0.000118, 0.001}) {
    frame.dlon = frame.dlat = step;
    for (const double north : {90.0, 45.0, -90.0 + 2.0 * step}) {
      frame.lat0 = north;
      if (step < 0.0005 && north != 45.0) {
        CHECK_THROWS_WITH_AS(make(frame, heights), doctest::Contains("can be told from each other"),
                             InvalidInput);
      } else {
        CHECK_NOTHROW(make(frame, heights));
      }
    }
  }
  frame.lat0 = 45.0;
  frame.dlat = 1.0;
  frame.dlon = 1e-9;
  CHECK_THROWS_AS(make(frame, heights), InvalidInput);
}

TEST_CASE("the hash sees frame, heights and mask; a mask without voids is none") {
  std::vector<float> heights = {1, 2, 3, 4, 5, 6};
  const std::vector<uint8_t> all(6, 1), one = {1, 1, 0, 1, 1, 1};
  const std::string base = make(frame_of(2, 3), heights)->hash();
  CHECK(base.size() == 32);
  CHECK(make(frame_of(2, 3), heights, all.data())->hash() == base);
  CHECK(make(frame_of(2, 3), heights, one.data())->hash() != base);
  CHECK(make(frame_of(3, 2), heights)->hash() != base);
  heights[4] = 5.5f;
  CHECK(make(frame_of(2, 3), heights)->hash() != base);
}

TEST_CASE("fill: a plane with holes comes back a plane inside") {
  const int64_t rows = 129, cols = 200;
  std::vector<float> h(rows * cols);
  std::vector<uint8_t> valid(rows * cols, 1);
  for (int64_t r = 0; r < rows; ++r) {
    for (int64_t c = 0; c < cols; ++c) {
      const bool hole = r > 10 && r < 120 && c > 20 && c < 150;
      valid[r * cols + c] = !hole;
      h[r * cols + c] = hole ? kNan : static_cast<float>(3 * r - 2 * c);
    }
  }
  fill_voids(h.data(), nullptr, rows, cols);
  for (int64_t r = 0; r < rows; ++r) {
    for (int64_t c = 0; c < cols; ++c) {
      CHECK(std::abs(h[r * cols + c] - static_cast<float>(3 * r - 2 * c)) < 0.05f);  // of a range of 784
    }
  }
}

TEST_CASE("fill: corner, edge, ragged lines, one sample") {
  for (const auto& [rows, cols] : {std::pair<int64_t, int64_t>{2, 2}, {2, 97}, {64, 64}, {101, 77}}) {
    for (int pattern = 0; pattern < 5; ++pattern) {
      CAPTURE(rows);
      CAPTURE(cols);
      CAPTURE(pattern);
      std::vector<float> h(rows * cols);
      std::vector<uint8_t> valid(rows * cols);
      uint32_t state = 12345;
      float lo = 1e9f, hi = -1e9f;
      for (int64_t i = 0; i < rows * cols; ++i) {
        const int64_t r = i / cols, c = i % cols;
        state = state * 1664525u + 1013904223u;
        const bool real[5] = {r + c > rows / 2, r > rows / 2 || i == 0, (state >> 24) < 20 || i == 0,
                              r == c || i == 0, i == rows * cols / 2};
        valid[i] = real[pattern];
        h[i] = -32768.0f;
        if (!valid[i]) continue;
        h[i] = static_cast<float>(state >> 16) / 65.536f;
        lo = std::min(lo, h[i]);
        hi = std::max(hi, h[i]);
      }
      const std::vector<float> before = h;
      fill_voids(h.data(), valid.data(), rows, cols);
      for (int64_t i = 0; i < rows * cols; ++i) {
        if (valid[i]) CHECK(h[i] == before[i]);
        CHECK(h[i] >= lo - 0.1f);  // a membrane has its extremes on its boundary; range is 1000
        CHECK(h[i] <= hi + 0.1f);
      }
      CHECK(largest_residual(h, valid, rows, cols) < 0.02);
    }
  }
}

TEST_CASE("fill: the same bits with one thread and two; nothing real is refused") {
  const int64_t rows = 500, cols = 400;
  std::vector<float> a(rows * cols);
  for (int64_t i = 0; i < rows * cols; ++i) {
    const int64_t r = i / cols - 250, c = i % cols - 200;
    a[i] = r * r + c * c < 150 * 150 ? kNan : static_cast<float>(std::sin(0.01 * static_cast<double>(i)));
  }
  std::vector<float> b = a;
  set_thread_count(1);
  fill_voids(a.data(), nullptr, rows, cols);
  set_thread_count(2);
  fill_voids(b.data(), nullptr, rows, cols);
  set_thread_count(0);
  CHECK(a == b);
  std::vector<float> none(12, kNan);
  CHECK_THROWS_AS(fill_voids(none.data(), nullptr, 3, 4), InvalidInput);
}
