// SPDX-License-Identifier: MIT
// Which chunks are on the GPU, where in its one buffer, and what to load or drop next. No GL: draw.cpp
// carries out what this decides. Ulrich 2002, section 15.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "methods/chunked/hierarchy.h"
#include "store/page_cache.h"

namespace lodlab::chunked {

class Residency {
 public:
  /// stream=false: everything is resident from the first draw on; InvalidInput when that exceeds the GPU
  /// budget. stream=true: InvalidInput when the budget cannot hold the roots and one set of children.
  Residency(std::shared_ptr<const ChunkedHierarchy> hierarchy, bool stream, int64_t cpu_bytes,
            int64_t gpu_bytes, std::chrono::milliseconds fetch_delay);

  bool streams() const { return stream_; }
  bool resident(uint32_t node) const {
    return !stream_ || place_[node].offset >= 0 || node < hierarchy_->roots;
  }
  bool children_resident(uint32_t node) const;
  void touch(uint32_t node) { place_[node].used = frame_; }
  void next_frame() { ++frame_; }
  /// Asks the loader for these, most important first.
  void want(std::vector<PageCache::Want> wants);
  void settle();

  /// Bytes of the geometry buffer to create.
  int64_t buffer_bytes() const { return capacity_; }
  /// Bytes of a node's geometry and of its texture.
  int64_t geometry_bytes(const Node& node) const;
  static int64_t texture_bytes(const Node& node);

  struct Upload {
    uint32_t node;
    int64_t offset;
    std::shared_ptr<const Bytes> geometry;  ///< a decoded page
    std::shared_ptr<const Bytes> texture;   ///< null: none
  };
  /// Makes the node resident, dropping nodes unused in this frame where room is needed; `wait` reads from
  /// storage if it must. Nothing when it is not in main memory yet or no room can be made.
  std::optional<Upload> admit(uint32_t node, bool wait, std::vector<uint32_t>& dropped);
  /// Wanted nodes that may be admitted now, most important first.
  const std::vector<PageCache::Want>& wanted() const { return wanted_; }
  int64_t offset(uint32_t node) const { return place_[node].offset; }

 private:
  struct Place {
    int64_t offset = -1;
    uint64_t used = 0;
  };
  int64_t allocate(int64_t bytes);
  void release(uint32_t node);
  bool drop_one(std::vector<uint32_t>& dropped);

  std::shared_ptr<const ChunkedHierarchy> hierarchy_;
  bool stream_;
  int64_t capacity_ = 0, texture_capacity_ = 0, texture_used_ = 0;
  uint64_t frame_ = 1;
  std::vector<Place> place_;
  std::vector<uint32_t> loaded_;     // resident nodes, any order
  std::map<int64_t, int64_t> free_;  // offset -> bytes
  std::unique_ptr<PageCache> cache_;
  std::vector<PageCache::Want> wanted_;
};

}  // namespace lodlab::chunked
