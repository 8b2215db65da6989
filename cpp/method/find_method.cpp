// SPDX-License-Identifier: MIT
// Looking methods up by name, and adding one for a test.
#include <algorithm>

#include "base/errors.h"
#include "method/method.h"
#include "method/registry.h"

namespace lodlab {
namespace {

std::vector<const Method*>& all_methods() {
  static std::vector<const Method*> all = built_in_methods();
  return all;
}

}  // namespace

const std::vector<const Method*>& methods() { return all_methods(); }

const Method& find_method(const std::string& name) {
  std::string known;
  for (const Method* method : all_methods()) {
    if (method->info().name == name) return *method;
    known += (known.empty() ? "" : ", ") + method->info().name;
  }
  throw InvalidInput("method: unknown method '" + name + "'; known: " + known);
}

void register_method(const Method* method) {
  const std::string& name = method->info().name;
  const auto same = [&](const Method* other) { return other->info().name == name; };
  if (std::any_of(all_methods().begin(), all_methods().end(), same)) {
    throw InvalidInput("register_method: there is a method '" + name + "' already");
  }
  all_methods().push_back(method);
}

}  // namespace lodlab
