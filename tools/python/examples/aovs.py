# SPDX-License-Identifier: Apache-2.0
"""Every plane of a render as numpy arrays.   aovs.py [SCENE [OUT.npz]]"""
import sys

import numpy as np

import braid

render = braid.load(sys.argv[1] if len(sys.argv) > 1 else "scenes/cornell.glb", size="96x54").render(spp=8)
for name, plane in sorted(render.planes.items()):
    print(f"{name:24} {plane.shape[1]}x{plane.shape[0]}  mean {np.mean(plane):.4g}")
noisiest = np.unravel_index(np.argmax(render.planes["pt.variance.G"]), render.planes["pt.variance.G"].shape)
print("noisiest pixel, row and column:", *map(int, noisiest))
np.savez(sys.argv[2] if len(sys.argv) > 2 else "planes.npz", **render.planes)
