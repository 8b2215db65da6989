// SPDX-License-Identifier: MIT
// Residency: parents of resident units are resident, nothing overlaps, the budget holds, what a frame uses
// stays.
#include "method/residency.h"

#include <doctest/doctest.h>

#include <algorithm>
#include <random>

#include "store_fixture.h"

using namespace lodlab;
using namespace lodlab::testing;

namespace {

constexpr int kUnits = 1 + 4 + 16 + 64;  // a quadtree, breadth first
constexpr int64_t kBytes = 100;

uint32_t parent(uint32_t unit) { return (unit - 1) / 4; }

/// Page 1000 + i of kind 2 belongs to unit i, page 1000 + i of kind 5 beside it.
std::shared_ptr<const Store> quadtree(const TemporaryFolder& folder) {
  StoreWriter writer(folder / "a.lod", toy_meta(), BuildMode::kNew);
  for (int64_t i = 0; i < kUnits; ++i) {
    writer.put_page(2, 1000 + i, Bytes(kBytes, static_cast<std::byte>(i)));
    writer.put_page(5, 1000 + i, Bytes(10, static_cast<std::byte>(i)));
  }
  writer.commit();
  return Store::open(folder / "a.lod");
}

Residency::Setup setup_of(int64_t capacity) {
  Residency::Setup setup;
  for (int64_t i = 0; i < kUnits; ++i) setup.units.push_back({1000 + i, kBytes, 0});
  setup.roots = 1;
  setup.kind = 2;
  setup.beside_kind = 5;
  setup.capacity = capacity;
  setup.cpu_bytes = 1 << 20;
  return setup;
}

/// As a method's draw does it: each unit after its parents, all of them used.
bool use(Residency& residency, uint32_t unit, std::vector<uint32_t>& dropped) {
  if (unit > 0 && !use(residency, parent(unit), dropped)) return false;
  if (residency.offset(unit) < 0) return residency.admit(unit, true, dropped).has_value();
  residency.touch(unit);
  return true;
}

void check_sound(const Residency& residency, int64_t capacity) {
  std::vector<int64_t> offsets;
  for (uint32_t i = 0; i < kUnits; ++i) {
    if (residency.offset(i) < 0) continue;
    offsets.push_back(residency.offset(i));
    if (i > 0) CHECK(residency.resident(parent(i)));
  }
  std::sort(offsets.begin(), offsets.end());
  for (size_t i = 0; i < offsets.size(); ++i) {
    const int64_t end = i + 1 < offsets.size() ? offsets[i + 1] : capacity;
    CHECK(offsets[i] + kBytes <= end);
  }
}

}  // namespace

TEST_CASE("whatever is used and dropped, parents of resident units are resident, and nothing overlaps") {
  const TemporaryFolder folder;
  const int64_t capacity = 20 * kBytes + 7;
  Residency residency(quadtree(folder), setup_of(capacity));
  std::mt19937 random(1);
  std::vector<uint32_t> dropped;
  size_t drops = 0;
  for (int frame = 0; frame < 400; ++frame) {
    residency.next_frame();
    for (int i = 0; i < 5; ++i) {
      CHECK(use(residency, static_cast<uint32_t>(random() % kUnits), dropped));
      for (const uint32_t unit : dropped) CHECK_FALSE(residency.touched(unit));  // root: used in every frame
      drops += dropped.size();
      dropped.clear();
    }
    check_sound(residency, capacity);
  }
  CHECK(drops > 100);
}

TEST_CASE("what a frame uses stays: nothing more is admitted until the next one") {
  const TemporaryFolder folder;
  Residency residency(quadtree(folder), setup_of(4 * kBytes));
  std::vector<uint32_t> dropped;
  for (const uint32_t unit : {0u, 1u, 2u, 3u}) CHECK(residency.admit(unit, true, dropped));
  CHECK_FALSE(residency.admit(4, true, dropped));
  CHECK(dropped.empty());
  residency.next_frame();
  residency.touch(2);
  CHECK(residency.admit(4, true, dropped));
  CHECK(dropped == std::vector<uint32_t>{3});  // as old as 1, and the higher number
  CHECK(residency.offset(3) == -1);
  CHECK(residency.resident(0));
}

