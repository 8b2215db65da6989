// SPDX-License-Identifier: MIT
#include "methods/multigrain/color_memory.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>

#include "base/errors.h"
#include "gl/error.h"

namespace lodlab::multigrain {
namespace {

constexpr size_t kFirstLayers = 8;

}  // namespace

ColorMemory::ColorMemory(const Forest& forest, double texels_per_pixel, gl::VertexArray& arrays)
    : colors_(forest), texels_per_pixel_(texels_per_pixel), instances_(sizeof(Row)) {
  arrays.floats(kLocation, kSlot, 4, GL_FLOAT, 0);
  glVertexArrayBindingDivisor(arrays.id(), kSlot, 1);
  gl::check("glVertexArrayBindingDivisor");
  grow();
}

void ColorMemory::begin_frame() {
  ++frame_;
  rows_.clear();
}

const std::vector<Patch>& ColorMemory::patches(uint32_t node, int stride_log2, const Camera& camera,
                                               render::Submitted& submitted) {
  patches_.clear();
  colors_.patches(node, stride_log2, camera, texels_per_pixel_, patches_);
  for (const Patch& patch : patches_) {
    const size_t layer = patch.tile < 0 ? 0 : layer_of(patch.tile, submitted);
    rows_.push_back({patch.u, patch.v, patch.scale, static_cast<float>(layer)});
  }
  return patches_;
}

size_t ColorMemory::layer_of(int64_t tile, render::Submitted& submitted) {
  const auto found = places_.find(tile);
  const size_t layer = found != places_.end() ? found->second : free_layer();
  layers_[layer].used = frame_;
  if (found == places_.end()) bring(tile, layer, submitted);
  return layer;
}

size_t ColorMemory::free_layer() {
  const auto oldest = [](const Layer& a, const Layer& b) { return a.used < b.used; };
  auto layer = std::min_element(layers_.begin(), layers_.end(), oldest);
  if (layer->used == frame_) {
    grow();
    layer = std::min_element(layers_.begin(), layers_.end(), oldest);
  }
  if (layer->tile >= 0) places_.erase(layer->tile);
  return static_cast<size_t>(layer - layers_.begin());
}

void ColorMemory::grow() {
  GLint limit = 0;
  glGetIntegerv(GL_MAX_ARRAY_TEXTURE_LAYERS, &limit);
  const size_t before = layers_.size();
  const size_t count = std::min(std::max(kFirstLayers, 2 * before), static_cast<size_t>(limit));
  if (count == before) {
    throw Unsupported("multigrain: a frame needs more than " + std::to_string(limit) +
                      " tiles of colours, this device's limit of layers; take fewer texels_per_pixel");
  }
  const auto side = static_cast<int>(colors_.tiles().pitch());
  gl::Texture larger = gl::Texture::array(GL_RGBA8, side, side, static_cast<int>(count), ColorTiles::kMips);
  // The GPU would go down to one texel a pixel whatever the tile has.
  glTextureParameterf(larger.id(), GL_TEXTURE_LOD_BIAS, static_cast<float>(-std::log2(texels_per_pixel_)));
  for (int mip = 0; mip < ColorTiles::kMips && before > 0; ++mip) {
    glCopyImageSubData(texture_.id(), GL_TEXTURE_2D_ARRAY, mip, 0, 0, 0, larger.id(), GL_TEXTURE_2D_ARRAY,
                       mip, 0, 0, 0, side >> mip, side >> mip, static_cast<GLsizei>(before));
  }
  gl::check("glCopyImageSubData");
  texture_ = std::move(larger);
  layers_.resize(count);
}

void ColorMemory::bring(int64_t tile, size_t layer, render::Submitted& submitted) {
  const ColorTiles::Tile shape = colors_.tiles().at(tile);
  std::vector<uint32_t> texels = colors_.tile(tile);
  for (int mip = 0; mip < ColorTiles::kMips; ++mip) {
    const int64_t cols = shape.cols >> mip, rows = shape.rows >> mip;
    if (mip > 0) texels = half_colors(texels, 2 * cols, 2 * rows);
    texture_.upload_rgba(mip, static_cast<int>(layer), 0, 0, static_cast<int>(cols), static_cast<int>(rows),
                         texels.data());
    submitted.upload_bytes += static_cast<int64_t>(as_bytes(texels).size());
  }
  layers_[layer].tile = tile;
  places_[tile] = layer;
}

void ColorMemory::upload(gl::VertexArray& arrays, render::Submitted& submitted) {
  const std::span<const std::byte> bytes = as_bytes(rows_);
  const auto needed = static_cast<int64_t>(bytes.size());
  if (needed > instances_.bytes()) instances_ = gl::Buffer(std::max(needed, 2 * instances_.bytes()));
  instances_.upload(0, bytes);
  submitted.upload_bytes += needed;
  arrays.source(kSlot, instances_, 0, sizeof(Row));
}

int64_t ColorMemory::bytes() const {
  const int64_t side = colors_.tiles().pitch();
  int64_t texels = 0;
  for (int mip = 0; mip < ColorTiles::kMips; ++mip) texels += (side >> mip) * (side >> mip);
  return instances_.bytes() + 4 * texels * static_cast<int64_t>(layers_.size());
}

}  // namespace lodlab::multigrain
