// SPDX-License-Identifier: MIT
// Stores and methods for Python. What takes long runs without the GIL. A build runs on a thread of its own,
// while the calling thread looks for Ctrl-C and reports progress, so that both work whatever thread the
// method reports from.
#include "store/store.h"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <limits>
#include <mutex>
#include <optional>
#include <set>
#include <thread>

#include "base/errors.h"
#include "bindings/common.h"
#include "geometry/height_field.h"
#include "geometry/mesh.h"
#include "method/method.h"

namespace py = pybind11;

namespace lodlab {

std::map<std::string, OptionValue> options_from_dict(const std::string& owner, const py::dict& given) {
  std::map<std::string, OptionValue> out;
  for (const auto& [key, object] : given) {
    const std::string name = py::str(key);
    py::object value = py::reinterpret_borrow<py::object>(object);
    if (py::hasattr(value, "dtype") && py::hasattr(value, "item")) value = value.attr("item")();  // numpy
    if (py::hasattr(value, "__fspath__")) value = value.attr("__fspath__")();
    if (py::isinstance<py::bool_>(value)) {
      out[name] = value.cast<bool>();
    } else if (py::isinstance<py::int_>(value)) {
      int overflow = 0;
      const long long number = PyLong_AsLongLongAndOverflow(value.ptr(), &overflow);
      if (overflow != 0) throw InvalidInput(owner + ": option " + name + " is beyond 64 bits");
      out[name] = static_cast<int64_t>(number);
    } else if (py::isinstance<py::float_>(value)) {
      out[name] = value.cast<double>();
    } else if (py::isinstance<py::str>(value)) {
      out[name] = value.cast<std::string>();
    } else {
      throw InvalidInput(owner + ": option " + name + " is a " + Py_TYPE(value.ptr())->tp_name +
                         ", not bool, int, float or str");
    }
  }
  return out;
}

namespace {

py::object to_python(const OptionValue& value) {
  return std::visit([](const auto& v) { return py::object(py::cast(v)); }, value);
}

/// Texts for the enums of the core; InvalidInput lists the known ones.
template <class T>
T choose(const char* what, const std::string& text, std::initializer_list<std::pair<const char*, T>> known) {
  std::string names;
  for (const auto& [name, value] : known) {
    if (text == name) return value;
    names += (names.empty() ? "" : ", ") + std::string(name);
  }
  throw InvalidInput(std::string(what) + ": '" + text + "' is not one of " + names);
}

Stage stage_of(const std::string& text) {
  return choose<Stage>("stage", text, {{"build", Stage::kBuild}, {"draw", Stage::kDraw}});
}

BuildMode mode_of(const std::string& text) {
  return choose<BuildMode>(
      "build mode", text,
      {{"new", BuildMode::kNew}, {"force", BuildMode::kForce}, {"resume", BuildMode::kResume}});
}

py::object bound(double limit) { return std::isfinite(limit) ? py::object(py::float_(limit)) : py::none(); }

py::dict describe(const OptionSpec& option) {
  py::dict out;
  out["name"] = option.name;
  out["type"] = option.type();
  out["default"] = to_python(option.default_value);
  if (!option.choices.empty()) out["choices"] = py::cast(option.choices);
  if (std::isfinite(option.minimum) || std::isfinite(option.maximum)) {
    py::list range;
    range.append(bound(option.minimum));
    range.append(bound(option.maximum));
    out["range"] = range;
  }
  out["unit"] = option.unit;
  out["help"] = option.help;
  out["stage"] = option.stage == Stage::kBuild ? "build" : "draw";
  return out;
}

py::list list_methods() {
  py::list out;
  for (const Method* method : methods()) {
    const MethodInfo& info = method->info();
    py::dict entry;
    entry["name"] = info.name;
    entry["summary"] = info.summary;
    entry["accepts"] = py::cast(info.accepts);
    entry["budgets"] = py::cast(info.budgets);
    entry["reproduces_source"] = info.reproduces_source;
    py::list options;
    for (const OptionSpec& option : info.options) options.append(describe(option));
    entry["options"] = options;
    entry["by_rows"] = info.by_rows;
    entry["needs"] = name_of(info.needs);
    entry["deforms"] = info.deforms;
    out.append(entry);
  }
  return out;
}

std::string lacking_of(const std::string& method, const std::shared_ptr<Source>& source) {
  const MethodInfo& info = find_method(method).info();
  const Source& mesh = *given("lacking: source", source);
  const py::gil_scoped_release release;
  return lacking(info, mesh);
}

py::dict resolve(const std::string& method, const std::string& stage, const py::dict& given) {
  const MethodInfo& info = find_method(method).info();
  return options_to_dict(
      resolve_options(info.name, info.options, stage_of(stage), options_from_dict(info.name, given)));
}

std::shared_ptr<PyStore> with_method(std::shared_ptr<const Store> store) {
  const std::string& name = store->meta().method;
  const auto& all = methods();
  const auto found =
      std::find_if(all.begin(), all.end(), [&](const Method* method) { return method->info().name == name; });
  if (found == all.end()) {
    throw StoreError("store " + store->path() + ": was built by method '" + name +
                     "', which this program does not have");
  }
  auto hierarchy = (*found)->open(store);
  return std::make_shared<PyStore>(PyStore{std::move(store), *found, std::move(hierarchy)});
}

std::shared_ptr<PyStore> open_store(const std::filesystem::path& path) {
  const py::gil_scoped_release release;
  return with_method(Store::open(path.string()));
}

/// A build on its own thread. The calling thread ticks: signals, then the newest progress.
class Building {
 public:
  explicit Building(std::function<std::shared_ptr<PyStore>(const Progress&)> work)
      : thread_([this, work = std::move(work)] { run(work); }) {}

