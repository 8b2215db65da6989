// SPDX-License-Identifier: MIT
// One mutex over a map with an LRU list; the loader thread holds it only to pick a want and to store a page.
// The byte budget holds at every moment. Wants that the present list ranks at least as high are never evicted
// for a lower one: when only such pages are left, the rest of the queue is dropped, so that a list larger
// than the cache loads its most important part once instead of turning over for ever.
#include "store/page_cache.h"

#include <pthread.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <exception>
#include <limits>
#include <list>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "base/errors.h"
#include "store/format.h"

namespace lodlab {
namespace {

using Key = std::pair<int, int64_t>;

struct Entry {
  std::shared_ptr<const Bytes> bytes;
  std::list<Key>::iterator place;  // in the LRU list, newest first
  int64_t list = -1;               // the last list of wants that named it
  double priority = 0.0;           // in that list
};

}  // namespace

struct PageCache::Impl {
  std::shared_ptr<const Store> store;
  int64_t capacity;
  std::chrono::milliseconds delay;
  Decode decode;

  mutable std::mutex mutex;  // guards all below
  std::condition_variable work, idle;
  std::vector<Want> queue;      // least important first
  std::optional<Want> current;  // being read by the loader thread
  int64_t current_list = 0;
  std::map<Key, Entry> entries;
  std::list<Key> order;  // newest first
  int64_t bytes = 0, list = 0;
  bool stop = false;
  std::exception_ptr error;
  std::thread thread;
  pid_t process = getpid();  // fork copies neither the thread nor a sane state of the mutex

