#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes trained weights as the file that their method reads (combiners/learned/network_file.h).

    python3 tools/train/export.py WEIGHTS.pt combiners/denoise/kpn/kpn.network
"""

import os
import sys

import torch

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import network_file
import shrinkage
from network import KernelPrediction, PLANES


def main():
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    stored = torch.load(sys.argv[1])
    shrinks = "method" in stored
    model = shrinkage.METHODS[stored["method"]](**stored["shape"]) if shrinks else KernelPrediction()
    model.load_state_dict(stored["model"])
    inputs = model.PLANES * model.unet.pack**2 if shrinks else 4 * PLANES
    network_file.write(sys.argv[2], model.unet, inputs, {} if shrinks else model.constants(), stored["record"])
    print(f"{sys.argv[2]}: {os.path.getsize(sys.argv[2])} bytes")


if __name__ == "__main__":
    main()
