// SPDX-License-Identifier: MIT
// Option tables: what a method can be told, with type, default, range, unit and one sentence each.
// Bindings, command line, sweeps and reports read these tables and know no method by name.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <variant>
#include <vector>

namespace lodlab {

struct Mesh;

enum class Stage { kBuild, kDraw };

/// Meshes that a user brings by an option.
using Meshes = std::vector<std::shared_ptr<const Mesh>>;
using OptionValue = std::variant<bool, int64_t, double, std::string>;

struct OptionSpec {
  std::string name;
  OptionValue default_value;  ///< its alternative is the option's type
  Stage stage = Stage::kBuild;
  std::string unit;
  std::string help;                  ///< one sentence
  std::vector<std::string> choices;  ///< for strings that are one of a few; empty: free text
  double minimum = -std::numeric_limits<double>::infinity();
  double maximum = std::numeric_limits<double>::infinity();
  bool meshes = false;  ///< of a string that is not the default: it names meshes, which come beside it

  /// "bool", "int", "float", "choice", "meshes" or "string".
  std::string type() const;
};

/// Validated values, one for each option of a table.
class Options {
 public:
  bool flag(const std::string& name) const;
  int64_t integer(const std::string& name) const;
  double real(const std::string& name) const;
  const std::string& text(const std::string& name) const;
  const std::map<std::string, OptionValue>& values() const { return values_; }
  /// The meshes that an option names; InvalidInput where they have not come with it.
  const Meshes& meshes(const std::string& name) const;
  /// Those that have come, by option.
  std::map<std::string, Meshes> brought;

  /// Compact JSON, keys sorted; floats in the shortest form that reads back the same.
  std::string to_json() const;

 private:
  friend Options resolve_options(const std::string&, const std::vector<OptionSpec>&, Stage,
                                 const std::map<std::string, OptionValue>&);
  std::map<std::string, OptionValue> values_;
};

/// The values of the table's options of one stage: those given, checked, and the defaults of the rest.
/// Accepts an int for a float, text for any type (as from a command line), a bool for a choice that
/// has "true" or "false". Throws InvalidInput for an unknown name (listing the known), a wrong type,
/// a value out of range. `owner` names the method in messages.
Options resolve_options(const std::string& owner, const std::vector<OptionSpec>& table, Stage stage,
                        const std::map<std::string, OptionValue>& given);

}  // namespace lodlab
