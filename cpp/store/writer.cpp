// SPDX-License-Identifier: MIT
// The writer: one SQLite connection behind a mutex, rows appended in order of arrival, a transaction every
// kFlushBytes or kFlushTime. While building nothing is synced: SQLite's rollback journal makes the partial
// file survive the death of the process, and commit() syncs once before the rename. A power cut may damage a
// partial file; a resumed build therefore reads every page again and drops those whose checksum fails.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <optional>
#include <set>
#include <unordered_map>

#include "base/errors.h"
#include "store/format.h"
#include "store/partial.h"
#include "store/sqlite.h"
#include "store/store.h"

namespace lodlab {
namespace {

using Clock = std::chrono::steady_clock;
namespace fs = std::filesystem;
using namespace lodlab::store;

constexpr int64_t kFlushBytes = 16 << 20;
constexpr auto kFlushTime = std::chrono::milliseconds(500);

const std::set<std::string> kOwnKeys = {"format_version", "method",        "options",       "source_hash",
                                        "source_spec",    "frame",         "complete",      "replaces",
                                        "content_hash",   "build_seconds", "build_reached", "seal"};

struct PageKey {
  int64_t kind, id;
  bool operator==(const PageKey&) const = default;
};
struct PageKeyHash {
  size_t operator()(const PageKey& key) const {
    const auto mixed =
        (static_cast<uint64_t>(key.id) + 0x9e3779b97f4a7c15u * static_cast<uint64_t>(key.kind + 1)) *
        0xbf58476d1ce4e5b9u;
    return static_cast<size_t>(mixed ^ (mixed >> 31));
  }
};

/// Refuses what no lock or rename could put right, before anything is touched.
void check_target(const std::string& path, BuildMode mode) {
  if (path.empty()) throw StoreError("store: the path to build is empty");
  std::error_code ignored;
  const fs::file_status status = fs::status(path, ignored);
  if (fs::is_directory(status)) throw StoreError("store " + path + ": is a directory");
  if (!fs::exists(status)) return;
  if (!fs::is_regular_file(status)) throw StoreError("store " + path + ": is not a regular file");
  if (mode == BuildMode::kNew)
    throw StoreError("store " + path + ": exists already; mode=\"force\" replaces it");
}

struct Connection {
  explicit Connection(Database opened) : database(std::move(opened)) {}
  Database database;
  Statement page{database, "INSERT INTO page(kind, id, checksum, size, bytes) VALUES (?, ?, ?, ?, ?)"};
  Statement array{database, "INSERT OR REPLACE INTO array(name, checksum, bytes) VALUES (?, ?, ?)"};
  Statement meta{database, "INSERT OR REPLACE INTO meta(key, value, checksum) VALUES (?, ?, ?)"};
};

Database open_for_building(const std::string& partial) {
  Database database = Database::open_writable(partial);
  database.exec(
      "PRAGMA page_size = 8192; PRAGMA locking_mode = EXCLUSIVE; PRAGMA synchronous = OFF; "
      "PRAGMA secure_delete = OFF; PRAGMA cache_size = -32768");
  return database;
}

/// Leaves its transaction open: the tables appear together with the meta rows that say whose they are, so
/// that a writer killed here leaves an empty database.
void create_tables(Database& database) {
  database.exec("BEGIN EXCLUSIVE");
  for (const char* sql : {kCreateMeta, kCreateArray, kCreatePage, kCreateIndex}) database.exec(sql);
  const std::string header = "PRAGMA application_id = " + std::to_string(kApplicationId) +
                             "; PRAGMA user_version = " + std::to_string(kFormatVersion);
  database.exec(header.c_str());
}

int64_t single_number(const Database& database, const char* sql) {
  Statement statement(database, sql);
  return statement.step() ? statement.integer(0) : 0;
}

[[noreturn]] void refuse_resume(const std::string& partial, const std::string& why) {
  throw StoreError("cannot resume " + partial + ": " + why + "; build with mode=\"force\" to start over");
}

void check_agrees(const std::string& partial, const std::map<std::string, std::string>& found,
                  const StoreMeta& meta) {
  const auto compare = [&](const char* key, const char* what, const std::string& ours) {
    const auto row = found.find(key);
    if (row == found.end()) refuse_resume(partial, std::string("it names no ") + what);
    if (row->second != ours)
      refuse_resume(partial, std::string("its ") + what + " is " + row->second + ", this build's is " + ours);
  };
  compare("format_version", "format version", std::to_string(kFormatVersion));
  compare("method", "method", meta.method);
  compare("options", "options", meta.options);
  compare("source_hash", "source hash", meta.source_hash);
}

}  // namespace

struct StoreWriter::Impl {
  std::string path, partial;
  std::unique_ptr<PartialLock> lock;
  std::unique_ptr<Connection> connection;
  bool replaces = false;

