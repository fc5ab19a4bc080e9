"""Measures `opsr view` in a browser: the first picture, pictures and counts, FLIP of what is shown, a picture after a drag.

    python tests/view/pace.py target/release/opsr /usr/bin/chromium SCENE... [--size 640x480]
        [--shots FOLDER] [--references FOLDER] [--options WORDS]

Prints a row for each scene. `million` is a model of a million triangles that is made here, `turning` the figurines with a camera that turns for two
seconds. Animations are played at the end: seconds to the first frame, to all of them, and frames shown a second in the two loops after. FLIP is that of the page's canvas, enlarged without edges, over a render by `vcm` with 64 samples, which the
folder of references keeps. Needs the packages of page.py, for FLIP also numpy, OpenEXR and pillow. The window and the size of pictures
decide what is measured: a slow machine makes fewer pictures.
"""

import argparse
import base64
import io
import json
import math
import pathlib
import struct
import subprocess
import tempfile
import time

from playwright.sync_api import sync_playwright

FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
SECONDS = 15
TIMES = [0.5, 1, 2, 5, 10]

# Times, in seconds, of every picture and of every count of samples.
WATCH = """() => {
    window.pictures = [];
    window.counts = [];
    const now = () => performance.now() / 1000;
    new MutationObserver(() => window.pictures.push([now(), head.preview, head.samples, head.run]))
        .observe(stage, { attributes: true, attributeFilter: ["data-frames"] });
    let last = null;
    setInterval(() => {
        const key = state && `${state.run} ${state.course.samples}`;
        if (key !== last) window.counts.push(now());
        last = key;
    }, 10);
}"""


ROOT = pathlib.Path(__file__).resolve().parents[2]


def glb(gltf, data):
    """The bytes of a .glb file of one buffer."""
    gltf["buffers"] = [{"byteLength": len(data)}]
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    data += bytes(-len(data) % 4)
    head = struct.pack("<4s2I", b"glTF", 2, 28 + len(text) + len(data))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data


def accessor(gltf, data, numbers, kind, component=5126, **more):
    """Appends an accessor of an array; gives its index and all bytes."""
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[kind]
    gltf.setdefault("bufferViews", []).append({"buffer": 0, "byteOffset": len(data), "byteLength": numbers.nbytes})
    view = len(gltf["bufferViews"]) - 1
    of = {"bufferView": view, "componentType": component, "type": kind, "count": numbers.size // width, **more}
    gltf.setdefault("accessors", []).append(of)
    return len(gltf["accessors"]) - 1, data + numbers.tobytes()


def million(folder):
    """A ball with ripples of a million triangles, half metal."""
    import numpy

    columns, rows = 1000, 501
    u, v = numpy.meshgrid(numpy.linspace(0, 2 * math.pi, columns), numpy.linspace(0, math.pi, rows))
    r = 1 + 0.05 * numpy.sin(40 * u) * numpy.sin(20 * v)
    places = numpy.stack([r * numpy.sin(v) * numpy.cos(u), r * numpy.cos(v), r * numpy.sin(v) * numpy.sin(u)], -1).astype("<f4").reshape(-1, 3)
    at = numpy.arange(columns * rows, dtype="<u4").reshape(rows, columns)
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, :-1], at[1:, 1:]
    corners = numpy.stack([a, b, d, a, d, c], -1).astype("<u4")
    gltf = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}]}
    ends = {"min": places.min(0).tolist(), "max": places.max(0).tolist()}
    position, data = accessor(gltf, b"", places, "VEC3", **ends)
    indices, data = accessor(gltf, data, corners, "SCALAR", 5125)
    gltf["materials"] = [{"doubleSided": True, "pbrMetallicRoughness": {"baseColorFactor": [0.9, 0.6, 0.3, 1], "metallicFactor": 0.5, "roughnessFactor": 0.3}}]
    gltf["meshes"] = [{"primitives": [{"attributes": {"POSITION": position}, "indices": indices, "material": 0}]}]
    file = folder / "million.glb"
    file.write_bytes(glb(gltf, data))
    return file


