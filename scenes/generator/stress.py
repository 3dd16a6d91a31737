"""Scenes at the edge of what floats, materials and memory bear, for
tools/stress. Most are one small room with one thing taken to its extreme."""

import math
import struct
import zlib

from .glb import Scene
from .maths import translate
from .shapes import Mesh, box, icosphere, merged, quad
from .stress_images import write_exr

GREY = (0.6, 0.6, 0.6)
EYE, TARGET = (0, 1, 3.4), (0, 0.9, 0)


def light_panel(half, height=1.9):
    """A square that faces down."""
    return quad((-half, height, -half), (2 * half, 0, 0), (0, 0, 2 * half))


def walls():
    """Floor, back, ceiling, right and left of a room that is open to +z."""
    return merged([quad((-1, 0, 1), (2, 0, 0), (0, 0, -2)),
                   quad((-1, 0, -1), (2, 0, 0), (0, 2, 0)),
                   quad((-1, 2, -1), (2, 0, 0), (0, 0, 2)),
                   quad((1, 0, 1), (0, 2, 0), (0, 0, -2)),
                   quad((-1, 0, -1), (0, 2, 0), (0, 0, 2))])


def room(radiance=8.0, light=0.4, albedo=GREY, objects=None, eye=EYE,
         target=TARGET, name="stress"):
    """The room with a panel of light; objects(scene) adds what is in it."""
    scene = Scene(name, "extremes")
    scene.place("walls", (walls(), scene.diffuse("walls", albedo)))
    if light:
        emitter = scene.diffuse("light", (0, 0, 0), emission=(radiance,) * 3,
                                double_sided=False)
        scene.place("light", (light_panel(light), emitter))
    if objects:
        objects(scene)
    scene.camera(eye, target, 45)
    return scene


def ball(radius=0.45, centre=(0, 0.5, 0), level=2):
    return icosphere(level, radius, centre)


# ---- objects ------------------------------------------------------------

def diffuse_ball(scene):
    scene.place("ball", (ball(), scene.diffuse("ball", (0.7, 0.4, 0.2))))


def metal_ball(roughness, color=(0.9, 0.7, 0.4)):
    return lambda scene: scene.place("ball", (ball(), scene.material(
        "metal", color, 1.0, roughness)))


def glass_ball(ior=1.5, roughness=0.0):
    return lambda scene: scene.place("ball", (ball(), scene.glass(
        "glass", ior, roughness=roughness)))


def mixed_objects(scene):
    """Diffuse, metal and glass: every kind of lobe in one picture."""
    scene.place("ball", (ball(0.3, (-0.5, 0.35, 0)),
                         scene.glass("glass", 1.5)))
    scene.place("metal", (ball(0.3, (0.5, 0.35, 0.1)), scene.material(
        "metal", (0.9, 0.7, 0.4), 1.0, 0.2)))
    scene.place("box", (box((-0.15, 0, -0.6), (0.15, 0.7, -0.3)),
                        scene.diffuse("box", (0.2, 0.5, 0.7))))


def balls_in_balls(*shells):
    """shells: (radius, centre, ior), each a solid of its own."""
    def place(scene):
        for i, (radius, centre, ior) in enumerate(shells):
            scene.place(f"shell {i}", (ball(radius, centre, 3), scene.glass(
                f"solid {i}", ior)))
    return place


def slivers(scene):
    """Needles 10^-6 to 10^-2 wide and 1 long, standing like blades."""
    out = Mesh()
    for i in range(40):
        x, width = -0.8 + 0.04 * i, 10.0 ** (-6 + i % 5)
        out.add(Mesh([(x, 0.1, 0), (x + width, 0.1, 0), (x, 1.1, 0.2)],
                     (0, 1, 2)))
    scene.place("slivers", (out, scene.diffuse("slivers", (0.7, 0.4, 0.2))))
    scene.place("mirrors", (out.moved(translate(0.02, 0, 0.3)),
                            scene.material("mirror", metallic=1.0,
                                           roughness=0.0)))


