// SPDX-License-Identifier: Apache-2.0
// Jobs for Slurm, OpenCue and Flamenco. What a scheduler would run is run here in its place, with a program that writes
// down its arguments.
#include <doctest/doctest.h>

#include "tests/support/command_line.h"
#include "tools/farm/farm_job.h"
#include "tests/tools/commands/farm_jobs.h"

namespace braid::test_farm_schedulers {

using namespace test::farm_jobs;
using test::contains;
using test::Folder;
using test::Json;
using test::readText;

namespace {

bool has(const std::string& program) { return std::system(("command -v " + program + " >/dev/null").c_str()) == 0; }

}  // namespace

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
    REQUIRE(data["images"].size() == 1);
    std::vector<Json> steps = data["images"][0]["shares"];
    steps.push_back(data["images"][0]["merge"]);
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

}  // namespace braid::test_farm_schedulers
