"""What of the Blender add-on needs no Blender: files, lamps, materials, and when a viewport renders."""

import json
import math
import pathlib
import struct
import subprocess
import sys
import types
import zlib

import numpy as np
import pytest

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "blender"))
from opsr_blender import exr, lamps, materials, suns  # noqa: E402
from opsr_blender.glb import UP, Glb  # noqa: E402
from opsr_blender.program import NoProgram, Render, denoiser, find, first_line, warnings  # noqa: E402
from opsr_blender.refine import Refiner  # noqa: E402


def empty(path):
    """A binary glTF file without anything."""
    text = json.dumps({"asset": {"version": "2.0"}, "scenes": [{}], "scene": 0}).encode()
    text += b" " * (-len(text) % 4)
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 20 + len(text)) + struct.pack("<I4s", len(text), b"JSON") + text)
    return Glb(path)


def test_exr_files_come_back(tmp_path):
    picture = {name: np.random.default_rng(1).random((5, 7), np.float32) for name in ("R", "G", "depth")}
    exr.write(tmp_path / "a.exr", picture)
    read = exr.read(tmp_path / "a.exr")
    assert all((read[name] == picture[name]).all() for name in picture) and len(read) == 3
    assert exr.layer(read, "", "RGB") is None and exr.layer(read, "depth", "").shape == (5, 7, 1)


def test_exr_blocks_are_unpacked():
    # The predictor and the order of OpenEXR's zip, forwards.
    raw = bytes(np.random.default_rng(2).integers(0, 256, 101, np.uint8))
    apart = np.frombuffer(raw[0::2] + raw[1::2], np.uint8).astype(int)
    steps = np.concatenate([apart[:1], (np.diff(apart) + 128) & 255]).astype(np.uint8)
    assert exr.unpacked(zlib.compress(steps.tobytes())) == raw


def test_exr_files_of_the_program_are_read(program, tmp_path):
    scene, read = pathlib.Path(__file__).parents[2] / "training_scenes" / "rings.glb", []
    for coding in ("none", "zip", "zips"):
        words = [program, "render", scene, "--size", "20x18", "--spp", "2", "--exr", coding, "--aov"]
        subprocess.run([*words, "-o", tmp_path / "a.exr"], check=True, capture_output=True)
        read.append(exr.read(tmp_path / "a.exr"))
    assert all((each[name] == read[0][name]).all() for each in read for name in read[0])
    np.testing.assert_allclose(np.linalg.norm(exr.layer(read[0], "normal", "XYZ"), axis=-1).max(), 1, rtol=1e-3)


POSE = [[0, -2, 0, 1], [2, 0, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]]