def no_area(scene):
    """Triangles that are points and lines, one of them an emitter."""
    flat = Mesh([(0, 0.5, 0), (0, 0.5, 0), (0, 0.5, 0), (0.5, 0.5, 0.5),
                 (0.6, 0.6, 0.6), (0.7, 0.7, 0.7)], (0, 1, 2, 3, 4, 5))
    scene.place("flat", (flat, scene.diffuse("flat", GREY)))
    scene.place("flat light", (flat, scene.emitter("dead", (5, 5, 5))))
    diffuse_ball(scene)


def duplicates(scene):
    """Every triangle four times."""
    once = ball()
    four = Mesh(once.positions, once.indices * 4, once.normals)
    scene.place("ball", (four, scene.diffuse("ball", (0.7, 0.4, 0.2))))


def coincident(scene):
    """Glass, metal and diffuse squares in exactly the same place, a glass
    cube flush with the floor, and two cubes that share a face."""
    square = quad((-0.9, 0.9, -0.5), (0.8, 0, 0), (0, 0.8, 0))
    glass = scene.glass("glass", 1.5)
    for i, material in enumerate((
            scene.diffuse("a", (0.8, 0.1, 0.1)),
            scene.material("b", (0.1, 0.8, 0.1), 1.0, 0.1),
            scene.material("c", KHR_materials_transmission={
                "transmissionFactor": 1.0}))):
        scene.place(f"square {i}", (square, material))
    scene.place("cubes", (box((0, 0, 0), (0.4, 0.4, 0.4)), glass))
    scene.place("next", (box((0.4, 0, 0), (0.8, 0.4, 0.4)), glass))


# ---- whole scenes -------------------------------------------------------

def moved(build, scale=1.0, offset=(0, 0, 0)):
    """Everything below one node that scales and shifts it, camera too."""
    scene = build()
    below = scene.gltf["scenes"][0]["nodes"]
    scene.gltf["scenes"][0]["nodes"] = []
    scene.node("placement", children=below, scale=[scale] * 3,
               translation=list(offset))
    return scene


def grazing(degrees):
    """A floor in sunlight that comes in at this angle to it."""
    scene = Scene("grazing", "light along a surface")
    scene.place("floor", (quad((-5, 0, 5), (10, 0, 0), (0, 0, -10)),
                          scene.diffuse("floor", GREY)))
    diffuse_ball(scene)
    angle = math.radians(degrees)
    scene.light("directional", (0, 0, 0),
                (math.cos(angle), -math.sin(angle), 0), intensity=3.0)
    scene.camera(EYE, TARGET, 45)
    return scene


def white_box(albedo, level):
    """Closed, every wall of this albedo and emitting (1 - albedo) level:
    radiance `level`, less what paths of n segments leave out, albedo^n."""
    scene = Scene("white box", "1000 bounces")
    emission = (1 - albedo) * level
    scene.place("box", (box((-1, 0, -1), (1, 2, 1)), scene.diffuse(
        "white", (albedo,) * 3, emission=(emission,) * 3)))
    scene.camera((0, 1, 0.9), (0, 0.8, 0), 60)
    return scene


def behind_pane(fraction):
    """The only light, behind a thin pane that lets this much through."""
    def pane(scene):
        scene.place("pane", (quad((-1, 1.7, -1), (2, 0, 0), (0, 0, 2)),
                             scene.material(
                                 "pane", (1, 1, 1), roughness=0.0,
                                 KHR_materials_transmission={
                                     "transmissionFactor": fraction},
                                 KHR_materials_specular={
                                     "specularFactor": 0.0})))
    return room(radiance=800.0, objects=pane)


def open_ground(objects=mixed_objects):
    """No light of its own: for environments."""
    scene = Scene("ground", "environments")
    scene.place("floor", (quad((-2, 0, 2), (4, 0, 0), (0, 0, -4)),
                          scene.diffuse("floor", GREY)))
    objects(scene)
    scene.camera(EYE, TARGET, 45)
    return scene


