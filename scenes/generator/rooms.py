"""Indoor scenes: bookshelf, interior, door_ajar."""

import math
import random

from . import textures
from .glb import Scene
from .maths import add, mul, normalize, rotate_x, rotate_y
from .maths import rotate_z, scale, translate
from .shapes import (Mesh, arc, box, disc, icosphere, lathe, merged, quad,
                     superellipsoid, tube)


# ---- bookshelf ----------------------------------------------------------

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
    solid = lathe([[(0, 0), (0.05, 0)], _smooth(profile),
                   [profile[-1], inner[0]], _smooth(inner)], 48)
    return solid.moved(scale(scale_by))


def _smooth(points, steps=4):
    """Catmull-Rom curve through a lathe profile."""
    out = []
    for k in range(len(points) - 1):
        p0, p1 = points[max(k - 1, 0)], points[k]
        p2, p3 = points[k + 1], points[min(k + 2, len(points) - 1)]
        for i in range(steps):
            t = i / steps
            out.append(tuple(0.5 * (
                2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t * t
                + (3 * b - a - 3 * c + d) * t ** 3)
                for a, b, c, d in zip(p0, p1, p2, p3)))
    return out + [points[-1]]


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


# ---- interior -----------------------------------------------------------

ROOM = (2.5, 2.7, 2.0)        # half width, height, half depth


def _room_shell(scene):
    """Floor, walls and ceiling; the left wall is thick, with a window."""
    w, h, d = ROOM
    floor = scene.material("parquet", roughness=0.3, color_map=scene.texture(
        textures.wood(seed=31)))
    paper = scene.diffuse("wallpaper", (1, 1, 1), color_map=scene.texture(
        textures.wallpaper()))
    brick = scene.diffuse(
        "brick", (1, 1, 1),
        color_map=scene.texture(textures.brick_color()),
        normal_map=scene.texture(textures.brick_normal()))
    plaster = scene.diffuse("plaster", (0.78, 0.77, 0.74))
    scene.place("floor", (quad((-w, 0, d), (2 * w, 0, 0), (0, 0, -2 * d),
                               (4, 3.2)), floor))
    scene.place("back wall", (quad((-w, 0, -d), (2 * w, 0, 0), (0, h, 0),
                                   (5, 2.7)), brick))
    scene.place("papered walls", (merged([
        quad((w, 0, -d), (0, 0, 2 * d), (0, h, 0), (4, 2.7)),
        quad((w, 0, d), (-2 * w, 0, 0), (0, h, 0), (5, 2.7))]), paper))
    # The window is 1.8 by 1.5 m; beyond the left wall's inner face lie
    # 0.25 m of reveal.
    a, b, z0, z1, out = 0.8, 2.3, -1.2, 0.6, -w - 0.25
    scene.place("window wall", (merged([
        box((out, 0, -d), (-w, a, d)), box((out, b, -d), (-w, h, d)),
        box((out, a, -d), (-w, b, z0)), box((out, a, z1), (-w, b, d)),
        quad((-w, h, -d), (2 * w, 0, 0), (0, 0, 2 * d))]), plaster))
    frame = scene.material("frame", (0.8, 0.8, 0.78), roughness=0.3)
    x0, x1, middle = -w - 0.14, -w - 0.09, (z0 + z1) / 2
    scene.place("window frame", (merged(
        [box((x0, a, z), (x1, b, z + 0.05))
         for z in (z0, middle - 0.025, z1 - 0.05)]
        + [box((x0, y, z0), (x1, y + 0.05, z1))
           for y in (a, 1.75, b - 0.05)]), frame))


def _outside(scene):
    """All the light: a sky panel, and a small sun in front of it."""
    scene.place("sky", (quad((-16, -1, 22), (0, 0, -44), (0, 22, 0)),
                        scene.emitter("sky", (12.0, 15.0, 19.0))))
    sun = (-14.0, 9.6, 2.2)
    towards_window = normalize(add(mul(sun, -1), (-2.5, 1.5, -0.3)))
    scene.place("sun", (disc(sun, 0.12, towards_window, 24),
                        scene.emitter("sun", (190000, 165000, 130000))))
    scene.place("ground", (quad((-16, -0.5, 22), (13, 0, 0), (0, 0, -44)),
                           scene.diffuse("ground", (0.3, 0.32, 0.25))))