def turning(folder):
    """The figurines, around which their camera turns by 40 degrees in two seconds."""
    import numpy

    raw = (ROOT / "training_scenes/figurines.glb").read_bytes()
    length = struct.unpack("<I", raw[12:16])[0]
    gltf, data = json.loads(raw[20 : 20 + length]), raw[28 + length :]
    camera = next(i for i, node in enumerate(gltf["nodes"]) if "camera" in node)
    rig = len(gltf["nodes"])
    gltf["nodes"].append({"children": [camera]})
    roots = gltf["scenes"][0]["nodes"]
    roots[roots.index(camera)] = rig
    times = numpy.array([0, 2], "<f4")
    angles = numpy.radians([0, 20])
    turns = numpy.array([[0, math.sin(x / 2), 0, math.cos(x / 2)] for x in 2 * angles], "<f4")
    keys, data = accessor(gltf, data, times, "SCALAR", min=[0], max=[2])
    values, data = accessor(gltf, data, turns, "VEC4")
    channel = {"sampler": 0, "target": {"node": rig, "path": "rotation"}}
    gltf["animations"] = [{"samplers": [{"input": keys, "output": values}], "channels": [channel]}]
    file = folder / "turning.glb"
    file.write_bytes(glb(gltf, data))
    return file


def played(page):
    """Seconds to the first frame, to all frames, and frames a second of the loops after them."""
    if not page.evaluate("facts.seconds"):
        return ""
    page.locator("#stage").focus()
    page.evaluate(
        """() => {
            window.frames_shown = [];
            new MutationObserver(() => onStage && window.frames_shown.push(performance.now() / 1000))
                .observe(stage, { attributes: true, attributeFilter: ["data-frame"] });
        }"""
    )
    begun = page.evaluate("performance.now() / 1000")
    page.keyboard.press("t")
    page.wait_for_function("() => reel && Object.keys(reel.stills).length === facts.frames", timeout=600_000)
    end = page.evaluate("performance.now() / 1000")
    loop = 2 * page.evaluate("facts.seconds")
    page.wait_for_timeout(1000 * loop)
    shown = page.evaluate("window.frames_shown")
    later = [t for t in shown if end < t < end + loop]
    page.wait_for_function("() => reel.stills.every((still) => still.round > 0)", timeout=600_000)
    better = page.evaluate("performance.now() / 1000")
    return f"{shown[0] - begun:.1f}, {end - begun:.1f}, {len(later) / loop:.0f}; round 2 after {better - begun:.0f}"


def linear(image, size):
    """Pixels of a PNG image as radiance, enlarged as a browser enlarges a canvas."""
    import numpy
    from PIL import Image

    image = Image.open(image).convert("RGB").resize(size, Image.BILINEAR)
    v = numpy.asarray(image, numpy.float32) / 255
    return numpy.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4).astype(numpy.float32)


def written(pixels, path):
    """An EXR file of these pixels."""
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    planes = {name: pixels[..., i].copy() for i, name in enumerate("RGB")}
    OpenEXR.File(header, planes).write(str(path))


def flips(opsr, chosen, scene, shown):
    """FLIP of each canvas over the picture of many samples."""
    size = tuple(map(int, chosen.size.split("x")))
    folder = pathlib.Path(chosen.references)
    reference = folder / f"{pathlib.Path(scene).stem}-{chosen.size}"
    png = reference.with_suffix(".png")
    if not png.exists():
        how = ["--integrator", "vcm", "--spp", "64", "--exposure", "0"]
        subprocess.run([opsr, "render", scene, "--size", chosen.size, *how, "-o", png], check=True, capture_output=True)
    written(linear(png, size), reference.with_suffix(".exr"))
    found = []
    for canvas in shown:
        written(linear(io.BytesIO(base64.b64decode(canvas.split(",")[1])), size), folder / "shown.exr")
        out = folder / "compared.json"
        files = [folder / "shown.exr", reference.with_suffix(".exr")]
        subprocess.run([opsr, "compare", *files, "--json", out], check=True, capture_output=True)
        metrics = json.loads(out.read_text())["entries"][0]["metrics"]
        found += [metric["value"] for metric in metrics if metric["name"] == "FLIP"]
    return found


