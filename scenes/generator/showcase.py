"""Many lights and many materials: many_lights, sun_sky, materials."""

import math
import random

from . import textures
from .glb import Scene
from .maths import mul, normalize, rotate_x, rotate_y, rotate_z, translate
from .nature import add_sky
from .shapes import (Mesh, box, disc, icosphere, lathe, merged, quad, torus,
                     uv_sphere)


# ---- many_lights --------------------------------------------------------

CITY_BLOCKS, PITCH = 28, 10.0


def _buildings(rng):
    """(centre x, centre z, width, depth, height) of every building."""
    for j in range(CITY_BLOCKS):
        for i in range(CITY_BLOCKS):
            x = (i - (CITY_BLOCKS - 1) / 2) * PITCH
            z = (j - (CITY_BLOCKS - 1) / 2) * PITCH
            centre = math.exp(-(x * x + z * z) / 3600)
            height = rng.uniform(3, 8) + centre * rng.uniform(4, 34)
            yield (x, z, rng.uniform(5.2, 7.2), rng.uniform(5.2, 7.2), height)


def _lamp_position(rng, buildings):
    x, z, w, d, h = rng.choice(buildings)
    kind = rng.random()
    if kind < 0.6:                                   # over the street
        along = rng.uniform(-PITCH / 2, PITCH / 2)
        aside = PITCH / 2 - rng.uniform(0, 1.2)
        if rng.random() < 0.5:
            along, aside = aside, along
        return (x + along, rng.uniform(0.4, 3.5), z + aside)
    if kind < 0.88:                                  # on a facade
        y, sign = rng.uniform(1.0, h), rng.choice((-1, 1))
        if rng.random() < 0.5:
            return (x + sign * (w / 2 + 0.25), y, z + rng.uniform(-d, d) / 2)
        return (x + rng.uniform(-w, w) / 2, y, z + sign * (d / 2 + 0.25))
    return (x + rng.uniform(-w, w) / 2, h + 0.35,    # on a roof
            z + rng.uniform(-d, d) / 2)


def many_lights():
    scene = Scene("many_lights", "sampling 10 000 small lights of varied "
                                 "colour and power")
    rng = random.Random(404)
    buildings = list(_buildings(rng))
    for k in range(6):
        value = 0.3 + 0.09 * k
        material = scene.material(f"facade {k}", (
            value, value * rng.uniform(0.85, 1), value * rng.uniform(0.7, 1)),
            roughness=0.3 + 0.1 * k)
        mesh = scene.mesh(f"facade {k}", (box((-0.5, 0, -0.5), (0.5, 1, 0.5)),
                                          material))
        chosen = buildings[k::6]
        scene.instances("buildings", mesh,
                        [(x, 0.0, z) for x, z, *_ in chosen],
                        scales=[(w, h, d) for _, _, w, d, h in chosen])

    s = 1 / math.sqrt(3)
    tetra = Mesh([(s, s, s), (s, -s, -s), (-s, s, -s), (-s, -s, s)],
                 (0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2))
    colors = ((1, .72, .4), (1, .85, .62), (.75, .87, 1), (1, .3, .12),
              (.2, 1, .55), (.25, .45, 1), (1, .25, .75), (1, .95, .85))
    for k, color in enumerate(colors):
        radiance = mul(color, (90, 140, 200, 110, 80, 160, 100, 320)[k])
        mesh = scene.mesh(f"lamp {k}", (tetra, scene.emitter(f"lamp {k}",
                                                            radiance)))
        # Sizes vary fourfold, so powers within a colour vary sixteenfold.
        sizes = [0.08 * 4 ** rng.random() for _ in range(1250)]
        scene.instances("lamps", mesh,
                        [_lamp_position(rng, buildings) for _ in sizes],
                        scales=[(r, r, r) for r in sizes])
    half = CITY_BLOCKS * PITCH / 2 + 20
    scene.place("ground", (quad((-half, 0, half), (2 * half, 0, 0),
                                (0, 0, -2 * half)),
                           scene.material("asphalt", (0.22, 0.22, 0.23),
                                          roughness=0.35)))
    scene.camera((52, 46, 104), (2, 4, 12), 40)
    return scene


# ---- sun_sky ------------------------------------------------------------

def sun_sky():
    scene = Scene("sun_sky", "a bright sun and a textured sky on metals and "
                             "dielectrics from smooth to rough")
    ball = icosphere(4, 0.4)
    rows = (("gold", (1.0, 0.78, 0.34), 1.0), ("plastic", (0.1, 0.24, 0.55),
                                               0.0),
            ("steel", (0.56, 0.57, 0.58), 1.0))
    for j, (name, color, metallic) in enumerate(rows):
        for i in range(5):
            roughness = 0.02 + 0.98 * (i / 4) ** 1.5
            material = scene.material(f"{name} {i}", color, metallic,
                                      roughness)
            scene.place(f"{name} {i}", (ball, material),
                        at=((i - 2) * 1.05, 0.4, -j * 1.15))
    clay = scene.diffuse("clay", (0.55, 0.27, 0.17))
    ring = torus(0.55, 0.2, 64, 32).moved(translate(3.4, 0.72, -1.6)
                                          @ rotate_z(20) @ rotate_x(80))
    tower = merged([box((-.45, 0.7 * k, -.45), (.45, 0.7 * k + 0.66, .45))
                    .moved(rotate_y(17 * k)) for k in range(4)])
    column = lathe([[(0, 0), (0.5, 0)], [(0.5, 0), (0.5, 0.12)],
                    [(0.5, 0.12), (0.3, 0.2), (0.26, 0.5), (0.25, 1.6),
                     (0.3, 1.9)], [(0.3, 1.9), (0.5, 2.0)],
                    [(0.5, 2.0), (0.5, 2.15)], [(0.5, 2.15), (0, 2.15)]], 48)
    scene.place("tower", (tower.moved(translate(-3.6, 0, -2.6)), clay))
    scene.place("ring", (ring, scene.material("copper", (0.95, 0.64, 0.54),
                                              1.0, 0.25)))
    marble = scene.material("marble", (0.75, 0.73, 0.69), roughness=0.2)
    for x in (-1.8, 0.3, 2.4):
        scene.place("column", (column.moved(translate(x, 0, -4.4)), marble))
    scene.place("ground", (disc((0, 0, 0), 20, (0, 1, 0), 64),
                           scene.diffuse("ground", (0.42, 0.38, 0.32))))
    # 300 m away an opening of 6 degrees lets the sun onto the whole ground.
    add_sky(scene, 300, 6, normalize((0.55, 0.62, 0.42)), 0.9, 2.4)
    scene.camera((-1.6, 1.75, 5.6), (-0.1, 0.62, -1.2), 38)
    return scene