def _chair():
    legs = [box((x, 0, z), (x + 0.04, 0.45, z + 0.04))
            for x in (-0.2, 0.16) for z in (-0.2, 0.16)]
    back = [box((x, 0.45, -0.2), (x + 0.04, 0.95, -0.17))
            for x in (-0.2, 0.16)]
    slats = [box((-0.2, y, -0.195), (0.2, y + 0.08, -0.175))
             for y in (0.6, 0.72, 0.84)]
    return merged(legs + back + slats + [box((-.22, .43, -.22),
                                             (.22, .47, .22))])


def _sofa():
    """(frame, cushions), facing +Z."""
    frame = merged([box((-0.95, 0.05, -0.4), (0.95, 0.25, 0.4)),
                    box((-0.95, 0.25, -0.4), (0.95, 0.75, -0.22)),
                    box((-0.95, 0.25, -0.4), (-0.78, 0.55, 0.4)),
                    box((0.78, 0.25, -0.4), (0.95, 0.55, 0.4))])
    seat = superellipsoid((0.78, 0.2, 0.6), 0.35)
    pillow = superellipsoid((0.7, 0.42, 0.18), 0.5)
    cushions = [seat.moved(translate(x, 0.34, 0.09)) for x in (-0.39, 0.39)]
    cushions += [pillow.moved(translate(x, 0.62, -0.12) @ rotate_x(-12))
                 for x in (-0.39, 0.39)]
    return frame, merged(cushions)


def interior():
    scene = Scene("interior", "a textured, normal-mapped room lit only "
                              "through a window by sky and a tiny sun")
    _room_shell(scene)
    _outside(scene)
    oak = scene.material("oak", (0.36, 0.22, 0.12), roughness=0.3)
    linen = scene.material("linen", (0.2, 0.3, 0.38), KHR_materials_sheen={
        "sheenColorFactor": [0.2, 0.25, 0.3], "sheenRoughnessFactor": 0.5})
    wine = scene.diffuse("wine cloth", (0.42, 0.1, 0.09))
    china = scene.material("china", (0.8, 0.8, 0.78), roughness=0.08)

    table = [box((-0.7, 0.71, -0.45), (0.7, 0.75, 0.45))]
    table += [box((x, 0, z), (x + 0.06, 0.71, z + 0.06))
              for x in (-0.66, 0.6) for z in (-0.41, 0.35)]
    at = translate(-0.75, 0, 0.05)
    chairs = [_chair().moved(at @ translate(x, 0, z) @ rotate_y(turn))
              for x, z, turn in ((-0.3, 0.62, 180), (0.35, -0.68, 8),
                                 (0.95, 0.1, -100))]
    scene.place("table and chairs", (merged(
        [merged(table).moved(at)] + chairs), oak))
    bowl = lathe([[(0, 0), (0.06, 0)], arc((0, .16), .171, -69.4, -10, 10),
                  [(0.1684, 0.1303), (0.162, 0.1303)],
                  list(reversed(arc((0, 0.16), 0.165, -90, -10.4, 12)))], 40)
    scene.place("bowl", (bowl.moved(at @ translate(0, 0.752, 0)), china))
    fruit = [icosphere(3, 0.042).moved(at @ translate(x, y, z))
             for x, y, z in ((0.05, 0.815, 0), (-0.045, 0.815, 0.03),
                             (-0.01, 0.815, -0.065), (0, 0.88, 0))]
    scene.place("fruit", (merged(fruit), scene.material(
        "orange", (0.85, 0.33, 0.03), roughness=0.4)))
    frame, cushions = _sofa()
    at = translate(1.35, 0, -1.5)
    scene.place("sofa", (frame.moved(at), linen), (cushions.moved(at), wine))

    art = scene.diffuse("picture", (1, 1, 1), color_map=scene.texture(
        textures.picture(), repeat=False))
    x, y, z = 0.8, 1.35, -ROOM[2]
    scene.place("picture", (quad((x, y, z + 0.02), (1.05, 0, 0), (0, .7, 0),
                                 (1, 1)), art))
    scene.place("picture frame", (merged(
        [box((x - .05, y - .05, z), (x + 1.1, y, z + 0.04)),
         box((x - .05, y + .7, z), (x + 1.1, y + .75, z + 0.04)),
         box((x - .05, y, z), (x, y + .7, z + 0.04)),
         box((x + 1.05, y, z), (x + 1.1, y + .7, z + 0.04))]),
        scene.material("gilt", (0.95, 0.75, 0.38), 1.0, 0.3)))
    scene.camera((1.95, 1.5, 1.85), (-0.55, 0.95, -0.85), 50)
    return scene


# ---- door_ajar ----------------------------------------------------------

