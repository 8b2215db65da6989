// SPDX-License-Identifier: MIT
#include "method/map_memory.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>

#include "gl/error.h"
#include "method/indirect.h"

namespace lodlab {
namespace {

constexpr unsigned kFirstSlot = 2;  // of a vertex array: those below are the method's
constexpr int64_t kFewestLayers = 8;

}  // namespace

MapTexture::MapTexture(MapPaging& paging, size_t map, gl::VertexArray& arrays)
    : paging_(paging), map_(map), slot_(kFirstSlot + static_cast<unsigned>(map)), instances_(sizeof(MapRow)) {
  arrays.floats(kind() == kColors ? kColorLocation : kNormalLocation, slot_, 4, GL_FLOAT, 0);
  glVertexArrayBindingDivisor(arrays.id(), slot_, 1);
  gl::check("glVertexArrayBindingDivisor");
}

std::optional<MapRow> MapTexture::row(const MapPatch& patch, render::Submitted& submitted) {
  if (patch.tile[map_] < 0) return MapRow{};
  Residency& pool = paging_.residency(map_);
  uint32_t unit = paging_.unit(map_, patch.tile[map_]);
  if (!paging_.streams()) {
    if (!bring(unit, true, submitted)) return std::nullopt;
  } else {
    while (pool.offset(unit) < 0) unit = paging_.parent(map_, unit);
  }
  const MapPlace place = Maps::place(map(), paging_.tile(map_, unit), patch.row, patch.col);
  return MapRow{place, static_cast<float>(pool.offset(unit) / map().tiles.bytes())};
}

/// To the fewest layers of the largest texture's fourth, its fourth, ... that are at least as many.
void MapTexture::grow(int64_t layers) {
  int64_t count = paging_.residency(map_).capacity() / map().tiles.bytes();
  while ((count + 3) / 4 >= std::max(layers, kFewestLayers)) count = (count + 3) / 4;
  const auto side = static_cast<int>(map().tiles.pitch());
  gl::Texture larger = gl::Texture::array(GL_RGBA8, side, side, static_cast<int>(count), MapTiles::kMips);
  // The GPU would go down to one texel a pixel whatever the tile has.
  glTextureParameterf(larger.id(), GL_TEXTURE_LOD_BIAS,
                      static_cast<float>(-std::log2(paging_.texels_per_pixel())));
  for (int mip = 0; mip < MapTiles::kMips && layers_ > 0; ++mip) {
    glCopyImageSubData(texture_.id(), GL_TEXTURE_2D_ARRAY, mip, 0, 0, 0, larger.id(), GL_TEXTURE_2D_ARRAY,
                       mip, 0, 0, 0, side >> mip, side >> mip, static_cast<GLsizei>(layers_));
  }
  gl::check("glCopyImageSubData");
  texture_ = std::move(larger);
  layers_ = count;
}

void MapTexture::admit(const Residency::Want& want, render::Submitted& submitted) {
  const uint32_t parent = paging_.parent(map_, want.unit);
  if (paging_.residency(map_).offset(parent) < 0) return;
  bring(want.unit, false, submitted, want.priority);
}

void MapTexture::bring_root(render::Submitted& submitted) { bring(MapPaging::kRoot, true, submitted); }

bool MapTexture::bring(uint32_t unit, bool wait, render::Submitted& submitted, double worth) {
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

void MapTexture::upload(gl::VertexArray& arrays, render::Submitted& submitted) {
  send(instances_, as_bytes(rows_), submitted);
  arrays.source(slot_, instances_, 0, sizeof(MapRow));
}

void MapTexture::bind() const { texture_.bind(kind() == kColors ? render::kColorUnit : render::kNormalUnit); }

int64_t MapTexture::bytes() const { return instances_.bytes() + layers_ * map().tiles.bytes(); }

MapMemory::MapMemory(MapPaging& paging, gl::VertexArray& arrays, render::Submitted& submitted)
    : paging_(paging) {
  maps_.reserve(paging.count());
  for (size_t i = 0; i < paging.count(); ++i) {
    maps_.emplace_back(paging, i, arrays);
    if (paging.streams()) maps_.back().bring_root(submitted);
  }
}

std::optional<MapMemory::Rows> MapMemory::rows(const MapPatch& patch, render::Submitted& submitted) {
  Rows out{};
  for (size_t i = 0; i < maps_.size(); ++i) {
    const auto row = maps_[i].row(patch, submitted);
    if (!row) return std::nullopt;
    out[i] = *row;
  }
  return out;
}

void MapMemory::admit_wanted(int64_t most_bytes, render::Submitted& submitted) {
  for (size_t i = 0; i < maps_.size(); ++i) {
    for (const Residency::Want& want : paging_.residency(i).wanted()) {
      if (submitted.upload_bytes + paging_.maps().all()[i].tiles.bytes() > most_bytes) return;
      maps_[i].admit(want, submitted);
    }
  }
}

void MapMemory::begin() {
  for (MapTexture& map : maps_) map.begin();
}

void MapMemory::add(const Rows& rows) {
  for (size_t i = 0; i < maps_.size(); ++i) maps_[i].add(rows[i]);
}

void MapMemory::upload(gl::VertexArray& arrays, render::Submitted& submitted) {
  for (MapTexture& map : maps_) map.upload(arrays, submitted);
}

render::Maps MapMemory::shown() const {
  render::Maps out;
  for (const MapTexture& map : maps_) (map.kind() == kColors ? out.colors : out.normals) = true;
  return out;
}

void MapMemory::bind() const {
  for (const MapTexture& map : maps_) map.bind();
}

int64_t MapMemory::bytes() const {
  int64_t sum = 0;
  for (const MapTexture& map : maps_) sum += map.bytes();
  return sum;
}

}  // namespace lodlab
