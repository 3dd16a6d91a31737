# SPDX-License-Identifier: Apache-2.0
"""js-neural and double-shrinkage-neural as braid runs them (combiners/shrinkage/neural), in torch, for training.

A U-Net says weights of the windows about every pixel, in cells of pixels that share them, and a number more: the share of
either fit (js-neural) or the error of the prior (double-shrinkage-neural). What is made of them are the formulas of
combiners/README.md, James-Stein and Double shrinkage.
"""

import torch
import torch.nn as nn
import torch.nn.functional as functional


class Unet(nn.Module):
    """The U-Net of Neural James-Stein; with pack 2 it sees squares of 2x2 pixels as single ones."""

    def __init__(self, planes, numbers, pack=2, widths=(32, 32, 48), head=1):
        super().__init__()
        a, b, c = widths
        self.pack, self.planes = pack, planes
        conv = lambda inputs, outputs, kernel=3: nn.Conv2d(inputs, outputs, kernel, padding=kernel // 2)
        self.enc0a, self.enc0b = conv(planes * pack * pack, a), conv(a, a)
        self.enc1a, self.enc1b = conv(a, b), conv(b, b)
        self.enc2a, self.enc2b = conv(b, c), conv(c, c)
        self.dec1a, self.dec1b = conv(c + b, b), conv(b, b)
        self.dec0a, self.dec0b = conv(b + a, a), conv(a, a)
        self.head = conv(a, numbers * pack * pack, head)
        with torch.no_grad():
            self.head.weight *= 0.1

    def forward(self, planes):
        relu, pool = functional.relu, lambda t: functional.max_pool2d(t, 2)
        up = lambda t: functional.interpolate(t, scale_factor=2, mode="nearest")
        e0 = relu(self.enc0b(relu(self.enc0a(functional.pixel_unshuffle(planes, self.pack)))))
        e1 = relu(self.enc1b(relu(self.enc1a(pool(e0)))))
        t = relu(self.enc2b(relu(self.enc2a(pool(e1)))))
        t = relu(self.dec1b(relu(self.dec1a(torch.cat([up(t), e1], 1)))))
        t = relu(self.dec0b(relu(self.dec0a(torch.cat([up(t), e0], 1)))))
        return functional.pixel_shuffle(self.head(t), self.pack)

    def layers(self):
        """Those of the exported file, and the modules of those that have weights (network_file.py)."""
        out, modules = [], []

        def convolutions(source, *names):
            for name in names:
                module = getattr(self, name)
                out.append({"name": name, "kind": "convolution", "inputs": [source], "outputs": module.out_channels,
                            "kernel": module.kernel_size[0], "relu": name != "head"})
                modules.append(module)
                source = name
            return source

        def other(kind, name, *sources):
            out.append({"name": name, "kind": kind, "inputs": list(sources)})
            return name

        e0 = convolutions("input", "enc0a", "enc0b")
        e1 = convolutions(other("pool", "pool0", e0), "enc1a", "enc1b")
        t = convolutions(other("pool", "pool1", e1), "enc2a", "enc2b")
        t = convolutions(other("concatenate", "with1", other("upsample", "up1", t), e1), "dec1a", "dec1b")
        t = convolutions(other("concatenate", "with0", other("upsample", "up0", t), e0), "dec0a", "dec0b")
        convolutions(t, "head")
        return out, modules


def mirrored(planes, radius):
    return functional.pad(planes, (radius,) * 4, mode="reflect")


def window_mean(planes, radius):
    side = 2 * radius + 1
    rows = functional.avg_pool2d(mirrored(planes, radius), (side, 1), 1)
    return functional.avg_pool2d(rows, (1, side), 1)


class Cells:
    """Weighted means over mirrored windows whose pixels share weights in cells (combiners/learned/planes/window_cells.h)."""

    def __init__(self, radius, cells):
        side = 2 * radius + 1
        half_away = lambda v: int(abs(v) + 0.5) * (1 if v > 0 else -1)
        of = [half_away(d * cells / side) + (cells - 1) // 2 for d in range(-radius, radius + 1)]
        self.radius, self.cells = radius, cells
        self.members = torch.tensor([[float(c == k) for c in of] for k in range(cells)])
        pixels = self.members.sum(1)
        self.pixels = (pixels[:, None] * pixels[None]).reshape(1, -1, 1, 1)

    def means(self, plane, weights):
        """Of one channel."""
        count, _, height, width = plane.shape
        side, r = 2 * self.radius + 1, self.radius
        columns = functional.conv2d(mirrored(plane, r), self.members.reshape(-1, 1, side, 1))
        sums = functional.conv2d(columns.reshape(-1, 1, height, width + 2 * r), self.members.reshape(-1, 1, 1, side))
        sums = sums.reshape(count, self.cells**2, height, width)
        return (weights * sums).sum(1, keepdim=True) / (weights * self.pixels).sum(1, keepdim=True)


def radiance(compressed):
    return torch.expm1(2 * compressed) / 4


def rescaled(compressed, exposure):
    return 0.5 * torch.log1p(torch.expm1(2 * compressed) * exposure)


def compressed_error(error, level):
    """compressedError() of combiners/shrinkage/neural/learned_noise.h."""
    return 0.25 * torch.log2(torch.sqrt(error) / (level.clamp(min=0) + 0.01) + 0.002)


def error_of(planes):
    """What is stored as a logarithm."""
    return (torch.exp2(planes) - 2.0**-40).clamp(min=0)


class JamesStein(nn.Module):
    PLANES, STORED, RADIUS, LIMIT = 12, 21, 7, 1.5
    LOGARITHMS = slice(12, 15)  # of what is stored
    NAME = "js-neural"

    def __init__(self, cells=5, **unet):
        super().__init__()
        self.cells = Cells(self.RADIUS, cells)
        self.unet = Unet(self.PLANES, cells * cells + 1, **unet)
        with torch.no_grad():
            self.unet.head.bias.zero_()
            self.unet.head.bias[: -self.unet.pack**2] = 0.2  # even weights; only their ratios matter

    @classmethod
    def unpacked(cls, stored, exposure=1.0):
        """Planes, X, both fits, variance, the least factors and those of fireflies, in another exposure."""
        planes = stored[:, : cls.PLANES].clone()
        for part in (slice(0, 3), slice(6, 12)):
            planes[:, part] = rescaled(planes[:, part], exposure)
        x, a, b = (radiance(planes[:, k : k + 3]) for k in (0, 6, 9))
        variance = error_of(stored[:, 12:15]) * exposure**2
        planes[:, 3:6] = compressed_error(variance, 0.5 * (a + b))
        return planes, x, a, b, variance, stored[:, 15:18], stored[:, 18:21]

    @classmethod
    def images(cls, stored):
        _, x, a, b, *_ = cls.unpacked(stored)
        return {"unbiased": x, "fit": 0.5 * (a + b)}

    def plain(self, *inputs):
        """js without the network."""
        return self.shrunk(*inputs[1:], None)

    def forward(self, planes, *images):
        return self.shrunk(*images, self.unet(planes))

    def shrunk(self, x, a, b, variance, least, fireflies, said):
        p = (2 * self.RADIUS + 1) ** 2
        noise, share = window_mean(variance, self.RADIUS), 0.5
        if said is not None:
            weights, share = functional.relu(said[:, :-1]) + 1e-4, torch.sigmoid(said[:, -1:])
            learned = torch.cat([self.cells.means(variance[:, c : c + 1], weights) for c in range(3)], 1)
            noise = torch.minimum(learned, self.LIMIT * noise)
        y = b + share * (a - b)
        lone = fireflies >= 0
        squares = torch.where(lone, torch.zeros_like(x), torch.maximum((x - y) ** 2, 1e-12 * x * x))
        sums = (p * window_mean(squares, self.RADIUS)).clamp(min=1e-5)
        factor = torch.maximum(functional.relu(1 - (p - 2) * noise / sums), least)
        factor = torch.where(lone, fireflies, window_mean(factor, self.RADIUS))
        return functional.relu(y + factor * (x - y))


class DoubleShrinkage(nn.Module):
    PLANES, STORED, RADIUS, LIMIT, DARK = 11, 16, 6, 2.0, 0.01
    LOGARITHMS = slice(11, 16)
    NAME = "double-shrinkage-neural"

    def __init__(self, cells=5, **unet):
        super().__init__()
        self.cells = Cells(self.RADIUS, cells)
        self.unet = Unet(self.PLANES, 2 * cells * cells + 1, **unet)
        with torch.no_grad():
            self.unet.head.bias.zero_()
            self.unet.head.bias[-self.unet.pack**2 :] = -4

    @classmethod
    def unpacked(cls, stored, exposure=1.0):
        """Planes, the three images, two errors as pixels say them and three as they are measured, in another exposure."""
        planes = stored[:, : cls.PLANES].clone()
        planes[:, :9] = rescaled(planes[:, :9], exposure)
        images = [radiance(planes[:, k : k + 3]) for k in (0, 3, 6)]
        errors = [error_of(stored[:, k : k + 1]) * exposure**2 for k in range(11, 16)]
        level = images[2].mean(1, keepdim=True)
        planes[:, 9:10], planes[:, 10:11] = (compressed_error(e, level) for e in errors[:2])
        return planes, *images, *errors

    @classmethod
    def images(cls, stored):
        _, x, y, prior, *_ = cls.unpacked(stored)
        return {"unbiased": x, "biased": y, "prior": prior}

    def plain(self, planes, x, y, prior, own_u, own_b, error_u, error_b, error_p):
        """double-shrinkage without the network."""
        return self.combined(x, y, prior, error_u, error_b, error_p)

    def forward(self, planes, x, y, prior, own_u, own_b, most_u, least_b, least_p):
        said, count = self.unet(planes), self.cells.cells**2
        level = prior.mean(1, keepdim=True) ** 2
        u = self.cells.means(own_u, torch.softmax(said[:, :count], 1))
        b = self.cells.means(own_b, torch.softmax(said[:, count : 2 * count], 1))
        p = torch.exp(said[:, -1:].clamp(-30, 10)) * (level + self.DARK)
        tiny = 1e-8 * (level + 1e-4)
        u = torch.minimum(torch.maximum(u, tiny), self.LIMIT * most_u)
        b = torch.maximum(torch.maximum(b, tiny), least_b / self.LIMIT)
        p = torch.maximum(torch.maximum(p, 1e-6 * (level + self.DARK)), least_p / self.LIMIT)
        return self.combined(x, y, prior, u, b, p)

    @staticmethod
    def combined(x, y, prior, u, b, p):
        to_biased = u / (u + b).clamp(min=1e-30)
        harmonic = to_biased * b
        to_prior = harmonic / (harmonic + p).clamp(min=1e-30)
        first = functional.relu(x + to_biased * (y - x))
        return functional.relu(first + to_prior * (prior - first))


METHODS = {m.NAME: m for m in (JamesStein, DoubleShrinkage)}
