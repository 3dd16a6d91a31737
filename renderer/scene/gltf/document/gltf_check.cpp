// SPDX-License-Identifier: Apache-2.0
// JSON against the table of gltf_schema.cpp.
#include <algorithm>
#include <cmath>
#include <optional>
#include <variant>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "renderer/scene/gltf/document/gltf_schema.h"

namespace braid::gltf {

namespace {

using Json = nlohmann::json;

std::string escapedKey(std::string_view key) {
  std::string out;
  for (const char c : key) {
    if (c == '~') {
      out += "~0";
    } else if (c == '/') {
      out += "~1";
    } else {
      out += static_cast<unsigned char>(c) < 0x20 ? '?' : c;
    }
  }
  return out;
}

std::string brief(const Json& value) {
  if (value.is_object()) return "an object";
  if (value.is_array()) return "an array";
  if (value.is_string()) return "the text " + quoted(value.get_ref<const std::string&>());
  return value.dump();
}

std::string_view without(const Field& field, bool replaced) {
  if (field.meanwhile) return field.meanwhile;
  if (replaced) return "what it belongs to is left out";
  return field.mend ? "its object is left out" : "it is taken as absent";
}

class Checker {
 public:
  Checker(Json& root, Report& report) : report_(report) {
    for (const Field& f : rootShape()) count(root, f.name, f.name);
    if (!root.contains("extensions") || !root["extensions"].is_object()) return;
    struct OfExtension {
      const char *extension, *array, *name;
    };
    for (const auto& [extension, array, name] : {OfExtension{"KHR_lights_punctual", "lights", "lights"},
                                                 OfExtension{"EXT_lights_image_based", "lights", "image-based lights"},
                                                 OfExtension{"KHR_materials_variants", "variants", "variants"}}) {
      const auto found = root["extensions"].find(extension);
      if (found != root["extensions"].end()) count(*found, array, name);
    }
  }

  // Returns false if the object lacks a member that it cannot do without.
  bool object(Json& value, std::span<const Field> shape) {
    for (auto it = value.begin(); it != value.end();) {
      const bool known = std::any_of(shape.begin(), shape.end(), [&](const Field& f) { return it.key() == f.name; });
      it = known ? std::next(it) : value.erase(it);
    }
    for (const Field& field : shape) {
      const auto found = value.find(field.name);
      if (found == value.end()) {
        if (!field.mend && !field.fallback) continue;
        if (field.mend)
          at(field.name, [&] { problem(std::string("is missing; ") + field.mend, without(field, field.fallback)); });
        if (!field.fallback) return false;
        value[field.name] = Json::parse(field.fallback);
        continue;
      }
      bool good = false;
      const char* const instead = field.fallback ? field.fallback : field.ifWrong;
      at(field.name, [&] { good = member(*found, field); });
      if (good) continue;
      if (instead) {
        *found = Json::parse(instead);
      } else {
        value.erase(found);
        if (field.mend) return false;
      }
    }
    return true;
  }

 private:
  using Step = std::variant<std::string_view, size_t>;

  void count(const Json& parent, const char* array, const char* name) {
    const auto found = parent.is_object() ? parent.find(array) : parent.end();
    counts_[name] = parent.is_object() && found != parent.end() && found->is_array() ? found->size() : 0;
  }

  std::string pointer() const {
    std::string text;
    for (const Step& step : path_) {
      text += '/';
      text += step.index() == 0 ? escapedKey(std::get<0>(step)) : std::to_string(std::get<1>(step));
    }
    return text;
  }

  template <class Run>
  void at(Step step, const Run& run) {
    path_.push_back(step);
    run();
    path_.pop_back();
  }

  bool problem(const std::string& text, std::string_view meanwhile) {
    report_.problem(pointer(), text, std::string(meanwhile));
    return false;
  }

  bool wrong(const Json& value, const std::string& right, const Field& field) {
    return problem("is " + brief(value) + "; it must be " + right, without(field, field.fallback || field.ifWrong));
  }

  // Returns whether the value, mended where that is possible, can be used.
  bool member(Json& value, const Field& field) {
    switch (field.kind) {
      case Kind::Bool:
        return value.is_boolean() || wrong(value, "true or false", field);
      case Kind::Text:
        return value.is_string() || wrong(value, "text in quotes", field);
      case Kind::Texts:
        return list(value, field,
                    [&](Json& entry) { return entry.is_string() || wrong(entry, "text in quotes", field); });
      case Kind::Word:
        return word(value, field);
      case Kind::Real:
        return real(value, field) && clamp(value, field);
      case Kind::Reals:
      case Kind::Colour:
        return reals(value, field);
      case Kind::Whole:
        return whole(value, field);
      case Kind::Index:
        return index(value, field);
      case Kind::Indices:
        return indices(value, field);
      case Kind::RealRows:
      case Kind::IndexRows:
        return list(value, field, [&](Json& row) {
          if (!(field.kind == Kind::RealRows ? reals(row, field) : indices(row, field))) row = Json::array();
          return true;
        });
      case Kind::Map:
        return map(value, field);
      case Kind::Object:
        return isObject(value, field) && object(value, field.shape);
      case Kind::List:
        return list(value, field, [&](Json& entry) {
          if (field.of) return map(entry, field);
          if (!isObject(entry, field)) entry = Json::object();
          if (const auto samplers = entry.find("samplers"); samplers != entry.end())
            counts_["samplers of this animation"] = samplers->is_array() ? samplers->size() : 0;
          if (!object(entry, field.shape)) entry = Json::object();
          return true;
        });
    }
    return false;
  }

