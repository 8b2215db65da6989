// SPDX-License-Identifier: MIT
// Sections and figures in comments are of the paper (flip.h). The picture is filtered band by band of rows,
// along the rows first; beyond the border a picture repeats its last pixel. Means are doubles.
#include "instrument/flip.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <numeric>

#include "base/errors.h"
#include "base/parallel.h"
#include "instrument/picture_difference.h"
#include "instrument/separable.h"

namespace lodlab::instrument {
namespace {

constexpr double kPixelsPerDegree = 67.0;
constexpr double kFeatureWidth = 0.082;  // degrees (4.2)
constexpr float kColourPower = 0.7f;     // 4.1.3
constexpr float kKnee = 0.4f, kAtKnee = 0.95f;
constexpr int64_t kBand = 64;  // rows

// ---- kernels ----------------------------------------------------------------------------------------------

struct Gauss {
  double height, width;  // a and b of table 1: a * sqrt(pi / b) * exp(-pi^2 x^2 / b), x in degrees
};

double at(const Gauss& gauss, int k) {
  const double x = k / kPixelsPerDegree, pi = std::numbers::pi;
  return std::exp(-pi * pi * x * x / gauss.width);
}

double sum_of(const Gauss& gauss, int radius) {
  double sum = 1.0;
  for (int k = 1; k <= radius; ++k) sum += 2.0 * at(gauss, k);
  return sum;
}

/// Three deviations of the widest, for all alike.
int contrast_radius() {
  constexpr double widest = 0.04;
  return static_cast<int>(
      std::ceil(3.0 * std::sqrt(widest / (2.0 * std::numbers::pi * std::numbers::pi)) * kPixelsPerDegree));
}

/// Along one axis, of a filter in two whose Gaussians are weighted so that it sums to 1; `share`: of this
/// one. Weights that floats lose beside the middle one are left out.
Kernel contrast(const Gauss& gauss, double share) {
  const int radius = contrast_radius();
  const double scale = std::sqrt(share) / sum_of(gauss, radius);
  Kernel out;
  for (int k = 0; k <= radius && at(gauss, k) > 1e-9; ++k)
    out.weights.push_back(static_cast<float>(scale * at(gauss, k)));
  return out;
}

struct Kernels {
  Kernel lightness, red_green, blue_yellow, blue_yellow_wide;
  Kernel smooth, slope,
      curve;  ///< a Gaussian and its derivatives; positive weights sum to 1, negative ones to -1
};

void add_features(Kernels& kernels) {
  const double deviation = 0.5 * kFeatureWidth * kPixelsPerDegree;
  const int radius = static_cast<int>(std::ceil(3.0 * deviation));
  std::vector<double> smooth, slope, curve;
  double all = 0.0, rise = 0.0, above = 0.0, below = 0.0;
  for (int k = 0; k <= radius; ++k) {
    const double x = k / deviation, g = std::exp(-0.5 * x * x), both = k == 0 ? 1.0 : 2.0;
    smooth.push_back(g);
    slope.push_back(-x * g);
    curve.push_back((x * x - 1.0) * g);
    all += both * g;
    rise += x * g;
    (curve.back() > 0.0 ? above : below) += both * std::fabs(curve.back());
  }
  for (size_t k = 0; k < smooth.size(); ++k) {
    kernels.smooth.weights.push_back(static_cast<float>(smooth[k] / all));
    kernels.slope.weights.push_back(static_cast<float>(slope[k] / rise));
    kernels.curve.weights.push_back(static_cast<float>(curve[k] / (curve[k] > 0.0 ? above : below)));
  }
  kernels.slope.odd = true;
}

Kernels make_kernels() {
  const Gauss lightness{1.0, 0.0047}, red_green{1.0, 0.0053}, first{34.1, 0.04}, second{13.5, 0.025};
  const int radius = contrast_radius();
  const auto volume = [&](const Gauss& g) {
    const double side = sum_of(g, radius);
    return g.height * std::sqrt(std::numbers::pi / g.width) * side * side;
  };
  const double share = volume(first) / (volume(first) + volume(second));
  Kernels out;
  out.lightness = contrast(lightness, 1.0);
  out.red_green = contrast(red_green, 1.0);
  out.blue_yellow = contrast(second, 1.0 - share);
  out.blue_yellow_wide = contrast(first, share);
  add_features(out);
  return out;
}

// ---- colours ----------------------------------------------------------------------------------------------

/// Linear sRGB to XYZ over white (D65): rows sum to 1.
constexpr std::array<std::array<double, 3>, 3> kToXyz = {
    {{10135552.0 / 23359437.0, 8788810.0 / 23359437.0, 4435075.0 / 23359437.0},
     {2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0},
     {1425312.0 / 80288307.0, 8788810.0 / 80288307.0, 70074185.0 / 80288307.0}}};

struct Matrix {
  std::array<std::array<float, 3>, 3> m;
  float row(size_t i, float x, float y, float z) const { return m[i][0] * x + m[i][1] * y + m[i][2] * z; }
};

Matrix to_xyz() {
  Matrix out{};
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j) out.m[i][j] = static_cast<float>(kToXyz[i][j]);
  return out;
}

Matrix from_xyz() {
  const auto& m = kToXyz;
  const auto minor = [&](size_t i, size_t j) {  // the signed cofactor, by cyclic indices
    const size_t a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, d = (j + 2) % 3;
    return m[a][c] * m[b][d] - m[a][d] * m[b][c];
  };
  const double determinant = m[0][0] * minor(0, 0) + m[0][1] * minor(0, 1) + m[0][2] * minor(0, 2);
  Matrix out{};
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j) out.m[j][i] = static_cast<float>(minor(i, j) / determinant);
  return out;
}

