// SPDX-License-Identifier: Apache-2.0
// One render as a job for an existing farm: shares by passes (`braid render --passes A:B`), each with a checkpoint that
// a task started again goes on from, and a merge that waits for all of them; or the same for every frame of an
// animation. Options in, text out; nothing is run.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "renderer/film/film_state.h"

namespace braid {

enum class FarmFormat { Slurm, OpenCue, Flamenco, Make };

// slurm, opencue, flamenco or make. Throws Error(Usage).
FarmFormat parseFarmFormat(const std::string& name);

// One option as on a command line: the long name with its dashes, and the value unless it is a flag.
struct FarmOption {
  std::string name;
  std::optional<std::string> value;
  bool operator==(const FarmOption&) const = default;
};

// Frames first, first + step, …
struct FarmFrames {
  uint64_t first = 0, step = 1, count = 0;  // count 0: one image without a number
  uint64_t at(uint64_t i) const { return first + i * step; }
};

struct FarmJob {
  std::string program;        // the braid that the machines run
  std::string folder;         // absolute: where relative file names count
  std::string scene, output;  // glTF file, EXR file
  std::vector<FarmOption> render,
      merge;  // besides those that this file adds: scene, passes, checkpoint, output, threads
  uint64_t spp = 0, tasks = 0;
  FarmFrames frames;  // names of files hold a place for their numbers, which braid fills
  int threads = 0;    // of every share; 0: as many processors as the farm gives it
};

// [0, spp) in `tasks` intervals, in order. Pass p belongs to quarter p % 4 and half p % 2 (film.h), so all but the last
// interval are multiples of 4 passes if there are that many, else of 2, else of 1; lengths differ by no more than that,
// or for a remainder by less than twice that. Throws Error(Usage) unless 1 <= tasks <= spp.
std::vector<PassInterval> splitPasses(uint64_t spp, uint64_t tasks);

// The state of share `task`: beside the output, OUT.shard0.state and so on for OUT.exr.
std::string shareFile(const std::string& output, uint64_t task);

// One word of a POSIX shell, whatever bytes it holds, readable where it needs no quotes.
std::string shellQuoted(const std::string& text);

// The whole job:
//   slurm     bash script that submits an array and the merge (sbatch, afterok); with frames an array over them for
//             every share, and one of merges whose tasks wait for theirs (aftercorr)
//   opencue   Python script that launches an outline of two layers; with frames one a share and one of merges
//   flamenco  JavaScript job type for the Manager's folder `scripts`
//   make      Makefile
// Throws Error(Usage) for what a format cannot carry: control characters in all of them, text that is not UTF-8 in
// Python and JavaScript, commands longer than OpenCue stores.
std::string farmJobText(const FarmJob& job, FarmFormat format);

}  // namespace braid
