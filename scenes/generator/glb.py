"""Writes one scene as a binary glTF 2.0 (.glb) file."""

import json
import struct

from .maths import look_at

FLOAT, SHORT, UINT16, UINT32 = 5126, 5122, 5123, 5125
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Scene:
    """A glTF document under construction. Methods return glTF indices."""

    def __init__(self, name, stresses):
        self.name = name
        self.gltf = {
            "asset": {"version": "2.0", "generator": "braid scenes"},
            "scene": 0,
            "scenes": [{"name": name, "nodes": [],
                        "extras": {"stresses": stresses}}],
        }
        self.binary = bytearray()
        self.used, self.required = set(), set()
        self._stored = {}

    # ---- containers -----------------------------------------------------

    def _push(self, kind, item):
        items = self.gltf.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def _view(self, data, target=None, stride=None):
        self.binary.extend(b"\0" * (-len(self.binary) % 4))
        view = {"buffer": 0, "byteOffset": len(self.binary),
                "byteLength": len(data)}
        if target:
            view["target"] = target
        if stride:
            view["byteStride"] = stride
        self.binary.extend(data)
        return self._push("bufferViews", view)

    def _floats(self, rows, kind, target=ARRAY_BUFFER, bounds=False):
        flat = [x for row in rows for x in row]
        data = struct.pack(f"<{len(flat)}f", *flat)
        accessor = {"bufferView": self._view(data, target),
                    "componentType": FLOAT, "count": len(rows), "type": kind}
        if bounds:
            # Bounds must be those of the stored 32-bit values.
            stored = struct.unpack(f"<{len(flat)}f", data)
            accessor["min"] = [min(stored[i::3]) for i in range(3)]
            accessor["max"] = [max(stored[i::3]) for i in range(3)]
        return self._push("accessors", accessor)

    def _quantized(self, positions, step):
        """Positions as 16-bit counts of `step`, padded to a stride of 8."""
        rows = [tuple(round(x / step) for x in p) for p in positions]
        data = b"".join(struct.pack("<3hxx", *row) for row in rows)
        columns = list(zip(*rows))
        self._extension("KHR_mesh_quantization", required=True)
        return self._push("accessors", {
            "bufferView": self._view(data, ARRAY_BUFFER, 8),
            "componentType": SHORT, "count": len(rows), "type": "VEC3",
            "min": [min(c) for c in columns],
            "max": [max(c) for c in columns]})

    def _indices(self, indices, vertex_count):
        small = vertex_count < 65535
        data = struct.pack(f"<{len(indices)}{'H' if small else 'I'}", *indices)
        return self._push("accessors", {
            "bufferView": self._view(data, ELEMENT_ARRAY_BUFFER),
            "componentType": UINT16 if small else UINT32,
            "count": len(indices), "type": "SCALAR"})

    def _extension(self, name, required=False):
        self.used.add(name)
        if required:
            self.required.add(name)

    # ---- textures and materials -----------------------------------------

    def texture(self, png, repeat=True):
        wrap = 10497 if repeat else 33071
        sampler = {"magFilter": 9729, "minFilter": 9987,
                   "wrapS": wrap, "wrapT": wrap}
        samplers = self.gltf.setdefault("samplers", [])
        if sampler not in samplers:
            samplers.append(sampler)
        image = self._push("images", {"bufferView": self._view(png),
                                      "mimeType": "image/png"})
        return self._push("textures", {"source": image,
                                       "sampler": samplers.index(sampler)})

    def material(self, name, color=(0.8, 0.8, 0.8), metallic=0.0,
                 roughness=1.0, emission=None, color_map=None,
                 normal_map=None, emission_map=None, metal_rough_map=None,
                 mask=None, double_sided=True, **extensions):
        """`emission` is a radiance; `mask` an alpha cutoff; further keywords
        are material extensions by their glTF names."""
        pbr = {"baseColorFactor": [*color, 1.0],
               "metallicFactor": metallic, "roughnessFactor": roughness}
        material = {"name": name, "pbrMetallicRoughness": pbr,
                    "doubleSided": double_sided}
        if color_map is not None:
            pbr["baseColorTexture"] = {"index": color_map}
        if metal_rough_map is not None:
            pbr["metallicRoughnessTexture"] = {"index": metal_rough_map}
        if normal_map is not None:
            material["normalTexture"] = {"index": normal_map}
        if emission_map is not None:
            material["emissiveTexture"] = {"index": emission_map}
        if mask is not None:
            material.update(alphaMode="MASK", alphaCutoff=mask)
        if emission is not None:
            # emissiveFactor may not exceed 1: the strength carries the rest.
            strength = max(1.0, *emission)
            material["emissiveFactor"] = [e / strength for e in emission]
            if strength > 1.0:
                extensions["KHR_materials_emissive_strength"] = {
                    "emissiveStrength": strength}
        if extensions:
            material["extensions"] = extensions
        for extension in extensions:
            self._extension(extension)
        return self._push("materials", material)

    def diffuse(self, name, color, **options):
        """Perfectly diffuse: the dielectric coat is switched off."""
        return self.material(name, color, KHR_materials_specular={
            "specularFactor": 0.0}, **options)

    def emitter(self, name, radiance):
        return self.diffuse(name, (0.0, 0.0, 0.0), emission=radiance)

    def glass(self, name, ior, color=(1.0, 1.0, 1.0), roughness=0.0,
              **volume):
        """A refracting closed solid; its faces must point outward."""
        return self.material(
            name, color, roughness=roughness, double_sided=False,
            KHR_materials_transmission={"transmissionFactor": 1.0},
            KHR_materials_volume={"thicknessFactor": 1.0, **volume},
            KHR_materials_ior={"ior": ior})

    # ---- meshes and nodes -----------------------------------------------

    def mesh(self, name, *parts, step=None):
        """parts: (Mesh, material) pairs, one primitive each. With `step`
        positions are stored as integers, to be scaled back by the nodes."""
        primitives = []
        for shape, material in parts:
            # A shape used with several materials is stored once. Keeping
            # the shape in the table keeps its id from being reused.
            if id(shape) not in self._stored:
                self._stored[id(shape)] = shape, self._geometry(shape, step)
            primitives.append({"material": material,
                               **self._stored[id(shape)][1]})
        return self._push("meshes", {"name": name, "primitives": primitives})

    def _geometry(self, shape, step):
        position = (self._quantized(shape.positions, step) if step else
                    self._floats(shape.positions, "VEC3", bounds=True))
        attributes = {"POSITION": position}
        for name, rows, kind in (("NORMAL", shape.normals, "VEC3"),
                                 ("TANGENT", shape.tangents, "VEC4"),
                                 ("TEXCOORD_0", shape.uvs, "VEC2")):
            if rows:
                attributes[name] = self._floats(rows, kind)
        return {"attributes": attributes, "indices": self._indices(
            shape.indices, len(shape.positions))}

    def node(self, name, **fields):
        index = self._push("nodes", {"name": name, **fields})
        self.gltf["scenes"][0]["nodes"].append(index)
        return index

    def place(self, name, *parts, at=None):
        """A mesh with a node of its own, shifted by `at` if given."""
        mesh = self.mesh(name, *parts)
        if at is None:
            return self.node(name, mesh=mesh)
        return self.node(name, mesh=mesh, translation=list(at))

    def instances(self, name, mesh, translations, rotations=None,
                  scales=None):
        columns = {"TRANSLATION": (translations, "VEC3"),
                   "ROTATION": (rotations, "VEC4"),
                   "SCALE": (scales, "VEC3")}
        attributes = {key: self._floats(rows, kind, target=None)
                      for key, (rows, kind) in columns.items() if rows}
        self._extension("EXT_mesh_gpu_instancing", required=True)
        return self.node(name, mesh=mesh, extensions={
            "EXT_mesh_gpu_instancing": {"attributes": attributes}})

    def camera(self, eye, target, yfov):
        """aspectRatio is left out so that any output size fits."""
        index = self._push("cameras", {"type": "perspective", "perspective": {
            "yfov": yfov * 3.141592653589793 / 180, "znear": 0.01}})
        self.node("camera", camera=index, translation=list(eye),
                  rotation=list(look_at(eye, target).quaternion()))

    def light(self, kind, position, target, color=(1.0, 1.0, 1.0),
              intensity=1.0, **spot):
        """A punctual light at `position` shining towards `target`."""
        self._extension("KHR_lights_punctual", required=True)
        lights = self.gltf.setdefault("extensions", {}).setdefault(
            "KHR_lights_punctual", {"lights": []})["lights"]
        lights.append({"name": kind, "type": kind, "color": list(color),
                       "intensity": intensity, **spot})
        self.node(f"{kind} light", translation=list(position),
                  rotation=list(look_at(position, target).quaternion()),
                  extensions={"KHR_lights_punctual": {
                      "light": len(lights) - 1}})

    # ---- output ---------------------------------------------------------

    def to_bytes(self):
        document = dict(self.gltf)
        if self.used:
            document["extensionsUsed"] = sorted(self.used)
        if self.required:
            document["extensionsRequired"] = sorted(self.required)
        binary = bytes(self.binary) + b"\0" * (-len(self.binary) % 4)
        document["buffers"] = [{"byteLength": len(binary)}]
        text = json.dumps(document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + len(binary)
        return (struct.pack("<4sII", b"glTF", 2, total)
                + struct.pack("<I4s", len(text), b"JSON") + text
                + struct.pack("<I4s", len(binary), b"BIN\0") + binary)
