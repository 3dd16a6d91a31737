# SPDX-License-Identifier: Apache-2.0
"""Triangle meshes as numpy arrays: scenes are made by the hundred, and loops over vertices would take most of the time.

Every mesh carries positions, normals and texture coordinates in metres, so that any texture suits any mesh. Faces are
counter-clockwise seen from outside.
"""

import math

import numpy as np


class Mesh:
    """`flat` meshes are stored without normals, as glTF prescribes for flat shading."""

    def __init__(self, points, faces, normals=None, uvs=None):
        self.points = np.asarray(points, np.float32).reshape(-1, 3)
        self.faces = np.asarray(faces, np.int64).reshape(-1, 3)
        self.flat = normals is None
        self.normals = self._flat_normals() if self.flat else np.asarray(normals, np.float32).reshape(-1, 3)
        self.uvs = self._box_uvs() if uvs is None else np.asarray(uvs, np.float32).reshape(-1, 2)

    def _flat_normals(self):
        """Corners are split, since a vertex shared by two flat faces would need two normals."""
        corners = self.points[self.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals = unit(normals)
        self.points = corners.reshape(-1, 3)
        self.faces = np.arange(len(self.points)).reshape(-1, 3)
        return np.repeat(normals, 3, axis=0).astype(np.float32)

    def _box_uvs(self):
        """Seen along the axis that the normal is nearest to."""
        axis = np.argmax(np.abs(self.normals), axis=1)
        x, y, z = self.points.T
        u = np.where(axis == 0, z, x)
        v = np.where(axis == 1, z, -y)
        return np.stack([u, v], axis=1).astype(np.float32)

    def moved(self, matrix):
        """Transformed by a 4x4 matrix; mirrored ones turn their faces."""
        linear = matrix[:3, :3]
        out = Mesh.__new__(Mesh)
        out.points = (self.points @ linear.T + matrix[:3, 3]).astype(np.float32)
        cofactor = np.linalg.inv(linear).T
        out.normals = unit(self.normals @ cofactor.T).astype(np.float32)
        out.faces = self.faces[:, ::-1] if np.linalg.det(linear) < 0 else self.faces
        out.uvs, out.flat = self.uvs, self.flat
        return out

    def at(self, x, y, z):
        return self.moved(translate(x, y, z))

    def with_uvs(self, uvs):
        out = self.moved(np.eye(4))
        out.uvs = np.asarray(uvs, np.float32)
        return out

    def welded(self):
        """Without normals and uvs, each point once: a third of the bytes of flat meshes."""
        rows = np.ascontiguousarray(self.points).view([("", np.float32)] * 3).reshape(-1)
        _, first, number = np.unique(rows, return_index=True, return_inverse=True)
        out = Mesh.__new__(Mesh)
        out.points, out.faces = self.points[first], number.reshape(-1)[self.faces]
        out.flat, out.textured, out.normals, out.uvs = True, False, None, None
        return out

    def bounds(self):
        return self.points.min(axis=0), self.points.max(axis=0)


def unit(vectors):
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    fallback = np.zeros_like(vectors)
    fallback[..., 1] = 1
    return np.where(lengths > 1e-20, vectors / np.maximum(lengths, 1e-20), fallback)


def merged(meshes):
    """One mesh of several; it is flat only if all of them are."""
    meshes = list(meshes)
    offsets = np.cumsum([0] + [len(m.points) for m in meshes[:-1]])
    out = Mesh.__new__(Mesh)
    out.points = np.concatenate([m.points for m in meshes])
    out.normals = np.concatenate([m.normals for m in meshes])
    out.uvs = np.concatenate([m.uvs for m in meshes])
    out.faces = np.concatenate([m.faces + o for m, o in zip(meshes, offsets)])
    out.flat = all(m.flat for m in meshes)
    return out


def from_generator(mesh):
    """A mesh of scenes/generator."""
    return Mesh(mesh.positions, mesh.indices, mesh.normals or None, mesh.uvs or None)


# ---- transforms ----

def translate(x, y, z):
    out = np.eye(4)
    out[:3, 3] = x, y, z
    return out


def scale(x, y=None, z=None):
    return np.diag([x, x if y is None else y, x if z is None else z, 1.0])


def rotate(axis, degrees):
    """About x, y or z (0, 1, 2)."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    out = np.eye(4)
    out[i, i], out[j, j], out[j, i], out[i, j] = c, c, s, -s
    return out


# ---- shapes ----

_CUBE = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
_CUBE_FACES = np.array([0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                        2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5]).reshape(-1, 3)


def box(low, high):
    low, high = np.asarray(low, float), np.asarray(high, float)
    return Mesh(low + _CUBE * (high - low), _CUBE_FACES)


def slab(width, height, depth):
    """A box on the floor, its middle at the origin."""
    return box((-width / 2, 0, -depth / 2), (width / 2, height, depth / 2))


def quad(origin, edge_u, edge_v, fit=False):
    """Faces edge_u x edge_v; `fit` spans one whole texture across it."""
    o, u, v = (np.asarray(a, float) for a in (origin, edge_u, edge_v))
    mesh = Mesh([o, o + u, o + u + v, o + v], [[0, 1, 2], [0, 2, 3]])
    corners = [(0, 1), (1, 1), (1, 0), (0, 1), (1, 0), (0, 0)]
    return mesh.with_uvs(corners) if fit else mesh


def grid(points, closed_u=False, uvs=None, flip=False):
    """A smooth surface through an array of rows of points; normals follow from the points themselves."""
    rows, columns = points.shape[:2]
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1 + closed_u), indexing="ij")
    k = (j + 1) % columns
    a, b, c, d = (i * columns + j, i * columns + k, (i + 1) * columns + k, (i + 1) * columns + j)
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    flatten = points.reshape(-1, 3)
    if flip:
        faces = faces[:, ::-1]
    corners = flatten[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    keep = np.linalg.norm(area, axis=1) > 1e-12
    faces, area = faces[keep], area[keep]
    normals = np.zeros_like(flatten)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], area)
    # Poles and other points that coincide share one normal, or the surface would crease there.
    _, same = np.unique(np.round(flatten, 6), axis=0, return_inverse=True)
    total = np.zeros((same.max() + 1, 3))
    np.add.at(total, same.reshape(-1), normals)
    return Mesh(flatten, faces, unit(total[same.reshape(-1)]), uvs)


def lathe(profile, segments=24):
    """Revolves (radius, height) pairs about y; a profile that goes up on the outside faces outward."""
    profile = np.asarray(profile, float)
    angle = np.linspace(0, 2 * math.pi, segments + 1)
    r, y = profile[:, :1], profile[:, 1:]
    points = np.stack([r * np.cos(angle), y + 0 * angle, r * np.sin(angle)], axis=-1)
    points[:, -1] = points[:, 0]
    around = angle * max(profile[:, 0].max(), 1e-3)
    uvs = np.stack([around + 0 * y, -y + 0 * angle], axis=-1).reshape(-1, 2)
    return grid(points, uvs=uvs, flip=True)


def creased(profile, segments=24):
    """A lathe whose profile has edges: flat-shaded across them, each piece smooth around."""
    return merged(lathe(profile[k:k + 2], segments) for k in range(len(profile) - 1))


def cylinder(radius, height, segments=24):
    return creased([(0, 0), (radius, 0), (radius, height), (0, height)], segments)


def sphere(radius, nu=32, nv=20):
    angle = np.linspace(-math.pi / 2, math.pi / 2, nv + 1)
    profile = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    profile[[0, -1], 0] = 0
    return lathe(profile, nu)


def superellipsoid(size, sharpness, nu=28, nv=18):
    """Cushions: an exponent of 1 is an ellipsoid, smaller ones are boxier."""
    def power(x):
        return np.sign(x) * np.abs(x) ** sharpness
    t = np.linspace(0, 2 * math.pi, nu, endpoint=False)
    p = np.linspace(-math.pi / 2, math.pi / 2, nv + 1)[:, None]
    ring = power(np.cos(p))
    ring[[0, -1]] = 0
    points = np.stack([size[0] / 2 * ring * power(np.cos(t)), size[1] / 2 * power(np.sin(p)) + 0 * t,
                       size[2] / 2 * ring * power(np.sin(t))], axis=-1)
    return grid(points, closed_u=True, flip=True)


def torus(major, minor, nu=48, nv=20):
    t = np.linspace(0, 2 * math.pi, nu + 1)[:, None]
    p = np.linspace(0, 2 * math.pi, nv, endpoint=False)
    r = major + minor * np.cos(p)
    points = np.stack([r * np.cos(t), minor * np.sin(p) + 0 * t, r * np.sin(t)], axis=-1)
    return grid(points, closed_u=True)


def tubes(paths, radii, sides=5):
    """Sweeps circles along many polylines of equal length at once: paths (count, steps, 3), radii (count, steps)."""
    paths = np.asarray(paths, float)
    count, steps = paths.shape[:2]
    along = unit(np.gradient(paths, axis=1))
    helper = np.where(np.abs(along[:, :, :1]) < 0.9, [1.0, 0, 0], [0, 1.0, 0])
    # One helper for a whole path, chosen at its start, keeps the tube from twisting.
    side = unit(np.cross(along, np.repeat(helper[:, :1], steps, axis=1)))
    other = np.cross(along, side)
    angle = np.linspace(0, 2 * math.pi, sides, endpoint=False)[:, None]
    normals = side[:, :, None] * np.cos(angle) + other[:, :, None] * np.sin(angle)
    points = paths[:, :, None] + normals * np.asarray(radii)[:, :, None, None]
    n, i, j = np.meshgrid(np.arange(count), np.arange(steps - 1), np.arange(sides), indexing="ij")
    base, k = (n * steps + i) * sides, (j + 1) % sides
    faces = np.stack([base + j, base + k, base + sides + k, base + j, base + sides + k, base + sides + j], axis=-1)
    return Mesh(points.reshape(-1, 3), faces.reshape(-1, 3), normals.reshape(-1, 3))


def rod(start, end, radius, sides=10):
    return tubes([[start, end]], [[radius, radius]], sides)


def cards(points, headings, size, aspect, rng, fit=True):
    """Quads that grow from points along headings: leaves, blades, paper."""
    count = len(points)
    side = unit(np.cross(headings, rng.normal(size=(count, 3)))) * (np.broadcast_to(size, count) * aspect / 2)[:, None]
    tip = points + headings * np.broadcast_to(size, count)[:, None]
    corners = np.stack([points - side, points + side, tip + side, tip - side], axis=1)
    faces = (np.arange(count)[:, None, None] * 4 + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    mesh = Mesh(corners.reshape(-1, 3), faces)
    order = np.array([(0, 1), (1, 1), (1, 0), (0, 1), (1, 0), (0, 0)], np.float32)
    return mesh.with_uvs(np.tile(order, (count, 1))) if fit else mesh