def flux(glb):
    """Power of the only emitting mesh: pi times its radiance times its area, per colour."""
    (mesh,), (material,) = glb.json["meshes"], glb.json["materials"]
    arrays = []
    for place, kind, columns in ((mesh["primitives"][0]["attributes"]["POSITION"], "<f4", 3), (mesh["primitives"][0]["indices"], "<u4", 3)):
        view = glb.json["bufferViews"][glb.json["accessors"][place]["bufferView"]]
        data = glb.bytes[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        arrays.append(np.frombuffer(bytes(data), kind).reshape(-1, columns))
    strength = material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"]
    area = lamps.size_of(*arrays)
    return math.pi * area * strength * np.array(material["emissiveFactor"]), *arrays


@pytest.mark.parametrize("shape", ["SQUARE", "RECTANGLE", "DISK", "ELLIPSE"])
def test_area_lamps_keep_their_power_and_face_down(tmp_path, shape):
    lamp = {"kind": "AREA", "name": "lamp", "matrix": POSE, "color": [100, 50, 20], "shape": shape, "size": (0.5, 0.25)}
    glb = empty(tmp_path / "a.glb")
    lamps.add(glb, lamp)
    power, positions, faces = flux(glb)
    np.testing.assert_allclose(power, [100, 50, 20], rtol=1e-5)
    a, b, c = (positions[faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    # Blender's -z is -y in glTF.
    assert (normals[:, 1] < 0).all()
    round_ones = math.pi / 4 if shape in ("DISK", "ELLIPSE") else 1
    assert lamps.size_of(positions, faces) == pytest.approx(0.125 * 4 * round_ones, rel=1e-5)


def test_round_lamps_are_closed_balls_of_their_power(tmp_path):
    glb = empty(tmp_path / "a.glb")
    spot = {"kind": "SPOT", "name": "spot", "matrix": POSE, "color": [10, 20, 30], "radius": 0.1, "spot_size": 1.0, "spot_blend": 0.5}
    lamps.add(glb, spot)
    power, positions, faces = flux(glb)
    np.testing.assert_allclose(power, [10, 20, 30], rtol=1e-5)
    centre = (UP @ np.array(POSE))[:3, 3]
    np.testing.assert_allclose(np.linalg.norm(positions - centre, axis=1), 0.1, rtol=1e-5)
    a, b, c = (positions[faces[:, i]] - centre for i in range(3))
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a) > 0).all() and len(faces) == 80
    lamp = glb.json["materials"][0]["extras"]["lamp"]
    assert lamp["hidden"] and lamp["cone"]["direction"] == pytest.approx([0, -1, 0])
    assert lamp["cone"]["cosOuter"] == pytest.approx(math.cos(0.5))
    glb.save(tmp_path / "b.glb")
    assert Glb(tmp_path / "b.glb").json["buffers"][0]["byteLength"] == len(glb.bytes)


@pytest.mark.parametrize("towards", [(0.3, -0.5, 0.6), (0, 0, 1), (-1, 0.01, 0.0), (0.01, 0, -1)])
def test_suns_in_a_map_keep_their_irradiance(towards):
    towards = np.array(towards) / np.linalg.norm(towards)
    drawn = suns.with_suns(np.full((1, 2, 3), 0.5, np.float32), [(towards, (4.0, 2.0, 1.0), math.radians(0.6))])
    height, width = drawn.shape[:2]
    theta, phi = (np.arange(height) + 0.5) * math.pi / height, math.pi - (np.arange(width) + 0.5) * math.pi / height
    ring = np.cos(np.arange(height) * math.pi / height) - np.cos((np.arange(height) + 1) * math.pi / height)
    sky = np.stack([np.sin(theta)[:, None] * np.cos(phi), np.sin(theta)[:, None] * np.sin(phi), np.broadcast_to(np.cos(theta)[:, None], (height, width))], -1)
    weight = (ring * 2 * math.pi / width)[:, None, None] * np.maximum(sky @ towards, 0)[..., None]
    np.testing.assert_allclose(((drawn - 0.5) * weight).sum(axis=(0, 1)), [4, 2, 1], rtol=1e-3)
    lit = (drawn[..., 0] > 0.5)
    assert np.degrees(np.arccos(np.clip(sky[lit] @ towards, -1, 1))).max() < 0.6


class Tree:
    """Nodes with values and links, as a material of Blender has them."""

    def __init__(self):
        self.nodes = []

    def node(self, kind, inputs=(), **values):
        sockets = Sockets()
        for name in [*inputs, *values]:
            value = values.get(name)
            key = name.replace("_", " ")
            sockets[key] = types.SimpleNamespace(name=key, default_value=value, is_linked=False, links=[])
        made = types.SimpleNamespace(type=kind, name=kind.title(), inputs=sockets, outputs=[], is_active_output=True)
        self.nodes.append(made)
        return made

    @staticmethod
    def link(source, node, name):
        socket = node.inputs[name]
        socket.is_linked, socket.links = True, [types.SimpleNamespace(from_node=source, is_muted=False)]


class Sockets(dict):
    def __getitem__(self, key):
        return list(self.values())[key] if isinstance(key, int) else super().__getitem__(key)

    def __iter__(self):
        return iter(self.values())

    def __contains__(self, name):
        return name in self.keys()


def translated(tree, surface, tmp_path, volume=None):
    output = tree.node("OUTPUT_MATERIAL", ["Surface", "Volume", "Displacement"])
    tree.link(surface, output, "Surface")
    if volume is not None:
        tree.link(volume, output, "Volume")
    glb = empty(tmp_path / "a.glb")
    glb.add("materials", {"name": "m", "pbrMetallicRoughness": {}})
    notes = materials.translate(glb, types.SimpleNamespace(name="m", use_nodes=True, node_tree=tree))
    return glb.json["materials"][0], notes


def test_absorbing_glass_of_blender(tmp_path):
    tree = Tree()
    glass = tree.node("BSDF_GLASS", Color=(1, 0.5, 1, 1), Roughness=0.1, IOR=1.5)
    inside = tree.node("VOLUME_ABSORPTION", Color=(0.9, 0.5, 0.2, 1), Density=2.0)
    read, notes = translated(tree, glass, tmp_path, inside)
    # Each interface of a glTF body tints once, as the node does.
    assert read["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx([1, 0.5, 1, 1])
    volume = read["extensions"]["KHR_materials_volume"]
    absorbed = [-math.log(c) / volume["attenuationDistance"] for c in volume["attenuationColor"]]
    assert absorbed == pytest.approx([0.2, 1.0, 1.6]) and notes == []
    assert read["extensions"]["KHR_materials_transmission"]["transmissionFactor"] == 1


def test_mixtures_of_shaders(tmp_path):
    tree = Tree()
    mix = tree.node("MIX_SHADER", Fac=0.25, A=None, B=None)
    tree.link(tree.node("BSDF_DIFFUSE", Color=(1, 0, 0, 1)), mix, "A")
    tree.link(tree.node("BSDF_DIFFUSE", Color=(0, 0, 1, 1)), mix, "B")
    read, notes = translated(tree, mix, tmp_path)
    assert read["pbrMetallicRoughness"]["baseColorFactor"] == [0.75, 0, 0.25, 1] and notes == []
    tree = Tree()
    mix = tree.node("MIX_SHADER", Fac=0.25, A=None, B=None)
    tree.link(tree.node("BSDF_TRANSPARENT", Color=(1, 1, 1, 1)), mix, "A")
    tree.link(tree.node("EMISSION", Color=(1, 0.5, 0, 1), Strength=4.0), mix, "B")
    read, notes = translated(tree, mix, tmp_path)
    assert read["alphaMode"] == "BLEND" and read["pbrMetallicRoughness"]["baseColorFactor"][3] == 0.25
    assert read["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] == 4 and notes == []
    tree = Tree()
    mix = tree.node("MIX_SHADER", Fac=0.5, A=None, B=None)
    tree.link(tree.node("BSDF_DIFFUSE", Color=(1, 0, 0, 1)), mix, "A")
    tree.link(tree.node("BSDF_HAIR", Color=(0, 0, 1, 1)), mix, "B")
    _, notes = translated(tree, mix, tmp_path)
    assert any("Bsdf_Hair is not translated" in note for note in notes)


@pytest.mark.parametrize("kind", ["alone", "MIX_SHADER", "ADD_SHADER"])
def test_translucent_shaders_transmit(tmp_path, kind):
    tree = Tree()
    node = tree.node("BSDF_TRANSLUCENT", Color=(0.2, 0.4, 0.1, 1))
    if kind != "alone":
        through, node = node, tree.node(kind, **({"Fac": 0.25} if kind == "MIX_SHADER" else {}), A=None, B=None)
        tree.link(tree.node("BSDF_DIFFUSE", Color=(0.1, 0.6, 0.3, 1)), node, "A")
        tree.link(through, node, "B")
    read, notes = translated(tree, node, tmp_path)
    extension = read["extensions"]["KHR_materials_diffuse_transmission"]
    share = extension["diffuseTransmissionFactor"]
    reflected = [(1 - share) * c for c in read["pbrMetallicRoughness"]["baseColorFactor"][:3]]
    transmitted = [share * c for c in extension["diffuseTransmissionColorFactor"]]
    a, b = {"alone": (0, 1), "MIX_SHADER": (0.75, 0.25), "ADD_SHADER": (1, 1)}[kind]
    assert reflected == pytest.approx([a * c for c in (0.1, 0.6, 0.3)])
    assert transmitted == pytest.approx([b * c for c in (0.2, 0.4, 0.1)])
    assert read["extensions"]["KHR_materials_specular"]["specularFactor"] == 0 and notes == []


def test_translucent_shaders_that_no_base_has_are_named(tmp_path):
    def of(a, b, inner=None):
        tree = Tree()
        node = tree.node("ADD_SHADER", A=None, B=None)
        nodes = [tree.node(kind, **values) for kind, values in (a, b)]
        if inner is not None:
            inside = tree.node("ADD_SHADER", A=None, B=None)
            tree.link(nodes[1], inside, "A")
            tree.link(tree.node(inner[0], **inner[1]), inside, "B")
            nodes[1] = inside
        tree.link(nodes[0], node, "A")
        tree.link(nodes[1], node, "B")
        return translated(tree, node, tmp_path)

    leaf = ("BSDF_TRANSLUCENT", {"Color": (0, 0.9, 0, 1)})
    _, notes = of(("BSDF_DIFFUSE", {"Color": (0.9, 0, 0, 1)}), leaf)
    assert any("they are clipped" in note for note in notes)
    _, notes = of(("BSDF_GLOSSY", {"Color": (0.5, 0.5, 0.5, 1), "Roughness": 0.2}), leaf)
    assert any("adds two surfaces" in note for note in notes)
    shining = ("EMISSION", {"Color": (1, 0.5, 0, 1), "Strength": 0.25})
    read, notes = of(("BSDF_DIFFUSE", {"Color": (0, 0.05, 0, 1)}), leaf, shining)
    assert read["emissiveFactor"] == pytest.approx([0.25, 0.125, 0]) and notes == []


def test_a_body_is_black_at_no_temperature():
    # The white of Rec. 709 is a daylight of 6504 K: a black body near it is nearly white.
    assert materials.blackbody(6500) == pytest.approx((1, 1, 1), abs=0.06)
    red, _, blue = materials.blackbody(2000)
    assert red > 2 and blue < 0.15


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


class Running:
    def __init__(self, exported, view):
        self.of, self.left, self.killed = (exported, view), 3, False

    def running(self):
        self.left -= 1
        return self.left > 0

    def fresh(self):
        return True

    def status(self):
        return f"{self.left} left"

    def kill(self):
        self.killed = True

    def end(self):
        return None, []


def test_viewports_refine_while_nothing_moves():
    clock, exports, started = Clock(), [], []

    def export():
        exports.append(clock.now)
        return len(exports)

    def start(exported, view):
        started.append(Running(exported, view))
        return started[-1]

    refiner = Refiner(export, start, lambda running: (running.of, running.left), quiet=1.0, clock=clock)
    refiner.changed()
    refiner.look("a")
    assert not refiner.tick() and not started
    clock.now = 2.0
    refiner.look("a")
    assert not refiner.tick() and started[0].of == (1, "a")
    assert refiner.tick() and refiner.picture == ((1, "a"), 2)
    # Another view ends the render, waits, and exports nothing.
    refiner.look("b")
    assert started[0].killed and not refiner.tick() and len(started) == 1
    clock.now = 4.0
    refiner.tick()
    assert started[1].of == (1, "b") and exports == [2.0]
    assert [refiner.tick() for _ in range(4)] == [True, True, True, False]
    # Another scene is exported again; what fails is said.
    refiner.export = lambda: 1 / 0
    refiner.changed()
    clock.now = 6.0
    assert refiner.tick() and "zero" in refiner.message and not refiner.tick()


def test_program_is_heard_and_its_message_is_short(tmp_path):
    script = tmp_path / "opsr.py"
    script.write_text(
        "import sys, pathlib\n"
        "print('{\"spp\": 4, \"fraction\": 0.5, \"eta\": 2.0, \"error\": 0.25}', flush=True)\n"
        "print(' WARN a.glb: glass is thin', file=sys.stderr)\n"
        "if 'fail' in sys.argv: sys.exit('opsr: a.glb: is no scene\\nmore')\n"
        "pathlib.Path(sys.argv[sys.argv.index('-o') + 1]).write_text('x')\n"
    )
    run = Render([sys.executable, script], tmp_path / "a.exr")
    assert run.end() == (None, ["a.glb: glass is thin"]) and run.fresh() and not run.fresh()
    assert run.fraction == 0.5 and run.status() == "4 samples, error 0.2500, 2 s left"
    failed, _ = Render([sys.executable, script, "fail"], tmp_path / "a.exr").end()
    assert failed == "a.glb: is no scene"
    assert first_line("\nError: one\ntwo") == "one" and warnings("none") == []
    with pytest.raises(NoProgram, match="no-such: no such program"):
        find("no-such")


def test_denoiser_is_that_of_a_variable_or_of_an_installation(tmp_path, monkeypatch):
    monkeypatch.delenv("OIDN_DIR", raising=False)
    some = tmp_path / "some"
    (some / "lib").mkdir(parents=True)
    (some / "lib" / "libOpenImageDenoise_core.so.2").touch()
    assert denoiser(some) is None and denoiser(tmp_path / "none") is None
    (some / "lib" / "libOpenImageDenoise.so.2").touch()
    assert denoiser(some) == str(some / "lib")
    run = Render([sys.executable, "-c", "import os, sys; sys.exit(os.environ['OIDN_DIR'])"], tmp_path / "a.exr", denoiser="there")
    assert run.end()[0] == "there"
    # A variable counts where the library is in its folder.
    for wrong in ("", str(tmp_path / "none")):
        monkeypatch.setenv("OIDN_DIR", wrong)
        assert denoiser(some) == str(some / "lib") and denoiser(tmp_path) is None
    (tmp_path / "own" / "bin").mkdir(parents=True)
    (tmp_path / "own" / "bin" / "OpenImageDenoise.dll").touch()
    monkeypatch.setenv("OIDN_DIR", str(tmp_path / "own"))
    assert denoiser(some) == str(tmp_path / "own" / "bin")
