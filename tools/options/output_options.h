// SPDX-License-Identifier: Apache-2.0
// What the subcommands that write images share.
#pragma once

#include <string>

#include "renderer/film/files/exr.h"
#include "renderer/film/files/tone.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace braid {

// -o,--output: an image in the format of its ending.
CLI::Option* addOutput(CLI::App& command, std::string& file);

// --tone and --exposure, of formats for eyes.
void addToneOptions(CLI::App& command, ToneChoice& choice);

// none, features or all. Throws Error(Usage).
AovSet parseAovs(const std::string& name);
const char* nameOf(AovSet set);

// Finds out before hours of rendering that the result could not be saved. Throws Error(OutputFailed).
void checkWritable(const std::string& path);

// The same; and temporary files that killed runs left of it go.
void prepareOutput(const std::string& path);

}  // namespace braid
