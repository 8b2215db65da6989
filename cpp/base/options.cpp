// SPDX-License-Identifier: MIT
#include "base/options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/errors.h"

namespace lodlab {
namespace {

std::string format_real(double value) {
  if (std::isnan(value)) return "nan";
  if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
  char buffer[32];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
  return std::string(buffer, end);
}

std::string json_text(const std::string& text) {
  using nlohmann::json;
  return json(text).dump(-1, ' ', false, json::error_handler_t::replace);
}

std::string show(const OptionValue& value) {
  struct Visitor {
    std::string operator()(bool v) const { return v ? "true" : "false"; }
    std::string operator()(int64_t v) const { return std::to_string(v); }
    std::string operator()(double v) const { return format_real(v); }
    std::string operator()(const std::string& v) const { return v; }
  };
  return std::visit(Visitor{}, value);
}

[[noreturn]] void refuse(const std::string& owner, const OptionSpec& spec, const OptionValue& value,
                         const std::string& wanted) {
  throw InvalidInput(owner + ": option " + spec.name + " = " + show(value) + " is not " + wanted);
}

std::string range_text(const OptionSpec& spec) {
  const bool low = std::isfinite(spec.minimum), high = std::isfinite(spec.maximum);
  if (low && high) return " from " + format_real(spec.minimum) + " to " + format_real(spec.maximum);
  if (low) return " of at least " + format_real(spec.minimum);
  if (high) return " of at most " + format_real(spec.maximum);
  return "";
}

template <class T>
bool parse_number(const std::string& text, T& out) {
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, out);
  return result.ec == std::errc() && result.ptr == end;
}

bool to_bool(const OptionValue& value, bool& out) {
  if (const bool* b = std::get_if<bool>(&value)) return out = *b, true;
  if (const auto* text = std::get_if<std::string>(&value)) {
    if (*text == "true" || *text == "false") return out = *text == "true", true;
  }
  return false;
}

bool to_integer(const OptionValue& value, int64_t& out) {
  if (const auto* i = std::get_if<int64_t>(&value)) return out = *i, true;
  if (const auto* d = std::get_if<double>(&value)) {
    if (*d != std::floor(*d) || std::abs(*d) > 9e15) return false;
    return out = static_cast<int64_t>(*d), true;
  }
  const auto* text = std::get_if<std::string>(&value);
  return text != nullptr && parse_number(*text, out);
}

bool to_real(const OptionValue& value, double& out) {
  if (const auto* i = std::get_if<int64_t>(&value)) return out = static_cast<double>(*i), true;
  if (const auto* d = std::get_if<double>(&value)) return out = *d, true;
  const auto* text = std::get_if<std::string>(&value);
  return text != nullptr && parse_number(*text, out);
}

OptionValue convert(const std::string& owner, const OptionSpec& spec, const OptionValue& value) {
  const std::string type = spec.type();
  if (type == "bool") {
    bool out = false;
    if (!to_bool(value, out)) refuse(owner, spec, value, "true or false");
    return out;
  }
  if (type == "int") {
    int64_t out = 0;
    if (!to_integer(value, out) || static_cast<double>(out) < spec.minimum ||
        static_cast<double>(out) > spec.maximum) {
      refuse(owner, spec, value, "a whole number" + range_text(spec));
    }
    return out;
  }
  if (type == "float") {
    double out = 0;
    if (!to_real(value, out) || !(out >= spec.minimum && out <= spec.maximum) || !std::isfinite(out)) {
      refuse(owner, spec, value, "a finite number" + range_text(spec));
    }
    return out;
  }
  const std::string out = show(value);
  if (type == "choice" && std::find(spec.choices.begin(), spec.choices.end(), out) == spec.choices.end()) {
    std::string wanted = "one of";
    for (const auto& choice : spec.choices) wanted += (wanted.size() > 6 ? ", " : " ") + choice;
    refuse(owner, spec, value, wanted);
  }
  return out;
}

template <class T>
const T& get(const std::map<std::string, OptionValue>& values, const std::string& name) {
  const auto found = values.find(name);
  if (found == values.end()) throw InvalidInput("options: no option '" + name + "'");
  return std::get<T>(found->second);
}

}  // namespace

std::string OptionSpec::type() const {
  static const char* const kNames[] = {"bool", "int", "float", "string"};
  if (meshes) return "meshes";
  return choices.empty() ? kNames[default_value.index()] : "choice";
}

bool Options::flag(const std::string& name) const { return get<bool>(values_, name); }
int64_t Options::integer(const std::string& name) const { return get<int64_t>(values_, name); }
double Options::real(const std::string& name) const { return get<double>(values_, name); }
const std::string& Options::text(const std::string& name) const { return get<std::string>(values_, name); }

const Meshes& Options::meshes(const std::string& name) const {
  const auto found = brought.find(name);
  if (found == brought.end() || found->second.empty())
    throw InvalidInput("options: the meshes that option " + name + " names have not come with it");
  return found->second;
}

std::string Options::to_json() const {
  std::string out = "{";
  for (const auto& [name, value] : values_) {
    if (out.size() > 1) out += ',';
    out += json_text(name) + ':';
    out += std::holds_alternative<std::string>(value) ? json_text(std::get<std::string>(value)) : show(value);
  }
  return out + '}';
}

Options resolve_options(const std::string& owner, const std::vector<OptionSpec>& table, Stage stage,
                        const std::map<std::string, OptionValue>& given) {
  Options out;
  for (const auto& spec : table) {
    if (spec.stage == stage) out.values_[spec.name] = spec.default_value;
  }
  for (const auto& [name, value] : given) {
    const auto spec = std::find_if(table.begin(), table.end(),
                                   [&](const OptionSpec& s) { return s.name == name && s.stage == stage; });
    if (spec == table.end()) {
      const bool other =
          std::any_of(table.begin(), table.end(), [&](const OptionSpec& s) { return s.name == name; });
      std::string known;
      for (const auto& [key, unused] : out.values_) known += (known.empty() ? "" : ", ") + key;
      throw InvalidInput(owner + ": unknown " + (stage == Stage::kBuild ? "build" : "draw") + " option '" +
                         name + "'" +
                         (!other                   ? ""
                          : stage == Stage::kBuild ? ", which is said when drawing"
                                                   : ", which is said when building: build a store with it") +
                         "; known: " + (known.empty() ? "none" : known));
    }
    out.values_[name] = convert(owner, *spec, value);
  }
  return out;
}

}  // namespace lodlab
