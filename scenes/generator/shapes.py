"""Triangle meshes. Faces are counter-clockwise seen from outside."""

import math

from .maths import (add, cross, dot, frame, mul, normalize, perpendicular,
                    sub)


class Mesh:
    """Without normals a mesh is flat-shaded, as glTF prescribes."""

    def __init__(self, positions=(), indices=(), normals=(), uvs=(),
                 tangents=()):
        self.positions, self.indices = list(positions), list(indices)
        self.normals, self.uvs = list(normals), list(uvs)
        self.tangents = list(tangents)

    def add(self, other):
        """Appends a mesh that has the same attributes."""
        base = len(self.positions)
        self.positions += other.positions
        self.normals += other.normals
        self.uvs += other.uvs
        self.tangents += other.tangents
        self.indices += [base + i for i in other.indices]
        return self

    def moved(self, affine):
        tangents = [(*normalize(affine.vector(t[:3])), t[3])
                    for t in self.tangents]
        return Mesh([affine.point(p) for p in self.positions], self.indices,
                    [affine.normal(n) for n in self.normals], self.uvs,
                    tangents)

    def triangles(self):
        return zip(self.indices[0::3], self.indices[1::3], self.indices[2::3])

    def oriented(self):
        """Drops degenerate triangles and turns the others to agree with
        the vertex normals, so parametric shapes need not mind winding."""
        indices = []
        for a, b, c in self.triangles():
            p, q, r = (self.positions[i] for i in (a, b, c))
            edges = sub(q, p), sub(r, p), sub(r, q)
            face = cross(edges[0], edges[1])
            if dot(face, face) < 1e-12 * max(dot(e, e) for e in edges) ** 2:
                continue
            mean = add(add(self.normals[a], self.normals[b]), self.normals[c])
            indices += (a, b, c) if dot(face, mean) > 0 else (a, c, b)
        self.indices = indices
        return self

    def faceted(self):
        """The same flat faces with explicit normals, so that flat and
        curved parts can share one primitive."""
        out = Mesh()
        for corners in self.triangles():
            p, q, r = (self.positions[i] for i in corners)
            normal = normalize(cross(sub(q, p), sub(r, p)))
            out.add(Mesh((p, q, r), (0, 1, 2), [normal] * 3))
        return out

    def without_normals(self):
        return Mesh(self.positions, self.indices)


def merged(meshes):
    out = Mesh()
    for mesh in meshes:
        out.add(mesh)
    return out


def quad(origin, edge_u, edge_v, tiles=None):
    """Parallelogram facing edge_u x edge_v; `tiles` (repeats along u and v)
    adds texture coordinates, normals and tangents for normal mapping."""
    positions = [origin, add(origin, edge_u),
                 add(add(origin, edge_u), edge_v), add(origin, edge_v)]
    mesh = Mesh(positions, (0, 1, 2, 0, 2, 3))
    if tiles:
        u, v = tiles
        # Image rows run downward: v = 0 belongs at the far end of edge_v.
        mesh.uvs = [(0, v), (u, v), (u, 0), (0, 0)]
        mesh.normals = [normalize(cross(edge_u, edge_v))] * 4
        mesh.tangents = [(*normalize(edge_u), 1.0)] * 4
    return mesh


def box(low, high, uv_scale=None):
    """Axis-aligned box; `uv_scale` gives texture repeats per metre."""
    (a, b, c), (d, e, f) = low, high
    if uv_scale is None:
        corners = [(x, y, z) for z in (c, f) for y in (b, e) for x in (a, d)]
        return Mesh(corners, (0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6,
                              0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3,
                              0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5))
    x, y, z = (d - a, 0, 0), (0, e - b, 0), (0, 0, f - c)
    sides = [((a, b, f), x, y), ((d, b, c), mul(x, -1), y),
             ((d, b, f), mul(z, -1), y), ((a, b, c), z, y),
             ((a, e, f), x, mul(z, -1)), ((a, b, c), x, z)]
    out = Mesh()
    for origin, u, v in sides:
        tiles = (sum(map(abs, u)) * uv_scale, sum(map(abs, v)) * uv_scale)
        out.add(quad(origin, u, v, tiles))
    return out


