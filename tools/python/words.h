// SPDX-License-Identifier: Apache-2.0
// Keyword arguments of Python as options of the command line: the same names, ranges and sentences.
#pragma once

#include <string>
#include <vector>

#include "tools/options/combining.h"
#include "tools/options/scene_options.h"

namespace braid::python {

using Words = std::vector<std::string>;  // "--size=640x360", "--ground"

struct RenderChoice {
  SampleChoice samples;
  CombineChoice combine;
};

// The options that choose a scene, samples or methods. Throw Error(Usage) with the sentence of the command line for
// what is unknown or out of its range.
SceneChoice sceneChoice(const std::string& file, const Words& words);
RenderChoice renderChoice(const Words& words);
CombineChoice combineChoice(const Words& words);

}  // namespace braid::python
