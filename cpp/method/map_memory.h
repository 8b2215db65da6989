// SPDX-License-Identifier: MIT
// The tiles of the maps in GPU memory: of each map layers of an array texture, where residency puts them, and
// a row of instanced data for each patch that a frame draws. The texture grows by four as tiles come, to as
// many layers as residency may use; the room that both take while one is copied to the other is set aside
// (map_pools). The only files of this room that call GL.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "gl/buffer.h"
#include "gl/texture.h"
#include "gl/vertex_array.h"
#include "method/map_paging.h"
#include "render/pass.h"

namespace lodlab {

/// Instanced data of a patch, for one map: attribute kColorLocation or kNormalLocation of a vertex shader.
struct MapRow {
  MapPlace place;
  float layer;
};
enum MapLocation : unsigned { kColorLocation = 3, kNormalLocation = 4 };

class MapTexture {
 public:
  /// `map` is the number of a map of the paging. Instanced data come from slots of the vertex
  /// array that begin with the third.
  MapTexture(MapPaging& paging, size_t map, gl::VertexArray& arrays);

  MapKind kind() const { return map().kind; }
  /// The tile that is locked while streaming: before anything is drawn.
  void bring_root(render::Submitted& submitted);
  /// The row of a patch. While streaming it is that of the finest resident tile; else the tile is read and
  /// brought if need be: nothing, when this frame uses all the memory that there is.
  std::optional<MapRow> row(const MapPatch& patch, render::Submitted& submitted);
  /// Brings a tile that was asked for and is in main memory, where its worth makes room.
  void admit(const Residency::Want& want, render::Submitted& submitted);

  void begin() { rows_.clear(); }
  void add(const MapRow& row) { rows_.push_back(row); }
  /// Brings the instanced data to the GPU.
  void upload(gl::VertexArray& arrays, render::Submitted& submitted);
  void bind() const;
  int64_t bytes() const;

 private:
  const Map& map() const { return paging_.maps().all()[map_]; }
  void grow(int64_t layers);
  bool bring(uint32_t unit, bool wait, render::Submitted& submitted, double worth = 0.0);

  MapPaging& paging_;
  size_t map_;
  unsigned slot_;
  int64_t layers_ = 0;
  gl::Texture texture_;
  gl::Buffer instances_;
  std::vector<MapRow> rows_;
  std::vector<uint32_t> dropped_;
};

/// All maps of a store; none, and nothing of this does anything.
class MapMemory {
 public:
  using Rows = std::array<MapRow, kMostMaps>;

  /// Brings what is locked while streaming.
  MapMemory(MapPaging& paging, gl::VertexArray& arrays, render::Submitted& submitted);

  /// Nothing when this frame uses all the memory that there is.
  std::optional<Rows> rows(const MapPatch& patch, render::Submitted& submitted);
  /// What arrived meanwhile becomes resident for the next frame, as long as this frame uploads no more than
  /// this.
  void admit_wanted(int64_t most_bytes, render::Submitted& submitted);

  void begin();
  void add(const Rows& rows);
  void upload(gl::VertexArray& arrays, render::Submitted& submitted);
  render::Maps shown() const;
  void bind() const;
  int64_t bytes() const;

 private:
  MapPaging& paging_;
  std::vector<MapTexture> maps_;
};

}  // namespace lodlab
