// SPDX-License-Identifier: MIT
#include "methods/chunked/residency.h"

#include <algorithm>

#include "base/errors.h"
#include "methods/chunked/texture.h"

namespace lodlab::chunked {
namespace {

constexpr int64_t kAlign = 16;  // offsets serve as base vertex (8 bytes) and first index (2 or 4)

int64_t aligned(int64_t bytes) { return (bytes + kAlign - 1) / kAlign * kAlign; }

}  // namespace

int64_t Residency::geometry_bytes(const Node& node) const {
  return aligned(int64_t{node.vertices} * 8 + int64_t{node.indices} * hierarchy_->index_bytes);
}

/// With its mip levels, a third more.
int64_t Residency::texture_bytes(const Node& node) {
  return node.texture_side == 0 ? 0 : int64_t{node.texture_side + 1} * (node.texture_side + 1) * 16 / 3;
}

Residency::Residency(std::shared_ptr<const ChunkedHierarchy> hierarchy, bool stream, int64_t cpu_bytes,
                     int64_t gpu_bytes, std::chrono::milliseconds fetch_delay)
    : hierarchy_(std::move(hierarchy)), stream_(stream), place_(hierarchy_->node.size()) {
  int64_t geometry = 0, texture = 0, least = 0, widest = 0;
  for (size_t i = 0; i < hierarchy_->node.size(); ++i) {
    const Node& node = hierarchy_->node[i];
    const int64_t bytes = geometry_bytes(node) + texture_bytes(node);
    geometry += geometry_bytes(node);
    texture += texture_bytes(node);
    if (i < hierarchy_->roots) least += bytes;
    int64_t family = 0;
    for (uint32_t c = node.first_child; c < node.first_child + node.children; ++c) {
      family += geometry_bytes(hierarchy_->node[c]) + texture_bytes(hierarchy_->node[c]);
    }
    widest = std::max(widest, family);
  }
  const int64_t total = geometry + texture;
  const auto mib = [](int64_t bytes) { return std::to_string((bytes + (1 << 20) - 1) >> 20); };
  if (!stream && total > gpu_bytes) {
    throw InvalidInput("chunked: stream=false needs gpu_cache_mb of at least " + mib(total) + ", not " +
                       mib(gpu_bytes));
  }
  if (stream && least + widest > gpu_bytes) {
    throw InvalidInput("chunked: the roots and one set of children need gpu_cache_mb of at least " +
                       mib(least + widest) + ", not " + mib(gpu_bytes));
  }
  const double share = total > gpu_bytes ? static_cast<double>(gpu_bytes) / static_cast<double>(total) : 1.0;
  capacity_ = static_cast<int64_t>(static_cast<double>(geometry) * share) / kAlign * kAlign;
  texture_capacity_ = static_cast<int64_t>(static_cast<double>(texture) * share);
  free_[0] = capacity_;
  cache_ = std::make_unique<PageCache>(
      hierarchy_->store, cpu_bytes, fetch_delay, [tree = hierarchy_](int kind, int64_t id, Bytes stored) {
        if (kind == kTexture) return decode_texture(stored, tree->node[static_cast<size_t>(id)].texture_side);
        return decode_page(stored, tree->index_bytes);
      });
  // Roots are locked; read now, so that the first frame does not wait for storage.
  for (uint32_t i = 0; stream && i < hierarchy_->roots; ++i) {
    cache_->load(kGeometry, i);
    if (hierarchy_->node[i].texture_side > 0) cache_->load(kTexture, i);
  }
}

bool Residency::children_resident(uint32_t node) const {
  const Node& parent = hierarchy_->node[node];
  for (uint32_t c = parent.first_child; c < parent.first_child + parent.children; ++c) {
    if (!resident(c)) return false;
  }
  return true;
}

void Residency::want(std::vector<PageCache::Want> wants) {
  std::stable_sort(wants.begin(), wants.end(), [](const PageCache::Want& a, const PageCache::Want& b) {
    return a.priority > b.priority;
  });
  wanted_ = wants;
  const size_t count = wants.size();
  for (size_t i = 0; i < count; ++i) {
    if (hierarchy_->node[static_cast<size_t>(wants[i].id)].texture_side > 0) {
      wants.push_back({kTexture, wants[i].id, wants[i].priority});
    }
  }
  cache_->want(std::move(wants));
}

void Residency::settle() { cache_->settle(); }

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

void Residency::release(uint32_t node) {
  int64_t offset = place_[node].offset, bytes = geometry_bytes(hierarchy_->node[node]);
  place_[node].offset = -1;
  texture_used_ -= texture_bytes(hierarchy_->node[node]);
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

/// Drops the least recently used node, the deepest first among equals: children go before their parent,
/// which was used whenever they were. Roots are locked.
bool Residency::drop_one(std::vector<uint32_t>& dropped) {
  const auto older = [&](uint32_t a, uint32_t b) {
    return place_[a].used != place_[b].used ? place_[a].used < place_[b].used : a > b;
  };
  const auto victim = std::min_element(loaded_.begin(), loaded_.end(), older);
  if (victim == loaded_.end() || place_[*victim].used >= frame_) return false;
  dropped.push_back(*victim);
  release(*victim);
  *victim = loaded_.back();
  loaded_.pop_back();
  return true;
}

std::optional<Residency::Upload> Residency::admit(uint32_t id, bool wait, std::vector<uint32_t>& dropped) {
  const Node& node = hierarchy_->node[id];
  Upload upload{id, -1, nullptr, nullptr};
  upload.geometry = wait ? cache_->load(kGeometry, id) : cache_->find(kGeometry, id);
  if (node.texture_side > 0) upload.texture = wait ? cache_->load(kTexture, id) : cache_->find(kTexture, id);
  if (upload.geometry == nullptr || (node.texture_side > 0 && upload.texture == nullptr)) return std::nullopt;
  const int64_t bytes = geometry_bytes(node);
  while (texture_used_ + texture_bytes(node) > texture_capacity_ || (upload.offset = allocate(bytes)) < 0) {
    if (!drop_one(dropped)) return std::nullopt;
  }
  place_[id].offset = upload.offset;
  place_[id].used = frame_;
  texture_used_ += texture_bytes(node);
  if (id >= hierarchy_->roots) loaded_.push_back(id);
  return upload;
}

}  // namespace lodlab::chunked
