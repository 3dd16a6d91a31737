"""OpenEXR files for the stress test: a writer of environments and textures,
and a reader of what a renderer wrote, so that every value can be checked."""

import array
import itertools
import math
import struct
import zlib

HALF, FLOAT = 1, 2
ROWS = {0: 1, 2: 1, 3: 16}      # by compression: none, ZIPS, ZIP
_FLIP = bytes(i ^ 128 for i in range(256))


def _attribute(name, kind, data):
    return (name.encode() + b"\0" + kind.encode() + b"\0"
            + struct.pack("<I", len(data)) + data)


def write_exr(width, height, pixel):
    """Uncompressed R G B floats; pixel(x, y) -> 3 values, from the top."""
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(name + b"\0" + struct.pack("<iB3xii", FLOAT, 0, 1, 1)
                        for name in (b"B", b"G", b"R")) + b"\0"
    header = (b"v/1\x01" + struct.pack("<I", 2)
              + _attribute("channels", "chlist", channels)
              + _attribute("compression", "compression", b"\0")
              + _attribute("dataWindow", "box2i", window)
              + _attribute("displayWindow", "box2i", window)
              + _attribute("lineOrder", "lineOrder", b"\0")
              + _attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
              + _attribute("screenWindowCenter", "v2f", bytes(8))
              + _attribute("screenWindowWidth", "float", struct.pack("<f", 1))
              + b"\0")
    size = 8 + 12 * width
    start = len(header) + 8 * height
    out = [header, struct.pack(f"<{height}Q", *(start + size * y
                                                for y in range(height)))]
    for y in range(height):
        row = [pixel(x, y) for x in range(width)]
        out.append(struct.pack(f"<iI{3 * width}f", y, 12 * width,
                               *(row[x][c] for c in (2, 1, 0)
                                 for x in range(width))))
    return b"".join(out)


def _unzip(data, size):
    """Undoes OpenEXR's ZIP: deflate, differences, even and odd bytes apart."""
    if len(data) == size:
        return data                     # stored, as it would not shrink
    # Byte i is the sum of i + 1 stored ones less 128 i: for odd i its top
    # bit flips.
    sums = bytes(x & 255 for x in itertools.accumulate(zlib.decompress(data)))
    plain = bytearray(len(sums))
    plain[0::2] = sums[0::2]
    plain[1::2] = sums[1::2].translate(_FLIP)
    middle = (len(plain) + 1) // 2
    out = bytearray(len(plain))
    out[0::2], out[1::2] = plain[:middle], plain[middle:]
    return bytes(out)


def _text(data, at):
    end = data.index(b"\0", at)
    return data[at:end].decode(), end + 1


def _header(data):
    attributes, at = {}, 8
    while data[at]:
        name, at = _text(data, at)
        _, at = _text(data, at)
        size, = struct.unpack_from("<I", data, at)
        attributes[name] = data[at + 4:at + 4 + size]
        at += 4 + size
    return attributes, at + 1


def _channels(chlist):
    channels, at = [], 0
    while chlist[at]:
        name, at = _text(chlist, at)
        channels.append((name, struct.unpack_from("<i", chlist, at)[0]))
        at += 16
    return channels


class Exr:
    """A scan-line file: `planes` by channel name, `attributes` as bytes."""

    def __init__(self, path):
        with open(path, "rb") as file:
            data = file.read()
        if data[:4] != b"v/1\x01":
            raise ValueError("not an OpenEXR file")
        self.attributes, at = _header(data)
        x0, y0, x1, y1 = struct.unpack("<4i", self.attributes["dataWindow"])
        self.width, self.height = x1 - x0 + 1, y1 - y0 + 1
        channels = _channels(self.attributes["channels"])
        rows = ROWS[self.attributes["compression"][0]]
        line = self.width * sum(4 if kind == FLOAT else 2
                                for _, kind in channels)
        self.planes = {name: array.array("f") for name, _ in channels}
        blocks = -(-self.height // rows)
        for offset in struct.unpack_from(f"<{blocks}Q", data, at):
            y, size = struct.unpack_from("<iI", data, offset)
            count = min(rows, y1 + 1 - y)
            self._add(_unzip(data[offset + 8:offset + 8 + size],
                             count * line), channels, count)

    def _add(self, raw, channels, count):
        at = 0
        for _ in range(count):
            for name, kind in channels:
                if kind == FLOAT:
                    self.planes[name].frombytes(raw[at:at + 4 * self.width])
                    at += 4 * self.width
                else:
                    self.planes[name].extend(struct.unpack_from(
                        f"<{self.width}e", raw, at))
                    at += 2 * self.width

    def integer(self, name, fallback=0):
        data = self.attributes.get(name)
        return fallback if data is None else struct.unpack("<i", data)[0]

    def mean(self, layer):
        """Mean over the pixels and the three colours."""
        return sum(sum(self.planes[f"{layer}.{c}"]) for c in "RGB") / (
            3 * self.width * self.height)

    def tile_means(self, layer, side):
        """The mean, then those of all tiles, row by row, over the colours."""
        w, h = self.width, self.height
        planes = [self.planes[f"{layer}.{c}"] for c in "RGB"]
        grey = [(r + g + b) / 3 for r, g, b in zip(*planes)]
        means = [sum(grey) / (w * h)]
        for y0 in range(0, h, side):
            for x0 in range(0, w, side):
                x1, y1 = min(x0 + side, w), min(y0 + side, h)
                total = sum(sum(grey[y * w + x0:y * w + x1])
                            for y in range(y0, y1))
                means.append(total / ((x1 - x0) * (y1 - y0)))
        return means

    def not_finite(self):
        """Names of the channels that hold a NaN or an infinity. A sum in
        doubles of finite floats cannot overflow."""
        return [name for name, plane in self.planes.items()
                if not math.isfinite(sum(plane))]
