// SPDX-License-Identifier: MIT
// The family of the adversaries: a small level-of-detail method that keeps every law, with a hook at each
// place where a method can go wrong. A member of the family overrides one hook, so that what the instrument
// finds in it is that flaw and nothing else; the member that overrides none proves it.
//
// A mesh is cut into nodes by components and, within the box of all, by octants, each drawn simplified (0),
// its rim left as it is, or as it is (1); the bound is the largest distance either way. A flat field is cut
// into nodes of 16 x 16 cells (fewer at the east and south borders), all of them roots, each drawn at half
// resolution (0) or at full (1). Along its sides a node has even samples and the last alone, at either
// resolution: odd vertices there are moved on to their even neighbour. So neighbours always agree, and a node
// has one surface per resolution, whose largest deviation from the source is found at build and is its bound.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "geometry/height_field.h"
#include "geometry/mesh.h"
#include "geometry/mesh_surface.h"
#include "method/method.h"

namespace lodlab::adversaries {

inline constexpr int kSide = 16;  ///< cells along a node's side
inline constexpr int kResolutions = 2;

struct Vertex {
  uint32_t col, row;
  float height;
  uint32_t node, filler;
};

/// The triangles of one node at one resolution, counter-clockwise seen from above.
struct Mesh {
  int64_t node = 0;
  int resolution = 0;
  std::vector<Vertex> vertices;
  std::vector<uint32_t> indices;
};

/// The triangles of one node of a mesh at one resolution.
struct Patch {
  int64_t node = 0;
  int64_t component = 0;
  int resolution = 0;
  WeldedMesh mesh;
};

class FieldHierarchy;

class Family : public Method {
 public:
  Family(std::string name, std::string flaw, std::vector<std::string> accepts = {"heightfield", "mesh"});

  const MethodInfo& info() const override { return info_; }
  void build(const Source& source, const Options& options, StoreWriter& writer,
             const Progress& progress) const override;
  std::shared_ptr<const Hierarchy> open(std::shared_ptr<const Store> store) const override;

  // The hooks. `gap` is the build option of that name, source units.

  /// Changes a node's triangles; the bound is that of the mesh as changed.
  virtual void change(Mesh&, double /*gap*/) const {}
  virtual void change(Patch&, double /*gap*/) const {}
  /// Whether the bound of a patch is that of its triangles as changed.
  virtual bool owns_up() const { return true; }
  /// The bound that the store keeps, from the largest deviation.
  virtual double bound(double deviation) const { return deviation; }
  /// The number of triangles that it reports of a node.
  virtual int64_t told(int64_t triangles) const { return triangles; }
  /// The budget that selection goes by, and that it compares with to claim that it was met.
  virtual Budget allowed(const Budget& budget) const { return budget; }
  /// The resolution of the cut: `honest` is what it should be, `before` that of the last selection (-1: there
  /// was none), `again`: the view is the same as then.
  virtual int choose(int honest, int /*before*/, bool /*again*/) const { return honest; }
  /// The resolution that is drawn where the cut has this one, in the midst of a pass; -1: nothing.
  virtual int drawn(int resolution, const render::Pass&) const { return resolution; }
  /// How it selects and draws on fields: on the CPU, or on the GPU (computed.cpp).
  virtual std::unique_ptr<Session> session(std::shared_ptr<const FieldHierarchy> hierarchy) const;
  /// The resolution that the twin on the CPU claims where the GPU selects this one.
  virtual int claimed(int selected) const { return selected; }

 private:
  MethodInfo info_;
};

/// A node as the store keeps it.
struct Node {
  double lo[3], hi[3];
  double error[kResolutions];
  int64_t triangles[kResolutions], fillers[kResolutions];
};

class FamilyHierarchy : public Hierarchy {
 public:
  FamilyHierarchy(const Family& method, const Store& store);

  std::vector<NodeInfo> nodes() const override;
  double quantum() const override { return 0.0; }

  const Family& method;
  std::vector<Node> node;
};

class FieldHierarchy : public FamilyHierarchy, public std::enable_shared_from_this<FieldHierarchy> {
 public:
  FieldHierarchy(const Family& method, const Store& store);

  int64_t vertices() const override { return frame.rows * frame.cols; }
  std::unique_ptr<Session> session(const Options& draw_options) const override;

  FieldFrame frame;
  std::vector<float> heights;
  Bytes coverage;
  double gap = 0.0;
};

/// The mesh of a node, as the method changes it. `heights` are the field's, row by row.
Mesh make_mesh(const Family& method, const FieldFrame& frame, const float* heights, double gap, int64_t node,
               int resolution);

/// The family on meshes: mesh.cpp.
void build_patches(const Family& method, const lodlab::Mesh& source, double gap, StoreWriter& writer);
std::shared_ptr<const Hierarchy> open_patches(const Family& method, const Store& store);

class FamilySession : public Session {
 public:
  explicit FamilySession(std::shared_ptr<const FamilyHierarchy> hierarchy) : nodes_(std::move(hierarchy)) {}

  Cut select(const Request& request) override;
  Cut cut(const std::vector<int64_t>& nodes, const std::vector<int32_t>& resolutions) const override;
  std::vector<Cut> audit_cuts() const override;
  void draw(const Cut& cut, render::Pass& pass) override;
  void reset() override;

 protected:
  /// What comes before the nodes of a pass, and each of them.
  virtual void begin(render::Pass& pass) = 0;
  virtual void draw_node(uint32_t node, int resolution, render::Pass& pass) = 0;
  /// The claim of the cut whose resolution `pick` makes of the honest one.
  Claim claim(const Request& request, const std::function<int(int)>& pick) const;

 private:
  Claim uniform(const View& view, int resolution) const;
  void add(Claim& claim, int64_t node, int resolution, bool visible) const;

  std::shared_ptr<const FamilyHierarchy> nodes_;
  std::optional<View> view_;  ///< of the last selection, and its resolution
  int resolution_ = -1;
};

class FieldSession : public FamilySession {
 public:
  explicit FieldSession(std::shared_ptr<const FieldHierarchy> hierarchy);
  ~FieldSession() override;

  int64_t resident_bytes() const override;

 protected:
  void begin(render::Pass& pass) override;
  void draw_node(uint32_t node, int resolution, render::Pass& pass) override;
  const FieldHierarchy& hierarchy() const { return *hierarchy_; }
  struct Gpu;  // GL objects, made by the first draw: gpu.h
  Gpu& gpu();

 private:
  std::shared_ptr<const FieldHierarchy> hierarchy_;
  std::unique_ptr<Gpu> gpu_;
};

/// A session that selects in a compute shader and draws what that has left in a buffer: computed.cpp.
std::unique_ptr<Session> computed_session(std::shared_ptr<const FieldHierarchy> hierarchy);

}  // namespace lodlab::adversaries
