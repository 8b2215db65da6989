// SPDX-License-Identifier: MIT
// Height fields for Python. Arrays are held, not copied; the Python class lodlab.HeightField prepares them.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "base/errors.h"
#include "bindings/common.h"
#include "geometry/fractal.h"
#include "geometry/height_field.h"
#include "geometry/height_rows.h"

namespace py = pybind11;

namespace lodlab {
namespace {

using Floats = py::array_t<float, py::array::c_style>;
using Mask = py::array_t<uint8_t, py::array::c_style>;

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

/// The keywords of a frame, as frame_dict gives them; those that are missing keep their defaults.
FieldFrame frame_of(int64_t rows, int64_t cols, const py::kwargs& keys) {
  FieldFrame f;
  f.rows = rows;
  f.cols = cols;
  const std::map<std::string, double*> numbers{{"dx", &f.dx},         {"dy", &f.dy},
                                               {"x0", &f.x0},         {"y0", &f.y0},
                                               {"radius", &f.radius}, {"lon0", &f.lon0},
                                               {"lat0", &f.lat0},     {"dlon", &f.dlon},
                                               {"dlat", &f.dlat},     {"height_step", &f.height_step}};
  const std::map<std::string, bool*> flags{{"planet", &f.planet}, {"wraps", &f.wraps}};
  for (const auto& [key, value] : keys) {
    const std::string name = py::str(key);
    if (const auto number = numbers.find(name); number != numbers.end()) {
      *number->second = value.cast<double>();
    } else if (const auto flag = flags.find(name); flag != flags.end()) {
      *flag->second = value.cast<bool>();
    } else {
      throw py::type_error("HeightField: unknown keyword " + name);
    }
  }
  return f;
}

std::shared_ptr<HeightField> make(const Floats& heights, const std::optional<Mask>& valid,
                                  const std::string& spec, const py::kwargs& keys) {
  check_2d(heights, "HeightField");
  const FieldFrame frame = frame_of(heights.shape(0), heights.shape(1), keys);
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

/// Looks for Ctrl-C and passes on how far a reading is; called without the GIL.
Progress ticking(const std::optional<py::function>& progress) {
  return [&progress](const std::string& stage, double share) {
    const py::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (progress) (*progress)(stage, share);
  };
}

std::shared_ptr<WindowedField> survey(const FieldFrame& frame, ReadRows read, const std::string& spec,
                                      const std::optional<py::function>& progress, int64_t at_once) {
  if (at_once < 1) throw InvalidInput("WindowedField: at_once " + std::to_string(at_once) + " is below 1");
  const py::gil_scoped_release release;
  return std::const_pointer_cast<WindowedField>(
      make_windowed_field(frame, std::move(read), spec, ticking(progress), at_once));
}

/// What Python's reader gives for some rows: an array of this type and shape, C-contiguous.
template <class T>
void copy_rows(const py::handle& given, const char* what, int64_t rows, int64_t cols, T* out) {
  using Array = py::array_t<T, py::array::c_style>;
  if (!py::isinstance<Array>(given)) throw InvalidInput(std::string("WindowedField: ") + what);
  const auto array = py::reinterpret_borrow<Array>(given);
  if (array.ndim() != 2 || array.shape(0) != rows || array.shape(1) != cols) {
    throw InvalidInput("WindowedField: " + std::to_string(rows) + " x " + std::to_string(cols) +
                       " samples were asked for, others were read");
  }
  std::copy_n(array.data(), rows * cols, out);
}

/// `read(first_row, rows)` gives heights (rows, cols) float32 and a mask (rows, cols) uint8, or None.
std::shared_ptr<WindowedField> windowed(int64_t rows, int64_t cols, const py::function& read,
                                        const std::string& spec, const std::optional<py::function>& progress,
                                        int64_t at_once, const py::kwargs& keys) {
  const auto held = keep(read);
  const auto from_python = [held, cols](int64_t first, int64_t count, float* heights, uint8_t* valid) {
    const py::gil_scoped_acquire gil;
    const auto& call = *static_cast<const py::object*>(held.get());
    const py::object given = call(first, count);
    if (!py::isinstance<py::tuple>(given) || py::len(given) != 2)
      throw InvalidInput("WindowedField: a reader gives heights and a mask");
    copy_rows(given[py::int_(0)], "its heights are not float32", count, cols, heights);
    if (valid == nullptr) return;
    if (given[py::int_(1)].is_none()) {
      std::fill_n(valid, count * cols, uint8_t{1});
    } else {
      copy_rows(given[py::int_(1)], "its mask is not uint8", count, cols, valid);
    }
  };
  return survey(frame_of(rows, cols, keys), from_python, spec, progress, at_once);
}

/// The generated terrain, its heights times `scale`.
std::shared_ptr<WindowedField> windowed_fractal(int64_t rows, int64_t cols, uint64_t seed, double roughness,
                                                double scale, const std::string& spec,
                                                const std::optional<py::function>& progress,
                                                const py::kwargs& keys) {
  const auto read = [=](int64_t first, int64_t count, float* out, uint8_t* valid) {
    if (valid != nullptr) std::fill_n(valid, count * cols, uint8_t{1});
    fractal_heights({seed, roughness}, first, 0, count, cols, out);
    if (scale == 1.0) return;
    for (int64_t i = 0; i < count * cols; ++i)
      out[i] = static_cast<float>(static_cast<double>(out[i]) * scale);
  };
  return survey(frame_of(rows, cols, keys), read, spec, progress, kSamplesAtOnce);
}

void fill(Floats heights, const std::optional<Mask>& valid) {
  check_2d(heights, "fill_voids");
  const uint8_t* mask = mask_of(valid, heights, "fill_voids");
  float* samples = heights.mutable_data();  // throws when the array is read-only
  const int64_t rows = heights.shape(0), cols = heights.shape(1);
  const py::gil_scoped_release release;
  fill_voids(samples, mask, rows, cols);
}

/// What all sources have, then what all grids of heights have: where they lie, as properties and as a dict.
void bind_sources(py::module_& module) {
  py::class_<Source, std::shared_ptr<Source>>(module, "Source", "What stores are built from.")
      .def_property_readonly("kind", &Source::kind, "heightfield or planet.")
      .def_property_readonly("samples", &Source::samples, "Points that it is made of.")
      .def_readonly("spec", &Source::spec, "A SOURCE that loads it again, or empty.")
      .def("hash", &Source::hash, "32 hex digits, of all that is measured against.",
           py::call_guard<py::gil_scoped_release>());
  py::class_<FieldSource, Source, std::shared_ptr<FieldSource>>(module, "FieldSource", "A grid of heights.")
      .def_readonly("rows", &FieldSource::rows)
      .def_readonly("cols", &FieldSource::cols)
      .def_readonly("dx", &FieldSource::dx)
      .def_readonly("dy", &FieldSource::dy)
      .def_readonly("x0", &FieldSource::x0)
      .def_readonly("y0", &FieldSource::y0)
      .def_readonly("planet", &FieldSource::planet)
      .def_readonly("radius", &FieldSource::radius)
      .def_readonly("lon0", &FieldSource::lon0)
      .def_readonly("lat0", &FieldSource::lat0)
      .def_readonly("dlon", &FieldSource::dlon)
      .def_readonly("dlat", &FieldSource::dlat)
      .def_readonly("wraps", &FieldSource::wraps)
      .def_readonly("z_min", &FieldSource::z_min)
      .def_readonly("z_max", &FieldSource::z_max)
      .def_readonly("height_step", &FieldSource::height_step)
      .def("frame", [](const FieldSource& field) { return frame_dict(field); });
}

void bind_windowed(py::module_& module) {
  py::class_<WindowedField, FieldSource, std::shared_ptr<WindowedField>> type(
      module, "WindowedField", "A grid of heights larger than memory, read by bands of rows.");
  type.def_readonly("voids", &WindowedField::voids, "Samples that are not real.");
  type.def(py::init(&windowed), py::arg("rows"), py::arg("cols"), py::arg("read"), py::kw_only(),
           py::arg("spec") = "", py::arg("progress") = py::none(), py::arg("at_once") = kSamplesAtOnce,
           "Reads everything once, in bands of about `at_once` samples. `read(first_row, rows)` gives (rows, "
           "cols) float32, voids filled, and (rows, cols) uint8, 0 in voids, or None. `progress(stage, "
           "share)`. Further keywords as HeightField's.")
      .def_static("fractal", &windowed_fractal, py::arg("rows"), py::arg("cols"), py::arg("seed"),
                  py::arg("roughness"), py::arg("scale"), py::kw_only(), py::arg("spec") = "",
                  py::arg("progress") = py::none(), "The generated terrain, heights times `scale`.");
}

}  // namespace

void bind_field(py::module_& module) {
  bind_sources(module);
  bind_windowed(module);
  py::class_<HeightField, FieldSource, std::shared_ptr<HeightField>> type(
      module, "HeightField", "A grid of finite heights and where it lies.");
  type.def(py::init(&make), py::arg("heights").noconvert(), py::arg("valid").noconvert() = py::none(),
           py::kw_only(), py::arg("spec") = "",
           "Further keywords: those of frame() but rows, cols, z_min and z_max.")
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
      .def("position", &positions, py::arg("rows"), py::arg("cols"),
           "World positions (N, 3) float64 of samples.");
  module.def("fill_voids", &fill, py::arg("heights").noconvert(), py::arg("valid").noconvert() = py::none(),
             "Fills voids (NaN, or 0 in the mask) of a writable float32 array in place.");
  module.def("fractal", &fractal_window, py::arg("rows"), py::arg("cols"), py::arg("row0") = 0,
             py::arg("col0") = 0, py::arg("seed") = 1, py::arg("roughness") = 0.5,
             "A window of the generated terrain, (rows, cols) float32, metres.");
}

}  // namespace lodlab
