# SPDX-License-Identifier: Apache-2.0
"""Lamps of rooms, from large panels to single diodes. Each function takes the stage, a room (its bounds) and the flux
that it is to give off; `room` is ((x0, y0, z0), (x1, y1, z1))."""

import colorsys
import math

import numpy as np

from . import textures
from .meshes import box, creased, lathe, merged, quad, rod, rotate, slab, sphere, torus, translate, tubes


def lamp_color(rng, colorful=0.2):
    """Warm to cold white, sometimes a strong colour; of mean 1."""
    if rng.uniform() < colorful:
        c = np.array(colorsys.hsv_to_rgb(rng.uniform(), rng.uniform(0.4, 1.0), 1.0))
    else:
        warm = rng.uniform(-0.5, 0.6)
        c = np.array([1 + 0.5 * warm, 1.0, 1 - 0.7 * warm])
    return c / c.mean()


def _spot(rng, room, margin=0.4):
    (x0, _, z0), (x1, _, z1) = room
    m = min(margin, (x1 - x0) * 0.3, (z1 - z0) * 0.3)
    return rng.uniform(x0 + m, x1 - m), rng.uniform(z0 + m, z1 - m)


def panels(stage, room, flux):
    rng, top = stage.rng, room[1][1]
    n = int(rng.choice([1, 1, 2, 4, 6]))
    w, d = np.exp(rng.uniform(np.log(0.08), np.log(1.4), 2))
    color = lamp_color(rng, 0.1)
    for _ in range(n):
        x, z = _spot(rng, room, 0.8)
        stage.emit(quad((x - w / 2, top - 0.03, z - d / 2), (w, 0, 0), (0, 0, d)), flux / n, color, solid=False)
        stage.add(box((x - w / 2 - 0.01, top - 0.028, z - d / 2 - 0.01),
                      (x + w / 2 + 0.01, top - 0.001, z + d / 2 + .01)),
                  stage.materials.plastic())


def bulbs(stage, room, flux):
    """Bare bulbs on wires, in view."""
    rng, top = stage.rng, room[1][1]
    n = int(rng.choice([1, 1, 1, 2, 3, 5]))
    r = float(np.exp(rng.uniform(np.log(0.008), np.log(0.2))))
    for _ in range(n):
        x, z = _spot(rng, room)
        y = rng.uniform(max(1.2, top - 1.3), top - r - 0.1)
        stage.emit(sphere(r, 20, 12).at(x, y, z), flux / n, lamp_color(rng))
        stage.add(rod((x, y + r, z), (x, top, z), 0.004, 5), stage.materials.matte(), solid=False)


def shades(stage, room, flux):
    """A bulb in a shade that hangs or stands; the shade is thin cloth or blocks the light."""
    rng, top = stage.rng, room[1][1]
    r0, r1, h = rng.uniform(0.06, 0.2), rng.uniform(0.12, 0.3), rng.uniform(0.15, 0.35)
    x, z = _spot(rng, room)
    hangs = rng.uniform() < 0.5
    y = rng.uniform(1.5, top - h - 0.1) if hangs and top > 2.1 else rng.uniform(0.7, 1.5)
    shade = lathe([(r1, 0), (r0, h)], 36)
    stage.add(shade.at(x, y, z), stage.materials.thin() if rng.uniform() < 0.6 else stage.materials.any())
    stage.emit(sphere(rng.uniform(0.02, min(0.05, r0)), 16, 10).at(x, y + h * 0.45, z), flux, lamp_color(rng, 0.08))
    if hangs:
        stage.add(rod((x, y + h, z), (x, top, z), 0.005, 5), stage.materials.matte(), solid=False)
    else:
        foot = creased([(0, 0), (0.14, 0), (0.14, 0.02), (0.012, 0.025), (0.012, y + h * 0.35), (0, y + h * 0.36)], 24)
        stage.add(foot.at(x, 0, z), stage.materials.metal())


