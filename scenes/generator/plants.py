"""Plant shapes shared by foliage and forest."""

import math

from .maths import add, cross, lerp, mul, normalize, perpendicular
from .shapes import Mesh, merged, tube


def random_direction(rng):
    while True:
        v = tuple(rng.uniform(-1, 1) for _ in range(3))
        if 0.01 < sum(x * x for x in v) < 1:
            return normalize(v)


def grow(rng, start, direction, size, radius, depth, spread=0.55, lift=0.15):
    """A branching skeleton: list of (path, radii, levels still to come)."""
    path, heading = [start], direction
    for _ in range(3):
        heading = normalize(add(add(heading, mul(random_direction(rng), 0.18)),
                                (0, lift, 0)))
        path.append(add(path[-1], mul(heading, size / 3)))
    radii = [radius * (1 - 0.14 * k) for k in range(4)]
    out = [(path, radii, depth)]
    if depth == 0:
        return out
    # Forks leave in evenly spaced directions around the parent.
    side = perpendicular(heading)
    other = cross(heading, side)
    first, forks = rng.random() * math.tau, 3
    for k in range(forks):
        a = first + k * math.tau / forks + rng.uniform(-0.4, 0.4)
        away = add(mul(side, math.cos(a)), mul(other, math.sin(a)))
        out += grow(rng, path[-1 if k else 2],
                    normalize(add(heading, mul(away, spread / 0.55))),
                    size * rng.uniform(0.68, 0.85), radius * 0.6, depth - 1,
                    spread, lift)
    return out


def bark(skeleton, thinnest, sides=6):
    """Tubes for all branches of at least the given radius."""
    return merged([tube(path, radii, max(3, sides - 2 * (i > 0)), False)
                   for i, (path, radii, _) in enumerate(skeleton)
                   if radii[0] >= thinnest])


def leaf_sites(rng, skeleton, per_branch, levels=1):
    """(point, heading) pairs along the outermost branches."""
    for path, _, depth in skeleton:
        if depth > levels:
            continue
        for _ in range(per_branch):
            k = rng.randrange(len(path) - 1)
            point = lerp(path[k], path[k + 1], rng.random())
            along = normalize([b - a for a, b in zip(path[k], path[k + 1])])
            yield point, normalize(add(mul(along, 0.6), random_direction(rng)))


def leaf_card(rng, point, heading, size, aspect=0.6, textured=False):
    """A quad growing from `point` along `heading`."""
    side = normalize(cross(heading, random_direction(rng)))
    half = mul(side, size * aspect / 2)
    tip = add(point, mul(heading, size))
    back = mul(half, -1)
    mesh = Mesh((add(point, back), add(point, half), add(tip, half),
                 add(tip, back)), (0, 1, 2, 0, 2, 3))
    if textured:
        mesh.uvs = [(0, 1), (1, 1), (1, 0), (0, 0)]
    return mesh


def conifer(rng, height, layers, per_layer):
    """(trunk, needles): drooping cards in whorls that shrink upward."""
    trunk = tube([(0, -0.5, 0), (0, height * 0.5, 0), (0, height, 0)],
                 [height * 0.02, height * 0.012, 0.01], 6, False)
    needles = Mesh()
    for layer in range(layers):
        t = layer / (layers - 1)
        y = height * (0.12 + 0.87 * t)
        reach = height * 0.2 * (1 - t) ** 0.85 + 0.12
        for k in range(per_layer):
            a = math.tau * (k + rng.random()) / per_layer
            out = (math.cos(a), 0, math.sin(a))
            side = (-out[2], rng.uniform(-0.35, 0.35), out[0])
            near, far = reach * rng.uniform(0.0, 0.55), reach
            far *= rng.uniform(0.75, 1.1)
            width = 0.05 * reach + 0.05
            drop = rng.uniform(0.25, 0.5)
            root = add(mul(out, near), (0, y - near * drop, 0))
            tip = add(mul(out, far), (0, y - far * drop, 0))
            half, point = mul(side, width), mul(side, width * 0.25)
            needles.add(Mesh((add(root, mul(half, -1)), add(root, half),
                              add(tip, point), add(tip, mul(point, -1))),
                             (0, 1, 2, 0, 2, 3)))
    return trunk, needles


def broadleaf(rng, size, leaves, leaf_size, lift=0.15):
    """(bark, leaves) of a round-crowned tree."""
    skeleton = grow(rng, (0, -0.3, 0), (0, 1, 0), size, size * 0.055, 4,
                    lift=lift)
    sites = list(leaf_sites(rng, skeleton, 24))
    rng.shuffle(sites)
    crown = merged([leaf_card(rng, p, h, leaf_size * rng.uniform(0.7, 1.3))
                    for p, h in sites[:leaves]])
    return bark(skeleton, size * 0.012), crown
