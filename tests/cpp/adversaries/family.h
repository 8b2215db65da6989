// SPDX-License-Identifier: MIT
// The family of the adversaries: a small level-of-detail method that keeps every law, with a hook at each
// place where a method can go wrong. A member of the family overrides one hook, so that what the instrument
// finds in it is that flaw and nothing else; the member that overrides none proves it.
//
// A flat field is cut into nodes of 16 x 16 cells (fewer at the east and south borders), all of them roots,
// each drawn at half resolution (0) or at full (1). Along its sides a node has even samples and the last
// alone, at either resolution: odd vertices there are moved on to their even neighbour. So neighbours always
// agree, and a node has one surface per resolution, whose largest deviation from the source is found at build
// and is its bound.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

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

class FamilyHierarchy;

class Family : public Method {
 public:
  Family(std::string name, std::string flaw);

  const MethodInfo& info() const override { return info_; }
  void build(const Source& source, const Options& options, StoreWriter& writer,
             const Progress& progress) const override;
  std::shared_ptr<const Hierarchy> open(std::shared_ptr<const Store> store) const override;

  // The hooks. `gap` is the build option of that name, source units.

  /// Changes a node's triangles; the bound is that of the mesh as changed.
  virtual void change(Mesh&, double /*gap*/) const {}
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
  /// How it selects and draws: on the CPU, or on the GPU (computed.cpp).
  virtual std::unique_ptr<Session> session(std::shared_ptr<const FamilyHierarchy> hierarchy) const;
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

class FamilyHierarchy : public Hierarchy, public std::enable_shared_from_this<FamilyHierarchy> {
 public:
  FamilyHierarchy(const Family& method, std::shared_ptr<const Store> store);

  std::vector<NodeInfo> nodes() const override;
  double quantum() const override { return 0.0; }
  int64_t vertices() const override { return frame.rows * frame.cols; }
  std::unique_ptr<Session> session(const Options& draw_options) const override;

  const Family& method;
  FieldFrame frame;
  std::vector<Node> node;
  std::vector<float> heights;
  Bytes coverage;
  double gap = 0.0;
};

/// The mesh of a node, as the method changes it. `heights` are the field's, row by row.
Mesh make_mesh(const Family& method, const FieldFrame& frame, const float* heights, double gap, int64_t node,
               int resolution);

class FamilySession : public Session {
 public:
  explicit FamilySession(std::shared_ptr<const FamilyHierarchy> hierarchy);
  ~FamilySession() override;

  Cut select(const Request& request) override;
  Cut cut(const std::vector<int64_t>& nodes, const std::vector<int32_t>& resolutions) const override;
  std::vector<Cut> audit_cuts() const override;
  void draw(const Cut& cut, render::Pass& pass) override;
  void reset() override;
  int64_t resident_bytes() const override;

 protected:
  const FamilyHierarchy& hierarchy() const { return *hierarchy_; }
  struct Gpu;  // GL objects, made by the first draw: gpu.h
  Gpu& gpu();
  /// The claim of the cut whose resolution `pick` makes of the honest one.
  Claim claim(const Request& request, const std::function<int(int)>& pick) const;

 private:
  Claim uniform(const View& view, int resolution) const;
  void add(Claim& claim, int64_t node, int resolution, bool visible) const;

  std::shared_ptr<const FamilyHierarchy> hierarchy_;
  std::optional<View> view_;  ///< of the last selection, and its resolution
  int resolution_ = -1;
  std::unique_ptr<Gpu> gpu_;
};

/// A session that selects in a compute shader and draws what that has left in a buffer: computed.cpp.
std::unique_ptr<Session> computed_session(std::shared_ptr<const FamilyHierarchy> hierarchy);

}  // namespace lodlab::adversaries
