// SPDX-License-Identifier: Apache-2.0
#include "renderer/core/error.h"

namespace braid {

namespace {

std::string joinProblems(const std::string& file, const std::vector<Problem>& problems) {
  std::string text;
  for (const Problem& p : problems) {
    if (!text.empty()) text += '\n';
    text += printable(file + ": " + (p.place.empty() ? "" : p.place + ": ") + p.text);
  }
  return text;
}

}  // namespace

std::string printable(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return text;
}

Error::Error(ExitCode code, const std::string& text) : std::runtime_error(printable(text)), code_(code) {}

SceneError::SceneError(ExitCode code, std::string file, std::vector<Problem> problems)
    : Error(code, Lines{joinProblems(file, problems)}), problems_(std::move(problems)) {}

SceneError::SceneError(ExitCode code, std::string file, std::string place, std::string text)
    : SceneError(code, std::move(file), std::vector<Problem>{{std::move(place), std::move(text)}}) {}

void assertionFailed(const char* condition, const char* file, int line) {
  throw Error(ExitCode::Internal,
              std::string(file) + ":" + std::to_string(line) + ": internal error: " + condition + " does not hold");
}

}  // namespace braid
