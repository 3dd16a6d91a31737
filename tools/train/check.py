#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Trains for a minute and checks that every step fits the next one; leaves out, with a sentence, what is not installed.

    python3 tools/train/check.py BRAID

A scene is made and rendered small; training lowers the error of its views; kernels.c gives what whole tensors give; and
braid makes the same images with the exported networks as torch does.
"""

import math
import os
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))


def left_out():
    try:
        import numpy, OpenImageIO, torch  # noqa: F401, E401
    except ImportError as error:
        return f"{error.name} is not installed (Debian: python3-torch, python3-numpy, python3-openimageio)"
    return ""


def run(*call):
    subprocess.run(call, check=True)


def python(script, *arguments):
    run(sys.executable, os.path.join(HERE, script), *arguments)


def check_kernels():
    import kernels
    import network
    import torch

    if not kernels.LIBRARY:
        print("no C compiler: kernels.c is not checked")
        return
    torch.manual_seed(1)
    inputs = [torch.rand(2, 3, 20, 28) * 3, torch.rand(2, 1, 20, 28) + 0.1, torch.randn(2, 6, 20, 28),
              torch.rand(2, 1, 20, 28), torch.rand(2, 1, 20, 28) * 0.05, torch.tensor(0.4), torch.tensor(1.5)]
    slope = torch.randn(2, 3, 20, 28)
    results = []
    for average in (network.average_by_tensors, kernels.Average.apply):
        own = [t.clone().requires_grad_(k not in (3, 4)) for k, t in enumerate(inputs)]
        image = average(*own)
        (image * slope).sum().backward()
        results.append([image.detach()] + [t.grad for t in own if t.requires_grad])
    for one, other in zip(*results):
        assert (one - other).abs().max() < 1e-4 * (1 + one.abs().max()), "kernels.c differs from whole tensors"


def check_resumed(folder, views, exported):
    """A training resumed from what braid reads begins with its weights and tests."""
    from network import KernelPrediction
    import network_file

    weights, again = (os.path.join(folder, name) for name in ("resumed.pt", "resumed.network"))
    python("train.py", views, "--resume", exported, "-o", weights, "--seconds", "0")
    python("export.py", weights, again)
    models = [KernelPrediction(), KernelPrediction()]
    constants = [network_file.read(path, model.unet)["constants"] for path, model in zip((exported, again), models)]
    same = all((one == other).all() for one, other in zip(*(model.unet.parameters() for model in models)))
    assert same and constants[0] == constants[1], "a resumed training begins with other weights"


def check_image(braid, folder, weights, exported):
    """braid's image of the view against torch's."""
    import data
    import numpy as np
    import torch
    from network import KernelPrediction
    from train import unpacked

    image, planes, out = (os.path.join(folder, name) for name in ("image.exr", "planes.exr", "out.exr"))
    run(braid, "render", os.path.join(HERE, "../../scenes/cornell.glb"), "-o", image, "--integrator", "pt", "--combine",
        "none", "--spp", "4", "--size", "96x64", "--aovs", "all", "--float", "-q")
    call = [braid, "combine", "--unbiased", image, "--method", "kpn", "--kpn-network", exported, "--float", "-q"]
    run(*call, "-o", out)
    run(*call, "--kpn-planes", "1", "--weights", "-o", planes)
    channels, exposure = data.read(planes)
    stored = np.stack([channels[f"kpn.{k:02}.Y"] for k in range(data.PLANES)] +
                      [np.log2(channels["kpn.variance.Y"] + 2.0**-40)])[None]
    model = KernelPrediction()
    model.load_state_dict(torch.load(weights)["model"])
    with torch.no_grad():
        for values in model.unet.parameters():
            values.copy_(values.half().float())
        x, irradiance, variance, divisor = unpacked(torch.from_numpy(stored.astype(np.float32)))
        mine = (model(x, irradiance, variance) * divisor / exposure).numpy()[0]
    compare(mine, out, "kpn")


def compare(mine, out, method):
    import data

    channels, _ = data.read(out)
    layer = next(n[: -len(".R")] for n in channels if n.startswith("combined." + method) and n.endswith(".R"))
    difference = ((mine - data.rgb(channels, layer)) ** 2).sum() / (mine**2).sum()
    print(f"relative squared difference of braid and torch, {method}: {difference:.1e}")
    assert difference < 1e-5, f"braid's image by {method} is not that of torch"


def disturb(weights):
    """Makes even weights of windows uneven, for training to take back: what it finds beyond even ones is little."""
    import torch

    stored = torch.load(weights)
    bias = stored["model"]["unet.head.bias"]
    bias += 5 * torch.randn(bias.numel(), generator=torch.Generator().manual_seed(3))
    torch.save(stored, weights)


def check_shrinkage(braid, folder):
    """Training of the two shrinkage methods, and braid's images of a view against torch's."""
    import shrinkage_data
    import torch
    from shrinkage import METHODS

    views, image = os.path.join(folder, "shrinkage"), os.path.join(folder, "both.exr")
    python("shrinkage_data.py", "0", "1", views, "--braid", braid, "--size", "96x64", "--target", "16")
    run(braid, "render", os.path.join(HERE, "../../scenes/cornell.glb"), "-o", image, "--integrator", "pt,sppm",
        "--combine", "none", "--spp", "8", "--size", "96x64", "--aovs", "all", "--float", "-q")
    for method, more in (("js-neural", []), ("double-shrinkage-neural", ["--double-shrinkage-chosen", "0"])):
        weights, exported, out = (os.path.join(folder, method + end) for end in (".pt", ".network", ".exr"))
        train = ("shrinkage_train.py", method, views, "--validation", views, "-o", weights, "--rate", "0.01", "--seconds")
        python(*train, "0")
        disturb(weights)
        errors = []
        for seconds in ("0", "15"):
            python(*train, seconds, "--resume", weights)
            found = torch.load(weights)["record"]["validation"]["network"].values()
            errors.append(sum(math.log(error) for error in found))
        assert errors[1] < errors[0], f"training of {method} did not help: {errors[0]} became {errors[1]}"
        python("export.py", weights, exported)
        run(braid, "combine", "--unbiased", image, "--method", method + "@sppm", f"--{method}-network", exported, *more,
            "--float", "-q", "-o", out)
        planes, exposure = shrinkage_data.planes_of(braid, image, method, "sppm", folder)
        model = METHODS[method]()
        model.load_state_dict(torch.load(weights)["model"])
        with torch.no_grad():
            for values in model.unet.parameters():
                values.copy_(values.half().float())
            mine = (model(*model.unpacked(torch.from_numpy(planes[None]))) / exposure).numpy()[0]
        compare(mine, out, method)


def main():
    reason = left_out()
    if reason:
        print("left out:", reason)
        return
    sys.path.insert(0, HERE)
    braid = os.path.abspath(sys.argv[1])
    check_kernels()
    with tempfile.TemporaryDirectory() as folder:
        views, weights, exported = (os.path.join(folder, name) for name in ("views", "kpn.pt", "kpn.network"))
        python("data.py", "0", "1", views, "--braid", braid, "--size", "96x64", "--target", "16")
        python("train.py", views, "-o", weights, "--seconds", "40", "--side", "64")
        python("evaluate.py", views, weights)
        import glob

        import network
        import numpy as np
        import torch
        from train import validated

        stored = [(name, np.load(name)) for name in sorted(glob.glob(os.path.join(views, "*.npz")))]
        before, after = network.KernelPrediction(), network.KernelPrediction()
        after.load_state_dict(torch.load(weights)["model"])
        first, last = validated(before, stored), validated(after, stored)
        assert sum(last.values()) < sum(first.values()), f"training did not help: {first} became {last}"
        python("export.py", weights, exported)
        check_resumed(folder, views, exported)
        check_image(braid, folder, weights, exported)
        check_shrinkage(braid, folder)


if __name__ == "__main__":
    main()
