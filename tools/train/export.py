#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes trained weights as the file that their method reads (combiners/learned/network_file.h).

    python3 tools/train/export.py WEIGHTS.pt combiners/denoise/kpn/kpn.network
"""

import json
import os
import struct
import sys

import numpy as np
import torch

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import shrinkage
from network import KernelPrediction, PLANES


def layers(unet):
    """The layers of Unet.forward, and the modules of those that have weights."""
    out, modules = [], []

    def convolution(name, source, relu=True):
        module = getattr(unet, name)
        out.append({"name": name, "kind": "convolution", "inputs": [source], "outputs": module.out_channels,
                    "kernel": module.kernel_size[0], "relu": relu})
        modules.append(module)
        return name

    def other(kind, name, *sources):
        out.append({"name": name, "kind": kind, "inputs": list(sources)})
        return name

    def joined(below, beside):
        return other("concatenate", "with_" + beside, other("upsample", "up_" + below, below), beside)

    e0 = convolution("enc0b", convolution("enc0a", "input"))
    e1 = convolution("enc1", other("pool", "pool0", e0))
    e2 = convolution("enc2", other("pool", "pool1", e1))
    e3 = convolution("enc3", other("pool", "pool2", e2))
    t = convolution("enc4b", convolution("enc4a", other("pool", "pool3", e3)))
    t = convolution("dec3", joined(t, e3))
    t = convolution("dec2", joined(t, e2))
    t = convolution("dec1", joined(t, e1))
    t = convolution("dec0b", convolution("dec0a", joined(t, e0)))
    convolution("head", other("concatenate", "with_input", t, "input"), relu=False)
    return out, modules


def write(path, model, training):
    described, modules = layers(model.unet)
    steepness, tolerance = (t.detach().tolist() for t in model.tests())
    rounded = lambda values: [round(v, 6) for v in values]
    description = {
        "inputs": 4 * PLANES,
        "layers": described,
        "constants": {"steepness": rounded(steepness[0]), "tolerance": rounded(tolerance[0]),
                      "gateSteepness": rounded(steepness[1]), "gateTolerance": rounded(tolerance[1])},
        "training": training,
    }
    write_layers(path, description, modules)


def write_layers(path, description, modules):
    text = json.dumps(description, separators=(",", ":")).encode()
    with open(path, "wb") as file:
        file.write(b"BRAIDNET" + struct.pack("<II", 1, len(text)) + text)
        for module in modules:
            for values in (module.weight, module.bias):
                file.write(values.detach().numpy().astype("<f2").tobytes())


def write_shrinkage(path, model, training):
    described, modules = model.unet.layers()
    inputs = model.PLANES * model.unet.pack**2
    write_layers(path, {"inputs": inputs, "layers": described, "constants": {}, "training": training}, modules)


def main():
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    stored = torch.load(sys.argv[1])
    if "method" in stored:
        model = shrinkage.METHODS[stored["method"]](**stored["shape"])
        model.load_state_dict(stored["model"])
        write_shrinkage(sys.argv[2], model, stored["record"])
    else:
        model = KernelPrediction()
        model.load_state_dict(stored["model"])
        write(sys.argv[2], model, stored["record"])
    print(f"{sys.argv[2]}: {os.path.getsize(sys.argv[2])} bytes")


if __name__ == "__main__":
    main()
