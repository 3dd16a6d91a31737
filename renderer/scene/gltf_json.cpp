// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf_json.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include <nlohmann/json.hpp>

namespace braid::gltf {

namespace {

// A hostile file could break every rule a million times; past this many lines nobody reads on.
constexpr size_t kMaxListedProblems = 200;

std::string escapedKey(const char* key) {
  std::string out;
  for (; *key; ++key) {
    if (*key == '~') {
      out += "~0";
    } else if (*key == '/') {
      out += "~1";
    } else {
      out += static_cast<unsigned char>(*key) < 0x20 ? '?' : *key;
    }
  }
  return out;
}

std::string brief(const nlohmann::json& value) {
  if (value.is_object()) return "an object";
  if (value.is_array()) return "an array";
  if (value.is_string()) return "the text " + quoted(value.get_ref<const std::string&>());
  if (value.is_null()) return "null";
  return value.dump();
}

std::string shortReal(float value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", static_cast<double>(value));
  return text;
}

}  // namespace

std::string counted(uint64_t count, const char* one, const char* many) {
  return std::to_string(count) + ' ' + (count == 1 ? one : many);
}

std::string quoted(const std::string& text) {
  constexpr size_t kLongest = 120;
  std::string out = "'";
  for (size_t i = 0; i < std::min(text.size(), kLongest); ++i) {
    out += static_cast<unsigned char>(text[i]) < 0x20 ? '?' : text[i];
  }
  return out + (text.size() > kLongest ? "…'" : "'");
}

void Report::problem(const std::string& place, const std::string& text) {
  if (problems_.size() < kMaxListedProblems) {
    if (!seen_.emplace(std::make_pair(place, text), true).second) return;
    problems_.push_back({place, text});
  }
  ++problemCount_;
}

void Report::warn(const std::string& place, const std::string& text, uint64_t count) {
  const auto [entry, isNew] = warningIndex_.emplace(text, warnings_.size());
  if (isNew) warnings_.push_back({text, place, 0});
  warnings_[entry->second].count += count;
}

void Report::append(const Report& other) {
  for (const Problem& p : other.problems_) problem(p.place, p.text);
  for (const Warning& w : other.warnings_) warn(w.firstPlace, w.text, w.count);
}

void Report::throwIfBroken(const std::string& file) const {
  if (!broken()) return;
  std::vector<Problem> list = problems_;
  if (problemCount_ > list.size()) {
    list.push_back({"", "and " + counted(problemCount_ - list.size(), "more problem", "more problems")});
  }
  throw SceneError(ExitCode::BadInput, file, std::move(list));
}

std::vector<std::string> Report::warningLines() const {
  std::vector<std::string> lines;
  for (const Warning& w : warnings_) {
    std::string line = w.firstPlace.empty() ? "" : w.firstPlace + ": ";
    line += w.text;
    if (w.count > 1) line += " (" + std::to_string(w.count) + " times)";
    lines.push_back(std::move(line));
  }
  return lines;
}

JsonRef JsonRef::operator[](const char* key) const {
  std::string place = pointer_ + '/' + escapedKey(key);
  if (!value_) return {nullptr, std::move(place), report_};
  if (!value_->is_object()) {
    problem("is " + brief(*value_) + "; it must be an object");
    return {nullptr, std::move(place), report_};
  }
  const auto found = value_->find(key);
  return {found == value_->end() ? nullptr : &*found, std::move(place), report_};
}

JsonRef JsonRef::at(size_t index) const {
  const bool there = value_ && value_->is_array() && index < value_->size();
  return {there ? &(*value_)[index] : nullptr, pointer_ + '/' + std::to_string(index), report_};
}

const JsonRef& JsonRef::required(const char* why) const {
  if (!value_) problem(std::string("is missing; ") + why);
  return *this;
}

bool JsonRef::isObject() const {
  if (!value_) return false;
  if (!value_->is_object()) problem("is " + brief(*value_) + "; it must be an object");
  return value_->is_object();
}

size_t JsonRef::size() const {
  if (!value_) return 0;
  if (value_->is_array()) return value_->size();
  problem("is " + brief(*value_) + "; it must be an array");
  return 0;
}

std::vector<std::string> JsonRef::keys() const {
  std::vector<std::string> names;
  if (!isObject()) return names;
  for (auto it = value_->begin(); it != value_->end(); ++it) names.push_back(it.key());
  return names;
}

bool JsonRef::boolean(bool fallback) const {
  if (!value_) return fallback;
  if (value_->is_boolean()) return value_->get<bool>();
  problem("is " + brief(*value_) + "; it must be true or false");
  return fallback;
}

std::string JsonRef::text(const std::string& fallback) const {
  if (!value_) return fallback;
  if (value_->is_string()) return value_->get<std::string>();
  problem("is " + brief(*value_) + "; it must be text in quotes");
  return fallback;
}

double JsonRef::number(double fallback) const {
  if (!value_) return fallback;
  if (!value_->is_number()) {
    problem("is " + brief(*value_) + "; it must be a number");
    return fallback;
  }
  const double value = value_->get<double>();
  if (std::abs(value) <= static_cast<double>(std::numeric_limits<float>::max())) return value;
  problem("is " + brief(*value_) + ", too large for a 32-bit float; write a smaller number");
  return fallback;
}

float JsonRef::real(float fallback) const { return static_cast<float>(number(static_cast<double>(fallback))); }

float JsonRef::clamped(float fallback, float low, float high) const {
  const float value = real(fallback);
  const float result = std::clamp(value, low, high);
  if (result != value) warn("is " + shortReal(value) + ", outside its range; " + shortReal(result) + " is used");
  return result;
}

uint64_t JsonRef::whole(uint64_t fallback, uint64_t maximum) const {
  if (!value_) return fallback;
  const double value = value_->is_number() ? value_->get<double>() : -1;
  // Some exporters write 3.0 for 3: any integral number is accepted.
  if (value >= 0 && value <= static_cast<double>(maximum) && value == std::floor(value))
    return static_cast<uint64_t>(value);
  problem("is " + brief(*value_) + "; it must be a whole number from 0 to " + std::to_string(maximum));
  return fallback;
}

uint32_t JsonRef::index(size_t count, const char* what) const {
  if (!value_) return kNone;
  const double value = value_->is_number() ? value_->get<double>() : -1;
  if (value >= 0 && value < static_cast<double>(count) && value == std::floor(value))
    return static_cast<uint32_t>(value);
  const std::string last =
      count == 0 ? "the file has no " + std::string(what) : what + (" end at " + std::to_string(count - 1));
  problem("is " + brief(*value_) + ", but " + last + "; refer to one that exists");
  return kNone;
}

std::vector<uint32_t> JsonRef::indices(size_t count, const char* what) const {
  std::vector<uint32_t> list;
  const size_t entries = size();
  list.reserve(entries);
  for (size_t i = 0; i < entries; ++i) {
    const uint32_t entry = at(i).index(count, what);
    if (entry != kNone) list.push_back(entry);
  }
  return list;
}

bool JsonRef::reals(double* out, size_t count) const {
  if (!value_) return false;
  if (!value_->is_array() || value_->size() != count) {
    const std::string actual = value_->is_array() ? std::to_string(value_->size()) + " entries" : brief(*value_);
    problem("is " + actual + "; it must be an array of " + std::to_string(count) + " numbers");
    return false;
  }
  const size_t before = report_->problemCount();
  std::vector<double> values(count);
  for (size_t i = 0; i < count; ++i) values[i] = at(i).number(0);
  if (report_->problemCount() != before) return false;
  std::copy(values.begin(), values.end(), out);
  return true;
}

bool JsonRef::reals(float* out, size_t count) const {
  std::vector<double> values(count);
  if (!reals(values.data(), count)) return false;
  std::transform(values.begin(), values.end(), out, [](double v) { return static_cast<float>(v); });
  return true;
}

std::vector<float> JsonRef::realList() const {
  std::vector<float> list(size());
  if (!list.empty() && !reals(list.data(), list.size())) list.clear();
  return list;
}

std::vector<std::string> JsonRef::textList() const {
  std::vector<std::string> list;
  const size_t entries = size();
  for (size_t i = 0; i < entries; ++i) list.push_back(at(i).text());
  return list;
}

}  // namespace braid::gltf
