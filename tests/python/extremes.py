"""A search for runs that say `ok` and should not, over solutions, Poisson's ratios, amplitudes and schemes.

    python extremes.py MMS [--runs 1000] [--seed 1]

Each study has two grids, hence two runs. Found are

- a run with status `ok` whose error of u exceeds the largest displacement, which a body that stays at rest would reach too;
- a study whose error of u or P is larger on the finer grid than on the coarser one, and that has neither a warning, nor a status
  that says why, nor a failed verdict.

Displacements come from `mms eval`, so that no figure of the program that is judged is taken for its own judge.

Exit status: 0 where nothing is found, 1 otherwise, with the commands.
"""

import argparse
import csv
import json
import math
import random
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

# Cells of the coarser grid, and the largest part of a period.
SOLUTIONS = {
    "axis-aligned": (8, 0.25),
    "axis-aligned-1d": (16, 0.5),
    "axis-aligned-3d": (4, 0.05),
    "ring": (8, 0.1),
    "ring-nu": (8, 0.1),
    "ring-isochoric": (8, 0.1),
    "shears": (8, 0.25),
    "shears-loaded": (8, 0.25),
    "shears-3d": (4, 0.05),
    "skew-2d": (8, 0.25),
    "swirl": (8, 0.25),
    "vortex": (8, 0.1),
}
RATIOS = (0.0, 0.3, 0.45, 0.49, 0.499, 0.4999)
SHARES_OF_AMPLITUDE = (0.01, 0.1, 0.5, 1.0, 1.5)
# Their sides are moved or loaded, which lattices of boxes cannot be in the updated formulation.
HELD = ("ring-isochoric", "shears", "shears-loaded", "shears-3d", "skew-2d", "vortex")
CLIPPED = ("cpdi2", "bspline2", "bspline3")
UPDATED = ("linear", "gimp", "ugimp", "cpdi", "cpdi2", "gimp-bspline2", "bspline2", "bspline3")
TRANSFERS = ("flip", "pic", "apic", "xpic2")
INTEGRATORS = ("usl", "usf", "musl", "cd")
TOTAL = ("bspline2", "bspline3", "bspline4")
# An error that grows by less than this is taken to stand still; next to rounding errors nothing is said of it.
GROWTH = 1.1
ROUNDING = 1e-9


def mms(program, *words):
    """Ends with its exit status and its last line of errors."""
    done = subprocess.run([program, *map(str, words)], capture_output=True, text=True, check=False)
    return done.returncode, (done.stderr.strip().splitlines() or [""])[-1]


def parameters(program, name, folder):
    """Of a solution, by name."""
    file = folder / "list.json"
    if not file.exists():
        mms(program, "list", "--json", file)
    rows = json.loads(file.read_text())["rows"]
    [row] = [row for row in rows if row["name"] == name]
    return {one["name"]: one["default"] for one in row["parameters"]}, row["dimension"]


def study(program, draw, folder):
    """Options of a study, drawn."""
    name = draw.choice(list(SOLUTIONS))
    coarse, longest = SOLUTIONS[name]
    given, dimension = parameters(program, name, folder)
    options = ["--cells", f"{coarse},{2 * coarse}", "--periods", round(longest * draw.choice((0.2, 0.5, 1.0)), 4)]
    values = {}
    if "nu" in given:
        values["nu"] = draw.choice(RATIOS)
    if "A" in given:
        values["A"] = given["A"] * draw.choice(SHARES_OF_AMPLITUDE)
    for parameter, value in values.items():
        options += ["--set", f"{parameter}={value:.6g}"]
    if draw.random() < 0.3:
        options += ["--formulation", "total-lagrangian", "--shape", draw.choice(TOTAL)]
    else:
        clipped = name in HELD or draw.random() < 0.3
        shape = draw.choice(CLIPPED if clipped else UPDATED)
        options += ["--shape", shape, "--transfer", draw.choice(TRANSFERS), "--integrator", draw.choice(INTEGRATORS)]
        if clipped:
            options += ["--layout", "clipped"]
    if draw.random() < 0.3:
        options += ["--volume", "projected"]
    return name, dimension, values, options


def largest_displacement(program, name, dimension, values, periods, period, folder, key):
    """Of the exact motion, at points drawn of the unit box and of the ring between its radii."""
    draw = random.Random(1)
    points, fields = folder / f"{key}-points.csv", folder / f"{key}-fields.csv"
    axes = "XYZ"[:dimension]
    with points.open("w") as file:
        file.write(",".join(axes) + ",t\n")
        for _ in range(400):
            if name.startswith("ring"):
                radius, angle = draw.uniform(0.4, 0.6), draw.uniform(0, 2 * math.pi)
                place = [radius * math.cos(angle), radius * math.sin(angle)]
            else:
                place = [draw.random() for _ in axes]
            file.write(",".join(map(repr, [*place, draw.uniform(0, periods * period)])) + "\n")
    sets = [word for one, value in values.items() for word in ("--set", f"{one}={value:.6g}")]
    status, said = mms(program, "eval", name, "--points", points, "--csv", fields, *sets)
    if status:
        sys.exit(f"mms eval {name}: {said}")
    with fields.open() as file:
        rows = list(csv.DictReader(file))
    return max(math.hypot(*(float(row[f"u{i + 1}"]) for i in range(dimension))) for row in rows)


def judged(program, drawn, folder, key):
    """Complaints about a study, and how many runs it had."""
    name, dimension, values, options = drawn
    written = folder / f"{key}.json"
    status, said = mms(program, "converge", name, "--quiet", "--json", written, *options)
    command = " ".join(map(str, ["mms converge", name, *options]))
    if not written.exists():
        return ([] if status == 2 else [f"{command}\n    exit status {status} without a result: {said}"]), 0
    told = json.loads(written.read_text())
    rows = told["rows"]
    found = []
    ok = [row for row in rows if row["status"] == "ok"]
    if ok:
        end = ok[0]["dt"] * ok[0]["steps"]
        amplitude = largest_displacement(program, name, dimension, values, 1.0, end, folder, key)
        for row in ok:
            # The points are drawn, so that the largest of them is a little less than that of the body.
            if row["errors"]["u"]["linf"] > 1.2 * amplitude > 0:
                found.append(f"ok on {row['cells']} cells, error {row['errors']['u']['linf']:.2e} above the motion's {amplitude:.2e}")
    reasons = [key for key in ("growth", "locking", "quadrature", "refinement") if told.get(key)]
    if len(ok) == len(rows) == 2 and not reasons:
        for field in ("u", "P"):
            errors = [row["errors"][field]["l2"] for row in rows]
            verdict = told["verdicts"][field]["l2"]
            if errors[1] > GROWTH * errors[0] and errors[1] > ROUNDING * amplitude and verdict["passed"] is not False:
                found.append(f"error of {field} grows from {errors[0]:.2e} to {errors[1]:.2e} without a word, {verdict['behaviour']}")
    return [f"{command}\n    {text}" for text in found], len(rows)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("mms")
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    draw = random.Random(options.seed)
    runs, refused, complaints = 0, 0, []
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(options.jobs) as pool:
        folder = Path(folder)
        studies = [study(options.mms, draw, folder) for _ in range(options.runs // 2)]
        for found, had in pool.map(lambda one: judged(options.mms, one[1], folder, one[0]), enumerate(studies)):
            complaints += found
            runs += had
            refused += had == 0
            for text in found:
                print(text, flush=True)
    print(f"{runs} runs, {refused} studies refused, {len(complaints)} found")
    sys.exit(1 if complaints else 0)


if __name__ == "__main__":
    main()
