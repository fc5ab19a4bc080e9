"""Measures the pace of `opsr view` in a browser: the first picture, pictures and counts, a picture after a drag.

    python tests/view/pace.py target/release/opsr /usr/bin/chromium SCENE... [--size 640x480] [--shots FOLDER]

Prints a row for each scene. Needs the packages of page.py. The window and the size of pictures decide what is measured: a slow machine
makes fewer pictures.
"""

import argparse
import pathlib
import subprocess
import time

from playwright.sync_api import sync_playwright

FLAGS = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
SECONDS = 15

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


def measured(browser, opsr, chosen, scene):
    """One scene: the row of the table, and screenshots."""
    command = [opsr, "view", scene, "--no-open", "--size", chosen.size]
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
        for second in [0.5, 2, 10]:
            page.wait_for_function("t => performance.now() / 1000 >= t", arg=begun + second, timeout=60_000)
            if chosen.shots:
                name = f"{pathlib.Path(scene).stem}-{second}.png"
                page.screenshot(path=pathlib.Path(chosen.shots) / name)
        page.wait_for_function("t => performance.now() / 1000 >= t", arg=begun + SECONDS, timeout=60_000)
        pictures, counts = page.evaluate("[window.pictures, window.counts]")
        pictures = [p for p in pictures if p[2] > 0 and p[0] < begun + SECONDS]
        counts = [c for c in counts if begun < c < begun + SECONDS]
        early = [p for p in pictures if p[0] < begun + 10]

        # A drag, and the first picture of more than one sample of every pixel after it.
        box = page.locator("#stage").bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + 0.6 * box["height"]
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + 80, y + 10, steps=10)
        page.mouse.up()
        released = time.monotonic()
        run = page.evaluate("state.run")
        page.wait_for_function(
            "run => head.samples > 1 && head.run === state.run && head.run >= run", arg=run, timeout=120_000
        )
        after = time.monotonic() - released
        page.close()
    finally:
        viewer.kill()
    longest = max([b - a for a, b in zip([begun, *(p[0] for p in pictures)], [*(p[0] for p in pictures), begun + SECONDS])])
    samples = pictures[-1][2] if pictures else 0
    return (
        f"| {pathlib.Path(scene).stem} | {first:.2f} | {len(early) / 10:.1f} | {longest:.1f} "
        f"| {len(counts) / SECONDS:.1f} | {samples} | {after:.1f} |"
    )


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("opsr")
    parser.add_argument("chromium")
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--shots")
    chosen = parser.parse_args()
    print("| scene | first picture, s | pictures a second, first 10 s | longest wait, s | counts a second | samples after 15 s | after a drag, s |")
    print("|---|---|---|---|---|---|---|")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=chosen.chromium, args=FLAGS)
        for scene in chosen.scenes:
            print(measured(browser, chosen.opsr, chosen, scene), flush=True)
        browser.close()


if __name__ == "__main__":
    main()
