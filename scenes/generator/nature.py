"""Fine and plentiful geometry: hair, foliage, forest."""

import math
import random

from . import textures
from .glb import Scene
from .maths import add, cross, frame, mul, normalize, rotate_y, sub
from .maths import translate
from .plants import (bark, broadleaf, conifer, grow, leaf_card, leaf_sites)
from .shapes import (Mesh, lathe, merged, quad, sky_dome,
                     superellipsoid, surface)


def add_sky(scene, radius, opening, sun, sky_strength, sun_irradiance):
    """Textured dome and a directional sun that shines in through its
    opening. `sun` is the direction towards it."""
    sky = scene.diffuse("sky", (0, 0, 0), emission=(sky_strength,) * 3,
                        emission_map=scene.texture(textures.sky(), False))
    scene.place("sky", (sky_dome(radius, sun, opening), sky))
    scene.light("directional", (0, 0, 0), mul(sun, -1), (1.0, 0.94, 0.84),
                sun_irradiance)


# ---- hair ---------------------------------------------------------------

def _strand(rng, bend):
    """A curling ribbon that sets out along +Y and bends towards -Z."""
    segments, size = 24, rng.uniform(0.17, 0.23)
    turns, phase = rng.uniform(2.2, 3.6), rng.random() * math.tau
    root = [rng.gauss(0, 0.0035) for _ in range(2)]
    curl = rng.uniform(0.006, 0.011)
    spine, points, radials = (root[0], -0.002, root[1]), [], []
    for k in range(segments + 1):
        t = k / segments
        angle = 0.8 + (bend - 0.8) * t
        heading = (0, math.cos(angle), -math.sin(angle))
        a = phase + math.tau * turns * t
        radial = add((math.cos(a), 0, 0),
                     mul(cross(heading, (1, 0, 0)), math.sin(a)))
        points.append(add(spine, mul(radial, curl * min(1, 2.5 * t))))
        radials.append(radial)
        spine = add(spine, mul(heading, size / segments))
    out = Mesh()
    for k, (p, radial) in enumerate(zip(points, radials)):
        along = normalize(sub(points[min(k + 1, segments)],
                              points[max(k - 1, 0)]))
        across = normalize(cross(along, radial))
        normal = cross(across, along)
        half = mul(across, 0.0007 * (1 - 0.8 * (k / segments) ** 3))
        out.positions += [sub(p, half), add(p, half)]
        out.normals += [normal] * 2
        # Highlights of hair spread across the strand.
        out.tangents += [(*across, 1.0)] * 2
    for k in range(segments):
        a = 2 * k
        out.indices += (a, a + 1, a + 3, a, a + 3, a + 2)
    return out.oriented()


def _scalp(count):
    """Evenly spread directions on the hairy part of the head; +Z is the
    face."""
    golden = math.pi * (3 - math.sqrt(5))
    for i in range(count):
        y = 1 - 1.35 * (i + 0.5) / count
        r = math.sqrt(1 - y * y)
        n = (r * math.cos(golden * i), y, r * math.sin(golden * i))
        if not (n[2] > 0.25 and n[1] < 0.55 + 0.25 * abs(n[0])):
            yield n


