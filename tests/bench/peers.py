#!/usr/bin/env python3
"""Camera paths that a CPU-second buys in opsr and in every other renderer that is installed, in turns, in one run, and CPU time
to the same noise; then rays of opsr beside Embree's.

    pip install numpy OpenEXR mitsuba bpy pyluxcore embreex
    cargo build --release
    python3 tests/bench/peers.py target/release/opsr

What is missing is named and left out. SPP and TURNS are taken from the environment (64, 5). The boxes are those of
against_mitsuba.py, with the same triangles, depth and lights everywhere; Cycles and LuxCore have no Beckmann distribution and
take theirs. Each render is a process of its own; the CPU time of one with a sample less than two is taken off, so that
loading, compiling and writing do not count. Noise is the variance between the turns over the squared mean picture plus 0.01,
mean over channels and pixels but the worst 0.1 %. Mean radiances stand beside, to see that the work was the same. Not part of
the automatic tests: it needs minutes.
"""

import glob
import importlib.util
import math
import os
import platform
import resource
import statistics
import subprocess
import sys
import tempfile
import time

import numpy as np

import against_mitsuba as boxes
from against_mitsuba import CAMERA_Z, FOV_Y, IOR, RADIANCE, SCENES, SIZE, VERTICES

NAMES = ["diffuse", "glass and metal"]


def opsr(program, folder, parts, spp, seed, *options):
    gltf = boxes.write_gltf(folder, parts)
    subprocess.run(
        [program, "render", gltf, "--spp", str(spp), "--size", f"{SIZE}x{SIZE}", "--max-depth", str(VERTICES), "--seed",
         str(seed), "--progress", "none", "-o", os.path.join(folder, "opsr.exr"), *options], check=True)


def read(path):
    import OpenEXR

    with OpenEXR.File(path, separate_channels=True) as file:
        channels = file.channels()
        return np.stack([channels[name].pixels.astype(float) for name in "RGB"], -1)


def mitsuba(folder, parts, spp, seed, lanes, sampler="independent"):
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    if lanes == 8:
        boxes.hold_to_avx2()
    scene = boxes.mitsuba_scene(folder, parts, sampler)
    return np.array(mi.render(scene, spp=spp, seed=seed))[..., :3]


