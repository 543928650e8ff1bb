"""Solves `swirl` with NGSolve on several meshes, has the results scored, and compares the orders with theory.

    python check.py MMS FOLDER CELLS,CELLS,...

MMS is the command `mms`. With elements of degree 2 the mean-square errors on the finest pair of meshes must fall with order 3 for
u and with order 2 for F and P, to a tenth; from 8 cells on they do.
Exit status: 0 where all do, 1 where one does not.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

from solve import run

AMPLITUDE = 0.2
ORDERS = {"u": 3.0, "F": 2.0, "P": 2.0}


def main(mms, folder, cells):
    os.environ["MMS"] = mms
    recordings = [Path(folder) / count for count in cells.split(",")]
    for count, recording in zip(cells.split(","), recordings):
        steps, points, seconds = run(int(count), recording, amplitude=AMPLITUDE)
        print(f"{count} cells: {steps} steps, {points} points, {seconds:.2f} s", flush=True)
    output = Path(folder) / "score.json"
    command = [mms, "score", "swirl", *map(str, recordings), "--set", f"A={AMPLITUDE}", "--cells", cells]
    subprocess.run([*command, "--json", str(output)], check=True)
    orders = json.loads(output.read_text(encoding="utf-8"))["orders"]
    failed = False
    for field, expected in ORDERS.items():
        found = orders[field]["l2"]["local"][-1]
        passed = abs(found - expected) <= 0.1
        failed |= not passed
        print(f"{'passed' if passed else 'FAILED'}: {field}: order {found:.3f}, expected {expected} +/- 0.1")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
