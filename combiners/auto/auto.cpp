// SPDX-License-Identifier: Apache-2.0
// "auto": the best image that the inputs allow, without a choice for the user. The rule and its reasons are in
// combiners/auto/auto.md; its steps are
//   1. fuse: the unbiased image x joins the photon maps (fused_estimate.h);
//   2. remove fireflies of x that one or two quarters alone speak for (fireflies.h);
//   3. filter x, its direct and indirect light apart where they are known (direct_indirect.h);
//   4. shrink x towards every filter (shrinkage.h): filters and shrunk images are the candidates;
//   5. combine them by errors measured across halves (relative_weights.h);
//   6. refilter the result, where halves show its use (refilter.h);
//   7. estimate the error (half_statistics.h), with the squared bias that the photon maps leave.
// x itself is no candidate: halves cannot see the error of a firefly in the half that holds it.
#include <algorithm>
#include <array>

#include "combiners/shrinkage/debias.h"
#include "combiners/denoise/pw/pw1_filter.h"
#include "combiners/denoise/pw/pw_filter.h"
#include "combiners/statistics/variance.h"
#include "combiners/statistics/fireflies.h"
#include "combiners/statistics/half_statistics.h"
#include "combiners/pixels/finite_float.h"
#include "combiners/shrinkage/fused_estimate.h"
#include "combiners/statistics/direct_indirect.h"
#include "combiners/pipeline/combine_plan.h"
#include "combiners/pipeline/registry.h"
#include "combiners/ensemble/relative_weights.h"
#include "combiners/auto/refilter.h"
#include "combiners/shrinkage/shrinkage.h"

namespace braid {

namespace {

const OptionInfo kPatch{"auto-patch", 15, "Width in pixels of the patches that errors are summed over", 1, 101};
const OptionInfo kFuse{"auto-fuse", 1, "0: photon maps are bases, not part of the image that is denoised"};
const OptionInfo kDebias{"auto-debias", 1, "0: photon maps keep the bias that they tell"};
const OptionInfo kShrink{"auto-shrink", 1, "0: bases only, without James-Stein shrinkage towards them"};
const OptionInfo kRefilter{"auto-refilter", 1, "0: the combined image is not filtered once more"};
const OptionInfo kDirectIndirect{"auto-direct-indirect", 1, "0: direct and indirect light are filtered together"};
const OptionInfo kFireflies{"auto-remove-fireflies", 1, "0: keep fireflies"};

constexpr uint64_t kFewestPasses = 4;       // fewer: the first filter alone
constexpr uint64_t kFirstOrderPasses = 64;  // fewer: slopes fit noise

// The careful filter is for what the wide one takes for noise, which is small (combiners/EXPERIMENTS.md, Careful
// filter).
constexpr PatchWelchNeighbours kCarefulNeighbours{4, 4};
constexpr int kFirstOrderStride = 7;  // with a careful filter beside it, fits every fifth pixel change no error either

// What images from filters of direct and indirect light keep of the squared bias that their halves show
// (combiners/EXPERIMENTS.md, Bias that filters keep): filters blur less as variances fall, but not all bias goes with
// the variance.
constexpr double kBiasKeptByParts = 0.85;

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
    needs.helpful.features = needs.helpful.featureNoise = true;
    needs.helpful.quarters = needs.helpful.directIndirect = true;
    return needs;
  }
  MethodMemory memory(const MemoryCase& of) const override;
  std::vector<OptionInfo> options() const override {
    return {kPatch, kFuse, kDebias, kDirectIndirect, kShrink, kFireflies, kRefilter};
  }
  MethodResult run(const MethodInputs& in) const override;
};

Estimate asEstimate(std::vector<Rgb<float>> images, const char* name) {
  Estimate e;
  e.name = name;
  e.mean = std::move(images[0]);
  for (size_t h = 0; h + 1 < images.size(); ++h) e.half[h] = std::move(images[1 + h]);
  return e;
}

MethodMemory Auto::memory(const MemoryCase& of) const {
  const int fused = of.photonMaps > 0 ? 112 : 0, others = of.bases - of.photonMaps;
  if (of.passes > 0 && of.passes < kFewestPasses) return {48 + fused + 36 * others, 36, 2'300'000};
  const int bases = others + 2;
  const int refilterBytes = 353 + 16 * bases;  // 48 of it a copy without fireflies
  return {std::max(44 + 88 * bases, refilterBytes) + fused, 44 + 8 * bases};
}

// Whether errors can be measured across halves. Images of other renderers may not say their passes.
bool mayBeMeasured(const Estimate& x) { return x.passes == 0 || x.passes >= kFewestPasses; }

