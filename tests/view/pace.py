"""Measures `opsr view` in a browser: the first picture, pictures and counts, FLIP of what is shown, a picture after a drag.

    python tests/view/pace.py target/release/opsr /usr/bin/chromium SCENE... [--size 640x480]
        [--shots FOLDER] [--references FOLDER] [--options WORDS]

Prints a row for each scene. FLIP is that of the page's canvas, enlarged without edges, over a render by `vcm` with 64 samples, which the
folder of references keeps. Needs the packages of page.py, for FLIP also numpy, OpenEXR and pillow. The window and the size of pictures
decide what is measured: a slow machine makes fewer pictures.
"""

import argparse
import base64
import io
import json
import pathlib
import subprocess
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
        page.wait_for_function("() => head !== null", timeout=120_000)
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
            "run => head.samples > 1 && head.run === state.run && head.run >= run", arg=run, timeout=120_000
        )
        last = page.evaluate("pictures.filter(p => p[3] === state.run).map(p => p[0])")
        after = f"{last[0] - released:.1f}, {last[-1] - released:.1f}"
        page.close()
    finally:
        viewer.kill()
    longest = max([b - a for a, b in zip([begun, *(p[0] for p in pictures)], [*(p[0] for p in pictures), begun + SECONDS])])
    samples = pictures[-1][2] if pictures else 0
    found = flips(opsr, chosen, scene, shown) if chosen.references else []
    found = ", ".join(f"{flip:.3f}" for flip in found)
    return (
        f"| {pathlib.Path(scene).stem} | {first:.2f} | {len(early) / 10:.1f} | {longest:.1f} "
        f"| {len(counts) / SECONDS:.1f} | {samples} | {after} | {found} |"
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
    print(f"| scene | first picture, s | pictures a second, first 10 s | longest wait, s | counts a second | samples after 15 s | after a drag, s | FLIP after {TIMES} s |")
    print("|---|---|---|---|---|---|---|---|")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chosen.chromium, args=FLAGS)
        for scene in chosen.scenes:
            print(measured(browser, chosen.opsr, chosen, scene), flush=True)
        browser.close()


if __name__ == "__main__":
    main()
