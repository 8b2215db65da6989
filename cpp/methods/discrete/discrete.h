// SPDX-License-Identifier: MIT
// discrete: a few levels of the whole source, or of each of its components, each with a measured bound; the
// coarsest within the budget is drawn. METHOD.md says more.
#pragma once

#include <memory>
#include <vector>

#include "geometry/height_field.h"
#include "geometry/mesh.h"
#include "method/mesh_pages.h"
#include "method/method.h"

namespace lodlab::discrete {

/// Pages: mesh number i is node i's.
enum PageKind : int { kMeshes = 0, kCoverage = 4 };

/// One row of the array "nodes" of the store: a level of a chain. Chains follow one another, each from its
/// coarsest level on.
struct Node {
  double error;  ///< bound, source units
  int64_t vertices, triangles;
  int32_t chain, level;  ///< 0: the coarsest
};
static_assert(sizeof(Node) == 32);

/// One row of the array "chains": what is drawn at one of several levels.
struct Chain {
  double lo[3], hi[3];  ///< bounds of its part of the source and of all its levels
  uint32_t first;       ///< its coarsest node
  uint32_t levels;
};
static_assert(sizeof(Chain) == 56);

/// Triangles of the least level that is made, about: what halving goes down to.
inline constexpr int64_t kFewTriangles = 256;

/// The faces of a mesh so that neighbours in the list lie near one another.
std::vector<uint32_t> in_order(const Mesh& mesh);

/// Faces of the levels of a mesh, the coarsest first, the mesh itself last: halved as far as it goes.
/// `field`: what the mesh is of, or null.
std::vector<std::vector<uint32_t>> halved(const Mesh& mesh, const HeightField* field);

/// A triangulation of samples of a field in which every triangle shows its upper side: simplification leaves
/// some that are turned over or, on one line, have no area. They are swapped with a neighbour's half. Empty
/// where that does not help.
std::vector<uint32_t> unfolded(std::vector<uint32_t> indices, const HeightField& field);

/// The parts of a mesh that have levels of their own: each component, sets of triangles joined at positions,
/// that is large enough to be halved; and all others together.
std::vector<std::shared_ptr<const Mesh>> parts_of(std::shared_ptr<const Mesh> mesh);

/// Two triangles a cell, cut as height_field.h has them.
std::shared_ptr<const Mesh> mesh_of(const HeightField& field);

/// Measures levels of a part of a mesh, both ways (geometry/mesh_distance.h).
class MeshMeasure {
 public:
  /// `faces`: in_order().
  MeshMeasure(std::shared_ptr<const Mesh> part, std::span<const uint32_t> faces);
  ~MeshMeasure();
  /// No point of either surface is farther from the other, and no point of the level's border from the
  /// part's. `first`: first_at_position() of the level's mesh.
  double bound(const Mesh& of, std::span<const uint32_t> first, std::span<const uint32_t> indices) const;
  /// first_at_position() of the part.
  std::span<const uint32_t> first() const { return first_; }

 private:
  struct Target;
  std::shared_ptr<const Mesh> part_;
  std::vector<uint32_t> first_;
  std::unique_ptr<Target> target_;
};

struct FieldBound {
  double error = 0.0;     ///< no sample is farther from the surface above or below it
  int64_t uncovered = 0;  ///< samples that nothing covers
  int64_t first_uncovered = -1;
};
/// Of a surface over a flat field, at all its samples but voids.
FieldBound field_bound(const HeightField& field, const Mesh& of, std::span<const uint32_t> indices);

void build(const Source& source, const Options& options, StoreWriter& writer, const Progress& progress);

class DiscreteHierarchy : public Hierarchy, public std::enable_shared_from_this<DiscreteHierarchy> {
 public:
  explicit DiscreteHierarchy(std::shared_ptr<const Store> store);

  std::vector<NodeInfo> nodes() const override;
  double quantum() const override { return quantum_; }
  int64_t vertices() const override;
  std::unique_ptr<Session> session(const Options& draw_options) const override;

  bool on_mesh() const { return on_mesh_; }
  /// Of a height field.
  const FieldFrame& frame() const { return frame_; }
  Bytes coverage() const;
  /// All nodes' meshes.
  std::vector<StoredMesh> meshes() const;

  std::vector<Node> node;
  std::vector<Chain> chain;
  Box box;

 private:
  std::shared_ptr<const Store> store_;
  bool on_mesh_;
  FieldFrame frame_;
  double quantum_ = 0.0;
};

std::unique_ptr<Session> make_session(std::shared_ptr<const DiscreteHierarchy> hierarchy,
                                      const Options& options);

}  // namespace lodlab::discrete
