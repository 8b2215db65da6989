// SPDX-License-Identifier: MIT
// What the bindings share: the Python face's store, and option dicts as the core's values.
// module.cpp calls bind_field, bind_store, bind_session, ... in this order; each file defines its own.
// The class `Store` (PyStore) is bound in store.cpp; session.cpp adds its method `session`:
//   pybind11::class_<PyStore, std::shared_ptr<PyStore>>(m.attr("Store")).def("session", ...).
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/errors.h"
#include "geometry/height_rows.h"
#include "method/method.h"
#include "store/store.h"

namespace lodlab {

/// A pointer from Python, where None is one too. InvalidInput names what is None.
template <class T>
std::shared_ptr<T> given(const char* what, std::shared_ptr<T> pointer) {
  if (pointer == nullptr) throw InvalidInput(std::string(what) + " is None");
  return pointer;
}

/// An opened store with the method that built it.
struct PyStore {
  std::shared_ptr<const Store> store;
  const Method* method = nullptr;
  std::shared_ptr<const Hierarchy> hierarchy;
};

/// Where the control points of a store are at rest. Unsupported, naming `operation`, where its method has
/// none.
std::vector<glm::dvec3> control_of(const PyStore& store, const std::string& operation);

/// A pose of them. InvalidInput for another dtype or shape than (V, 3) float64, and for what is no number
/// within 1e30; Unsupported as control_of().
std::shared_ptr<const Pose> pose_of(const PyStore& store, const std::string& operation,
                                    const pybind11::array& positions);

/// (N, 3) float64: a copy of points.
pybind11::array_t<double> array_of_points(std::span<const glm::dvec3> points);

/// A dict of bool, int, float and str (or numpy scalars of these) as option values. Other types throw
/// InvalidInput naming `owner`, the option and the type.
std::map<std::string, OptionValue> options_from_dict(const std::string& owner, const pybind11::dict& given);

/// Resolved options as a dict of Python values.
pybind11::dict options_to_dict(const Options& options);

/// Holds Python objects for the core; the last owner may let go on any thread.
inline std::shared_ptr<const void> keep(pybind11::object object) {
  auto* held = new pybind11::object(std::move(object));
  return {static_cast<const void*>(held), [held](const void*) {
            if (!Py_IsInitialized()) return;  // the interpreter took its objects with it
            const pybind11::gil_scoped_acquire gil;
            delete held;
          }};
}

/// The array's elements in C order. `shape`: what its dimensions must be, -1 for any number. InvalidInput
/// says what was `wanted` in place of another dtype or shape.
template <class T>
pybind11::array_t<T, pybind11::array::c_style> checked(const std::string& operation,
                                                       const pybind11::array& array, const char* name,
                                                       const std::vector<pybind11::ssize_t>& shape,
                                                       const char* wanted) {
  namespace py = pybind11;
  bool fits = array.dtype().is(py::dtype::of<T>()) || array.dtype().equal(py::dtype::of<T>());
  fits = fits && array.ndim() == static_cast<py::ssize_t>(shape.size());
  for (size_t i = 0; fits && i < shape.size(); ++i)
    fits = shape[i] < 0 || array.shape(static_cast<py::ssize_t>(i)) == shape[i];
  if (!fits) {
    throw InvalidInput(operation + ": " + name + " is " + py::str(array.attr("shape")).cast<std::string>() +
                       " " + py::str(array.dtype()).cast<std::string>() + ", not " + wanted);
  }
  return py::array_t<T, py::array::c_style>::ensure(array);
}

/// Rows of an array as elements of one type.
template <class Element, class Array>
std::span<const Element> span_of(const Array& array) {
  return {reinterpret_cast<const Element*>(array.data()), static_cast<size_t>(array.shape(0))};
}

/// A view of native memory that Python may not write to.
inline void make_read_only(const pybind11::array& array) {
  namespace detail = pybind11::detail;
  detail::array_proxy(array.ptr())->flags &= ~detail::npy_api::NPY_ARRAY_WRITEABLE_;
}

void bind_field(pybind11::module_& m);
void bind_mesh(pybind11::module_& m);
void bind_store(pybind11::module_& m);
void bind_session(pybind11::module_& m);
void bind_comparison(pybind11::module_& m);
void bind_instrument(pybind11::module_& m);
void bind_devices(pybind11::module_& m);
void bind_bench(pybind11::module_& m);
#ifdef LODLAB_OPENIMAGEIO
void bind_imageio(pybind11::module_& m);
#endif

}  // namespace lodlab
