# SPDX-License-Identifier: Apache-2.0
"""Scenes under the sky: ground, trees, grass, hair-like tubes, fences and houses."""

import math
import random

import numpy as np
from generator import plants

from . import furniture, lamps, skies, textures
from .meshes import Mesh, box, cards, from_generator, grid, merged, quad, rotate, scale, slab, sphere
from .meshes import superellipsoid, translate, tubes, unit


class Ground:
    """Rolling ground; things ask it for its height."""

    def __init__(self, rng, size):
        self.size, self.lift = size, rng.uniform(0, 0.12) * size * (rng.uniform() < 0.7)
        self.phase, self.waves = rng.uniform(0, 6.3, 4), rng.uniform(1, 3, 4) / size * 2

    def height(self, x, z):
        f, p = self.waves, self.phase
        return self.lift * 0.4 * (np.sin(f[0] * x + p[0]) * np.sin(f[1] * z + p[1]) + 0.5
                                  * np.sin(f[2] * (x + z) + p[2]))

    def mesh(self):
        x = np.linspace(-4, 4, 90) ** 3 / 16 * self.size
        x, z = np.meshgrid(x, x)
        return grid(np.stack([x, self.height(x, z), z], -1), flip=True)


def _tree(stage, place, most_leaves):
    rng = stage.rng
    kind, python = rng.integers(3), random.Random(int(rng.integers(1 << 30)))
    foliage = stage.materials.thin() if rng.uniform() < 0.5 else stage.materials.matte(value=(0.2, 0.7))
    if kind == 0:
        trunk, needles = plants.conifer(python, 4.0, int(rng.integers(10, 24)), int(rng.integers(10, 28)))
        bark, crown = from_generator(trunk), from_generator(needles)
    else:
        skeleton = plants.grow(python, (0, -0.2, 0), (0, 1, 0), 1.4, 0.09, 3, spread=rng.uniform(0.35, 0.8))
        bark, crown = from_generator(plants.bark(skeleton, 0.012)), None
        if kind == 1 or rng.uniform() < 0.6:
            points, headings = _leaf_sites(rng, skeleton, int(rng.uniform(0.3, 1) * most_leaves))
            fit = rng.uniform() < 0.5
            crown = cards(points, headings, rng.uniform(0.06, 0.22) * rng.uniform(0.7, 1.3, len(points)), 0.6, rng)
            if fit:
                foliage = _leaf_material(stage), 1.0
    stage.add(bark.moved(place), stage.materials.matte_textured([textures.mottled, textures.wood]), solid=False)
    if crown is not None:
        stage.add(crown.moved(place), foliage, fit=True, solid=False)


def _leaf_material(stage):
    options = {}
    if stage.rng.uniform() < 0.6:
        options["KHR_materials_diffuse_transmission"] = {
            "diffuseTransmissionFactor": float(stage.rng.uniform(0.2, 0.5)),
            "diffuseTransmissionColorFactor": list(stage.materials.color(value=(0.4, 0.9)))}
    return stage.scene.material("leaf", (1, 1, 1), roughness=float(stage.rng.uniform(0.3, 1)), mask=0.5,
                                color_map=stage.scene.texture(textures.png(textures.leaf(stage.rng)), False), **options)


def _leaf_sites(rng, skeleton, count):
    """Points on outer branches, and directions in which leaves grow there."""
    ends = [np.array(path) for path, _, depth in skeleton if depth <= 1]
    starts = np.concatenate([p[:-1] for p in ends])
    steps = np.concatenate([np.diff(p, axis=0) for p in ends])
    pick = rng.integers(0, len(starts), count)
    points = starts[pick] + steps[pick] * rng.uniform(size=(count, 1))
    return points, unit(0.6 * unit(steps[pick]) + unit(rng.normal(size=(count, 3))))


