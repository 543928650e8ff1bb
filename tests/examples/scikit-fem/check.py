"""Solves with scikit-fem on several meshes, has the results scored, and compares the orders with theory.

    python check.py MMS FOLDER NAME=CELLS,CELLS,... ...

MMS is the command `mms`; NAME is ring or vortex. On the finest pair of meshes the largest error of u must fall with order
2.0 +/- 0.1, and the root-mean-square error of the elements' own F with order 1.0 +/- 0.1. The vortex shears by six over
its ring: its mean errors of u come within 0.1 of order 2 on finer meshes only than its largest error does.
Exit status: 0 where all do, 1 where one does not.
"""

import json
import subprocess
import sys
import time
from pathlib import Path

from solve import run


def score(mms, name, folder, kind, cells):
    lists = [str(folder / f"{name}-{count}" / f"{kind}.pvd") for count in cells]
    output = folder / f"{name}-{kind}.json"
    command = [mms, "score", name, *lists, "--cells", ",".join(map(str, cells)), "--json", str(output)]
    subprocess.run(command, check=True)
    result = json.loads(output.read_text(encoding="utf-8"))
    for row in result["rows"]:
        assert row["status"] == "ok", row["status"]
    return result["orders"]


def main(mms, folder, *studies):
    folder = Path(folder)
    failed = False
    for study in studies:
        name, cells = study.split("=")
        cells = [int(count) for count in cells.split(",")]
        for count in cells:
            started = time.monotonic()
            steps, _ = run(name, count, folder / f"{name}-{count}")
            print(f"{name}, {count} cells: {steps} steps, {time.monotonic() - started:.1f} s", flush=True)
        for kind, field, norm, order in [("nodes", "u", "linf", 2.0), ("quadrature", "F", "l2", 1.0)]:
            finest = score(mms, name, folder, kind, cells)[field][norm]["local"][-1]
            passed = abs(finest - order) <= 0.1
            failed |= not passed
            verdict = "passed" if passed else "FAILED"
            print(f"{verdict}: {name}, {kind}, {norm} of {field}: order {finest:.3f}, expected {order} +/- 0.1")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
