#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Training data of js-neural and double-shrinkage-neural: views of random scenes, as the networks see them.

    python3 tools/train/shrinkage_data.py FIRST END FOLDER [--braid PROGRAM] [--size WxH] [--target SAMPLES]

Renders two views of each scene from FIRST to before END (tools/train/scenes.py), by pt and sppm at 4 to 32 samples, and
writes FOLDER/SCENE_VIEW.npz: for each number of samples what both methods write of it, of js-neural towards pw and
towards sppm in turn. A view that is there is left alone. The target is what braid makes by default of the samples named.
"""

import os
import sys

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from data import Renderer, half, make_views, read, rgb, run, worth_seeing
from shrinkage import METHODS

# Of each view one of each group.
SAMPLES = ((4, 8, 16), (16, 32))


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


class ShrinkageRenderer(Renderer):
    def view(self, scene, camera, seed, view):
        """Planes and target of each number of samples, or None where there is nothing to see."""
        target, _ = read(self.render(scene, camera, [], self.target, 7000 + seed, "target.exr"), "")
        truth = rgb(target, "")
        if not worth_seeing(truth):
            return None
        arrays, chosen = {}, []
        for group, candidates in enumerate(SAMPLES):
            samples = candidates[(seed + view) % len(candidates)]
            image = self.render(scene, camera, ["--integrator", "pt,sppm", "--combine", "none"], samples,
                                10 * seed + group, "image.exr")
            for method in METHODS:
                biased = "sppm" if method != "js-neural" or (seed + view + group) % 4 == 0 else "pw"
                planes, arrays[f"{method}-exposure{group}"] = planes_of(self.program, image, method, biased, self.folder)
                arrays[f"{method}{group}"] = half(planes)
            chosen.append(samples)
        return {"target": truth.astype(np.float32), "samples": np.array(chosen), **arrays}


if __name__ == "__main__":
    make_views(__doc__, "96x64", 96, 2, ShrinkageRenderer)