  /// Called without the GIL; `tick` may throw, which stops the build and comes out of here.
  std::shared_ptr<PyStore> wait(const std::function<void(const std::string*, double)>& tick) {
    std::exception_ptr stopped;
    for (bool last = false; !last;) {
      std::unique_lock guard(mutex_);
      last = ended_.wait_for(guard, kTick, [this] { return done_; });
      const std::string stage = stage_;
      const double share = share_;
      const bool news = std::exchange(news_, false);
      guard.unlock();
      if (stopped) continue;
      try {
        tick(news ? &stage : nullptr, share);
      } catch (...) {
        stopped = std::current_exception();
        stop_ = true;
      }
    }
    thread_.join();
    if (stopped) std::rethrow_exception(stopped);
    if (error_) std::rethrow_exception(error_);
    return std::move(result_);
  }

 private:
  static constexpr std::chrono::milliseconds kTick{50};

  void report(const std::string& stage, double share) {
    if (stop_) throw Interrupted();
    const std::lock_guard guard(mutex_);
    stage_ = stage;
    share_ = share;
    news_ = true;
  }

  void run(const std::function<std::shared_ptr<PyStore>(const Progress&)>& work) {
    std::shared_ptr<PyStore> result;
    std::exception_ptr error;
    try {
      result = work([this](const std::string& stage, double share) { report(stage, share); });
    } catch (...) {
      error = std::current_exception();
    }
    const std::lock_guard guard(mutex_);
    result_ = std::move(result);
    error_ = error;
    done_ = true;
    ended_.notify_one();
  }

