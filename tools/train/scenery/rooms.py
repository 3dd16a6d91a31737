# SPDX-License-Identifier: Apache-2.0
"""Rooms: walls with doors and windows, partitions, furniture and lamps."""

import math

import numpy as np

from . import fittings, furniture, lamps, skies
from .meshes import box, merged, quad, rotate, slab, translate

# Metres that a thing needs around its middle, and whether it stands with its back to a wall.
NEEDS = {furniture.table: (0.8, False), furniture.chair: (0.35, False), furniture.sofa: (1.0, True),
         furniture.bed: (1.1, True), furniture.bookshelf: (0.7, True), furniture.cabinet: (0.7, True),
         furniture.pillar: (0.3, False), furniture.plant: (0.4, False)}
BACK = {furniture.sofa: 0.52, furniture.bed: 1.12, furniture.bookshelf: 0.19, furniture.cabinet: 0.32}


class Wall:
    """A wall by the matrix from its own frame: x along it, y up, z into the room, the origin at its foot's middle."""

    def __init__(self, place, length, height, thickness):
        self.place, self.length, self.height, self.thickness = place, length, height, thickness
        self.holes = []     # (x0, y0, x1, y1)

    def hole(self, x0, y0, x1, y1):
        """Cuts a hole unless it meets another one; says whether it did."""
        if any(x0 < b + 0.2 and x1 > a - 0.2 for a, _, b, _ in self.holes) or x1 - x0 > self.length - 0.2:
            return False
        self.holes.append((x0, y0, x1, y1))
        return True

    def mesh(self):
        """Boxes of all cells between the holes' edges that are in no hole."""
        half = self.length / 2
        xs = sorted({-half, half, *(x for h in self.holes for x in (h[0], h[2]))})
        parts = []
        for a, b in zip(xs, xs[1:]):
            y = 0.0
            for h in self.holes:
                if h[0] <= a and b <= h[2]:
                    if h[1] > 0.001:
                        parts.append(box((a, 0, -self.thickness), (b, h[1], 0)))
                    y = h[3]
            if y < self.height - 1e-3:
                parts.append(box((a, y, -self.thickness), (b, self.height, 0)))
        return merged(parts).moved(self.place)


def _walls(rng, w, d, h):
    thick = rng.uniform(0.08, 0.35)
    # Walls reach past the corners, so that no light leaks in there.
    return [Wall(translate(x, 0, z) @ rotate(1, turn), length + (2 * thick if turn % 180 else 0), h, thick)
            for turn, x, z, length in ((0, 0, -d / 2, w), (90, -w / 2, 0, d), (180, 0, d / 2, w), (270, w / 2, 0, d))]


def _window(stage, wall):
    rng, mats = stage.rng, stage.materials
    w, y0 = rng.uniform(0.4, min(2.6, wall.length * 0.7)), rng.uniform(0.05, 1.2)
    y1 = min(wall.height - 0.15, y0 + rng.uniform(0.5, 2.0))
    half = (wall.length - w) / 2 - wall.thickness - 0.1
    x = rng.uniform(-max(half, 0), max(half, 0))
    if not wall.hole(x - w / 2, y0, x + w / 2, y1):
        return
    z = -wall.thickness * rng.uniform(0.3, 0.7)
    bars, t = [], rng.uniform(0.015, 0.04)
    for k in np.linspace(-w / 2, w / 2, int(rng.integers(2, 5))):
        bars.append(box((x + k - t, y0, z - t), (x + k + t, y1, z + t)))
    for y in np.linspace(y0, y1, int(rng.integers(2, 5))):
        bars.append(box((x - w / 2, y - t, z - t), (x + w / 2, y + t, z + t)))
    stage.add(merged(bars).moved(wall.place), mats.plain(), solid=False)
    if rng.uniform() < 0.45:
        stage.add(quad((x - w / 2, y0, z), (w, 0, 0), (0, y1 - y0, 0)).moved(wall.place), mats.pane(), solid=False)
    k = rng.uniform()
    if k < 0.3:
        for side in (-1, 1):
            width = rng.uniform(0.1, 0.35) * w
            place = wall.place @ translate(x + side * (w / 2 - width / 2 + 0.1), y1 + 0.08, 0)
            furniture.curtain(stage, place, width, min(y1, y1 - y0 + 0.3))
    elif k < 0.42:
        slats = [slab(w, 0.003, 0.05).moved(translate(x, y, -0.03) @ rotate(0, 35))
                 for y in np.arange(y0 + rng.uniform(0, (y1 - y0) / 2), y1, 0.06)]
        stage.add(merged(slats).moved(wall.place), mats.matte(value=(0.5, 0.95)), solid=False)


