// SPDX-License-Identifier: Apache-2.0
#include "combiners/regression/regression.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "combiners/regression/regression_fitter.h"
#include "combiners/regression/regression_job.h"
#include "combiners/regression/regression_reconstructor.h"
#include "renderer/core/error.h"
#include "renderer/core/parallel.h"

namespace braid {

namespace {

using namespace regression;

constexpr int kBandRows = 128;  // pixel rows whose models are in memory together, plus two window radii
constexpr int kSegment = 32;    // centres that one task fits

RegressionReport fitRows(const Job& job, Models& models, int firstRow, int endRow) {
  const auto segments = static_cast<size_t>((models.columns() + kSegment - 1) / kSegment);
  const size_t tasks = segments * static_cast<size_t>(endRow - firstRow);
  return parallelSum(tasks, 1, RegressionReport{}, [&](size_t task, size_t) {
    RegressionReport report;
    Fitter fitter(job);
    const int row = firstRow + static_cast<int>(task / segments);
    const int first = static_cast<int>(task % segments) * kSegment;
    const int cy = centrePosition(row, job.height, job.settings.stride);
    for (int column = first; column < std::min(first + kSegment, models.columns()) && !job.cancelled(); ++column)
      fitter.fit(centrePosition(column, job.width, job.settings.stride), cy, models.at(column, row), report);
    return report;
  });
}

RegressionReport reconstructRows(const Job& job, Models& models, int y0, int y1, std::array<Rgb<float>, 2>& out) {
  return parallelSum(static_cast<size_t>(y1 - y0), kSlabRows, RegressionReport{}, [&](size_t begin, size_t end) {
    RegressionReport report;
    if (job.cancelled()) return report;
    const int first = y0 + static_cast<int>(begin), last = y0 + static_cast<int>(end);
    Reconstructor slab(job, models);
    slab.gather(first, last);
    if (job.settings.ownModelBelow > 0 && job.settings.stride > 1) {
      Fitter fitter(job);
      for (int y = first; y < last; ++y) slab.addOwnModels(y, first, fitter, report);
    }
    for (int y = first; y < last; ++y) report.fallbackPixels += slab.finish(y, first, out);
    return report;
  });
}

Job prepare(const RegressionInputs& inputs, const RegressionSettings& settings, bool two) {
  BRAID_ASSERT(!inputs.terms.empty() && inputs.fallback && settings.stride >= 1 && settings.radius >= 0);
  Job job{inputs, settings, inputs.fallback->width(), inputs.fallback->height(), {}, {}, {}, two ? 6 : 3};
  std::vector<const Plane<float>*> features, targets;
  for (const FeatureGroup& group : inputs.features) {
    BRAID_ASSERT(group.size() >= 1 && group.size() <= 3);
    features.insert(features.end(), group.begin(), group.end());
    job.groupEnd.push_back(static_cast<int>(features.size()));
  }
  BRAID_ASSERT(features.size() <= RegressionInputs::kMaxFeatures);
  for (const RegressionTerm& term : inputs.terms) {
    for (size_t c = 0; c < 3; ++c) targets.push_back(&(*term.target)[c]);
    for (size_t c = 0; c < 3 && two; ++c) targets.push_back(&(*term.secondTarget)[c]);
  }
  for (const auto* planes : {&features, &targets})
    for (const Plane<float>* p : *planes) BRAID_ASSERT(p->width == job.width && p->height == job.height);
  job.features = PackedRows(features);
  job.targets = PackedRows(targets);
  return job;
}

std::array<Rgb<float>, 2> run(const Job& job, RegressionReport* report) {
  const RegressionSettings& settings = job.settings;
  std::array<Rgb<float>, 2> out;
  for (int i = 0; i < job.colours / 3; ++i) out[static_cast<size_t>(i)] = Rgb<float>(job.width, job.height);
  RegressionReport total;
  const int rows = centreCount(job.height, settings.stride);
  Models models(job, std::min(rows, (kBandRows + 2 * settings.radius) / settings.stride + 2));
  int fitted = 0;
  for (int y0 = 0; y0 < job.height && !job.cancelled(); y0 += kBandRows) {
    const int y1 = std::min(job.height, y0 + kBandRows);
    int needed = fitted;
    while (needed < rows && centrePosition(needed, job.height, settings.stride) - settings.radius < y1) ++needed;
    total += fitRows(job, models, fitted, needed);
    fitted = needed;
    total += reconstructRows(job, models, y0, y1, out);
  }
  if (report) *report += total;
  return out;
}

}  // namespace

RegressionSettings stridedSettings(int stride, const std::atomic<bool>* cancel) {
  RegressionSettings settings;
  const auto cell = static_cast<float>(stride * stride);
  settings.stride = stride;
  settings.fallbackWeight = 1 / cell;
  settings.ownModelBelow = 8 / cell;
  settings.cancel = cancel;
  return settings;
}

RegressionReport& RegressionReport::operator+=(const RegressionReport& other) {
  models += other.models;
  raisedRidge += other.raisedRidge;
  constantModels += other.constantModels;
  ownModels += other.ownModels;
  fallbackPixels += other.fallbackPixels;
  maxCondition = std::max(maxCondition, other.maxCondition);
  return *this;
}

Attribute RegressionReport::attribute(const std::string& name) const {
  Attribute a;
  a.name = name;
  a.text = fmt::format(
      "{} models, {} of them of single pixels, {} with a raised ridge, {} constant, {} pixels by fallback alone, "
      "condition <= {:.3g}",
      models, ownModels, raisedRidge, constantModels, fallbackPixels, maxCondition);
  return a;
}

int centreCount(int size, int stride) { return (size + stride - 1) / stride; }

int centrePosition(int k, int size, int stride) { return std::min(k * stride + stride / 2, size - 1); }

Rgb<float> regress(const RegressionInputs& inputs, const RegressionSettings& settings, RegressionReport* report) {
  return run(prepare(inputs, settings, false), report)[0];
}

std::array<Rgb<float>, 2> regressTwo(const RegressionInputs& inputs, const RegressionSettings& settings,
                                     RegressionReport* report) {
  return run(prepare(inputs, settings, true), report);
}

}  // namespace braid
