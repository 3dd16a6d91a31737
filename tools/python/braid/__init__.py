# SPDX-License-Identifier: Apache-2.0
"""braid for Python: load a glTF scene, render it, combine, compare.

    import braid
    scene = braid.load("scene.glb", size="640x360")
    render = scene.render(spp=16)
    render.planes["pt.variance.R"]      # numpy, no copy
    render.save("out.png")

Options have the names of the command line with underscores: `max_depth=8` is
`--max-depth 8`, `ground=True` is `--ground`; (640, 360) and "640x360" are the
same size. What is refused raises BraidError with one sentence; its `code` is
the exit code that the command line would end with. Lengths are metres, times
seconds, colours linear radiance in Rec. 709, images float32 of shape
(height, width, 3), planes float32 of shape (height, width).
"""
from __future__ import annotations

import json
import os
import tempfile
import warnings
from typing import Any, Callable, Iterable, Mapping, Optional, Sequence, Union

import numpy as np

from . import _braid
from ._braid import BraidError

__version__: str = _braid.version
integrators: list[str] = _braid.integrators()
methods: list[str] = _braid.methods()
metrics: list[str] = _braid.metrics()

Progress = Callable[[dict], Optional[bool]]
Denoiser = Callable[[np.ndarray, dict], np.ndarray]

__all__ = ["BraidError", "Combined", "Plan", "Render", "Scene", "combine", "compare", "integrators", "load", "methods",
           "metrics", "sweep"]


def _text(name: str, value: Any) -> str:
    if isinstance(value, (tuple, list)):
        return ("x" if name == "size" else ",").join(str(v) for v in value)
    return str(value)


def _words(options: Mapping[str, Any]) -> list[str]:
    words = []
    for name, value in options.items():
        option = "--" + name.replace("_", "-")
        if value is True:
            words.append(option)
        elif value is not None and value is not False:
            words.append(f"{option}={_text(name, value)}")
    return words


class Combined:
    """An image and all that is known of it. It never changes."""

    def __init__(self, made: "_braid.Made", stacklevel: int = 3):
        self._made = made
        self._planes: Optional[dict[str, np.ndarray]] = None
        for line in made.warnings:
            warnings.warn(line, stacklevel=stacklevel)

    @property
    def planes(self) -> dict[str, np.ndarray]:
        """Every plane by its channel name in EXR files ("R", "Albedo.G", "pt.variance.B", "Error.Y"): read-only views
        of braid's own memory, (height, width), valid as long as anything holds them."""
        if self._planes is None:
            self._planes = self._made.planes
        return self._planes

    @property
    def image(self) -> np.ndarray:
        """The image, (height, width, 3): a copy."""
        return self._made.image

    @property
    def features(self) -> dict[str, np.ndarray]:
        """Copies: "albedo" and "normal", (height, width, 3), and "depth" in metres; those that there are."""
        found = {}
        for name, channels in {"albedo": ["Albedo.R", "Albedo.G", "Albedo.B"], "normal": ["N.X", "N.Y", "N.Z"]}.items():
            if all(c in self.planes for c in channels):
                found[name] = np.stack([self.planes[c] for c in channels], axis=-1)
        if "Depth.Z" in self.planes:
            found["depth"] = self.planes["Depth.Z"].copy()
        return found

    @property
    def method(self) -> str:
        """The method that made the image; empty: an integrator did."""
        return self._made.method

    @property
    def error(self) -> Optional[float]:
        """The estimated relative squared error of the image; None: it is not known."""
        return self._made.error

    @property
    def combine_seconds(self) -> float:
        """Of denoisers and combiners."""
        return self._made.combine_seconds

    def save(self, path: Union[str, os.PathLike], aovs: str = "features") -> None:
        """Writes .exr (with `aovs` "features" or "all"), .png, .jpg, .hdr or .tif."""
        warning = self._made.save(os.fspath(path), aovs == "all")
        if warning:
            warnings.warn(warning, stacklevel=2)

    def _repr_png_(self) -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "image.png")
            self.save(path)
            with open(path, "rb") as file:
                return file.read()


