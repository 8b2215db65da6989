// SPDX-License-Identifier: MIT
// Sessions for Python: select, draw, capture, time. What takes long runs without the GIL.
#include "bindings/session.h"

#include <pybind11/stl.h>

#include <chrono>
#include <optional>

#include "base/errors.h"
#include "base/parallel.h"
#include "bindings/view.h"
#include "gl/context.h"

namespace py = pybind11;

namespace lodlab {

PySession::PySession(std::shared_ptr<PyStore> store, const py::dict& draw_options)
    : store_(given("session: store", std::move(store))) {
  const MethodInfo& info = store_->method->info();
  options_ =
      resolve_options(info.name, info.options, Stage::kDraw, options_from_dict(info.name, draw_options));
  session_ = store_->hierarchy->session(options_);
}

Session& PySession::selecting() const {
  if (process_ != getpid()) {
    throw GLError("session after fork: it belongs to the parent process; spawn processes instead of forking");
  }
  const std::lock_guard lock(mutex_);
  if (owner_.ended()) owner_ = ThreadKey::here();
  if (!owner_.is_here()) {
    throw GLError(
        "session: it belongs to the thread that first used it; give each thread a session of its own");
  }
  return *session_;
}

Session& PySession::drawing() {
  selecting();
  gl::ensure_context();
  return *session_;
}

std::shared_ptr<PyCut> PySession::resolved(Cut cut) const {
  session_->resolve(cut);
  if (!cut.claim)
    throw Unsupported("select: method " + store_->method->info().name + " does not say what it draws");
  return std::make_shared<PyCut>(PyCut{std::move(cut), store_->hierarchy});
}

const Cut& PySession::own(const PyCut& cut) const {
  if (cut.hierarchy != store_->hierarchy)
    throw InvalidInput("session: the cut was selected from another store");
  return cut.cut;
}

render::DrawCall PySession::draw_call(const Cut& cut) {
  Session& session = drawing();
  return {[&session, &cut](render::Work& work) { session.prepare(cut, work); },
          [&session, &cut](render::Pass& pass) { session.draw(cut, pass); }};
}

render::Show show_of(const std::string& text) {
  if (text == "shade") return render::Show::kShade;
  if (text == "normal") return render::Show::kNormal;
  if (text == "level") return render::Show::kLevel;
  if (text == "class") return render::Show::kClass;
  throw InvalidInput("show: '" + text + "' is not one of shade, normal, level, class");
}

namespace {

using Clock = std::chrono::steady_clock;

double milliseconds(Clock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

/// A picture as Python has it.
struct Frame {
  py::array_t<uint8_t> image;
  py::array_t<float> depth;
};

Frame frame_of(render::Picture picture) {
  const py::ssize_t height = picture.height, width = picture.width;
  return {array_of(std::move(picture.rgba), {height, width, 4}),
          array_of(std::move(picture.depth), {height, width})};
}

using Positions = std::optional<py::array>;

Request request_of(const PySession& self, const View& view, const Budget& budget,
                   const Positions& positions) {
  check_budget(self.store().method->info(), budget);
  return {view, budget, positions ? pose_of(self.store(), "select", *positions) : nullptr};
}

std::shared_ptr<PyCut> select(const PySession& self, const View& view, const Budget& budget,
                              const Positions& positions) {
  const Request request = request_of(self, view, budget, positions);
  const py::gil_scoped_release release;
  return self.resolved(self.selecting().select(request));
}

double optimum_px(const PySession& self, const View& view, const Budget& budget) {
  const Request request = request_of(self, view, budget, {});
  const py::gil_scoped_release release;
  return self.selecting().optimum_px(request);
}

std::shared_ptr<PyCut> cut_of_nodes(const PySession& self, const std::vector<int64_t>& nodes,
                                    const std::optional<std::vector<int32_t>>& resolutions) {
  const py::gil_scoped_release release;
  const auto finer = resolutions.value_or(std::vector<int32_t>());
  return self.resolved(self.selecting().cut(nodes, finer));
}

std::vector<std::shared_ptr<PyCut>> audit_cuts(const PySession& self) {
  std::vector<std::shared_ptr<PyCut>> out;
  for (Cut& cut : self.selecting().audit_cuts()) out.push_back(self.resolved(std::move(cut)));
  return out;
}

std::shared_ptr<PyCut> random_cut(const PySession& self, uint64_t seed) {
  std::optional<Cut> cut = self.selecting().random_cut(seed);
  return cut ? self.resolved(std::move(*cut)) : nullptr;
}

Frame draw(PySession& self, const PyCut& cut, const View& view, const std::string& show, bool everything) {
  render::Picture picture;
  {
    const py::gil_scoped_release release;
    picture = render::draw_picture(make_camera(view), show_of(show), self.draw_call(cut), true, everything);
  }
  return frame_of(std::move(picture));
}

Frame wire(PySession& self, const PyCut& cut, const View& view) {
  render::Picture picture;
  {
    const py::gil_scoped_release release;
    picture = render::draw_wire(make_camera(view), self.draw_call(cut));
  }
  return frame_of(std::move(picture));
}

std::shared_ptr<PyCapture> capture(PySession& self, const PyCut& cut, const View& view, bool everything) {
  const py::gil_scoped_release release;
  return std::make_shared<PyCapture>(
      PyCapture{render::capture(make_camera(view), self.draw_call(cut), everything)});
}

double time_draw(PySession& self, const PyCut& cut, const View& view, bool discard) {
  const py::gil_scoped_release release;
  const auto show = discard ? render::Show::kNone : render::Show::kShade;
  return render::time_draw(make_camera(view), show, self.draw_call(cut)).gpu_ms;
}

struct FrameCost {
  double select_ms, frame_ms;
  render::Timing timing;
  int64_t resident_bytes;
};

py::dict cost_columns(const FrameCost& cost, const Claim& claim) {
  const render::Submitted& submitted = cost.timing.submitted;
  py::dict out;
  out["select_ms"] = cost.select_ms;
  out["gpu_ms"] = cost.timing.gpu_ms;
  out["gpu_clock"] = cost.timing.gpu_clock;
  out["frame_ms"] = cost.frame_ms;
  out["triangles"] = submitted.triangles;
  out["vertices"] = submitted.vertices;
  out["nodes"] = submitted.nodes;
  out["draw_calls"] = submitted.draw_calls;
  out["filler_triangles"] = submitted.filler_triangles;
  out["upload_bytes"] = submitted.upload_bytes;
  out["resident_bytes"] = cost.resident_bytes;
  out["page_misses"] = claim.missing_nodes;
  out["adapt_steps"] = claim.adapt_steps;
  out["processed_triangles"] = submitted.processed;
  return out;
}

py::tuple time_frame(PySession& self, const View& view, const Budget& budget, bool discard,
                     const Positions& positions) {
  std::shared_ptr<PyCut> cut;
  FrameCost cost;
  const Request request = request_of(self, view, budget, positions);
  {
    const py::gil_scoped_release release;
    const Camera camera = make_camera(view);
    const auto show = discard ? render::Show::kNone : render::Show::kShade;
    Session& session = self.drawing();
    const Clock::time_point start = Clock::now();
    Cut selected = session.select(request);
    cost.select_ms = milliseconds(Clock::now() - start);
    cost.timing = render::time_draw(camera, show, self.draw_call(selected));
    cost.frame_ms = milliseconds(Clock::now() - start);
    cost.resident_bytes = session.resident_bytes();
    cut = self.resolved(std::move(selected));
  }
  return py::make_tuple(cut, cost_columns(cost, cut->claim()));
}

// Cut -----------------------------------------------------------------------------------------------------

struct CutRow {
  uint32_t node, resolution;
  float morph;
  bool visible, missing;
  double error;
};

py::array cut_nodes(const PyCut& self) {  // untyped in the signature: stubs know no struct
  py::array_t<CutRow> out(static_cast<py::ssize_t>(self.claim().nodes.size()));
  CutRow* row = out.mutable_data();
  for (const CutNode& n : self.claim().nodes)
    *row++ = {n.node, n.resolution, n.morph, n.visible, n.missing, n.error};
  return out;
}

std::optional<py::array_t<double>> cut_pose(const PyCut& self) {
  const auto& pose = self.cut.request.pose;
  if (pose == nullptr) return std::nullopt;
  return array_of_points(pose->control);
}

std::string cut_text(const PyCut& self) {
  const Claim& cut = self.claim();
  return "Cut(" + std::to_string(cut.nodes.size()) + " nodes, " + std::to_string(cut.visible_nodes) +
         " visible, " + std::to_string(cut.triangles) + " triangles, predicted " +
         py::str(py::float_(cut.predicted_px)).cast<std::string>() + " px" +
         (cut.budget_met ? "" : ", budget not met") +
         (cut.least_triangles ? ", the least is " + std::to_string(*cut.least_triangles) + " triangles in " +
                                    std::to_string(*cut.least_nodes) + " nodes"
                              : "") +
         ")";
}

void bind_cut(py::module_& m) {
  PYBIND11_NUMPY_DTYPE(CutRow, node, resolution, morph, visible, missing, error);
  py::class_<PyCut, std::shared_ptr<PyCut>>(m, "Cut", "What a method selected for a view under a budget.")
      .def_property_readonly(
          "nodes", &cut_nodes,
          "Structured array node, resolution, morph, visible, missing, error (the bound as "
          "drawn, source units): a row per node.")
      .def_property_readonly(
          "triangles", [](const PyCut& c) { return c.claim().triangles; },
          "Triangles of the visible nodes, fillers included.")
      .def_property_readonly("filler_triangles", [](const PyCut& c) { return c.claim().filler_triangles; })
      .def_property_readonly("visible_nodes", [](const PyCut& c) { return c.claim().visible_nodes; })
      .def_property_readonly(
          "missing_nodes", [](const PyCut& c) { return c.claim().missing_nodes; },
          "Visible nodes that stand in for finer data that is not there yet.")
      .def_property_readonly(
          "tau", [](const PyCut& c) { return c.claim().tau; },
          "Pixels that morphs and edges were computed for.")
      .def_property_readonly(
          "predicted_px", [](const PyCut& c) { return c.claim().predicted_px; },
          "Largest projected error bound among the visible nodes, pixels.")
      .def_property_readonly(
          "adapt_steps", [](const PyCut& c) { return c.claim().adapt_steps; },
          "Moves that adaptation made or tried; 0 where the method has none.")
      .def_property_readonly("promises_bound", [](const PyCut& c) { return c.claim().promises_bound; })
      .def_property_readonly("budget_met", [](const PyCut& c) { return c.claim().budget_met; })
      .def_property_readonly(
          "least_triangles", [](const PyCut& c) { return c.claim().least_triangles; },
          "Triangles of the cheapest cut for the view, where that breaks a hard budget, else None.")
      .def_property_readonly(
          "least_nodes", [](const PyCut& c) { return c.claim().least_nodes; }, "Its nodes.")
      .def_property_readonly(
          "view", [](const PyCut& c) { return c.cut.request.view; }, "The view it was selected for.")
      .def_property_readonly("control_positions", &cut_pose,
                             "(V, 3) float64: the pose that it was selected for, or None: at rest.")
      .def_property_readonly(
          "warning", [](const PyCut& c) { return c.claim().warning; },
          "What its user should know of it; empty: nothing.")
      .def("__repr__", &cut_text);
}

// Capture -------------------------------------------------------------------------------------------------

py::array_t<double> capture_triangles(const PyCapture& self) {
  const render::Captured& captured = self.captured;
  std::vector<double> out(3 * captured.vertices.size());
  {
    const py::gil_scoped_release release;
    parallel_for(static_cast<int64_t>(captured.vertices.size()), 1 << 18, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i) {
        const render::CapturedVertex& v = captured.vertices[static_cast<size_t>(i)];
        double* at = out.data() + 3 * i;
        at[0] = captured.eye.x + static_cast<double>(v.x);
        at[1] = captured.eye.y + static_cast<double>(v.y);
        at[2] = captured.eye.z + static_cast<double>(v.z);
      }
    });
  }
  return array_of(std::move(out), {captured.triangles(), 3, 3});
}

py::array_t<uint8_t> capture_kind(const PyCapture& self) {
  const auto& vertices = self.captured.vertices;
  std::vector<uint8_t> out(static_cast<size_t>(self.captured.triangles()));
  for (size_t t = 0; t < out.size(); ++t) {
    out[t] = static_cast<uint8_t>(
        (vertices[3 * t].bits | vertices[3 * t + 1].bits | vertices[3 * t + 2].bits) & 1u);
  }
  return array_of(std::move(out), {self.captured.triangles()});
}

py::array_t<uint32_t> capture_node(const PyCapture& self) {
  std::vector<uint32_t> out(static_cast<size_t>(self.captured.triangles()));
  for (size_t t = 0; t < out.size(); ++t) out[t] = self.captured.vertices[3 * t].node;
  return array_of(std::move(out), {self.captured.triangles()});
}

void bind_pictures(py::module_& m) {
  py::class_<Frame>(m, "Frame", "A picture of a cut.")
      .def_readonly("image", &Frame::image, "(H, W, 4) uint8, row 0 on top.")
      .def_readonly("depth", &Frame::depth,
                    "(H, W) float32, distance along the view axis in source units, inf where empty.")
      .def("__repr__", [](const Frame& f) {
        return "Frame(" + std::to_string(f.image.shape(1)) + " x " + std::to_string(f.image.shape(0)) +
               " pixels)";
      });
  py::class_<PyCapture, std::shared_ptr<PyCapture>>(m, "Capture",
                                                    "The triangles of a cut as the GPU emitted them.")
      .def_property_readonly("triangles", &capture_triangles, "(T, 3, 3) float64, source coordinates.")
      .def_property_readonly("kind", &capture_kind, "(T,) uint8: 0 surface, 1 filler.")
      .def_property_readonly("node", &capture_node, "(T,) uint32.")
      .def("__len__", [](const PyCapture& c) { return c.captured.triangles(); })
      .def("__repr__", [](const PyCapture& c) {
        return "Capture(" + std::to_string(c.captured.triangles()) + " triangles)";
      });
}

void bind_session_class(py::module_& m) {
  const auto view = py::arg("view"), cut = py::arg("cut");
  py::class_<PySession, std::shared_ptr<PySession>>(
      m, "Session",
      "Owns GL objects, caches and the adaptation state of one store; one thread's once it has drawn.")
      .def_property_readonly("options", [](const PySession& s) { return options_to_dict(s.options()); })
      .def("select", &select, view, py::arg("budget") = Budget(), py::arg("control_positions") = py::none(),
           "Picks the cut for a view under a budget; of the mesh as its control positions, (V, 3) float64 in "
           "source units, deform it. InvalidInput for others; Unsupported where the method has none.")
      .def(
          "optimum_px", &optimum_px, view, py::arg("budget") = Budget(),
          "The smallest largest projected error, pixels, that any cut reaches within the hard budgets, no "
          "smaller than the pixel error; nan: no cut keeps them, or the method does not know. May take long.")
      .def("cut", &cut_of_nodes, py::arg("nodes"), py::arg("resolutions") = py::none(),
           "A cut by hand: nodes that cover the source once. InvalidInput names the first gap or overlap.")
      .def(
          "digest", [](const PySession& s, const PyCut& c) { return s.selecting().digest(s.own(c)); }, cut,
          "Equal texts: the cuts draw the same in any view.")
      .def("audit_cuts", &audit_cuts,
           "Cuts that together draw every node at every resolution in every state of morph and edges.")
      .def("random_cut", &random_cut, py::arg("seed"), py::call_guard<py::gil_scoped_release>(),
           "A random one of all valid cuts; None: any nodes that cover the source, at any resolutions, are "
           "one.")
      .def("draw", &draw, cut, view, py::arg("show") = "shade", py::arg("everything") = false,
           "A Frame; show is 'shade', 'normal', 'level' or 'class'. With everything, culled nodes are drawn "
           "too.")
      .def("wire", &wire, cut, view, "A Frame of all triangles' edges over a pale surface.")
      .def("capture", &capture, cut, view, py::arg("everything") = true,
           "The triangles that the drawing program emits, culled nodes included by default.")
      .def("time_frame", &time_frame, view, py::arg("budget") = Budget(), py::arg("discard") = false,
           py::arg("control_positions") = py::none(),
           "Selects and draws, reading nothing back: (Cut, dict of cost columns).")
      .def("time_draw", &time_draw, cut, view, py::arg("discard") = false,
           "Milliseconds to draw a cut; with discard the rasterizer is off.")
      .def(
          "reset", [](const PySession& s) { s.selecting().reset(); },
          "Forgets the adaptation state; caches stay warm.")
      .def(
          "settle", [](const PySession& s) { s.selecting().settle(); },
          py::call_guard<py::gil_scoped_release>(), "Waits until everything requested so far is there.")
      .def_property_readonly("resident_bytes",
                             [](const PySession& s) { return s.selecting().resident_bytes(); })
      .def("__repr__", [](const PySession& s) {
        return "Session(" + s.store().method->info().name + ", " + s.store().store->path() + ")";
      });
  py::class_<PyStore, std::shared_ptr<PyStore>>(m.attr("Store"))
      .def(
          "session",
          [](std::shared_ptr<PyStore> store, const py::dict& options) {
            auto session = std::make_shared<PySession>(std::move(store), options);
            for (const std::string& warning : session->warnings()) {
              if (PyErr_WarnEx(PyExc_UserWarning, warning.c_str(), 1) < 0) throw py::error_already_set();
            }
            return session;
          },
          py::arg("options") = py::dict(), "A new session with these draw options.");
}

}  // namespace

void bind_session(py::module_& m) {
  bind_view(m);
  bind_cut(m);
  bind_pictures(m);
  bind_session_class(m);
  bind_static_mesh(m);
}

}  // namespace lodlab
