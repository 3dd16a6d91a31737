# SPDX-License-Identifier: Apache-2.0
"""Studios: things on a table or backdrop, lit by lamps and softboxes; every material from mirror to matte."""

import math

import numpy as np

from . import furniture, lamps, skies
from .meshes import box, grid, quad, rotate, scale, slab, sphere, translate


def _backdrop(stage, size):
    """A floor that bends up into a wall, or a floor alone."""
    rng, mats = stage.rng, stage.materials
    if rng.uniform() < 0.6:
        t = np.linspace(0, math.pi / 2, 10)
        z = np.concatenate([[size], -size / 2 - 0.5 * np.sin(t), [-size / 2 - 0.5]])
        y = np.concatenate([[0], 0.5 - 0.5 * np.cos(t), [size]])
        x = np.array([-1.5 * size, 1.5 * size])
        points = np.stack([x + 0 * z[:, None], y[:, None] + 0 * x, z[:, None] + 0 * x], -1)
        stage.add(grid(points), mats.plain() if rng.uniform() < 0.7 else mats.any(), solid=False)
    else:
        stage.add(quad((-3 * size, 0, 3 * size), (6 * size, 0, 0), (0, 0, -6 * size)),
                  mats.plain() if rng.uniform() < 0.7 else mats.any(), shell=True)


def _softbox(stage, size, flux):
    """A bright rectangle that faces the middle, with a black back."""
    rng = stage.rng
    azimuth, elevation = rng.uniform(0, 360), rng.uniform(15, 80)
    w, h = np.exp(rng.uniform(np.log(0.03), np.log(0.9), 2)) * size
    place = translate(0, 0.2, 0) @ rotate(1, azimuth) @ rotate(0, -elevation)
    place = place @ translate(0, 0, size * rng.uniform(1.1, 1.8))
    front = quad((w / 2, -h / 2, 0), (-w, 0, 0), (0, h, 0)).moved(place)
    stage.emit(front, flux, lamps.lamp_color(rng, 0.25), solid=False)
    stage.add(box((-w / 2 - 0.01, -h / 2 - 0.01, 0.002), (w / 2 + 0.01, h / 2 + 0.01, 0.03)).moved(place),
              stage.materials.matte(value=(0.02, 0.1)), solid=False)


def _lights(stage, size):
    rng = stage.rng
    flux = size * size * math.exp(rng.uniform(0.5, 2.5))
    k = rng.uniform()
    if k < 0.35:
        stage.environment = skies.softboxes(rng) if rng.uniform() < 0.7 else skies.blobs(rng)
        stage.options += ["--env-scale", f"{math.exp(rng.uniform(0, 2)):.3f}"]
    elif k < 0.5:
        stage.environment = (skies.lights_at_night(rng) if rng.uniform() < 0.5 else
                             skies.daylight(rng, rng.uniform() < 0.5))
    if k > 0.35 or rng.uniform() < 0.3:
        for _ in range(int(rng.choice([1, 2, 3, 5]))):
            _softbox(stage, size, flux * rng.uniform(0.2, 1))
    if rng.uniform() < 0.25:
        room = ((-size, 0, -size * 0.5), (size, size * 1.3, size))
        (lamps.bulbs if rng.uniform() < 0.5 else lamps.points)(stage, room, flux)


def _rows(stage, size):
    """Equal bodies whose roughness or colour changes along a row."""
    rng, scene = stage.rng, stage.scene
    n, r = int(rng.integers(3, 8)), rng.uniform(0.1, 0.2)
    kind = rng.integers(4)
    base, metal = stage.materials.color(), float(rng.integers(2))
    for k in range(n):
        t = k / max(n - 1, 1)
        rough = 0.02 + 0.98 * t ** 1.5
        if kind == 3:
            material = scene.glass("glass", 1.5, roughness=0.5 * t)
        else:
            options = {} if kind else {"KHR_materials_clearcoat": {"clearcoatFactor": 1.0,
                                                                   "clearcoatRoughnessFactor": 0.3 * t}}
            material = scene.material("row", base, metallic=metal, roughness=0.5 if not kind else rough, **options)
        body = sphere(r, 48, 32) if rng.uniform() < 0.9 else slab(r, r * 2, r).at(0, -r, 0)
        stage.add(body.at((k - (n - 1) / 2) * r * 2.3, r, rng.uniform(-0.3, 0.3)), (material, 1.0))
    return [(0, r, 0)]


