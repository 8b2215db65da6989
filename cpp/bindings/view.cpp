// SPDX-License-Identifier: MIT
// Views and budgets for Python: checked when made, then immutable.
#include "geometry/view.h"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <array>
#include <cmath>
#include <limits>

#include "base/errors.h"
#include "bindings/view.h"
#include "method/method.h"

namespace py = pybind11;

namespace lodlab {
namespace {

std::string text_of(const py::handle& object) { return py::repr(object).cast<std::string>(); }

double number(const std::string& name, const py::handle& object) {
  const double value = PyFloat_AsDouble(object.ptr());
  if (PyErr_Occurred() != nullptr) {
    PyErr_Clear();
    throw InvalidInput(name + " " + text_of(object) + " is not a number");
  }
  return value;
}

int64_t whole(const std::string& name, const py::handle& object) {
  const py::object index = py::reinterpret_steal<py::object>(PyNumber_Index(object.ptr()));
  int overflow = 0;
  const long long value = index ? PyLong_AsLongLongAndOverflow(index.ptr(), &overflow) : 0;
  if (PyErr_Occurred() != nullptr) {
    PyErr_Clear();
    throw InvalidInput(name + " " + text_of(object) + " is not a whole number");
  }
  if (overflow == 0) return value;
  return overflow > 0 ? std::numeric_limits<int64_t>::max() : std::numeric_limits<int64_t>::min();
}

template <class T, size_t count, class Convert>
std::array<T, count> several(const std::string& name, const py::handle& object, const Convert& convert) {
  const py::object list = py::reinterpret_steal<py::object>(PySequence_List(object.ptr()));
  if (!list) PyErr_Clear();
  if (!list || py::len(list) != count) {
    throw InvalidInput(name + " " + text_of(object) + " is not " + std::to_string(count) + " numbers");
  }
  std::array<T, count> out;
  for (size_t i = 0; i < count; ++i) out[i] = convert(name, list[py::int_(i)]);
  return out;
}

glm::dvec3 vector(const std::string& name, const py::handle& object) {
  const auto v = several<double, 3>(name, object, number);
  return {v[0], v[1], v[2]};
}

/// Refuses arguments that there are none of, naming those there are, and the one that has these letters in
/// this order (px: pixel_error).
void refuse_unknown(const std::string& what, const py::kwargs& given,
                    std::initializer_list<std::string> known) {
  if (given.empty()) return;
  const std::string wrong = given.begin()->first.cast<std::string>();
  std::string all, meant;
  for (const std::string& name : known) {
    size_t at = 0;
    for (const char letter : name) at += at < wrong.size() && letter == wrong[at] ? 1 : 0;
    if (meant.empty() && at == wrong.size() && name[0] == wrong[0]) meant = name;
    all += (all.empty() ? "" : ", ") + name;
  }
  throw InvalidInput(what + ": no argument '" + wrong + "'; there are " + all +
                     (meant.empty() ? "" : " (did you mean " + meant + "?)"));
}

/// Sides too large for an int are out of any range: make_camera says so.
int side(int64_t value) {
  return static_cast<int>(
      std::clamp<int64_t>(value, std::numeric_limits<int>::min(), std::numeric_limits<int>::max()));
}

View make_view(const py::object& eye, const py::object& target, const py::object& up, const py::object& fov,
               const py::object& size, const py::object& near, const py::kwargs& unknown) {
  refuse_unknown("view", unknown, {"eye", "target", "up", "fov", "size", "near"});
  View view;
  view.eye = vector("view: eye", eye);
  view.target = vector("view: target", target);
  view.up = vector("view: up", up);
  view.fov = number("view: fov", fov);
  const auto sides = several<int64_t, 2>("view: size (width, height)", size, whole);
  view.width = side(sides[0]);
  view.height = side(sides[1]);
  if (!near.is_none()) {
    view.near_plane = number("view: near", near);
    if (!(view.near_plane > 0.0)) throw InvalidInput("view: near " + text_of(near) + " is not above 0");
  }
  make_camera(view);
  return view;
}

py::array_t<double> array_of(const glm::dvec3& v) {
  py::array_t<double> out(3);
  for (int i = 0; i < 3; ++i) out.mutable_at(i) = v[i];
  return out;
}

py::array_t<double> matrix(const View& view) {
  const glm::dmat4 clip = make_camera(view).clip_from_world();
  py::array_t<double> out({4, 4});
  for (int row = 0; row < 4; ++row) {
    for (int col = 0; col < 4; ++col) out.mutable_at(row, col) = clip[col][row];
  }
  return out;
}

py::tuple arguments(const View& v) {
  const py::object near = v.near_plane > 0.0 ? py::object(py::float_(v.near_plane)) : py::object(py::none());
  const auto tuple = [](const glm::dvec3& p) { return py::make_tuple(p.x, p.y, p.z); };
  return py::make_tuple(tuple(v.eye), tuple(v.target), tuple(v.up), v.fov, py::make_tuple(v.width, v.height),
                        near);
}

std::string view_text(const View& view) {
  const py::tuple a = arguments(view);
  return "View(eye=" + text_of(a[0]) + ", target=" + text_of(a[1]) + ", up=" + text_of(a[2]) +
         ", fov=" + text_of(a[3]) + ", size=" + text_of(a[4]) + ", near=" + text_of(a[5]) + ")";
}

Budget make_budget(const py::object& pixel_error, const py::object& triangles, const py::object& nodes,
                   const py::kwargs& unknown) {
  refuse_unknown("budget", unknown, {"pixel_error", "triangles", "nodes"});
  Budget budget;
  if (!pixel_error.is_none()) {
    budget.pixel_error = number("budget: pixel_error", pixel_error);
    if (!(*budget.pixel_error > 0.0)) {
      throw InvalidInput("budget: pixel_error " + text_of(pixel_error) + " is not above 0");
    }
  }
  const auto count = [](const char* name, const py::object& object) -> std::optional<int64_t> {
    if (object.is_none()) return std::nullopt;
    const int64_t value = whole(name, object);
    if (value < 1) throw InvalidInput(std::string(name) + " " + text_of(object) + " is not above 0");
    return value;
  };
  budget.triangles = count("budget: triangles", triangles);
  budget.nodes = count("budget: nodes", nodes);
  return budget;
}

template <class T>
py::object optional_of(const std::optional<T>& value) {
  return value ? py::object(py::cast(*value)) : py::object(py::none());
}

py::tuple arguments(const Budget& b) {
  return py::make_tuple(optional_of(b.pixel_error), optional_of(b.triangles), optional_of(b.nodes));
}

std::string budget_text(const Budget& budget) {
  const py::tuple a = arguments(budget);
  const char* names[] = {"pixel_error", "triangles", "nodes"};
  std::string out;
  for (size_t i = 0; i < 3; ++i) {
    if (!a[i].is_none()) out += (out.empty() ? "" : ", ") + std::string(names[i]) + "=" + text_of(a[i]);
  }
  return "Budget(" + out + ")";
}

}  // namespace

void bind_view(py::module_& m) {
  py::class_<View>(m, "View", "The camera and viewport of one frame; immutable.")
      .def(py::init(&make_view), py::arg("eye"), py::arg("target"),
           py::arg("up") = py::make_tuple(0.0, 0.0, 1.0), py::arg("fov") = 60.0,
           py::arg("size") = py::make_tuple(1280, 720), py::arg("near") = py::none(),
           "fov is horizontal, in degrees; size is (width, height); near defaults to a ten-thousandth of the "
           "distance from eye to target. InvalidInput names a bad value and its limit.")
      .def_property_readonly(
          "eye", [](const View& v) { return array_of(v.eye); }, "(3,) float64.")
      .def_property_readonly(
          "target", [](const View& v) { return array_of(v.target); }, "(3,) float64.")
      .def_property_readonly(
          "up", [](const View& v) { return array_of(v.up); }, "(3,) float64.")
      .def_property_readonly(
          "fov", [](const View& v) { return v.fov; }, "Horizontal, degrees.")
      .def_property_readonly("size", [](const View& v) { return py::make_tuple(v.width, v.height); })
      .def_property_readonly(
          "near", [](const View& v) { return make_camera(v).near_plane; }, "Source units.")
      .def_property_readonly("matrix", &matrix,
                             "(4, 4) float64, world to clip, for column vectors; depth is near / distance.")
      .def(
          "__eq__", [](const View& a, const View& b) { return arguments(a).equal(arguments(b)); },
          py::is_operator())
      .def("__hash__", [](const View& v) { return py::hash(arguments(v)); })
      .def("__repr__", &view_text)
      .def(py::pickle([](const View& v) { return arguments(v); },
                      [](const py::tuple& a) { return make_view(a[0], a[1], a[2], a[3], a[4], a[5], {}); }));
  py::class_<Budget>(m, "Budget", "What a frame may spend; immutable.")
      .def(py::init(&make_budget), py::arg("pixel_error") = py::none(), py::arg("triangles") = py::none(),
           py::arg("nodes") = py::none(), "Each optional, above 0; triangles and nodes are hard limits.")
      .def_property_readonly("pixel_error", [](const Budget& b) { return optional_of(b.pixel_error); })
      .def_property_readonly("triangles", [](const Budget& b) { return optional_of(b.triangles); })
      .def_property_readonly("nodes", [](const Budget& b) { return optional_of(b.nodes); })
      .def(
          "__eq__", [](const Budget& a, const Budget& b) { return arguments(a).equal(arguments(b)); },
          py::is_operator())
      .def("__hash__", [](const Budget& b) { return py::hash(arguments(b)); })
      .def("__repr__", &budget_text)
      .def(py::pickle([](const Budget& b) { return arguments(b); },
                      [](const py::tuple& a) { return make_budget(a[0], a[1], a[2], {}); }));
}

}  // namespace lodlab
