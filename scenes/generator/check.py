"""A small validator for the files this generator writes."""

import json
import math
import struct

from .glb import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, WIDTH

FORMAT = {5122: ("h", 2), 5123: ("H", 2), 5125: ("I", 4), 5126: ("f", 4)}


class Invalid(Exception):
    pass


def require(condition, message):
    if not condition:
        raise Invalid(message)


def _chunks(data):
    magic, version, total = struct.unpack_from("<4sII", data)
    require(magic == b"glTF" and version == 2, "not a glTF 2.0 binary")
    require(total == len(data) and total % 4 == 0, "wrong total length")
    size, kind = struct.unpack_from("<I4s", data, 12)
    require(kind == b"JSON" and size % 4 == 0, "bad JSON chunk")
    document = json.loads(data[20:20 + size])
    start = 20 + size
    size, kind = struct.unpack_from("<I4s", data, start)
    require(kind == b"BIN\0" and start + 8 + size == total, "bad BIN chunk")
    require(document["buffers"][0]["byteLength"] == size, "buffer length")
    return document, data[start + 8:]


class File:
    def __init__(self, data):
        self.gltf, self.binary = _chunks(data)
        for view in self.gltf["bufferViews"]:
            require(view["byteOffset"] % 4 == 0, "unaligned buffer view")
            require(view["byteOffset"] + view["byteLength"]
                    <= len(self.binary), "buffer view out of range")

    def read(self, index, kind, target):
        """Rows of an accessor, after checking its layout and bounds."""
        accessor = self.gltf["accessors"][index]
        view = self.gltf["bufferViews"][accessor["bufferView"]]
        require(accessor["type"] == kind, f"accessor {index} is not {kind}")
        require(view.get("target") == target, f"target of accessor {index}")
        code, size = FORMAT[accessor["componentType"]]
        width, count = WIDTH[kind], accessor["count"]
        stride = view.get("byteStride", width * size)
        require(count > 0, f"accessor {index} is empty")
        require((count - 1) * stride + width * size <= view["byteLength"],
                f"accessor {index} overruns its view")
        rows = [struct.unpack_from(f"<{width}{code}", self.binary,
                                   view["byteOffset"] + i * stride)
                for i in range(count)]
        require(all(math.isfinite(x) for row in rows for x in row),
                f"accessor {index} is not finite")
        columns = list(zip(*rows))
        for key, best in (("min", min), ("max", max)):
            if key in accessor:
                require(accessor[key] == [best(c) for c in columns],
                        f"{key} of accessor {index}")
        return rows


def _unit(rows, what):
    for row in rows:
        size = math.sqrt(sum(x * x for x in row))
        require(abs(size - 1) < 1e-3, f"{what} of length {size}")


def _primitive(file, primitive):
    attributes = primitive["attributes"]
    position = file.gltf["accessors"][attributes["POSITION"]]
    require("min" in position and "max" in position, "POSITION has no bounds")
    count = len(file.read(attributes["POSITION"], "VEC3", ARRAY_BUFFER))
    for name, kind in (("NORMAL", "VEC3"), ("TANGENT", "VEC4"),
                       ("TEXCOORD_0", "VEC2")):
        if name in attributes:
            rows = file.read(attributes[name], kind, ARRAY_BUFFER)
            require(len(rows) == count, f"{name} count")
            if name != "TEXCOORD_0":
                _unit([row[:3] for row in rows], name)
    require("TANGENT" not in attributes or "NORMAL" in attributes,
            "TANGENT without NORMAL")
    indices = file.read(primitive["indices"], "SCALAR", ELEMENT_ARRAY_BUFFER)
    require(len(indices) % 3 == 0, "index count")
    require(max(i for i, in indices) < count, "index out of range")
    require(primitive["material"] < len(file.gltf["materials"]), "material")
    return len(indices) // 3


def _closed_solid(file, primitives):
    """Refracting solids must be watertight and face outward. Corners are
    matched by position because creases duplicate vertices."""
    edges, volume = {}, 0.0
    for primitive in primitives:
        points = file.read(primitive["attributes"]["POSITION"], "VEC3",
                           ARRAY_BUFFER)
        indices = [i for i, in file.read(primitive["indices"], "SCALAR",
                                         ELEMENT_ARRAY_BUFFER)]
        for k in range(0, len(indices), 3):
            p, q, r = (points[i] for i in indices[k:k + 3])
            volume += (p[0] * (q[1] * r[2] - q[2] * r[1])
                       + p[1] * (q[2] * r[0] - q[0] * r[2])
                       + p[2] * (q[0] * r[1] - q[1] * r[0])) / 6
            for a, b in ((p, q), (q, r), (r, p)):
                edges[a, b] = edges.get((a, b), 0) + 1
    require(volume > 0, "solid is inside out")
    require(all(edges.get((b, a)) == n for (a, b), n in edges.items()),
            "solid is not closed")


def _is_solid(file, primitive):
    material = file.gltf["materials"][primitive["material"]]
    return "KHR_materials_volume" in material.get("extensions", {})


def check(data):
    """Raises Invalid, or returns (stored, instanced) triangle counts."""
    file = File(data)
    gltf = file.gltf
    counts = []
    for mesh in gltf["meshes"]:
        counts.append(sum(_primitive(file, p) for p in mesh["primitives"]))
        solid = [p for p in mesh["primitives"] if _is_solid(file, p)]
        if solid:
            _closed_solid(file, solid)
    instanced = 0
    for node in gltf["nodes"]:
        copies = 1
        instancing = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
        if instancing:
            sizes = set()
            for name, index in instancing["attributes"].items():
                kind = "VEC4" if name == "ROTATION" else "VEC3"
                rows = file.read(index, kind, None)
                sizes.add(len(rows))
                if name == "ROTATION":
                    _unit(rows, name)
            require(len(sizes) == 1, "instance attributes differ in length")
            copies = sizes.pop()
        if "mesh" in node:
            instanced += copies * counts[node["mesh"]]
        if "rotation" in node:
            _unit([node["rotation"]], "node rotation")
    cameras = [n for n in gltf["nodes"] if "camera" in n]
    require(len(cameras) == 1 and cameras[0]["name"] == "camera", "camera")
    require(gltf["scenes"][0]["extras"]["stresses"], "extras")
    require(set(gltf.get("extensionsRequired", []))
            <= set(gltf.get("extensionsUsed", [])), "extension lists")
    return sum(counts), instanced
