// SPDX-License-Identifier: MIT
// Pictures that the instrument compares with, and comparisons of any two, for Python.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include "bindings/common.h"
#include "instrument/measurement.h"
#include "instrument/picture_difference.h"
#include "instrument/ssim.h"

namespace py = pybind11;

namespace lodlab {
namespace {

using instrument::Reference;

/// The middle (height, width, 4) of a picture, read-only; keeps its owner alive.
py::object picture_of(const py::object& owner, const render::Picture& picture, int width, int height) {
  const py::ssize_t row = 4 * static_cast<py::ssize_t>(picture.width);
  const py::ssize_t first = (picture.height - height) / 2 * row + (picture.width - width) / 2 * 4;
  py::array_t<uint8_t> out(std::vector<py::ssize_t>{height, width, 4}, std::vector<py::ssize_t>{row, 4, 1},
                           picture.rgba.data() + first, owner);
  make_read_only(out);
  return out;
}

py::object image(const py::object& self) {
  const render::Picture& shade = self.cast<const Reference&>().shade;
  return picture_of(self, shade, shade.width, shade.height);
}

py::object classes(const py::object& self) {
  const auto& reference = self.cast<const Reference&>();
  return picture_of(self, reference.classes, reference.shade.width, reference.shade.height);
}

py::object depth(const py::object& self) {
  const render::Picture& shade = self.cast<const Reference&>().shade;
  py::array_t<float> out(std::vector<py::ssize_t>{shade.height, shade.width}, shade.depth.data(), self);
  make_read_only(out);
  return out;
}

void bind_reference(py::module_& m) {
  py::class_<Reference, std::shared_ptr<Reference>>(m, "Reference",
                                                    "The source at full resolution in one view.")
      .def_property_readonly("image", &image, "(H, W, 4) uint8, row 0 on top, read-only.")
      .def_property_readonly(
          "classes", &classes,
          "(H, W, 4) uint8; red 0: nothing, 255: the surface's outside, 128: its inside. Read-only.")
      .def_property_readonly(
          "depth", &depth,
          "(H, W) float32, distance along the view axis in source units, inf where empty, read-only.")
      .def_property_readonly("nbytes", &Reference::bytes, "Bytes that it takes once it was compared with.")
      .def("__repr__", [](const Reference& r) {
        return "Reference(" + std::to_string(r.shade.width) + " x " + std::to_string(r.shade.height) +
               " pixels)";
      });
}

using Colours = py::array_t<uint8_t, py::array::c_style>;

render::Picture picture_from(const char* operation, const Colours& colours) {
  if (colours.ndim() != 3 || colours.shape(2) != 4 || colours.size() == 0)
    throw InvalidInput(std::string(operation) + ": a picture is (H, W, 4) uint8, and not empty");
  render::Picture out;
  out.height = static_cast<int>(colours.shape(0));
  out.width = static_cast<int>(colours.shape(1));
  out.rgba.assign(colours.data(), colours.data() + colours.size());
  return out;
}

/// A comparison of two arrays, computed without the GIL.
template <class Compare>
auto comparison(const char* operation, const Compare& compare) {
  return [operation, compare](const Colours& image, const Colours& reference) {
    const render::Picture a = picture_from(operation, image), b = picture_from(operation, reference);
    const py::gil_scoped_release release;
    return compare(a, b);
  };
}

void bind_comparisons(py::module_& m) {
  m.def("ssim", comparison("ssim", &instrument::ssim), py::arg("image"), py::arg("reference"),
        "Structural similarity (Wang et al. 2004) of two (H, W, 4) uint8 pictures: the mean over red, green "
        "and "
        "blue, 1 when equal; nan below 11 pixels a side. InvalidInput when the sizes differ.");
  const auto flip = [](const render::Picture& a, const render::Picture& b) {
    instrument::check_same_size("flip", a, b);
    return instrument::flip(instrument::seen(a), instrument::seen(b));
  };
  m.def("flip", comparison("flip", flip), py::arg("image"), py::arg("reference"),
        "Mean FLIP error (Andersson et al. 2020, LDR, 67 pixels a degree) of two (H, W, 4) uint8 pictures: 0 "
        "when "
        "equal, at most 1. InvalidInput when the sizes differ.");
}

}  // namespace

void bind_comparison(py::module_& m) {
  bind_reference(m);
  bind_comparisons(m);
}

}  // namespace lodlab
