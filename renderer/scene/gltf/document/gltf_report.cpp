// SPDX-License-Identifier: Apache-2.0
#include "renderer/scene/gltf/document/gltf_report.h"

#include <algorithm>
#include <array>
#include <cctype>

namespace braid::gltf {

namespace {

// A hostile file could break every rule a million times; past this many lines nobody reads on.
constexpr size_t kMostListed = 200;
// And past this many places the rest is only counted.
constexpr size_t kMostFlaws = 20000;

// A text without its numbers and quotations: flaws that differ in nothing else are of one kind.
std::string kindOf(const std::string& text) {
  std::string kind;
  bool inQuotes = false;
  for (const char c : text) {
    if (c == '\'') inQuotes = !inQuotes;
    if (!inQuotes && !std::isdigit(static_cast<unsigned char>(c))) kind += c;
  }
  return kind;
}

// The array and index that a place such as /meshes/3/primitives/0 begins with; index -1: none.
std::pair<std::string, int> objectOf(const std::string& place) {
  constexpr std::string_view kLights = "/extensions/KHR_lights_punctual",
                             kImages = "/extensions/EXT_lights_image_based";
  const bool ofImages = place.starts_with(kImages);
  const size_t start = place.starts_with(kLights) ? kLights.size() + 1 : ofImages ? kImages.size() + 1 : 1;
  const size_t end = place.find('/', start);
  if (end == std::string::npos || end + 1 >= place.size()) return {"", -1};
  int index = 0;
  size_t at = end + 1;
  for (; at < place.size() && std::isdigit(static_cast<unsigned char>(place[at])) && index < 100'000'000; ++at)
    index = index * 10 + (place[at] - '0');
  if (at == end + 1 || (at < place.size() && place[at] != '/')) return {"", -1};
  return {ofImages ? "image-based lights" : place.substr(start, end - start), index};
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

bool Usage::mark(const std::string& array, int index) {
  if (index < 0) return false;
  std::vector<bool>& used = used_[array];
  const auto i = static_cast<size_t>(index);
  if (i >= used.size()) used.resize(std::max(i + 1, used.size() * 2));
  const bool isNew = !used[i];
  used[i] = true;
  return isNew;
}

bool Usage::covers(const std::string& place) const {
  static constexpr std::array kArrays{
      "accessors", "animations", "bufferViews", "buffers", "cameras", "image-based lights",
      "images",    "lights",     "materials",   "meshes",  "nodes",   "samplers",
      "scenes",    "skins",      "textures"};
  const auto [array, index] = objectOf(place);
  if (index < 0 || std::find(kArrays.begin(), kArrays.end(), array) == kArrays.end()) return true;
  const auto found = used_.find(array);
  return found != used_.end() && static_cast<size_t>(index) < found->second.size() &&
         found->second[static_cast<size_t>(index)];
}

void Report::add(Flaw flaw) {
  const auto [entry, isNew] = index_.emplace(std::make_pair(flaw.place, flaw.text), flaws_.size());
  if (!isNew) {
    if (!flaw.isProblem) flaws_[entry->second].count += flaw.count;
    return;
  }
  if (flaw.isProblem) ++problemCount_;
  if (flaws_.size() < kMostFlaws) {
    flaws_.push_back(std::move(flaw));
  } else {
    index_.erase(entry);
  }
}

void Report::problem(const std::string& place, const std::string& text, const std::string& meanwhile) {
  add({place, text, meanwhile, 1, true});
}

void Report::warn(const std::string& place, const std::string& text, uint64_t count) {
  add({place, text, {}, count, false});
}

void Report::append(const Report& other) {
  for (const Flaw& f : other.flaws_) add(f);
}

void Report::throwIfBroken(const std::string& file, const Usage* usage) const {
  std::vector<Problem> list;
  for (const Flaw& f : flaws_) {
    if (f.isProblem && list.size() < kMostListed && (!usage || usage->covers(f.place)))
      list.push_back({f.place, f.text});
  }
  if (list.empty()) return;
  if (!usage && problemCount_ > list.size())
    list.push_back({"", "and " + counted(problemCount_ - list.size(), "more problem", "more problems")});
  throw SceneError(ExitCode::BadInput, file, std::move(list));
}

std::vector<std::string> Report::lines(const Usage& usage, bool used) const {
  struct Row {
    const Flaw* first;
    uint64_t count = 0;
  };
  std::vector<Row> kinds;
  std::map<std::string, size_t> index;
  for (const Flaw& f : flaws_) {
    if (usage.covers(f.place) != used) continue;
    const auto [entry, isNew] = index.emplace(kindOf(f.place + f.text), kinds.size());
    if (isNew && kinds.size() >= kMostListed) {
      index.erase(entry);
      continue;
    }
    if (isNew) kinds.push_back({&f});
    kinds[entry->second].count += f.count;
  }
  std::vector<std::string> out;
  for (const Row& kind : kinds) {
    std::string line = kind.first->place.empty() ? "" : kind.first->place + ": ";
    line += kind.first->text;
    if (!kind.first->meanwhile.empty()) line += "; meanwhile " + kind.first->meanwhile;
    if (kind.count > 1) line += " (" + std::to_string(kind.count) + " times)";
    out.push_back(printable(std::move(line)));  // names of members stand in places as the file has them
  }
  return out;
}

}  // namespace braid::gltf
