// SPDX-License-Identifier: MIT
// Clocks for `lodlab bench select` that run inside the core: selection along a path, and beside it what
// selection costs without a hierarchy: a test of every node.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <chrono>
#include <vector>

#include "base/errors.h"
#include "bindings/session.h"
#include "common/projection.h"
#include "geometry/bounds.h"

namespace py = pybind11;

namespace lodlab {
namespace {

using Clock = std::chrono::steady_clock;

void check(const std::vector<View>& views, int repeats) {
  if (views.empty()) throw InvalidInput("timing: no views");
  if (repeats < 1) throw InvalidInput("timing: " + std::to_string(repeats) + " repeats; at least 1");
}

/// Microseconds of `work(view)` for every view, all of them `repeats` times; `before` goes ahead of a repeat.
template <class Before, class Work>
std::vector<double> clock_views(const std::vector<View>& views, int repeats, Before before, Work work) {
  std::vector<double> out;
  out.reserve(views.size() * static_cast<size_t>(repeats));
  for (int i = 0; i < repeats; ++i) {
    before();
    for (const View& view : views) {
      const Clock::time_point start = Clock::now();
      work(view);
      out.push_back(std::chrono::duration<double, std::micro>(Clock::now() - start).count());
    }
  }
  return out;
}

py::tuple time_select(const PySession& self, const std::vector<View>& views, const Budget& budget,
                      int repeats) {
  check(views, repeats);
  const auto count = static_cast<py::ssize_t>(views.size());
  std::vector<double> times;
  std::vector<int64_t> chunks;
  {
    const py::gil_scoped_release release;
    check_budget(self.store().method->info(), budget);
    Session& session = self.selecting();
    for (const View& view : views)
      chunks.push_back(self.resolved(session.select({view, budget, nullptr}))->claim().visible_nodes);
    times = clock_views(
        views, repeats, [&] { session.reset(); },
        [&](const View& view) {
          session.select({view, budget, nullptr});
        });
  }
  return py::make_tuple(array_of(std::move(times), {repeats, count}), array_of(std::move(chunks), {count}));
}

/// Nodes that pass both tests of a selection: the projected error, and the frustum.
int64_t scan(const std::vector<NodeInfo>& nodes, const View& view, double tau) {
  const Camera c = make_camera(view);
  int64_t drawn = 0;
  for (const NodeInfo& node : nodes) {
    const double rho = project_strict(node.error, c.K, distance(node.box, c.eye), c.near_plane, c.s, 1.0);
    drawn += rho <= tau && c.sees(node.box);
  }
  return drawn;
}

py::array_t<double> time_scan(const PyStore& store, const std::vector<View>& views, double pixel_error,
                              int repeats) {
  check(views, repeats);
  std::vector<double> times;
  {
    const py::gil_scoped_release release;
    const std::vector<NodeInfo> nodes = store.hierarchy->nodes();
    volatile int64_t seen = 0;  // the compiler must believe that somebody reads the counts
    times = clock_views(
        views, repeats, [] {}, [&](const View& view) { seen = scan(nodes, view, pixel_error); });
  }
  return array_of(std::move(times), {repeats, static_cast<py::ssize_t>(views.size())});
}

}  // namespace

void bind_bench(py::module_& m) {
  m.def(
      "time_select", &time_select, py::arg("session"), py::arg("views"), py::arg("budget"),
      py::arg("repeats"),
      "Microseconds of each select, (repeats, views) float64, the session reset before every repeat; and the "
      "nodes drawn in each view, (views,) int64.");
  m.def("time_scan", &time_scan, py::arg("store"), py::arg("views"), py::arg("pixel_error"),
        py::arg("repeats"),
        "Microseconds to test every node of a store against a view, (repeats, views) float64.");
}

}  // namespace lodlab
