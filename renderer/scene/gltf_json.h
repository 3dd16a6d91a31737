// SPDX-License-Identifier: Apache-2.0
// Typed reading of JSON with a pointer for every value, so that each problem of a file names its place.
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "renderer/core/error.h"

namespace braid::gltf {

// "No index": an optional reference that is absent or was reported as a problem.
inline constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
// Sizes and offsets above 2^53 cannot be written exactly in JSON.
inline constexpr uint64_t kMaxWhole = uint64_t(1) << 53;

// Collects problems (the file must be refused) and warnings (it can be rendered). Not thread-safe: parallel work fills
// one report per item and appends them in order.
class Report {
 public:
  void problem(const std::string& place, const std::string& text);
  // The same text is one warning however often it occurs.
  void warn(const std::string& place, const std::string& text, uint64_t count = 1);
  void append(const Report& other);

  bool broken() const { return problemCount_ > 0; }
  size_t problemCount() const { return problemCount_; }
  void throwIfBroken(const std::string& file) const;
  std::vector<std::string> warningLines() const;

 private:
  struct Warning {
    std::string text, firstPlace;
    uint64_t count = 0;
  };
  std::vector<Problem> problems_;
  std::map<std::pair<std::string, std::string>, bool> seen_;
  size_t problemCount_ = 0;
  std::vector<Warning> warnings_;
  std::map<std::string, size_t> warningIndex_;
};

// A JSON value, or the absence of one, together with its pointer. Readers return a fallback for absent values and
// report wrong types.
class JsonRef {
 public:
  JsonRef(const nlohmann::json* value, std::string pointer, Report* report)
      : value_(value), pointer_(std::move(pointer)), report_(report) {}

  explicit operator bool() const { return value_ != nullptr; }
  const std::string& pointer() const { return pointer_; }
  void problem(const std::string& text) const { report_->problem(pointer_, text); }
  void warn(const std::string& text) const { report_->warn(pointer_, text); }

  JsonRef operator[](const char* key) const;
  JsonRef operator[](const std::string& key) const { return (*this)[key.c_str()]; }
  JsonRef at(size_t index) const;
  JsonRef extension(const char* name) const { return (*this)["extensions"][name]; }
  // Reports a missing value; `why` says what to write.
  const JsonRef& required(const char* why) const;

  bool isObject() const;
  size_t size() const;                    // entries of an array, 0 if absent
  std::vector<std::string> keys() const;  // of an object

  bool boolean(bool fallback) const;
  std::string text(const std::string& fallback = {}) const;
  float real(float fallback) const;
  // Values outside [low, high] are clamped with a warning.
  float clamped(float fallback, float low, float high) const;
  uint64_t whole(uint64_t fallback, uint64_t maximum = kMaxWhole) const;
  // An index into an array of `count` entries called `what`.
  uint32_t index(size_t count, const char* what) const;
  std::vector<uint32_t> indices(size_t count, const char* what) const;
  // Exactly `count` numbers; returns whether they were there and right.
  bool reals(float* out, size_t count) const;
  bool reals(double* out, size_t count) const;
  std::vector<float> realList() const;
  std::vector<std::string> textList() const;

 private:
  double number(double fallback) const;

  const nlohmann::json* value_;
  std::string pointer_;
  Report* report_;
};

// "1 vertex", "2 vertices": counts in messages.
std::string counted(uint64_t count, const char* one, const char* many);
// Shortens and quotes text of unknown origin so that a message stays on one line.
std::string quoted(const std::string& text);

}  // namespace braid::gltf
