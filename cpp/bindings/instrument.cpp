// SPDX-License-Identifier: MIT
// The instrument for Python: one object a source. It draws the cuts that it measures, on the thread that
// owns the GL context; what takes long runs without the GIL.
#include "instrument/instrument.h"

#include <pybind11/stl.h>

#include "base/errors.h"
#include "bindings/session.h"
#include "geometry/coverage.h"
#include "gl/context.h"
#include "instrument/slack.h"

namespace py = pybind11;

namespace lodlab {
namespace {

using instrument::Accuracy;
using instrument::Instrument;
using instrument::Reference;

class PyInstrument {
 public:
  PyInstrument(std::shared_ptr<HeightField> field, std::shared_ptr<PySession> reference)
      : field_(std::move(field)), instrument_(field_), hash_(field_->hash()), full_(std::move(reference)) {
    if (full_ != nullptr) check_source(*full_, "Instrument");
  }

  const Instrument& core() const { return instrument_; }

  std::shared_ptr<const Reference> reference(const View& view) {
    if (full_ == nullptr)
      throw InvalidInput("reference: the instrument was made without a session of `full`");
    const Camera camera = make_camera(view);
    const PyCut cut{full_->selecting().select(view, Budget()), full_->store().hierarchy};
    return instrument_.reference(camera, full_->draw_call(cut));
  }

  Accuracy measure(PySession& session, const PyCut& cut, const View& view, const Reference* reference,
                   bool pictures) {
    check_source(session, "measure");
    const Camera camera = make_camera(view);
    const render::DrawCall draw = session.draw_call(cut);
    return instrument_.measure(camera, draw, resources(), {cut.cut.predicted_px, reference, pictures});
  }

  instrument::Jump jump(PySession& session, const PyCut& before, const PyCut& after, const View& view) {
    check_source(session, "jump");
    const Camera camera = make_camera(view);
    const render::Captured from = render::capture(camera, session.draw_call(before), true);
    const render::Captured to = render::capture(camera, session.draw_call(after), true);
    return instrument_.jump(camera, from, to);
  }

  std::vector<instrument::NodeError> node_errors(PySession& session, const PyCut& cut, const View& view) {
    check_source(session, "node_errors");
    return instrument_.node_errors(render::capture(make_camera(view), session.draw_call(cut), true));
  }

 private:
  void check_source(const PySession& session, const char* operation) const {
    const StoreMeta& meta = session.store().store->meta();
    if (meta.source_hash == hash_) return;
    throw InvalidInput(std::string(operation) + ": store " + session.store().store->path() +
                       " was built from another source than the instrument's");
  }

  const render::FieldResources& resources() {
    gl::ensure_context();
    if (resources_ == nullptr) resources_ = render::make_field_resources(*field_, coverage_bits(*field_));
    return *resources_;
  }

  std::shared_ptr<HeightField> field_;
  Instrument instrument_;
  std::string hash_;
  std::shared_ptr<PySession> full_;
  std::shared_ptr<const render::FieldResources> resources_;
};

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

py::dict columns(const Accuracy& a) {
  py::dict out;
  out["predicted_px"] = a.predicted_px;
  out["measured_px_max"] = a.measured_px_max;
  out["measured_px_p99"] = a.measured_px_p99;
  out["measured_px_rms"] = a.measured_px_rms;
  out["measured_max"] = a.measured_max;
  out["measured_rms"] = a.measured_rms;
  out["hole_samples"] = a.hole_samples;
  out["measured_samples"] = a.measured_samples;
  out["crack_edges"] = a.crack_edges;
  out["crack_pixels"] = a.crack_pixels;
  out["crack_mask_share"] = a.crack_mask_share;
  out["capture_mismatch_pixels"] = a.capture_mismatch_pixels;
  out["psnr_db"] = a.psnr_db;
  return out;
}

py::tuple node_arrays(const std::vector<instrument::NodeError>& errors) {
  std::vector<uint32_t> nodes;
  std::vector<double> largest;
  for (const instrument::NodeError& error : errors) {
    nodes.push_back(error.node);
    largest.push_back(error.max);
  }
  const py::ssize_t count = static_cast<py::ssize_t>(errors.size());
  return py::make_tuple(array_of(std::move(nodes), {count}), array_of(std::move(largest), {count}));
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
      .def("__repr__", [](const Reference& r) {
        return "Reference(" + std::to_string(r.shade.width) + " x " + std::to_string(r.shade.height) +
               " pixels)";
      });
}

}  // namespace

void bind_instrument(py::module_& m) {
  const auto session = py::arg("session"), cut = py::arg("cut"), view = py::arg("view");
  bind_reference(m);
  m.attr("SLACK_STEPS") = instrument::kSlackSteps;
  m.attr("SLACK_PIXELS") = instrument::kSlackPixels;
  m.def("world_slack", &instrument::world_slack, py::arg("distance"),
        "Four float steps at this distance to the eye, source units.");
  py::class_<PyInstrument, std::shared_ptr<PyInstrument>>(
      m, "Instrument",
      "Measures drawn cuts of one source against it. `reference`: a session of `full` on the same source; "
      "None when no picture is to be compared. InvalidInput when a store was built from another source.")
      .def(py::init<std::shared_ptr<HeightField>, std::shared_ptr<PySession>>(), py::arg("field"),
           py::arg("reference") = py::none())
      .def(
          "reference",
          [](PyInstrument& self, const View& at) {
            const py::gil_scoped_release release;
            return std::const_pointer_cast<Reference>(self.reference(at));
          },
          view, "The source drawn at full resolution; None above 32 M samples.")
      .def(
          "measure",
          [](PyInstrument& self, PySession& s, const PyCut& c, const View& at,
             const std::shared_ptr<Reference>& reference, bool pictures) {
            Accuracy accuracy;
            {
              const py::gil_scoped_release release;
              accuracy = self.measure(s, c, at, reference.get(), pictures);
            }
            return columns(accuracy);
          },
          session, cut, view, py::arg("reference") = py::none(), py::arg("pictures") = true,
          "Dict of accuracy columns. Without a reference the columns that compare with it are nan; without "
          "pictures capture_mismatch_pixels is too. InvalidInput for a reference of another view and for a "
          "drawn vertex that is not finite.")
      .def(
          "jump",
          [](PyInstrument& self, PySession& s, const PyCut& before, const PyCut& after, const View& at) {
            instrument::Jump jump;
            {
              const py::gil_scoped_release release;
              jump = self.jump(s, before, after, at);
            }
            return py::make_tuple(jump.px, jump.world);
          },
          session, py::arg("before"), py::arg("after"), view,
          "(pixels, source units): the largest distance between the two cuts' captured surfaces at the "
          "samples inside the frustum that both cover; nan where there are none.")
      .def(
          "node_errors",
          [](PyInstrument& self, PySession& s, const PyCut& c, const View& at) {
            std::vector<instrument::NodeError> errors;
            {
              const py::gil_scoped_release release;
              errors = self.node_errors(s, c, at);
            }
            return node_arrays(errors);
          },
          session, cut, view,
          "(nodes, errors): per node of the cut the largest deviation of its triangles from the samples "
          "they cover; (N,) uint32 and (N,) float64, source units.")
      .def(
          "slack", [](const PyInstrument& self, const View& at) { return self.core().slack(at.eye); }, view,
          "world_slack at the farthest sample, source units: what laws on measured_max allow.");
}

}  // namespace lodlab
