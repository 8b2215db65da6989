// SPDX-License-Identifier: MIT
#include "render/replay.h"

#include <epoxy/gl.h>

#include <bit>
#include <cstring>
#include <limits>

#include "base/errors.h"
#include "gl/error.h"

namespace lodlab::render {
namespace {

struct Position {
  float x, y, z;
};
struct Grid {
  float col, row;
};
struct Tag {
  uint32_t node, bits;
};

/// One for the process; lives as long as the context, which is never destroyed.
SurfaceProgram& replay_program() {
  static auto* program = new SurfaceProgram({{"vertex", "common/replay.vert"}});
  return *program;
}

struct Shared {
  std::vector<uint32_t> indices, first_use;
};

/// Indices by which vertices that are equal to the last byte, and come again soon, are shaded once: emitted
/// triangles name each vertex about six times. A table of the latest vertices by their hash, one a place.
Shared share(const std::vector<CapturedVertex>& vertices) {
  constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
  constexpr int kPlacesLog2 = 14;
  std::vector<uint32_t> latest(size_t{1} << kPlacesLog2, kNone);
  Shared out;
  out.indices.reserve(vertices.size());
  for (size_t i = 0; i < vertices.size(); ++i) {
    const CapturedVertex& v = vertices[i];
    uint32_t hash = std::bit_cast<uint32_t>(v.x) * 0x9e3779b1u;
    hash = (std::rotl(hash, 13) ^ std::bit_cast<uint32_t>(v.y)) * 0x85ebca77u;
    uint32_t& place = latest[hash >> (32 - kPlacesLog2)];
    if (place == kNone || std::memcmp(&vertices[out.first_use[place]], &v, sizeof v) != 0) {
      place = static_cast<uint32_t>(out.first_use.size());
      out.first_use.push_back(static_cast<uint32_t>(i));
    }
    out.indices.push_back(place);
  }
  return out;
}

}  // namespace

template <class Order>
void StaticMesh::fill(const std::vector<CapturedVertex>& vertices, size_t count, const Order& order) {
  std::vector<Position> positions(count);
  std::vector<Grid> grids(count);
  std::vector<Tag> tags(count);
  for (size_t i = 0; i < count; ++i) {
    const CapturedVertex& v = vertices[order(i)];
    positions[i] = {v.x, v.y, v.z};
    grids[i] = {v.col, v.row};
    tags[i] = {v.node, v.bits};
  }
  positions_ = gl::Buffer(positions);
  grids_ = gl::Buffer(grids);
  tags_ = gl::Buffer(tags);
  array_.floats(0, 0, 3, GL_FLOAT, 0);
  array_.floats(1, 1, 2, GL_FLOAT, 0);
  array_.integers(2, 2, 1, GL_UNSIGNED_INT, 0);
  array_.integers(3, 2, 1, GL_UNSIGNED_INT, 4);
  array_.source(0, positions_, 0, sizeof(Position));
  array_.source(1, grids_, 0, sizeof(Grid));
  array_.source(2, tags_, 0, sizeof(Tag));
  vertices_ = static_cast<int64_t>(count);
}

StaticMesh::StaticMesh(const std::vector<CapturedVertex>& vertices) {
  const Shared shared = share(vertices);
  fill(vertices, shared.first_use.size(), [&](size_t i) { return shared.first_use[i]; });
  put_indices(shared.indices);
}

void StaticMesh::put_indices(const std::vector<uint32_t>& indices) {
  indices_ = gl::Buffer(indices);
  array_.indices(indices_);
  corners_ = static_cast<int64_t>(indices.size());
}

StaticMesh::StaticMesh(const std::vector<CapturedVertex>& vertices, const std::vector<uint32_t>& indices,
                       const std::vector<uint32_t>& first_use) {
  for (const uint32_t index : indices) {
    if (index >= first_use.size())
      throw InvalidInput("static mesh: index " + std::to_string(index) + " of " +
                         std::to_string(first_use.size()) + " vertices");
  }
  for (const uint32_t source : first_use) {
    if (source >= vertices.size())
      throw InvalidInput("static mesh: vertex " + std::to_string(source) + " of " +
                         std::to_string(vertices.size()) + " captured");
  }
  fill(vertices, first_use.size(), [&](size_t i) { return first_use[i]; });
  put_indices(indices);
}

void StaticMesh::draw(Pass& pass, const Surface& field) {
  if (corners_ > std::numeric_limits<GLsizei>::max() / 3 * 3) {
    throw Unsupported("drawing " + std::to_string(corners_ / 3) + " triangles with one call");
  }
  pass.use(replay_program(), field, {});
  array_.bind();
  glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(corners_), GL_UNSIGNED_INT, nullptr);
  gl::check("glDrawElements");
  pass.submitted.triangles += corners_ / 3;
  pass.submitted.vertices += vertices_;
  pass.submitted.draw_calls += 1;
}

}  // namespace lodlab::render
