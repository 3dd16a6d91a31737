// SPDX-License-Identifier: Apache-2.0
// "auto": the best image that the inputs allow, without a choice for the user. The rule and its reasons are in
// combiners/auto/auto.md; its steps are
//   1. fuse: the unbiased image x joins the photon maps (fused_estimate.h);
//   2. remove fireflies of x that one or two quarters alone speak for (fireflies.h);
//   3. filter x, its direct and indirect light apart where they are known (direct_indirect.h);
//   4. shrink x towards every filter (shrinkage.h): filters and shrunk images are the candidates;
//   5. combine them by errors measured across halves at several scales (scale_weights.h);
//   6. take the noise of the albedo out of the result (settled_albedo.h);
//   7. refilter it, where halves show its use (refilter.h);
//   8. give it the light back that filters have lost (lost_light.h);
//   9. average what the features of a few samples could not tell apart (feature_noise.h);
//   10. estimate the error (half_statistics.h), with the squared bias that the photon maps leave.
#include <algorithm>
#include <array>

#include "combiners/shrinkage/debias.h"
#include "combiners/statistics/variance.h"
#include "combiners/statistics/fireflies.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/shrinkage/fused_estimate.h"
#include "combiners/statistics/direct_indirect.h"
#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/registry.h"
#include "combiners/ensemble/scale_weights.h"
#include "combiners/auto/albedo_noise.h"
#include "combiners/auto/auto_filters.h"
#include "combiners/auto/feature_noise.h"
#include "combiners/auto/lost_light.h"
#include "combiners/auto/refilter.h"
#include "combiners/auto/settled_albedo.h"
#include "combiners/auto/shrunk_filters.h"
#include "combiners/statistics/local_range_clamp.h"
#include "renderer/film/make_attribute.h"

