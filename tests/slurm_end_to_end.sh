#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs the job that `braid plan --format slurm` prints on a real Slurm: a single node of Debian's packages with its own
# keys, ports and folders, stopped at the end. Shows that the merged image is that of the unsplit render, that a share
# that is told its time is up goes on in a second turn, that a failed share cancels the merge, and that an animation of
# 24 frames is finished by a second submission after a share and a merge have failed.
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
missing() {
  for program in slurmctld slurmd munged sbatch; do command -v $program >/dev/null || return 0; done
  return 1
}
if missing; then
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
echo "4. 24 frames, of which a share and a merge fail"
python3 - "$scene" moving.glb <<'END_OF_PYTHON'
import json, struct, sys

data = open(sys.argv[1], "rb").read()
size = struct.unpack("<I", data[12:16])[0]
root, binary = json.loads(data[20:20 + size]), data[28 + size:]
keys = struct.pack("<8f", 0, 1, 0, 0, 0, 0, 0.1, 0)
views = root["bufferViews"]
for offset, length in ((0, 8), (8, 24)):
    views.append({"buffer": 0, "byteOffset": len(binary) + offset, "byteLength": length})
root["accessors"] += [
    {"bufferView": len(views) - 2, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1]},
    {"bufferView": len(views) - 1, "componentType": 5126, "count": 2, "type": "VEC3"}]
node = next(i for i, n in enumerate(root["nodes"]) if "mesh" in n and "matrix" not in n)
last = len(root["accessors"]) - 1
root["animations"] = [{"samplers": [{"input": last - 1, "output": last}],
                       "channels": [{"sampler": 0, "target": {"node": node, "path": "translation"}}]}]
root["buffers"][0]["byteLength"] = len(binary) + 32
text = json.dumps(root).encode()
text += b" " * (-len(text) % 4)
binary += keys
out = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
open(sys.argv[2], "wb").write(struct.pack("<III", 0x46546C67, 2, 12 + len(out)) + out)
END_OF_PYTHON
cat >flaky <<END_OF_FLAKY
#!/bin/sh
case "\$*" in
*--passes=4:8*--frames=5:6*) mkdir failed_share 2>/dev/null && exit 9 ;;
merge*--frame=11*) mkdir failed_merge 2>/dev/null && exit 9 ;;
esac
exec '$braid' "\$@"
END_OF_FLAKY
chmod +x flaky
frames=(--frames 0:24 --fps 24)
"$braid" plan moving.glb -q "${options[@]}" "${frames[@]}" --spp 8 --threads 1 --tasks 2 --format slurm \
  --program "$work/job/flaky" -o "f_##.exr" >frames.sh
merges() { # the job of merges
  local line
  line=$(bash frames.sh)
  echo "  $line" >&2
  sed -E 's/.* ([0-9]+) *$/\1/' <<<"$line"
}
ended() { ! squeue -h -j "$1" 2>/dev/null | grep -q .; }
merge=$(merges)
for ((i = 0; i < 600; ++i)); do ended "$merge" && break; sleep 0.2; done
count=$(ls f_??.exr | wc -l)
[[ $count == 22 && ! -e f_05.exr && ! -e f_11.exr ]] || fail "expected 22 frames, all but 5 and 11: $(ls f_??.exr)"
echo "  22 frames are there; the job is submitted again"
touch -d '1 hour ago' f_??.exr
merge=$(merges)
for ((i = 0; i < 600; ++i)); do ended "$merge" && break; sleep 0.2; done
[[ $(ls f_??.exr | wc -l) == 24 ]] || fail "frames are missing: $(ls f_??.exr)"
[[ $(find . -name 'f_??.exr' -newermt '30 minutes ago' | wc -l) == 2 ]] || fail "finished frames were made again"
"$braid" render moving.glb -q "${options[@]}" "${frames[@]}" --spp 8 --aovs all -o "w_##.exr"
for ((i = 0; i < 24; ++i)); do
  n=$(printf %02d $i)
  "$braid" compare "f_$n.exr" "w_$n.exr" --metric relL2,MSE --max 1e-6 >/dev/null || fail "frame $n differs"
done
echo "  all 24 are those of one process"
echo "PASSED"
