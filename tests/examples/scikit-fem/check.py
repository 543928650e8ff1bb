"""Verifies the solver in solve.py, and then the test that verifies it.

    python check.py FOLDER [--matrix PAGE]

Of the finest pair of meshes the largest error of u must fall with order 2, and the root-mean-square error of the elements' own F with
order 1; `mms score` must say the same of files with these values. Each of the faults that a solver meets must be caught
with one solution or another, and the outcomes must be the table in PAGE. Exit status: 0 where all that holds, else 1.
"""

import argparse
import sys
from pathlib import Path

import mmsmith
import numpy
from solve import solve

STUDIES = {"ring": (8, 16, 32), "vortex": (16, 32), "ring-nu": (8, 16, 32), "skew-2d": (8, 16, 32)}
# Other conditions on the components of a side.
CONDITIONS = Path(__file__).parents[2] / "data" / "specs" / "conditions"
STUDIES |= {str(CONDITIONS / f"{name}.toml"): (16, 32) for name in ("moving-rollers", "sticking")}


def written(folder, name, cells, result):
    """What the solver computed as a CSV file that `mms score` reads."""
    heads = {"X": ["X", "Y"], "u": ["ux", "uy"], "F": ["F11", "F12", "F21", "F22"]}
    columns = {field: result[field].reshape(len(result["X"]), -1) for field in heads if field in result}
    table = numpy.column_stack([numpy.full(len(result["X"]), result["t"]), *columns.values()])
    path = folder / f"{Path(name).stem}-{cells}-{'-'.join(columns)}.csv"
    head = ",".join(["t", *(name for field in columns for name in heads[field])])
    numpy.savetxt(path, table, fmt="%.17g", delimiter=",", header=head, comments="")
    return path


def orders(folder):
    for name, cells in STUDIES.items():
        solution = mmsmith.load(name)
        for where, field, norm, order in [("nodes", "u", "linf", 2.0), ("elements", "F", "l2", 1.0)]:
            results = [solve(solution, count, where=where) for count in cells]
            errors = [mmsmith.measure(solution, result, norm)[field] for result in results]
            table = mmsmith.orders([solution.cell_length / count for count in cells], {field: errors})
            print(f"{name}, {norm} of {field}\n{table}", flush=True)
            mmsmith.assert_order(table, tolerance=0.1, **{field: order})
            files = [written(folder, name, *pair) for pair in zip(cells, results)]
            scored = mmsmith.score(solution, *files, cells=cells)
            assert [row["status"] for row in scored["rows"]] == ["ok"] * len(cells), scored["rows"]
            assert numpy.allclose([row["errors"][field][norm] for row in scored["rows"]], errors, rtol=1e-9)


def faults(page):
    # With a density other than one, which a force per volume would not show.
    solutions = [mmsmith.load(name, rho0=2.0) for name in ("ring", "ring-nu", "skew-2d")]
    audit = mmsmith.audit(solve, *solutions, cells=(8, 16), u=2)
    print(audit)
    print(audit.markdown())
    assert not audit.missed, audit.missed
    assert len(audit.caught) >= 14
    assert audit.outcomes["body-force-of-transposed-stress"]["ring"] == "blind"
    assert page is None or audit.markdown() in page.read_text(encoding="utf-8"), f"{page} has another table"


def without_traction(solution, cells):
    """A solver with a mistake of its own: it takes loaded surfaces for free ones."""

    class Free:
        def __getattr__(self, name):
            return getattr(solution, name)

        def traction(self, surface, X, t):
            return 0.0 * solution.traction(surface, X, t)

    return solve(Free(), cells)


def planted():
    try:
        mmsmith.audit(without_traction, "ring-nu", faults=[], u=2)
    except AssertionError as error:
        assert "the test fails with the right fields of ring-nu" in str(error), error
        print("a solver that drops tractions is caught on ring-nu")
    else:
        raise AssertionError("a solver that drops tractions passes on ring-nu")
    # The ring has none.
    mmsmith.audit(without_traction, "ring", faults=[], u=2)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--matrix", type=Path, metavar="PAGE")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    try:
        orders(options.folder)
        faults(options.matrix)
        planted()
    except AssertionError as error:
        print(f"FAILED: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
