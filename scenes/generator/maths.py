"""Small vector and affine-transform helpers; vectors are plain tuples."""

import math


def add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def mul(a, s):
    return (a[0] * s, a[1] * s, a[2] * s)


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0])


def length(a):
    return math.sqrt(dot(a, a))


def normalize(a):
    n = length(a)
    return mul(a, 1.0 / n) if n > 0.0 else (0.0, 1.0, 0.0)


def lerp(a, b, t):
    return tuple(x + (y - x) * t for x, y in zip(a, b))


def perpendicular(n):
    """Any unit vector at right angles to the unit vector n."""
    helper = (1.0, 0.0, 0.0) if abs(n[0]) < 0.9 else (0.0, 1.0, 0.0)
    return normalize(cross(n, helper))


class Affine:
    """x -> M x + t, with M given by its three columns."""

    def __init__(self, x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1), t=(0, 0, 0)):
        self.x, self.y, self.z, self.t = x, y, z, t

    def vector(self, v):
        return tuple(self.x[i] * v[0] + self.y[i] * v[1] + self.z[i] * v[2]
                     for i in range(3))

    def point(self, p):
        return add(self.vector(p), self.t)

    def normal(self, n):
        """Cofactor matrix times n: right for any invertible M."""
        return normalize(add(add(mul(cross(self.y, self.z), n[0]),
                                 mul(cross(self.z, self.x), n[1])),
                             mul(cross(self.x, self.y), n[2])))

    def __matmul__(self, other):
        return Affine(self.vector(other.x), self.vector(other.y),
                      self.vector(other.z), self.point(other.t))

    def quaternion(self):
        """Rotation (x, y, z, w); the columns must be orthonormal."""
        (a, b, c), (d, e, f), (g, h, i) = self.x, self.y, self.z
        trace = a + e + i
        if trace > 0:
            s = 2 * math.sqrt(1 + trace)
            return ((f - h) / s, (g - c) / s, (b - d) / s, s / 4)
        if a >= e and a >= i:
            s = 2 * math.sqrt(1 + a - e - i)
            return (s / 4, (b + d) / s, (g + c) / s, (f - h) / s)
        if e >= i:
            s = 2 * math.sqrt(1 + e - a - i)
            return ((b + d) / s, s / 4, (f + h) / s, (g - c) / s)
        s = 2 * math.sqrt(1 + i - a - e)
        return ((g + c) / s, (f + h) / s, s / 4, (b - d) / s)


def translate(x, y, z):
    return Affine(t=(x, y, z))


def scale(x, y=None, z=None):
    y = x if y is None else y
    z = x if z is None else z
    return Affine((x, 0, 0), (0, y, 0), (0, 0, z))


def rotate_x(degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return Affine((1, 0, 0), (0, c, s), (0, -s, c))


def rotate_y(degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return Affine((c, 0, -s), (0, 1, 0), (s, 0, c))


def rotate_z(degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return Affine((c, s, 0), (-s, c, 0), (0, 0, 1))


def frame(y, z_hint):
    """Rotation taking +Y to y and +Z as near z_hint as that allows."""
    y = normalize(y)
    z = sub(z_hint, mul(y, dot(y, z_hint)))
    z = normalize(z) if length(z) > 1e-6 else perpendicular(y)
    return Affine(cross(y, z), y, z)


def look_at(eye, target, up=(0, 1, 0)):
    """Rotation of a glTF camera or light: its -Z axis points at target."""
    z = normalize(sub(eye, target))
    x = cross(up, z)
    x = normalize(x) if length(x) > 1e-6 else (1.0, 0.0, 0.0)
    return Affine(x, cross(z, x), z)
