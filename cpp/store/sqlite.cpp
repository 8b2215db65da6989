// SPDX-License-Identifier: MIT
#include "store/sqlite.h"

#include <cstring>
#include <new>
#include <utility>

namespace lodlab::store {
namespace {

/// A path as a file: URI; SQLite decodes %, and ends the path at ? and #.
std::string file_uri(const std::string& path, const char* query) {
  static const char* const kHex = "0123456789ABCDEF";
  std::string uri = "file:";
  if (path.starts_with("//")) uri += "//";  // an empty authority, so that the path's own slashes stay
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '%' || c == '?' || c == '#' || byte < 0x20 || byte >= 0x7f) {
      uri += '%';
      uri += kHex[byte >> 4];
      uri += kHex[byte & 15];
    } else {
      uri += c;
    }
  }
  return uri + query;
}

}  // namespace

Database Database::open_immutable(const std::string& path) {
  Database database(path, file_uri(path, "?immutable=1"), SQLITE_OPEN_READONLY);
  database.exec("PRAGMA query_only = ON; PRAGMA mmap_size = 0");
  return database;
}

Database Database::open_writable(const std::string& path) {
  return {path, file_uri(path, ""), SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE};
}

Database::Database(const std::string& path, const std::string& uri, int flags) : path_(path) {
  const int code =
      sqlite3_open_v2(uri.c_str(), &handle_, flags | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX, nullptr);
  if (handle_ == nullptr) throw std::bad_alloc();
  try {
    if (code != SQLITE_OK) fail(code, "open");
    sqlite3_extended_result_codes(handle_, 1);
    sqlite3_db_config(handle_, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    // A file from elsewhere may be damaged or hostile: check cells, trust no function in its schema.
    exec("PRAGMA cell_size_check = ON; PRAGMA trusted_schema = OFF; PRAGMA temp_store = MEMORY");
  } catch (...) {
    close();
    throw;
  }
}

Database::Database(Database&& other) noexcept
    : path_(std::move(other.path_)), handle_(std::exchange(other.handle_, nullptr)) {}

void Database::close() { sqlite3_close_v2(std::exchange(handle_, nullptr)); }

bool Database::in_transaction() const { return handle_ != nullptr && sqlite3_get_autocommit(handle_) == 0; }

void Database::exec(const char* sql) {
  const int code = sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) fail(code, std::string("run '") + sql + "'");
}

void Database::fail(int code, const std::string& doing) const {
  const int system = handle_ != nullptr ? sqlite3_system_errno(handle_) : 0;
  const std::string what = "store " + path_ + ": cannot " + doing + ": ";
  std::string why;
  switch (code & 0xff) {
    case SQLITE_NOMEM:
      throw std::bad_alloc();
    case SQLITE_CORRUPT:
      throw DamagedFile(what + "the file is damaged");
    case SQLITE_NOTADB:
      throw DamagedFile(what + "the file is not a store, or its header is damaged");
    case SQLITE_FULL:
      why = "the disk is full";
      break;
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      why = "another program is using it";
      break;
    default:
      why = handle_ != nullptr ? sqlite3_errmsg(handle_) : sqlite3_errstr(code);
  }
  if ((code & 0xff) == SQLITE_IOERR || (code & 0xff) == SQLITE_CANTOPEN) {
    if (system != 0) why += std::string(" (") + std::strerror(system) + ")";
  }
  throw StoreError(what + why);
}

Statement::Statement(const Database& database, const char* sql) : database_(&database) {
  const int code =
      sqlite3_prepare_v3(database.handle(), sql, -1, SQLITE_PREPARE_PERSISTENT, &handle_, nullptr);
  if (code != SQLITE_OK) database.fail(code, "read its tables");
}

Statement::Statement(Statement&& other) noexcept
    : database_(other.database_), handle_(std::exchange(other.handle_, nullptr)) {}

Statement::~Statement() { sqlite3_finalize(handle_); }

void Statement::bind(int index, int64_t value) {
  if (const int code = sqlite3_bind_int64(handle_, index, value)) database_->fail(code, "bind a number");
}

void Statement::bind(int index, std::string_view text) {
  const int code = sqlite3_bind_text64(handle_, index, text.data(), text.size(), SQLITE_STATIC, SQLITE_UTF8);
  if (code != SQLITE_OK) database_->fail(code, "bind a text");
}

void Statement::bind(int index, std::span<const std::byte> blob) {
  // A null pointer would bind NULL; an empty blob is a blob.
  const int code = blob.empty()
                       ? sqlite3_bind_zeroblob(handle_, index, 0)
                       : sqlite3_bind_blob64(handle_, index, blob.data(), blob.size(), SQLITE_STATIC);
  if (code != SQLITE_OK) database_->fail(code, "bind " + std::to_string(blob.size()) + " bytes");
}

bool Statement::step() {
  const int code = sqlite3_step(handle_);
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  sqlite3_reset(handle_);
  database_->fail(code, sqlite3_stmt_readonly(handle_) ? "read" : "write");
}

void Statement::run() {
  while (step()) continue;
  reset();
}

std::string Statement::text(int column) const {
  const auto* data = reinterpret_cast<const char*>(sqlite3_column_text(handle_, column));
  return data == nullptr ? std::string() : std::string(data, sqlite3_column_bytes(handle_, column));
}

std::span<const std::byte> Statement::blob(int column) const {
  const auto* data = static_cast<const std::byte*>(sqlite3_column_blob(handle_, column));
  const int size = sqlite3_column_bytes(handle_, column);
  return data == nullptr ? std::span<const std::byte>() : std::span(data, static_cast<size_t>(size));
}

}  // namespace lodlab::store