  std::mutex mutex_;
  std::condition_variable ended_;
  bool done_ = false, news_ = false;
  std::string stage_;
  double share_ = 0.0;
  std::atomic<bool> stop_{false};
  std::shared_ptr<PyStore> result_;
  std::exception_ptr error_;
  std::thread thread_;  // last: it uses all the others
};

std::shared_ptr<PyStore> build(std::shared_ptr<Source> source, const std::string& method_name,
                               const std::filesystem::path& path, const py::dict& options,
                               const std::string& mode, const std::optional<py::function>& progress,
                               std::map<std::string, Meshes> meshes) {
  given("build: source", source);
  const Method& method = find_method(method_name);
  const auto values = options_from_dict(method.info().name, options);
  const BuildMode build_mode = mode_of(mode);
  const auto tick = [&](const std::string* stage, double share) {
    const py::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (stage != nullptr && progress) (*progress)(*stage, share);
  };
  const py::gil_scoped_release release;
  Building building([&](const Progress& report) {
    return with_method(build_store(*source, method, values, path.string(), build_mode, report, meshes));
  });
  return building.wait(tick);
}

// store.nodes ---------------------------------------------------------------------------------------------

struct NodeRow {
  int64_t id, parent;
  int32_t level, resolution;
  int64_t triangles;
  double error;
  double box_min[3], box_max[3];
};

py::array nodes(const PyStore& self) {  // untyped in the signature: stubs know no struct
  std::vector<NodeInfo> infos;
  {
    const py::gil_scoped_release release;
    infos = self.hierarchy->nodes();
  }
  py::array_t<NodeRow> out(static_cast<py::ssize_t>(infos.size()));
  NodeRow* row = out.mutable_data();
  for (const NodeInfo& n : infos) {
    *row++ = {n.id,
              n.parent,
              n.level,
              n.resolution,
              n.triangles,
              n.error,
              {n.box.lo.x, n.box.lo.y, n.box.lo.z},
              {n.box.hi.x, n.box.hi.y, n.box.hi.z}};
  }
  return out;
}

// store.info() --------------------------------------------------------------------------------------------

py::object parse_json(const std::string& text) { return py::module_::import("json").attr("loads")(text); }

/// Per level: its nodes, their triangles and largest error, each node at its finest resolution.
py::list levels(const std::vector<NodeInfo>& rows) {
  std::map<int64_t, const NodeInfo*> finest;
  for (const NodeInfo& row : rows) {
    const NodeInfo*& best = finest[row.id];
    if (best == nullptr || row.resolution > best->resolution) best = &row;
  }
  struct Level {
    int64_t nodes = 0, triangles = 0;
    double error = 0.0;
  };
  std::map<int32_t, Level> sums;
  for (const auto& [id, row] : finest) {
    Level& level = sums[row->level];
    ++level.nodes;
    level.triangles += row->triangles;
    level.error = std::max(level.error, row->error);
  }
  py::list out;
  for (const auto& [number, level] : sums) {
    py::dict entry;
    entry["level"] = number;
    entry["nodes"] = level.nodes;
    entry["triangles"] = level.triangles;
    entry["error_max"] = level.error;
    out.append(entry);
  }
  return out;
}

/// Of the source: of a mesh its vertices.
int64_t samples_of_frame(const std::string& frame) {
  if (kind_of_frame(frame) == "mesh") return mesh_frame_from_json(frame).vertices;
  const FieldFrame field = frame_from_json(frame);
  return field.rows * field.cols;
}

py::dict info(const PyStore& self) {
  const Store& store = *self.store;
  const auto bytes = static_cast<double>(store.bytes());
  const auto vertices = static_cast<double>(self.hierarchy->vertices());
  py::dict out;
  out["format_version"] = store.format_version();
  out["complete"] = true;  // others do not open
  out["method"] = store.meta().method;
  out["options"] = parse_json(store.meta().options);
  out["source"] = store.meta().source_spec;
  out["source_hash"] = store.meta().source_hash;
  out["content_hash"] = store.content_hash();
  out["build_seconds"] = store.build_seconds();
  out["quantum"] = self.hierarchy->quantum();
  out["bytes"] = store.bytes();
  out["bytes_per_sample"] = bytes / static_cast<double>(samples_of_frame(store.meta().frame));
  out["bytes_per_vertex"] = vertices > 0 ? bytes / vertices : std::numeric_limits<double>::quiet_NaN();
  out["levels"] = levels(self.hierarchy->nodes());
  if (const std::string told = self.hierarchy->told(); !told.empty()) out["build"] = parse_json(told);
  return out;
}

py::array_t<double> carry(const PyStore& self, const std::shared_ptr<Mesh>& source,
                          const py::array& positions) {
  given("deformed: source", source);
  const auto pose = pose_of(self, "deformed", positions);
  std::shared_ptr<const Mesh> carried;
  {
    const py::gil_scoped_release release;
    carried = self.hierarchy->carrier(source)->carry(*pose);
  }
  return array_of_points(carried->positions);
}

void bind_store_class(py::module_& m) {
  PYBIND11_NUMPY_DTYPE(NodeRow, id, parent, level, resolution, triangles, error, box_min, box_max);
  py::class_<PyStore, std::shared_ptr<PyStore>>(m, "Store", "An opened, complete store: immutable.")
      .def_property_readonly("path", [](const PyStore& s) { return s.store->path(); })
      .def_property_readonly("method", [](const PyStore& s) { return s.store->meta().method; })
      .def_property_readonly(
          "options", [](const PyStore& s) { return parse_json(s.store->meta().options); },
          "Build options, every default written out.")
      .def_property_readonly("source_hash", [](const PyStore& s) { return s.store->meta().source_hash; })
      .def_property_readonly("source_spec", [](const PyStore& s) { return s.store->meta().source_spec; })
      .def_property_readonly("frame", [](const PyStore& s) { return parse_json(s.store->meta().frame); })
      .def_property_readonly(
          "nodes", &nodes,
          "Structured array id, parent, level, resolution, triangles, error, box_min, box_max: "
          "a row per node and resolution.")
      .def_property_readonly(
          "control_positions",
          [](const PyStore& s) { return array_of_points(control_of(s, "control_positions")); },
          "(V, 3) float64, source units: the control points at rest, which a pose moves. Unsupported where "
          "the "
          "method has none.")
      .def("carry", &carry, py::arg("source"), py::arg("control_positions"),
           "(V, 3) float64: where the vertices of its source go as a pose deforms it.")
      .def("info", &info, "What `lodlab info --json` prints.")
      .def(
          "verify", [](const PyStore& s) { s.store->verify(); }, py::call_guard<py::gil_scoped_release>(),
          "Reads and checks everything; StoreError names the first part that is damaged.");
}

}  // namespace

std::vector<glm::dvec3> control_of(const PyStore& store, const std::string& operation) {
  std::vector<glm::dvec3> control = store.hierarchy->control();
  if (control.empty())
    throw Unsupported(operation + ": method " + store.method->info().name + " has no control points to move");
  return control;
}

std::shared_ptr<const Pose> pose_of(const PyStore& store, const std::string& operation,
                                    const py::array& positions) {
  const auto count = static_cast<py::ssize_t>(control_of(store, operation).size());
  const std::string wanted = "(" + std::to_string(count) + ", 3) float64";
  const auto array = checked<double>(operation, positions, "control_positions", {count, 3}, wanted.c_str());
  const auto points = span_of<glm::dvec3>(array);
  for (size_t i = 0; i < points.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      if (std::abs(points[i][k]) <= kFarthestVertex) continue;
      throw InvalidInput(operation + ": control position " + std::to_string(i) + " is " +
                         py::str(py::float_(points[i][k])).cast<std::string>() +
                         " along an axis; it is a number within 1e30");
    }
  }
  return std::make_shared<const Pose>(Pose{{points.begin(), points.end()}});
}

