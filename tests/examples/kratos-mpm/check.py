"""Solves with the material point method of Kratos on several grids, and has the results scored.

    python check.py MMS FOLDER CELLS,CELLS,... [SCHEME ...]

MMS is the command `mms`; without schemes all are run. The problem is axis-aligned with an amplitude of a thousandth, in which no
point changes its cell. With usf, usl and musl the errors of all fields must be those of `mms run --shape linear` to three
digits at least, in all norms: Kratos and mms are two implementations of one scheme. The mean-square error of u with central
differences, which differ from those of mms, and with Newmark's method must fall with order 1.8 at least on the coarsest pair; on finer
ones the bilinear functions take the order away, here as there.
Exit status: 0 where all do, 1 where one does not.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

from solve import FORCE_AT, run

AMPLITUDE = 0.001
SAME_AS_MMS = ["usf", "usl", "musl"]
FEWEST_DIGITS = 3.0
LEAST_ORDER = 1.8


def main(mms, folder, cells, *schemes):
    os.environ["MMS"] = mms
    failed = False
    for scheme in schemes or FORCE_AT:
        recordings = []
        for count in cells.split(","):
            recording = Path(folder) / f"{scheme}-{count}"
            steps, points, seconds = run("axis-aligned", int(count), recording, scheme, AMPLITUDE)
            print(f"{scheme}, {count} cells: {steps} steps of {points} points, {seconds:.2f} s", flush=True)
            recordings.append(str(recording))
        output = Path(folder) / f"{scheme}.json"
        command = [mms, "score", "axis-aligned", *recordings, "--set", f"A={AMPLITUDE}", "--cells", cells]
        command += ["--json", str(output)]
        if scheme in SAME_AS_MMS:
            command += ["--against", f"mms:linear,{scheme}"]
        subprocess.run(command, check=True)
        result = json.loads(output.read_text(encoding="utf-8"))
        if scheme in SAME_AS_MMS:
            digits = [
                value
                for agreement in result["against"]
                for field in "uvFP"
                for value in agreement["digits"][field].values()
            ]
            passed, what = min(digits) >= FEWEST_DIGITS, f"{min(digits):.1f} digits in common with mms"
        else:
            order = result["orders"]["u"]["l2"]["local"][0]
            passed, what = order >= LEAST_ORDER, f"order {order:.2f} of u"
        failed |= not passed
        print(f"{'passed' if passed else 'FAILED'}: {scheme}: {what}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
