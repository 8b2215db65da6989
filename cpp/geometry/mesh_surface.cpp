// SPDX-License-Identifier: MIT
#include "geometry/mesh_surface.h"

#include <meshoptimizer.h>

#include LODLAB_EMBREE_HEADER  // <embree3/rtcore.h> or <embree4/rtcore.h>
#include <cmath>
#include <string>

#include "base/errors.h"
#include "geometry/bounds.h"
#include "geometry/mesh_edges.h"

namespace lodlab {
namespace {

/// Coordinates of size 1 round by 2^-25 to floats, and so do the few operations that measure a box; this
/// share of all sizes that take part is many times what their roundings can come to.
constexpr double kFloatSlack = 0x1p-20;

/// Closest point of the segment from a to b, exactly b at its end.
glm::dvec3 closest_on_segment(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& point) {
  const glm::dvec3 ab = b - a;
  const double along = glm::dot(point - a, ab), squared = glm::dot(ab, ab);
  if (!(along > 0.0)) return a;
  return along >= squared ? b : a + (along / squared) * ab;
}

/// Squared distance to a triangle, and where.
double measure(const Triangle& t, const glm::dvec3& point, glm::dvec3& closest) {
  const glm::dvec3 ab = t[1] - t[0], ac = t[2] - t[0], ap = point - t[0];
  const glm::dvec3 normal = glm::cross(ab, ac);
  const double square = glm::dot(normal, normal);
  if (square > kFlattest * kFlattest * glm::dot(ab, ab) * glm::dot(ac, ac)) {
    const double w = glm::dot(glm::cross(ab, ap), normal), v = glm::dot(glm::cross(ap, ac), normal);
    if (w > 0.0 && v > 0.0 && v + w < square && point != t[1] && point != t[2]) {
      const double height = glm::dot(ap, normal);
      closest = point - (height / square) * normal;
      return height * height / square;
    }
  }
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    const glm::dvec3 at = closest_on_segment(t[i], t[(i + 1) % 3], point), gap = point - at;
    const double squared = glm::dot(gap, gap);
    if (!(squared < best)) continue;
    best = squared;
    closest = at;
  }
  return best;
}

/// The radius of a query that loses nothing within a scaled distance. `reach`: what floats round at, scaled.
float padded(double distance, double reach) {
  return static_cast<float>(distance + kFloatSlack * (reach + distance));
}

struct Search {
  const WeldedMesh& mesh;
  glm::dvec3 point;
  double scale, reach;
  const std::function<bool(uint32_t, double)>* is = nullptr;  ///< what alone is asked for
  double squared = std::numeric_limits<double>::infinity();
  glm::dvec3 closest{std::numeric_limits<double>::quiet_NaN()};
  uint32_t triangle = kNoTriangle;

  void consider(uint32_t candidate) {
    glm::dvec3 at;
    const double found = measure(mesh.triangle(candidate), point, at);
    if (found > squared || (found == squared && candidate >= triangle)) return;
    if (is != nullptr && !(*is)(candidate, std::sqrt(found))) return;
    squared = found;
    closest = at;
    triangle = candidate;
  }
  float radius() const { return padded(scale * std::sqrt(squared), reach); }
};

bool visit(RTCPointQueryFunctionArguments* arguments) {
  auto& search = *static_cast<Search*>(arguments->userPtr);
  const double before = search.squared;
  search.consider(arguments->primID);
  if (!(search.squared < before)) return false;
  arguments->query->radius = search.radius();
  return true;
}

struct Looking {
  const WeldedMesh& mesh;
  glm::dvec3 point;
  double distance;
  const std::function<bool(uint32_t)>& is;
  bool found = false;
};

bool look(RTCPointQueryFunctionArguments* arguments) {
  auto& looking = *static_cast<Looking*>(arguments->userPtr);
  const uint32_t candidate = arguments->primID;
  if (looking.found ||
      closest_on_triangle(looking.mesh.triangle(candidate), looking.point).distance > looking.distance ||
      !looking.is(candidate))
    return false;
  looking.found = true;
  arguments->query->radius = 0.0f;
  return true;
}

struct Bounded {
  const WeldedMesh& mesh;
  double scale;
};

/// Where the line through a point cuts a triangle whose normal runs along it, in lengths of the direction;
/// nan where it does not. The volumes that tell change their sign alone when an edge is run the other way.
double crossing(const Triangle& t, const glm::dvec3& origin, const glm::dvec3& direction) {
  const glm::dvec3 a = t[0] - origin, b = t[1] - origin, c = t[2] - origin;
  const double u = glm::dot(direction, glm::cross(b, c)), v = glm::dot(direction, glm::cross(c, a)),
               w = glm::dot(direction, glm::cross(a, b)), sum = u + v + w;
  if (!(u >= 0.0 && v >= 0.0 && w >= 0.0 && sum > 0.0)) return std::numeric_limits<double>::quiet_NaN();
  return glm::dot((u * a + v * b + w * c) / sum, direction) / glm::dot(direction, direction);
}

#if RTC_VERSION_MAJOR >= 4
using RayContext = RTCRayQueryContext;
#else
using RayContext = RTCIntersectContext;
#endif

/// A line, of which Embree follows one half at a time.
struct Line {
  RayContext context;  ///< the first member: Embree hands it back
  glm::dvec3 origin, direction;
  double reach;
  const std::function<bool(uint32_t)>& is;
  Crossing found{};