def _grass(stage, ground, radius):
    """Blades as thin triangles: more detail than pixels."""
    rng = stage.rng
    count, height = int(rng.integers(3000, 14000)), rng.uniform(0.04, 0.5)
    r, a = radius * np.sqrt(rng.uniform(size=count)), rng.uniform(0, 2 * math.pi, count)
    x, z = r * np.cos(a), r * np.sin(a)
    root = np.stack([x, ground.height(x, z), z], -1)
    lean = rng.normal(0, 0.35, (count, 3)) * (1, 0, 1)
    side = unit(rng.normal(size=(count, 3)) * (1, 0, 1)) * rng.uniform(0.003, 0.012)
    tip = root + (lean + (0, 1, 0)) * (height * rng.uniform(0.5, 1.2, (count, 1)))
    corners = np.stack([root - side, root + side, tip], axis=1)
    blades = Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))
    groups = int(rng.integers(1, 4))
    for k in range(groups):
        part = Mesh(blades.points.reshape(-1, 3, 3)[k::groups].reshape(-1, 3), np.arange(
            3 * len(blades.faces[k::groups])).reshape(-1, 3))
        material = stage.materials.thin() if rng.uniform() < 0.5 else stage.materials.matte(value=(0.2, 0.8))
        stage.add(part, material, solid=False)


def _fur(stage, place):
    """A body that is covered with thin glossy tubes."""
    rng = stage.rng
    count, steps = int(rng.integers(600, 2300)), 6
    n = unit(rng.normal(size=(count, 3)))
    t = np.linspace(0, 1, steps)[:, None]
    length, fall = rng.uniform(0.1, 0.5), rng.uniform(0, 1)
    wave = rng.normal(0, 0.06, (count, 1, 3)) * np.sin(rng.uniform(3, 14) * t)
    paths = n[:, None] * (0.4 + length * t) + np.array([0, -1, 0]) * fall * length * t ** 2 + wave * length * 2
    radii = rng.uniform(0.001, 0.006) * (1 - 0.8 * t[:, 0]) + np.zeros((count, 1))
    strands = tubes(paths + (0, 0.6, 0), radii, 3)
    options = {"KHR_materials_anisotropy": {"anisotropyStrength": 0.7}} if rng.uniform() < 0.4 else {}
    hair = stage.scene.material("hair", stage.materials.color(), roughness=float(rng.uniform(0.15, 0.7)), **options)
    stage.add(strands.moved(place), (hair, 1.0), solid=False)
    stage.add(sphere(0.4).at(0, 0.6, 0).moved(place), stage.materials.matte())


def _fence(stage, ground):
    """Pickets, or posts with wires, along a wavering line."""
    rng = stage.rng
    n, gap = int(rng.integers(15, 70)), rng.uniform(0.08, 0.3)
    turn, h = rng.uniform(0, 360), rng.uniform(0.6, 1.6)
    x0, z0 = rng.uniform(-2, 2, 2)
    parts = []
    for k in range(n):
        place = rotate(1, turn) @ translate((k - n / 2) * gap, 0, 2.0)
        x, z = place[0, 3] + x0, place[2, 3] + z0
        post = slab(gap * 0.55 if gap < 0.2 else 0.06, h, 0.03).moved(rotate(1, turn))
        parts.append(post.at(x, float(ground.height(x, z)) - 0.1, z))
    ends = rotate(1, turn) @ np.array([[-n / 2 * gap, n / 2 * gap], [0, 0], [2.03, 2.03], [1, 1]])
    y = [float(ground.height(ends[0, k] + x0, ends[2, k] + z0)) for k in (0, 1)]
    for up in np.linspace(0.25, 0.8, int(rng.integers(2, 5))) * h:
        parts.append(tubes([[(ends[0, k] + x0, y[k] + up, ends[2, k] + z0) for k in (0, 1)]], [[0.012, 0.012]], 5))
    stage.add(merged(parts), stage.materials.wood() if rng.uniform() < 0.5 else stage.materials.any(), solid=False)


