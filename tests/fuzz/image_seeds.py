"""Images that fuzzing starts from: seeds.py writes them."""

import base64
import math
import struct
import zlib

from generator.stress_images import write_exr
from generator.textures import png

JPEG = ("/9j/4AAQSkZJRgABAQEASABIAAD/2wBDAAEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEB"
        "AQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQH/wAALCAACAAIBAREA/8QA"
        "FAABAAAAAAAAAAAAAAAAAAAACv/EABQQAQAAAAAAAAAAAAAAAAAAAAD/2gAIAQEAAD8A"
        "fwf/2Q==")
WEBP = "UklGRhoAAABXRUJQVlA4TA0AAAAvAAAAEAcQERGIiP4HAA=="
AVIF = ("AAAAIGZ0eXBhdmlmAAAAAGF2aWZtaWYxbWlhZk1BMUIAAADybWV0YQAAAAAAAAAoaGRs"
        "cgAAAAAAAAAAcGljdAAAAAAAAAAAAAAAAGxpYmF2aWYAAAAADnBpdG0AAAAAAAEAAAAe"
        "aWxvYwAAAABEAAABAAEAAAABAAABGgAAABQAAAAoaWluZgAAAAAAAQAAABppbmZlAgAA"
        "AAABAABhdjAxQ29sb3IAAAAAamlwcnAAAABLaXBjbwAAABRpc3BlAAAAAAAAAAIAAAAC"
        "AAAAEHBpeGkAAAAAAwgICAAAAAxhdjFDgQAMAAAAABNjb2xybmNseAACAAIAAoAAAAAX"
        "aXBtYQAAAAAAAAABAAEEAQKDBAAAABxtZGF0EgAKBRgANgQgMgkXgAkkkkQABUg=")
# A KTX2 file with alpha, under zlib.
ETC1S = ("eNpb7R0SoWBksJuXS4qLAQgYgZgDiHkYEIARCWcAsQ2S3AoofZoRQjcwQWhFBlQA08PE"
         "YMGwmJGRgZmZgUEALmsPZ/0HAiCfH5XPwMDKIMFgC6Tzgfg7mtlCUAzSpOCQGz1JJXJa"
         "6s1XxxsYtuZ6TkoBclbLMzNd2abqOSk1ctraOh6mgNvTVDynpUZu+8OYUWvZp/166sac"
         "3k3sDBxZtyepnNykc9rs3//TnHM2cpyJfH9Q7u/Rc8qKrrwBr212RkQXHFNin38xwuG4"
         "rOjP6yJW2sVyMm/YLpiti9o4bfJpuVPz0u/lXr/EuUfv7fnzZlcTou6nZez9f9CN/eWp"
         "j8wnrjwS3i5lLOt/5Y7r5+iFDIyOMLeeu1q8ftutqOLerZvDrvZd/B5zO/1axGq311u/"
         "3Up+K7k666zU4u2m1+Wyz5oee3f5e1TxFanar5a3XxW/s3w+q/jnhL3uZ7ceu1Xduzdn"
         "69Zvm/aW3a89e0f7etTGou+Gs7ft/XXPN7fPNvuc6fNb2V+37nq39Voe9/OqHV9jsre8"
         "tQmLLv7dsTW3f+uvqNr3N7PXXy05u/VZTPaavc/m1K6NS17byQALN936A8LwcCv+apt0"
         "9mm2uXT2923PThk6pX3deijm+oKZez8uuJU8bW3m6ucrInoPX1+1Me380tXiAnB93wrN"
         "UOPuv/S//z//v/gv/+//v/zf9ZP/M/w3/b/7z+K+///qpf87/mcGAF1RC4s=")


def hdr(width, height):
    head = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n"
    return head.encode() + bytes(
        (x * 7 + 3) % 256 for x in range(4 * width * height))


def texture_seeds():
    yield "png", png(3, 2, lambda x, y: (x * 80, y * 120, 5))
    yield "jpeg", base64.b64decode(JPEG)
    yield "webp", base64.b64decode(WEBP)
    yield "avif", base64.b64decode(AVIF)
    yield "hdr", hdr(4, 2)
    yield "hdr, runs", hdr(16, 2)
    yield "exr", write_exr(4, 2, lambda x, y: (x, math.inf, -1.0))
    yield "bmp", b"BM" + struct.pack("<IIIIiiHHIIiiII", 66, 0, 54, 40, 2, 1,
                                     1, 24, 0, 8, 1, 1, 0, 0) + bytes(8)


def ktx2(level, vk_format=0, model=1, channel=0, scheme=0, pairs=b""):
    """A KTX2 file of 4x4 texels, of one level."""
    sample = struct.pack("<HBB", 0, 127, channel) + bytes(8) + b"\xff" * 4
    block = struct.pack("<IHHBBBB", 0, 2, 40, model, 1, 2, 1) \
        + bytes((3, 3, 0, 0, 16)) + bytes(7) + sample
    descriptor = struct.pack("<I", 4 + len(block)) + block
    at = 104 + len(descriptor)
    start = at + len(pairs)
    return b"\xabKTX 20\xbb\r\n\x1a\n" + struct.pack(
        "<9I4I2Q3Q", vk_format, 1, 4, 4, 0, 0, 1, 1, scheme, 104,
        len(descriptor), at, len(pairs), 0, 0, start, len(level),
        len(level)) + descriptor + pairs + level


def ktx2_seeds():
    pairs = b"".join(
        struct.pack("<I", len(entry)) + entry + bytes(-len(entry) % 4)
        for entry in (b"KTXorientation\0ru\0", b"KTXswizzle\0bgr1\0"))
    texels = bytes(range(64))
    for vk_format in (9, 16, 23, 37, 44, 91, 97, 109):
        yield f"format {vk_format}", ktx2(texels * 4, vk_format, pairs=pairs)
    # Every way in which a block may begin.
    for start in range(128):
        block = bytes((start,)) + bytes(range(1, 16))
        yield f"uastc {start}", ktx2(block, model=166, channel=start % 7)
    frame = b"\x28\xb5\x2f\xfd\x20\x10\x81\0\0" + bytes(range(16))
    yield "uastc, zstd", ktx2(frame, model=166, scheme=2)
    yield "uastc, zlib", ktx2(zlib.compress(texels), model=166, scheme=3)
    yield "etc1s", zlib.decompress(base64.b64decode(ETC1S))
