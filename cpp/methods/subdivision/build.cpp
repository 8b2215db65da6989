// SPDX-License-Identifier: MIT
// From a mesh to a store: collapse, sample, bound, write.
#include <algorithm>
#include <chrono>
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

/// What stages take.
class Seconds {
 public:
  void end(const char* stage) {
    const auto now = std::chrono::steady_clock::now();
    all_[stage] = std::chrono::duration<double>(now - begun_).count();
    begun_ = now;
  }
  const nlohmann::ordered_json& all() const { return all_; }

 private:
  std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
  nlohmann::ordered_json all_;
};

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

  Seconds seconds;
  Stored stored;
  const SourceSurface surface(mesh);
  const Meshes poses = options.text("poses") == "none" ? Meshes() : options.meshes("poses");
  ControlMesh control =
      control_mesh(mesh, target > 0 ? target : default_target(mesh, pattern), progress, poses);
  seconds.end("collapse");
  stored.control = subdivision::stored(control, surface.centre);
  stored.control.faces =
      as_coded(stored.control.faces, static_cast<int64_t>(stored.control.positions.size()));
  const Samples samples(stored.control, pattern);
  const Displacement displacement =
      displace(surface, stored.control, samples,
               interpolation ? Sampling::kInterpolation : Sampling::kIntersection, progress);
  seconds.end("sample");
  const PackedHeights packed = pack(samples, displacement.heights, bits);
  stored.heights = unpack(samples, packed);
  const std::vector<float>& heights = stored.heights;
  const Bounds found = bounds(surface, stored.control, samples, displacement, heights, progress);

  seconds.end("bound");
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
  shape.reached_target = control.reached_target ? 1 : 0;
  for (int k = 0; k < 3; ++k) {
    shape.centre[k] = surface.centre[k];
    shape.lo[k] = box.lo[k];
    shape.hi[k] = box.hi[k];
  }
  put(writer, stored, packed);
  seconds.end("write");
  const nlohmann::ordered_json told = {{"control_faces", shape.faces},
                                       {"control_vertices", shape.vertices},
                                       {"reached_target", control.reached_target},
                                       {"samples", samples.count()},
                                       {"missed", displacement.missed},
                                       {"wrong_sheet", displacement.wrong_sheet},
                                       {"averaged", displacement.averaged},
                                       {"average_distance", found.average},
                                       {"seconds", seconds.all()}};
  writer.put_meta("build", told.dump());
}

}  // namespace lodlab::subdivision
