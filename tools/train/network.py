# SPDX-License-Identifier: Apache-2.0
"""Kernel prediction as braid runs it (combiners/denoise/kpn), in torch, for training.

A U-Net at half resolution turns the planes of an image (combiners/denoise/kpn/kpn_planes.h) into features. Pixels
average their neighbours by the distance of their features, at LEVELS scales, each of half the resolution of the one
before, and the scales are joined from the coarsest on. The result is linear in the irradiance for given features, so no
colour is invented. Neighbours and coarse pixels that differ by more than noise explains are left out by a test that no
feature can overrule, so that the error goes on falling with more samples.
"""

import torch
import torch.nn as nn
import torch.nn.functional as functional

import kernels

PLANES = 18
LEVELS = 6
FINE_FEATURES = 6  # of the first level, at full resolution; besides, the weight of the pixel and its gate
COARSE_FEATURES = 8  # of the others; besides, their gate
FINE_OUTPUTS = FINE_FEATURES + 2
COARSE_OUTPUTS = COARSE_FEATURES + 1
OUTPUTS = 4 * FINE_OUTPUTS + (LEVELS - 1) * COARSE_OUTPUTS
RADIUS = 2
LUMINANCE = (0.2126, 0.7152, 0.0722)
TINY = 1e-12

# Encoder and decoder, by name: inputs, outputs, kernel. Both halves of a name are joined for the decoder.
# Planes and scales of the features that training starts from: normal, depth, where nothing is seen, light nearby, albedo.
START = ((10, 3.0), (11, 3.0), (12, 3.0), (13, 4.0), (15, 4.0), (3, 1.5), (7, 1.5), (9, 1.5))
WIDTHS = {"in": 32, "1": 48, "2": 64, "3": 80, "4": 80}


def luminance(image):
    return sum(weight * image[:, c : c + 1] for c, weight in enumerate(LUMINANCE))


def shifted(padded, dy, dx, like, margin):
    height, width = like.shape[-2:]
    return padded[..., margin + dy : margin + dy + height, margin + dx : margin + dx + width]


def box(image):
    """Means over 3x3 pixels, clipped at the borders."""
    return functional.avg_pool2d(image, 3, 1, 1, count_include_pad=False)


