// SPDX-License-Identifier: MIT
// Levels are made or brought, measured against the source, and written. Of those that are made, the ones
// finer than `finest_error` asks for are left out. Bounds nest: a level's is no smaller than that of a finer
// one.
#include <algorithm>
#include <cmath>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/coverage.h"
#include "geometry/mesh_repair.h"
#include "methods/discrete/discrete.h"

namespace lodlab::discrete {
namespace {

struct Level {
  std::shared_ptr<const Mesh> mesh;
  std::vector<uint32_t> indices;
  double error = 0.0;
};
using Levels = std::vector<Level>;  ///< the coarsest first

double error_of_storing(const Mesh& mesh) { return std::sqrt(3.0) * stored_step(mesh.box, mesh.in_floats); }

/// Those of a user, the one with the fewest triangles first.
Levels brought(const Meshes& meshes) {
  Levels out;
  for (const auto& mesh : meshes) out.push_back({mesh, in_order(*mesh)});
  std::stable_sort(out.begin(), out.end(),
                   [](const Level& a, const Level& b) { return a.indices.size() < b.indices.size(); });
  return out;
}

Levels made(const std::shared_ptr<const Mesh>& mesh, const HeightField* field) {
  Levels out;
  for (auto& indices : halved(*mesh, field)) out.push_back({mesh, std::move(indices)});
  return out;
}

void measure_on_mesh(const std::shared_ptr<const Mesh>& part, Levels& levels,
                     const std::function<void()>& done) {
  const bool own = levels.back().mesh == part;
  const MeshMeasure measure(part, own ? levels.back().indices : in_order(*part));
  for (Level& level : levels) {
    const bool whole = level.mesh == part && level.indices.size() == 3 * part->faces.size();
    if (level.mesh == part) {
      level.error = whole ? 0.0 : measure.bound(*part, measure.first(), level.indices);
    } else {
      level.error = measure.bound(*level.mesh, first_at_position(level.mesh->positions), level.indices);
    }
    level.error += error_of_storing(*level.mesh);
    done();
  }
}

/// The same along the vertical: where a triangle is steep, what it is off to the side counts by its slope.
double error_of_storing_upright(const Mesh& mesh, std::span<const uint32_t> indices) {
  const double step = error_of_storing(mesh);
  double most = 0.0;
  for (size_t i = 0; i < indices.size() && step > 0.0; i += 3) {
    const glm::dvec3 &a = mesh.positions[indices[i]], &b = mesh.positions[indices[i + 1]],
                     &c = mesh.positions[indices[i + 2]];
    const glm::dvec3 normal = glm::cross(b - a, c - a);
    const double range = std::max({a.z, b.z, c.z}) - std::min({a.z, b.z, c.z});
    most = std::max(most, std::min(range, step * std::hypot(normal.x, normal.y) / std::abs(normal.z)));
  }
  return step + most;
}

void measure_on_field(const HeightField& field, Levels& levels, const std::function<void()>& done) {
  for (Level& level : levels) {
    const FieldBound found = field_bound(field, *level.mesh, level.indices);
    if (found.uncovered > 0) {
      throw InvalidInput("discrete: levels: the one of " + std::to_string(level.indices.size() / 3) +
                         " triangles leaves " + std::to_string(found.uncovered) +
                         " samples uncovered (limit: 0), the first at row " +
                         std::to_string(found.first_uncovered / field.cols) + ", column " +
                         std::to_string(found.first_uncovered % field.cols));
    }
    level.error = found.error + error_of_storing_upright(*level.mesh, level.indices);
    done();
  }
}

/// Bounds nest, and what is finer than asked for goes.
void finish(Levels& levels, double finest_error) {
  for (size_t i = levels.size() - 1; i-- > 0;)
    levels[i].error = std::max(levels[i].error, levels[i + 1].error);
  const auto fine = std::find_if(levels.begin(), levels.end(),
                                 [&](const Level& level) { return level.error <= finest_error; });
  if (fine != levels.end()) levels.erase(fine + 1, levels.end());
}

/// Levels that hold samples they do not cover are no levels: made ones end before.
void keep_covering(const HeightField& field, Levels& levels) {
  while (levels.size() > 1 && field_bound(field, *levels[0].mesh, levels[0].indices).uncovered > 0)
    levels.erase(levels.begin());
}

}  // namespace

void build(const Source& source, const Options& options, StoreWriter& writer, const Progress& progress) {
  const auto* field = dynamic_cast<const HeightField*>(&source);
  const bool given = options.text("levels") != "auto";
  std::vector<std::shared_ptr<const Mesh>> parts;
  if (field == nullptr) {
    const std::shared_ptr<const Mesh> mesh(std::shared_ptr<const void>(), dynamic_cast<const Mesh*>(&source));
    parts = given ? std::vector{mesh} : parts_of(mesh);
  } else if (!given) {
    parts = {mesh_of(*field)};
  }
  std::vector<Levels> chains(given ? 1 : parts.size());
  if (given) chains[0] = brought(options.meshes("levels"));
  if (!given) {
    Count count(progress, "simplify", static_cast<int64_t>(chains.size()));
    parallel_for(static_cast<int64_t>(chains.size()), 1, [&](int64_t begin, int64_t end) {
      for (auto c = static_cast<size_t>(begin); c < static_cast<size_t>(end); ++c) {
        chains[c] = made(parts[c], field);
        count();
      }
    });
    if (field != nullptr) keep_covering(*field, chains[0]);
  }
  int64_t levels = 0;
  for (const Levels& chain : chains) levels += static_cast<int64_t>(chain.size());
  {
    Count count(progress, "measure", levels);
    parallel_for(static_cast<int64_t>(chains.size()), 1, [&](int64_t begin, int64_t end) {
      for (auto c = static_cast<size_t>(begin); c < static_cast<size_t>(end); ++c) {
        if (field != nullptr) {
          measure_on_field(*field, chains[c], [&] { count(); });
        } else {
          measure_on_mesh(parts[c], chains[c], [&] { count(); });
        }
        finish(chains[c], given ? 0.0 : options.real("finest_error"));
      }
    });
  }

  std::vector<Node> nodes;
  std::vector<Chain> table;
  std::vector<const Level*> level_of;
  for (size_t c = 0; c < chains.size(); ++c) {
    Box box;
    if (field != nullptr) {
      box.add(field->position(0, 0, field->z_min));
      box.add(field->position(field->rows - 1, field->cols - 1, field->z_max));
    } else {
      box = parts[c]->box;
    }
    Chain chain{};
    chain.first = static_cast<uint32_t>(nodes.size());
    chain.levels = static_cast<uint32_t>(chains[c].size());
    for (size_t l = 0; l < chains[c].size(); ++l) {
      const Level& level = chains[c][l];
      box.add(level.mesh->box);
      nodes.push_back({level.error, 0, static_cast<int64_t>(level.indices.size() / 3),
                       static_cast<int32_t>(c), static_cast<int32_t>(l)});
      level_of.push_back(&level);
    }
    const double step = stored_step(box, false);
    for (int k = 0; k < 3; ++k) {
      chain.lo[k] = box.lo[k] - step;
      chain.hi[k] = box.hi[k] + step;
    }
    table.push_back(chain);
  }
  Count count(progress, "write", static_cast<int64_t>(nodes.size()));
  parallel_for(static_cast<int64_t>(nodes.size()), 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const Level& level = *level_of[static_cast<size_t>(i)];
      const StoredMesh stored = stored_mesh(*level.mesh, level.indices);
      nodes[static_cast<size_t>(i)].vertices = stored.vertices();
      put_mesh(writer, kMeshes, i, stored);
      count();
    }
  });
  if (field != nullptr) {
    const Bytes coverage = coverage_bits(*field);
    if (!coverage.empty() && !writer.has_page(kCoverage, 0)) writer.put_page(kCoverage, 0, coverage);
  }
  writer.put_array("nodes", as_bytes(nodes));
  writer.put_array("chains", as_bytes(table));
}

}  // namespace lodlab::discrete
