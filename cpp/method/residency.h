// SPDX-License-Identifier: MIT
// Paging, shared by all methods that page: which units of a store are on the GPU, where in its buffer, and
// what to load or drop next; a unit is what a method loads at once. Ulrich 2002, section 15. No GL: a
// method's draw.cpp carries out what this decides.
//
// Units are numbered so that parents come before their children, and roots, which are locked, come first. A
// method that uses a unit's parents whenever it uses the unit, for no less worth, has this invariant: the
// parents of a resident unit are resident, since among equals the highest number is dropped first.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <tuple>
#include <vector>

#include "store/page_cache.h"

namespace lodlab {

class Residency {
 public:
  struct Unit {
    int64_t page;        ///< its number in the store
    int64_t bytes;       ///< in the buffer
    int64_t beside = 0;  ///< GPU memory beside the buffer (a texture); 0: there is no such page
  };
  struct Setup {
    std::vector<Unit> units;
    uint32_t roots = 0;
    int kind = 0, beside_kind = 0;  ///< of pages
    int64_t capacity = 0, beside_capacity = 0;
    bool stream =
        true;  ///< false: a unit counts as resident at any time; what is not there is read when drawn
    int64_t cpu_bytes = 0;
    std::chrono::milliseconds fetch_delay{0};
    PageCache::Decode decode;
  };
  /// Reads the roots when streaming, so that the first frame does not wait for storage.
  Residency(const std::shared_ptr<const Store>& store, Setup setup);
  /// Loads through another one's loader and cache in main memory, whose size, delay and decode hold for both:
  /// one queue, in which priorities compare. It has GPU memory of its own.
  Residency(const Residency& host, Setup setup);

  bool streams() const { return setup_.stream; }
  bool resident(uint32_t unit) const {
    return !setup_.stream || place_[unit].offset >= 0 || unit < setup_.roots;
  }
  /// Marks a unit as used in this frame: it is not dropped before the next one, but for a unit of more than
  /// twice its worth.
  void touch(uint32_t unit, double worth = std::numeric_limits<double>::infinity()) {
    Place& place = place_[unit];
    place.worth = place.used == frame_ ? std::max(place.worth, worth) : worth;
    place.used = frame_;
  }
  /// Whether it was, with at least this worth.
  bool touched(uint32_t unit, double worth = 0.0) const {
    return place_[unit].used == frame_ && place_[unit].worth >= worth;
  }
  void next_frame() { ++frame_; }

  struct Want {
    uint32_t unit;
    double priority;  ///< larger comes first
  };
  /// Asks the loader for these in place of what it was asked for before.
  void want(std::vector<Want> wants);
  /// Wanted units that may be admitted now, most important first.
  const std::vector<Want>& wanted() const { return wanted_; }
  /// Blocks until all that was asked for is in main memory.
  void settle() { loader_->cache.settle(); }

  /// How many units have been made resident so far; the same number, the same units.
  int64_t admitted() const { return admitted_; }
  /// Bytes of the buffer to create.
  int64_t capacity() const { return setup_.capacity; }
  /// GPU memory beside it that resident units take.
  int64_t beside_used() const { return beside_used_; }
  /// In the buffer; -1: not there.
  int64_t offset(uint32_t unit) const { return place_[unit].offset; }

  struct Upload {
    uint32_t unit;
    int64_t offset;
    std::shared_ptr<const Bytes> page;    ///< decoded
    std::shared_ptr<const Bytes> beside;  ///< null: none
  };
  /// Makes the unit resident, dropping units unused in this frame, or worth less than half, where room is
  /// needed; `wait` reads from storage if it must. Nothing when it is not in main memory yet or no room can
  /// be made.
  std::optional<Upload> admit(uint32_t unit, bool wait, std::vector<uint32_t>& dropped, double worth = 0.0);

 private:
  struct Loader {
    PageCache cache;
    std::vector<std::vector<PageCache::Want>> asked;  ///< by who shares it
  };
  Residency(std::shared_ptr<Loader> loader, Setup setup);

  struct Place {
    int64_t offset = -1;
    uint64_t used = 0;
    double worth = 0.0;   ///< in that frame
    uint32_t loaded = 0;  ///< its index there
  };
  /// What goes first: the least recently used; of those used in this frame the one of least worth; among
  /// equals the highest number: children go before their parent, which was used whenever they were.
  struct Rank {
    uint64_t used;
    double worth;
    uint32_t unit;
    bool operator<(const Rank& other) const {
      return std::tuple(used, worth, other.unit) < std::tuple(other.used, other.worth, unit);
    }
  };
  Rank rank(uint32_t unit) const {
    const Place& place = place_[unit];
    return {place.used, place.used == frame_ ? place.worth : 0.0, unit};
  }
  std::optional<uint32_t> first_to_go();
  int64_t allocate(int64_t bytes);
  void release(uint32_t unit);
  bool drop_one(double worth, std::vector<uint32_t>& dropped);

  Setup setup_;
  std::shared_ptr<Loader> loader_;
  size_t turn_;  ///< its place in Loader::asked
  int64_t beside_used_ = 0, admitted_ = 0;
  uint64_t frame_ = 1;
  std::vector<Place> place_;
  std::vector<uint32_t> loaded_;  // resident units that are not roots, any order
  std::vector<Rank> going_;       // the same as a heap, once a frame needs it: ranks as they were, or lower
  uint64_t going_frame_ = 0;      // which frame's
  std::map<int64_t, int64_t> free_;  // offset -> bytes
  std::vector<Want> wanted_;
};

}  // namespace lodlab