class Unet(nn.Module):
    """Its layers are those of the exported file, by their names."""

    def __init__(self):
        super().__init__()
        w = WIDTHS
        conv = lambda inputs, outputs, kernel=3: nn.Conv2d(inputs, outputs, kernel, padding=kernel // 2)
        self.enc0a, self.enc0b = conv(4 * PLANES, w["in"]), conv(w["in"], w["in"])
        self.enc1, self.enc2, self.enc3 = conv(w["in"], w["1"]), conv(w["1"], w["2"]), conv(w["2"], w["3"])
        self.enc4a, self.enc4b = conv(w["3"], w["4"]), conv(w["4"], w["4"])
        self.dec3 = conv(w["4"] + w["3"], w["3"])
        self.dec2 = conv(w["3"] + w["2"], w["2"])
        self.dec1 = conv(w["2"] + w["1"], w["1"])
        self.dec0a, self.dec0b = conv(w["1"] + w["in"], 48), conv(48, 48)
        self.head = conv(48 + 4 * PLANES, OUTPUTS, 1)
        with torch.no_grad():
            self.head.weight *= 0.3
            self.start()

    def start(self):
        """A cross-bilateral filter to begin with: features that are those of the scene, straight from the planes."""
        self.head.weight[:, 48:] = 0
        self.head.bias.zero_()
        for k, (plane, scale) in enumerate(START[:FINE_FEATURES]):
            for pixel in range(4):
                self.head.weight[4 * k + pixel, 48 + 4 * plane + pixel] = scale
        # The brighter a pixel against its surroundings, the less it counts.
        own, far, weights = 1, 4, 4 * FINE_FEATURES
        self.head.bias[weights : weights + 4] = 2
        for pixel in range(4):
            self.head.weight[weights + pixel, 48 + 4 * own + pixel] = -2
            self.head.weight[weights + pixel, 48 + 4 * far + pixel] = 2
        for level in range(1, LEVELS):
            first = 4 * FINE_OUTPUTS + (level - 1) * COARSE_OUTPUTS
            for k, (plane, scale) in enumerate(START):
                self.head.weight[first + k, 48 + 4 * plane : 48 + 4 * plane + 4] = scale / 4

    def forward(self, planes):
        relu, pool = functional.relu, lambda t: functional.max_pool2d(t, 2)
        up = lambda t: functional.interpolate(t, scale_factor=2, mode="nearest")
        packed = functional.pixel_unshuffle(planes, 2)
        e0 = relu(self.enc0b(relu(self.enc0a(packed))))
        e1 = relu(self.enc1(pool(e0)))
        e2 = relu(self.enc2(pool(e1)))
        e3 = relu(self.enc3(pool(e2)))
        t = relu(self.enc4b(relu(self.enc4a(pool(e3)))))
        t = relu(self.dec3(torch.cat([up(t), e3], 1)))
        t = relu(self.dec2(torch.cat([up(t), e2], 1)))
        t = relu(self.dec1(torch.cat([up(t), e1], 1)))
        t = relu(self.dec0b(relu(self.dec0a(torch.cat([up(t), e0], 1)))))
        return self.head(torch.cat([t, packed], 1))

    def layers(self):
        """Those of the exported file, and the modules of those that have weights (network_file.py)."""
        out, modules = [], []

        def convolution(name, source, relu=True):
            module = getattr(self, name)
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


class KernelPrediction(nn.Module):
    def __init__(self):
        super().__init__()
        self.unet = Unet()
        # Of the tests, by level: how steeply weights fall beyond how much noise; first of neighbours, then of gates.
        self.steepness = nn.Parameter(torch.zeros(2, LEVELS))
        self.tolerance = nn.Parameter(torch.zeros(2, LEVELS))

    def tests(self):
        """Steepness at least 0.05 and tolerance between 1 and 7, in squared standard deviations: never switched off."""
        return 0.05 + functional.softplus(self.steepness - 0.5), 1 + 6 * torch.sigmoid(self.tolerance - 1)

    def constants(self):
        """The tests, as the exported file names them."""
        steepness, tolerance = (t.detach().tolist() for t in self.tests())
        rounded = lambda values: [round(v, 6) for v in values]
        return {"steepness": rounded(steepness[0]), "tolerance": rounded(tolerance[0]),
                "gateSteepness": rounded(steepness[1]), "gateTolerance": rounded(tolerance[1])}

    def take_constants(self, constants):
        """What constants() gave: the tests are those again."""
        both = lambda of, gates: torch.tensor([constants[of], constants[gates]], dtype=torch.float32)
        steepness = (both("steepness", "gateSteepness") - 0.05).clamp(min=1e-6)
        tolerance = ((both("tolerance", "gateTolerance") - 1) / 6).clamp(1e-6, 1 - 1e-6)
        with torch.no_grad():
            self.steepness.copy_(0.5 + torch.log(torch.expm1(steepness)))
            self.tolerance.copy_(1 + torch.logit(tolerance))

    def forward(self, planes, irradiance, variance):
        out = self.unet(planes)
        fine = functional.pixel_shuffle(out[:, : 4 * FINE_OUTPUTS], 2)
        levels = [fine[:, : FINE_FEATURES]]
        gates = [fine[:, FINE_FEATURES + 1 : FINE_FEATURES + 2]]
        weight = torch.sigmoid(torch.clamp(fine[:, FINE_FEATURES : FINE_FEATURES + 1], min=-12.0))
        for level in range(1, LEVELS):
            first = 4 * FINE_OUTPUTS + (level - 1) * COARSE_OUTPUTS
            part = out[:, first : first + COARSE_OUTPUTS]
            if level > 1:
                part = functional.avg_pool2d(part, 2 ** (level - 1))
            levels.append(part[:, :COARSE_FEATURES])
            gates.append(part[:, COARSE_FEATURES:])
        steepness, tolerance = self.tests()
        scales = pyramid(irradiance, variance, weight)
        filtered = [
            average(*scale, features, steepness[0, k], tolerance[0, k]) for k, (scale, features) in enumerate(zip(scales, levels))
        ]
        result = filtered[-1][0]
        for level in range(LEVELS - 2, -1, -1):
            image, mean, noise = filtered[level]
            coarse = upsampled(result, levels[level])
            z = (mean - luminance(coarse)) ** 2 / (noise + TINY)
            excess = torch.clamp(z - tolerance[1, level], 0, 1e4)
            gate = torch.sigmoid(gates[level]) * torch.exp(-steepness[1, level] * excess)
            result = image + gate * (coarse - image)
        return result


def pyramid(irradiance, variance, weight):
    """Of each level irradiance, variance of its luminance, and weight: means over 2x2 by the weights."""
    scales = [(irradiance, variance, weight)]
    for _ in range(LEVELS - 1):
        image, noise, w = scales[-1]
        sums = lambda t: functional.avg_pool2d(t, 2)
        mean = sums(w)
        scales.append((sums(w * image) / mean, sums(w * w * noise) / (4 * mean * mean), mean))
    return scales


def average(image, variance, weight, features, steepness, tolerance):
    """The filtered image; the mean luminance over 3x3 pixels and the variance of that."""
    bright = box(luminance(image)).detach()
    noise = box(variance).detach() / 9
    if kernels.LIBRARY:
        inputs = (image, weight, features, bright, noise, steepness, tolerance)
        return kernels.Average.apply(*inputs), bright, noise
    return average_by_tensors(image, weight, features, bright, noise, steepness, tolerance), bright, noise


def average_by_tensors(image, weight, features, bright, noise, steepness, tolerance):
    pad = lambda t: functional.pad(t, (RADIUS,) * 4)
    padded = [pad(t) for t in (image, weight, features, bright, noise)]
    total, values = 0, 0
    for dy in range(-RADIUS, RADIUS + 1):
        for dx in range(-RADIUS, RADIUS + 1):
            i, w, f, b, n = (shifted(t, dy, dx, image, RADIUS) for t in padded)
            z = (bright - b) ** 2 / (noise + n + TINY)
            distance = ((features - f) ** 2).sum(1, keepdim=True)
            w = w * torch.exp(-distance - steepness * torch.clamp(z - tolerance, 0, 1e4))
            total = total + w
            values = values + w * i
    return values / total


def upsampled(coarse, features):
    """Twice as wide and high: of the four nearest coarse pixels those of like features, each a mean over 2x2."""
    guide = functional.avg_pool2d(features, 2)
    pad = lambda t: functional.pad(t, (1, 1, 1, 1), mode="replicate")
    coarse_padded, guide_padded = pad(coarse), pad(guide)
    rows = []
    for a in (0, 1):
        columns = []
        for b in (0, 1):
            own = features[..., a::2, b::2]
            near = [(0, 0, 9 / 16), (2 * a - 1, 0, 3 / 16), (0, 2 * b - 1, 3 / 16), (2 * a - 1, 2 * b - 1, 1 / 16)]
            distances = [((own - shifted(guide_padded, y, x, guide, 1)) ** 2).sum(1, keepdim=True) for y, x, _ in near]
            least = torch.stack(distances).min(0)[0]
            weights = [t * torch.exp(least - d) for d, (_, _, t) in zip(distances, near)]
            values = sum(w * shifted(coarse_padded, y, x, guide, 1) for w, (y, x, _) in zip(weights, near))
            columns.append(values / sum(weights))
        rows.append(torch.stack(columns, -1).flatten(-2))
    return torch.stack(rows, -2).flatten(-3, -2)
