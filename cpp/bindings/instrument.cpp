// SPDX-License-Identifier: MIT
// The instrument for Python: one object a source. It draws the cuts that it measures, on the thread that
// owns the GL context; what takes long runs without the GIL.
#include "instrument/measurement.h"

#include <pybind11/stl.h>

#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <variant>

#include "base/errors.h"
#include "bindings/session.h"
#include "gl/context.h"
#include "instrument/captured.h"
#include "instrument/field_ruler.h"
#include "instrument/mesh_ruler.h"
#include "instrument/slack.h"
#include "method/mesh_memory.h"

namespace py = pybind11;

namespace lodlab {

std::shared_ptr<const render::Surface> surface_of(const std::string& operation, const Source& source) {
  if (const auto* mesh = dynamic_cast<const Mesh*>(&source)) return render::make_surface(mesh->box);
  const FieldSource& field = heights_of(source, operation);
  return render::make_surface(field, field.coverage());
}

namespace {

using instrument::Measurement;
using instrument::Reference;

/// What is drawn together: usually one session's cut; in calibration those of several stores.
using Part = std::pair<std::shared_ptr<PySession>, std::shared_ptr<PyCut>>;
using Parts = std::vector<Part>;

/// A measurement keeps what its draw calls use.
struct PyMeasurement {
  Parts parts, before;
  Measurement measurement;
  std::mutex mutex;  ///< figures are kept when first computed

  PyMeasurement(Parts drawn, Parts drawn_before, std::shared_ptr<const instrument::Ruler> ruler,
                std::shared_ptr<const render::Surface> resources, instrument::Subject subject)
      : parts(std::move(drawn)),
        before(std::move(drawn_before)),
        measurement(std::move(ruler), std::move(resources), std::move(subject)) {}
};

render::DrawCall draw_call(const Parts& parts) {
  std::vector<render::DrawCall> calls;
  for (const auto& [session, cut] : parts) calls.push_back(session->draw_call(*cut));
  return {[calls](render::Work& work) {
            for (const render::DrawCall& call : calls) call.prepare(work);
          },
          [calls](render::Pass& pass) {
            for (const render::DrawCall& call : calls) call.draw(pass);
          }};
}

/// What the method says that its hierarchy could reach at best where this cut was selected; empty for a cut
/// by hand, and for one that breaks a hard budget.
std::function<double()> optimum_of(const Part& part) {
  const Budget& budget = part.second->cut.request.budget;
  const bool by_hand = !budget.pixel_error && !budget.triangles && !budget.nodes;
  if (by_hand || !part.second->claim().within_hard(budget)) return {};
  return [part] { return part.first->selecting().optimum_px(part.second->cut.request); };
}

std::shared_ptr<const instrument::Ruler> ruler_of(const std::shared_ptr<const Source>& source) {
  if (const auto mesh = std::dynamic_pointer_cast<const Mesh>(source))
    return std::make_shared<instrument::MeshRuler>(mesh);
  heights_of(*source, "Instrument: this");
  return std::make_shared<instrument::FieldRuler>(std::dynamic_pointer_cast<const FieldSource>(source));
}

/// How far each node of a cut, or of cuts drawn together, may be from the source: its error as drawn.
instrument::NodeBound bound_of(const Parts& parts) {
  auto bounds = std::make_shared<std::map<uint32_t, double>>();
  for (const auto& [session, cut] : parts) {
    if (!cut->cut.claim) continue;
    for (const CutNode& node : cut->cut.claim->nodes) {
      double& seen = (*bounds)[node.node];
      seen = std::max(seen, node.error);
    }
  }
  return [bounds](uint32_t node) {
    const auto found = bounds->find(node);
    return found == bounds->end() ? 0.0 : found->second;
  };
}

/// A mesh as a pose deforms it, with its ruler, and what draws it at full resolution.
struct PosedSource {
  PosedSource(const Carrier& carrier, std::shared_ptr<const Pose> of)
      : pose(std::move(of)),
        mesh(carrier.carry(*pose)),
        ruler(std::make_shared<instrument::MeshRuler>(mesh)) {}

