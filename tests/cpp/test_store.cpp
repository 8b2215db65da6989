// SPDX-License-Identifier: MIT
// The .lod file: what is written reads back, whatever order, threads or resumption; what is damaged, on its
// way or of another kind is refused with a StoreError that says which.
#include "store/store.h"

#include <doctest/doctest.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <thread>

#include "store_fixture.h"

using namespace lodlab;
using namespace lodlab::testing;
namespace fs = std::filesystem;

namespace {

/// Runs `work` in a child process and returns its exit status; -SIGNAL when a signal ended it.
template <class Work>
int in_child(const Work& work) {
  const pid_t child = fork();
  if (child == 0) {
    int code = 99;
    try {
      code = work();
    } catch (const std::exception& error) {
      std::fprintf(stderr, "child: %s\n", error.what());
    }
    _exit(code);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

void expect_file_refused(const std::string& path, const std::string& part) {
  const std::string message = store_error([&] { Store::open(path); });
  CHECK_MESSAGE(says(message, part), message);
  CHECK_MESSAGE(says(message, path), message);
}

}  // namespace

TEST_CASE("a store reads back what was put") {
  const TemporaryFolder folder;
  const std::string path = folder / "toy # 100%?.lod";  // characters that mean something in a URI
  build_toy(path);
  const auto store = Store::open(path);
  CHECK(toy_is_right(*store));
  CHECK(store->format_version() == 1);
  CHECK(store->content_hash().size() == 32);
  CHECK(store->bytes() > 0);
  CHECK(store->bytes() < static_cast<int64_t>(fs::file_size(path)));
  CHECK(store->build_seconds() >= 0.0);
  CHECK(store->build_seconds() < 60.0);
  CHECK_NOTHROW(store->verify());
  CHECK(folder.files() == 1);  // no journal, no partial file
  CHECK(says(store_error([&] { store->page(0, 9999); }), "has no page 9999 of kind 0"));
  CHECK(says(store_error([&] { store->array("edges"); }), "has no array 'edges'"));
  CHECK(says(store_error([&] { store->meta("colour"); }), "has no meta 'colour'"));
}

TEST_CASE("a store of no pages") {
  const TemporaryFolder folder;
  StoreWriter writer(folder / "none.lod", toy_meta(), BuildMode::kNew);
  writer.commit();
  CHECK_NOTHROW(Store::open(folder / "none.lod")->verify());
  CHECK(says(store_error([&] { writer.put_page(0, 0, {}); }), "committed already"));
}

TEST_CASE("the content hash knows content, not order, threads, force or resumption") {
  const TemporaryFolder folder;
  const std::string hash = build_toy(folder / "a.lod");
  CHECK(build_toy(folder / "a.lod", BuildMode::kForce) == hash);
  {
    StoreWriter writer(folder / "backwards.lod", toy_meta(), BuildMode::kNew);
    for (int64_t id = kToyPages - 1; id >= 0; --id) writer.put_page(id % 3 == 0, id, page_bytes(id));
    put_toy(writer);
    writer.commit();
    CHECK(Store::open(folder / "backwards.lod")->content_hash() == hash);
  }
  {
    StoreWriter writer(folder / "threads.lod", toy_meta(), BuildMode::kNew);
    std::atomic<int64_t> next{0};
    {
      std::vector<std::jthread> threads;
      for (int t = 0; t < 4; ++t) {
        threads.emplace_back([&] {
          for (int64_t id = next++; id < kToyPages; id = next++)
            writer.put_page(id % 3 == 0, id, page_bytes(id));
        });
      }
    }
    put_toy(writer);
    writer.commit();
    CHECK(Store::open(folder / "threads.lod")->content_hash() == hash);
  }
  start_toy(folder / "resumed.lod", BuildMode::kNew, 17);
  CHECK(build_toy(folder / "resumed.lod", BuildMode::kResume) == hash);
  CHECK(build_toy(folder / "more.lod", BuildMode::kNew, kToyPages + 1) != hash);
  StoreWriter writer(folder / "other.lod", toy_meta(), BuildMode::kNew);
  put_toy(writer);
  writer.put_array("nodes", page_bytes(1004));
  writer.commit();
  CHECK(Store::open(folder / "other.lod")->content_hash() != hash);
}

TEST_CASE("a page that is put twice must be the same") {
  const TemporaryFolder folder;
  StoreWriter writer(folder / "a.lod", toy_meta(), BuildMode::kNew);
  writer.put_page(1, 5, page_bytes(5));
  CHECK_NOTHROW(writer.put_page(1, 5, page_bytes(5)));
  CHECK(says(store_error([&] { writer.put_page(1, 5, page_bytes(6)); }), "page 5 of kind 1"));
  CHECK_THROWS_AS(writer.put_meta("content_hash", "mine"), InvalidInput);
}

TEST_CASE("build modes") {
  const TemporaryFolder folder;
  const std::string path = folder / "a.lod";
  build_toy(path);
  const auto opened = Store::open(path);
  CHECK(says(store_error([&] { build_toy(path, BuildMode::kNew); }), "exists already"));
  CHECK(says(store_error([&] { build_toy(path, BuildMode::kResume); }), "exists already"));
  CHECK(folder.files() == 1);
  build_toy(path, BuildMode::kForce, 3);
  CHECK(Store::open(path)->has_page(0, 2));
  CHECK(!Store::open(path)->has_page(0, 5));
  CHECK(toy_is_right(*opened));  // what was opened before stays what it was

  SUBCASE("an interrupted replacement leaves the old store, and is resumed") {
    start_toy(path, BuildMode::kForce, 9);
    CHECK(Store::open(path)->has_page(0, 2));
    build_toy(path, BuildMode::kResume);
    CHECK(toy_is_right(*Store::open(path)));
  }
  SUBCASE("a new build starts a partial file over") {
    const std::string other = folder / "b.lod";
    start_toy(other, BuildMode::kNew, 9);
    CHECK(fs::exists(other + ".partial"));
    StoreWriter writer(other, toy_meta(), BuildMode::kNew);
    CHECK(!writer.has_page(0, 1));
  }
  SUBCASE("a build without a page leaves nothing") {
    { const StoreWriter writer(folder / "c.lod", toy_meta(), BuildMode::kNew); }
    CHECK(folder.files() == 1);
  }
}

TEST_CASE("a build is resumed only by the same build") {
  const TemporaryFolder folder;
  const std::string path = folder / "a.lod";
  {
    StoreWriter writer(path, toy_meta(), BuildMode::kNew);
    put_toy(writer, 9);
    writer.note_progress("bounds", 0.43);
  }
  expect_file_refused(path, "incomplete");
  expect_file_refused(path, "bounds 43 %");
  expect_file_refused(path, "mode=\"resume\"");
  expect_file_refused(path + ".partial", "incomplete");
  const auto differing = [&](auto change) {
    StoreMeta meta = toy_meta();
    change(meta);
    return store_error([&] { StoreWriter(path, meta, BuildMode::kResume); });
  };
  CHECK(says(differing([](StoreMeta& m) { m.method = "other"; }), "method is toy, this build's is other"));
  CHECK(says(differing([](StoreMeta& m) { m.options = "{}"; }), R"(options is {"detail":1})"));
  CHECK(says(differing([](StoreMeta& m) { m.source_hash = "beef"; }), "this build's is beef"));
  CHECK(build_toy(path, BuildMode::kResume) == build_toy(folder / "b.lod"));
}

TEST_CASE("a partial file whose pages were damaged is repaired by the resumed build") {
  const TemporaryFolder folder;
  const std::string path = folder / "a.lod";
  start_toy(path, BuildMode::kNew);
  std::vector<char> bytes = read_file(path + ".partial");
  // The middle of the largest page, found by its content.
  const Bytes page = page_bytes(37);
  const auto* begin = reinterpret_cast<const char*>(page.data());
  const auto found = std::search(bytes.begin(), bytes.end(), begin + 100, begin + 140);
  REQUIRE(found != bytes.end());
  *found = static_cast<char>(*found ^ 4);
  write_file(path + ".partial", bytes);
  StoreWriter writer(path, toy_meta(), BuildMode::kResume);
  CHECK(writer.has_page(0, 38));
  CHECK(!writer.has_page(0, 37));
  put_toy(writer);
  writer.commit();
  CHECK(toy_is_right(*Store::open(path)));
}

TEST_CASE("one builder at a time") {
  const TemporaryFolder folder;
  const std::string path = folder / "a.lod";
  auto writer = std::make_unique<StoreWriter>(path, toy_meta(), BuildMode::kNew);
  put_toy(*writer, 3);
  for (const BuildMode mode : {BuildMode::kNew, BuildMode::kForce, BuildMode::kResume}) {
    CHECK(says(store_error([&] { build_toy(path, mode); }), "being built by this process"));
  }
  // From another process: a fork would share our lock, so a builder is forked and we are the second.
  int ready[2];
  REQUIRE(pipe(ready) == 0);
  const std::string theirs = folder / "b.lod";
  const pid_t child = fork();
  if (child == 0) {
    StoreWriter held(theirs, toy_meta(), BuildMode::kNew);
    held.put_page(0, 1, page_bytes(1));
    if (write(ready[1], "!", 1) != 1) _exit(1);
    while (true) pause();
  }
  char mark = 0;
  REQUIRE(read(ready[0], &mark, 1) == 1);
  const std::string who = "being built by another process (pid " + std::to_string(child) + ")";
  const std::string message = store_error([&] { build_toy(theirs, BuildMode::kForce); });
  CHECK_MESSAGE(says(message, who), message);
  expect_file_refused(theirs, who);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  expect_file_refused(theirs, "incomplete");  // the lock died with its process
  CHECK_NOTHROW(build_toy(theirs, BuildMode::kResume));
  put_toy(*writer);
  writer->commit();
  CHECK(toy_is_right(*Store::open(path)));
}

TEST_CASE("killed at any moment, a build resumes to the same content") {
  constexpr int kPages = 600;
  const TemporaryFolder folder;
  const std::string hash = build_toy(folder / "whole.lod", BuildMode::kNew, kPages);
  const std::string path = folder / "killed.lod";
  int interrupted = 0, kept = 0;
  for (int attempt = 0; attempt < 6; ++attempt) {
    const pid_t child = fork();
    if (child == 0) {
      StoreWriter writer(path, toy_meta(), BuildMode::kForce);
      for (int64_t id = 0; id < kPages; ++id) {
        writer.put_page(id % 3 == 0, id, page_bytes(id));
        if (id % 4 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));  // about 1.5 s in all
      }
      put_toy(writer, kPages);
      writer.commit();
      _exit(0);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1 + 230 * attempt));
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    if (WIFSIGNALED(status)) ++interrupted;
    if (!fs::exists(path)) {
      CHECK(store_error([&] { Store::open(path); }) != "no error");
    }
    if (!fs::exists(path)) {  // else it was faster than the signal
      StoreWriter writer(path, toy_meta(), BuildMode::kResume);
      kept += writer.has_page(true, 0);
      put_toy(writer, kPages);
      writer.commit();
    }
    CHECK(Store::open(path)->content_hash() == hash);
    CHECK_NOTHROW(Store::open(path)->verify());
    CHECK(!fs::exists(path + ".partial"));
    fs::remove(path);
  }
  CHECK(interrupted >= 5);
  CHECK(kept >= 2);  // something was there to go on from
}