  mutable std::mutex mutex;  // guards all below and the connection
  std::unordered_map<PageKey, PageHead, PageKeyHash> pages;
  std::map<std::string, ArrayHead> arrays;
  std::map<std::string, std::string> meta;
  std::string failure;  // the first error: the writer is of no more use after it
  int64_t pending = 0;
  Clock::time_point last_flush = Clock::now(), start = Clock::now();
  double seconds_before = 0.0;
  std::string reached;

  Impl(const std::string& target, const StoreMeta& store_meta, BuildMode mode);
  ~Impl();

  void write_meta(const std::string& key, const std::string& value);
  void resume(const StoreMeta& store_meta);
  std::map<std::string, std::string> read_meta() const;
  void keep_sound_pages();
  void begin();
  void flush();
  void flush_when_due();
  std::vector<PageHead> sorted_pages() const;
  double seconds() const {
    return seconds_before + std::chrono::duration<double>(Clock::now() - start).count();
  }

  /// Runs `work` under the mutex; an error of the file ends the writer's life, all later calls repeat it.
  template <class Work>
  void guarded(const Work& work) {
    const std::lock_guard guard(mutex);
    if (connection == nullptr) throw StoreError("store " + path + ": was committed already");
    if (!failure.empty()) throw StoreError(failure);
    try {
      work();
    } catch (const StoreError& error) {
      failure = error.what();
      throw;
    }
  }
};

StoreWriter::Impl::Impl(const std::string& target, const StoreMeta& store_meta, BuildMode mode)
    : path(target), partial(partial_path(target)), replaces(mode == BuildMode::kForce) {
  check_target(path, mode);
  lock = std::make_unique<PartialLock>(path);
  bool fresh = mode != BuildMode::kResume || lock->size() == 0;
  try {
    if (fresh) lock->start_over();
    Database database = open_for_building(partial);
    // A writer killed before its first transaction ended leaves an empty database.
    if (!fresh) fresh = single_number(database, "SELECT count(*) FROM sqlite_schema") == 0;
    if (fresh && !replaces && fs::exists(path)) {
      throw StoreError("store " + path +
                       ": exists already and nothing is left to resume; mode=\"force\" replaces it");
    }
    if (fresh) create_tables(database);
    connection = std::make_unique<Connection>(std::move(database));
    begin();
    if (!fresh) resume(store_meta);
    write_meta("format_version", std::to_string(kFormatVersion));
    write_meta("method", store_meta.method);
    write_meta("options", store_meta.options);
    write_meta("source_hash", store_meta.source_hash);
    write_meta("source_spec", store_meta.source_spec);
    write_meta("frame", store_meta.frame);
    write_meta("complete", "false");
    write_meta("replaces", replaces ? "true" : "false");
    flush();
  } catch (const DamagedFile&) {
    connection.reset();
    if (fresh) throw;
    refuse_resume(partial, "the file is damaged");
  } catch (...) {
    connection.reset();
    if (fresh) lock->remove();
    throw;
  }
}

StoreWriter::Impl::~Impl() {
  if (connection == nullptr) return;
  try {
    if (failure.empty()) flush();
  } catch (const std::exception&) {
    // The open transaction is rolled back; what was flushed before stays resumable.
  }
  connection.reset();
  if (pages.empty()) lock->remove();
}

void StoreWriter::Impl::write_meta(const std::string& key, const std::string& value) {
  connection->meta.bind(1, key);
  connection->meta.bind(2, value);
  connection->meta.bind(3, static_cast<int64_t>(checksum(key, value)));
  connection->meta.run();
  meta[key] = value;
}

std::map<std::string, std::string> StoreWriter::Impl::read_meta() const {
  std::map<std::string, std::string> found;
  Statement rows(connection->database, "SELECT key, value, checksum FROM meta");
  while (rows.step()) {
    const std::string key = rows.text(0), value = rows.text(1);
    if (static_cast<uint64_t>(rows.integer(2)) != checksum(key, value)) {
      refuse_resume(partial, "its meta row '" + key + "' is damaged");
    }
    found[key] = value;
  }
  return found;
}

void StoreWriter::Impl::resume(const StoreMeta& store_meta) {
  Database& database = connection->database;
  if (single_number(database, "PRAGMA application_id") != kApplicationId) {
    refuse_resume(partial, "it is not a store");
  }
  const std::map<std::string, std::string> found = read_meta();
  check_agrees(partial, found, store_meta);
  const auto value = [&](const char* key) {
    const auto row = found.find(key);
    return row == found.end() ? std::string() : row->second;
  };
  replaces = value("replaces") == "true";
  if (!replaces && fs::exists(path)) {
    throw StoreError("store " + path + ": exists already; mode=\"force\" replaces it");
  }
  seconds_before = seconds_of(value("build_seconds"));
  // A build puts its arrays and meta again; only pages are worth keeping.
  database.exec("DELETE FROM array; DELETE FROM meta");
  keep_sound_pages();
}

void StoreWriter::Impl::keep_sound_pages() {
  std::vector<int64_t> damaged;
  Statement rows(connection->database, "SELECT row, kind, id, checksum, size, bytes FROM page");
  while (rows.step()) {
    const PageHead head{rows.integer(1), rows.integer(2), rows.integer(0), rows.integer(4),
                        static_cast<uint64_t>(rows.integer(3))};
    const std::span<const std::byte> bytes = rows.blob(5);
    const bool sound = static_cast<int64_t>(bytes.size()) == head.size && checksum(bytes) == head.checksum;
    if (!sound || !pages.emplace(PageKey{head.kind, head.id}, head).second) damaged.push_back(head.row);
  }
  Statement drop(connection->database, "DELETE FROM page WHERE row = ?");
  for (const int64_t row : damaged) {
    drop.bind(1, row);
    drop.run();
  }
}

void StoreWriter::Impl::begin() {
  if (!connection->database.in_transaction()) connection->database.exec("BEGIN IMMEDIATE");
}

void StoreWriter::Impl::flush() {
  begin();
  write_meta("build_seconds", seconds_text(seconds()));
  if (!reached.empty()) write_meta("build_reached", reached);
  connection->database.exec("COMMIT");
  pending = 0;
  last_flush = Clock::now();
}

void StoreWriter::Impl::flush_when_due() {
  if (pending >= kFlushBytes || (pending > 0 && Clock::now() - last_flush >= kFlushTime)) flush();
}

std::vector<PageHead> StoreWriter::Impl::sorted_pages() const {
  std::vector<PageHead> out;
  out.reserve(pages.size());
  for (const auto& [key, head] : pages) out.push_back(head);
  std::sort(out.begin(), out.end(), [](const PageHead& a, const PageHead& b) {
    return a.kind != b.kind ? a.kind < b.kind : a.id < b.id;
  });
  return out;
}

StoreWriter::StoreWriter(const std::string& path, const StoreMeta& meta, BuildMode mode)
    : impl_(std::make_unique<Impl>(path, meta, mode)) {}

StoreWriter::~StoreWriter() = default;

bool StoreWriter::has_page(int kind, int64_t id) const {
  const std::lock_guard guard(impl_->mutex);
  return impl_->pages.contains({kind, id});
}

void StoreWriter::put_page(int kind, int64_t id, std::span<const std::byte> bytes) {
  const auto size = static_cast<int64_t>(bytes.size());
  if (size > kMaxBlob) {
    throw StoreError("store " + impl_->path + ": " + page_name(kind, id) + " has " + std::to_string(size) +
                     " bytes, the limit is " + std::to_string(kMaxBlob));
  }
  const PageHead head{kind, id, 0, size, checksum(bytes)};
  impl_->guarded([&] {
    if (const auto found = impl_->pages.find({kind, id}); found != impl_->pages.end()) {
      if (found->second.size == size && found->second.checksum == head.checksum) return;
      throw StoreError("store " + impl_->path + ": " + page_name(kind, id) +
                       " was put already, with other bytes");
    }
    impl_->begin();
    Statement& insert = impl_->connection->page;
    insert.bind(1, head.kind);
    insert.bind(2, head.id);
    insert.bind(3, static_cast<int64_t>(head.checksum));
    insert.bind(4, head.size);
    insert.bind(5, bytes);
    insert.run();
    impl_->pages.emplace(PageKey{kind, id}, head);
    impl_->pending += size + 64;
    impl_->flush_when_due();
  });
}

void StoreWriter::put_array(const std::string& name, std::span<const std::byte> bytes) {
  const auto size = static_cast<int64_t>(bytes.size());
  if (size > kMaxBlob) {
    throw StoreError("store " + impl_->path + ": array '" + name + "' has " + std::to_string(size) +
                     " bytes, the limit is " + std::to_string(kMaxBlob));
  }
  const ArrayHead head{size, checksum(bytes)};
  impl_->guarded([&] {
    impl_->begin();
    Statement& insert = impl_->connection->array;
    insert.bind(1, name);
    insert.bind(2, static_cast<int64_t>(head.checksum));
    insert.bind(3, bytes);
    insert.run();
    impl_->arrays[name] = head;
    impl_->pending += size + 64;
    impl_->flush_when_due();
  });
}

void StoreWriter::put_meta(const std::string& key, const std::string& value) {
  if (kOwnKeys.contains(key))
    throw InvalidInput("put_meta: the key '" + key + "' belongs to the store itself");
  impl_->guarded([&] {
    impl_->begin();
    impl_->write_meta(key, value);
    impl_->pending += static_cast<int64_t>(value.size()) + 64;
  });
}

void StoreWriter::note_progress(const std::string& stage, double share) {
  impl_->guarded([&] {
    const double percent = std::isfinite(share) ? 100.0 * std::clamp(share, 0.0, 1.0) : 0.0;
    impl_->reached = stage + " " + std::to_string(static_cast<int>(percent)) + " %";
    impl_->flush_when_due();
  });
}

void StoreWriter::commit() {
  impl_->guarded([&] {
    impl_->begin();
    impl_->connection->database.exec(
        "DELETE FROM meta WHERE key IN ('replaces', 'build_reached', 'build_seconds')");
    for (const char* key : {"replaces", "build_reached", "build_seconds"}) impl_->meta.erase(key);
    impl_->write_meta("content_hash", content_hash(impl_->arrays, impl_->sorted_pages()));
    impl_->write_meta("build_seconds", seconds_text(impl_->seconds()));
    impl_->write_meta("complete", "true");
    impl_->write_meta("seal", seal(impl_->meta));
    impl_->connection->database.exec("COMMIT");
    // From here the partial file is a whole store; should the rename fail, a resumed build tries it again.
    impl_->connection.reset();
    impl_->lock->publish(impl_->replaces);
  });
  impl_->lock.reset();
}

}  // namespace lodlab
