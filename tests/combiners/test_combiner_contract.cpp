// SPDX-License-Identifier: Apache-2.0
// What every registered denoiser and combiner must keep: the same bits for any number of threads, an end soon after it
// is told to, behaviour that does not depend on the units of light, and names that users can type. The registry is
// iterated, so a new method is covered by being in it.
#include <atomic>
#include <chrono>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>
#include <thread>

#include <doctest/doctest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "renderer/core/parallel.h"
#include "renderer/film/files/exr.h"
#include "tests/support/every_method.h"
#include "tests/support/gltf_fixture.h"
#include "tools/images/estimates_file.h"

namespace braid::test_combiner_contract {

using namespace test;
namespace fs = std::filesystem;

namespace {

bool sameBits(const MethodResult& a, const MethodResult& b) {
  return identical(a.image.mean, b.image.mean) && identical(a.image.half[0], b.image.half[0]) &&
         identical(a.image.half[1], b.image.half[1]) && identical(a.error, b.error);
}

std::string fileText(const fs::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

}  // namespace

TEST_CASE("Every file that makes a method has a line in combiners/list.def, and every line a file") {
  const fs::path folder = fs::path(BRAID_SOURCE_DIR) / "combiners";
  const std::regex maker(R"(make_(\w+)\(\)\s*\{)"), row(R"((^|\n)METHOD\((\w+)\))");
  std::set<std::string> files, rows;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".cpp") continue;
    const std::string text = fileText(entry.path());
    for (std::sregex_iterator m(text.begin(), text.end(), maker), end; m != end; ++m) files.insert((*m)[1]);
  }
  const std::string list = fileText(folder / "list.def");
  for (std::sregex_iterator m(list.begin(), list.end(), row), end; m != end; ++m) rows.insert((*m)[2]);
  CHECK(files == rows);
  CHECK(makeMethods().size() == rows.size());
}

TEST_CASE("Methods have distinct names that users can type, a description, and options with their name") {
  std::set<std::string> names;
  for (const auto& m : makeMethods()) {
    const std::string name = m->name();
    CAPTURE(name);
    CHECK(names.insert(name).second);
    CHECK(std::regex_match(name, std::regex("[a-z][a-z0-9-]*")));
    CHECK(name != "none");
    CHECK(std::strlen(m->description()) > 10);
    for (const OptionInfo& o : m->options()) {
      CAPTURE(o.name);
      CHECK(std::regex_match(o.name, std::regex("[a-z][a-z0-9-]*-[a-z0-9-]+")));
      CHECK(o.description.size() > 5);
      CHECK(std::isfinite(o.fallback));
    }
  }
}

TEST_CASE("The number of threads changes no bit of any method") {
  const tbb::global_control many(tbb::global_control::max_allowed_parallelism, 8);
  const Estimates e = everything(makeCase(sized(67, 45)));
  for (const auto& m : runnableMethods()) {
    CAPTURE(std::string(m->name()));
    MethodResult results[3];
    size_t k = 0;
    for (const int threads : {1, 2, 5}) {
      tbb::task_arena arena(threads);
      results[k++] = arena.execute([&] { return outputOf(*m, e).result; });
    }
    CHECK(sameBits(results[0], results[1]));
    CHECK(sameBits(results[0], results[2]));
  }
}

TEST_CASE("Every method ends soon after it is told to") {
  const Case c = makeCase(sized(640, 400, 8));
  const Estimates estimates = everything(c);
  for (const auto& m : runnableMethods()) {
    std::string name = m->name();
    INFO(name);
    const auto processorSeconds = [&](bool told) {
      const std::atomic<bool> cancel{told};
      Estimates many = estimates;
      many.estimates[0].passes = 128;
      MethodInputs in;
      in.unbiased = &many.estimates[0];
      in.biased = many.find("narrow");
      in.correlated = many.find("crn");
      in.features = &*many.features;
      in.reference = &many.reference;
      in.history = &many.history.at("pt");
      in.bases = {many.find("narrow"), many.find("wide")};
      in.redenoise = [](const Rgb<float>& image) { return image; };
      in.cancel = &cancel;
      const std::clock_t begin = std::clock();
      cancellable(&cancel, [&] { m->run(in); });
      return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    };
    // In seconds of all processors, which other programs do not slow down.
    const double whole = processorSeconds(false), told = processorSeconds(true);
    CHECK(told < std::max(0.1, 0.25 * whole));
  }
}

