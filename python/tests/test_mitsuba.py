"""The integrator for Mitsuba 3: look-up and picture, each variant in a process of its own."""

import os
import subprocess
import sys

import pytest

pytest.importorskip("mitsuba", reason="pip install mitsuba")

CHECKS = '''
import re, sys
import numpy as np
import mitsuba as mi
variant, document = sys.argv[1:]
try:
    mi.set_variant(variant)
    mi.Float(1) + mi.Float([1, 2]) if variant.startswith("llvm") else None
except (ImportError, RuntimeError) as error:
    sys.exit(print(f"skip {variant}: {error}"))
import opsr.mitsuba
from opsr.mitsuba import PathRoughness, _bin
opsr.mitsuba.register()

# The test vectors of the document.
number = lambda x: float(np.ravel(x)[0])
factor = lambda index: 0.05 + 0.0005 * mi.Float(index)
rows = [[c.strip() for c in line.split("|")[1:-1]] for line in open(document) if re.match(r"\\| [ABC] \\|", line)]
assert len(rows) == 11
for row in rows:
    if row[1] == "1":
        path = PathRoughness()
    alpha = mi.Float(float(row[2]))
    assert number(_bin(alpha)) == float(row[3]), row
    accumulated = number(path.accumulate(alpha, factor))
    assert abs(accumulated - float(row[6])) < 1e-6, (row, accumulated)
    path = path.pushed(alpha, factor, mi.Bool(True))
    if row[:2] == ["C", "5"]:
        assert number(path.length) == 1 and number(path.code) == 3 and abs(number(path.a) - 0.842236) < 1e-6

# Without factors it is Mitsuba's own path tracer, with them nearly as bright.
scene = mi.cornell_box()
for size in ("width", "height"):
    scene["sensor"]["film"][size] = 16
scene["small-box"]["bsdf"] = {"type": "roughconductor", "alpha": 0.1}
scene["large-box"]["bsdf"] = {"type": "dielectric"}
world = mi.load_dict(scene)
def mean(spp=256 if variant == "llvm_ad_rgb" else 48, **integrator):
    integrator = mi.load_dict({"max_depth": 8, "type": "opsr", **integrator})
    return float(np.array(mi.render(world, integrator=integrator, spp=spp, seed=3))[..., :3].mean())
plain = mean(type="path", spp=1024)
for options in ({}, {"gamma": 0.3}, {"table": "beta-0.001"}):
    assert abs(mean(**options) / plain - 1) < 0.05, (options, mean(**options), plain)

for wrong, words in (
    ({"gamma": 2.0}, "gamma: expected"),
    ({"gamma": -0.3}, "gamma: expected"),
    ({"gamma": 0.3, "table": "beta-0.05"}, "factors of its own"),
    ({"table": "none.json"}, "none.json"),
):
    try:
        mi.load_dict({"type": "opsr", **wrong})
    except Exception as error:
        assert words in str(error), error
    else:
        raise AssertionError(wrong)
scene["small-box"]["bsdf"] = {"type": "plastic"}
try:
    mi.load_dict({"type": "opsr"}).render(mi.load_dict(scene), spp=1)
except ValueError as error:
    assert "SmoothPlastic" in str(error), error
else:
    raise AssertionError("plastic")
print("passed")
'''


@pytest.mark.parametrize("variant", ["scalar_rgb", "llvm_ad_rgb"])
def test_mitsuba_look_up_and_energy(variant):
    document = os.path.join(os.path.dirname(__file__), "..", "..", "docs", "renderers.md")
    command = [sys.executable, "-c", CHECKS, variant, document]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=300)
    lines = ended.stdout.strip().splitlines() or [""]
    if "skip " in lines[-1] or "LLVM" in ended.stderr and "Cannot select" in ended.stderr:
        pytest.skip(lines[-1] or "Mitsuba's LLVM has no code for this processor")
    assert lines[-1].endswith("passed"), ended.stdout + ended.stderr
