// SPDX-License-Identifier: MIT
// Work: what a method does on the GPU for one picture of a cut. A pass is the part of it that draws: into the
// current target, or into a capture of its triangles. A method supplies vertices; everything after its last
// geometry stage is shared (shaders/common).
#pragma once

#include <compare>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

#include "geometry/bounds.h"
#include "geometry/height_field.h"
#include "geometry/view.h"
#include "store/store.h"

namespace lodlab::render {

/// What the shared fragment shader shows.
enum class Show {
  kShade,   ///< hillshade with height tints, or the colour map where there is one
  kNormal,  ///< the normal that shades, as colour
  kLevel,   ///< a colour per hierarchy level
  kClass,   ///< red channel: 0 nothing, 255 the outside of the surface, 128 its inside; voids filled
  kNone,    ///< nothing: rasterizer off (benchmarks)
};

/// Maps of attributes that a method has for its surface. Normals that it has shade pictures in place of the
/// drawn triangles' own.
struct Maps {
  bool colors = false, normals = false;
  auto operator<=>(const Maps&) const = default;
};
/// Texture units of their sampler2DArrays (surface.frag).
enum MapUnit : unsigned { kColorUnit = 0, kNormalUnit = 1 };

/// What was really submitted by a draw.
struct Submitted {
  int64_t triangles = 0, filler_triangles = 0, vertices = 0, nodes = 0, draw_calls = 0;
  int64_t upload_bytes = 0;
  int64_t processed = 0;  ///< triangles that passes or threads tested, once for each test; 0: whole nodes are
};

enum class SurfaceKind { kFlat, kPlanet, kMesh };

/// What every method needs of its source to draw on (surface.h). Created once per session on the GL thread.
class Surface;
std::shared_ptr<const Surface> make_surface(const FieldFrame& frame, const Bytes& coverage);
std::shared_ptr<const Surface> make_surface(const Box& mesh);

/// The method's stages plus the shared fragment shader and the transform feedback layout. Variants (by
/// Show, kind of surface, coverage, maps) compile on first use. `stages` maps a stage ("vertex", "geometry",
/// "tess_control", "tess_evaluation") to a file below the shader folder, as "chunked/chunk.vert".
/// Every stage that ends the geometry includes "common/surface_out.glsl" and calls emit_surface().
class SurfaceProgram {
 public:
  struct StageFile {
    std::string stage, file;
  };
  SurfaceProgram(std::initializer_list<StageFile> stages, std::vector<std::string> defines = {});
  ~SurfaceProgram();

 private:
  friend class Pass;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

struct Variant;

/// Handed to Session::prepare.
class Work {
 public:
  virtual ~Work() = default;
  /// What the cut is drawn from.
  const Camera& camera() const { return camera_; }
  /// True in captures of the whole cut: culled nodes are submitted too.
  bool everything() const { return everything_; }
  Submitted submitted;  ///< the method adds what it submits

  using Tell = std::function<void(Submitted&)>;
  /// For what only the GPU knows: called when all is done, not timed, and only where it is asked for. It
  /// reads buffers and queries.
  void when_done(Tell tell) { tells_.push_back(std::move(tell)); }

 protected:
  Work(const Camera& camera, bool everything) : camera_(camera), everything_(everything) {}
  Camera camera_;
  bool everything_;
  std::vector<Tell> tells_;
};

/// Handed to Session::draw.
class Pass : public Work {
 public:
  /// Binds the program's variant for this pass, the camera block and the field's resources, and returns
  /// the GL program name (for the method's own uniforms). Called before the method's draw calls, again
  /// after any other program was bound. The stages compile with LODLAB_COLORS and LODLAB_NORMALS
  /// where the pass shows a map that there is; the method binds its sampler2DArrays to their units. Between
  /// use() and the last draw call that belongs to it no other program may be bound (a capture may be
  /// running).
  virtual unsigned use(SurfaceProgram& program, const Surface& field, Maps maps) = 0;
  /// Triangles that one use() takes well. Where a draw submits more, the method may split it and call use()
  /// again in between: a capture then needs less memory. No limit in pictures.
  virtual int64_t batch_triangles() const { return INT64_MAX; }

 protected:
  using Work::Work;
  /// The program of this variant, compiled on first use.
  static unsigned program_of(SurfaceProgram& program, const Variant& variant);
};

}  // namespace lodlab::render
