// SPDX-License-Identifier: Apache-2.0
#include "tools/farm/farm_job.h"

#include <algorithm>
#include <filesystem>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "renderer/core/error.h"
#include "tools/farm/farm_words.h"

namespace braid {

using namespace farm;

namespace {

// Of an image: its name among the rules, what those of its shares begin with, and its frame.
struct FarmTarget {
  std::string name, prefix;
  std::optional<uint64_t> frame;
};

void requireCarriable(const FarmJob& job, FarmFormat format) {
  Words words{job.program, job.folder};
  for (const Words& more : {renderWords(job), mergeWords(job)}) words.insert(words.end(), more.begin(), more.end());
  for (const std::string& w : words) {
    if (std::any_of(w.begin(), w.end(), [](char c) { return (c >= 0 && c < ' ') || c == 127; }))
      throw Error(ExitCode::Usage, "a job cannot carry control characters such as newlines: rename the file of " +
                                       nlohmann::json(w).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace));
    if (format != FarmFormat::OpenCue && format != FarmFormat::Flamenco) continue;
    try {
      (void)nlohmann::json(w).dump();
    } catch (const nlohmann::json::exception&) {
      throw Error(ExitCode::Usage,
                  "a name that is not UTF-8 fits no Python or JavaScript text: rename it, or use "
                  "--format slurm or make");
    }
  }
}

// The array's script runs braid as a child.
std::string slurmText(const FarmJob& job, const std::vector<PassInterval>& shares) {
  std::string passes;
  for (const PassInterval& p : shares) passes += fmt::format("{}{}:{}", passes.empty() ? "" : " ", p.begin, p.end);
  const std::string threads = slurmThreads(job);
  const std::string command = fmt::format(
      R"({program} {render} --passes="${{passes[SLURM_ARRAY_TASK_ID]}}" --checkpoint={stem}.shard"$SLURM_ARRAY_TASK_ID".state --threads={threads})",
      fmt::arg("program", shellQuoted(job.program)), fmt::arg("render", shellLine(renderWords(job))),
      fmt::arg("stem", shellQuoted(stemOf(job.output))), fmt::arg("threads", threads));
  return fmt::format(
      R"(#!/bin/bash
# {title}.
#   bash THIS_FILE [options of sbatch for both jobs, such as --partition=long --time=8:00:00 --mem=16G]
# A share that is requeued, or submitted again with this file, goes on from its checkpoint. Two minutes before the time
# limit it saves and requeues itself.
set -euo pipefail
cd -- {folder}

shares=$(sbatch --parsable --job-name={name} --array=0-{last} --requeue --signal=B:USR1@120{cpus} "$@" <<'END_OF_SHARE'
{share}END_OF_SHARE
)
shares=${{shares%%;*}}

merge=$(sbatch --parsable --job-name={name}_merge --dependency="afterok:$shares" --kill-on-invalid-dep=yes{cpus} "$@" <<'END_OF_MERGE'
#!/bin/bash
cd -- {folder} && exec {program} {merge}{merge_threads}
END_OF_MERGE
) || {{ scancel "$shares"; exit 1; }}
echo "shares: job $shares, merge: job ${{merge%%;*}}"
)",
      fmt::arg("title", jobTitle(job)), fmt::arg("folder", shellQuoted(job.folder)), fmt::arg("name", jobName(job)),
      fmt::arg("last", job.tasks - 1), fmt::arg("program", shellQuoted(job.program)),
      fmt::arg("cpus", job.threads > 0 ? fmt::format(" --cpus-per-task={}", job.threads) : ""),
      fmt::arg("share", slurmShareScript(job, "passes=(" + passes + ")\n", command)),
      fmt::arg("merge", shellLine(mergeWords(job))),
      fmt::arg("merge_threads", job.threads > 0 ? "" : " --threads=" + threads));
}

// A Makefile's text for the shell.
std::string makeQuoted(std::string text) {
  for (size_t at = 0; (at = text.find('$', at)) != std::string::npos; at += 2) text.insert(at, "$");
  return text;
}

// The command of a rule: words, and what a frame adds to them.
std::string makeRule(const FarmJob& job, const std::string& target, const std::string& after, Words words,
                     const std::string& frame) {
  if (!frame.empty()) words.push_back(frame);
  return fmt::format(
      "{}:{}\n\t{}\n", target, after,
      makeQuoted("cd -- " + shellQuoted(job.folder) + " && " + shellQuoted(job.program) + " " + shellLine(words)));
}

