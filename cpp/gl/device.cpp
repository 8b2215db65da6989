// SPDX-License-Identifier: MIT
#include "gl/device.h"

#include <dlfcn.h>
#include <epoxy/egl.h>

#include <algorithm>
#include <charconv>

#include "base/errors.h"
#include "gl/egl.h"

namespace lodlab::gl {
namespace {

bool lists(const char* extensions, const std::string& name) {
  return extensions != nullptr &&
         (' ' + std::string(extensions) + ' ').find(' ' + name + ' ') != std::string::npos;
}

bool loads(const char* library) { return dlopen(library, RTLD_LAZY | RTLD_GLOBAL) != nullptr; }

/// libepoxy ends the process when it finds no library to load: look before it does.
void require_libraries() {
  static const bool egl = loads("libEGL.so.1"), gl = loads("libOpenGL.so.0") || loads("libGL.so.1");
  if (!egl) throw GLError("EGL: libEGL.so.1 cannot be loaded; install libegl1 and a GL driver");
  if (!gl) throw GLError("GL: neither libOpenGL.so.0 nor libGL.so.1 can be loaded; install libopengl0");
}

Device describe(EGLDeviceEXT handle, int index) {
  const auto query_text = egl_function<PFNEGLQUERYDEVICESTRINGEXTPROC>("eglQueryDeviceStringEXT");
  const auto query_value = egl_function<PFNEGLQUERYDEVICEATTRIBEXTPROC>("eglQueryDeviceAttribEXT");
  Device device;
  device.index = index;
  device.handle = handle;
  const char* extensions = query_text(handle, EGL_EXTENSIONS);
  device.software = lists(extensions, "EGL_MESA_device_software");
  EGLAttrib ordinal = 0;
  if (lists(extensions, "EGL_NV_device_cuda") && query_value(handle, EGL_CUDA_DEVICE_NV, &ordinal)) {
    device.cuda = static_cast<int>(ordinal);
  }
  const char* file =
      lists(extensions, "EGL_EXT_device_drm") ? query_text(handle, EGL_DRM_DEVICE_FILE_EXT) : nullptr;
  device.name = device.software    ? "software"
                : device.cuda >= 0 ? "cuda:" + std::to_string(device.cuda)
                                   : "hardware";
  if (file != nullptr) device.name += std::string(" ") + file;
  return device;
}

/// The whole text as a number that is not negative, or -1.
int number(const std::string& text) {
  int value = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && value >= 0 ? value : -1;
}

std::string listing(const std::vector<Device>& all) {
  std::string text;
  for (const Device& device : all) {
    text += (text.empty() ? "" : ", ") + std::to_string(device.index) + " = " + device.name;
  }
  return text.empty() ? "none" : text;
}

}  // namespace

std::vector<Device> devices() {
  require_libraries();
  const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  if (!lists(client, "EGL_EXT_device_base") && !lists(client, "EGL_EXT_device_enumeration")) {
    throw GLError("EGL: this driver cannot enumerate devices (EGL_EXT_device_enumeration is missing)");
  }
  const auto query = egl_function<PFNEGLQUERYDEVICESEXTPROC>("eglQueryDevicesEXT");
  EGLint count = 0;
  if (!query(0, nullptr, &count)) throw GLError("eglQueryDevicesEXT failed");
  std::vector<EGLDeviceEXT> handles(static_cast<size_t>(count));
  if (count > 0 && !query(count, handles.data(), &count)) throw GLError("eglQueryDevicesEXT failed");
  std::vector<Device> all;
  for (int i = 0; i < count; ++i) all.push_back(describe(handles[static_cast<size_t>(i)], i));
  return all;
}

std::vector<Device> candidates(const std::string& choice, const std::vector<Device>& all) {
  std::vector<Device> found;
  const bool by_cuda = choice.rfind("cuda:", 0) == 0;
  const int wanted = number(by_cuda ? choice.substr(5) : choice);
  if (choice == "auto") {
    found = all;
    std::stable_partition(found.begin(), found.end(), [](const Device& d) { return !d.software; });
  } else if (choice == "software" || wanted >= 0) {
    for (const Device& device : all) {
      const bool fits =
          choice == "software" ? device.software : (by_cuda ? device.cuda : device.index) == wanted;
      if (fits) found.push_back(device);
    }
    if (choice == "software" && found.size() > 1) found.resize(1);
  } else {
    throw InvalidInput("device: '" + choice + "' is not one of auto, software, cuda:N, N");
  }
  if (found.empty())
    throw GLError("device: no device '" + choice + "' on this machine (" + listing(all) + ")");
  return found;
}

}  // namespace lodlab::gl
