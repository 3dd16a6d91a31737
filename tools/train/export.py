#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes trained weights as the file that their method reads (combiners/learned/network_file.h).

    python3 tools/train/export.py WEIGHTS.pt combiners/denoise/kpn/kpn.network [WITH ...]

WITH: weights of other trainings, or networks that braid reads, to be averaged with these. What has learned on from a
network is often better half way back (Wortsman et al. 2022).
"""

import os
import sys

import torch

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import network_file
import shrinkage
from network import KernelPrediction, PLANES
from training import resume


def main():
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    stored = torch.load(sys.argv[1])
    shrinks = "method" in stored
    model = shrinkage.METHODS[stored["method"]](**stored["shape"]) if shrinks else KernelPrediction()
    record, sums = dict(stored["record"]), stored["model"]
    for path in sys.argv[3:]:
        resume(model, path)
        sums = {name: value + model.state_dict()[name] for name, value in sums.items()}
        record["averaged"] = len(sys.argv) - 2
    model.load_state_dict({name: value / (len(sys.argv) - 2) for name, value in sums.items()})
    inputs = model.PLANES * model.unet.pack**2 if shrinks else 4 * PLANES
    network_file.write(sys.argv[2], model.unet, inputs, {} if shrinks else model.constants(), record)
    print(f"{sys.argv[2]}: {os.path.getsize(sys.argv[2])} bytes")


if __name__ == "__main__":
    main()