std::array<float, 256> linear_of_bytes() {
  std::array<float, 256> out{};
  for (size_t i = 0; i < out.size(); ++i) {
    const double c = static_cast<double>(i) / 255.0;
    out[i] = static_cast<float>(c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4));
  }
  return out;
}

/// Of [0.008, 1.01], to a float's last digits: a guess from the exponent and three steps of Newton's. No
/// call, so that loops stay vectors.
inline float cube_root(float x) {
  float y = std::bit_cast<float>(std::bit_cast<uint32_t>(x) / 3u + 0x2a5137a0u);
  for (int i = 0; i < 3; ++i) y = (2.0f * y + x / (y * y)) * (1.0f / 3.0f);
  return y;
}

/// CIE's f of L*a*b*.
inline float lab_of(float t) {
  constexpr float kStep = 6.0f / 29.0f, kLinear = kStep * kStep * kStep;
  const float root = cube_root(std::max(t, kLinear));
  return t > kLinear ? root : t * (1.0f / (3.0f * kStep * kStep)) + 4.0f / 29.0f;
}

inline void lab_of(float x, float y, float z, float& lightness, float& a, float& b) {
  const float fx = lab_of(x), fy = lab_of(y), fz = lab_of(z);
  lightness = 116.0f * fy - 16.0f;
  a = 0.01f * lightness * 500.0f * (fx - fy);  // Hunt: dark colours look less colourful
  b = 0.01f * lightness * 200.0f * (fy - fz);
}

/// HyAB to the power 0.7 between full green and full blue, the two colours farthest apart.
float largest_difference() {
  const Matrix xyz = to_xyz();
  std::array<std::array<float, 3>, 2> lab{};
  for (size_t i = 0; i < 2; ++i) {
    const size_t channel = i + 1;
    lab_of(xyz.m[0][channel], xyz.m[1][channel], xyz.m[2][channel], lab[i][0], lab[i][1], lab[i][2]);
  }
  return std::pow(std::fabs(lab[0][0] - lab[1][0]) + std::hypot(lab[0][1] - lab[1][1], lab[0][2] - lab[1][2]),
                  kColourPower);
}

// ---- one picture ------------------------------------------------------------------------------------------

