// SPDX-License-Identifier: MIT
#include "methods/chunked/texture.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/errors.h"

namespace lodlab::chunked {
namespace {

constexpr int32_t kLargestSide = 4096;

/// Means of 2 x 2 texels; an odd last row or column is repeated.
ImageU8 half(const ImageU8& image) {
  ImageU8 out;
  out.width = (image.width + 1) / 2;
  out.height = (image.height + 1) / 2;
  out.channels = 4;
  out.samples.resize(static_cast<size_t>(out.width) * out.height * 4);
  for (int y = 0; y < out.height; ++y) {
    const int y0 = 2 * y, y1 = std::min(y0 + 1, image.height - 1);
    for (int x = 0; x < out.width; ++x) {
      const int x0 = 2 * x, x1 = std::min(x0 + 1, image.width - 1);
      for (int c = 0; c < 4; ++c) {
        const auto at = [&](int i, int j) {
          return int{image.samples[(static_cast<size_t>(j) * image.width + i) * 4 + c]};
        };
        out.samples[(static_cast<size_t>(y) * out.width + x) * 4 + c] =
            static_cast<uint8_t>((at(x0, y0) + at(x1, y0) + at(x0, y1) + at(x1, y1) + 2) / 4);
      }
    }
  }
  return out;
}

}  // namespace

TexturePyramid::TexturePyramid(const std::string& file, const HeightField& field, const Layout& layout,
                               const Levels& levels, double tau_max)
    : layout_(&layout) {
  if (file.empty()) return;
  mips_.push_back(read_rgba8(file));
  while (std::max(mips_.back().width, mips_.back().height) > 1) mips_.push_back(half(mips_.back()));
  texels_x_ = static_cast<double>(mips_[0].width) / static_cast<double>(field.cols);
  texels_y_ = static_cast<double>(mips_[0].height) / static_cast<double>(field.rows);
  const double finest = std::max(texels_x_, texels_y_);  // texels per sample
  const double spacing = std::max(field.dx, field.dy);
  for (int level = 0; level < layout.levels; ++level) {
    const double geometric = levels.delta[static_cast<size_t>(level)] / tau_max;  // T_g, equation 7
    const double wanted = geometric > 0.0 ? std::min(finest, spacing / geometric) : finest;
    const double texels = std::max(1.0, std::ceil(wanted * layout.side(level)));
    if (texels > kLargestSide) {
      throw InvalidInput("chunked: attribute " + file + ": a chunk of level " + std::to_string(level) +
                         " needs " + std::to_string(static_cast<int64_t>(texels)) +
                         " texels a side, more than " + std::to_string(kLargestSide) +
                         "; take a smaller tau_max");
    }
    sides_.push_back(static_cast<int32_t>(std::bit_ceil(static_cast<uint32_t>(texels))));
  }
}

/// Bilinear at (u, v) in texels of the full raster, centres at whole numbers, from one level of the pyramid.
void TexturePyramid::sample(double u, double v, int mip, uint8_t* rgba) const {
  const ImageU8& image = mips_[static_cast<size_t>(mip)];
  const double scale = std::ldexp(1.0, -mip);
  const double x = std::clamp((u + 0.5) * scale - 0.5, 0.0, image.width - 1.0);
  const double y = std::clamp((v + 0.5) * scale - 0.5, 0.0, image.height - 1.0);
  const int x0 = static_cast<int>(x), y0 = static_cast<int>(y);
  const int x1 = std::min(x0 + 1, image.width - 1), y1 = std::min(y0 + 1, image.height - 1);
  const double fx = x - x0, fy = y - y0;
  for (int c = 0; c < 4; ++c) {
    const auto at = [&](int i, int j) {
      return double{image.samples[(static_cast<size_t>(j) * image.width + i) * 4 + c] * 1.0};
    };
    const double value =
        (1 - fy) * ((1 - fx) * at(x0, y0) + fx * at(x1, y0)) + fy * ((1 - fx) * at(x0, y1) + fx * at(x1, y1));
    rgba[c] = static_cast<uint8_t>(std::lround(value));
  }
}

Bytes TexturePyramid::page(int level, int32_t row, int32_t col) const {
  const int32_t side = sides_[static_cast<size_t>(level)];
  const double step = static_cast<double>(layout_->side(level)) / side;  // samples per texel
  const double raster_step = std::max(1.0, step * std::max(texels_x_, texels_y_));
  const int mip = std::min(static_cast<int>(std::log2(raster_step)), static_cast<int>(mips_.size()) - 1);
  std::vector<uint8_t> texels(static_cast<size_t>(side + 1) * (side + 1) * 4);
  for (int32_t y = 0; y <= side; ++y) {
    const double v = (row + y * step + 0.5) * texels_y_ - 0.5;
    for (int32_t x = 0; x <= side; ++x) {
      sample((col + x * step + 0.5) * texels_x_ - 0.5, v, mip,
             &texels[(static_cast<size_t>(y) * (side + 1) + x) * 4]);
    }
  }
  const size_t count = texels.size() / 4;
  Bytes out(meshopt_encodeVertexBufferBound(count, 4));
  out.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(out.data()), out.size(),
                                        texels.data(), count, 4));
  return out;
}

Bytes decode_texture(const Bytes& stored, int32_t side) {
  const size_t count = static_cast<size_t>(side + 1) * (side + 1);
  Bytes out(count * 4);
  if (meshopt_decodeVertexBuffer(out.data(), count, 4, reinterpret_cast<const unsigned char*>(stored.data()),
                                 stored.size()) != 0) {
    throw StoreError("chunked: a texture page does not decode");
  }
  return out;
}

}  // namespace lodlab::chunked
