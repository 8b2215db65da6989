// SPDX-License-Identifier: MIT
// Frames of height fields: positions, checks, hash, and the JSON text that stores keep.
#include "geometry/height_field.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/errors.h"
#include "base/hasher.h"
#include "base/parallel.h"
#include "geometry/angles.h"
#include "geometry/bounds.h"
#include "geometry/coverage.h"
#include "geometry/height_check.h"

namespace lodlab {
namespace {

constexpr int64_t kMaxSamples = int64_t{1} << 31;
constexpr double kAngleSlack = 1e-6;  // degrees; geotransforms carry the rounding of their decimals

std::string number(double value) {
  char buffer[32];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
  return {buffer, end};
}

[[noreturn]] void refuse(const std::string& what) { throw InvalidInput("height field: " + what); }

// Drawing computes in 32-bit floats: sizes stay where their products neither overflow nor vanish.
constexpr double kLeastLength = 1e-30, kMostLength = 1e30, kMostExtent = 1e36;
constexpr float kMostHeight = 1e36f;
constexpr double kMostSteps = 0x1p50;  // from the origin of coordinates: doubles still part the samples

/// Refuses a length that is not within kLeastLength to kMostLength.
void check_length(const char* what, double value) {
  if (!(value > 0.0) || !std::isfinite(value)) refuse(what + (" " + number(value)) + " is not positive");
  if (value < kLeastLength || value > kMostLength) {
    refuse(what + (" " + number(value)) + " is not within 1e-30 to 1e+30");
  }
}

/// Refuses an axis that floats cannot hold, or that lies where doubles do not part its samples.
void check_axis(double origin, double spacing, int64_t samples) {
  const double extent = spacing * static_cast<double>(samples - 1);
  if (extent > kMostExtent) refuse("extent " + number(extent) + " is more than 1e+36");
  if (std::abs(origin) > kMostSteps * spacing) {
    refuse("origin " + number(origin) + " is more than 2^50 times the spacing " + number(spacing) +
           " from 0: samples would fall together");
  }
}

void check_grid(const FieldFrame& f) {
  const std::string size = std::to_string(f.rows) + " x " + std::to_string(f.cols);
  if (f.rows < 2 || f.cols < 2) refuse(size + " samples; at least 2 x 2 are needed");
  if (f.rows > kMaxSamples / f.cols) refuse(size + " samples are more than 2^31");
  for (const double value : {f.dx, f.dy}) check_length("spacing", value);
  if (!std::isfinite(f.x0) || !std::isfinite(f.y0)) {
    refuse("origin (" + number(f.x0) + ", " + number(f.y0) + ") is not finite");
  }
  check_axis(f.x0, f.dx, f.cols);
  check_axis(f.y0, f.dy, f.rows);
  if (!(f.height_step >= 0.0) || !std::isfinite(f.height_step)) {
    refuse("height step " + number(f.height_step) + " is not 0 or more");
  }
}

/// Beside a pole columns come together: nearer than this, seen from the centre, methods cannot part them.
constexpr double kLeastAngle = 0x1p-34;  // radians; 0.4 mm on the Earth

void check_parted(const FieldFrame& f, int64_t row) {
  const double angle = std::cos(f.latitude(row) * kRadiansPerDegree) * f.dlon * kRadiansPerDegree;
  if (std::abs(f.latitude(row)) == 90.0 || angle >= kLeastAngle) return;
  refuse("planet samples of row " + std::to_string(row) + " are " + number(angle * f.radius) +
         " apart, and those of " + number(kLeastAngle * f.radius) +
         " at least can be told from each other: beside a pole leave the row out, or take fewer columns");
}

void check_planet(const FieldFrame& f) {
  check_length("planet radius", f.radius);
  if (!(f.dlon > 0.0) || !(f.dlat > 0.0) || !std::isfinite(f.lon0) || !std::isfinite(f.dlon)) {
    refuse("planet steps of " + number(f.dlon) + " x " + number(f.dlat) + " degrees are not positive");
  }
  if (f.dlon > 120.0 + kAngleSlack || f.dlat > 90.0 + kAngleSlack) {  // those of the coarsest globe
    refuse("planet steps of " + number(f.dlon) + " x " + number(f.dlat) +
           " degrees: triangles that go so far round show their insides; the limit is 120 x 90");
  }
  const double south = f.lat0 - f.dlat * static_cast<double>(f.rows - 1);
  if (!(f.lat0 <= 90.0 + kAngleSlack) || !(south >= -90.0 - kAngleSlack)) {
    refuse("planet latitudes " + number(f.lat0) + " to " + number(south) + " leave -90 to 90 degrees");
  }
  const double steps = static_cast<double>(f.wraps ? f.cols : f.cols - 1);
  if (steps * f.dlon > 360.0 + kAngleSlack) {
    refuse("planet columns span " + number(steps * f.dlon) + " degrees; the limit is 360");
  }
  if (f.rows < 3 && f.lat0 >= 90.0 - kAngleSlack && south <= -90.0 + kAngleSlack) {
    refuse("a planet from pole to pole needs at least 3 rows: two are its poles alone");
  }
  if (f.wraps && f.cols < 3) refuse("a planet that wraps needs at least 3 columns");
  if (f.wraps && std::abs(steps * f.dlon - 360.0) > kAngleSlack) {
    refuse("a planet that wraps spans 360 degrees, not " + number(steps * f.dlon));
  }
  for (const int64_t row : {int64_t{0}, int64_t{1}, f.rows - 2, f.rows - 1}) check_parted(f, row);
}

/// The members of a frame's JSON, flat, doubles in the shortest form that reads back the same bits; hashed,
/// so that their text may not change.
std::string members_of(const FieldFrame& f) {
  std::string out = "\"rows\":" + std::to_string(f.rows) + ",\"cols\":" + std::to_string(f.cols);
  const auto real = [&out](const char* key, double value) {
    out += std::string(",\"") + key + "\":" + number(value);
  };
  const auto flag = [&out](const char* key, bool value) {
    out += std::string(",\"") + key + "\":" + (value ? "true" : "false");
  };
  real("dx", f.dx);
  real("dy", f.dy);
  real("x0", f.x0);
  real("y0", f.y0);
  flag("planet", f.planet);
  real("radius", f.radius);
  real("lon0", f.lon0);
  real("lat0", f.lat0);
  real("dlon", f.dlon);
  real("dlat", f.dlat);
  flag("wraps", f.wraps);
  real("z_min", f.z_min);
  real("z_max", f.z_max);
  real("height_step", f.height_step);
  return out;
}

}  // namespace

glm::dvec2 cos_sin_degrees(double degrees) {
  const double turn = std::remainder(degrees, 360.0);  // exact
  const double quarter = std::nearbyint(turn / 90.0);
  const double rest = (turn - quarter * 90.0) * kRadiansPerDegree;  // the difference is exact too
  const double c = std::cos(rest), s = std::sin(rest);
  switch ((static_cast<int>(quarter) + 4) % 4) {
    case 0:
      return {c, s};
    case 1:
      return {-s, c};
    case 2:
      return {-c, -s};
    default:
      return {s, -c};
  }
}

double FieldFrame::longitude(int64_t col) const {
  if (wraps) col = ((col % cols) + cols) % cols;
  return lon0 + static_cast<double>(col) * dlon;
}

double FieldFrame::latitude(int64_t row) const {
  const double degrees = lat0 - static_cast<double>(row) * dlat;
  return std::abs(std::abs(degrees) - 90.0) <= kAngleSlack ? std::copysign(90.0, degrees) : degrees;
}

glm::dvec3 FieldFrame::direction(int64_t row, int64_t col) const {
  const glm::dvec2 lat = cos_sin_degrees(latitude(row));
  const glm::dvec2 lon = cos_sin_degrees(longitude(col));
  return {lat.x * lon.x + 0.0, lat.x * lon.y + 0.0, lat.y};
}

/// A planet smaller than 1e-26 has fewer steps: shaders may not know floats below the least normal one.
double FieldFrame::position_step() const {
  if (!planet) return 0.0;
  return std::max(std::ldexp(1.0, std::ilogb(radius + z_max) + 1 - kPositionBits),
                  static_cast<double>(std::numeric_limits<float>::min()));
}

glm::dvec3 FieldFrame::position(int64_t row, int64_t col, double height) const {
  if (planet) return (radius + height) * direction(row, col);
  return {x0 + static_cast<double>(col) * dx, y0 - static_cast<double>(row) * dy, height};
}

double FieldFrame::reach(const glm::dvec3& eye) const {
  if (planet) return glm::length(eye) + radius + std::max(0.0, z_max);
  Box box;
  box.add(position(0, 0, z_min));
  box.add(position(rows - 1, cols - 1, z_max));
  return lodlab::reach(box, eye);
}

void check_frame(const FieldFrame& frame) {
  check_grid(frame);
  if (frame.planet) check_planet(frame);
  if (frame.wraps && !frame.planet) refuse("only a planet wraps");
}

void widen(HeightRange& range, const FieldFrame& f, const float* heights, int64_t first_row, int64_t rows) {
  std::mutex mutex;
  int64_t bad = rows * f.cols;
  parallel_for(rows * f.cols, int64_t{1} << 20, [&](int64_t begin, int64_t end) {
    float lo = heights[begin], hi = heights[begin];
    int64_t first = rows * f.cols;
    for (int64_t i = begin; i < end; ++i) {
      if (!(std::abs(heights[i]) <= kMostHeight)) {
        first = i;
        break;
      }
      lo = std::min(lo, heights[i]);
      hi = std::max(hi, heights[i]);
    }
    const std::lock_guard lock(mutex);
    bad = std::min(bad, first);
    range.lo = std::min<double>(range.lo, lo);
    range.hi = std::max<double>(range.hi, hi);
  });
  if (bad < rows * f.cols) {
    refuse("height " + number(heights[bad]) + " at row " + std::to_string(first_row + bad / f.cols) +
           ", column " + std::to_string(bad % f.cols) +
           (std::isfinite(heights[bad]) ? " is not within 1e+36 of 0" : " is not finite"));
  }
}

void set_range(FieldFrame& frame, const HeightRange& range) {
  frame.z_min = range.lo;
  frame.z_max = range.hi;
  if (frame.planet && frame.radius + range.lo <= 0.0) {
    refuse("lowest height " + number(range.lo) + " reaches the centre of a planet of radius " +
           number(frame.radius));
  }
}

struct HeightHash::State {
  Hasher heights, mask;
};

HeightHash::HeightHash() : state_(std::make_unique<State>()) {}

HeightHash::~HeightHash() = default;

void HeightHash::add(const float* heights, int64_t count) {
  state_->heights.add(heights, static_cast<size_t>(count) * sizeof(float));
}

void HeightHash::add_mask(const uint8_t* valid, int64_t count) {
  state_->mask.add(valid, static_cast<size_t>(count));
}

std::string HeightHash::finish(const FieldFrame& frame, bool masked) const {
  Hasher all = state_->heights;
  if (masked) {
    const XXH128_hash_t mask = state_->mask.value();
    const uint64_t halves[2] = {mask.low64, mask.high64};
    all.add(halves, sizeof halves);
  }
  const std::string text_of_frame = '{' + members_of(frame) + '}';
  all.add(text_of_frame.data(), text_of_frame.size());
  return all.text();
}

std::string HeightField::hash() const {
  HeightHash hash;
  hash.add(heights, rows * cols);
  if (valid != nullptr) hash.add_mask(valid, rows * cols);
  return hash.finish(*this, valid != nullptr);
}

std::shared_ptr<const HeightField> make_height_field(const FieldFrame& frame, const float* heights,
                                                     const uint8_t* valid, std::shared_ptr<const void> owner,
                                                     std::string spec) {
  check_frame(frame);
  auto field = std::make_shared<HeightField>();
  static_cast<FieldFrame&>(*field) = frame;
  HeightRange range;
  widen(range, frame, heights, 0, frame.rows);
  set_range(*field, range);
  const int64_t samples = frame.rows * frame.cols;
  const bool any_void = valid != nullptr && std::find(valid, valid + samples, uint8_t{0}) != valid + samples;
  field->heights = heights;
  field->valid = any_void ? valid : nullptr;
  field->owner = std::move(owner);
  field->spec = std::move(spec);
  return field;
}

std::vector<std::byte> HeightField::coverage() const { return coverage_bits(*this); }

std::string FieldSource::frame() const { return "{\"kind\":\"" + kind() + "\"," + members_of(*this) + '}'; }

const FieldSource& heights_of(const Source& source, const std::string& operation) {
  if (const auto* field = dynamic_cast<const FieldSource*>(&source)) return *field;
  throw Unsupported(operation + " needs heights; a " + source.kind() + " has none");
}

const HeightField& field_in_memory(const Source& source, const std::string& operation) {
  const FieldSource& field = heights_of(source, operation);
  if (const HeightField* whole = field.whole()) return *whole;
  throw Unsupported(operation + " needs the source in memory; its " + std::to_string(field.rows) + " x " +
                    std::to_string(field.cols) + " samples are read by windows");
}

FieldFrame frame_from_json(const std::string& text) {
  try {
    const auto json = nlohmann::json::parse(text);
    FieldFrame f;
    json.at("rows").get_to(f.rows);
    json.at("cols").get_to(f.cols);
    json.at("dx").get_to(f.dx);
    json.at("dy").get_to(f.dy);
    json.at("x0").get_to(f.x0);
    json.at("y0").get_to(f.y0);
    json.at("planet").get_to(f.planet);
    json.at("radius").get_to(f.radius);
    json.at("lon0").get_to(f.lon0);
    json.at("lat0").get_to(f.lat0);
    json.at("dlon").get_to(f.dlon);
    json.at("dlat").get_to(f.dlat);
    json.at("wraps").get_to(f.wraps);
    json.at("z_min").get_to(f.z_min);
    json.at("z_max").get_to(f.z_max);
    json.at("height_step").get_to(f.height_step);
    return f;
  } catch (const nlohmann::json::exception& error) {
    throw InvalidInput(std::string("frame of a height field: ") + error.what());
  }
}

}  // namespace lodlab
