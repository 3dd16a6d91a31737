// SPDX-License-Identifier: Apache-2.0
// The commands of a job for a farm, word by word.
#pragma once

#include <string>
#include <vector>

#include "tools/farm/farm_job.h"

namespace braid::farm {

using Words = std::vector<std::string>;

// A file name where an option could stand.
std::string operand(const std::string& file);
std::string stemOf(const std::string& output);

// `render` and its options, but for --frames, --passes, --checkpoint and --threads.
Words renderWords(const FarmJob& job);
Words shareWords(const FarmJob& job, uint64_t task, const PassInterval& passes);
Words mergeOptions(const FarmJob& job);
Words mergeWords(const FarmJob& job);
// What one frame adds to them.
std::string renderFrame(uint64_t frame);
std::string mergeFrame(uint64_t frame);
std::string shellLine(const Words& words);

// How many threads a task on Slurm has, as a word of shell.
std::string slurmThreads(const FarmJob& job);

// A name that every scheduler takes: letters, digits and underscores.
std::string jobName(const FarmJob& job);
std::string jobTitle(const FarmJob& job);

// The scripts of FarmFormat::Flamenco and OpenCue, and those of frames for the latter and Slurm.
std::string flamencoText(const FarmJob& job, const std::vector<PassInterval>& shares);
std::string openCueText(const FarmJob& job, const std::vector<PassInterval>& shares);
std::string openCueFramesText(const FarmJob& job, const std::vector<PassInterval>& shares);
std::string slurmFramesText(const FarmJob& job, const std::vector<PassInterval>& shares);

// The script of one share on Slurm. Bash has to stay beside braid, to ask for another turn when the time limit is near.
// `command` is a line of shell that may end in options.
std::string slurmShareScript(const FarmJob& job, const std::string& before, const std::string& command);

}  // namespace braid::farm
