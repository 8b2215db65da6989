// SPDX-License-Identifier: MIT
// The sides of edges that may collapse, the cheapest first, about.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

namespace lodlab::subdivision {

/// A priority queue that is exact to 3 %: 32 buckets for each power of two.
class CollapseQueue {
 public:
  struct Entry {
    float cost;  ///< not negative
    uint32_t side;
  };
  void push(const Entry& entry) {
    const size_t bucket = std::bit_cast<uint32_t>(entry.cost) >> 18;
    buckets_[bucket].push_back(entry);
    least_ = std::min(least_, bucket);
  }
  bool pop(Entry& out) {
    while (least_ < buckets_.size() && buckets_[least_].empty()) ++least_;
    if (least_ == buckets_.size()) return false;
    out = buckets_[least_].back();
    buckets_[least_].pop_back();
    return true;
  }

 private:
  std::vector<std::vector<Entry>> buckets_ = std::vector<std::vector<Entry>>(1 << 13);
  size_t least_ = 0;
};

}  // namespace lodlab::subdivision