  // Joints keep their places: -1 stands for a node that does not exist.
  bool indices(Json& value, const Field& field) {
    if (field.count != 0 && value.is_array() && value.size() != field.count)
      return problem(fmt::format("is {} entries; it must be an array of {} indices", value.size(), field.count),
                     without(field, false));
    return list(value, field, [&](Json& entry) {
      if (!index(entry, field)) entry = -1;
      return true;
    });
  }

  bool isObject(const Json& value, const Field& field) { return value.is_object() || wrong(value, "an object", field); }

  // Entries that cannot be used become empty: the others keep their places.
  template <class Check>
  bool list(Json& value, const Field& field, const Check& check) {
    if (!value.is_array()) return wrong(value, "an array", field);
    for (size_t i = 0; i < value.size(); ++i) {
      at(i, [&] {
        if (!check(value[i])) value[i] = field.kind == Kind::Texts ? Json("") : Json::object();
      });
    }
    return true;
  }

  bool word(const Json& value, const Field& field) {
    if (!value.is_string()) return wrong(value, "text in quotes", field);
    const std::string& text = value.get_ref<const std::string&>();
    const std::string words = std::string(", ") + field.of + ", ";
    if (!text.empty() && words.find(", " + text + ", ") != std::string::npos) return true;
    return problem("is " + quoted(text) + "; it must be one of " + field.of, without(field, field.fallback));
  }

  bool real(Json& value, const Field& field) {
    if (!value.is_number()) return wrong(value, "a number", field);
    // Integers too become doubles: tinygltf holds those of extensions in 32 bits.
    const double number = value.get<double>();
    constexpr double kMost = std::numeric_limits<float>::max();
    if (std::abs(number) > kMost) {
      problem("is " + brief(value) + ", too large for a 32-bit float; write a smaller number",
              "the largest one is used");
    }
    value = std::clamp(number, -kMost, kMost);
    return true;
  }

  bool clamp(Json& value, const Field& field) {
    const double number = value.get<double>(), result = std::clamp(number, field.low, field.high);
    if (result != number)
      report_.warn(pointer(), fmt::format("is {:g}, outside its range; {:g} is used", number, result));
    value = result;
    return true;
  }

  bool reals(Json& value, const Field& field) {
    if (!value.is_array() || (field.count != 0 && value.size() != field.count)) {
      const std::string actual = value.is_array() ? std::to_string(value.size()) + " entries" : brief(value);
      return problem("is " + actual + "; it must be an array of " +
                         (field.count != 0 ? std::to_string(field.count) + " numbers" : "numbers"),
                     without(field, false));
    }
    bool good = true, clamped = false;
    for (size_t i = 0; i < value.size(); ++i) {
      at(i, [&] { good = real(value[i], field) && good; });
      if (!good) return false;
      const double number = value[i].get<double>(), result = std::clamp(number, field.low, field.high);
      clamped = clamped || result != number;
      value[i] = result;
    }
    if (clamped) report_.warn(pointer(), "a colour factor lies outside its range; it is clamped");
    return true;
  }

  // Some exporters write 3.0 for 3: any integral number is accepted.
  static std::optional<uint64_t> integral(const Json& value, double most) {
    const double number = value.is_number() ? value.get<double>() : -1;
    if (!(number >= 0 && number <= most && number == std::floor(number))) return {};
    return static_cast<uint64_t>(number);
  }

  bool whole(Json& value, const Field& field) {
    const std::optional<uint64_t> number = integral(value, field.high);
    if (!number)
      return wrong(value, fmt::format("a whole number from 0 to {}", static_cast<uint64_t>(field.high)), field);
    value = *number;
    if (!field.of || isNamed(*number, field.of)) return true;
    return problem("is " + std::to_string(*number) + "; it must be " + field.of, without(field, field.fallback));
  }

  static bool isNamed(uint64_t number, std::string_view numbers) {
    const std::string digits = std::to_string(number);
    const auto isDigit = [&](size_t i) {
      return i < numbers.size() && std::isdigit(static_cast<unsigned char>(numbers[i]));
    };
    for (size_t at = numbers.find(digits); at != std::string_view::npos; at = numbers.find(digits, at + 1)) {
      if (!isDigit(at - 1) && !isDigit(at + digits.size())) return true;
    }
    return false;
  }

  bool index(Json& value, const Field& field) {
    const size_t size = counts_[field.of];
    if (const std::optional<uint64_t> number = integral(value, double(size) - 1)) {
      value = *number;
      return true;
    }
    const std::string last =
        size == 0 ? "the file has no " + std::string(field.of) : field.of + (" end at " + std::to_string(size - 1));
    return problem("is " + brief(value) + ", but " + last + "; refer to one that exists",
                   without(field, field.fallback || field.ifWrong));
  }

  // Names to indices, or to ids of any value.
  bool map(Json& value, const Field& field) {
    if (!isObject(value, field)) return false;
    const Field id{.name = field.name, .kind = Kind::Whole, .high = 65535};
    for (auto it = value.begin(); it != value.end();) {
      bool good = false;
      at(std::string_view(it.key()), [&] { good = field.of ? index(*it, field) : whole(*it, id); });
      it = good ? std::next(it) : value.erase(it);
    }
    return true;
  }

  Report& report_;
  std::vector<Step> path_;
  std::map<std::string, size_t, std::less<>> counts_;
};

}  // namespace

void checkJson(Json& root, Report& report) { Checker(root, report).object(root, rootShape()); }

}  // namespace braid::gltf
