// SPDX-License-Identifier: MIT
// A binary heap of node ids with handles: the entry of any node is found, changed or erased in O(log n).
// The largest key is on top, of equal ones the smallest id: the order of a cut's adaptation never depends on
// how a heap was filled. Nothing is allocated once a heap has been as full as it gets.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace lodlab::multigrain {

struct Key {
  double first = 0.0, second = 0.0;  ///< the larger, the sooner; `second` among equal `first`
};

class Heap {
 public:
  /// Ids are below `ids`.
  explicit Heap(size_t ids) : where_(ids, -1) {}

  bool empty() const { return entries_.empty(); }
  size_t size() const { return entries_.size(); }
  uint32_t top() const { return entries_.front().id; }
  const Key& key() const { return entries_.front().key; }
  bool holds(uint32_t id) const { return where_[id] >= 0; }

  /// Adds the node, or gives it another key.
  void set(uint32_t id, Key key) {
    if (where_[id] < 0) {
      where_[id] = static_cast<int32_t>(entries_.size());
      entries_.push_back({key, id});
      rise(entries_.size() - 1);
    } else {
      const auto at = static_cast<size_t>(where_[id]);
      entries_[at].key = key;
      settle(at);
    }
  }
  void erase(uint32_t id) {
    if (where_[id] < 0) return;
    const auto at = static_cast<size_t>(where_[id]);
    where_[id] = -1;
    const Entry last = entries_.back();
    entries_.pop_back();
    if (last.id == id) return;
    put(at, last);
    settle(at);
  }
  void pop() { erase(top()); }
  void clear() {
    for (const Entry& entry : entries_) where_[entry.id] = -1;
    entries_.clear();
  }
  /// Adds a node that is not there without keeping the order: for a frame's first filling, where every key
  /// changes with the eye. order() ends it, in linear time.
  void append(uint32_t id, Key key) {
    where_[id] = static_cast<int32_t>(entries_.size());
    entries_.push_back({key, id});
  }
  void order() {
    for (size_t at = entries_.size() / 2; at-- > 0;) sink(at);
  }

 private:
  struct Entry {
    Key key;
    uint32_t id;
  };
  static bool sooner(const Entry& a, const Entry& b) {
    if (a.key.first != b.key.first) return a.key.first > b.key.first;
    if (a.key.second != b.key.second) return a.key.second > b.key.second;
    return a.id < b.id;
  }
  void put(size_t at, const Entry& entry) {
    entries_[at] = entry;
    where_[entry.id] = static_cast<int32_t>(at);
  }
  void settle(size_t at) {
    if (at > 0 && sooner(entries_[at], entries_[(at - 1) / 2])) {
      rise(at);
    } else {
      sink(at);
    }
  }
  void rise(size_t at) {
    const Entry entry = entries_[at];
    while (at > 0 && sooner(entry, entries_[(at - 1) / 2])) {
      put(at, entries_[(at - 1) / 2]);
      at = (at - 1) / 2;
    }
    put(at, entry);
  }
  void sink(size_t at) {
    const Entry entry = entries_[at];
    for (;;) {
      size_t child = 2 * at + 1;
      if (child >= entries_.size()) break;
      if (child + 1 < entries_.size() && sooner(entries_[child + 1], entries_[child])) ++child;
      if (!sooner(entries_[child], entry)) break;
      put(at, entries_[child]);
      at = child;
    }
    put(at, entry);
  }

  std::vector<Entry> entries_;
  std::vector<int32_t> where_;  ///< -1: not there
};

}  // namespace lodlab::multigrain