class Plan:
    """What a render will do. `str(plan)` says what is left out, and why."""

    def __init__(self, run: "_braid.Run"):
        self._run = run

    def __str__(self) -> str:
        return self._run.plan

    @property
    def memory_bytes(self) -> int:
        """What the render takes at most."""
        return self._run.memory_bytes

    def lines(self) -> list[tuple[bool, str, str]]:
        """(kept, what, why) of every line."""
        parts = []
        for line in str(self).splitlines():
            if line[:2] in ("+ ", "- "):
                subject, _, reason = line[2:].partition(": ")
                parts.append((line[0] == "+", subject, reason))
        return parts


class Render(Combined):
    """A render, finished or ended early. `resume` goes on; earlier planes keep their values."""

    def __init__(self, run: "_braid.Run"):
        self._run = run
        super().__init__(run.made(), 4)

    spp = property(lambda self: self._run.spp, doc="Samples per pixel of the first integrator.")
    seconds = property(lambda self: self._run.seconds, doc="Of the passes of the last run.")
    reason = property(lambda self: self._run.reason, doc='What ended it: "samples", "time", "cancelled".')
    plan = property(lambda self: Plan(self._run), doc="What it did.")

    def resume(self, spp: int = 0, seconds: float = 0, callback: Optional[Progress] = None) -> "Render":
        """Goes on to `spp` samples in all, or for `seconds`. The pixels are those of one long run."""
        self._run.resume(spp, seconds, callback)
        super().__init__(self._run.made())
        return self

    def combine(self, method: str = "auto", denoisers: Optional[Mapping[str, Denoiser]] = None, **options: Any) -> Combined:
        """The same samples by another method; `denoisers` as in combine()."""
        name = next(p[:-len(".mean.R")] for p in self.planes if p.endswith(".mean.R"))
        stack = lambda layer: _stack(self.planes, f"{name}.{layer}")
        halves = (stack("halfA"), stack("halfB"))
        return combine(stack("mean"), halves=None if halves[0] is None else halves, variance=stack("variance"),
                       features=self.features, passes=self.spp, method=method, denoisers=denoisers, **options)


class Scene:
    """A scene, ready for rays. It may be rendered any number of times, also by several threads at once."""

    def __init__(self, path: Union[str, os.PathLike], **options: Any):
        self._scene = _braid.Scene(os.fspath(path), _words(options))
        for line in self.info["warnings"]:
            warnings.warn(line, stacklevel=3)

    @property
    def info(self) -> dict:
        """What `braid info --json` prints."""
        return json.loads(self._scene.record)

    def plan(self, **options: Any) -> Plan:
        """What render() would do with these options."""
        return Plan(_braid.Run(self._scene, _words(options)))

    def render(self, callback: Optional[Progress] = None, **options: Any) -> Render:
        """Renders: integrator="auto", spp=64, seed=0, time="60s", combine="auto" ("none": not), max_depth=32, …

        `callback(progress)` is called after each round of passes with {"spp", "of", "seconds", "seconds_left"}; False
        ends the render, an exception ends it and is raised. What is done is kept. Other Python threads run meanwhile,
        and an interrupt ends the passes.
        """
        run = _braid.Run(self._scene, _words(options))
        run.advance(callback)
        return Render(run)


def load(path: Union[str, os.PathLike], **options: Any) -> Scene:
    """Reads a glTF file (.gltf, .glb): size="1280x720", camera, env, frame_time, ground, … as `braid info` takes."""
    return Scene(path, **options)


def _stack(planes: Mapping[str, np.ndarray], layer: str) -> Optional[np.ndarray]:
    names = [f"{layer}.{c}" for c in "RGB"]
    return np.stack([planes[n] for n in names], axis=-1) if all(n in planes for n in names) else None