def _house(stage, place):
    """Walls with window panes or lit windows, a pitched or flat roof."""
    rng, mats = stage.rng, stage.materials
    w, d, h = rng.uniform(3, 7), rng.uniform(3, 6), rng.uniform(2.4, 6)
    stage.add(box((-w / 2, -0.5, -d / 2), (w / 2, h, d / 2)).moved(place),
              mats.matte_textured([textures.bricks, textures.mottled]) if rng.uniform() < 0.6 else mats.plain())
    if rng.uniform() < 0.7:
        e, top = 0.35, h + rng.uniform(0.8, 2.5)
        z = d / 2 + e
        for side in (-1, 1):
            roof = quad((-w / 2 - e, h - 0.25, side * z), (w + 2 * e, 0, 0), (0, top - h + 0.25, -side * z))
            stage.add(roof.moved(place), mats.matte_textured([textures.bricks]) if rng.uniform() < 0.5
                      else mats.plain())
        gable = [[(s * w / 2, h, -d / 2), (s * w / 2, h, d / 2), (s * w / 2, top - 0.3, 0)] for s in (-1, 1)]
        stage.add(Mesh(gable, [[0, 2, 1], [3, 4, 5]]).moved(place), mats.plain())
    frames, panes = [], []
    for x in np.arange(-w / 2 + 0.5, w / 2 - 1.0, rng.uniform(1.2, 2.2)):
        for y in np.arange(0.9, h - 1.2, 2.4):
            for z, s in ((d / 2, 1), (-d / 2, -1)):
                frames.append(box((x - 0.05, y - 0.05, z - 0.03), (x + 0.85, y + 1.15, z + 0.03)))
                panes.append(box((x, y, z - 0.035), (x + 0.8, y + 1.1, z + 0.035)))
    if panes:
        stage.add(merged(frames).moved(place), mats.plain())
        if rng.uniform() < 0.25:
            stage.emit(merged(panes).moved(place), rng.uniform(5, 100), lamps.lamp_color(rng, 0.1))
        else:
            stage.add(merged(panes).moved(place), mats.plastic(0.02) if rng.uniform() < 0.7 else mats.metal(0.02))


def _pergola(stage, place):
    """Beams on posts, whose shadows fall in stripes."""
    rng = stage.rng
    w, d, h = rng.uniform(1.5, 4), rng.uniform(1.5, 4), rng.uniform(2, 2.8)
    parts = [box((x - 0.05, -0.3, z - 0.05), (x + 0.05, h, z + 0.05)) for x in (-w / 2, w / 2) for z in (-d / 2, d / 2)]
    parts += [box((-w / 2 - .2, h, z - .03), (w / 2 + .2, h + .12, z + .03)) for z in (-d / 2, d / 2)]
    parts += [box((x, h + 0.12, -d / 2 - .3), (x + 0.05, h + 0.2, d / 2 + .3))
              for x in np.arange(-w / 2, w / 2, rng.uniform(0.12, 0.5))]
    stage.add(merged(parts).moved(place), stage.materials.wood() if rng.uniform() < 0.6 else stage.materials.any(),
              solid=False)


def _water(stage, ground):
    """A rippled mirror-like surface, low in the ground: it shows the sky, and no floor that paths would hardly find."""
    rng, size = stage.rng, ground.size
    x, z = np.meshgrid(np.linspace(-size, size, 80), np.linspace(-size, size, 80))
    f = rng.normal(0, rng.uniform(2, 8), (5, 2))
    y = sum(np.sin(a * x + b * z + p) for (a, b), p in zip(f, rng.uniform(0, 6, 5))) * rng.uniform(0.0005, 0.006)
    level = rng.uniform(-0.2, 0.15) * max(ground.lift, 0.2)
    surface = grid(np.stack([x, y + level, z], -1), flip=True)
    color = stage.materials.color(value=(0.05, 0.4))
    stage.add(surface, (stage.scene.material("water", color, roughness=float(rng.choice([0.02, 0.05, 0.15]))), 1.0),
              solid=False)