TEST_CASE("files that are no complete store are refused by name") {
  const TemporaryFolder folder;
  const std::string path = folder / "a.lod";
  build_toy(path);
  const std::vector<char> whole = read_file(path);
  expect_file_refused(folder / "nothing.lod", "does not exist");
  fs::create_directory(folder / "dir.lod");
  expect_file_refused(folder / "dir.lod", "is a directory");
  write_file(path, {});
  expect_file_refused(path, "empty");
  write_file(path, std::vector<char>(5000, 'x'));
  expect_file_refused(path, "is not a lodlab store");
  write_file(path, {'P', 'N', 'G'});
  expect_file_refused(path, "is not a lodlab store");
  for (const size_t length :
       {size_t{10}, size_t{99}, size_t{100}, size_t{4096}, whole.size() / 2, whole.size() - 1}) {
    write_file(path, {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)});
    expect_file_refused(path, "truncated");
  }
  std::vector<char> longer = whole;
  longer.resize(longer.size() + 8192);
  write_file(path, longer);
  expect_file_refused(path, "damaged");
  std::vector<char> newer = whole;
  newer[63] = 2;  // user_version
  write_file(path, newer);
  expect_file_refused(path, "format version 2, newer than this program's 1");
  std::vector<char> foreign = whole;
  foreign[70] = 'x';  // application_id
  write_file(path, foreign);
  expect_file_refused(path, "not a lodlab store");
}

