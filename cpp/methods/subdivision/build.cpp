// SPDX-License-Identifier: MIT
// From a mesh to a store: collapse, sample, bound, write.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/errors.h"
#include "methods/subdivision/bounds.h"
#include "methods/subdivision/displacement.h"
#include "methods/subdivision/stored_control.h"
#include "methods/subdivision/subdivision.h"

namespace lodlab::subdivision {
namespace {

/// As many that the finest triangles are as many as the source's; where that is few, one for eight of its
/// triangles: fewer show little of its shape.
int64_t default_target(const Mesh& mesh, const Pattern& pattern) {
  constexpr int64_t kEnough = 1000, kFew = 64;
  const auto faces = static_cast<int64_t>(mesh.faces.size()), a_face = int64_t{pattern.n()} * pattern.n();
  return std::max({(faces + a_face - 1) / a_face, std::min(faces / 8, kEnough), kFew});
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
  stored.control = subdivision::stored(control, surface.centre);
  stored.control.faces =
      as_coded(stored.control.faces, static_cast<int64_t>(stored.control.positions.size()));
  const Samples samples(stored.control, pattern);
  const Displacement displacement =
      displace(surface, stored.control, samples,
               interpolation ? Sampling::kInterpolation : Sampling::kIntersection, progress);
  stored.packed = pack(samples, displacement.heights, bits);
  const std::vector<float> heights = unpack(samples, stored.packed);
  const Bounds found = bounds(surface, stored.control, samples, displacement, heights, progress);

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
