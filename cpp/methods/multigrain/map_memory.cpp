// SPDX-License-Identifier: MIT
#include "methods/multigrain/map_memory.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>

#include "gl/error.h"

namespace lodlab::multigrain {
namespace {

constexpr unsigned kFirstSlot = 2;
constexpr int64_t kFewestLayers = 8;

}  // namespace

MapMemory::MapMemory(MapPaging& paging, size_t map, double texels_per_pixel, gl::VertexArray& arrays)
    : paging_(paging),
      map_(map),
      slot_(kFirstSlot + static_cast<unsigned>(map)),
      texels_per_pixel_(texels_per_pixel),
      instances_(sizeof(Row)) {
  arrays.floats(kind() == kColors ? 3 : 4, slot_, 4, GL_FLOAT, 0);  // locations: grid.vert
  glVertexArrayBindingDivisor(arrays.id(), slot_, 1);
  gl::check("glVertexArrayBindingDivisor");
}

std::optional<MapMemory::Row> MapMemory::row(const Patch& patch, render::Submitted& submitted) {
  if (patch.tile[map_] < 0) return Row{};
  Residency& pool = paging_.residency(map_);
  uint32_t unit = paging_.unit(map_, patch.tile[map_]);
  if (!paging_.streams()) {
    if (!bring(unit, true, submitted)) return std::nullopt;
  } else {
    while (pool.offset(unit) < 0) unit = paging_.parent(map_, unit);
  }
  const MapPlace place = paging_.maps().place(map(), paging_.tile(map_, unit), patch.row, patch.col);
  return Row{place, static_cast<float>(pool.offset(unit) / map().tiles.bytes())};
}

/// To the fewest layers of the largest texture's fourth, its fourth, ... that are at least as many.
void MapMemory::grow(int64_t layers) {
  int64_t count = paging_.residency(map_).capacity() / map().tiles.bytes();
  while ((count + 3) / 4 >= std::max(layers, kFewestLayers)) count = (count + 3) / 4;
  const auto side = static_cast<int>(map().tiles.pitch());
  gl::Texture larger = gl::Texture::array(GL_RGBA8, side, side, static_cast<int>(count), MapTiles::kMips);
  // The GPU would go down to one texel a pixel whatever the tile has.
  glTextureParameterf(larger.id(), GL_TEXTURE_LOD_BIAS, static_cast<float>(-std::log2(texels_per_pixel_)));
  for (int mip = 0; mip < MapTiles::kMips && layers_ > 0; ++mip) {
    glCopyImageSubData(texture_.id(), GL_TEXTURE_2D_ARRAY, mip, 0, 0, 0, larger.id(), GL_TEXTURE_2D_ARRAY,
                       mip, 0, 0, 0, side >> mip, side >> mip, static_cast<GLsizei>(layers_));
  }
  gl::check("glCopyImageSubData");
  texture_ = std::move(larger);
  layers_ = count;
}

void MapMemory::admit(const Residency::Want& want, render::Submitted& submitted) {
  const uint32_t parent = paging_.parent(map_, want.unit);
  if (paging_.residency(map_).offset(parent) < 0) return;
  bring(want.unit, false, submitted, want.priority);
}

void MapMemory::bring_root(render::Submitted& submitted) { bring(MapPaging::kRoot, true, submitted); }

bool MapMemory::bring(uint32_t unit, bool wait, render::Submitted& submitted, double worth) {
  Residency& pool = paging_.residency(map_);
  if (wait) pool.touch(unit);
  if (pool.offset(unit) >= 0) return true;
  const auto upload = pool.admit(unit, wait, dropped_, worth);
  dropped_.clear();
  if (!upload) return false;
  const MapTiles::Tile tile = map().tiles.at(paging_.tile(map_, unit));
  const int64_t layer = upload->offset / map().tiles.bytes();
  if (layer >= layers_) grow(layer + 1);
  const std::byte* texels = upload->page->data();
  for (int mip = 0; mip < MapTiles::kMips; ++mip) {
    const int64_t cols = tile.cols >> mip, rows = tile.rows >> mip;
    texture_.upload_rgba(mip, static_cast<int>(layer), 0, 0, static_cast<int>(cols), static_cast<int>(rows),
                         texels);
    texels += 4 * cols * rows;
  }
  submitted.upload_bytes += static_cast<int64_t>(upload->page->size());
  return true;
}

void MapMemory::upload(gl::VertexArray& arrays, render::Submitted& submitted) {
  const std::span<const std::byte> bytes = as_bytes(rows_);
  const auto needed = static_cast<int64_t>(bytes.size());
  if (needed > instances_.bytes()) instances_ = gl::Buffer(std::max(needed, 2 * instances_.bytes()));
  instances_.upload(0, bytes);
  submitted.upload_bytes += needed;
  arrays.source(slot_, instances_, 0, sizeof(Row));
}

void MapMemory::bind() const { texture_.bind(kind() == kColors ? render::kColorUnit : render::kNormalUnit); }

int64_t MapMemory::bytes() const { return instances_.bytes() + layers_ * map().tiles.bytes(); }

}  // namespace lodlab::multigrain
