"""Scenes with a known answer or a known difficulty: furnace, cornell,
plates."""

from .glb import Scene
from .maths import add, length, mul, normalize, sub
from .shapes import Mesh, icosphere, merged, quad


def furnace():
    scene = Scene("furnace", "energy conservation: L = Le / (1 - albedo) = 1 "
                             "in every pixel")
    wall = scene.diffuse("wall", (0.5, 0.5, 0.5), emission=(0.5, 0.5, 0.5))
    # Flat facets: the closed form holds for any closed polyhedron, while
    # interpolated normals would bend it slightly.
    scene.place("sphere", (icosphere(5).without_normals(), wall))
    scene.camera((0.2, 0.1, 0.4), (0, 0, -1), 60)
    return scene


def _prism(base, height):
    """Box of the Cornell data: four floor corners and a height, open below.
    The corners run clockwise seen from above."""
    top = [(x, height, z) for x, _, z in base]
    out = Mesh(top, (0, 1, 2, 0, 2, 3))
    for i in range(4):
        j = (i + 1) % 4
        out.add(Mesh((base[i], base[j], top[j], top[i]), (0, 2, 1, 0, 3, 2)))
    return out


def cornell():
    scene = Scene("cornell", "diffuse interreflection, colour bleeding, soft "
                             "shadows; cheap to intersect")
    white = scene.diffuse("white", (0.73, 0.73, 0.73))
    red = scene.diffuse("red", (0.63, 0.065, 0.05))
    green = scene.diffuse("green", (0.14, 0.45, 0.091))
    light = scene.emitter("light", (36.0, 26.0, 11.5))

    unit = 2.0 / 548.8        # the published data have a 548.8 high room

    def p(x, y, z):
        return ((x - 278) * unit, y * unit, z * unit)

    def rectangle(*corners):
        return Mesh([p(*c) for c in corners], (0, 1, 2, 0, 2, 3))
    w, h, d = 556.0, 548.8, 559.2
    x0, x1, z0, z1 = 213.0, 343.0, 227.0, 332.0
    room = [rectangle((0, 0, 0), (0, 0, d), (w, 0, d), (w, 0, 0)),
            rectangle((0, 0, d), (0, h, d), (w, h, d), (w, 0, d))]
    # The ceiling is a ring around the light: a lamp hung below it would also
    # light the gap between them.
    room += [rectangle((a, h, c), (b, h, c), (b, h, e), (a, h, e))
             for a, b, c, e in ((0, w, 0, z0), (0, w, z1, d),
                                (0, x0, z0, z1), (x1, w, z0, z1))]
    short = [p(x, 0, z) for x, z in ((130, 65), (82, 225), (240, 272),
                                     (290, 114))]
    tall = [p(x, 0, z) for x, z in ((423, 247), (265, 296), (314, 456),
                                    (472, 406))]
    boxes = [_prism(short, 165 * unit), _prism(tall, 330 * unit)]
    scene.place("room", (merged(room + boxes), white),
                (rectangle((w, 0, 0), (w, 0, d), (w, h, d), (w, h, 0)), red),
                (rectangle((0, 0, 0), (0, h, 0), (0, h, d), (0, 0, d)), green))
    scene.place("light", (rectangle((x0, h, z0), (x1, h, z0), (x1, h, z1),
                                    (x0, h, z1)), light))
    scene.camera(p(278, 273, -800), p(278, 273, 0), 39.3)
    return scene


def plates():
    scene = Scene("plates", "multiple importance sampling: small to large "
                            "lights in sharp to rough reflections")
    grey = scene.diffuse("walls", (0.35, 0.35, 0.35))
    scene.place("floor and wall", (merged([
        quad((-6, -1.08, 4), (12, 0, 0), (0, 0, -6)),
        quad((-6, -1.08, -2), (12, 0, 0), (0, 6, 0))]), grey))

    radii = (0.008, 0.025, 0.075, 0.225)
    for i, radius in enumerate(radii):
        # Equal power: radiance falls with the square of the radius.
        level = 0.11 / radius ** 2
        tint = ((1, .6, .4), (1, .95, .5), (.5, 1, .6), (.5, .65, 1))[i]
        ball = icosphere(3, radius, (-0.95 + 0.63 * i, 0, 0))
        scene.place(f"light {i}", (ball, scene.emitter(
            f"light {i}", mul(tint, level))))
    # Far enough forward that no plate mirrors it.
    scene.place("fill", (quad((-2, 3.5, 1.5), (4, 0, 0), (0, 0, 3)),
                         scene.emitter("fill", (2.2, 2.2, 2.2))))

    eye = (0, 0.45, 4.2)
    for i, roughness in enumerate((0.02, 0.06, 0.12, 0.22, 0.4)):
        centre = (0, -0.58 - 0.085 * i, 0.4 + 0.26 * i)
        # Each plate mirrors the row of lights towards the camera.
        normal = normalize(add(normalize(mul(centre, -1)),
                               normalize(sub(eye, centre))))
        down = (0, -normal[2], normal[1])
        half = mul(down, 0.115 / length(down))
        plate = quad(add(add(centre, half), (-1.1, 0, 0)), (2.2, 0, 0),
                     mul(half, -2))
        scene.place(f"plate {i}", (plate, scene.material(
            f"steel {roughness}", (0.62, 0.62, 0.65), 1.0,
            roughness)))
    scene.camera(eye, (0, -0.52, 0.5), 29)
    return scene
