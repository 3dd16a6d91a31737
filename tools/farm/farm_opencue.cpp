// SPDX-License-Identifier: Apache-2.0
// Jobs for OpenCue.
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "renderer/core/error.h"
#include "tools/farm/farm_words.h"

namespace braid::farm {

namespace {

// Cuebot replaces tokens such as #LAYER# in commands before a shell sees them: quotes after every # keep names whole.
std::string withoutTokens(std::string text) {
  for (size_t at = 0; (at = text.find('#', at)) != std::string::npos; at += 3) text.insert(at + 1, "''");
  return text;
}

// Words for a shell within Cuebot, each with a space before it.
std::string cueWords(const Words& words) {
  std::string text;
  for (const std::string& w : words) text += " " + withoutTokens(shellQuoted(w));
  return text;
}

// One script for all frames, however many: Cuebot stores at most 4000 characters of it. Share k of n begins at
// unit * (k * each + min(k, extra)), and the last one ends with the passes.
std::string cueShareScript(const FarmJob& job, const std::string& begin, const std::string& threads) {
  const uint64_t unit = job.spp >= 4 * job.tasks ? 4 : job.spp >= 2 * job.tasks ? 2 : 1;
  return fmt::format(
      "k=$((#IFRAME#-1)); at() {{ echo $(($1==0 ? 0 : $1=={n} ? {spp} : {unit}*($1*{each}+($1<{extra}?$1:{extra})))); "
      "}}; {begin}{words} --passes=$(at $k):$(at $((k+1))) --checkpoint={stem}.shard$k.state --threads={threads}",
      fmt::arg("n", job.tasks), fmt::arg("spp", job.spp), fmt::arg("unit", unit),
      fmt::arg("each", job.spp / unit / job.tasks), fmt::arg("extra", job.spp / unit % job.tasks),
      fmt::arg("begin", begin), fmt::arg("words", cueWords(renderWords(job))),
      fmt::arg("stem", withoutTokens(shellQuoted(stemOf(job.output)))), fmt::arg("threads", threads));
}

std::string cueMergeScript(const FarmJob& job, const std::string& begin, const std::string& threads) {
  return fmt::format("set --; while [ $# -lt {} ]; do set -- \"$@\" {}.shard$#.state; done; {} merge \"$@\"{}{}",
                     job.tasks, withoutTokens(shellQuoted(operand(stemOf(job.output)))), begin,
                     cueWords(mergeOptions(job)), job.threads > 0 ? "" : " --threads=" + threads);
}

// Not shellQuoted() of what holds tokens that are meant: its quotes stand before and after, not within them.
std::string cueCommand(const std::string& script) {
  const std::string command = "/bin/sh -c " + shellQuoted(script);
  if (command.size() > 4000)
    throw Error(ExitCode::Usage, fmt::format("OpenCue stores at most 4000 characters of a command, and this one has "
                                             "{}: use shorter names",
                                             command.size()));
  return command;
}

}  // namespace

std::string openCueFramesText(const FarmJob& job, const std::vector<PassInterval>& shares) {
  const std::string begin =
      fmt::format("f=$(({} + {} * (#IFRAME# - 1))); cd -- {} && exec {}", job.frames.first, job.frames.step,
                  withoutTokens(shellQuoted(job.folder)), withoutTokens(shellQuoted(job.program)));
  const std::string threads =
      job.threads > 0 ? "" : std::string(" --threads=\"${CUE_THREADS:-0}\"");  // the words have the number
  const std::string cores =
      job.threads > 0 ? fmt::format(", threads={0}, cores={0}, overrideCores=True", job.threads) : "";
  std::string layers;
  const auto layer = [&](const std::string& name, const std::string& script) {
    layers += fmt::format(
        "layers.append(outline.modules.shell.Shell(\n    {}, command=[{}],\n    range=\"1-{}\", chunk=1, "
        "threadable=True{}))\n",
        nlohmann::json(name).dump(), nlohmann::json(cueCommand(script)).dump(), job.frames.count, cores);
  };
  for (uint64_t k = 0; k < job.tasks; ++k)
    layer(fmt::format("share{}", k),
          begin + cueWords(shareWords(job, k, shares[k])) + " --frames=$f:$((f + 1))" + threads);
  layer("merge", begin + cueWords(mergeWords(job)) + " --frame=$f" + threads);
  return fmt::format(
      R"(#!/usr/bin/env python3
# {title}.
#   python3 THIS_FILE    where OpenCue's packages are installed; SHOW, SHOT and the like as for every outline
# A share that is retried goes on from its checkpoint. The render hosts need braid and the folder, and no Python package.
import outline
import outline.cuerun
import outline.modules.shell

job = outline.Outline({name})
layers = []
{layers}for layer in layers:
    job.add_layer(layer)
for share in layers[:-1]:
    layers[-1].depend_on(share)  # frame by frame
outline.cuerun.launch(job, range="1-{frames}", use_pycuerun=False)
)",
      fmt::arg("title", jobTitle(job)), fmt::arg("name", nlohmann::json(jobName(job)).dump()),
      fmt::arg("layers", layers), fmt::arg("frames", job.frames.count));
}

std::string openCueText(const FarmJob& job, const std::vector<PassInterval>& shares) {
  const std::string begin = fmt::format("cd -- {} && exec {}", withoutTokens(shellQuoted(job.folder)),
                                        withoutTokens(shellQuoted(job.program)));
  const std::string threads = job.threads > 0 ? std::to_string(job.threads) : "\"${CUE_THREADS:-0}\"";
  const std::string render = cueCommand(cueShareScript(job, begin, threads));
  const std::string merge = cueCommand(cueMergeScript(job, begin, threads));
  const std::string cores =
      job.threads > 0 ? fmt::format(", threads={0}, cores={0}, overrideCores=True", job.threads) : "";
  return fmt::format(
      R"(#!/usr/bin/env python3
# {title}.
#   python3 THIS_FILE    where OpenCue's packages are installed; SHOW, SHOT and the like as for every outline
# A share that is retried goes on from its checkpoint. The render hosts need braid and the folder, and no Python package.
import outline
import outline.cuerun
import outline.modules.shell

job = outline.Outline({name})
shares = outline.modules.shell.Shell(
    "shares", command=[{render}],
    range="1-{n}", chunk=1, threadable=True{cores})
merge = outline.modules.shell.Shell(
    "merge", command=[{merge}],
    range="1", chunk=1, threadable=True{cores})
job.add_layer(shares)
job.add_layer(merge)
merge.depend_all(shares)
outline.cuerun.launch(job, range="1-{n}", use_pycuerun=False)
)",
      fmt::arg("title", jobTitle(job)), fmt::arg("name", nlohmann::json(jobName(job)).dump()),
      fmt::arg("n", shares.size()), fmt::arg("render", nlohmann::json(render).dump()),
      fmt::arg("merge", nlohmann::json(merge).dump()), fmt::arg("cores", cores));
}

}  // namespace braid::farm
