# SPDX-License-Identifier: Apache-2.0
"""Combines two renders of another program, of the same view and other seeds.   combine_others.py [A.npy B.npy [OUT.png]]

Arrays of shape (height, width, 3), linear. Without files a lit ball with noise stands for that program.
"""
import sys

import numpy as np

import braid


def ball(seed):
    y, x = np.mgrid[-1:1:90j, -1.6:1.6:144j]
    inside = x * x + y * y < 0.64
    normal = np.stack([x, -y, np.sqrt(np.maximum(0.64 - x * x - y * y, 0))], axis=-1) / 0.8 * inside[..., None]
    light = np.where(inside, np.maximum(normal @ [0.5, 0.6, 0.62], 0.02), 0.2)[..., None] * [0.9, 0.7, 0.5]
    noise = np.random.default_rng(seed).gamma(0.5, 2, light.shape[:2] + (1,))
    return light * noise, {"normal": normal, "albedo": np.where(inside[..., None], [0.9, 0.7, 0.5], 0)}


if len(sys.argv) > 2:
    halves, features = [np.load(sys.argv[1]), np.load(sys.argv[2])], {}
else:
    (a, features), (b, _) = ball(1), ball(2)
    halves = [a, b]
combined = braid.combine(halves=halves, features=features, passes=8, method="auto")
print(combined.method, "estimated error", combined.error)
combined.save(sys.argv[3] if len(sys.argv) > 3 else "combined.png")
