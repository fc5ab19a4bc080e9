"""Drives the page of `opsr view` in a browser as a person would, and compares pictures.

    python tests/view/page.py target/release/opsr /usr/bin/chromium [FOLDER FOR SCREENSHOTS]

Needs the packages playwright (without its browsers), numpy and pillow. Works on a scene of this repository, without a network.
"""

import base64
import io
import json
import pathlib
import re
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile
import time

import numpy
from PIL import Image
from playwright.sync_api import sync_playwright

ROOT = pathlib.Path(__file__).resolve().parents[2]
FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
SPP = 16


def picture(page):
    """The pixels that the page shows, height x width x 3."""
    size, values = page.evaluate(
        """() => {
            const canvas = document.getElementById("picture");
            const data = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            return [[canvas.height, canvas.width], Array.from(data.data)];
        }"""
    )
    return numpy.array(values, numpy.uint8).reshape(*size, 4)[:, :, :3]


def done(page):
    """Waits until the render has its samples and all of them are shown."""
    page.wait_for_function(
        """spp => {
            const of = document.getElementById("stage").dataset;
            return of.phase === "done" && Number(of.samples) === spp && head.run === state.run;
        }""",
        arg=SPP,
        timeout=60_000,
    )


def another(page, act):
    """Does something that begins a new render, and waits for its end."""
    run = page.evaluate("state.run")
    act()
    page.wait_for_function("run => state.run > run", arg=run, timeout=10_000)
    done(page)


def brightness(pixels):
    return float(pixels.astype(float).mean())


