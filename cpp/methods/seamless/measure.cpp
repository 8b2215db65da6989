// SPDX-License-Identifier: MIT
// Every triangle is scanned row by row, in 32-bit floats about the height of its first vertex: between its
// long side and the vertex across, so that no value is larger than the triangle's own range of heights.
//
// A patch that is whole is symmetric: turned so that an edge lies in row 0, its four edges have the same
// triangles. So four of them are measured at once, one in each lane of a vector. What is clamped, or larger
// than a share, is measured one by one.
#include "methods/seamless/measure.h"

#include <algorithm>
#include <atomic>
#include <cmath>

namespace lodlab::seamless {
namespace {

typedef float Four __attribute__((vector_size(16)));

/// What rounding in 32 bits can take: not more than 24 half steps of a triangle's range of heights, and two
/// of the distance itself.
constexpr float kOfRange = 0x1p-19f, kOfDistance = 0x1p-20f;

float absolute(float v) { return std::abs(v); }
Four absolute(const Four& v) { return v < 0.0f ? -v : v; }
float larger(float a, float b) { return a > b ? a : b; }
Four larger(const Four& a, const Four& b) { return a > b ? a : b; }

/// Whole part of a linear function of the row.
class Walk {
 public:
  /// x + steps * dx / dy, rounded down; dy > 0.
  Walk(int64_t x, int64_t dx, int64_t dy, int64_t steps) : dy_(dy) {
    if (dx == 0 || dx == dy || dx == -dy) {  // most sides are
      slope_ = dx == 0 ? 0 : dx == dy ? 1 : -1;
      at_ = x + slope_ * steps;
      return;
    }
    slope_ = floor_of(dx);
    more_ = dx - slope_ * dy;
    const int64_t whole = floor_of(steps * more_);
    rest_ = steps * more_ - whole * dy;
    at_ = x + steps * slope_ + whole;
  }
  int64_t at() const { return at_; }
  void step() {
    at_ += slope_;
    rest_ += more_;
    if (rest_ >= dy_) {
      rest_ -= dy_;
      ++at_;
    }
  }

 private:
  int64_t floor_of(int64_t n) const { return n >= 0 ? n / dy_ : -((-n + dy_ - 1) / dy_); }

