// SPDX-License-Identifier: Apache-2.0
// From estimates to files: denoisers and combiners, then the EXR and the PNG. During a render, at its end, and after
// merging.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "renderer/film/files/exr.h"
#include "renderer/film/files/tone.h"
#include "renderer/film/kept_buffers.h"
#include "tools/options/combining.h"

namespace CLI {
class App;
}

namespace braid {

// What viewers are shown of one publication. Errors are estimated squared errors, averaged over the channels. What is
// null does not exist or is not known; nothing outlives the call that it is handed to.
struct ImageViews {
  const Rgb<float>* noisy = nullptr;     // of the first integrator
  const Rgb<float>* combined = nullptr;  // the image of the last wanted method that ran
  const Plane<float>*noisyError = nullptr, *combinedError = nullptr;
  // squaredLevels() of what has an error; null: those of its own values.
  const Plane<float>*noisyLevels = nullptr, *combinedLevels = nullptr;
};
using ShowImages = std::function<void(const ImageViews&)>;

struct ImageOutput {
  std::string file, png;       // empty: not written; the ending says the format of `file`
  std::optional<AovSet> aovs;  // none: see aovSet()
  std::string layerPrefix;
  ToneChoice tone;
  bool quarters = false, history = false, directIndirect = false, floatHeadline = false, noTiming = false;
  CombineChoice combine;
  ShowImages show;  // called between combining and writing, if there is one

  // The names of the files, without empty ones.
  std::vector<std::string> files() const;
  // What --aovs says; nothing said: features, or all where layers that are there only then have been asked for.
  AovSet aovSet() const;
  // What the film has to keep for the layers.
  KeptBuffers buffers() const;
  // Without files that can be written only once: streams.
  ImageOutput replaceable() const;
  // Without denoisers and combiners.
  ImageOutput plain() const;
};

// -o, --png, --combine and all that say what the files hold; `output` holds the defaults.
void addImageOptions(CLI::App& command, ImageOutput& output);

// Throws Error for names of images whose endings are unknown, and for files that could not be written.
void checkImageFiles(const ImageOutput& output);

// One image in the format that the ending of `path` says. Returns a warning, or nothing.
std::string writeImageFile(const std::string& path, const Estimates& estimates, const Rgb<float>& image,
                           const Plane<float>* alpha, const ExrOptions& exr, const Tone& tone);

// How an image is shown, if `file` is for eyes or `png` is asked for.
std::optional<Tone> toneOf(const std::string& file, const std::string& png, const ToneChoice& choice,
                           const Rgb<float>& image, const Plane<float>* alpha);

// A line for people.
std::string describe(const Tone& tone);

// What became of one writing.
struct WrittenImage {
  // relativeError() of the headline; none where the headline's method does not estimate its error.
  std::optional<double> error;
  std::optional<Tone> tone;  // of the files for eyes
  double combineSeconds = 0, writeSeconds = 0;
  double secondsOfRun = 0;                     // that the pass loop was held up for it
  std::vector<std::string> warnings, timings;  // one line each
  bool cancelled = false;                      // nothing was written
};

// Runs the methods and writes the files. `attributes` of the estimates are those of the header; what the file says of
// the methods is added to the estimates. `threads` 0: all that the process may use. When `cancel` is set meanwhile, the
// files stay as they were. Throws Error(OutputFailed).
WrittenImage writeImage(const ImageOutput& output, Estimates& estimates, const Plane<float>* alpha, int threads,
                        const std::atomic<bool>* cancel = nullptr);

// The error of the last wanted method that ran, or of the first integrator; none where light is missing, which leaves
// no trace in the samples.
std::optional<double> headlineError(const PipelineResult& combined, const std::vector<std::string>& wanted,
                                    const Estimates& estimates);

// Calls `show` with what the estimates and the methods that ran on them hold.
void showImages(const Estimates& estimates, const PipelineResult& combined, const std::vector<std::string>& wanted,
                const ShowImages& show);

}  // namespace braid
