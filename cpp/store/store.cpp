// SPDX-License-Identifier: MIT
// The reader. Opening trusts nothing: header, schema, meta seal, array checksums, and the directory of pages
// against the content hash. Page reads go through a pool of connections, so threads do not wait for one
// another; bytes are checked against the directory that was read when the store was opened.
#include "store/store.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <utility>

#include "base/errors.h"
#include "store/format.h"
#include "store/partial.h"
#include "store/sqlite.h"

namespace lodlab {
namespace {

namespace fs = std::filesystem;
using namespace lodlab::store;

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw StoreError("store " + path + ": " + why);
}

std::string value_of(const std::map<std::string, std::string>& meta, const char* key) {
  const auto found = meta.find(key);
  return found == meta.end() ? std::string() : found->second;
}

/// The rows of meta, each checked against its checksum.
std::map<std::string, std::string> read_meta(const Database& database, const std::string& path) {
  std::map<std::string, std::string> meta;
  Statement rows(database, "SELECT key, value, checksum FROM meta");
  while (rows.step()) {
    const std::string key = rows.text(0), value = rows.text(1);
    if (static_cast<uint64_t>(rows.integer(2)) != checksum(key, value)) {
      refuse(path, "damaged: meta '" + key + "' fails its checksum");
    }
    meta[key] = value;
  }
  return meta;
}

struct Header {
  int64_t file_bytes = 0;
  uint32_t version = 0;
};

uint32_t big_endian(const std::array<unsigned char, 100>& bytes, size_t at) {
  return uint32_t{bytes[at]} << 24 | uint32_t{bytes[at + 1]} << 16 | uint32_t{bytes[at + 2]} << 8 |
         bytes[at + 3];
}

/// Reads the first 100 bytes without SQLite, to say what is wrong in words: of another kind, cut short,
/// newer.
Header read_header(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) refuse(path, std::string("cannot be read: ") + std::strerror(errno));
  std::array<unsigned char, 100> bytes{};
  struct stat status = {};
  const bool known = fstat(file, &status) == 0;
  const ssize_t got = read(file, bytes.data(), bytes.size());
  const int error = errno;
  close(file);
  if (!known || got < 0) refuse(path, std::string("cannot be read: ") + std::strerror(error));
  if (got == 0) refuse(path, "the file is empty");
  const size_t compared = std::min<size_t>(static_cast<size_t>(got), 16);
  if (std::memcmp(bytes.data(), "SQLite format 3", compared) != 0) refuse(path, "is not a lodlab store");
  if (got < 100) refuse(path, "truncated: only " + std::to_string(got) + " bytes are left");
  if (big_endian(bytes, 68) != static_cast<uint32_t>(kApplicationId)) {
    refuse(path, "is a database, but not a lodlab store");
  }
  Header header{status.st_size, big_endian(bytes, 60)};
  if (header.version > static_cast<uint32_t>(kFormatVersion)) {
    refuse(path, "has format version " + std::to_string(header.version) + ", newer than this program's " +
                     std::to_string(kFormatVersion));
  }
  if (header.version < 1) refuse(path, "damaged: format version " + std::to_string(header.version));
  const int64_t coded = bytes[16] << 8 | bytes[17];  // 1 stands for 65536
  const int64_t expected = (coded == 1 ? 65536 : coded) * int64_t{big_endian(bytes, 28)};
  if (header.file_bytes < expected) {
    refuse(path, "truncated: " + std::to_string(header.file_bytes) + " bytes of " + std::to_string(expected));
  }
  if (header.file_bytes > expected) {
    refuse(path, "damaged: " + std::to_string(header.file_bytes) + " bytes, its header says " +
                     std::to_string(expected));
  }
  return header;
}

void check_schema(const Database& database, const std::string& path) {
  Statement rows(database, "SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY rowid");
  for (const char* expected : {kCreateMeta, kCreateArray, kCreatePage, kCreateIndex}) {
    if (!rows.step() || rows.text(0) != expected)
      refuse(path, "damaged: its tables are not those of a store");
  }
  if (rows.step()) refuse(path, "damaged: it has tables that are not those of a store");
}

/// What a partial file says of itself; never throws for damage, the file is on its way anyway.
std::string describe_partial(const std::string& partial) {
  if (const auto pid = partial_writer(partial)) {
    return "being built by another process" + (*pid > 0 ? " (pid " + std::to_string(*pid) + ")" : "");
  }
  std::string reached;
  try {
    const Database database = Database::open_immutable(partial);
    reached = value_of(read_meta(database, partial), "build_reached");
  } catch (const StoreError&) {
    reached.clear();
  }
  return "incomplete: its build was interrupted" + (reached.empty() ? "" : " at " + reached) +
         "; build it again with mode=\"resume\" to go on, or mode=\"force\" to start over";
}