def centred_box(sx, sy, sz):
    """Box standing on y = 0, centred in x and z."""
    return box((-sx / 2, 0, -sz / 2), (sx / 2, sy, sz / 2))


def surface(nu, nv, point, uv=None, hint=None, tangents=False):
    """Smooth patch point(u, v) over the unit square. Normals come from
    central differences; `hint(u, v, p)` says which way is outward."""
    out = Mesh()
    h = 1e-4
    for j in range(nv + 1):
        for i in range(nu + 1):
            u, v = i / nu, j / nv
            p = point(u, v)
            # Differences at a pole vanish, so stay a little inside in v.
            w = min(max(v, 1e-3), 1 - 1e-3)
            du = sub(point(u + h, w), point(u - h, w))
            dv = sub(point(u, w + h), point(u, w - h))
            n = normalize(cross(du, dv))
            if hint and dot(n, hint(u, v, p)) < 0:
                n = mul(n, -1)
            out.positions.append(p)
            out.normals.append(n)
            if uv:
                out.uvs.append(uv(u, v, p))
            if tangents:
                out.tangents.append((*normalize(du), 1.0))
    row = nu + 1
    for j in range(nv):
        for i in range(nu):
            a = j * row + i
            out.indices += (a, a + 1, a + row + 1, a, a + row + 1, a + row)
    return out.oriented()


def uv_sphere(nu, nv, radius=1.0, textured=False, tangents=False):
    def point(u, v):
        t, p = math.tau * u, math.pi * v
        return (radius * math.sin(p) * math.cos(t), radius * math.cos(p),
                -radius * math.sin(p) * math.sin(t))
    uv = (lambda u, v, p: (u, v)) if textured else None
    return surface(nu, nv, point, uv, lambda u, v, p: p, tangents)


def superellipsoid(size, sharpness, nu=24, nv=16):
    """Cushion shape: 1 is an ellipsoid, smaller exponents are boxier."""
    def power(x):
        return math.copysign(abs(x) ** sharpness, x)

    def point(u, v):
        t, p = math.tau * u, math.pi * v
        return (size[0] / 2 * power(math.sin(p)) * power(math.cos(t)),
                size[1] / 2 * power(math.cos(p)),
                size[2] / 2 * power(math.sin(p)) * power(math.sin(t)))
    return surface(nu, nv, point, hint=lambda u, v, p: p)


def torus(major, minor, nu, nv):
    def point(u, v):
        t, p = math.tau * u, math.tau * v
        r = major + minor * math.cos(p)
        return (r * math.cos(t), minor * math.sin(p), r * math.sin(t))

    def outward(u, v, p):
        t = math.tau * u
        return sub(p, (major * math.cos(t), 0, major * math.sin(t)))
    return surface(nu, nv, point, hint=outward)


def icosphere(level, radius=1.0, centre=(0, 0, 0)):
    g = (1 + math.sqrt(5)) / 2
    points = [normalize(p) for p in (
        (-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g),
        (0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1),
        (-g, 0, 1))]
    faces = [(0, 11, 5), (0, 5, 1), (0, 1, 7), (0, 7, 10), (0, 10, 11),
             (1, 5, 9), (5, 11, 4), (11, 10, 2), (10, 7, 6), (7, 1, 8),
             (3, 9, 4), (3, 4, 2), (3, 2, 6), (3, 6, 8), (3, 8, 9),
             (4, 9, 5), (2, 4, 11), (6, 2, 10), (8, 6, 7), (9, 8, 1)]
    for _ in range(level):
        middle, split = {}, []

        def midpoint(i, j):
            key = (min(i, j), max(i, j))
            if key not in middle:
                middle[key] = len(points)
                points.append(normalize(add(points[i], points[j])))
            return middle[key]
        for a, b, c in faces:
            ab, bc, ca = midpoint(a, b), midpoint(b, c), midpoint(c, a)
            split += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = split
    return Mesh([add(centre, mul(p, radius)) for p in points],
                [i for face in faces for i in face], points)


