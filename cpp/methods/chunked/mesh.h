// SPDX-License-Identifier: MIT
// The mesh of one chunk: the part of a level's 4-8 mesh inside the chunk's square, every vertex with its
// own height and its height on the parent's mesh (the morph target), and skirts along inner edges.
#pragma once

#include <cstdint>
#include <vector>

#include "methods/chunked/grid.h"

namespace lodlab::chunked {

/// Position in cells from the chunk's corner; heights in quanta. The stored and drawn format.
struct Vertex {
  uint16_t x, y, z, target;
};
static_assert(sizeof(Vertex) == 8);

/// What selects the vertices of each level: one is kept when its error exceeds the level's limit.
struct Levels {
  std::vector<double> delta;  ///< source units
  std::vector<float> limit;   ///< quanta
};

struct ChunkMesh {
  std::vector<Vertex> vertices;   ///< surface first, then the bottoms of skirts
  std::vector<uint32_t> indices;  ///< triangles, counter-clockwise from above; surface first, then skirts
  uint32_t surface_vertices = 0, surface_indices = 0;
  double error = 0.0;             ///< bound on the distance to the source, source units
  bool rounded = false;           ///< some morph target or border vertex lies up to half a quantum off
  int32_t low = 65535, high = 0;  ///< range of heights, targets and skirts, quanta
};

/// For every grid line between chunks: per sample the lowest of all levels' curves along it.
class Envelope {
 public:
  Envelope(const Grid& grid, const Levels& levels);
  /// Lowest curve at sample i of the line at `at` cells (a multiple of the leaf's side).
  int32_t low(bool vertical, int32_t at, int32_t i) const {
    return lines_[vertical][static_cast<size_t>(at / leaf_ - 1) * length_[vertical] + i];
  }

 private:
  int32_t leaf_;
  int32_t length_[2];
  std::vector<uint16_t> lines_[2];  // [vertical]
};

/// Builds chunk meshes; keeps its buffers between calls. One per thread.
class ChunkMesher {
 public:
  ChunkMesher(const Grid& grid, const Levels& levels, const Envelope& envelope);
  /// The chunk of this level whose corner lies at (x, y); it overlaps the field.
  const ChunkMesh& build(int level, int32_t x, int32_t y);

 private:
  struct Corner {
    int32_t x, y;
    int64_t target;  // height on the parent's mesh, in 2^-32 quanta: every midpoint is exact
    uint32_t index;  // in the mesh; only below bisect()
  };
  // Triangles leave along a Sierpinski curve: from corner b to corner c (from_b) or back, so that each shares
  // an edge with the one before it.
  void split(const Corner& apex, const Corner& b, const Corner& c, bool in_parent, bool from_b);
  void bisect(const Corner& apex, const Corner& b, const Corner& c, bool in_parent, bool from_b);
  void emit_clipped(const Corner& a, const Corner& b, const Corner& c);
  uint32_t vertex(int32_t x, int32_t y, int32_t z, int64_t target);
  Corner corner(int32_t x, int32_t y) const;
  void skirt(bool vertical, int32_t at, int32_t from, bool outward_positive);
  uint32_t find(int32_t x, int32_t y) const;

  const Grid& grid_;
  const Levels& levels_;
  const Envelope& envelope_;
  ChunkMesh mesh_;
  int level_ = 0;
  int32_t x_ = 0, y_ = 0, side_ = 0;
  float limit_ = 0.0f, parent_limit_ = 0.0f, worst_ = 0.0f;
  std::vector<uint32_t> keys_, slots_;  // open addressing: local position -> vertex
  size_t mask_ = 0;
  std::vector<float> own_, parent_;  // curves along an edge
};

/// Height of a level's mesh along a grid line, at samples [from, to], which are multiples of the level's
/// side or, on a line through the middle of its squares, of half of it. out[0] is sample `from`.
void edge_curve(const Grid& grid, const Levels& levels, int level, bool vertical, int32_t at, int32_t from,
                int32_t to, std::vector<float>& out);

}  // namespace lodlab::chunked
