# SPDX-License-Identifier: Apache-2.0
"""Things that stand in rooms and studios. Each function adds one to the stage, turned and shifted by a matrix; its own
origin is on the floor and its front is +z. Each returns the height of the place on top of it, or None."""

import math

import numpy as np
from generator.shapes import icosphere

from . import textures
from .meshes import (Mesh, box, cylinder, from_generator, grid, lathe, merged, quad, rod, rotate, slab,
                     sphere, superellipsoid, torus, tubes)


def table(stage, place):
    rng, mats = stage.rng, stage.materials
    w, d, h = rng.uniform(0.6, 1.8), rng.uniform(0.5, 1.0), rng.uniform(0.4, 0.8)
    k = rng.integers(3)
    if k == 0:
        top = slab(w, 0.04, d).at(0, h - 0.04, 0)
        legs = [box((x - 0.025, 0, z - 0.025), (x + 0.025, h - 0.04, z + 0.025))
                for x in (-w / 2 + 0.05, w / 2 - 0.05) for z in (-d / 2 + 0.05, d / 2 - 0.05)]
    elif k == 1:
        d = w
        top = cylinder(w / 2, 0.03, 40).at(0, h - 0.03, 0)
        legs = [lathe([(0.22, 0), (0.2, 0.02), (0.04, 0.06), (0.03, h / 2), (0.05, h - 0.03)], 20)]
    else:
        top = slab(w, 0.03, d).at(0, h - 0.03, 0)
        legs = [box((x - 0.015, 0, -d / 2), (x + 0.015, h - 0.03, d / 2)) for x in (-w / 2 + 0.1, w / 2 - 0.1)]
    top_material = mats.glass() if rng.uniform() < 0.08 else mats.wood() if rng.uniform() < 0.5 else mats.any()
    stage.add(top.moved(place), top_material)
    stage.add(merged(legs).moved(place), mats.any() if rng.uniform() < 0.6 else mats.wood())
    return h, w * 0.38, d * 0.38


def chair(stage, place):
    rng = stage.rng
    w, h = rng.uniform(0.38, 0.5), rng.uniform(0.42, 0.5)
    parts = [box((x - 0.02, 0, z - 0.02), (x + 0.02, h, z + 0.02)) for x in (-w / 2, w / 2) for z in (-w / 2, w / 2)]
    parts.append(slab(w + 0.06, 0.03, w + 0.06).at(0, h, 0))
    top = h + rng.uniform(0.35, 0.6)
    parts += [box((x - 0.02, h, -w / 2 - 0.02), (x + 0.02, top, -w / 2 + 0.02)) for x in (-w / 2, w / 2)]
    for y in np.arange(h + 0.12, top - 0.03, rng.uniform(0.07, 0.3)):
        parts.append(box((-w / 2, y, -w / 2 - 0.012), (w / 2, y + 0.05, -w / 2 + 0.012)))
    stage.add(merged(parts).moved(place), stage.materials.wood() if rng.uniform() < 0.5 else stage.materials.any())
    if rng.uniform() < 0.4:
        seat = superellipsoid((w, 0.07, w), 0.4).at(0, h + 0.06, 0)
        stage.add(seat.moved(place), stage.materials.cloth())


def sofa(stage, place):
    rng = stage.rng
    w, d, arm = rng.uniform(1.0, 2.2), rng.uniform(0.75, 0.95), rng.uniform(0.12, 0.22)
    cloth = stage.materials.cloth() if rng.uniform() < 0.7 else stage.materials.any()
    parts = [superellipsoid((w, 0.3, d), 0.15).at(0, 0.22, 0),
             superellipsoid((w, 0.6, 0.22), 0.2).at(0, 0.5, -d / 2 + .1)]
    parts += [superellipsoid((arm, 0.5, d), 0.25).at(x, 0.35, 0) for x in (-w / 2 + arm / 2, w / 2 - arm / 2)]
    seats = max(1, int(w / 0.7))
    size = (w - 2 * arm) / seats
    for k in range(seats):
        x = -w / 2 + arm + (k + 0.5) * size
        parts.append(superellipsoid((size * 0.98, 0.16, d * 0.75), 0.3).at(x, 0.43, 0.06))
    stage.add(merged(parts).moved(place), cloth)
    for _ in range(int(rng.integers(0, 4))):
        pillow = superellipsoid((0.42, 0.42, 0.14), 0.6).moved(rotate(0, -20) @ rotate(2, rng.uniform(-15, 15)))
        stage.add(pillow.at(rng.uniform(-w / 2 + 0.3, w / 2 - 0.3), 0.68, -0.12).moved(place), stage.materials.cloth())