/// Missing, a directory, on its way, or a file that can be read.
void check_exists(const std::string& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (fs::is_directory(status)) refuse(path, "is a directory");
  if (fs::is_regular_file(status)) return;
  if (fs::exists(status)) refuse(path, "is not a regular file");
  if (status.type() != fs::file_type::not_found) refuse(path, "cannot be read: " + error.message());
  const std::string partial = partial_path(path);
  if (fs::is_regular_file(partial, error)) refuse(path, describe_partial(partial));
  refuse(path, "does not exist");
}

/// One reader: its blob handle moves from page to page.
class Reader {
 public:
  explicit Reader(const std::string& path) : database_(Database::open_immutable(path)) {
    database_.exec("PRAGMA cache_size = -1024");
  }
  ~Reader() { sqlite3_blob_close(blob_); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  const Database& database() const { return database_; }

  Bytes read(const PageHead& page) {
    int code = blob_ == nullptr
                   ? sqlite3_blob_open(database_.handle(), "main", "page", "bytes", page.row, 0, &blob_)
                   : sqlite3_blob_reopen(blob_, page.row);
    if (code == SQLITE_OK && sqlite3_blob_bytes(blob_) != page.size) code = SQLITE_CORRUPT;
    if (code == SQLITE_OK) {
      Bytes bytes(static_cast<size_t>(page.size));
      code =
          bytes.empty() ? SQLITE_OK : sqlite3_blob_read(blob_, bytes.data(), static_cast<int>(page.size), 0);
      if (code == SQLITE_OK) return bytes;
    }
    // A handle that failed cannot be moved any more.
    sqlite3_blob_close(std::exchange(blob_, nullptr));
    // "No such row" is SQLITE_ERROR: the directory says that there is one.
    database_.fail((code & 0xff) == SQLITE_ERROR ? SQLITE_CORRUPT : code,
                   "read " + page_name(page.kind, page.id));
  }

 private:
  Database database_;
  sqlite3_blob* blob_ = nullptr;
};

}  // namespace

struct Store::Impl {
  std::string path;
  StoreMeta meta;
  std::map<std::string, std::string> values;
  std::string content_hash;
  int version = 0;
  std::map<std::string, ArrayHead> arrays;
  std::vector<PageHead> directory;  // sorted by (kind, id)

  mutable std::mutex mutex;
  mutable std::vector<std::unique_ptr<Reader>> idle;

  void load();
  void check_meta();
  const PageHead* find(int64_t kind, int64_t id) const;
  std::unique_ptr<Reader> take() const;

  /// Runs `work` with a reader of the pool; one that failed is not used again.
  template <class Work>
  auto with_reader(const Work& work) const {
    std::unique_ptr<Reader> reader = take();
    auto result = work(*reader);
    const std::lock_guard guard(mutex);
    idle.push_back(std::move(reader));
    return result;
  }
  Bytes read_array(const Database& database, const std::string& name) const;
  Bytes read_page(Reader& reader, const PageHead& page) const;
};

std::unique_ptr<Reader> Store::Impl::take() const {
  {
    const std::lock_guard guard(mutex);
    if (!idle.empty()) {
      std::unique_ptr<Reader> reader = std::move(idle.back());
      idle.pop_back();
      return reader;
    }
  }
  auto reader = std::make_unique<Reader>(path);
  // The name may mean another file by now; what is open stays what it was.
  Statement row(reader->database(), "SELECT value FROM meta WHERE key = 'seal'");
  if (!row.step() || row.text(0) != value_of(values, "seal")) {
    refuse(path, "was replaced by another one while it was open; open it again");
  }
  return reader;
}

void Store::Impl::check_meta() {
  if (value_of(values, "complete") != "true") {
    const std::string suffix = ".partial";
    refuse(path, path.ends_with(suffix) ? describe_partial(path) : "incomplete: its build never ended");
  }
  if (value_of(values, "seal") != seal(values)) refuse(path, "damaged: meta lacks rows or has others");
  if (value_of(values, "format_version") != std::to_string(version)) {
    refuse(path, "damaged: header and meta name different format versions");
  }
  meta = {value_of(values, "method"), value_of(values, "options"), value_of(values, "source_hash"),
          value_of(values, "source_spec"), value_of(values, "frame")};
  content_hash = value_of(values, "content_hash");
}

