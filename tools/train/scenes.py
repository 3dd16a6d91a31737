#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes random scenes to train denoisers on, with cameras and the options to render them with.

    scenes.py FIRST END FOLDER      writes FOLDER/K.glb and K.json, and K_env.hdr where there is one, for K in FIRST:END

K.json holds "kind" (room, outdoor, studio or abstract), "options" (of braid render) and "cameras", a list of "look_at"
and "yfov", for --look-at and --yfov. Needs numpy. One seed always gives the same bytes.
"""

import json
import pathlib
import sys

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
for folder in (HERE, HERE.parents[1] / "scenes"):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

from scenery import abstract, outdoors, rooms, skies, studios  # noqa: E402  (found by the paths above)
from scenery.stage import Stage  # noqa: E402

KINDS = (("room", rooms.build, 0.54), ("outdoor", outdoors.build, 0.22), ("studio", studios.build, 0.15),
         ("abstract", abstract.build, 0.09))
CAMERAS, ATTEMPTS = 3, 20


def make(seed, folder):
    """Writes the scene of a seed and returns what its .json holds."""
    folder = pathlib.Path(folder)
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([seed, attempt])
        kind, build, _ = KINDS[rng.choice(len(KINDS), p=[share for _, _, share in KINDS])]
        stage = Stage(rng, kind)
        cameras = stage.cameras(build(stage), CAMERAS)
        # A scene so full that no view is free makes room for another of the same seed.
        if len(cameras) == CAMERAS:
            return _write(stage, seed, folder, cameras)
    raise RuntimeError(f"scene {seed}: no free views in {ATTEMPTS} attempts; leave this seed out")


def _write(stage, seed, folder, cameras):
    options = stage.options
    if stage.environment is not None:
        path = folder / f"{seed}_env.hdr"
        skies.write_hdr(path, stage.environment)
        options = ["--env", str(path), *options]
    ex, ey, ez, tx, ty, tz = map(float, cameras[0]["look_at"].split(","))
    stage.scene.camera((ex, ey, ez), (tx, ty, tz), cameras[0]["yfov"])
    (folder / f"{seed}.glb").write_bytes(stage.scene.to_bytes())
    about = {"kind": stage.kind, "options": options, "cameras": cameras}
    (folder / f"{seed}.json").write_text(json.dumps(about, indent=1) + "\n")
    return about


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    first, end, folder = int(sys.argv[1]), int(sys.argv[2]), pathlib.Path(sys.argv[3])
    folder.mkdir(parents=True, exist_ok=True)
    for seed in range(first, end):
        make(seed, folder)


if __name__ == "__main__":
    main()
