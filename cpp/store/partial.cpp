// SPDX-License-Identifier: MIT
#include "store/partial.h"

#include <fcntl.h>
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <set>

#include "base/errors.h"

namespace lodlab::store {
namespace {

namespace fs = std::filesystem;

constexpr off_t kLockByte = off_t{1} << 62;
constexpr off_t kSqliteBytes = 0x40000000;  // where SQLite puts its own locks, 512 bytes

// Partial files being written by this process. They must not be opened a second time here: closing any
// descriptor of a file drops the process's POSIX locks on it, SQLite's among them.
std::mutex g_mutex;
std::set<std::string> g_writing;

std::string canonical(const std::string& path) {
  std::error_code ignored;
  const fs::path full = fs::weakly_canonical(path, ignored);
  return full.empty() ? path : full.string();
}

[[noreturn]] void fail(const std::string& path, const std::string& doing, int error) {
  std::string why = std::strerror(error);
  if (error == ENOENT) {
    const fs::path folder = fs::path(path).parent_path();
    if (!folder.empty() && !fs::exists(folder)) why = "the directory " + folder.string() + " does not exist";
  }
  throw StoreError("store " + path + ": cannot " + doing + ": " + why);
}

struct flock lock_of(short type, off_t start, off_t length) {
  struct flock lock = {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  lock.l_start = start;
  lock.l_len = length;
  return lock;
}

/// The process that holds SQLite's lock on the file, 0 when unknown.
int64_t holder(int file) {
  struct flock lock = lock_of(F_WRLCK, kSqliteBytes, 512);
  return fcntl(file, F_GETLK, &lock) == 0 && lock.l_type != F_UNLCK && lock.l_pid > 0 ? lock.l_pid : 0;
}

[[noreturn]] void refuse_second(const std::string& path, int64_t pid) {
  const std::string who = pid == getpid() ? "this process" : "another process";
  throw StoreError("store " + path + ": being built by " + who +
                   (pid > 0 ? " (pid " + std::to_string(pid) + ")" : ""));
}

bool same_file(int file, const std::string& path) {
  struct stat open_one = {}, named = {};
  return fstat(file, &open_one) == 0 && stat(path.c_str(), &named) == 0 && open_one.st_ino == named.st_ino &&
         open_one.st_dev == named.st_dev;
}

int open_and_lock(const std::string& path, const std::string& partial) {
  while (true) {
    const int file = open(partial.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (file < 0) fail(partial, "create", errno);
    struct flock lock = lock_of(F_WRLCK, kLockByte, 1);
    if (fcntl(file, F_OFD_SETLK, &lock) != 0) {
      const int error = errno;
      const int64_t pid = holder(file);
      close(file);
      if (error == EAGAIN || error == EACCES) refuse_second(path, pid);
      fail(partial, "lock", error);
    }
    // The former writer may have renamed or removed the file between our open and our lock.
    if (same_file(file, partial)) return file;
    close(file);
  }
}

}  // namespace

std::string partial_path(const std::string& path) { return path + ".partial"; }

PartialLock::PartialLock(const std::string& path)
    : path_(path), partial_(partial_path(path)), registered_(canonical(partial_)) {
  {
    const std::lock_guard guard(g_mutex);
    if (!g_writing.insert(registered_).second) refuse_second(path_, getpid());
  }
  try {
    file_ = open_and_lock(path_, partial_);
  } catch (...) {
    const std::lock_guard guard(g_mutex);
    g_writing.erase(registered_);
    throw;
  }
}

PartialLock::~PartialLock() {
  close(file_);
  const std::lock_guard guard(g_mutex);
  g_writing.erase(registered_);
}

int64_t PartialLock::size() const {
  struct stat status = {};
  if (fstat(file_, &status) != 0) fail(partial_, "look at", errno);
  return status.st_size;
}

void PartialLock::start_over() {
  // The journal first: left alone it would be played back into the new file.
  for (const char* suffix : {"-journal", "-wal", "-shm"}) unlink((partial_ + suffix).c_str());
  if (ftruncate(file_, 0) != 0) fail(partial_, "empty", errno);
}

void PartialLock::remove() {
  unlink((partial_ + "-journal").c_str());
  unlink(partial_.c_str());
}

void PartialLock::publish(bool replace) {
  if (fsync(file_) != 0) fail(partial_, "write", errno);
  int code = replace ? -1 : renameat2(AT_FDCWD, partial_.c_str(), AT_FDCWD, path_.c_str(), RENAME_NOREPLACE);
  if (code != 0 && !replace && errno == EEXIST) {
    throw StoreError("store " + path_ + ": appeared while it was being built; the new one is kept as " +
                     partial_ + "; remove the other one, then build with mode=\"resume\"");
  }
  // Some file systems know no rename without replacing.
  if (code != 0 && rename(partial_.c_str(), path_.c_str()) != 0) fail(path_, "rename to it", errno);
  const fs::path folder = fs::path(path_).parent_path();
  const int handle = open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (handle >= 0) {
    fsync(handle);  // best effort: the name itself survives a power cut
    close(handle);
  }
}

std::optional<int64_t> partial_writer(const std::string& partial) {
  {
    const std::lock_guard guard(g_mutex);
    if (g_writing.contains(canonical(partial))) return getpid();
  }
  const int file = open(partial.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return std::nullopt;
  struct flock lock = lock_of(F_WRLCK, kLockByte, 1);
  std::optional<int64_t> pid;
  if (fcntl(file, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK) pid = holder(file);
  close(file);
  return pid;
}

}  // namespace lodlab::store