  void consider(const Triangle& triangle, uint32_t index) {
    const double along = crossing(triangle, origin, direction);
    if (!(std::abs(along) <= reach)) return;
    const bool first = found.triangle == kNoTriangle || std::abs(along) < std::abs(found.along);
    const bool tie = !first && std::abs(along) == std::abs(found.along) &&
                     (along > found.along || (along == found.along && index < found.triangle));
    if ((!first && !tie) || !is(index)) return;
    found = {along, index};
    reach = std::abs(along);
  }
};

void cut(const RTCIntersectFunctionNArguments* arguments) {
  if (arguments->valid[0] == 0) return;
  auto& line = *reinterpret_cast<Line*>(arguments->context);
  const auto& bounded = *static_cast<const Bounded*>(arguments->geometryUserPtr);
  const double before = line.reach;
  line.consider(bounded.mesh.triangle(arguments->primID), arguments->primID);
  if (!(line.reach < before)) return;
  RTCRayN* const ray = RTCRayHitN_RayN(arguments->rayhit, arguments->N);
  const double length = bounded.scale * glm::length(line.direction) * line.reach;
  RTCRayN_tfar(ray, arguments->N, 0) =
      std::min(RTCRayN_tfar(ray, arguments->N, 0), static_cast<float>(length + kFloatSlack * (2.0 + length)));
}

void bound(const RTCBoundsFunctionArguments* arguments) {
  const auto& bounded = *static_cast<const Bounded*>(arguments->geometryUserPtr);
  Box box;
  for (const glm::dvec3& corner : bounded.mesh.triangle(arguments->primID)) box.add(bounded.scale * corner);
  // Wider than what a line's origin and its way are rounded by; for closest points one step would do.
  const auto down = [](double v) { return static_cast<float>(v - kFloatSlack); };
  const auto up = [](double v) { return static_cast<float>(v + kFloatSlack); };
  RTCBounds& out = *arguments->bounds_o;
  out.lower_x = down(box.lo.x), out.lower_y = down(box.lo.y), out.lower_z = down(box.lo.z);
  out.upper_x = up(box.hi.x), out.upper_y = up(box.hi.y), out.upper_z = up(box.hi.z);
}

void query(RTCScene scene, const glm::dvec3& scaled, float radius, RTCPointQueryFunction visitor,
           void* user) {
  RTCPointQuery query{};
  query.x = static_cast<float>(scaled.x);
  query.y = static_cast<float>(scaled.y);
  query.z = static_cast<float>(scaled.z);
  query.radius = radius;
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(scene, &query, &context, visitor, user);
}

double largest(const glm::dvec3& v) { return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)}); }

}  // namespace

WeldedMesh weld(std::span<const Triangle> triangles, const glm::dvec3& centre) {
  WeldedMesh out;
  if (triangles.empty()) return out;
  const size_t corners = 3 * triangles.size();
  if (corners >= kNoTriangle) {
    throw Unsupported("mesh distance: " + std::to_string(triangles.size()) +
                      " triangles; at most 1431655764 can be measured");
  }
  std::vector<uint32_t> vertex(corners);
  const size_t unique = meshopt_generateVertexRemap(vertex.data(), nullptr, corners, triangles.data(),
                                                    corners, sizeof(glm::dvec3));
  out.positions.resize(unique);
  out.faces.resize(triangles.size());
  for (size_t i = 0; i < corners; ++i) {
    out.positions[vertex[i]] = triangles[i / 3][i % 3] - centre;
    out.faces[i / 3][i % 3] = vertex[i];
  }
  return out;
}

WeldedMesh unmatched_edges(const WeldedMesh& mesh) {
  const MeshEdges edges = mesh_edges(mesh.faces, static_cast<int64_t>(mesh.positions.size()));
  WeldedMesh out;
  for (int64_t e = 0; e < edges.count(); ++e) {
    const std::span<const uint32_t> sides = edges.of(e);
    const auto start = [&](uint32_t side) { return vertex_of(mesh.faces, side); };
    const uint32_t from = start(sides[0]), to = start(side_end(sides[0]));
    if (sides.size() == 2 && start(sides[1]) == to) continue;
    const auto first = static_cast<uint32_t>(out.positions.size());
    out.positions.push_back(mesh.positions[std::min(from, to)]);
    out.positions.push_back(mesh.positions[std::max(from, to)]);
    out.faces.push_back({first, first + 1, first + 1});
  }
  return out;
}

