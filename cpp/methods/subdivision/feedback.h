// SPDX-License-Identifier: MIT
// The paper's pipeline: a geometry shader bisects triangles, transform feedback takes them from one buffer to
// the other, and those that are fine leave as indices.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "gl/buffer.h"
#include "gl/framebuffer.h"
#include "gl/program.h"
#include "gl/query.h"
#include "gl/vertex_array.h"

namespace lodlab::subdivision {

class Feedback {
 public:
  /// At most so many triangles are there at a time.
  Feedback(const std::vector<std::string>& defines, int64_t most_triangles);

  struct Result {
    int64_t triangles, tested;
  };
  /// Bisects `faces` control faces as the frame's state, which is bound, says. Indices go to the start of
  /// `indices`, which grows; more than `most` triangles: it ends before all are there.
  Result run(int64_t faces, int64_t most, gl::Buffer& indices);
  int64_t bytes() const { return pass_[0].bytes() + pass_[1].bytes(); }

 private:
  int64_t most_triangles_;
  gl::Program roots_, halves_;
  gl::Buffer pass_[2];
  gl::Query to_go_, fine_;
  gl::VertexArray none_, points_;
  gl::Framebuffer target_;
};

}  // namespace lodlab::subdivision
