// SPDX-License-Identifier: Apache-2.0
// Parsing of what `braid sweep` is asked for.
#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "renderer/core/error.h"
#include "tools/sweep/sweep.h"

namespace braid {

namespace {

std::vector<std::string> splitAt(const std::string& text, char separator) {
  std::vector<std::string> items(1);
  for (char c : text) {
    if (c == separator)
      items.emplace_back();
    else
      items.back() += c;
  }
  return items;
}

std::string tidy(std::string name) {
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '_' && c != '-') c = '_';
  return name.empty() ? "scene" : name;
}

bool repeats(const std::vector<std::string>& names, const std::string& name) {
  return std::count(names.begin(), names.end(), name) > 1;
}

}  // namespace

std::vector<double> parseLadder(const std::string& text, bool durations) {
  const auto fail = [&]() -> double {
    throw Error(
        ExitCode::Usage,
        fmt::format("'{}': expected FROM:TO (doubling from rung to rung) or a list such as {}", text,
                    durations ? "1,4,16 in seconds, from above 0 to 1e9" : "4,16,64, whole numbers from 1 to 2^40"));
  };
  const auto number = [&](const std::string& item) {
    if (durations) {
      const double v = parseDuration(item);
      return v > 0 ? v : fail();
    }
    const bool whole = !item.empty() && item.size() < 16 &&
                       std::all_of(item.begin(), item.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
    const double v = whole ? std::stod(item) : 0;
    return v > 0 && v <= 0x1p40 ? v : fail();
  };
  const std::vector<std::string> ends = splitAt(text, ':');
  std::vector<double> rungs;
  if (ends.size() == 2) {
    const double last = number(ends[1]);
    for (double rung = number(ends[0]); rung <= last; rung *= 2) rungs.push_back(rung);
  } else if (ends.size() == 1) {
    for (const std::string& item : splitAt(text, ',')) rungs.push_back(number(item));
    std::sort(rungs.begin(), rungs.end());
    rungs.erase(std::unique(rungs.begin(), rungs.end()), rungs.end());
  }
  if (rungs.empty()) fail();
  return rungs;
}

std::vector<std::string> sceneNames(const std::vector<std::string>& files) {
  namespace fs = std::filesystem;
  std::vector<std::string> names;
  for (const std::string& file : files) names.push_back(tidy(fs::path(file).stem().string()));
  const std::vector<std::string> stems = names;
  for (size_t i = 0; i < files.size(); ++i)
    if (repeats(stems, stems[i]))
      names[i] = tidy(fs::absolute(files[i]).lexically_normal().parent_path().filename().string() + "-" + stems[i]);
  for (const std::string& name : names)
    if (repeats(names, name))
      throw Error(ExitCode::Usage, fmt::format("two scenes would be called {}: rename one of the files", name));
  return names;
}

std::string valueForScene(const std::vector<std::string>& list, const std::string& scene, const std::string& fallback) {
  std::string value = fallback;
  for (const std::string& item : list)
    if (item.find('=') == std::string::npos) value = item;
  for (const std::string& item : list)
    if (item.rfind(scene + "=", 0) == 0) value = item.substr(scene.size() + 1);
  return value;
}

}  // namespace braid
