// SPDX-License-Identifier: Apache-2.0
// Neither kills nor interrupts nor full disks leave a broken file.
#include <algorithm>
#include <random>

#include <doctest/doctest.h>
#include <sys/mount.h>

#include "renderer/film/files/exr.h"
#include "renderer/film/files/state_file.h"
#include "tests/support/running_braid.h"

namespace braid::test_robust_output {

using test::braidRun;
using test::contains;
using test::Folder;
using test::Json;
using test::kCornellFile;
using test::Process;
using test::readText;
using test::records;
using test::Run;
using test::sleepFor;
using test::waitUntil;
namespace fs = std::filesystem;

namespace {

int64_t samplesOf(const ImageFile& image) {
  for (const Attribute& a : image.attributes)
    if (a.name == "samplesPerPixel") return a.integer;
  return -1;
}

std::vector<std::string> filesIn(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

// A small file system of its own, gone with the test; not where mounting is not allowed.
class TinyDisk {
 public:
  TinyDisk(const fs::path& path, const char* size) : path_(path.string()) {
    fs::create_directories(path);
    mounted_ = ::mount("tmpfs", path_.c_str(), "tmpfs", 0, size) == 0;
    if (!mounted_) MESSAGE("SKIPPED: no right to mount a small disk: the limit of file sizes alone is tested");
  }
  ~TinyDisk() {
    if (mounted_) ::umount2(path_.c_str(), MNT_DETACH);
  }
  TinyDisk(const TinyDisk&) = delete;
  TinyDisk& operator=(const TinyDisk&) = delete;
  bool mounted() const { return mounted_; }
  void makeReadOnly() const { REQUIRE(::mount("tmpfs", path_.c_str(), "tmpfs", MS_REMOUNT | MS_RDONLY, nullptr) == 0); }

 private:
  std::string path_;
  bool mounted_ = false;
};

struct RenderFiles {
  fs::path state, image, log;
};

enum class After { Start, Plan, FirstImage };

// Kills a render so many seconds after one of these.
void killRender(const RenderFiles& files, double saveEvery, After after, double delay) {
  fs::remove(files.log);
  const auto lastImage = [&] {
    return fs::exists(files.image) ? fs::last_write_time(files.image) : fs::file_time_type::min();
  };
  const fs::file_time_type before = lastImage();
  Process process({"--size", "24x16", "--integrator", "pt,crn", "--reproducible", "--threads", "2", "--time", "60",
                   "--save-every", std::to_string(saveEvery), "--checkpoint", files.state.string(), "--resume", "-o",
                   files.image.string(), "--log-json", files.log.string()});
  if (after == After::Plan) REQUIRE(waitUntil([&] { return contains(readText(files.log), "\"plan\""); }));
  if (after == After::FirstImage) REQUIRE(waitUntil([&] { return lastImage() != before; }));
  sleepFor(delay);
  process.signal(SIGKILL);
  CHECK(process.wait() == -SIGKILL);
}

}  // namespace

TEST_CASE("Killed at any moment, fifty times, a render leaves whole files and loses one save interval at most") {
  const Folder folder;
  const fs::path state = folder.path / "k.state", image = folder.path / "k.exr", log = folder.path / "log";
  constexpr double kSaveEvery = 0.02;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> delay(0, 0.08);
  uint64_t rounds = 0;
  double worstLoss = 0;
  int resumed = 0, images = 0, leftOver = 0;
  for (int kill = 0; kill < 50; ++kill) {
    const double secondsBefore = rounds > 0 ? readStateHeader(state).seconds : 0;
    // Most kills fall between saves or into one, some into starting up, and into the first passes while the image
    // codecs open, which take longer.
    constexpr After kMoments[] = {After::Start, After::Plan, After::FirstImage, After::FirstImage, After::FirstImage};
    const After after = kMoments[kill % 5];
    killRender({state, image, log}, kSaveEvery, after, (after == After::Plan ? 4 : 1) * delay(random));

    for (const std::string& name : filesIn(folder.path)) leftOver += contains(name, ".tmp-");
    if (fs::exists(image)) {
      const ImageFile file = readImage(image);
      CHECK(file.planes.at("crn.variance.B").size() == 24 * 16);
      CHECK(samplesOf(file) > 0);
      ++images;
    }
    double saved = secondsBefore;
    if (fs::exists(state)) {
      const FilmState read = readStateFile(state);
      CHECK(read.rounds() >= rounds);
      resumed += rounds > 0;
      rounds = read.rounds();
      saved = read.seconds;
    }
    const std::vector<Json> progress = records(log, "progress");
    if (!progress.empty())
      worstLoss = std::max(worstLoss, progress.back()["seconds"].get<double>() - (saved - secondsBefore));
  }
  MESSAGE("resumed " << resumed << " times, " << images << " images, " << rounds << " rounds, at most " << worstLoss
                     << " s lost, " << leftOver << " temporary files seen");
  CHECK(resumed >= 10);
  CHECK(images >= 10);
  // One interval, and what a busy machine takes to put a file on the disk.
  CHECK(worstLoss < kSaveEvery + 0.5);

  // What was saved is what a run without any of this would have had, and nothing else stays behind.
  const std::string common = "render '" + kCornellFile +
                             "' -q --size 24x16 --integrator pt,crn --reproducible --combine none " +
                             "--aovs all --spp " + std::to_string(rounds + 3);
  REQUIRE(braidRun(folder, common + " --checkpoint k.state --resume -o k.exr").code == 0);
  REQUIRE(braidRun(folder, common + " -o whole.exr").code == 0);
  CHECK((readText(image) == readText(folder.path / "whole.exr")));
  for (const std::string& name : filesIn(folder.path)) CHECK_MESSAGE(!contains(name, ".tmp-"), name);
}

TEST_CASE("Interrupted, a render saves image and state alike; a second time, it leaves at once") {
  const Folder folder;
  const fs::path state = folder.path / "i.state", image = folder.path / "i.exr", log = folder.path / "log";
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    fs::remove(log);
    Process process({"--size", "32x24", "--time", "60", "--checkpoint", state.string(), "--overwrite", "-o",
                     image.string(), "--log-json", log.string()});
    REQUIRE(waitUntil([&] { return contains(readText(log), "\"progress\""); }));
    process.signal(number);
    CHECK(process.wait() == 130);
    const Json end = records(log).back();
    CHECK(end["status"] == "interrupted");
    CHECK(end["reason"] == "cancelled");
    CHECK(readStateFile(state).rounds() == end["spp"].get<uint64_t>());
    CHECK(samplesOf(readImage(image)) == end["spp"].get<int64_t>());
  }
  // Rounds of seconds: the first signal alone would wait for one to end.
  const std::string before = readText(image), stateBefore = readText(state);
  Process slow({"--size", "4096x4096", "--aovs", "none", "--time", "600", "--threads", "1", "--overwrite",
                "--checkpoint", state.string(), "-o", image.string()});
  sleepFor(1);
  slow.signal(SIGINT);
  sleepFor(0.05);
  const auto start = std::chrono::steady_clock::now();
  slow.signal(SIGINT);
  CHECK(slow.wait() == 130);
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(1));
  CHECK((readText(image) == before));
  CHECK((readText(state) == stateBefore));
}

