// SPDX-License-Identifier: Apache-2.0
// Open Image Denoise by its weights: against nested loops with random weights, and, where the published weights are,
// against what another implementation of the networks makes of the same pixels.
#include <doctest/doctest.h>

#include <cmath>
#include <limits>

#include "combiners/denoise/oidn/oidn.h"
#include "combiners/denoise/oidn/oidn_transfer.h"
#include "combiners/denoise/oidn/oidn_unet.h"
#include "combiners/pipeline/external_method.h"
#include "renderer/core/error.h"
#include "tests/support/combiner_fixture.h"
#include "tests/support/gltf_fixture.h"
#include "tests/combiners/learned/plain_network.h"

namespace braid::test_oidn_networks {

using namespace test;

namespace {

constexpr int kChannels = 6;

// Random weights under the names of those that are published.
void writeAll(const Folder& folder) {
  const auto write = [&](const std::string& name, int inputs, bool large = false) {
    writeTza((folder.path / (name + ".tza")).string(), randomUnet(inputs, kChannels, large, name.size()));
  };
  for (const std::string size : {"", "_small"}) {
    write("rt_hdr" + size, 3);
    write("rt_hdr_alb" + size, 6);
    write("rt_hdr_alb_nrm" + size, 9);
    write("rt_hdr_calb_cnrm" + size, 9);
  }
  write("rt_hdr_calb_cnrm_large", 9, true);
  for (const std::string name : {"rt_alb", "rt_nrm"}) {
    write(name, 3);
    write(name + "_large", 3, true);
  }
}

std::unique_ptr<Method> oidnOf(const Folder& folder) {
  return makeOidn(nullptr, "not here", {folder.path.string(), true});
}

MethodInputs withOptions(MethodInputs in, double network, double prefilter) {
  in.options.set("oidn-network", network);
  in.options.set("oidn-prefilter", prefilter);
  return in;
}

template <class Encode>
void addChannels(Planar& to, int first, const Rgb<float>& image, const Encode& encode) {
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < to.height; ++y)
      for (int x = 0; x < to.width; ++x) to.at(first + c, x, y) = encode(image[static_cast<size_t>(c)].at(x, y));
}

Planar plain(const Folder& folder, const std::string& name, const Planar& in) {
  return plainNetwork(oidnUnet(readTza((folder.path / (name + ".tza")).string())), in, 16);
}

float clamped(float v, float lo, float hi) { return std::clamp(v, lo, hi); }

// As the method, by nested loops.
Planar denoised(const Folder& folder, const std::string& size, bool prefilter, const Rgb<float>& colour,
                const Features& features) {
  const int width = colour.width(), height = colour.height();
  Planar in(9, width, height), albedo(3, width, height), normal(3, width, height);
  addChannels(in, 0, colour, oidnEncoded);
  addChannels(albedo, 0, features.albedo.mean, [](float v) { return clamped(v, 0, 1); });
  addChannels(normal, 0, features.normal.mean, [](float v) { return 0.5f * clamped(v, -1, 1) + 0.5f; });
  if (prefilter) {
    albedo = plain(folder, size == "_large" ? "rt_alb_large" : "rt_alb", albedo);
    normal = plain(folder, size == "_large" ? "rt_nrm_large" : "rt_nrm", normal);
    for (Planar* image : {&albedo, &normal})
      for (float& value : image->values) value = clamped(value, 0, 1);
  }
  std::copy(albedo.values.begin(), albedo.values.end(), in.values.begin() + 3 * width * height);
  std::copy(normal.values.begin(), normal.values.end(), in.values.begin() + 6 * width * height);
  Planar out = plain(folder, (prefilter ? "rt_hdr_calb_cnrm" : "rt_hdr_alb_nrm") + size, in);
  for (float& value : out.values) value = oidnDecoded(value);
  return out;
}

double differenceOf(const Rgb<float>& image, const Planar& expected) {
  Planar got(3, image.width(), image.height());
  addChannels(got, 0, image, [](float v) { return v; });
  return largestDifference(got, expected);
}

}  // namespace

TEST_CASE("The transfer function has no steps, an inverse, and an answer to any value") {
  for (float radiance = 1e-8f; radiance < 6e4f; radiance *= 1.01f) {
    CHECK(oidnDecoded(oidnEncoded(radiance)) == doctest::Approx(radiance).epsilon(1e-3));
    CHECK(oidnEncoded(1.01f * radiance) > oidnEncoded(radiance));
    CHECK(oidnEncoded(1.01f * radiance) - oidnEncoded(radiance) < 0.01);
  }
  CHECK(oidnEncoded(kOidnMostRadiance) == 1);
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  CHECK(oidnEncoded(infinity) == 1);
  for (const float none : {0.0f, -1.0f, -infinity, nan}) {
    CHECK(oidnEncoded(none) == 0);
    CHECK(oidnDecoded(none) == 0);
  }
  CHECK(std::isfinite(oidnDecoded(infinity)));
}

