# SPDX-License-Identifier: Apache-2.0
"""What belongs to a room rather than to its furniture: rugs, beams, tiles, radiators, stairs, screens, table lamps."""

import numpy as np

from . import lamps, textures
from .meshes import (box, creased, cylinder, lathe, merged, quad, rod, rotate, slab, sphere, superellipsoid, translate,
                     tubes)


def rug(stage, room):
    rng, ((x0, _, z0), (x1, _, z1)) = stage.rng, room
    w, d = rng.uniform(0.3, 0.7) * (x1 - x0), rng.uniform(0.3, 0.7) * (z1 - z0)
    place = translate(rng.uniform(-0.15, 0.15) * (x1 - x0), 0.003, rng.uniform(-0.15, 0.15) * (z1 - z0))
    mesh = cylinder(min(w, d) / 2, 0.008, 48) if rng.uniform() < 0.25 else slab(w, 0.008, d)
    mesh = mesh.moved(place @ rotate(1, rng.normal(0, 6)))
    kinds = [textures.plaid, textures.weave, textures.stripes, textures.camouflage, textures.dots, textures.speckle]
    stage.add(mesh, stage.materials.matte_textured(kinds), solid=False)


def beams(stage, room):
    """Under the ceiling, along one axis; their sides see little light."""
    rng, ((x0, _, z0), (x1, top, z1)) = stage.rng, room
    s = rng.uniform(0.06, 0.22)
    if rng.uniform() < 0.5:
        parts = [box((x, top - s, z0), (x + s * 0.8, top, z1))
                 for x in np.arange(x0 + 0.3, x1 - s, rng.uniform(0.5, 1.2))]
    else:
        parts = [box((x0, top - s, z), (x1, top, z + s * 0.8))
                 for z in np.arange(z0 + 0.3, z1 - s, rng.uniform(0.5, 1.2))]
    if parts:
        stage.add(merged(parts), stage.materials.wood() if rng.uniform() < 0.6 else stage.materials.plain())


def half_wall(stage, wall):
    """Tiles or panels up to a height, where the wall has no holes."""
    rng = stage.rng
    h, half = rng.uniform(0.7, 1.6), wall.length / 2
    edges = sorted({-half, half, *(x for hole in wall.holes if hole[1] < h for x in (hole[0] - 0.07, hole[2] + 0.07))})
    parts = []
    for a, b in zip(edges, edges[1:]):
        if b - a > 0.1 and not any(x0 < (a + b) / 2 < x1 and y0 < h for x0, y0, x1, _ in wall.holes):
            parts.append(box((a, 0, 0), (b, h, 0.012)))
    if parts:
        material = stage.materials.wood() if rng.uniform() < 0.3 else (stage.scene.material(
            "tiles", (1, 1, 1), roughness=float(rng.uniform(0.03, 0.4)),
            color_map=stage.materials.color_map([textures.bricks, textures.checks])), float(rng.uniform(0.4, 1.5)))
        stage.add(merged(parts).moved(wall.place), material, solid=False)


def skirting(stage, wall):
    parts, half = [], wall.length / 2
    edges = sorted({-half, half, *(x for hole in wall.holes if hole[1] < 0.1
                                   for x in (hole[0] - 0.06, hole[2] + 0.06))})
    for a, b in zip(edges, edges[1:]):
        if not any(x0 < (a + b) / 2 < x1 and y0 < 0.1 for x0, y0, x1, _ in wall.holes):
            parts.append(box((a, 0, 0), (b, 0.09, 0.015)))
    if parts:
        stage.add(merged(parts).moved(wall.place), stage.materials.plain(), solid=False)


def radiator(stage, wall):
    n = int(stage.rng.integers(8, 22))
    parts = [superellipsoid((0.045, 0.6, 0.1), 0.3, 12, 10).at((k - n / 2) * 0.055, 0.45, 0.1) for k in range(n)]
    place = wall.place @ translate(stage.rng.uniform(-0.25, 0.25) * wall.length, 0, 0)
    stage.add(merged(parts).moved(place), stage.materials.plastic() if stage.rng.uniform() < 0.7
              else stage.materials.metal())


def grille(stage, room):
    """A standing screen of slats, rods or a sheet with holes, through which light falls in patterns."""
    rng, ((x0, _, z0), (x1, top, z1)) = stage.rng, room
    w, h = rng.uniform(0.8, 2.0), rng.uniform(1.2, min(2.2, top - 0.1))
    place = translate(rng.uniform(x0, x1) * 0.5, 0, rng.uniform(z0, z1) * 0.5) @ rotate(1, rng.uniform(0, 180))
    k = rng.integers(4)
    if k == 0:
        mesh = merged(box((x, 0.02, -0.01), (x + 0.025, h, 0.01))
                      for x in np.arange(-w / 2, w / 2, rng.uniform(0.04, 0.15)))
    elif k == 1:
        mesh = merged(slab(w, 0.006, 0.07).moved(translate(0, y, 0) @ rotate(0, 40)) for y in np.arange(0.1, h, 0.08))
    elif k == 2:
        stage.add(quad((-w / 2, 0.02, 0), (w, 0, 0), (0, h, 0)).moved(place), stage.materials.sheet())
        return
    else:
        x = np.arange(-w / 2, w / 2, rng.uniform(0.02, 0.06))
        paths = np.stack([np.stack([x, 0 * x + 0.02, 0 * x], -1), np.stack([x, 0 * x + h, 0 * x], -1)], 1)
        mesh = tubes(paths, np.full((len(x), 2), 0.004), 5)
    stage.add(mesh.moved(place), stage.materials.any())