def uplights(stage, room, flux):
    """Lamps in opaque bowls, that shine at the ceiling: nearly all light in the room is indirect."""
    rng = stage.rng
    for _ in range(int(rng.choice([1, 1, 2]))):
        x, z = _spot(rng, room)
        y = rng.uniform(1.3, max(1.4, min(1.9, room[1][1] - 0.6)))
        r = rng.uniform(0.08, 0.22)
        stage.add(lathe([(0.02, 0), (r * 0.8, 0.05), (r, 0.14)], 30).at(x, y, z), stage.materials.plain())
        stage.emit(lathe([(r * rng.uniform(0.1, 0.6), 0), (0, 0)], 20).at(x, y + 0.07, z), 1.5 * flux,
                   lamp_color(rng, 0.1))
        stage.add(rod((x, 0, z), (x, y + 0.02, z), 0.015), stage.materials.metal())


def cove(stage, room, flux):
    """A strip behind a ledge along a wall."""
    rng, ((x0, _, z0), (x1, top, z1)) = stage.rng, room
    color = lamp_color(rng, 0.3)
    y, out = top - rng.uniform(0.15, 0.5), rng.uniform(0.08, 0.2)
    sides = rng.permutation(4)[:rng.integers(1, 4)]
    for side in sides:
        low, high = [((x0, z0), (x1, z0 + out)), ((x0, z1 - out), (x1, z1)), ((x0, z0), (x0 + out, z1)),
                     ((x1 - out, z0), (x1, z1))][side]
        stage.add(box((low[0], y - 0.02, low[1]), (high[0], y, high[1])), stage.materials.plain())
        inner = [(0, 1), (0, -1), (1, 0), (-1, 0)][side]
        lip_low, lip_high = list(low), list(high)
        axis = 0 if inner[0] else 1
        if sum(inner) > 0:
            lip_low[axis] = high[axis] - 0.015
        else:
            lip_high[axis] = low[axis] + 0.015
        stage.add(box((lip_low[0], y, lip_low[1]), (lip_high[0], y + 0.06, lip_high[1])), stage.materials.plain())
        middle = [(a + b) / 2 for a, b in zip(low, high)]
        if axis == 1:
            strip = quad((low[0] + 0.05, y + 0.01, middle[1] + 0.01), (high[0] - low[0] - 0.1, 0, 0), (0, 0, -0.02))
        else:
            strip = quad((middle[0] - 0.01, y + 0.01, high[1] - 0.05), (0.02, 0, 0), (0, 0, low[1] - high[1] + 0.1))
        stage.emit(strip, 2 * flux / len(sides), color, solid=False)


def fluorescent(stage, room, flux):
    rng, top = stage.rng, room[1][1]
    n, length, r = int(rng.integers(1, 5)), rng.uniform(0.4, 1.5), rng.uniform(0.008, 0.03)
    turn = rng.choice([0, 90])
    for _ in range(n):
        x, z = _spot(rng, room, 0.9)
        place = translate(x, top - 0.1, z) @ rotate(1, turn)
        stage.emit(rod((-length / 2, 0, 0), (length / 2, 0, 0), r).moved(place), flux / n, lamp_color(rng, 0.1))
        stage.add(slab(length, 0.04, 0.12).at(0, r + 0.01, 0).moved(place), stage.materials.plastic(), solid=False)


def screen(stage, room, flux):
    """A display with a picture, right beside its dark frame."""
    rng, ((x0, _, z0), (x1, _, z1)) = stage.rng, room
    w = rng.uniform(0.4, 1.5)
    h = w * rng.uniform(0.5, 0.7)
    turn = rng.choice([0, 90, 180, 270])
    x, z = _spot(rng, room, 0.6)
    x, z = {0: (x, z0 + 0.05), 90: (x0 + 0.05, z), 180: (x, z1 - 0.05), 270: (x1 - 0.05, z)}[int(turn)]
    place = translate(x, rng.uniform(0.5, 1.1), z) @ rotate(1, turn)
    image = (textures.picture if rng.uniform() < 0.6 else textures.words)(rng)
    image = stage.scene.texture(textures.png(image), False)
    strength = float(flux / (math.pi * w * h * 0.3))
    material = stage.scene.diffuse("screen", (0.02, 0.02, 0.02), emission=(strength,) * 3, emission_map=image)
    stage.add(quad((-w / 2, 0, 0.02), (w, 0, 0), (0, h, 0), fit=True).moved(place), (material, 1.0), fit=True)
    stage.add(box((-w / 2 - 0.03, -0.03, -0.03), (w / 2 + 0.03, h + 0.03, 0.015)).moved(place),
              stage.materials.plastic())


