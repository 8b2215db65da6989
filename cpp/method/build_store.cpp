// SPDX-License-Identifier: MIT
// Building a store with a method: what is checked before, what is written around the method's own build; and
// the check of budgets, the same for all methods.
#include <algorithm>
#include <charconv>
#include <string_view>

#include "base/errors.h"
#include "geometry/height_field.h"
#include "geometry/mesh_census.h"
#include "method/method.h"

namespace lodlab {
namespace {

std::string join(const std::vector<std::string>& words) {
  std::string out;
  for (const auto& word : words) out += (out.empty() ? "" : ", ") + word;
  return out;
}

bool lists(const std::vector<std::string>& words, std::string_view word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

std::string show(double value) {
  char buffer[32];
  return {buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr};
}

void check_accepts(const MethodInfo& info, const Source& source) {
  const std::string kind = source.kind();
  if (!lists(info.accepts, kind)) {
    throw Unsupported("build: method " + info.name + " does not accept a " + kind + "; it accepts " +
                      join(info.accepts));
  }
  if (!info.by_rows && dynamic_cast<const FieldSource*>(&source) != nullptr)
    field_in_memory(source, "build: method " + info.name);
  if (const std::string fault = lacking(info, source); !fault.empty()) throw InvalidInput("build: " + fault);
}

}  // namespace

std::string name_of(Needs needs) {
  constexpr const char* kNames[] = {"", "manifold", "closed", "genus 0"};
  return kNames[static_cast<size_t>(needs)];
}

std::string lacking(const MethodInfo& info, const Source& source) {
  const auto* mesh = dynamic_cast<const Mesh*>(&source);
  if (mesh == nullptr || info.needs == Needs::kAnything) return {};
  const MeshCensus census = surface_census(*mesh);
  const std::string method = "method " + info.name;
  if (const std::string faults = manifold_faults(census); !faults.empty())
    return method + " needs an oriented manifold: " + faults;
  if (info.needs >= Needs::kClosed && census.boundary_edges > 0) {
    return method + " needs a closed mesh: this one has " + std::to_string(census.boundary_edges) +
           " edges of one triangle";
  }
  if (info.needs >= Needs::kGenusZero && census.genus != 0)
    return method + " needs a mesh of genus 0: the genus is " + std::to_string(*census.genus);
  return {};
}

std::shared_ptr<const Store> build_store(const Source& source, const Method& method,
                                         const std::map<std::string, OptionValue>& options,
                                         const std::string& path, BuildMode mode, const Progress& progress,
                                         std::map<std::string, Meshes> brought) {
  const MethodInfo& info = method.info();
  check_accepts(info, source);
  Options resolved = resolve_options(info.name, info.options, Stage::kBuild, options);
  resolved.brought = std::move(brought);
  const StoreMeta meta{info.name, resolved.to_json(), source.hash(), source.spec, source.frame()};
  {
    StoreWriter writer(path, meta, mode);
    method.build(source, resolved, writer, [&](const std::string& stage, double share) {
      writer.note_progress(stage, share);
      if (progress) progress(stage, share);
    });
    writer.commit();
  }
  return Store::open(path);
}

void check_budget(const MethodInfo& info, const Budget& budget) {
  const auto check = [&](const char* name, bool positive, const std::string& value) {
    if (!positive) throw InvalidInput("budget: " + std::string(name) + " = " + value + " is not positive");
  };
  // "not greater than 0" is true of NaN too.
  if (budget.pixel_error) check("pixel_error", *budget.pixel_error > 0.0, show(*budget.pixel_error));
  if (budget.triangles) check("triangles", *budget.triangles > 0, std::to_string(*budget.triangles));
  if (budget.nodes) check("nodes", *budget.nodes > 0, std::to_string(*budget.nodes));
  if (info.budgets.empty()) return;
  const auto listed = [&](const char* name, bool given) {
    if (given && !lists(info.budgets, name)) {
      throw Unsupported("budget: method " + info.name + " knows no " + name + "; it knows " +
                        join(info.budgets));
    }
  };
  listed("pixel_error", budget.pixel_error.has_value());
  listed("triangles", budget.triangles.has_value());
  listed("nodes", budget.nodes.has_value());
  if (!budget.pixel_error && !budget.triangles && !budget.nodes) {
    throw InvalidInput("budget: none is set; method " + info.name + " needs at least one of " +
                       join(info.budgets));
  }
}

}  // namespace lodlab