TEST_CASE("oidn by random weights is what nested loops make, for every network, and each half for itself") {
  if (!oneDnn()) return;
  const Folder folder;
  writeAll(folder);
  const Case c = makeCase(sized(37, 21));
  const MethodInputs in = inputsOf(c);
  const auto method = oidnOf(folder);
  CHECK(dynamic_cast<const ExternalMethod&>(*method).skipReason().empty());
  const std::string sizes[] = {"_small", "", "_large"};
  for (int size = 0; size < 3; ++size)
    for (const bool prefilter : {false, true}) {
      const MethodResult r = method->run(withOptions(in, size, prefilter));
      INFO("network ", size, ", prefilter ", prefilter);
      const bool clean = prefilter || size == 2;
      CHECK(differenceOf(r.image.mean, denoised(folder, sizes[size], clean, c.pt().mean, *c.estimates.features)) <
            1e-4);
      Features half = *c.estimates.features;
      half.albedo.mean = half.albedo.half[1];
      half.normal.mean = half.normal.half[1];
      CHECK(r.remarks.at(0).text == (clean ? "rt_hdr_calb_cnrm" : "rt_hdr_alb_nrm") + sizes[size]);
      CHECK(differenceOf(r.image.half[1], denoised(folder, sizes[size], clean, c.pt().half[1], half)) < 1e-4);
    }
}

TEST_CASE("oidn takes what features there are") {
  if (!oneDnn()) return;
  const Folder folder;
  writeAll(folder);
  Case c = makeCase(sized(20, 18));
  Planar in(6, 20, 18);
  addChannels(in, 0, c.pt().mean, oidnEncoded);
  addChannels(in, 3, c.estimates.features->albedo.mean, [](float v) { return clamped(v, 0, 1); });
  const auto decoded = [](Planar image) {
    for (float& value : image.values) value = oidnDecoded(value);
    return image;
  };
  c.estimates.features->normal = {};
  for (const double prefilter : {0.0, 1.0})
    CHECK(differenceOf(oidnOf(folder)->run(withOptions(inputsOf(c), 1, prefilter)).image.mean,
                       decoded(plain(folder, "rt_hdr_alb", in))) < 1e-4);
  c.estimates.features.reset();
  in.channels = 3;
  in.values.resize(3 * 20 * 18);
  for (const double network : {1.0, 2.0})
    CHECK(differenceOf(oidnOf(folder)->run(withOptions(inputsOf(c), network, 1)).image.mean,
                       decoded(plain(folder, "rt_hdr", in))) < 1e-4);
}

TEST_CASE("oidn makes finite images of any size and of any values") {
  if (!oneDnn()) return;
  const Folder folder;
  writeAll(folder);
  for (const auto& [width, height] : std::vector<std::pair<int, int>>{{1, 1}, {2, 33}, {400, 1}, {17, 16}}) {
    Case c = makeCase(sized(width, height));
    Estimate& pt = c.estimates.estimates[0];
    const float largest = std::numeric_limits<float>::max();
    const float strange[] = {-largest,
                             largest,
                             0,
                             -1,
                             1e-30f,
                             std::numeric_limits<float>::infinity(),
                             std::numeric_limits<float>::quiet_NaN()};
    for (size_t i = 0; i < pt.mean.size(); ++i)
      if (i % 3 == 0) pt.mean[i % 2][i] = strange[i % 7];
    for (const double prefilter : {0.0, 1.0}) {
      const MethodResult r = oidnOf(folder)->run(withOptions(inputsOf(c), 1, prefilter));
      CHECK(r.image.mean.width() == width);
      CHECK(r.image.half[0].height() == height);
      CHECK(badPlanes(r) == "");
    }
  }
}

