// SPDX-License-Identifier: Apache-2.0
// Image files: channel names, bit-exact round trips, reproducible bytes, and failures that leave nothing behind.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <limits>
#include <set>

#include <doctest/doctest.h>
#include <sys/resource.h>
#include <unistd.h>

#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "tests/film/exr_files.h"

namespace braid::test_exr {

namespace fs = std::filesystem;
using namespace test::exr_files;

namespace {

bool same(const Plane<float>& a, const Plane<float>& b) {
  return a.width == b.width && a.height == b.height && std::memcmp(a.data.data(), b.data.data(), 4 * a.size()) == 0;
}
bool same(const Rgb<float>& a, const Rgb<float>& b) { return same(a[0], b[0]) && same(a[1], b[1]) && same(a[2], b[2]); }

const Attribute* findAttribute(const ImageFile& f, const std::string& name) {
  const auto a =
      std::find_if(f.attributes.begin(), f.attributes.end(), [&](const Attribute& x) { return x.name == name; });
  return a == f.attributes.end() ? nullptr : &*a;
}

}  // namespace

TEST_CASE("statistics survive a file bit for bit, under the documented names") {
  const Folder folder;
  const std::string path = folder.file("a.exr");
  const Estimates all = sampleEstimates(37, 133);
  const Rgb<float> error = colour(37, 133, 1e-12f);
  ExrOptions options;
  options.quarters = true;
  options.layers = {{"combined.js", &error}, {"Error", nullptr, &error[1]}};
  writeExr(path, all, all.estimates[0].mean, nullptr, options);
  const ImageFile f = readImage(path);
  CHECK((f.width == 37 && f.height == 133));
  for (const Estimate& e : all.estimates) {
    CHECK(same(f.rgb(e.name + ".mean"), e.mean));
    CHECK(same(f.rgb(e.name + ".halfA"), e.half[0]));
    CHECK(same(f.rgb(e.name + ".halfB"), e.half[1]));
    CHECK(same(f.rgb(e.name + ".variance"), e.variance));
  }
  CHECK(same(f.rgb("pt.q3"), all.estimates[0].quarter[3]));
  CHECK(same(f.rgb("combined.js"), error));
  CHECK(f.planes.at("Error.Y").data == error[1].data);
  CHECK(f.rgb("Error")[2].data == error[1].data);
  CHECK(same(f.rgb("Albedo"), all.features->albedo.mean));
  CHECK(same(f.rgb("AlbedoB"), all.features->albedo.half[1]));
  CHECK(same(f.rgb("AlbedoVariance"), all.features->albedo.variance));
  CHECK(same(f.rgb("NA"), all.features->normal.half[0]));
  CHECK(same(f.planes.at("N.X"), all.features->normal.mean[0]));
  CHECK(same(f.planes.at("NVariance.Z"), all.features->normal.variance[2]));
  CHECK(same(f.planes.at("Depth.Z"), all.features->depth.mean));
  CHECK(same(f.planes.at("DepthA.Z"), all.features->depth.half[0]));
  CHECK(same(f.planes.at("DepthVariance.Z"), all.features->depth.variance));
  CHECK(same(f.planes.at("Visibility.V"), all.features->visibility.mean));
  CHECK(same(f.planes.at("VisibilityB.V"), all.features->visibility.half[1]));
  CHECK(same(f.planes.at("VisibilityVariance.V"), all.features->visibility.variance));
  // The headline is half: 11 bits.
  CHECK(f.rgb()[0].at(3, 4) == doctest::Approx(all.estimates[0].mean[0].at(3, 4)).epsilon(1.0 / 2048));
  CHECK(f.channelNames.size() == 3 + 2 * 12 + 12 + 3 + 1 + 4 * (3 + 3 + 1 + 1));
  CHECK(folder.count() == 1);
}

TEST_CASE("how much is written follows the options") {
  const Folder folder;
  const std::string path = folder.file("a.exr");
  const Estimates all = sampleEstimates(4, 3);
  ExrOptions options;
  const auto names = [&](const Plane<float>* alpha) {
    writeExr(path, all, all.estimates[0].mean, alpha, options);
    const ImageFile f = readImage(path);
    return std::set<std::string>(f.channelNames.begin(), f.channelNames.end());
  };
  options.aovs = AovSet::None;
  CHECK(names(nullptr) == std::set<std::string>{"R", "G", "B"});
  const Plane<float> alpha(4, 3, 0.5f);
  CHECK(names(&alpha) == std::set<std::string>{"R", "G", "B", "A"});
  options.aovs = AovSet::Features;
  options.layerPrefix = "ViewLayer";
  CHECK(names(nullptr) == std::set<std::string>{"R", "G", "B", "ViewLayer.Albedo.R", "ViewLayer.Albedo.G",
                                                "ViewLayer.Albedo.B", "ViewLayer.N.X", "ViewLayer.N.Y", "ViewLayer.N.Z",
                                                "ViewLayer.Depth.Z", "ViewLayer.Visibility.V"});
  options.aovs = AovSet::All;
  options.layerPrefix = "";
  CHECK(names(nullptr).count("pt.q0.R") == 0);
  options.floatHeadline = true;
  CHECK(names(nullptr).count("combined.js.variance.B") == 1);
  CHECK(same(readImage(path).rgb(), all.estimates[0].mean));
}

TEST_CASE("the headline is clamped to the range of half floats, and counted") {
  const Folder folder;
  const std::string path = folder.file("a.exr");
  Rgb<float> headline(3, 70, 1);
  headline[0].at(1, 2) = 65504;
  headline[1].at(1, 2) = 65505;
  headline[2].at(2, 69) = std::numeric_limits<float>::infinity();
  headline[2].at(0, 69) = -1e9f;
  CHECK(writeExr(path, {}, headline, nullptr, {}).clampedToHalf == 3);
  const Rgb<float> back = readImage(path).rgb();
  CHECK(back[0].at(1, 2) == 65504);
  CHECK(back[1].at(1, 2) == 65504);
  CHECK(back[2].at(2, 69) == 65504);
  CHECK(back[2].at(0, 69) == -65504);
  ExrOptions wide;
  wide.floatHeadline = true;
  CHECK(writeExr(path, {}, headline, nullptr, wide).clampedToHalf == 0);
  CHECK(std::isinf(readImage(path).rgb()[2].at(2, 69)));
}

TEST_CASE("window, matrices and other metadata are in the header; a date is not") {
  const Folder folder;
  const std::string path = folder.file("a.exr");
  Estimates all = sampleEstimates(5, 4);
  all.window = {10, 20, 15, 24};
  all.fullWidth = 64;
  all.fullHeight = 48;
  std::vector<float> matrix(16);
  for (size_t i = 0; i < 16; ++i) matrix[i] = 0.5f * static_cast<float>(i);
  using Kind = Attribute::Kind;
  all.attributes = {
      {"worldToCamera", Kind::Matrix, "", 0, 0, matrix},  {"worldToNDC", Kind::Matrix, "", 0, 0, matrix},
      {"samplesPerPixel", Kind::Int, "", 64, 0, {}},      {"braid/seed", Kind::Int, "", int64_t(1) << 40, 0, {}},
      {"renderTimeSeconds", Kind::Float, "", 0, 2.5, {}}, {"braid/plan", Kind::String, "line one\nline two", 0, 0, {}}};
  writeExr(path, all, all.estimates[0].mean, nullptr, {});
  const ImageFile f = readImage(path);
  CHECK(f.window == all.window);
  CHECK((f.fullWidth == 64 && f.fullHeight == 48));
  for (const char* name : {"worldToCamera", "worldToNDC"}) {
    const Attribute* a = findAttribute(f, name);
    REQUIRE(a);
    CHECK(a->values == matrix);
  }
  CHECK(findAttribute(f, "samplesPerPixel")->integer == 64);
  CHECK(findAttribute(f, "braid/seed")->text == "1099511627776");
  CHECK(findAttribute(f, "renderTimeSeconds")->number == 2.5);
  CHECK(findAttribute(f, "braid/plan")->text == "line one\nline two");
  CHECK(findAttribute(f, "chromaticities")->values[6] == doctest::Approx(0.3127));
  CHECK(findAttribute(f, "colorInteropID")->text == "lin_rec709_scene");
  CHECK(findAttribute(f, "compression")->text == "zip");
  CHECK(findAttribute(f, "DateTime") == nullptr);
}

TEST_CASE("the same image gives the same bytes a second later") {
  const Folder folder;
  const Estimates all = sampleEstimates(31, 17);
  std::string exr[2], png[2];
  for (size_t k : {0, 1}) {
    if (k == 1) ::usleep(1100000);
    writeExr(folder.file("a.exr"), all, all.estimates[0].mean, nullptr, {});
    writePng(folder.file("a.png"), all.estimates[0].mean);
    exr[k] = bytesOf(folder.file("a.exr"));
    png[k] = bytesOf(folder.file("a.png"));
  }
  CHECK(exr[0].size() > 1000);
  CHECK(exr[0] == exr[1]);
  CHECK(png[0] == png[1]);
}

TEST_CASE("a full disk is an error, and the previous file stays") {
  // A limit on the size of files fails every write past it, as a full disk does, also within the last buffer before
  // closing.
  const Folder folder;
  const std::string path = folder.file("a.exr"), png = folder.file("a.png");
  const Rgb<float> small(4, 4, 1);
  writeExr(path, {}, small, nullptr, {});
  writePng(png, small);
  const std::string before = bytesOf(path);
  Rgb<float> large(200, 100);
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < large.size(); ++i) large[c][i] = std::fabs(std::sin(static_cast<float>(i * (c + 1))));
  writeExr(folder.file("b.exr"), {}, large, nullptr, {});
  const size_t complete = fs::file_size(folder.file("b.exr"));