TEST_CASE("targets that cannot be written are refused by name") {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& path, const std::string& part) {
    const std::string message = store_error([&] { build_toy(path); });
    CHECK_MESSAGE(says(message, part), message);
    CHECK_MESSAGE(says(message, path), message);
  };
  refused(folder / "no/such/a.lod", "does not exist");
  write_file(folder / "file", {'x'});
  refused(folder / "file/a.lod", "Not a directory");
  fs::create_directory(folder / "dir.lod");
  refused(folder / "dir.lod", "is a directory");
  CHECK(says(store_error([&] { build_toy(""); }), "empty"));
  fs::create_directory(folder / "locked");
  fs::permissions(folder / "locked", fs::perms::owner_read | fs::perms::owner_exec);
  CHECK(in_child([&] {
          if (geteuid() == 0 && seteuid(65534) != 0) return 2;  // root may write anywhere
          return says(store_error([&] { build_toy(folder / "locked/a.lod"); }), "Permission denied") ? 0 : 1;
        }) == 0);
  CHECK(fs::is_empty(folder / "locked"));
}

TEST_CASE("a full disk is a StoreError, and the build can be resumed when there is room") {
  const TemporaryFolder folder;
  const std::string path = folder / "a.lod";
  const std::string hash = build_toy(folder / "whole.lod", BuildMode::kNew, 9000);
  const int code = in_child([&] {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{24 << 20, 24 << 20};
    if (setrlimit(RLIMIT_FSIZE, &limit) != 0) return 2;
    const std::string message = store_error([&] { build_toy(path, BuildMode::kNew, 9000); });
    return says(message, path) && says(message, "cannot") ? 0 : 1;
  });
  CHECK(code == 0);
  CHECK(!fs::exists(path));
  expect_file_refused(path, "incomplete");
  {
    const StoreWriter writer(path, toy_meta(), BuildMode::kResume);
    CHECK(writer.has_page(false, 1));
  }
  CHECK(build_toy(path, BuildMode::kResume, 9000) == hash);
}