def cycles(folder, parts, spp, seed, *features):
    """With features of its own: "denoise", "guide", "caustics" (manifolds from surfaces to lamps through glass)."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    render, options = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = SIZE
    render.filepath = os.path.join(folder, "cycles.exr")
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    options.samples, options.seed, options.pixel_filter_type = spp, seed, "BOX"
    options.use_adaptive_sampling = False
    options.use_denoising, options.denoiser = "denoise" in features, "OPENIMAGEDENOISE"
    options.use_guiding = "guide" in features
    options.sample_clamp_indirect, options.blur_glossy = 0, 0
    for bounces in ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces"):
        setattr(options, bounces, VERTICES)

    def shader(kind, name):
        material = bpy.data.materials.new(name)
        material.use_nodes = True
        nodes, link = material.node_tree.nodes, material.node_tree.links.new
        nodes.clear()
        out = nodes.new("ShaderNodeOutputMaterial").inputs["Surface"]
        if kind == "light":
            # From the front alone.
            node, mix = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeMixShader")
            node.inputs["Strength"].default_value = RADIANCE
            link(nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], mix.inputs["Fac"])
            link(node.outputs[0], mix.inputs[1])
            link(mix.outputs[0], out)
            material.cycles.emission_sampling = "FRONT"
            return material
        types = {"glass": "ShaderNodeBsdfGlass", "metal": "ShaderNodeBsdfAnisotropic"}
        node = nodes.new(types.get(kind[0], "ShaderNodeBsdfDiffuse"))
        if kind[0] in types:
            node.inputs["Color"].default_value = (1, 1, 1, 1)
            node.inputs["Roughness"].default_value = math.sqrt(kind[1])
            if kind[0] == "glass":
                node.inputs["IOR"].default_value = IOR
        else:
            node.inputs["Color"].default_value = (*kind, 1)
        link(node.outputs[0], out)
        return material

    for name, kind, (p, _, index) in parts:
        if kind == "light" and "caustics" in features:
            # Manifolds end on lamps, which a camera does not see; the mesh is seen by nothing else.
            sides = (p[1] - p[0], p[3] - p[0])
            lamp = bpy.data.lights.new(name, "AREA")
            lamp.shape = "RECTANGLE"
            lamp.size, lamp.size_y = (float(np.linalg.norm(side)) for side in sides)
            lamp.energy = math.pi * RADIANCE * lamp.size * lamp.size_y
            lamp.cycles.is_caustics_light = True
            made = bpy.data.objects.new(name, lamp)
            made.location = p.mean(0).tolist()
            # A lamp shines along its -z.
            made.rotation_euler = (-math.pi / 2, 0, 0)
            scene.collection.objects.link(made)
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(p.tolist(), [], index.tolist())
        mesh.shade_smooth()
        mesh.materials.append(shader(kind, name))
        made = bpy.data.objects.new(name, mesh)
        if kind == "light" and "caustics" in features:
            made.visible_diffuse = made.visible_glossy = made.visible_transmission = made.visible_shadow = False
        made.cycles.is_caustics_caster = kind[0] == "glass"
        made.cycles.is_caustics_receiver = kind[0] not in ("glass", "metal")
        scene.collection.objects.link(made)
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.angle = "VERTICAL", FOV_Y
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.camera.location = (0, 0, CAMERA_Z)
    scene.collection.objects.link(scene.camera)
    bpy.ops.render.render(write_still=True)
    pixels = np.array(bpy.data.images.load(render.filepath).pixels)
    # Rows from below.
    return pixels.reshape(SIZE, SIZE, 4)[::-1, :, :3]


# Properties of LuxCore: light paths for what is seen by way of smooth glass and metal, and its caustics from photons.
HYBRID = {"path.hybridbackforward.enable": True, "path.hybridbackforward.partition": 0.8,
          "path.hybridbackforward.glossinessthreshold": 0.05}
PHOTON_GI = {"path.photongi.caustic.enabled": True, "path.photongi.photon.maxcount": 2_000_000,
             "path.photongi.photon.maxdepth": VERTICES, "path.photongi.caustic.maxsize": 200_000,
             "path.photongi.caustic.updatespp": 8}


def luxcore(folder, parts, spp, seed, engine, **options):
    import pyluxcore as lux

    lux.Init(lambda message: None)

    def properties(values):
        out = lux.Properties()
        for key, value in values.items():
            out.Set(lux.Property(key, value))
        return out

    scene = lux.Scene()
    white = [1.0, 1.0, 1.0]
    scene.Parse(properties({
        "scene.camera.type": "perspective",
        "scene.camera.lookat.orig": [0.0, 0.0, CAMERA_Z],
        "scene.camera.lookat.target": [0.0, 0.0, 0.0],
        "scene.camera.up": [0.0, 1.0, 0.0],
        "scene.camera.fieldofview": math.degrees(FOV_Y),
    }))
    for name, kind, (p, n, index) in parts:
        material = f"scene.materials.{name}."
        if kind == "light":
            values = {"type": "matte", "kd": [0.0] * 3, "emission": white, "emission.gain": [RADIANCE] * 3}
        elif kind == ("glass", 0):
            values = {"type": "glass", "kr": white, "kt": white, "interiorior": IOR}
        elif kind == ("metal", 0):
            values = {"type": "mirror", "kr": white}
        elif kind[0] == "glass":
            values = {"type": "roughglass", "kr": white, "kt": white, "interiorior": IOR, "uroughness": kind[1],
                      "vroughness": kind[1]}
        elif kind[0] == "metal":
            values = {"type": "metal2", "fresnel": f"{name}-fresnel", "uroughness": kind[1], "vroughness": kind[1]}
            scene.Parse(properties({f"scene.textures.{name}-fresnel.type": "fresnelcolor",
                                    f"scene.textures.{name}-fresnel.kr": white}))
        else:
            values = {"type": "matte", "kd": list(kind)}
        scene.Parse(properties({material + key: value for key, value in values.items()}))
        corners, faces, normals = ([tuple(row) for row in rows.tolist()] for rows in (p, index, n))
        scene.DefineMesh(name, corners, faces, normals, None, None, None)
        scene.Parse(properties({f"scene.objects.{name}.shape": name, f"scene.objects.{name}.material": name}))
    depth = VERTICES + 1
    config = lux.RenderConfig(properties({
        "renderengine.type": engine, "renderengine.seed": seed + 1, "sampler.type": "SOBOL",
        "sampler.sobol.adaptive.strength": 0.0, "path.pathdepth.total": depth, "path.pathdepth.diffuse": depth,
        "path.pathdepth.glossy": depth, "path.pathdepth.specular": depth, "light.maxdepth": depth, "path.maxdepth": depth,
        "film.width": SIZE, "film.height": SIZE, "film.filter.type": "NONE", "film.imagepipelines.0.0.type": "NOP",
        "batch.haltspp": spp, **options,
    }), scene)
    session = lux.RenderSession(config)
    session.Start()
    while not session.HasDone():
        time.sleep(0.02)
        session.UpdateStats()
    session.Stop()
    pixels = np.zeros((SIZE, SIZE, 3), np.float32)
    session.GetFilm().GetOutputFloat(lux.FilmOutputType.RGB_IMAGEPIPELINE, pixels, 0)
    # Rows from below, and all of them a row too low: the last one is not known.
    return np.roll(pixels[::-1], -1, 0)


# Name: package, what renders.
PEERS = {
    "Mitsuba, 16 lanes": ("mitsuba", lambda *args: mitsuba(*args, 16)),
    "Mitsuba, 8 lanes": ("mitsuba", lambda *args: mitsuba(*args, 8)),
    "Mitsuba, 16 lanes, multijitter": ("mitsuba", lambda *args: mitsuba(*args, 16, "multijitter")),
    "Cycles": ("bpy", cycles),
    "LuxCore PATHCPU": ("pyluxcore", lambda *args: luxcore(*args, "PATHCPU")),
    "LuxCore BIDIRCPU": ("pyluxcore", lambda *args: luxcore(*args, "BIDIRCPU")),
}
OURS = {
    "opsr": ["--resolve", "raw"],
    "opsr, beta-0.001, one level": ["--opsr-table", "beta-0.001", "--resolve", "raw"],
}


def run(program, who, name, spp, seed, ours=OURS, scenes=SCENES, script=__file__):
    """CPU seconds of a render, and its picture: of ours with its options, of others by this script with --render."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        if who in ours:
            opsr(program, folder, scenes[name], spp, seed, *ours[who])
            picture = read(os.path.join(folder, "opsr.exr"))
        else:
            file = os.path.join(folder, "picture.npy")
            child = [sys.executable, script, "--render", who, name, str(spp), str(seed), file]
            subprocess.run(child, check=True, capture_output=True, text=True)
            picture = np.load(file)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, picture


