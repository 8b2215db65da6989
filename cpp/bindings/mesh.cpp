// SPDX-License-Identifier: MIT
// Triangle meshes for Python. Arrays are held, not copied; the Python class lodlab.Mesh prepares them.
#include "geometry/mesh.h"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <optional>
#include <vector>

#include "bindings/common.h"
#include "geometry/cube_sphere.h"

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
          "(2, 3) float64: least and largest coordinates of the vertices that faces use.");
  module.def(
      "cube_sphere", &sphere, py::arg("size"),
      "Unit directions (V, 3) float64 and faces (F, 3) uint32 of a cube's surface, size x size points a "
      "face, blown up.");
  module.def("blob", &blob, py::arg("size"), py::arg("seed"),
             "Positions (V, 3) float64 and faces (F, 3) uint32 of a fractal closed surface, a displaced cube "
             "sphere.");
}

}  // namespace lodlab
