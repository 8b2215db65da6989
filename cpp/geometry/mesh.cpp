// SPDX-License-Identifier: MIT
#include "geometry/mesh.h"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/errors.h"
#include "base/hasher.h"

namespace lodlab {
namespace {

[[noreturn]] void refuse(const std::string& what) { throw InvalidInput("mesh: " + what); }

void check_sizes(const MeshArrays& m) {
  if (m.faces.empty()) refuse("it has no triangles");
  if (static_cast<int64_t>(m.faces.size()) > kMostFaces) {
    refuse(std::to_string(m.faces.size()) + " triangles; at most " + std::to_string(kMostFaces) +
           " are possible");
  }
  const auto check = [&](const char* what, size_t count) {
    if (count == 0 || count == m.positions.size()) return;
    refuse(std::to_string(count) + ' ' + what + " for " + std::to_string(m.positions.size()) + " vertices");
  };
  check("colours", m.colors.size());
  check("normals", m.normals.size());
}

void check_face(const MeshArrays& m, size_t face) {
  for (const uint32_t vertex : m.faces[face]) {
    if (vertex < m.positions.size()) continue;
    refuse("triangle " + std::to_string(face) + " names vertex " + std::to_string(vertex) + " of " +
           std::to_string(m.positions.size()));
  }
}

void check_position(const glm::dvec3& p, size_t vertex) {
  for (int i = 0; i < 3; ++i) {
    if (std::abs(p[i]) <= kFarthestVertex) continue;  // not true of NaN
    char text[160];
    std::snprintf(text, sizeof text, "vertex %zu at (%.9g, %.9g, %.9g) is not finite and within %g", vertex,
                  p.x, p.y, p.z, kFarthestVertex);
    refuse(text);
  }
}

template <class T>
void add(Hasher& hasher, std::span<const T> values) {
  const uint64_t count = values.size();
  hasher.add(&count, sizeof count);
  hasher.add(values.data(), values.size_bytes());
}

std::array<double, 3> as_array(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

}  // namespace

std::string Mesh::hash() const {
  Hasher hasher;
  add(hasher, positions);
  add(hasher, faces);
  add(hasher, colors);
  add(hasher, normals);
  return hasher.text();
}

std::string Mesh::frame() const {
  return nlohmann::ordered_json{{"kind", kind()},         {"vertices", positions.size()},
                                {"faces", faces.size()},  {"lo", as_array(box.lo)},
                                {"hi", as_array(box.hi)}, {"colors", !colors.empty()},
                                {"in_floats", in_floats}}
      .dump();
}

std::shared_ptr<const Mesh> make_mesh(MeshArrays arrays, std::string spec) {
  auto mesh = std::make_shared<Mesh>();
  static_cast<MeshArrays&>(*mesh) = std::move(arrays);
  check_sizes(*mesh);
  mesh->in_floats = true;
  for (size_t i = 0; i < mesh->positions.size(); ++i) {
    const glm::dvec3& p = mesh->positions[i];
    check_position(p, i);
    mesh->in_floats = mesh->in_floats && glm::dvec3(glm::vec3(p)) == p;
  }
  for (size_t i = 0; i < mesh->faces.size(); ++i) {
    check_face(*mesh, i);
    for (const uint32_t vertex : mesh->faces[i]) mesh->box.add(mesh->positions[vertex]);
  }
  mesh->spec = std::move(spec);
  return mesh;
}

MeshFrame mesh_frame_from_json(const std::string& text) {
  try {
    const auto json = nlohmann::json::parse(text);
    MeshFrame f;
    json.at("vertices").get_to(f.vertices);
    json.at("faces").get_to(f.faces);
    const auto lo = json.at("lo").get<std::array<double, 3>>();
    const auto hi = json.at("hi").get<std::array<double, 3>>();
    f.box.add({lo[0], lo[1], lo[2]});
    f.box.add({hi[0], hi[1], hi[2]});
    json.at("in_floats").get_to(f.in_floats);
    return f;
  } catch (const nlohmann::json::exception& error) {
    throw InvalidInput(std::string("frame of a mesh: ") + error.what());
  }
}

}  // namespace lodlab
