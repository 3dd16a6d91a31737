#!/usr/bin/env python3
"""Writes the files that fuzzing starts from, and the words it puts into them.

    tests/fuzz/seeds.py BRAID FOLDER

makes FOLDER/gltf, texture, image and state, and FOLDER/words.dict. BRAID is a
build of braid, which renders the images and states.
"""

import json
import math
import pathlib
import re
import struct
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "scenes"))
sys.dont_write_bytecode = True

from generator.stress_cases import CASES  # noqa: E402
from generator.stress_images import write_exr  # noqa: E402
from generator.textures import png  # noqa: E402
from image_seeds import ktx2_seeds, texture_seeds  # noqa: E402

LARGEST = 16384     # bytes of a seed; mutations of larger ones reach less


def split_glb(data):
    """JSON, a zero byte, and the binary chunk: what the target takes."""
    size = struct.unpack_from("<I", data, 12)[0]
    body = data[20:20 + size].rstrip(b" \0") + b"\0"
    return body + data[20 + size + 8:]


def every_feature():
    """One small scene with a bit of everything that glTF has."""
    triangle = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    binary = triangle + struct.pack("<3H2x", 0, 1, 2)
    binary += struct.pack("<6f", 0, 0, 1, 0, 1, 1)              # uv, 44
    binary += struct.pack("<16f", *(float(i % 5 == 0) for i in range(16)))
    binary += bytes(12) + struct.pack("<12f", *[0.25] * 12)     # joints
    binary += struct.pack("<2f", 0, 1) + struct.pack("<6f", *range(6))
    image = png(2, 2, lambda x, y: (x * 255, y * 255, 9))
    views, at = [], 0
    for size in (36, 8, 24, 64, 12, 48, 8, 24):
        views.append({"buffer": 0, "byteOffset": at, "byteLength": size})
        at += size
    views.append({"buffer": 0, "byteOffset": at, "byteLength": len(image)})
    binary += image
    floats = {"componentType": 5126}
    accessors = [
        dict(floats, bufferView=0, count=3, type="VEC3",
             min=[0, 0, 0], max=[1, 1, 0]),
        {"bufferView": 1, "componentType": 5123, "count": 3,
         "type": "SCALAR"},
        dict(floats, bufferView=2, count=3, type="VEC2"),
        dict(floats, bufferView=3, count=1, type="MAT4"),
        {"bufferView": 4, "componentType": 5121, "count": 3, "type": "VEC4"},
        dict(floats, bufferView=5, count=3, type="VEC4"),
        dict(floats, bufferView=6, count=2, type="SCALAR"),
        dict(floats, bufferView=7, count=2, type="VEC3"),
        dict(floats, count=3, type="VEC3", sparse={
            "count": 1, "indices": {"bufferView": 1, "componentType": 5123},
            "values": {"bufferView": 0}})]
    texture = {"index": 0, "texCoord": 0, "extensions": {
        "KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1,
                                  "scale": [2, 2], "texCoord": 0}}}
    material = {
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.6, 0.7, 0.8], "metallicFactor": 0.5,
            "roughnessFactor": 0.3, "baseColorTexture": texture,
            "metallicRoughnessTexture": texture},
        "normalTexture": dict(texture, scale=0.5), "doubleSided": True,
        "occlusionTexture": texture, "emissiveTexture": texture,
        "emissiveFactor": [1, 1, 1], "alphaMode": "MASK", "alphaCutoff": 0.4,
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 5},
            "KHR_materials_ior": {"ior": 1.4},
            "KHR_materials_transmission": {"transmissionFactor": 0.5},
            "KHR_materials_volume": {"thicknessFactor": 1,
                                     "attenuationDistance": 2,
                                     "attenuationColor": [0.9, 0.8, 0.7]},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.5,
                                        "clearcoatRoughnessFactor": 0.1},
            "KHR_materials_sheen": {"sheenColorFactor": [0.2, 0.2, 0.2],
                                    "sheenRoughnessFactor": 0.4},
            "KHR_materials_specular": {"specularFactor": 0.5,
                                       "specularColorFactor": [1, 0.9, 0.8]},
            "KHR_materials_iridescence": {"iridescenceFactor": 1,
                                          "iridescenceIor": 1.3,
                                          "iridescenceThicknessMaximum": 400},
            "KHR_materials_anisotropy": {"anisotropyStrength": 0.5,
                                         "anisotropyRotation": 1}}}
    other = {"alphaMode": "BLEND", "extensions": {
        "KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": [1, 1, 1, 0.5], "specularFactor": [0, 1, 0],
            "glossinessFactor": 0.5, "diffuseTexture": {"index": 0}},
        "KHR_materials_diffuse_transmission": {
            "diffuseTransmissionFactor": 0.5},
        "KHR_materials_unlit": {}}}
    primitive = {
        "attributes": {"POSITION": 0, "TEXCOORD_0": 2, "JOINTS_0": 4,
                       "WEIGHTS_0": 5, "COLOR_0": 5},
        "indices": 1, "material": 0, "mode": 4,
        "targets": [{"POSITION": 8}],
        "extensions": {"KHR_materials_variants": {"mappings": [
            {"material": 1, "variants": [0]}]}}}
    strip = {"attributes": {"POSITION": 8}, "mode": 5, "material": 1}
    strokes = [{"attributes": {"POSITION": 0, "COLOR_0": 5}, "mode": mode}
               for mode in range(4)]
    nodes = [
        {"mesh": 0, "skin": 0, "weights": [0.5], "children": [1, 2]},
        {"camera": 0, "translation": [0, 0, 3]},
        {"extensions": {"KHR_lights_punctual": {"light": 0},
                        "KHR_node_visibility": {"visible": True}},
         "rotation": [0, 0, 0, 1], "scale": [1, -1, 1]},
        {"mesh": 1, "extensions": {"EXT_mesh_gpu_instancing": {
            "attributes": {"TRANSLATION": 7}}}},
        {"matrix": [float(i % 5 == 0) for i in range(16)], "camera": 1}]
    document = {
        "asset": {"version": "2.0"}, "scene": 0,
        "scenes": [{"nodes": [0, 3, 4], "extensions": {
            "EXT_lights_image_based": {"light": 0}}}], "nodes": nodes,
        "meshes": [{"primitives": [primitive], "weights": [0.1]},
                   {"primitives": [strip, *strokes]}],
        "skins": [{"joints": [2], "inverseBindMatrices": 3}],
        "animations": [{"samplers": [{"input": 6, "output": 7,
                                      "interpolation": "LINEAR"}],
                        "channels": [{"sampler": 0, "target": {
                            "node": 2, "path": "translation"}}]}],
        "cameras": [{"type": "perspective", "perspective": {
            "yfov": 0.8, "znear": 0.1, "aspectRatio": 1.5}},
            {"type": "orthographic", "orthographic": {
                "xmag": 1, "ymag": 1, "znear": 0.1, "zfar": 10}}],
        "materials": [material, other],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}],
        "images": [{"bufferView": 8, "mimeType": "image/png"}],
        "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
        "extensions": {
            "EXT_lights_image_based": {"lights": [{
                "intensity": 2, "rotation": [0, 0, 0, 1],
                "irradianceCoefficients": [[1, 0.5, 0.2]] * 9,
                "specularImages": [[0] * 6], "specularImageSize": 2}]},
            "KHR_lights_punctual": {"lights": [
                {"type": "spot", "intensity": 10, "range": 9,
                 "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.4}},
                {"type": "point"}, {"type": "directional"}]},
            "KHR_materials_variants": {"variants": [{"name": "red"}]}},
        "extensionsUsed": ["EXT_lights_image_based", "KHR_lights_punctual",
                           "KHR_node_visibility"]}
    return json.dumps(document, separators=(",", ":")).encode() + b"\0" \
        + binary


