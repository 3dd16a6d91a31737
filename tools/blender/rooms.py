# SPDX-License-Identifier: Apache-2.0
"""Makes one of four scenes in Blender, and renders it by Cycles or exports it for braid.

    blender -b --python-exit-code 1 -P rooms.py -- window|lamps|balls|gap export FOLDER
    blender -b --python-exit-code 1 -P rooms.py -- NAME cycles WIDTHxHEIGHT SAMPLES SEED THREADS OUT.exr

What is exported goes through the add-on beside this file. Materials are Lambert's in both renderers but for metal:
models of gloss differ. Cycles follows as many bounces as braid, without clamping, blurred caustics or denoising, with
a box filter; its seconds of processor time are written to OUT.exr.seconds. compare_cycles.py runs both.
"""
import json
import math
import pathlib
import random
import sys
import time

import bpy
from mathutils import Vector

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import braid_render  # noqa: E402

BOUNCES = 12
WALL, FLOOR, BACK, SHELF = (0.75, 0.73, 0.7), (0.45, 0.3, 0.2), (0.5, 0.6, 0.7), (0.3, 0.22, 0.15)
RED, GREEN, BLUE = (0.6, 0.1, 0.08), (0.15, 0.4, 0.12), (0.1, 0.15, 0.5)
WIDTH, DEPTH, HEIGHT = 5, 4, 2.8  # of the room, in metres


def material(color, roughness=None):
    """Lambert's, or metal of a roughness; one for each colour."""
    name = f"{'matte' if roughness is None else 'metal'} {color} {roughness}"
    if name in bpy.data.materials:
        return bpy.data.materials[name]
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.distribution = "GGX"
    shader.inputs["Base Color"].default_value = (*color, 1)
    shader.inputs["Metallic"].default_value = 0 if roughness is None else 1
    shader.inputs["Roughness"].default_value = roughness or 1
    made["matte"] = roughness is None
    return made


def give(color, roughness=None):
    bpy.context.object.data.materials.append(material(color, roughness))


def box(low, high, color, turn=0):
    low, high = Vector(low), Vector(high)
    bpy.ops.mesh.primitive_cube_add(size=1, location=(low + high) / 2, rotation=(0, 0, turn))
    bpy.context.object.scale = high - low
    give(color)


def ball(center, radius, color, roughness=None):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, radius=radius, location=center)
    bpy.ops.object.shade_smooth()
    give(color, roughness)


def towards(direction):
    return Vector(direction).to_track_quat("-Z", "Y").to_euler()


def camera(eye, target, degrees=65):
    bpy.ops.object.camera_add(location=eye, rotation=towards(Vector(target) - Vector(eye)))
    bpy.context.object.data.angle = math.radians(degrees)
    bpy.context.scene.camera = bpy.context.object


def lamp(kind, at, power, size=0.0, direction=(0, 0, -1), color=(1, 1, 1)):
    bpy.ops.object.light_add(type=kind, location=at, rotation=towards(direction))
    data = bpy.context.object.data
    data.energy, data.color = power, color
    if kind == "AREA":
        data.shape, data.size = "SQUARE", size
    elif kind == "SUN":
        data.angle = size
    else:
        data.shadow_soft_size = size


def sky(color):
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (*color, 1)
    bpy.context.scene.world = world


def opened_wall(y0, y1, z0, z1):
    """The wall at the end of the room, with a hole."""
    x0, x1 = WIDTH, WIDTH + 0.15
    box((x0, 0, 0), (x1, y0, HEIGHT), WALL)
    box((x0, y1, 0), (x1, DEPTH, HEIGHT), WALL)
    box((x0, y0, z1), (x1, y1, HEIGHT), WALL)
    if z0 > 0:
        box((x0, y0, 0), (x1, y1, z0), WALL)


def shell(x0, x1):
    """Floor, ceiling and side walls from x0 to x1."""
    box((x0, 0, -0.1), (x1, DEPTH, 0), FLOOR)
    box((x0, 0, HEIGHT), (x1, DEPTH, HEIGHT + 0.1), WALL)
    box((x0, DEPTH, 0), (x1, DEPTH + 0.1, HEIGHT), BACK)
    box((x0, -0.1, 0), (x1, 0, HEIGHT), WALL)


def room(chance):
    """A furnished room without its wall at x = WIDTH."""
    shell(0, WIDTH)
    box((-0.1, 0, 0), (0, DEPTH, HEIGHT), WALL)
    box((2.6, 2.2, 0.7), (4.2, 3.2, 0.76), FLOOR)
    for x in (2.65, 4.1):
        for y in (2.25, 3.1):
            box((x, y, 0), (x + 0.06, y + 0.06, 0.7), FLOOR)
    ball((3, 2.6, 0.91), 0.15, RED)
    ball((3.4, 2.9, 0.86), 0.1, GREEN)
    box((3.6, 2.5, 0.76), (3.9, 2.75, 1.1), BLUE, 0.4)
    box((0.2, 3.2, 0), (1.2, 3.95, 1.9), SHELF)
    box((1.6, 3.5, 0), (2.2, 3.9, 0.45), GREEN)
    ball((1.9, 3.7, 0.65), 0.2, WALL)
    for k in range(12):
        x = 0.25 + 0.08 * k
        box((x, 3.0, 1.0), (x + 0.05, 3.2, 1.2 + 0.05 * chance.random()), [0.7 * chance.random() for _ in range(3)])
    camera((0.5, 0.4, 1.6), (3.4, 2.8, 0.9))