  int64_t dy_, slope_ = 0, more_ = 0, rest_ = 0, at_ = 0;
};

template <class Lanes>
struct Point {
  int64_t x, y;
  Lanes z;
};

/// What a piece has come to so far.
template <class Lanes>
struct Worst {
  Lanes distance{}, range{};
};

void scan_row(const float* z, int64_t count, float middle, float start, float slope, float& worst) {
  float most = worst;
#pragma omp simd reduction(max : most)
  for (int i = 0; i < static_cast<int>(count); ++i) {
    const float d = std::abs((z[i] - middle) - (start + slope * static_cast<float>(i)));
    most = most > d ? most : d;
  }
  worst = most;
}

void scan_row(const Four* z, int64_t count, const Four& middle, const Four& start, const Four& slope,
              Four& worst) {
  float x = 0.0f;
  for (int64_t i = 0; i < count; ++i, x += 1.0f)
    worst = larger(worst, absolute((z[i] - middle) - (start + slope * x)));
}

/// Samples of a triangle in rows [first, end), its sides included. `row(y)` points to column 0.
template <class Lanes, class Row>
void scan(Point<Lanes> a, Point<Lanes> b, Point<Lanes> c, int64_t first, int64_t end, const Row& row,
          Worst<Lanes>& worst) {
  if (b.y < a.y) std::swap(a, b);
  if (c.y < b.y) std::swap(b, c);
  if (b.y < a.y) std::swap(a, b);
  const int64_t height = c.y - a.y, y0 = std::max(a.y, first), y1 = std::min(c.y, end - 1);
  if (y0 > y1) return;
  // The side from a to c, and b across it.
  const int64_t area = (b.x - a.x) * height - (c.x - a.x) * (b.y - a.y);
  if (area == 0) return;
  const double part = 1.0 / static_cast<double>(height);
  const double across = static_cast<double>(area) * part, down = static_cast<double>(c.x - a.x) * part;
  const Lanes fall = c.z - a.z;
  const Lanes slope = ((b.z - a.z) - fall * static_cast<float>(static_cast<double>(b.y - a.y) * part)) *
                      static_cast<float>(1.0 / across);
  worst.range = larger(worst.range, larger(absolute(fall), absolute(b.z - a.z)));
  const int64_t sign = area > 0 ? 1 : -1;  // 1: b is to the right
  // The left side is walked mirrored: rounded down there is rounded up here.
  const auto scan_part = [&](const Point<Lanes>& from, int64_t dx, int64_t dy, int64_t low, int64_t high) {
    Walk near(-sign * a.x, -sign * (c.x - a.x), height, low - a.y);
    Walk far(sign * from.x, sign * dx, dy, low - from.y);
    for (int64_t y = low; y < high; ++y, near.step(), far.step()) {
      const int64_t left = area > 0 ? -near.at() : -far.at(), right = area > 0 ? far.at() : near.at();
      if (left > right) continue;
      const auto steps = static_cast<double>(y - a.y);
      const Lanes start = fall * static_cast<float>(steps * part) +
                          slope * static_cast<float>(static_cast<double>(left - a.x) - steps * down);
      scan_row(row(y) + left, right - left + 1, a.z, start, slope, worst.distance);
    }
  };
  if (y0 < b.y) scan_part(a, b.x - a.x, b.y - a.y, y0, std::min(b.y, y1 + 1));
  if (y1 >= b.y) scan_part(b, c.x - b.x, std::max<int64_t>(c.y - b.y, 1), std::max(y0, b.y), y1 + 1);
}

}  // namespace

struct Measurer::Scratch {
  Scratch(const Layout& layout_of, const PatchMesh& mesh_of, const Pyramid& pyramid_of)
      : layout(layout_of), mesh(mesh_of), pyramid(pyramid_of) {}

  const Layout& layout;
  const PatchMesh& mesh;
  const Pyramid& pyramid;
  std::vector<float> heights[3];  ///< of the lattice, by resolution; the last one's unless they are averages
  std::vector<int64_t> row, col;  ///< samples of the lattice's lines
  std::vector<Four> samples;      ///< turned, an edge a lane

  int shift(int k) const { return pyramid.averaged() ? layout.resolutions - 1 - k : 0; }
  float height(int k, int u, int v) const {
    const int by = shift(k), side = (layout.segments() >> by) + 1;
    const auto& z = heights[pyramid.averaged() ? k : layout.resolutions - 1];
    return z[static_cast<size_t>((v >> by) * side + (u >> by))];
  }

  void prepare(const HeightRows& rows, const Patch& p, int least) {
    const int finest = layout.resolutions - 1, points = layout.segments() + 1;
    for (int k = pyramid.averaged() ? least : finest; k <= finest; ++k) {
      const int side = (layout.segments() >> shift(k)) + 1;
      heights[k].resize(static_cast<size_t>(side * side));
      pyramid.fill(rows, layout, p, k, heights[k].data());
    }
    row.resize(static_cast<size_t>(points));
    col.resize(static_cast<size_t>(points));
    for (int i = 0; i < points; ++i) {
      row[static_cast<size_t>(i)] = layout.sample_row(p, i);
      col[static_cast<size_t>(i)] = layout.sample_col(p, i);
    }
  }

  Worst<float> measure_piece(const HeightRows& rows, const Share& share,
                             const std::vector<Triangle>& piece) const {
    Worst<float> worst;
    const auto at = [&](const Vertex& v) {
      return Point<float>{col[static_cast<size_t>(v.u)], row[static_cast<size_t>(v.v)],
                          height(v.resolution, v.u, v.v)};
    };
    for (const Triangle& t : piece)
      scan(
          at(t[0]), at(t[1]), at(t[2]), share.first, share.end, [&](int64_t y) { return rows.row(y); },
          worst);
    return worst;
  }

