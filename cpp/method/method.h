// SPDX-License-Identifier: MIT
// The one interface of all level-of-detail methods. Bindings, command line, sweeps and charts know
// methods through it alone.
//
// A Method builds stores and opens them. An opened store gives sessions; a Session owns GL objects,
// caches and adaptation state, belongs to one thread once it has drawn, and selects, draws and is captured.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/options.h"
#include "base/progress.h"
#include "geometry/bounds.h"
#include "geometry/mesh.h"
#include "geometry/source.h"
#include "geometry/view.h"
#include "render/pass.h"
#include "store/store.h"

namespace lodlab {

/// What a frame may spend. At least one is set, all are positive.
struct Budget {
  std::optional<double> pixel_error;  ///< target for the projected error, pixels
  std::optional<int64_t> triangles;   ///< hard limit on submitted triangles, fillers included
  std::optional<int64_t> nodes;       ///< hard limit on submitted nodes
};

/// What kind of surface a mesh must be, vertices at equal positions made one; each is the one before it, too.
enum class Needs { kAnything, kManifold, kClosed, kGenusZero };  // manifold: oriented alike
std::string name_of(Needs needs);

struct MethodInfo {
  std::string name;
  std::string summary;               ///< one sentence
  std::vector<std::string> accepts;  ///< of heightfield, planet, mesh
  std::vector<std::string> budgets;  ///< of pixel_error, triangles, nodes; empty: budgets are ignored
  bool reproduces_source = false;    ///< the finest cut is the source up to the store's quantum
  std::vector<OptionSpec> options;   ///< of both stages
  bool by_rows = false;              ///< builds from sources larger than memory, too
  Needs needs = Needs::kAnything;    ///< of a mesh: builds of others are refused
  bool deforms = false;              ///< requests may have a pose: its hierarchies have control points
};

/// A row per node and resolution: what `store.nodes` shows.
struct NodeInfo {
  int64_t id = 0;
  int64_t parent = -1;  ///< -1: a root
  int32_t level = 0;    ///< 0: roots
  int32_t resolution = 0;
  int64_t triangles = 0;  ///< fillers included
  double error = 0.0;     ///< bound on the distance to the source, source units
  Box box;
};

struct CutNode {
  uint32_t node = 0;  ///< the node that was selected
  uint32_t resolution = 0;
  float morph = 1.0f;    ///< 1: its own surface, 0: its parent's
  bool visible = true;   ///< false: outside the frustum, not submitted in pictures
  bool missing = false;  ///< finer data was wanted and is not there yet: this node stands in
  double error = 0.0;  ///< bound on the distance to the source as drawn (morph, edges included), source units
};

/// Where the control points of a mesh are, source units: null where nothing is deformed.
struct Pose {
  std::vector<glm::dvec3> control;
  bool operator==(const Pose&) const = default;
};

/// Whether two requests are of one pose.
inline bool same_pose(const std::shared_ptr<const Pose>& a, const std::shared_ptr<const Pose>& b) {
  return a == b || (a != nullptr && b != nullptr && *a == *b);
}

/// Where a source goes when the control points of a store that was built from it are moved.
class Carrier {
 public:
  virtual ~Carrier() = default;
  /// The source as the pose deforms it, vertex by vertex. InvalidInput for another number of control points,
  /// and for a pose that takes a vertex beyond kFarthestVertex.
  virtual std::shared_ptr<const Mesh> carry(const Pose& pose) const = 0;
};

/// What a frame asks for.
struct Request {
  View view;
  Budget budget;  ///< none set: a cut by hand
  std::shared_ptr<const Pose> pose;
};

/// What a method that selects on the GPU keeps of a selection: its uniforms, from which the very cut is drawn
/// again.
struct Record {
  virtual ~Record() = default;
};

/// What a method says of a cut. Its nodes cover the whole source.
struct Claim {
  std::vector<CutNode> nodes;                            ///< sorted by node
  double tau = std::numeric_limits<double>::infinity();  ///< pixels; morphs and edges were computed for it
  double predicted_px = 0.0;  ///< largest projected bound among visible nodes, as drawn
  int64_t triangles = 0;      ///< of visible nodes, fillers included
  int64_t filler_triangles = 0;
  int64_t visible_nodes = 0;
  int64_t missing_nodes = 0;   ///< visible stand-ins
  int64_t adapt_steps = 0;     ///< moves that adaptation made or tried
  bool promises_bound = true;  ///< predicted_px is an upper bound
  bool budget_met = true;
  std::string warning;  ///< what its user should know of this cut; empty: nothing
  /// What the cheapest cut for the view takes, where that breaks a hard budget: of the cuts within the nodes
  /// (or with the fewest, where none is within them) the one with the fewest triangles.
  std::optional<int64_t> least_triangles, least_nodes;

  bool within(const Budget& budget) const {
    return within_hard(budget) && (!budget.pixel_error || predicted_px <= *budget.pixel_error);
  }
  bool within_hard(const Budget& budget) const {
    return (!budget.triangles || triangles <= *budget.triangles) &&
           (!budget.nodes || visible_nodes <= *budget.nodes);
  }
};

/// What a method selected. It is drawn as often as wanted, in any view, and never changes: from its record
/// where the GPU selects, else from its claim.
struct Cut {
  Request request;
  std::shared_ptr<const Record> record;  ///< null where the CPU selects
  std::optional<Claim> claim;            ///< none until resolve() where the GPU selects
};

/// A cut of nodes that no view asked for: it predicts no pixels.
inline Cut cut_by_hand(Claim claim) {
  claim.predicted_px = std::numeric_limits<double>::quiet_NaN();
  return {{}, nullptr, std::move(claim)};
}

class Session {
 public:
  virtual ~Session() = default;