def glass_wall(stage, room):
    """A pane across part of the room, with or without a frame."""
    rng, ((_, _, z0), (_, top, z1)) = stage.rng, room
    d, h = rng.uniform(0.4, 0.9) * (z1 - z0), rng.uniform(1.5, top - 0.05)
    place = translate(rng.uniform(-0.5, 0.5), 0, z0 + d / 2) @ rotate(1, 90)
    pane = quad((-d / 2, 0.03, 0), (d, 0, 0), (0, h - 0.03, 0))
    stage.add(pane.moved(place), stage.materials.pane(), solid=True)
    bars = [box((x - 0.02, 0, -0.02), (x + 0.02, h, 0.02)) for x in np.linspace(-d / 2, d / 2, int(rng.integers(2, 6)))]
    stage.add(merged(bars).moved(place), stage.materials.metal())


def steps(stage, room):
    rng, ((x0, _, z0), (x1, top, z1)) = stage.rng, room
    n, w = int(rng.integers(3, 11)), rng.uniform(0.7, 1.2)
    parts = [box((0, k * 0.17, k * 0.26), (w, (k + 1) * 0.17, (k + 1) * 0.26 + (0.02 if k < n - 1 else 0)))
             for k in range(n) if (k + 1) * 0.26 < z1 - z0 - 0.3 and (k + 1) * 0.17 < top - 0.5]
    if parts:
        stage.add(merged(parts).at(x0 if rng.uniform() < 0.5 else x1 - w, 0, z0), stage.materials.plain())


def table_lamp(stage, place, flux):
    """Small, on furniture: what lies beside it is bright, what lies behind it dark."""
    rng = stage.rng
    h, r = rng.uniform(0.15, 0.35), rng.uniform(0.07, 0.15)
    foot = creased([(0, 0), (0.06, 0), (0.05, 0.02), (0.012, 0.03), (0.012, h), (0, h)], 20)
    stage.add(foot.moved(place), stage.materials.any())
    stage.add(lathe([(r, h * 0.8), (r * rng.uniform(0.4, 1), h * 0.8 + 0.16)], 28).moved(place),
              stage.materials.thin() if rng.uniform() < 0.7 else stage.materials.any())
    stage.emit(sphere(0.022, 14, 8).at(0, h + 0.06, 0).moved(place), flux, lamps.lamp_color(rng, 0.1), solid=False)


def candles(stage, place, flux):
    n = int(stage.rng.integers(1, 6))
    for _ in range(n):
        x, z = stage.rng.uniform(-0.15, 0.15, 2)
        h = stage.rng.uniform(0.05, 0.25)
        stage.add(cylinder(0.015, h, 14).at(x, 0, z).moved(place), stage.materials.matte(value=(0.6, 0.95)))
        flame = lathe([(0, 0), (0.005, 0.008), (0.003, 0.02), (0, 0.028)], 10).at(x, h + 0.004, z)
        stage.emit(flame.moved(place), flux / n, (1.7, 1.0, 0.3), solid=False)


def sconce(stage, wall, flux):
    """A box or shell on the wall that lets light out upward and downward only."""
    rng = stage.rng
    for x in np.linspace(-0.3, 0.3, int(rng.integers(1, 4))) * wall.length:
        place = wall.place @ translate(x, rng.uniform(1.4, 1.8), 0.07)
        shell = [box((-.06, 0, .045), (.06, .2, .05)), box((-.06, 0, -.06), (-.055, .2, .05)), box((.055, 0, -.06),
                                                                                                 (.06, .2, .05))]
        stage.add(merged(shell).moved(place), stage.materials.any())
        stage.emit(rod((0, 0.05, 0), (0, 0.15, 0), 0.012).moved(place), flux / 2, lamps.lamp_color(rng, 0.1),
                   solid=False)


def litter(stage, room):
    """Sheets of paper, cubes and balls on the floor."""
    rng, ((x0, _, z0), (x1, _, z1)) = stage.rng, room
    parts = [[], []]
    for _ in range(int(rng.integers(5, 40))):
        x, z = rng.uniform(x0 + 0.2, x1 - 0.2), rng.uniform(z0 + 0.2, z1 - 0.2)
        k, s = rng.integers(3), rng.uniform(0.02, 0.1)
        mesh = [slab(0.21, 0.001, 0.3), slab(s, s, s), sphere(s / 2, 16, 10).at(0, s / 2, 0)][k]
        parts[int(k > 0)].append(mesh.moved(rotate(1, rng.uniform(0, 360))).at(x, 0.002, z))
    for k, group in enumerate(parts):
        if group:
            kinds = [textures.words] if k == 0 else None
            stage.add(merged(group), stage.materials.matte_textured(kinds), solid=False)


def add_some(stage, room, walls):
    """A few of all these; lamps are added by the room itself."""
    rng = stage.rng
    for kind, chance in ((rug, 0.4), (beams, 0.15), (grille, 0.15), (glass_wall, 0.08), (steps, 0.1), (litter, 0.2)):
        if rng.uniform() < chance:
            kind(stage, room)
    if rng.uniform() < 0.4:
        for wall in walls:
            skirting(stage, wall)
    if rng.uniform() < 0.25:
        for k in rng.permutation(4)[:rng.integers(1, 5)]:
            half_wall(stage, walls[k])
    if rng.uniform() < 0.15:
        radiator(stage, walls[rng.integers(4)])