def drive(page, opsr, scene, folder):
    done(page)
    first = picture(page)
    assert first.std() > 10, "the picture is one colour"
    shown = "document.querySelector('#integrator').selectedOptions[0].textContent"
    assert page.evaluate(shown) == "auto"

    # Turn by mouse, by keys, and back.
    box = page.locator("#stage").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def drag():
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 40, y + 10, steps=6)
        page.mouse.up()
        page.wait_for_timeout(600)

    another(page, drag)
    turned = picture(page)
    assert numpy.abs(turned.astype(int) - first).mean() > 3, "the camera does not turn"
    page.locator("#stage").focus()
    another(page, lambda: page.keyboard.press("ArrowLeft"))
    assert (picture(page) != turned).any(), "keys do not turn the camera"
    another(page, lambda: page.keyboard.press("h"))
    assert (picture(page) == first).all(), "the camera of the file makes another picture"
    another(page, lambda: page.keyboard.press("ArrowRight"))
    moves(page)

    # Another integrator shows the same light.
    before = brightness(picture(page))
    another(page, lambda: page.select_option("#integrator", "bdpt"))
    assert page.evaluate("state.integrator") == "bdpt"
    assert abs(brightness(picture(page)) / before - 1) < 0.1, "the integrators disagree"
    another(page, lambda: page.select_option("#integrator", ""))
    another(page, lambda: page.select_option("#roughening", "beta-0.05"))
    assert page.evaluate(shown) == "path"

    # An overlay, and back.
    plain = picture(page)
    page.locator("#stage").focus()
    page.keyboard.press("2")
    page.wait_for_function("() => head.legend && head.legend.what.includes('error')", timeout=10_000)
    assert page.locator("#legend").is_visible()
    assert (picture(page) != plain).any()
    page.keyboard.press("1")
    page.wait_for_function("() => head.legend === null", timeout=10_000)
    assert (picture(page) == plain).all()

    # A pixel: value and paths, the brightest first.
    page.mouse.click(x, y + 40)
    page.wait_for_selector("#why li", state="attached", timeout=10_000)
    values = page.locator("#pointer")
    assert "radiance" in values.inner_text() and "object" in values.inner_text()
    assert values.evaluate("e => e.scrollHeight <= e.clientHeight && e.scrollWidth <= e.clientWidth"), "a value is cut off"
    assert page.evaluate("document.getElementById('why-box').open")
    page.locator("#why").scroll_into_view_if_needed(timeout=2_000)
    # The brightest path is drawn from the pixel that was clicked.
    points = page.locator("#path polyline").first.get_attribute("points").split()
    frame, pixel = page.evaluate("[head.frame, marked]")
    apart = [abs(float(at) / 1000 * n - 0.5 - x) for at, n, x in zip(points[0].split(","), frame, pixel)]
    assert max(apart) < 1, f"the path begins {apart} pixels beside the one that was clicked"
    # Each path has a line, and a dot for each of its vertices, twice.
    dots = page.locator("#path .dot").count()
    assert dots == 2 * len(points), f"{dots} dots of {points}"
    page.locator("#why li summary").first.click()
    assert "throughput" in page.locator("#why li table").first.inner_text()

    # Save: the file is what is shown, and so is a render of the saved view.
    with page.expect_download() as download:
        page.locator("#save-png").click()
    saved = numpy.asarray(Image.open(download.value.path()).convert("RGB"))
    assert (saved == plain).all(), "the saved picture is another one"
    with page.expect_download() as download:
        page.locator("#save-look").click()
    look = folder / "view.json"
    download.value.save_as(look)
    assert len(json.loads(look.read_text())["position"]) == 3
    out = folder / "out.png"
    options = ["--size", "160x120", "--spp", str(SPP), "--opsr-table", "beta-0.05"]
    command = [opsr, "render", scene, "--camera", look, *options, "-o", out]
    subprocess.run(command, check=True, capture_output=True)
    rendered = numpy.asarray(Image.open(out).convert("RGB"))
    assert (rendered == plain).all(), "a render of the saved view is another picture"

    # The command of the page makes its picture, from negative places and of a file with spaces in its name.
    page.locator("#stage").focus()
    another(page, lambda: page.keyboard.press("Shift+X"))
    assert page.evaluate("Math.min(...look.position)") < 0
    shown = picture(page)
    words = shlex.split(page.evaluate("document.getElementById('command').textContent"))
    assert words[0] == "opsr", words
    again = folder / "again.png"
    subprocess.run([opsr, *words[1:], "--spp", str(SPP), "-o", again], check=True, capture_output=True)
    rendered = numpy.asarray(Image.open(again).convert("RGB"))
    assert (rendered == shown).all(), "the command of the page makes another picture"

    # Two pictures beside each other.
    page.locator("summary", has_text="Compare").click()
    page.select_option("#compare", "plain")
    page.wait_for_function("() => !document.getElementById('other').hidden", timeout=20_000)
    assert page.locator("#divider").is_visible()
    page.select_option("#compare", "")
    page.wait_for_function("() => document.getElementById('other').hidden", timeout=20_000)

    # Radius and distance of the lens are one option.
    page.evaluate("document.getElementById('aperture').closest('details').open = true")
    page.fill("#focus", "2")
    page.press("#focus", "Enter")
    page.wait_for_function("() => document.getElementById('toast').textContent.includes('radius')")
    page.fill("#aperture", "0.05")
    page.press("#aperture", "Enter")
    page.wait_for_function("() => state.options.lens === '0.05,2' && state.command.includes('--lens 0.05,2')", timeout=20_000)
    page.fill("#aperture", "")
    page.press("#aperture", "Enter")
    page.fill("#focus", "")
    page.press("#focus", "Enter")
    page.wait_for_function("() => state.options.lens === undefined", timeout=20_000)
    page.evaluate("document.activeElement.blur()")

    # Full screen, and back.
    page.keyboard.press("m")
    page.wait_for_function("() => document.fullscreenElement?.id === 'viewport'", timeout=5_000)
    page.keyboard.press("m")
    page.wait_for_function("() => document.fullscreenElement === null", timeout=5_000)

    # A refusal is a message, not an end.
    page.evaluate("set({ options: { integrator: 'magic' } })")
    page.wait_for_function("() => document.getElementById('toast').textContent.includes('expected')")
    page.keyboard.press("?")
    assert page.locator("#help").is_visible()
    page.keyboard.press("Escape")


