// SPDX-License-Identifier: MIT
// What all cuts of one source are drawn on: its kind, and what the shared shading needs to know of it; of a
// height field also its coverage mask and, for planets, tables of cosine and sine.
#pragma once

#include "geometry/bounds.h"
#include "geometry/height_field.h"
#include "gl/buffer.h"
#include "render/camera_block.h"
#include "render/pass.h"

namespace lodlab::render {

class Surface {
 public:
  Surface(const FieldFrame& frame, const Bytes& coverage);
  /// Of a mesh in this box.
  explicit Surface(const Box& mesh) : kind_(SurfaceKind::kMesh), box_(mesh) {}

  SurfaceKind kind() const { return kind_; }
  bool has_coverage() const { return static_cast<bool>(coverage_); }
  /// What those of a field take.
  static int64_t bytes_of(const FieldFrame& frame, bool has_coverage);
  int64_t bytes() const { return coverage_.bytes() + columns_.bytes() + rows_.bytes(); }
  CameraBlock block(const Camera& camera) const;
  /// Binds the storage buffers that its shaders read.
  void bind() const;

 private:
  SurfaceKind kind_;
  FieldFrame frame_;  ///< of a field
  Box box_;           ///< of a mesh
  gl::Buffer coverage_, columns_, rows_;
};

}  // namespace lodlab::render
