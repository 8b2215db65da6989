// SPDX-License-Identifier: MIT
// What of a store's heights is where. The unit is a patch; the root is locked, and the parents of a resident
// patch are resident, so that one can stand in for what is missing.
//
// Beside what a cut asks for, each level has a window of patches round the eye, of equal width in patches and
// as wide as memory allows, filled level by level. When the eye moves, what enters a window is an L of
// patches, and it takes the slots of those that left it. Windows are whole families of children: a patch can
// split only when all of them are there.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "base/options.h"
#include "method/residency.h"
#include "methods/seamless/hierarchy.h"
#include "methods/seamless/slots.h"

namespace lodlab::seamless {

class Paging {
 public:
  /// With the draw options stream, cpu_cache_mb, gpu_cache_mb, fetch_delay_ms and upload_bytes. InvalidInput
  /// when a cache cannot hold the root and, on the GPU, a family of patches on each level below it, the same
  /// of maps, or a frame cannot upload a patch or a tile of a map.
  Paging(const std::shared_ptr<const Hierarchy>& hierarchy, const PatchMesh& mesh, const Options& options);

  bool streams() const { return residency_.streams(); }
  /// Begins a frame: what the last one used may be dropped.
  void next_frame() { residency_.next_frame(); }
  bool resident(int64_t patch) const { return residency_.resident(static_cast<uint32_t>(patch)); }
  /// Marks a patch and its parents as used in this frame. Patches of more than twice the worth may take their
  /// places; in windows it is a quarter at most, so what a cut draws or lacks is worth 1 or more.
  void touch(int64_t patch, double worth);
  /// Touches a patch, or puts it into this frame's list of what the loader is asked for. Its parent is there,
  /// or needed too.
  void need(int64_t patch, double priority);
  /// Windows of the levels down to this one go where the eye is.
  void follow(const glm::dvec3& eye, int level);
  /// Hands the list over.
  void ask();
  /// Blocks until what was asked for is in main memory.
  void settle() { residency_.settle(); }

  // For maps (method/map_paging.h).
  const Residency& residency() const { return residency_; }
  /// Bytes of GPU memory that tiles of each map may take.
  const std::vector<int64_t>& map_bytes() const { return map_bytes_; }

  // For drawing.
  /// Patches, and what maps cut them into, that are drawn at once.
  int64_t most_pieces() const { return most_pieces_; }
  const Slots& slots() const { return slots_; }
  /// That a frame may bring to the GPU beside what it draws.
  int64_t upload_bytes() const { return upload_bytes_; }
  int64_t capacity() const { return residency_.capacity(); }
  /// Where a patch's slot is in the buffer, bytes; -1: not there.
  int64_t offset(int64_t patch) const { return residency_.offset(static_cast<uint32_t>(patch)); }
  /// What is asked for, most important first.
  const std::vector<Residency::Want>& wanted() const { return residency_.wanted(); }
  static constexpr uint32_t roots() { return 1; }
  uint32_t parent(int64_t patch) const;
  /// Makes a patch resident (Residency::admit).
  std::optional<Residency::Upload> admit(int64_t patch, bool wait, double worth);

  /// Patches across a window.
  int64_t window() const { return window_; }

 private:
  struct Plan {
    Residency::Setup setup;
    std::vector<int64_t> map_bytes;
    int64_t most_pieces;
  };
  static Plan plan(const std::shared_ptr<const Hierarchy>& hierarchy, const PatchMesh& mesh,
                   const Options& options);
  Paging(const std::shared_ptr<const Hierarchy>& hierarchy, Plan plan, int64_t upload_bytes);
  struct Origin {
    int64_t y, x;
    bool operator==(const Origin&) const = default;
  };
  bool look_round(int level, const Origin& origin, double row, double col);

  std::shared_ptr<const Hierarchy> hierarchy_;
  Slots slots_;
  int64_t window_, upload_bytes_, most_pieces_;
  Residency residency_;
  std::vector<int64_t> map_bytes_;
  std::vector<Residency::Want> wants_;
  std::vector<uint32_t> dropped_;
  std::vector<Origin> complete_;  ///< windows of which all is there, from level 1 on
};

}  // namespace lodlab::seamless
