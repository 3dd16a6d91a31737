// SPDX-License-Identifier: Apache-2.0
// The combiner "auto" as a whole: better than its inputs, with an error map that is true.
#include <algorithm>
#include <cmath>
#include <fstream>

#include <doctest/doctest.h>

#include "combiners/learned/network_place.h"
#include "combiners/shrinkage/fused_estimate.h"
#include "combiners/pipeline/external_method.h"
#include "combiners/pipeline/method_names.h"
#include "combiners/pipeline/pipeline.h"
#include "tests/combiners/auto_cases.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/running_braid.h"

namespace braid::test_auto {

using namespace test;
using namespace test::auto_cases;

namespace {

double relativeError(const Rgb<float>& image, const Rgb<float>& truth) {
  double sum = 0;
  for (size_t i = 0; i < image.size(); ++i) {
    double level = 0, square = 0;
    for (size_t c = 0; c < 3; ++c) {
      level += static_cast<double>(truth[c][i]) / 3;
      square += sqr(static_cast<double>(image[c][i]) - static_cast<double>(truth[c][i])) / 3;
    }
    sum += square / (level * level + 0.01);
  }
  return sum / static_cast<double>(image.size());
}

}  // namespace

TEST_CASE("auto is far better than the unbiased image and hardly ever worse than its filters") {
  int worse = 0, cells = 0;
  for (const uint64_t samples : {8, 32, 128})
    for (const double fireflies : {0.0, 0.001}) {
      const Case c = noisyCase(samples, fireflies);
      const Estimates e = kept(c, {"pt"});
      const double best = relativeError(outputOf(e, "auto").result.image.mean, c.truth);
      double input = relativeError(c.pt().mean, c.truth);
      CAPTURE(samples);
      CAPTURE(fireflies);
      CHECK(best < 0.25 * input);
      for (const char* filter : {"pw-wide", "pw1"})
        input = std::min(input, relativeError(outputOf(e, filter).result.image.mean, c.truth));
      ++cells;
      worse += best > 1.05 * input;
      CHECK(best < 1.25 * input);
    }
  CHECK(cells == 6);
  CHECK(worse <= 2);  // both with fireflies in one of ten pixels
}

TEST_CASE("auto's error map agrees with the true error of the image within a factor of two") {
  double logarithms = 0;
  int cases = 0;
  for (const uint64_t samples : {16, 64, 256}) {
    const Case c = noisyCase(samples, 0, samples);
    for (const std::vector<std::string>& names : {std::vector<std::string>{"pt"}, {"pt", "sppm"}}) {
      const PipelineOutput out = outputOf(kept(c, names), "auto");
      const double ratio = relativeSum(out.result.error, c.truth) / relativeError(out.result.image.mean, c.truth);
      CAPTURE(samples);
      CAPTURE(names.size());
      CHECK(ratio > 0.4);
      CHECK(ratio < 2.5);
      logarithms += std::log(ratio);
      ++cases;
    }
  }
  CHECK(std::fabs(logarithms / cases) < std::log(2.0));
}

TEST_CASE("With a photon map auto is better than with either image alone") {
  CaseOptions o;
  o.noise = 8;
  o.photonBlur = 1;
  const Case c = makeCase(o);
  const double both = relativeError(outputOf(kept(c, {"pt", "sppm"}), "auto").result.image.mean, c.truth);
  CHECK(both < 0.9 * relativeError(outputOf(kept(c, {"pt"}), "auto").result.image.mean, c.truth));
  CHECK(both < 0.9 * relativeError(c.sppm().mean, c.truth));
  CHECK(both < 0.1 * relativeError(c.pt().mean, c.truth));
}

TEST_CASE("A denoiser whose image is worse than its halves show is not believed") {
  const Case c = noisyCase(64);
  Estimates e = kept(c, {"pt"});
  Estimate liar;  // halves next to the truth, an image that is black
  liar.name = "liar";
  liar.unbiased = false;
  liar.half[0] = liar.half[1] = c.truth;
  liar.mean = Rgb<float>(e.width, e.height);
  const double without = relativeError(outputOf(e, "auto").result.image.mean, c.truth);
  e.estimates.push_back(liar);
  CHECK(relativeError(outputOf(e, "auto").result.image.mean, c.truth) < 1.1 * without);
}

TEST_CASE("auto measures from two passes on, and makes a picture of one") {
  PipelineOptions options;
  options.roles.helpers = false;
  for (const uint64_t passes : {1, 2, 3}) {
    const Case c = noisyCase(passes);
    const Estimates e = kept(c, {"pt"});
    const PipelineResult result = runPipeline(e, {"auto"}, options);
    const PipelineOutput& out = *result.find("auto");
    CAPTURE(passes);
    REQUIRE(out.ran());
    CHECK(out.result.image.passes == passes);
    CHECK(relativeError(out.result.image.mean, c.truth) < 0.3 * relativeError(c.pt().mean, c.truth));
    const bool weighs = std::any_of(out.result.aovs.begin(), out.result.aovs.end(),
                                    [](const NamedPlane& p) { return p.name == "weight.auto.pw-wide"; });
    CHECK(weighs);
  }
}

TEST_CASE("Of one pass auto takes kpn's image where it runs") {
  if (!dynamic_cast<const ExternalMethod&>(*findMethod("kpn")).skipReason().empty()) return;
  const Case c = noisyCase(1);
  const Estimates e = kept(c, {"pt"});
  const PipelineResult both = runPipeline(e, {"auto", "kpn"}, {});
  REQUIRE(both.find("auto")->ran());
  REQUIRE(both.find("kpn")->ran());
  CHECK(relativeError(both.find("auto")->result.image.mean, c.truth) <
        1.05 * relativeError(both.find("kpn")->result.image.mean, c.truth));
}

TEST_CASE("What rays that miss see of the environment stays as sharp as it is, from one pass on") {
  if (!dynamic_cast<const ExternalMethod&>(*findMethod("kpn")).skipReason().empty()) return;
  Estimates e = kept(noisyCase(1), {"pt"});
  Estimate& pt = e.estimates[0];
  Features& f = *e.features;
  const int width = pt.mean.width(), horizon = pt.mean.height() / 2;
  f.depth.mean = Plane<float>(width, pt.mean.height(), 2.0f);
  const auto sky = [](int x, int y, size_t c) {
    return ((x / 2 + y / 2) % 2 ? 3.0f : 0.4f) + 0.1f * static_cast<float>(c);
  };
  for (int y = 0; y < horizon; ++y)
    for (int x = 0; x < width; ++x) {
      const size_t i = pt.mean[0].index(x, y);
      f.depth.mean[i] = 0;
      for (size_t c = 0; c < 3; ++c) f.albedo.mean[c][i] = pt.mean[c][i] = sky(x, y, c);
    }
  const Rgb<float> image = outputOf(e, "auto").result.image.mean;
  float largest = 0, changed = 0;
  for (int y = 0; y < pt.mean.height(); ++y)
    for (int x = 0; x < width; ++x)
      for (size_t c = 0; c < 3; ++c) {
        const size_t i = pt.mean[0].index(x, y);
        const float difference = std::abs(image[c][i] - pt.mean[c][i]);
        float& most = y < horizon ? largest : changed;
        most = std::max(most, difference);
      }
  CHECK(largest < 1e-3f);
  CHECK(changed > 0.01f);
}

TEST_CASE("kpn helps auto from few samples, and its image is kept only where it is asked for") {
  if (!dynamic_cast<const ExternalMethod&>(*findMethod("kpn")).skipReason().empty()) return;
  AvailableEstimates available;
  available.features = true;
  const auto planOf = [&](uint64_t passes, const std::vector<std::string>& wanted, const CombinePlanOptions& options) {
    available.estimates.resize(1);
    available.estimates[0] = {"pt", true, Correlation::Independent, passes};
    return makeCombinePlan(available, wanted, options);
  };
  for (const uint64_t passes : {1, 2, 255}) {
    const CombinePlan combinePlan = planOf(passes, {"auto"}, {});
    CAPTURE(passes);
    REQUIRE(combinePlan.find("kpn"));
    CHECK(combinePlan.find("kpn")->helper);
    CHECK(combinePlan.find("auto")->bases == std::vector<std::string>{"kpn"});
  }
  CHECK_FALSE(planOf(256, {"auto"}, {}).find("kpn"));
  CHECK_FALSE(planOf(4, {"auto", "kpn"}, {}).find("kpn")->helper);
  CHECK_FALSE(planOf(4, {"auto", "js@kpn"}, {}).find("kpn")->helper);
  CombinePlanOptions options;
  options.helpers = false;
  CHECK_FALSE(planOf(4, {"auto"}, options).find("kpn"));
  options = {};
  options.bases = {"nlm"};
  CHECK_FALSE(planOf(4, {"auto"}, options).find("kpn"));
  options = {};
  options.denoisers = {"nlm"};
  CHECK(planOf(4, {"auto"}, options).find("kpn"));
  CHECK_FALSE(planOf(1, {"auto"}, options).find("kpn"));  // one image is taken, the named one
  // Photon maps, which are fused with the samples, leave the network less to do than it costs, but for a single pass.
  const auto besidePhotonMaps = [&](uint64_t passes) {
    available.estimates = {{"pt", true, Correlation::Independent, passes},
                           {"sppm", false, Correlation::Independent, passes}};
    available.estimates[1].bias = true;
    return makeCombinePlan(available, {"auto"}, {}).find("kpn") != nullptr;
  };
  CHECK(besidePhotonMaps(1));
  CHECK_FALSE(besidePhotonMaps(2));
}

TEST_CASE("auto does without a helper that fails") {
  const Folder folder;
  const std::string broken = (folder.path / "broken.network").string();
  std::ofstream(broken) << "no network";
  nameNetwork("kpn", broken);
  const Estimates e = kept(noisyCase(4), {"pt"});
  const PipelineResult result = runPipeline(e, {"auto"}, {});
  nameNetwork("kpn", "");
  REQUIRE(result.find("auto")->ran());
  CHECK(result.find("auto")->step.bases.empty());
  if (const PipelineOutput* kpn = result.find("kpn")) CHECK_FALSE(kpn->ran());
}

TEST_CASE("Of one pass auto takes the named denoiser's image, for nothing can judge it") {
  const Estimates e = kept(noisyCase(1), {"pt"});
  PipelineOptions options;
  options.roles.denoisers = {"nlm"};
  const PipelineResult both = runPipeline(e, {"auto"}, options);
  REQUIRE(both.find("auto")->ran());
  const Rgb<float>& image = both.find("auto")->result.image.mean;
  const Rgb<float>& named = both.find("nlm")->result.image.mean;
  double apart = 0, size = 0;
  for (size_t i = 0; i < image.size(); ++i) {
    apart += std::fabs(static_cast<double>(image[0][i]) - static_cast<double>(named[0][i]));
    size += std::fabs(static_cast<double>(named[0][i]));
  }
  CHECK(apart < 0.02 * size);  // but for the range of the pixels about it
}

TEST_CASE("Without photon maps the fused estimate is the unbiased one") {
  const Case c = noisyCase(16);
  const FusedEstimate f = fusedEstimate(c.pt(), {}, nullptr);
  CHECK(identical(f.image.mean, c.pt().mean));
  CHECK(identical(f.image.variance, c.pt().variance));
  CHECK(f.squaredBias.empty());
}

TEST_CASE("auto takes a consistent estimate in the place of an unbiased one, as it would that, and never twice") {
  Estimates unbiased = kept(noisyCase(16), {"pt"}), consistent = unbiased;
  consistent.estimates[0].unbiased = false;
  const PipelineOutput one = outputOf(unbiased, "auto"), other = outputOf(consistent, "auto");
  CHECK(other.step.unbiased == "pt");
  CHECK(std::count(other.step.bases.begin(), other.step.bases.end(), "pt") == 0);
  CHECK(other.step.bases == one.step.bases);
  bool same = true;
  for (size_t i = 0; i < one.result.error.size(); ++i)
    same &= one.result.image.mean.pixel(i) == other.result.image.mean.pixel(i) &&
            one.result.error[i] == other.result.error[i];
  CHECK(same);
}

}  // namespace braid::test_auto
