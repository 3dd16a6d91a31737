#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs the job that `braid plan --format slurm` prints on a real Slurm: a single node of Debian's packages with its own
# keys, ports and folders, stopped at the end. Shows that the merged image is that of the unsplit render, that a share
# that is told its time is up goes on in a second turn, and that a failed share cancels the merge.
#   tests/slurm_end_to_end.sh [BRAID]     (as root, or with Slurm's packages installed)
# Where Slurm cannot run it prints "SKIPPED: reason" and exits with 77.
set -euo pipefail
source=$(cd "$(dirname "$0")/.." && pwd)
braid=$(realpath "${1:-$source/build/release/braid}")
scene=$source/scenes/cornell.glb

skip() { echo "SKIPPED: $*"; exit 77; }
fail() { echo "FAILED: $*"; exit 1; }
[[ -x $braid ]] || fail "no braid at $braid: build it, or name one"

# --- Slurm -----------------------------------------------------------------------------------------------------------
if ! command -v slurmctld slurmd munged sbatch >/dev/null; then
  [[ $(id -u) == 0 ]] || skip "slurmctld, slurmd or munged is not installed, and only root can install them"
  { apt-get update -q && DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends \
    slurmctld slurmd slurm-client munge; } >/dev/null 2>&1 || skip "apt-get cannot install slurmctld, slurmd and munge"
fi
[[ $(id -u) == 0 ]] || skip "slurmd starts jobs as root only"

work=$(mktemp -d /tmp/braid-slurm.XXXXXX)
daemons=()
cleanup() {
  code=$?
  trap - EXIT
  ((${#daemons[@]})) && kill "${daemons[@]}" 2>/dev/null
  wait 2>/dev/null || true
  if [[ $code == 0 || $code == 77 ]]; then rm -rf "$work"; else echo "kept: $work"; fi
  exit "$code"
}
trap cleanup EXIT

chmod 755 "$work"
mkdir -p "$work"/{munge,state,spool,job}
chmod 700 "$work/munge"
head -c 1024 /dev/urandom >"$work/munge/key"
chmod 400 "$work/munge/key"
host=$(hostname -s)
cpus=$(nproc)
cat >"$work/slurm.conf" <<END
ClusterName=braid
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
SlurmctldPort=26817
SlurmdPort=26818
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
CryptoType=crypto/munge
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
SchedulerParameters=batch_sched_delay=0,sched_interval=1
KillWait=10
NodeName=$host NodeAddr=127.0.0.1 CPUs=$cpus State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
END
export SLURM_CONF=$work/slurm.conf

munged --foreground --force --key-file="$work/munge/key" --socket="$work/munge/socket" --pid-file="$work/munge/pid" \
  --log-file="$work/munge/log" --seed-file="$work/munge/seed" >"$work/munge/out" 2>&1 &
daemons+=($!)
for _ in {1..50}; do [[ -S $work/munge/socket ]] && break; sleep 0.1; done
[[ -S $work/munge/socket ]] || skip "munged does not start: $(tail -1 "$work/munge/log" "$work/munge/out" 2>/dev/null | tr '\n' ' ')"
slurmctld -D >"$work/slurmctld.out" 2>&1 &
daemons+=($!)
slurmd -D >"$work/slurmd.out" 2>&1 &
daemons+=($!)
up() { [[ $(sinfo -h -o %T 2>/dev/null) == idle ]]; }
for _ in {1..60}; do up && break; sleep 0.5; done
up || skip "Slurm does not come up here: $(grep -hE 'error|fatal' "$work"/slurm*.{log,out} 2>/dev/null | tail -2 | tr '\n' ' ')"
echo "Slurm: $(slurmd -V), node $host with $cpus processors"

# --- Jobs ------------------------------------------------------------------------------------------------------------
state() { scontrol show job "$1" -o 2>/dev/null | grep -oE 'JobState=[A-Z_]+' | cut -d= -f2 | sort -u | tr '\n' ' '; }
submit() { # job.sh [options]; sets `shares` and `merge`
  local line
  line=$(bash "$@")
  echo "  $line"
  shares=$(sed -E 's/.*shares: job ([0-9]+).*/\1/' <<<"$line")
  merge=$(sed -E 's/.*merge: job ([0-9]+).*/\1/' <<<"$line")
}
await() { # job state-pattern seconds
  for ((i = 0; i < $3 * 5; ++i)); do
    [[ $(state "$1") =~ $2 ]] && return 0
    sleep 0.2
  done
  fail "job $1 is '$(state "$1")' after $3 s, expected $2: $(tail -n 3 "$work"/job/slurm-*.out 2>/dev/null)"
}

cd "$work/job"
options=(--size 64x48 --max-depth 6 --combine js --biased box --quarters)

echo "1. four shares and their merge"
"$braid" plan "$scene" -q "${options[@]}" --spp 18 --threads 1 --tasks 4 --format slurm -o "my out.exr" >job.sh
submit job.sh
await "$merge" COMPLETED 120
"$braid" render "$scene" -q "${options[@]}" --spp 18 -o whole.exr
[[ $(cd "$work/job" && ls ./*.state | wc -l) == 4 ]] || fail "expected four states: $(ls)"
"$braid" compare "my out.exr" whole.exr --metric relL2,MSE --max 1e-6
echo "  the merged image is that of the unsplit render"

echo "2. a share whose time is up goes on in a second turn"
"$braid" plan "$scene" "${options[@]}" --spp 600 --threads 1 --tasks 1 --save-every 1 --format slurm -o turns.exr >turns.sh
submit turns.sh
await "$shares" RUNNING 60
for _ in {1..100}; do [[ -e turns.shard0.state ]] && break; sleep 0.1; done
[[ -e turns.shard0.state ]] || fail "no checkpoint yet: $(cat slurm-"$shares"_0.out)"
scancel --batch --signal=USR1 "${shares}_0"
for ((i = 0; i < 150; ++i)); do
  restarts=$(scontrol show job "${shares}_0" -o | grep -oE 'Restarts=[0-9]+' | cut -d= -f2)
  [[ $restarts == 1 ]] && break
  sleep 0.2
done
[[ $restarts == 1 ]] || fail "the share was not requeued: $(state "$shares") $(cat slurm-"$shares"_0.out)"
echo "  requeued with $(stat -c %s turns.shard0.state) bytes of state"
# A requeued job waits for two minutes; told not to, it still has to let slurmd forget the first turn's credential.
await "${shares}_0" PENDING 60
sleep 5
scontrol update JobId="${shares}_0" StartTime=now
await "$merge" COMPLETED 240
"$braid" render "$scene" -q "${options[@]}" --spp 600 -o turns_whole.exr
"$braid" compare turns.exr turns_whole.exr --metric relL2,MSE --max 1e-6
echo "  and the image is that of one turn"

echo "3. a share that fails cancels the merge"
sed 's/--size=64x48/--size=no/' job.sh | sed 's/my out/bad/g' >bad.sh
submit bad.sh
await "$merge" CANCELLED 60
[[ ! -e bad.exr ]] || fail "an image was made of failed shares"
echo "PASSED"
