# SPDX-License-Identifier: Apache-2.0
"""Renders the open scene with braid: choose "braid" as the render engine, then F12.

The scene goes through Blender's glTF exporter; area lamps and the world, which glTF lacks, are added. Lights keep
Blender's units. The program is the one of the preferences, the environment variable BRAID, or `braid` on the path.
"""
import base64
import json
import math
import os
import shutil
import struct
import subprocess
import tempfile

import bpy
import numpy as np
from mathutils import Matrix

bl_info = {
    "name": "braid",
    "author": "the authors of braid",
    "version": (0, 2, 0),
    "blender": (3, 4, 0),
    "category": "Render",
    "description": "Path tracing with built-in combiners, on the CPU",
}

Y_UP = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))  # from Blender's axes to glTF's


def area_radiance(lamp):
    """Of Cycles: a quarter of the power over the area, W/(sr m2) by channel."""
    return [channel * lamp.energy / (4 * area_of(lamp)) for channel in lamp.color]


def sides_of(lamp):
    """Width and height in metres."""
    return lamp.size, lamp.size_y if lamp.shape in {"RECTANGLE", "ELLIPSE"} else lamp.size


def area_of(lamp):
    width, height = sides_of(lamp)
    return width * height * (math.pi / 4 if lamp.shape in {"DISK", "ELLIPSE"} else 1)


def outline(lamp):
    """Corners of the lamp in its own plane, counter-clockwise as seen from where it shines."""
    width, height = sides_of(lamp)
    if lamp.shape in {"DISK", "ELLIPSE"}:
        angles = [-2 * math.pi * k / 48 for k in range(48)]
        return [(width / 2 * math.cos(a), height / 2 * math.sin(a), 0) for a in angles]
    x, y = width / 2, height / 2
    return [(-x, -y, 0), (-x, y, 0), (x, y, 0), (x, -y, 0)]


def append(document, key, item):
    document.setdefault(key, []).append(item)
    return len(document[key]) - 1


def add_area_lamp(document, name, matrix, lamp):
    """An emissive polygon that shines along the lamp's -z, as the lamp does."""
    corners = outline(lamp)
    indices = [i for k in range(1, len(corners) - 1) for i in (0, k, k + 1)]
    data = struct.pack(f"<{3 * len(corners)}f", *[v for corner in corners for v in corner])
    data += struct.pack(f"<{len(indices)}I", *indices)
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    buffer = append(document, "buffers", {"uri": uri, "byteLength": len(data)})
    split = 12 * len(corners)
    views = [append(document, "bufferViews", {"buffer": buffer, "byteOffset": begin, "byteLength": size})
             for begin, size in ((0, split), (split, len(data) - split))]
    low, high = ([f(c[i] for c in corners) for i in range(3)] for f in (min, max))
    positions = append(document, "accessors", {"bufferView": views[0], "componentType": 5126, "count": len(corners),
                                               "type": "VEC3", "min": low, "max": high})
    triangles = append(document, "accessors", {"bufferView": views[1], "componentType": 5125, "count": len(indices),
                                               "type": "SCALAR"})
    radiance = area_radiance(lamp)
    strength = max(*radiance, 1e-30)
    material = append(document, "materials", {
        "name": name, "emissiveFactor": [v / strength for v in radiance],
        "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}})
    mesh = append(document, "meshes", {"name": name, "primitives": [
        {"attributes": {"POSITION": positions}, "indices": triangles, "material": material}]})
    columns = (Y_UP @ matrix).transposed()
    node = append(document, "nodes", {"name": name, "mesh": mesh, "matrix": [v for row in columns for v in row]})
    document["scenes"][document.get("scene", 0)].setdefault("nodes", []).append(node)
    used = document.setdefault("extensionsUsed", [])
    if "KHR_materials_emissive_strength" not in used:
        used.append("KHR_materials_emissive_strength")


def linear_pixels(image):
    """(height, width, 3) floats, the last row first as Blender and PFM have them."""
    pixels = np.empty(4 * image.size[0] * image.size[1], np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(image.size[1], image.size[0], 4)[..., :3]
    if image.is_float:
        return pixels
    return np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)


def upstream(socket, kind):
    """The node of a kind that feeds a socket; none where another does, or nothing."""
    return next((link.from_node for link in socket.links if link.from_node.type == kind), None)


def directions(height, width):
    """(height, width, 3): the direction of every pixel, as Blender lays an equirectangular image out."""
    azimuth = math.pi * (1 - 2 * (np.arange(width) + 0.5) / width)[None, :]
    altitude = math.pi * ((np.arange(height) + 0.5) / height - 0.5)[:, None]
    level = np.cos(altitude)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(altitude) + 0 * azimuth], axis=-1)


