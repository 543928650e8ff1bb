"""A material point method in one dimension, written independently, beside that of mms.

    python bar.py MMS

Quadratic splines, velocities by FLIP or APIC, the stress last, centred differences, mirrors at both walls: the bar of
`axis-aligned-1d`. The largest error of u over all particles and steps must agree with that of `mms converge` to
nine digits. On fine grids both errors grow: the method's own doing, told in the book under lost orders.

Exit status: 0 where all agree, 1 where any does not, 2 for a wrong call.
"""

import csv
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

A, E, NU, DENSITY, CFL = 0.1, 1e4, 0.3, 4.0, 0.4
LAMBDA, MU = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
SPEED = np.sqrt(E / DENSITY)
CELLS = (16, 32, 64, 128)
# Nodes beyond each wall.
GHOSTS = 2


def stress(F):
    """First Piola-Kirchhoff stress of the neo-Hookean law, and its derivative."""
    return LAMBDA * np.log(F) / F + MU * (F - 1 / F), LAMBDA * (1 - np.log(F)) / F**2 + MU * (1 + 1 / F**2)


class Bar:
    """u = A sin(pi X) cos(c pi t) between 0 and 1."""

    def __init__(self, X):
        self.sin, self.cos = np.sin(np.pi * X), np.cos(np.pi * X)

    def u(self, t):
        return A * self.sin * np.cos(SPEED * np.pi * t)

    def F(self, t):
        return 1 + np.pi * A * self.cos * np.cos(SPEED * np.pi * t)

    def body_force(self, t):
        u = self.u(t)
        _, slope = stress(self.F(t))
        return -((SPEED * np.pi) ** 2) * u + slope * np.pi**2 * u / DENSITY


def fold(values, cells, sign):
    """Adds the nodes beyond the walls to their mirror images; what is normal to a wall vanishes on it."""
    first, last = GHOSTS, GHOSTS + cells
    for k in range(1, GHOSTS + 1):
        values[first + k] += sign * values[first - k]
        values[last - k] += sign * values[last + k]
    if sign < 0:
        values[first] = values[last] = 0
    return values


def unfold(values, cells):
    """Sets the nodes beyond the walls to what their mirror images say."""
    first, last = GHOSTS, GHOSTS + cells
    for k in range(1, GHOSTS + 1):
        values[first - k] = -values[first + k]
        values[last + k] = -values[last - k]


def largest_error(cells, per_cell, affine):
    """The largest error of u over all particles and steps of one period."""
    count, h = cells * per_cell, 1 / cells
    X = (np.arange(count) + 0.5) / count
    bar, mass, volume = Bar(X), DENSITY / count, 1 / count
    period = 2 / SPEED
    steps = int(np.ceil(period / (CFL * h / SPEED) * (1 - 1e-12)))
    dt = period / steps
    x, F, v, C = X + bar.u(0), bar.F(0), np.zeros(count), np.zeros(count)
    worst = 0.0
    for step in range(steps):
        middle = np.floor(x / h + 0.5).astype(int)
        d = x / h - middle
        nodes = np.stack([middle - 1, middle, middle + 1]) + GHOSTS
        S = np.stack([0.5 * (0.5 - d) ** 2, 0.75 - d * d, 0.5 * (0.5 + d) ** 2])
        G = np.stack([d - 0.5, -2 * d, d + 0.5]) / h
        arms = (nodes - GHOSTS) * h - x

        def p2g(values, sign, nodes=nodes):
            sums = np.zeros(cells + 1 + 2 * GHOSTS)
            np.add.at(sums, nodes, values)
            return fold(sums, cells, sign)

        kirchhoff = stress(F)[0] * F
        grid_mass = p2g(S * mass, 1)
        inverse = np.divide(1, grid_mass, out=np.zeros_like(grid_mass), where=grid_mass > 0)
        momentum = p2g(S * mass * (v + C * arms), -1)
        force = p2g(S * mass * bar.body_force(step * dt) - volume * kirchhoff * G, -1)
        # Velocities lie half a step before positions.
        a = force * inverse * (0.5 if step == 0 else 1)
        grid_v = momentum * inverse + dt * a
        unfold(a, cells)
        unfold(grid_v, cells)
        velocity = (S * grid_v[nodes]).sum(0)
        if affine:
            v, C = velocity, (S * grid_v[nodes] * arms).sum(0) / (S * arms**2).sum(0)
        else:
            v = v + dt * (S * a[nodes]).sum(0)
        x = x + dt * velocity
        F = F * (1 + dt * (G * grid_v[nodes]).sum(0))
        worst = max(worst, np.abs(x - X - bar.u((step + 1) * dt)).max())
    return worst


def errors_of(program, per_cell, transfer):
    """The same errors, from `mms converge`."""
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "rows.csv"
        command = [program, "converge", "axis-aligned-1d", "--shape", "bspline2", "--integrator", "cd"]
        command += ["--transfer", transfer, "--ppc", str(per_cell), "--cfl", str(CFL), "--csv", str(table), "--quiet"]
        command += ["--cells", ",".join(map(str, CELLS))]
        # Its verdict is that the errors do not converge.
        subprocess.run(command, check=False, stdout=subprocess.DEVNULL)
        with table.open(encoding="utf-8") as rows:
            return [float(row["u_linf"]) for row in csv.DictReader(rows)]


def main(arguments):
    if len(arguments) != 1:
        print("usage: python bar.py MMS", file=sys.stderr)
        return 2
    failed = False
    for transfer in ("flip", "apic"):
        for per_cell in (2, 4):
            theirs = errors_of(arguments[0], per_cell, transfer)
            own = [float(largest_error(cells, per_cell, transfer == "apic")) for cells in CELLS]
            # Sums of other order leave some units in the thirteenth digit.
            agree = len(theirs) == len(own) and np.allclose(own, theirs, rtol=1e-9, atol=0)
            failed |= not agree
            print(f"{transfer}, {per_cell} particles a cell: {own} here, {theirs} by mms{'' if agree else ' FAILED'}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
