"""The table of tools/stress: what to render, and what must come out."""

import dataclasses
import typing

from . import stress as s

INF, NAN = float("inf"), float("nan")
MIB = 1 << 20
ALL = None
# Lights that have no area, or are seen only in mirrors of no roughness: some
# integrators cannot sample these paths at all, or only by rare luck.
NOT_COMPARED = ()


@dataclasses.dataclass(frozen=True)
class Case:
    """A scene and what braid must make of it.

    Means of unbiased integrators must agree with that of `pt` for those in
    `agree` (ALL, or names). `like` names the case whose picture this one
    must be, times `factor`. `mean` is the exact answer. A refusal is `code`
    and a line that holds `says`; with code 0 a warning holds it.
    """
    name: str
    build: typing.Callable
    options: tuple = ()
    environment: typing.Callable = None
    size: str = "48x32"
    spp: int = 16
    only: tuple = ALL
    combine: bool = True
    agree: tuple = ALL
    like: str = ""
    factor: float = 1.0
    mean: float = None
    code: int = 0
    says: str = ""
    seconds: int = 60
    memory: int = 1024 * MIB
    short: bool = False


def _room():
    return s.room(objects=s.mixed_objects)


def _lights():
    yield Case("room", _room, short=True)
    for power in (-12, -9, -6, -3, 3, 6, 9, 12):
        scale = 10.0 ** power
        yield Case(f"lights 1e{power:+d}",
                   lambda scale=scale: s.room(8 * scale,
                                              objects=s.mixed_objects),
                   like="room", factor=scale, short=abs(power) == 12)
    half = (1e-8 * 24) ** 0.5 / 2       # the room has 24 square metres
    yield Case("emitter area 1e-8", lambda: s.small_light(half), short=True)
    yield Case("emitter area 1e-8, glass and metal", lambda: s.room(
        8 * (0.4 / half) ** 2, half, objects=s.mixed_objects),
        agree=NOT_COMPARED)
    yield Case("grazing light 1e-3 deg", lambda: s.grazing(1e-3), short=True)
    yield Case("grazing light 0 deg", lambda: s.grazing(0))
    yield Case("behind 1 % transmission", lambda: s.behind_pane(0.01),
               short=True)
    yield Case("1e6 lights", s.many_lights, seconds=120, agree=("bdpt",),
               memory=2048 * MIB)


def _placement():
    for power in (-6, -4, -2, 2, 4, 6):
        yield Case(f"scale 1e{power:+d}",
                   lambda power=power: s.moved(_room, 10.0 ** power),
                   like="room", short=abs(power) == 6)
    for power in (1, 2, 3, 4, 5, 6):
        yield Case(f"translated 1e{power}",
                   lambda power=power: s.moved(
                       _room, 1, (2 * 10.0 ** power, -10.0 ** power,
                                  10.0 ** power)),
                   like="room", short=power in (3, 6))
    yield Case("scale 1e-6, translated 1e3", lambda: s.moved(
        _room, 1e-6, (2e-3, -1e-3, 1e-3)), like="room")


def _materials():
    for roughness in (0.0, 1e-4, 1e-3, 1.0):
        short = roughness == 1e-4
        yield Case(f"metal, roughness {roughness:g}",
                   lambda r=roughness: s.room(objects=s.metal_ball(r)),
                   short=short)
        yield Case(f"glass, roughness {roughness:g}",
                   lambda r=roughness: s.room(objects=s.glass_ball(1.5, r)),
                   short=short)
    yield Case("albedo 0", lambda: s.room(albedo=(0, 0, 0)))
    yield Case("albedo 1", lambda: s.room(albedo=(1, 1, 1)))
    yield Case("albedo 1.5", lambda: s.room(albedo=(1.5,) * 3),
               like="albedo 1", says="clamped", short=True)
    yield Case("albedo -1", lambda: s.room(albedo=(-1,) * 3),
               like="albedo 0", says="clamped")
    yield Case("albedo 1 by vertex colours of 5",
               lambda: s.vertex_colours(5.0), like="albedo 1")
    yield Case("albedo 1 of metal", lambda: s.room(
        objects=s.metal_ball(0.3, (1, 1, 1))))
    for ior in (0, 1, 1.000001, 3):
        for roughness in (0, 0.3):
            yield Case(f"ior {ior:.7g}, roughness {roughness}",
                       lambda i=ior, r=roughness: s.room(
                           objects=s.glass_ball(i, r)),
                       short=ior == 1.000001 and roughness > 0)
    yield Case("ior 0.5", lambda: s.room(objects=s.glass_ball(0.5)),
               says="below 1")
    yield Case("ior 1e30", lambda: s.room(objects=s.glass_ball(1e30)))