def _flowers(stage, ground, radius):
    """Stalks with coloured heads."""
    rng = stage.rng
    n = int(rng.integers(30, 300))
    x, z = rng.normal(0, radius / 2, (2, n))
    root = np.stack([x, ground.height(x, z), z], -1)
    head = root + np.stack([rng.normal(0, 0.04, n), rng.uniform(0.15, 0.6, n), rng.normal(0, 0.04, n)], -1)
    stage.add(tubes(np.stack([root, head], 1), np.full((n, 2), 0.004), 4), stage.materials.matte(), solid=False)
    kinds = int(rng.integers(1, 4))
    bloom = sphere(rng.uniform(0.02, 0.05), 8, 5)
    for k in range(kinds):
        petals = [bloom.at(*p) for p in head[k::kinds]]
        stage.add(merged(petals), stage.materials.matte(saturation=(0.4, 1)), solid=False)


def _boxes(stage, place):
    """A stack of crates, or blocks of a ruin."""
    rng, parts = stage.rng, []
    for row in range(int(rng.integers(1, 5))):
        for k in range(int(rng.integers(1, 5 - row)) if row < 4 else 1):
            s = rng.uniform(0.3, 0.6)
            parts.append(slab(s, 0.5, s).moved(rotate(1, rng.normal(0, 12))).at(k * 0.65, row * 0.5,
                                                                                rng.normal(0, 0.03)))
    for k in range(2):
        if parts[k::2]:
            stage.add(merged(parts[k::2]).moved(place), stage.materials.any())


def _paving(stage, ground):
    """A path of slabs."""
    rng = stage.rng
    n, turn = int(rng.integers(8, 40)), rng.uniform(0, 360)
    stones = []
    for k in range(n):
        at = rotate(1, turn) @ np.array([rng.normal(0, 0.05), 0, (k - n / 2) * 0.5, 1])
        x, z = at[0] + 0.4 * math.sin(k * 0.3), at[2]
        stones.append(slab(rng.uniform(0.35, 0.6), 0.08, 0.42).moved(rotate(1, turn + rng.normal(0, 6))).at(
            x, float(ground.height(x, z)) - 0.03, z))
    stage.add(merged(stones), stage.materials.plain(), solid=False)


def _wires(stage, ground):
    """Lines that sag between posts, thin against the sky; washing may hang on them."""
    rng, size = stage.rng, ground.size
    x = np.array([-size * 0.6, size * 0.6])
    z, h = rng.uniform(-0.5, 0.3) * size, rng.uniform(2, 4)
    for end in x:
        stage.add(box((end - 0.06, -1, z - 0.06), (end + 0.06, h + 0.3, z + 0.06)), stage.materials.wood())
    t = np.linspace(0, 1, 24)
    for k in range(int(rng.integers(1, 5))):
        y = h - 0.12 * k - rng.uniform(0.2, 0.7) * 4 * t * (1 - t)
        path = np.stack([x[0] + (x[1] - x[0]) * t, y, 0 * t + z + 0.05 * k], -1)
        stage.add(tubes([path], [np.full(24, rng.uniform(0.003, 0.012))], 5), stage.materials.matte(), solid=False)
    if rng.uniform() < 0.5:
        for j in rng.permutation(20)[:6] + 2:
            w, drop = rng.uniform(0.3, 0.8), rng.uniform(0.4, 1.0)
            stage.add(quad(path[j] - (w / 2, drop, 0), (w, 0, 0), (0, drop, 0)), stage.materials.cloth(), solid=False)


def _rocks(stage, ground, spread):
    rng = stage.rng
    rocks = []
    for _ in range(int(rng.integers(3, 14))):
        x, z = rng.normal(0, spread / 2, 2)
        body = superellipsoid(rng.uniform(0.1, 0.9, 3), rng.uniform(0.5, 1.2))
        rocks.append(body.moved(rotate(1, rng.uniform(0, 360)) @ rotate(0, rng.normal(0, 20))).at(
            x, float(ground.height(x, z)), z))
    stage.add(merged(rocks), stage.materials.matte_textured([textures.mottled, textures.marble, textures.speckle]),
              solid=False)