def moves(page):
    """The camera turns about what is under the pointer, frames objects, and looks along axes."""
    surface = """() => asked("pixel", [Math.floor(0.3 * head.frame[0]), Math.floor(0.7 * head.frame[1])])"""
    pivot = page.evaluate(surface)["surface"]["position"]
    before = page.evaluate("p => projected(p)", pivot)
    box = page.evaluate("() => { const b = stage.getBoundingClientRect(), at = fitted(); return [b.left + at.x, b.top + at.y, at.w, at.h]; }")
    x, y = box[0] + (0.3 + 0.5 / 160) * box[2], box[1] + (0.7 + 0.5 / 120) * box[3]

    def drag():
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 60, y + 20, steps=6)
        page.mouse.up()
        page.wait_for_timeout(600)

    target = page.evaluate("look.target")
    another(page, drag)
    after = page.evaluate("p => projected(p)", pivot)
    assert max(abs(a - b) for a, b in zip(before, after)) < 2e-3, f"the point turned from {before} to {after}"
    assert page.evaluate("look.target") != target

    # The object under the pointer fills the picture, and so does the scene.
    page.mouse.move(x, y)
    page.mouse.move(x + 1, y)
    page.locator("#stage").focus()
    bounds = page.evaluate("asked('object', hovered)")["bounds"]
    corners = """([low, high]) => Array.from({ length: 8 }, (_, i) => projected([0, 1, 2].map((k) => ((i >> k) & 1 ? high : low)[k])))"""
    scene = page.evaluate("facts.bounds")
    for key, box in [(".", bounds), ("Home", scene)]:
        another(page, lambda: page.keyboard.press(key))
        seen = page.evaluate(corners, box)
        assert all(p and 0 <= p[0] <= 1 and 0 <= p[1] <= 1 for p in seen), f"{key}: {seen}"
        wide = [max(p[k] for p in seen) - min(p[k] for p in seen) for k in range(2)]
        assert max(wide) > 0.4, f"{key}: {wide}"

    # Along the axes, by keys and by the cross.
    back = "(() => unit(add(look.position, look.target, -1)).map(x => Math.round(1000 * x) / 1000))()"
    for key, way in [("x", [1, 0, 0]), ("Shift+X", [-1, 0, 0]), ("y", [0, 1, 0]), ("z", [0, 0, 1])]:
        another(page, lambda: page.keyboard.press(key))
        assert page.evaluate(back) == way, f"{key}: {page.evaluate(back)}"
    another(page, lambda: page.locator("#axes [data-axis='0'] circle").click())
    assert page.evaluate(back) == [1, 0, 0]
    page.locator("#stage").focus()
    another(page, lambda: page.keyboard.press("h"))
    another(page, lambda: page.keyboard.press("ArrowRight"))


def many(browser, address):
    """More pages than a browser opens connections: each shows the picture, and the last is heard at once."""
    context = browser.new_context(viewport={"width": 600, "height": 400})
    pages = [context.new_page() for _ in range(9)]
    for page in pages:
        page.goto(address)
    for page in pages:
        done(page)
    clock = time.monotonic()
    pages[-1].evaluate("set({ options: { exposure: 1.5 } })")
    for page in pages:
        page.wait_for_function("() => Number(state.options.exposure) === 1.5", timeout=10_000)
    assert time.monotonic() - clock < 5, "pages wait for each other"
    pages[-1].evaluate("set({ options: { exposure: null } })")
    # Options that exclude each other: the one that was there before is left out, and the page says so.
    pages[0].evaluate("set({ options: { table: 0.3 } })")
    pages[0].evaluate("set({ options: { integrator: 'sppm' } })")
    pages[0].wait_for_function("() => document.getElementById('notes').textContent.includes('--opsr-table')", timeout=10_000)
    pages[0].evaluate("set({ options: { integrator: null, table: null } })")
    context.close()