TEST_CASE("A full disk ends in exit code 3 with the previous files intact") {
  const Folder folder;
  const auto run = [&](const std::string& rest, const std::string& before = "") {
    return braidRun(folder, "render '" + kCornellFile + "' -q " + test::plainly(rest), before);
  };
  const auto checkIntact = [&](const fs::path& where, const std::string& image, const std::string& state) {
    CHECK((readText(where / "o.exr") == image));  // in parentheses: bytes are not to be printed
    CHECK((readText(where / "o.state") == state));
    CHECK(filesIn(where) == std::vector<std::string>{"o.exr", "o.state"});
  };
  // Files may grow to 64 KiB only.
  fs::create_directories(folder.path / "limit");
  const std::string files = " -o limit/o.exr --checkpoint limit/o.state --overwrite";
  REQUIRE(run("--size 8x8 --spp 2" + files).code == 0);
  std::string image = readText(folder.path / "limit" / "o.exr"), state = readText(folder.path / "limit" / "o.state");
  Run full = run("--size 96x96 --spp 2" + files, "trap '' XFSZ; ulimit -f 128; ");
  CHECK(full.code == 3);
  CHECK(contains(full.err, "free some space"));
  checkIntact(folder.path / "limit", image, state);
  // The image alone fits: it is saved although the state is not.
  full = run("--size 24x24 --aovs none --spp 2" + files, "trap '' XFSZ; ulimit -f 64; ");
  CHECK(full.code == 3);
  CHECK(contains(full.err, "limit/o.state: cannot be written"));
  CHECK(readImage(folder.path / "limit" / "o.exr").width == 24);
  CHECK((readText(folder.path / "limit" / "o.state") == state));

  const TinyDisk disk(folder.path / "disk", "size=400k");
  if (!disk.mounted()) return;
  const std::string there = " -o disk/o.exr --checkpoint disk/o.state --overwrite";
  REQUIRE(run("--size 8x8 --spp 2" + there).code == 0);
  image = readText(folder.path / "disk" / "o.exr");
  state = readText(folder.path / "disk" / "o.state");
  full = run("--size 256x160 --time 1.6 --save-every 0.1 --log-json log" + there);
  CHECK(full.code == 3);
  CHECK(contains(full.err, "No space left on device; free some space"));
  CHECK(records(folder.path / "log", "warning").size() >= 1);  // told while rendering, once for each file at most
  CHECK(records(folder.path / "log", "warning").size() <= 2);
  checkIntact(folder.path / "disk", image, state);
  disk.makeReadOnly();
  full = run("--size 8x8 --spp 3" + there);
  CHECK(full.code == 3);
  CHECK(contains(full.err, "not writable"));
  checkIntact(folder.path / "disk", image, state);
}

TEST_CASE("A folder that goes away while rendering ends in exit code 3, its files intact elsewhere") {
  const Folder folder;
  const fs::path here = folder.path / "here", gone = folder.path / "gone", log = folder.path / "log";
  fs::create_directories(here);
  Process process({"--size", "32x24", "--time", "60", "--save-every", "0.05", "--checkpoint", here / "o.state", "-o",
                   here / "o.exr", "--log-json", log.string()});
  REQUIRE(waitUntil([&] { return fs::exists(here / "o.state") && fs::exists(here / "o.exr"); }));
  fs::rename(here, gone);
  REQUIRE(waitUntil([&] { return contains(readText(log), "\"warning\""); }));
  process.signal(SIGINT);
  CHECK(process.wait() == 3);
  CHECK(readImage(gone / "o.exr").width == 32);
  CHECK(readStateFile(gone / "o.state").rounds() > 0);
}

}  // namespace braid::test_robust_output