def bed(stage, place):
    rng, mats = stage.rng, stage.materials
    w, d = rng.uniform(0.9, 1.8), 2.0
    stage.add(merged([slab(w + 0.08, 0.25, d + 0.06).at(0, 0.08, 0), box((-w / 2 - 0.04, 0, -d / 2 - 0.08), (
        w / 2 + 0.04, rng.uniform(0.6, 1.2), -d / 2 - 0.02))]).moved(place), mats.wood())
    stage.add(superellipsoid((w, 0.22, d), 0.2).at(0, 0.42, 0).moved(place), mats.cloth())
    blanket = superellipsoid((w + 0.06, 0.2, d * 0.6), 0.25).at(0, 0.47, d * 0.2)
    stage.add(blanket.moved(place), mats.cloth())
    for x in ([0] if w < 1.3 else [-w / 4, w / 4]):
        stage.add(superellipsoid((0.6, 0.16, 0.4), 0.5).at(x, 0.58, -d / 2 + 0.3).moved(place), mats.cloth())


def bookshelf(stage, place):
    rng, mats = stage.rng, stage.materials
    w, h, d = rng.uniform(0.6, 1.8), rng.uniform(0.8, 2.1), rng.uniform(0.24, 0.35)
    boards = max(2, int(h / rng.uniform(0.26, 0.4)))
    gap = h / boards
    parts = [box((x - 0.012, 0, -d / 2), (x + 0.012, h, d / 2)) for x in (-w / 2, w / 2)]
    parts += [box((-w / 2, y, -d / 2), (w / 2, y + 0.02, d / 2)) for y in np.linspace(0.03, h - 0.02, boards + 1)]
    if rng.uniform() < 0.7:
        parts.append(box((-w / 2, 0, -d / 2), (w / 2, h, -d / 2 + 0.01)))
    stage.add(merged(parts).moved(place), mats.wood() if rng.uniform() < 0.7 else mats.any())
    groups = [[] for _ in range(6)]
    for row in range(boards):
        y, x = 0.03 + row * (h - 0.05) / boards + 0.02, -w / 2 + 0.03
        end = w / 2 - 0.03 - (rng.uniform(0, w * 0.6) if rng.uniform() < 0.4 else 0)
        while rng.uniform() < 0.985:
            t = rng.uniform(0.012, 0.05)
            if x + t > end:
                break
            tall, deep = min(gap * 0.88, rng.uniform(0.16, 0.3)), rng.uniform(0.5, 0.9) * d
            groups[rng.integers(6)].append(box((x, y, d / 2 - deep - 0.01),
                                               (x + t - 0.001, y + tall * 0.95, d / 2 - 0.02)))
            x += t
    for books in groups:
        if books:
            material = (mats.matte_textured([textures.words]) if rng.uniform() < 0.4 else
                        mats.matte() if rng.uniform() < 0.6 else mats.plastic())
            stage.add(merged(books).moved(place), material)
    return h, w * 0.4, d * 0.25


def cabinet(stage, place):
    rng, mats = stage.rng, stage.materials
    w, h, d = rng.uniform(0.5, 1.6), rng.uniform(0.4, 1.9), rng.uniform(0.35, 0.6)
    stage.add(slab(w, h, d).moved(place), mats.wood() if rng.uniform() < 0.5 else mats.plain())
    columns, rows = max(1, round(w / 0.5)), max(1, round(h / rng.uniform(0.25, 0.8)))
    fronts, knobs = [], []
    for i in range(columns):
        for j in range(rows):
            x0, y0 = -w / 2 + w * i / columns + 0.01, h * j / rows + 0.01
            x1, y1 = x0 + w / columns - 0.02, y0 + h / rows - 0.02
            fronts.append(box((x0, y0, d / 2), (x1, y1, d / 2 + 0.015)))
            knobs.append(sphere(0.012, 10, 6).at((x0 + x1) / 2, y1 - 0.05, d / 2 + 0.03))
    stage.add(merged(fronts).moved(place), mats.any())
    stage.add(merged(knobs).moved(place), mats.metal())
    return h, w * 0.4, d * 0.3


def pillar(stage, place):
    r, h = stage.rng.uniform(0.06, 0.25), stage.rng.uniform(0.6, 2.3)
    if stage.rng.uniform() < 0.5:
        stage.add(slab(2 * r, h, 2 * r).moved(place), stage.materials.any())
    else:
        stage.add(cylinder(r, h, 32).moved(place), stage.materials.any())
    return h, r * 0.4, r * 0.4


