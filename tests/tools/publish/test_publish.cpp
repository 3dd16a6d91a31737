// SPDX-License-Identifier: Apache-2.0
// Publication while a render goes on: when it happens, that it changes no pixel, and what ends a run.
#include <cmath>
#include <cstdio>

#include <doctest/doctest.h>
#include <fmt/format.h>

#include "tests/support/running_braid.h"
#include "renderer/core/stopwatch.h"
#include "renderer/film/files/exr.h"
#include "tools/run/progress_line.h"
#include "tools/publish/publication_schedule.h"

namespace braid::test_publish {

using test::braidRun;
using test::contains;
using test::Folder;
using test::Json;
using test::kCornellFile;
using test::readText;
using test::records;
using test::Run;

namespace {

Progress at(uint64_t round, double seconds, double left = -1) {
  Progress p;
  p.round = round;
  p.seconds = seconds;
  p.secondsLeft = left;
  return p;
}

}  // namespace

TEST_CASE("Images are due after rounds 1, 2, 4, 8, and by the clock") {
  PublicationSchedule s(10, 0, false, {});
  std::vector<uint64_t> marks;
  for (uint64_t round = 1; round <= 40; ++round) {
    const Progress p = at(round, static_cast<double>(round) * 0.1);
    const auto due = s.due(p);
    CHECK(due.image == due.state);
    CHECK(!due.combined);
    s.begun(due, p);
    if (due.image) s.published(round, false, 1e-5, std::nullopt);
    if (due.image) marks.push_back(round);
  }
  CHECK(marks == std::vector<uint64_t>{1, 2, 4, 8, 16, 32});
  CHECK(!s.due(at(41, 13.1)).image);
  CHECK(s.due(at(41, 13.3)).image);  // ten seconds after round 32
  CHECK(!PublicationSchedule(0, 0, false, {}).due(at(41, 1e6)).image);
  // Nothing for runs that are about to end.
  CHECK(!PublicationSchedule(10, 0, false, {}).due(at(1, 0.1, 0.5)).image);
  CHECK(PublicationSchedule(10, 0, false, {}).due(at(1, 0.1, 5)).image);
  Progress last = at(64, 50, 0);
  last.rounds = 64;
  CHECK(!PublicationSchedule(10, 0, false, {}).due(last).state);
}

TEST_CASE("Publishing takes its share of the time and no more") {
  // Every image costs one second of the machine; a round takes 0.2 s; the clock is off.
  for (const bool combines : {false, true}) {
    PublicationSchedule s(0, 0, combines, {});
    uint64_t round = 0;
    double seconds = 0, spent = 0;
    int images = 0, combined = 0;
    const double last = combines ? 1 : 0;  // the final image, which comes out of the same share
    while (seconds < 20000) {
      seconds += 0.2;
      const Progress p = at(++round, seconds);
      const auto due = s.due(p);
      if (!due.image) continue;
      s.begun(due, p);
      s.published(round, due.combined, 1, std::nullopt);
      spent += 1;
      ++images;
      combined += due.combined;
      // What the first one of a kind costs is not known before.
      const double share = combines ? PublicationSchedule::kShare : PublicationSchedule::kPlainShare;
      if (images > 2) CHECK(spent - (combines ? 1 : 0) + last <= share * seconds);
    }
    CHECK(images >= 8);
    CHECK(combined == (combines ? images - 1 : 0));
  }
}

TEST_CASE("The first image is plain, combined ones follow, and one that takes too long is given up") {
  PublicationSchedule s(5, 0, true, {});
  const auto first = s.due(at(1, 1, 999));
  CHECK(first.image);
  CHECK(!first.combined);
  s.begun(first, at(1, 1, 999));
  s.published(1, false, 0.01, std::nullopt);
  const auto second = s.due(at(2, 2, 998));
  CHECK(second.combined);
  s.begun(second, at(2, 2, 998));
  CHECK(!s.tooLong(at(3, 20, 980), 19));  // with the final one, 4 % of 1000 s
  CHECK(s.tooLong(at(3, 20, 980), 21));
  s.givenUp(30);
  CHECK(!s.due(at(4, 60, 940)).combined);
  CHECK(s.due(at(4, 60, 940)).image);  // plain, by the clock
  // Once a combined image is out, no plain one takes its place.
  PublicationSchedule t(5, 0, true, {});
  t.begun({.state = true, .image = true}, at(1, 1));
  t.published(1, false, 0.01, std::nullopt);
  t.begun({.state = true, .image = true, .combined = true}, at(2, 100));
  t.published(2, true, 3.9, std::nullopt);
  CHECK(!t.due(at(4, 110)).image);
  CHECK(t.due(at(4, 110)).state);
  CHECK(!t.due(at(4, 290)).combined);
  CHECK(t.due(at(4, 300)).combined);  // 3.9, the next one and the last one are 4 % of 292.5
  // What it is expected to cost counts until it is known, and a target of the error ends the run with the combined
  // image.
  for (const double target : {0.0, 0.01}) {
    PublicationSchedule v(0, target, true, {0, 1.5});
    v.begun({.state = true, .image = true}, at(1, 1));
    v.published(1, false, 0.01, std::nullopt);
    CHECK(!v.due(at(2, 2, 35)).combined);
    CHECK(v.due(at(2, 2, 48)).combined == (target > 0));
    CHECK(v.due(at(2, 2, 98)).combined);
  }
  // A first image that is dear waits for the clock in a short run.
  const PublicationSchedule dear(60, 0, true, {0.7, 0});
  CHECK(!dear.due(at(1, 1, 40)).image);
  CHECK(dear.due(at(1, 1, 49)).image);
  CHECK(dear.due(at(1, 1)).image);  // a run without an end
  CHECK(dear.due(at(30, 61, 2)).image);
  // Saving by the clock, however dear, does not keep combiners from their share.
  PublicationSchedule u(1, 0, true, {});
  u.begun({.state = true, .image = true}, at(1, 1));
  u.published(1, false, 50, std::nullopt);
  u.spend(100);
  CHECK(u.due(at(3, 10)).combined);
}

TEST_CASE("With a target the error is looked at after 16, 32, 64, ... rounds, whatever that costs") {
  for (const bool combines : {false, true}) {
    PublicationSchedule s(0, 0.01, combines, {1000, 1000});
    std::vector<uint64_t> looks;
    for (uint64_t round = 1; round <= 100; ++round)
      if (s.looksAt(at(round, 1e-3 * static_cast<double>(round)))) looks.push_back(round);
    CHECK(looks == std::vector<uint64_t>{16, 32, 64});
    Progress last = at(64, 50, 0);
    last.rounds = 64;
    CHECK(!s.looksAt(last));  // the last image tells
    CHECK(!PublicationSchedule(0, 0, combines, {}).looksAt(at(64, 1)));
    // Combining for nothing is saved: an error that falls with the square of the samples is 0.01 after 20 rounds, or
    // after 41.
    s.published(10, combines, 0, 0.04);
    CHECK(s.looksAt(at(16, 1)) == !combines);
    CHECK(s.looksAt(at(32, 2)));
    s.published(10, combines, 0, 0.1601);
    CHECK(s.looksAt(at(32, 2)) == !combines);
    CHECK(s.looksAt(at(64, 4)));
  }
}

TEST_CASE("Publishing changes no pixel, with and without combiners") {
  const Folder folder;
  for (const std::string& combine : {std::string(), std::string(" --combine js --biased box")}) {
    INFO(combine);
    const std::string common =
        "render '" + kCornellFile + "' -q " + test::plainly("--size 80x48 --spp 400 --reproducible" + combine);
    CHECK(braidRun(folder, common + " -o often.exr --png often.png --checkpoint o.state --overwrite --save-every 0.05 "
                                    "--threads 1 --log-json log")
              .code == 0);
    CHECK(braidRun(folder, common + " -o never.exr --save-every 0 --threads 2").code == 0);
    CHECK((readText(folder.path / "often.exr") == readText(folder.path / "never.exr")));
    const std::vector<Json> published = records(folder.path / "log", "published");
    MESSAGE(published.size() << " publications");
    REQUIRE(published.size() >= 2);
    for (const Json& p : published) CHECK(p["spp"].get<int>() < 400);
    // The first one is plain.
    CHECK(published[0].contains("combined") == !combine.empty());
    if (!combine.empty()) CHECK(published[0]["combined"] == false);
    CHECK(records(folder.path / "log", "warning").empty());
  }
}

TEST_CASE("A target of the error ends a run after the fewest of 16, 32, 64, ... samples that meet it, on any machine") {
  const Folder folder;
  const std::string common = "render '" + kCornellFile + "' --size 64x36 -o o.exr --log-json log --integrator pt ";
  for (const std::string& combine : {std::string("none"), std::string("js --biased box")}) {
    INFO(combine);
    const std::string with = common + "--combine " + combine;
    const auto end = [&] { return records(folder.path / "log").back(); };
    const auto told = [&](int spp) {
      CHECK(braidRun(folder, fmt::format("{} --spp {}", with, spp)).code == 0);
      return end()["estimatedError"].get<double>();
    };
    const double errors[] = {told(16), told(32), told(64)};
    REQUIRE(errors[0] > errors[1]);
    REQUIRE(errors[1] > errors[2]);
    for (const int threads : {1, 2}) {
      for (int k = 0; k < 3; ++k) {
        const std::string target = fmt::format(" --threads {} --error {}", threads, 1.0001 * errors[k]);
        CHECK(braidRun(folder, with + target).code == 0);
        CHECK(end()["spp"] == 16 << k);
        CHECK(end()["reason"] == "error");
        CHECK(end()["estimatedError"].get<double>() == errors[k]);
        double inHeader = 0;
        for (const Attribute& attribute : readImage(folder.path / "o.exr").attributes)
          if (attribute.name == "braid/estimatedError") inHeader = attribute.number;
        CHECK(inHeader == doctest::Approx(errors[k]));
      }
    }
    // What the look that ends the run has written is the image of all its samples.
    CHECK(braidRun(folder, with + fmt::format(" --reproducible --error {}", 1.0001 * errors[1])).code == 0);
    const std::string stopped = readText(folder.path / "o.exr");
    CHECK(braidRun(folder, with + " --reproducible --spp 32").code == 0);
    CHECK((readText(folder.path / "o.exr") == stopped));
  }
  // Who tells no error cannot meet a target: nothing else ends the run.
  const Run unknown = braidRun(folder, common + "--combine box --error 0.1");
  CHECK(unknown.code == 6);
  CHECK(contains(unknown.err, "the estimated error is not known"));
  // The whole of the command that took 2055 samples while publishing decided.
  CHECK(braidRun(folder, common + "--error 0.05").code == 0);
  CHECK(records(folder.path / "log").back()["spp"] == 16);
}

TEST_CASE("The parts of a run add up to its time, which is that of the process") {
  const Folder folder;
  for (const std::string& stop : {std::string("--spp 8"), std::string("--error 0.1 --combine js --biased box")}) {
    const Stopwatch clock;
    const Run run =
        braidRun(folder, "render '" + kCornellFile + "' --size 320x180 -o o.exr --png o.png --log-json log " + stop);
    const double waited = clock.seconds();
    CHECK(run.code == 0);
    const Json seconds = records(folder.path / "log").back()["seconds"];
    double sum = 0;
    for (const auto& [part, value] : seconds.items())
      if (part != "total") sum += value.get<double>();
    const double total = seconds["total"].get<double>();
    CHECK(std::fabs(sum - total) < 0.001);
    CHECK(total <= waited + 0.02);  // the clock of the system has ticks of 10 ms
    MESSAGE(total << " s told of " << waited << " s");
    // The last line says the same.
    const std::string last = run.err.substr(run.err.rfind('\n', run.err.size() - 2) + 1);
    double whole = 0, parts[4] = {};
    int samples = 0;
    REQUIRE(std::sscanf(last.c_str(), "%d spp in %lfs (start and load %lfs, render %lfs, combine %lfs, write %lfs; ",
                        &samples, &whole, &parts[0], &parts[1], &parts[2], &parts[3]) == 6);
    CHECK(std::fabs(whole - total) < 0.0051);
    CHECK(std::fabs(parts[0] + parts[1] + parts[2] + parts[3] - whole) < 0.0251);
  }
  CHECK(formatHundredths(1.234) == "1.23s");
  CHECK(formatHundredths(59.996) == "1m00.00s");
  CHECK(formatHundredths(7384.5) == "2h03m04.50s");
}

TEST_CASE("A limit of time holds for the whole process, and what it leaves no time for is said") {
  const Folder folder;
  // A second of combining is expected of this size on one thread, by a cost that is known beforehand.
  const std::string common = "render '" + kCornellFile + "' --threads 1 -o o.exr --log-json log --integrator pt ";
  const auto end = [&] { return records(folder.path / "log").back(); };
  Run run = braidRun(folder, common + "--size 640x360 --time 1 --combine nfor");
  CHECK(run.code == 0);
  CHECK(contains(run.err, "the image is not combined"));
  CHECK(readImage(folder.path / "o.exr").planes.count("combined.nfor.R") == 0);
  CHECK(end()["spp"].get<int>() >= 1);
  // A state holds whole passes.
  run = braidRun(folder, common + "--size 640x360 --time 0.02 --combine none --checkpoint o.state");
  CHECK(run.code == 0);
  CHECK(end()["spp"] == 1);
  CHECK(contains(run.err, "--time 0.0s: the first pass over the image is not done by then and goes on"));
  // A round that would end too late is not begun.
  run = braidRun(folder, common + "--size 320x180 --time 2 --combine none");
  CHECK(end()["reason"] == "time");
  CHECK(end()["seconds"]["total"].get<double>() < 3.5);
  CHECK(end()["spp"].get<int>() > 1);
}

TEST_CASE("The first of samples, time and error ends the run, and the record says which") {
  const Folder folder;
  const std::string common =
      "render '" + kCornellFile + "' " + test::plainly("--size 32x24 -o o.exr --log-json log ") + " ";
  const auto end = [&] { return records(folder.path / "log").back(); };
  Run run = braidRun(folder, common + "--error 0.01 --spp 100000 --time 60 --png o.png --checkpoint o.state");
  CHECK(run.code == 0);
  CHECK(end()["reason"] == "error");
  CHECK(end()["estimatedError"].get<double>() <= 0.01);
  CHECK(end()["spp"].get<int>() >= 16);
  CHECK(end()["outputs"] == Json::array({"o.exr", "o.png", "o.state"}));
  const std::string last = run.err.substr(run.err.rfind('\n', run.err.size() - 2) + 1);
  CHECK(contains(last, " spp in "));
  CHECK(contains(last, fmt::format("estimated error {:.3g}, ", end()["estimatedError"].get<double>())));
  CHECK(contains(last, "stopped by error: o.exr, o.png, o.state"));
  run = braidRun(folder, common + "--error 0.0000001 --spp 20");
  CHECK(run.code == 6);
  CHECK(end()["reason"] == "samples");
  CHECK(contains(run.err, "--error 1e-07 was not reached: the estimated error is 0.0"));
  run = braidRun(folder, common + "--error 0.0000001 --time 0.3");
  CHECK(run.code == 6);
  CHECK(end()["reason"] == "time");
  CHECK(braidRun(folder, common + "--error 0").code == 1);
  run = braidRun(folder, "render '" + kCornellFile + "' --checkpoint o.state --error 0.1");
  CHECK(run.code == 1);
  CHECK(contains(run.err, "no image to estimate it from"));
}

}  // namespace braid::test_publish