def _door(stage, wall, angles=(4, 10, 25, 50, 85, 110)):
    """A doorway whose leaf stands ajar by some degrees, or is missing."""
    rng = stage.rng
    w, h = rng.uniform(0.7, 1.1), min(rng.uniform(1.9, 2.2), wall.height - 0.1)
    half = max((wall.length - w) / 2 - wall.thickness - 0.15, 0)
    x = rng.uniform(-half, half)
    if not wall.hole(x - w / 2, 0, x + w / 2, h):
        return
    if rng.uniform() < 0.8:
        angle = float(rng.choice(angles))
        leaf = box((0, 0.01, -0.04), (w - 0.01, h - 0.01, 0))
        side = rng.choice([-1, 1])
        place = wall.place @ translate(x - w / 2, 0, 0 if side < 0
                                       else -wall.thickness + 0.04) @ rotate(1, side * angle)
        stage.add(leaf.moved(place), stage.materials.plain())
        knob = merged([box((w - 0.12, 1.0, z), (w - 0.04, 1.02, z + 0.02)) for z in (0.02, -0.08)])
        stage.add(knob.moved(place), stage.materials.metal())
    frame = [box((x - w / 2 - 0.06, 0, 0), (x - w / 2, h + 0.06, 0.02)),
             box((x + w / 2, 0, 0), (x + w / 2 + 0.06, h + 0.06,
             0.02)), box((x - w / 2, h, 0), (x + w / 2, h + 0.06, 0.02))]
    stage.add(merged(frame).moved(wall.place), stage.materials.plain(), solid=False)


def _furnish(stage, walls, w, d, h):
    """Large things that keep out of each other's way, small ones on top of them, flat ones on the walls. Returns where
    there is room on top of things."""
    rng, taken, tops = stage.rng, [], []
    for _ in range(int(rng.integers(2, 6 + int(w * d / 5)))):
        kind = furniture.FURNITURE[rng.integers(len(furniture.FURNITURE))]
        radius, at_wall = NEEDS[kind]
        for _ in range(12):
            if at_wall:
                wall = walls[rng.integers(4)]
                room = wall.length / 2 - radius - wall.thickness
                x = rng.uniform(-room, room) if room > 0 else 0
                if any(a < x + radius and b > x - radius and y0 < 1.0 for a, y0, b, _ in wall.holes):
                    continue
                place = wall.place @ translate(x, 0, BACK[kind])
            else:
                if w < 2 * radius + 0.2 or d < 2 * radius + 0.2:
                    break
                place = translate(rng.uniform(-w / 2 + radius, w / 2 - radius), 0, rng.uniform(
                    -d / 2 + radius, d / 2 - radius)) @ rotate(1, rng.choice([0, 90, 180, 270]) + rng.normal(0, 8))
            spot = place[[0, 2], 3]
            if any(np.hypot(*(spot - p)) < 0.85 * (radius + r) for p, r in taken):
                continue
            taken.append((spot, radius))
            top = kind(stage, place)
            stage.interest.append((*spot[:1], rng.uniform(0.3, 1.0), *spot[1:]))
            if top is not None and top[0] < h - 0.3:
                tops.append(place @ translate(0, top[0], 0))
                clutter(stage, tops[-1], top[1], top[2])
            break
    for wall in walls:
        _hang(stage, wall)
    return tops


