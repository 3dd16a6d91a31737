// SPDX-License-Identifier: Apache-2.0
// Jobs of many frames for Slurm.
#include <fmt/format.h>

#include "tools/farm/farm_words.h"

namespace braid::farm {

std::string slurmThreads(const FarmJob& job) {
  return job.threads > 0 ? std::to_string(job.threads) : std::string("\"${SLURM_CPUS_ON_NODE:-0}\"");
}

std::string slurmShareScript(const FarmJob& job, const std::string& before, const std::string& command) {
  return fmt::format(R"(#!/bin/bash
cd -- {folder} || exit
{before}signalled=
again=
trap 'signalled=yes' TERM  # Slurm sends it to braid as well, which saves and ends
trap 'signalled=yes; again=yes; kill -TERM "$render"' USR1
{command} &
render=$!
while true; do
  wait "$render"
  code=$?
  [ -n "$signalled" ] || break
  signalled=
done
if [ -n "$again" ] && [ "$code" -eq 130 ]; then exec scontrol requeue "$SLURM_JOB_ID"; fi
exit "$code"
)",
                     fmt::arg("folder", shellQuoted(job.folder)), fmt::arg("before", before),
                     fmt::arg("command", command));
}

std::string slurmFramesText(const FarmJob& job, const std::vector<PassInterval>& shares) {
  std::string submissions;
  const std::string threads = slurmThreads(job);
  const std::string frame =
      fmt::format("frame=$(({} + {} * SLURM_ARRAY_TASK_ID))\n", job.frames.first, job.frames.step);
  for (uint64_t k = 0; k < job.tasks; ++k) {
    FarmJob own = job;
    own.threads = 0;  // said below
    const std::string command =
        fmt::format("{} {} --frames=\"$frame:$((frame + 1))\" --threads={}", shellQuoted(job.program),
                    shellLine(shareWords(own, k, shares[k])), threads);
    submissions +=
        fmt::format("submit --job-name={}_{} --requeue --signal=B:USR1@120 <<'END_OF_SHARE'\n{}END_OF_SHARE\n",
                    jobName(job), k, slurmShareScript(job, frame, command));
  }
  return fmt::format(
      R"(#!/bin/bash
# {title}.
#   bash THIS_FILE [options of sbatch for all jobs, such as --partition=long --time=8:00:00 --mem=16G]
# Arrays over the frames, one a share, and one of merges, each of which waits for its own shares. A share that is
# requeued, or submitted again with this file, goes on from its checkpoint; what is finished ends at once. Two minutes
# before the time limit a share saves and requeues itself.
set -euo pipefail
cd -- {folder}

options=("$@")
jobs=
submit() {{
  local job
  job=$(sbatch --parsable --array=0-{last}{cpus} "$@" "${{options[@]}}") || {{ scancel ${{jobs//:/ }}; exit 1; }}
  jobs=$jobs:${{job%%;*}}
}}
{submissions}submit --job-name={name}_merge --dependency="aftercorr$jobs" --kill-on-invalid-dep=yes <<'END_OF_MERGE'
#!/bin/bash
{frame}cd -- {folder} && exec {program} {merge} --frame="$frame"{merge_threads}
END_OF_MERGE
echo "shares, and merges last: jobs ${{jobs//:/ }}"
)",
      fmt::arg("title", jobTitle(job)), fmt::arg("folder", shellQuoted(job.folder)), fmt::arg("name", jobName(job)),
      fmt::arg("last", job.frames.count - 1),
      fmt::arg("cpus", job.threads > 0 ? fmt::format(" --cpus-per-task={}", job.threads) : ""),
      fmt::arg("submissions", submissions), fmt::arg("frame", frame), fmt::arg("program", shellQuoted(job.program)),
      fmt::arg("merge", shellLine(mergeWords(job))),
      fmt::arg("merge_threads", job.threads > 0 ? "" : " --threads=" + threads));
}

}  // namespace braid::farm
