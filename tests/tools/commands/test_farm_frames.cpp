// SPDX-License-Identifier: Apache-2.0
// Jobs of many frames: every frame has its shares, and a merge that waits for these alone.
#include <doctest/doctest.h>

#include <set>
#include <sstream>

#include "tests/support/command_line.h"
#include "tests/tools/commands/farm_jobs.h"
#include "tools/farm/farm_job.h"

namespace braid::test_farm_frames {

using namespace test::farm_jobs;
using test::contains;
using test::Folder;
using test::Json;
using test::readText;

namespace {

// Frames 3, 5 and 7 in two shares; the program writes down its arguments, a line a call.
struct FrameJob {
  Folder folder;
  FarmJob job;
  FrameJob() {
    job.program = folder.path / "braid";
    job.folder = folder.path;
    job.scene = "s $x.glb";
    job.output = "it's out_####.exr";
    job.render = {{"--fps", "12"}};
    job.spp = 8;
    job.tasks = 2;
    job.threads = 1;
    job.frames = {3, 2, 3};
    write(job.program, "#!/bin/bash\necho \"$*\" >>calls\n", true);
  }

  void print(FarmFormat format, const std::string& name) const { write(folder.path / name, farmJobText(job, format)); }

  std::multiset<std::string> calls() const {
    std::multiset<std::string> all;
    std::ifstream in(folder.path / "calls");
    for (std::string line; std::getline(in, line);) {
      std::istringstream words(line);  // their order differs between formats, and does not matter
      std::set<std::string> sorted;
      for (std::string word; words >> word;) sorted.insert(word);
      std::string joined;
      for (const std::string& word : sorted) joined += word + ' ';
      all.insert(joined);
    }
    return all;
  }

  // All formats run these.
  void check() const {
    const auto all = calls();
    CHECK(all.size() == 9);
    for (const char* frame : {"3:4", "5:6", "7:8"})
      for (const auto& [share, passes] : {std::pair<std::string, std::string>("0", "0:4"), {"1", "4:8"}}) {
        const std::string call = "$x.glb --checkpoint=it's --fps=12 --frames=" + std::string(frame) +
                                 " --passes=" + passes + " --resume --threads=1 out_####.shard" + share +
                                 ".state render s ";
        CHECK_MESSAGE(all.count(call) == 1, call);
      }
    for (const char* frame : {"3", "5", "7"}) {
      const std::string call = "--frame=" + std::string(frame) +
                               " --output=it's --threads=1 it's merge out_####.exr out_####.shard0.state "
                               "out_####.shard1.state ";
      CHECK_MESSAGE(all.count(call) == 1, call);
    }
  }
};

}  // namespace

TEST_CASE("make has a rule for each frame, its shares and its merge") {
  const FrameJob frames;
  frames.print(FarmFormat::Make, "job.mk");
  must(frames.folder, "make -f job.mk frame5");
  CHECK(frames.calls().size() == 3);
  std::filesystem::remove(frames.folder.path / "calls");
  must(frames.folder, "make -j3 -f job.mk");
  frames.check();
}

TEST_CASE("Slurm gets an array of frames for every share, and one of merges each of which waits for its own") {
  const FrameJob frames;
  frames.print(FarmFormat::Slurm, "job.sh");
  must(frames.folder, "bash -n job.sh");
  std::filesystem::create_directory(frames.folder.path / "bin");
  write(frames.folder.path / "bin/sbatch",
        "#!/bin/bash\nn=1; while [ -e script$n ]; do ((++n)); done\ncat >script$n\nprintf '%s\\n' \"$@\" >options$n\n"
        "echo \"10$n;cluster\"\n",
        true);
  must(frames.folder, "PATH=$PWD/bin:$PATH bash job.sh --partition='a b'");
  CHECK(contains(readText(frames.folder.path / "log"), "101 102 103"));
  for (const char* n : {"1", "2", "3"}) {
    const std::string options = readText(frames.folder.path / (std::string("options") + n));
    CHECK(contains(options, "--array=0-2\n"));
    CHECK(contains(options, "--partition=a b\n"));
    CHECK(contains(options, "--cpus-per-task=1\n"));
    for (const char* k : {"0", "1", "2"})
      must(frames.folder, std::string("SLURM_ARRAY_TASK_ID=") + k + " bash script" + n);
  }
  CHECK(contains(readText(frames.folder.path / "options1"), "--requeue\n"));
  CHECK(contains(readText(frames.folder.path / "options3"), "--dependency=aftercorr:101:102\n"));
  frames.check();
}

TEST_CASE("OpenCue gets a layer a share, and merges that wait frame by frame") {
  const FrameJob frames;
  frames.print(FarmFormat::OpenCue, "job.py");
  std::filesystem::create_directories(frames.folder.path / "outline/modules");
  write(frames.folder.path / "outline/__init__.py",
        "class Outline:\n"
        "    def __init__(self, name): self.layers = []\n"
        "    def add_layer(self, layer): self.layers.append(layer)\n");
  write(frames.folder.path / "outline/modules/__init__.py", "");
  write(frames.folder.path / "outline/modules/shell.py",
        "class Shell:\n"
        "    def __init__(self, name, **args): self.name, self.args, self.after = name, args, []\n"
        "    def depend_on(self, layer): self.after.append(layer.name)\n");
  write(frames.folder.path / "outline/cuerun.py",
        "import json\n"
        "def launch(job, use_pycuerun=True, **args):\n"
        "    layers = [dict(name=l.name, after=l.after, **l.args) for l in job.layers]\n"
        "    json.dump(layers, open('job.json', 'w'))\n");
  must(frames.folder, "python3 job.py");
  const Json layers = Json::parse(readText(frames.folder.path / "job.json"));
  REQUIRE(layers.size() == 3);
  CHECK(layers[2]["after"] == Json({"share0", "share1"}));
  for (const Json& layer : layers) {
    CHECK(layer["range"] == "1-3");
    for (const char* frame : {"1", "2", "3"}) {
      std::string line = layer["command"][0];
      for (size_t at; (at = line.find("#IFRAME#")) != std::string::npos;) line.replace(at, 8, frame);
      write(frames.folder.path / "command", line);
      must(frames.folder, "sh ./command");
    }
  }
  frames.check();
}

TEST_CASE("Flamenco gets the tasks of every frame") {
  const FrameJob frames;
  const std::string text = farmJobText(frames.job, FarmFormat::Flamenco);
  const size_t begin = text.find("const DATA = ") + 13;
  const Json data = Json::parse(text.substr(begin, text.find("};\n", begin) + 1 - begin));
  REQUIRE(data["images"].size() == 3);
  CHECK(data["images"][1]["merge"]["name"] == "frame 5 merge");
  for (const Json& image : data["images"]) {
    REQUIRE(image["shares"].size() == 2);
    std::vector<Json> steps = image["shares"];
    steps.push_back(image["merge"]);
    for (const Json& step : steps) {
      std::string line = shellQuoted(frames.job.program);
      for (const std::string word : step["args"]) line += " " + shellQuoted(word);
      must(frames.folder, line);
    }
  }
  frames.check();
}

}  // namespace braid::test_farm_frames