def compressed(extension, payload):
    """A primitive behind a compression extension, with bytes to mutate."""
    document = {
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}], "extensionsRequired": [extension],
        "accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"},
                      {"componentType": 5123, "count": 3,
                       "type": "SCALAR"}],
        "bufferViews": [{"buffer": 0, "byteLength": len(payload)}],
        "buffers": [{"byteLength": len(payload)}]}
    primitive = {"attributes": {"POSITION": 0}, "indices": 1}
    if extension == "EXT_meshopt_compression":
        document["buffers"].append({"byteLength": 36})
        document["bufferViews"] = [{
            "buffer": 1, "byteLength": 36, "byteStride": 12, "extensions": {
                extension: {"buffer": 0, "byteOffset": 0, "byteStride": 12,
                            "byteLength": len(payload), "count": 3,
                            "mode": "ATTRIBUTES", "filter": "NONE"}}}]
        document["accessors"][0]["bufferView"] = 0
        del primitive["indices"]
    else:
        primitive["extensions"] = {extension: {
            "bufferView": 0, "attributes": {"POSITION": 0}}}
    document["meshes"] = [{"primitives": [primitive]}]
    return json.dumps(document).encode() + b"\0" + payload


def flawed():
    """The scene of every feature, with one flaw that costs only a part."""
    body, binary = every_feature().split(b"\0", 1)
    flaws = {
        "texture": lambda d: d["images"].__setitem__(0, {"uri": "leaf.png"}),
        "null": lambda d: d["materials"][0].update(normalTexture=None),
        "huge": lambda d: d["nodes"][1].update(translation=[1e300, 0, 3]),
        "index": lambda d: d["meshes"][0]["primitives"][0].update(indices=6),
        "accessor": lambda d: d["accessors"][2].update(count=900),
        "sparse": lambda d: d["accessors"][8]["sparse"].update(count=2),
        "joints": lambda d: d["accessors"][4].update(
            componentType=5125, count=1),
        "skin": lambda d: d["skins"][0].update(joints=[99, 2]),
        "channel": lambda d: d["animations"][0]["channels"].append(
            {"sampler": 3, "target": {"path": "scale"}}),
        "cycle": lambda d: d["nodes"][2].update(children=[0]),
        "camera": lambda d: d["cameras"][0].pop("perspective"),
        "lights": lambda d: d["extensions"]["KHR_lights_punctual"][
            "lights"][0].update(range=0, spot=None),
        "extension": lambda d: d.update(extensionsRequired=["ACME_gizmo"]),
        "view": lambda d: d["bufferViews"][0].update(byteLength=9000),
        "sets": lambda d: d["materials"][0]["emissiveTexture"].update(
            texCoord=7)}
    for name, change in flaws.items():
        document = json.loads(body)
        change(document)
        yield "flaw, " + name, json.dumps(document).encode() + b"\0" + binary
    yield "flaw, cut", body + b"\0" + binary[:150]
    yield "flaw, text", body.replace(b'"red"', b'"r\xe9\td\\q"').replace(
        b"0.4,", b"NaN,").replace(b"0.5,", b"-1e999,") + b"\0" + binary


