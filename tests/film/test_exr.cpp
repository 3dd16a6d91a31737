// SPDX-License-Identifier: Apache-2.0
// Image files: channel names, bit-exact round trips, reproducible bytes, and failures that leave nothing behind.
#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <set>

#include <doctest/doctest.h>
#include <OpenImageIO/imageio.h>
#include <sys/resource.h>
#include <unistd.h>

#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "renderer/film/files/srgb.h"

namespace braid::test_exr {

namespace fs = std::filesystem;

namespace {

// A folder that goes away with the test.
struct Folder {
  fs::path path = fs::temp_directory_path() / ("braid-test-exr-" + std::to_string(::getpid()));
  Folder() { fs::create_directories(path); }
  ~Folder() { fs::remove_all(path); }
  std::string file(const std::string& name) const { return (path / name).string(); }
  size_t count() const {
    return static_cast<size_t>(std::distance(fs::directory_iterator(path), fs::directory_iterator()));
  }
};

Plane<float> plane(int w, int h, float seed) {
  Plane<float> p(w, h);
  for (size_t i = 0; i < p.size(); ++i) p[i] = seed + 1e-3f * static_cast<float>(i);
  return p;
}

Rgb<float> colour(int w, int h, float seed) {
  Rgb<float> c;
  for (size_t k = 0; k < 3; ++k) c[k] = plane(w, h, seed + static_cast<float>(k));
  return c;
}

Estimates sampleEstimates(int w, int h) {
  Estimates all;
  all.width = w;
  all.height = h;
  for (const char* name : {"pt", "combined.js"}) {
    Estimate e;
    e.name = name;
    e.mean = colour(w, h, 1.25f);
    e.half[0] = colour(w, h, 2e-9f);
    e.half[1] = colour(w, h, 3e9f);
    e.variance = colour(w, h, 1e-20f);
    if (e.name == "pt")
      for (int q = 0; q < 4; ++q) e.quarter.push_back(colour(w, h, 10.0f + static_cast<float>(q)));
    all.estimates.push_back(e);
  }
  Features f;
  f.albedo = {colour(w, h, 0.1f), {colour(w, h, 0.2f), colour(w, h, 0.3f)}, colour(w, h, 0.4f)};
  f.normal = {colour(w, h, -1), {colour(w, h, -2), colour(w, h, -3)}, colour(w, h, -4)};
  f.depth = {plane(w, h, 5), {plane(w, h, 6), plane(w, h, 7)}, plane(w, h, 8)};
  f.visibility = {plane(w, h, 0.5f), {plane(w, h, 0.6f), plane(w, h, 0.7f)}, plane(w, h, 0.8f)};
  all.features = f;
  return all;
}

std::string bytesOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

bool same(const Plane<float>& a, const Plane<float>& b) {
  return a.width == b.width && a.height == b.height && std::memcmp(a.data.data(), b.data.data(), 4 * a.size()) == 0;
}
bool same(const Rgb<float>& a, const Rgb<float>& b) { return same(a[0], b[0]) && same(a[1], b[1]) && same(a[2], b[2]); }

std::string errorOf(const std::function<void()>& action, ExitCode code) {
  try {
    action();
  } catch (const Error& e) {
    CHECK(e.code() == code);
    const std::string text = e.what();
    CHECK(text.find('\n') == std::string::npos);
    return text;
  }
  FAIL("no error");
  return "";
}

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

TEST_CASE("PNG: exposure, sRGB, clamping, and the way back to linear") {
  const Folder folder;
  const std::string path = folder.file("a.png");
  Rgb<float> image(4, 1, 0.1f);
  image[0][1] = 7;
  image[1][1] = -1;
  image[2][1] = std::numeric_limits<float>::quiet_NaN();
  writePng(path, image, 1);
  const ImageFile f = readImage(path);
  CHECK(f.rgb()[0][0] == doctest::Approx(0.2).epsilon(0.01));
  CHECK((f.rgb()[0][1] == 1 && f.rgb()[1][1] == 0 && f.rgb()[2][1] == 0));
  for (float v : {0.0f, 0.001f, 0.0031308f, 0.2f, 1.0f})
    CHECK(decodeSrgb(encodeSrgb(v)) == doctest::Approx(v).epsilon(1e-5));
  CHECK(encodeSrgb(0.2140411f) == doctest::Approx(0.5).epsilon(1e-5));
}

TEST_CASE("other programs' files: PFM, HDR, grey, tiles, named layers") {
  const Folder folder;
  const auto write = [](const std::string& path, std::vector<std::string> names, int tile) {
    OIIO::ImageSpec spec(19, 13, static_cast<int>(names.size()), OIIO::TypeDesc::FLOAT);
    spec.channelnames = names;
    spec.tile_width = spec.tile_height = tile;
    std::vector<float> data;
    for (size_t i = 0; i < 19 * 13; ++i)
      for (size_t c = 0; c < names.size(); ++c) data.push_back(static_cast<float>(i) + 0.25f * static_cast<float>(c));
    auto out = OIIO::ImageOutput::create(path);
    REQUIRE(out);
    REQUIRE(out->open(path, spec));
    REQUIRE(out->write_image(OIIO::TypeDesc::FLOAT, data.data()));
    REQUIRE(out->close());
  };
  {
    std::ofstream pfm(folder.file("a.pfm"), std::ios::binary);  // rows from the bottom up, little-endian
    pfm << "PF\n19 13\n-1.0\n";
    for (int y = 12; y >= 0; --y)
      for (int x = 0; x < 19; ++x)
        for (int c = 0; c < 3; ++c) {
          const float v = static_cast<float>(y * 19 + x) + 0.25f * static_cast<float>(c);
          pfm.write(reinterpret_cast<const char*>(&v), 4);
        }
  }
  for (const char* name : {"a.pfm", "a.hdr", "a.exr", "a.tif"}) {
    if (std::string(name) != "a.pfm") write(folder.file(name), {"R", "G", "B"}, 0);
    const Rgb<float> image = readImage(folder.file(name)).rgb();
    CAPTURE(name);
    CHECK(image[1].at(18, 12) == doctest::Approx(246.25).epsilon(0.01));
    CHECK(image[0].at(3, 1) == doctest::Approx(22).epsilon(0.01));
  }
  write(folder.file("tiled.exr"), {"R", "G", "B"}, 16);
  CHECK(readImage(folder.file("tiled.exr")).rgb()[2].at(18, 12) == 246.5f);
  write(folder.file("grey.exr"), {"Y"}, 0);
  CHECK(readImage(folder.file("grey.exr")).rgb()[2].at(5, 0) == 5);
  write(folder.file("blender.exr"),
        {"ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B", "ViewLayer.Depth.Z"}, 0);
  const ImageFile blender = readImage(folder.file("blender.exr"));
  CHECK(blender.rgb("ViewLayer.Combined")[1].at(0, 0) == 0.25f);
  CHECK((blender.rgb("ViewLayer.Depth")[0].at(0, 0) == 0.75f && !hasLayer(blender, "pt.mean")));
  CHECK(errorOf([&] { blender.rgb(); }, ExitCode::BadInput) ==
        folder.file("blender.exr") + ": no channels R G B; its layers are ViewLayer.Combined, ViewLayer.Depth");
}

TEST_CASE("the parts of a multi-part file are merged") {
  const Folder folder;
  const std::string path = folder.file("parts.exr");
  OIIO::ImageSpec spec(3, 2, 3, OIIO::TypeDesc::FLOAT);
  OIIO::ImageSpec specs[2] = {spec, spec};
  specs[0].attribute("oiio:subimagename", "beauty");
  specs[1].attribute("oiio:subimagename", "albedo");
  auto out = OIIO::ImageOutput::create("exr");
  REQUIRE(out->open(path, 2, specs));
  REQUIRE(out->write_image(OIIO::TypeDesc::FLOAT, std::vector<float>(18, 1).data()));
  REQUIRE(out->open(path, specs[1], OIIO::ImageOutput::AppendSubimage));
  REQUIRE(out->write_image(OIIO::TypeDesc::FLOAT, std::vector<float>(18, 2).data()));
  REQUIRE(out->close());
  const ImageFile f = readImage(path);
  CHECK(f.rgb()[0][0] == 1);
  CHECK(f.rgb("albedo")[0][0] == 2);
}

TEST_CASE("bad files are refused in one line that names them") {
  const Folder folder;
  CHECK(errorOf([&] { readImage(folder.file("none.exr")); }, ExitCode::BadInput) ==
        folder.file("none.exr") + ": no such file");
  CHECK(errorOf([&] { readImage(folder.path.string()); }, ExitCode::BadInput).find("is a folder") != std::string::npos);
  std::ofstream(folder.file("text.exr")) << "this is not an image";
  CHECK(errorOf([&] { readImage(folder.file("text.exr")); }, ExitCode::BadInput).find(folder.file("text.exr")) == 0);
  std::ofstream(folder.file("empty.png"));
  CHECK(errorOf([&] { readImage(folder.file("empty.png")); }, ExitCode::BadInput).find("cannot be read as an image") !=
        std::string::npos);

  const Estimates all = sampleEstimates(64, 200);
  writeExr(folder.file("a.exr"), all, all.estimates[0].mean, nullptr, {});
  const std::string whole = bytesOf(folder.file("a.exr"));
  for (size_t part : {whole.size() / 10, whole.size() / 2, whole.size() - 1}) {
    std::ofstream(folder.file("cut.exr"), std::ios::binary) << whole.substr(0, part);
    CAPTURE(part);
    CHECK(errorOf([&] { readImage(folder.file("cut.exr")); }, ExitCode::BadInput).find(folder.file("cut.exr")) == 0);
  }

  // A PFM header may declare any size in a few bytes.
  std::ofstream(folder.file("huge.pfm"), std::ios::binary) << "PF\n60000 60000\n-1.0\n";
  CHECK(errorOf([&] { readImage(folder.file("huge.pfm")); }, ExitCode::BadInput) ==
        folder.file("huge.pfm") + ": 60000x60000 pixels are more than the limit of 2^28; crop or resize it");
}

}  // namespace braid::test_exr
