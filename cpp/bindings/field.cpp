// SPDX-License-Identifier: MIT
// Height fields for Python. Arrays are held, not copied; the Python class lodlab.HeightField prepares them.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "base/errors.h"
#include "bindings/common.h"
#include "geometry/fractal.h"
#include "geometry/height_field.h"

namespace py = pybind11;

namespace lodlab {
namespace {

using Floats = py::array_t<float, py::array::c_style>;
using Mask = py::array_t<uint8_t, py::array::c_style>;

/// Holds Python objects for the core; the last owner may let go on any thread.
std::shared_ptr<const void> keep(py::object object) {
  auto* held = new py::object(std::move(object));
  return {static_cast<const void*>(held), [held](const void*) {
            if (!Py_IsInitialized()) return;  // the interpreter took its objects with it
            const py::gil_scoped_acquire gil;
            delete held;
          }};
}

const uint8_t* mask_of(const std::optional<Mask>& valid, const Floats& heights, const char* operation) {
  if (!valid) return nullptr;
  if (valid->ndim() != 2 || valid->shape(0) != heights.shape(0) || valid->shape(1) != heights.shape(1)) {
    throw InvalidInput(std::string(operation) + ": the mask's shape is not that of the heights");
  }
  return valid->data();
}

void check_2d(const Floats& heights, const char* operation) {
  if (heights.ndim() == 2) return;
  throw InvalidInput(std::string(operation) + ": the array has " + std::to_string(heights.ndim()) +
                     " dimensions, not 2");
}

std::shared_ptr<HeightField> make(const Floats& heights, const std::optional<Mask>& valid, double dx,
                                  double dy, double x0, double y0, bool planet, double radius, double lon0,
                                  double lat0, double dlon, double dlat, bool wraps, double height_step,
                                  const std::string& spec) {
  check_2d(heights, "HeightField");
  FieldFrame frame;
  frame.rows = heights.shape(0);
  frame.cols = heights.shape(1);
  frame.dx = dx;
  frame.dy = dy;
  frame.x0 = x0;
  frame.y0 = y0;
  frame.planet = planet;
  frame.radius = radius;
  frame.lon0 = lon0;
  frame.lat0 = lat0;
  frame.dlon = dlon;
  frame.dlat = dlat;
  frame.wraps = wraps;
  frame.height_step = height_step;
  const uint8_t* mask = mask_of(valid, heights, "HeightField");
  const float* samples = heights.data();
  auto owner = keep(valid ? py::object(py::make_tuple(heights, *valid)) : py::object(heights));
  const py::gil_scoped_release release;
  return std::const_pointer_cast<HeightField>(
      make_height_field(frame, samples, mask, std::move(owner), spec));
}

/// A read-only view that keeps the field alive.
template <class T>
py::array_t<T> view_of(const T* data, const py::object& self, const HeightField& field) {
  py::array_t<T> out({field.rows, field.cols}, data, self);
  make_read_only(out);
  return out;
}

py::dict frame_dict(const FieldFrame& f) {
  py::dict out;
  out["rows"] = f.rows;
  out["cols"] = f.cols;
  out["dx"] = f.dx;
  out["dy"] = f.dy;
  out["x0"] = f.x0;
  out["y0"] = f.y0;
  out["planet"] = f.planet;
  out["radius"] = f.radius;
  out["lon0"] = f.lon0;
  out["lat0"] = f.lat0;
  out["dlon"] = f.dlon;
  out["dlat"] = f.dlat;
  out["wraps"] = f.wraps;
  out["z_min"] = f.z_min;
  out["z_max"] = f.z_max;
  out["height_step"] = f.height_step;
  return out;
}

py::array_t<double> positions(const HeightField& field, py::array_t<int64_t, py::array::forcecast> rows,
                              py::array_t<int64_t, py::array::forcecast> cols) {
  if (rows.size() != cols.size()) {
    throw InvalidInput("position: " + std::to_string(rows.size()) + " rows and " +
                       std::to_string(cols.size()) + " columns");
  }
  const auto row = py::array_t<int64_t, py::array::c_style>::ensure(rows.attr("ravel")());
  const auto col = py::array_t<int64_t, py::array::c_style>::ensure(cols.attr("ravel")());
  py::array_t<double> out({row.size(), py::ssize_t{3}});
  for (py::ssize_t i = 0; i < row.size(); ++i) {
    const int64_t r = row.at(i), c = col.at(i);
    if (r < 0 || r >= field.rows || c < 0 || c >= field.cols) {
      throw InvalidInput("position: sample (" + std::to_string(r) + ", " + std::to_string(c) +
                         ") is not one of " + std::to_string(field.rows) + " x " +
                         std::to_string(field.cols));
    }
    const glm::dvec3 p = field.position(r, c, field.at(r, c));
    for (int k = 0; k < 3; ++k) out.mutable_at(i, k) = p[k];
  }
  return out;
}

Floats fractal_window(int64_t rows, int64_t cols, int64_t row0, int64_t col0, uint64_t seed,
                      double roughness) {
  if (rows < 1 || cols < 1 || rows > (int64_t{1} << 31) / cols) {
    throw InvalidInput("fractal: " + std::to_string(rows) + " x " + std::to_string(cols) +
                       " samples; 1 to 2^31 are possible");
  }
  Floats out({rows, cols});
  float* samples = out.mutable_data();
  const py::gil_scoped_release release;
  fractal_heights({seed, roughness}, row0, col0, rows, cols, samples);
  return out;
}

void fill(Floats heights, const std::optional<Mask>& valid) {
  check_2d(heights, "fill_voids");
  const uint8_t* mask = mask_of(valid, heights, "fill_voids");
  float* samples = heights.mutable_data();  // throws when the array is read-only
  const int64_t rows = heights.shape(0), cols = heights.shape(1);
  const py::gil_scoped_release release;
  fill_voids(samples, mask, rows, cols);
}

}  // namespace

void bind_field(py::module_& module) {
  py::class_<HeightField, std::shared_ptr<HeightField>>(module, "HeightField",
                                                        "A grid of finite heights and where it lies.")
      .def(py::init(&make), py::arg("heights").noconvert(), py::arg("valid").noconvert() = py::none(),
           py::kw_only(), py::arg("dx") = 1.0, py::arg("dy") = 1.0, py::arg("x0") = 0.0, py::arg("y0") = 0.0,
           py::arg("planet") = false, py::arg("radius") = 6371000.0, py::arg("lon0") = 0.0,
           py::arg("lat0") = 90.0, py::arg("dlon") = 0.0, py::arg("dlat") = 0.0, py::arg("wraps") = false,
           py::arg("height_step") = 0.0, py::arg("spec") = "")
      .def_property_readonly("heights",
                             [](const py::object& self) {
                               const auto& field = self.cast<const HeightField&>();
                               return view_of(field.heights, self, field);
                             })
      .def_property_readonly("valid",
                             [](const py::object& self) -> py::object {
                               const auto& field = self.cast<const HeightField&>();
                               if (field.valid == nullptr) return py::none();
                               return view_of(field.valid, self, field);
                             })
      .def_readonly("rows", &HeightField::rows)
      .def_readonly("cols", &HeightField::cols)
      .def_readonly("dx", &HeightField::dx)
      .def_readonly("dy", &HeightField::dy)
      .def_readonly("x0", &HeightField::x0)
      .def_readonly("y0", &HeightField::y0)
      .def_readonly("planet", &HeightField::planet)
      .def_readonly("radius", &HeightField::radius)
      .def_readonly("lon0", &HeightField::lon0)
      .def_readonly("lat0", &HeightField::lat0)
      .def_readonly("dlon", &HeightField::dlon)
      .def_readonly("dlat", &HeightField::dlat)
      .def_readonly("wraps", &HeightField::wraps)
      .def_readonly("z_min", &HeightField::z_min)
      .def_readonly("z_max", &HeightField::z_max)
      .def_readonly("height_step", &HeightField::height_step)
      .def_readonly("spec", &HeightField::spec)
      .def("hash", &HeightField::hash, py::call_guard<py::gil_scoped_release>(),
           "32 hex digits of frame, heights and mask.")
      .def("frame", [](const HeightField& field) { return frame_dict(field); })
      .def("position", &positions, py::arg("rows"), py::arg("cols"),
           "World positions (N, 3) float64 of samples.");
  module.def("fill_voids", &fill, py::arg("heights").noconvert(), py::arg("valid").noconvert() = py::none(),
             "Fills voids (NaN, or 0 in the mask) of a writable float32 array in place.");
  module.def("fractal", &fractal_window, py::arg("rows"), py::arg("cols"), py::arg("row0") = 0,
             py::arg("col0") = 0, py::arg("seed") = 1, py::arg("roughness") = 0.5,
             "A window of the generated terrain, (rows, cols) float32, metres.");
}

}  // namespace lodlab