TEST_CASE("oidn says which weights are missing or wrong, and prefers those that a user names") {
  const Folder folder;
  std::string reason;
  const ConvolutionLibrary* library = openConvolutions(reason);
  const auto skipReason = [](const std::unique_ptr<Method>& m) {
    return dynamic_cast<const ExternalMethod&>(*m).skipReason();
  };
  CHECK(skipReason(oidnOf(folder)) == reason);
  const std::string nowhere = (folder.path / "no").string();
  CHECK(skipReason(makeOidn(nullptr, "", {nowhere, true})).find("no such folder of weights") != std::string::npos);
  const OidnApi api;
  CHECK(skipReason(makeOidn(&api, "", {nowhere, false})) == "");
  CHECK(skipReason(makeOidn(&api, "", {nowhere, true})) != "");
  CHECK(skipReason(makeOidn(nullptr, "neither", {})) == "neither");
  if (!library) return;
  const Case c = makeCase(sized(8, 8));
  const auto refused = [&](const char* text) {
    CHECK_THROWS_WITH_AS(oidnOf(folder)->run(inputsOf(c)), doctest::Contains(text), Error);
  };
  refused("rt_hdr_alb_nrm.tza: there are no such weights: fetch them with tools/setup oidn");
  folder.write("rt_hdr_alb_nrm.tza", "no weights");
  refused("rt_hdr_alb_nrm.tza: no TZA file");
  WeightTensors weights = randomUnet(9, kChannels, false);
  weights.erase("dec_conv2a.bias");
  writeTza((folder.path / "rt_hdr_alb_nrm.tza").string(), weights);
  refused("rt_hdr_alb_nrm.tza: dec_conv2a.bias is missing");
  writeTza((folder.path / "rt_hdr_alb_nrm.tza").string(), randomUnet(3, kChannels, false));
  refused("rt_hdr_alb_nrm.tza: it reads 3 channels instead of 9");
  weights = randomUnet(9, kChannels, false);
  weights["enc_conv3.weight"] = randomWeights(3, 3, 3, 1);
  writeTza((folder.path / "rt_hdr_alb_nrm.tza").string(), weights);
  refused("rt_hdr_alb_nrm.tza: layer enc_conv3: ");
}

namespace {

// An image of random pixels without a scale: image(1) times 2, image(2), and image(3) from -1 to 1.
Rgb<float> randomImage(uint64_t seed, float scale, float offset) {
  Rgb<float> image(40, 24);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < image.size(); ++i) image[c][i] = scale * noiseAt(seed, c * image.size() + i) + offset;
  return image;
}

struct Published {
  OidnSize size;
  bool prefilter;
  int features;  // 0: none, 1: albedo, 2: normals too
  std::vector<float> values;
};

}  // namespace

TEST_CASE("By the published weights oidn makes what another implementation of the networks makes of them") {
  const OidnWeights weights = findOidnWeights();
  if (weights.folder.empty()) {
    MESSAGE("not tested: there are no published weights; tools/setup oidn fetches them");
    return;
  }
  const ConvolutionLibrary* library = oneDnn();
  if (!library) return;
  const Rgb<float> colour = randomImage(1, 2, 0), albedo = randomImage(2, 1, 0), normal = randomImage(3, 2, -1);
  for (const Published& p :
       std::vector<Published>{{OidnSize::Small, false, 2, {0.7122254f, 0.9670868f, 0.9316765f, 0.9655059f}},
                              {OidnSize::Small, true, 2, {0.933471f, 0.7203711f, 1.022524f, 0.9139475f}},
                              {OidnSize::Base, false, 2, {1.218567f, 1.483466f, 1.012742f, 0.9920399f}},
                              {OidnSize::Base, true, 2, {1.403409f, 0.6293255f, 1.007342f, 0.8652701f}},
                              {OidnSize::Large, true, 2, {0.9390377f, 0.9789741f, 1.005673f, 0.9662012f}},
                              {OidnSize::Base, false, 0, {1.301949f, 0.4350329f, 0.9618409f, 1.061698f}},
                              {OidnSize::Base, false, 1, {1.391063f, 1.076054f, 0.9760355f, 0.900571f}},
                              {OidnSize::Small, false, 0, {0.9652618f, 0.696322f, 0.9593313f, 0.9244254f}},
                              {OidnSize::Small, false, 1, {0.8341737f, 1.118347f, 1.027372f, 1.024956f}}}) {
    OidnNetworks networks(weights.folder, {p.size, p.prefilter, nullptr}, *library);
    const Rgb<float> out =
        networks.denoise(colour, p.features > 0 ? &albedo : nullptr, p.features > 1 ? &normal : nullptr);
    const float got[] = {out[0].at(0, 0), out[1].at(39, 23), out[2].at(20, 5), out[0].at(7, 17)};
    for (size_t k = 0; k < 4; ++k) CHECK(got[k] == doctest::Approx(p.values[k]).epsilon(1e-4));
  }
}

}  // namespace braid::test_oidn_networks
