// SPDX-License-Identifier: MIT
// GL objects of one height field: its coverage mask and, for planets, tables of cosine and sine.
#pragma once

#include "geometry/height_field.h"
#include "gl/buffer.h"
#include "render/pass.h"

namespace lodlab::render {

class FieldResources {
 public:
  FieldResources(const FieldFrame& frame, const Bytes& coverage);

  const FieldFrame& frame() const { return frame_; }
  bool has_coverage() const { return static_cast<bool>(coverage_); }
  /// What such resources take.
  static int64_t bytes_of(const FieldFrame& frame, bool has_coverage);
  int64_t bytes() const { return coverage_.bytes() + columns_.bytes() + rows_.bytes(); }
  /// Binds the storage buffers that the shaders of this field read.
  void bind() const;

 private:
  FieldFrame frame_;
  gl::Buffer coverage_, columns_, rows_;
};

}  // namespace lodlab::render
