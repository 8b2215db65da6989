// SPDX-License-Identifier: MIT
// Pictures for Python, when the core was built with OpenImageIO.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include "bindings/common.h"

#ifdef LODLAB_OPENIMAGEIO
#include "base/errors.h"
#include "imageio/image.h"

namespace py = pybind11;

namespace lodlab {
namespace {

template <class T>
py::array to_array(ImageOf<T>&& image) {
  auto* held = new std::vector<T>(std::move(image.samples));
  const py::capsule owner(held, [](void* p) { delete static_cast<std::vector<T>*>(p); });
  return py::array_t<T>({image.height, image.width, image.channels}, held->data(), owner);
}

py::array read(const std::string& path) {
  Image image;
  {
    const py::gil_scoped_release release;
    image = read_image(path);
  }
  return std::visit([](auto& one) -> py::array { return to_array(std::move(one)); }, image);
}

void write(const std::string& path, const py::array_t<uint8_t, py::array::c_style>& samples) {
  if (samples.ndim() != 3 || samples.shape(2) < 1 || samples.shape(2) > 4 || samples.size() == 0) {
    throw InvalidInput("write_image: the array is not (H, W, 1 to 4) uint8");
  }
  const ImageU8 image{static_cast<int>(samples.shape(1)), static_cast<int>(samples.shape(0)),
                      static_cast<int>(samples.shape(2)),
                      std::vector<uint8_t>(samples.data(), samples.data() + samples.size())};
  const py::gil_scoped_release release;
  write_image(path, image);
}

}  // namespace

void bind_imageio(py::module_& module) {
  module.def("read_image", &read, py::arg("path"), "(H, W, C) in the type of the file.");
  module.def(
      "read_rgba8",
      [](const std::string& path) {
        ImageU8 image;
        {
          const py::gil_scoped_release release;
          image = read_rgba8(path);
        }
        return to_array(std::move(image));
      },
      py::arg("path"), "(H, W, 4) uint8 colours.");
  module.def("write_image", &write, py::arg("path"), py::arg("samples").noconvert(),
             "Writes (H, W, 1 to 4) uint8; the format follows the extension.");
}

}  // namespace lodlab
#endif
