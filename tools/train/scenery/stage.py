# SPDX-License-Identifier: Apache-2.0
"""A scene under construction: the file, where its things stand, and cameras that look at them from free space."""

import math

import numpy as np
from generator.glb import ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, FLOAT, UINT16, UINT32, Scene

from .materials import Materials

CLEARANCE = 0.33        # metres between a camera and anything
RAYS = 8, 5             # the grid of rays that judges a view


class ArrayScene(Scene):
    """Stores meshes of arrays; what the file does not need (normals of flat meshes, unused uvs) is left out."""

    def _array(self, data, kind, target=ARRAY_BUFFER, bounds=False):
        data = np.ascontiguousarray(data, "<f4")
        accessor = {"bufferView": self._view(data.tobytes(), target), "componentType": FLOAT, "count": len(data),
                    "type": kind}
        if bounds:
            accessor["min"], accessor["max"] = (b.astype(float).tolist() for b in (data.min(axis=0), data.max(axis=0)))
        return self._push("accessors", accessor)

    def _geometry(self, shape, step):
        if shape.flat and not shape.textured:
            shape = shape.welded()
        attributes = {"POSITION": self._array(shape.points, "VEC3", bounds=True)}
        if not shape.flat:
            attributes["NORMAL"] = self._array(shape.normals, "VEC3")
        if shape.textured:
            attributes["TEXCOORD_0"] = self._array(shape.uvs, "VEC2")
        small = len(shape.points) < 65535
        data = np.ascontiguousarray(shape.faces, "<u2" if small else "<u4").tobytes()
        indices = self._push("accessors", {
            "bufferView": self._view(data, ELEMENT_ARRAY_BUFFER), "componentType": UINT16 if small else UINT32,
            "count": shape.faces.size, "type": "SCALAR"})
        return {"attributes": attributes, "indices": indices}

    def is_textured(self, material):
        """Whether it needs texture coordinates; anisotropy does, to know its direction."""
        item = self.gltf["materials"][material]
        keys = (*item, *item["pbrMetallicRoughness"], *item.get("extensions", ()))
        return any("Texture" in key or key == "KHR_materials_anisotropy" for key in keys)


