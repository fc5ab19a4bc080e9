#!/usr/bin/env python3
"""The error that renders state, over the true one: a line for each scene, method and number of samples.

usage: average_error.py SCENE ...   (OPSR is the program, by default target/release/opsr)

The reference is raw vcm with 2,048 samples. Judge only cases whose true error is three times that of the reference: that of raw vcm
with 256 samples over the root of 8.
"""
import json, os, subprocess, sys, tempfile

PROGRAM = os.environ.get("OPSR", "target/release/opsr")
METHODS = {
    "path": ["--integrator", "path"],
    "levels": ["--integrator", "path", "--opsr-table", "beta-0.001"],
    "default": [],
    "raw path": ["--integrator", "path", "--resolve", "raw"],
    "raw vcm": ["--integrator", "vcm", "--resolve", "raw"],
}


def render(scene, picture, samples, seed, options):
    stats = picture + ".json"
    command = [PROGRAM, "render", scene, "--size", "48x36", "--spp", str(samples), "--seed", str(seed), "--progress", "none"]
    subprocess.run([*command, "--stats", stats, "-o", picture, *options], check=True, capture_output=True)
    with open(stats) as file:
        return json.load(file)["mean_relative_error"]


def measured(picture, reference):
    report = picture + ".compare.json"
    subprocess.run([PROGRAM, "compare", picture, reference, "--json", report], check=True, capture_output=True)
    with open(report) as file:
        metrics = json.load(file)["entries"][0]["metrics"]
    return next(m["value"] for m in metrics if m["name"] == "mean relative error")


for scene in sys.argv[1:] or sys.exit(__doc__):
    with tempfile.TemporaryDirectory() as folder:
        reference, picture = (os.path.join(folder, name) for name in ("reference.exr", "picture.exr"))
        render(scene, reference, 2048, 77, METHODS["raw vcm"])
        for method, options in METHODS.items():
            for samples in (8, 16, 64, 256):
                stated = render(scene, picture, samples, 13, options)
                true = measured(picture, reference)
                print(f"{os.path.basename(scene)}, {method}, {samples} samples: true {true:.4f}, stated {stated:.4f}, {stated / true:.2f}", flush=True)
