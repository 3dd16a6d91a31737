// SPDX-License-Identifier: Apache-2.0
#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/pipeline.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include <fmt/format.h>

#include "combiners/pipeline/invalid_pixels.h"
#include "combiners/pipeline/spatial_variance.h"
#include "combiners/pixels/plane_mean.h"
#include "combiners/statistics/half_estimate.h"
#include "renderer/core/error.h"
#include "renderer/core/parallel.h"
#include "renderer/core/pixel_buffer.h"
#include "renderer/core/stopwatch.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

void addDifference(Rgb<float>& to, const Rgb<float>& a, const Rgb<float>& b) {
  if (to.empty()) return;
  for (size_t c = 0; c < 3; ++c)
    parallelChunks(to[c].size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) to[c][i] += a[c][i] - b[c][i];
    });
}

double meanOf(const Rgb<float>& image) { return (planeMean(image[0]) + planeMean(image[1]) + planeMean(image[2])) / 3; }

// The estimate with another mean; halves and quarters move with it.
Estimate withMean(const Estimate& e, const Rgb<float>& mean) {
  Estimate moved = e;
  for (Rgb<float>& half : moved.half) addDifference(half, mean, e.mean);
  for (Rgb<float>& quarter : moved.quarter) addDifference(quarter, mean, e.mean);
  moved.mean = mean;
  return moved;
}

bool sizeIs(const Rgb<float>& image, const Estimates& e) {
  return image.empty() || (image.width() == e.width && image.height() == e.height);
}

void checkSizes(const Estimates& all) {
  if (!sizeIs(all.reference, all))
    throw Error(ExitCode::BadInput, fmt::format("the reference is not of the size {}x{}", all.width, all.height));
  for (const Estimate& e : all.estimates) {
    bool ok = !e.mean.empty() && sizeIs(e.variance, all) && sizeIs(e.bias, all) && sizeIs(e.biasVariance, all);
    for (const Rgb<float>* image : {&e.mean, &e.half[0], &e.half[1], &e.biasHalf[0], &e.biasHalf[1]})
      ok = ok && sizeIs(*image, all);
    for (const Rgb<float>& q : e.quarter) ok = ok && sizeIs(q, all);
    if (!ok)
      throw Error(ExitCode::BadInput, fmt::format("the planes of the estimate {} are not all of the size {}x{}", e.name,
                                                  all.width, all.height));
  }
}

class Runner {
 public:
  explicit Runner(const PipelineOptions& options) : options_(options) {}

  // Takes of the estimates what the combine plan reads, without invalid pixels.
  void normalise(const Estimates& estimates, const CombinePlan& combinePlan);
  // Makes estimates of the earlier images that steps read.
  void keepEarlier(const CombinePlan& combinePlan);
  // The last step may change what it reads.
  void run(Step step, bool last);
  // Back to the units of the estimates.
  void finish();

  PipelineResult result;

 private:
  void take(const CombinePlan& combinePlan);
  const Estimate* estimate(const std::string& name) const;
  GivenQuarters givenQuarters(const std::string& name) const;
  MethodInputs inputsOf(const Step& step) const;
  std::string missingInput(const Step& step, bool& failed) const;
  double inputSeconds(const Step& step) const;

  using Earlier = std::pair<std::string, uint64_t>;  // name, passes

  Estimates all_;                    // normalised; so are the results until finish()
  std::optional<Estimates> filled_;  // a copy of the given ones without invalid pixels, if there are any
  const Estimates* given_ = nullptr;
  const Features* features_ = nullptr;   // the given ones, if they are fit as they are
  std::map<Earlier, Estimate> earlier_;  // images of checkpoints
  const PipelineOptions& options_;
};

void Runner::normalise(const Estimates& estimates, const CombinePlan& combinePlan) {
  given_ = &estimates;
  take(combinePlan);
  if (result.sanitised.nonFinite == 0) return;
  const SanitiseReport found = result.sanitised;
  filled_ = estimates;
  const uint64_t filled = fillInvalid(*filled_);
  given_ = &*filled_;
  result.sanitised = {};
  take(combinePlan);
  result.sanitised.nonFinite = found.nonFinite;
  result.sanitised.filled = filled;
}

void Runner::take(const CombinePlan& combinePlan) {
  std::string unbiased;
  for (const Step& step : combinePlan.steps)
    if (unbiased.empty()) unbiased = step.unbiased;
  const Estimate* e = given_->find(unbiased);
  result.exposure = options_.exposure > 0 ? options_.exposure : e ? exposureScale(e->mean) : 1.0;
  PlanesRead read = planesRead(combinePlan);
  bool& features = read.buffers.features;
  const bool fit = features && given_->features && isSane(*given_->features, read.buffers.featureNoise);
  features = features && !fit;
  all_ = normalised(*given_, result.exposure, result.sanitised, read);
  features_ = fit ? &*given_->features : all_.features ? &*all_.features : nullptr;
  completeFirstPasses(all_, features_);
}

