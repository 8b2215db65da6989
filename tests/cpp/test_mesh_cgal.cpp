// SPDX-License-Identifier: MIT
// The two-sided maximum beside CGAL's bounded_error_symmetric_Hausdorff_distance, an independent branch and
// bound, on six pairs. Built where CGAL is found (Debian's libcgal-dev): nothing else needs it.
#include <CGAL/Simple_cartesian.h>  // before those that use it

#include <CGAL/Polygon_mesh_processing/distance.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/boost/graph/IO/polygon_mesh_io.h>
#include <doctest/doctest.h>
#include <meshoptimizer.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <glm/gtc/constants.hpp>
#include <optional>
#include <string>

#include "geometry/bounds.h"
#include "geometry/mesh_distance.h"
#include "instrument/mesh_error.h"

using namespace lodlab;

namespace {

using Point = CGAL::Simple_cartesian<double>::Point_3;
using Surface = CGAL::Surface_mesh<Point>;
using Place = std::function<glm::dvec3(double u, double v)>;  // of [0, 1] x [0, 1]

/// As much of a soup of indices as is a manifold: both tools are given that.
Surface surface_of(const std::vector<Point>& points, const std::vector<uint32_t>& indices) {
  Surface out;
  for (const Point& p : points) out.add_vertex(p);
  const auto vertex = [](uint32_t index) { return Surface::Vertex_index(index); };
  for (size_t i = 0; i + 2 < indices.size(); i += 3)
    out.add_face(vertex(indices[i]), vertex(indices[i + 1]), vertex(indices[i + 2]));
  return out;
}

/// rows x cols cells; closed both ways where it wraps.
Surface swept(uint32_t rows, uint32_t cols, bool wraps, const Place& at) {
  const uint32_t width = wraps ? cols : cols + 1, height = wraps ? rows : rows + 1;
  std::vector<Point> points;
  for (uint32_t row = 0; row < height; ++row) {
    for (uint32_t col = 0; col < width; ++col) {
      const glm::dvec3 p = at(double(row) / rows, double(col) / cols);
      points.emplace_back(p.x, p.y, p.z);
    }
  }
  std::vector<uint32_t> indices;
  for (uint32_t row = 0; row < rows; ++row) {
    for (uint32_t col = 0; col < cols; ++col) {
      const auto name = [&](uint32_t r, uint32_t c) { return r % height * width + c % width; };
      const uint32_t a = name(row, col), b = name(row + 1, col), c = name(row + 1, col + 1),
                     d = name(row, col + 1);
      indices.insert(indices.end(), {a, b, c, a, c, d});
    }
  }
  return surface_of(points, indices);
}

glm::dvec3 ring(double u, double v, double tube) {
  const double a = glm::two_pi<double>() * u, b = glm::two_pi<double>() * v, r = 1.0 + tube * std::cos(b);
  return {r * std::cos(a), r * std::sin(a), tube * std::sin(b)};
}

Surface torus(uint32_t rows, uint32_t cols) {
  return swept(rows, cols, true, [](double u, double v) { return ring(u, v, 0.4); });
}

Surface knobbly(uint32_t rows, uint32_t cols) {
  return swept(rows, cols, true, [](double u, double v) {
    return ring(u, v, 0.4 + 0.05 * std::sin(60.0 * u) * std::cos(40.0 * v));
  });
}

Surface patch(uint32_t cells) {
  return swept(cells, cells, false, [](double u, double v) {
    return glm::dvec3(u, v, 0.1 * std::sin(9.0 * u) * std::cos(7.0 * v));
  });
}

Surface two_parts() {
  Surface out = torus(48, 24);
  out.join(
      swept(24, 12, true, [](double u, double v) { return 0.5 * ring(u, v, 0.3) + glm::dvec3(2, 1, 0); }));
  return out;
}

/// A file of the shared data; nothing where it is not there.
std::optional<Surface> real(const char* name) {
  const char* folder = std::getenv("LODLAB_DATA");
  const std::filesystem::path path =
      std::filesystem::path(folder == nullptr ? "../shared/data" : folder) / name;
  if (!std::filesystem::exists(path)) return std::nullopt;
  Surface out;
  REQUIRE(CGAL::IO::read_polygon_mesh(path.string(), out));
  return out;
}

Surface simplified(const Surface& mesh, size_t triangles) {
  std::vector<Point> points;
  std::vector<float> floats;
  for (const auto vertex : mesh.vertices()) {
    const Point& p = points.emplace_back(mesh.point(vertex));
    floats.insert(floats.end(), {float(p.x()), float(p.y()), float(p.z())});
  }
  std::vector<uint32_t> indices;
  for (const auto face : mesh.faces()) {
    for (const auto vertex : mesh.vertices_around_face(mesh.halfedge(face))) indices.push_back(vertex);
  }
  indices.resize(meshopt_simplify(indices.data(), indices.data(), indices.size(), floats.data(),
                                  points.size(), 3 * sizeof(float), 3 * triangles, 1.0f, 0, nullptr));
  return surface_of(points, indices);
}

std::vector<Triangle> soup_of(const Surface& mesh) {
  std::vector<Triangle> out;
  for (const auto face : mesh.faces()) {
    size_t i = 0;
    out.emplace_back();
    for (const auto vertex : mesh.vertices_around_face(mesh.halfedge(face))) {
      const Point& p = mesh.point(vertex);
      out.back()[i++] = {p.x(), p.y(), p.z()};
    }
  }
  return out;
}

void compare(const std::string& name, const Surface& source, const Surface& drawn) {
  const std::vector<Triangle> triangles = soup_of(source);
  Box box;
  for (const Triangle& triangle : triangles) {
    for (const glm::dvec3& p : triangle) box.add(p);
  }
  const WeldedMesh one = weld(triangles, box.center()), other = weld(soup_of(drawn), box.center());
  const MeshSurface from(one), to(other);
  const double extent = glm::distance(box.lo, box.hi), error = 1e-4 * extent;
  const instrument::TwoSided both = instrument::two_sided(from, to, closest_to_vertices(one, to), extent);
  const double ours = std::max(both.max_to_drawn, both.max_to_source);
  const double theirs =
      CGAL::Polygon_mesh_processing::bounded_error_symmetric_Hausdorff_distance<CGAL::Sequential_tag>(
          source, drawn, error);
  INFO(name << ": " << ours << " beside " << theirs << " within " << error);
  CHECK(std::abs(ours - theirs) <= error + kMaxTolerance * ours);
  CHECK(ours > 2.0 * error);  // or the bound says nothing
}

}  // namespace

TEST_CASE("the two-sided maximum agrees with CGAL's within its error") {
  compare("torus", torus(128, 64), torus(24, 12));
  compare("knobbly torus", knobbly(96, 48), knobbly(32, 16));
  compare("a component dropped", two_parts(), torus(48, 24));
  compare("open patch", patch(60), patch(9));
}

TEST_CASE("the same on simplified scans, one with holes") {
  for (const char* name : {"mesh/armadillo.off", "mesh/bunny_stanford_holes.ply"}) {
    const std::optional<Surface> mesh = real(name);
    if (!mesh) {
      const char* must = std::getenv("LODLAB_REQUIRE_DATA");
      REQUIRE_MESSAGE((must == nullptr || std::string(must) != "1"), name << " is not there");
      continue;
    }
    compare(name, *mesh, simplified(*mesh, 4000));
  }
}
