// SPDX-License-Identifier: MIT
// The file of a build in progress, `PATH.partial`, and the lock that a writer holds on it. The lock belongs
// to the open file (Linux "open file description" lock), so it ends with the process, however that ends, and
// no other descriptor's closing drops it; it lies on a byte far past those that SQLite locks.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace lodlab::store {

std::string partial_path(const std::string& path);

/// The lock on a partial file; creates the file when absent. StoreError when another writer holds it.
class PartialLock {
 public:
  explicit PartialLock(const std::string& path);
  ~PartialLock();
  PartialLock(const PartialLock&) = delete;
  PartialLock& operator=(const PartialLock&) = delete;

  int64_t size() const;
  /// Empties the file and removes what a killed writer left beside it.
  void start_over();
  void remove();
  /// Makes the file durable and gives it the store's name; `replace` says whether over an existing one.
  void publish(bool replace);

 private:
  std::string path_, partial_, registered_;
  int file_ = -1;
};

/// The process that writes the partial file now; 0 when it is not known which, nothing when none does.
std::optional<int64_t> partial_writer(const std::string& partial);

}  // namespace lodlab::store
