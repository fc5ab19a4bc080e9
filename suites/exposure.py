#!/usr/bin/env python3
"""Automatic exposure of scenes, least and most stops of five methods at 16 and 128 samples: they should not differ by more than 0.1.

usage: exposure.py SCENE ...   (OPSR is the program, by default target/release/opsr)
"""
import json, os, subprocess, sys, tempfile

PROGRAM = os.environ.get("OPSR", "target/release/opsr")
METHODS = ["--integrator path --resolve raw", "--integrator path", "--opsr-table beta-0.001", "--integrator bdpt", ""]

for scene in sys.argv[1:] or sys.exit(__doc__):
    with tempfile.TemporaryDirectory() as folder:
        picture, stats = (os.path.join(folder, name) for name in ("picture.png", "stats.json"))
        stops = []
        for options in METHODS:
            for samples in (16, 128):
                command = [PROGRAM, "render", scene, "--size", "192x144", "--spp", str(samples), "--progress", "none", *options.split()]
                subprocess.run([*command, "--stats", stats, "-o", picture], check=True, capture_output=True)
                with open(stats) as file:
                    stops.append(json.load(file)["exposure"])
        print(f"{os.path.basename(scene)}: {min(stops):.1f} to {max(stops):.1f}", flush=True)
