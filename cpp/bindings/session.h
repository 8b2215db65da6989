// SPDX-License-Identifier: MIT
// Sessions, cuts and captures as Python holds them; the instrument's and the benchmarks' bindings use them.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <unistd.h>

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "base/thread_key.h"
#include "bindings/common.h"
#include "geometry/view.h"
#include "method/method.h"
#include "render/frame.h"

namespace lodlab {

/// A cut with its claim filled in. It remembers the store that it was selected from: node numbers mean
/// nothing to another.
struct PyCut {
  Cut cut;
  std::shared_ptr<const Hierarchy> hierarchy;
  const Claim& claim() const { return *cut.claim; }
};

/// A session; it belongs to the thread that first used it, and when that one has ended, to the next.
class PySession {
 public:
  PySession(std::shared_ptr<PyStore> store, const pybind11::dict& draw_options);

  const PyStore& store() const { return *store_; }
  const Options& options() const { return options_; }
  /// What its user should know; any thread may ask.
  std::vector<std::string> warnings() const { return session_->warnings(); }
  /// The session, for calls that select; GLError on another thread than its owner while that one lives.
  Session& selecting() const;
  /// The session, for calls that draw.
  Session& drawing();
  /// What the session has selected, its claim filled in.
  std::shared_ptr<PyCut> resolved(Cut cut) const;
  /// Draws a cut of this session's store into a pass. Call on the drawing thread.
  render::DrawCall draw_call(const Cut& cut);
  /// InvalidInput when it is another store's.
  const Cut& own(const PyCut& cut) const;
  render::DrawCall draw_call(const PyCut& cut) { return draw_call(own(cut)); }

 private:
  std::shared_ptr<PyStore> store_;
  Options options_;
  std::unique_ptr<Session> session_;
  mutable std::mutex mutex_;  // guards owner_
  mutable ThreadKey owner_;
  pid_t process_ = getpid();
};

/// What transform feedback captured; arrays are made when asked for.
struct PyCapture {
  render::Captured captured;
};

/// What cuts of a source are drawn on. Unsupported, naming `operation`, for a kind of source that is no
/// surface.
std::shared_ptr<const render::Surface> surface_of(const std::string& operation, const Source& source);

/// "shade", "normal", "level", "class". InvalidInput lists them.
render::Show show_of(const std::string& text);

/// A vector's memory as an array of this shape, without a copy.
template <class T>
pybind11::array_t<T> array_of(std::vector<T> values, std::vector<pybind11::ssize_t> shape) {
  auto* kept = new std::vector<T>(std::move(values));
  const pybind11::capsule owner(kept, [](void* held) { delete static_cast<std::vector<T>*>(held); });
  return pybind11::array_t<T>(std::move(shape), kept->data(), owner);
}

}  // namespace lodlab
