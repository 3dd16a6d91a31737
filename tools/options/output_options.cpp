// SPDX-License-Identifier: Apache-2.0
#include "tools/options/output_options.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/film/files/output_file.h"
#include "tools/options/syntax/option_checks.h"
#include "tools/options/syntax/option_texts.h"

namespace braid {

namespace {

const std::vector<std::pair<std::string, ToneCurve>> kToneCurves{{nameOf(ToneCurve::Neutral), ToneCurve::Neutral},
                                                                 {nameOf(ToneCurve::Agx), ToneCurve::Agx},
                                                                 {nameOf(ToneCurve::Aces), ToneCurve::Aces},
                                                                 {nameOf(ToneCurve::None), ToneCurve::None}};

}  // namespace

CLI::Option* addOutput(CLI::App& command, std::string& file) {
  return command
      .add_option("-o,--output", file,
                  "Image to write, by its ending: .exr with layers; .png, .jpg tone-mapped; .hdr, .tif linear; - is "
                  "EXR to standard output")
      ->type_name("FILE");
}

void addToneOptions(CLI::App& command, ToneChoice& choice) {
  addNamed(command, "--tone", choice.curve, NamedValues<ToneCurve>{"tone curve", kToneCurves},
           "Tone curve of PNG, JPEG and previews: neutral (Khronos PBR Neutral), agx, aces, or none (cut off at 1)");
  addParsed(command, "--exposure", choice.exposure, parseExposure,
            "Exposure of PNG and JPEG in stops, or auto; printed")
      ->default_str("auto")
      ->type_name("EV");
}

AovSet parseAovs(const std::string& name) {
  if (name == "none") return AovSet::None;
  if (name == "features") return AovSet::Features;
  if (name == "all") return AovSet::All;
  throw Error(ExitCode::Usage, "unknown --aovs '" + name + "': known are none, features, all");
}

const char* nameOf(AovSet set) { return set == AovSet::None ? "none" : set == AovSet::Features ? "features" : "all"; }

void checkWritable(const std::string& path) {
  if (isStream(path)) return;
  const std::filesystem::path folder = std::filesystem::path(behindLinks(path)).parent_path();
  const std::string name = folder.empty() ? "." : folder.string();
  std::error_code ignored;
  if (!std::filesystem::is_directory(name, ignored))
    throw Error(ExitCode::OutputFailed,
                fmt::format("{}: the folder {} does not exist: create it or choose another output", path, name));
  if (access(name.c_str(), W_OK) != 0)
    throw Error(ExitCode::OutputFailed,
                fmt::format("{}: the folder {} is not writable: {}", path, name, std::strerror(errno)));
  if (std::filesystem::is_directory(path, ignored))
    throw Error(ExitCode::OutputFailed, fmt::format("{}: is a folder: give a file name", path));
}

void prepareOutput(const std::string& path) {
  checkWritable(path);
  removeAbandoned(path);
}

}  // namespace braid
