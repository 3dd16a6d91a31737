"""Indoor scenes: interior, door_ajar."""

import math

from . import textures
from .glb import Scene
from .maths import add, mul, normalize, rotate_x, rotate_y, translate
from .shapes import (arc, box, disc, icosphere, lathe, merged, quad, smooth,
                     superellipsoid, tube)


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
    body = lathe([[(0, 0), (0.05, 0)], smooth(profile), smooth(lid)], 48)
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
