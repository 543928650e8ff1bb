"""Values of three isochoric solutions to 25 digits, by differences in 120 digits of motions that are written out here.

    python golden.py FILE.json

Nothing of mmsmith takes part: deformation, acceleration and the divergence of the stress are central differences with steps of
1e-30, whose errors are some 1e-58 of the values. Needs mpmath.
"""

import json
import random
import sys

from mpmath import cos, log, matrix, mp, mpf, nstr, pi, sin, sqrt

mp.dps = 120
STEP = mpf(10) ** -30


def shears(X, t, p):
    T = p["A"] * sin(p["c"] * pi * t)
    q = T * sin(pi * X[1])
    return [q, T * sin(pi * (X[0] + q))]


def shears_3d(X, t, p):
    T = p["A"] * sin(p["c"] * pi * t)
    q = T * sin(pi * X[1])
    return [q, T * sin(pi * X[2]), T * sin(pi * (X[0] + q))]


def ring_isochoric(X, t, p):
    a = 2 * p["Ro"] * p["A"] * sin(p["c"] * pi * t)
    R = sqrt(X[0] ** 2 + X[1] ** 2)
    share = sqrt(R**2 + a) / R - 1
    return [share * X[0], share * X[1]]


def moved(X, axis, by):
    return [x + (by if k == axis else 0) for k, x in enumerate(X)]


def deformation(u, X, t, p):
    n = len(X)
    F = matrix(n, n)
    for J in range(n):
        ahead, behind = u(moved(X, J, STEP), t, p), u(moved(X, J, -STEP), t, p)
        for i in range(n):
            F[i, J] = (ahead[i] - behind[i]) / (2 * STEP) + (1 if i == J else 0)
    return F


def stress(u, X, t, p):
    """First Piola-Kirchhoff, of the neo-Hookean law: mu (F - F^-T) + lambda ln J F^-T."""
    F = deformation(u, X, t, p)
    inverse = (F**-1).T
    return p["mu"] * (F - inverse) + p["lambda"] * log(mp.det(F)) * inverse


def fields(u, X, t, p):
    n = len(X)
    before, now, after = (u(X, t + k * STEP, p) for k in (-1, 0, 1))
    v = [(after[i] - before[i]) / (2 * STEP) for i in range(n)]
    a = [(after[i] - 2 * now[i] + before[i]) / STEP**2 for i in range(n)]
    ahead = [stress(u, moved(X, J, STEP), t, p) for J in range(n)]
    behind = [stress(u, moved(X, J, -STEP), t, p) for J in range(n)]
    divergence = [sum((ahead[J][i, J] - behind[J][i, J]) / (2 * STEP) for J in range(n)) for i in range(n)]
    F, P = deformation(u, X, t, p), stress(u, X, t, p)
    rows = lambda A: [[A[i, J] for J in range(n)] for i in range(n)]
    b = [a[i] - divergence[i] / p["rho0"] for i in range(n)]
    return {"u": now, "v": v, "a": a, "F": rows(F), "P": rows(P), "b": b}


def text(value):
    if isinstance(value, list):
        return [text(one) for one in value]
    # The errors of differences are much less, and no other value is so small.
    return "0" if abs(value) < mpf(10) ** -40 else nstr(value, 25, strip_zeros=False, min_fixed=1, max_fixed=0)


def main():
    draw = random.Random(52)
    problems = {}
    for name, u, dimension in (("shears", shears, 2), ("shears-3d", shears_3d, 3), ("ring-isochoric", ring_isochoric, 2)):
        problems[name] = []
        for _ in range(20):
            given = {"A": draw.choice([0.01, 0.05, 0.1]), "E": 1e4, "nu": draw.choice([0.3, 0.49, 0.4999, 0.499999]), "rho0": 4.0}
            if name == "ring-isochoric":
                given |= {"Ri": 0.5, "Ro": 1.0}
                radius, angle = mpf(draw.uniform(0.5, 1.0)), mpf(draw.uniform(0.0, 1.5))
                X = [float(radius * cos(angle)), float(radius * sin(angle))]
            else:
                X = [draw.random() for _ in range(dimension)]
            t = draw.uniform(0.0, 0.04)
            p = {key: mpf(value) for key, value in given.items()}
            p["c"] = sqrt(p["E"] / p["rho0"])
            p["mu"] = p["E"] / (2 * (1 + p["nu"]))
            p["lambda"] = p["E"] * p["nu"] / ((1 + p["nu"]) * (1 - 2 * p["nu"]))
            out = fields(u, [mpf(x) for x in X], mpf(t), p)
            problems[name].append({"X": X, "t": t, "par": given, "out": {key: text(value) for key, value in out.items()}})
    with open(sys.argv[1], "w") as file:
        json.dump({"digits": 25, "problems": problems}, file, indent=1)
        file.write("\n")


main()