def moving(folder):
    """A file of a square that moves for two seconds, red or green by its variant."""
    numbers = lambda *values: b"".join(struct.pack("<f", x) for x in values)
    parts = [
        (numbers(-1, 0, 0, 1, 0, 0, 1, 2, 0, -1, 2, 0), 5126, "VEC3", 4, {"min": [-1, 0, 0], "max": [1, 2, 0]}),
        (struct.pack("<6H", 0, 1, 2, 0, 2, 3), 5123, "SCALAR", 6, {}),
        (numbers(0, 2), 5126, "SCALAR", 2, {"min": [0], "max": [2]}),
        (numbers(0, 0, 0, 3, 0, 0), 5126, "VEC3", 2, {}),
    ]
    views, accessors, data = [], [], b""
    for i, (raw, component, kind, count, ends) in enumerate(parts):
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(raw)})
        accessors.append({"bufferView": i, "componentType": component, "type": kind, "count": count, **ends})
        data += raw
    color = lambda *rgb: {"doubleSided": True, "pbrMetallicRoughness": {"baseColorFactor": [*rgb, 1], "metallicFactor": 0}}
    variants = {"mappings": [{"material": i, "variants": [i]} for i in range(2)]}
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "material": 0, "extensions": {"KHR_materials_variants": variants}}
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    gltf = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_variants"],
        "extensions": {"KHR_materials_variants": {"variants": [{"name": "red"}, {"name": "green"}]}},
        "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"name": "square", "primitives": [primitive]}],
        "materials": [color(0.8, 0.05, 0.05), color(0.05, 0.8, 0.05)],
        "animations": [{
            "samplers": [{"input": 2, "output": 3}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
        }],
        "accessors": accessors, "bufferViews": views, "buffers": [{"uri": uri, "byteLength": len(data)}],
    }
    file = folder / "moving.gltf"
    file.write_text(json.dumps(gltf))
    return file


# Columns of a picture that show the square, in the mean.
MIDDLE = """() => {
    const { width, height } = canvases[0], data = canvases[0].getContext("2d").getImageData(0, 0, width, height).data;
    let [sum, all] = [0, 0];
    for (let i = 0; i < width * height; i++) {
        const red = Math.max(0, data[4 * i] - data[4 * i + 1]);
        [sum, all] = [sum + (red * ((i % width) + 0.5)) / width, all + red];
    }
    return sum / all;
}"""


def runs(page, opsr, folder):
    """The animations run from the moment on, at the pace of the file once all frames are there, and stop at the one that is shown."""
    page.locator("#stage").focus()
    page.keyboard.press("t")
    page.wait_for_function("() => stage.dataset.frame !== undefined && state.phase === 'playing'", timeout=20_000)
    assert page.locator("#play").get_attribute("aria-pressed") == "true"
    page.wait_for_function("() => Object.keys(reel.stills).length === facts.frames", timeout=60_000)
    assert page.evaluate("facts.frames") == 48
    page.wait_for_timeout(200)
    page.evaluate(
        """() => {
            window.shown = [];
            const middle = %s;
            new MutationObserver(() => onStage && window.shown.push([performance.now() / 1000, onStage.frame, middle()]))
                .observe(stage, { attributes: true, attributeFilter: ["data-frame"] });
        }"""
        % MIDDLE
    )
    page.wait_for_timeout(3_000)
    shown = page.evaluate("window.shown")
    times, frames, middles = zip(*[(t, f, m) for t, f, m in shown if t < shown[0][0] + 2])
    assert len(set(frames)) > 30, f"{len(set(frames))} of 48 frames in a round of two seconds"
    assert len({f for _, f, _ in shown}) > 40
    # A frame is that of the clock.
    off = [((f - frames[0]) - 24 * (t - times[0]) + 24) % 48 - 24 for t, f in zip(times, frames)]
    assert max(map(abs, off)) < 3, f"{off}"
    # At the end it leaves the picture.
    order = [m for f, m in sorted(zip(frames, middles)) if f < 36]
    assert order[-1] - order[0] > 0.2 and min(b - a for a, b in zip(order, order[1:])) > -0.02, f"the square is at {order}"
    # Better frames take the place of the first, and the command is that of the frame.
    page.wait_for_function("() => reel.stills.some((still) => still.round > 1)", timeout=60_000)
    frame, command = page.evaluate("[onStage.frame, document.getElementById('command').textContent]")
    assert f"--at {frame}@24 " in " ".join(shlex.split(command)), f"{frame}: {command}"
    # What the pointer meets is not known of frames that run.
    page.mouse.click(200, 200)
    assert page.evaluate("marked") is None
    # Exposure shows all frames anew.
    change = page.evaluate("reel.change")
    page.evaluate("set({ options: { exposure: 2 } })")
    page.wait_for_function("change => reel.change >= change + facts.frames", arg=change, timeout=20_000)
    page.evaluate("set({ options: { exposure: null } })")
    # A turn of the camera makes new frames, and the animations run on.
    film = page.evaluate("reel.film")
    page.locator("#stage").focus()
    page.keyboard.press("ArrowLeft")
    page.wait_for_function("film => reel.film !== film", arg=film, timeout=20_000)
    assert page.evaluate("Boolean(playing) && state.playing")
    another(page, lambda: page.keyboard.press("t"))
    assert page.locator("#play").get_attribute("aria-pressed") == "false" and page.evaluate("onStage === null")
    at = page.evaluate("state.options.at")
    page.wait_for_timeout(300)
    assert re.fullmatch(r"[0-9]+@24", at) and page.evaluate("state.options.at") == at, f"{at}: it plays on"
    words = shlex.split(page.evaluate("document.getElementById('command').textContent"))
    again = folder / "moment.png"
    subprocess.run([opsr, *words[1:], "--spp", str(SPP), "-o", again], check=True, capture_output=True)
    assert words[words.index("--at") + 1] == at
    assert (numpy.asarray(Image.open(again).convert("RGB")) == picture(page)).all(), "the command makes another picture"
    another(page, lambda: page.keyboard.press("h"))
    # A saved file is that of the frame at rest.
    page.locator("#play").click()
    page.wait_for_function("() => onStage !== null", timeout=20_000)
    with page.expect_download() as download:
        page.locator("#save-png").click()
    assert page.evaluate("playing") is None
    done(page)
    saved = numpy.asarray(Image.open(download.value.path()).convert("RGB"))
    assert saved.shape == picture(page).shape


