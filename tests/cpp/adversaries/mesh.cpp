// SPDX-License-Identifier: MIT
// The family on meshes: its patches, their bounds, and their drawing. Rims of patches stay as they are at
// either resolution, so that neighbours always agree. A bound is the largest distance from what a node draws
// to the source, and from the part of the source that it stands for to what it draws.
#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "family.h"
#include "geometry/mesh_distance.h"
#include "geometry/mesh_edges.h"
#include "method/mesh_memory.h"

namespace lodlab::adversaries {
namespace {

constexpr int kPatches = 0;  ///< first of the kinds of pages
constexpr int64_t kMostPieces = int64_t{1} << 24;

/// As they are, in the order of components and octants.
std::vector<Patch> patches_of(const lodlab::Mesh& source) {
  Sets joined(source.samples());
  for (const Face& face : source.faces) {
    joined.join(face[0], face[1]);
    joined.join(face[0], face[2]);
  }
  std::map<uint32_t, std::map<int, std::vector<Triangle>>> parts;
  const glm::dvec3 centre = source.box.center();
  for (const Face& face : source.faces) {
    const Triangle t = {source.positions[face[0]], source.positions[face[1]], source.positions[face[2]]};
    const glm::dvec3 middle = (t[0] + t[1] + t[2]) / 3.0 - centre;
    const int octant = (middle.x > 0.0 ? 1 : 0) + (middle.y > 0.0 ? 2 : 0) + (middle.z > 0.0 ? 4 : 0);
    parts[joined.find(face[0])][octant].push_back(t);
  }
  std::vector<Patch> out;
  int64_t component = 0;
  for (const auto& [root, octants] : parts) {
    for (const auto& [octant, triangles] : octants)
      out.push_back({static_cast<int64_t>(out.size()), component, 1, weld(triangles, glm::dvec3(0.0))});
    ++component;
  }
  return out;
}

/// A third of its triangles, where its rim leaves as few.
Patch simplified(const Patch& patch) {
  Box box;
  for (const glm::dvec3& p : patch.mesh.positions) box.add(p);
  std::vector<glm::vec3> positions;
  for (const glm::dvec3& p : patch.mesh.positions) positions.emplace_back(p - box.center());
  const size_t corners = 3 * patch.mesh.faces.size();
  const unsigned* const indices = patch.mesh.faces.data()->data();
  std::vector<unsigned> kept(corners);
  kept.resize(meshopt_simplify(kept.data(), indices, corners, &positions[0].x, positions.size(),
                               sizeof(glm::vec3), corners / 9 * 3, 1.0f, meshopt_SimplifyLockBorder,
                               nullptr));
  std::vector<Triangle> triangles;
  for (size_t i = 0; i < kept.size(); i += 3) {
    const auto& p = patch.mesh.positions;
    triangles.push_back({p[kept[i]], p[kept[i + 1]], p[kept[i + 2]]});
  }
  Patch out = patch;
  out.resolution = 0;
  if (!triangles.empty()) out.mesh = weld(triangles, glm::dvec3(0.0));
  return out;
}

/// The largest distance, either way: a maximum is found within a tolerance below it.
double deviation(const WeldedMesh& drawn, const WeldedMesh& part, const MeshSurface& source, double extent) {
  const auto farthest = [&](const WeldedMesh& from, const MeshSurface& to) {
    return largest_distance(from, closest_to_vertices(from, to), to, extent, kMostPieces);
  };
  const double found = std::max(farthest(drawn, source), farthest(part, MeshSurface(drawn)));
  return found * (1.0 + 2.0 * kMaxTolerance);
}

StoredMesh stored(const Patch& patch) {
  lodlab::Mesh mesh;
  mesh.positions = patch.mesh.positions;
  if (patch.mesh.faces.empty()) return {};
  return stored_mesh(mesh, {patch.mesh.faces.data()->data(), 3 * patch.mesh.faces.size()});
}

class PatchHierarchy : public FamilyHierarchy, public std::enable_shared_from_this<PatchHierarchy> {
 public:
  PatchHierarchy(const Family& family, const Store& store)
      : FamilyHierarchy(family, store), frame(mesh_frame_from_json(store.meta().frame)) {
    const std::vector<int64_t> sizes = store.array_of<int64_t>("patches");
    for (size_t i = 0; i < sizes.size(); i += 2)
      patches.push_back(get_mesh(store, kPatches, static_cast<int64_t>(i / 2), sizes[i], sizes[i + 1]));
  }
  double quantum() const override { return stored_step(frame.box, frame.in_floats); }
  int64_t vertices() const override {
    int64_t out = 0;
    for (const StoredMesh& patch : patches) out += patch.vertices();
    return out;
  }
  std::unique_ptr<Session> session(const Options&) const override;

