# SPDX-License-Identifier: Apache-2.0
"""A denoiser of ten lines against nfor and auto.   my_denoiser.py [SCENE]

In a sweep of the command line, with its row in the report:
    braid sweep SCENE -o DIR --methods "pt,nfor,auto,external-command:python3 -m braid.external
        my_denoiser.py:cross_bilateral {color.pfm} {albedo.pfm} {normal.pfm} {out.pfm}"
"""
import sys

import numpy as np

import braid


def cross_bilateral(color, features):
    """Means over 5x5 pixels of like albedo and normal."""
    guides = np.concatenate([features["albedo"] / 0.1, features["normal"] / 0.3], axis=-1)
    total, weights = np.zeros_like(color), np.zeros(color.shape[:2] + (1,))
    for dy in range(-2, 3):
        for dx in range(-2, 3):
            there = np.roll(guides, (dy, dx), (0, 1))
            w = np.exp(-np.sum((guides - there) ** 2, axis=-1, keepdims=True))
            total += w * np.roll(color, (dy, dx), (0, 1))
            weights += w
    return total / weights


def main():
    scene = braid.load(sys.argv[1] if len(sys.argv) > 1 else "scenes/cornell.glb", size="96x54")
    methods = ["none", ("cross-bilateral", cross_bilateral), "nfor", "auto"]
    print(f"{'method':16} {'spp':>4} {'relL2':>9} {'seconds':>8}")
    for row in braid.sweep(scene, methods, spp=(4, 16), reference=256, integrator="pt"):
        print(f"{row['method']:16} {row['spp']:4} {row['error']:9.5f} {row['seconds']:8.3f}")

    # As one of the images that auto chooses from.
    render = scene.render(spp=16, integrator="pt", combine="none")
    print("auto with it:", render.combine("auto", denoisers={"mine": cross_bilateral}).error)


if __name__ == "__main__":
    main()