def plant(stage, place):
    rng = stage.rng
    pot, r = rng.uniform(0.15, 0.4), rng.uniform(0.1, 0.22)
    stage.add(lathe([(0, 0), (r * 0.7, 0), (r, pot), (r * 0.9, pot), (r * 0.85, pot * 0.9),
                     (0, pot * 0.9)]).moved(place),
              stage.materials.any())
    stems = int(rng.integers(12, 90))
    t = np.linspace(0, 1, 6)
    out = rng.normal(size=(stems, 2)) * rng.uniform(0.1, 0.4)
    height = rng.uniform(0.3, 1.2) * rng.uniform(0.6, 1, stems)
    paths = np.stack([out[:, :1] * t ** 1.7, pot * 0.9 + height[:, None] * t * (1 - 0.25 * t), out[:, 1:] * t ** 1.7],
                     -1)
    blades = _blades(paths, rng.uniform(0.01, 0.06) * np.sin(math.pi * np.clip(t * 0.9 + 0.08, 0, 1)))
    stage.add(blades.moved(place), stage.materials.thin() if rng.uniform() < 0.6 else stage.materials.plastic())


def _blades(paths, half_widths):
    """Ribbons along paths; their sides lie level."""
    count, steps = paths.shape[:2]
    along = np.gradient(paths, axis=1)
    side = np.cross(along, [0, 1.0, 0])
    side /= np.maximum(np.linalg.norm(side, axis=-1, keepdims=True), 1e-6)
    edge = side * np.asarray(half_widths)[None, :, None]
    points = np.stack([paths - edge, paths + edge], axis=2)
    n, i = np.meshgrid(np.arange(count), np.arange(steps - 1), indexing="ij")
    a = (n * steps + i) * 2
    faces = np.stack([a, a + 1, a + 3, a, a + 3, a + 2], axis=-1)
    normals = np.cross(side, along)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
    return Mesh(points.reshape(-1, 3), faces.reshape(-1, 3), np.repeat(normals.reshape(-1, 3), 2, axis=0))


FURNITURE = (table, table, chair, chair, sofa, bed, bookshelf, bookshelf, cabinet, cabinet, pillar, plant)


# ---- small things, that stand on others ----

def vase(stage, place):
    rng = stage.rng
    h = rng.uniform(0.12, 0.4)
    y = np.linspace(0, 1, 14)
    r = rng.uniform(0.03, 0.08) * (1 + 0.6 * np.sin(rng.uniform(2, 7) * y + rng.uniform(0, 6)) * (0.3 + y * (1 - y)))
    outer = np.stack([r, h * y], axis=1)
    inner = np.stack([r[::-1] - 0.006, h * (y[::-1] * 0.95 + 0.05)], axis=1)
    profile = np.concatenate([[(0, 0)], outer, inner, [(0, 0.05 * h)]])
    profile[:, 0] = np.maximum(profile[:, 0], 0)
    stage.add(lathe(profile, 32).moved(place), stage.materials.any(closed=True))


def ball(stage, place):
    r = stage.rng.uniform(0.03, 0.14)
    stage.add(sphere(r, 40, 24).at(0, r, 0).moved(place), stage.materials.any(closed=True))


def block(stage, place):
    size = stage.rng.uniform(0.05, 0.25, 3)
    shape = slab(*size) if stage.rng.uniform() < 0.6 else superellipsoid(size, stage.rng.uniform(0.1, 0.9)).at(
        0, size[1] / 2, 0)
    stage.add(shape.moved(place), stage.materials.any(closed=True))


def ring(stage, place):
    major = stage.rng.uniform(0.05, 0.14)
    minor = major * stage.rng.uniform(0.12, 0.5)
    turn = rotate(0, stage.rng.choice([0, 90]))
    lift = minor if turn[1, 1] > 0.5 else major + minor
    stage.add(torus(major, minor).moved(turn).at(0, lift, 0).moved(place), stage.materials.any(closed=True))


def bowl(stage, place):
    rng = stage.rng
    r, h = rng.uniform(0.08, 0.2), rng.uniform(0.04, 0.12)
    t = np.linspace(0, 1, 10)
    outer = np.stack([r * t ** 0.6, h * t ** 2], axis=1)
    inner = np.stack([(r - 0.006) * t[::-1] ** 0.6, 0.006 + (h - 0.006) * t[::-1] ** 2], axis=1)
    stage.add(lathe(np.concatenate([outer, inner]), 36).moved(place), stage.materials.any())
    if rng.uniform() < 0.5:
        fruits = [sphere(r * 0.3, 16, 10).at(*(rng.uniform(-0.4, 0.4, 2)[[0, 1]] * r).tolist()[:1], h * 0.9,
                                             float(rng.uniform(-0.4, 0.4) * r)) for _ in range(4)]
        stage.add(merged(fruits).moved(place), stage.materials.any())


