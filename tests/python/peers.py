"""Steps a second of mms beside those of other codes, measured in turn on one machine.

    python peers.py MMS SCRIPTS [--space] [--cells N] [--rounds N] [--steps N]

SCRIPTS is a folder with `gimp_plain.c`, `taichi_mls2d.py` and `warp_mls2d.py`, programs that print one JSON line with
`mups_median`, millions of particle-steps a second. All compute a unit square of neo-Hookean material, four particles a
cell, in double precision, on one thread. mms adds the body force of its exact solution. With --space it is a unit cube with
eight particles a cell, and the programs are `gimp_plain_3d.c` of that folder and `warp_mls3d.py` beside this file.

Every round runs each code once, so that a slow phase of the machine meets all of them. A ratio is the geometric mean over
the rounds, with its 95 % interval. A code that is not installed here is left out, and named.

Exit status: 0, or 2 for a wrong call.
"""

import argparse
import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

# Of mms, by the name in the table.
SCHEMES = {
    "ugimp + flip + usl": ("ugimp", "flip", "usl"),
    "gimp + flip + cd": ("gimp", "flip", "cd"),
    "bspline2 + apic + usl": ("bspline2", "apic", "usl"),
}
# The scheme of mms that is the same method.
PEERS = {
    "plain C, UGIMP": "ugimp + flip + usl",
    "taichi, UGIMP": "ugimp + flip + usl",
    "taichi, MLS-MPM": "bspline2 + apic + usl",
    "warp, MLS-MPM": "bspline2 + apic + usl",
    "plain C, UGIMP in space": "ugimp + flip + usl",
    "warp, MLS-MPM in space": "bspline2 + apic + usl",
}
# Two-sided 95 % of Student's t, by degrees of freedom.
STUDENT = {1: 12.71, 2: 4.30, 3: 3.18, 4: 2.78, 5: 2.57, 6: 2.45, 7: 2.36, 8: 2.31, 9: 2.26, 14: 2.14, 19: 2.09}


def one_thread():
    return {**os.environ, "OMP_NUM_THREADS": "1", "RAYON_NUM_THREADS": "1"}


def printed(command):
    """The JSON that a program prints last; None, with the reason on standard error, where it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=one_thread())
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode or not lines:
        reason = (done.stderr.strip() or "no result").splitlines()[-1]
        print(f"{command[0]} {Path(command[1]).name}: {reason}", file=sys.stderr)
        return None
    return json.loads(lines[-1])


def of_mms(program, problem, scheme, cells, steps):
    """Millions of particle-steps a second of one run."""
    shape, transfer, integrator = SCHEMES[scheme]
    # A period takes 2/(CFL h) steps.
    cfl = 0.4
    periods = steps * cfl / (2 * cells)
    command = [program, "run", problem, "--cells", str(cells), "--shape", shape, "--transfer", transfer]
    command += ["--integrator", integrator, "--cfl", str(cfl), "--periods", str(periods), "--threads", "1", "--json", "-"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)["result"]["particle_steps_per_s"] / 1e6


def available(scripts, folder, in_space):
    """The peers that can run here: name and the command for a number of cells and steps."""
    found = {}
    compiler = shutil.which("cc")
    source = scripts / ("gimp_plain_3d.c" if in_space else "gimp_plain.c")
    program = Path(folder) / source.stem
    if compiler and source.is_file():
        build = [compiler, "-O3", "-march=native", "-o", str(program), str(source), "-lm"]
        if subprocess.run(build, capture_output=True, check=False).returncode == 0:
            name = "plain C, UGIMP in space" if in_space else "plain C, UGIMP"
            found[name] = lambda cells, steps: [str(program), str(cells), str(steps), "1"]

    def python(module, script, name, arguments):
        path = scripts / script
        importable = subprocess.run([sys.executable, "-c", f"import {module}"], capture_output=True, check=False)
        if path.is_file() and importable.returncode == 0:
            found[name] = lambda cells, steps: [sys.executable, str(path), *arguments(cells, steps)]

    numbers = lambda cells, steps: [str(cells), str(steps), "1"]
    if in_space:
        here = Path(__file__).resolve().parent / "warp_mls3d.py"
        python("warp", here, "warp, MLS-MPM in space", lambda c, s: ["f64", *numbers(c, s)])
        return found
    python("taichi", "taichi_mls2d.py", "taichi, UGIMP", lambda c, s: ["gimp", "f64", "1", *numbers(c, s)])
    python("taichi", "taichi_mls2d.py", "taichi, MLS-MPM", lambda c, s: ["mls", "f64", "1", *numbers(c, s)])
    python("warp", "warp_mls2d.py", "warp, MLS-MPM", lambda c, s: ["f64", *numbers(c, s)])
    return found


def interval(ratios):
    """Geometric mean of ratios and the ends of its 95 % interval."""
    logarithms = [math.log(ratio) for ratio in ratios]
    mean = statistics.fmean(logarithms)
    if len(logarithms) < 2:
        return math.exp(mean), math.nan, math.nan
    freedom = max(known for known in STUDENT if known <= len(logarithms) - 1)
    half = STUDENT[freedom] * statistics.stdev(logarithms) / math.sqrt(len(logarithms))
    return math.exp(mean), math.exp(mean - half), math.exp(mean + half)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mms")
    parser.add_argument("scripts", type=Path)
    parser.add_argument("--space", action="store_true")
    parser.add_argument("--cells", type=int, help="default: 256, 32 in space")
    parser.add_argument("--rounds", type=int, default=6)
    parser.add_argument("--steps", type=int, default=60)
    options = parser.parse_args()
    if not options.scripts.is_dir() or shutil.which(options.mms) is None:
        parser.error(f"{options.scripts} has to be a folder, and {options.mms} a program")
    problem = "axis-aligned-3d" if options.space else "axis-aligned"
    cells = options.cells or (32 if options.space else 256)
    with tempfile.TemporaryDirectory() as folder:
        peers = available(options.scripts, folder, options.space)
        for name in PEERS.keys() - peers.keys():
            if name.endswith("in space") == options.space:
                print(f"{name}: not installed here, left out", file=sys.stderr)
        rates = {name: [] for name in [*SCHEMES, *peers]}
        for _ in range(options.rounds):
            for scheme in SCHEMES:
                rates[scheme].append(of_mms(options.mms, problem, scheme, cells, options.steps))
            for name, command in list(peers.items()):
                result = printed(command(cells, options.steps))
                if result is None:
                    del peers[name], rates[name]
                else:
                    rates[name].append(result["mups_median"])
    grid = " x ".join([str(cells)] * (3 if options.space else 2))
    print(f"{grid} cells, one thread, {options.rounds} rounds, in turn\n")
    print("| code | million particle-steps/s | times, of mms with the same method | 95 % |\n|---|---:|---:|---|")
    for name, values in rates.items():
        line = f"| {name} | {statistics.median(values):.2f} |"
        if name in PEERS:
            mean, low, high = interval([ours / theirs for ours, theirs in zip(rates[PEERS[name]], values)])
            line += f" {mean:.2f} | {low:.2f} to {high:.2f} |"
        else:
            line += " - | - |"
        print(line)
    return 0


if __name__ == "__main__":
    sys.exit(main())