TEST_CASE("A method that is told to end at any moment ends, and the pipeline goes on to nothing else") {
  const Case c = makeCase(sized(160, 100));
  const Estimates estimates = everything(c);
  for (const auto& m : runnableMethods())
    for (int delay = 0; delay < 4; ++delay) {
      std::string name = m->name();
      if (m->needs().biased) name += m->needs().redenoise ? "@box" : "@sppm";
      std::atomic<bool> cancel{false};
      PipelineOptions options = basesNamed();
      options.cancel = &cancel;
      std::thread user([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(3 * delay * delay));
        cancel = true;
      });
      CHECK_NOTHROW(runPipeline(estimates, {name}, options));
      user.join();
      CHECK(runPipeline(estimates, {name}, options).outputs.empty());
    }
}

TEST_CASE("What a method does not ask for does not change its image") {
  const Estimates all = everything(makeCase(sized(48, 36)));
  const auto without = [&](const auto& remove) {
    Estimates e = all;
    remove(e);
    return e;
  };
  const Estimates noFeatures = without([](Estimates& e) { e.features.reset(); });
  const Estimates noNoise = without([](Estimates& e) {
    const auto remove = [](auto& f) { f.half[0] = f.half[1] = f.variance = {}; };
    remove(e.features->albedo);
    remove(e.features->normal);
    remove(e.features->depth);
    remove(e.features->visibility);
  });
  const Estimates noQuarters = without([](Estimates& e) {
    for (Estimate& x : e.estimates) x.quarter.clear();
  });
  const Estimates noHistory = without([](Estimates& e) { e.history.clear(); });
  const Estimates noReference = without([](Estimates& e) { e.reference = {}; });
  // The method as it is called here may want more than alone: its input's denoiser reads what it needs.
  for (const auto& m : runnableMethods()) {
    CAPTURE(std::string(m->name()));
    const Needs needs = m->needs();
    const MethodResult whole = outputOf(*m, all).result;
    if (!needs.helpful.features) CHECK(sameBits(outputOf(*m, noFeatures).result, whole));
    if (!needs.helpful.featureNoise) CHECK(sameBits(outputOf(*m, noNoise).result, whole));
    if (!needs.quarters && !needs.helpful.quarters) CHECK(sameBits(outputOf(*m, noQuarters).result, whole));
    if (needs.checkpoints == 0) CHECK(sameBits(outputOf(*m, noHistory).result, whole));
    if (!needs.reference) CHECK(sameBits(outputOf(*m, noReference).result, whole));
  }
}

TEST_CASE("Scaling all lights scales the image of every method and nothing else") {
  CaseOptions o = sized(48, 36);
  const Estimates one = everything(makeCase(o));
  for (const double light : {1e-6, 1e6}) {
    o.light = light;
    const Estimates scaled = everything(makeCase(o));
    for (const auto& m : runnableMethods()) {
      CAPTURE(std::string(m->name()));
      CAPTURE(light);
      MethodResult a = outputOf(*m, one).result, b = outputOf(*m, scaled).result;
      undoExposure(b, light);
      // The scaled samples are rounded anew; a choice between equals may fall the other way in a pixel.
      CHECK(relativeDistance(b.image.mean, a.image.mean) < 1e-3);
      if (a.error.empty()) continue;
      double sums[2] = {0, 0};
      for (size_t i = 0; i < a.error.size(); ++i) {
        sums[0] += static_cast<double>(a.error[i]);
        sums[1] += static_cast<double>(b.error[i]);
      }
      CHECK(sums[1] == doctest::Approx(sums[0]).epsilon(1e-2));
    }
  }
}

TEST_CASE("From files every method makes what it makes in process") {
  const Folder folder;
  Estimates e = everything(makeCase(sized(40, 30)));
  const std::string path = folder.path / "all.exr";
  ExrOptions options;
  options.quarters = options.history = true;
  e.attributes = estimateAttributes(e);
  writeExr(path, e, e.estimates[0].mean, nullptr, options);
  Estimates read = readEstimates(readImage(path));
  read.reference = e.reference;  // a file of its own
  REQUIRE(read.estimates.size() == e.estimates.size());
  for (const auto& m : runnableMethods()) {
    CAPTURE(std::string(m->name()));
    const PipelineOutput a = outputOf(*m, e), b = outputOf(*m, read);
    INFO(b.step.skipReason);
    REQUIRE(b.ran());
    CHECK(sameBits(a.result, b.result));
  }
}

}  // namespace braid::test_combiner_contract
