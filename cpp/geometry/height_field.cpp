// SPDX-License-Identifier: MIT
// Frames of height fields: positions, checks, hash, and the JSON text that stores keep.
// The text is flat JSON with doubles in the shortest form that reads back the same bits.
#include "geometry/height_field.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <limits>
#include <mutex>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/angles.h"
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

/// Reads flat JSON objects of numbers and booleans, which is all that frames are.
class FlatJson {
 public:
  explicit FlatJson(const std::string& text) : text_(text) {}

  std::string_view value(const char* key) const {
    const std::string quoted = '"' + std::string(key) + "\":";
    const size_t at = text_.find(quoted);
    if (at == std::string::npos) fail(std::string("no \"") + key + '"');
    const size_t begin = at + quoted.size();
    const size_t end = text_.find_first_of(",}", begin);
    if (end == std::string::npos) fail("it is cut short");
    return std::string_view(text_).substr(begin, end - begin);
  }
  template <class T>
  T number_of(const char* key) const {
    const std::string_view text = value(key);
    T out{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
    if (error != std::errc() || end != text.data() + text.size()) {
      fail('"' + std::string(key) + "\" is not a number: " + std::string(text));
    }
    return out;
  }
  bool flag(const char* key) const {
    const std::string_view text = value(key);
    if (text != "true" && text != "false") fail('"' + std::string(key) + "\" is not true or false");
    return text == "true";
  }

 private:
  [[noreturn]] void fail(const std::string& why) const {
    throw InvalidInput("frame of a height field: " + why);
  }
  const std::string& text_;
};

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
  const glm::dvec3 first = position(0, 0, z_min), last = position(rows - 1, cols - 1, z_max);
  return glm::length(glm::max(glm::abs(first - eye), glm::abs(last - eye)));
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
  XXH3_state_t heights, mask;
};

HeightHash::HeightHash() : state_(std::make_unique<State>()) {
  XXH3_128bits_reset(&state_->heights);
  XXH3_128bits_reset(&state_->mask);
}

HeightHash::~HeightHash() = default;

void HeightHash::add(const float* heights, int64_t count) {
  XXH3_128bits_update(&state_->heights, heights, static_cast<size_t>(count) * sizeof(float));
}

void HeightHash::add_mask(const uint8_t* valid, int64_t count) {
  XXH3_128bits_update(&state_->mask, valid, static_cast<size_t>(count));
}

std::string HeightHash::finish(const FieldFrame& frame, bool masked) const {
  XXH3_state_t state = state_->heights;
  if (masked) {
    const XXH128_hash_t mask = XXH3_128bits_digest(&state_->mask);
    const uint64_t halves[2] = {mask.low64, mask.high64};
    XXH3_128bits_update(&state, halves, sizeof halves);
  }
  const std::string text_of_frame = frame_to_json(frame);
  XXH3_128bits_update(&state, text_of_frame.data(), text_of_frame.size());
  const XXH128_hash_t digest = XXH3_128bits_digest(&state);
  char text[33];
  std::snprintf(text, sizeof text, "%016llx%016llx", static_cast<unsigned long long>(digest.high64),
                static_cast<unsigned long long>(digest.low64));
  return text;
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

std::string frame_to_json(const FieldFrame& f) {
  std::string out = "{\"rows\":" + std::to_string(f.rows) + ",\"cols\":" + std::to_string(f.cols);
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
  return out + '}';
}

FieldFrame frame_from_json(const std::string& text) {
  const FlatJson json(text);
  FieldFrame f;
  f.rows = json.number_of<int64_t>("rows");
  f.cols = json.number_of<int64_t>("cols");
  f.dx = json.number_of<double>("dx");
  f.dy = json.number_of<double>("dy");
  f.x0 = json.number_of<double>("x0");
  f.y0 = json.number_of<double>("y0");
  f.planet = json.flag("planet");
  f.radius = json.number_of<double>("radius");
  f.lon0 = json.number_of<double>("lon0");
  f.lat0 = json.number_of<double>("lat0");
  f.dlon = json.number_of<double>("dlon");
  f.dlat = json.number_of<double>("dlat");
  f.wraps = json.flag("wraps");
  f.z_min = json.number_of<double>("z_min");
  f.z_max = json.number_of<double>("z_max");
  f.height_step = json.number_of<double>("height_step");
  return f;
}

}  // namespace lodlab
