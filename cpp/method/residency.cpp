// SPDX-License-Identifier: MIT
#include "method/residency.h"

#include <algorithm>
#include <tuple>

namespace lodlab {

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
  for (const Want& want : wants) pages.push_back({setup_.kind, setup_.units[want.unit].page, want.priority});
  for (const Want& want : wants) {
    const Unit& unit = setup_.units[want.unit];
    if (unit.beside > 0) pages.push_back({setup_.beside_kind, unit.page, want.priority});
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

/// Drops the least recently used unit, of those used in this frame the one of least worth, the highest number
/// first among equals: children go before their parent, which was used whenever they were. Roots are locked.
bool Residency::drop_one(double worth, std::vector<uint32_t>& dropped) {
  const auto rank = [&](uint32_t unit) {
    const Place& place = place_[unit];
    return std::tuple(place.used, place.used == frame_ ? place.worth : 0.0, ~unit);
  };
  const auto victim = std::min_element(loaded_.begin(), loaded_.end(),
                                       [&](uint32_t a, uint32_t b) { return rank(a) < rank(b); });
  if (victim == loaded_.end()) return false;
  if (place_[*victim].used == frame_ && !(place_[*victim].worth < 0.5 * worth)) return false;
  dropped.push_back(*victim);
  release(*victim);
  *victim = loaded_.back();
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
  if (id >= setup_.roots) loaded_.push_back(id);
  return upload;
}

}  // namespace lodlab
