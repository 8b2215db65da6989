// SPDX-License-Identifier: MIT
// full: the baseline. One node, the whole source, one vertex buffer, one index buffer, one draw call.
#pragma once

#include <cstdint>
#include <memory>

#include "geometry/height_field.h"
#include "geometry/mesh.h"
#include "method/method.h"

namespace lodlab::full {

/// Pages of a store. Heights, colours, normals: blocks of rows (rows_per_page), as method/sample_code.h has
/// them.
enum PageKind : int { kHeights = 0, kCoverage = 1, kColors = 2, kNormals = 3 };

/// Rows of 4-byte samples in one page: about 256 KiB.
int64_t rows_per_page(int64_t columns);
int64_t page_count(int64_t rows, int64_t columns);

/// Columns of vertices: one more than the samples where a planet's columns close round.
inline int64_t vertex_columns(const FieldFrame& frame) { return frame.cols + (frame.wraps ? 1 : 0); }
/// Whether all samples of this row are one point.
bool is_pole(const FieldFrame& frame, int64_t row);
/// Triangles of the full-resolution surface: two a cell, one beside a pole.
int64_t triangle_count(const FieldFrame& frame);

void build(const HeightField& field, const Options& options, StoreWriter& writer, const Progress& progress);

class FullHierarchy : public Hierarchy, public std::enable_shared_from_this<FullHierarchy> {
 public:
  explicit FullHierarchy(std::shared_ptr<const Store> store);

  std::vector<NodeInfo> nodes() const override { return {root_}; }
  double quantum() const override { return 0.0; }
  int64_t vertices() const override;
  std::unique_ptr<Session> session(const Options& draw_options) const override;

  const Store& store() const { return *store_; }
  const FieldFrame& frame() const { return frame_; }
  const Box& box() const { return root_.box; }
  int64_t triangles() const { return root_.triangles; }
  std::vector<float> heights() const;
  Bytes coverage() const;
  /// A map: RGBA8, rows from the north; empty when the store has none.
  struct Raster {
    int width = 0, height = 0;
    std::vector<uint32_t> pixels;
  };
  Raster colors() const;
  Raster normals() const;

 private:
  std::shared_ptr<const Store> store_;
  FieldFrame frame_;
  NodeInfo root_;
};

/// A session of one node that draws everything.
class OneNodeSession : public Session {
 public:
  explicit OneNodeSession(int64_t triangles) : triangles_(triangles) {}

  Cut select(const Request& request) override;
  Cut cut(const std::vector<int64_t>& nodes, const std::vector<int32_t>& resolutions) const override;
  std::vector<Cut> audit_cuts() const override { return {everything()}; }

 private:
  Cut everything() const;  ///< the one cut there is, of no view

  int64_t triangles_;
};

class FullSession : public OneNodeSession {
 public:
  explicit FullSession(std::shared_ptr<const FullHierarchy> hierarchy);
  ~FullSession() override;

  void draw(const Cut& cut, render::Pass& pass) override;
  int64_t resident_bytes() const override;

 private:
  std::shared_ptr<const FullHierarchy> hierarchy_;
  struct Gpu;  // GL objects, made by the first draw
  std::unique_ptr<Gpu> gpu_;
};

/// Of a mesh (mesh.cpp).
void build_mesh(const Mesh& mesh, StoreWriter& writer, const Progress& progress);
std::shared_ptr<const Hierarchy> open_mesh(std::shared_ptr<const Store> store);

}  // namespace lodlab::full