  /// Picks the cut: all that a frame does for it on the CPU, and timed. Deterministic given what is resident;
  /// streaming requests are issued here. A method that selects on the GPU leaves a record and no claim.
  virtual Cut select(const Request& request) = 0;

  /// Fills in the claim of a cut that has none, as the GPU selects it: on the CPU, not timed. Deterministic.
  virtual void resolve(Cut& /*cut*/) const {}

  /// Equal where two cuts of equal hierarchies draw the same. Here: that of the claim's nodes, resolutions,
  /// morphs and visibility; a method that draws from a record tells records apart.
  virtual std::string digest(const Cut& cut) const;

  /// The smallest largest projected error, pixels, that any cut of this hierarchy reaches for a request
  /// within its hard budgets (a lower bound is enough); no smaller than its pixel error. NaN: none that keeps
  /// them, or not known. It may take long, and changes nothing.
  virtual double optimum_px(const Request& /*request*/) const {
    return std::numeric_limits<double>::quiet_NaN();
  }

  /// A cut by hand: any nodes that cover the source exactly once. InvalidInput names the first gap,
  /// overlap or broken rule. `resolutions` is empty or as long as `nodes`.
  virtual Cut cut(const std::vector<int64_t>& nodes, const std::vector<int32_t>& resolutions) const = 0;

  /// Cuts that together draw every node at every resolution in every state of morph and edges that its bound
  /// has to cover: what an audit measures.
  virtual std::vector<Cut> audit_cuts() const = 0;

  /// A random one of all valid cuts, the same for a seed. Nothing: any nodes at any of their resolutions that
  /// cover the source are one.
  virtual std::optional<Cut> random_cut(uint64_t /*seed*/) const { return std::nullopt; }

  /// Runs passes of the method's own (a selection, a refinement: compute, transform feedback, framebuffers of
  /// its own) ahead of draw(). They are timed, but neither captured nor counted as drawn. The GL state is
  /// neutral, and is made so again afterwards; queries may be begun, but for GL_TIME_ELAPSED.
  virtual void prepare(const Cut& /*cut*/, render::Work& /*work*/) {}

  /// Submits the triangles of the cut into the pass: of its visible nodes, or all when `pass.everything()`.
  /// Uploads what is missing and resident in main memory; never waits for storage. May come several times
  /// after one prepare().
  virtual void draw(const Cut& cut, render::Pass& pass) = 0;

  /// Forgets adaptation state, so that a run starts the same way every time. Caches stay warm.
  virtual void reset() {}

  /// What its user should know about the draw options, a sentence each: Python warns of them when it is made.
  virtual std::vector<std::string> warnings() const { return {}; }

  /// Bytes of GPU memory held by this session.
  virtual int64_t resident_bytes() const = 0;

  /// Blocks until everything requested so far is resident (tests and warm-up of streaming runs).
  virtual void settle() {}
};

/// An opened, immutable store seen by its method; shared between threads.
class Hierarchy {
 public:
  virtual ~Hierarchy() = default;
  virtual std::vector<NodeInfo> nodes() const = 0;
  /// The quantum of stored heights or positions, source units; 0: none.
  virtual double quantum() const = 0;
  /// Unique surface vertices over all nodes, for bytes_per_vertex.
  virtual int64_t vertices() const = 0;
  /// What the build told of itself, JSON; empty: nothing.
  virtual std::string told() const { return {}; }
  /// Where the control points are at rest, source units: what a pose moves. Empty: the method deforms
  /// nothing, and is never asked for a pose.
  virtual std::vector<glm::dvec3> control() const { return {}; }
  /// How its source hangs on them; null where there are none.
  virtual std::shared_ptr<const Carrier> carrier(std::shared_ptr<const Mesh> /*source*/) const {
    return nullptr;
  }
  /// A new session. `draw_options` are validated against the method's table.
  virtual std::unique_ptr<Session> session(const Options& draw_options) const = 0;
};

class Method {
 public:
  virtual ~Method() = default;
  virtual const MethodInfo& info() const = 0;
  /// Writes hierarchy, geometry and bounds. Pages that `writer.has_page` holds already (a resumed build)
  /// are left as they are. Never touches GL. Deterministic whatever the number of threads.
  virtual void build(const Source& source, const Options& options, StoreWriter& writer,
                     const Progress& progress) const = 0;
  virtual std::shared_ptr<const Hierarchy> open(std::shared_ptr<const Store> store) const = 0;
};

/// All methods, in the order of the registry. One line a method: method/registry.cpp.
const std::vector<const Method*>& methods();
/// Throws InvalidInput listing the known ones.
const Method& find_method(const std::string& name);
/// For tests: adds a method to the registry until the process ends.
void register_method(const Method* method);

/// What a method needs and a mesh lacks, a sentence with counts; empty: nothing.
std::string lacking(const MethodInfo& info, const Source& source);

/// Checks that the method accepts the source and its windows (Unsupported), that the source has what the
/// method needs (InvalidInput, with counts), and the options (InvalidInput), builds into `path` (temporary
/// name, renamed when complete), returns the opened store. `brought`: the meshes that options name.
std::shared_ptr<const Store> build_store(const Source& source, const Method& method,
                                         const std::map<std::string, OptionValue>& options,
                                         const std::string& path, BuildMode mode, const Progress& progress,
                                         std::map<std::string, Meshes> brought = {});

/// Checks a budget against a method's list: InvalidInput for values that are not positive or none set,
/// Unsupported for one that the method does not list. `full` (empty list) ignores budgets.
void check_budget(const MethodInfo& info, const Budget& budget);

}  // namespace lodlab