  void check_process() const {
    if (process == getpid()) return;
    throw StoreError("page cache of " + store->path() +
                     ": its loader thread stayed with the parent process; open the store again after fork");
  }
  std::shared_ptr<const Bytes> use(const Key& key);
  bool make_room(int64_t size, std::optional<double> priority);
  std::shared_ptr<const Bytes> keep(const Key& key, Bytes page, std::optional<double> priority);
  Bytes fetch(const Key& key) const;
  void rethrow() {
    if (error) std::rethrow_exception(std::exchange(error, nullptr));
  }
  /// Sleeps the delay; false when the cache is being destroyed.
  bool pause(std::unique_lock<std::mutex>& guard) {
    if (delay.count() > 0) work.wait_for(guard, delay, [&] { return stop; });
    return !stop;
  }
  void load_next(std::unique_lock<std::mutex>& guard);
  void loop();
};

std::shared_ptr<const Bytes> PageCache::Impl::use(const Key& key) {
  const auto found = entries.find(key);
  if (found == entries.end()) return nullptr;
  order.splice(order.begin(), order, found->second.place);
  return found->second.bytes;
}

/// Evicts least recently used pages until `size` bytes fit; with a priority, spares those of the present
/// list that are at least as important. False when that is not enough.
bool PageCache::Impl::make_room(int64_t size, std::optional<double> priority) {
  auto place = order.end();
  while (bytes + size > capacity) {
    if (place == order.begin()) return false;
    --place;
    const auto entry = entries.find(*place);
    if (priority && entry->second.list == list && entry->second.priority >= *priority) continue;
    bytes -= static_cast<int64_t>(entry->second.bytes->size());
    entries.erase(entry);
    place = order.erase(place);
  }
  return true;
}

/// Stores a decoded page and returns it; null when there is no room for one of this priority.
std::shared_ptr<const Bytes> PageCache::Impl::keep(const Key& key, Bytes page,
                                                   std::optional<double> priority) {
  if (auto present = use(key)) return present;  // another thread was faster
  const auto size = static_cast<int64_t>(page.size());
  if (size > capacity) {
    throw InvalidInput("page cache: " + store::page_name(key.first, key.second) + " of " + store->path() +
                       " needs " + std::to_string(size) + " bytes, the capacity is " +
                       std::to_string(capacity));
  }
  if (!make_room(size, priority)) return nullptr;
  auto kept = std::make_shared<const Bytes>(std::move(page));
  order.push_front(key);
  bytes += size;
  Entry entry{kept, order.begin()};
  if (priority) entry.list = current_list, entry.priority = *priority;
  entries[key] = std::move(entry);
  return kept;
}

Bytes PageCache::Impl::fetch(const Key& key) const {
  Bytes stored = store->page(key.first, key.second);
  return decode ? decode(key.first, key.second, std::move(stored)) : stored;
}

/// Reads the most important want, off the mutex. While it is read the queue may be replaced: want() then
/// gives `current` its new rank, or its list stays behind and it may evict only what is not wanted.
void PageCache::Impl::load_next(std::unique_lock<std::mutex>& guard) {
  current = queue.back();
  current_list = list;
  queue.pop_back();
  const Key key{current->kind, current->id};
  if (entries.contains(key)) return;
  guard.unlock();
  Bytes page;
  std::exception_ptr failure;
  try {
    page = fetch(key);
  } catch (...) {
    failure = std::current_exception();
  }
  guard.lock();
  try {
    if (failure) std::rethrow_exception(failure);
    const bool wanted = current_list == list;
    const double priority = wanted ? current->priority : -std::numeric_limits<double>::infinity();
    if (keep(key, std::move(page), priority) == nullptr && wanted) queue.clear();
  } catch (...) {
    if (!error) error = std::current_exception();
  }
}

void PageCache::Impl::loop() {
  // Woken by a frame, it does not take that frame's processor before its time is over.
  const sched_param batch{};
  pthread_setschedparam(pthread_self(), SCHED_BATCH, &batch);
  std::unique_lock guard(mutex);
  while (true) {
    work.wait(guard, [&] { return stop || !queue.empty(); });
    // The delay comes before the choice, so that the choice is made from the newest list.
    if (!pause(guard)) return;
    if (!queue.empty()) load_next(guard);
    current.reset();
    if (queue.empty()) idle.notify_all();
  }
}

PageCache::PageCache(std::shared_ptr<const Store> store, int64_t capacity,
                     std::chrono::milliseconds fetch_delay, Decode decode)
    : impl_(std::make_unique<Impl>()) {
  if (capacity <= 0) {
    throw InvalidInput("page cache: capacity " + std::to_string(capacity) + " bytes is not positive");
  }
  if (fetch_delay.count() < 0) {
    throw InvalidInput("page cache: fetch delay " + std::to_string(fetch_delay.count()) + " ms is negative");
  }
  impl_->store = std::move(store);
  impl_->capacity = capacity;
  impl_->delay = fetch_delay;
  impl_->decode = std::move(decode);
  impl_->thread = std::thread([impl = impl_.get()] { impl->loop(); });
}

PageCache::~PageCache() {
  if (impl_->process != getpid()) {
    static_cast<void>(impl_.release());  // neither joined nor destroyed: that would wait for ever
    return;
  }
  {
    const std::lock_guard guard(impl_->mutex);
    impl_->stop = true;
  }
  impl_->work.notify_all();
  impl_->thread.join();
}

void PageCache::want(std::vector<Want> wants) {
  Impl& it = *impl_;
  it.check_process();
  std::unique_lock guard(it.mutex);
  ++it.list;
  it.queue.clear();
  for (Want& want : wants) {
    if (std::isnan(want.priority)) want.priority = -std::numeric_limits<double>::infinity();
    if (const auto found = it.entries.find({want.kind, want.id}); found != it.entries.end()) {
      found->second.list = it.list;
      found->second.priority = want.priority;
    } else if (it.current && it.current->kind == want.kind && it.current->id == want.id) {
      it.current = want;
      it.current_list = it.list;
    } else {
      it.queue.push_back(want);
    }
  }
  // Equal priorities in order of key: what is loaded does not depend on the order of the list.
  std::sort(it.queue.begin(), it.queue.end(), [](const Want& a, const Want& b) {
    return a.priority != b.priority ? a.priority < b.priority
                                    : std::pair(b.kind, b.id) < std::pair(a.kind, a.id);
  });
  const bool loads = !it.queue.empty();
  guard.unlock();
  if (loads) it.work.notify_all();  // a frame that lacks nothing wakes nobody
}

std::shared_ptr<const Bytes> PageCache::find(int kind, int64_t id) {
  impl_->check_process();
  const std::lock_guard guard(impl_->mutex);
  impl_->rethrow();
  return impl_->use({kind, id});
}

std::shared_ptr<const Bytes> PageCache::load(int kind, int64_t id) {
  impl_->check_process();
  std::unique_lock guard(impl_->mutex);
  if (auto present = impl_->use({kind, id})) return present;
  impl_->pause(guard);
  guard.unlock();
  Bytes page = impl_->fetch({kind, id});
  guard.lock();
  return impl_->keep({kind, id}, std::move(page), std::nullopt);
}

void PageCache::settle() {
  impl_->check_process();
  std::unique_lock guard(impl_->mutex);
  impl_->idle.wait(guard, [&] { return impl_->queue.empty() && !impl_->current; });
  impl_->rethrow();
}

int64_t PageCache::bytes() const {
  const std::lock_guard guard(impl_->mutex);
  return impl_->bytes;
}

int64_t PageCache::capacity() const { return impl_->capacity; }

}  // namespace lodlab