def lathe(runs, segments):
    """Revolves polylines of (radius, height) about Y. Each run is smooth;
    runs meet at creases. Outside is to the right of the direction of
    travel, so a closed solid goes out along its base and up its side."""
    out = Mesh()
    for run in runs:
        base = len(out.positions)
        slopes = []
        for k in range(len(run)):
            (r0, y0), (r1, y1) = run[max(k - 1, 0)], run[min(k + 1,
                                                            len(run) - 1)]
            size = math.hypot(r1 - r0, y1 - y0)
            slopes.append(((y1 - y0) / size, -(r1 - r0) / size))
        for (r, y), (nr, ny) in zip(run, slopes):
            for i in range(segments):
                t = math.tau * i / segments
                c, s = math.cos(t), math.sin(t)
                out.positions.append((r * c, y, r * s))
                out.normals.append((nr * c, ny, nr * s))
        for k in range(len(run) - 1):
            for i in range(segments):
                j = (i + 1) % segments
                a, b = base + k * segments + i, base + k * segments + j
                out.indices += (a, b, b + segments, a, b + segments,
                                a + segments)
    return out.oriented()


def arc(centre, radius, start, end, steps):
    """Part of a circle in degrees, for lathe profiles."""
    out = []
    for i in range(steps + 1):
        t = math.radians(start + (end - start) * i / steps)
        out.append((max(0.0, centre[0] + radius * math.cos(t)),
                    centre[1] + radius * math.sin(t)))
    return out


def tube(path, radii, sides, smooth=True):
    """Sweeps a circle along a polyline; the ends stay open."""
    out = Mesh()
    side = None
    for k, p in enumerate(path):
        along = normalize(sub(path[min(k + 1, len(path) - 1)],
                              path[max(k - 1, 0)]))
        # Carrying the last side vector along keeps the tube from twisting.
        side = perpendicular(along) if side is None else normalize(
            sub(side, mul(along, dot(along, side))))
        other = cross(along, side)
        for i in range(sides):
            t = math.tau * i / sides
            n = add(mul(side, math.cos(t)), mul(other, math.sin(t)))
            out.positions.append(add(p, mul(n, radii[k])))
            out.normals.append(n)
    for k in range(len(path) - 1):
        for i in range(sides):
            a, b = k * sides + i, k * sides + (i + 1) % sides
            out.indices += (a, b, b + sides, a, b + sides, a + sides)
    out.oriented()
    return out if smooth else out.without_normals()


def disc(centre, radius, normal, segments):
    x = perpendicular(normalize(normal))
    y = cross(normalize(normal), x)
    angles = [math.tau * i / segments for i in range(segments)]
    ring = [add(centre, add(mul(x, radius * math.cos(a)),
                            mul(y, radius * math.sin(a)))) for a in angles]
    indices = [k for i in range(segments)
               for k in (0, 1 + i, 1 + (i + 1) % segments)]
    return Mesh([centre, *ring], indices)


def sky_dome(radius, sun, opening, nu=48, nv=32):
    """Sphere around the scene with a round opening of half-angle `opening`
    degrees towards the sun: a closed dome would shadow a directional light.
    The texture coordinate v is 0 at the zenith and 1 at the nadir."""
    turn = frame(sun, (0, 0, 1))
    start = math.radians(opening)

    def point(u, v):
        t, p = math.tau * u, start + (math.pi - start) * v
        return mul(turn.vector((math.sin(p) * math.cos(t), math.cos(p),
                                math.sin(p) * math.sin(t))), radius)

    def uv(u, v, p):
        return (0.5, math.acos(max(-1, min(1, p[1] / radius))) / math.pi)
    return surface(nu, nv, point, uv, lambda u, v, p: mul(p, -1))


def smooth(points, steps=4):
    """Catmull-Rom curve through a lathe profile."""
    out = []
    for k in range(len(points) - 1):
        p0, p1 = points[max(k - 1, 0)], points[k]
        p2, p3 = points[k + 1], points[min(k + 2, len(points) - 1)]
        for i in range(steps):
            t = i / steps
            out.append(tuple(0.5 * (
                2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t * t
                + (3 * b - a - 3 * c + d) * t ** 3)
                for a, b, c, d in zip(p0, p1, p2, p3)))
    return out + [points[-1]]
