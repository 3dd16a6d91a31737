#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Trains the network of js-neural or double-shrinkage-neural on the views of tools/train/shrinkage_data.py.

    python3 tools/train/shrinkage_train.py METHOD DATA... -o WEIGHTS.pt [--validation HELD] [--seconds S]

Weights are saved every few minutes, averaged over the last steps; with 0 seconds those of the start. The record says the
error of held-out views by number of samples: of the inputs, of the method without a network, and with it.
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

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from network import luminance
from shrinkage import METHODS
from train import loss_of


class Views:
    def __init__(self, method, folders):
        self.method, self.folders, self.views, self.seen = method, folders, [], set()
        self.refresh()

    def refresh(self):
        for name in sorted(sum((glob.glob(os.path.join(f, "*.npz")) for f in self.folders), [])):
            if name in self.seen or name.endswith(".part.npz"):
                continue
            self.seen.add(name)
            stored = np.load(name)
            for k, samples in enumerate(stored["samples"]):
                target = (stored["target"] * stored[f"{self.method}-exposure{k}"]).astype(np.float32)
                self.views.append((int(samples), stored[f"{self.method}{k}"], target))

    def crops(self, count, side, rng):
        planes, targets = [], []
        for _ in range(count):
            _, x, t = rng.choice(self.views)
            height, width = x.shape[-2:]
            y0, x0 = rng.randrange(height - side + 1), rng.randrange(width - side + 1)
            planes.append(x[:, y0 : y0 + side, x0 : x0 + side].astype(np.float32))
            targets.append(t[:, y0 : y0 + side, x0 : x0 + side])
        return torch.from_numpy(np.stack(planes)), torch.from_numpy(np.stack(targets))


def augmented(planes, target, rng):
    for flip in (lambda t: t.flip(-1), lambda t: t.flip(-2), lambda t: t.transpose(-1, -2)):
        if rng.random() < 0.5:
            planes, target = flip(planes), flip(target)
    return planes, target


def relative_error(image, target):
    return ((image - target) ** 2).mean(1) / (luminance(target)[:, 0] ** 2 + 0.0025)


def validated(model, views):
    """Geometric means over the views of the relative squared error, by number of samples and image."""
    sums = {}
    with torch.no_grad():
        for samples, stored, target in views:
            height, width = (n // 8 * 8 for n in stored.shape[-2:])
            planes = torch.from_numpy(stored[None, :, :height, :width].astype(np.float32))
            inputs = model.unpacked(planes)
            images = {**model.images(planes), "plain": model.plain(*inputs), "network": model(*inputs)}
            for name, image in images.items():
                error = relative_error(image, torch.from_numpy(target[None, :, :height, :width])).mean().item()
                sums.setdefault(name, {}).setdefault(samples, []).append(math.log(error + 1e-9))
    mean = lambda logs: float(f"{math.exp(sum(logs) / len(logs)):.4g}")
    return {name: {s: mean(logs) for s, logs in sorted(of.items())} for name, of in sums.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("method", choices=METHODS)
    parser.add_argument("data", nargs="+")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--validation", default="")
    parser.add_argument("--resume", default="")
    parser.add_argument("--seconds", type=float, default=900)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rate", type=float, default=4e-3)
    parser.add_argument("--crops", type=int, default=4)
    parser.add_argument("--side", type=int, default=64)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--shape", default="{}", help='e.g. {"cells": 15, "pack": 1, "widths": [32, 64, 128], "head": 3}')
    o = parser.parse_args()
    torch.set_num_threads(o.threads)
    torch.manual_seed(o.seed)
    rng, shape = random.Random(o.seed), json.loads(o.shape)
    model = METHODS[o.method](**shape)
    if o.resume:
        model.load_state_dict(torch.load(o.resume)["model"])
    mean = copy.deepcopy(model)
    optimiser = torch.optim.Adam(model.parameters(), lr=o.rate, betas=(0.9, 0.99))
    views = Views(o.method, o.data)
    held = Views(o.method, [o.validation]).views if o.validation else []
    begun, step, losses, saved = time.time(), 0, [0.0], time.time()
    while True:
        seconds = time.time() - begun
        if seconds >= o.seconds or time.time() - saved > 120:
            saved = time.time()
            record = {"steps": step, "seconds": round(seconds), "views": len(views.views),
                      "loss": round(sum(losses[-500:]) / len(losses[-500:]), 4)}
            if held:
                record["validation"] = validated(mean, held)
            print(json.dumps(record), flush=True)
            torch.save({"method": o.method, "shape": shape, "model": mean.state_dict(), "record": record}, o.output + ".part")
            os.replace(o.output + ".part", o.output)
            views.refresh()
            if seconds >= o.seconds:
                break
        rate = o.rate * min(1, (step + 1) / 30) * (0.5 + 0.5 * math.cos(math.pi * seconds / o.seconds) + 0.01)
        for group in optimiser.param_groups:
            group["lr"] = rate
        planes, target = augmented(*views.crops(o.crops, o.side, rng), rng)
        exposure = 2 ** rng.uniform(-1, 1)
        loss = loss_of(model(*model.unpacked(planes, exposure)), target * exposure)
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


if __name__ == "__main__":
    main()