/// Rows of a band, with those above and below it that filters reach, after the pass along rows.
struct Along {
  enum Plane : size_t {
    kLightness,
    kRedGreen,
    kBlueYellow,
    kBlueYellowWide,
    kSmooth,
    kSlope,
    kCurve,
    kPlanes
  };
  std::array<std::vector<float>, kPlanes> planes;
};

class Eye {
 public:
  explicit Eye(const render::Picture& picture)
      : picture_(picture),
        kernels_(make_kernels()),
        reach_(std::max(contrast_radius(), kernels_.smooth.radius())) {}

  void look(int64_t first, int64_t end, Seen& out) const {
    const int64_t width = picture_.width, tall = end - first + 2 * reach_;
    Along along;
    for (auto& plane : along.planes) plane.resize(static_cast<size_t>(width * tall));
    for (int64_t row = 0; row < tall; ++row) filter_row(first - reach_ + row, row, along);
    std::array<std::vector<float>, 6> line;
    for (auto& values : line) values.resize(static_cast<size_t>(width));
    for (int64_t row = first; row < end; ++row) {
      colours(along, row - first + reach_, line, row * width, out);
      features(along, row - first + reach_, line, row * width, out);
    }
  }

 private:
  /// Opponent colours of a row (YCxCz over their scales: y, x - y, y - z), its last pixels repeated on either
  /// side, and what the filters make of it along the row. A row above or below the picture is the first or
  /// last one.
  void filter_row(int64_t source, int64_t row, Along& along) const {
    const int64_t width = picture_.width, padded = width + 2 * reach_;
    std::array<std::vector<float>, 3> line;
    for (auto& values : line) values.resize(static_cast<size_t>(padded));
    const uint8_t* pixels =
        picture_.rgba.data() + 4 * width * std::clamp<int64_t>(source, 0, picture_.height - 1);
    for (int64_t i = 0; i < padded; ++i) {
      const uint8_t* pixel = pixels + 4 * std::clamp<int64_t>(i - reach_, 0, width - 1);
      const float r = linear_[pixel[0]], g = linear_[pixel[1]], b = linear_[pixel[2]];
      const float x = xyz_.row(0, r, g, b), y = xyz_.row(1, r, g, b), z = xyz_.row(2, r, g, b);
      const size_t at = static_cast<size_t>(i);
      line[0][at] = y;
      line[1][at] = x - y;
      line[2][at] = y - z;
    }
    const auto filter = [&](const Kernel& kernel, size_t channel, Along::Plane plane) {
      convolve(
          kernel, [&](int k) { return line[channel].data() + reach_ + k; }, width,
          along.planes[plane].data() + row * width);
    };
    filter(kernels_.lightness, 0, Along::kLightness);
    filter(kernels_.red_green, 1, Along::kRedGreen);
    filter(kernels_.blue_yellow, 2, Along::kBlueYellow);
    filter(kernels_.blue_yellow_wide, 2, Along::kBlueYellowWide);
    filter(kernels_.smooth, 0, Along::kSmooth);
    filter(kernels_.slope, 0, Along::kSlope);
    filter(kernels_.curve, 0, Along::kCurve);
  }

  void down(const Along& along, Along::Plane plane, const Kernel& kernel, int64_t row,
            std::vector<float>& out) const {
    const int64_t width = picture_.width;
    convolve(
        kernel, [&](int k) { return along.planes[plane].data() + (row + k) * width; }, width, out.data());
  }

