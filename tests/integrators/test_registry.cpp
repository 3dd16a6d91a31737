// SPDX-License-Identifier: Apache-2.0
// What every registered integrator promises of how it runs: threads, shapes, ends, progress. A new one is covered by
// being in the registry.
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
#include "renderer/session/session.h"
#include "tools/bench/builtin_scenes.h"
#include "tests/integrators/small_renders.h"

namespace braid::test_registry {

namespace fs = std::filesystem;
using namespace test::small_renders;

namespace {

std::string read(const fs::path& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

size_t countMatches(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern);
  return static_cast<size_t>(std::distance(std::sregex_iterator(text.begin(), text.end(), regex), {}));
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

}  // namespace braid::test_registry
