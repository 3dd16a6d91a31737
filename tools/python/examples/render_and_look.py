# SPDX-License-Identifier: Apache-2.0
"""Renders a scene and shows how good the picture is.   render_and_look.py [SCENE [OUT.png]]"""
import sys

import braid

scene = braid.load(sys.argv[1] if len(sys.argv) > 1 else "scenes/cornell.glb", size="160x90")
print(scene.plan(spp=16))
render = scene.render(spp=16, callback=lambda p: print(f"\r{p['spp']} of {p['of']}", end=""))
print(f"\n{render.method} of {render.spp} samples in {render.seconds:.2f} s + {render.combine_seconds:.2f} s,"
      f" estimated error {render.error:.3g}")
render.save(sys.argv[2] if len(sys.argv) > 2 else "look.png")