  render::DrawCall draw_call(const std::shared_ptr<const render::Surface>& surface) {
    if (memory == nullptr) {
      const std::span<const uint32_t> indices(mesh->faces.data()->data(), 3 * mesh->faces.size());
      memory = std::make_unique<MeshMemory>(std::vector<StoredMesh>{stored_mesh(*mesh, indices)});
    }
    return {[this, surface](render::Pass& pass) { memory->draw({{{0, 0, 0}}}, *surface, pass); }};
  }

  std::shared_ptr<const Pose> pose;
  std::shared_ptr<const Mesh> mesh;
  std::shared_ptr<const instrument::Ruler> ruler;
  std::unique_ptr<MeshMemory> memory;
};

class PyInstrument {
 public:
  PyInstrument(std::shared_ptr<Source> source, std::shared_ptr<PySession> reference)
      : source_(given("Instrument: source", std::move(source))),
        ruler_(ruler_of(source_)),
        hash_(source_->hash()),
        full_(std::move(reference)) {
    if (full_ != nullptr) check_source(*full_, "Instrument");
  }

  const instrument::Ruler& ruler() const { return *ruler_; }

  std::shared_ptr<const Reference> reference(const View& view, const PyCut* of) {
    if (full_ == nullptr)
      throw InvalidInput("reference: the instrument was made without a session of `full`");
    const Camera camera = make_camera(view);
    if (of != nullptr && of->cut.request.pose != nullptr) {
      gl::ensure_context();
      PosedSource& posed = posed_of(*of);
      const auto out = instrument::draw_reference(*posed.ruler, camera, posed.draw_call(resources()));
      out->pose = posed.pose;
      return out;
    }
    const Cut cut = full_->selecting().select({view, {}, nullptr});
    return instrument::draw_reference(*ruler_, camera, full_->draw_call(cut));
  }

  void check_source(const PySession& session, const char* operation) const {
    const StoreMeta& meta = session.store().store->meta();
    if (meta.source_hash == hash_) return;
    throw InvalidInput(std::string(operation) + ": store " + session.store().store->path() +
                       " was built from another source than the instrument's");
  }

  std::shared_ptr<PyMeasurement> examine(Parts parts, Parts before, const View& view,
                                         std::shared_ptr<const Reference> reference, bool pictures) {
    if (parts.empty()) throw InvalidInput("examine: no part to draw");
    for (const Parts* drawn : {&parts, &before}) {
      for (const auto& [session, cut] : *drawn) {
        given("examine: session", session);
        given("examine: cut", cut);
      }
    }
    const PyCut& cut = *parts[0].second;
    const std::shared_ptr<const Pose>& pose = cut.cut.request.pose;
    if (reference != nullptr && !same_pose(std::static_pointer_cast<const Pose>(reference->pose), pose))
      throw InvalidInput("measure: the reference is of another pose");
    if (!before.empty() && !same_pose(before[0].second->cut.request.pose, pose)) before.clear();
    instrument::Subject subject;
    subject.camera = make_camera(view);
    subject.draw = draw_call(parts);
    if (!before.empty()) subject.draw_before = draw_call(before);
    std::set<std::string> names;
    for (const Part& part : parts) names.insert(part.first->store().method->info().name);
    for (const std::string& name : names) subject.drawn_by += (subject.drawn_by.empty() ? "" : ", ") + name;
    if (parts.size() == 1) {
      subject.predicted_px = parts[0].second->claim().predicted_px;
      subject.optimum_px = optimum_of(parts[0]);
    }
    subject.reference = std::move(reference);
    subject.bound = bound_of(parts);
    subject.bound_promised = pose == nullptr || cut.claim().promises_bound;
    subject.pictures = pictures;
    return std::make_shared<PyMeasurement>(std::move(parts), std::move(before),
                                           pose == nullptr ? ruler_ : posed_of(cut).ruler, resources(),
                                           std::move(subject));
  }

