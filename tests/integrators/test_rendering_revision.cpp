// SPDX-License-Identifier: Apache-2.0
// Pixels change only together with the rendering revision. Small renders by every integrator, and by auto/auto, are
// compared with those that tests/integrators/rendering_revision.txt holds.
//
// Builds differ in the last bits of floats, as vectorised functions do, and in rare cases a path then takes another
// turn. So numbers are compared to kTolerance, and a few pixels may be others; other samples would change nearly all.
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>

#include <doctest/doctest.h>
#include <fmt/format.h>

#include "renderer/session/rendering_revision.h"
#include "tests/support/render_fixture.h"
#include "tools/images/exr_metadata.h"
#include "tools/prepare/prepared_render.h"

namespace braid::test_rendering_revision {

namespace {

constexpr int kWidth = 32, kHeight = 18, kEveryX = 4, kEveryY = 3;
constexpr double kTolerance = 1e-3, kOthers = 0.15;

const char* const kFile = "tests/integrators/rendering_revision.txt";
const char* const kHowToRecord =
    "record with BRAID_RECORD_REVISION=1 braid_tests --source-file='*test_rendering_revision.cpp', and say what "
    "changed under \"Changed pixels\" in CHANGELOG.md";

// Means of red, green and blue, then the green of pixels on a grid.
using Pixels = std::vector<double>;
using Renders = std::map<std::string, Pixels>;

Pixels pixelsOf(const Rgb<float>& image) {
  Pixels pixels;
  for (size_t c = 0; c < 3; ++c) {
    double sum = 0;
    for (const float v : image[c].data) sum += static_cast<double>(v);
    pixels.push_back(sum / static_cast<double>(image.size()));
  }
  for (int y = kEveryY / 2; y < kHeight; y += kEveryY)
    for (int x = kEveryX / 2; x < kWidth; x += kEveryX) pixels.push_back(static_cast<double>(image[1].at(x, y)));
  return pixels;
}

// What `braid render` makes of a scene of the suite with 4 samples.
Pixels rendered(const std::string& scene, const std::string& integrator, const std::string& method = "none") {
  SceneChoice choice;
  choice.file = test::sourcePath("scenes/" + scene + ".glb");
  choice.size = {kWidth, kHeight};
  choice.quiet = true;
  SampleChoice samples;
  samples.integrators = {integrator};
  samples.spp = 4;
  CombineChoice combine;
  combine.helpers = false;  // what a network makes depends on the machine
  combine.methods = parseMethods(method);
  const PreparedRender render = prepareRender(choice, makeSettings(choice, samples), combine, {samples.spp});
  const std::unique_ptr<Session> session = beginSession(render, choice);
  session->advance();
  const Estimates estimates = describedEstimates(*session, false);
  const PipelineResult combined = runCombining(estimates, combine, combine.options(), 0);
  const PipelineOutput* out = method == "none" ? nullptr : combined.find(method);
  REQUIRE((method == "none" || (out && out->ran())));
  return pixelsOf(out ? out->result.image.mean : estimates.estimates.front().mean);
}

Renders renders() {
  Renders all;
  for (const Integrator* i : test::integrators())
    all[fmt::format("cornell {}", i->name())] = rendered("cornell", i->name());
  // Textures, glass, lobes and lights that the box has not.
  for (const char* scene : {"materials", "glass_of_water", "sun_sky", "many_lights", "foliage"})
    all[fmt::format("{} pt", scene)] = rendered(scene, "pt");
  for (const char* scene : {"cornell", "torus_glass"})
    all[fmt::format("{} auto/auto", scene)] = rendered(scene, "auto", "auto");
  return all;
}

struct Record {
  int revision = 0;
  Renders renders;
};

// "revision N", then a line for each render: its two words and its numbers.
Record readRecord(std::istream& in) {
  Record record;
  std::string word, line;
  in >> word >> record.revision;
  while (std::getline(in, line)) {
    std::istringstream words(line);
    std::string scene, how;
    if (!(words >> scene >> how)) continue;
    Pixels& pixels = record.renders[scene + " " + how];
    for (double v = 0; words >> v;) pixels.push_back(v);
  }
  return record;
}

std::string toText(const Renders& all) {
  std::string text = fmt::format("revision {}\n", kRenderingRevision);
  for (const auto& [name, pixels] : all) {
    text += name;
    for (const double v : pixels) text += fmt::format(" {:.5g}", v);
    text += '\n';
  }
  return text;
}

bool close(double a, double b) { return std::fabs(a - b) <= kTolerance * std::max(std::fabs(a), std::fabs(b)) + 1e-6; }

// Whether both are of the same samples. A pixel that is another one may move the means by its share.
bool same(const Pixels& a, const Pixels& b) {
  if (a.size() != b.size() || a.size() < 4) return false;
  size_t others = 0;
  for (size_t i = 3; i < a.size(); ++i) others += close(a[i], b[i]) ? 0 : 1;
  for (size_t i = 0; i < 3; ++i)
    if (std::fabs(a[i] - b[i]) > 0.01 * std::max(a[i], b[i])) return false;
  return static_cast<double>(others) <= kOthers * static_cast<double>(a.size() - 3);
}

// The renders that are not what was recorded, or were not recorded.
std::string changed(const Renders& now, const Renders& before) {
  std::string names;
  for (const auto& [name, pixels] : now)
    if (const auto old = before.find(name); old == before.end() || !same(pixels, old->second))
      names += (names.empty() ? "" : ", ") + name;
  return names;
}

}  // namespace

TEST_CASE("Pixels are those that were recorded for this rendering revision") {
  const std::string path = test::sourcePath(kFile);
  std::ifstream in(path);
  const Record record = readRecord(in);
  const Renders now = renders();
  const std::string others = changed(now, record.renders);
  if (std::getenv("BRAID_RECORD_REVISION")) {
    Renders known = now;
    std::erase_if(known, [&](const auto& r) { return record.renders.count(r.first) == 0; });
    REQUIRE_MESSAGE((record.revision != kRenderingRevision || changed(known, record.renders).empty()),
                    "other pixels than were recorded for revision ", kRenderingRevision,
                    ": raise kRenderingRevision in renderer/session/rendering_revision.h first");
    std::ofstream(path) << toText(now);
    return;
  }
  REQUIRE_MESSAGE(record.revision == kRenderingRevision, kFile, " is of revision ", record.revision, ", the source of ",
                  kRenderingRevision, ": ", kHowToRecord);
  CHECK_MESSAGE(others.empty(), "other pixels than recorded: ", others,
                ": raise kRenderingRevision in renderer/session/rendering_revision.h by one, then ", kHowToRecord);
}

TEST_CASE("The comparison takes other roundings for the same pixels, and other samples for others") {
  const Renders pixels{{"room a", {1, 2, 3, 0.5, 0.25, 4, 8, 0.1, 0.2, 0.3, 0.4}}};
  Renders rounded = pixels, one = pixels, brighter = pixels, other = pixels;
  for (double& v : rounded["room a"]) v *= 1 + 1e-4;
  one["room a"][5] = 7;
  for (double& v : brighter["room a"]) v *= 1.003;
  for (size_t i = 3; i < 11; i += 2) other["room a"][i] *= 1.2;
  CHECK(changed(rounded, pixels).empty());
  CHECK(changed(one, pixels).empty());
  CHECK(changed(brighter, pixels) == "room a");
  CHECK(changed(other, pixels) == "room a");
  CHECK(changed({{"b", {1, 1, 1, 1}}}, pixels) == "b");
  std::istringstream text(toText(pixels));
  const Record read = readRecord(text);
  CHECK(read.revision == kRenderingRevision);
  CHECK(changed(pixels, read.renders).empty());
}

TEST_CASE("Another seed gives other pixels") {
  Settings settings = test::settingsFor(kWidth, kHeight, 4);
  const Scene scene(cornellBox());
  const Pixels first = pixelsOf(test::render(scene, settings).image);
  settings.seed = 1;
  CHECK_FALSE(same(pixelsOf(test::render(scene, settings).image), first));
}

}  // namespace braid::test_rendering_revision
