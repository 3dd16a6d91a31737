# SPDX-License-Identifier: Apache-2.0
"""Bodies of any shape, size and material strewn about in a box or under an environment: arrangements that no room has,
so that denoisers learn light and edges rather than furniture."""

import math

import numpy as np

from . import lamps, skies
from .meshes import (box, cards, creased, cylinder, grid, lathe, merged, quad, rotate, scale, slab, sphere,
                     superellipsoid, torus, tubes, unit)


def _any_turn(rng):
    return rotate(1, rng.uniform(0, 360)) @ rotate(0, rng.uniform(0, 360)) @ rotate(2, rng.uniform(0, 360))


def _knot(rng):
    t = np.linspace(0, 2 * math.pi, 160)
    p, q = int(rng.integers(1, 4)), int(rng.integers(2, 6))
    r = 0.35 + 0.14 * np.cos(q * t)
    path = np.stack([r * np.cos(p * t), 0.14 * np.sin(q * t), r * np.sin(p * t)], -1)
    return tubes([path], [np.full(160, rng.uniform(0.01, 0.06))], 10)


def _ripple(rng):
    """A waving sheet."""
    x, z = np.meshgrid(np.linspace(-0.5, 0.5, 50), np.linspace(-0.5, 0.5, 50))
    f = rng.uniform(3, 18, 2)
    return grid(np.stack([x, rng.uniform(0.02, 0.1) * np.sin(f[0] * x + 2 * np.sin(f[1] * z)), z], -1), flip=True)


def _lump(rng):
    """A sphere dented by waves."""
    body = sphere(0.5, 48, 32)
    f = rng.normal(0, 6, (3, 3))
    bump = 1 + 0.08 * np.sin(body.points @ f + rng.uniform(0, 6, 3)).sum(axis=1, keepdims=True)
    points = body.points * bump
    return grid(points.reshape(33, 49, 3), flip=True)


def _burst(rng):
    """Spikes in all directions."""
    n = unit(rng.normal(size=(int(rng.integers(20, 300)), 3)))
    return tubes(np.stack([n * 0.05, n * rng.uniform(0.3, 0.5, (len(n), 1))], 1), np.tile([0.012, 0.002], (len(n), 1)),
                 5)


def _lattice(rng):
    n, r = int(rng.integers(2, 6)), rng.uniform(0.006, 0.03)
    x = np.linspace(-0.4, 0.4, n)
    rods = []
    for a in x:
        for b in x:
            rods += [box((-.42, a - r, b - r), (.42, a + r, b + r)), box((a - r, -.42, b - r), (a + r, .42, b + r)),
                     box((a - r, b - r, -.42), (a + r, b + r, .42))]
    return merged(rods)


def _confetti(rng):
    n = int(rng.integers(30, 600))
    return cards(rng.normal(0, 0.25, (n, 3)), unit(rng.normal(size=(n, 3))), rng.uniform(0.01, 0.12),
                 rng.uniform(0.1, 1),
                 rng, fit=False)


def _stairs(rng):
    n = int(rng.integers(3, 12))
    return merged(box((-0.4, 0, k / n - 0.5), (0.4, (k + 1) / n * 0.8, (k + 1) / n - 0.5)) for k in range(n))


def _shape(rng):
    """(mesh of about one metre, whether it is closed)."""
    makers = [(lambda r: sphere(0.5), True), (lambda r: box((-.5, -.5, -.5), (.5, .5, .5)), True),
              (lambda r: torus(0.38, r.uniform(0.03, 0.15)), True), (lambda r: cylinder(0.3, 1, 40).at(0, -.5, 0),
                                                                     True),
              (lambda r: superellipsoid((1, 1, 1), r.uniform(0.1, 1.6)), True),
              (lambda r: lathe([(0, -.5), (0.4, -.5), (0.0, 0.5)], 40), True),
              (lambda r: slab(1, 0.03, 0.7), True), (_knot, False), (_ripple, False), (_lump, True), (_burst, False),
              (_lattice, False), (_confetti, False), (_stairs, True),
              (lambda r: creased([(0.3, 0), (0.5, 0.4), (0.2, 0.5)], int(r.integers(3, 9))), False)]
    make, closed = makers[rng.integers(len(makers))]
    return make(rng), closed


