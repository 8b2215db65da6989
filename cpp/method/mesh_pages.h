// SPDX-License-Identifier: MIT
// A mesh as stores keep it and as it is drawn: in the order of meshoptimizer's vertex cache, positions as
// sums of two floats, in pages coded without loss (meshoptimizer's vertex and index codecs).
#pragma once

#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "geometry/mesh.h"
#include "store/store.h"

namespace lodlab {

struct StoredMesh {
  std::vector<glm::vec3> high;
  std::vector<glm::vec3> low;       ///< what the floats of `high` leave; empty where that is nothing
  std::vector<glm::u8vec4> colors;  ///< or empty
  std::vector<uint32_t> indices;    ///< three a triangle

  int64_t vertices() const { return static_cast<int64_t>(high.size()); }
  int64_t triangles() const { return static_cast<int64_t>(indices.size() / 3); }
};

/// Triangles, three indices each, in the order of the vertex cache, and what their vertices are numbered as
/// they are used: ~0 for those that none uses.
struct CacheOrder {
  std::vector<uint32_t> indices, number;
  size_t used = 0;
};
CacheOrder cache_order(std::span<const uint32_t> indices, size_t vertices);

/// These triangles (three indices each) of a mesh, with the vertices that they use.
StoredMesh stored_mesh(const Mesh& mesh, std::span<const uint32_t> indices);

/// How far, in each coordinate, what is stored may be from a coordinate of a mesh in this box.
double stored_step(const Box& box, bool in_floats);

/// Pages of kinds `kind` to `kind` + 3 for mesh number `id`; those that are there already are left as they
/// are.
void put_mesh(StoreWriter& writer, int kind, int64_t id, const StoredMesh& mesh);
/// Whether mesh number `id` has positions as sums of two floats.
bool has_low(const Store& store, int kind, int64_t id);
/// StoreError where pages are missing or are no such mesh.
StoredMesh get_mesh(const Store& store, int kind, int64_t id, int64_t vertices, int64_t triangles);

}  // namespace lodlab
