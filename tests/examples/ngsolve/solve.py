"""Solves `swirl` with the finite elements of NGSolve, for `mms score` to measure.

    python solve.py CELLS FOLDER [--degree P] [--amplitude A] [--cfl X] [--frames N]

Of mmsmith only the generated C header is used: for the body force, the constants and the start. Total-Lagrangian
quadrilaterals of degree P, whose forces NGSolve derives from the strain energy; consistent mass, explicit central differences.

FOLDER gets a recording, quadrature.pvd: displacement, velocity, F and P at the quadrature points.
"""

import argparse
import sys
import time
from pathlib import Path

import ngsolve
import numpy
from ngsolve import CF, Det, Grad, Id, InnerProduct, Inv, Trace, Variation, dx, log, x, y
from ngsolve.comp import IntegrationRuleSpace
from ngsolve.meshes import MakeStructured2DMesh

sys.path.insert(0, str(Path(__file__).parents[1]))
from exact import Exact, Recording, padded


class Solver:
    def __init__(self, exact, cells, degree):
        mesh = MakeStructured2DMesh(quads=True, nx=cells, ny=cells)
        # The motion vanishes on the walls: there the body may stick.
        self.space = ngsolve.VectorH1(mesh, order=degree, dirichlet=".*")
        self.points = IntegrationRuleSpace(mesh, order=2 * degree)
        at_points = dx(intrules=self.points.GetIntegrationRules())
        self.X = numpy.column_stack([self.at_points(x), self.at_points(y)])
        self.lam = exact.E * exact.nu / ((1 + exact.nu) * (1 - 2 * exact.nu))
        self.mu = exact.E / (2 * (1 + exact.nu))
        trial, test = self.space.TnT()
        F = Id(2) + Grad(trial)
        J = Det(F)
        energy = self.mu / 2 * (Trace(F.trans * F) - 2) - self.mu * log(J) + self.lam / 2 * log(J) ** 2
        self.internal = ngsolve.BilinearForm(self.space)
        self.internal += Variation(energy.Compile() * at_points)
        mass = ngsolve.BilinearForm(exact.rho0 * InnerProduct(trial, test) * dx).Assemble()
        self.inverse = mass.mat.Inverse(self.space.FreeDofs(), inverse="sparsecholesky")
        self.field = [ngsolve.GridFunction(self.points) for _ in range(2)]
        self.load = ngsolve.LinearForm(exact.rho0 * CF(tuple(self.field)) * test * at_points)
        self.u, self.v = ngsolve.GridFunction(self.space), ngsolve.GridFunction(self.space)
        self.force = self.u.vec.CreateVector()

    def at_points(self, function):
        """The values of a scalar at the quadrature points."""
        values = ngsolve.GridFunction(self.points)
        values.Interpolate(function)
        return values.vec.FV().NumPy().copy()

    def loaded(self, values):
        """The load vector of a field per unit mass at the quadrature points."""
        for component, column in zip(self.field, values.T):
            component.vec.FV().NumPy()[:] = column
        self.load.Assemble()
        return self.load.vec

    def project(self, values):
        """The velocity nearest to values at the quadrature points."""
        self.v.vec.data = self.inverse * self.loaded(values)

    def acceleration(self, b):
        self.internal.Apply(self.u.vec, self.force)
        # Evaluated into a vector of its own, since terms are added to the result one by one.
        residual = (self.loaded(b) - self.force).Evaluate()
        return (self.inverse * residual).Evaluate()

    def arrays(self, v):
        F = Id(2) + Grad(self.u)
        P = self.mu * F + (self.lam * log(Det(F)) - self.mu) * Inv(F).trans
        vector = lambda field: numpy.column_stack([self.at_points(field[i]) for i in range(2)])
        tensor = lambda field: numpy.column_stack([self.at_points(field[i, j]) for i in range(2) for j in range(2)])
        return {
            "reference_position": padded(self.X),
            "displacement": padded(vector(self.u)),
            "velocity": padded(vector(v)),
            "F": tensor(F),
            "P": tensor(P),
        }


def run(cells, folder, degree=2, amplitude=0.2, cfl=0.1, frames=11):
    """Steps, points, and the seconds that they took."""
    exact = Exact("swirl", amplitude)
    folder.mkdir(parents=True, exist_ok=True)
    between = int(numpy.ceil(exact.period * exact.speed * cells / cfl / (frames - 1) - 1e-9))
    steps = between * (frames - 1)
    dt = exact.period / steps
    solver = Solver(exact, cells, degree)
    b = exact.body_force(solver.X)
    solver.project(exact.start(solver.X)[1])
    recording = Recording(folder, "quadrature", exact.name, exact.parameters)
    started = time.process_time()
    for step in range(steps + 1):
        a = solver.acceleration(b(step * dt))
        if step > 0:
            # From the half step before to this time.
            solver.v.vec.data += dt / 2 * a
        if step % between == 0:
            arrays = solver.arrays(solver.v)
            recording.write(step * dt, (solver.X + arrays["displacement"][:, :2]), arrays)
        solver.v.vec.data += dt / 2 * a
        solver.u.vec.data += dt * solver.v.vec
    return steps, len(solver.X), time.process_time() - started


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cells", type=int)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--degree", type=int, default=2)
    parser.add_argument("--amplitude", type=float, default=0.2)
    parser.add_argument("--cfl", type=float, default=0.1)
    parser.add_argument("--frames", type=int, default=11)
    options = parser.parse_args(arguments)
    steps, points, seconds = run(**vars(options))
    print(f"swirl, {options.cells} cells, degree {options.degree}: {steps} steps, {points} points, {seconds:.2f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
