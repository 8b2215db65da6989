// SPDX-License-Identifier: MIT
// The tiles of one map in GPU memory: layers of an array texture, where residency puts them, and a row of
// instanced data for each patch that a frame draws. The texture grows by four as tiles come, to as many
// layers as residency may use; the room that both take while one is copied to the other is set aside
// (slots_of).
#pragma once

#include <optional>
#include <vector>

#include "gl/buffer.h"
#include "gl/texture.h"
#include "gl/vertex_array.h"
#include "methods/multigrain/map_paging.h"
#include "render/pass.h"

namespace lodlab::multigrain {

class MapMemory {
 public:
  /// Of a patch (grid.vert).
  struct Row {
    MapPlace place;
    float layer;
  };

  /// `map` is the number of a map of the paging. Instanced data come from slot kSlot + map.
  MapMemory(MapPaging& paging, size_t map, double texels_per_pixel, gl::VertexArray& arrays);

  PageKind kind() const { return map().kind; }
  /// The tile that is locked while streaming: before anything is drawn.
  void bring_root(render::Submitted& submitted);
  /// The row of a patch. While streaming it is that of the finest resident tile; else the tile is read and
  /// brought if need be: nothing, when this frame uses all the memory that there is.
  std::optional<Row> row(const Patch& patch, render::Submitted& submitted);
  /// Brings a tile that was asked for and is in main memory, where its worth makes room.
  void admit(const Residency::Want& want, render::Submitted& submitted);

  void begin() { rows_.clear(); }
  void add(const Row& row) { rows_.push_back(row); }
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
  double texels_per_pixel_;
  int64_t layers_ = 0;
  gl::Texture texture_;
  gl::Buffer instances_;
  std::vector<Row> rows_;
  std::vector<uint32_t> dropped_;
};

}  // namespace lodlab::multigrain