def chain(stage, room, flux):
    """Strings of many small coloured lamps."""
    rng, ((x0, _, z0), (x1, top, z1)) = stage.rng, room
    colors, groups = int(rng.integers(2, 7)), []
    for _ in range(int(rng.integers(1, 5))):
        n = int(rng.integers(8, 70))
        a = np.array([rng.uniform(x0 + .1, x1 - .1), rng.uniform(top * 0.6, top - 0.1), rng.choice([z0 + .1, z1 - .1])])
        b = np.array([rng.choice([x0 + .1, x1 - .1]), rng.uniform(top * 0.6, top - 0.1), rng.uniform(z0 + .1, z1 - .1)])
        t = np.linspace(0, 1, n)[:, None]
        points = a + (b - a) * t - np.array([0, 1, 0]) * rng.uniform(0.1, top * 0.4) * 4 * t * (1 - t)
        groups.append(points)
        stage.add(tubes([points], [np.full(n, 0.002)], 4), stage.materials.matte(), solid=False)
    points, r = np.concatenate(groups), rng.uniform(0.005, 0.025)
    for k in range(colors):
        part = points[k::colors]
        if len(part):
            stage.emit(merged(sphere(r, 8, 6).at(*p) for p in part), flux * len(part) / len(points),
                       lamp_color(rng, 0.9),
                       solid=False)


def neon(stage, room, flux):
    """Bent glowing tubes on or near a wall."""
    rng, ((x0, _, z0), (x1, top, z1)) = stage.rng, room
    for _ in range(int(rng.integers(1, 4))):
        t = np.linspace(0, 1, 40)
        f = rng.normal(size=(2, 4)) / (1 + np.arange(4))
        a = 2 * math.pi * t[:, None] * np.arange(1, 5)
        size = rng.uniform(0.15, 0.5)
        x, z = _spot(rng, room, 0.8)
        path = np.stack([x + size * (np.cos(a) * f[0]).sum(1), rng.uniform(0.8, top - 0.8) + size * 0.7 * (
            np.sin(a) * f[1]).sum(1), np.full(40, z0 + 0.06)], -1)
        if rng.uniform() < 0.5:
            path = np.stack([np.full(40, x0 + 0.06), path[:, 1], z + path[:, 0] - x], -1)
        path = np.clip(path, (x0 + 0.05, 0.1, z0 + 0.05), (x1 - 0.05, top - 0.05, z1 - 0.05))
        stage.emit(tubes([path], [np.full(40, rng.uniform(0.006, 0.02))], 8), flux / 2, lamp_color(rng, 1.0),
                   solid=False)


def points(stage, room, flux):
    """Lights without size: point and spot lights; sharp shadows."""
    rng, top = stage.rng, room[1][1]
    n = int(rng.choice([1, 1, 2, 4, 8]))
    for _ in range(n):
        x, z = _spot(rng, room)
        y = rng.uniform(top * 0.6, top - 0.15)
        tx, tz = _spot(rng, room)
        if rng.uniform() < 0.5:
            stage.light("point", (x, y, z), (x, 0, z + 0.01), lamp_color(rng), flux / n / (4 * math.pi))
        else:
            outer = rng.uniform(0.2, 1.1)
            stage.light("spot", (x, y, z), (tx, 0, tz), lamp_color(rng), flux / n / 3, spot={
                "innerConeAngle": float(outer * rng.uniform(0.2, 0.95)), "outerConeAngle": float(outer)})


def globe(stage, room, flux):
    """A large glowing body on the floor, beside whatever is dark."""
    r = stage.rng.uniform(0.08, 0.35)
    x, z = _spot(stage.rng, room, 0.6)
    body = sphere(r, 32, 20) if stage.rng.uniform() < 0.6 else torus(r, r * 0.2).moved(rotate(0, 90))
    stage.emit(body.at(x, r * 1.2, z), flux, lamp_color(stage.rng, 0.4))


LAMPS = (panels, panels, bulbs, bulbs, shades, shades, fluorescent, screen, neon, points, globe)
HIDDEN = (uplights, cove)
