// SPDX-License-Identifier: MIT
// Tiles of colours in GPU memory: the layers of one array texture, and a row of instanced data for each patch
// that a frame draws. The array has as many layers as the largest frame so far needed at once; a tile that
// this frame does not need makes room for one that it does, the least recently used first.
#pragma once

#include <unordered_map>
#include <vector>

#include "gl/buffer.h"
#include "gl/texture.h"
#include "gl/vertex_array.h"
#include "methods/multigrain/colors.h"
#include "render/pass.h"

namespace lodlab::multigrain {

class ColorMemory {
 public:
  /// Instanced data come at this location, from this slot (grid.vert).
  enum : unsigned { kLocation = 3, kSlot = 2 };

  ColorMemory(const Forest& forest, double texels_per_pixel, gl::VertexArray& arrays);

  void begin_frame();
  /// The patches of a node: each takes a row of instanced data. Valid until the next call.
  const std::vector<Patch>& patches(uint32_t node, int stride_log2, const Camera& camera,
                                    render::Submitted& submitted);
  /// Brings the instanced data to the GPU.
  void upload(gl::VertexArray& arrays, render::Submitted& submitted);
  void bind() const { texture_.bind(0); }
  int64_t bytes() const;

 private:
  struct Layer {
    int64_t tile = -1;
    uint64_t used = 0;  ///< the frame
  };
  struct Row {
    float u, v, scale, layer;
  };

  /// The layer of a tile, brought if need be.
  size_t layer_of(int64_t tile, render::Submitted& submitted);
  size_t free_layer();
  void grow();
  void bring(int64_t tile, size_t layer, render::Submitted& submitted);

  Colors colors_;
  double texels_per_pixel_;
  uint64_t frame_ = 0;
  std::vector<Layer> layers_;
  std::unordered_map<int64_t, size_t> places_;
  gl::Texture texture_;
  gl::Buffer instances_;
  std::vector<Row> rows_;
  std::vector<Patch> patches_;
};

}  // namespace lodlab::multigrain
