// SPDX-License-Identifier: MIT
// The layout of a .lod file, shared by its writer and its reader.
//   meta (key, value, checksum)            what the store is; the row `seal` covers all other rows
//   array (name, checksum, bytes)          node arrays, small blobs
//   page (kind, id, checksum, size, bytes) pages in order of arrival; the index page_key holds everything
//                                          but the bytes, so that a directory is read without them
// Checksums are XXH3-64 of the bytes (meta: of key, 0, value). The content hash is XXH3-128 over
// (name, size, checksum) of the arrays by name and (kind, id, size, checksum) of the pages by key: equal for
// equal content, whatever the order of arrival.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace lodlab::store {

inline constexpr int kFormatVersion = 1;
inline constexpr int kApplicationId = 0x6c6f646c;  // "lodl"; `file` and SQLite show it

// The names of the tables' SQL as sqlite_schema keeps it: a reader compares them letter by letter, so that a
// damaged or foreign schema is never executed.
inline constexpr const char* kCreateMeta =
    "CREATE TABLE meta(key TEXT PRIMARY KEY, value TEXT NOT NULL, checksum INTEGER NOT NULL)";
inline constexpr const char* kCreateArray =
    "CREATE TABLE array(name TEXT PRIMARY KEY, checksum INTEGER NOT NULL, bytes BLOB NOT NULL)";
inline constexpr const char* kCreatePage =
    "CREATE TABLE page(row INTEGER PRIMARY KEY, kind INTEGER NOT NULL, id INTEGER NOT NULL, "
    "checksum INTEGER NOT NULL, size INTEGER NOT NULL, bytes BLOB NOT NULL)";
inline constexpr const char* kCreateIndex = "CREATE UNIQUE INDEX page_key ON page(kind, id, checksum, size)";

/// Everything of a page but its bytes.
struct PageHead {
  int64_t kind = 0, id = 0, row = 0, size = 0;
  uint64_t checksum = 0;
};

struct ArrayHead {
  int64_t size = 0;
  uint64_t checksum = 0;
};

/// 32 hex digits.
std::string digest_of(std::span<const std::byte> bytes);
uint64_t checksum(std::span<const std::byte> bytes);
uint64_t checksum(const std::string& key, const std::string& value);

/// The seal of a meta table: over all its rows by key, `seal` itself left out.
std::string seal(const std::map<std::string, std::string>& meta);

/// `pages` sorted by (kind, id). 32 hex digits.
std::string content_hash(const std::map<std::string, ArrayHead>& arrays, const std::vector<PageHead>& pages);

/// Seconds as text and back, whatever the locale; text that is no number gives 0.
std::string seconds_text(double seconds);
double seconds_of(const std::string& text);

/// "page 5 of kind 1": how messages name a page.
std::string page_name(int64_t kind, int64_t id);

}  // namespace lodlab::store