  void colours(const Along& along, int64_t row, std::array<std::vector<float>, 6>& line, int64_t to,
               Seen& out) const {
    down(along, Along::kLightness, kernels_.lightness, row, line[0]);
    down(along, Along::kRedGreen, kernels_.red_green, row, line[1]);
    down(along, Along::kBlueYellow, kernels_.blue_yellow, row, line[2]);
    down(along, Along::kBlueYellowWide, kernels_.blue_yellow_wide, row, line[3]);
    const float *light = line[0].data(), *red = line[1].data(), *blue = line[2].data(),
                *wide = line[3].data();
    float *lightness = out.lightness.data() + to, *a = out.a.data() + to, *b = out.b.data() + to;
    for (int64_t i = 0; i < picture_.width; ++i) {
      const float y = light[i], x = red[i] + y, z = y - (blue[i] + wide[i]);
      const auto shown = [&](size_t channel) { return std::clamp(rgb_.row(channel, x, y, z), 0.0f, 1.0f); };
      const float r = shown(0), g = shown(1), bl = shown(2);
      lab_of(xyz_.row(0, r, g, bl), xyz_.row(1, r, g, bl), xyz_.row(2, r, g, bl), lightness[i], a[i], b[i]);
    }
  }

  void features(const Along& along, int64_t row, std::array<std::vector<float>, 6>& line, int64_t to,
                Seen& out) const {
    down(along, Along::kSlope, kernels_.smooth, row, line[0]);
    down(along, Along::kSmooth, kernels_.slope, row, line[1]);
    down(along, Along::kCurve, kernels_.smooth, row, line[2]);
    down(along, Along::kSmooth, kernels_.curve, row, line[3]);
    const auto length = [&](size_t x, size_t y, float* to_values) {
      const float *u = line[x].data(), *v = line[y].data();
      for (int64_t i = 0; i < picture_.width; ++i) to_values[i] = std::sqrt(u[i] * u[i] + v[i] * v[i]);
    };
    length(0, 1, out.edge.data() + to);
    length(2, 3, out.point.data() + to);
  }

  const render::Picture& picture_;
  Kernels kernels_;
  int64_t reach_;
  Matrix xyz_ = to_xyz(), rgb_ = from_xyz();
  std::array<float, 256> linear_ = linear_of_bytes();
};

}  // namespace

Seen seen(const render::Picture& picture) {
  check_colours("flip", picture);
  Seen out{picture.width, picture.height, {}, {}, {}, {}, {}};
  const size_t pixels = picture.rgba.size() / 4;
  for (auto* plane : {&out.lightness, &out.a, &out.b, &out.edge, &out.point}) plane->resize(pixels);
  const Eye eye(picture);
  parallel_for(picture.height, kBand, [&](int64_t first, int64_t end) { eye.look(first, end, out); });
  return out;
}

double flip(const Seen& found, const Seen& wanted) {
  if (found.width != wanted.width || found.height != wanted.height)
    throw InvalidInput("flip: pictures of two sizes do not compare");
  const float largest = largest_difference(), knee = kKnee * largest;
  const int64_t width = found.width;
  std::vector<double> sums(static_cast<size_t>(found.height));
  const auto error = [&](size_t i) {
    const float da = found.a[i] - wanted.a[i], db = found.b[i] - wanted.b[i];
    const float distance = std::fabs(found.lightness[i] - wanted.lightness[i]) + std::sqrt(da * da + db * db);
    const float feature =
        std::max(std::fabs(found.edge[i] - wanted.edge[i]), std::fabs(found.point[i] - wanted.point[i]));
    if (distance == 0.0f && feature == 0.0f) return 0.0f;
    const float power = std::pow(distance, kColourPower);
    const float colour = power < knee ? power * (kAtKnee / knee)
                                      : kAtKnee + (power - knee) / (largest - knee) * (1.0f - kAtKnee);
    return std::pow(colour, 1.0f - std::sqrt(feature * (1.0f / std::numbers::sqrt2_v<float>)));
  };
  parallel_for(found.height, 16, [&](int64_t first, int64_t end) {
    for (int64_t row = first; row < end; ++row) {
      double sum = 0.0;
      for (int64_t i = 0; i < width; ++i)
        sum += static_cast<double>(error(static_cast<size_t>(row * width + i)));
      sums[static_cast<size_t>(row)] = sum;
    }
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0) / static_cast<double>(width * found.height);
}

}  // namespace lodlab::instrument