def played(browser, opsr, folder):
    """A file with an animation and variants: its time line, play, and the choice."""
    command = [opsr, "view", moving(folder), "--no-open", "--size", "80x60", "--spp", str(SPP)]
    viewer = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        page = browser.new_page(viewport={"width": 900, "height": 600})
        page.goto(viewer.stdout.readline().strip())
        page.wait_for_function("() => typeof head !== 'undefined' && head !== null", timeout=30_000)
        done(page)
        rest = picture(page)
        assert page.locator("#time").is_visible() and page.locator("#seconds").inner_text() == "at rest"
        looks(page, "a file with animations", 900, None)
        another(page, lambda: page.locator("#moment").fill("24"))
        assert page.evaluate("state.options.at") == "24@24"
        assert page.get_attribute("#moment", "aria-valuetext") == page.locator("#seconds").inner_text() == "1.00 of 2.00 s"
        moved = picture(page)
        assert numpy.abs(moved.astype(int) - rest).mean() > 3, "the square does not move"
        red = lambda pixels: float((pixels[..., 0].astype(int) - pixels[..., 1]).sum())
        another(page, lambda: page.select_option("#variant", "green"))
        assert red(moved) > 0 > red(picture(page)), "the variant changes no colour"
        another(page, lambda: page.select_option("#variant", ""))
        # The slider goes frame by frame.
        another(page, lambda: page.locator("#moment").press("ArrowRight"))
        assert page.evaluate("state.options.at") == "25@24"
        runs(page, opsr, folder)
        another(page, lambda: page.locator("#rest").click())
        # The camera of a file without one frames what is there at its moment.
        page.locator("#stage").focus()
        another(page, lambda: page.keyboard.press("h"))
        assert (picture(page) == rest).all(), "rest is another picture"
        page.close()
    finally:
        viewer.send_signal(2)
        assert viewer.wait(10) == 0


# Drops files, as names and bytes in base64, onto the page.
DROP = """(files) => {
    const all = new DataTransfer();
    for (const [name, bytes] of files) all.items.add(new File([Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0))], name));
    for (const kind of ["dragover", "drop"]) stage.dispatchEvent(new DragEvent(kind, { dataTransfer: all, bubbles: true, cancelable: true }));
}"""