def _denoised(name: str, denoiser: Denoiser, unbiased: dict, features: dict) -> dict:
    mean = unbiased["mean"]
    halves = unbiased.get("halves")
    if mean is None:
        mean = 0.5 * (np.asarray(halves[0]) + np.asarray(halves[1]))
    result = {"name": name, "unbiased": False, "mean": np.asarray(denoiser(np.asarray(mean), features))}
    if halves is not None:
        result["halves"] = tuple(np.asarray(denoiser(np.asarray(h), features)) for h in halves)
    return result


def combine(unbiased: Optional[np.ndarray] = None, *, halves: Optional[Sequence[np.ndarray]] = None,
            variance: Optional[np.ndarray] = None, biased: Optional[Mapping[str, Any]] = None,
            features: Optional[Mapping[str, np.ndarray]] = None, passes: int = 0, method: str = "auto",
            denoisers: Optional[Mapping[str, Denoiser]] = None, threads: int = 0, **options: Any) -> Combined:
    """Denoises or combines arrays of any origin (copied once).

    `unbiased`: the noisy image, (height, width, 3). `halves`: two images of half the samples each, whose mean it is;
    without them they and the variance are estimated from the pixels around. `variance`: of the mean. `biased`: by name,
    images or (image, half A, half B) of others, such as photon maps or denoised ones, which `auto` and ensembles take
    as bases. `features`: "albedo", "normal", "depth". `passes`: samples per pixel, 0: not known. `denoisers`: by name,
    functions (image, features) -> image, which are run on the image and on both halves. `method` as `--combine`.
    Further keywords are options of methods: js_constant=1.25. Raises BraidError where the method cannot run.
    """
    first = {"name": "image", "mean": unbiased, "halves": halves, "variance": variance, "passes": passes}
    features = dict(features or {})
    given = [first]
    for name, images in (biased or {}).items():
        if isinstance(images, (tuple, list)):
            given.append({"name": name, "unbiased": False, "mean": images[0], "halves": tuple(images[1:3])})
        else:
            given.append({"name": name, "unbiased": False, "mean": images, "halves": (images, images)})
    given += [_denoised(name, f, first, features) for name, f in (denoisers or {}).items()]
    words = [f"--combine={method}"] + _words(options)
    return Combined(_braid.combine(given, features, words, threads))


def compare(image: np.ndarray, reference: np.ndarray, names: Iterable[str] = ()) -> dict[str, float]:
    """The errors of an image by metrics (all, or those named): relL2, ssim, hdr-flip, …"""
    return _braid.compare(np.asarray(image), np.asarray(reference), list(names))


def sweep(scene: Scene, methods: Iterable[Union[str, tuple[str, Denoiser]]], spp: Iterable[int] = (4, 16, 64),
          reference: Union[int, np.ndarray] = 1024, metric: str = "relL2", **options: Any) -> list[dict]:
    """Error against samples and time: a row {"method", "spp", "error", "seconds"} for each method and number of samples.

    A method is a name as in `--combine`, "none", or (name, function) for a denoiser of your own. `reference`: samples
    of another seed, or an image. Seconds are those of rendering and combining.
    """
    from time import perf_counter
    if not isinstance(reference, np.ndarray):
        reference = scene.render(spp=reference, seed=2**31 - 1, combine="none", **options).image
    rows = []
    for count in spp:
        render = scene.render(spp=count, combine="none", **options)
        for method in methods:
            begin = perf_counter()
            name = method if isinstance(method, str) else method[0]
            if not isinstance(method, str):
                image = np.asarray(method[1](render.image, render.features))
            else:
                image = render.image if method == "none" else render.combine(method).image
            seconds = render.seconds + perf_counter() - begin
            rows.append({"method": name, "spp": count, "error": compare(image, reference, [metric])[metric],
                         "seconds": seconds})
    return rows
