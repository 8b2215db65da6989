// SPDX-License-Identifier: MIT
#include "method/residency.h"

#include <algorithm>
#include <cmath>

namespace lodlab {
namespace {

/// Makes the least the top of a heap.
constexpr auto kLater = [](const auto& a, const auto& b) { return b < a; };

}  // namespace

Residency::Residency(const std::shared_ptr<const Store>& store, Setup setup)
    : Residency(std::shared_ptr<Loader>(
                    new Loader{PageCache(store, setup.cpu_bytes, setup.fetch_delay, setup.decode), {}}),
                setup) {}

Residency::Residency(const Residency& host, Setup setup) : Residency(host.loader_, std::move(setup)) {}

Residency::Residency(std::shared_ptr<Loader> loader, Setup setup)
    : setup_(std::move(setup)),
      loader_(std::move(loader)),
      turn_(loader_->asked.size()),
      place_(setup_.units.size()) {
  loader_->asked.emplace_back();
  free_[0] = setup_.capacity;
  for (uint32_t i = 0; setup_.stream && i < setup_.roots; ++i) {
    const Unit& unit = setup_.units[i];
    loader_->cache.load(setup_.kind, unit.page);
    if (unit.beside > 0) loader_->cache.load(setup_.beside_kind, unit.page);
  }
}

void Residency::want(std::vector<Want> wants) {
  std::stable_sort(wants.begin(), wants.end(),
                   [](const Want& a, const Want& b) { return a.priority > b.priority; });
  std::vector<PageCache::Want>& pages = loader_->asked[turn_];
  pages.clear();
  double rank = std::numeric_limits<double>::infinity();
  for (const Want& want : wants) {
    const Unit& unit = setup_.units[want.unit];
    if (unit.beside == 0) {
      pages.push_back({setup_.kind, unit.page, want.priority});
      continue;
    }
    // No two alike: a cache too small for both units would fill with the first pages of each.
    rank = std::min(want.priority, std::nextafter(rank, -std::numeric_limits<double>::infinity()));
    pages.push_back({setup_.kind, unit.page, rank});
    pages.push_back({setup_.beside_kind, unit.page, rank});
  }
  wanted_ = std::move(wants);
  std::vector<PageCache::Want> all;
  for (const auto& asked : loader_->asked) all.insert(all.end(), asked.begin(), asked.end());
  loader_->cache.want(std::move(all));
}

/// First fit.
int64_t Residency::allocate(int64_t bytes) {
  for (auto hole = free_.begin(); hole != free_.end(); ++hole) {
    if (hole->second < bytes) continue;
    const int64_t offset = hole->first, left = hole->second - bytes;
    free_.erase(hole);
    if (left > 0) free_[offset + bytes] = left;
    return offset;
  }
  return -1;
}

void Residency::release(uint32_t unit) {
  int64_t offset = place_[unit].offset, bytes = setup_.units[unit].bytes;
  place_[unit].offset = -1;
  beside_used_ -= setup_.units[unit].beside;
  auto next = free_.lower_bound(offset);
  if (next != free_.end() && next->first == offset + bytes) {
    bytes += next->second;
    next = free_.erase(next);
  }
  if (next != free_.begin()) {
    const auto before = std::prev(next);
    if (before->first + before->second == offset) {
      before->second += bytes;
      return;
    }
  }
  free_[offset] = bytes;
}

/// Within a frame ranks only rise, so what the heap has on top goes first if its rank is still the same.
std::optional<uint32_t> Residency::first_to_go() {
  if (going_frame_ != frame_) {
    going_.clear();
    for (const uint32_t unit : loaded_) going_.push_back(rank(unit));
    std::make_heap(going_.begin(), going_.end(), kLater);
    going_frame_ = frame_;
  }
  while (!going_.empty()) {
    const uint32_t unit = going_.front().unit;
    const Rank now = rank(unit);
    if (!(going_.front() < now)) return unit;
    std::pop_heap(going_.begin(), going_.end(), kLater);
    going_.back() = now;
    std::push_heap(going_.begin(), going_.end(), kLater);
  }
  return std::nullopt;
}

/// Roots are locked.
bool Residency::drop_one(double worth, std::vector<uint32_t>& dropped) {
  const std::optional<uint32_t> victim = first_to_go();
  if (!victim) return false;
  const Place& place = place_[*victim];
  if (place.used == frame_ && !(place.worth < 0.5 * worth)) return false;
  std::pop_heap(going_.begin(), going_.end(), kLater);
  going_.pop_back();
  dropped.push_back(*victim);
  release(*victim);
  loaded_[place.loaded] = loaded_.back();
  place_[loaded_.back()].loaded = place.loaded;
  loaded_.pop_back();
  return true;
}

std::optional<Residency::Upload> Residency::admit(uint32_t id, bool wait, std::vector<uint32_t>& dropped,
                                                  double worth) {
  const Unit& unit = setup_.units[id];
  const auto page = [&](int kind) {
    return wait ? loader_->cache.load(kind, unit.page) : loader_->cache.find(kind, unit.page);
  };
  Upload upload{id, -1, page(setup_.kind), nullptr};
  if (unit.beside > 0) upload.beside = page(setup_.beside_kind);
  if (upload.page == nullptr || (unit.beside > 0 && upload.beside == nullptr)) return std::nullopt;
  while (beside_used_ + unit.beside > setup_.beside_capacity || (upload.offset = allocate(unit.bytes)) < 0) {
    if (!drop_one(worth, dropped)) return std::nullopt;
  }
  place_[id].offset = upload.offset;
  touch(id, worth);
  ++admitted_;
  beside_used_ += unit.beside;
  if (id < setup_.roots) return upload;
  place_[id].loaded = static_cast<uint32_t>(loaded_.size());
  loaded_.push_back(id);
  if (going_frame_ == frame_) {
    going_.push_back(rank(id));
    std::push_heap(going_.begin(), going_.end(), kLater);
  }
  return upload;
}

}  // namespace lodlab
