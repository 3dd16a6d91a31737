# SPDX-License-Identifier: Apache-2.0
"""The package braid: what its text says holds.   PYTHONPATH=BUILD/python test_python.py

Nothing is statistical but the error of a denoiser against that of its input, by fixed seeds.
"""
import gc
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import numpy as np

import braid

ROOT = pathlib.Path(__file__).resolve().parents[2]
CORNELL = ROOT / "scenes" / "cornell.glb"
EXAMPLES = ROOT / "tools" / "python" / "examples"


def resident():
    """Bytes of this process in memory."""
    return int(pathlib.Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


class Rendering(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scene = braid.load(CORNELL, size=(32, 24))
        cls.render = cls.scene.render(spp=8, integrator="pt")

    def test_what_a_scene_holds(self):
        info = self.scene.info
        self.assertGreater(info["triangles"], 0)
        self.assertEqual(pathlib.Path(info["file"]).name, "cornell.glb")

    def test_the_plan_says_what_is_left_out(self):
        plan = self.scene.plan(spp=8, integrator="auto")
        self.assertIn("- sppm: ", str(plan))
        self.assertIn((True, "auto"), [(kept, what) for kept, what, _ in plan.lines()])
        self.assertGreater(plan.memory_bytes, 1 << 20)

    def test_planes_are_views_without_copies(self):
        render = self.render
        for name in ("R", "Albedo.G", "N.Z", "pt.mean.R", "pt.halfA.B", "pt.variance.G", "Error.Y"):
            plane = render.planes[name]
            self.assertEqual(plane.shape, (24, 32))
            self.assertEqual(plane.dtype, np.float32)
            self.assertEqual(plane.ctypes.data, render._made.address(name))
            with self.assertRaises(ValueError):
                plane[0, 0] = 1

    def test_planes_outlive_what_made_them(self):
        plane = self.scene.render(spp=1, combine="none").planes["R"]
        before = plane.copy()
        gc.collect()
        self.assertTrue(np.array_equal(plane, before))

    def test_the_image_is_that_of_its_planes(self):
        self.assertTrue(np.array_equal(self.render.image[..., 1], self.render.planes["G"]))
        self.assertEqual(self.render.method, "auto")
        self.assertGreater(self.render.error, 0)

    def test_the_command_line_makes_the_same_pixels(self):
        with tempfile.TemporaryDirectory() as folder:
            self.render.save(f"{folder}/python.exr", aovs="all")
            subprocess.run([os.environ["BRAID"], "render", CORNELL, "--size", "32x24", "--spp", "8", "--integrator", "pt",
                            "--aovs", "all", "--quiet", "-o", f"{folder}/braid.exr"], check=True)
            result = subprocess.run([os.environ["BRAID"], "compare", f"{folder}/python.exr", f"{folder}/braid.exr",
                                     "--metric", "relL2"], capture_output=True, text=True)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn(" 0", result.stdout)

    def test_resumed_is_as_if_never_ended(self):
        resumed = self.scene.render(spp=3, integrator="pt", combine="none").resume(spp=8)
        self.assertEqual(resumed.spp, 8)
        self.assertTrue(np.array_equal(resumed.planes["pt.mean.R"], self.render.planes["pt.mean.R"]))
        with self.assertRaises(braid.BraidError):
            resumed.resume(spp=2)

    def test_a_callback_ends_a_render(self):
        seen = []
        render = self.scene.render(spp=8, combine="none", callback=lambda p: seen.append(p["spp"]) or p["spp"] < 3)
        self.assertEqual((seen, render.spp, render.reason), ([1, 2, 3], 3, "cancelled"))

    def test_an_exception_ends_a_render_and_is_raised(self):
        class Enough(Exception):
            pass

        def stop(progress):
            raise Enough(progress["spp"])

        with self.assertRaises(Enough):
            self.scene.render(spp=8, callback=stop)
        self.assertEqual(self.scene.render(spp=1, combine="none").spp, 1)

    def test_an_interrupt_ends_a_render(self):
        threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        begin = time.monotonic()
        with self.assertRaises(KeyboardInterrupt):
            self.scene.render(time=60, combine="none")
        self.assertLess(time.monotonic() - begin, 30)

    def test_other_threads_run_meanwhile(self):
        counted, stop = [0], threading.Event()

        def count():
            while not stop.is_set():
                counted[0] += 1
                time.sleep(0.001)

        thread = threading.Thread(target=count)
        thread.start()
        before = counted[0]
        self.scene.render(time=0.5, combine="none", threads=1)
        during = counted[0] - before
        stop.set()
        thread.join()
        self.assertGreater(during, 20)

    def test_a_thousand_renders_take_no_more_memory(self):
        scene = braid.load(CORNELL, size="8x8")
        for _ in range(100):
            scene.render(spp=1, combine="none").planes["R"]
        before = resident()
        for _ in range(1000):
            scene.render(spp=1, combine="none").planes["R"]
        self.assertLess(resident() - before, 8 << 20)

    def test_what_is_refused_says_why(self):
        for options, code, part in [({"spp": 0}, 1, "--spp"), ({"integrator": "nonsense"}, 1, "nonsense"),
                                    ({"nonsense": 3}, 1, "--nonsense")]:
            with self.assertRaises(braid.BraidError) as caught:
                self.scene.render(**options)
            self.assertEqual(caught.exception.code, code)
            self.assertIn(part, str(caught.exception))
        with self.assertRaises(braid.BraidError) as caught:
            braid.load("no such file.glb")
        self.assertEqual(caught.exception.code, 2)
        self.assertIn("no such file.glb", str(caught.exception))

    def test_a_notebook_gets_a_png(self):
        self.assertEqual(self.render._repr_png_()[:4], b"\x89PNG")


class Combining(unittest.TestCase):
    def setUp(self):
        y, x = np.mgrid[0:1:48j, 0:1:64j]
        self.truth = np.stack([x, y, 0.5 + 0 * x], axis=-1) + 0.1
        random = np.random.default_rng(7)
        self.halves = [self.truth * random.gamma(2, 0.5, self.truth.shape) for _ in range(2)]
        self.image = (self.halves[0] + self.halves[1]) / 2

    def error(self, image):
        return braid.compare(image, self.truth, ["relL2"])["relL2"]

    def test_arrays_of_any_origin(self):
        noisy = self.error(self.image)
        for method in ("auto", "pw", "nlm", "js@nlm"):
            combined = braid.combine(self.image, halves=self.halves, passes=8, method=method)
            self.assertEqual(combined.method, method)
            self.assertLess(self.error(combined.image), 0.8 * noisy, method)
        self.assertLess(self.error(braid.combine(self.image.astype(np.float64)).image), noisy)
        self.assertLess(self.error(braid.combine(halves=self.halves, method="js@nlm", js_constant=1.25).image), noisy)

    def test_a_function_is_a_denoiser(self):
        calls = []

        def truth(image, features):
            calls.append(image.shape)
            return self.truth

        combined = braid.combine(self.image, halves=self.halves, passes=8, denoisers={"truth": truth})
        self.assertEqual(calls, [(48, 64, 3)] * 3)
        alone = braid.combine(self.image, halves=self.halves, passes=8)
        self.assertLess(self.error(combined.image), 0.7 * self.error(alone.image))

        def fails(image, features):
            raise ZeroDivisionError

        with self.assertRaises(ZeroDivisionError):
            braid.combine(self.image, halves=self.halves, denoisers={"fails": fails})

    def test_wrong_arrays_are_refused(self):
        for wrong in (np.zeros((4, 4, 2)), np.zeros(5), np.zeros((0, 3, 3)), "text", np.zeros((2, 2, 3, 1))):
            with self.assertRaises(braid.BraidError):
                braid.combine(wrong)
        with self.assertRaises(braid.BraidError):
            braid.combine(self.image, halves=(self.image[:4], self.image[:4]))
        with self.assertRaises(braid.BraidError):
            braid.combine(self.image, features={"albedo": np.zeros((3, 3, 3))})
        with self.assertRaises(braid.BraidError):
            braid.compare(self.image, self.truth[:9])

    def test_values_that_are_none_stay_out(self):
        self.image[3, 4] = np.nan
        self.image[9, 9] = np.inf
        self.assertTrue(np.isfinite(braid.combine(self.image, method="pw").image).all())

    def test_a_sweep_is_a_table(self):
        scene = braid.load(CORNELL, size="24x16")
        rows = braid.sweep(scene, ["none", ("black", lambda image, features: 0 * image), "pw"], spp=(2, 4), reference=64,
                           integrator="pt")
        self.assertEqual([(r["method"], r["spp"]) for r in rows],
                         [(m, n) for n in (2, 4) for m in ("none", "black", "pw")])
        for row in rows:
            self.assertGreater(row["error"], 0)
            self.assertGreater(row["seconds"], 0)
        by = {(r["method"], r["spp"]): r["error"] for r in rows}
        self.assertLess(by["pw", 4], by["none", 4])
        self.assertGreater(by["black", 4], 0.1)

    def test_a_function_is_in_a_sweep_of_the_command_line_and_its_report(self):
        with tempfile.TemporaryDirectory() as folder:
            mine = (f"external-command:{sys.executable} -m braid.external {EXAMPLES}/my_denoiser.py:cross_bilateral "
                    "{color.pfm} {albedo.pfm} {normal.pfm} {out.pfm}")
            subprocess.run([os.environ["BRAID"], "sweep", CORNELL, "-o", folder, "--size", "32x24", "--spp", "4",
                            "--methods", f"pt,nfor,auto,{mine}", "--reference-spp", "64"], check=True, capture_output=True)
            rows = (pathlib.Path(folder) / "sweep.csv").read_text().splitlines()
            self.assertEqual(len(rows), 5)
            self.assertEqual(sum("cross_bilateral" in row for row in rows), 1)
            for report in ("summary.md", "report.html"):
                self.assertIn("cross_bilateral", (pathlib.Path(folder) / report).read_text())

    def test_metrics_have_names(self):
        values = braid.compare(self.image, self.truth)
        self.assertEqual(set(values), set(braid.metrics))
        self.assertTrue(all(np.isfinite(v) for v in values.values()))


class Examples(unittest.TestCase):
    def run_example(self, name, *words):
        result = subprocess.run([sys.executable, EXAMPLES / f"{name}.py", *map(str, words)], capture_output=True, text=True,
                                env=os.environ)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result.stdout

    def test_all(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            self.assertIn("estimated error", self.run_example("render_and_look", CORNELL, folder / "look.png"))
            self.assertIn("cross-bilateral", self.run_example("my_denoiser", CORNELL))
            self.run_example("error_over_time", CORNELL, folder / "error.png")
            self.run_example("animation", CORNELL, 2, folder)
            self.assertIn("Albedo.R", self.run_example("aovs", CORNELL, folder / "planes.npz"))
            self.assertIn("auto", self.run_example("combine_others", *self.arrays(folder), folder / "combined.png"))
            for name in ("look.png", "error.png", "frame_0001.png", "combined.png"):
                self.assertEqual((folder / name).read_bytes()[:4], b"\x89PNG")
            self.assertIn("R", np.load(folder / "planes.npz"))
        self.assertEqual(len(list(EXAMPLES.glob("*.py"))), 6)

    def arrays(self, folder):
        for seed in (1, 2):
            np.save(folder / f"{seed}.npy", np.random.default_rng(seed).gamma(2, 0.5, (32, 32, 3)))
        return folder / "1.npy", folder / "2.npy"


if __name__ == "__main__":
    unittest.main()