def _plates(stage, size):
    """Tilted glossy plates that mirror lamps of different sizes; each plate shows every lamp more or less blurred."""
    rng = stage.rng
    n = int(rng.integers(2, 6))
    for k in range(n):
        roughness = float(np.exp(rng.uniform(np.log(0.02), np.log(0.6))))
        material = stage.materials.metal(roughness) if rng.uniform() < 0.6 else stage.materials.plastic(roughness)
        place = translate(rng.uniform(-0.3, 0.3), 0.02 + k * 0.25, -0.35 * k) @ rotate(1, rng.normal(0, 12)) @ rotate(
            0, rng.uniform(10, 60))
        stage.add(slab(rng.uniform(0.8, 1.8), 0.02, rng.uniform(0.2, 0.4)).moved(place), material)
    for _ in range(int(rng.integers(2, 6))):
        r = float(np.exp(rng.uniform(np.log(0.01), np.log(0.25))))
        stage.emit(sphere(r, 24, 16).at(rng.uniform(-1, 1), rng.uniform(1.2, 2), rng.uniform(-1.5, 0.3)),
                   rng.uniform(2, 9),
                   lamps.lamp_color(rng, 0.6))
    return [(0, 0.3, -0.3)]


def _still_life(stage, size):
    """Vases, bowls, rings, crystals and such, close together."""
    rng, spots = stage.rng, []
    n = int(rng.integers(4, 14))
    for _ in range(n * 3):
        spot = rng.uniform(-0.45, 0.45, 2) * math.sqrt(n) * 0.35
        if all(np.hypot(*(spot - s)) > 0.24 for s in spots) and len(spots) < n:
            spots.append(spot)
    for x, z in spots:
        place = translate(x, 0, z) @ rotate(1, rng.uniform(0, 360)) @ scale(rng.uniform(0.7, 1.6))
        furniture.SMALL[rng.integers(len(furniture.SMALL))](stage, place)
    return [(x, 0.1, z) for x, z in spots]


def _piece(stage, size):
    """One or two pieces of furniture as in a catalogue."""
    rng = stage.rng
    kinds = rng.permutation(len(furniture.FURNITURE))[:rng.integers(1, 3)]
    for k, kind in enumerate(kinds):
        place = translate(1.7 * (k - (len(kinds) - 1) / 2), 0, 0) @ rotate(1, rng.uniform(-50, 50))
        top = furniture.FURNITURE[kind](stage, place)
        if top is not None:
            furniture.SMALL[rng.integers(len(furniture.SMALL))](stage, place @ translate(0, top[0], 0))
    return [(1.7 * (k - (len(kinds) - 1) / 2), 0.4, 0) for k in range(len(kinds))]


def build(stage):
    rng = stage.rng
    kind = [_rows, _plates, _still_life, _still_life, _piece][rng.integers(5)]
    size = {_still_life: 1.4, _rows: 1.6, _plates: 1.8, _piece: 2.6}[kind]
    _backdrop(stage, size)
    focus = kind(stage, size)
    _lights(stage, size)

    def propose():
        target = np.array(focus[rng.integers(len(focus))], float) + rng.normal(0, 0.08, 3) * size
        azimuth = rng.normal(0, 35 if rng.uniform() < 0.8 else 80)
        place = rotate(1, azimuth) @ rotate(0, -rng.uniform(3, 50))
        eye = target + place[:3, 2] * size * rng.uniform(0.5, 1.4)
        eye[1] = max(eye[1], 0.36)
        return eye, target
    return propose