def _bodies(stage, half, count):
    rng = stage.rng
    shared = [stage.materials.any() for _ in range(int(rng.integers(3, 9)))]
    floats = rng.uniform() < 0.4
    for _ in range(count):
        size = float(np.exp(rng.uniform(np.log(0.06), np.log(0.9)))) * half / 1.5
        mesh, closed = _shape(rng)
        turned = mesh.moved(_any_turn(rng) if floats or rng.uniform() < 0.4 else rotate(1, rng.uniform(0, 360)))
        turned = turned.moved(scale(size * rng.uniform(0.5, 1.5), size * rng.uniform(0.5, 1.5), size))
        low = turned.bounds()[0][1]
        x, z = rng.uniform(-half, half, 2) * 0.85
        y = rng.uniform(0.1, 1.6) * half if floats else 0.002 - low
        material = stage.materials.any(closed) if rng.uniform() < 0.5 else shared[rng.integers(len(shared))]
        if rng.uniform() < 0.06:
            stage.emit(turned.at(x, y, z), half * half * rng.uniform(1, 8), lamps.lamp_color(rng, 0.7))
        elif rng.uniform() < 0.05:
            stage.add(turned.at(x, y, z), stage.materials.sheet())
        else:
            stage.add(turned.at(x, y, z), material)
        stage.interest.append((x, y + (0 if floats else size * 0.3), z))


def _surround(stage, half):
    """A closed box, a box without a side or two, or a floor alone. Returns the height of the ceiling."""
    rng, mats = stage.rng, stage.materials
    high, walls = half * rng.uniform(1.0, 2.2), int(rng.choice([0, 2, 3, 4, 4]))
    wide = half if walls else 6 * half
    stage.add(quad((-wide, 0, wide), (2 * wide, 0, 0), (0, 0, -2 * wide)), mats.plain(), shell=True)
    for turn in rng.permutation(4)[:walls]:
        wall = quad((-half, 0, -half), (2 * half, 0, 0), (0, high, 0)).moved(rotate(1, 90 * turn))
        stage.add(wall, mats.any() if rng.uniform() < 0.25 else mats.plain(), shell=True)
    closed = walls == 4
    if closed:
        stage.add(quad((-half, high, -half), (2 * half, 0, 0), (0, 0, 2 * half)), mats.plain(), shell=True)
    return high, closed


def build(stage):
    rng = stage.rng
    half = rng.uniform(1.2, 3.0)
    high, closed = _surround(stage, half)
    _bodies(stage, half, int(rng.integers(8, 45)))
    room = ((-half, 0, -half), (half, high, half))
    flux = half * half * 8 * math.exp(rng.uniform(0, 2))
    if closed:
        stage.inside = np.array(room) + np.array([[0.34] * 3, [-0.34] * 3])
    else:
        stage.environment = (skies.softboxes(rng) if rng.uniform() < 0.4 else skies.blobs(rng)
                             if rng.uniform() < 0.4 else
                             skies.daylight(rng, rng.uniform() < 0.6))
    if closed or rng.uniform() < 0.4:
        kinds = (lamps.panels, lamps.bulbs, lamps.points, lamps.globe, lamps.fluorescent, lamps.chain, lamps.cove)
        for _ in range(int(rng.integers(1, 4))):
            kinds[rng.integers(len(kinds))](stage, room, flux * math.exp(rng.normal(0, 0.7)))

    def propose():
        target = np.array(stage.interest[rng.integers(len(stage.interest))]) + rng.normal(0, 0.15, 3)
        reach = half * (1 if closed else 1.6)
        eye = rng.uniform(-1, 1, 3) * reach
        eye[1] = rng.uniform(0.36, max(0.5, high * 0.9))
        return eye, target
    return propose
