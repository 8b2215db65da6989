// SPDX-License-Identifier: MIT
// The reference of the benchmark `draw` for Python: the very triangles of a captured cut in one static
// buffer, vertices with bit-equal positions made one, meshoptimizer's cache and fetch order.
#include <meshoptimizer.h>
#include <pybind11/pybind11.h>

#include "bindings/session.h"
#include "bindings/view.h"

namespace py = pybind11;

namespace lodlab {
namespace {

struct PyStaticMesh {
  std::shared_ptr<render::StaticMesh> mesh;
  std::shared_ptr<const render::Surface> surface;
  size_t triangles, vertices;
};

std::shared_ptr<PyStaticMesh> make(const PyCapture& capture, const std::shared_ptr<Source>& source) {
  given("StaticMesh: source", source);
  const py::gil_scoped_release release;
  const auto& captured = capture.captured.vertices;
  const meshopt_Stream stream{captured.data(), 3 * sizeof(float), sizeof(render::CapturedVertex)};
  std::vector<uint32_t> indices(captured.size());
  const size_t unique =
      meshopt_generateVertexRemapMulti(indices.data(), nullptr, captured.size(), captured.size(), &stream, 1);
  std::vector<uint32_t> vertex(unique);  // the captured one of each unique one
  for (size_t i = captured.size(); i-- > 0;) vertex[indices[i]] = static_cast<uint32_t>(i);
  meshopt_optimizeVertexCache(indices.data(), indices.data(), indices.size(), unique);
  std::vector<uint32_t> fetch(unique), first_use(unique);
  meshopt_optimizeVertexFetchRemap(fetch.data(), indices.data(), indices.size(), unique);
  for (size_t i = 0; i < unique; ++i) first_use[fetch[i]] = vertex[i];
  meshopt_remapIndexBuffer(indices.data(), indices.data(), indices.size(), fetch.data());
  PyStaticMesh out;
  out.mesh = render::make_static_mesh(capture.captured, indices, first_use);
  out.surface = surface_of("StaticMesh", *source);
  out.triangles = indices.size() / 3;
  out.vertices = unique;
  return std::make_shared<PyStaticMesh>(std::move(out));
}

double time(const PyStaticMesh& self, const View& view, bool discard) {
  const py::gil_scoped_release release;
  const auto show = discard ? render::Show::kNone : render::Show::kShade;
  return render::time_static(make_camera(view), show, *self.mesh, *self.surface).gpu_ms;
}

}  // namespace

void bind_static_mesh(py::module_& m) {
  py::class_<PyStaticMesh, std::shared_ptr<PyStaticMesh>>(
      m, "StaticMesh", "Captured triangles in one static buffer: what a method's draw is compared with.")
      .def(py::init(&make), py::arg("capture"), py::arg("source"))
      .def_readonly("triangles", &PyStaticMesh::triangles)
      .def_readonly("vertices", &PyStaticMesh::vertices)
      .def("time_draw", &time, py::arg("view"), py::arg("discard") = false,
           "Milliseconds to draw it with the shared shading. The view must have the eye of the capture's.")
      .def("__repr__", [](const PyStaticMesh& s) {
        return "StaticMesh(" + std::to_string(s.triangles) + " triangles, " + std::to_string(s.vertices) +
               " vertices)";
      });
}

}  // namespace lodlab