  std::shared_ptr<PyMeasurement> examine_triangles(std::span<const Triangle> triangles,
                                                   std::span<const uint8_t> fillers,
                                                   const std::optional<View>& view,
                                                   std::shared_ptr<const Reference> reference) {
    instrument::Subject subject;
    if (view) subject.camera = make_camera(*view);
    if (!view) subject.camera.eye = ruler_->middle();
    auto captured =
        std::make_shared<render::Captured>(instrument::captured_from(triangles, fillers, subject.camera.eye));
    const auto* field = dynamic_cast<const instrument::FieldRuler*>(ruler_.get());
    if (view && field != nullptr && field->has_voids())
      instrument::place_on_grid(*captured, field->grid(), subject.camera);
    const auto surface = view ? resources() : nullptr;
    if (view) subject.draw = render::redraw(captured, surface);
    subject.captured = std::move(captured);
    subject.on_screen = subject.pictures = view.has_value();
    subject.drawn_by = "triangles";
    subject.reference = std::move(reference);
    return std::make_shared<PyMeasurement>(Parts(), Parts(), ruler_, surface, std::move(subject));
  }

 private:
  /// Its source as the pose of a cut deforms it; that of the last pose asked for is kept.
  PosedSource& posed_of(const PyCut& cut) {
    if (carried_by_ != cut.hierarchy) {
      carrier_ = cut.hierarchy->carrier(std::dynamic_pointer_cast<const Mesh>(source_));
      carried_by_ = cut.hierarchy;
      posed_.reset();
    }
    if (!posed_ || !same_pose(posed_->pose, cut.cut.request.pose))
      posed_.emplace(*carrier_, cut.cut.request.pose);
    return *posed_;
  }

  std::shared_ptr<const render::Surface> resources() {
    gl::ensure_context();
    if (resources_ == nullptr) resources_ = surface_of("Instrument: this", *source_);
    return resources_;
  }

