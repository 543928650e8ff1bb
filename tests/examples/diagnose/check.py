"""Plants mistakes in four solvers and lets diagnose name them.

    python check.py MMS FOLDER [--quick] [--page PAGE | --write PAGE]

The solvers are plane.py (NumPy) and ../scikit-fem/solve.py by `mmsmith.diagnose`, and square.cpp and bar.f90 by `mms diagnose`. Of each
mistake the cause that is named first must be the right one, and the right solvers must be told that nothing is wrong. The outcomes are a
table: PAGE must have it, or gets it. Exit status: 0 where all that holds, else 1.
"""

import argparse
import json
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy

import mmsmith

HERE = Path(__file__).resolve().parent
sys.path += [str(HERE), str(HERE.parent / "scikit-fem")]

import plane  # noqa: E402

HEAD = "| solver | mistake planted | named | order with the opposite |\n|---|---|---|---:|\n"
#: The mistakes that are planted in each change.
QUICK = {
    "NumPy": ["", "P transposed", "rho0 b for b", "b at t + dt", "boundary held", "starts at rest"],
    "scikit-fem": ["", "traction subtracted"],
    "C++": ["", "stress-transposed", "force-half-step-ahead"],
    "Fortran": ["", "force-per-volume"],
}


@dataclass
class Outcome:
    solver: str
    mistake: str
    right: str
    named: list
    order: float | None
    seconds: float

    @property
    def is_right(self):
        return self.named[:1] == [self.right] if self.right else self.named == []

    def row(self):
        named = ", ".join(f"`{name}`" for name in self.named[:2]) or "nothing is wrong"
        order = "" if self.order is None else f"{self.order:.2f}"
        return f"| {self.solver} | {self.mistake or 'none'} | {named} | {order} |"


def of_python(name, solve, solution, mistake, right):
    begin = time.perf_counter()
    found = mmsmith.diagnose(solve, solution, cells=(8, 16), u=2)
    assert found.passed == (found.causes == ()), f"{name}, {mistake}: no cause is named:\n{found}"
    order = found.causes[0].order if found.causes else None
    return Outcome(name, mistake, right, [cause.name for cause in found.causes], order, time.perf_counter() - begin)


def numpy_solver(wanted):
    for mistake, right in {"": "", **plane.MISTAKES}.items():
        if wanted(mistake):
            name = str(HERE / "loaded.toml") if "traction" in mistake else "skew-2d"
            yield of_python("NumPy", lambda solution, cells: plane.solve(solution, cells, mistake), name, mistake, right)


class Mistaken:
    """A solution behind a solver's own layer, which has a mistake."""

    def __init__(self, solution, **fields):
        self._solution, self._fields = solution, fields

    def __getattr__(self, name):
        return self._fields.get(name, getattr(self._solution, name))


SCIKIT_FEM = {
    "": "",
    "traction subtracted": "traction-sign",
    "tractions of another surface pressure, halved": "traction-halved",
    "P transposed": "stress-transposed",
    "J - 1 for ln J": "law-neo-hookean-volume-change",
    "second Piola-Kirchhoff stress for P": "stress-second-piola-kirchhoff",
    "E for mu": "E-for-mu",
}


def scikit_fem(wanted):
    import solve as fem

    law = fem.first_piola_kirchhoff

    def transposed(F, lam, mu):
        return law(F, lam, mu).swapaxes(0, 1)

    def volume(F, lam, mu):
        J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
        inverse = numpy.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]]) / J
        return mu * F + (lam * (J - 1) - mu) * inverse

    def second(F, lam, mu):
        J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
        inverse = numpy.array([[F[1, 1], -F[0, 1]], [-F[1, 0], F[0, 0]]]) / J
        return numpy.einsum("ij...,jk...->ik...", inverse, law(F, lam, mu))

    laws = {"P transposed": transposed, "J - 1 for ln J": volume, "second Piola-Kirchhoff stress for P": second}
    factors = {"traction subtracted": -1.0, "tractions of another surface pressure, halved": 0.5}
    for mistake, right in SCIKIT_FEM.items():
        if not wanted(mistake):
            continue

        def solve(solution, cells):
            fields = {}
            if mistake in factors:
                fields["traction"] = lambda surface, X, t: factors[mistake] * solution.traction(surface, X, t)
            if mistake == "E for mu":
                lam, mu = solution.law["lambda"], solution.law["mu"]
                fields["law"] = {"lambda": lam, "mu": mu * (3 * lam + 2 * mu) / (lam + mu)}
            fem.first_piola_kirchhoff = laws.get(mistake, law)
            try:
                return fem.solve(Mistaken(solution, **fields), cells)
            finally:
                fem.first_piola_kirchhoff = law

        name = "ring-nu" if "traction" in mistake else "skew-2d"
        yield of_python("scikit-fem", solve, name, mistake, right)


