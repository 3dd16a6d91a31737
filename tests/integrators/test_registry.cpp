// SPDX-License-Identifier: Apache-2.0
// What every registered integrator promises. A new one is covered by being in the registry.
#include <chrono>
#include <ctime>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <thread>

#include <doctest/doctest.h>
#include <tbb/global_control.h>

#include "integrators/registry.h"
#include "renderer/core/error.h"
#include "renderer/scene/data/gltf.h"
#include "renderer/session/session.h"
#include "tests/support/chi_squared.h"
#include "tools/bench/builtin_scenes.h"

namespace braid::test_registry {

namespace fs = std::filesystem;

namespace {

using Integrators = std::vector<std::unique_ptr<Integrator>>;

std::string read(const fs::path& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

size_t countMatches(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern);
  return static_cast<size_t>(std::distance(std::sregex_iterator(text.begin(), text.end(), regex), {}));
}

CameraData cameraOf(const Scene& scene) {
  return scene.data().cameras.empty() ? CameraData() : scene.data().cameras[0];
}

Settings smallFrame(int width, int height, uint64_t spp, const std::string& integrator) {
  Settings s;
  s.width = width;
  s.height = height;
  s.spp = spp;
  s.integrators = {integrator};
  return s;
}

RenderResult render(const Scene& scene, const Settings& settings, const Integrators& all) {
  return Session(scene, makePlan(scene, cameraOf(scene), settings, pointersTo(all))).run();
}

bool sameBits(const Rgb<float>& a, const Rgb<float>& b) {
  for (size_t c = 0; c < 3; ++c)
    if (a[c].size() != b[c].size() || std::memcmp(a[c].data.data(), b[c].data.data(), a[c].size() * 4) != 0)
      return false;
  return true;
}

bool sameBits(const RenderResult& a, const RenderResult& b) {
  const Estimate &x = a.estimates->estimates[0], &y = b.estimates->estimates[0];
  const Features &f = *a.estimates->features, &g = *b.estimates->features;
  return sameBits(x.mean, y.mean) && sameBits(x.half[0], y.half[0]) && sameBits(x.half[1], y.half[1]) &&
         sameBits(x.variance, y.variance) && sameBits(f.albedo.mean, g.albedo.mean) &&
         sameBits(f.normal.variance, g.normal.variance);
}

// Finite everywhere and nowhere negative, unless noise may be.
bool sane(const Rgb<float>& image, bool mayBeNegative = false) {
  for (size_t c = 0; c < 3; ++c)
    for (const float v : image[c].data)
      if (!std::isfinite(v) || (v < 0 && !mayBeNegative)) return false;
  return !image.empty();
}

// The mean over an image and over each of four quadrants, per channel: 15 numbers.
std::vector<double> means(const Rgb<float>& image) {
  std::vector<double> result(15, 0.0);
  const int w = image.width(), h = image.height();
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x)
      for (size_t c = 0; c < 3; ++c) {
        const auto quadrant = static_cast<size_t>((2 * x >= w) + 2 * (2 * y >= h));
        const double v = static_cast<double>(image[c].at(x, y));
        result[c] += v / (w * h);
        result[3 + 3 * quadrant + c] += 4 * v / (w * h);
      }
  return result;
}

struct MeanAndError {
  double mean = 0, error = 0;  // error: standard deviation of the mean
};

// Every pass is an independent image with the independent sampler, whatever pixels of a pass share.
std::vector<MeanAndError> meansOfPasses(const Scene& scene, const Integrator& integrator, Settings settings, int passes,
                                        const Integrators& all) {
  settings.sampler = SamplerKind::Independent;
  const Plan plan = makePlan(scene, cameraOf(scene), settings, pointersTo(all));
  const TransportContext context(scene, settings.lightStrategy);
  PassTarget target(settings.width, settings.height, integrator.splats(), plan.kept.features);
  std::vector<double> sum(15), squares(15);
  for (int pass = 0; pass < passes; ++pass) {
    target.clear();
    REQUIRE(integrator.renderPass({context, plan, static_cast<uint64_t>(pass)}, target));
    Accumulator film(settings.width, settings.height, 2);
    film.commit(0, target);
    const std::vector<double> values = means(film.mean());
    for (size_t i = 0; i < values.size(); ++i) {
      sum[i] += values[i];
      squares[i] += values[i] * values[i];
    }
  }
  std::vector<MeanAndError> result;
  for (size_t i = 0; i < sum.size(); ++i) {
    const double mean = sum[i] / passes;
    result.push_back({mean, std::sqrt(std::max(0.0, squares[i] / passes - mean * mean) / (passes - 1))});
  }
  return result;
}

}  // namespace

