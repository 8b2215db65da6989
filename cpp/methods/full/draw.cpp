// SPDX-License-Identifier: MIT
// The whole field in one static vertex buffer, drawn with one call. Triangles run down strips of columns, so
// that the row above is still in the vertex cache, and vertices are numbered in the order of first use.
#include <epoxy/gl.h>

#include <limits>

#include "base/errors.h"
#include "base/parallel.h"
#include "gl/error.h"
#include "gl/texture.h"
#include "gl/vertex_array.h"
#include "methods/full/full.h"

namespace lodlab::full {
namespace {

constexpr int64_t kStrip = 16;  // cells across a strip

template <class Index>
struct Vertex {
  Index col, row;
  float height;
};

/// Where vertices lie in the buffer: strip by strip, each row by row. The first strip owns its left edge.
struct Numbering {
  int64_t rows, columns;

  int64_t first_column(int64_t strip) const { return strip == 0 ? 0 : strip * kStrip + 1; }
  int64_t strips() const { return (columns - 2) / kStrip + 1; }
  int64_t end_column(int64_t strip) const { return std::min(columns, (strip + 1) * kStrip + 1); }
  uint32_t operator()(int64_t row, int64_t col) const {
    const int64_t strip = col == 0 ? 0 : (col - 1) / kStrip;
    const int64_t first = first_column(strip), width = end_column(strip) - first;
    return static_cast<uint32_t>(rows * first + row * width + (col - first));
  }
};

template <class Index>
gl::Buffer make_vertices(const FieldFrame& frame, const std::vector<float>& heights,
                         const Numbering& number) {
  std::vector<Vertex<Index>> vertices(static_cast<size_t>(number.rows * number.columns));
  parallel_for(frame.rows, 64, [&](int64_t begin, int64_t end) {
    for (int64_t row = begin; row < end; ++row) {
      for (int64_t col = 0; col < number.columns; ++col) {
        const int64_t sample = is_pole(frame, row) ? 0 : col % frame.cols;  // a pole is one point
        vertices[number(row, col)] = {static_cast<Index>(col), static_cast<Index>(row),
                                      heights[static_cast<size_t>(row * frame.cols + sample)]};
      }
    }
  });
  return gl::Buffer(vertices);
}

/// Appends the triangles of a cell, cut as height_field.h says, counter-clockwise seen from above; beside a
/// pole, where two corners are one point, only the triangle that has an area.
uint32_t* add_cell(uint32_t* out, const Numbering& number, int64_t row, int64_t col, bool above, bool below) {
  const uint32_t nw = number(row, col), ne = number(row, col + 1);
  const uint32_t sw = number(row + 1, col), se = number(row + 1, col + 1);
  const auto add = [&out](uint32_t a, uint32_t b, uint32_t c) {
    *out++ = a;
    *out++ = b;
    *out++ = c;
  };
  if ((row + col) % 2 == 0) {
    if (!below) add(nw, sw, se);
    if (!above) add(nw, se, ne);
  } else {
    if (!above) add(nw, sw, ne);
    if (!below) add(ne, sw, se);
  }
  return out;
}

std::vector<uint32_t> make_indices(const FieldFrame& frame, const Numbering& number, int64_t triangles) {
  std::vector<uint32_t> indices(static_cast<size_t>(3 * triangles));
  uint32_t* out = indices.data();
  for (int64_t strip = 0; strip < number.strips(); ++strip) {
    const int64_t end = std::min(number.columns - 1, (strip + 1) * kStrip);
    for (int64_t row = 0; row + 1 < frame.rows; ++row) {
      const bool above = is_pole(frame, row), below = is_pole(frame, row + 1);
      for (int64_t col = strip * kStrip; col < end; ++col)
        out = add_cell(out, number, row, col, above, below);
    }
  }
  return indices;
}

/// A texture with all its mip levels, its bytes counted; none without pixels.
gl::Texture make_map(const char* what, const FullHierarchy::Raster& raster, bool wraps, int64_t& bytes) {
  if (raster.pixels.empty()) return {};
  const int limit = gl::ensure_context().max_texture, side = std::max(raster.width, raster.height);
  if (side > limit) {
    throw Unsupported(std::string("full: ") + what + " of " + std::to_string(raster.width) + " x " +
                      std::to_string(raster.height) + " pixels is above this device's limit of " +
                      std::to_string(limit));
  }
  int levels = 1;
  while (side >> levels != 0) ++levels;
  gl::Texture map = gl::Texture::array(GL_RGBA8, raster.width, raster.height, 1, levels);
  map.upload_rgba(0, 0, 0, 0, raster.width, raster.height, raster.pixels.data());
  map.make_mips();
  if (wraps) glTextureParameteri(map.id(), GL_TEXTURE_WRAP_S, GL_REPEAT);
  bytes += static_cast<int64_t>(raster.pixels.size()) * 4 * 4 / 3;
  return map;
}

}  // namespace

struct FullSession::Gpu {
  explicit Gpu(const FullHierarchy& hierarchy);

