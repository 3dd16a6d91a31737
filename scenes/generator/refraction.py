"""Glass and water: glass_of_water, pool, torus_glass."""

import math

from . import textures
from .glb import Scene
from .maths import rotate_x, rotate_y, rotate_z, translate
from .shapes import (Mesh, box, icosphere, lathe, merged, quad, surface,
                     torus)


def glass_of_water():
    scene = Scene("glass_of_water", "caustics of a small light through "
                                    "nested glass and water")
    # Outer wall, rim, inner wall and floor of the tumbler, base up.
    glass = lathe([[(0, 0), (0.030, 0)], [(0.030, 0), (0.038, 0.115)],
                   [(0.038, .115), (.0373, .1158), (.0362, .1158),
                    (0.0355, 0.115)],
                   [(0.0355, 0.115), (0.0281, 0.010)], [(.0281, .010),
                                                        (0, 0.010)]], 96)
    # The water reaches 0.4 mm into the glass: no air gap, no coincident
    # faces. Light thus enters the water before it leaves the glass; a
    # renderer that takes every crossing as one from or to air is wrong only
    # inside that overlap, so no priorities between volumes are needed.
    def wall(y):
        return 0.0281 + (y - 0.010) * (0.0355 - 0.0281) / 0.105 + 0.0004
    low, high = 0.0096, 0.082
    water = lathe([[(0, low), (wall(low), low)],
                   [(wall(low), low), (wall(high), high)],
                   [(wall(high), high), (0, high)]], 96)
    # 0.2 mm of air keep the base off the table top.
    at = translate(0, 0.0002, 0)
    scene.place("tumbler", (glass.moved(at), scene.glass("glass", 1.5)))
    scene.place("water", (water.moved(at), scene.glass("water", 1.33)))

    timber = scene.material("table", roughness=0.4, color_map=scene.texture(
        textures.wood(planks=3, seed=51)))
    scene.place("table", (quad((-0.6, 0, 0.5), (1.2, 0, 0), (0, 0, -1.0),
                               (4, 3.4)), timber))
    scene.place("wall", (quad((-1.2, -0.4, -0.5), (2.4, 0, 0), (0, 1.6, 0)),
                         scene.diffuse("wall", (0.45, 0.5, 0.55))))
    scene.place("light", (icosphere(3, 0.006, (-0.24, 0.30, -0.14)),
                          scene.emitter("light", (4200, 3700, 2900))))
    scene.place("fill", (quad((-0.8, 1.1, -0.4), (1.6, 0, 0), (0, 0, 1.4)),
                         scene.emitter("fill", (0.6, 0.65, 0.7))))
    scene.camera((0.12, 0.21, 0.36), (0.025, 0.042, 0.01), 25)
    return scene


# ---- pool ---------------------------------------------------------------

HALF_X, HALF_Z, DEPTH, LEVEL = 2.0, 1.25, 1.2, -0.12
WAVES = ((3.1, 1.3, 0.0, 0.010), (-2.2, 3.9, 1.1, 0.008),
         (5.7, -2.8, 2.3, 0.005), (1.1, 7.3, 4.0, 0.0035),
         (-8.9, -4.1, 0.7, 0.002), (9.7, 8.3, 3.3, 0.0012))


def _water():
    """A closed volume. Its sides and bottom lie behind the opaque basin and
    are never hit: light only ever crosses the wavy top."""
    x, z, bottom = HALF_X + 0.05, HALF_Z + 0.05, -DEPTH - 0.05

    def point(u, v):
        px, pz = x * (2 * u - 1), z * (2 * v - 1)
        return (px, LEVEL + sum(a * math.sin(kx * px + kz * pz + phase)
                                for kx, kz, phase, a in WAVES), pz)
    nu, nv = 112, 72
    top = surface(nu, nv, point, hint=lambda u, v, p: (0, 1, 0))
    # Each side shares the top's border vertices, so the volume is tight.
    row = nu + 1
    border = ([top.positions[i] for i in range(nu)]
              + [top.positions[j * row + nu] for j in range(nv)]
              + [top.positions[nv * row + i] for i in range(nu, 0, -1)]
              + [top.positions[j * row] for j in range(nv, 0, -1)])
    sides = Mesh([(0, bottom, 0)])
    for p in border:
        sides.positions += [p, (p[0], bottom, p[2])]
    for k in range(len(border)):
        a, b = 1 + 2 * k, 1 + 2 * ((k + 1) % len(border))
        sides.indices += (a, b, b + 1, a, b + 1, a + 1, 0, a + 1, b + 1)
    return top, sides


