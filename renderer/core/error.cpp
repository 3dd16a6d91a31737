// SPDX-License-Identifier: Apache-2.0
#include "renderer/core/error.h"

namespace braid {

namespace {

std::string joinProblems(const std::string& file, const std::vector<Problem>& problems) {
  std::string text;
  for (const Problem& p : problems) {
    if (!text.empty()) text += '\n';
    text += file + ": ";
    if (!p.place.empty()) text += p.place + ": ";
    text += p.text;
  }
  return text;
}

}  // namespace

SceneError::SceneError(ExitCode code, std::string file, std::vector<Problem> problems)
    : Error(code, joinProblems(file, problems)), problems_(std::move(problems)) {}

SceneError::SceneError(ExitCode code, std::string file, std::string place, std::string text)
    : SceneError(code, std::move(file), std::vector<Problem>{{std::move(place), std::move(text)}}) {}

void assertionFailed(const char* condition, const char* file, int line) {
  throw Error(ExitCode::Internal,
              std::string(file) + ":" + std::to_string(line) + ": internal error: " + condition + " does not hold");
}

}  // namespace braid
