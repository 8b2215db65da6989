// SPDX-License-Identifier: MIT
// The texture quadtree of a colour raster of the same extent (Ulrich 2002, section 13): one square texture
// a chunk, its texels no larger than the level's error / tau_max, and no smaller than the raster's own.
// Texels sit on the corners of their cells (side + 1 a row), so neighbours share the border's texels.
#pragma once

#include <string>
#include <vector>

#include "imageio/image.h"
#include "methods/chunked/mesh.h"
#include "store/store.h"

namespace lodlab::chunked {

class TexturePyramid {
 public:
  /// Reads the raster and its half-resolution levels; an empty file name makes an inactive pyramid.
  /// InvalidInput when the rule asks for textures beyond 4096 texels.
  TexturePyramid(const std::string& file, const HeightField& field, const Layout& layout,
                 const Levels& levels, double tau_max);

  bool active() const { return !mips_.empty(); }
  /// Cells of texels along a chunk of this level; a texture has one more each way.
  int32_t side(int level) const { return sides_[static_cast<size_t>(level)]; }
  /// RGBA8 texels of the chunk, compressed.
  Bytes page(int level, int32_t row, int32_t col) const;

 private:
  void sample(double u, double v, int mip, uint8_t* rgba) const;

  std::vector<ImageU8> mips_;
  std::vector<int32_t> sides_;
  const Layout* layout_ = nullptr;
  double texels_x_ = 1.0, texels_y_ = 1.0;  // raster texels per height sample
};

/// The texels of a stored texture of (side + 1)^2.
Bytes decode_texture(const Bytes& stored, int32_t side);

}  // namespace lodlab::chunked
