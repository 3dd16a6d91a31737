"""Procedural PNG textures. Colours are given sRGB-encoded, 0 to 1."""

import math
import random
import struct
import zlib


def png(width, height, pixel):
    """Encodes pixel(u, v) -> 3 or 4 channels; v runs down the image."""
    rows = bytearray()
    for y in range(height):
        line = [max(0, min(255, round(c * 255)))
                for x in range(width)
                for c in pixel((x + 0.5) / width, (y + 0.5) / height)]
        channels = len(line) // width
        # Filter 1 stores differences to the left neighbour: smaller files.
        rows.append(1)
        rows.extend((c - (line[i - channels] if i >= channels else 0)) & 255
                    for i, c in enumerate(line))

    def chunk(kind, data):
        return (struct.pack(">I", len(data)) + kind + data
                + struct.pack(">I", zlib.crc32(kind + data)))
    header = struct.pack(">IIBBBBB", width, height, 8,
                         {3: 2, 4: 6}[channels], 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
            + chunk(b"IDAT", zlib.compress(bytes(rows), 9))
            + chunk(b"IEND", b""))


class Noise:
    """Value noise on an nx by ny lattice that repeats over the unit square."""

    def __init__(self, nx, ny, seed):
        rng = random.Random(seed)
        self.nx, self.ny = nx, ny
        self.values = [[rng.random() for _ in range(nx)] for _ in range(ny)]

    def __call__(self, u, v):
        x, y = u * self.nx, v * self.ny
        i, j = math.floor(x), math.floor(y)
        fx, fy = x - i, y - j
        fx, fy = fx * fx * (3 - 2 * fx), fy * fy * (3 - 2 * fy)
        a, b = self.values[j % self.ny], self.values[(j + 1) % self.ny]
        i, k = i % self.nx, (i + 1) % self.nx
        top = a[i] + (a[k] - a[i]) * fx
        return top + (b[i] + (b[k] - b[i]) * fx - top) * fy


def mix(a, b, t):
    return tuple(x + (y - x) * t for x, y in zip(a, b))


def wood(planks=4, seed=1, light=(0.72, 0.52, 0.34), dark=(0.45, 0.29, 0.17)):
    """Planks along u with stretched grain; repeats in both directions."""
    rng = random.Random(seed)
    tones = [(rng.random(), rng.random()) for _ in range(planks)]
    grain, broad = Noise(4, 64, seed + 1), Noise(3, 12, seed + 2)

    def pixel(u, v):
        row = int(v * planks)
        tone, shift = tones[row]
        u = (u + shift) % 1.0
        t = 0.45 * grain(u, v) + 0.35 * broad(u, v) + 0.3 * tone
        # A dark gap along the plank and at its one butt joint.
        gap = min(v * planks - row, row + 1 - v * planks) < 0.025
        shade = 0.35 if gap or u < 0.006 else 1.0
        return tuple(round(c * shade * 64) / 64 for c in mix(light, dark, t))
    return png(256, 256, pixel)


def _brick(u, v):
    """(distance into the brick from its mortar, brick number)."""
    columns, rows = 4, 8
    row = int(v * rows)
    x = (u * columns + 0.5 * (row % 2)) % columns
    column = int(x)
    edge_x = min(x - column, column + 1 - x) / columns
    edge_y = min(v * rows - row, row + 1 - v * rows) / rows
    return min(edge_x, edge_y), row * columns + column


def brick_color(seed=3):
    rng = random.Random(seed)
    tones = [rng.random() for _ in range(32)]
    rough = Noise(32, 32, seed)

    def pixel(u, v):
        depth, number = _brick(u, v)
        if depth < 0.008:
            return mix((0.70, 0.68, 0.64), (0.60, 0.58, 0.55), rough(u, v))
        return mix(mix((0.66, 0.36, 0.27), (0.50, 0.25, 0.20),
                       tones[number]), (0.4, 0.2, 0.17), 0.5 * rough(u, v))
    return png(128, 128, pixel)


