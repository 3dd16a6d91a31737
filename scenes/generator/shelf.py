"""An indoor scene: bookshelf."""

import math
import random

from . import textures
from .glb import Scene
from .maths import add, normalize, rotate_z, scale, translate
from .shapes import (Mesh, box, icosphere, lathe, merged, quad, smooth)


def _book(thickness, height, depth):
    """(cover, pages) of a standing book whose spine faces +Z."""
    board, lip = 0.003, 0.004
    spine = []
    for k in range(9):
        t = math.pi * k / 8
        spine.append((-math.cos(t) * thickness / 2,
                      math.sin(t) * min(0.008, thickness / 4)))
    cover = merged([
        box((-thickness / 2, 0, -depth), (-thickness / 2 + board, height, 0)),
        box((thickness / 2 - board, 0, -depth), (thickness / 2, height, 0)),
    ]).faceted()
    strip = Mesh()
    for x, z in spine:
        for y in (0, height):
            strip.positions.append((x, y, z))
            strip.normals.append(normalize((x / thickness, 0, z / 0.016)))
    for k in range(8):
        a = 2 * k
        strip.indices += (a, a + 2, a + 3, a, a + 3, a + 1)
    pages = box((-thickness / 2 + board, lip, -depth + lip),
                (thickness / 2 - board, height - lip, -0.001))
    return cover.add(strip.oriented()), pages


def _book_materials(scene, rng):
    covers = []
    for i in range(14):
        hue = rng.random() * math.tau
        value = rng.uniform(0.12, 0.6)
        color = [value * (0.72 + 0.28 * math.cos(hue + k * math.tau / 3))
                 for k in range(3)]
        extra = {}
        if i % 3 == 0:
            extra["KHR_materials_clearcoat"] = {
                "clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.05}
        covers.append(scene.material(f"cover {i}", color,
                                     roughness=0.05 + 0.35 * i / 13, **extra))
    return covers


def _fill_shelf(rng, y, x, end, depth, covers, pages):
    """Books from x to end; now and then one leans on its neighbour."""
    while True:
        thickness = rng.uniform(0.018, 0.055)
        height = rng.uniform(0.2, 0.3)
        if x + thickness > end:
            return
        cover, paper = _book(thickness, height, rng.uniform(0.16, 0.22))
        lean = rng.uniform(4, 9) if rng.random() < 0.06 else 0.0
        reach = height * math.sin(math.radians(lean))
        if x + thickness + reach > end:
            return
        # Turning about the lower left corner lifts nothing off the shelf
        # when the book leans left, so its foot starts `reach` further right.
        place = (translate(x + reach, y, depth - rng.uniform(0.0, 0.03))
                 @ rotate_z(lean) @ translate(thickness / 2, 0, 0))
        rng.choice(covers).append(cover.moved(place))
        pages.append(paper.moved(place))
        x += thickness + reach + rng.uniform(0.0005, 0.002)


def _shelf_frame(width, height, depth, levels):
    boards = [box((-width / 2, y, 0), (width / 2, y + 0.025, depth), 1.5)
              for y in levels]
    boards += [box((x, 0, 0), (x + 0.03, height, depth), 1.5)
               for x in (-width / 2 - 0.03, width / 2)]
    boards.append(box((-width / 2, 0, 0), (width / 2, height, 0.01), 1.5))
    return merged(boards)


def _vase(scale_by=1.0):
    profile = [(0.05, 0.0), (0.075, 0.04), (0.09, 0.09), (0.08, 0.14),
               (0.045, 0.19), (0.03, 0.23), (0.035, 0.26), (0.05, 0.275)]
    inner = [(r - 0.004, y) for r, y in reversed(profile[1:])]
    solid = lathe([[(0, 0), (0.05, 0)], smooth(profile),
                   [profile[-1], inner[0]], smooth(inner)], 48)
    return solid.moved(scale(scale_by))


def bookshelf():
    scene = Scene("bookshelf", "many glossy and clear-coated surfaces under "
                               "one large and one small light")
    rng = random.Random(2024)
    timber = scene.material("timber", roughness=0.35, color_map=scene.texture(
        textures.wood(seed=21, light=(.5, .36, .26), dark=(.32, .2, .13))))
    paper = scene.diffuse("paper", (0.75, 0.7, 0.58))
    plaster = scene.diffuse("plaster", (0.62, 0.6, 0.56))
    floor = scene.material("floor", roughness=0.25, color_map=scene.texture(
        textures.wood(seed=22)))
    brass = scene.material("brass", (0.89, 0.75, 0.42), 1.0, 0.15)
    enamel = scene.material("enamel", (0.1, 0.25, 0.2), roughness=0.2)

    levels = (0.05, 0.4, 0.75, 1.1, 1.45, 1.8)
    scene.place("shelf", (_shelf_frame(1.8, 1.825, 0.28, levels), timber))
    materials = _book_materials(scene, rng)
    covers, pages = [[] for _ in materials], []
    for k, y in enumerate(levels[:-1]):
        # The vase and the lamp take the place of some books.
        start = -0.4 if k == 3 else -0.895
        end = 0.45 if k == 2 else 0.895
        _fill_shelf(rng, y + 0.025, start, end, 0.25, covers, pages)
    scene.place("books", *((merged(c), m) for c, m in zip(covers, materials)
                           if c), (merged(pages), paper))
    scene.place("vase", (_vase().moved(translate(-0.65, 1.127, 0.15)), brass))
    scene.place("floor vase", (_vase(1.5).moved(translate(1.15, 0.001, .35)),
                               enamel))
    stand = lathe([[(0, 0), (0.06, 0)], [(0.06, 0), (0.06, 0.012)],
                   [(0.06, 0.012), (0.008, 0.02)],
                   [(0.008, 0.02), (0.008, 0.15)], [(0.008, .15), (0, .15)]],
                  32)
    at = translate(0.68, 0.777, 0.14)
    scene.place("lamp stand", (stand.moved(at), brass))
    scene.place("lamp", (icosphere(3, 0.03).moved(at @ translate(0, .18, 0)),
                         scene.emitter("lamp", (160, 105, 50))))
    scene.place("floor", (quad((-3, 0, 3.5), (6, 0, 0), (0, 0, -3.5),
                               (4, 2.33)), floor))
    scene.place("wall", (quad((-3, 0, -0.01), (6, 0, 0), (0, 3, 0)), plaster))
    scene.place("ceiling light", (quad((-0.8, 2.9, 1.0), (1.6, 0, 0),
                                       (0, 0, 1.2)),
                                  scene.emitter("panel", (24.0, 24.0, 25.0))))
    scene.camera((0.35, 1.15, 2.75), (0.05, 0.93, 0.1), 42)
    return scene
