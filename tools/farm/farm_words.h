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

// `render` and its options, but for --passes, --checkpoint and --threads.
Words renderWords(const FarmJob& job);
Words shareWords(const FarmJob& job, uint64_t task, const PassInterval& passes);
Words mergeOptions(const FarmJob& job);
Words mergeWords(const FarmJob& job);
std::string shellLine(const Words& words);

// A name that every scheduler takes: letters, digits and underscores.
std::string jobName(const FarmJob& job);
std::string jobTitle(const FarmJob& job);

// The script of FarmFormat::OpenCue.
std::string openCueText(const FarmJob& job, const std::vector<PassInterval>& shares);

}  // namespace braid::farm
