// SPDX-License-Identifier: MIT
// The chunk quadtree as stored and as used at run time, and the page format.
// Nodes are in breadth-first order: ids rise with the level, children of a node are contiguous.
#pragma once

#include <memory>
#include <vector>

#include "method/method.h"
#include "methods/chunked/mesh.h"

namespace lodlab::chunked {

enum PageKind { kGeometry = 0, kTexture = 1, kCoverage = 2 };

/// One row of the array "nodes" of the store.
struct Node {
  double lo[3], hi[3];  ///< bounds of source samples, surface, targets and skirts
  double error;  ///< bound for every surface this node may be drawn with, down to its children's morphs
  double parent_error;  ///< that of the parent; of a root its own
  int32_t parent;       ///< -1: root
  uint32_t first_child;
  int32_t row, col;  ///< corner of the chunk, samples
  uint32_t vertices, surface_vertices, indices, surface_indices;
  uint16_t level, children;
  uint16_t texture_side;  ///< texels a side, 0: none
  uint16_t pad;
};
static_assert(sizeof(Node) == 104);

/// Head of a decoded page; vertices (8 bytes each) and indices (2 or 4 bytes each) follow.
struct PageHead {
  uint32_t vertices, surface_vertices, indices, surface_indices;
};

/// Reorders for the vertex cache and vertex fetch, and compresses.
Bytes encode_page(const ChunkMesh& mesh);
/// Back to head, vertices and indices of `index_bytes` each. StoreError when the page does not decode.
Bytes decode_page(const Bytes& stored, int index_bytes);

class ChunkedHierarchy : public Hierarchy, public std::enable_shared_from_this<ChunkedHierarchy> {
 public:
  explicit ChunkedHierarchy(std::shared_ptr<const Store> store);

  std::vector<NodeInfo> nodes() const override;
  double quantum() const override { return quantizer.quantum; }
  int64_t vertices() const override;
  std::unique_ptr<Session> session(const Options& draw_options) const override;
  /// The mask of coverage.h.
  Bytes coverage() const { return store->page(kCoverage, 0); }

  std::shared_ptr<const Store> store;
  FieldFrame frame;
  Quantizer quantizer;
  std::vector<Node> node;
  uint32_t roots = 0;
  int levels = 0;
  int32_t root_side = 0;  ///< cells
  int index_bytes = 2;
};

/// The session on a hierarchy: select.cpp picks, draw.cpp draws.
std::unique_ptr<Session> make_session(std::shared_ptr<const ChunkedHierarchy> hierarchy,
                                      const Options& options);

}  // namespace lodlab::chunked