TEST_CASE("what a frame uses gives way to what is worth more than twice as much") {
  const TemporaryFolder folder;
  Residency residency(quadtree(folder), setup_of(4 * kBytes));
  std::vector<uint32_t> dropped;
  CHECK(residency.admit(0, true, dropped));
  for (const uint32_t unit : {1u, 2u, 3u}) CHECK(residency.admit(unit, true, dropped, unit));
  CHECK_FALSE(residency.admit(4, true, dropped, 2.0));
  CHECK(dropped.empty());
  CHECK(residency.admit(4, true, dropped, 2.1));
  CHECK(dropped == std::vector<uint32_t>{1});
  residency.touch(2, 8.0);
  CHECK(residency.admit(1, true, dropped, 100.0));
  CHECK(dropped == std::vector<uint32_t>{1, 4});
  residency.touch(1);
  residency.touch(2);
  residency.touch(3);
  CHECK_FALSE(residency.admit(4, true, dropped, 1e300));
}

TEST_CASE("what is wanted arrives in main memory, and is admitted from there") {
  const TemporaryFolder folder;
  Residency::Setup setup = setup_of(4 * kBytes);
  for (Residency::Unit& unit : setup.units) unit.beside = 10;
  setup.beside_capacity = 25;
  Residency residency(quadtree(folder), std::move(setup));
  std::vector<uint32_t> dropped;
  const auto root = residency.admit(0, false, dropped);  // read already
  REQUIRE(root);
  CHECK(root->page->at(0) == std::byte{0});
  CHECK_FALSE(residency.admit(2, false, dropped));
  residency.want({{3, 1.0}, {2, 5.0}});
  CHECK(residency.wanted()[0].unit == 2);
  residency.settle();
  CHECK_FALSE(residency.resident(2));
  const auto second = residency.admit(2, false, dropped);
  REQUIRE(second);
  CHECK(second->page->at(0) == std::byte{2});
  CHECK(second->beside->size() == 10);
  CHECK(residency.beside_used() == 20);
  CHECK_FALSE(residency.admit(3, false, dropped));  // no room beside the buffer
  residency.next_frame();
  CHECK(residency.admit(3, false, dropped));
  CHECK(dropped == std::vector<uint32_t>{2});
  CHECK(residency.beside_used() == 20);
}

TEST_CASE("without streaming a unit counts as resident, and is read when it is drawn") {
  const TemporaryFolder folder;
  Residency::Setup setup = setup_of(2 * kBytes);
  setup.stream = false;
  Residency residency(quadtree(folder), std::move(setup));
  std::vector<uint32_t> dropped;
  CHECK(residency.resident(9));
  CHECK(residency.offset(9) == -1);
  CHECK(residency.admit(9, true, dropped));
  CHECK(residency.offset(9) == 0);
}

TEST_CASE(
    "two that share a loader are both served, most wanted first, in one cache; GPU memory is their own") {
  const TemporaryFolder folder;
  Residency::Setup setup = setup_of(4 * kBytes);
  setup.cpu_bytes = 4 * kBytes;
  Residency host(quadtree(folder), setup);
  Residency::Setup guest_setup = setup_of(3 * 10);
  for (Residency::Unit& unit : guest_setup.units) unit.bytes = 10;
  guest_setup.kind = 5;
  Residency guest(host, std::move(guest_setup));
  std::vector<uint32_t> dropped;
  CHECK(host.admit(0, false, dropped));  // the roots of both are read
  CHECK(guest.admit(0, false, dropped));
  host.want({{1, 1.0}, {2, 9.0}});
  guest.want({{1, 5.0}, {2, 0.5}});  // does not take the place of what the other one wants
  host.settle();
  for (const uint32_t unit : {1u, 2u}) {
    CHECK(host.admit(unit, false, dropped));
    const auto page = guest.admit(unit, false, dropped);
    REQUIRE(page);
    CHECK(page->page->size() == 10);
  }
  CHECK(dropped.empty());
  // Room for three pages of the host and some of the guest's: what is wanted least is left out, whoever wants
  // it.
  host.want({{5, 1.0}, {6, 2.0}, {7, 3.0}, {8, 4.0}, {9, 5.0}});
  guest.want({{5, 10.0}, {6, 0.1}});
  guest.settle();
  CHECK_FALSE(host.admit(5, false, dropped));
  guest.next_frame();
  CHECK(guest.admit(5, false, dropped));
  CHECK_FALSE(guest.admit(6, false, dropped));
}