class Stage:
    def __init__(self, rng, kind):
        self.rng, self.kind = rng, kind
        self.scene = ArrayScene(kind, "learning")
        self.materials = Materials(self.scene, rng)
        self.environment = None     # an image of radiance
        self.options = []           # of braid render
        self.things = []            # (mesh, solid)
        self.inside = None          # bounds that cameras stay in
        self.interest = []          # points that cameras look at

    def add(self, mesh, material, fit=False, solid=True, shell=False):
        """Places a mesh. `fit`: its uvs are whole textures already; `solid`: no camera within its bounds; `shell`:
        what surrounds cameras, such as walls."""
        index, tile = material
        stored = mesh.with_uvs(mesh.uvs if fit else mesh.uvs / tile)
        stored.textured = self.scene.is_textured(index)
        self.scene.place(self.kind, (stored, index))
        self.things.append((mesh, solid and not shell))

    def emit(self, mesh, flux, color, **options):
        """A lamp of a given flux: its radiance follows from its area, so that tiny lamps are bright."""
        corners = mesh.points[mesh.faces]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
        self.add(mesh, self.materials.emitter(np.asarray(color) * flux / (math.pi * max(area, 1e-8))), **options)

    def light(self, kind, position, target, color, intensity, **spot):
        self.scene.light(kind, tuple(map(float, position)), tuple(map(float, target)), tuple(map(float, color)),
                         float(intensity), **spot)

    # ---- cameras ----

    def _soup(self, most=60000):
        """(triangle corners, number of the thing) of the whole scene, thinned out where there are very many."""
        parts = []
        for number, (mesh, _) in enumerate(self.things):
            corners = mesh.points[mesh.faces]
            stride = 1 + len(corners) * len(self.things) // (most * 4) if len(corners) > 4000 else 1
            parts.append((corners[::stride], np.full(len(corners[::stride]), number)))
        return np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])

    def _free(self, eye):
        if self.inside is not None and not ((eye > self.inside[0]) & (eye < self.inside[1])).all():
            return False
        for mesh, solid in self.things:
            if solid and ((eye > mesh.low - CLEARANCE) & (eye < mesh.high + CLEARANCE)).all():
                return False
            if not solid and len(mesh.points) and (np.square(mesh.points - eye).sum(axis=1) < CLEARANCE ** 2).any():
                return False
        return True

    def cameras(self, propose, count=3):
        """The best views among proposals: propose() gives (eye, target). Near walls and dull views lose."""
        for mesh, _ in self.things:
            mesh.low, mesh.high = mesh.bounds()
        soup, views = self._soup(), []
        for _ in range(300):
            eye, target = (np.asarray(p, float) for p in propose())
            if not self._free(eye):
                continue
            yfov = float(self.rng.choice([28, 38, 45, 50, 60, 75], p=[0.1, 0.15, 0.25, 0.25, 0.15, 0.1]))
            score = self._score(soup, eye, target, yfov)
            if score is not None:
                views.append((score, eye, target, yfov))
            if len(views) >= 4 * count:
                break
        chosen = []
        while len(chosen) < count and views:
            # Each next view is a good one that differs from those before it.
            best = max(views, key=lambda view: view[0] + 4 * min([1.0, *(_difference(view, c) for c in chosen)]))
            chosen.append(best)
            views = [view for view in views if view is not best]
        return [{"look_at": ",".join(f"{x:.4f}" for x in (*eye, *target)), "yfov": yfov}
                for _, eye, target, yfov in chosen]

    def _score(self, soup, eye, target, yfov):
        """How many things a view shows, or None where something stands right before the camera or nothing is seen."""
        back = eye - target
        if np.linalg.norm(back) < 0.5:
            return None
        back = back / np.linalg.norm(back)
        right = np.cross((0, 1, 0), back)
        if np.linalg.norm(right) < 0.05:
            return None
        right /= np.linalg.norm(right)
        up = np.cross(back, right)
        half = math.tan(math.radians(yfov / 2))
        x, y = np.meshgrid(np.linspace(-0.9, 0.9, RAYS[0]) * half * 16 / 9, np.linspace(-0.9, 0.9, RAYS[1]) * half)
        rays = (right * x.reshape(-1, 1) + up * y.reshape(-1, 1) - back)
        distance, thing = _nearest(soup[0], soup[1], eye, rays)
        hit = thing >= 0
        if hit.sum() < len(rays) // 4 or distance[hit].min() < CLEARANCE or np.median(distance[hit]) < 0.7:
            return None
        counts = np.bincount(thing[hit])
        if counts.max() > 0.85 * len(rays):
            return None
        return len(np.flatnonzero(counts)) + self.rng.uniform(0, 3)


def _difference(view, other):
    """From 0, the same, to 1 and more: how far apart the eyes are against how far they look."""
    return np.linalg.norm(view[1] - other[1]) / np.linalg.norm(view[1] - view[2])


def _nearest(corners, numbers, eye, rays):
    """Distance along each ray, in units of its length, and number of the first thing, -1 for none."""
    a = (corners[:, 0] - eye).astype(np.float32)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(e1, e2)
    volume = np.einsum("ij,ij->i", a, normal)
    # Möller and Trumbore's test with what does not depend on the ray worked out once: the eye is the same for all.
    cu, cv = np.cross(e2, a), np.cross(a, e1)
    distance, thing = np.full(len(rays), np.inf), np.full(len(rays), -1)
    for k, ray in enumerate(rays.astype(np.float32)):
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1 / (normal @ ray)
            u, v, t = (cu @ ray) * inverse, (cv @ ray) * inverse, volume * inverse
            t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-4), t, np.inf)
        best = np.argmin(t)
        if t[best] < np.inf:
            distance[k], thing[k] = t[best], numbers[best]
    return distance, thing
