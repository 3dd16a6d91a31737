// SPDX-License-Identifier: Apache-2.0
// Denoisers and combiners: pure functions from estimates to an image. They see no scene and no rays, so each can be
// tested on synthetic planes, run during a render, or run on files afterwards.
//
// All colours are exposure-normalised before a method sees them (combiners/pipeline/exposure.h), all inputs are finite,
// and variances are variances of the mean.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "renderer/film/estimates.h"
#include "renderer/film/kept_buffers.h"

namespace braid {

// A number that a user may set, e.g. --js-constant 1.25 on the command line; names are "<method>-<word>". It is within
// [least, most], a whole one or any; unless said otherwise, a switch.
struct OptionInfo {
  std::string name;
  double fallback = 0;
  std::string description;
  double least = 0, most = 1;
  bool whole = true;
};

class MethodOptions {
 public:
  void set(const std::string& name, double value) { values_[name] = value; }
  double number(const OptionInfo& option) const {
    const auto found = values_.find(option.name);
    return found == values_.end() ? option.fallback : found->second;
  }
  const std::map<std::string, double>& values() const { return values_; }

 private:
  std::map<std::string, double> values_;
};

// What a method must be given: what is missing keeps it from running, with a sentence that names it. And what makes its
// image better.
struct Needs {
  bool biased = false;      // a smooth image with halves: a denoiser's, a photon map's or another combiner's
  bool redenoise = false;   // the biased image must come from a denoiser, which is run again
  bool correlated = false;  // an estimate by common random numbers or gradients
  bool reference = false;   // the image that is to be estimated: for comparisons only, no render has it
  int bases = 0;            // images with halves to choose from
  // Takes, beyond those `bases`, what there is: the bases or denoisers that a user names, and biased estimates such as
  // photon maps.
  bool anyBases = false;
  // A denoiser whose image is one of the bases below so many passes of the unbiased estimate, where it can run and the
  // user names none; empty: there is none. Beside photon maps, where it filters the fused image once more, it pays
  // below fewer passes (combiners/EXPERIMENTS.md, kpn beside photon maps).
  std::string helper;
  uint64_t helperBelow = 0, helperBelowFused = 0;

  // Of the unbiased estimate.
  uint64_t passes = 2;
  int checkpoints = 0;
  bool variance = true;
  bool quarters = false;  // of the correlated one too
  bool halves = true;     // of the biased image and the bases too; false: works on the means alone

  // Works without, but worse. Quarters: few of their values are read, MethodInputs::quarters. Direct light is not read
  // where photon maps are among the bases.
  KeptBuffers helpful;
};

// The quarters of an estimate in the units that they were given in, of which a copy in those of the method would take
// longer than what is read.
struct GivenQuarters {
  const std::vector<Rgb<float>>* images = nullptr;  // four; null: there are none
  double scale = 1;                                 // to the units of the method
};

// The estimate that a method improves.
struct UnbiasedInput {
  const Estimate* unbiased = nullptr;  // mean, halves, variance
  Estimate* consumable = nullptr;      // the same, if nobody reads it afterwards: a method may change it
  bool firstPass = false;  // its variance and halves were made of a single pass: they cannot judge other images
  GivenQuarters quarters;
  const std::vector<Checkpoint>* history = nullptr;  // oldest first
  // The same of fewer passes, mean, halves and variance, that `biased` and `redenoise` are made of; null: they are made
  // of `unbiased`. For StoppingMethod only.
  const Estimate* stopped = nullptr;
};

// A smooth image with an unknown bias.
struct BiasedInput {
  const Estimate* biased = nullptr;  // mean, halves; variance and bias where known
  GivenQuarters biasedQuarters;      // unless a method made it
  // Runs the denoiser that made it on another colour image, everything else unchanged.
  std::function<Rgb<float>(const Rgb<float>&)> redenoise;
  // Runs it on half h (0 or 1) of its colour alone. Null: its halves share no weights anyway, or there are no quarters,
  // which show the noise of a half.
  std::function<Rgb<float>(int h)> denoiseHalf;
};

// How a method runs, whatever its images.
struct MethodRun {
  MethodOptions options;
  uint64_t seed = 0;
  bool meanOnly = false;                      // of the result only image.mean will be read
  const std::atomic<bool>* cancel = nullptr;  // a cancelled method may return anything
  bool cancelled() const { return cancel && cancel->load(); }
};

// The inputs of one method. Pointers that needs() does not ask for may be null. Widths and heights agree.
struct MethodInputs : UnbiasedInput, BiasedInput, MethodRun {
  std::vector<const Estimate*> bases;
  const Estimate* correlated = nullptr;
  const Features* features = nullptr;
  const Rgb<float>* reference = nullptr;
};

struct NamedPlane {
  std::string name;  // EXR layer or channel, e.g. "weight.pw"
  Plane<float> plane;
};

// What a method makes. image.mean is the result; image.half[i] is the same method applied to half i of the inputs
// (empty when the method has no halves).
struct MethodResult {
  Estimate image;
  Plane<float> error;              // estimated squared error of the mean, channel average; empty: not estimated
  std::vector<NamedPlane> aovs;    // on request only: weights, shrinkage factors
  std::vector<Attribute> remarks;  // constants used and counts of fallbacks, for the header
};

// What the memory of a method depends on.
struct MemoryCase {
  uint64_t passes = 0;       // of the unbiased estimate; 0: not known
  int bases = 0;             // images to choose from,
  int photonMaps = 0;        // of which so many are biased estimates
  bool photonMap = false;    // whether the biased input is one
  bool denoiseHalf = false;  // whether there is MethodInputs::denoiseHalf
};

// Bytes a pixel. The inputs are not counted.
struct MethodMemory {
  int peak = 0;               // at the most at a time, result included
  int kept = 0;               // of the result
  uint64_t eachThread = 0;    // bytes in all that every thread takes besides
  int besideRedenoising = 0;  // held while MethodInputs::redenoise or denoiseHalf runs
};

enum class MethodKind { Denoiser, Combiner };

class Method {
 public:
  virtual ~Method() = default;
  virtual const char* name() const = 0;
  virtual const char* description() const = 0;
  virtual MethodKind kind() const = 0;
  virtual Needs needs() const = 0;
  // To 10 % (tests/combiners/test_combining_memory.cpp), without what MethodInputs::redenoise and denoiseHalf take.
  virtual MethodMemory memory(const MemoryCase& of) const = 0;
  virtual std::vector<OptionInfo> options() const { return {}; }
  // Whether a half of the result depends on the other half of the colour, as where weights are made of all samples.
  // Such a denoiser asks for quarters (Needs::helpful).
  virtual bool halvesShareWeights() const { return false; }
  // Deterministic for any number of threads. A denoiser reads inputs.unbiased and inputs.features.
  virtual MethodResult run(const MethodInputs& inputs) const = 0;
};

}  // namespace braid