def opened(browser, opsr, folder):
    """Files that are dropped onto the page, or chosen, are opened; what cannot be read leaves the picture as it is."""
    first = folder / "first.glb"
    shutil.copy(ROOT / "training_scenes/cornell_caustics.glb", first)
    command = [opsr, "view", first, "--no-open", "--size", "80x60", "--spp", str(SPP)]
    viewer = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    pages = []
    try:
        address = viewer.stdout.readline().strip()
        for _ in range(2):
            pages.append(browser.new_page(viewport={"width": 900, "height": 600}))
            pages[-1].goto(address)
            pages[-1].wait_for_function("() => typeof head !== 'undefined' && head !== null", timeout=30_000)
        page, beside = pages
        done(page)
        before = picture(page)

        # A scene of two files, of which one is forgotten at first.
        scene = json.loads(moving(folder).read_text())
        data = base64.b64decode(scene["buffers"][0]["uri"].split(",")[1])
        scene["buffers"][0]["uri"] = "square.bin"
        files = [["square.gltf", json.dumps(scene).encode()], ["square.bin", data]]
        files = [[name, base64.b64encode(raw).decode()] for name, raw in files]
        says = lambda text: page.wait_for_function("t => document.getElementById('toast').textContent.includes(t)", arg=text, timeout=20_000)
        run = page.evaluate("state.run")
        page.evaluate(DROP, files[:1])
        says("square.bin")
        assert "dropped along" in page.locator("#toast").inner_text() and "/tmp" not in page.locator("#toast").inner_text()
        page.evaluate(DROP, files[1:])
        says("expected one scene")
        assert page.evaluate("state.run") == run and (picture(page) == before).all()
        another(page, lambda: page.evaluate(DROP, files))
        says("Opened")
        assert (picture(page) != before).any() and page.locator("#title").inner_text() == "square"
        # Its time line is there, on every page; the command says that it cannot know the place of the file.
        for one in pages:
            one.wait_for_function("() => facts.title === 'square' && !document.getElementById('time').hidden", timeout=10_000)
        assert shlex.split(page.evaluate("state.command"))[2] == "square.gltf"
        assert "put its own path into the command" in page.locator("#notes").inner_text()
        another(page, lambda: page.locator("#moment").fill("24"))

        # The same by keyboard: the button and its key open the browser's list of files.
        for act in [lambda: page.locator("#open").press("Enter"), lambda: page.locator("#stage").press("o")]:
            with page.expect_file_chooser() as chooser:
                act()
        another(page, lambda: chooser.value.set_files(str(first)))
        assert (picture(page) == before).all(), "the same file is another picture"
        assert page.evaluate("facts.seconds") == 0 and page.locator("#time").is_hidden()
        kept = pathlib.Path(page.evaluate("state.scene"))
        assert kept.exists() and kept.name == "first.glb"
    finally:
        for page in pages:
            page.close()
        viewer.send_signal(2)
        assert viewer.wait(10) == 0
    assert not kept.parent.parent.exists(), f"{kept} stays"


