// SPDX-License-Identifier: MIT
// Streaming: a loader thread that reads wanted pages, most important first, into a least-recently-used
// cache in main memory with a hard byte budget. A frame asks and goes on; it never waits. No GL here.
// After fork the child may only destroy it: all else is a StoreError there.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "store/store.h"

namespace lodlab {

class PageCache {
 public:
  struct Want {
    int kind;
    int64_t id;
    double priority;  ///< larger comes first
  };
  /// Turns a stored page into the bytes kept in the cache; runs on the loader thread.
  using Decode = std::function<Bytes(int kind, int64_t id, Bytes stored)>;

  /// `fetch_delay` is slept before each read (tests: slow storage). `capacity` bytes is hard: pages are
  /// evicted, least recently used first, before one that would exceed it is stored.
  PageCache(std::shared_ptr<const Store> store, int64_t capacity, std::chrono::milliseconds fetch_delay,
            Decode decode);
  ~PageCache();

  /// Replaces the queue by these wants; those already cached are skipped. Returns at once.
  void want(std::vector<Want> wants);
  /// The page if it is cached, marked as used; else null. Errors of the loader thread are rethrown here.
  std::shared_ptr<const Bytes> find(int kind, int64_t id);
  /// Reads on the calling thread what the cache does not hold (locked roots, stream=false).
  std::shared_ptr<const Bytes> load(int kind, int64_t id);
  /// Blocks until the queue is empty.
  void settle();

  int64_t bytes() const;
  int64_t capacity() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace lodlab
