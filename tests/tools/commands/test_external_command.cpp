// SPDX-License-Identifier: Apache-2.0
// Other denoisers as commands: run on the image and its halves, timed, with clear errors when they fail; in sweeps as
// methods of every cell.
#include <cmath>

#include <doctest/doctest.h>

#include "combiners/pipeline/pipeline.h"
#include "renderer/core/error.h"
#include "renderer/film/files/exr.h"
#include "tests/support/every_method.h"
#include "tests/support/command_line.h"
#include "tools/sweep/table/sweep_table.h"

namespace braid::test_external_command {

using namespace test;

namespace {

CaseOptions small() {
  CaseOptions o;
  o.width = 24;
  o.height = 18;
  o.light = 1e5;
  return o;
}

PipelineOutput outputOf(const std::string& method, const Estimates& estimates, double timeout = 60) {
  PipelineOptions options;
  options.numbers.set("external-command-timeout", timeout);
  const PipelineResult result = runPipeline(estimates, {method}, options);
  REQUIRE(result.find(method));
  return *result.find(method);
}

size_t temporaryFolders() {
  size_t count = 0;
  for (const auto& entry : fs::directory_iterator(fs::temp_directory_path()))
    count += contains(entry.path().filename().string(), "braid-") && entry.is_directory() &&
             !contains(entry.path().filename().string(), "test");
  return count;
}

// A script that a test may call by one word.
std::string script(const Folder& folder, const std::string& name, const std::string& text) {
  const std::string path = folder.write(name, "#!/bin/sh\n" + text + "\n");
  fs::permissions(path, fs::perms::owner_all);
  return path;
}

// A sweep of small images without a report.
Run sweep(const Folder& folder, const std::string& methods, const std::string& rest) {
  return braidRun(folder, "sweep '" BRAID_SOURCE_DIR
                          "/scenes/cornell.glb' -q --size 16x12 --reference-spp 16 --no-plots --metric relL2 " +
                              rest + " --methods \"" + methods + "\"");
}

}  // namespace

TEST_CASE("External command: it reads and writes EXR or PFM in the units of the render, the image and both halves") {
  const Case c = makeCase(small());
  for (const char* command : {"external-command:cp {color} {out}", "external-command:cp {color.pfm} {out.pfm}",
                              "external-command:'cat {color} > {out}'"}) {
    CAPTURE(std::string(command));
    const PipelineOutput out = outputOf(command, c.estimates);
    CHECK(out.step.skipReason.empty());
    REQUIRE(out.ran());
    for (size_t k = 0; k < 3; ++k)
      for (size_t i = 0; i < c.truth.size(); ++i) {
        REQUIRE(out.result.image.mean[k][i] == doctest::Approx(c.pt().mean[k][i]));
        for (size_t h = 0; h < 2; ++h) REQUIRE(out.result.image.half[h][k][i] == doctest::Approx(c.pt().half[h][k][i]));
      }
    CHECK(out.seconds > 0);
  }
  // Features are files as well.
  const PipelineOutput albedo =
      outputOf("external-command:test -s {normal} -a -s {color} && cp {albedo} {out}", c.estimates);
  REQUIRE(albedo.ran());
  CHECK(albedo.result.image.mean[1][7] == doctest::Approx(c.estimates.features->albedo.mean[1][7]));
}

TEST_CASE("External command: combiners take it as their biased input and run it again") {
  const Case c = makeCase(small());
  for (const char* method :
       {"js@external-command:cp {color} {out}", "inverse-variance@external-command:cp {color} {out}",
        "easy@external-command:cp {color} {out}"})
    CHECK_MESSAGE(outputOf(method, c.estimates).ran(), method);
}

TEST_CASE("External command: failures are said with the last line of the program, and leave no files") {
  const Case c = makeCase(small());
  const size_t before = temporaryFolders();
  const auto failsWith = [&](const std::string& command, const std::string& part, double timeout = 60) {
    const PipelineOutput out = outputOf("external-command:" + command, c.estimates, timeout);
    INFO(out.step.skipReason);
    CHECK_FALSE(out.ran());
    CHECK(out.failed);
    CHECK(contains(out.step.skipReason, part));
  };
  failsWith("echo first; echo no model >&2; false {color} {out}", "failed with exit code 1: no model");
  failsWith("no-such-denoiser {color} {out}", "was not found (exit code 127)");
  failsWith("kill -9 $$ {color} {out}", "was ended by signal 9");
  failsWith("true {color} {out}", "wrote no image");
  failsWith("echo text > {out}; true {color}", "cannot be read as an image");
  failsWith("sleep 30; true {color} {out}", "took longer than 0.2 s", 0.2);
  failsWith("true {color}; printf 'PF\\n2 2\\n-1.0\\n' > {out.pfm}", "wrote 2x2 pixels instead of 24x18");
  failsWith("true {color}; printf 'PF\\n24 18\\n-1.0\\n' > {out.pfm}", "cut off");
  CHECK(temporaryFolders() == before);
  // A combiner says what its input failed by.
  const PipelineOutput js = outputOf("js@external-command:false {color} {out}", c.estimates);
  CHECK(js.failed);
  CHECK(contains(js.step.skipReason, "exit code 1"));
  CHECK_THROWS_WITH_AS(findMethod("external-command:my_denoiser {color}"), doctest::Contains("{out}"), Error);
  CHECK_THROWS_WITH_AS(findMethod("external-command:my_denoiser {out}"), doctest::Contains("{color}"), Error);
}

TEST_CASE("External command: it ends soon after it is told to") {
  const Case c = makeCase(small());
  const std::atomic<bool> cancel{true};
  MethodInputs in;
  in.unbiased = &c.pt();
  in.features = &*c.estimates.features;
  in.cancel = &cancel;
  findMethod("external-command:sleep 60; cp {color} {out}")->run(in);
}

TEST_CASE("Sweeps run external commands in every cell") {
  const Folder folder;
  const std::string copy = "external-command:cp {color} {out}",
                    box = "external-command:'" BRAID_BINARY
                          "' combine -q --float --unbiased {color} --method box -o {out}";
  const Run run = sweep(folder, "pt," + copy + ",js@" + copy + ",box," + box, "--spp 4:8 -o good");
  INFO(run.err);
  CHECK(run.code == 0);
  const SweepTable table = readSweepTable(folder.path / "good/sweep.csv");
  CHECK(table.rows.size() == 10);
  const size_t error = table.column("relL2");
  const auto row = [&](const std::string& method, double mark) {
    for (const SweepRow& r : table.rows)
      if (r.method == method && r.mark == mark) return r;
    FAIL("no row of " << method);
    return SweepRow();
  };
  for (const double mark : {4.0, 8.0}) {
    CHECK(row(copy, mark).values[error] == doctest::Approx(row("pt", mark).values[error]).epsilon(1e-5));
    CHECK(row(box, mark).values[error] == doctest::Approx(row("box", mark).values[error]).epsilon(1e-5));
    CHECK(row(box, mark).denoise > 0);
    CHECK(row("js@" + copy, mark).denoise > 0);
  }
}

TEST_CASE("A sweep whose external command fails in some cells names it, and goes on where it stopped") {
  const Folder folder;
  // Fails from the second cell on, by its size; then works.
  const std::string moody = script(folder, "moody",
                                   "if [ -e '" + (folder.path / "well").string() +
                                       "' ]; then exec cp $1 $2; fi\n"
                                       "n=$(cat '" +
                                       (folder.path / "count").string() +
                                       "' 2>/dev/null || echo 0)\n"
                                       "echo $((n+1)) > '" +
                                       (folder.path / "count").string() +
                                       "'\n"
                                       "[ $n -lt 3 ] && exec cp $1 $2\n"
                                       "echo out of licences >&2; exit 3");
  const std::string method = "external-command:" + moody + " {color} {out}";
  const Run partly = sweep(folder, "pt," + method, "--spp 4:8 -o partly");
  CHECK(partly.code == 2);
  CHECK(contains(partly.err, "1 cells failed"));
  CHECK(contains(partly.err, "out of licences"));
  CHECK(readSweepTable(folder.path / "partly/sweep.csv").rows.size() == 3);
  folder.write("well", "");
  const Run again = sweep(folder, "pt," + method, "--spp 4:8 -o partly");
  INFO(again.err);
  CHECK(again.code == 0);
  CHECK(readSweepTable(folder.path / "partly/sweep.csv").rows.size() == 4);
}

TEST_CASE("A sweep fails with the name of an external command that never ran") {
  const Folder folder;
  const Run never = sweep(folder, "pt,external-command:false {color} {out}", "--spp 4 -o never");
  CHECK(never.code == 2);
  CHECK(contains(never.err, "external-command:false {color} {out} never ran: the command failed with exit code 1"));
  CHECK(readSweepTable(folder.path / "never/sweep.csv").rows.size() == 1);
  const Run late =
      sweep(folder, "pt,external-command:sleep 20; cp {color} {out}", "--spp 4 -o late --external-command-timeout 0.1");
  CHECK(late.code == 2);
  CHECK(contains(late.err, "took longer than 0.1 s"));
  // Too few samples for it, in every cell.
  const Run few = sweep(folder, "pt,js", "--spp 1:2 -o few");
  CHECK(few.code == 2);
  CHECK(contains(few.err, "js never ran: "));
}

TEST_CASE("A fixed image is refused where it would stand for several rungs") {
  const Folder folder;
  const std::string sweep =
      "sweep '" BRAID_SOURCE_DIR "/scenes/cornell.glb' -q --size 16x12 --reference-spp 8 --no-plots ";
  REQUIRE(braidRun(folder, "render '" BRAID_SOURCE_DIR "/scenes/cornell.glb' -q --size 16x12 --spp 4 --integrator pt "
                           "--combine none --aovs all -o d.exr")
              .code == 0);
  for (const char* method : {"external:d.exr", "inverse-variance@external:d.exr:d.exr:d.exr"}) {
    const Run run = braidRun(folder, sweep + "--spp 4:8 -o no --methods pt," + method);
    CHECK(run.code == 1);
    CHECK(contains(run.err, "one image cannot stand for 2 rungs"));
    CHECK_FALSE(fs::exists(folder.path / "no/sweep.csv"));
  }
  const Run one = braidRun(folder, sweep + "--spp 4 -o one --methods pt,external:d.exr");
  INFO(one.err);
  CHECK(one.code == 0);
}

TEST_CASE("Commands denoise in combine as well") {
  const Folder folder;
  REQUIRE(braidRun(folder, "render '" BRAID_SOURCE_DIR "/scenes/cornell.glb' -q --size 16x12 --spp 4 --integrator pt "
                           "--combine none --aovs all --float -o a.exr")
              .code == 0);
  const Run run = braidRun(folder,
                           "combine -q --float --unbiased a.exr "
                           "--method \"external-command:cp {color} {out}\" -o o.exr");
  INFO(run.err);
  CHECK(run.code == 0);
  const ImageFile out = readImage(folder.path / "o.exr");
  CHECK(relativeDistance(out.rgb(), readImage(folder.path / "a.exr").rgb()) < 1e-6);
  bool told = false;
  for (const Attribute& a : out.attributes) told = told || a.text == "cp {color} {out}";
  CHECK(told);
  const Run failed =
      braidRun(folder, "combine -q --unbiased a.exr --method \"external-command:false {color} {out}\" -o n.exr");
  CHECK(failed.code == 2);
  CHECK(contains(failed.err, "failed with exit code 1"));
  CHECK_FALSE(fs::exists(folder.path / "n.exr"));
}

}  // namespace braid::test_external_command
