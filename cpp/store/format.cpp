// SPDX-License-Identifier: MIT
#include "store/format.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <charconv>
#include <memory>

namespace lodlab::store {
namespace {

std::string hex(uint64_t value) {
  std::string out(16, '0');
  for (int i = 15; i >= 0; --i, value >>= 4) out[i] = "0123456789abcdef"[value & 15];
  return out;
}

/// XXH3 in pieces. The state needs 64-byte alignment, which its own functions give.
class Hasher {
 public:
  Hasher() : state_(XXH3_createState(), &XXH3_freeState) { XXH3_128bits_reset(state_.get()); }
  void add(const void* data, size_t size) { XXH3_128bits_update(state_.get(), data, size); }
  void add(int64_t value) {  // little-endian on every machine
    unsigned char bytes[8];
    for (int i = 0; i < 8; ++i)
      bytes[i] = static_cast<unsigned char>(static_cast<uint64_t>(value) >> (8 * i));
    add(bytes, sizeof bytes);
  }
  void add(const std::string& text) {
    add(static_cast<int64_t>(text.size()));
    add(text.data(), text.size());
  }
  std::string digest() const {
    const XXH128_hash_t value = XXH3_128bits_digest(state_.get());
    return hex(value.high64) + hex(value.low64);
  }

 private:
  std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state_;
};

}  // namespace

std::string digest_of(std::span<const std::byte> bytes) {
  Hasher hasher;
  hasher.add(bytes.data(), bytes.size());
  return hasher.digest();
}

uint64_t checksum(std::span<const std::byte> bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

uint64_t checksum(const std::string& key, const std::string& value) {
  std::string row = key;
  row += '\0';
  row += value;
  return XXH3_64bits(row.data(), row.size());
}

std::string seal(const std::map<std::string, std::string>& meta) {
  Hasher hasher;
  for (const auto& [key, value] : meta) {
    if (key == "seal") continue;
    hasher.add(key);
    hasher.add(value);
  }
  return hasher.digest();
}

std::string content_hash(const std::map<std::string, ArrayHead>& arrays, const std::vector<PageHead>& pages) {
  Hasher hasher;
  for (const auto& [name, head] : arrays) {
    hasher.add(name);
    hasher.add(head.size);
    hasher.add(static_cast<int64_t>(head.checksum));
  }
  for (const PageHead& page : pages) {
    hasher.add(page.kind);
    hasher.add(page.id);
    hasher.add(page.size);
    hasher.add(static_cast<int64_t>(page.checksum));
  }
  return hasher.digest();
}

std::string seconds_text(double seconds) {
  char buffer[64];
  return {buffer, std::to_chars(buffer, buffer + sizeof buffer, seconds, std::chars_format::fixed, 6).ptr};
}

double seconds_of(const std::string& text) {
  double value = 0.0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

std::string page_name(int64_t kind, int64_t id) {
  return "page " + std::to_string(id) + " of kind " + std::to_string(kind);
}

}  // namespace lodlab::store