def clutter(stage, place, half_x, half_z, most=6):
    """Small things on a top, in cells of a grid."""
    rng = stage.rng
    columns, rows = max(1, int(half_x / 0.14)), max(1, int(half_z / 0.16))
    for cell in rng.permutation(columns * rows)[:rng.integers(0, most + 1)]:
        x, z = (cell % columns + 0.5) / columns * 2 - 1, (cell // columns + 0.5) / rows * 2 - 1
        turn = rotate(1, rng.uniform(0, 360))
        furniture.SMALL[rng.integers(len(furniture.SMALL))](
            stage, place @ translate(x * half_x if columns > 1 else 0, 0, z * half_z if rows > 1 else 0) @ turn)


def _hang(stage, wall):
    rng = stage.rng
    for _ in range(int(rng.integers(0, 4))):
        x = rng.uniform(-0.4, 0.4) * (wall.length - 1)
        if not any(a < x + 0.75 and b > x - 0.75 for a, _, b, _ in wall.holes):
            y = rng.uniform(1.3, max(1.4, min(1.8, wall.height - 0.6)))
            furniture.frame(stage, wall.place @ translate(x, y, 0.001))
            wall.holes.append((x - 0.6, 3.0, x + 0.6, 3.0))     # taken, though no hole: after the wall was built


def _partition(stage, w, d, h):
    """A wall across the room, full with an open doorway or with a gap beside or above it; returns its x."""
    rng = stage.rng
    x = rng.uniform(-0.2, 0.2) * w
    k = rng.uniform()
    if k < 0.6:
        wall = Wall(translate(x, 0, 0) @ rotate(1, 90), d, h, 0.1)
        _door(stage, wall, (15, 30, 50, 85, 110))
    elif k < 0.8:
        length = d * rng.uniform(0.5, 0.85)
        wall = Wall(translate(x, 0, (d - length) / 2 * rng.choice([-1, 1])) @ rotate(1, 90), length, h, 0.1)
    else:
        wall = Wall(translate(x, 0, 0) @ rotate(1, 90), d, h * rng.uniform(0.6, 0.9), 0.1)
    stage.add(wall.mesh(), stage.materials.plain())
    return x


def _outside(stage, sunny, wall):
    """What shines in: a sky image, or a glowing panel, and ground before the windows. The sun stands before `wall`, or
    few paths would find it."""
    rng = stage.rng
    outward = -wall.place[:3, 2]
    azimuth = math.atan2(outward[2], outward[0]) + rng.normal(0, 0.6)
    if rng.uniform() < 0.85:
        stage.environment = skies.daylight(rng, sunny, azimuth)
        stage.options += ["--env-scale", f"{math.exp(rng.uniform(0.5, 3)):.3f}"]
        if not sunny and rng.uniform() < 0.3:
            sun = np.array([math.cos(azimuth), rng.uniform(0.2, 1), math.sin(azimuth)])
            stage.light("directional", (0, 0, 0), -sun, (1, 0.95, 0.85), rng.uniform(5, 60))
    else:
        for x, u in ((-14, 28), (14, -28)):
            panel = quad((x, -1, u / 2), (0, 0, -u), (0, 12, 0))
            stage.add(panel, stage.materials.emitter(rng.uniform(2, 30) * lamps.lamp_color(rng, 0.1)), solid=False)
    if rng.uniform() < 0.7:
        stage.add(quad((-20, -0.1, 20), (40, 0, 0), (0, 0, -40)), stage.materials.plain(), shell=True)


def _light(stage, room, dark_side):
    """Lamps by a plan: which kinds, how many, and whether cameras see them. Room sizes set their flux."""
    rng = stage.rng
    (x0, _, z0), (x1, h, z1) = room
    area = (x1 - x0) * (z1 - z0) * 2 + 2 * h * (x1 - x0 + z1 - z0)
    flux = area * math.exp(rng.uniform(-1, 1.5))
    lit = room
    if dark_side is not None:
        lit = ((dark_side + 0.1, 0, z0),
               (x1, h, z1)) if stage.inside[1][0] < x1 - 0.5 else ((x0, 0, z0), (dark_side - 0.1,
                                                                                                    h, z1))
        flux *= 3
    k = rng.uniform()
    if k < 0.25:
        lamps.HIDDEN[rng.integers(2)](stage, lit, flux)
    elif k < 0.4:
        lamps.chain(stage, lit, flux)
    else:
        for _ in range(int(rng.choice([1, 2, 3], p=[0.55, 0.3, 0.15]))):
            lamps.LAMPS[rng.integers(len(lamps.LAMPS))](stage, lit, flux * math.exp(rng.normal(0, 0.7)))
    if dark_side is not None and rng.uniform() < 0.5:
        # A glimmer on the dark side, or some of its corners would stay black for any number of samples.
        x, z = rng.uniform(stage.inside[:, 0].min(), stage.inside[:, 0].max()), rng.uniform(z0 + 0.3, z1 - 0.3)
        fittings.candles(stage, translate(x, 0.02, z), flux * 0.02)
    if rng.uniform() < 0.12:
        lamps.screen(stage, room, flux * 0.05)
    if rng.uniform() < 0.08:
        lamps.chain(stage, room, flux * 0.1)


def _small_lights(stage, tops, walls, area):
    """Lamps on tables and walls, at times in place of daylight, mostly beside it."""
    rng = stage.rng
    flux = area * math.exp(rng.uniform(-1, 1.5))
    for place in tops:
        if rng.uniform() < 0.2:
            (fittings.table_lamp if rng.uniform() < 0.7 else fittings.candles)(stage, place, flux)
    if rng.uniform() < 0.12:
        fittings.sconce(stage, walls[rng.integers(4)], flux)


def build(stage):
    rng, mats = stage.rng, stage.materials
    w, d = rng.uniform(2.4, 8, 2)
    h = rng.uniform(2.2, 4.0)
    room = ((-w / 2, 0, -d / 2), (w / 2, h, d / 2))
    stage.inside = np.array(room) + np.array([[0.35, 0.3, 0.35], [-0.35, -0.3, -0.35]])
    walls = _walls(rng, w, d, h)
    daylight = rng.uniform() < 0.45
    first = int(rng.integers(4))
    if daylight or rng.uniform() < 0.3:
        for k in range(int(rng.integers(1, 5))):
            _window(stage, walls[first if k % 2 == 0 else rng.integers(4)])
    # Windows too small to light a room leave nothing but noise: then lamps help.
    area = sum((x1 - x0) * (y1 - y0) for wall in walls for x0, y0, x1, y1 in wall.holes)
    bright = daylight and area > 0.2 * w * d
    if rng.uniform() < 0.4:
        _door(stage, walls[rng.integers(4)])
    partition = _partition(stage, w, d, h) if min(w, d) > 3.2 and rng.uniform() < 0.3 else None
    dark_side = partition if partition is not None and rng.uniform() < 0.7 else None
    if dark_side is not None:
        side = int(rng.integers(2))
        stage.inside[side][0] = dark_side + (0.5 if side == 0 else -0.5)
    same = mats.plain() if rng.uniform() < 0.6 else None
    for wall in walls:
        stage.add(wall.mesh(), same or mats.plain(), shell=True)
    t = walls[0].thickness
    stage.add(box((-w / 2 - t, -0.1, -d / 2 - t), (w / 2 + t, 0, d / 2 + t)), mats.plain(), shell=True)
    stage.add(box((-w / 2 - t, h, -d / 2 - t), (w / 2 + t, h + 0.1, d / 2 + t)),
              mats.matte(value=(0.75, 0.99), saturation=(0, 0.4)),
              shell=True)
    fittings.add_some(stage, room, walls)
    tops = _furnish(stage, walls, w, d, h)
    if daylight:
        _outside(stage, rng.uniform() < 0.6, walls[first])
    if not bright or rng.uniform() < 0.3:
        _light(stage, room, dark_side)
    _small_lights(stage, tops, walls, w * d)

    def propose():
        low, high = stage.inside
        eye = low + rng.uniform(size=3) * (high - low)
        eye[1] = rng.uniform(0.5, min(2.2, h - 0.35))
        if stage.interest and rng.uniform() < 0.6:
            target = np.array(stage.interest[rng.integers(len(stage.interest))]) + rng.normal(0, 0.2, 3)
        else:
            target = np.array(room[0]) + rng.uniform(0.1, 0.9, 3) * (np.array(room[1]) - room[0])
        if rng.uniform() < 0.25:     # a close look
            eye = target + (eye - target) * min(1, rng.uniform(0.6, 1.2) / max(np.linalg.norm(eye - target), 0.1))
        return eye, target
    return propose