  MeshFrame frame;
  std::vector<StoredMesh> patches;  ///< node by node, resolution by resolution
};

class PatchSession : public FamilySession {
 public:
  explicit PatchSession(std::shared_ptr<const PatchHierarchy> hierarchy)
      : FamilySession(hierarchy), hierarchy_(std::move(hierarchy)) {}

  int64_t resident_bytes() const override {
    int64_t out = 0;
    for (const auto& memory : memory_) out += memory ? memory->bytes() : 0;
    return out;
  }

 protected:
  void begin(render::Pass& pass) override {
    if (!surface_) upload();
    pass.use(*program_, *surface_, {});  // tells whether it is a capture
  }
  void draw_node(uint32_t node, int resolution, render::Pass& pass) override {
    const size_t patch = node * kResolutions + static_cast<size_t>(resolution);
    if (memory_[patch] == nullptr) {
      ++pass.submitted.nodes;
      return;
    }
    memory_[patch]->draw({{{0, node, 0}}}, *surface_, pass);
    pass.submitted.triangles +=
        hierarchy_->node[node].triangles[resolution] - hierarchy_->patches[patch].triangles();
  }

 private:
  void upload() {
    surface_ = render::make_surface(hierarchy_->frame.box);
    program_.reset(new render::SurfaceProgram({{"vertex", "common/mesh.vert"}}));
    for (const StoredMesh& patch : hierarchy_->patches)
      memory_.push_back(patch.indices.empty() ? nullptr : std::make_unique<MeshMemory>(std::vector{patch}));
  }

  std::shared_ptr<const PatchHierarchy> hierarchy_;
  std::shared_ptr<const render::Surface> surface_;
  std::unique_ptr<render::SurfaceProgram> program_;
  std::vector<std::unique_ptr<MeshMemory>> memory_;
};

std::unique_ptr<Session> PatchHierarchy::session(const Options&) const {
  return std::make_unique<PatchSession>(shared_from_this());
}

}  // namespace

void build_patches(const Family& method, const lodlab::Mesh& source, double gap, StoreWriter& writer) {
  const std::vector<Patch> parts = patches_of(source);
  std::vector<Triangle> triangles;
  for (const Face& f : source.faces)
    triangles.push_back({source.positions[f[0]], source.positions[f[1]], source.positions[f[2]]});
  const WeldedMesh welded = weld(triangles, glm::dvec3(0.0));
  const MeshSurface surface(welded);
  const double step = std::sqrt(3.0) * stored_step(source.box, source.in_floats);
  std::vector<Node> nodes;
  std::vector<int64_t> sizes;
  for (const Patch& part : parts) {
    Node& node = nodes.emplace_back();
    Box box;
    const auto add = [&box](const WeldedMesh& mesh) {
      for (const glm::dvec3& p : mesh.positions) {
        if (std::isfinite(p.x + p.y + p.z)) box.add(p);
      }
    };
    add(part.mesh);
    for (int resolution = 0; resolution < kResolutions; ++resolution) {
      const Patch honest = resolution == 0 ? simplified(part) : part;
      Patch patch = honest;
      method.change(patch, gap);
      add(patch.mesh);
      const Patch& told = method.owns_up() ? patch : honest;
      node.error[resolution] = method.bound(deviation(told.mesh, part.mesh, surface, source.extent())) + step;
      node.triangles[resolution] = method.told(patch.mesh.triangles());
      const StoredMesh kept = stored(patch);
      put_mesh(writer, kPatches, static_cast<int64_t>(sizes.size() / 2), kept);
      sizes.insert(sizes.end(), {kept.vertices(), kept.triangles()});
    }
    for (int i = 0; i < 3; ++i) {
      node.lo[i] = box.lo[i];
      node.hi[i] = box.hi[i];
    }
  }
  writer.put_array("nodes", as_bytes(nodes));
  writer.put_array("patches", as_bytes(sizes));
}

std::shared_ptr<const Hierarchy> open_patches(const Family& method, const Store& store) {
  return std::make_shared<PatchHierarchy>(method, store);
}

}  // namespace lodlab::adversaries
