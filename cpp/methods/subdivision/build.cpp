// SPDX-License-Identifier: MIT
// From a mesh to a store: collapse, sample, bound, write.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/errors.h"
#include "methods/subdivision/bounds.h"
#include "methods/subdivision/displacement.h"
#include "methods/subdivision/subdivision.h"

namespace lodlab::subdivision {
namespace {

/// Fewer control faces show little of any shape.
constexpr int64_t kFewFaces = 256;

/// As many that the finest triangles are as many as the source's.
int64_t default_target(const Mesh& mesh, const Pattern& pattern) {
  const auto faces = static_cast<int64_t>(mesh.faces.size()), a_face = int64_t{pattern.n()} * pattern.n();
  return std::max(kFewFaces, (faces + a_face - 1) / a_face);
}

ControlMesh at_rest(const ControlMesh& c, const glm::dvec3& centre) {  // TEMP
  ControlMesh out = c;
  for (auto& p : out.positions) p = glm::dvec3(vec3(p - centre));
  for (auto& n : out.normals) n = glm::dvec3(vec3(n));
  return out;
}

}  // namespace

void build(const Source& source, const Options& options, StoreWriter& writer, const Progress& progress) {
  const auto& mesh = dynamic_cast<const Mesh&>(source);
  const Pattern pattern = Pattern::of_degree(options.integer("degree"));
  if (pattern.d > kMostDoublings) {
    throw InvalidInput("subdivision: degree " + std::to_string(pattern.n() + 1) + "; at most " +
                       std::to_string((1 << kMostDoublings) + 1));
  }
  const auto bits = static_cast<int>(std::stoi(options.text("bits")));
  const bool interpolation = options.text("sampling") == "interpolation";
  const int64_t target = options.integer("target");

  Stored stored;
  const SourceSurface surface(mesh);
  ControlMesh control = control_mesh(mesh, target > 0 ? target : default_target(mesh, pattern), progress);
  const bool reached = control.reached_target;
  stored.control = at_rest(control, surface.centre);
  stored.control.faces =
      as_coded(stored.control.faces, static_cast<int64_t>(stored.control.positions.size()));
  const Samples samples(stored.control, pattern);
  ControlMesh moved = stored.control;  // TEMP
  for (auto& p : moved.positions) p += surface.centre;
  const Samples old_samples(moved, pattern);
  Displacement displacement = displace(surface, moved, old_samples,
                                       interpolation ? Sampling::kInterpolation : Sampling::kIntersection);
  std::vector<float> scale(displacement.heights.size(), 1.0f);  // TEMP
  {
    const int n = pattern.n();
    std::vector<int64_t> of(static_cast<size_t>(pattern.points()));
    for (int64_t f = 0; f < samples.control_faces(); ++f) {
      samples.of_face(f, of);
      const Face& v = stored.control.faces[static_cast<size_t>(f)];
      for (int j = 0; j <= n; ++j) {
        for (int i = 0; i + j <= n; ++i) {
          const glm::dvec3 sum =
              (double(n - i - j) * stored.control.normals[v[0]] + double(i) * stored.control.normals[v[1]] +
               double(j) * stored.control.normals[v[2]]) /
              double(n);
          scale[static_cast<size_t>(of[static_cast<size_t>(pattern.point(i, j))])] =
              static_cast<float>(glm::length(sum));
        }
      }
    }
  }
  std::vector<float> along = displacement.heights;
  for (size_t i = 0; i < along.size(); ++i) along[i] /= scale[i];
  stored.packed = pack(samples, along, bits);
  std::vector<float> heights = unpack(samples, stored.packed);
  for (size_t i = 0; i < along.size(); ++i) heights[i] *= scale[i];
  const Bounds found = bounds(surface, moved, samples, displacement, heights);

  Stored::Shape& shape = stored.shape;
  shape = {};
  shape.vertices = static_cast<int64_t>(stored.control.positions.size());
  shape.faces = samples.control_faces();
  shape.degree = pattern.n() + 1;
  shape.bits = bits;
  const double largest = std::max(*std::max_element(found.face.begin(), found.face.end()),
                                  *std::max_element(found.sampling.begin(), found.sampling.end()));
  shape.low_code = low_code_for(largest);
  Box box = mesh.box;
  const auto levels = static_cast<size_t>(found.levels);
  for (size_t f = 0; f < stored.control.faces.size(); ++f) {
    for (size_t level = 0; level < levels; ++level)
      stored.codes.push_back(code_above(shape.low_code, found.face[f * levels + level]));
    stored.codes.push_back(code_above(shape.low_code, found.sampling[f]));
  }
  for (const glm::dvec3& p : displaced(samples, displacement, heights).positions) box.add(p + surface.centre);
  shape.closed = 1;
  for (int64_t e = 0; e < samples.edges().count(); ++e) {
    if (samples.edges().of(e).size() != 2) shape.closed = 0;
  }
  for (int k = 0; k < 3; ++k) {
    shape.centre[k] = surface.centre[k];
    shape.lo[k] = box.lo[k];
    shape.hi[k] = box.hi[k];
  }
  put(writer, stored);
  const nlohmann::json told = {{"control_faces", shape.faces},      {"control_vertices", shape.vertices},
                               {"reached_target", reached},         {"samples", samples.count()},
                               {"missed", displacement.missed},     {"wrong_sheet", displacement.wrong_sheet},
                               {"averaged", displacement.averaged}, {"average_distance", found.average}};
  writer.put_meta("subdivision", told.dump());
}

}  // namespace lodlab::subdivision