TEST_CASE("a flipped bit is found, or harmless") {
  const TemporaryFolder folder;
  const std::string path = folder / "a.lod";
  build_toy(path);
  const std::vector<char> whole = read_file(path);
  REQUIRE(whole.size() > 150000);
  int found_by_open = 0, found_later = 0, harmless = 0;
  const auto flip = [&](size_t at, int bit) {
    std::vector<char> bytes = whole;
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << bit));
    write_file(path, bytes);
    std::shared_ptr<const Store> store;
    try {
      store = Store::open(path);
    } catch (const StoreError&) {
      ++found_by_open;
      return;
    }
    bool refused = false;
    try {
      store->verify();
    } catch (const StoreError&) {
      refused = true;
    }
    // What reads must be right even where verify has already complained.
    for (int64_t id = 0; id < kToyPages; ++id) {
      bool right = false;
      try {
        right = store->page(id % 3 == 0, id) == page_bytes(id);
      } catch (const StoreError&) {
        right = refused;
      }
      CHECK(right);
    }
    if (!refused) CHECK(toy_is_right(*store));
    ++(refused ? found_later : harmless);
  };
  for (size_t at = 0; at < 1200; ++at) flip(at, static_cast<int>(at % 8));  // header and schema, every byte
  for (size_t at = 1200, n = 0; at < whole.size(); at += 1009, ++n) flip(at, static_cast<int>(n % 8));
  // The rest of each database page's head, where the tree's own words are.
  for (size_t page = 8192; page < whole.size(); page += 8192) {
    for (size_t at = 0; at < 24; ++at) flip(page + at, static_cast<int>(at % 8));
  }
  MESSAGE("found by open ", found_by_open, ", by verify ", found_later, ", harmless ", harmless);
  CHECK(found_later > 100);
  CHECK(found_by_open > 50);
}

TEST_CASE("threads read one store at once") {
  const TemporaryFolder folder;
  build_toy(folder / "a.lod");
  const auto store = Store::open(folder / "a.lod");
  std::atomic<int> wrong{0};
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 4; ++t) {
      threads.emplace_back([&, t] {
        for (int round = 0; round < 50; ++round) {
          const int64_t id = (round * 7 + t * 11) % kToyPages;
          if (store->page(id % 3 == 0, id) != page_bytes(id)) ++wrong;
          if (store->array("nodes") != page_bytes(1003)) ++wrong;
        }
      });
    }
  }
  CHECK(wrong == 0);
}