def _dielectrics():
    at = (0, 0.6, 0)
    shells = {
        "nested": ((0.5, at, 1.5), (0.4, at, 1.33), (0.2, at, 2.4)),
        "overlapping": ((0.4, (-0.2, 0.6, 0), 1.5),
                        (0.4, (0.2, 0.6, 0), 1.33)),
        "coincident": ((0.4, at, 1.5), (0.4, at, 1.33)),
        "touching": ((0.3, (-0.3, 0.6, 0), 1.5), (0.3, (0.3, 0.6, 0), 1.5)),
    }
    for name, parts in shells.items():
        yield Case(f"{name} dielectrics", lambda p=parts: s.room(
            objects=s.balls_in_balls(*p)), short=name == "overlapping")
    yield Case("camera in glass", lambda: s.look_from(
        (0, 0.6, 0.1), (0, 0.9, -1), s.balls_in_balls((0.5, at, 1.5))),
        short=True)
    yield Case("camera in nested glass", lambda: s.look_from(
        (0, 0.6, 0.1), (0, 0.9, -1),
        s.balls_in_balls((0.5, at, 1.5), (0.3, at, 1.33))))
    yield Case("camera on a surface", lambda: s.look_from(
        (0, 0, 0.9), (0, 0.9, 0)), short=True)
    yield Case("camera on glass", lambda: s.look_from(
        (0, 0.6, 0.5), (0, 0.6, 0), s.balls_in_balls((0.5, at, 1.5))))
    # A surface through the eye is met at distance 0, where there is no
    # footprint to gather photons over: sppm is dark there.
    unmerged = ("bdpt", "crn", "gdpt", "vcm")
    yield Case("camera along a surface", lambda: s.look_from(
        (0, 0, 0.9), (0, 0, 0)), agree=unmerged, short=True)
    yield Case("camera in a wall, along it", lambda: s.look_from(
        (-1, 1, 0.9), (-1, 1, 0)), agree=unmerged)


def _geometry():
    yield Case("slivers", lambda: s.room(objects=s.slivers), short=True)
    yield Case("zero-area triangles", lambda: s.room(objects=s.no_area),
               says="no area", short=True)
    yield Case("ball", lambda: s.room(objects=s.diffuse_ball), short=True)
    yield Case("duplicate triangles", lambda: s.room(objects=s.duplicates),
               like="ball", short=True)
    yield Case("coincident surfaces", lambda: s.room(objects=s.coincident),
               short=True)
    yield Case("1e7 triangles", s.many_triangles, seconds=120,
               memory=2048 * MIB)


def _depths():
    for depth in (1, 2, 10000):
        yield Case(f"max depth {depth}", _room, ("--max-depth", str(depth)),
                   short=depth < 10000, seconds=240)
    yield Case("white box, depth 32", lambda: s.white_box(0.999, 1000),
               mean=1000 * (1 - 0.999 ** 32), size="24x16", short=True)
    yield Case("white box, depth 10000", lambda: s.white_box(0.999, 1),
               ("--max-depth", "10000"), size="6x4", spp=8, mean=1.0,
               seconds=240)


def _images():
    for name, sun, bad in (("1e9:1", 1e9, ()),
                           ("with NaN and infinity", 100, (NAN, INF, -INF)),
                           ("with negative light", 100, (-5, -1e30)),
                           ("with 1e38", 100, (1e38, 3e38)),
                           ("all 0", None, ())):
        yield Case(f"environment {name}", s.open_ground, environment=lambda
                   sun=sun, bad=bad: s.write_exr(2, 1, lambda x, y: (0,) * 3)
                   if sun is None else s.sun_sky(sun, bad),
                   agree=NOT_COMPARED if sun == 1e9 else ALL,
                   short=name in ("1e9:1", "with NaN and infinity"))
    yield Case("environment 1e9:1, diffuse", lambda: s.open_ground(
        s.diffuse_ball), environment=lambda: s.sun_sky(1e9))
    yield Case("environment 1x1", s.open_ground,
               environment=lambda: s.write_exr(1, 1, lambda x, y: (1,) * 3))
    yield Case("texture 1x1", lambda: s.textured(s.flat_png(1, 1, 128)))
    yield Case("texture 16384x16384", lambda: s.textured(
        s.flat_png(16384, 16384, 128)), like="texture 1x1", seconds=120)
    yield Case("texture 32768x16384", lambda: s.textured(
        s.flat_png(32768, 16384, 128)), code=2, says="make it smaller",
        seconds=120)
    for name, bad in (("NaN", (NAN, NAN)), ("infinity", (INF, -INF)),
                      ("negative values", (-1, -1e30)),
                      ("1e38", (1e38, 3e38))):
        for emissive in (False, True):
            yield Case(f"{'emissive ' * emissive}texture with {name}",
                       lambda b=bad, e=emissive: s.textured(
                           s.hdr_texture(b), e),
                       agree=NOT_COMPARED if name == "1e38" and emissive
                       else ALL, short=name == "NaN")
    for size in ("1x1", "1x64", "64x1"):
        yield Case(f"image {size}", _room, size=size, spp=32,
                   short=size != "64x1")
    # One at a time, in 16 GiB; what needs more is refused with what needs it.
    large = dict(size="8192x8192", spp=1, combine=False, seconds=1200,
                 memory=16384 * MIB)
    for name, options in (("pt", ()), ("bdpt", ()), ("crn", ()),
                          ("gdpt", ()), ("sppm", ("--photons", "1000000"))):
        yield Case(f"image 8192x8192, {name}",
                   lambda: s.room(objects=s.diffuse_ball),
                   ("--max-depth", "2", *options), only=(name,), **large)
    for name, only, combine in (("vcm", ("vcm",), False),
                                ("combined", ("pt", "crn"), True)):
        yield Case(f"image 8192x8192, {name}", _room,
                   ("--memory-limit", "16G"), only=only, code=5,
                   says="and the limit is 16384 MiB",
                   **large | dict(spp=4, combine=combine))


CASES = {case.name: case for part in (
    _lights, _placement, _materials, _dielectrics, _geometry, _depths,
    _images) for case in part()}
