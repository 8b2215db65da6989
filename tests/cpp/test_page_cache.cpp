// SPDX-License-Identifier: MIT
// The page cache: most important first, never above its budget, errors come out where a frame asks.
#include "store/page_cache.h"

#include <doctest/doctest.h>

#include <mutex>
#include <thread>

#include "store_fixture.h"

using namespace lodlab;
using namespace lodlab::testing;
using std::chrono::milliseconds;

namespace {

constexpr int64_t kSize = 1000;

/// A store of pages 0 to 19 of kind 0, each of kSize bytes that say its number, and page 20 of 5 kSize.
std::shared_ptr<const Store> numbered(const TemporaryFolder& folder) {
  StoreWriter writer(folder / "a.lod", toy_meta(), BuildMode::kNew);
  for (int64_t id = 0; id < 20; ++id) writer.put_page(0, id, Bytes(kSize, static_cast<std::byte>(id)));
  writer.put_page(0, 20, Bytes(5 * kSize));
  writer.commit();
  return Store::open(folder / "a.lod");
}

/// Remembers the order in which pages were decoded.
struct Log {
  std::mutex mutex;
  std::vector<int64_t> ids;
  PageCache::Decode decode() {
    return [this](int, int64_t id, Bytes stored) {
      const std::lock_guard guard(mutex);
      ids.push_back(id);
      return stored;
    };
  }
};

std::vector<PageCache::Want> wants(std::initializer_list<std::pair<int64_t, double>> list) {
  std::vector<PageCache::Want> out;
  for (const auto& [id, priority] : list) out.push_back({0, id, priority});
  return out;
}

}  // namespace

TEST_CASE("wanted pages arrive, most important first") {
  const TemporaryFolder folder;
  Log log;
  PageCache cache(numbered(folder), 10 * kSize, milliseconds(5), log.decode());
  CHECK(cache.find(0, 3) == nullptr);
  cache.want(wants({{3, 0.5}, {1, 2.0}, {7, 1.0}, {9, 1.0}, {2, -1.0}}));
  cache.settle();
  CHECK(log.ids == std::vector<int64_t>{1, 7, 9, 3, 2});
  for (const int64_t id : log.ids) {
    const auto page = cache.find(0, id);
    REQUIRE(page != nullptr);
    CHECK(*page == Bytes(kSize, static_cast<std::byte>(id)));
  }
  CHECK(cache.bytes() == 5 * kSize);
  CHECK(cache.capacity() == 10 * kSize);
}

TEST_CASE("a new list replaces the queue") {
  const TemporaryFolder folder;
  Log log;
  PageCache cache(numbered(folder), 10 * kSize, milliseconds(40), log.decode());
  cache.want(wants({{1, 1.0}, {2, 0.9}, {3, 0.8}}));
  cache.want(wants({{4, 1.0}}));
  cache.settle();
  CHECK(log.ids == std::vector<int64_t>{4});
  cache.want({});
  cache.settle();  // an empty queue is settled
}

TEST_CASE("asking never waits for storage") {
  const TemporaryFolder folder;
  PageCache cache(numbered(folder), 10 * kSize, milliseconds(60000), nullptr);
  cache.want(wants({{1, 1.0}, {2, 1.0}}));
  for (int frame = 0; frame < 100; ++frame)
    CHECK(cache.find(0, 1) == nullptr);  // it would be here, had one waited
}

TEST_CASE("the budget holds, least recently used goes first") {
  const TemporaryFolder folder;
  PageCache cache(numbered(folder), 3 * kSize + 10, milliseconds(0), nullptr);
  for (const int64_t id : {1, 2, 3}) CHECK(cache.load(0, id) != nullptr);
  CHECK(cache.find(0, 1) != nullptr);  // now 2 is the oldest
  cache.want(wants({{4, 1.0}}));
  cache.settle();
  CHECK(cache.bytes() == 3 * kSize);
  CHECK(cache.find(0, 2) == nullptr);
  for (const int64_t id : {1, 3, 4}) CHECK(cache.find(0, id) != nullptr);
  const auto held = cache.find(0, 1);
  for (const int64_t id : {5, 6, 7}) CHECK(cache.load(0, id) != nullptr);
  CHECK(cache.find(0, 1) == nullptr);
  CHECK(held->size() == kSize);  // who holds a page keeps it
}

