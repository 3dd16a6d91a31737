#!/usr/bin/env bash
# Looks for data races: short renders by every integrator, published, combined by every method and resumed, under
# ThreadSanitizer. Not part of tools/test: it needs a build of its own. What cannot be judged, and why, is in
# tests/thread_sanitizer.supp.
set -euo pipefail
cd "$(dirname "$0")/.."
cmake -G Ninja -S . -B build/thread -DCMAKE_BUILD_TYPE=Debug -DBRAID_SANITIZE=thread -DBRAID_TESTS=OFF \
  -DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=6 -DCMAKE_CXX_FLAGS_DEBUG="-O1 -g1" >&2
cmake --build build/thread --target braid >&2
export TSAN_OPTIONS="suppressions=$PWD/tests/thread_sanitizer.supp:halt_on_error=1:exitcode=66"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
run() {
  echo "braid $*" >&2
  build/thread/braid "$@" --threads 4 > "$work/log" 2>&1 || { cat "$work/log"; echo "FAILED: braid $*"; exit 1; }
}
for integrator in pt bdpt sppm crn gdpt vcm auto; do
  run render scenes/glass_of_water.glb --integrator "$integrator" --size 48x36 --spp 6 --save-every 0.2 -o "$work/a.exr"
done
methods=$(build/thread/braid --list | awk '/^[a-z]/{on = /^(denoisers|combiners)$/; next} on && $1 !~ /external|oidn/ {printf "%s%s", sep, $1; sep=","}')
run render scenes/cornell.glb --integrator pt,crn,sppm --size 64x48 --spp 16 --combine "$methods" --save-every 0.1 \
  --checkpoint "$work/b.state" -o "$work/b.exr" --png "$work/b.png"
run render scenes/cornell.glb --integrator pt,crn,sppm --size 64x48 --spp 20 --combine "$methods" --resume \
  --checkpoint "$work/b.state" -o "$work/b.exr"
run render scenes/materials.glb --size 48x36 --spp 4 --transparent --filter gaussian -o "$work/c.exr"
build/thread/braid preview scenes/cornell.glb --size 64x48 --spp 200 --http 0 -o "$work/d.exr" > "$work/url" 2> "$work/log" &
preview=$!
until url=$(grep -o 'http://[^ ]*' "$work/url" "$work/log" -h | head -1) && [[ $url ]]; do sleep 0.2; done
for _ in $(seq 20); do for what in state.json 'image?view=noisy' 'image?view=combined'; do curl -s "$url$what" > /dev/null || true; done; sleep 0.1; done
wait "$preview" || { cat "$work/log"; echo "FAILED: braid preview"; exit 1; }
echo "no data race found"