def noise(pictures):
    """Relative variance of renders that differ in the seed, without the worst pixels."""
    pictures = np.array(pictures, float)
    relative = pictures.var(0, ddof=1) / (pictures.mean(0) ** 2 + 0.01)
    return np.sort(relative.mean(-1), None)[:-max(1, SIZE * SIZE // 1000)].mean()


def processor():
    try:
        lines = open("/proc/cpuinfo").read().split("\n")
    except OSError:
        return platform.processor()
    field = lambda key: next((line.split(":")[1].strip() for line in lines if line.startswith(key)), "")
    vector = "AVX-512" if "avx512f" in field("flags") else "AVX2" if "avx2" in field("flags") else "neither AVX2 nor AVX-512"
    return f"{field('model name')}, family {field('cpu family')}, model {field('model')}, {vector}"


def embree():
    """Rays of this crate beside Embree's, by the bench in Rust."""
    found = importlib.util.find_spec("embreex")
    pattern = os.path.join(os.path.dirname(found.origin) + ".libs", "libembree4*") if found else None
    library = os.environ.get("OPSR_EMBREE") or next(iter(glob.glob(pattern)) if pattern else iter([]), None)
    if library is None:
        print("missing: Embree (pip install embreex, or its path in OPSR_EMBREE)")
        return
    paths = [os.path.dirname(library), os.environ.get("LD_LIBRARY_PATH", "")]
    environment = dict(os.environ, OPSR_EMBREE=library, LD_LIBRARY_PATH=":".join(filter(None, paths)))
    subprocess.run(["cargo", "bench", "--bench", "traversal"], check=True, env=environment,
                   cwd=os.path.join(os.path.dirname(os.path.abspath(__file__)), "../.."))


def main():
    if sys.argv[1:2] == ["--render"]:
        who, name, spp, seed, file = sys.argv[2:]
        with tempfile.TemporaryDirectory() as folder:
            np.save(file, PEERS[who][1](folder, SCENES[name], int(spp), int(seed)))
        # Some packages crash when the interpreter takes them apart.
        os._exit(0)
    program = os.path.abspath(sys.argv[1] if len(sys.argv) > 1 else "target/release/opsr")
    spp, turns = int(os.environ.get("SPP", 64)), int(os.environ.get("TURNS", 5))
    print(processor())
    there = list(OURS)
    for who, (package, _) in PEERS.items():
        if importlib.util.find_spec(package) is None:
            print(f"missing: {who} (pip install {package})")
        else:
            there.append(who)
    for name in NAMES:
        start = {}
        for who in list(there):
            try:
                start[who] = min(run(program, who, name, 1, 0)[0] for _ in range(2))
            except subprocess.CalledProcessError as error:
                print(f"left out, it fails: {who}: {(error.stderr or '').strip().splitlines()[-1:]}")
                there.remove(who)
        seconds, pictures = {who: [] for who in there}, {who: [] for who in there}
        for turn in range(turns):
            for who in there:
                cost, picture = run(program, who, name, spp, turn)
                seconds[who].append(cost - start[who])
                pictures[who].append(picture)
        # CPU seconds for a noise of 1.
        to_noise = {who: noise(pictures[who]) * statistics.median(seconds[who]) for who in there}
        print(f"{name}, {SIZE} x {SIZE}, {spp} samples, medians of {turns} turns")
        for who in there:
            ratios = [a / b for a, b in zip(seconds[who], seconds["opsr"])]
            rate = (spp - 1) * SIZE * SIZE / 1e6 / statistics.median(seconds[who])
            print(f"  {who}: {rate:.3f} million paths per CPU-second, opsr {statistics.median(ratios):.2f} "
                  f"({min(ratios):.2f} to {max(ratios):.2f}) times as fast; to the same noise "
                  f"{to_noise[who] / to_noise['opsr']:.2f}; mean {np.mean(pictures[who]):.4f}", flush=True)
    embree()


if __name__ == "__main__":
    main()
