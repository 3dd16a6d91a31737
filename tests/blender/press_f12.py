# SPDX-License-Identifier: Apache-2.0
"""Renders a scene in Blender by braid's add-on, as F12 does, and compares the result with the command line's image and
with Cycles' brightness.   BRAID=PROGRAM blender -b --factory-startup --python-exit-code 1 -P press_f12.py
"""
import os
import pathlib
import subprocess
import sys
import tempfile

import bpy
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools" / "blender"))
import braid_render  # noqa: E402

WIDTH, HEIGHT = 64, 36


def material(name, color=None, image=None):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    shader = made.node_tree.nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 1
    shader.inputs["Specular"].default_value = 0
    if color:
        shader.inputs["Base Color"].default_value = (*color, 1)
    if image:
        texture = made.node_tree.nodes.new("ShaderNodeTexImage")
        texture.image, texture.interpolation = image, "Closest"  # Cycles mixes texels before it decodes them
        made.node_tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    return made


def checks():
    image = bpy.data.images.new("checks", 64, 64)
    y, x = np.mgrid[0:64, 0:64] // 8
    pixels = np.ones((64, 64, 4), np.float32)
    pixels[..., :3] = np.where(((x + y) % 2)[..., None], [0.9, 0.8, 0.6], [0.1, 0.2, 0.5])
    image.pixels = pixels.ravel().tolist()
    image.pack()
    return image


def lamp(kind, name, location, rotation, energy, **settings):
    data = bpy.data.lights.new(name, kind)
    data.energy = energy
    for key, value in settings.items():
        setattr(data, key, value)
    thing = bpy.data.objects.new(name, data)
    thing.location, thing.rotation_euler = location, rotation
    bpy.context.collection.objects.link(thing)


def build():
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    bpy.ops.mesh.primitive_plane_add(size=10)
    bpy.context.object.data.materials.append(material("ground", image=checks()))
    bpy.ops.mesh.primitive_cube_add(size=1.5, location=(0, 0, 0.75), rotation=(0, 0, 0.5))
    bpy.context.object.data.materials.append(material("red", (0.7, 0.1, 0.1)))
    lamp("SUN", "sun", (0, 0, 5), (0.6, 0.3, 0), 1.5, angle=0)
    lamp("AREA", "soft", (-2, -1, 3), (0, -0.6, 0.2), 80, shape="RECTANGLE", size=1.5, size_y=0.8, color=(1, 0.9, 0.7))
    lamp("POINT", "bulb", (2, 2, 2), (0, 0, 0), 60, shadow_soft_size=0)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location, camera.rotation_euler = (4, -6, 4), (1.05, 0, 0.59)
    bpy.context.collection.objects.link(camera)
    scene = bpy.context.scene
    scene.camera = camera
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.2, 0.3, 0.5, 1)
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.5
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = WIDTH, HEIGHT, 100
    scene.view_settings.view_transform = "Raw"
    return scene


def make_lambertian():
    """What glTF's diffuse is; Blender's principled one reflects more at grazing angles."""
    for tree in (made.node_tree for made in bpy.data.materials if made.node_tree):
        shader, output = tree.nodes["Principled BSDF"], tree.nodes["Material Output"]
        diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
        color = shader.inputs["Base Color"]
        diffuse.inputs["Color"].default_value = color.default_value
        for link in color.links:
            tree.links.new(link.from_socket, diffuse.inputs["Color"])
        tree.links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])


def pixels(path):
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Raw"
    values = np.array(image.pixels[:], np.float32).reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return values[..., :3]


def pressed(scene, path):
    """The image in Blender's render result after F12."""
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return pixels(path)


def turn_a_sky_over(scene):
    """An environment of smooth colours behind a Mapping node that turns it about all three axes; nothing else."""
    for thing in [thing for thing in bpy.data.objects if thing.type != "CAMERA"]:
        bpy.data.objects.remove(thing)
    bpy.ops.mesh.primitive_plane_add(size=0.01, location=(0, 0, -50))
    sky = bpy.data.images.new("sky", 128, 64, float_buffer=True)
    y, x = np.mgrid[0:64, 0:128]
    values = np.ones((64, 128, 4), np.float32)
    values[..., 0] = 1 + np.cos(2 * np.pi * x / 128)
    values[..., 1] = 1 + np.sin(2 * np.pi * x / 128)
    values[..., 2] = 2 * y / 64
    sky.pixels = values.ravel().tolist()
    tree = scene.world.node_tree
    kinds = ("ShaderNodeTexEnvironment", "ShaderNodeMapping", "ShaderNodeTexCoord")
    texture, mapping, place = (tree.nodes.new(kind) for kind in kinds)
    texture.image = sky
    mapping.inputs["Rotation"].default_value = (0.4, -0.3, 1.9)
    tree.links.new(place.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    scene.camera.data.lens, scene.camera.rotation_euler = 12, (1.9, 0.2, 0.7)


def check_turned_sky(scene, folder):
    turn_a_sky_over(scene)
    scene.render.engine, scene.braid.samples, scene.cycles.samples = "BRAID", 4, 16
    ours = pressed(scene, folder / "sky.exr")
    scene.render.engine = "CYCLES"
    theirs = pressed(scene, folder / "cycles_sky.exr")
    apart = np.abs(ours - theirs).max() / theirs.mean()
    print("turned sky, largest difference over the mean:", f"{apart:.4f}")
    assert apart < 0.1, apart


def main():
    braid_render.register()
    scene = build()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="braid-f12-"))
    scene.render.engine, scene.braid.samples = "BRAID", 64
    ours = pressed(scene, folder / "braid.exr")
    assert ours.shape == (HEIGHT, WIDTH, 3) and np.isfinite(ours).all() and ours.max() > 0

    depsgraph = bpy.context.evaluated_depsgraph_get()
    path, words = braid_render.export(depsgraph, str(folder))
    subprocess.run([os.environ["BRAID"], "render", path, *words, "--size", f"{WIDTH}x{HEIGHT}", "--spp", "64",
                    "--integrator", "auto", "--aovs", "none", "--float", "--quiet", "-o", str(folder / "line.exr")],
                   check=True)
    assert np.array_equal(ours, pixels(folder / "line.exr")), "F12 and the command line differ"

    make_lambertian()
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.pixel_filter_type = 256, False, "BOX"
    theirs = pressed(scene, folder / "cycles.exr")
    ratio = ours.mean(axis=(0, 1)) / theirs.mean(axis=(0, 1))
    apart = np.abs(ours - theirs).mean() / theirs.mean()
    print("brightness over Cycles by channel:", *(f"{r:.4f}" for r in ratio), "mean difference:", f"{apart:.4f}")
    assert np.all(np.abs(ratio - 1) < 0.03), ratio
    assert apart < 0.08, apart

    check_turned_sky(scene, folder)

    scene.render.engine, os.environ["BRAID"] = "BRAID", "/nowhere/braid"
    try:
        bpy.ops.render.render()
        told = ""
    except RuntimeError as error:
        told = str(error)
    assert "/nowhere/braid" in told and "preferences" in told, told
    braid_render.unregister()
    print("F12 works", flush=True)
    os._exit(0)  # having reported an error, Blender would end with one


main()
