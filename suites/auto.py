"""How far every method of suites/auto.toml is from the best of all, by FLIP and by trimmed relMSE.

    python3 suites/auto.py results.json

A line a scene: the error of every method over that of the best one, `auto` left out, at the end of the runs; geometric means over
seeds. Then how many of the scenes each method is within 10 % in, and its geometric mean.
"""

import json
import math
import sys

METRICS = ["FLIP", "relMSE trimmed"]


def mean(values):
    return math.exp(sum(math.log(max(value, 1e-12)) for value in values) / len(values))


def main():
    results = json.load(open(sys.argv[1]))
    errors = {}
    for cell in results["cells"]:
        if not cell.get("refused"):
            runs = errors.setdefault(cell["scene"], {}).setdefault(cell["method"], [])
            runs.append(cell["points"][-1]["errors"])
    names = [method["name"] for method in results["suite"]["method"]]
    ratios = {name: [] for name in names}
    print("| scene | " + " | ".join(names) + " |")
    print("|---" * (len(names) + 1) + "|")
    for scene, methods in errors.items():
        error = {n: [mean([run[m] for run in runs]) for m in METRICS] for n, runs in methods.items()}
        others = [e for n, e in error.items() if not n.startswith("auto")]
        best = [min(e[i] for e in others) for i in range(len(METRICS))]
        words = []
        for name in names:
            ratio = [e / b for e, b in zip(error[name], best)] if name in error else None
            words.append(", ".join(f"{r:.2f}" for r in ratio) if ratio else "")
            ratios[name] += [ratio] if ratio else []
        print(f"| {scene} | " + " | ".join(words) + " |")
    for title, summary in [
        ("within 10 %", lambda x: f"{sum(r <= 1.1 for r in x)} of {len(x)}"),
        ("mean", lambda x: f"{mean(x):.2f}"),
        ("worst", lambda x: f"{max(x):.2f}"),
    ]:
        columns = [", ".join(summary([r[i] for r in ratios[n]]) for i in range(len(METRICS))) for n in names]
        print(f"| {title} | " + " | ".join(columns) + " |")


if __name__ == "__main__":
    main()