def brick_normal(seed=3):
    rough = Noise(32, 32, seed)

    def height(u, v):
        depth, _ = _brick(u % 1.0, v % 1.0)
        return 0.012 * min(depth / 0.02, 1.0) + 0.004 * rough(u, v)

    def pixel(u, v):
        h = 1 / 256
        dx = (height(u + h, v) - height(u - h, v)) / (2 * h)
        # Image rows run down while the tangent frame's y runs up.
        dy = (height(u, v - h) - height(u, v + h)) / (2 * h)
        n = math.sqrt(dx * dx + dy * dy + 1)
        return (0.5 - 0.5 * dx / n, 0.5 - 0.5 * dy / n, 0.5 + 0.5 / n)
    return png(128, 128, pixel)


def wallpaper():
    def pixel(u, v):
        stripe = (u * 4) % 1.0 < 0.5
        base = (0.86, 0.84, 0.76) if stripe else (0.80, 0.78, 0.69)
        x, y = (u * 4) % 1.0 - 0.25, (v * 4) % 1.0 - 0.5
        flower = math.hypot(x, y) < 0.12 * (1 + 0.4 * math.cos(
            5 * math.atan2(y, x)))
        return (0.55, 0.62, 0.60) if flower else base
    return png(128, 128, pixel)


def tiles(count=8, seed=5, color=(0.35, 0.66, 0.74), grout=(0.85, 0.86, 0.84)):
    rng = random.Random(seed)
    tones = [[rng.uniform(0.8, 1.15) for _ in range(count)]
             for _ in range(count)]

    def pixel(u, v):
        x, y = u * count, v * count
        i, j = int(x), int(y)
        if min(x - i, y - j, i + 1 - x, j + 1 - y) < 0.05:
            return grout
        return tuple(c * tones[j][i] for c in color)
    return png(128, 128, pixel)


def picture():
    """An invented landscape for the picture frame."""
    ridge = Noise(6, 1, 8)

    def pixel(u, v):
        hill = 0.55 + 0.25 * (ridge(u, 0) - 0.5)
        if math.hypot(u - 0.68, v - 0.28) < 0.09:
            return (0.98, 0.86, 0.5)
        if v < hill:
            return mix((0.35, 0.5, 0.75), (0.95, 0.75, 0.6), v / hill)
        return mix((0.25, 0.42, 0.3), (0.55, 0.55, 0.25),
                   (v - hill) / (1 - hill))
    return png(96, 64, pixel)


def leaf():
    """A pointed leaf with a stalk; alpha cuts out its outline."""
    def pixel(u, v):
        x, t = abs(u - 0.5), 1 - v
        width = 0.42 * math.sin(math.pi * min(1, max(0, (t - .12) / .86))
                                ** 0.8) ** 0.8 if 0.12 < t < 0.98 else 0.0
        inside = x < width or (x < 0.025 and t < 0.2)
        vein = x < 0.015 or abs((t * 9 - x * 6) % 1.0) < 0.12
        color = mix((0.24, 0.47, 0.14), (0.42, 0.62, 0.22),
                    0.8 if vein else 0.35 * t)
        return (*color, 1.0 if inside else 0.0)
    return png(64, 64, pixel)


def grass(seed=11):
    fine, broad = Noise(64, 64, seed), Noise(6, 6, seed + 1)

    def pixel(u, v):
        t = 0.6 * fine(u, v) + 0.4 * broad(u, v)
        return tuple(round(c * 48) / 48 for c in mix(
            (0.30, 0.38, 0.18), (0.48, 0.46, 0.27), t))
    return png(128, 128, pixel)


def sky():
    """Radiance by elevation for a dome: zenith at the top, ground below."""
    def pixel(u, v):
        up = math.cos(math.pi * v)
        if up < 0:
            return mix((0.42, 0.40, 0.37), (0.25, 0.24, 0.22), -up)
        return mix((0.95, 0.95, 0.95), (0.45, 0.62, 0.92), up ** 0.45)
    return png(4, 256, pixel)


def glow():
    """Checks of four colours for an emissive texture."""
    def pixel(u, v):
        i, j = int(u * 12), int(v * 6)
        return [(1.0, 0.35, 0.1), (0.05, 0.05, 0.05), (0.1, 0.6, 1.0),
                (0.05, 0.05, 0.05)][(i + 2 * (j % 2)) % 4]
    return png(96, 48, pixel)


def metal_rough_checks():
    """Green is roughness, blue is metalness (linear values)."""
    def pixel(u, v):
        odd = (int(u * 12) + int(v * 6)) % 2
        return (0.0, 0.15 if odd else 0.6, 1.0 if odd else 0.0)
    return png(96, 48, pixel)
