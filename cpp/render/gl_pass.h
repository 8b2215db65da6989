// SPDX-License-Identifier: MIT
// The passes behind render/frame.h: drawing into the bound target, and capture by transform feedback.
#pragma once

#include "gl/buffer.h"
#include "gl/query.h"
#include "render/frame.h"
#include "render/surface.h"
#include "render/variant.h"

namespace lodlab::render {

/// Draws with the rasterizer's state as it stands.
class DrawPass : public Pass {
 public:
  /// `show` is a value of LODLAB_SHOW.
  DrawPass(const Camera& camera, int show, bool everything);
  unsigned use(SurfaceProgram& program, const Surface& field, Maps maps) override;
  /// Adds what only the GPU knew; call when all is done.
  void tell() {
    for (const Tell& one : tells_) one(submitted);
  }

 protected:
  /// Binds program, camera block and field for this variant.
  unsigned bind(SurfaceProgram& program, const Surface& field, Maps maps, bool feedback);

 private:
  int show_;
  gl::Buffer block_;
};

/// Captures what each use() draws, a segment at a time: a segment ends at the next use() or at finish().
class CapturePass : public DrawPass {
 public:
  CapturePass(const Camera& camera, bool everything, const gl::Buffer& buffer);
  ~CapturePass() override;  ///< stops a capture that an exception left running
  unsigned use(SurfaceProgram& program, const Surface& field, Maps maps) override;
  int64_t batch_triangles() const override { return kBatch; }

  /// Ends the last segment. Bytes that the largest segment needs: more than the buffer's means that
  /// triangles were lost.
  int64_t finish();
  std::vector<CapturedVertex>& vertices() { return vertices_; }

 private:
  static constexpr int64_t kBatch = int64_t{1} << 21;

  const gl::Buffer& buffer_;
  gl::Query generated_;
  bool running_ = false;
  int64_t needed_ = 0;
  std::vector<CapturedVertex> vertices_;
};

}  // namespace lodlab::render