def gltf_seeds():
    for case in CASES.values():
        if re.match("1e[67] |texture .*x16384|lights|scale", case.name):
            continue    # too large, or nothing new
        data = case.build().to_bytes()
        if len(data) <= LARGEST:
            yield case.name, split_glb(data)
    yield "every feature", every_feature()
    yield "draco", compressed("KHR_draco_mesh_compression",
                              b"DRACO\x02\x02\x01\x01\0\0" + bytes(40))
    yield "meshopt", compressed("EXT_meshopt_compression",
                                b"\xa0" + bytes(60))
    yield from flawed()
    yield "container", b"glTF" + struct.pack("<IIII", 2, 40, 20, 0x4E4F534A) \
        + b'{"asset":{"version":"2.0"}}'


def run(braid, *arguments):
    subprocess.run([braid, *map(str, arguments)], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def image_and_state_seeds(braid, folder):
    """Tiny renders, as images and as states."""
    variants = {
        "plain": ["--spp", 2],
        "photons": ["--spp", 4, "--integrator", "pt,sppm"],
        "correlated": ["--spp", 4, "--integrator", "pt,crn", "--quarters"],
        "curves": ["--spp", 8, "--combine", "curves:4"],
        "alpha": ["--spp", 2, "--transparent"]}
    scene = ROOT / "scenes" / "cornell.glb"
    for name, options in variants.items():
        state = folder / f"{name}.state"
        picture = folder / f"{name}.exr"
        run(braid, "render", scene, "-o", picture, "--size", "4x3",
            "--checkpoint", state, *options)
        yield "image", name, picture.read_bytes()
        data = state.read_bytes()
        line, rest = data.split(b"\n", 1)
        header = int(line.split()[2])
        yield "state", name, rest[:header] + b"\0" + rest[header:-17]


def tza(large, half):
    """The weights of a U-Net of one channel."""
    convolutions = ["enc_conv0"] * (not large) + ["dec_conv0"] * (not large)
    for level in range(1, 5):
        convolutions += [f"enc_conv{level}{end}"
                         for end in (("a", "b") if large else ("",))]
        convolutions += [f"dec_conv{level}a", f"dec_conv{level}b"]
    convolutions += ["enc_conv5a", "enc_conv5b"] + ["dec_conv1c"] * large
    kind, size = ("h", 2) if half else ("f", 4)
    values, table = b"", struct.pack("<I", 2 * len(convolutions))
    for name in convolutions:
        first = name == ("enc_conv1a" if large else "enc_conv0")
        last = name == ("dec_conv1c" if large else "dec_conv0")
        wide = name.startswith("dec") and name.endswith("a")
        outputs = 3 if last else 1
        inputs = 3 if first else 1 + wide * (3 if "1a" in name else 1)
        for word, sizes, layout in ((".weight", (outputs, inputs, 3, 3),
                                     "oihw"), (".bias", (outputs,), "x")):
            text = (name + word).encode()
            table += struct.pack("<H", len(text)) + text
            table += struct.pack(f"<B{len(sizes)}I", len(sizes), *sizes)
            table += (layout + kind).encode()
            table += struct.pack("<Q", 12 + len(values))
            values += struct.pack("<e" if half else "<f", 0.5) \
                * math.prod(sizes)
    return struct.pack("<HBBQ", 0x41D7, 2, 0, 12 + len(values)) + values \
        + table


def words():
    """Every word that the reader of glTF compares with."""
    found = set()
    for source in sorted((ROOT / "renderer" / "scene").rglob("*.cpp")):
        found |= set(re.findall(r'"([A-Za-z_][A-Za-z_0-9]{2,40})"',
                                source.read_text()))
    return sorted(found)


def main():
    braid, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    seeds = [("gltf", *seed) for seed in gltf_seeds()]
    seeds += [("texture", *seed) for seed in texture_seeds()]
    seeds += [("ktx2", *seed) for seed in ktx2_seeds()]
    with tempfile.TemporaryDirectory() as work:
        seeds += image_and_state_seeds(braid, pathlib.Path(work))
    for large in (False, True):
        seeds.append(("weights", f"unet {large}", tza(large, large)))
    seeds.append(("image", "three floats", write_exr(3, 2, lambda x, y: (
        x, y, 1))))
    for target, name, data in seeds:
        path = folder / target / re.sub("[^A-Za-z0-9.+-]+", "-", name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    (folder / "words.dict").write_text(
        "".join(f'"\\"{word}\\""\n' for word in words()))


if __name__ == "__main__":
    main()
