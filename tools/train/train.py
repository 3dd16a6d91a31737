#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Trains the network of kpn on the views of tools/train/data.py.

    python3 tools/train/train.py DATA... -o WEIGHTS.pt [--seconds S] [--resume WEIGHTS.pt] [--threads N]

New views in the folders are found while it runs. Weights are saved every few minutes, averaged over the last steps.
"""

import glob
import math
import os
import sys

import numpy as np
import torch
import torch.nn.functional as functional

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import training
from network import KernelPrediction, LUMINANCE, luminance
from training import flipped

DARK = 0.003  # squared brightness below which errors stop being relative
NOISE_SHARE = 0.1  # of a target's noise that counts where crops are weighed: noisy targets teach less
ALBEDO, NORMAL, MISS = slice(7, 10), slice(10, 13), 15


def unpacked(planes, exposure=1.0):
    """Planes, irradiance, variance and divisor from stored planes, in another exposure."""
    x = planes[:, :18].clone()
    irradiance = torch.expm1(2 * x[:, :3]) / 4 * exposure
    x[:, :5] = 0.5 * torch.log1p(torch.expm1(2 * x[:, :5]) * exposure)
    variance = (torch.exp2(planes[:, 18:19]) - 2.0**-40).clamp(min=0) * exposure**2
    divisor = torch.where(x[:, MISS : MISS + 1] > 0.5, torch.ones_like(x[:, :1]), x[:, ALBEDO].clamp(min=0.03))
    return x, irradiance, variance, divisor


def relative_error(result, target, bright, pixels=None):
    """Of every crop the mean squared error relative to a brightness, of pixels and of blocks, where blotches show.

    `pixels`: the target of single pixels, where it is another one.
    """
    total = torch.zeros(result.shape[0])
    for side, weight in ((1, 1.0), (4, 2.0), (16, 4.0)):
        mean = lambda t: functional.avg_pool2d(t, side) if side > 1 else t
        of = pixels if side == 1 and pixels is not None else target
        relative = mean(result - of) / torch.sqrt(mean(bright * bright) + DARK)
        huber = functional.huber_loss(relative, torch.zeros_like(relative), reduction="none", delta=10.0)
        total = total + weight * 2 * huber.mean((1, 2, 3))
    return total


def loss_of(result, target):
    """The logarithm of the error of crops whose target has next to no noise."""
    return torch.log(relative_error(result, target, luminance(target).clamp(min=0)) + 1e-4).mean()


def loss_towards(result, noisy, smooth):
    """The error towards a noisy target; `smooth` is what `auto` makes of it.

    Single pixels are drawn half way to it: a quarter of the noise, and a bias that the blocks do not share.
    A crop counts by the inverse of what is wrong of it, as by a logarithm. That of the error itself would take the
    target's noise for a part of it, and all but leave out the crops that are hard to render.
    """
    bright = luminance(smooth).clamp(min=0)
    with torch.no_grad():
        wrong = relative_error(result, smooth, bright) + NOISE_SHARE * relative_error(noisy, smooth, bright) + 1e-3
    return (relative_error(result, noisy, bright, 0.5 * (noisy + smooth)) / wrong).mean()


def inputs_of(stored):
    both = np.concatenate([stored["target"], stored["bright"]])
    for k, samples in enumerate(stored["samples"]):
        if samples <= 64:
            yield int(samples), stored[f"x{k}"], (both * stored[f"exposure{k}"]).astype(np.float32)


def rotation(rng):
    matrix, _ = np.linalg.qr(np.array([[rng.gauss(0, 1) for _ in range(3)] for _ in range(3)]))
    return torch.tensor(matrix, dtype=torch.float32)


def augmented(planes, target, rng):
    planes, target = flipped(planes, target, rng)
    planes = planes.clone()
    planes[:, NORMAL] = torch.einsum("ij,bjhw->bihw", rotation(rng), planes[:, NORMAL])
    return planes, target


def validated(model, views, limit=256):
    """Geometric mean over the views of the relative squared error to what `auto` makes of the target, by samples."""
    errors = {}
    with torch.no_grad():
        for name, stored in views:
            for k, samples in enumerate(stored["samples"]):
                planes = torch.from_numpy(stored[f"x{k}"][None].astype(np.float32))
                height, width = (n // 32 * 32 for n in planes.shape[-2:])
                planes = planes[..., :height, :width]
                target = torch.from_numpy(stored["bright"][None] * stored[f"exposure{k}"])[..., :height, :width]
                x, irradiance, variance, divisor = unpacked(planes)
                result = model(x, irradiance, variance) * divisor
                relative = ((result - target) ** 2).mean(1) / (luminance(target)[:, 0] ** 2 + 0.0025)
                errors.setdefault(int(samples), []).append(math.log(relative.mean().item() + 1e-9))
    return {s: round(math.exp(sum(e) / len(e)), 5) for s, e in sorted(errors.items())}


def main():
    options = training.arguments(__doc__, seconds=3600, rate=2e-3, side=96).parse_args()
    training.begin(options)
    model, views = KernelPrediction(), training.Views(options.data, inputs_of)
    checks = [(n, np.load(n)) for n in sorted(glob.glob(os.path.join(options.validation, "*.npz")))] if options.validation else []

    def loss_of_crops(rng):
        planes, target = augmented(*views.crops(options.crops, options.side, rng, multiple=2), rng)
        exposure = 2 ** rng.uniform(-1, 1)
        x, irradiance, variance, divisor = unpacked(planes, exposure)
        return loss_towards(model(x, irradiance, variance) * divisor, *(target * exposure).split(3, 1))

    training.train(model, options, views, loss_of_crops, lambda mean: validated(mean, checks) if checks else None, {})


if __name__ == "__main__":
    main()