CPP = [
    "moduli-exchanged", "plane-stress", "bulk-modulus-for-lambda", "initial-velocity-half-step-ahead", "initial-velocity-sign",
    "internal-force-fourfold", "law-inverse-not-transposed", "law-neo-hookean-volume-change", "stress-transposed", "stress-shear-halved",
    "stress-kirchhoff", "stress-cauchy", "force-step-ahead", "force-half-step-ahead", "force-frozen", "force-at-current-position",
    "force-coordinates-exchanged", "force-components-exchanged", "force-Y-sign", "force-per-mass", "boundary-step-ahead", "boundary-unused",
]  # fmt: skip
FORTRAN = [
    "lambda-missing", "mu-doubled", "initial-velocity-halved", "stress-kirchhoff",
    "stress-second-piola-kirchhoff", "law-small-strain", "internal-force-halved", "internal-force-without-density", "force-step-ahead",
    "force-step-behind", "force-at-current-position", "force-half-a-cell-off", "force-sign", "force-per-volume", "force-halved", "force-unused",
    "mass-doubled",
]  # fmt: skip


def by_command(mms, folder, name, solution, target, build, run, mistake):
    begin = time.perf_counter()
    path = folder / f"{name}-{mistake or 'right'}.json"
    words = [mms, "diagnose", solution, "--target", target, "--build", build, "--run", f"{run} {mistake}", "--jobs", "2", "--json", path]
    ended = subprocess.run(words, capture_output=True, text=True)
    assert ended.returncode == (1 if mistake else 0), f"{name}, {mistake}: status {ended.returncode}\n{ended.stdout}{ended.stderr}"
    found = json.loads(path.read_text(encoding="utf-8"))
    assert found["passed"] == (not mistake)
    named = [cause["name"] for cause in found["causes"]]
    return Outcome(name, mistake, mistake, named, found["causes"][0]["order"] if named else None, time.perf_counter() - begin)


def cpp(mms, folder, wanted):
    build = f"c++ -std=c++17 -O0 -ffp-contract=off -I {{fields}} {HERE / 'square.cpp'} -o {{fields}}/square"
    for mistake in ["", *CPP]:
        if wanted(mistake):
            yield by_command(mms, folder, "C++", "skew-2d", "cpp", build, "{fields}/square {cells} {out}", mistake)


def fortran(mms, folder, wanted):
    build = f"cd {{fields}} && gfortran -O0 -ffp-contract=off axis_aligned_1d.f90 {HERE / 'bar.f90'} -o bar"
    for mistake in ["", *FORTRAN]:
        if wanted(mistake):
            yield by_command(mms, folder, "Fortran", "axis-aligned-1d", "fortran", build, "{fields}/bar {cells} {out}", mistake)


def merged(page, outcomes):
    """The page with the rows of these outcomes; rows of others stay."""
    before, _, rest = page.partition(HEAD)
    inside, gap, after = rest.partition("\n\n")
    key = lambda row: row.split("|")[1:3]  # noqa: E731
    rows = inside.splitlines()
    for outcome in outcomes:
        row = outcome.row()
        places = [index for index, known in enumerate(rows) if key(known) == key(row)]
        rows = [row if index in places else known for index, known in enumerate(rows)] + ([] if places else [row])
    return before + HEAD + "\n".join(rows) + (gap + after if gap else "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mms")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--quick", action="store_true", help="a few mistakes of each solver")
    parser.add_argument("--only", metavar="SOLVER", help="one solver")
    parser.add_argument("--mistake", help="one mistake")
    parser.add_argument("--page", type=Path, help="this page must have the table")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="this page gets the table")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    mms = str(Path(options.mms).resolve())

    def of(solver):
        return lambda mistake: (
            (not options.quick or mistake in QUICK[solver]) and options.only in (None, solver) and options.mistake in (None, mistake)
        )

    studies = [numpy_solver(of("NumPy")), scikit_fem(of("scikit-fem")), cpp(mms, options.folder, of("C++"))]
    if shutil.which("gfortran"):
        studies.append(fortran(mms, options.folder, of("Fortran")))
    else:
        print("skipped: there is no gfortran")
    outcomes = []
    for study in studies:
        for outcome in study:
            outcomes.append(outcome)
            print(f"{'ok' if outcome.is_right else 'WRONG'} {outcome.seconds:5.1f} s {outcome.row()}", flush=True)
    wrong = [outcome for outcome in outcomes if not outcome.is_right]
    for outcome in wrong:
        print(f"FAILED: {outcome.solver}, {outcome.mistake}: {outcome.named} in place of {outcome.right}", file=sys.stderr)
    if options.write:
        page = options.write.read_text(encoding="utf-8")
        options.write.write_text(merged(page, outcomes), encoding="utf-8")
    if options.page:
        text = options.page.read_text(encoding="utf-8")
        missing = [outcome.row() for outcome in outcomes if outcome.row() not in text]
        for row in missing:
            print(f"FAILED: {options.page} lacks the row {row}", file=sys.stderr)
        wrong += missing
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
