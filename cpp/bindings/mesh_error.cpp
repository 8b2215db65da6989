// SPDX-License-Identifier: MIT
// Drawn triangles against a source mesh, for Python: arrays in, a dict of accuracy columns out.
#include "instrument/mesh_error.h"

#include <pybind11/stl.h>

#include <optional>

#include "base/errors.h"
#include "bindings/common.h"

namespace py = pybind11;

namespace lodlab {
namespace {

py::dict columns(const instrument::MeshAccuracy& a) {
  py::dict out;
  out["measured_max"] = a.measured_max;
  out["measured_rms"] = a.measured_rms;
  out["measured_max_source_to_drawn"] = a.measured_max_source_to_drawn;
  out["measured_max_drawn_to_source"] = a.measured_max_drawn_to_source;
  out["measured_rms_source_to_drawn"] = a.measured_rms_source_to_drawn;
  out["measured_rms_drawn_to_source"] = a.measured_rms_drawn_to_source;
  out["measured_px_max"] = a.measured_px_max;
  out["measured_px_p99"] = a.measured_px_p99;
  out["measured_px_rms"] = a.measured_px_rms;
  return out;
}

py::dict measure(const py::array& vertices, const py::array& faces, const py::array& drawn,
                 const std::optional<View>& view, const std::optional<py::array>& depth) {
  const auto positions = checked<double>("mesh_accuracy", vertices, "vertices", {-1, 3}, "(V, 3) float64");
  const auto indices = checked<uint32_t>("mesh_accuracy", faces, "faces", {-1, 3}, "(F, 3) uint32");
  const auto triangles = checked<double>("mesh_accuracy", drawn, "drawn", {-1, 3, 3}, "(T, 3, 3) float64");
  std::optional<Camera> camera;
  if (view) camera = make_camera(*view);
  std::optional<render::Picture> reference;
  if (depth) {
    const auto depths = checked<float>("mesh_accuracy", *depth, "depth", {-1, -1}, "(height, width) float32");
    reference.emplace();
    reference->width = static_cast<int>(depths.shape(1));
    reference->height = static_cast<int>(depths.shape(0));
    reference->depth.assign(depths.data(), depths.data() + depths.size());
  }
  instrument::MeshAccuracy out;
  {
    const py::gil_scoped_release release;
    out = instrument::mesh_accuracy(span_of<glm::dvec3>(positions), span_of<std::array<uint32_t, 3>>(indices),
                                    span_of<Triangle>(triangles),
                                    {camera ? &*camera : nullptr, reference ? &*reference : nullptr});
  }
  return columns(out);
}

}  // namespace

void bind_mesh_error(py::module_& m) {
  m.def(
      "mesh_accuracy", &measure, py::arg("vertices"), py::arg("faces"), py::arg("drawn"),
      py::arg("view") = py::none(), py::arg("depth") = py::none(),
      "Dict of the accuracy columns of a mesh. vertices (V, 3) float64 and faces (F, 3) uint32: the source; "
      "drawn (T, 3, 3) float64: the drawn surface's triangles, in source coordinates; depth (height, width) "
      "float32: the source's distance along the axis of `view`, inf where it is not seen. measured_max and "
      "measured_rms (source units) are the larger of the two directions; with nothing drawn, source to drawn "
      "is inf and drawn to source nan. measured_px_* (pixels) are nan without a view, p99 and rms without "
      "depth. A maximum is attained and within 0.1 % of the true one. InvalidInput for arrays of other "
      "shapes or types, positions that are not finite, and a source without triangles.");
}

}  // namespace lodlab