def sun_sky(sun, bad=()):
    """64 x 32 texels: sky of 1, a sun of 3 texels, and `bad` values at
    texels of their own."""
    texels = {(20 + i, 5): (sun,) * 3 for i in range(3)}
    texels.update({(30 + 2 * i, 8): (value,) * 3
                   for i, value in enumerate(bad)})
    return write_exr(64, 32, lambda x, y: texels.get((x, y), (1, 1, 1)))


def textured(image, emissive=False):
    """The room with this image on a wall, or on its light."""
    def place(scene):
        texture = scene.texture(image)
        square = quad((-0.8, 0.2, -0.9), (1.6, 0, 0), (0, 1.6, 0), (1, 1))
        scene.place("picture", (square, scene.diffuse(
            "picture", (1, 1, 1), emission_map=texture,
            emission=(1, 1, 1)) if emissive else scene.diffuse(
                "picture", (1, 1, 1), color_map=texture)))
    return room(objects=place)


def flat_png(width, height, level):
    """A grey PNG of one value, row by row: its size in memory is not ours."""
    def chunk(kind, data):
        return (struct.pack(">I", len(data)) + kind + data
                + struct.pack(">I", zlib.crc32(kind + data)))
    packer, row = zlib.compressobj(1), b"\0" + bytes([level]) * width
    pixels = b"".join(packer.compress(row) for _ in range(height))
    return (b"\x89PNG\r\n\x1a\n"
            + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0,
                                         0, 0))
            + chunk(b"IDAT", pixels + packer.flush()) + chunk(b"IEND", b""))


def hdr_texture(bad):
    """8 x 8 texels of 0.5, the first ones `bad`."""
    return write_exr(8, 8, lambda x, y: (bad[x],) * 3 if y == 0 and
                     x < len(bad) else (0.5,) * 3)


def grid(side, spacing, y=0.2):
    """side^3 places, centred in the room."""
    centre = (side - 1) / 2
    return [(spacing * (i - centre), y + spacing * j, spacing * (k - centre))
            for i in range(side) for j in range(side) for k in range(side)]


def many_triangles():
    """500 instances of 20 480 triangles: 10 240 000."""
    def place(scene):
        mesh = scene.mesh("ball", (icosphere(5, 0.08), scene.diffuse(
            "ball", (0.7, 0.4, 0.2))))
        scene.instances("balls", mesh, grid(8, 0.2)[:500])
    return room(objects=place)


def many_lights():
    """10^6 emissive triangles: 100 in a mesh, 10 000 instances of it."""
    tiny = Mesh()
    for i in range(100):
        x, z = 0.008 * (i % 10), 0.008 * (i // 10)
        tiny.add(Mesh([(x, 0, z), (x + 0.004, 0, z), (x, 0, z + 0.004)],
                      (0, 1, 2)))

    def place(scene):
        mesh = scene.mesh("lights", (tiny, scene.emitter("light",
                                                         (4, 4, 4))))
        scene.instances("lights", mesh, [
            (-0.95 + 0.09 * (i % 20), 0.1 + 0.07 * (i // 400),
             -0.95 + 0.09 * (i // 20 % 20)) for i in range(10000)])
    return room(light=0, objects=place)


def vertex_colours(level):
    """COLOR_0 of this value on the walls: glTF allows any float."""
    scene = room(albedo=(1, 1, 1))
    shape = scene.gltf["meshes"][0]["primitives"][0]
    count = scene.gltf["accessors"][shape["attributes"]["POSITION"]]["count"]
    shape["attributes"]["COLOR_0"] = scene._floats([(level,) * 3] * count,
                                                   "VEC3")
    return scene


def look_from(eye, target, objects=mixed_objects):
    return room(objects=objects, eye=eye, target=target)


def small_light(light):
    """A panel 2 `light` wide, of the same power as the usual one."""
    return room(radiance=8 * (0.4 / light) ** 2, light=light,
                objects=diffuse_ball)

