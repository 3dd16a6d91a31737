# SPDX-License-Identifier: Apache-2.0
"""Procedural textures as arrays (rows, columns, channels) of sRGB-encoded values from 0 to 1; all of them repeat.

Denoisers must tell texture from noise, so there are patterns at every scale, down to single texels.
"""

import colorsys
import math
import struct
import zlib

import numpy as np


def png(image):
    """Encodes 3 or 4 channels of 8 bits."""
    pixels = np.clip(np.rint(image * 255), 0, 255).astype(np.uint8)
    height, width, channels = pixels.shape
    # Filter 1 stores differences to the left neighbour: smaller files.
    rows = pixels.copy()
    rows[:, 1:] -= pixels[:, :-1]
    lines = np.ones((height, 1 + width * channels), np.uint8)
    lines[:, 1:] = rows.reshape(height, -1)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", width, height, 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(lines.tobytes(), 6))
            + chunk(b"IEND", b""))


def color(rng, value=(0.1, 0.95), saturation=(0.0, 0.8)):
    """An sRGB-encoded colour, greys and strong colours both often."""
    s = rng.uniform(*saturation) * rng.choice([0.15, 0.6, 1.0])
    return np.array(colorsys.hsv_to_rgb(rng.uniform(), s, rng.uniform(*value)))


def linear(srgb):
    srgb = np.asarray(srgb, float)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def noise(rng, size, cells_x, cells_y):
    """Smooth value noise on a lattice that repeats, 0 to 1."""
    values = rng.uniform(size=(cells_y, cells_x))

    def weights(count):
        x = (np.arange(size) + 0.5) / size * count
        i = x.astype(int)
        f = x - i
        return i % count, (i + 1) % count, f * f * (3 - 2 * f)
    i, j, fx = weights(cells_x)
    k, m, fy = weights(cells_y)
    fy = fy[:, None]
    top = values[k][:, i] * (1 - fx) + values[k][:, j] * fx
    low = values[m][:, i] * (1 - fx) + values[m][:, j] * fx
    return top * (1 - fy) + low * fy


