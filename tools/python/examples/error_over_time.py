# SPDX-License-Identifier: Apache-2.0
"""Error against time, plotted by gnuplot.   error_over_time.py [SCENE [OUT.png]]"""
import subprocess
import sys

import braid

scene = braid.load(sys.argv[1] if len(sys.argv) > 1 else "scenes/cornell.glb", size="96x54")
out = sys.argv[2] if len(sys.argv) > 2 else "error.png"
methods = ["none", "pw", "auto"]
rows = braid.sweep(scene, methods, spp=(1, 4, 16), reference=256, integrator="pt")
data = "".join("".join(f"{r['seconds']} {r['error']}\n" for r in rows if r["method"] == m) + "e\n" for m in methods)
curves = ", ".join(f"'-' with linespoints title '{m}'" for m in methods)
script = (f"set terminal pngcairo size 640,480\nset output '{out}'\nset logscale\nset xlabel 'seconds'\n"
          f"set ylabel 'relL2'\nplot {curves}\n{data}")
subprocess.run(["gnuplot"], input=script, text=True, check=True)
print(out)
