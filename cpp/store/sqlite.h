// SPDX-License-Identifier: MIT
// A thin owner of SQLite handles, private to the store: every failure becomes a StoreError that names the
// file, what was being done and SQLite's or the system's reason. One connection is used by one thread at a
// time (the store's pool and the writer's mutex see to it).
#pragma once

#include <sqlite3.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "base/errors.h"

namespace lodlab::store {

/// The largest blob that SQLite's default limits take, less room for the rest of its row.
inline constexpr int64_t kMaxBlob = 1'000'000'000 - 4096;

/// SQLite found the file's structure damaged, or no database at all.
class DamagedFile : public StoreError {
 public:
  using StoreError::StoreError;
};

class Database {
 public:
  /// Reads a file that nobody changes: no locks, no files beside it.
  static Database open_immutable(const std::string& path);
  /// Opens or creates for writing.
  static Database open_writable(const std::string& path);
  Database(Database&& other) noexcept;
  Database& operator=(Database&&) = delete;
  ~Database() { close(); }

  void exec(const char* sql);
  sqlite3* handle() const { return handle_; }
  void close();
  /// True while a transaction is open (SQLite may have rolled it back by itself after an error).
  bool in_transaction() const;
  /// Throws StoreError: path, what was being done, why it failed.
  [[noreturn]] void fail(int code, const std::string& doing) const;

 private:
  Database(const std::string& path, const std::string& uri, int flags);
  std::string path_;
  sqlite3* handle_ = nullptr;
};

/// A prepared statement. Arguments are bound by position from 1 and must outlive step().
class Statement {
 public:
  Statement(const Database& database, const char* sql);
  Statement(Statement&& other) noexcept;
  Statement& operator=(Statement&&) = delete;
  ~Statement();

  void bind(int index, int64_t value);
  void bind(int index, std::string_view text);
  void bind(int index, std::span<const std::byte> blob);
  /// Steps once; true when there is a row.
  bool step();
  /// Steps to the end, ignoring rows, and makes ready for the next use.
  void run();
  void reset() { sqlite3_reset(handle_); }

  int64_t integer(int column) const { return sqlite3_column_int64(handle_, column); }
  std::string text(int column) const;
  std::span<const std::byte> blob(int column) const;

 private:
  const Database* database_;
  sqlite3_stmt* handle_ = nullptr;
};

}  // namespace lodlab::store