void Store::Impl::load() {
  check_exists(path);
  const Header header = read_header(path);
  version = static_cast<int>(header.version);
  auto reader = std::make_unique<Reader>(path);
  const Database& database = reader->database();
  check_schema(database, path);
  values = read_meta(database, path);
  check_meta();
  Statement array(database, "SELECT name, checksum, bytes FROM array");
  while (array.step()) {
    const std::string name = array.text(0);
    const std::span<const std::byte> bytes = array.blob(2);
    const ArrayHead head{static_cast<int64_t>(bytes.size()), static_cast<uint64_t>(array.integer(1))};
    if (checksum(bytes) != head.checksum) refuse(path, "damaged: array '" + name + "' fails its checksum");
    arrays[name] = head;
  }
  Statement page(database,
                 "SELECT kind, id, row, size, checksum FROM page INDEXED BY page_key ORDER BY kind, id");
  while (page.step()) {
    directory.push_back({page.integer(0), page.integer(1), page.integer(2), page.integer(3),
                         static_cast<uint64_t>(page.integer(4))});
  }
  if (store::content_hash(arrays, directory) != content_hash) {
    refuse(path, "damaged: arrays or the directory of pages do not match the content hash");
  }
  idle.push_back(std::move(reader));
}

const PageHead* Store::Impl::find(int64_t kind, int64_t id) const {
  const auto found = std::lower_bound(directory.begin(), directory.end(), std::pair(kind, id),
                                      [](const PageHead& page, const std::pair<int64_t, int64_t>& key) {
                                        return std::pair(page.kind, page.id) < key;
                                      });
  return found != directory.end() && found->kind == kind && found->id == id ? &*found : nullptr;
}

Bytes Store::Impl::read_array(const Database& database, const std::string& name) const {
  const auto found = arrays.find(name);
  if (found == arrays.end()) refuse(path, "has no array '" + name + "'");
  Statement row(database, "SELECT bytes FROM array WHERE name = ?");
  row.bind(1, name);
  if (!row.step()) refuse(path, "damaged: array '" + name + "' is gone");
  const std::span<const std::byte> bytes = row.blob(0);
  if (static_cast<int64_t>(bytes.size()) != found->second.size || checksum(bytes) != found->second.checksum) {
    refuse(path, "damaged: array '" + name + "' fails its checksum");
  }
  return {bytes.begin(), bytes.end()};
}

Bytes Store::Impl::read_page(Reader& reader, const PageHead& page) const {
  Bytes bytes = reader.read(page);
  if (checksum(bytes) != page.checksum) {
    refuse(path, "damaged: " + page_name(page.kind, page.id) + " fails its checksum");
  }
  return bytes;
}

Store::Store() : impl_(std::make_unique<Impl>()) {}
Store::~Store() = default;

std::shared_ptr<const Store> Store::open(const std::string& path) {
  const std::shared_ptr<Store> store(new Store());
  store->impl_->path = path;
  store->impl_->load();
  return store;
}

const StoreMeta& Store::meta() const { return impl_->meta; }
const std::string& Store::path() const { return impl_->path; }
const std::string& Store::content_hash() const { return impl_->content_hash; }
int Store::format_version() const { return impl_->version; }
double Store::build_seconds() const { return seconds_of(value_of(impl_->values, "build_seconds")); }
int64_t Store::bytes() const {
  int64_t sum = 0;
  for (const auto& [name, head] : impl_->arrays) sum += head.size;
  for (const PageHead& page : impl_->directory) sum += page.size;
  return sum;
}

const std::string& Store::meta(const std::string& key) const {
  const auto found = impl_->values.find(key);
  if (found == impl_->values.end()) refuse(impl_->path, "has no meta '" + key + "'");
  return found->second;
}

Bytes Store::array(const std::string& name) const {
  return impl_->with_reader([&](Reader& reader) { return impl_->read_array(reader.database(), name); });
}

bool Store::has_page(int kind, int64_t id) const { return impl_->find(kind, id) != nullptr; }

Bytes Store::page(int kind, int64_t id) const {
  const PageHead* head = impl_->find(kind, id);
  if (head == nullptr) refuse(impl_->path, "has no " + page_name(kind, id));
  return impl_->with_reader([&](Reader& reader) { return impl_->read_page(reader, *head); });
}

void Store::verify() const {
  impl_->with_reader([&](Reader& reader) {
    for (const auto& [name, head] : impl_->arrays) impl_->read_array(reader.database(), name);
    for (const PageHead& page : impl_->directory) impl_->read_page(reader, page);
    // What no page of ours lies on: the trees themselves, free pages, the order of keys.
    Statement check(reader.database(), "PRAGMA integrity_check(1)");
    const std::string verdict = check.step() ? check.text(0) : "no verdict";
    if (verdict != "ok") refuse(impl_->path, "damaged: its structure fails: " + verdict);
    return true;
  });
}

}  // namespace lodlab