  render::SurfaceProgram program{{"vertex", "full/full.vert"}};
  std::shared_ptr<const render::Surface> field;
  gl::Buffer vertices, indices;
  gl::VertexArray array;
  gl::Texture colors, normals;
  int64_t bytes = 0;
  bool uploaded_now = true;  ///< the next draw reports the upload
};

FullSession::Gpu::Gpu(const FullHierarchy& hierarchy) {
  const FieldFrame& frame = hierarchy.frame();
  const Numbering number{frame.rows, vertex_columns(frame)};
  if (hierarchy.triangles() > std::numeric_limits<GLsizei>::max() / 3) {
    throw Unsupported("full: " + std::to_string(hierarchy.triangles()) +
                      " triangles are more than one draw call takes");
  }
  const Bytes coverage = hierarchy.coverage();
  field = render::make_surface(frame, coverage);
  const bool small = number.columns <= 65536 && number.rows <= 65536;
  const std::vector<float> heights = hierarchy.heights();
  vertices = small ? make_vertices<uint16_t>(frame, heights, number)
                   : make_vertices<uint32_t>(frame, heights, number);
  indices = gl::Buffer(make_indices(frame, number, hierarchy.triangles()));
  array.integers(0, 0, 2, small ? GL_UNSIGNED_SHORT : GL_UNSIGNED_INT, 0);
  array.floats(1, 0, 1, GL_FLOAT, small ? 4 : 8);
  array.source(0, vertices, 0, small ? 8 : 12);
  array.indices(indices);
  bytes = vertices.bytes() + indices.bytes() + static_cast<int64_t>(coverage.size());
  if (frame.planet) bytes += static_cast<int64_t>(sizeof(glm::dvec2)) * (frame.rows + frame.cols + 1);
  colors = make_map("a colour raster", hierarchy.colors(), frame.wraps, bytes);
  normals = make_map("a map of normals", hierarchy.normals(), frame.wraps, bytes);
}

FullSession::FullSession(std::shared_ptr<const FullHierarchy> hierarchy)
    : OneNodeSession(hierarchy->triangles()), hierarchy_(std::move(hierarchy)) {}

FullSession::~FullSession() = default;

void FullSession::draw(const Cut& cut, render::Pass& pass) {
  if (!gpu_) gpu_ = std::make_unique<Gpu>(*hierarchy_);
  if (cut.claim->nodes.empty()) return;
  const FieldFrame& frame = hierarchy_->frame();
  const int64_t total = hierarchy_->triangles();
  int64_t drawn = 0;
  while (drawn < total) {
    const int64_t count = std::min(total - drawn, pass.batch_triangles());
    const render::Maps maps{static_cast<bool>(gpu_->colors), static_cast<bool>(gpu_->normals)};
    const unsigned program = pass.use(gpu_->program, *gpu_->field, maps);
    if (maps.colors) gpu_->colors.bind(render::kColorUnit);
    if (maps.normals) gpu_->normals.bind(render::kNormalUnit);
    if (maps.colors || maps.normals) {
      const int samples = glGetUniformLocation(program, "samples");
      glProgramUniform2f(program, samples, static_cast<float>(frame.cols), static_cast<float>(frame.rows));
    }
    gpu_->array.bind();
    glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(3 * count), GL_UNSIGNED_INT,
                   reinterpret_cast<const void*>(3 * sizeof(uint32_t) * static_cast<size_t>(drawn)));
    gl::check("glDrawElements");
    pass.submitted.draw_calls += 1;
    drawn += count;
  }
  pass.submitted.triangles += total;
  pass.submitted.vertices += frame.rows * vertex_columns(frame);
  pass.submitted.nodes += 1;
  if (gpu_->uploaded_now) pass.submitted.upload_bytes += gpu_->bytes;
  gpu_->uploaded_now = false;
}

int64_t FullSession::resident_bytes() const { return gpu_ ? gpu_->bytes : 0; }

}  // namespace lodlab::full
