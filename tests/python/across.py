"""Plates in plane stress and bars in uniaxial stress against laws in space, in 60 digits.

    python across.py MMS

Of the specifications in tests/data/specs/across the motion, the parameters and the energy in space are written out here. The stretch
across is the root of P_zz = 0 by Newton's method, P is the stress of the law in space there, and b comes from differences with steps of
1e-20. `mms eval` keeps every field within 16 units of 2^-53 of its size at each place, at amplitudes from 1e-9 to those of the file.
Needs mpmath.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

from mpmath import cos, eye, findroot, log, matrix, mp, mpf, pi, sin, sqrt

mp.dps = 60
STEP = mpf(10) ** -20
FOLDER = pathlib.Path(__file__).parent.parent / "data/specs/across"
UNITS = 16


def plate(X, t, A):
    x, y = X
    return [A * sin(pi * x) * cos(pi * y / 2) * cos(10 * t), A * x**2 * y * sin(10 * t)]


def bar(X, t, A):
    return [A * sin(pi * X[0]) * cos(100 * pi * t)]


def stress_in_space(law, F, lam, mu):
    """First Piola-Kirchhoff stress of a deformation in space."""
    C, one = F.T * F, eye(3)
    trace = lambda A: A[0, 0] + A[1, 1] + A[2, 2]
    if law == "linear-elastic":
        H = F - one
        return lam * trace(H) * one + mu * (H + H.T)
    if law == "st-venant-kirchhoff":
        E = (C - one) / 2
        return F * (lam * trace(E) * one + 2 * mu * E)
    J, inverse = mp.det(F), (F**-1).T
    if law == "hencky":
        B = F * F.T
        # ln B of a plane tensor by its eigenvalues, and of the direction across.
        m, d = (B[0, 0] + B[1, 1]) / 2, sqrt(((B[0, 0] - B[1, 1]) / 2) ** 2 + B[0, 1] ** 2)
        high, low = log(m + d), log(m - d)
        logarithm = matrix(3, 3)
        for i in range(2):
            for j in range(2):
                deviator = B[i, j] - (m if i == j else 0)
                part = (high - low) / (2 * d) * deviator if d > 0 else 0
                logarithm[i, j] = part + ((high + low) / 2 if i == j else 0)
        logarithm[2, 2] = log(B[2, 2])
        return (lam * log(J) * one + mu * logarithm) * inverse
    pressure = {"neo-hookean-mixed": (J * J - 1) / 2, "neo-hookean-quadratic": J * (J - 1)}[law]
    return mu * (F - inverse) + lam * pressure * inverse


class Solution:
    def __init__(self, name, A):
        self.motion = plate if name.startswith("plate") else bar
        self.law = name.split("-", 1)[1]
        E, nu, self.rho0 = (1000, mpf(0.3), 2) if self.motion is plate else (10000, mpf(0.3), 1)
        self.lam, self.mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
        self.A, self.n = mpf(A), 2 if self.motion is plate else 1

    def moved(self, X, axis, by):
        return [x + (by if k == axis else 0) for k, x in enumerate(X)]

    def slopes(self, f, X):
        """Derivatives along the axes: of fourth order in the step."""
        at = lambda axis, by: f(self.moved(X, axis, by * STEP))
        fine = [[(a - b) / 2 for a, b in zip(at(k, 1), at(k, -1))] for k in range(self.n)]
        return [[value / STEP for value in row] for row in fine]

    def F(self, X, t):
        columns = self.slopes(lambda X: self.motion(X, t, self.A), X)
        F = eye(self.n)
        for i in range(self.n):
            for k in range(self.n):
                F[i, k] += columns[k][i]
        return F

    def across_and_stress(self, X, t):
        F = self.F(X, t)

        def in_space(stretch):
            whole = eye(3) * stretch
            for i in range(self.n):
                for k in range(self.n):
                    whole[i, k] = F[i, k]
            return stress_in_space(self.law, whole, self.lam, self.mu)

        stretch = findroot(lambda z: in_space(z)[2, 2] / self.mu, (mpf(1), mpf("1.0001")), tol=mpf(10) ** -100)
        P = in_space(stretch)
        return stretch, [P[i, k] for i in range(self.n) for k in range(self.n)]

    def b(self, X, t):
        u = lambda t: self.motion(X, t, self.A)
        h = mpf(10) ** -15
        acceleration = [(p - 2 * q + r) / h**2 for p, q, r in zip(u(t + h), u(t), u(t - h))]
        columns = self.slopes(lambda X: self.across_and_stress(X, t)[1], X)
        divergence = [sum(columns[k][i * self.n + k] for k in range(self.n)) for i in range(self.n)]
        return [a - d / self.rho0 for a, d in zip(acceleration, divergence)], acceleration


def evaluated(mms, name, A, points):
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "points.json"
        rows = [{"X": X, "t": t, "par": {"A": A}} for X, t in points]
        file.write_text(json.dumps(rows))
        command = [mms, "eval", str(FOLDER / f"{name}.toml"), "--points", str(file)]
        return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)["rows"]


def main(mms):
    worst = 0.0
    laws = ["linear-elastic", "st-venant-kirchhoff", "hencky", "neo-hookean-mixed", "neo-hookean-quadratic"]
    for name in [f"{body}-{law}" for body in ["plate", "bar"] for law in laws]:
        for A in [1e-9, 1e-3, 0.1, -0.15]:
            if name.startswith("plate"):
                points = [([0.3, 0.7], 0.1), ([0.85, 0.2], 0.33)]
            else:
                points = [([0.3], 0.003), ([0.85], 0.0141)]
            solution = Solution(name, A)
            found = {"F_zz": 0.0, "P": 0.0, "b": 0.0}
            for (X, t), row in zip(points, evaluated(mms, name, A, points)):
                X, t = [mpf(x) for x in X], mpf(t)
                stretch, P = solution.across_and_stress(X, t)
                b, acceleration = solution.b(X, t)
                own = [entry for line in row["P"] for entry in line]
                pairs = {
                    "F_zz": ([row["F_zz"]], [stretch], [stretch]),
                    "P": (own, P, P),
                    "b": (row["b"], b, b + acceleration),
                }
                for field, (values, expected, sizes) in pairs.items():
                    size = max(abs(x) for x in sizes)
                    error = max(abs(mpf(v) - e) for v, e in zip(values, expected)) / size
                    found[field] = max(found[field], float(error * 2**53))
            worst = max(worst, *found.values())
            told = ", ".join(f"{field} {units:.1f}" for field, units in found.items())
            print(f"{name}, A = {A}: {told} units of 2^-53")
    if worst > UNITS:
        sys.exit(f"a field is {worst:.0f} units of 2^-53 from that of the law in space")


main(sys.argv[1])
