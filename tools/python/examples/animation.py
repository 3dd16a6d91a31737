# SPDX-License-Identifier: Apache-2.0
"""Frames of an animated file.   animation.py SCENE [FRAMES [FOLDER]]"""
import pathlib
import sys

import braid

path = sys.argv[1]
count = int(sys.argv[2]) if len(sys.argv) > 2 else 3
folder = pathlib.Path(sys.argv[3] if len(sys.argv) > 3 else ".")
clips = braid.load(path, size="64x36").info["animations"]
seconds = clips[0]["seconds"] if clips else 0
for frame in range(count):
    scene = braid.load(path, size="64x36", frame_time=seconds * frame / count) if clips else braid.load(path, size="64x36")
    scene.render(spp=4).save(folder / f"frame_{frame:04}.png")
    print(folder / f"frame_{frame:04}.png")