def measured(browser, opsr, chosen, scene):
    """One scene: the row of the table, and screenshots."""
    command = [opsr, "view", scene, "--no-open", "--size", chosen.size, "--exposure", "0", *chosen.options.split()]
    shown = []
    viewer = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        clock = time.monotonic()
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(viewer.stdout.readline().strip())
        page.wait_for_function("() => typeof head !== 'undefined' && typeof state !== 'undefined'")
        page.evaluate(WATCH)
        page.wait_for_function("() => head !== null", timeout=600_000)
        first = time.monotonic() - clock
        begun = page.evaluate("performance.now() / 1000")
        for second in TIMES:
            page.wait_for_function("t => performance.now() / 1000 >= t", arg=begun + second, timeout=60_000)
            if chosen.references:
                shown.append(page.evaluate("canvases[0].toDataURL()"))
            if chosen.shots:
                name = f"{pathlib.Path(scene).stem}-{second}.png"
                page.screenshot(path=pathlib.Path(chosen.shots) / name)
        page.wait_for_function("t => performance.now() / 1000 >= t", arg=begun + SECONDS, timeout=60_000)
        pictures, counts = page.evaluate("[window.pictures, window.counts]")
        pictures = [p for p in pictures if begun < p[0] < begun + SECONDS]
        counts = [c for c in counts if begun < c < begun + SECONDS]
        early = [p for p in pictures if p[0] < begun + 10]

        # A drag, the first picture of its end, and the first of the whole frame.
        box = page.locator("#stage").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + 0.6 * box["height"]
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 80, y + 10, steps=10)
        page.mouse.up()
        run, released = page.evaluate("[state.run, performance.now() / 1000]")
        page.wait_for_function(
            "run => head.samples > 1 && head.run === state.run && head.run >= run", arg=run, timeout=600_000
        )
        last = page.evaluate("pictures.filter(p => p[3] === state.run).map(p => p[0])")
        after = f"{last[0] - released:.1f}, {last[-1] - released:.1f}"
        play = played(page)
        page.close()
    finally:
        viewer.kill()
    longest = max([b - a for a, b in zip([begun, *(p[0] for p in pictures)], [*(p[0] for p in pictures), begun + SECONDS])])
    samples = pictures[-1][2] if pictures else 0
    found = flips(opsr, chosen, scene, shown) if chosen.references else []
    found = ", ".join(f"{flip:.3f}" for flip in found)
    return (
        f"| {pathlib.Path(scene).stem} | {first:.2f} | {len(early) / 10:.1f} | {longest:.1f} "
        f"| {len(counts) / SECONDS:.1f} | {samples} | {after} | {play} | {found} |"
    )


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("opsr")
    parser.add_argument("chromium")
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--shots")
    parser.add_argument("--references")
    parser.add_argument("--options", default="", help="options of the viewer")
    chosen = parser.parse_args()
    print(f"| scene | first picture, s | pictures a second, first 10 s | longest wait, s | counts a second | samples after 15 s | after a drag, s | played | FLIP after {TIMES} s |")
    print("|---|---|---|---|---|---|---|---|---|")
    with sync_playwright() as play, tempfile.TemporaryDirectory() as folder:
        browser = play.chromium.launch(executable_path=chosen.chromium, args=FLAGS)
        made = {"million": million, "turning": turning}
        for scene in chosen.scenes:
            scene = made[scene](pathlib.Path(folder)) if scene in made else scene
            print(measured(browser, chosen.opsr, chosen, scene), flush=True)
        browser.close()


if __name__ == "__main__":
    main()
