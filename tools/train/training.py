# SPDX-License-Identifier: Apache-2.0
"""What the trainings of all networks share: views in folders, their crops, the steps, and the files of weights."""

import argparse
import copy
import glob
import json
import math
import os
import random
import time

import numpy as np
import torch

import network_file

SAVED_EVERY = 300  # seconds
FIRST_STEPS = 30  # in which the rate rises


class Views:
    """Views in folders as (samples, planes, target), which inputs_of(file) yields; refresh() finds new files."""

    def __init__(self, folders, inputs_of):
        self.folders, self.inputs_of, self.views, self.seen = folders, inputs_of, [], set()
        self.refresh()

    def refresh(self):
        for name in sorted(sum((glob.glob(os.path.join(f, "*.npz")) for f in self.folders), [])):
            if name not in self.seen and not name.endswith(".part.npz"):
                self.seen.add(name)
                self.views += self.inputs_of(np.load(name))

    def crops(self, count, side, rng, multiple=1):
        """Planes and targets of random squares whose corners are at multiples of so many pixels."""
        planes, targets = [], []
        for _ in range(count):
            _, x, t = rng.choice(self.views)
            y0, x0 = (rng.randrange(n - side + 1) // multiple * multiple for n in x.shape[-2:])
            planes.append(x[:, y0 : y0 + side, x0 : x0 + side].astype(np.float32))
            targets.append(t[:, y0 : y0 + side, x0 : x0 + side])
        return torch.from_numpy(np.stack(planes)), torch.from_numpy(np.stack(targets))


def flipped(planes, target, rng):
    for flip in (lambda t: t.flip(-1), lambda t: t.flip(-2), lambda t: t.transpose(-1, -2)):
        if rng.random() < 0.5:
            planes, target = flip(planes), flip(target)
    return planes, target


def arguments(description, seconds, rate, side, first=None):
    """The options that all have, with these defaults; `first` is an argument before the data, a name and its choices."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    if first:
        parser.add_argument(first[0], choices=first[1])
    parser.add_argument("data", nargs="+")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--validation", default="")
    parser.add_argument("--resume", default="")
    parser.add_argument("--seconds", type=float, default=seconds)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--rate", type=float, default=rate)
    parser.add_argument("--crops", type=int, default=4)
    parser.add_argument("--side", type=int, default=side)
    parser.add_argument("--seed", type=int, default=1)
    return parser


def begin(options):
    torch.set_num_threads(options.threads)
    torch.manual_seed(options.seed)


class Averaged:
    """A model, and the average of its weights over the last steps, which is what is saved."""

    def __init__(self, model, rate):
        self.model, self.mean, self.rate, self.steps = model, copy.deepcopy(model), rate, 0
        self.optimiser = torch.optim.Adam(model.parameters(), lr=rate, betas=(0.9, 0.99))

    def step(self, loss, done):
        """Follows the gradient of a loss; `done` is the share of the training that is over."""
        rate = self.rate * min(1, (self.steps + 1) / FIRST_STEPS) * (0.5 + 0.5 * math.cos(math.pi * done) + 0.01)
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        self.optimiser.zero_grad()
        loss.backward()
        if torch.isfinite(torch.nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)):
            self.optimiser.step()
        decay = min(0.998, self.steps / (self.steps + 20))
        with torch.no_grad():
            for to, of in zip(self.mean.parameters(), self.model.parameters()):
                to += (1 - decay) * (of - to)
        self.steps += 1


def resume(model, path):
    """Weights of a training, or of a network that braid reads."""
    if not path.endswith(".network"):
        model.load_state_dict(torch.load(path)["model"])
        return
    constants = network_file.read(path, model.unet)["constants"]
    if constants:
        model.take_constants(constants)


def train(model, options, views, loss_of_crops, validation, kept):
    """Trains for options.seconds and saves every few minutes; with 0 seconds only the weights of the start.

    loss_of_crops(rng) is a step's loss, validation(model) what the record says of held-out views (None: nothing), and
    `kept` what else belongs into the file of weights.
    """
    if options.resume:
        resume(model, options.resume)
    averaged, rng = Averaged(model, options.rate), random.Random(options.seed)
    begun, saved, losses = time.time(), time.time(), [0.0]
    while True:
        seconds = time.time() - begun
        if seconds >= options.seconds or time.time() - saved > SAVED_EVERY:
            saved = time.time()
            record = {"steps": averaged.steps, "seconds": round(seconds), "views": len(views.views),
                      "loss": round(sum(losses[-500:]) / len(losses[-500:]), 4)}
            held = validation(averaged.mean)
            if held is not None:
                record["validation"] = held
            print(json.dumps(record), flush=True)
            torch.save({**kept, "model": averaged.mean.state_dict(), "record": record}, options.output + ".part")
            os.replace(options.output + ".part", options.output)
            views.refresh()
            if seconds >= options.seconds:
                return
        loss = loss_of_crops(rng)
        averaged.step(loss, seconds / options.seconds)
        losses.append(loss.item())