  std::shared_ptr<const Source> source_;
  std::shared_ptr<const instrument::Ruler> ruler_;
  std::string hash_;
  std::shared_ptr<PySession> full_;
  std::shared_ptr<const render::Surface> resources_;
  std::shared_ptr<const Hierarchy> carried_by_;
  std::shared_ptr<const Carrier> carrier_;
  std::optional<PosedSource> posed_;
};

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

/// A figure of a measurement, computed without the GIL.
template <class Figure>
auto figure(Figure (Measurement::*function)()) {
  return [function](PyMeasurement& self) {
    const py::gil_scoped_release release;
    const std::lock_guard lock(self.mutex);
    return (self.measurement.*function)();
  };
}

/// A count that may mean nothing on the kind of source: nan then.
auto count_of(std::optional<int64_t> (Measurement::*function)()) {
  return [function](PyMeasurement& self) -> std::variant<int64_t, double> {
    const std::optional<int64_t> found = figure(function)(self);
    if (found) return *found;
    return instrument::kUndefined;
  };
}

py::array_t<float> error_px(PyMeasurement& self) {
  std::vector<float> errors = figure(&Measurement::error_px)(self);
  const Camera& camera = self.measurement.camera();
  return array_of(std::move(errors), {camera.height, camera.width});
}

py::array_t<uint8_t> drawn_image(PyMeasurement& self) {
  std::vector<uint8_t> image;
  {
    const py::gil_scoped_release release;
    const std::lock_guard lock(self.mutex);
    image = self.measurement.drawn().rgba;
  }
  const Camera& camera = self.measurement.camera();
  return array_of(std::move(image), {camera.height, camera.width, 4});
}

void bind_measurement(py::module_& m) {
  py::class_<PyMeasurement, std::shared_ptr<PyMeasurement>> type(
      m, "Measurement",
      "One drawn cut, measured: a property for each figure, computed when it is first asked for. nan: "
      "undefined; inf: a hole, or equal pictures (psnr_db). InvalidInput for a drawn vertex that is not "
      "finite, naming method and node.");
  type.def_property_readonly(
      "predicted_px", [](const PyMeasurement& self) { return self.measurement.predicted_px(); },
      "The method's claim, pixels; nan when several stores draw.");
  const auto column = [&](const char* name, auto function, const char* text) {
    type.def_property_readonly(name, figure(function), text);
  };
  const auto count = [&](const char* name, std::optional<int64_t> (Measurement::*function)(),
                         const char* text) { type.def_property_readonly(name, count_of(function), text); };
  column("measured_px_max", &Measurement::measured_px_max,
         "Largest over the samples in the frustum, pixels.");
  column("measured_px_p99", &Measurement::measured_px_p99, "Over the reference's pixels, nearest rank.");
  column("measured_px_rms", &Measurement::measured_px_rms, "Over the reference's pixels.");
  column("measured_max", &Measurement::measured_max, "Over all samples, source units.");
  column("measured_rms", &Measurement::measured_rms, "Over all samples, source units.");
  count("hole_samples", &Measurement::hole_samples, "Samples that no surface triangle covers.");
  column("measured_samples", &Measurement::measured_samples, "Samples that are not void.");
  column("crack_edges", &Measurement::crack_edges, "Directed edges without exactly one opposite.");
  column("crack_pixels", &Measurement::crack_pixels, "Clear colour or inside where there is outside.");
  column("crack_mask_share", &Measurement::crack_mask_share, "Share of pixels looked at for cracks.");
  column("capture_mismatch_pixels", &Measurement::capture_mismatch_pixels,
         "Pixels whose depth differs from that of the capture drawn again.");
  column("psnr_db", &Measurement::psnr_db, "Against the reference, decibels.");
  column("ssim", &Measurement::ssim, "Structural similarity to the reference, 1 when equal.");
  column("flip", &Measurement::flip, "Mean FLIP error against the reference, 0 when equal.");
  column("pop_px_max", &Measurement::pop_px_max, "Largest jump from the cut before, this view, pixels.");
  column("pop_area", &Measurement::pop_area, "Share of pixels that jump more than one pixel.");
  column("inverted_triangles", &Measurement::inverted_triangles, "Surface triangles wound the wrong way.");
  column("optimum_gap", &Measurement::optimum_gap, "predicted_px over the optimum of the hierarchy, less 1.");
  count("slanted_filler_triangles", &Measurement::slanted_filler_triangles, "Fillers that are not vertical.");
  count("raised_filler_triangles", &Measurement::raised_filler_triangles,
        "Fillers that rise above the drawn surface.");
  column("drawn_triangles", &Measurement::drawn_triangles,
         "Triangles of the picture as the GPU counts them, culled nodes left out.");
  column("measured_max_source_to_drawn", &Measurement::measured_max_source_to_drawn,
         "From all of the source's surface, source units; nan on height fields.");
  column("measured_max_drawn_to_source", &Measurement::measured_max_drawn_to_source,
         "From all of the drawn surface, source units; nan on height fields.");
  column("measured_rms_source_to_drawn", &Measurement::measured_rms_source_to_drawn,
         "From all of the source's surface, source units; nan on height fields.");
  column("measured_rms_drawn_to_source", &Measurement::measured_rms_drawn_to_source,
         "From all of the drawn surface, source units; nan on height fields.");
  type.def_property_readonly("image", &drawn_image, "(H, W, 4) uint8: the picture as drawn, row 0 on top.")
      .def_property_readonly(
          "reference",
          [](const PyMeasurement& self) {
            return std::const_pointer_cast<Reference>(self.measurement.reference());
          },
          "The Reference that it is compared with, or None.")
      .def("error_px", &error_px,
           "(H, W) float32: the measured error at each pixel of the picture as drawn, pixels; nan where "
           "nothing is drawn, inf at a hole.")
      .def(
          "node_errors",
          [](PyMeasurement& self) { return node_arrays(figure(&Measurement::node_errors)(self)); },
          "(nodes, errors): per node of the cut the largest deviation of its triangles from the samples "
          "they cover; (N,) uint32 and (N,) float64, source units.");
}

}  // namespace

void bind_instrument(py::module_& m) {
  const auto view = py::arg("view");
  bind_measurement(m);
  m.attr("SLACK_STEPS") = instrument::kSlackSteps;
  m.attr("SLACK_PIXELS") = instrument::kSlackPixels;
  m.def("world_slack", &instrument::world_slack, py::arg("distance"),
        "Four float steps at this distance to the eye, source units.");
  py::class_<PyInstrument, std::shared_ptr<PyInstrument>>(
      m, "Instrument",
      "Measures drawn cuts of one source against it. `reference`: a session of `full` on the same source; "
      "None when no picture is to be compared. InvalidInput when a store was built from another source.")
      .def(py::init<std::shared_ptr<Source>, std::shared_ptr<PySession>>(), py::arg("source"),
           py::arg("reference") = py::none())
      .def(
          "reference",
          [](PyInstrument& self, const View& at, std::shared_ptr<PyCut> cut) {
            const py::gil_scoped_release release;
            return std::const_pointer_cast<Reference>(self.reference(at, cut.get()));
          },
          view, py::arg("cut") = py::none(),
          "The source drawn at full resolution, as the pose of a cut deforms it; None above 32 M samples.")
      .def(
          "examine",
          [](PyInstrument& self, std::shared_ptr<PySession> s, std::shared_ptr<PyCut> c, const View& at,
             std::shared_ptr<Reference> reference, bool pictures, std::shared_ptr<PyCut> before) {
            const py::gil_scoped_release release;
            self.check_source(*given("measure: session", s), "measure");
            const Parts earlier = before == nullptr ? Parts() : Parts{{s, before}};
            return self.examine({{s, c}}, earlier, at, std::move(reference), pictures);
          },
          py::arg("session"), py::arg("cut"), view, py::arg("reference") = py::none(),
          py::arg("pictures") = true, py::arg("before") = py::none(),
          "A Measurement of a cut. Without a reference the figures that compare with it are nan; without "
          "pictures capture_mismatch_pixels is too; without `before`, the cut of the frame before, pops "
          "are, as where it has another pose. A cut with a pose is measured against the source deformed "
          "alike. InvalidInput for a reference of another view or pose.")
      .def(
          "examine_parts",
          [](PyInstrument& self, Parts parts, const View& at, std::shared_ptr<Reference> reference,
             bool pictures, Parts before) {
            const py::gil_scoped_release release;
            return self.examine(std::move(parts), std::move(before), at, std::move(reference), pictures);
          },
          py::arg("parts"), view, py::arg("reference") = py::none(), py::arg("pictures") = true,
          py::arg("before") = Parts(),
          "For calibration: a Measurement of cuts of any stores, of other sources too, drawn together: "
          "(session, cut) pairs.")
      .def(
          "examine_triangles",
          [](PyInstrument& self, const py::array& triangles, const std::optional<py::array>& fillers,
             const std::optional<View>& at, std::shared_ptr<Reference> reference) {
            const auto corners =
                checked<double>("measure", triangles, "triangles", {-1, 3, 3}, "(T, 3, 3) float64");
            py::array_t<uint8_t, py::array::c_style> kinds;
            if (fillers)
              kinds = checked<uint8_t>("measure", *fillers, "fillers", {corners.shape(0)}, "(T,) uint8");
            const std::span<const Triangle> soup = span_of<Triangle>(corners);
            const std::span<const uint8_t> kind(kinds.data(), static_cast<size_t>(kinds.size()));
            const py::gil_scoped_release release;
            return self.examine_triangles(soup, kind, at, std::move(reference));
          },
          py::arg("triangles"), py::arg("fillers") = py::none(), py::arg("view") = py::none(),
          py::arg("reference") = py::none(),
          "A Measurement of triangles that no method drew: (T, 3, 3) float64 in source coordinates; fillers "
          "(T,) uint8, 1 where one is filler. Without a view nothing is drawn, and columns that need one are "
          "nan. InvalidInput for other arrays, no triangles, and a vertex that is not finite.")
      .def(
          "slack", [](const PyInstrument& self, const View& at) { return self.ruler().slack(at.eye); }, view,
          "world_slack at the farthest sample, source units: what laws on measured_max allow.");
}

}  // namespace lodlab