namespace braid {

namespace {

const OptionInfo kFuse{"auto-fuse", 1, "0: photon maps are bases, not part of the image that is denoised"};
const OptionInfo kDebias{"auto-debias", 1, "0: photon maps are not corrected by their own bias estimate"};
const OptionInfo kShrink{"auto-shrink", 1, "0: bases only, without James-Stein shrinkage towards them"};
const OptionInfo kRefilter{"auto-refilter", 1, "0: the combined image is not filtered once more"};
const OptionInfo kAlbedo{"auto-settle-albedo", 1, "0: noise of the albedo stays"};
const OptionInfo kDirectIndirect{"auto-direct-indirect", 1, "0: direct and indirect light are filtered together"};
const OptionInfo kLostLight{"auto-lost-light", 1, "0: light that filters have lost is not given back"};
const OptionInfo kFeatureNoise{"auto-feature-noise", 1, "0: noise of the features stays"};
const OptionInfo kFireflies{"auto-remove-fireflies", 1, "0: keep fireflies"};

// Fewer: the variances of direct and of indirect light are known worse than that of their sum, and x, whose variance is
// too small wherever no firefly has fallen yet, is no image to be pulled to (combiners/EXPERIMENTS.md, Auto at few
// samples).
constexpr uint64_t kPartsPasses = 16, kShrinkPasses = 16;
constexpr const char* kHelper = "kpn";
// From so many passes on the other filters are as good without a network (combiners/EXPERIMENTS.md, Kernel prediction).
constexpr uint64_t kLearnedPasses = 256, kLearnedFusedPasses = 2;
// From so many passes on the noise of the albedo is of no account (combiners/EXPERIMENTS.md, Noise of the albedo).
constexpr uint64_t kSettledPasses = 64;
// From so many passes on it costs more than it gains to average what features cannot tell apart
// (combiners/EXPERIMENTS.md, Noise of the features).
constexpr uint64_t kFeatureNoisePasses = 8;
constexpr int kNamedRange = 2;  // radius in pixels of the range that images of other denoisers are kept in

class Auto : public Method {
 public:
  const char* name() const override { return "auto"; }
  const char* description() const override {
    return "The best image that the inputs allow: photon maps, filters and shrinkage, combined by measured errors";
  }
  MethodKind kind() const override { return MethodKind::Combiner; }
  Needs needs() const override {
    Needs needs;
    needs.anyBases = true;
    needs.helper = kHelper;
    needs.helperBelow = kLearnedPasses;
    needs.helperBelowFused = kLearnedFusedPasses;
    needs.helpful.features = needs.helpful.featureNoise = true;
    needs.helpful.quarters = needs.helpful.directIndirect = true;
    return needs;
  }
  MethodMemory memory(const MemoryCase& of) const override;
  std::vector<OptionInfo> options() const override {
    return {kFuse, kDebias, kDirectIndirect, kShrink, kFireflies, kAlbedo, kRefilter, kLostLight, kFeatureNoise};
  }
  MethodResult run(const MethodInputs& in) const override;
};

MethodMemory Auto::memory(const MemoryCase& of) const {
  const int fused = of.photonMaps > 0 ? 112 : 0, filters = of.bases - of.photonMaps + 2;
  const bool shrinks = of.passes == 0 || of.passes >= kShrinkPasses;
  const int candidates = (shrinks ? 2 : 1) * filters, pairs = candidates * (candidates + 1) / 2;
  // 48 of refiltering is a copy without fireflies; the maps of a fused image's errors are gone by then.
  const int combining = 60 + 44 * candidates + 5 * pairs / 4 + fused;
  const int refiltering = 353 + (shrinks ? 16 : 4) * filters + (fused > 0 ? 64 : 0);
  return {std::max(combining, refiltering), 44 + 4 * candidates};
}

// The external base as a filter of x: a denoiser that has seen the unbiased image alone is run again.
Estimate baseOf(const Estimate& base, const Estimate& x, bool fused, const MethodInputs& in) {
  if (!fused || !isMethod(base.name)) return base;
  const std::shared_ptr<const Method> method = findMethod(base.name);
  if (method->kind() != MethodKind::Denoiser) return base;
  MethodInputs again = in;
  again.unbiased = &x;
  again.consumable = nullptr;
  Estimate out = method->run(again).image;
  out.name = base.name;
  return hasHalves(out) ? out : base;
}

// A denoiser may blur its image once more than its halves. Halves moved to the image's side show its errors too.
Estimate consistentHalves(const Estimate& base) {
  Estimate out = base;
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < base.mean.size(); ++i) {
      const float shift = base.mean[c][i] - 0.5f * (base.half[0][c][i] + base.half[1][c][i]);
      for (Rgb<float>& half : out.half) half[c][i] += shift;
    }
  return out;
}

// Keeps an image of a learned or another denoiser from lighting what is beside a lamp, where x shows that it is dark.
void keepInRange(Estimate& base, const Estimate& x) {
  if (x.variance.empty() || !hasHalves(x)) return;
  clampToLocalRange(std::array{&base.mean, &base.half[0], &base.half[1]}, std::array{&x.mean, &x.half[0], &x.half[1]},
                    x.mean, x.variance, kNamedRange);
}

// A result becomes another image as far as the halves of x ask for it. Its planes are the weights so far.
void chooseBetween(const Estimate& x, const Estimate& second, const char* name, const MethodInputs& in,
                   MethodResult& result) {
  const Estimate first = std::move(result.image);
  const std::vector<const Estimate*> both = {&second, &first};
  const WeightMaps shares = scaleWeights(x, both, in.features);
  result.image = weightedEstimate(shares, both);
  for (NamedPlane& map : result.aovs)
    parallelChunks(map.plane.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) map.plane[i] *= shares.of(1, 0)[i];
    });
  result.aovs.push_back({std::string("weight.auto.") + name, shares.of(0, 0)});
}

void addTo(Plane<float>& sum, const Plane<float>& other) {
  for (size_t i = 0; i < sum.size(); ++i)
    sum[i] = finiteFloat(static_cast<double>(sum[i]) + static_cast<double>(other[i]));
}

// The unbiased image fused with the photon maps, which are corrected by their own bias estimates.
FusedEstimate fusedWith(std::vector<const Estimate*> photonMaps, const MethodInputs& in) {
  if (in.options.number(kDebias) == 0) return fusedEstimate(*in.unbiased, photonMaps, in.features);
  std::vector<Estimate> corrected;
  corrected.reserve(photonMaps.size());
  for (const Estimate*& map : photonMaps)
    if (map->passes != 1) map = &corrected.emplace_back(debiased(*map));
  return fusedEstimate(*in.unbiased, photonMaps, in.features);
}