def hair():
    scene = Scene("hair", "hundreds of thousands of thin glossy triangles, "
                          "instanced and overlapping")
    rng = random.Random(77)
    brown = scene.material("hair", (0.2, 0.1, 0.045), roughness=0.3,
                           KHR_materials_anisotropy={
                               "anisotropyStrength": 0.75})
    skin = scene.material("skin", (0.62, 0.4, 0.3), roughness=0.5)
    cloth = scene.diffuse("cloth", (0.12, 0.2, 0.32))
    # Three families of wisps: the higher on the head, the more they must
    # bend to hang down.
    families = [[], [], []]
    for n in _scalp(3000):
        families[0 if n[1] > 0.75 else 1 if n[1] > 0.3 else 2].append(n)
    for family, bend in zip(families, (2.5, 2.0, 1.55)):
        rng.shuffle(family)
        for k in range(20):
            wisp = scene.mesh("wisp", (merged(
                [_strand(rng, bend) for _ in range(4)]), brown))
            points = family[k::20]
            turns = []
            for n in points:
                jitter = [rng.gauss(0, 0.25) for _ in range(3)]
                turns.append(frame(n, add((0, 1, -0.2), jitter)).quaternion())
            sizes = [(s, s, s) for s in (rng.uniform(0.8, 1.1)
                                         for _ in points)]
            scene.instances("hair", wisp, [_on_head(n) for n in points],
                            turns, sizes)
    _bust(scene, skin, cloth)
    scene.place("backdrop", (quad((-2, -1, -0.9), (4, 0, 0), (0, 3, 0)),
                             scene.diffuse("backdrop", (0.3, 0.32, 0.36))))
    scene.place("key", (quad((-1.1, 0.6, 0.3), (0.5, 0, 0.5), (0.2, .6, -.2)),
                        scene.emitter("key", (36.0, 34.0, 31.0))))
    scene.place("rim", (quad((0.5, 0.5, -0.75), (0.4, 0, 0.3), (0, .5, 0)),
                        scene.emitter("rim", (25.0, 27.0, 31.0))))
    scene.place("fill", (quad((0.9, -0.2, 1.0), (0, 0, 1), (0, 1, 0)),
                         scene.emitter("fill", (4.0, 4.0, 4.2))))
    scene.camera((0.42, 0.06, 0.85), (0, -0.03, 0), 30)
    return scene


def _on_head(n):
    return (0.078 * n[0], 0.1 * n[1], 0.092 * n[2])


def _bust(scene, skin, cloth):
    head = superellipsoid((0.156, 0.21, 0.184), 1.0, 48, 32)
    jaw = superellipsoid((0.115, 0.14, 0.12), 1.0, 32, 24).moved(
        translate(0, -0.065, 0.03))
    nose = superellipsoid((0.024, 0.05, 0.035), 1.0, 16, 12).moved(
        translate(0, -0.03, 0.096))
    neck = lathe([[(0.06, -0.24), (0.048, -0.16), (0.05, -0.06)]], 32)
    scene.place("head", (merged([head, jaw, nose, neck]), skin))
    shoulders = superellipsoid((0.42, 0.2, 0.2), 0.8, 40, 24)
    scene.place("shoulders", (shoulders.moved(translate(0, -.3, -.01)), cloth))


# ---- foliage ------------------------------------------------------------

def foliage():
    scene = Scene("foliage", "alpha-masked leaf cards in sun and sky, some "
                             "of them translucent")
    rng = random.Random(5)
    leaf = scene.texture(textures.leaf(), repeat=False)
    opaque = scene.material("leaf", (1, 1, 1), roughness=0.45,
                            color_map=leaf, mask=0.5)
    thin = scene.material("thin leaf", (1, 1, 1), roughness=0.5,
                          color_map=leaf, mask=0.5,
                          KHR_materials_diffuse_transmission={
                              "diffuseTransmissionFactor": 0.5,
                              "diffuseTransmissionColorFactor":
                                  [0.45, 0.7, 0.12]})
    wood = scene.diffuse("bark", (0.2, 0.15, 0.11))
    for name, material, x, z, stems in (("shrub", opaque, -0.75, -0.2, 4),
                                        ("thin shrub", thin, .75, .15, 3)):
        skeleton = []
        for k in range(stems):
            a = math.tau * (k + rng.random() * 0.4) / stems
            skeleton += grow(rng, (x + 0.05 * math.cos(a), -0.02,
                                   z + 0.05 * math.sin(a)),
                             normalize((0.55 * math.cos(a), 1,
                                        0.55 * math.sin(a))),
                             0.42, 0.018, 3)
        leaves = merged([leaf_card(rng, p, h, rng.uniform(0.07, 0.12), 1.0,
                                   True)
                         for p, h in leaf_sites(rng, skeleton, 9)])
        scene.place(name, (bark(skeleton, 0.002), wood), (leaves, material))
    scene.place("ground", (quad((-8, 0, 8), (16, 0, 0), (0, 0, -16),
                                (10, 10)),
                           scene.diffuse("ground", (1, 1, 1), color_map=(
                               scene.texture(textures.grass())))))
    add_sky(scene, 150, 6, normalize((-0.7, 0.75, -0.25)), 1.0, 3.2)
    scene.camera((0.25, 1.05, 3.1), (0, 0.58, 0), 36)
    return scene