def _basin(scene):
    x, z = HALF_X, HALF_Z
    down = (0, -DEPTH, 0)
    tiled = scene.material("basin tiles", roughness=0.25,
                           color_map=scene.texture(textures.tiles()))
    basin = [quad((-x, -DEPTH, z), (2 * x, 0, 0), (0, 0, -2 * z), (4, 2.5))]
    for origin, edge, repeats in (
            ((-x, 0, -z), (2 * x, 0, 0), 4), ((x, 0, z), (-2 * x, 0, 0), 4),
            ((-x, 0, z), (0, 0, -2 * z), 2.5), ((x, 0, -z), (0, 0, 2 * z),
                                                2.5)):
        foot = tuple(a + b for a, b in zip(origin, down))
        basin.append(quad(foot, edge, (0, DEPTH, 0), (repeats, 1.2)))
    scene.place("basin", (merged(basin), tiled))
    stone = scene.material("deck", roughness=0.7, color_map=scene.texture(
        textures.tiles(4, 6, (0.62, 0.56, 0.48), (0.45, 0.43, 0.4))))
    far = 8.0
    deck = [((-far, 0, -z), 2 * far, far - z), ((-far, 0, far), 2 * far,
                                                far - z),
            ((-far, 0, z), far - x, 2 * z), ((x, 0, z), far - x, 2 * z)]
    scene.place("deck", (merged(
        [quad(o, (w, 0, 0), (0, 0, -d), (w / 2, d / 2)) for o, w, d in deck]),
        stone))


def pool():
    scene = Scene("pool", "caustics of a small sun through a wavy water "
                          "surface, seen through that surface")
    _basin(scene)
    top, sides = _water()
    water = scene.glass("water", 1.33, attenuationDistance=6.0,
                        attenuationColor=[0.55, 0.85, 0.9])
    scene.place("water", (top, water), (sides, water))
    scene.place("wall", (quad((-8, 0, -4), (16, 0, 0), (0, 2.6, 0)),
                         scene.diffuse("plaster", (0.72, 0.66, 0.58))))
    rubber = scene.material("ball", (0.75, 0.12, 0.08), roughness=0.3)
    scene.place("sunken ball", (icosphere(4, 0.18, (0.5, -DEPTH + 0.181, 0.1)),
                                rubber))
    scene.place("sun", (icosphere(3, 0.15, (2.4, 6.5, -1.6)),
                        scene.emitter("sun", (4200, 3750, 3000))))
    scene.place("sky", (quad((-6, 9, -6), (12, 0, 0), (0, 0, 12)),
                        scene.emitter("sky", (0.35, 0.45, 0.6))))
    scene.camera((-0.7, 1.65, 3.2), (0.1, -0.45, -0.35), 46)
    return scene


def torus_glass():
    scene = Scene("torus_glass", "a diffuse object inside glass: its only "
                                 "direct light is refracted")
    ring = torus(0.26, 0.085, 64, 32).moved(
        translate(0, 0.5, 0) @ rotate_z(28) @ rotate_x(55))
    scene.place("torus", (ring, scene.diffuse("paint", (0.75, 0.3, 0.08))))
    cube = box((-0.45, 0.0, -0.45), (0.45, 0.9, 0.45))
    # 2 mm of air keep the cube off the floor.
    scene.place("cube", (cube.moved(translate(0, 0.002, 0) @ rotate_y(32)),
                         scene.glass("glass", 1.5)))
    scene.place("stage", (merged([
        quad((-4, 0, 4), (8, 0, 0), (0, 0, -6)),
        quad((-4, 0, -2), (8, 0, 0), (0, 4, 0))]),
        scene.diffuse("stage", (0.55, 0.55, 0.58))))
    scene.place("light", (icosphere(3, 0.07, (-1.3, 2.3, 0.9)),
                          scene.emitter("light", (1100, 1000, 850))))
    scene.place("fill", (quad((-3, 4.2, -2), (6, 0, 0), (0, 0, 6)),
                         scene.emitter("fill", (0.18, 0.2, 0.24))))
    scene.camera((0.55, 1.35, 2.5), (0, 0.42, 0), 32)
    return scene
