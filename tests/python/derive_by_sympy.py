"""Derives body forces by SymPy, and compares them with those of mms: python derive_by_sympy.py MMS [NAME...]

The shortest way that the manual of SymPy suggests: F from the displacement, P from the law, b from the balance, then lambdify. For each
solution the time of both derivations, the operations of SymPy's expression, and the largest difference of b, over the size of b, at
amplitudes down to 1e-12. Solutions are Cartesian, in the plane, with the neo-Hookean law. Needs SymPy and NumPy.
"""

import json
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy
import sympy

SPECS = Path(__file__).resolve().parents[2] / "mms-specs"
PLACES = [(0.3, 0.7), (0.11, 0.43), (0.83, 0.27)]


def derive(spec):
    """b as a function of X, Y, t and the parameters in their order, and the number of its operations."""
    X, Y, t = sympy.symbols("X Y t")
    parameters = sympy.symbols(list(spec["parameters"]))
    names = {"X": X, "Y": Y, "t": t, "Pi": sympy.pi, **{str(p): p for p in parameters}}
    read = lambda text: sympy.sympify(str(text).replace("^", "**"), locals=names)
    for name, text in spec.get("let", {}).items():
        names[name] = read(text)
    u = [read(spec["displacement"].get(axis, 0)) for axis in "XY"]
    E, nu, rho0 = names["E"], names["nu"], names["rho0"]
    lam, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    F = sympy.eye(2) + sympy.Matrix(2, 2, lambda i, j: sympy.diff(u[i], [X, Y][j]))
    inverse = F.inv().T
    P = mu * (F - inverse) + lam * sympy.log(F.det()) * inverse
    b = [sympy.diff(u[i], t, 2) - (sympy.diff(P[i, 0], X) + sympy.diff(P[i, 1], Y)) / rho0 for i in range(2)]
    return sympy.lambdify((X, Y, t, *parameters), b), sum(sympy.count_ops(entry) for entry in b)


def main(mms, *names):
    for name in names or ("axis-aligned", "skew-2d"):
        spec = tomllib.loads((SPECS / f"{name}.toml").read_text())
        start = time.process_time()
        b, operations = derive(spec)
        took = time.process_time() - start
        print(f"{name}: SymPy derives in {took:.1f} s of CPU, {operations} operations")
        for nu in (0.3, 0.0):
            for amplitude in (0.1, 1e-4, 1e-8, 1e-12):
                values = {p: own["default"] for p, own in spec["parameters"].items()} | {"A": amplitude, "nu": nu}
                points = "X,Y,t\n" + "".join(f"{x!r},{y!r},0.004\n" for x, y in PLACES)
                settings = [word for p, value in values.items() for word in ("--set", f"{p}={value!r}")]
                out = subprocess.run([mms, "eval", name, *settings, "--points", "-", "--json", "-"], input=points, capture_output=True, text=True, check=True).stdout
                own = numpy.array([row["b"] for row in json.loads(out)["rows"]])
                theirs = numpy.array([b(x, y, 0.004, *values.values()) for x, y in PLACES], dtype=float)
                print(f"  nu = {nu}, A = {amplitude:g}: difference {numpy.abs(own - theirs).max() / numpy.abs(own).max():.0e} of b")


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
