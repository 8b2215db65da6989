// SPDX-License-Identifier: MIT
// What the tests of seamless share: fields, stores of them, heights of vertices.
#pragma once

#include <cmath>
#include <map>
#include <memory>
#include <random>
#include <string>

#include "methods/seamless/hierarchy.h"
#include "methods/seamless/seamless.h"
#include "store_fixture.h"
#include "synthetic.h"

namespace lodlab {
const Method& seamless_method();
}

namespace lodlab::seamless {

using OptionValues = std::map<std::string, OptionValue>;
using Field = std::shared_ptr<const HeightField>;

struct Opened {
  Field field;
  std::shared_ptr<const Hierarchy> hierarchy;
  std::string content_hash;
};

/// The store of a field, in memory or read by rows; what is opened has no field where it was read by rows.
inline Opened open(const std::shared_ptr<const FieldSource>& source, const OptionValues& options) {
  const testing::TemporaryFolder folder;
  const auto store = build_store(*source, seamless_method(), options, folder / "a.lod", BuildMode::kNew, {});
  auto hierarchy = std::dynamic_pointer_cast<const Hierarchy>(seamless_method().open(store));
  return {std::dynamic_pointer_cast<const HeightField>(source), std::move(hierarchy), store->content_hash()};
}

inline OptionValues shape(int64_t patch, int64_t resolutions) {
  return {{"patch", patch}, {"resolutions", resolutions}};
}

/// The same samples, read by rows.
inline std::shared_ptr<const WindowedField> windowed(const Field& field, int64_t at_once = kSamplesAtOnce) {
  const ReadRows read = [field](int64_t first, int64_t rows, float* heights, uint8_t* valid) {
    std::copy_n(field->heights + first * field->cols, rows * field->cols, heights);
    if (valid == nullptr) return;
    for (int64_t i = 0; i < rows * field->cols; ++i)
      valid[i] = field->valid == nullptr ? 1 : field->valid[first * field->cols + i];
  };
  return make_windowed_field(*field, read, "", {}, at_once);
}

/// Hills with a step and spikes.
inline synthetic::Height rough(unsigned seed, double scale = 1.0) {
  return [seed, scale](int64_t row, int64_t col) {
    std::mt19937 random(static_cast<unsigned>(seed * 7919u + row * 104729u + col * 1299709u));
    random.discard(3);
    const double noise = static_cast<double>(random() % 1000) / 1000.0;
    const double r = static_cast<double>(row), c = static_cast<double>(col);
    const double spike = random() % 397 == 0 ? 400.0 : 0.0;
    return scale * (300.0 + 90.0 * std::sin(0.11 * r + 0.3 * seed) * std::cos(0.07 * c) + 5.0 * noise +
                    spike + (col > 30 ? 60.0 : 0.0));
  };
}

inline Field flat(int64_t rows, int64_t cols, unsigned seed, double scale = 1.0) {
  return synthetic::field(synthetic::flat(rows, cols, 10.0), rough(seed, scale));
}

}  // namespace lodlab::seamless