# ---- forest -------------------------------------------------------------

def _height(x, z):
    """Rolling ground with a valley along the view."""
    return (7 * math.sin(x * 0.021 + 0.6) * math.cos(z * 0.017)
            + 3 * math.sin(x * 0.05 - z * 0.041 + 2.0)
            + 0.00085 * x * x)


def _species(rng, scene):
    """Tree meshes as (mesh, weight in the mix)."""
    step = TREE_STEP
    wood = scene.diffuse("bark", (0.16, 0.12, 0.09))
    pale = scene.diffuse("birch bark", (0.55, 0.53, 0.48))
    greens = [scene.diffuse(f"green {i}", c) for i, c in enumerate(
        ((0.07, 0.17, 0.08), (0.1, 0.22, 0.08), (0.18, 0.32, 0.08),
         (0.45, 0.32, 0.08)))]
    trees = []
    for height, layers, per_layer, green in ((14, 44, 50, 0), (10, 34, 54, 1)):
        trunk, needles = conifer(rng, height, layers, per_layer)
        trees.append(scene.mesh("conifer", (trunk, wood),
                                (needles, greens[green]), step=step))
    for size, leaves, leaf_size, trunk_material, green in (
            (3.4, 2000, 0.5, wood, 2), (2.9, 1700, 0.42, pale, 3)):
        stem, crown = broadleaf(rng, size, leaves, leaf_size)
        trees.append(scene.mesh("broadleaf", (stem, trunk_material),
                                (crown, greens[green]), step=step))
    return list(zip(trees, (0.4, 0.3, 0.2, 0.1)))


# Tree vertices are whole millimetres in 16 bits; the instances scale them
# back to metres.
TREE_STEP = 0.001
FOREST_HALF, FOREST_CELL = 160.0, 5.4


def _plant(rng, weights):
    """Trees on a jittered grid, one list of placements per species."""
    placements = [([], [], []) for _ in weights]
    cells = int(2 * FOREST_HALF / FOREST_CELL)
    for j in range(cells):
        for i in range(cells):
            x = -FOREST_HALF + (i + rng.uniform(0.1, 0.9)) * FOREST_CELL
            z = -FOREST_HALF + (j + rng.uniform(0.1, 0.9)) * FOREST_CELL
            species = rng.choices(range(len(weights)), weights)[0]
            size = rng.uniform(0.7, 1.25) * TREE_STEP
            turn = rotate_y(rng.uniform(0, 360)).quaternion()
            # A clearing for the camera, open towards the view (-Z).
            if math.hypot(x - EYE[0], z - EYE[1]) < 7 or (
                    abs(x - EYE[0]) < 2.5 + 0.08 * (EYE[1] - z)
                    and EYE[1] - 24 < z < EYE[1]):
                continue
            where, turns, sizes = placements[species]
            where.append((x, _height(x, z) - 0.1, z))
            turns.append(turn)
            sizes.append((size, size, size))
    return placements


EYE = (10.0, 105.0)


def forest():
    scene = Scene("forest", "more than ten million instanced triangles under "
                            "sun and sky")
    rng = random.Random(99)
    species = _species(rng, scene)
    placements = _plant(rng, [weight for _, weight in species])
    for (mesh, _), (where, turns, sizes) in zip(species, placements):
        scene.instances("trees", mesh, where, turns, sizes)

    def point(u, v):
        x, z = (340 * (t - 0.5) for t in (u, v))
        return (x, _height(x, z), z)
    soil = scene.diffuse("soil", (0.15, 0.13, 0.07))
    scene.place("terrain", (surface(64, 64, point,
                                    hint=lambda u, v, p: (0, 1, 0)), soil))
    add_sky(scene, 3000, 6, normalize((-0.75, 0.6, 0.15)), 2.0, 12.0)
    eye = (EYE[0], _height(*EYE) + 13.0, EYE[1])
    scene.camera(eye, (EYE[0] - 6, eye[1] - 8.0, EYE[1] - 40), 42)
    return scene
