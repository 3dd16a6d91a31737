# SPDX-License-Identifier: Apache-2.0
"""Weights as the file that their method reads (combiners/learned/network_file.h), written and read again."""

import json
import struct

import numpy as np
import torch

MAGIC = b"BRAIDNET"
VERSION = 1


def write(path, unet, inputs, constants, training):
    """The layers of a U-Net, its weights as halves, and what they were trained by."""
    described, modules = unet.layers()
    description = {"inputs": inputs, "layers": described, "constants": constants, "training": training}
    text = json.dumps(description, separators=(",", ":")).encode()
    with open(path, "wb") as file:
        file.write(MAGIC + struct.pack("<II", VERSION, len(text)) + text)
        for module in modules:
            for values in (module.weight, module.bias):
                file.write(values.detach().numpy().astype("<f2").tobytes())


def read(path, unet):
    """Gives a U-Net of the same layers the weights of a file; returns its description. ValueError for other layers."""
    with open(path, "rb") as file:
        data = file.read()
    magic, version, length = struct.unpack_from("<8sII", data)
    if magic != MAGIC or version != VERSION:
        raise ValueError(f"{path}: no network of version {VERSION}")
    description = json.loads(data[16 : 16 + length])
    described, modules = unet.layers()
    if description["layers"] != described:
        raise ValueError(f"{path}: its layers are not those of this network")
    values = torch.from_numpy(np.frombuffer(data, "<f2", offset=16 + length).astype(np.float32))
    parts = [part for module in modules for part in (module.weight, module.bias)]
    with torch.no_grad():
        for part, of in zip(parts, values.split([part.numel() for part in parts])):
            part.copy_(of.reshape(part.shape))
    return description
