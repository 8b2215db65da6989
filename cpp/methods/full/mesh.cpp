// SPDX-License-Identifier: MIT
// `full` of a mesh: its triangles as they are, in the order that draws fastest.
#include <cmath>

#include "base/errors.h"
#include "method/mesh_memory.h"
#include "methods/full/full.h"

namespace lodlab::full {
namespace {

constexpr int kMeshPages = 4;  ///< the kinds after those of height fields

class MeshSession : public OneNodeSession {
 public:
  MeshSession(std::shared_ptr<const Hierarchy> hierarchy, StoredMesh mesh, const Box& box)
      : OneNodeSession(mesh.triangles()), hierarchy_(std::move(hierarchy)), box_(box) {
    mesh_.push_back(std::move(mesh));
  }

  void draw(const Cut& cut, render::Pass& pass) override {
    if (!gpu_) {
      gpu_ = std::make_unique<Gpu>(mesh_, box_);
      mesh_ = {};
    }
    if (!cut.claim->nodes.empty()) gpu_->memory.draw({{{0, 0, 0}}}, *gpu_->surface, pass);
  }
  int64_t resident_bytes() const override { return gpu_ ? gpu_->memory.bytes() : 0; }

 private:
  struct Gpu {
    Gpu(const std::vector<StoredMesh>& mesh, const Box& box)
        : surface(render::make_surface(box)), memory(mesh) {}
    std::shared_ptr<const render::Surface> surface;
    MeshMemory memory;
  };
  std::shared_ptr<const Hierarchy> hierarchy_;
  std::vector<StoredMesh> mesh_;  ///< the one, until the first draw
  Box box_;
  std::unique_ptr<Gpu> gpu_;
};

class MeshHierarchy : public Hierarchy, public std::enable_shared_from_this<MeshHierarchy> {
 public:
  explicit MeshHierarchy(std::shared_ptr<const Store> store)
      : store_(std::move(store)), frame_(mesh_frame_from_json(store_->meta().frame)) {
    const std::vector<int64_t> counts = store_->array_of<int64_t>("mesh");
    if (counts.size() != 2)
      throw StoreError("full: " + store_->path() + " does not say the size of its mesh");
    vertices_ = counts[0];
    root_.triangles = counts[1];
    root_.box = frame_.box;
    root_.error = std::sqrt(3.0) * stored_step(frame_.box, frame_.in_floats);
  }

  std::vector<NodeInfo> nodes() const override { return {root_}; }
  double quantum() const override { return stored_step(frame_.box, frame_.in_floats); }
  int64_t vertices() const override { return vertices_; }
  std::unique_ptr<Session> session(const Options&) const override {
    return std::make_unique<MeshSession>(
        shared_from_this(), get_mesh(*store_, kMeshPages, 0, vertices_, root_.triangles), frame_.box);
  }

 private:
  std::shared_ptr<const Store> store_;
  MeshFrame frame_;
  int64_t vertices_ = 0;
  NodeInfo root_;
};

}  // namespace

void build_mesh(const Mesh& mesh, StoreWriter& writer, const Progress& progress) {
  if (progress) progress("order", 0.0);
  const std::span<const uint32_t> indices(mesh.faces.data()->data(), 3 * mesh.faces.size());
  const StoredMesh stored = stored_mesh(mesh, indices);
  if (progress) progress("write", 0.5);
  put_mesh(writer, kMeshPages, 0, stored);
  writer.put_array("mesh", as_bytes(std::vector<int64_t>{stored.vertices(), stored.triangles()}));
  if (progress) progress("write", 1.0);
}

std::shared_ptr<const Hierarchy> open_mesh(std::shared_ptr<const Store> store) {
  return std::make_shared<MeshHierarchy>(std::move(store));
}

}  // namespace lodlab::full