void Runner::keepEarlier(const CombinePlan& combinePlan) {
  for (const Step& step : combinePlan.steps) {
    const Estimate* newest = step.kept > 0 ? all_.find(step.unbiased) : nullptr;
    if (!newest || earlier_.count({step.unbiased, step.kept})) continue;
    for (const Checkpoint& c : all_.history[step.unbiased]) {
      if (c.passes != step.kept || c.mean.empty()) continue;
      Estimate e;
      e.name = newest->name;
      e.passes = c.passes;
      e.seconds = c.seconds;
      e.mean = c.mean;
      for (size_t h = 0; h < 2; ++h) e.half[h] = c.half[h];
      e.variance = c.variance;
      earlier_[{step.unbiased, step.kept}] = std::move(e);
    }
  }
}

const Estimate* Runner::estimate(const std::string& name) const {
  if (name.empty()) return nullptr;
  if (const PipelineOutput* made = result.find(name)) return made->ran() ? &made->result.image : nullptr;
  return all_.find(name);
}

GivenQuarters Runner::givenQuarters(const std::string& name) const {
  const Estimate* given = given_->find(name);
  if (!given || given->quarter.size() != 4) return {};
  return {&given->quarter, result.exposure};
}

// What a method made may lack halves that the combine plan could not know of, or may have failed.
std::string Runner::missingInput(const Step& step, bool& failed) const {
  std::vector<std::string> names = step.bases;
  if (!step.biased.empty()) names.push_back(step.biased);
  for (const std::string& name : names) {
    const PipelineOutput* made = result.find(name);
    if (made && made->failed) failed = true;
    if (made && !made->ran()) return fmt::format("needs {}, which did not run: {}", name, made->step.skipReason);
    const Estimate* e = estimate(name);
    if (!e) return fmt::format("needs {}, which does not exist", name);
    if (step.method->needs().halves && (e->half[0].empty() || e->half[1].empty()))
      return fmt::format("needs the halves of {}", name);
  }
  return {};
}

MethodInputs Runner::inputsOf(const Step& step) const {
  MethodInputs in;
  in.unbiased = estimate(step.unbiased);
  const Estimate* given = given_->find(step.unbiased);
  in.firstPass = given && given->unbiased && given->passes == 1;
  in.biased = estimate(step.biased);
  in.correlated = estimate(step.correlated);
  for (const std::string& base : step.bases) in.bases.push_back(estimate(base));
  in.features = features_;
  if (!all_.reference.empty()) in.reference = &all_.reference;
  if (step.kept == 0) in.quarters = givenQuarters(step.unbiased);
  if (!result.find(step.biased)) in.biasedQuarters = givenQuarters(step.biased);
  const auto history = all_.history.find(step.unbiased);
  in.history = history == all_.history.end() ? nullptr : &history->second;
  in.seed = all_.seed;
  in.options = options_.numbers;
  in.options.set(kPipelineExposure.name, result.exposure);
  in.cancel = options_.cancel;
  if (step.kept > 0) {
    const Estimate* earlier = &earlier_.at({step.unbiased, step.kept});
    (step.method->kind() == MethodKind::Denoiser ? in.unbiased : in.stopped) = earlier;
  }
  const PipelineOutput* maker = result.find(step.biased);
  if (maker && maker->step.method->kind() == MethodKind::Denoiser) {
    MethodInputs again = inputsOf(maker->step);
    again.meanOnly = true;
    in.redenoise = [again, method = maker->step.method](const Rgb<float>& image) {
      const Estimate moved = withMean(*again.unbiased, image);
      MethodInputs other = again;
      other.unbiased = &moved;
      return method->run(other).image.mean;
    };
    if (maker->step.method->halvesShareWeights() && hasHalfEstimates(*again.unbiased, again.quarters))
      in.denoiseHalf = [again, method = maker->step.method](int h) {
        const Estimate half = halfEstimate(*again.unbiased, again.quarters, h);
        MethodInputs other = again;
        other.unbiased = &half;
        other.quarters = {};
        return method->run(other).image.mean;
      };
  }
  return in;
}

double Runner::inputSeconds(const Step& step) const {
  std::set<std::string> seen;
  double seconds = 0;
  const auto visit = [&](const auto& self, const Step& s) -> void {
    std::vector<std::string> names = s.bases;
    names.push_back(s.biased);
    for (const std::string& name : names) {
      const PipelineOutput* made = result.find(name);
      if (!made || !seen.insert(name).second) continue;
      seconds += made->seconds;
      self(self, made->step);
    }
  };
  visit(visit, step);
  return seconds;
}