# ---- materials ----------------------------------------------------------

def _features(scene):
    """Twelve (name, material); the first six stand in the back row."""
    make = scene.material
    return [
        ("sheen", make("sheen", (0.25, 0.04, 0.1), KHR_materials_sheen={
            "sheenColorFactor": [0.9, 0.45, 0.6],
            "sheenRoughnessFactor": 0.35})),
        ("clearcoat", make(
            "clearcoat", (0.5, 0.03, 0.03), 0.6, 0.5, KHR_materials_clearcoat={
                "clearcoatFactor": 1.0, "clearcoatRoughnessFactor": 0.03})),
        ("anisotropy", make(
            "anisotropy", (0.75, 0.74, 0.72), 1.0, 0.3,
            KHR_materials_anisotropy={"anisotropyStrength": 0.9,
                                      "anisotropyRotation": 0.0})),
        ("iridescence", make(
            "iridescence", (0.08, 0.08, 0.09), 0.6, 0.15,
            KHR_materials_iridescence={
                "iridescenceFactor": 1.0, "iridescenceIor": 1.4,
                "iridescenceThicknessMinimum": 100.0,
                "iridescenceThicknessMaximum": 420.0})),
        ("diffuse transmission", make(
            "diffuse transmission", (0.8, 0.75, 0.6),
            KHR_materials_diffuse_transmission={
                "diffuseTransmissionFactor": 0.75,
                "diffuseTransmissionColorFactor": [0.9, 0.5, 0.2]})),
        ("thin wall", make(
            "thin wall", (0.6, 0.9, 0.75), roughness=0.0,
            KHR_materials_transmission={"transmissionFactor": 1.0})),
        ("rough glass", scene.glass(
            "rough glass", 1.5, roughness=0.2, attenuationDistance=0.35,
            attenuationColor=[0.2, 0.55, 0.85])),
        ("gold", make("gold", (1.0, 0.78, 0.34), 1.0, 0.2)),
        ("plastic", make("plastic", (0.04, 0.3, 0.12), roughness=0.15)),
        ("specular colour", make(
            "specular colour", (0.05, 0.05, 0.05), roughness=0.25,
            KHR_materials_specular={"specularFactor": 1.0,
                                    "specularColorFactor": [1.0, 0.25, 0.6]},
            KHR_materials_ior={"ior": 1.9})),
        ("emissive", make("emissive", (0.05, 0.05, 0.05), roughness=0.4,
                          emission=(2.0, 2.0, 2.0),
                          emission_map=scene.texture(textures.glow()))),
        ("metal and roughness map", make(
            "metal and roughness map", (0.85, 0.8, 0.7), 1.0, 1.0,
            metal_rough_map=scene.texture(textures.metal_rough_checks()))),
    ]


def materials():
    scene = Scene("materials", "one material feature per sphere, under area, "
                               "point and spot lights")
    textured = uv_sphere(64, 32, 0.45, textured=True, tangents=True)
    plain = icosphere(4, 0.45)
    for k, (name, material) in enumerate(_features(scene)):
        i, back = k % 6, k < 6
        # 1 mm of air keeps the spheres off their stands.
        place = ((i - 2.5) * 1.05, 1.051 if back else 0.451,
                 -1.1 if back else 0.0)
        needs_uv = name in ("anisotropy", "emissive",
                            "metal and roughness map")
        ball = textured if needs_uv else plain
        scene.place(name, (ball, material), at=place)
    scene.place("step", (box((-3.4, 0.0, -1.7), (3.4, 0.6, -0.55)),
                         scene.diffuse("step", (0.5, 0.5, 0.5))))
    floor = scene.diffuse("floor", (1, 1, 1), color_map=scene.texture(
        textures.tiles(4, 71, (0.62, 0.62, 0.62), (0.45, 0.45, 0.45))))
    scene.place("floor", (quad((-6, 0, 6), (12, 0, 0), (0, 0, -8.5), (6, 4)),
                          floor))
    scene.place("wall", (quad((-6, 0, -2.5), (12, 0, 0), (0, 5, 0), (6, 2.5)),
                         floor))
    scene.place("softbox", (quad((-2.5, 4.2, 0.2), (5, 0, 0), (0, 0, 2)),
                            scene.emitter("softbox", (8.0, 8.0, 8.2))))
    scene.light("point", (-3.4, 2.4, 2.2), (0, 0, 0), (1.0, 0.8, 0.6), 15.0)
    scene.light("spot", (3.2, 3.6, 3.0), (1.0, 0.5, -0.5), (0.75, 0.87, 1.0),
                70.0, spot={"innerConeAngle": 0.25, "outerConeAngle": 0.4})
    scene.camera((0, 1.75, 6.6), (0, 0.72, -0.4), 28)
    return scene
