#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Training data of js-neural and double-shrinkage-neural: views of random scenes, as the networks see them.

    python3 tools/train/shrinkage_data.py FIRST END FOLDER [--braid PROGRAM] [--size WxH] [--target SAMPLES]

Renders two views of each scene from FIRST to before END (tools/train/scenes.py), by pt and sppm at 4 to 32 samples, and
writes FOLDER/SCENE_VIEW.npz: for each number of samples what both methods write of it, of js-neural towards pw and
towards sppm in turn. A view that is there is left alone. The target is what braid makes by default of the samples named.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from data import half, read, rgb
from shrinkage import METHODS

# Of each view one of each group.
SAMPLES = ((4, 8, 16), (16, 32))


def run(*call):
    done = subprocess.run(call, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr.strip())


def planes_of(program, image, method, biased, folder):
    """What the method would read, errors as logarithms, and the exposure that it reads it in."""
    out = os.path.join(folder, "planes.exr")
    run(program, "combine", "--unbiased", image, "--method", f"{method}@{biased}", f"--{method}-planes", "1", "--weights",
        "--float", "-q", "-o", out)
    channels, exposure = read(out, f"braid/{method}@{biased}/{method}-exposure")
    assert exposure, f"{out} does not say its exposure"
    kind = METHODS[method]
    stored = np.stack([channels[f"{method}.{k:02}.Y"] for k in range(kind.STORED)])
    stored[kind.LOGARITHMS] = np.log2(stored[kind.LOGARITHMS] + 2.0**-40)
    return stored.astype(np.float32), np.float32(exposure)


class Renderer:
    def __init__(self, options, folder):
        self.program, self.size, self.target, self.folder = options.braid, options.size, options.target, folder

    def render(self, scene, camera, samples, seed, more, name):
        out = os.path.join(self.folder, name)
        run(self.program, "render", scene["file"], "-o", out, "--spp", str(samples), "--seed", str(seed), "--size", self.size,
            "--look-at", camera["look_at"], "--yfov", str(camera["yfov"]), "--threads", "1", "-q", "--float", "--aovs", "all",
            *scene["options"], *more)
        return out

    def view(self, scene, camera, seed, view):
        """Planes and target of each number of samples, or None where there is nothing to see."""
        target, _ = read(self.render(scene, camera, self.target, 7000 + seed, [], "target.exr"), "")
        truth = rgb(target, "")
        if not truth.mean() > 1e-4 or np.median(truth.std(axis=(1, 2))) < 0.02 * truth.mean():
            return None
        arrays, chosen = {}, []
        for group, candidates in enumerate(SAMPLES):
            samples = candidates[(seed + view) % len(candidates)]
            image = self.render(scene, camera, samples, 10 * seed + group,
                                ["--integrator", "pt,sppm", "--combine", "none"], "image.exr")
            for method in METHODS:
                biased = "sppm" if method != "js-neural" or (seed + view + group) % 4 == 0 else "pw"
                planes, arrays[f"{method}-exposure{group}"] = planes_of(self.program, image, method, biased, self.folder)
                arrays[f"{method}{group}"] = half(planes)
            chosen.append(samples)
        return {"target": truth.astype(np.float32), "samples": np.array(chosen), **arrays}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int)
    parser.add_argument("end", type=int)
    parser.add_argument("folder")
    parser.add_argument("--braid", default="tools/braid")
    parser.add_argument("--size", default="96x64")
    parser.add_argument("--target", type=int, default=96)
    options = parser.parse_args()
    import scenes  # reads the repository's generator

    os.makedirs(options.folder, exist_ok=True)
    for seed in range(options.first, options.end):
        names = [os.path.join(options.folder, f"{seed:05}_{view}.npz") for view in range(2)]
        if all(os.path.exists(name) for name in names):
            continue
        with tempfile.TemporaryDirectory() as folder:
            scene = scenes.make(seed, folder)
            scene["file"] = os.path.join(folder, f"{seed}.glb")
            renderer = Renderer(options, folder)
            for view, camera in enumerate(scene["cameras"][:2]):
                if os.path.exists(names[view]):
                    continue
                try:
                    arrays = renderer.view(scene, camera, seed, view)
                except RuntimeError as error:
                    print(json.dumps({"scene": seed, "view": view, "error": str(error)}), flush=True)
                    continue
                if arrays is not None:
                    np.savez(names[view] + ".part.npz", **arrays)
                    os.replace(names[view] + ".part.npz", names[view])
                print(json.dumps({"scene": seed, "view": view, "kept": arrays is not None}), flush=True)


if __name__ == "__main__":
    main()
