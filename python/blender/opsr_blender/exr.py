"""OpenEXR files of one part with scan lines: what opsr and Blender write, and the maps that opsr is given."""

import pathlib
import struct
import zlib

import numpy as np

# Numbers of the types of pixels, and of the codings with the rows of a block.
TYPES = {1: np.dtype("<f2"), 2: np.dtype("<f4"), 0: np.dtype("<u4")}
ROWS = {0: 1, 2: 1, 3: 16}


def write(path, channels):
    """Writes arrays of height x width by their names as single floats, without compression."""
    names = sorted(channels)
    height, width = channels[names[0]].shape
    listed = b"".join(name.encode() + b"\0" + struct.pack("<iBxxxii", 2, 0, 1, 1) for name in names) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes = [
        ("channels", "chlist", listed),
        ("compression", "compression", b"\0"),
        ("dataWindow", "box2i", window),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1)),
    ]
    head = struct.pack("<2i", 20000630, 2)
    for name, kind, value in attributes:
        head += f"{name}\0{kind}\0".encode() + struct.pack("<i", len(value)) + value
    head += b"\0"
    size = 4 * width * len(names)
    rows = np.empty(height, np.dtype([("y", "<i4"), ("size", "<i4"), ("data", "<f4", (len(names), width))]))
    rows["y"], rows["size"] = np.arange(height), size
    for place, name in enumerate(names):
        rows["data"][:, place] = channels[name]
    offsets = len(head) + 8 * height + (8 + size) * np.arange(height, dtype="<u8")
    pathlib.Path(path).write_bytes(head + offsets.astype("<u8").tobytes() + rows.tobytes())


def read(path):
    """The channels of a file by their names, as single floats, rows from the top."""
    data = pathlib.Path(path).read_bytes()
    if data[:4] != struct.pack("<i", 20000630) or data[5] & 0x1A:
        raise ValueError(f"{path}: no EXR file of one part with scan lines")
    attributes, at = header(data)
    coding = attributes["compression"][0]
    if coding not in ROWS:
        raise ValueError(f"{path}: its compression {coding} is not read")
    channels = channel_list(attributes["channels"])
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    width, height = right - left + 1, bottom - top + 1
    picture = {name: np.empty((height, width), np.float32) for name, _ in channels}
    blocks = -(-height // ROWS[coding])
    for begin in struct.unpack_from(f"<{blocks}Q", data, at):
        y, size = struct.unpack_from("<2i", data, begin)
        block = data[begin + 8 : begin + 8 + size]
        rows = min(ROWS[coding], bottom - y + 1)
        length = rows * width * sum(kind.itemsize for _, kind in channels)
        if coding != 0 and size < length:
            block = unpacked(block)
        place = 0
        for row in range(y - top, y - top + rows):
            for name, kind in channels:
                picture[name][row] = np.frombuffer(block, kind, width, place)
                place += width * kind.itemsize
    return picture


def header(data):
    """Values of the attributes by their names, and the place behind the header."""
    attributes, at = {}, 8
    while data[at]:
        end = data.index(b"\0", at)
        name, at = data[at:end].decode(), data.index(b"\0", end + 1) + 1
        (size,) = struct.unpack_from("<i", data, at)
        attributes[name] = data[at + 4 : at + 4 + size]
        at += 4 + size
    return attributes, at + 1


def channel_list(value):
    """Names and types of the channels, in the order of the file."""
    channels, at = [], 0
    while value[at]:
        end = value.index(b"\0", at)
        kind, across, down = struct.unpack_from("<i4x2i", value, end + 1)
        if (across, down) != (1, 1):
            raise ValueError("channels of fewer pixels are not read")
        channels.append((value[at:end].decode(), TYPES[kind]))
        at = end + 17
    return channels


def unpacked(block):
    """Bytes of a block by zip: differences of bytes whose even and odd places are apart."""
    raw = np.frombuffer(zlib.decompress(block), np.uint8).astype(np.int64)
    raw[1:] -= 128
    raw = (np.cumsum(raw) & 255).astype(np.uint8)
    half = (len(raw) + 1) // 2
    out = np.empty_like(raw)
    out[0::2], out[1::2] = raw[:half], raw[half:]
    return out.tobytes()


def layer(picture, name, letters):
    """A layer as height x width x channels; the name is empty for the picture itself."""
    names = [f"{name}.{letter}" if name else letter for letter in letters] if letters else [name]
    if any(each not in picture for each in names):
        return None
    return np.stack([picture[each] for each in names], axis=-1)
