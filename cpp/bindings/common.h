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
#include <string>

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

/// A dict of bool, int, float and str (or numpy scalars of these) as option values. Other types throw
/// InvalidInput naming `owner`, the option and the type.
std::map<std::string, OptionValue> options_from_dict(const std::string& owner, const pybind11::dict& given);

/// Resolved options as a dict of Python values.
pybind11::dict options_to_dict(const Options& options);

/// A view of native memory that Python may not write to.
inline void make_read_only(const pybind11::array& array) {
  namespace detail = pybind11::detail;
  detail::array_proxy(array.ptr())->flags &= ~detail::npy_api::NPY_ARRAY_WRITEABLE_;
}

void bind_field(pybind11::module_& m);
void bind_store(pybind11::module_& m);
void bind_session(pybind11::module_& m);
void bind_instrument(pybind11::module_& m);
void bind_mesh_error(pybind11::module_& m);
void bind_devices(pybind11::module_& m);
void bind_bench(pybind11::module_& m);
#ifdef LODLAB_OPENIMAGEIO
void bind_imageio(pybind11::module_& m);
#endif

}  // namespace lodlab
