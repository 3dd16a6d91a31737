// SPDX-License-Identifier: Apache-2.0
// `braid compare`: output, limits, layers, messages and the command line.
#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <iostream>
#include <sstream>
#include <string>
#include <utility>

#include <CLI/CLI.hpp>
#include <doctest/doctest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "tools/commands/compare.h"
#include "tools/metrics/identical.h"
#include "tools/metrics/metrics.h"

namespace braid::test_compare {

namespace {

Rgb<float> constant(int w, int h, const Vec3& v) {
  Rgb<float> image(w, h);
  for (size_t i = 0; i < image.size(); ++i) image.set(i, v);
  return image;
}

struct Files {
  std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("braid-test-compare-" + std::to_string(::getpid()));
  Files() { std::filesystem::create_directories(folder); }
  ~Files() { std::filesystem::remove_all(folder); }
  std::string write(const std::string& name, const Rgb<float>& image, const Estimates& estimates = {}) const {
    ExrOptions options;
    options.floatHeadline = true;
    const std::string path = (folder / name).string();
    writeExr(path, estimates, image, nullptr, options);
    return path;
  }
};

}  // namespace

TEST_CASE("compare: text, JSON, limits and layers") {
  const Files files;
  const Rgb<float> grey = constant(8, 6, Vec3(0.5f));
  Estimates estimates;
  estimates.estimates.emplace_back();
  estimates.estimates[0].name = "pt";
  estimates.estimates[0].mean = grey;
  CompareOptions options;
  options.image = files.write("a.exr", constant(8, 6, Vec3(1)), estimates);
  options.reference = files.write("r.exr", grey);
  options.metrics = {"MSE", "relL2"};
  std::ostringstream out, warnings;
  CHECK(runCompare(options, out, warnings) == 0);
  CHECK(out.str() == "MSE 0.25\nrelL2 0.961538\n");
  CHECK(warnings.str().empty());

  options.max = 0.2;
  CHECK(runCompare(options, out, warnings) == 6);
  CHECK(warnings.str() == "MSE 0.25 is above --max 0.2\n");
  options.max = 0.25;
  options.json = true;
  out.str("");
  CHECK(runCompare(options, out, warnings) == 0);
  const auto json = nlohmann::json::parse(out.str());
  CHECK(json["schema"] == 1);
  CHECK(json["metrics"]["MSE"] == 0.25);
  CHECK(json["width"] == 8);
  CHECK(json["passed"] == true);

  options.layer = "pt";
  options.max = 0;
  CHECK(runCompare(options, out, warnings) == 0);
  options.max.reset();
  options.metrics.clear();
  options.json = false;
  out.str("");
  CHECK(runCompare(options, out, warnings) == 0);
  const std::string lines = out.str();
  CHECK(std::count(lines.begin(), lines.end(), '\n') == static_cast<std::ptrdiff_t>(metricRegistry().size()));
  CHECK(lines.find("PSNR inf\n") != std::string::npos);
}

TEST_CASE("compare: mistakes are named") {
  const Files files;
  CompareOptions options;
  options.image = files.write("a.exr", constant(8, 6, Vec3(1)));
  options.reference = files.write("r.exr", constant(6, 8, Vec3(1)));
  std::ostringstream out, warnings;
  const auto failure = [&] {
    try {
      runCompare(options, out, warnings);
    } catch (const Error& e) {
      return std::pair(e.code(), std::string(e.what()));
    }
    return std::pair(ExitCode::Ok, std::string());
  };
  const auto [code, text] = failure();
  CHECK(code == ExitCode::BadInput);
  CHECK(text == options.image + ": 8x6 pixels, but " + options.reference + " has 6x8; compare images of one size");
  options.metrics = {"L3"};
  CHECK(failure().first == ExitCode::Usage);
  CHECK(failure().second.find("known are relL2, relMSE, MSE") != std::string::npos);
  options.metrics = {"PSNR"};
  options.max = 3;
  CHECK(failure().first == ExitCode::Usage);
  options.metrics = {"MSE"};
  options.trimPercent = 100;
  CHECK(failure().first == ExitCode::Usage);
  options.trimPercent = 0;
  options.reference = "/nonexistent/r.exr";
  CHECK(failure().first == ExitCode::BadInput);
  CHECK(out.str().empty());
}

TEST_CASE("compare: the command line") {
  const Files files;
  const std::string a = files.write("a.exr", constant(4, 4, Vec3(1))),
                    r = files.write("r.exr", constant(4, 4, Vec3(2)));
  CLI::App app;
  std::function<int()> action;
  addCompare(app, action);
  // The list of metrics must not swallow the files that follow it.
  app.parse("compare --metric MSE,FLIP " + a + " " + r + " --max 0.5 --trim 1 --json");
  REQUIRE(action);
  std::ostringstream captured;
  std::streambuf* const old = std::cout.rdbuf(captured.rdbuf());
  std::streambuf* const oldErrors = std::cerr.rdbuf(captured.rdbuf());
  const int code = action();
  std::cout.rdbuf(old);
  std::cerr.rdbuf(oldErrors);
  CHECK(code == 6);
  CHECK(captured.str().find("\"passed\": false") != std::string::npos);
  CHECK(app.get_subcommand("compare")->help().find("SMAPE") != std::string::npos);
}

TEST_CASE("--identical sees one bit of one channel, and says where") {
  const Plane<float> plane(3, 2, 0.5f);
  ImageFile a;
  a.path = "a.exr", a.width = 3, a.height = 2;
  a.window = {0, 0, 3, 2};
  a.planes = {{"R", plane}, {"pt.mean.R", plane}};
  ImageFile b = a;
  CHECK(firstDifference(a, b).empty());
  b.planes.at("pt.mean.R").at(2, 1) = std::nextafter(0.5f, 1.0f);
  CHECK(firstDifference(a, b).starts_with("channel pt.mean.R, pixel 2,1: 0.5 and 0.5"));
  b = a;
  b.planes.at("R").at(0, 0) = std::numeric_limits<float>::quiet_NaN();
  CHECK(firstDifference(b, b).empty());
  CHECK_FALSE(firstDifference(a, b).empty());
  b = a;
  b.planes.erase("R");
  CHECK(firstDifference(a, b) == "channel R is not in a.exr");
}

}  // namespace braid::test_compare