def books(stage, place):
    y = 0.0
    for _ in range(int(stage.rng.integers(1, 6))):
        t = stage.rng.uniform(0.012, 0.05)
        book = slab(stage.rng.uniform(0.12, 0.2), t, stage.rng.uniform(0.18, 0.28)).moved(
            rotate(1, stage.rng.uniform(-25, 25)))
        stage.add(book.at(0, y, 0).moved(place), stage.materials.any())
        y += t


def crystal(stage, place):
    """A faceted body; of glass, metal or anything."""
    body = from_generator(icosphere(int(stage.rng.integers(0, 2)), 1.0))
    r = stage.rng.uniform(0.04, 0.12)
    rough = Mesh(body.points * r, body.faces)
    stage.add(rough.at(0, r * 0.9, 0).moved(place), stage.materials.any(closed=True))


def wires(stage, place):
    """A tangle of thin tubes: hair, cables, springs."""
    rng = stage.rng
    count, steps = int(rng.integers(3, 150)), 24
    t = np.linspace(0, 1, steps)
    heading = rng.normal(size=(count, 3)) * (1, 0.3, 1)
    heading[:, 1] = np.abs(heading[:, 1]) + 0.5
    curl = rng.uniform(0.003, 0.03)
    a = rng.uniform(0, 6.3, (count, 1)) + rng.uniform(5, 40) * t
    paths = heading[:, None] * t[:, None] * rng.uniform(0.1, 0.3) + np.stack([curl * np.cos(a), 0 * a,
                                                                              curl * np.sin(a)], -1)
    paths[:, :, 1] = np.abs(paths[:, :, 1] - rng.uniform(0, 0.25) * t ** 2) + 0.004
    radii = np.full((count, steps), rng.uniform(0.0006, 0.006))
    stage.add(tubes(paths, radii, 4).moved(place), stage.materials.any())


SMALL = (vase, vase, ball, ball, block, ring, bowl, books, crystal, wires)


# ---- flat things, that hang on walls: origin on the wall, z into the room ----

def frame(stage, place):
    rng, mats = stage.rng, stage.materials
    w, h, b = rng.uniform(0.15, 1.2), rng.uniform(0.15, 0.9), rng.uniform(0.01, 0.06)
    stage.add(merged([box((-w / 2 - b, -h / 2 - b, 0), (w / 2 + b, -h / 2, 0.03)),
                      box((-w / 2 - b, h / 2, 0), (w / 2 + b, h / 2 + b, 0.03)),
                      box((-w / 2 - b, -h / 2, 0), (-w / 2, h / 2, 0.03)),
                      box((w / 2, -h / 2, 0), (w / 2 + b, h / 2, 0.03))]).moved(place), mats.any())
    image = quad((-w / 2, -h / 2, 0.012), (w, 0, 0), (0, h, 0), fit=True).moved(place)
    k = rng.uniform()
    if k < 0.12:
        stage.add(image, mats.metal(0.02), fit=True)    # a mirror
    else:
        kinds = [textures.picture] if k < 0.7 else [textures.words, textures.checks, textures.stripes]
        material = stage.scene.material("picture", (1, 1, 1), roughness=float(rng.uniform(0.1, 1)),
                                        color_map=mats.color_map(kinds))
        stage.add(image, (material, 1.0), fit=True)
    if rng.uniform() < 0.15:
        stage.add(quad((-w / 2, -h / 2, 0.022), (w, 0, 0), (0, h, 0)).moved(place), mats.pane())


def curtain(stage, place, width=1.0, height=2.0):
    rng = stage.rng
    x = np.linspace(-width / 2, width / 2, 80)
    y = np.linspace(0, -height, 8)[:, None]
    waves, depth = rng.uniform(25, 60), rng.uniform(0.015, 0.05)
    z = 0.08 + depth * np.sin(waves * x + 0.4 * np.sin(3 * y)) * (0.5 + 0.5 * np.abs(y) / height)
    points = np.stack([x + 0 * y, y + 0 * x, z], axis=-1)
    stage.add(grid(points).moved(place), stage.materials.thin() if rng.uniform() < 0.6 else stage.materials.cloth(),
              solid=False)
    stage.add(rod((-width / 2 - 0.1, 0.02, 0.08), (width / 2 + 0.1, 0.02, 0.08), 0.012).moved(place),
              stage.materials.metal())