TEST_CASE("Every file that defines an integrator has a line in the list, and every line a file") {
  const fs::path folder = fs::path(BRAID_SOURCE_DIR) / "integrators";
  size_t files = 0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder))
    if (entry.path().extension() == ".cpp") files += countMatches(read(entry.path()), R"(make_\w+\(\)\s*\{)") > 0;
  const size_t rows = countMatches(read(folder / "list.def"), R"((^|\n)INTEGRATOR\(\w+\))");
  CHECK(files == rows);
  CHECK(makeIntegrators().size() == rows);
}

TEST_CASE("Integrators have distinct names that users can type, and a description") {
  std::set<std::string> names;
  for (const auto& i : makeIntegrators()) {
    CHECK(names.insert(i->name()).second);
    CHECK(std::regex_match(i->name(), std::regex("[a-z][a-z0-9-]*")));
    CHECK(std::string(i->name()) != "auto");
    CHECK(std::strlen(i->description()) > 10);
  }
  CHECK(names.count("pt") == 1);
}

TEST_CASE("An unknown integrator is refused with a list of the known ones") {
  const Scene scene(cornellBox());
  const Integrators all = makeIntegrators();
  std::string text;
  try {
    makePlan(scene, cameraOf(scene), smallFrame(8, 8, 1, "pf"), pointersTo(all));
  } catch (const Error& e) {
    text = e.what();
    CHECK(e.code() == ExitCode::Usage);
  }
  CHECK(text.find("'pf'") != std::string::npos);
  for (const auto& i : all) CHECK(text.find(i->name()) != std::string::npos);
}

namespace {

// How far the expectation of a few passes may be from the truth, relative: photons and merged vertices blur over a few
// pixels, and at corners they miss what lies around them.
double allowedBias(const Integrator& integrator) { return integrator.unbiased() ? 0.0 : 0.02; }

}  // namespace

TEST_CASE("Inside a furnace every integrator sees the closed form" * doctest::test_suite("statistics")) {
  const Integrators all = makeIntegrators();
  for (const float albedo : {0.0f, 0.5f, 0.8f}) {
    const Scene scene(furnace(albedo, 1));
    for (const auto& i : all) {
      Settings settings = smallFrame(16, 16, 1, i->name());
      settings.maxDepth = 200;
      const std::vector<MeanAndError> m = meansOfPasses(scene, *i, settings, 48, all);
      CAPTURE(std::string(i->name()));
      CAPTURE(albedo);
      // 4 standard errors by Student's t with 47 degrees of freedom: a false alarm in 4500 runs for each integrator and
      // albedo. Rounding of the mean of floats allows 10⁻⁶ more.
      const double expected = 1 / (1 - static_cast<double>(albedo));
      CHECK(std::fabs(m[0].mean - expected) <= 4 * m[0].error + (1e-6 + allowedBias(*i)) * expected);
      CHECK(m[0].error < 0.02 * expected);
    }
  }
}

TEST_CASE("Integrators agree on a Cornell box" * doctest::test_suite("statistics")) {
  constexpr double kFalseAlarm = 1e-3;  // of all comparisons together
  const Scene scene(cornellBox());
  const Integrators all = makeIntegrators();
  Settings reference = smallFrame(12, 12, 1, "pt");
  reference.seed = 1000;  // pt is compared too: with itself under another seed
  const auto pt = std::find_if(all.begin(), all.end(), [](const auto& i) { return std::string(i->name()) == "pt"; });
  REQUIRE(pt != all.end());
  const std::vector<MeanAndError> expected = meansOfPasses(scene, **pt, reference, 400, all);
  for (const auto& i : all) {
    const std::vector<MeanAndError> m = meansOfPasses(scene, *i, smallFrame(12, 12, 1, i->name()), 400, all);
    for (size_t k = 0; k < m.size(); ++k) {
      // A frame of 12 x 12 pixels has wide ones: what is merged over five of them is an eighth of the picture.
      const double bias = 4 * allowedBias(*i) * expected[k].mean;
      const double distance = std::max(0.0, std::fabs(m[k].mean - expected[k].mean) - bias);
      const double z = distance / std::hypot(m[k].error, expected[k].error);
      CAPTURE(std::string(i->name()));
      CAPTURE(k);
      CHECK(std::erfc(z / std::sqrt(2.0)) > test::sidak(kFalseAlarm, static_cast<int>(m.size() * all.size())));
    }
  }
}

