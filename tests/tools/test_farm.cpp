// SPDX-License-Identifier: Apache-2.0
// `braid plan --tasks N --format ...`: jobs for farms. What every scheduler would run is run here in its place, with a
// program that writes down its arguments; the Makefile also renders.
#include <doctest/doctest.h>

#include <algorithm>
#include <set>

#include "renderer/film/files/exr.h"
#include "tests/support/command_line.h"
#include "tools/commands/farm_job.h"

namespace braid::test_farm {

using test::braidRun;
using test::contains;
using test::Folder;
using test::Json;
using test::readText;
using test::Run;

namespace {

using Words = std::vector<std::string>;
using Calls = std::map<std::string, Words>;  // by passes, or "merge"

const std::string kCornell = "'" BRAID_SOURCE_DIR "/scenes/cornell.glb'";
const std::string kUgly = "o'hara \"$HOME\" `id` \\n #LAYER# #IFRAME# 100% ;&|<>()*?[]{}~!, größe 漢字 😀";

void write(const std::filesystem::path& path, const std::string& text, bool program = false) {
  std::ofstream(path, std::ios::binary) << text;
  if (program) std::filesystem::permissions(path, std::filesystem::perms::owner_all);
}

// Exit code of a shell command in the folder.
int shell(const Folder& folder, const std::string& command) {
  const int status =
      std::system(("cd '" + folder.path.string() + "' && { " + command + "\n} >log 2>&1 </dev/null").c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

void must(const Folder& folder, const std::string& command) {
  INFO(command);
  const int code = shell(folder, command);
  INFO(readText(folder.path / "log"));
  REQUIRE(code == 0);
}

// A job whose names and values are as bad as they get; its program writes down where and how it was called.
struct UglyJob {
  Folder folder;
  FarmJob job;
  UglyJob() {
    const std::filesystem::path inner = folder.path / ("-in " + kUgly);
    std::filesystem::create_directory(inner);
    job.program = folder.path / "-pro gram's";
    job.folder = inner;
    job.scene = "-scene " + kUgly + ".glb";
    job.output = "-out " + kUgly + ".exr";
    job.render = {{"--size", "26x17"}, {"--env", "-sky " + kUgly}, {"--full", std::nullopt}, {"--variant", ""}};
    job.merge = {{"--png", "-" + kUgly + ".png"}, {"--float", std::nullopt}};
    job.spp = 18;
    job.tasks = 3;
    write(job.program,
          "#!/bin/bash\nset -C\nfor ((i = 0;; ++i)); do { : > '" + folder.path.string() +
              "'/call$i; } 2>/dev/null && break; done\n"
              "printf '%s\\n' \"$PWD\" \"$@\" >| '" +
              folder.path.string() + "'/call$i\n",
          true);
  }
  void print(FarmFormat format, const std::string& name) const { write(folder.path / name, farmJobText(job, format)); }

  Calls calls() const {
    Calls all;
    for (int i = 0; std::filesystem::exists(folder.path / ("call" + std::to_string(i))); ++i) {
      std::ifstream in(folder.path / ("call" + std::to_string(i)));
      Words words;
      for (std::string word; std::getline(in, word);) words.push_back(word);
      REQUIRE(words.size() > 2);
      CHECK(words[0] == job.folder);
      words.erase(words.begin());
      std::string key = words[0];
      for (const std::string& w : words)
        if (w.starts_with("--passes=")) key = w.substr(9);
      CHECK(all.count(key) == 0);
      all[key] = words;
    }
    return all;
  }

  // The calls were those of the job, `threads` being what a farm gives where the user said nothing.
  void check(const Calls& calls, const std::string& threads) const {
    const auto sorted = [&](Words words) {
      if (!threads.empty()) words.push_back("--threads=" + threads);
      std::sort(words.begin(), words.end());
      return words;
    };
    const auto sortedCall = [&](const std::string& key) {
      REQUIRE_MESSAGE(calls.count(key) == 1, key);
      Words words = calls.at(key);
      std::sort(words.begin(), words.end());
      return words;
    };
    CHECK(calls.size() == 4);
    const char* passes[] = {"0:8", "8:12", "12:18"};
    Words parts;
    for (int k = 0; k < 3; ++k) {
      const std::string state = "-out " + kUgly + ".shard" + std::to_string(k) + ".state";
      parts.push_back("./" + state);
      CHECK(sortedCall(passes[k]) ==
            sorted({"render", "./-scene " + kUgly + ".glb", "--size=26x17", "--env=-sky " + kUgly, "--full",
                    "--variant=", "--resume", std::string("--passes=") + passes[k], "--checkpoint=" + state}));
      CHECK(calls.at(passes[k])[0] == "render");
    }
    parts.insert(parts.end(), {"merge", "--output=-out " + kUgly + ".exr", "--png=-" + kUgly + ".png", "--float"});
    CHECK(sortedCall("merge") == sorted(parts));
    CHECK(calls.at("merge")[0] == "merge");
  }
};

bool has(const std::string& program) { return std::system(("command -v " + program + " >/dev/null").c_str()) == 0; }

}  // namespace

TEST_CASE("Passes are split without gaps, nearly equally, and so that quarters and halves stay equal") {
  for (uint64_t spp = 1; spp <= 70; ++spp)
    for (uint64_t tasks = 1; tasks <= spp; ++tasks) {
      CAPTURE(spp);
      CAPTURE(tasks);
      const std::vector<PassInterval> shares = splitPasses(spp, tasks);
      REQUIRE(shares.size() == tasks);
      CHECK(shares.front().begin == 0);
      CHECK(shares.back().end == spp);
      const uint64_t unit = spp >= 4 * tasks ? 4 : spp >= 2 * tasks ? 2 : 1;
      uint64_t least = spp, most = 0;
      for (size_t k = 0; k < tasks; ++k) {
        if (k > 0) CHECK(shares[k].begin == shares[k - 1].end);
        CHECK(shares[k].count() > 0);
        CHECK(shares[k].begin % unit == 0);
        least = std::min(least, shares[k].count());
        most = std::max(most, shares[k].count());
      }
      CHECK(most - least <= unit);
    }
  CHECK_THROWS(splitPasses(3, 4));
  CHECK_THROWS(splitPasses(3, 0));
}

TEST_CASE("make runs every share and then the merge with the very arguments, whatever their characters") {
  const UglyJob ugly;
  ugly.print(FarmFormat::Make, "job.mk");
  must(ugly.folder, "make -j3 -f job.mk");
  ugly.check(ugly.calls(), "");
}

TEST_CASE("Slurm gets an array and a merge after it, with the very arguments") {
  const UglyJob ugly;
  ugly.print(FarmFormat::Slurm, "job.sh");
  must(ugly.folder, "bash -n job.sh");
  std::filesystem::create_directory(ugly.folder.path / "bin");
  const std::string here = "'" + ugly.folder.path.string() + "'";
  write(ugly.folder.path / "bin/sbatch",
        "#!/bin/bash\nn=1; while [ -e " + here + "/script$n ]; do ((++n)); done\ncat >" + here +
            "/script$n\nprintf '%s\\n' \"$@\" >" + here + "/options$n\necho \"10$n;cluster\"\n",
        true);
  must(ugly.folder, "PATH=$PWD/bin:$PATH bash job.sh --partition='a b' --mem=1G");
  CHECK(readText(ugly.folder.path / "log") == "shares: job 101, merge: job 102\n");
  const std::string array = readText(ugly.folder.path / "options1"), merge = readText(ugly.folder.path / "options2");
  CHECK(contains(array, "--array=0-2\n"));
  CHECK(contains(array, "--requeue\n"));
  CHECK(contains(array, "--signal=B:USR1@120\n"));
  CHECK(contains(merge, "--dependency=afterok:101\n"));
  for (const std::string& options : {array, merge}) CHECK(contains(options, "--partition=a b\n--mem=1G\n"));
  for (const char* k : {"0", "1", "2"})
    must(ugly.folder, std::string("SLURM_CPUS_ON_NODE=5 SLURM_ARRAY_TASK_ID=") + k + " bash script1");
  must(ugly.folder, "SLURM_CPUS_ON_NODE=5 bash script2");
  ugly.check(ugly.calls(), "5");
}

TEST_CASE("A share on Slurm whose time is nearly up saves and asks for another turn, once braid has ended") {
  const Folder folder;
  FarmJob job;
  job.program = folder.path / "braid";
  job.folder = folder.path;
  job.scene = "s.glb";
  job.output = "out.exr";
  job.spp = 4;
  job.tasks = 1;
  // Saves for a while when told to end, as braid does.
  write(job.program,
        "#!/bin/bash\ntrap 'sleep 0.3; echo saved >>events; exit 130' TERM\ntouch begun\nwhile true; do sleep 0.02; "
        "done\n",
        true);
  std::filesystem::create_directory(folder.path / "bin");
  write(folder.path / "bin/scontrol", "#!/bin/bash\necho \"$@\" >>events\n", true);
  write(folder.path / "bin/sbatch", "#!/bin/bash\n[ -e script ] || cat >script\necho 7\n", true);
  write(folder.path / "job.sh", farmJobText(job, FarmFormat::Slurm));
  const std::string share =
      "SLURM_JOB_ID=8 SLURM_ARRAY_TASK_ID=0 bash script & p=$!; while [ ! -e begun ]; do sleep 0.01; done; sleep "
      "0.05; ";
  must(folder, "export PATH=$PWD/bin:$PATH; bash job.sh; " + share + "kill -USR1 $p; wait $p");
  CHECK(readText(folder.path / "events") == "saved\nrequeue 8\n");
  // Cancelled or preempted: all processes get the signal, and the task is left to Slurm.
  must(folder, "export PATH=$PWD/bin:$PATH; rm events begun; " + share +
                   "kill -TERM $p; pkill -TERM -P $p; wait $p; echo code $? >>events");
  CHECK(readText(folder.path / "events") == "saved\ncode 130\n");
}

TEST_CASE("OpenCue gets two layers of which the second waits, with the very arguments") {
  const UglyJob ugly;
  ugly.print(FarmFormat::OpenCue, "job.py");
  // Stand-ins for OpenCue's packages, which tell what they were given.
  std::filesystem::create_directories(ugly.folder.path / "outline/modules");
  write(ugly.folder.path / "outline/__init__.py",
        "class Outline:\n"
        "    def __init__(self, name): self.name, self.layers = name, []\n"
        "    def add_layer(self, layer): self.layers.append(layer)\n");
  write(ugly.folder.path / "outline/modules/__init__.py", "");
  write(ugly.folder.path / "outline/modules/shell.py",
        "class Shell:\n"
        "    def __init__(self, name, **args): self.name, self.args, self.after = name, args, []\n"
        "    def depend_all(self, layer): self.after.append(layer.name)\n");
  write(ugly.folder.path / "outline/cuerun.py",
        "import json\n"
        "def launch(job, use_pycuerun=True, **args):\n"
        "    assert not use_pycuerun\n"
        "    layers = [dict(name=l.name, after=l.after, **l.args) for l in job.layers]\n"
        "    json.dump(dict(name=job.name, layers=layers), open('job.json', 'w'))\n");
  must(ugly.folder, "python3 -m py_compile job.py && python3 job.py");
  const Json job = Json::parse(readText(ugly.folder.path / "job.json"));
  CHECK(job["name"].get<std::string>().find_first_not_of(
            "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_") == std::string::npos);
  REQUIRE(job["layers"].size() == 2);
  const Json &shares = job["layers"][0], &merge = job["layers"][1];
  CHECK(shares["range"] == "1-3");
  CHECK(merge["range"] == "1");
  CHECK(merge["after"] == Json({shares["name"]}));
  // Cuebot joins the words, replaces tokens wherever they stand, and hosts run the line.
  const auto run = [&](const Json& layer, const std::string& frame) {
    std::string line = layer["command"][0];
    REQUIRE(layer["command"].size() == 1);
    for (const auto& [token, value] : {std::pair<std::string, std::string>("#IFRAME#", frame), {"#LAYER#", "WRONG"}})
      for (size_t at; (at = line.find(token)) != std::string::npos;) line.replace(at, token.size(), value);
    write(ugly.folder.path / "command", line);
    must(ugly.folder, "CUE_THREADS=2 sh ./command");
  };
  for (const char* frame : {"1", "2", "3"}) run(shares, frame);
  run(merge, "1");
  ugly.check(ugly.calls(), "2");
}

TEST_CASE("OpenCue's one command finds the passes of every share") {
  const Folder folder;
  FarmJob job;
  job.program = "echo";
  job.folder = folder.path;
  job.scene = "s.glb";
  job.output = "o.exr";
  for (const auto& [spp, tasks] : {std::pair<uint64_t, uint64_t>(37, 4), {64, 16}, {11, 5}, {7, 6}, {5, 1}, {30, 7}}) {
    CAPTURE(spp);
    job.spp = spp;
    job.tasks = tasks;
    const std::string text = farmJobText(job, FarmFormat::OpenCue);
    const size_t begin = text.find("command=[") + 9;
    const std::string line = Json::parse(text.substr(begin, text.find("],\n", begin) - begin));
    const std::vector<PassInterval> shares = splitPasses(spp, tasks);
    for (uint64_t k = 0; k < tasks; ++k) {
      std::string one = line;
      one.replace(one.find("#IFRAME#"), 8, std::to_string(k + 1));
      write(folder.path / "command", one);
      must(folder, "sh ./command");
      CHECK(contains(readText(folder.path / "log"), "--passes=" + std::to_string(shares[k].begin) + ":" +
                                                        std::to_string(shares[k].end) + " --checkpoint=o.shard" +
                                                        std::to_string(k) + ".state "));
    }
  }
}

TEST_CASE("Flamenco's job type makes tasks of which the last depends on all others, with the very arguments") {
  const UglyJob ugly;
  const std::string text = farmJobText(ugly.job, FarmFormat::Flamenco);
  const size_t begin = text.find("const DATA = ") + 13;
  const Json data = Json::parse(text.substr(begin, text.find("};\n", begin) + 1 - begin));
  const auto run = [&](const Words& args) {
    std::string line = "env";
    for (const std::string& a : args) line += " " + shellQuoted(a);
    must(ugly.folder, line);
  };
  if (!has("node")) {
    MESSAGE("no node: the script's data are checked, and its code is not run");
    std::vector<Json> steps = data["shares"];
    steps.push_back(data["merge"]);
    for (const Json& step : steps) {
      Words args{"-C", data["folder"], data["program"]};
      for (const std::string a : step["args"]) args.push_back(a);
      run(args);
    }
    return ugly.check(ugly.calls(), "");
  }
  // A stand-in for the Manager, which copies a task when it is added to the job.
  write(ugly.folder.path / "job.js",
        "'use strict';\nconst author = {\n"
        "  Task: (name, type) => ({ name, type, commands: [], after: [],\n"
        "    addCommand(c) { this.commands.push(c); }, addDependency(t) { this.after.push(t.name); } }),\n"
        "  Command: (name, parameters) => ({ name, parameters }) };\n" +
            text +
            "const tasks = [];\n"
            "compileJob({ settings: {}, addTask(t) { tasks.push(JSON.stringify(t)); } });\n"
            "require('fs').writeFileSync('job.json', '[' + tasks + ']');\n"
            "require('fs').writeFileSync('type.json', JSON.stringify(JOB_TYPE));\n");
  must(ugly.folder, "node job.js");
  const Json tasks = Json::parse(readText(ugly.folder.path / "job.json"));
  REQUIRE(tasks.size() == 4);
  CHECK(tasks[3]["after"] == Json({"passes 0:8", "passes 8:12", "passes 12:18"}));
  for (const Json& task : tasks) {
    CHECK(task["type"] == "misc");
    REQUIRE(task["commands"].size() == 1);
    CHECK(task["commands"][0]["name"] == "exec");
    CHECK(task["commands"][0]["parameters"]["exe"] == "env");
    run(task["commands"][0]["parameters"]["args"]);
  }
  ugly.check(ugly.calls(), "");
  CHECK(Json::parse(readText(ugly.folder.path / "type.json"))["settings"][0]["default"] == ugly.job.program);
}

TEST_CASE("A job printed by plan for make gives the image of the unsplit render, also in a second go") {
  const Folder folder;
  const std::string inner = "a b's größe";
  std::filesystem::create_directory(folder.path / inner);
  std::filesystem::copy_file(BRAID_SOURCE_DIR "/scenes/cornell.glb", folder.path / inner / "-box.glb");
  const std::string render =
      " -q --size 26x17 --integrator pt,crn --max-depth 5 --seed 3 --spp 10 --transparent --combine "
      "js,uncorrelated --biased box --history --aovs all ";
  const std::string at = "cd \"" + inner + "\" && ";
  const Run plan = braidRun(folder,
                            "plan ./-box.glb" + render +
                                "--threads 1 --output=-out.exr --png 'p $x.png' --tasks 4 --format make --reproducible",
                            at);
  INFO(plan.err);
  REQUIRE(plan.code == 0);
  write(folder.path / "job.mk", plan.out);
  CHECK(contains(plan.out, "--passes=0:4 --checkpoint=-out.shard0.state"));
  CHECK(contains(plan.out, "--passes=8:10 --checkpoint=-out.shard3.state"));
  must(folder, "make -j4 -f job.mk");
  const Run whole = braidRun(folder, "render ./-box.glb" + render + "-o whole.exr --reproducible", at);
  INFO(whole.err);
  REQUIRE(whole.code == 0);
  const ImageFile a = readImage(folder.path / inner / "whole.exr"), b = readImage(folder.path / inner / "-out.exr");
  size_t means = 0;
  for (const auto& [name, plane] : a.planes) {
    INFO(name);
    if (contains(name, ".variance")) continue;
    REQUIRE(b.planes.count(name) == 1);
    const Plane<float>& other = b.planes.at(name);
    if (name.starts_with("pt.") || name.starts_with("crn.") || name == "A") {  // means and halves
      CHECK(other.data == plane.data);
      ++means;
    }
    if (contains(name, "combined."))
      for (size_t i = 0; i < plane.size(); ++i)
        CHECK(std::fabs(other[i] - plane[i]) <= 1e-3f * std::max(1.0f, std::fabs(plane[i])));
  }
  CHECK(means == 2 * 9 + 1);
  CHECK(std::filesystem::exists(folder.path / inner / "p $x.png"));
  // A second go makes what is missing.
  const std::string first = readText(folder.path / inner / "-out.exr");
  std::filesystem::remove(folder.path / inner / "-out.shard2.state");
  std::filesystem::remove(folder.path / inner / "-out.exr");
  must(folder, "make -j2 -f job.mk");
  CHECK((readText(folder.path / inner / "-out.exr") == first));
}

TEST_CASE("Every option given to plan is carried on, and none that a share or the merge would refuse") {
  const Folder folder;
  // Short shares of a method that needs quarters and history: each is told to keep what only the whole render needs.
  const std::string options =
      "plan " + kCornell +
      " -q --size 26x17 --spp 8 --yfov 40 --light-scale 2 --no-default-light --sampler independent "
      "--aovs features --float --exposure 1 --combine auto,uncorrelated,curves --biased box "
      "--integrator pt,crn --save-every 10 --checkpoint all.state -o out.exr --tasks 4 ";
  const Run run = braidRun(folder, options + "--format make --program 'my braid'");
  INFO(run.err);
  REQUIRE(run.code == 0);
  const std::string share =
      run.out.substr(run.out.find("share0:\n"), run.out.find("share1:\n") - run.out.find("share0:\n"));
  for (const char* text :
       {"'my braid' render ", " --size=26x17 ", " --yfov=40 ", " --light-scale=2 ", " --no-default-light ",
        " --sampler=independent ", " --quarters ", " --direct-indirect ", " --aovs=features ", " --save-every=10 ",
        " --quiet ", " --combine=auto,uncorrelated,curves ", " --biased=box ", " --resume ", " --passes=0:2 ",
        " --history "})
    CHECK_MESSAGE(contains(share, text), text);
  for (const char* text : {"--spp", "--exposure", "--float", "--tasks", "--format", "--output"})
    CHECK_MESSAGE(!contains(share, text), text);
  const std::string merge =
      run.out.substr(run.out.find("merge: share"), run.out.find("share0:\n") - run.out.find("merge: share"));
  for (const char* text : {" --output=out.exr ", " --float", " --exposure=1", " --aovs=features", " --biased=box ",
                           " --checkpoint=all.state", " --quiet"})
    CHECK_MESSAGE(contains(merge, text), text);
  CHECK(!contains(merge, "--size"));
  const Run real = braidRun(folder, options + "--format make");
  write(folder.path / "job.mk", real.out);
  must(folder, "make -f job.mk");
  CHECK(std::filesystem::exists(folder.path / "all.state"));
}

TEST_CASE("Jobs that could not run are refused with a sentence") {
  const Folder folder;
  const auto refusal = [&](const std::string& rest) {
    const Run run = braidRun(folder, "plan " + kCornell + " -q " + rest);
    INFO(rest);
    INFO(run.err);
    CHECK(run.code == 1);
    CHECK(run.out.empty());
    return run.err;
  };
  CHECK(contains(refusal("--tasks 2 -o a.exr"), "give --format slurm, opencue, flamenco or make"));
  CHECK(contains(refusal("--format make -o a.exr"), "give --tasks"));
  CHECK(contains(refusal("--tasks 2 --format pbs -o a.exr"), "unknown format 'pbs'"));
  CHECK(contains(refusal("--tasks 2 --format make"), "name the merged image"));
  CHECK(contains(refusal("--tasks 2 --format make -o a.exr --time 1h"), "give --spp alone"));
  CHECK(contains(refusal("--tasks 9 --spp 8 --format make -o a.exr"), "expected 1 to 8"));
  CHECK(contains(refusal("--tasks 2 --format make -o a.exr --json"), "a job is no JSON"));
  CHECK(contains(refusal("--tasks 2 --format make -o a.exr --combine uncorrelated"), "cannot run"));
  CHECK(contains(refusal("--tasks 2 --format make -o \"$(printf 'a\\nb').exr\""), "control characters"));
  CHECK(contains(refusal("--tasks 2 --format opencue -o \"$(printf 'a\\377b').exr\""), "not UTF-8"));
  CHECK(contains(refusal("--tasks 2 --format opencue -o " + std::string(900, 'a') + ".exr --png " +
                         std::string(2000, 'b') + " --layer-prefix " + std::string(2000, 'c')),
                 "at most 4000 characters"));
}

}  // namespace braid::test_farm