def _teapot():
    profile = [(0.05, 0.0), (0.085, 0.02), (0.105, 0.06), (0.1, 0.1),
               (0.075, 0.135), (0.05, 0.145)]
    lid = [(0.055, 0.146), (0.035, 0.162), (0.012, 0.17), (0.01, 0.178),
           (0.016, 0.19), (0.0, 0.198)]
    body = lathe([[(0, 0), (0.05, 0)], _smooth(profile), _smooth(lid)], 48)
    spout = tube([(0.085, 0.05, 0), (0.12, 0.065, 0), (0.145, 0.095, 0),
                  (0.16, 0.13, 0), (0.175, 0.14, 0)],
                 [0.03, 0.024, 0.017, 0.013, 0.014], 16)
    handle = [(-0.09, 0.11, 0)]
    handle += [(-0.1 - 0.055 * math.sin(math.radians(a)),
                0.075 + 0.04 * math.cos(math.radians(a)), 0)
               for a in range(15, 180, 15)] + [(-0.09, 0.04, 0)]
    return body.add(spout).add(tube(handle, [0.009] * len(handle), 12))


def _two_rooms():
    """The camera's room (z from -2 to 2), the lit room behind it (z from
    -5 to -2.1), and between them a wall with a doorway of 0.9 by 2.05 m."""
    h = 2.6
    front, back, left, right = 2.0, -5.0, -2.2, 2.2
    door0, door1, top = -1.1, -0.2, 2.05
    return merged([
        quad((left, 0, back), (right - left, 0, 0), (0, h, 0)),
        quad((right, 0, front), (left - right, 0, 0), (0, h, 0)),
        quad((left, 0, front), (0, 0, back - front), (0, h, 0)),
        quad((right, 0, back), (0, 0, front - back), (0, h, 0)),
        quad((left, h, back), (right - left, 0, 0), (0, 0, front - back)),
        box((left, 0, -2.1), (door0, h, -2.0)),
        box((door1, 0, -2.1), (right, h, -2.0)),
        box((door0, top, -2.1), (door1, h, -2.0))])


def door_ajar():
    scene = Scene("door_ajar", "indirect light only: the lamp is in another "
                               "room behind a door that is ajar")
    plaster = scene.diffuse("plaster", (0.75, 0.73, 0.7))
    scene.place("rooms", (_two_rooms(), plaster))
    scene.place("floor", (quad((-2.2, 0, 2), (4.4, 0, 0), (0, 0, -7),
                               (3, 4.8)), scene.material(
        "floor", roughness=0.25, color_map=scene.texture(
            textures.wood(seed=41, light=(.62, .47, .33))))))
    # The hinge is on the left; the door swings into the lit room.
    swing = translate(-1.1, 0, -2.1) @ rotate_y(26)
    scene.place("door", (box((0.005, 0.005, -0.04), (0.895, 2.04, 0)).moved(
        swing), scene.material("door paint", (.55, .5, .42), roughness=0.35)))
    knob = icosphere(3, 0.03).moved(swing @ translate(0.83, 1.0, 0.05))
    scene.place("knob", (knob, scene.material("brass", (.89, .75, .42), 1.0,
                                              0.2)))
    scene.place("lamp", (quad((-1.6, 2.55, -4.6), (2.6, 0, 0), (0, 0, 1.8)),
                         scene.emitter("lamp", (130.0, 117.0, 98.0))))
    _tea_table(scene)
    scene.camera((0.55, 1.35, 1.75), (0.02, 0.85, -1.0), 45)
    return scene


def _tea_table(scene):
    walnut = scene.material("walnut", (0.2, 0.11, 0.06), roughness=0.15)
    table = [box((-0.6, 0.62, -0.3), (0.6, 0.66, 0.3))]
    table += [box((x, 0, z), (x + 0.05, 0.62, z + 0.05))
              for x in (-0.56, 0.51) for z in (-0.26, 0.21)]
    at = translate(0.35, 0, -0.5)
    scene.place("table", (merged(table).moved(at), walnut))
    pots = ((-0.36, 0.08, 25, scene.material("glaze", (0.12, 0.3, 0.42),
                                             roughness=0.12)),
            (0.02, -0.06, -20, scene.material("steel", (.62, .61, .6), 1.0,
                                              0.08)),
            (0.38, 0.06, 160, scene.material("copper", (.95, .64, .54), 1.0,
                                             0.35)))
    for x, z, turn, material in pots:
        pot = _teapot().moved(at @ translate(x, 0.661, z) @ rotate_y(turn))
        scene.place("teapot", (pot, material))
    ball = icosphere(4, 0.05).moved(at @ translate(-0.14, 0.712, 0.19))
    scene.place("glass ball", (ball, scene.glass("glass", 1.5)))