// One run: what its steps leave to each other.
class AutoRun {
 public:
  explicit AutoRun(const MethodInputs& in) : in_(in), x_(in.unbiased), changeable_(in.consumable) {}
  MethodResult run();

 private:
  void fuse();
  void filterParts();
  void removeFireflies();
  void filter();
  void shrink();
  void combine();
  void settleCombined();
  void refilterCombined();
  void giveLostLight();
  void averageFeatures();
  void estimateError();

  bool isOn(const OptionInfo& option) const { return in_.options.number(option) != 0; }
  bool removesFireflies() const { return isOn(kFireflies); }
  // Whether filter f, or what is shrunk towards it, is made by dividing by the albedo of the samples.
  bool isOwn(size_t f) const { return f >= others_.size() || others_[f]->name == kHelper; }
  // x, from now on an image that may be changed.
  Estimate& changeableX();

  const MethodInputs& in_;
  const Estimate* x_;     // the unbiased image, or the fused one
  Estimate* changeable_;  // the same, or null
  Estimate copy_;         // where it must not be changed
  bool isFused_ = false;
  FusedEstimate fused_;
  std::vector<const Estimate*> others_;  // images of other denoisers, and photon maps that are not fused
  std::vector<PixelValues> removed_;     // the fireflies of x as they were
  std::vector<PixelValues> judging_;     // and as candidates are judged by them
  std::vector<Estimate> filters_, shrunk_;
  Plane<float> own_;  // what of the image isOwn() filters made; empty: all
  MethodResult result_;
};

MethodResult AutoRun::run() {
  fuse();
  filterParts();  // of x with its fireflies, which parts lose by themselves
  removeFireflies();
  filter();
  if (in_.cancelled()) return std::move(result_);
  if (filters_.empty()) {
    result_.image = *x_;
    return std::move(result_);
  }
  if (in_.firstPass && !others_.empty()) {
    result_.image = std::move(filters_.front());  // what halves that were made of one image say of others is chance
    if (isOwn(0)) averageFeatures();
    return std::move(result_);
  }
  shrink();
  if (!in_.cancelled()) combine();
  if (!in_.cancelled()) settleCombined();
  if (!in_.cancelled()) refilterCombined();
  if (!in_.cancelled()) giveLostLight();
  if (!in_.cancelled()) averageFeatures();
  if (!in_.cancelled() && !in_.firstPass) estimateError();  // halves that were made tell nothing
  return std::move(result_);
}

Estimate& AutoRun::changeableX() {
  if (!changeable_) changeable_ = &(copy_ = filterInput(*x_));
  x_ = changeable_;
  return *changeable_;
}

void AutoRun::fuse() {
  std::vector<const Estimate*> photonMaps;
  for (const Estimate* b : in_.bases) (!b->bias.empty() && isOn(kFuse) ? photonMaps : others_).push_back(b);
  if (!photonMaps.empty()) {
    isFused_ = true;
    fused_ = fusedWith(photonMaps, in_);
    x_ = changeable_ = &fused_.image;
  }
  if (!x_->variance.empty()) return;
  Estimate& x = changeableX();
  if (x.variance.empty()) x.variance = meanVariance(x);
}

void AutoRun::filterParts() {
  if (isFused_ || !isOn(kDirectIndirect) || (x_->passes > 0 && x_->passes < kPartsPasses) || !hasDirectIndirect(*x_))
    return;
  filters_ = autoFiltersOfParts(*x_, removesFireflies(), in_.features, in_.cancel);
}

void AutoRun::removeFireflies() {
  if (!removesFireflies()) return;
  const GivenQuarters quarters = isFused_ ? GivenQuarters{&fused_.image.quarter} : in_.quarters;
  const std::vector<Firefly> fireflies = findFireflies(*x_, quarters, in_.features);
  result_.remarks.push_back(wholeAttribute("removedFireflies", fireflies.size()));
  if (fireflies.empty()) return;
  if (!fused_.noise.empty()) replaceVariances(fused_.noise, fireflies);
  removed_ = removePixels(changeableX(), fireflies);
  judging_ = judgingPixels(removed_, fireflies);
}