  rlimit old;
  REQUIRE(::getrlimit(RLIMIT_FSIZE, &old) == 0);
  const auto oldHandler = std::signal(SIGXFSZ, SIG_IGN);
  for (size_t limit : {size_t(100), complete / 2, complete - 1}) {
    rlimit tight = old;
    tight.rlim_cur = limit;
    std::string text, pngText;
    ::setrlimit(RLIMIT_FSIZE, &tight);
    try {
      writeExr(path, {}, large, nullptr, {});
    } catch (const Error& e) {
      text = e.code() == ExitCode::OutputFailed ? e.what() : "wrong exit code";
    }
    try {
      if (limit == 100) writePng(png, large);
    } catch (const Error& e) {
      pngText = e.what();
    }
    ::setrlimit(RLIMIT_FSIZE, &old);
    CAPTURE(limit);
    CHECK(text == path + ": cannot be written: File too large; free some space, or write elsewhere");
    if (limit == 100)
      CHECK(pngText == png + ": cannot be written: File too large; free some space, or write elsewhere");
    CHECK(bytesOf(path) == before);
    CHECK(folder.count() == 3);
  }
  std::signal(SIGXFSZ, oldHandler);
}

TEST_CASE("a place that cannot be written is named, with the mend") {
  const Folder folder;
  const Rgb<float> image(2, 2, 1);
  const std::string missing = folder.file("none/a.exr");
  CHECK(errorOf([&] { writeExr(missing, {}, image, nullptr, {}); }, ExitCode::OutputFailed) ==
        missing + ": cannot be written: No such file or directory; create the folder first, or write elsewhere");
  CHECK(errorOf([&] { writeExr(folder.path.string(), {}, image, nullptr, {}); }, ExitCode::OutputFailed) ==
        folder.path.string() + ": cannot be written: Is a directory; give a file name, not a folder");
  CHECK(folder.count() == 0);
}

}  // namespace braid::test_exr
