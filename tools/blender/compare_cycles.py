#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Error against processor seconds of braid and of Blender's Cycles, on four scenes made in Blender.

    tools/blender/compare_cycles.py FOLDER [--scenes window,lamps,balls,gap] [--size 320x180] [--spp 4,16,64]
                                    [--seeds 1] [--reference-spp 2048] [--threads 1]

Each renderer is judged by a long render of its own: relL2 and HDR-FLIP of `braid compare`, medians over seeds. Seconds
are those of processors: of the whole process of braid, with combining; of Cycles its rendering alone, without Blender's
start, and what Open Image Denoise adds (its weights: tools/setup oidn; without them that row is left out). The last
columns of a row are errors of braid over the row's: at as many samples, and at as many seconds, by lines between
measured points on logarithmic scales. Needs Blender 3.4 and braid (BRAID names another program). What FOLDER holds already is kept.
"""
import argparse
import json
import math
import os
import pathlib
import resource
import statistics
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
BRAID = os.environ.get("BRAID", str(HERE.parent / "braid"))
SEED_OF_REFERENCES = 1000
ROWS = {"pt": ["--integrator", "pt", "--combine", "none"], "auto": []}  # of braid
LONGEST_PATH = 14  # in segments: twelve bounces


def run(*words):
    """Processor seconds of the command; where it fails, its last lines end this program."""
    def spent():
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime
    before = spent()
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)
    if done.returncode:
        told = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        sys.exit("\n".join(["failed: " + " ".join(map(str, words)), *told[-3:]]))
    return spent() - before


def blender(name, *rest):
    run("blender", "-b", "--python-exit-code", "1", "-P", HERE / "rooms.py", "--", name, *rest)


class Measurement:
    """A folder of renders of one scene, each with its seconds beside it."""

    def __init__(self, folder, name, options):
        self.folder, self.name, self.options = folder / name, name, options
        self.folder.mkdir(parents=True, exist_ok=True)
        if not (self.folder / "words.json").exists():
            blender(name, "export", self.folder)
        self.words = json.loads((self.folder / "words.json").read_text(encoding="utf-8"))

    def kept(self, file, make):
        """The seconds of a file, made if it is not there."""
        seconds = self.folder / (file + ".seconds")
        if not seconds.exists():
            made = make(self.folder / file)
            if made is not None:
                seconds.write_text(str(made), encoding="utf-8")
        return float(seconds.read_text(encoding="utf-8"))

    def cycles(self, spp, seed):
        file = f"cycles.{spp}.{seed}.exr"
        return file, self.kept(file, lambda out: blender(self.name, "cycles", self.options.size, spp, seed,
                                                         self.options.threads, out))

    def denoised(self, spp, seed):
        noisy, seconds = self.cycles(spp, seed)
        file = f"oidn.{spp}.{seed}.exr"

        def make(out):
            run(BRAID, "combine", self.folder / noisy, "--method", "oidn", "--aovs", "none", "--float", "--threads", 1,
                "-q", "-o", out)
            told = json.loads(subprocess.check_output([BRAID, "info", "--json", out]))
            return told["attributes"]["braid/oidn/seconds"]
        return file, seconds + self.kept(file, make)

    def braid(self, row, spp, seed):
        file = f"{row}.{spp}.{seed}.exr"
        return file, self.kept(file, lambda out: run(
            BRAID, "render", *self.words, "--size", self.options.size, "--spp", spp, "--seed", seed, "--max-depth",
            LONGEST_PATH, "--threads", self.options.threads, "--aovs", "none", "--float", "-q", *ROWS[row], "-o", out))

    def reference(self, of_cycles):
        spp, seed = self.options.reference_spp, SEED_OF_REFERENCES
        return (self.cycles(spp, seed) if of_cycles else self.braid("pt", spp, seed))[0]

    def errors(self, file, of_cycles):
        layers = []
        for option, one in (("--layer", file), ("--reference-layer", "cycles." if of_cycles else "")):
            if one.startswith("cycles."):
                layers += [option, "ViewLayer.Combined"]
        told = subprocess.check_output([BRAID, "compare", self.folder / file, self.folder / self.reference(of_cycles),
                                        "--metric", "relL2,FLIP", "--json", *layers])
        return json.loads(told)["metrics"]

    def median(self, make, spp, of_cycles):
        """Seconds, relL2 and HDR-FLIP."""
        points = []
        for seed in range(1, self.options.seeds + 1):
            file, seconds = make(spp, seed)
            metrics = self.errors(file, of_cycles)
            points.append((seconds, metrics["relL2"], metrics["FLIP"]))
        return tuple(statistics.median(values) for values in zip(*points))


def at(points, seconds):
    """The relL2 at so many seconds; none before the first point."""
    points = sorted((math.log(s), math.log(max(error, 1e-12))) for s, error, _ in points)
    x = math.log(seconds)
    if x < points[0][0] or len(points) < 2:
        return None
    (x0, y0), (x1, y1) = next((pair for pair in zip(points, points[1:]) if x <= pair[1][0]), points[-2:])
    return math.exp(y0 + (y1 - y0) * (x - x0) / (x1 - x0))


def table(measured, has_oidn):
    ladder = [int(spp) for spp in measured.options.spp.split(",")]
    braid = {row: {spp: measured.median(lambda spp, seed, r=row: measured.braid(r, spp, seed), spp, False)
                   for spp in sorted({1, *ladder})} for row in ROWS}
    ratios = "".join(f"{f'{row}, {equal}':>14}" for row in ROWS for equal in ("samples", "seconds"))
    print(f"\n{measured.name}\n{'':12}{'spp':>6}{'seconds':>10}{'relL2':>12}{'FLIP':>9}{ratios}")
    for row, points in braid.items():
        for spp, (seconds, error, flip) in points.items():
            print(f"{row:12}{spp:6}{seconds:10.2f}{error:12.3e}{flip:9.4f}")
    for row, make in (("Cycles", measured.cycles), ("with OIDN", measured.denoised))[:1 + has_oidn]:
        for spp in ladder:
            seconds, error, flip = measured.median(make, spp, True)
            print(f"{row:12}{spp:6}{seconds:10.2f}{error:12.3e}{flip:9.4f}", end="")
            for points in braid.values():
                for value in (points[spp][1], at(points.values(), seconds)):
                    print(f"{value / error:14.3f}" if value is not None else f"{'not begun':>14}", end="")
            print(flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--scenes", default="window,lamps,balls,gap")
    parser.add_argument("--size", default="320x180")
    parser.add_argument("--spp", default="4,16,64")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--reference-spp", type=int, default=2048)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    for name in options.scenes.split(","):
        measured = Measurement(options.folder.resolve(), name, options)
        oidn = subprocess.run([BRAID, "plan", measured.words[0], "--combine", "oidn"], capture_output=True, text=True,
                              check=False)
        table(measured, "\n- oidn" not in oidn.stdout)


main()
