// SPDX-License-Identifier: MIT
// lodlab._core: the module itself, its typed errors, and what belongs to no other file.
// Each Python class is bound in the file named after its part of the library.
#include <meshoptimizer.h>
#include <pybind11/pybind11.h>
#include <sqlite3.h>
#include <tbb/version.h>
#include <xxhash.h>

#include <glm/detail/setup.hpp>
#include <nlohmann/detail/abi_macros.hpp>

#include "base/errors.h"
#include "base/parallel.h"
#include "bindings/common.h"

namespace py = pybind11;

namespace {

/// "0.18" from 180, "1.2" from 1020: both forms that meshoptimizer has used.
std::string meshoptimizer_version() {
  constexpr int kVersion = MESHOPTIMIZER_VERSION;
  return std::to_string(kVersion / 1000) + "." + std::to_string(kVersion % 1000 / 10);
}

std::string xxhash_version() {
  const unsigned version = XXH_versionNumber();
  return std::to_string(version / 10000) + "." + std::to_string(version / 100 % 100) + "." +
         std::to_string(version % 100);
}

py::dict libraries() {
  py::dict out;
  out["sqlite"] = sqlite3_libversion();
  out["xxhash"] = xxhash_version();
  out["tbb"] = TBB_runtime_version();
  out["nlohmann_json"] = std::to_string(NLOHMANN_JSON_VERSION_MAJOR) + "." +
                         std::to_string(NLOHMANN_JSON_VERSION_MINOR) + "." +
                         std::to_string(NLOHMANN_JSON_VERSION_PATCH);
  out["meshoptimizer"] = meshoptimizer_version();
  out["glm"] = std::to_string(GLM_VERSION_MAJOR) + "." + std::to_string(GLM_VERSION_MINOR) + "." +
               std::to_string(GLM_VERSION_PATCH) + "." + std::to_string(GLM_VERSION_REVISION);
  out["pybind11"] = std::to_string(PYBIND11_VERSION_MAJOR) + "." + std::to_string(PYBIND11_VERSION_MINOR) +
                    "." + std::to_string(PYBIND11_VERSION_MICRO);
  out["epoxy"] = LODLAB_EPOXY_VERSION;
  out["embree"] = LODLAB_EMBREE_VERSION;
#ifdef LODLAB_OPENIMAGEIO
  out["openimageio"] = LODLAB_OPENIMAGEIO_VERSION;
#endif
  return out;
}

void bind_errors(py::module_& m) {
  // Of these translators the last registered is asked first, so derived classes come after their bases.
  py::register_exception<lodlab::GLError>(m, "GLError", PyExc_RuntimeError);
  py::register_exception<lodlab::Unsupported>(m, "Unsupported", PyExc_RuntimeError);
  py::register_exception<lodlab::StoreError>(m, "StoreError", PyExc_OSError);
  py::register_exception<lodlab::InvalidInput>(m, "InvalidInput", PyExc_ValueError);
  py::register_exception_translator([](std::exception_ptr error) {
    try {
      if (error) std::rethrow_exception(error);
    } catch (const lodlab::Interrupted&) {
      PyErr_SetNone(PyExc_KeyboardInterrupt);
    }
  });
}

}  // namespace

PYBIND11_MODULE(_core, m) {
  m.doc() = "The core of lodlab; the package lodlab is its face.";
  bind_errors(m);
  m.def("libraries", &libraries, "The libraries that the core was built with: name to version.");
  m.def("thread_count", &lodlab::thread_count,
        "Worker threads of parallel loops: LODLAB_THREADS, else the number of cores.");
  m.def("set_thread_count", &lodlab::set_thread_count, py::arg("threads"),
        "Overrides LODLAB_THREADS for this process; 0 goes back to it. InvalidInput outside 0 to 1024.");
  lodlab::bind_field(m);
  lodlab::bind_mesh(m);
  lodlab::bind_store(m);
  lodlab::bind_session(m);
  lodlab::bind_comparison(m);
  lodlab::bind_instrument(m);
  lodlab::bind_devices(m);
  lodlab::bind_bench(m);
#ifdef LODLAB_OPENIMAGEIO
  lodlab::bind_imageio(m);
#endif
}