def mapped(mapping, vectors):
    """What a Mapping node makes of vectors; sockets that other nodes feed count as their own values."""
    def value(name):
        return np.array(mapping.inputs[name].default_value[:]) if name in mapping.inputs else np.zeros(3)

    turn = np.array(mapping.inputs["Rotation"].default_value.to_matrix())
    scale, kind = value("Scale"), mapping.vector_type
    if kind == "TEXTURE":
        return ((vectors - value("Location")) @ turn) / np.where(scale == 0, 1, scale)
    vectors = vectors / np.where(scale == 0, 1, scale) if kind == "NORMAL" else vectors * scale
    return vectors @ turn.T + (value("Location") if kind == "POINT" else 0)


def turned(pixels, mapping):
    """The image as the world shows it behind its Mapping node: every pixel mixes the four that its direction meets."""
    height, width = pixels.shape[:2]
    vectors = mapped(mapping, directions(height, width))
    length = np.maximum(np.linalg.norm(vectors, axis=-1), 1e-30)
    column = (0.5 - np.arctan2(vectors[..., 1], vectors[..., 0]) / (2 * math.pi)) * width - 0.5
    row = (0.5 + np.arcsin(np.clip(vectors[..., 2] / length, -1, 1)) / math.pi) * height - 0.5
    left, low = np.floor(column).astype(int), np.floor(row).astype(int)
    right_share, high_share = (column - left)[..., None], (row - low)[..., None]

    def line(y):
        y = np.clip(y, 0, height - 1)
        return (1 - right_share) * pixels[y, left % width] + right_share * pixels[y, (left + 1) % width]

    return ((1 - high_share) * line(low) + high_share * line(low + 1)).astype(np.float32)


def world_radiance(world):
    """Pixels of the environment, W/(sr m2); none where the world is black."""
    if world is None:
        return None
    pixels, strength = np.array(world.color[:], np.float32)[None, None], 1.0
    node = world.node_tree.nodes.get("Background") if world.use_nodes and world.node_tree else None
    if node:
        strength = node.inputs["Strength"].default_value
        pixels = np.array(node.inputs["Color"].default_value[:3], np.float32)[None, None]
        texture = upstream(node.inputs["Color"], "TEX_ENVIRONMENT")
        if texture and texture.image:
            pixels = linear_pixels(texture.image)
            mapping = upstream(texture.inputs["Vector"], "MAPPING")
            pixels = turned(pixels, mapping) if mapping else pixels
    pixels = strength * pixels
    return pixels if pixels.max() > 0 else None


def write_pfm(path, pixels):
    if pixels.shape[:2] == (1, 1):
        pixels = np.broadcast_to(pixels, (4, 8, 3))
    with open(path, "wb") as file:
        file.write(f"PF\n{pixels.shape[1]} {pixels.shape[0]}\n-1.0\n".encode())
        file.write(np.ascontiguousarray(pixels, "<f4").tobytes())


def export(depsgraph, folder):
    """Writes the scene; returns its path and what the command line needs besides."""
    scene = depsgraph.scene
    path = os.path.join(folder, "scene.gltf")
    bpy.ops.export_scene.gltf(filepath=path, export_format="GLTF_SEPARATE", use_renderable=True, use_active_scene=True,
                              export_cameras=True, export_lights=True, export_apply=True, export_animations=False,
                              convert_lighting_mode="COMPAT")
    with open(path, encoding="utf-8") as file:
        document = json.load(file)
    for instance in depsgraph.object_instances:
        thing = instance.object
        if thing.type == "LIGHT" and thing.data.type == "AREA" and not thing.hide_render:
            add_area_lamp(document, thing.name, instance.matrix_world.copy(), thing.data)
    with open(path, "w", encoding="utf-8") as file:
        json.dump(document, file)
    words = ["--no-default-light"]
    if scene.camera:
        words += ["--camera", scene.camera.name]
    radiance = world_radiance(scene.world)
    if radiance is not None:
        write_pfm(os.path.join(folder, "world.pfm"), radiance)
        words += ["--env", os.path.join(folder, "world.pfm")]
    return path, words


def program():
    addon = bpy.context.preferences.addons.get(__name__)
    named = addon.preferences.program if addon and addon.preferences else ""
    return bpy.path.abspath(named) if named else os.environ.get("BRAID") or shutil.which("braid")


