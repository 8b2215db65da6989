// SPDX-License-Identifier: MIT
#include "render/surface.h"

#include <epoxy/gl.h>

#include "base/errors.h"
#include "geometry/coverage.h"
#include "gl/error.h"

namespace lodlab::render {
namespace {

/// The mask in whole 32-bit words, as the shader reads it.
gl::Buffer mask_buffer(const FieldFrame& frame, const Bytes& coverage) {
  const int64_t cells = cell_columns(frame) * (frame.rows - 1);
  const int64_t needed = (cells + 7) / 8;
  if (static_cast<int64_t>(coverage.size()) != needed) {
    throw InvalidInput("coverage mask: " + std::to_string(coverage.size()) + " bytes; " +
                       std::to_string(cells) + " cells need " + std::to_string(needed));
  }
  Bytes words = coverage;
  words.resize((coverage.size() + 3) / 4 * 4);
  return gl::Buffer(words);
}

}  // namespace

Surface::Surface(const FieldFrame& frame, const Bytes& coverage)
    : kind_(frame.planet ? SurfaceKind::kPlanet : SurfaceKind::kFlat), frame_(frame) {
  gl::ensure_context();
  if (!coverage.empty()) coverage_ = mask_buffer(frame, coverage);
  if (!frame.planet) return;
  std::vector<glm::dvec2> columns, rows;  // column `cols` is column 0 again where the planet wraps
  for (int64_t col = 0; col <= frame.cols; ++col) columns.push_back(cos_sin_degrees(frame.longitude(col)));
  for (int64_t row = 0; row < frame.rows; ++row) rows.push_back(cos_sin_degrees(frame.latitude(row)));
  columns_ = gl::Buffer(columns);
  rows_ = gl::Buffer(rows);
}

int64_t Surface::bytes_of(const FieldFrame& frame, bool has_coverage) {
  const int64_t mask = has_coverage ? (cell_columns(frame) * (frame.rows - 1) + 31) / 32 * 4 : 0;
  return mask + (frame.planet ? 16 * (frame.rows + frame.cols + 1) : 0);
}

CameraBlock Surface::block(const Camera& camera) const {
  return kind_ == SurfaceKind::kMesh ? make_camera_block(camera, box_) : make_camera_block(camera, frame_);
}

void Surface::bind() const {
  if (has_coverage()) glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, coverage_.id());
  if (kind_ == SurfaceKind::kPlanet) {
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, columns_.id());
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 2, rows_.id());
  }
  gl::check("glBindBufferBase");
}

std::shared_ptr<const Surface> make_surface(const FieldFrame& frame, const Bytes& coverage) {
  return std::make_shared<const Surface>(frame, coverage);
}

std::shared_ptr<const Surface> make_surface(const Box& mesh) { return std::make_shared<const Surface>(mesh); }

}  // namespace lodlab::render
