# SPDX-License-Identifier: Apache-2.0
"""A function of a Python file as an outside denoiser of the command line.

    braid sweep SCENE -o DIR --methods "pt,nfor,auto,external-command:python3 -m braid.external
        my_denoiser.py:cross_bilateral {color.pfm} {albedo.pfm} {normal.pfm} {out.pfm}"

The function gets the image, an array of shape (height, width, 3), and a dict with "albedo" and "normal", and returns
the denoised image, as the denoisers of `braid.combine()` do. Only numpy is needed.
"""
import importlib.util
import pathlib
import sys

import numpy as np


def read_pfm(path: str) -> np.ndarray:
    """A portable float map of three channels as an array (height, width, 3), the uppermost row first."""
    with open(path, "rb") as file:
        if file.readline().strip() != b"PF":
            raise ValueError(f"{path}: is no PFM of three channels")
        width, height = map(int, file.readline().split())
        order = "<" if float(file.readline()) < 0 else ">"
        return np.frombuffer(file.read(), order + "f4").reshape(height, width, 3)[::-1].astype(np.float32)


def write_pfm(path: str, image: np.ndarray) -> None:
    """Writes an array (height, width, 3) as a portable float map."""
    with open(path, "wb") as file:
        file.write(b"PF\n%d %d\n-1.0\n" % (image.shape[1], image.shape[0]))
        file.write(np.ascontiguousarray(image[::-1], "<f4").tobytes())


def main(function: str, color: str, albedo: str, normal: str, out: str) -> None:
    path, name = function.rsplit(":", 1)
    if not path.endswith(".py"):
        raise ValueError(f"{path}: is no Python file; name one that ends in .py")
    sys.path.insert(0, str(pathlib.Path(path).resolve().parent))
    spec = importlib.util.spec_from_file_location("denoiser", path)
    sys.modules["denoiser"] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    image = read_pfm(color)
    result = np.asarray(getattr(module, name)(image, {"albedo": read_pfm(albedo), "normal": read_pfm(normal)}))
    if result.shape != image.shape:
        raise ValueError(f"{function} returned an array of shape {result.shape}; it is to have the image's, {image.shape}")
    write_pfm(out, result)


if __name__ == "__main__":
    if len(sys.argv) != 6:
        sys.exit("usage: python3 -m braid.external FILE.py:FUNCTION COLOR.pfm ALBEDO.pfm NORMAL.pfm OUT.pfm")
    main(*sys.argv[1:])