py::array_t<double> array_of_points(std::span<const glm::dvec3> points) {
  return py::array_t<double>({static_cast<py::ssize_t>(points.size()), py::ssize_t{3}},
                             reinterpret_cast<const double*>(points.data()));
}

py::dict options_to_dict(const Options& options) {
  py::dict out;
  for (const auto& [name, value] : options.values()) out[py::str(name)] = to_python(value);
  return out;
}

void bind_store(py::module_& m) {
  bind_store_class(m);
  m.def("methods", &list_methods, "Every method with its option table, as `lodlab methods --json`.");
  m.def("lacking", &lacking_of, py::arg("method"), py::arg("source"),
        "What a method needs of a mesh and this one lacks, a sentence with counts; empty: nothing.");
  m.def("resolve_options", &resolve, py::arg("method"), py::arg("stage"), py::arg("options"),
        "The values of all options of a stage ('build' or 'draw'). InvalidInput for an unknown name or a bad "
        "value.");
  m.def(
      "build", &build, py::arg("source"), py::arg("method"), py::arg("path"), py::arg("options") = py::dict(),
      py::arg("mode") = "new", py::arg("progress") = py::none(), py::arg("meshes") = py::dict(),
      "Builds a store. `mode`: 'new', 'force' or 'resume'. `progress(stage, share)` is called at most 20 "
      "times "
      "a second on the calling thread; what it raises stops the build, as Ctrl-C does, and leaves a partial "
      "file that can be resumed. `meshes`: lists of those that options name, by option.");
  m.def("open", &open_store, py::arg("path"), "Opens a store; StoreError says what is wrong with the file.");
}

}  // namespace lodlab
