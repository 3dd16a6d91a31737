#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Trains the network of js-neural or double-shrinkage-neural on the views of tools/train/shrinkage_data.py.

    python3 tools/train/shrinkage_train.py METHOD DATA... -o WEIGHTS.pt [--validation HELD] [--seconds S]

Weights are saved every few minutes, averaged over the last steps; with 0 seconds those of the start. The record says the
error of held-out views by number of samples: of the inputs, of the method without a network, and with it.
"""

import json
import math
import os
import sys

import numpy as np
import torch

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import training
from network import luminance
from shrinkage import METHODS
from train import loss_of


def inputs_of(method):
    """What training.Views reads of a file."""

    def inputs(stored):
        for k, samples in enumerate(stored["samples"]):
            target = (stored["target"] * stored[f"{method}-exposure{k}"]).astype(np.float32)
            yield int(samples), stored[f"{method}{k}"], target

    return inputs


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
    parser = training.arguments(__doc__, seconds=900, rate=4e-3, side=64, first=("method", METHODS))
    parser.add_argument("--shape", default="{}", help='e.g. {"cells": 15, "pack": 1, "widths": [32, 64, 128], "head": 3}')
    options = parser.parse_args()
    training.begin(options)
    shape = json.loads(options.shape)
    model, inputs = METHODS[options.method](**shape), inputs_of(options.method)
    views = training.Views(options.data, inputs)
    held = training.Views([options.validation], inputs).views if options.validation else []

    def loss_of_crops(rng):
        planes, target = training.flipped(*views.crops(options.crops, options.side, rng), rng)
        exposure = 2 ** rng.uniform(-1, 1)
        return loss_of(model(*model.unpacked(planes, exposure)), target * exposure)

    training.train(model, options, views, loss_of_crops, lambda mean: validated(mean, held) if held else None,
                   {"method": options.method, "shape": shape})


if __name__ == "__main__":
    main()
