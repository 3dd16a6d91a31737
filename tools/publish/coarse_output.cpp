// SPDX-License-Identifier: Apache-2.0
#include "tools/publish/coarse_output.h"

#include <utility>

#include <fmt/format.h>

#include "renderer/core/parallel.h"
#include "tools/images/estimates_file.h"
#include "tools/images/exr_metadata.h"
#include "tools/run/progress_line.h"

namespace braid {

namespace {

// A path of a hundred vertices takes about as long, on one core.
constexpr double kSlowPath = 1e-4;
// Fewer pixels tell too little of what a pass takes, which is next to nothing.
constexpr double kLeastPixels = 128 * 128;

std::string lateText(const TimeLimit& limit, const Plan& plan, const FilmState& coarse, bool combines) {
  return fmt::format(
      "--time {}: one pass over all pixels takes longer: {}x{} were rendered in the place of {}x{}, and each stands "
      "for several; the image {}has no variances: give more time or a smaller --size",
      formatSeconds(limit.seconds()), coarse.fullWidth, coarse.fullHeight, plan.settings.width, plan.settings.height,
      combines ? "is not combined and " : "");
}

}  // namespace

bool mayBeTooLate(const PixelWindow& window, int threads, const TimeLimit& limit) {
  const double pixels = static_cast<double>(window.width()) * window.height();
  return limit.exists() && pixels >= kLeastPixels &&
         limit.left() < kSlowPath * pixels / (threads > 0 ? threads : machineThreads());
}

ImageOutput withoutStatistics(const ImageOutput& output) {
  ImageOutput plain = output.plain();
  plain.aovs = output.aovSet() == AovSet::None ? AovSet::None : AovSet::Features;
  plain.quarters = plain.history = plain.directIndirect = false;
  return plain;
}

WrittenImage writeCoarse(const CoarseRender& coarse, const Plan& plan, const ImageOutput& output,
                         std::vector<Attribute> attributes, const TimeLimit& limit) {
  const FilmState& state = coarse.state();
  const int threads = plan.settings.threads;
  Estimates estimates;
  std::optional<Plane<float>> alpha;
  withThreads(threads, [&] {
    estimates = enlargedEstimates(state, plan);
    alpha = enlargedAlpha(state, plan);
  });
  estimates.attributes = std::move(attributes);
  for (Attribute& a : passAttributes(estimates, state.seconds, !output.noTiming))
    estimates.attributes.push_back(std::move(a));
  Attribute size;
  size.name = kRenderedSizeAttribute;
  size.text = fmt::format("{}x{}", state.fullWidth, state.fullHeight);
  estimates.attributes.push_back(std::move(size));
  WrittenImage written = writeImage(withoutStatistics(output), estimates, alpha ? &*alpha : nullptr, threads);
  const bool combines = !output.combine.methods.empty() || !output.combine.denoisers.empty();
  written.warnings.insert(written.warnings.begin(), lateText(limit, plan, state, combines));
  return written;
}

}  // namespace braid
