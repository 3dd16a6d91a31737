# SPDX-License-Identifier: Apache-2.0
"""Environments as latitude-longitude images of radiance, and a writer of Radiance .hdr files."""

import math

import numpy as np

from . import textures
from .lamps import lamp_color


def write_hdr(path, image):
    """Radiance RGBE, flat pixels: any reader takes it, and no library is needed to write it."""
    height, width, _ = image.shape
    largest = np.maximum(image.max(axis=2), 1e-30)
    exponent = np.ceil(np.log2(largest * 256 / 255.4)).astype(int)
    scaled = image * np.exp2(8.0 - exponent)[..., None]
    pixels = np.zeros((height, width, 4), np.uint8)
    pixels[..., :3] = np.clip(np.rint(scaled), 0, 255)
    pixels[..., 3] = np.clip(exponent + 128, 0, 255)
    pixels[largest < 1e-20] = 0
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n"
    path.write_bytes(header.encode() + pixels.tobytes())


def _directions(height):
    """Unit vectors of pixels: the centre looks to +X, what is right of it to +Z."""
    theta = (np.arange(height) + 0.5) / height * math.pi
    phi = ((np.arange(2 * height) + 0.5) / (2 * height) - 0.5) * 2 * math.pi
    phi, theta = np.meshgrid(phi, theta)
    return np.stack([np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], axis=-1)


def _add_sun(image, d, towards, degrees, irradiance, color):
    """A disc of constant radiance; one pixel at least."""
    cosine = d @ towards
    inside = cosine > math.cos(math.radians(degrees / 2))
    if not inside.any():
        inside = cosine == cosine.max()
    solid = np.sqrt(1 - d[..., 1] ** 2) * (math.pi / image.shape[0]) ** 2
    image[inside] = irradiance / solid[inside].sum() * color


def daylight(rng, sun=True, azimuth=None):
    """A sky from clear to overcast, perhaps with a sun of half to eight degrees, whose azimuth may be given."""
    degrees = float(rng.choice([0.5, 1, 2, 4, 8]))
    d = _directions(512 if sun and degrees < 2 else 256)
    up = d[..., 1]
    zenith, horizon, ground = (textures.linear(c) for c in (
        np.array([0.35, 0.5, 0.85]) * rng.uniform(0.3, 1) + rng.normal(0, 0.05, 3), np.array([0.85, 0.88, 0.92])
        + rng.normal(0, 0.08, 3), textures.color(rng, value=(0.15, 0.5), saturation=(0, 0.4))))
    t = np.clip(up, 0, 1)[..., None] ** rng.uniform(0.25, 0.7)
    image = np.where(up[..., None] >= 0, np.maximum(horizon, 0.01) * (1 - t) + np.maximum(zenith, 0.01) * t,
                     ground * 0.5)
    elevation = math.radians(rng.uniform(8, 75 if azimuth is None else 50))
    azimuth = rng.uniform(0, 2 * math.pi) if azimuth is None else azimuth
    towards = np.array([math.cos(elevation) * math.cos(azimuth), math.sin(elevation),
                        math.cos(elevation) * math.sin(azimuth)])
    if rng.uniform() < 0.4:
        clouds = textures.fractal(rng, image.shape[0], 4, 5)
        clouds = np.concatenate([clouds, clouds], axis=1)[..., None]
        cover = np.clip((clouds - rng.uniform(0.35, 0.6)) * 4, 0, 1) * np.clip(up * 4, 0, 1)[..., None]
        image = image * (1 - cover) + rng.uniform(0.6, 2.0) * cover
    if not sun:
        return image
    glow = np.clip(d @ towards, 0, 1)[..., None] ** rng.uniform(8, 60)
    color = lamp_color(rng, 0) if elevation > 0.4 else np.array([1.5, 0.95, 0.5])
    image = image + glow * color * rng.uniform(0, 1.5)
    _add_sun(image, d, towards, degrees, rng.uniform(1, 12), color)
    return image


def softboxes(rng):
    """Bright rectangles and discs on a dim ground, as in a photographer's studio."""
    d = _directions(128)
    image = np.ones_like(d) * rng.uniform(0.0, 0.3) * textures.linear(textures.color(rng, saturation=(0, 0.4)))
    for _ in range(int(rng.integers(1, 6))):
        towards = rng.normal(size=3)
        towards[1] = abs(towards[1])
        towards /= np.linalg.norm(towards)
        right = np.cross(towards, (0.1, 1, 0.05))
        right /= np.linalg.norm(right)
        front = d @ towards
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = (d @ right) / front, (d @ np.cross(right, towards)) / front
        w, h = rng.uniform(0.05, 0.7, 2)
        inside = (front > 0) & ((np.abs(x) < w) & (np.abs(y) < h) if rng.uniform() < 0.7 else np.hypot(x, y) < w)
        image[inside] = lamp_color(rng, 0.25) * rng.uniform(0.5, 6) / (w * h + 0.05) * 0.3
    return image


def lights_at_night(rng):
    """A dark horizon full of small coloured lights."""
    d = _directions(128)
    image = np.ones_like(d) * rng.uniform(0.005, 0.1)
    for _ in range(int(rng.integers(5, 60))):
        y, x = int(rng.normal(60, 10)) % 128, int(rng.integers(256))
        s = int(rng.choice([1, 1, 2, 4]))
        image[y:y + s, x:x + s] = lamp_color(rng, 0.6) * rng.uniform(2, 80)
    return image


def blobs(rng):
    """Broad soft colours, as of a room seen out of focus."""
    image = np.stack([textures.fractal(rng, 128, 2, 3) for _ in range(3)], axis=-1)
    image = np.concatenate([image, image[:, ::-1]], axis=1)
    return np.exp((image - 0.5) * rng.uniform(2, 10)) * rng.uniform(0.2, 1)