void Runner::run(Step step, bool last) {
  PipelineOutput out;
  // Whoever is helped does without what failed.
  std::erase_if(step.bases, [&](const std::string& name) {
    const PipelineOutput* made = result.find(name);
    return made && made->step.helper && !made->ran();
  });
  if (step.skipReason.empty()) step.skipReason = missingInput(step, out.failed);
  if (step.skipReason.empty()) {
    MethodInputs in = inputsOf(step);
    for (Estimate& e : all_.estimates)
      if (last && &e == in.unbiased) in.consumable = &e;
    const double unbiasedMean = meanOf(in.unbiased->mean);
    const Stopwatch clock;
    try {
      cancellable(in.cancel, [&] { out.result = step.method->run(in); });
    } catch (const Error& e) {
      step.skipReason = e.what();
      out.failed = true;
    }
    out.seconds = clock.seconds();
    out.meanOverUnbiased = meanOf(out.result.image.mean) / unbiasedMean;
    out.inputSeconds = inputSeconds(step);
    const Estimate* unbiased = in.unbiased;
    Estimate& image = out.result.image;
    image.name = step.name;
    image.unbiased = false;
    const Estimate* given = given_->find(step.unbiased);
    image.passes = unbiased ? std::max(unbiased->passes, given ? given->passes : 0) : 0;
    image.seconds = out.seconds;
    if (step.skipReason.empty() && (image.mean.width() != all_.width || image.mean.height() != all_.height)) {
      step.skipReason = fmt::format("its image has {}x{} pixels instead of {}x{}", image.mean.width(),
                                    image.mean.height(), all_.width, all_.height);
      out.failed = true;
    }
  }
  out.step = std::move(step);
  result.outputs.push_back(std::move(out));
}

void Runner::finish() {
  for (PipelineOutput& out : result.outputs) undoExposure(out.result, result.exposure);
}

// What steps leave to one another is given back after the last, also when one throws: whoever writes the images then
// needs memory of other kinds.
struct KeptPixels {
  ~KeptPixels() { dropKeptPixels(); }
};

}  // namespace

const PipelineOutput* PipelineResult::find(const std::string& name) const {
  for (const PipelineOutput& out : outputs)
    if (out.step.name == name) return &out;
  return nullptr;
}

PlanesRead planesRead(const CombinePlan& combinePlan) {
  PlanesRead read{buffersOf(combinePlan), false};
  KeptBuffers& buffers = read.buffers;
  buffers.history = buffers.history || !buffers.stops.empty();
  buffers.quarters = false;
  for (const Step& step : combinePlan.steps) {
    if (!step.skipReason.empty()) continue;
    const Needs needs = step.method->needs();
    // Photon maps, which are bases that no step made, are fused with all of the quarters.
    const bool given = std::any_of(step.bases.begin(), step.bases.end(),
                                   [&](const std::string& base) { return !combinePlan.find(base); });
    buffers.quarters |= needs.quarters || (needs.helpful.quarters && given);
    read.reference |= needs.reference;
  }
  return read;
}

PipelineResult runPipeline(const Estimates& estimates, const std::vector<std::string>& wanted,
                           const PipelineOptions& options) {
  checkSizes(estimates);
  const KeptPixels kept{};
  const CombinePlan combinePlan = makeCombinePlan(availableIn(estimates), wanted, options.roles);
  Runner runner(options);
  runner.normalise(estimates, combinePlan);
  runner.keepEarlier(combinePlan);
  for (const Step& step : combinePlan.steps) {
    if (options.cancel && options.cancel->load()) break;
    runner.run(step, &step == &combinePlan.steps.back());
  }
  runner.finish();
  return std::move(runner.result);
}

std::vector<Attribute> remarksOf(const PipelineOutput& output, bool timing) {
  const std::string prefix = "braid/" + layerName(output.step.name) + "/";
  std::vector<Attribute> list;
  const auto input = [&](const char* role, const std::string& name) {
    if (!name.empty()) list.push_back(textAttribute(prefix + role, name));
  };
  input("unbiased", output.step.unbiased);
  input("biased", output.step.biased);
  input("correlated", output.step.correlated);
  std::string bases;
  for (const std::string& base : output.step.bases) bases += (bases.empty() ? "" : ", ") + base;
  input("bases", bases);
  for (Attribute remark : output.result.remarks) {
    remark.name = prefix + remark.name;
    list.push_back(remark);
  }
  const auto number = [&](const char* name, double value) { list.push_back(numberAttribute(prefix + name, value)); };
  if (std::isfinite(output.meanOverUnbiased)) number("meanOverUnbiased", output.meanOverUnbiased);
  if (timing) {
    number("seconds", output.seconds);
    number("inputSeconds", output.inputSeconds);
  }
  return list;
}

}  // namespace braid