// Images of other denoisers go first: the last filter is the careful one, whose image guides the weights.
void AutoRun::filter() {
  std::vector<Estimate> own = std::move(filters_);
  filters_.clear();
  for (const Estimate* b : others_) {
    filters_.push_back(consistentHalves(baseOf(*b, *x_, isFused_, in_)));
    if (!in_.firstPass) keepInRange(filters_.back(), *x_);  // what is made of one image shows no range
  }
  if (in_.firstPass && !filters_.empty()) return;  // nothing will judge the others
  if (own.empty()) own = autoFilters(*x_, in_.features, in_.cancel);
  for (Estimate& e : own) filters_.push_back(std::move(e));
}

void AutoRun::shrink() {
  if (isOn(kShrink) && !in_.firstPass && (x_->passes == 0 || x_->passes >= kShrinkPasses))
    shrunk_ = shrunkTowards(filters_, *x_, in_.cancel);
}

void AutoRun::combine() {
  std::vector<const Estimate*> candidates;
  for (const Estimate& e : shrunk_) candidates.push_back(&e);
  for (const Estimate& e : filters_) candidates.push_back(&e);
  if (!judging_.empty()) swapPixels(changeableX(), judging_);
  const WeightMaps weights = scaleWeights(*x_, candidates, in_.features);
  if (!judging_.empty()) swapPixels(changeableX(), judging_);
  if (in_.cancelled()) return;
  result_.image = weightedEstimate(weights, candidates);
  std::vector<Plane<float>> maps = channelMeans(weights);
  if (!others_.empty()) {
    own_ = Plane<float>(x_->mean.width(), x_->mean.height(), 0.0f);
    for (size_t b = 0; b < candidates.size(); ++b)
      if (isOwn(b % filters_.size())) addTo(own_, maps[b]);
  }
  for (size_t b = 0; b < candidates.size(); ++b)
    result_.aovs.push_back({"weight.auto." + layerName(candidates[b]->name), std::move(maps[b])});
  shrunk_.clear();  // their memory is what refiltering and the error map need
  filters_.clear();
}

void AutoRun::settleCombined() {
  const uint64_t passes = passesOf(*x_);
  if (isOn(kAlbedo) && !in_.firstPass && passes < kSettledPasses)
    settleAlbedo(result_.image, x_->variance, in_.features, passes, in_.cancel);
}

void AutoRun::refilterCombined() {
  if (!isOn(kRefilter)) return;
  const Estimate second = refilter(result_.image, in_.features, passesOf(*x_), in_.cancel);
  if (!in_.cancelled()) chooseBetween(*x_, second, "second-pass", in_, result_);
}

void AutoRun::giveLostLight() {
  if (isFused_ || in_.firstPass || !isOn(kLostLight)) return;
  if (!removed_.empty()) swapPixels(changeableX(), removed_);
  const std::optional<Estimate> brighter = withLostLight(result_.image, *x_, in_.features);
  if (brighter) chooseBetween(*x_, *brighter, "lost-light", in_, result_);
  if (!removed_.empty()) swapPixels(changeableX(), removed_);
}

void AutoRun::averageFeatures() {
  const uint64_t passes = in_.firstPass ? 1 : passesOf(*x_);
  if (isOn(kFeatureNoise) && passes < kFeatureNoisePasses)
    averageFeatureNoise(result_.image, in_.features, passes, own_, in_.cancel);
}

void AutoRun::estimateError() {
  const Rgb<float>& noise = fused_.noise.empty() ? x_->variance : fused_.noise;
  result_.error =
      mixtureErrorMap(result_.image.half, noise, result_.image.mean, albedoNoise(result_.image.mean, in_.features));
  if (!fused_.squaredBias.empty()) addTo(result_.error, smoothedSquaredBias(fused_.squaredBias, result_.image.mean));
}

MethodResult Auto::run(const MethodInputs& in) const { return AutoRun(in).run(); }

}  // namespace

std::unique_ptr<Method> make_auto() { return std::make_unique<Auto>(); }

}  // namespace braid