Closest closest_on_triangle(const Triangle& triangle, const glm::dvec3& point) {
  Closest out;
  out.distance = std::sqrt(measure(triangle, point, out.point));
  out.triangle = 0;
  return out;
}

struct MeshSurface::Scene {
  Bounded bounded;
  RTCDevice device = rtcNewDevice(nullptr);
  RTCScene scene = nullptr;

  explicit Scene(const Bounded& of) : bounded(of) {
    if (device != nullptr) {
      scene = rtcNewScene(device);
      rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
      const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
      rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(of.mesh.faces.size()));
      rtcSetGeometryUserData(geometry, &bounded);
      rtcSetGeometryBoundsFunction(geometry, &bound, nullptr);
      rtcSetGeometryIntersectFunction(geometry, &cut);
      rtcCommitGeometry(geometry);
      rtcAttachGeometry(scene, geometry);
      rtcReleaseGeometry(geometry);
      rtcCommitScene(scene);
    }
    if (const RTCError error = rtcGetDeviceError(device); error != RTC_ERROR_NONE) {
      release();
      throw Unsupported("mesh distance: Embree cannot take " + std::to_string(of.mesh.faces.size()) +
                        " triangles: its error " + std::to_string(static_cast<int>(error)));
    }
  }
  ~Scene() { release(); }
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

 private:
  void release() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }
};

MeshSurface::MeshSurface(const WeldedMesh& mesh) : mesh_(mesh) {
  if (mesh.faces.empty()) return;
  double reach = 0.0;
  for (const glm::dvec3& position : mesh.positions) reach = std::max(reach, largest(position));
  if (reach > 0.0) scale_ = std::ldexp(1.0, -std::ilogb(reach) - 1);
  scene_ = std::make_unique<Scene>(Bounded{mesh_, scale_});
}

MeshSurface::~MeshSurface() = default;

Closest MeshSurface::closest(const glm::dvec3& point, uint32_t hint) const {
  if (scene_ == nullptr) return {};
  const glm::dvec3 scaled = scale_ * point;
  Search search{mesh_, point, scale_, 1.0 + largest(scaled)};
  if (hint != kNoTriangle) search.consider(hint);
  query(scene_->scene, scaled, search.radius(), &visit, &search);
  return {std::sqrt(search.squared), search.closest, search.triangle};
}

Closest MeshSurface::closest_within(const glm::dvec3& point, double distance,
                                    const std::function<bool(uint32_t, double)>& is) const {
  if (scene_ == nullptr) return {};
  const glm::dvec3 scaled = scale_ * point;
  Search search{mesh_, point, scale_, 1.0 + largest(scaled), &is};
  query(scene_->scene, scaled, padded(scale_ * distance, search.reach), &visit, &search);
  return {std::sqrt(search.squared), search.closest, search.triangle};
}

bool MeshSurface::any_within(const glm::dvec3& point, double distance,
                             const std::function<bool(uint32_t)>& is) const {
  if (scene_ == nullptr) return false;
  const glm::dvec3 scaled = scale_ * point;
  Looking looking{mesh_, point, distance, is};
  query(scene_->scene, scaled, padded(scale_ * distance, 1.0 + largest(scaled)), &look, &looking);
  return looking.found;
}

Crossing MeshSurface::closest_crossing(const glm::dvec3& origin, const glm::dvec3& direction, double reach,
                                       const std::function<bool(uint32_t)>& is) const {
  if (scene_ == nullptr) return {};
  Line line{{}, origin, direction, reach, is};
#if RTC_VERSION_MAJOR >= 4
  rtcInitRayQueryContext(&line.context);
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.context = &line.context;
  const auto follow = [&](RTCRayHit& ray) { rtcIntersect1(scene_->scene, &ray, &arguments); };
#else
  rtcInitIntersectContext(&line.context);
  const auto follow = [&](RTCRayHit& ray) { rtcIntersect1(scene_->scene, &line.context, &ray); };
#endif
  const double size = glm::length(direction);
  const glm::dvec3 at = scale_ * origin, ahead = direction / size;
  for (const double way : {1.0, -1.0}) {
    const double length = scale_ * size * line.reach;
    RTCRayHit ray{};
    ray.ray.org_x = static_cast<float>(at.x);
    ray.ray.org_y = static_cast<float>(at.y);
    ray.ray.org_z = static_cast<float>(at.z);
    ray.ray.dir_x = static_cast<float>(way * ahead.x);
    ray.ray.dir_y = static_cast<float>(way * ahead.y);
    ray.ray.dir_z = static_cast<float>(way * ahead.z);
    ray.ray.tfar = static_cast<float>(length + kFloatSlack * (2.0 + length));
    ray.ray.mask = ~0u;
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    follow(ray);
  }
  return line.found;
}

}  // namespace lodlab
