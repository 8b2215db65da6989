// SPDX-License-Identifier: MIT
#include "store/format.h"

#include <charconv>

#include "base/hasher.h"

namespace lodlab::store {
namespace {

void add(Hasher& hasher, int64_t value) {  // little-endian on every machine
  unsigned char bytes[8];
  for (int i = 0; i < 8; ++i) bytes[i] = static_cast<unsigned char>(static_cast<uint64_t>(value) >> (8 * i));
  hasher.add(bytes, sizeof bytes);
}

void add(Hasher& hasher, const std::string& text) {
  add(hasher, static_cast<int64_t>(text.size()));
  hasher.add(text.data(), text.size());
}

}  // namespace

std::string digest_of(std::span<const std::byte> bytes) {
  Hasher hasher;
  hasher.add(bytes.data(), bytes.size());
  return hasher.text();
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
    add(hasher, key);
    add(hasher, value);
  }
  return hasher.text();
}

std::string content_hash(const std::map<std::string, ArrayHead>& arrays, const std::vector<PageHead>& pages) {
  Hasher hasher;
  for (const auto& [name, head] : arrays) {
    add(hasher, name);
    add(hasher, head.size);
    add(hasher, static_cast<int64_t>(head.checksum));
  }
  for (const PageHead& page : pages) {
    add(hasher, page.kind);
    add(hasher, page.id);
    add(hasher, page.size);
    add(hasher, static_cast<int64_t>(page.checksum));
  }
  return hasher.text();
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
