// SPDX-License-Identifier: MIT
#include "method/mesh_memory.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <limits>

#include "base/errors.h"
#include "gl/error.h"
#include "method/indirect.h"
#include "render/surface.h"

namespace lodlab {
namespace {

bool has_low(const std::vector<StoredMesh>& meshes) {
  return std::any_of(meshes.begin(), meshes.end(), [](const StoredMesh& m) { return !m.low.empty(); });
}

/// An array of all meshes, one after the other; zeros where one has none.
template <class T>
std::vector<T> joined(const std::vector<StoredMesh>& meshes, std::vector<T> StoredMesh::*array) {
  std::vector<T> out;
  for (const StoredMesh& mesh : meshes) {
    const std::vector<T>& part = mesh.*array;
    out.insert(out.end(), part.begin(), part.end());
    if (part.empty()) out.resize(out.size() + mesh.high.size(), T(0));
  }
  return out;
}

}  // namespace

MeshMemory::MeshMemory(const std::vector<StoredMesh>& meshes)
    : program_({{"vertex", "common/mesh.vert"}},
               has_low(meshes) ? std::vector<std::string>{"MESH_LOW"} : std::vector<std::string>{}) {
  int64_t vertices = 0, indices = 0;
  for (const StoredMesh& mesh : meshes) {
    places_.push_back(
        {static_cast<uint32_t>(indices), static_cast<int32_t>(vertices), mesh.vertices(), mesh.triangles()});
    vertices += mesh.vertices();
    indices += 3 * mesh.triangles();
    if (vertices > std::numeric_limits<int32_t>::max() || indices > std::numeric_limits<uint32_t>::max() ||
        3 * mesh.triangles() > std::numeric_limits<int32_t>::max()) {
      throw Unsupported("draw: " + std::to_string(vertices) + " vertices and " + std::to_string(indices) +
                        " indices are more than one buffer's 32-bit numbers tell apart");
    }
  }
  const auto input = [this](unsigned location, gl::Buffer& buffer, const auto& values, int count,
                            unsigned type) {
    buffer = gl::Buffer(values);
    array_.floats(location, location, count, type, 0);
    array_.source(location, buffer, 0, static_cast<int>(sizeof(values[0])));
  };
  input(0, high_, joined(meshes, &StoredMesh::high), 3, GL_FLOAT);
  if (has_low(meshes)) input(1, low_, joined(meshes, &StoredMesh::low), 3, GL_FLOAT);
  if (std::none_of(meshes.begin(), meshes.end(), [](const StoredMesh& m) { return m.colors.empty(); }))
    input(2, colors_, joined(meshes, &StoredMesh::colors), 4, GL_UNSIGNED_BYTE);
  std::vector<uint32_t> all;
  all.reserve(static_cast<size_t>(indices));
  for (const StoredMesh& mesh : meshes) all.insert(all.end(), mesh.indices.begin(), mesh.indices.end());
  indices_ = gl::Buffer(all);
  array_.indices(indices_);
  array_.integers(3, 3, 2, GL_UNSIGNED_INT, 0);
  glVertexArrayBindingDivisor(array_.id(), 3, 1);
  gl::check("glVertexArrayBindingDivisor");
}

int64_t MeshMemory::bytes() const {
  return high_.bytes() + low_.bytes() + colors_.bytes() + indices_.bytes() + tags_.bytes() +
         commands_.bytes();
}

void MeshMemory::draw(std::span<const Item> items, const render::Surface& surface, render::Pass& pass) {
  if (uploaded_now_) pass.submitted.upload_bytes += bytes();
  uploaded_now_ = false;
  const int64_t batch = std::max<int64_t>(pass.batch_triangles(), 1);
  int64_t room = batch;
  for (const Item& item : items) {
    const Place& place = places_[item.mesh];
    for (int64_t drawn = 0; drawn < place.triangles;) {
      const int64_t count = std::min(place.triangles - drawn, room);
      command_data_.push_back({static_cast<uint32_t>(3 * count), 1,
                               place.first_index + static_cast<uint32_t>(3 * drawn), place.base_vertex,
                               static_cast<uint32_t>(tag_data_.size())});
      tag_data_.push_back({item.node, item.level});
      drawn += count;
      room -= count;
      if (room > 0) continue;
      submit(surface, pass);
      room = batch;
    }
    pass.submitted.triangles += place.triangles;
    pass.submitted.vertices += place.vertices;
    pass.submitted.nodes += 1;
  }
  submit(surface, pass);
}

/// Draws what was added, and forgets it.
void MeshMemory::submit(const render::Surface& surface, render::Pass& pass) {
  if (command_data_.empty()) return;
  send(tags_, as_bytes(tag_data_), pass.submitted);
  send(commands_, as_bytes(command_data_), pass.submitted);
  array_.source(3, tags_, 0, sizeof(Tag));
  pass.use(program_, surface, {static_cast<bool>(colors_), false});
  array_.bind();
  gl::draw_indirect(commands_, 0, command_data_.size(), GL_UNSIGNED_INT);
  pass.submitted.draw_calls += 1;
  tag_data_.clear();
  command_data_.clear();
}

}  // namespace lodlab