// The filters of x, fewer once cancelled: a wide one, from 64 passes on its first-order fit instead, and last a careful
// one that takes no neighbour's noise for its own.
std::vector<Estimate> filtersOf(const Estimate& x, const Features* features, const std::atomic<bool>* cancel) {
  const auto cancelled = [&] { return cancel && cancel->load(); };
  std::vector<Estimate> bases;
  if (cancelled()) return bases;
  {
    const PatchWelchInput input = patchWelchInput(x, features);
    if (input.variance.empty()) return bases;
    if (!mayBeMeasured(x)) {
      bases.push_back(
          asEstimate(std::move(patchWelch(input, std::array{kPatchWelchThreshold}, {}, {}, cancel)[0]), "pw"));
      return bases;
    }
    const bool firstOrder = x.passes >= kFirstOrderPasses;
    FirstOrderOptions fits;
    fits.stride = kFirstOrderStride;
    auto wide = firstOrder ? patchWelchFirstOrder(input, fits, cancel)
                           : std::move(patchWelch(input, std::array{kPatchWelchWideThreshold}, {}, {}, cancel)[0]);
    if (cancelled()) return bases;
    bases.push_back(asEstimate(std::move(wide), firstOrder ? "pw1" : "pw-wide"));
  }
  if (cancelled()) return bases;
  const PatchWelchInput robust = patchWelchInput(x, features, true);
  auto careful = patchWelch(robust, std::array{kPatchWelchThreshold}, kCarefulNeighbours, {}, cancel);
  bases.push_back(asEstimate(std::move(careful[0]), "pw-robust"));
  return bases;
}

// The same filters of direct and of indirect light, added up.
std::vector<Estimate> filtersOfParts(const Estimate& x, bool removeFireflies, const Features* features,
                                     const std::atomic<bool>* cancel) {
  std::vector<Estimate> sums;
  for (Estimate (*part)(const Estimate&) : {directLight, indirectLight}) {
    Estimate light = part(x);
    if (removeFireflies) {
      const std::vector<Firefly> fireflies = findFireflies(light, {}, features);
      for (Rgb<float>* image : {&light.mean, &light.half[0], &light.half[1]}) replaceValues(*image, fireflies);
      replaceVariances(light.variance, fireflies);
    }
    std::vector<Estimate> filtered = filtersOf(light, features, cancel);
    for (size_t i = 0; i < sums.size() && i < filtered.size(); ++i) addImage(sums[i], filtered[i]);
    if (sums.empty()) sums = std::move(filtered);
  }
  return sums;
}

// The outside base as a filter of x: a denoiser that has seen the unbiased image alone is run again.
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

// x shrunk towards each base, and each half of x towards the base's half.
std::vector<Estimate> shrunkTowards(const std::vector<Estimate>& bases, const Estimate& x,
                                    const std::atomic<bool>* cancel) {
  JamesSteinSettings settings;
  settings.constant = 1;
  settings.gate = true;
  settings.shared = true;
  settings.filter = VarianceFilter::Whitened;
  settings.keepFactors = false;
  std::vector<Estimate> out(bases.size());
  for (size_t b = 0; b < bases.size(); ++b) out[b].name = "js@" + bases[b].name;
  const auto shrink = [&](const Rgb<float>& image, const Rgb<float>& noise, const auto& partOf) {
    const NoiseScale scale = noiseScale(noise, settings);
    for (size_t b = 0; b < bases.size() && !(cancel && cancel->load()); ++b)
      partOf(out[b]) = jamesStein(image, noise, scale, partOf(bases[b]), settings).image;
  };
  shrink(
      x.mean, x.variance, [](auto& e) -> auto& { return e.mean; });
  for (size_t h = 0; h < 2; ++h)
    shrink(
        x.half[h], halfVariance(x, x.variance, static_cast<int>(h)), [h](auto& e) -> auto& { return e.half[h]; });
  return out;
}

// The image of a result filtered once more, as far as the halves of x ask for it. Its planes are the weights so far.
void filterAgain(const Estimate& x, const MethodInputs& in, int patchRadius, MethodResult& result) {
  const Estimate first = std::move(result.image), second = refilter(first, in.features, passesOf(x), in.cancel);
  if (in.cancel && in.cancel->load()) return;
  const std::vector<const Estimate*> both = {&second, &first};
  const WeightMaps shares = relativeWeights(x, both, first.mean, x.variance, in.features, patchRadius);
  result.image = weightedEstimate(shares, both);
  for (NamedPlane& map : result.aovs)
    parallelChunks(map.plane.size(), kPixelChunk, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) map.plane[i] *= shares.of(1, 0)[i];
    });
  result.aovs.push_back({"weight.auto.second-pass", shares.of(0, 0)});
}

