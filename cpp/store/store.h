// SPDX-License-Identifier: MIT
// The .lod file: one SQLite database per build. Tables: meta (key, value), array (name, blob: node
// arrays), page (kind, id, checksum, bytes). No GL here.
//
// A build writes `PATH.partial` and renames it to PATH when complete; a writer holds an exclusive lock, so
// a second build of the same path is refused. The partial file can be resumed when method, options and
// source hash are the same. An opened store is immutable; its functions may be called from any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace lodlab {

using Bytes = std::vector<std::byte>;

/// What to do when PATH or PATH.partial exists.
enum class BuildMode {
  kNew,     ///< refuse when PATH exists; a partial file is started over
  kForce,   ///< replace both
  kResume,  ///< go on from the partial file where its meta agrees, else refuse with StoreError
};

struct StoreMeta {
  std::string method;
  std::string options;  ///< JSON of all build options
  std::string source_hash;
  std::string source_spec;  ///< SOURCE of the command line, or empty
  std::string frame;        ///< JSON of the FieldFrame
};

class StoreWriter {
 public:
  StoreWriter(const std::string& path, const StoreMeta& meta, BuildMode mode);
  ~StoreWriter();  ///< not committed: leaves a resumable partial file that says that it is incomplete
  StoreWriter(const StoreWriter&) = delete;
  StoreWriter& operator=(const StoreWriter&) = delete;

  bool has_page(int kind, int64_t id) const;
  /// Thread-safe; pages may arrive in any order. Disk full and the like throw StoreError, and the file
  /// stays resumable.
  void put_page(int kind, int64_t id, std::span<const std::byte> bytes);
  /// Node arrays and other small named blobs; also checksummed.
  void put_array(const std::string& name, std::span<const std::byte> bytes);
  void put_meta(const std::string& key, const std::string& value);
  /// Remembers how far the build is, for the message of a partial file. Also the moment when pages that
  /// wait for long are made safe from a kill of the process. Cheap; thread-safe.
  void note_progress(const std::string& stage, double share);
  /// Computes content_hash (pages and arrays in key order, no times), marks complete, closes, renames.
  void commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

class Store {
 public:
  /// Checks that the file is a store of this format version, complete, and the checksums of meta and
  /// arrays. StoreError says which of these failed: missing, truncated, not a store, newer version,
  /// incomplete (a partial file, or one being built by another process), damaged.
  static std::shared_ptr<const Store> open(const std::string& path);
  ~Store();

  const StoreMeta& meta() const;
  /// A value written by put_meta; StoreError when absent.
  const std::string& meta(const std::string& key) const;
  const std::string& path() const;
  const std::string& content_hash() const;
  int format_version() const;
  double build_seconds() const;
  /// Of pages and arrays: equal builds have equal ones, where the database file may have more or less room.
  int64_t bytes() const;

  Bytes array(const std::string& name) const;
  template <class T>
  std::vector<T> array_of(const std::string& name) const;

  /// Reads one page and checks its checksum. Thread-safe.
  Bytes page(int kind, int64_t id) const;
  bool has_page(int kind, int64_t id) const;
  /// Reads and checks everything; throws StoreError naming the first page that is damaged.
  void verify() const;

 private:
  Store();
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

template <class T>
std::vector<T> Store::array_of(const std::string& name) const {
  const Bytes bytes = array(name);
  std::vector<T> out(bytes.size() / sizeof(T));
  std::copy(bytes.begin(), bytes.begin() + out.size() * sizeof(T), reinterpret_cast<std::byte*>(out.data()));
  return out;
}

template <class T>
std::span<const std::byte> as_bytes(const std::vector<T>& values) {
  return std::as_bytes(std::span<const T>(values));
}

}  // namespace lodlab
