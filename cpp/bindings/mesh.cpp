// SPDX-License-Identifier: MIT
// Triangle meshes for Python. Arrays are held, not copied; the Python class lodlab.Mesh prepares them.
#include "geometry/mesh.h"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <limits>
#include <optional>
#include <vector>

#include "bindings/common.h"
#include "geometry/cube_sphere.h"
#include "geometry/mesh_census.h"
#include "geometry/mesh_repair.h"
#include "geometry/polygons.h"

namespace py = pybind11;

namespace lodlab {
namespace {

std::shared_ptr<Mesh> make(const py::array& positions, const py::array& faces,
                           const std::optional<py::array>& colors, const std::optional<py::array>& normals,
                           const std::string& spec) {
  const auto points = checked<double>("mesh", positions, "positions", {-1, 3}, "(V, 3) float64");
  const auto triangles = checked<uint32_t>("mesh", faces, "faces", {-1, 3}, "(F, 3) uint32");
  py::list kept;
  kept.append(points);
  kept.append(triangles);
  MeshArrays arrays{span_of<glm::dvec3>(points), span_of<Face>(triangles), {}, {}, {}};
  if (colors) {
    const auto given = checked<uint8_t>("mesh", *colors, "colors", {-1, 4}, "(V, 4) uint8");
    arrays.colors = span_of<glm::u8vec4>(given);
    kept.append(given);
  }
  if (normals) {
    const auto given = checked<float>("mesh", *normals, "normals", {-1, 3}, "(V, 3) float32");
    arrays.normals = span_of<glm::vec3>(given);
    kept.append(given);
  }
  arrays.owner = keep(kept);
  const py::gil_scoped_release release;
  return std::const_pointer_cast<Mesh>(make_mesh(std::move(arrays), spec));
}

/// Rows of `width` components, read-only; the array keeps the mesh alive.
template <class T, class Element>
py::object rows(std::span<const Element> elements, const py::object& self) {
  const auto width = static_cast<py::ssize_t>(sizeof(Element) / sizeof(T));
  py::array_t<T> out({static_cast<py::ssize_t>(elements.size()), width},
                     reinterpret_cast<const T*>(elements.data()), self);
  make_read_only(out);
  return out;
}

/// A vector's elements as rows of `width` components, without a copy.
template <class T, class Element>
py::array_t<T> as_rows(std::vector<Element> elements) {
  auto* kept = new std::vector<Element>(std::move(elements));
  const py::capsule owner(kept, [](void* held) { delete static_cast<std::vector<Element>*>(held); });
  const auto width = static_cast<py::ssize_t>(sizeof(Element) / sizeof(T));
  return py::array_t<T>({static_cast<py::ssize_t>(kept->size()), width},
                        reinterpret_cast<const T*>(kept->data()), owner);
}

py::dict census(const Mesh& mesh) {
  MeshCensus counted;
  {
    const py::gil_scoped_release release;
    counted = mesh_census(mesh);
  }
  py::dict out;
  out["components"] = counted.components;
  out["boundary_edges"] = counted.boundary_edges;
  out["nonmanifold_edges"] = counted.nonmanifold_edges;
  out["nonmanifold_vertices"] = counted.nonmanifold_vertices;
  out["genus"] = counted.genus;
  out["duplicate_triangles"] = counted.duplicate_triangles;
  out["degenerate_triangles"] = counted.degenerate_triangles;
  out["unused_vertices"] = counted.unused_vertices;
  out["oriented"] = counted.oriented;
  return out;
}

py::array_t<uint32_t> as_array(std::vector<uint32_t> values) {
  auto rows = as_rows<uint32_t>(std::move(values));
  return rows.reshape({rows.size()});
}

py::tuple repaired(const Mesh& mesh, const Repairs& wanted) {
  Repaired made;
  {
    const py::gil_scoped_release release;
    made = repair(mesh, wanted);
  }
  py::dict counts;
  counts["welded"] = made.welded;
  counts["degenerate"] = made.degenerate;
  counts["duplicates"] = made.duplicates;
  counts["turned"] = made.turned;
  counts["inside_out"] = made.inside_out;
  counts["one_sided"] = made.one_sided;
  counts["split"] = made.split;
  counts["unused"] = made.unused;
  return py::make_tuple(as_array(std::move(made.origin)), as_rows<uint32_t>(std::move(made.faces)), counts);
}

py::array_t<uint32_t> same_positions(const py::array& positions) {
  const auto points = checked<double>("first_at_position", positions, "positions", {-1, 3}, "(V, 3) float64");
  if (points.shape(0) > std::numeric_limits<uint32_t>::max())
    throw InvalidInput("first_at_position: more than 2^32 - 1");
  std::vector<uint32_t> first;
  {
    const py::gil_scoped_release release;
    first = first_at_position(span_of<glm::dvec3>(points));
  }
  return as_array(std::move(first));
}

py::array_t<uint32_t> polygons(const py::array& positions, const py::array& corners, const py::array& sizes) {
  const std::string who = "polygon_triangles";
  const auto points = checked<double>(who, positions, "positions", {-1, 3}, "(V, 3) float64");
  const auto indices = checked<uint32_t>(who, corners, "corners", {-1}, "(C,) uint32");
  const auto counts = checked<int64_t>(who, sizes, "sizes", {-1}, "(P,) int64");
  const auto corner_span = span_of<uint32_t>(indices);
  const auto size_span = span_of<int64_t>(counts);
  int64_t total = 0;
  for (const int64_t size : size_span) {
    if (size < 0 || size > static_cast<int64_t>(corner_span.size()) - total) {
      throw InvalidInput(who + ": sizes that do not add up to the corners");
    }
    total += size;
  }
  for (const uint32_t corner : corner_span) {
    if (corner >= points.shape(0)) throw InvalidInput(who + ": a corner that is no vertex");
  }
  std::vector<Face> faces;
  {
    const py::gil_scoped_release release;
    faces = polygon_triangles(span_of<glm::dvec3>(points), corner_span, size_span);
  }
  return as_rows<uint32_t>(std::move(faces));
}

py::tuple sphere(int64_t size) {
  CubeSphere made;
  {
    const py::gil_scoped_release release;
    made = cube_sphere(size);
  }
  return py::make_tuple(as_rows<double>(std::move(made.directions)),
                        as_rows<uint32_t>(std::move(made.faces)));
}

py::tuple blob(int64_t size, uint64_t seed) {
  CubeSphere made;
  {
    const py::gil_scoped_release release;
    made = cube_sphere(size);
    constexpr double kQuarter = 1.5707963267948966, kCells = 3.0;  // cells of the shortest wave
    displace_into_blob(made.directions, seed, kCells * kQuarter / static_cast<double>(size - 1));
  }
  return py::make_tuple(as_rows<double>(std::move(made.directions)),
                        as_rows<uint32_t>(std::move(made.faces)));
}

}  // namespace

void bind_mesh(py::module_& module) {
  const auto mesh = [](const py::object& self) -> const Mesh& { return self.cast<const Mesh&>(); };
  py::class_<Mesh, Source, std::shared_ptr<Mesh>>(module, "Mesh", "Triangles that index vertices.")
      .def(py::init(&make), py::arg("positions"), py::arg("faces"), py::arg("colors") = py::none(),
           py::arg("normals") = py::none(), py::kw_only(), py::arg("spec") = "",
           "positions (V, 3) float64, faces (F, 3) uint32, colors (V, 4) uint8, normals (V, 3) float32. "
           "InvalidInput for other arrays, indices out of range, and positions that are not finite.")
      .def_property_readonly(
          "positions", [mesh](const py::object& self) { return rows<double>(mesh(self).positions, self); })
      .def_property_readonly(
          "faces", [mesh](const py::object& self) { return rows<uint32_t>(mesh(self).faces, self); })
      .def_property_readonly("colors",
                             [mesh](const py::object& self) -> py::object {
                               if (mesh(self).colors.empty()) return py::none();
                               return rows<uint8_t>(mesh(self).colors, self);
                             })
      .def_property_readonly("normals",
                             [mesh](const py::object& self) -> py::object {
                               if (mesh(self).normals.empty()) return py::none();
                               return rows<float>(mesh(self).normals, self);
                             })
      .def_property_readonly(
          "bounds",
          [](const Mesh& m) {
            py::array_t<double> out({2, 3});
            for (int i = 0; i < 3; ++i) {
              out.mutable_at(0, i) = m.box.lo[i];
              out.mutable_at(1, i) = m.box.hi[i];
            }
            return out;
          },
          "(2, 3) float64: least and largest coordinates of the vertices that faces use.")
      .def("census", &census, "What kind of surface it is, counted: as geometry/mesh_census.h has it.")
      .def(
          "repaired",
          [](const Mesh& m, bool weld, bool degenerate, bool duplicates, bool orient, bool split,
             bool unused) {
            return repaired(m, {weld, degenerate, duplicates, orient, split, unused});
          },
          py::kw_only(), py::arg("weld") = false, py::arg("degenerate") = false,
          py::arg("duplicates") = false, py::arg("orient") = false, py::arg("split") = false,
          py::arg("unused") = false,
          "The vertex that each vertex was (V',) uint32, faces (F', 3) uint32, and what was done, counted: "
          "as "
          "geometry/mesh_repair.h has it.");
  module.def("first_at_position", &same_positions, py::arg("positions"),
             "(V,) uint32: for each of (V, 3) positions the first that equals it.");
  module.def(
      "polygon_triangles", &polygons, py::arg("positions"), py::arg("corners"), py::arg("sizes"),
      "Faces (F, 3) uint32 of polygons: `sizes` (P,) int64 corners each, (C,) uint32 one after the other.");
  module.def(
      "cube_sphere", &sphere, py::arg("size"),
      "Unit directions (V, 3) float64 and faces (F, 3) uint32 of a cube's surface, size x size points a "
      "face, blown up.");
  module.def("blob", &blob, py::arg("size"), py::arg("seed"),
             "Positions (V, 3) float64 and faces (F, 3) uint32 of a fractal closed surface, a displaced cube "
             "sphere.");
}

}  // namespace lodlab
