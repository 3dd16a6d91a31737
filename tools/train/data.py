#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Training data: views of random scenes, as the network sees them at few samples, and what they should become.

    python3 tools/train/data.py FIRST END FOLDER [--braid PROGRAM] [--size WxH] [--target SAMPLES]

Renders three views of each scene from FIRST to before END (tools/train/scenes.py) and writes FOLDER/SCENE_VIEW.npz. A
view that is there is left alone, so that an interrupted run goes on, and several can share a folder. The target is the
mean of the samples named, by bdpt. Where lamps are behind glass pt is too dark, and so would be whatever learns from it.
Its noise is left in: of noisy targets a network learns their expectation (Lehtinen et al. 2018), and for the seconds of one
clean target come several scenes. What `auto` makes of them is kept beside it, to say what errors are relative to.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile

import numpy as np
import OpenImageIO as oiio

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

# Of each view one of each group, so that every scene is seen at few and at many samples.
SAMPLES = ((1, 2, 4, 4), (8, 16, 8, 32))
PLANES = 18  # kKpnPlanes


def run(*call):
    done = subprocess.run(call, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr.strip())


def read(path, attribute="braid/kpn/kpn-exposure"):
    """The channels of an EXR by name, and an attribute."""
    image = oiio.ImageInput.open(path)
    if image is None:
        raise SystemExit(f"{path}: {oiio.geterror()}")
    spec = image.spec()
    pixels = image.read_image(0, 0, 0, spec.nchannels, oiio.FLOAT)
    return {name: pixels[..., k] for k, name in enumerate(spec.channelnames)}, spec.getattribute(attribute)


def rgb(channels, layer):
    return np.stack([channels[(layer + "." if layer else "") + c] for c in "RGB"])


def half(values):
    return np.clip(np.nan_to_num(values), -6e4, 6e4).astype(np.float16)


def inputs(channels):
    """The planes of the network and log2 of the variance: what kpn reads (combiners/denoise/kpn/kpn_planes.h)."""
    planes = [channels[f"kpn.{k:02}.Y"] for k in range(PLANES)]
    planes.append(np.log2(channels["kpn.variance.Y"] + 2.0**-40))
    return half(np.stack(planes))


def worth_seeing(truth):
    return truth.mean() > 1e-4 and np.median(truth.std(axis=(1, 2))) >= 0.02 * truth.mean()


class Renderer:
    def __init__(self, options, folder):
        self.program, self.size, self.target, self.folder = options.braid, options.size, options.target, folder

    def render(self, scene, camera, more, samples, seed, name):
        out = os.path.join(self.folder, name)
        run(self.program, "render", scene["file"], "-o", out, "--spp", str(samples), "--seed", str(seed), "--size", self.size,
            "--look-at", camera["look_at"], "--yfov", str(camera["yfov"]), "--threads", "1", "-q", "--float", "--aovs", "all",
            *scene["options"], *more)
        return out

    def view(self, scene, camera, seed, view):
        """Planes of each number of samples, the target and what it is relative to; None where there is nothing to see."""
        target, _ = read(self.render(scene, camera, ["--integrator", "bdpt", "--combine", "auto"], self.target, 7000 + seed,
                                     "target.exr"))
        bright = rgb(target, "")
        if not worth_seeing(bright):
            return None
        arrays, chosen = {}, []
        planes = ["--integrator", "pt", "--combine", "kpn", "--kpn-planes", "1", "--weights"]
        for group, candidates in enumerate(SAMPLES):
            samples = candidates[(seed + view) % len(candidates)]
            channels, exposure = read(self.render(scene, camera, planes, samples, 10 * seed + group, "planes.exr"))
            arrays[f"x{group}"] = inputs(channels)
            arrays[f"exposure{group}"] = np.float32(exposure)
            chosen.append(samples)
        return {"target": rgb(target, "bdpt.mean").astype(np.float32), "bright": bright.astype(np.float32),
                "samples": np.array(chosen), **arrays}


def make_views(description, size, target, views, renderer_of):
    """The command line of a script of data: renders so many views of every scene named and writes what is kept."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int)
    parser.add_argument("end", type=int)
    parser.add_argument("folder")
    parser.add_argument("--braid", default="tools/braid")
    parser.add_argument("--size", default=size)
    parser.add_argument("--target", type=int, default=target)
    options = parser.parse_args()
    import scenes  # reads the repository's generator

    os.makedirs(options.folder, exist_ok=True)
    for seed in range(options.first, options.end):
        names = [os.path.join(options.folder, f"{seed:05}_{view}.npz") for view in range(views)]
        if all(os.path.exists(name) for name in names):
            continue
        with tempfile.TemporaryDirectory() as folder:
            scene = scenes.make(seed, folder)
            scene["file"] = os.path.join(folder, f"{seed}.glb")
            renderer = renderer_of(options, folder)
            for view, camera in enumerate(scene["cameras"][:views]):
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
                print(json.dumps({"scene": seed, "view": view, "kind": scene["kind"], "kept": arrays is not None}), flush=True)


if __name__ == "__main__":
    make_views(__doc__, "192x128", 16, 3, Renderer)