def broken(browser, opsr, folder, shots):
    """A scene that cannot be read is a message on the page, in both widths."""
    scene = folder / "broken.glb"
    scene.write_bytes(b"glTF nothing")
    viewer = subprocess.Popen([opsr, "view", scene, "--no-open"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        address = viewer.stdout.readline().strip()
        for width in [390, 1280]:
            page = browser.new_page(viewport={"width": width, "height": 700})
            page.goto(address)
            page.wait_for_selector("#fault:not([hidden])", timeout=10_000)
            assert "broken.glb" in page.locator("#fault").inner_text()
            if shots:
                page.screenshot(path=shots / f"broken-{width}.png")
            page.close()
    finally:
        viewer.send_signal(2)
        assert viewer.wait(10) == 0


# Texts with less than 4.5 times the luminance of what is behind them, or the inverse (WCAG 2.2, 1.4.3 AA).
CONTRAST = """() => {
    const numbers = (text) => text.match(/[0-9.]+/g).map(Number);
    const linear = (x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
    const luminance = ([r, g, b]) => 0.2126 * linear(r / 255) + 0.7152 * linear(g / 255) + 0.0722 * linear(b / 255);
    const behind = (e) => {
        for (; e; e = e.parentElement) {
            const color = numbers(getComputedStyle(e).backgroundColor);
            if (color.length === 3 || color[3] > 0) return color;
        }
        return [255, 255, 255];
    };
    const texts = [...document.querySelectorAll("body *")].filter(
        (e) => e.checkVisibility({ opacityProperty: true }) && [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim()));
    return texts.flatMap((e) => {
        const style = getComputedStyle(e), ground = behind(e);
        const [a, b] = [luminance(numbers(e.closest("svg") ? style.fill : style.color)), luminance(ground)];
        const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
        const on = e.closest("#axes") || (ground.length > 3 && ground[3] < 1);
        return ratio < 4.5 && !on ? [`${e.tagName} ${e.textContent.trim().slice(0, 30)} ${ratio.toFixed(2)}`] : [];
    });
}"""
# Everything that Tab should reach.
REACHABLE = """() => {
    window.everything = () => [...document.querySelectorAll("button, a[href], input, select, summary, [tabindex='0']")]
        .filter((e) => e.checkVisibility() && !e.disabled && !e.closest("dialog:not([open])"));
    document.activeElement.blur();
    everything().forEach((e) => (e.reached = false));
    return everything().map((e) => e.outerHTML);
}"""


def looks(page, name, width, shots):
    """Nothing is wider than the page, and every control has a name."""
    over = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert over <= 0, f"{name}: {over} pixels too wide"
    unnamed = page.evaluate(
        """() => [...document.querySelectorAll("button, input, select, a")]
            .filter(e => !(e.labels?.[0]?.textContent || e.getAttribute("aria-label") || e.textContent || e.title).trim())
            .map(e => e.outerHTML)"""
    )
    assert not unnamed, f"{name}: {unnamed}"
    # The picture is as wide as a narrow page.
    if width < 700:
        seen = page.evaluate("fitted().w")
        assert seen > 0.97 * width, f"{name}: {seen} of {width} pixels"
    faint = page.evaluate(CONTRAST)
    assert not faint, f"{name}: {faint}"
    missed = page.evaluate(REACHABLE)
    for _ in range(len(missed) + 8):
        page.keyboard.press("Tab")
        page.evaluate("document.activeElement.reached = true")
    missed = page.evaluate("everything().filter(e => !e.reached).map(e => e.outerHTML)")
    assert not missed, f"{name}: Tab does not reach {missed}"
    if shots:
        page.screenshot(path=shots / f"{name}.png", full_page=width < 700)


def main():
    opsr, chromium = sys.argv[1:3]
    shots = pathlib.Path(sys.argv[3]) if len(sys.argv) > 3 else None
    kept = tempfile.TemporaryDirectory()
    scene = pathlib.Path(kept.name) / "a box with caustics.glb"
    shutil.copy(ROOT / "training_scenes/cornell_caustics.glb", scene)
    command = [opsr, "view", scene, "--no-open", "--size", "160x120", "--spp", str(SPP)]
    viewer = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        address = viewer.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[0-9a-f]{32}/", address), address
        with sync_playwright() as play, tempfile.TemporaryDirectory() as folder:
            browser = play.chromium.launch(executable_path=chromium, args=FLAGS)
            troubles = []
            for name, width, height, scheme in [
                ("wide-light", 1280, 800, "light"),
                ("wide-dark", 1280, 800, "dark"),
                ("phone-light", 390, 844, "light"),
                ("phone-dark", 390, 844, "dark"),
            ]:
                size = {"width": width, "height": height}
                context = browser.new_context(viewport=size, color_scheme=scheme)
                page = context.new_page()
                page.on("console", lambda m: m.type == "error" and "400" not in m.text and troubles.append(m.text))
                page.on("pageerror", lambda e: troubles.append(str(e)))
                page.on("request", lambda r: r.url.startswith((address, "blob:", "data:")) or troubles.append(r.url))
                page.goto(address)
                page.wait_for_timeout(500)
                page.wait_for_function("() => typeof head !== 'undefined' && head !== null", timeout=30_000)
                if name == "wide-light":
                    drive(page, opsr, scene, pathlib.Path(folder))
                done(page)
                looks(page, name, width, shots)
                context.close()
            many(browser, address)
            played(browser, opsr, pathlib.Path(folder))
            opened(browser, opsr, pathlib.Path(folder))
            broken(browser, opsr, pathlib.Path(folder), shots)
            browser.close()
            assert not troubles, troubles
        viewer.send_signal(2)
        assert viewer.wait(10) == 0, "Ctrl-C does not end the viewer"
    finally:
        viewer.kill()
    print("1 passed: the page of opsr view")


if __name__ == "__main__":
    main()
