#!/usr/bin/env python3
"""Generates the braid benchmark scenes next to this file.

    generate.py [NAME...]            write all scenes, or the named ones
    generate.py --check [NAME...]    validate the files that are there

Needs only the standard library. Every random choice has a fixed seed: equal
sources give equal bytes.
"""

import argparse
import pathlib
import sys

from generator import basics, nature, refraction, rooms, shelf, showcase
from generator.check import Invalid, check

SCENES = {build.__name__: build for build in (
    basics.furnace, basics.cornell, basics.plates,
    shelf.bookshelf, rooms.interior, rooms.door_ajar,
    refraction.glass_of_water, refraction.pool, refraction.torus_glass,
    nature.hair, nature.foliage, nature.forest,
    showcase.many_lights, showcase.sun_sky, showcase.materials)}

MAX_FILE, MAX_TOTAL = 1_000_000, 6_000_000


def check_files(names):
    """Prints one line per file; returns the number of bad ones."""
    bad, total = 0, 0
    print(f"{'scene':16}{'bytes':>10}{'stored tris':>13}{'instanced':>13}")
    for name in names:
        try:
            data = (HERE / f"{name}.glb").read_bytes()
            stored, instanced = check(data)
            if len(data) > MAX_FILE:
                raise Invalid("file too large")
        except (Invalid, OSError) as error:
            bad += 1
            print(f"{name:16}BAD: {error}")
            continue
        total += len(data)
        print(f"{name:16}{len(data):>10}{stored:>13}{instanced:>13}")
    print(f"{'total':16}{total:>10}")
    return bad + (total > MAX_TOTAL)


HERE = pathlib.Path(__file__).resolve().parent


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--check", action="store_true",
                        help="validate the existing files, write nothing")
    parser.add_argument("names", nargs="*", metavar="NAME",
                        help=f"scenes (default: all): {', '.join(SCENES)}")
    arguments = parser.parse_args()
    names = arguments.names or list(SCENES)
    unknown = [name for name in names if name not in SCENES]
    if unknown:
        parser.error(f"unknown scene: {', '.join(unknown)}")
    if not arguments.check:
        for name in names:
            (HERE / f"{name}.glb").write_bytes(SCENES[name]().to_bytes())
    return 1 if check_files(names) else 0


if __name__ == "__main__":
    sys.exit(main())