TEST_CASE("a list larger than the cache loads its most important part and rests") {
  const TemporaryFolder folder;
  Log log;
  PageCache cache(numbered(folder), 3 * kSize, milliseconds(0), log.decode());
  const auto list = wants({{0, 0.1}, {1, 0.2}, {2, 0.3}, {3, 0.4}, {4, 0.5}, {5, 0.6}, {6, 0.7}});
  for (int frame = 0; frame < 4; ++frame) {
    cache.want(list);
    cache.settle();
    CHECK(cache.bytes() <= 3 * kSize);
    for (const int64_t id : {4, 5, 6}) CHECK(cache.find(0, id) != nullptr);
  }
  CHECK(log.ids.size() <= 3 + 4);           // one page too many is tried per list, not all of them
  cache.want(wants({{1, 2.0}, {6, 0.1}}));  // what the list no longer names, or ranks below, may go
  cache.settle();
  CHECK(cache.find(0, 1) != nullptr);
}

TEST_CASE("a page larger than the whole budget is an error that names both") {
  const TemporaryFolder folder;
  PageCache cache(numbered(folder), 3 * kSize, milliseconds(0), nullptr);
  const auto message = [](const auto& work) {
    try {
      work();
    } catch (const InvalidInput& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  const std::string direct = message([&] { cache.load(0, 20); });
  CHECK(says(direct, "page 20 of kind 0"));
  CHECK(says(direct, "needs 5000 bytes, the capacity is 3000"));
  cache.want(wants({{20, 1.0}, {1, 0.5}}));
  CHECK(message([&] { cache.settle(); }) == direct);
  CHECK(cache.find(0, 1) != nullptr);  // said once; the others still arrive
  CHECK_THROWS_AS(PageCache(numbered(TemporaryFolder()), 0, milliseconds(0), nullptr), InvalidInput);
  CHECK_THROWS_AS(PageCache(numbered(TemporaryFolder()), 1, milliseconds(-1), nullptr), InvalidInput);
}

TEST_CASE("errors of the loader come out of find") {
  const TemporaryFolder folder;
  PageCache cache(numbered(folder), 10 * kSize, milliseconds(0), nullptr);
  cache.want(wants({{777, 1.0}, {1, 0.5}}));
  std::string message = "no error";
  for (int wait = 0; wait < 2000 && message == "no error"; ++wait) {
    message = store_error([&] { cache.find(0, 1); });
    std::this_thread::sleep_for(milliseconds(1));
  }
  CHECK(says(message, "has no page 777 of kind 0"));
  CHECK(says(store_error([&] { cache.load(0, 778); }), "has no page 778 of kind 0"));
}

TEST_CASE("decoded bytes are what counts") {
  const TemporaryFolder folder;
  PageCache cache(numbered(folder), 10 * kSize, milliseconds(0),
                  [](int, int64_t, const Bytes&) { return Bytes(7); });
  CHECK(cache.load(0, 1)->size() == 7);
  CHECK(cache.bytes() == 7);
}

TEST_CASE("a cache goes away at once, even during a long fetch") {
  const TemporaryFolder folder;
  Log log;
  {
    PageCache cache(numbered(folder), 10 * kSize, milliseconds(60000), log.decode());
    cache.want(wants({{1, 1.0}}));
    std::this_thread::sleep_for(milliseconds(20));
  }
  CHECK(log.ids.empty());  // the fetch was given up, not waited for
}

TEST_CASE("frames and loader together") {
  const TemporaryFolder folder;
  PageCache cache(numbered(folder), 6 * kSize, milliseconds(0), nullptr);
  int found = 0;
  for (int frame = 0; frame < 2000; ++frame) {
    cache.want(wants({{frame % 20, 1.0}, {(frame * 7) % 20, 0.5}, {(frame * 3) % 20, 0.7}}));
    if (const auto page = cache.find(0, frame % 20)) {
      ++found;
      CHECK(*page == Bytes(kSize, static_cast<std::byte>(frame % 20)));
    }
    if (frame % 50 == 0) cache.load(0, (frame * 11) % 20);
    CHECK(cache.bytes() <= 6 * kSize);
  }
  cache.settle();
  CHECK(found > 0);
}
