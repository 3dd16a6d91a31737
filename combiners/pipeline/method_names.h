// SPDX-License-Identifier: Apache-2.0
// What names on the command line stand for.
//
// A method is named by its name in the registry. Three forms add to it:
//   name:parameter   a method that takes a parameter, such as external:FILE; the rest of the text is the parameter
//   name@biased      the method with this biased input, which may itself have one: js@ensemble, js@easy@nfor
//   name:passes      a method that stops denoising, such as curves:128 (combiners/pipeline/denoise_cutoff.h)
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "combiners/method.h"

namespace braid {

// "name@biased" cut at the first '@' that is no part of a parameter, which a number never has; the second part may be
// empty.
std::pair<std::string, std::string> splitChain(const std::string& name);

// Whether a method of exactly this name is registered.
bool isMethod(const std::string& name);

// The method that a name stands for, without its '@' part. Throws Error(Usage) naming those that exist.
std::shared_ptr<const Method> findMethod(const std::string& name);

// The options of every registered method, each once.
std::vector<OptionInfo> allMethodOptions();

// A name for layers of files: what follows a colon is shortened to the stem of a file name, a command to its
// program and four digits of its hash, and no dots.
std::string layerName(const std::string& name);

}  // namespace braid