def window(chance):
    """Sun and sky through an open window."""
    room(chance)
    opened_wall(1.2, 2.8, 0.9, 2.1)
    sky((0.6, 0.8, 1.1))
    lamp("SUN", (8, 2, 5), 6, direction=(-1, 0.25, -0.8), color=(1, 0.9, 0.75))


def lamps(chance):
    """The room closed, with 40 small area lamps and 24 points."""
    def within(low, high):
        return low + (high - low) * chance.random()
    room(chance)
    box((WIDTH, 0, 0), (WIDTH + 0.1, DEPTH, HEIGHT), WALL)
    for _ in range(40):
        lamp("AREA", (within(0.4, 4.6), within(0.3, 3.7), within(2.2, 2.7)), 1.5 + 6 * chance.random() ** 2, 0.08,
             color=(1, within(0.6, 1), within(0.4, 0.9)))
    for _ in range(24):
        lamp("POINT", (within(0.3, 4.7), within(0.2, 3.8), within(0.3, 2.3)), 1 + 3 * chance.random() ** 2,
             color=(within(0.5, 1), within(0.6, 1), 1))


def balls(chance):
    """Balls of matte stuff and of metal under three area lamps, in a dim sky."""
    box((-6, -6, -0.1), (6, 6, 0), (0.4, 0.4, 0.42))
    box((-6, 3, 0), (6, 3.1, 5), WALL)
    sky((0.05, 0.06, 0.08))
    for k in range(14):
        radius = 0.28 + 0.14 * chance.random()
        at = (-2.4 + 1.2 * (k % 5) + 0.3 * chance.random(), -1 + 1.1 * (k // 5) + 0.2 * chance.random(), radius)
        if k % 3:
            ball(at, radius, [0.4 + 0.5 * chance.random() for _ in range(3)], (0.12, 0.2, 0.3, 0.4, 0.05)[k % 5])
        else:
            ball(at, radius, [0.8 * chance.random() for _ in range(3)])
    lamp("AREA", (-3, -3, 4), 250, 1, (3, 3, -3.5))
    lamp("AREA", (3.5, -2, 3), 120, 0.4, (-3, 2, -2.5), (1, 0.8, 0.6))
    lamp("AREA", (0, 1, 5), 100, 0.2)
    camera((0, -5.2, 2.2), (0, 0.2, 0.4), 45)


def gap(chance):
    """The room lit through a gap, from a lamp next door."""
    room(chance)
    opened_wall(1.0, 1.25, 0, 2.1)
    shell(WIDTH, WIDTH + 3)
    box((WIDTH + 3, 0, 0), (WIDTH + 3.1, DEPTH, HEIGHT), WALL)
    lamp("AREA", (6.5, 2, 2.6), 300, 0.6)


SCENES = {"window": window, "lamps": lamps, "balls": balls, "gap": gap}


def export(folder):
    """scene.gltf in the folder, and what else braid needs to be told in words.json."""
    scene_file, words = braid_render.export(bpy.context.evaluated_depsgraph_get(), folder)
    document = json.loads(pathlib.Path(scene_file).read_text(encoding="utf-8"))
    for entry in document["materials"]:
        if bpy.data.materials.get(entry["name"], {}).get("matte"):
            entry.setdefault("extensions", {})["KHR_materials_specular"] = {"specularFactor": 0.0}
    document["extensionsUsed"] = sorted({*document.get("extensionsUsed", []), "KHR_materials_specular"})
    pathlib.Path(scene_file).write_text(json.dumps(document), encoding="utf-8")
    pathlib.Path(folder, "words.json").write_text(json.dumps([scene_file, *words]), encoding="utf-8")


def make_matte():
    """Diffuse shaders in the place of what the exporter reads."""
    for made in bpy.data.materials:
        if not made.get("matte"):
            continue
        nodes, links = made.node_tree.nodes, made.node_tree.links
        diffuse = nodes.new("ShaderNodeBsdfDiffuse")
        diffuse.inputs["Color"].default_value = nodes["Principled BSDF"].inputs["Base Color"].default_value[:]
        links.new(diffuse.outputs[0], nodes["Material Output"].inputs[0])


def cycles(size, samples, seed, threads, out):
    make_matte()
    scene, render = bpy.context.scene, bpy.context.scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = (int(side) for side in size.split("x"))
    render.resolution_percentage, render.filepath = 100, out
    render.threads_mode, render.threads = "FIXED", int(threads)
    image = render.image_settings
    image.file_format, image.color_depth, image.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"
    settings = scene.cycles
    settings.device, settings.samples, settings.seed = "CPU", int(samples), int(seed)
    settings.use_adaptive_sampling = settings.use_denoising = False
    settings.max_bounces = settings.diffuse_bounces = settings.glossy_bounces = BOUNCES
    settings.sample_clamp_direct = settings.sample_clamp_indirect = settings.blur_glossy = 0
    settings.light_sampling_threshold = 0
    settings.pixel_filter_type = "BOX"
    bpy.context.view_layer.cycles.denoising_store_passes = True
    begin = time.process_time()
    bpy.ops.render.render(write_still=True)
    pathlib.Path(out + ".seconds").write_text(str(time.process_time() - begin), encoding="utf-8")


def main(name, action, *rest):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    SCENES[name](random.Random(name))
    {"export": export, "cycles": cycles}[action](*rest)


main(*sys.argv[sys.argv.index("--") + 1:])