// The targets are no files: a state is there from the first checkpoint on, finished or not. `frame`: of which target.
std::string makeImage(const FarmJob& job, const std::vector<PassInterval>& shares, const FarmTarget& of,
                      std::string& targets) {
  std::string names, rules;
  for (uint64_t k = 0; k < job.tasks; ++k) {
    const std::string name = fmt::format("{}share{}", of.prefix, k);
    names += ' ' + name;
    rules += makeRule(job, name, "", shareWords(job, k, shares[k]), of.frame ? renderFrame(*of.frame) : "");
  }
  targets += ' ' + of.name + names;
  return makeRule(job, of.name, names, mergeWords(job), of.frame ? mergeFrame(*of.frame) : "") + rules;
}

std::string makeText(const FarmJob& job, const std::vector<PassInterval>& shares) {
  std::string targets, rules, all;
  if (job.frames.count == 0) rules = makeImage(job, shares, {"merge", "", {}}, targets);
  for (uint64_t i = 0; i < job.frames.count; ++i) {
    const uint64_t frame = job.frames.at(i);
    const std::string name = fmt::format("frame{}", frame);
    all += ' ' + name;
    rules += makeImage(job, shares, {name, name + "_", frame}, targets);
  }
  if (!all.empty()) {
    targets = " frames" + targets;
    rules = "frames:" + all + "\n" + rules;
  }
  return fmt::format(
      "# {}.\n"
      "#   make -j4 -f THIS_FILE\n"
      "# Four shares at a time, each with {}. Run again after an interruption, it goes on from the checkpoints{}.\n"
      "SHELL = /bin/sh\n"
      "{}.PHONY:{}\n",
      jobTitle(job),
      job.threads > 0 ? fmt::format("--threads {}", job.threads) : "all processors unless plan gets --threads",
      all.empty() ? "" : "; with -k, a frame that fails does not keep the others from being rendered", rules, targets);
}

}  // namespace

FarmFormat parseFarmFormat(const std::string& name) {
  if (name == "slurm") return FarmFormat::Slurm;
  if (name == "opencue") return FarmFormat::OpenCue;
  if (name == "flamenco") return FarmFormat::Flamenco;
  if (name == "make") return FarmFormat::Make;
  throw Error(ExitCode::Usage, "unknown format '" + name + "': known are slurm, opencue, flamenco, make");
}

std::vector<PassInterval> splitPasses(uint64_t spp, uint64_t tasks) {
  if (tasks == 0 || tasks > spp)
    throw Error(ExitCode::Usage, fmt::format("--tasks {}: expected 1 to {}, a pass or more for each", tasks, spp));
  const uint64_t unit = spp / 4 >= tasks ? 4 : spp / 2 >= tasks ? 2 : 1;
  const uint64_t units = spp / unit, each = units / tasks, extra = units % tasks;
  std::vector<PassInterval> shares;
  for (uint64_t k = 0; k < tasks; ++k) {
    const uint64_t begin = shares.empty() ? 0 : shares.back().end;
    shares.push_back({begin, k + 1 == tasks ? spp : begin + unit * (each + (k < extra ? 1 : 0))});
  }
  return shares;
}

std::string shareFile(const std::string& output, uint64_t task) {
  return fmt::format("{}.shard{}.state", stemOf(output), task);
}

std::string shellQuoted(const std::string& text) {
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
           std::string_view("_./:=,+@%-").find(c) != std::string_view::npos;
  };
  if (!text.empty() && std::all_of(text.begin(), text.end(), plain)) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::string farmJobText(const FarmJob& job, FarmFormat format) {
  const std::vector<PassInterval> shares = splitPasses(job.spp, job.tasks);
  requireCarriable(job, format);
  switch (format) {
    case FarmFormat::Slurm:
      return job.frames.count > 0 ? slurmFramesText(job, shares) : slurmText(job, shares);
    case FarmFormat::OpenCue:
      return job.frames.count > 0 ? openCueFramesText(job, shares) : openCueText(job, shares);
    case FarmFormat::Flamenco:
      return flamencoText(job, shares);
    case FarmFormat::Make:
      return makeText(job, shares);
  }
  return {};
}

}  // namespace braid
