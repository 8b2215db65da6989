// SPDX-License-Identifier: MIT
// Which patches are resident, wanted, in windows round the eye (paging.h); the budgets of both memories.
#include "methods/seamless/paging.h"

#include <algorithm>
#include <cmath>

#include "base/errors.h"
#include "method/map_paging.h"
#include "method/paging_options.h"
#include "method/sample_code.h"
#include "methods/seamless/ranges.h"
#include "methods/seamless/seamless.h"
#include "methods/seamless/squares.h"
#include "render/surface.h"

namespace lodlab::seamless {
namespace {

constexpr double kWindowWorth = 0.25;
constexpr size_t kMostWanted = 4096;    // patches that the loader is asked for at once
constexpr size_t kEnoughWanted = 1024;  // beyond them finer windows wait
constexpr int64_t kPerPiece = 2 * 40;   // bytes of instance and command; buffers may double
constexpr int64_t kPerMap = 2 * 16;     // and of its row for a map
constexpr int64_t kMorePieces = 4096;   // that maps may cut patches into

int64_t branch(const Layout& layout) { return int64_t{1} << layout.branch_log2(); }

/// The most that index ranges can take on the GPU, and what the field does.
int64_t bytes_beside_heights(const Hierarchy& hierarchy, const PatchMesh& mesh) {
  return Ranges::most_bytes(mesh, hierarchy.layout) +
         render::Surface::bytes_of(hierarchy.frame, !hierarchy.coverage().empty());
}

[[noreturn]] void refuse(const std::string& what, const char* option, int64_t least, int64_t given) {
  throw InvalidInput("seamless: " + what + " need " + option + " of at least " +
                     std::to_string((least + (1 << 20) - 1) >> 20) + ", not " + std::to_string(given >> 20));
}

/// Without a capacity.
Residency::Setup setup_of(const std::shared_ptr<const Hierarchy>& hierarchy, const Slots& slots,
                          const Maps& maps, const Options& options) {
  const Layout& layout = hierarchy->layout;
  const PagingOptions caches = paging_of(options);
  const int64_t patches = layout.patches();
  if (patches > UINT32_MAX)
    throw Unsupported("seamless: " + std::to_string(patches) + " patches are more than can be paged");
  Residency::Setup setup;
  setup.units.reserve(static_cast<size_t>(patches));
  for (int64_t id = 0; id < patches; ++id) setup.units.push_back({id, slots.bytes()});
  setup.roots = 1;
  setup.kind = kHeights;
  setup.stream = caches.stream;
  setup.cpu_bytes = caches.cpu_bytes;
  setup.fetch_delay = caches.fetch_delay;
  setup.decode = [slots, maps, floats = page_samples(layout, hierarchy->averaged())](int kind, int64_t id,
                                                                                     Bytes stored) {
    if (auto texels = maps.decode(kind, id, stored)) return *std::move(texels);
    std::vector<float> heights(static_cast<size_t>(floats));
    decode_samples(stored, heights.data(), floats);
    return slots.arrange(heights);
  };
  return setup;
}

/// The width at which the windows of all levels fit into so many slots.
int64_t widest_window(const Layout& layout, int64_t slots) {
  const auto fits = [&](int64_t width) {
    int64_t sum = 1;
    for (int l = 1; l < layout.levels; ++l)
      sum += std::min(width, layout.across(l)) * std::min(width, layout.down(l));
    return sum <= slots;
  };
  constexpr int64_t kWidest = 32;  // patches: no view draws more of a level side by side
  const int last = layout.levels - 1;
  const int64_t step = branch(layout), whole = std::max(layout.across(last), layout.down(last));
  int64_t width = step;
  while (width < std::min(whole, kWidest) && fits(width + step)) width += step;
  return width;
}

/// The first of `width` patches about a place, of `count`: of a family.
int64_t first_of(double place, int64_t width, int64_t count, int64_t step) {
  const double families = std::round((place - 0.5 * static_cast<double>(width)) / static_cast<double>(step));
  const int64_t most = std::max<int64_t>((count - width + step - 1) / step, 0);
  return static_cast<int64_t>(std::clamp(families, 0.0, static_cast<double>(most))) * step;
}

}  // namespace

Paging::Plan Paging::plan(const std::shared_ptr<const Hierarchy>& hierarchy, const PatchMesh& mesh,
                          const Options& options) {
  const Layout& layout = hierarchy->layout;
  const Maps maps = maps_of(*hierarchy);
  const Slots slots(layout, hierarchy->averaged());
  const auto count = static_cast<int64_t>(maps.all().size());
  const int64_t piece = kPerPiece + count * kPerMap, each = slots.bytes() + piece;
  const int64_t more = count > 0 ? kMorePieces : 0;
  const int64_t beside = bytes_beside_heights(*hierarchy, mesh) + more * piece;
  const int64_t family = branch(layout) * branch(layout), below = (layout.levels - 1) * family;
  const int64_t addressed = int64_t{INT32_MAX} / slots.floats();  // vertices have 31-bit numbers
  std::vector<Pool> pools{{each, std::min(layout.patches(), addressed), 1 + below}};
  int64_t roots = slots.bytes(), largest = slots.bytes();
  for (const Pool& pool : map_pools(maps)) {
    pools.push_back(pool);
    roots += pool.slot;
    largest = std::max(largest, pool.slot);
  }
  pools[0].least = std::min(pools[0].least, pools[0].count);
  Plan out{setup_of(hierarchy, slots, maps, options), {}, 0};
  const std::string texels = count == 0 ? "" : ", those of the maps";
  const int64_t gpu_bytes = paging_of(options).gpu_bytes, least = beside + least_of(pools);
  if (least > gpu_bytes) {
    refuse("the coarsest patch, a family on each level below it" + texels + ", and the meshes",
           "gpu_cache_mb", least, gpu_bytes);
  }
  if (roots > out.setup.cpu_bytes)
    refuse("the coarsest heights" + texels, "cpu_cache_mb", roots, out.setup.cpu_bytes);
  if (largest > options.integer("upload_bytes")) {
    throw InvalidInput("seamless: upload_bytes=" + std::to_string(options.integer("upload_bytes")) +
                       " cannot move " + (largest > slots.bytes() ? "a tile of a map" : "a patch") + " of " +
                       std::to_string(largest) + " bytes");
  }
  part_room(gpu_bytes - beside, pools);
  const int64_t held = pools[0].capacity / each;
  out.setup.capacity = held * slots.bytes();
  out.most_pieces = held + more;
  for (size_t i = 1; i < pools.size(); ++i) out.map_bytes.push_back(lodlab::map_bytes(pools[i]));
  return out;
}

Paging::Paging(const std::shared_ptr<const Hierarchy>& hierarchy, const PatchMesh& mesh,
               const Options& options)
    : Paging(hierarchy, plan(hierarchy, mesh, options), options.integer("upload_bytes")) {}

Paging::Paging(const std::shared_ptr<const Hierarchy>& hierarchy, Plan plan, int64_t upload_bytes)
    : hierarchy_(hierarchy),
      slots_(hierarchy->layout, hierarchy->averaged()),
      window_(widest_window(hierarchy->layout, plan.setup.capacity / slots_.bytes())),
      upload_bytes_(upload_bytes),
      most_pieces_(plan.most_pieces),
      residency_(hierarchy->store, std::move(plan.setup)),
      map_bytes_(std::move(plan.map_bytes)) {}

uint32_t Paging::parent(int64_t patch) const {
  const Layout& layout = hierarchy_->layout;
  return static_cast<uint32_t>(layout.id(layout.parent(layout.at(patch))));
}

void Paging::touch(int64_t patch, double worth) {
  for (; patch > 0 && !residency_.touched(static_cast<uint32_t>(patch), worth); patch = parent(patch))
    residency_.touch(static_cast<uint32_t>(patch), worth);
}

void Paging::need(int64_t patch, double priority) {
  if (resident(patch)) {
    touch(patch, priority);
  } else {
    wants_.push_back({static_cast<uint32_t>(patch), priority});
  }
}

void Paging::follow(const glm::dvec3& eye, int level) {
  if (!streams()) return;
  const Layout& layout = hierarchy_->layout;
  const FieldFrame& frame = hierarchy_->frame;
  struct Place {
    double row, col;  // of the eye, in patches
  };
  const auto place = [&](int l) {
    const double side = std::ldexp(1.0, layout.side_log2(l));
    return Place{(frame.y0 - eye.y) / (frame.dy * side), (eye.x - frame.x0) / (frame.dx * side)};
  };
  std::vector<Origin> origins;
  for (int l = 1; l <= std::min(level, layout.levels - 1); ++l) {
    origins.push_back({first_of(place(l).row, window_, layout.down(l), branch(layout)),
                       first_of(place(l).col, window_, layout.across(l), branch(layout))});
  }
  const auto moved = std::mismatch(complete_.begin(), complete_.end(), origins.begin(), origins.end()).first;
  complete_.erase(moved, complete_.end());
  bool all = true;
  for (size_t i = complete_.size(); i < origins.size() && wants_.size() < kEnoughWanted; ++i) {
    const auto l = static_cast<int>(i) + 1;
    all &= look_round(l, origins[i], place(l).row, place(l).col);
    if (all) complete_.push_back(origins[i]);
  }
}

/// Needs what is in a level's window, the nearest most; whether all of it is there.
bool Paging::look_round(int level, const Origin& origin, double row, double col) {
  const Layout& layout = hierarchy_->layout;
  const int64_t last_y = std::min(origin.y + window_, layout.down(level));
  const int64_t last_x = std::min(origin.x + window_, layout.across(level));
  bool all = true;
  for (int64_t y = origin.y; y < last_y; ++y) {
    for (int64_t x = origin.x; x < last_x; ++x) {
      const int64_t id = layout.id({level, y, x});
      const double away = std::max(std::abs(static_cast<double>(y) + 0.5 - row),
                                   std::abs(static_cast<double>(x) + 0.5 - col));
      need(id, kWindowWorth / (1.0 + away));
      all &= resident(id);
    }
  }
  return all;
}

void Paging::ask() {
  std::sort(wants_.begin(), wants_.end(), [](const Residency::Want& a, const Residency::Want& b) {
    return a.unit != b.unit ? a.unit < b.unit : a.priority > b.priority;
  });
  const auto same = [](const Residency::Want& a, const Residency::Want& b) { return a.unit == b.unit; };
  wants_.erase(std::unique(wants_.begin(), wants_.end(), same), wants_.end());
  if (wants_.size() > kMostWanted) {
    std::nth_element(wants_.begin(), wants_.begin() + kMostWanted, wants_.end(),
                     [](const Residency::Want& a, const Residency::Want& b) {
                       return a.priority != b.priority ? a.priority > b.priority : a.unit < b.unit;
                     });
    wants_.resize(kMostWanted);
    std::sort(wants_.begin(), wants_.end(),
              [](const Residency::Want& a, const Residency::Want& b) { return a.unit < b.unit; });
  }
  residency_.want(std::move(wants_));
  wants_.clear();
}

std::optional<Residency::Upload> Paging::admit(int64_t patch, bool wait, double worth) {
  auto upload = residency_.admit(static_cast<uint32_t>(patch), wait, dropped_, worth);
  if (!dropped_.empty()) complete_.clear();
  dropped_.clear();
  return upload;
}

}  // namespace lodlab::seamless
