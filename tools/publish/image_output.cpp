// SPDX-License-Identifier: Apache-2.0
#include "tools/publish/image_output.h"

#include <cmath>
#include <exception>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/core/stopwatch.h"
#include "combiners/statistics/error_map.h"
#include "renderer/film/files/output_file.h"
#include "renderer/film/files/picture.h"
#include "renderer/film/make_attribute.h"
#include "tools/images/exr_metadata.h"
#include "tools/options/syntax/help.h"
#include "tools/options/syntax/option_checks.h"
#include "tools/options/output_options.h"
#include "tools/run/progress_line.h"
#include "tools/publish/estimated_error.h"

namespace braid {

namespace {

// The last wanted method that ran; null: none.
const MethodResult* headlineOf(const PipelineResult& combined, const std::vector<std::string>& wanted) {
  for (size_t i = wanted.size(); i > 0; --i)
    if (const PipelineOutput* out = combined.find(wanted[i - 1]); out && out->ran()) return &out->result;
  return nullptr;
}

// What of the light no integrator could find; empty: none of it.
std::string lightOutOfReach(const Estimates& estimates) {
  for (const Attribute& a : estimates.attributes)
    if (a.name == kUnreachableAttribute) return a.text;
  return "";
}

// Both tasks run, beside each other; then throws what the first of them threw.
void bothWhateverFails(const std::function<void()>& one, const std::function<void()>& other) {
  std::exception_ptr failures[2];
  const auto caught = [](const std::function<void()>& task, std::exception_ptr& failure) {
    try {
      task();
    } catch (...) {
      failure = std::current_exception();
    }
  };
  parallelBoth([&] { caught(one, failures[0]); }, [&] { caught(other, failures[1]); });
  for (const std::exception_ptr& failure : failures)
    if (failure) std::rethrow_exception(failure);
}

std::vector<std::string> timingsOf(const PipelineResult& combined) {
  std::vector<std::string> timings;
  for (const PipelineOutput& out : combined.outputs) {
    if (!out.ran()) continue;
    std::string text = fmt::format("{} in {}, its inputs in {}", out.step.name, formatSeconds(out.seconds),
                                   formatSeconds(out.inputSeconds));
    // Of a black picture there is no share.
    if (std::isfinite(out.meanOverUnbiased))
      text += fmt::format("; its mean is {:.2f} % of that of {}", 100 * out.meanOverUnbiased, out.step.unbiased);
    timings.push_back(std::move(text));
  }
  return timings;
}

}  // namespace

std::optional<double> headlineError(const PipelineResult& combined, const std::vector<std::string>& wanted,
                                    const Estimates& estimates) {
  if (!lightOutOfReach(estimates).empty()) return std::nullopt;
  if (const MethodResult* result = headlineOf(combined, wanted)) {
    if (result->error.empty()) return std::nullopt;
    return relativeError(result->error, squaredLevels(result->image.mean));
  }
  const Estimate& first = estimates.estimates.front();
  if (!knowsError(first)) return std::nullopt;
  return relativeError(errorMap(first), squaredLevels(first));
}

std::vector<std::string> ImageOutput::files() const {
  std::vector<std::string> list;
  for (const std::string& name : {file, png})
    if (!name.empty()) list.push_back(name);
  return list;
}

AovSet ImageOutput::aovSet() const {
  if (aovs) return *aovs;
  const bool more = quarters || history || directIndirect || combine.weights || !combine.denoisers.empty();
  return more ? AovSet::All : AovSet::Features;
}

KeptBuffers ImageOutput::buffers() const {
  return {
      .features = aovSet() != AovSet::None, .quarters = quarters, .history = history, .directIndirect = directIndirect};
}

ImageOutput ImageOutput::replaceable() const {
  ImageOutput output = *this;
  for (std::string* name : {&output.file, &output.png})
    if (isStream(*name)) name->clear();
  return output;
}

ImageOutput ImageOutput::plain() const {
  ImageOutput output = *this;
  output.combine.methods.clear();
  output.combine.denoisers.clear();
  return output;
}

void checkImageFiles(const ImageOutput& output) {
  if (!output.file.empty()) imageFormat(output.file);
  if (!output.png.empty() && !isStream(output.png) && imageFormat(output.png) != ImageFormat::Png)
    throw Error(ExitCode::Usage,
                fmt::format("--png {}: writes PNG: name a file that ends in .png, or use -o", output.png));
  for (const std::string& file : output.files()) prepareOutput(file);
}

std::string writeImageFile(const std::string& path, const Estimates& estimates, const Rgb<float>& image,
                           const Plane<float>* alpha, const ExrOptions& exr, const Tone& tone) {
  const ImageFormat format = imageFormat(path);
  if (format != ImageFormat::Exr) {
    writePicture(path, format, image, alpha, tone);
    return "";
  }
  const WriteReport report = writeExr(path, estimates, image, alpha, exr);
  if (report.clampedToHalf == 0) return "";
  return fmt::format("{}: {} values above 65504 were clamped to fit half floats: use --float", path,
                     report.clampedToHalf);
}

std::optional<Tone> toneOf(const std::string& file, const std::string& png, const ToneChoice& choice,
                           const Rgb<float>& image, const Plane<float>* alpha) {
  if (png.empty() && (file.empty() || !isForDisplay(imageFormat(file)))) return std::nullopt;
  return toneFor(choice, image, alpha);
}

std::string describe(const Tone& tone) {
  return fmt::format("shown with --tone {} --exposure {:.4g}", nameOf(tone.curve), tone.exposureStops);
}

void addImageOptions(CLI::App& command, ImageOutput& o) {
  addOutput(command, o.file);
  command.add_option("--png", o.png, "Also write a tone-mapped PNG")->type_name("FILE");
  addToneOptions(command, o.tone);
  addWords(command, "--combine", o.combine.methods, parseMethods,
           "none, or methods of --list; the last one makes the image")
      ->default_str(o.combine.text())
      ->type_name("NAMES");
  addCombineOptions(command, o.combine);
  addWords(command, "--aovs", o.aovs, parseAovs,
           fmt::format("Layers of the EXR besides the image: none; features, with the image's error; or all, which "
                       "combining the file later takes (default: {})",
                       o.aovs ? nameOf(*o.aovs) : "features, or all where another option asks for more"))
      ->type_name("SET");
  command.add_flag("--quarters", o.quarters, "Also write the four quarter buffers");
  command.add_flag("--direct-indirect", o.directIndirect,
                   "Also write direct light by itself and both parts' variances, for combining later");
  command.add_flag("--history", o.history, "Also write the variances after 1, 2, 4, ... samples, for combining later");
  command.add_flag("--float", o.floatHeadline, "32-bit floats for R G B and the features too");
  command.add_option("--layer-prefix", o.layerPrefix, "Put before every layer's name, e.g. ViewLayer")
      ->type_name("NAME");
  command.add_flag("--reproducible", o.noTiming, "No run times in the header: identical runs give identical files");
  showFirst(command, kOutputHelp, {"--output", "--png", "--exposure", "--combine", "--aovs"});
}

void showImages(const Estimates& estimates, const PipelineResult& combined, const std::vector<std::string>& wanted,
                const ShowImages& show) {
  const Estimate& first = estimates.estimates.front();
  ImageViews views{&first.mean};
  Plane<float> noisyError, noisyLevels, combinedLevels;
  if (knowsError(first)) {
    noisyError = errorMap(first);
    noisyLevels = squaredLevels(first);
    views.noisyError = &noisyError;
    views.noisyLevels = &noisyLevels;
  }
  if (const MethodResult* result = headlineOf(combined, wanted)) {
    views.combined = &result->image.mean;
    if (!result->error.empty()) {
      combinedLevels = squaredLevels(result->image.mean);
      views.combinedError = &result->error;
      views.combinedLevels = &combinedLevels;
    }
  }
  show(views);
}

WrittenImage writeImage(const ImageOutput& o, Estimates& estimates, const Plane<float>* alpha, int threads,
                        const std::atomic<bool>* cancel) {
  WrittenImage written;
  const std::vector<std::string> wanted = o.combine.methods;
  const Stopwatch combining;
  const PipelineResult combined = runCombining(estimates, o.combine, o.combine.options(cancel), threads);
  written.combineSeconds = combining.seconds();
  if (cancel && cancel->load()) {
    written.cancelled = true;
    return written;
  }
  withThreads(threads, [&] {
    if (o.show) showImages(estimates, combined, wanted, o.show);
    const Stopwatch writing;
    written.error = headlineError(combined, wanted, estimates);
    if (written.error) estimates.attributes.push_back(numberAttribute("braid/estimatedError", *written.error));
    // CombinedLayers may move the estimates.
    const Rgb<float> first = headlineOf(combined, wanted) ? Rgb<float>() : estimates.estimates.front().mean;
    const CombinedLayers layers(combined, wanted, o.combine.weights, !o.noTiming, estimates);
    const Rgb<float>& headline = layers.headline() ? *layers.headline() : first;
    ExrOptions exr;
    exr.layers = layers.layers();
    exr.history = o.history;
    exr.aovs = o.aovSet();
    exr.quarters = o.quarters;
    exr.directIndirect = o.directIndirect;
    exr.floatHeadline = o.floatHeadline;
    exr.layerPrefix = o.layerPrefix;
    written.warnings = combineWarnings(combined, o.combine.asked);
    if (const std::string missing = lightOutOfReach(estimates); !missing.empty())
      written.warnings.push_back(missing + "; the error of this image is not known");
    written.tone = toneOf(o.file, o.png, o.tone, headline, alpha);
    const Tone tone = written.tone.value_or(Tone());
    // Beside each other: a PNG is compressed by one thread.
    std::string warning;
    bothWhateverFails(
        [&] {
          if (!o.file.empty()) warning = writeImageFile(o.file, estimates, headline, alpha, exr, tone);
        },
        [&] {
          if (!o.png.empty()) writePicture(o.png, ImageFormat::Png, headline, alpha, tone);
        });
    if (!warning.empty()) written.warnings.push_back(std::move(warning));
    written.writeSeconds = writing.seconds();
  });
  written.timings = timingsOf(combined);
  return written;
}

}  // namespace braid
