// SPDX-License-Identifier: MIT
// What the store's tests share: a folder that goes away, deterministic pages, and a toy build.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "base/errors.h"
#include "store/store.h"

namespace lodlab::testing {

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "lodlab-test-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::string operator/(const std::string& name) const { return (path_ / name).string(); }
  size_t files() const {
    return static_cast<size_t>(std::distance(std::filesystem::directory_iterator(path_), {}));
  }

 private:
  std::filesystem::path path_;
};

/// The bytes of page `id`: sizes from 0 to about 9,000, content a function of the id alone.
inline Bytes page_bytes(int64_t id) {
  uint64_t state = static_cast<uint64_t>(id) * 0x9e3779b97f4a7c15u + 1;
  Bytes out(static_cast<size_t>(id * 977 % 9001));
  for (std::byte& byte : out) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    byte = static_cast<std::byte>(state >> 56);
  }
  return out;
}

inline StoreMeta toy_meta() { return {"toy", R"({"detail":1})", "cafe", "fractal:size=5", "{}"}; }

inline constexpr int kToyPages = 40;

/// Puts the toy's pages that are not there yet, its arrays and meta; does not commit.
inline void put_toy(StoreWriter& writer, int pages = kToyPages) {
  for (int64_t id = 0; id < pages; ++id) {
    if (!writer.has_page(id % 3 == 0, id)) writer.put_page(id % 3 == 0, id, page_bytes(id));
  }
  writer.put_array("nodes", page_bytes(1003));
  writer.put_array("empty", {});
  writer.put_meta("leaf", "64");
}

/// Begins a build and leaves it.
inline void start_toy(const std::string& path, BuildMode mode, int pages = kToyPages) {
  StoreWriter writer(path, toy_meta(), mode);
  put_toy(writer, pages);
}

inline std::string build_toy(const std::string& path, BuildMode mode = BuildMode::kNew,
                             int pages = kToyPages) {
  {
    StoreWriter writer(path, toy_meta(), mode);
    put_toy(writer, pages);
    writer.commit();
  }
  return Store::open(path)->content_hash();
}

/// True when everything of the toy reads back right; throws StoreError when something does not read.
inline bool toy_is_right(const Store& store, int pages = kToyPages) {
  const StoreMeta want = toy_meta();
  bool right = store.meta().method == want.method && store.meta().options == want.options &&
               store.meta().source_hash == want.source_hash && store.meta().frame == want.frame &&
               store.meta().source_spec == want.source_spec && store.meta("leaf") == "64" &&
               store.array("nodes") == page_bytes(1003) && store.array("empty").empty();
  for (int64_t id = 0; id < pages && right; ++id) {
    right = store.has_page(id % 3 == 0, id) && !store.has_page(id % 3 != 0, id) &&
            store.page(id % 3 == 0, id) == page_bytes(id);
  }
  return right;
}

inline std::vector<char> read_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline void write_file(const std::string& path, const std::vector<char>& bytes) {
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

/// The message of the StoreError that `work` throws; "no error" when it throws none.
template <class Work>
std::string store_error(const Work& work) {
  try {
    work();
  } catch (const StoreError& error) {
    return error.what();
  }
  return "no error";
}

inline bool says(const std::string& message, const std::string& part) {
  return message.find(part) != std::string::npos;
}

}  // namespace lodlab::testing