class BraidPreferences(bpy.types.AddonPreferences):
    bl_idname = __name__
    program: bpy.props.StringProperty(name="braid", subtype="FILE_PATH", description="The program; empty: on the path")

    def draw(self, context):
        self.layout.prop(self, "program")


class BraidSettings(bpy.types.PropertyGroup):
    samples: bpy.props.IntProperty(name="Samples", default=64, min=1, description="Samples per pixel")
    seconds: bpy.props.FloatProperty(name="Time Limit", default=0, min=0, unit="TIME_ABSOLUTE", description="0: none")
    integrator: bpy.props.StringProperty(name="Integrator", default="auto")
    combine: bpy.props.StringProperty(name="Combine", default="auto", description="none, or methods of braid --list")


class BraidEngine(bpy.types.RenderEngine):
    bl_idname = "BRAID"
    bl_label = "braid"
    bl_use_preview = False
    bl_use_shading_nodes_custom = False

    def update(self, data, depsgraph):
        # Here Blender holds still; render() runs beside it.
        self.folder = tempfile.mkdtemp(prefix="braid-")
        self.failure = None
        try:
            self.scene_file, self.words = export(depsgraph, self.folder)
        except Exception as error:  # whatever the exporter throws is told where Blender shows errors
            self.failure = str(error)

    def render(self, depsgraph):
        try:
            if self.failure is None:
                self.failure = self.run(depsgraph.scene)
            if self.failure:
                self.report({"ERROR"}, self.failure)
                self.error_set(self.failure)
        finally:
            shutil.rmtree(self.folder, ignore_errors=True)

    def run(self, scene):
        """Why there is no image; none: there is."""
        braid = program()
        if not braid:
            return "braid is not on the path: name the program in the preferences of the add-on"
        scale = scene.render.resolution_percentage / 100
        width, height = (max(1, int(v * scale)) for v in (scene.render.resolution_x, scene.render.resolution_y))
        out, s = os.path.join(self.folder, "out.exr"), scene.braid
        words = [braid, "render", self.scene_file, *self.words, "--size", f"{width}x{height}", "--spp", str(s.samples),
                 "--integrator", s.integrator, "--combine", s.combine, "--aovs", "none", "--float", "--quiet",
                 "--log-json", "-", "-o", out]
        if s.seconds > 0:
            words += ["--time", str(s.seconds)]
        if scene.render.film_transparent:
            words += ["--transparent"]
        told = os.path.join(self.folder, "errors")
        with open(told, "w", encoding="utf-8") as errors:
            try:
                process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=errors, text=True)
            except OSError as error:
                return f"{braid}: {error.strerror}: name the program in the preferences of the add-on"
            with process:
                for line in process.stdout:
                    self.show(json.loads(line), s.samples)
                    if self.test_break():
                        process.terminate()  # what is done is saved
        if not os.path.exists(out):
            with open(told, encoding="utf-8") as errors:
                lines = errors.read().strip().splitlines()
            return lines[-1] if lines else f"braid ended with code {process.returncode}"
        result = self.begin_result(0, 0, width, height)
        result.layers[0].load_from_file(out)
        self.end_result(result)
        return None

    def show(self, record, samples):
        done = record.get("spp") or record.get("round") or 0
        self.update_progress(min(1.0, done / samples))
        self.update_stats("braid", f"{done} of {samples} samples")


class BraidPanel(bpy.types.Panel):
    bl_idname = "RENDER_PT_braid"
    bl_label = "braid"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "render"
    COMPAT_ENGINES = {"BRAID"}

    @classmethod
    def poll(cls, context):
        return context.engine == "BRAID"

    def draw(self, context):
        self.layout.use_property_split = True
        for name in ("samples", "seconds", "integrator", "combine"):
            self.layout.prop(context.scene.braid, name)


CLASSES = (BraidPreferences, BraidSettings, BraidEngine, BraidPanel)


def cycles_panels():
    """Panels of others that serve every engine: materials as Cycles has them."""
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", ())
        if "CYCLES" in engines or "BLENDER_RENDER" in engines:
            yield panel


def register():
    for item in CLASSES:
        bpy.utils.register_class(item)
    bpy.types.Scene.braid = bpy.props.PointerProperty(type=BraidSettings)
    for panel in cycles_panels():
        panel.COMPAT_ENGINES.add("BRAID")


def unregister():
    for panel in cycles_panels():
        panel.COMPAT_ENGINES.discard("BRAID")
    del bpy.types.Scene.braid
    for item in reversed(CLASSES):
        bpy.utils.unregister_class(item)


if __name__ == "__main__":
    register()
