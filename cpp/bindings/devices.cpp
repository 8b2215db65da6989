// SPDX-License-Identifier: MIT
// GL devices, and where the shaders are, for Python.
#include <pybind11/pybind11.h>

#include "bindings/common.h"
#include "gl/context.h"
#include "gl/device.h"
#include "gl/shader_source.h"

namespace py = pybind11;

namespace lodlab {
namespace {

py::list list_devices() {
  py::list out;
  for (const gl::Device& device : gl::devices()) {
    py::dict entry;
    entry["index"] = device.index;
    entry["name"] = device.name;
    entry["software"] = device.software;
    out.append(entry);
  }
  return out;
}

py::dict gl_info() {
  const gl::Info& info = gl::ensure_context();
  py::dict out;
  out["vendor"] = info.vendor;
  out["renderer"] = info.renderer;
  out["version"] = info.version;
  out["device"] = info.device;
  out["software"] = info.software;
  out["max_size"] = py::make_tuple(info.max_width, info.max_height);
  return out;
}

}  // namespace

void bind_devices(py::module_& m) {
  m.def("devices", &list_devices,
        "EGL devices: dicts of index, name, software. GLError when EGL is missing.");
  m.def(
      "choose_device", &gl::choose_device, py::arg("device"),
      "Sets the device of this process: 'auto', 'software', 'cuda:N' or 'N'. InvalidInput for another text; "
      "GLError when there is no such device or the process already draws on another.");
  m.def(
      "gl_info", &gl_info,
      "Vendor, renderer, version, device, software, max_size of the GL context, created if need be. GLError "
      "when there is none to be had, on another thread than the first, and after fork.");
  m.def("set_shader_dir", &gl::set_shader_dir, py::arg("path"),
        "Where the shader files are; LODLAB_SHADER_DIR goes before it.");
  m.def("shader_dir", &gl::shader_dir, "The folder that shaders are read from.");
}

}  // namespace lodlab
