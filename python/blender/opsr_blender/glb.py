"""Scenes as binary glTF: what an exporter wrote, and what is added to it."""

import json
import pathlib
import struct

import numpy as np


class Glb:
    """A binary glTF file: its JSON, and its bytes."""

    def __init__(self, path):
        data = pathlib.Path(path).read_bytes()
        (length,) = struct.unpack_from("<I", data, 12)
        self.json = json.loads(data[20 : 20 + length])
        rest = data[20 + length :]
        self.bytes = bytearray(rest[8 : 8 + struct.unpack_from("<I", rest)[0]] if rest else b"")
        self.own = {}

    def save(self, path):
        """Writes the file."""
        if self.bytes:
            buffers = self.json.setdefault("buffers", [{}])
            self.bytes += bytes(-len(self.bytes) % 4)
            buffers[0]["byteLength"] = len(self.bytes)
        text = json.dumps(self.json, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        if self.bytes:
            chunks += struct.pack("<I4s", len(self.bytes), b"BIN\0") + self.bytes
        pathlib.Path(path).write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)

    def add(self, kind, value):
        """Adds to a list of the file; returns the place."""
        values = self.json.setdefault(kind, [])
        values.append(value)
        return len(values) - 1

    def material(self, name):
        """The material of a name, or None."""
        return next((m for m in self.json.get("materials", []) if m.get("name") == name), None)

    def uses(self, extension):
        """Names an extension as used."""
        used = self.json.setdefault("extensionsUsed", [])
        if extension not in used:
            used.append(extension)

    def place(self, node):
        """Adds a node to the scene."""
        scenes = self.json.setdefault("scenes", [{}])
        scene = scenes[self.json.setdefault("scene", 0)]
        scene.setdefault("nodes", []).append(self.add("nodes", node))

    def accessor(self, values, kind, target):
        """Adds numbers; returns the place of their accessor."""
        self.bytes += bytes(-len(self.bytes) % 4)
        view = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": values.nbytes, "target": target}
        self.bytes += values.tobytes()
        number = 5126 if values.dtype == np.float32 else 5125
        accessor = {"bufferView": self.add("bufferViews", view), "componentType": number, "count": len(values), "type": kind}
        if kind == "VEC3":
            accessor["min"], accessor["max"] = values.min(axis=0).tolist(), values.max(axis=0).tolist()
        return self.add("accessors", accessor)

    def mesh(self, name, positions, faces, material):
        """Adds a mesh of triangles, in the space of the scene."""
        primitive = {
            "attributes": {"POSITION": self.accessor(np.asarray(positions, np.float32), "VEC3", 34962)},
            "indices": self.accessor(np.asarray(faces, np.uint32).reshape(-1), "SCALAR", 34963),
            "material": self.add("materials", material),
        }
        self.place({"name": name, "mesh": self.add("meshes", {"name": name, "primitives": [primitive]})})

    def light(self, name, matrix, light):
        """Adds a light without area."""
        self.uses("KHR_lights_punctual")
        lights = self.json.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {}).setdefault("lights", [])
        lights.append({"name": name, **light})
        extension = {"KHR_lights_punctual": {"light": len(lights) - 1}}
        self.place({"name": name, "matrix": columns(matrix), "extensions": extension})

    def camera(self, name, matrix, camera):
        """Adds a camera."""
        self.place({"name": name, "matrix": columns(matrix), "camera": self.add("cameras", {"name": name, **camera})})


# Blender's axes in those of glTF: y is up there.
UP = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], float)


def columns(matrix):
    """A matrix of Blender's world without its scale, as glTF lists it."""
    matrix = UP @ np.array(matrix, float)
    matrix[:3, :3] /= np.maximum(np.linalg.norm(matrix[:3, :3], axis=0), 1e-30)
    return matrix.T.reshape(-1).tolist()
