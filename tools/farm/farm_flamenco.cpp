// SPDX-License-Identifier: Apache-2.0
// Jobs for Flamenco. Workers run `exec` without a shell; env changes the folder.
#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "tools/farm/farm_words.h"

namespace braid::farm {

namespace {

constexpr char kJobType[] =
    R"(// {title}.
// Save as {name}.js in the folder `scripts` beside Flamenco Manager, then submit:
//   curl -H 'Content-Type: application/json' http://MANAGER:8080/api/v3/jobs -d \
//     '{{"name": "{name}", "type": "{type}", "priority": 50, "submitter_platform": "linux", "settings": {{}}}}'
// A share that is run again goes on from its checkpoint.
const DATA = {data};

const JOB_TYPE = {{
  label: {label},
  settings: [
    {{ key: "program", type: "string", default: DATA.program, description: "The braid that workers run" }},
  ],
}};

function makeTask(job, step, type) {{
  const program = job.settings.program || DATA.program;
  const task = author.Task(step.name, type);
  task.addCommand(author.Command("exec", {{ exe: "env", args: ["-C", DATA.folder, program].concat(step.args) }}));
  return task;
}}

function compileImage(job, image) {{
  const merge = makeTask(job, image.merge, "misc");
  for (let i = 0; i < image.shares.length; i++) {{
    const share = makeTask(job, image.shares[i], "misc");
    job.addTask(share);
    merge.addDependency(share);
  }}
  job.addTask(merge);
}}

function compileJob(job) {{
  for (let i = 0; i < DATA.images.length; i++) compileImage(job, DATA.images[i]);
}}
)";

// The words of all tasks: of each image, those of its shares and of their merge.
nlohmann::ordered_json tasksOf(const FarmJob& job, const std::vector<PassInterval>& shares) {
  nlohmann::ordered_json data = {{"folder", job.folder}, {"program", job.program}, {"images", {}}};
  for (uint64_t i = 0; i < std::max<uint64_t>(1, job.frames.count); ++i) {
    const bool framed = job.frames.count > 0;
    const std::string name = framed ? fmt::format("frame {} ", job.frames.at(i)) : "";
    nlohmann::ordered_json image = {{"shares", {}}, {"merge", {}}};
    for (uint64_t k = 0; k < job.tasks; ++k) {
      Words words = shareWords(job, k, shares[k]);
      if (framed) words.push_back(renderFrame(job.frames.at(i)));
      image["shares"].push_back(
          {{"name", fmt::format("{}passes {}:{}", name, shares[k].begin, shares[k].end)}, {"args", words}});
    }
    Words words = mergeWords(job);
    if (framed) words.push_back(mergeFrame(job.frames.at(i)));
    image["merge"] = {{"name", name + "merge"}, {"args", words}};
    data["images"].push_back(image);
  }
  return data;
}

}  // namespace

std::string flamencoText(const FarmJob& job, const std::vector<PassInterval>& shares) {
  std::string type = jobName(job);
  std::replace(type.begin(), type.end(), '_', '-');
  // Escaped, for JavaScript ends lines at characters that JSON does not.
  return fmt::format(kJobType, fmt::arg("title", jobTitle(job)), fmt::arg("name", jobName(job)), fmt::arg("type", type),
                     fmt::arg("data", tasksOf(job, shares).dump(2, ' ', true)),
                     fmt::arg("label", nlohmann::json("braid: " + job.output).dump(-1, ' ', true)));
}

}  // namespace braid::farm