def _light(stage, size):
    """A sky, with or without a sun; or night with lamps."""
    rng = stage.rng
    k = rng.uniform()
    if k < 0.78:
        stage.environment = skies.daylight(rng, k < 0.6)
        if k > 0.6 and rng.uniform() < 0.5:
            stage.light("directional", (0, 0, 0), rng.normal(size=3) * (1, 0.1, 1) - (0, 0.8, 0),
                        lamps.lamp_color(rng, 0),
                        rng.uniform(1, 10))
        stage.options += ["--env-scale", f"{math.exp(rng.normal(0, 0.6)):.3f}"]
        return
    stage.environment = skies.lights_at_night(rng) if rng.uniform() < 0.5 else skies.daylight(rng, False) * 0.03
    for _ in range(int(rng.integers(1, 6))):
        x, z = rng.normal(0, size / 3, 2)
        y = rng.uniform(1.5, 4)
        if rng.uniform() < 0.7:
            stage.emit(sphere(rng.uniform(0.02, 0.2), 20, 12).at(x, y, z), rng.uniform(20, 300), lamps.lamp_color(rng))
            stage.add(tubes([[(x, -1, z), (x, y, z)]], [[0.03, 0.02]], 8), stage.materials.metal(), solid=False)
        else:
            stage.light("point", (x, y, z), (x, 0, z + 1), lamps.lamp_color(rng), rng.uniform(2, 30))


def build(stage):
    rng = stage.rng
    size = rng.uniform(3, 12)
    ground = Ground(rng, size)
    stage.add(ground.mesh(), stage.materials.matte_textured([textures.mottled, textures.speckle, textures.bricks])
              if rng.uniform() < 0.6 else stage.materials.plain(), solid=False)

    def spot(spread=0.45, turn=True):
        x, z = rng.normal(0, size * spread, 2)
        place = translate(x, float(ground.height(x, z)), z)
        stage.interest.append(place[:3, 3] + (0, 0.6, 0))
        return place @ rotate(1, rng.uniform(0, 360)) if turn else place

    trees = int(rng.choice([0, 1, 2, 4, 7]))
    for _ in range(trees):
        _tree(stage, spot() @ scale(rng.uniform(0.6, 1.6)), 9000 / (trees + 1))
    if rng.uniform() < 0.55:
        _grass(stage, ground, size * rng.uniform(0.3, 0.8))
    if rng.uniform() < 0.25:
        _fur(stage, spot(0.15) @ scale(rng.uniform(0.5, 1.5)))
    for _ in range(int(rng.choice([0, 0, 1, 2]))):
        _fence(stage, ground)
    if rng.uniform() < 0.4 and size > 4:
        _house(stage, translate(0, 0, -size * 0.8) @ translate(rng.normal(0, 2), 0, 0) @ rotate(1, rng.normal(0, 25)))
        stage.interest.append((0, 1.5, -size * 0.8))
    for kind, chance in ((_pergola, 0.12), (_boxes, 0.3)):
        if rng.uniform() < chance:
            kind(stage, spot(0.25))
    for kind, chance in ((_water, 0.12), (_paving, 0.2), (_wires, 0.15)):
        if rng.uniform() < chance:
            kind(stage, ground)
    if rng.uniform() < 0.2:
        _flowers(stage, ground, size * 0.5)
    if rng.uniform() < 0.5:
        _rocks(stage, ground, size * 0.5)
    for _ in range(int(rng.integers(0, 4))):
        furniture.FURNITURE[rng.integers(len(furniture.FURNITURE))](stage, spot(0.25))
    for _ in range(int(rng.integers(0, 5))):
        furniture.SMALL[rng.integers(len(furniture.SMALL))](stage, spot(0.2) @ scale(rng.uniform(1, 4)))
    _light(stage, size)
    stage.interest.append((0.0, 0.4, 0.0))

    def propose():
        target = np.array(stage.interest[rng.integers(len(stage.interest))], float) + rng.normal(0, 0.3, 3)
        a = rng.uniform(0, 2 * math.pi)
        r = size * rng.uniform(0.15, 1.0)
        x, z = target[0] + r * math.cos(a), target[2] + r * math.sin(a)
        return (x, ground.height(x, z) + rng.choice([0.45, 0.8, 1.6, 3.0]), z), target
    return propose