def fractal(rng, size=128, first=3, octaves=4, stretch=1):
    total, weight = np.zeros((size, size)), 0.0
    for k in range(octaves):
        cells = min(first << k, size // 2)
        total += noise(rng, size, cells, max(1, cells // stretch)) * 0.5 ** k
        weight += 0.5 ** k
    return total / weight


def blend(a, b, t):
    return a + (b - a) * np.asarray(t)[..., None]


def _coordinates(size):
    x = (np.arange(size) + 0.5) / size
    return np.meshgrid(x, x)


def _two(rng, contrast=0.0):
    """Two colours; a contrast of 1 makes them nearly black and white."""
    a, b = color(rng), color(rng)
    if rng.uniform() < contrast:
        a, b = a * 0.15, 1 - (1 - b) * 0.25
    return a, b


def mottled(rng):
    a, b = _two(rng)
    t = fractal(rng, 128, int(rng.integers(2, 24)), int(rng.integers(1, 5)))
    return blend(a, b, np.clip((t - 0.5) * rng.uniform(0.6, 3) + 0.5, 0, 1))


def speckle(rng):
    """Independent texels: what looks most like the noise of samples."""
    a, b = _two(rng)
    t = rng.uniform(size=(96, 96)) ** rng.uniform(0.5, 6)
    return np.rint(blend(a, b, t) * 24) / 24


def checks(rng):
    a, b = _two(rng, 0.5)
    n = int(rng.choice([2, 4, 8, 16, 32]))
    u, v = _coordinates(128)
    return blend(a, b, ((u * n).astype(int) + (v * n).astype(int)) % 2)


def stripes(rng):
    a, b = _two(rng, 0.5)
    n, angle = int(rng.choice([2, 4, 8, 16, 32])), rng.integers(0, 4)
    u, v = _coordinates(128)
    t = (([u, v, u + v, u - v][angle] * n) % 1.0) < rng.uniform(0.15, 0.6)
    return blend(a, b, t)


def bricks(rng, ratio=None):
    """Bricks, tiles or planks, by their rows and columns."""
    rows = int(rng.choice([2, 4, 8, 12]))
    columns = max(1, int(rows / (ratio or rng.choice([1, 2, 2.5, 4]))))
    a, b = _two(rng)
    joint = color(rng)
    u, v = _coordinates(192)
    row = (v * rows).astype(int)
    shift = rng.choice([0.0, 0.5]) * (row % 2)
    x = (u * columns + shift) % columns
    column = x.astype(int) % columns
    edge = np.minimum(np.minimum(x % 1, 1 - x % 1) / columns, np.minimum(v * rows % 1, 1 - v * rows % 1) / rows)
    tone = rng.uniform(size=(rows, columns))[row % rows, column]
    shade = 0.7 * tone + 0.3 * fractal(rng, 192, 8, 3)
    image = blend(a, b, shade * rng.uniform(0.2, 1))
    gap = np.clip(edge / rng.uniform(0.004, 0.015), 0, 1) > 0.5
    return np.where(gap[..., None], image, joint), np.clip(edge / 0.02, 0, 1)


def wood(rng):
    hue = rng.uniform(0.04, 0.11)
    a = np.array(colorsys.hsv_to_rgb(hue, rng.uniform(0.3, 0.65), rng.uniform(0.3, 0.85)))
    grain = fractal(rng, 192, 24, 3, stretch=12).T
    rings = np.sin(2 * math.pi * (rng.integers(2, 7) * _coordinates(192)[1] + 2 * fractal(rng, 192, 2, 2)))
    image = blend(a * rng.uniform(0.35, 0.75), a, 0.7 * grain + 0.15 * (rings + 1))
    if rng.uniform() < 0.6:
        planks = int(rng.integers(3, 9))
        v = _coordinates(192)[1] * planks
        image = image * rng.uniform(0.75, 1, planks)[v.astype(int)][..., None]
        image = np.where((np.minimum(v % 1, 1 - v % 1) < 0.03)[..., None], image * 0.4, image)
    return image


def marble(rng):
    a, b = _two(rng)
    t = fractal(rng, 192, 3, 5)
    veins = np.abs(np.sin(2 * math.pi * (_coordinates(192)[0] * rng.integers(1, 4) + t * rng.uniform(1, 4))))
    return blend(b, a, veins ** rng.uniform(0.2, 1))


def words(rng):
    """Rows of small random glyphs: the finest detail that must survive."""
    size, (paper, ink) = 256, _two(rng, 0.8)
    image = np.zeros((size, size))
    line, cell = int(rng.choice([8, 12, 16])), int(rng.choice([4, 5, 7]))
    glyphs = rng.uniform(size=(24, line - 4, cell - 1)) < 0.5
    for y in range(2, size - line, line):
        x = 4
        while x < size - 8 * cell:
            for _ in range(int(rng.integers(1, 9))):
                if x + cell < size - 4:
                    image[y:y + line - 4, x:x + cell - 1] = glyphs[rng.integers(24)]
                    x += cell
            x += cell
            if rng.uniform() < 0.04:
                break
    return blend(paper, ink, image)


def dots(rng):
    a, b = _two(rng, 0.3)
    n, r = int(rng.choice([3, 6, 12, 24])), rng.uniform(0.1, 0.45)
    u, v = _coordinates(144)
    return blend(a, b, np.hypot(u * n % 1 - 0.5, v * n % 1 - 0.5) < r)


def weave(rng):
    a, b = _two(rng)
    n = int(rng.choice([8, 16, 32]))
    u, v = _coordinates(160)
    over = ((u * n).astype(int) + (v * n).astype(int)) % 2
    t = np.where(over, np.sin(math.pi * (u * n % 1)), np.sin(math.pi * (v * n % 1)))
    return blend(a, b, over * 0.6 + 0.2) * (0.6 + 0.4 * t[..., None])


def gradient(rng):
    a, b = _two(rng)
    u, v = _coordinates(96)
    turn = rng.uniform(0, 2 * math.pi)
    return blend(a, b, 0.5 + 0.5 * np.cos(2 * math.pi * u + turn) * np.cos(2 * math.pi * v))


def picture(rng):
    """An invented painting: hills, sun and shapes under a brush's noise."""
    u, v = _coordinates(128)
    image = blend(color(rng), color(rng), v)
    for _ in range(int(rng.integers(2, 9))):
        c, x, y, r = color(rng), rng.uniform(), rng.uniform(), rng.uniform(0.03, 0.35)
        kind = rng.integers(3)
        inside = [np.hypot(u - x, v - y) < r, (np.abs(u - x) < r) & (np.abs(v - y) < r * 0.7),
                  v > y + 0.3 * (fractal(rng, 128, 3, 3) - 0.5)][kind]
        image = np.where(inside[..., None], c, image)
    return np.clip(image + rng.uniform(0, 0.15) * (fractal(rng, 128, 20, 2) - 0.5)[..., None], 0, 1)


def cells(rng):
    """Cobbles, scales, cracked earth: the nearest of random points."""
    n = int(rng.choice([12, 40, 150]))
    points, tone = rng.uniform(size=(n, 2)), rng.uniform(size=n)
    u, v = _coordinates(112)
    d = np.abs(np.stack([u, v], -1)[:, :, None] - points)
    d = np.minimum(d, 1 - d)
    d = np.hypot(d[..., 0], d[..., 1])
    nearest = np.argmin(d, axis=2)
    two = np.partition(d, 1, axis=2)
    a, b = _two(rng)
    image = blend(a, b, tone[nearest] * rng.uniform(0.3, 1))
    return np.where(((two[..., 1] - two[..., 0]) * math.sqrt(n) < rng.uniform(0, 0.25))[..., None], image * 0.4, image)


def plaid(rng):
    u, v = _coordinates(128)
    image = np.ones((128, 128, 3)) * color(rng)
    for _ in range(int(rng.integers(3, 8))):
        c, at, width, axis = color(rng), rng.uniform(), rng.uniform(0.01, 0.2), rng.integers(2)
        image = np.where((np.abs([u, v][axis] - at) < width / 2)[..., None], image * 0.4 + 0.6 * c, image)
    return image


def camouflage(rng):
    """Sharp-edged patches of a few colours."""
    t = fractal(rng, 160, int(rng.integers(2, 9)), 3)
    palette = np.stack([color(rng) for _ in range(int(rng.integers(2, 6)))])
    levels = np.quantile(t, np.linspace(0, 1, len(palette) + 1)[1:-1])
    return palette[np.digitize(t, levels)]


def hairlines(rng):
    """Lines one texel wide on a plain ground: graph paper, cracks, scratches."""
    a, b = _two(rng, 0.6)
    t = np.zeros((160, 160))
    if rng.uniform() < 0.5:
        step = int(rng.choice([5, 8, 16, 32]))
        t[::step] = 1
        t[:, ::step] = 1
    else:
        for _ in range(int(rng.integers(5, 40))):
            p, q = rng.uniform(0, 160, 2), rng.normal(0, 60, 2)
            line = (p + np.linspace(0, 1, 240)[:, None] * q).astype(int) % 160
            t[line[:, 0], line[:, 1]] = 1
    return blend(a, b, t)


def holes(rng):
    """A sheet with holes, or threads with gaps: alpha cuts them out."""
    u, v = _coordinates(96)
    n = int(rng.choice([4, 6, 8, 12]))
    x, y = u * n % 1 - 0.5, v * n % 1 - 0.5
    solid = [np.hypot(x, y) > rng.uniform(0.25, 0.45), np.maximum(np.abs(x), np.abs(y)) > rng.uniform(0.25, 0.42),
             np.abs(x) > rng.uniform(0.15, 0.35), fractal(rng, 96, 5, 2) > rng.uniform(0.42, 0.52)][rng.integers(4)]
    return np.concatenate([np.ones((96, 96, 3)) * color(rng), solid[..., None]], axis=2)


def leaf(rng):
    """A pointed leaf with veins; alpha cuts out its outline."""
    u, v = _coordinates(64)
    x, t = np.abs(u - 0.5), 1 - v
    width = 0.42 * np.sin(math.pi * np.clip((t - 0.05) / 0.93, 0, 1) ** rng.uniform(0.6, 1.1)) ** 0.9
    a = np.array(colorsys.hsv_to_rgb(rng.uniform(0.08, 0.36), rng.uniform(0.4, 0.9), rng.uniform(0.25, 0.7)))
    vein = (x < 0.02) | ((t * 9 - x * 6) % 1.0 < 0.15)
    image = blend(a * 0.8, np.minimum(a * 1.4, 1), vein)
    return np.concatenate([image, (x < width)[..., None]], axis=2)


def normals(height, strength):
    """A tangent-space normal map; rows of the image run down while the tangent frame's y runs up."""
    dx = (np.roll(height, -1, 1) - np.roll(height, 1, 1)) * strength
    dy = (np.roll(height, 1, 0) - np.roll(height, -1, 0)) * strength
    n = np.stack([-dx, -dy, np.ones_like(dx)], axis=-1)
    return 0.5 + 0.5 * n / np.linalg.norm(n, axis=-1, keepdims=True)


PATTERNS = (mottled, speckle, checks, stripes, wood, marble, words, dots, weave, gradient, cells, plaid, camouflage,
            hairlines)


def pattern(rng):
    """Any colour texture."""
    k = rng.integers(len(PATTERNS) + 2)
    return PATTERNS[k](rng) if k < len(PATTERNS) else bricks(rng)[0]
