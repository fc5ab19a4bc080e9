#!/usr/bin/env python3
"""Scenes, those below folders among them: which open, which open with a word, and which are refused and why.

    census.py OPSR PATH... [--unsupported nearest] [--times]

Runs `opsr info` on every glTF, pbrt, Mitsuba, OBJ and PLY file that no other file includes, and prints the refusals and the warnings, the most
frequent first. Names and numbers are left out of them, so that one cause is one row. With `--times` it prints the processor's seconds that
each file takes to open, the least of three runs, in place of these.
"""
import argparse
import collections
import re
import resource
import subprocess
from pathlib import Path

ENDINGS = {".glb", ".gltf", ".pbrt", ".xml", ".obj", ".ply"}


def cause(line):
    """A message without its file, its line, names and numbers."""
    line = re.sub(r"^.*?(line \d+|[\w/.-]+:\d+): ", "", line)
    line = re.sub(r"/[^\s:]+", "FILE", line)
    return re.sub(r"\d[\d.e+-]*", "N", line)[:150]


def seconds(command):
    """Processor's seconds of a command, the least of three runs."""
    def spent():
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    least = float("inf")
    for _ in range(3):
        before = spent()
        subprocess.run(command, capture_output=True)
        least = min(least, spent() - before)
    return least


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("opsr")
    parser.add_argument("path", type=Path, nargs="+")
    parser.add_argument("--unsupported", default="nearest")
    parser.add_argument("--times", action="store_true")
    args = parser.parse_args()
    below = lambda path: [path] if path.is_file() else path.rglob("*")
    files = sorted(p for path in args.path for p in below(path) if p.suffix.lower() in ENDINGS)
    text = {p: p.read_text(errors="replace") for p in files if p.suffix in (".pbrt", ".xml")}
    included = set()
    for path, words in text.items():
        for name in re.findall(r'(?:Include|Import|filename=|value=|string filename")\W+"?([^"\s]+)', words):
            included.add((path.parent / name).resolve())
    scenes = [p for p in files if p.resolve() not in included]
    # Meshes of a scene beside them are no models.
    with_scene = {p.parent for p in text}
    scenes = [p for p in scenes if p in text or not any(f in p.parents for f in with_scene)]
    refused, said, counts = collections.Counter(), collections.Counter(), collections.Counter()
    for path in scenes:
        command = [args.opsr, "info", str(path), "--unsupported", args.unsupported]
        if args.times:
            print(f"| {path.name} | {path.stat().st_size} | {seconds(command):.2f} |", flush=True)
            continue
        done = subprocess.run(command, capture_output=True, text=True)
        lines = [line for line in done.stderr.splitlines() if line.strip()]
        if done.returncode != 0:
            counts["refused"] += 1
            refused[cause(lines[-1] if lines else f"exit code {done.returncode}")] += 1
            print(f"refused {path}: {lines[-1] if lines else done.returncode}")
            continue
        words = {cause(line) for line in lines}
        counts["with a word" if words else "loads"] += 1
        said.update(words)
    if args.times:
        return
    total = max(len(scenes), 1)
    print("\n| files | |\n|---|---|")
    for name in ["loads", "with a word", "refused"]:
        print(f"| {name} | {counts[name]} ({100 * counts[name] / total:.0f} %) |")
    for title, counter in [("refused for", refused), ("words", said)]:
        print(f"\n| {title} | files |\n|---|---|")
        for what, number in counter.most_common(30):
            print(f"| {what} | {number} |")


if __name__ == "__main__":
    main()