TEST_CASE("The number of threads changes no bit") {
  // More threads than processors are needed to see tasks stolen.
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const Scene scene(cornellBox());
  const Integrators all = makeIntegrators();
  for (const auto& i : all) {
    Settings settings = smallFrame(50, 37, 5, i->name());
    settings.threads = 1;
    const RenderResult one = render(scene, settings, all);
    for (const int threads : {2, 5}) {
      settings.threads = threads;
      CAPTURE(std::string(i->name()));
      CAPTURE(threads);
      CHECK(sameBits(one, render(scene, settings, all)));
    }
    settings.seed = 1;
    CHECK_FALSE(sameBits(one, render(scene, settings, all)));
  }
}

TEST_CASE("Images of real scenes are finite and nowhere negative") {
  const Integrators all = makeIntegrators();
  for (const char* file : {"cornell", "materials", "glass_of_water", "plates", "sun_sky"}) {
    const Scene scene(loadGltf(std::string(BRAID_SOURCE_DIR) + "/scenes/" + file + ".glb"));
    for (const auto& i : all) {
      const RenderResult r = render(scene, smallFrame(48, 27, 4, i->name()), all);
      CAPTURE(std::string(file));
      CAPTURE(std::string(i->name()));
      CHECK(r.rejected == 0);
      CHECK(sane(r.image, i->mayBeNegative()));
      CHECK(sane(r.estimates->estimates[0].variance));
      CHECK(sane(r.estimates->features->albedo.mean));
      CHECK(means(r.image)[0] > 0);
    }
  }
}

TEST_CASE("Frames of any shape and crops of them render") {
  const Scene scene(cornellBox());
  const Integrators all = makeIntegrators();
  for (const auto& i : all) {
    for (const auto& [width, height] : {std::pair(1, 1), std::pair(1, 17), std::pair(37, 5), std::pair(33, 1)}) {
      const RenderResult r = render(scene, smallFrame(width, height, 3, i->name()), all);
      CAPTURE(std::string(i->name()));
      CAPTURE(width);
      CHECK(r.image.width() == width);
      CHECK(r.image.height() == height);
      CHECK(sane(r.image, i->mayBeNegative()));
    }
    Settings settings = smallFrame(40, 30, 3, i->name());
    settings.crop = PixelWindow{7, 11, 26, 14};
    const RenderResult r = render(scene, settings, all);
    CHECK(r.image.width() == 19);
    CHECK(r.image.height() == 3);
    CHECK(sane(r.image, i->mayBeNegative()));
  }
}

TEST_CASE("A render ends soon after it is told to, and keeps the passes that are done") {
  // A pass takes a good part of a second, with sanitizers as well.
#ifdef __SANITIZE_ADDRESS__
  constexpr int kSide = 160;
#else
  constexpr int kSide = 640;
#endif
  const Scene scene(cornellBox());
  const Integrators all = makeIntegrators();
  for (const auto& i : all) {
    CAPTURE(std::string(i->name()));
    const Plan plan = makePlan(scene, cameraOf(scene), smallFrame(kSide, kSide, 0, i->name()), pointersTo(all));
    std::atomic<bool> stop{true};
    const RenderResult nothing = Session(scene, plan).run({}, nullptr, &stop);
    CHECK((nothing.reason == StopReason::Cancelled));
    CHECK(nothing.estimates->estimates[0].passes == 0);
    const RenderResult onePass = Session(scene, plan).run({}, &stop);
    CHECK((onePass.reason == StopReason::Cancelled));
    CHECK(onePass.estimates->estimates[0].passes == 1);

    stop = false;
    std::clock_t told = 0;
    std::thread user([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      told = std::clock();
      stop = true;
    });
    const RenderResult r = Session(scene, plan).run({}, nullptr, &stop);
    const std::clock_t ended = std::clock();
    user.join();
    CHECK((r.reason == StopReason::Cancelled));
    CHECK(r.estimates->estimates[0].passes == r.rounds);
    // Without a limit of samples it would never end. In seconds of all processors, which other programs do not slow
    // down; sanitizers do.
    CHECK(ended - told < 10 * CLOCKS_PER_SEC);
  }
}

