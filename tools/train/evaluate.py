#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Relative squared errors of trained weights on views that training has not seen.

    python3 tools/train/evaluate.py DATA WEIGHTS [WEIGHTS ...]

Prints, for each file (of a training, or a network that braid reads), the geometric mean over the views by number of
samples; first that of the samples themselves.
"""

import glob
import os
import sys

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from network import KernelPrediction
from train import validated
from training import resume


def main():
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    views = [(name, np.load(name)) for name in sorted(glob.glob(os.path.join(sys.argv[1], "*.npz")))]
    print("samples", validated(lambda planes, irradiance, variance: irradiance, views))
    for path in sys.argv[2:]:
        model = KernelPrediction()
        resume(model, path)
        print(path, validated(model, views))


if __name__ == "__main__":
    main()
