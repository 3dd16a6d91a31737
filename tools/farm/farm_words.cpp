// SPDX-License-Identifier: Apache-2.0
#include "tools/farm/farm_words.h"

#include <filesystem>

#include <fmt/format.h>

namespace braid::farm {

namespace {

// --name=value, so that values may begin with a dash.
void append(Words& words, const std::vector<FarmOption>& options) {
  for (const FarmOption& o : options) words.push_back(o.value ? o.name + "=" + *o.value : o.name);
}

}  // namespace

std::string operand(const std::string& file) { return file.starts_with('-') ? "./" + file : file; }

std::string stemOf(const std::string& output) {
  return output.ends_with(".exr") ? output.substr(0, output.size() - 4) : output;
}

Words renderWords(const FarmJob& job) {
  Words words{"render", operand(job.scene)};
  append(words, job.render);
  words.push_back("--resume");
  return words;
}

Words mergeOptions(const FarmJob& job) {
  Words words{"--output=" + job.output};
  append(words, job.merge);
  if (job.threads > 0) words.push_back(fmt::format("--threads={}", job.threads));
  return words;
}

Words shareWords(const FarmJob& job, uint64_t task, const PassInterval& passes) {
  Words words = renderWords(job);
  words.push_back(fmt::format("--passes={}:{}", passes.begin, passes.end));
  words.push_back("--checkpoint=" + shareFile(job.output, task));
  if (job.threads > 0) words.push_back(fmt::format("--threads={}", job.threads));
  return words;
}

Words mergeWords(const FarmJob& job) {
  Words words{"merge"};
  for (uint64_t k = 0; k < job.tasks; ++k) words.push_back(operand(shareFile(job.output, k)));
  for (const std::string& w : mergeOptions(job)) words.push_back(w);
  return words;
}

std::string renderFrame(uint64_t frame) { return fmt::format("--frames={}:{}", frame, frame + 1); }
std::string mergeFrame(uint64_t frame) { return fmt::format("--frame={}", frame); }

std::string shellLine(const Words& words) {
  std::string text;
  for (const std::string& w : words) text += (text.empty() ? "" : " ") + shellQuoted(w);
  return text;
}

std::string jobName(const FarmJob& job) {
  std::string name = "braid_" + std::filesystem::path(stemOf(job.output)).filename().string();
  for (char& c : name)
    if (!((c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'))) c = '_';
  return name;
}

std::string jobTitle(const FarmJob& job) {
  if (job.frames.count == 0)
    return fmt::format("braid render of {}: {} samples per pixel in {} shares, and their merge to {}", job.scene,
                       job.spp, job.tasks, job.output);
  return fmt::format("braid render of {}: {} frames of {} samples per pixel in {} shares, each with its merge to {}",
                     job.scene, job.frames.count, job.spp, job.tasks, job.output);
}

}  // namespace braid::farm