TEST_CASE("Progress goes forward, round by round") {
  const Scene scene(cornellBox());
  const Integrators all = makeIntegrators();
  for (const auto& i : all) {
    CAPTURE(std::string(i->name()));
    Progress last;
    uint64_t calls = 0;
    Session(scene, makePlan(scene, cameraOf(scene), smallFrame(8, 8, 12, i->name()), pointersTo(all)))
        .run([&](const Progress& p) {
          CHECK(p.round == ++calls);
          CHECK(p.rounds == 12);
          CHECK(p.seconds >= last.seconds);
          CHECK((p.secondsLeft >= 0 || p.secondsLeft == -1));
          last = p;
          return true;
        });
    CHECK(calls == 12);
    CHECK(last.secondsLeft == doctest::Approx(0));
  }
}

TEST_CASE("Leaving out what a scene does not need changes no pixel") {
  const Integrators all = makeIntegrators();
  for (const char* file : {"cornell", "materials"}) {
    const std::string path = std::string(BRAID_SOURCE_DIR) + "/scenes/" + file + ".glb";
    LoadOptions everything;
    everything.keepAllAttributes = true;
    SceneOptions full;
    full.full = true;
    const Scene planned(loadGltf(path)), whole(loadGltf(path, everything), full);
    for (const auto& i : all) {
      Settings settings = smallFrame(40, 30, 4, i->name());
      const RenderResult a = render(planned, settings, all);
      settings.full = true;
      const RenderResult b = render(whole, settings, all);
      CAPTURE(std::string(file));
      CAPTURE(std::string(i->name()));
      CHECK(sameBits(a.image, b.image));
      CHECK(sameBits(a.estimates->features->albedo.mean, b.estimates->features->albedo.mean));
    }
  }
}

TEST_CASE("A transparent background gives the share of each pixel that is covered") {
  // A quad with coverage 0.3 in front of nothing fills the left half of the view.
  SceneData data;
  data.materials = {diffuseMaterial(Spectrum(0.5f))};
  data.materials[0].alphaMode = AlphaMode::Blend;
  data.materials[0].alpha = 0.3f;
  TriangleMesh quad;
  addQuad(quad, {-10, -10, -1}, {10, 0, 0}, {0, 20, 0});
  addMesh(data, std::move(quad), 0);
  data.environment.emplace().radiance = Spectrum(1);
  const Scene scene(std::move(data));
  const Integrators all = makeIntegrators();
  for (const auto& i : all) {
    Settings settings = smallFrame(16, 16, 256, i->name());
    CHECK_FALSE(render(scene, settings, all).alpha.has_value());
    settings.transparent = true;
    const RenderResult r = render(scene, settings, all);
    CAPTURE(std::string(i->name()));
    REQUIRE(r.alpha.has_value());
    double covered = 0;
    for (int y = 0; y < 16; ++y)
      for (int x = 0; x < 16; ++x) {
        const float a = r.alpha->at(x, y);
        if (x == 8) continue;  // a ray may graze the edge of the quad
        if (x > 8) {
          CHECK(a == 0);
          CHECK(r.image.pixel(r.alpha->index(x, y)) == Vec3(0));
        } else {
          covered += static_cast<double>(a) / 128;
          CHECK((a > 0.1f && a < 0.5f));
        }
      }
    // 128 pixels × 256 samples of a coin: 4 standard deviations are 0.0101. With common random numbers all pixels of a
    // pass see the same coin: 256 samples, 0.1146.
    CHECK(std::fabs(covered - 0.3) < (i->correlation() == Correlation::CommonRandomNumbers ? 0.1146 : 0.0102));
  }
}

}  // namespace braid::test_registry