  /// The four sides of a whole patch: samples by their place along an edge and their distance from it, as
  /// far as the middle.
  void turn(const HeightRows& rows, const Patch& p) {
    const int64_t side = int64_t{1} << layout.side_log2(p.level), pitch = rows.cols;
    samples.resize(static_cast<size_t>((side / 2 + 1) * (side + 1)));
    const float* origin = rows.row(layout.row(p)) + layout.col(p);
    for (int64_t y = 0; y <= side / 2; ++y) {
      const float *n = origin + y * pitch, *e = origin + side - y, *s = origin + (side - y) * pitch;
      const float* w = origin + y;
      Four* out = samples.data() + y * (side + 1);
      for (int64_t x = y; x <= side - y; ++x)
        out[x] = Four{n[side - x], e[(side - x) * pitch], s[x], w[x * pitch]};
    }
  }

  /// A piece of the south side, and those like it on the others.
  Worst<Four> measure_four(const Patch& p, const std::vector<Triangle>& piece) const {
    const int m = layout.segments(), log2 = layout.stride_log2(p.level);
    const int64_t side = int64_t{1} << layout.side_log2(p.level);
    Worst<Four> worst;
    const auto at = [&](const Vertex& v) {
      const int x = v.u, y = m - v.v, k = v.resolution;
      return Point<Four>{
          int64_t{x} << log2, int64_t{y} << log2,
          Four{height(k, m - x, y), height(k, m - y, m - x), height(k, x, m - y), height(k, y, x)}};
    };
    for (const Triangle& t : piece)
      scan(
          at(t[0]), at(t[1]), at(t[2]), 0, side + 1,
          [&](int64_t y) { return samples.data() + y * (side + 1); }, worst);
    return worst;
  }
};

namespace {

/// Calls visit(piece) for what is drawn beside an edge at a resolution.
template <class Visit>
void for_pieces(const PatchMesh& mesh, Edge e, int k, const Visit& visit) {
  visit(mesh.tile(e, k));
  for (int diagonal = k; diagonal < mesh.resolutions(); ++diagonal) {
    visit(mesh.half(e, Side::kStart, k, diagonal));
    visit(mesh.half(e, Side::kEnd, k, diagonal));
  }
}

void raise(float& value, float to) {
  std::atomic_ref<float> shared(value);
  float known = shared.load();
  while (known < to && !shared.compare_exchange_weak(known, to)) {
  }
}

float rounded(float distance, float range) { return distance * (1.0f + kOfDistance) + range * kOfRange; }

}  // namespace

Measurer::Measurer(const Layout& layout, const PatchMesh& mesh, const Pyramid& pyramid)
    : scratch_(std::make_unique<Scratch>(layout, mesh, pyramid)) {}

Measurer::~Measurer() = default;

void Measurer::measure(const HeightRows& rows, const Share& share, int least, int end, PatchErrors& out) {
  Scratch& s = *scratch_;
  const Patch& p = share.patch;
  const int64_t id = s.layout.id(p), side = int64_t{1} << s.layout.side_log2(p.level);
  const int64_t last_row = s.layout.row(p) + side, last_col = s.layout.col(p) + side;
  s.prepare(rows, p, least);
  const bool whole = last_row <= s.layout.last_row() && last_col <= s.layout.last_col() &&
                     share.first == s.layout.row(p) && share.end == last_row + 1;
  if (whole) s.turn(rows, p);
  for (int k = least; k < end; ++k) {
    if (whole) {
      for_pieces(s.mesh, kSouth, k, [&](const std::vector<Triangle>& piece) {
        const Worst<Four> worst = s.measure_four(p, piece);
        for (const Edge e : {kNorth, kEast, kSouth, kWest})
          raise(out.at(id, e, k), rounded(worst.distance[e], worst.range[e]));
      });
      continue;
    }
    for (const Edge e : {kNorth, kEast, kSouth, kWest}) {
      for_pieces(s.mesh, e, k, [&](const std::vector<Triangle>& piece) {
        const Worst<float> worst = s.measure_piece(rows, share, piece);
        raise(out.at(id, e, k), rounded(worst.distance, worst.range));
      });
    }
  }
}

}  // namespace lodlab::seamless