Attribute countRemark(const char* name, size_t count) {
  Attribute a;
  a.name = name;
  a.kind = Attribute::Kind::Int;
  a.integer = static_cast<int64_t>(count);
  return a;
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
    if (mayBeMeasured(*map)) map = &corrected.emplace_back(debiased(*map));
  return fusedEstimate(*in.unbiased, photonMaps, in.features);
}

MethodResult Auto::run(const MethodInputs& in) const {
  MethodResult result;
  std::vector<const Estimate*> photonMaps, others;
  for (const Estimate* b : in.bases)
    (!b->bias.empty() && in.options.number(kFuse) != 0 ? photonMaps : others).push_back(b);
  FusedEstimate fused;
  if (!photonMaps.empty()) fused = fusedWith(photonMaps, in);
  Estimate* own =
      photonMaps.empty() ? in.consumable : &fused.image;  // the unbiased or fused image, if it may be changed
  Estimate copy;
  const auto changeable = [&](const Estimate& e) -> Estimate& {
    if (!own) own = &(copy = filterInput(e));
    return *own;
  };
  const Estimate* whole = photonMaps.empty() ? in.unbiased : &fused.image;
  if (mayBeMeasured(*whole) && whole->variance.empty()) {
    whole = &changeable(*whole);
    if (own->variance.empty()) own->variance = meanVariance(*whole);
  }
  const bool removeFireflies = in.options.number(kFireflies) != 0 && mayBeMeasured(*whole);
  std::vector<Estimate> filters;  // of the parts, before fireflies of the whole are replaced
  if (photonMaps.empty() && in.options.number(kDirectIndirect) != 0 && mayBeMeasured(*whole) &&
      hasDirectIndirect(*whole))
    filters = filtersOfParts(*whole, removeFireflies, in.features, in.cancel);
  const double biasKept = filters.empty() ? 1 : kBiasKeptByParts;
  if (removeFireflies) {
    const GivenQuarters quarters = photonMaps.empty() ? in.quarters : GivenQuarters{&fused.image.quarter};
    const std::vector<Firefly> fireflies = findFireflies(*whole, quarters, in.features);
    result.remarks.push_back(countRemark("removedFireflies", fireflies.size()));
    if (!fused.noise.empty()) replaceVariances(fused.noise, fireflies);
    if (!fireflies.empty()) {
      Estimate& clean = changeable(*whole);
      for (Rgb<float>* image : {&clean.mean, &clean.half[0], &clean.half[1]}) replaceValues(*image, fireflies);
      replaceVariances(clean.variance, fireflies);
      whole = &clean;
    }
  }
  const Estimate& x = *whole;
  std::vector<Estimate> bases;
  for (const Estimate* b : others) bases.push_back(consistentHalves(baseOf(*b, x, !photonMaps.empty(), in)));
  if (filters.empty()) filters = filtersOf(x, in.features, in.cancel);
  for (Estimate& e : filters) bases.push_back(std::move(e));
  filters.clear();
  const auto cancelled = [&] { return in.cancel && in.cancel->load(); };
  if (cancelled()) return result;
  if (bases.empty() || !mayBeMeasured(x)) {
    result.image = bases.empty() ? x : std::move(bases.back());
    return result;
  }
  std::vector<Estimate> shrunk;
  if (in.options.number(kShrink) != 0) shrunk = shrunkTowards(bases, x, in.cancel);
  if (cancelled()) return result;
  std::vector<const Estimate*> candidates;
  for (const Estimate& e : shrunk) candidates.push_back(&e);
  for (const Estimate& e : bases) candidates.push_back(&e);
  const int patchRadius = static_cast<int>(std::clamp(in.options.number(kPatch), 1.0, 101.0)) / 2;
  const WeightMaps weights = relativeWeights(x, candidates, bases.back().mean, x.variance, in.features, patchRadius);
  if (cancelled()) return result;
  result.image = weightedEstimate(weights, candidates);
  std::vector<Plane<float>> maps = channelMeans(weights);
  for (size_t b = 0; b < candidates.size(); ++b)
    result.aovs.push_back({"weight.auto." + layerName(candidates[b]->name), std::move(maps[b])});
  shrunk.clear();  // their memory is what the second pass and the error map need
  bases.clear();
  if (in.options.number(kRefilter) != 0) filterAgain(x, in, patchRadius, result);
  if (cancelled()) return result;
  result.error =
      errorMap(result.image.half, x, fused.noise.empty() ? x.variance : fused.noise, result.image.mean, true, biasKept);
  if (!fused.squaredBias.empty()) addTo(result.error, smoothedSquaredBias(fused.squaredBias, result.image.mean));
  return result;
}

}  // namespace

std::unique_ptr<Method> make_auto() { return std::make_unique<Auto>(); }

}  // namespace braid
