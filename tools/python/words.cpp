// SPDX-License-Identifier: Apache-2.0
#include "tools/python/words.h"

#include <algorithm>

#include <CLI/CLI.hpp>

#include "renderer/core/error.h"

namespace braid::python {

namespace {

void parse(CLI::App& app, Words words) {
  std::reverse(words.begin(), words.end());
  try {
    app.parse(words);
  } catch (const CLI::ParseError& e) {
    throw Error(ExitCode::Usage, e.what());
  }
}

void addMethods(CLI::App& app, CombineChoice& combine) {
  addCombineOptions(app, combine);
  app.add_option_function<std::string>("--combine", [&](const std::string& text) {
    combine.methods = parseMethods(text);
    combine.asked = true;
  });
}

}  // namespace

SceneChoice sceneChoice(const std::string& file, const Words& words) {
  SceneChoice choice;
  CLI::App app;
  addSceneOptions(app, choice);
  Words all = words;
  all.insert(all.end(), {"--", file});
  parse(app, all);
  choice.quiet = true;  // warnings are the scene's
  return choice;
}

RenderChoice renderChoice(const Words& words) {
  RenderChoice choice;
  choice.samples.integrators = {"auto"};
  combineByDefault(choice.combine);
  CLI::App app;
  addSampleOptions(app, choice.samples);
  addMethods(app, choice.combine);
  parse(app, words);
  return choice;
}

CombineChoice combineChoice(const Words& words) {
  CombineChoice choice;
  choice.methods = {kDefaultMethod};
  CLI::App app;
  addMethods(app, choice);
  parse(app, words);
  return choice;
}

}  // namespace braid::python
