#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Trains the network of kpn on the views of tools/train/data.py.

    python3 tools/train/train.py DATA... -o WEIGHTS.pt [--seconds S] [--resume WEIGHTS.pt] [--threads N]

New views in the folders are found while it runs. Weights are saved every few minutes, averaged over the last steps.
"""

import argparse
import copy
import glob
import json
import math
import os
import random
import sys
import time

import numpy as np
import torch
import torch.nn.functional as functional

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from network import KernelPrediction, LUMINANCE, luminance

DARK = 0.003  # squared brightness below which errors stop being relative
ALBEDO, NORMAL, MISS = slice(7, 10), slice(10, 13), 15


def unpacked(planes, exposure=1.0):
    """Planes, irradiance, variance and divisor from stored planes, in another exposure."""
    x = planes[:, :18].clone()
    irradiance = torch.expm1(2 * x[:, :3]) / 4 * exposure
    x[:, :5] = 0.5 * torch.log1p(torch.expm1(2 * x[:, :5]) * exposure)
    variance = (torch.exp2(planes[:, 18:19]) - 2.0**-40).clamp(min=0) * exposure**2
    divisor = torch.where(x[:, MISS : MISS + 1] > 0.5, torch.ones_like(x[:, :1]), x[:, ALBEDO].clamp(min=0.03))
    return x, irradiance, variance, divisor


def loss_of(result, target):
    """The logarithm of the mean relative squared error, over pixels and over blocks, where blotches show."""
    bright = luminance(target).clamp(min=0)
    error = torch.zeros(result.shape[0])
    for side, weight in ((1, 1.0), (4, 2.0), (16, 4.0)):
        mean = lambda t: functional.avg_pool2d(t, side) if side > 1 else t
        relative = mean(result - target) / torch.sqrt(mean(bright * bright) + DARK)
        huber = functional.huber_loss(relative, torch.zeros_like(relative), reduction="none", delta=10.0)
        error = error + weight * 2 * huber.mean((1, 2, 3))
    return torch.log(error + 1e-4).mean()


class Views:
    def __init__(self, folders):
        self.folders, self.views, self.seen = folders, [], set()
        self.refresh()

    def refresh(self):
        for name in sorted(sum((glob.glob(os.path.join(f, "*.npz")) for f in self.folders), [])):
            if name in self.seen or name.endswith(".part.npz"):
                continue
            self.seen.add(name)
            stored = np.load(name)
            target = stored["target"]
            for k in range(len(stored["samples"])):
                if stored["samples"][k] <= 64:
                    self.views.append((stored[f"x{k}"], (target * stored[f"exposure{k}"]).astype(np.float32)))

    def crops(self, count, side, rng):
        planes, targets = [], []
        for _ in range(count):
            x, t = rng.choice(self.views)
            height, width = x.shape[-2:]
            y0, x0 = rng.randrange(height - side + 1) & ~1, rng.randrange(width - side + 1) & ~1
            planes.append(x[:, y0 : y0 + side, x0 : x0 + side].astype(np.float32))
            targets.append(t[:, y0 : y0 + side, x0 : x0 + side])
        return torch.from_numpy(np.stack(planes)), torch.from_numpy(np.stack(targets))


def rotation(rng):
    matrix, _ = np.linalg.qr(np.array([[rng.gauss(0, 1) for _ in range(3)] for _ in range(3)]))
    return torch.tensor(matrix, dtype=torch.float32)


def augmented(planes, target, rng):
    if rng.random() < 0.5:
        planes, target = planes.flip(-1), target.flip(-1)
    if rng.random() < 0.5:
        planes, target = planes.flip(-2), target.flip(-2)
    if rng.random() < 0.5:
        planes, target = planes.transpose(-1, -2), target.transpose(-1, -2)
    planes = planes.clone()
    planes[:, NORMAL] = torch.einsum("ij,bjhw->bihw", rotation(rng), planes[:, NORMAL])
    return planes, target


def validated(model, views, limit=256):
    """Geometric mean over the views of the relative squared error, by number of samples."""
    errors = {}
    with torch.no_grad():
        for name, stored in views:
            for k, samples in enumerate(stored["samples"]):
                planes = torch.from_numpy(stored[f"x{k}"][None].astype(np.float32))
                height, width = (n // 32 * 32 for n in planes.shape[-2:])
                planes = planes[..., :height, :width]
                target = torch.from_numpy(stored["target"][None] * stored[f"exposure{k}"])[..., :height, :width]
                x, irradiance, variance, divisor = unpacked(planes)
                result = model(x, irradiance, variance) * divisor
                relative = ((result - target) ** 2).mean(1) / (luminance(target)[:, 0] ** 2 + 0.0025)
                errors.setdefault(int(samples), []).append(math.log(relative.mean().item() + 1e-9))
    return {s: round(math.exp(sum(e) / len(e)), 5) for s, e in sorted(errors.items())}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="+")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--validation", default="")
    parser.add_argument("--resume", default="")
    parser.add_argument("--seconds", type=float, default=3600)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rate", type=float, default=2e-3)
    parser.add_argument("--crops", type=int, default=4)
    parser.add_argument("--side", type=int, default=96)
    parser.add_argument("--seed", type=int, default=1)
    o = parser.parse_args()
    torch.set_num_threads(o.threads)
    torch.manual_seed(o.seed)
    rng = random.Random(o.seed)
    model = KernelPrediction()
    if o.resume:
        model.load_state_dict(torch.load(o.resume)["model"])
    mean = copy.deepcopy(model)
    optimiser = torch.optim.Adam(model.parameters(), lr=o.rate, betas=(0.9, 0.99))
    views = Views(o.data)
    checks = [(n, np.load(n)) for n in sorted(glob.glob(os.path.join(o.validation, "*.npz")))] if o.validation else []
    begun, step, losses, saved = time.time(), 0, [], time.time()
    while time.time() - begun < o.seconds:
        done = (time.time() - begun) / o.seconds
        rate = o.rate * min(1, (step + 1) / 100) * (0.5 + 0.5 * math.cos(math.pi * done) + 0.01)
        for group in optimiser.param_groups:
            group["lr"] = rate
        planes, target = augmented(*views.crops(o.crops, o.side, rng), rng)
        exposure = 2 ** rng.uniform(-1, 1)
        x, irradiance, variance, divisor = unpacked(planes, exposure)
        loss = loss_of(model(x, irradiance, variance) * divisor, target * exposure)
        optimiser.zero_grad()
        loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        if torch.isfinite(norm):
            optimiser.step()
        decay = min(0.998, step / (step + 20))
        with torch.no_grad():
            for to, of in zip(mean.parameters(), model.parameters()):
                to += (1 - decay) * (of - to)
        losses.append(loss.item())
        step += 1
        if time.time() - saved > 300 or time.time() - begun >= o.seconds:
            saved = time.time()
            record = {"steps": step, "seconds": round(saved - begun), "views": len(views.views),
                      "loss": round(sum(losses[-500:]) / len(losses[-500:]), 4)}
            if checks:
                record["validation"] = validated(mean, checks)
            print(json.dumps(record), flush=True)
            torch.save({"model": mean.state_dict(), "record": record}, o.output + ".part")
            os.replace(o.output + ".part", o.output)
            views.refresh()


if __name__ == "__main__":
    main()
