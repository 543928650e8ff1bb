"""Solves a problem in the unit square with the material point method of Kratos, for `mms score` to measure.

    python solve.py axis-aligned|swirl CELLS FOLDER [--scheme SCHEME] [--amplitude A] [--cfl X] [--frames N]

Of mmsmith only the generated C header is used: for the body force, the constants and the start. Grid, law, equations of
motion and time integration are those of Kratos: bilinear shape functions, four points a cell, where those of `mms run` lie.

FOLDER gets a recording, particles.pvd: displacement, velocity, Cauchy stress and density of the points; and for axis-aligned
motion, where the gradient is diagonal, F and P as they follow from stress and density. Kratos does not tell F itself.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy

sys.path.insert(0, str(Path(__file__).parents[1]))
from exact import Exact, Recording, padded

import KratosMultiphysics as Kratos
import KratosMultiphysics.MPMApplication as MPM
from KratosMultiphysics.MPMApplication.mpm_explicit_solver import MPMExplicitSolver
from KratosMultiphysics.MPMApplication.mpm_implicit_dynamic_solver import MPMImplicitDynamicSolver

# With several threads a run of Kratos is not always the same: one in many had other errors in the third digit.
Kratos.ParallelUtilities.SetNumThreads(1)

EXPLICIT = {
    "usf": {"scheme_type": "forward_euler", "stress_update": "usf"},
    "usl": {"scheme_type": "forward_euler", "stress_update": "usl"},
    "musl": {"scheme_type": "forward_euler", "stress_update": "musl"},
    "central-difference": {"scheme_type": "central_difference"},
}
# The time of the force in a step, from its start on, in time steps. Central differences update F first, so that their
# forces are those of the end of the step, as Newmark's: with the force of the start they are of first order.
FORCE_AT = {"usf": 0, "usl": 0, "musl": 0, "central-difference": 1, "newmark": 1}


def settings(scheme, dt):
    """Parameters of a solver of Kratos."""
    own = {
        "domain_size": 2,
        "time_stepping": {"time_step": dt},
        "auxiliary_variables_list": [],
    }
    if scheme in EXPLICIT:
        own |= {"time_integration_method": "explicit", "analysis_type": "linear"} | EXPLICIT[scheme]
    else:
        own |= {
            "time_integration_method": "implicit",
            "scheme_type": "newmark",
            "convergence_criterion": "residual_criterion",
            # Far below the errors that are measured.
            "residual_relative_tolerance": 1e-9,
            "residual_absolute_tolerance": 1e-14,
            "linear_solver_settings": {"solver_type": "skyline_lu_factorization"},
        }
    return Kratos.Parameters(json.dumps(own))


class Solver:
    """The points of Kratos in the unit square between walls without friction."""

    def __init__(self, exact, cells, scheme, dt):
        kind = MPMExplicitSolver if scheme in EXPLICIT else MPMImplicitDynamicSolver
        self.solver = kind(Kratos.Model(), settings(scheme, dt))
        self.solver.AddVariables()
        grid, body = self.solver.grid_model_part, self.solver.initial_mesh_model_part
        material = body.GetProperties()[1]
        material.SetValue(Kratos.DENSITY, exact.rho0)
        material.SetValue(Kratos.YOUNG_MODULUS, exact.E)
        material.SetValue(Kratos.POISSON_RATIO, exact.nu)
        material.SetValue(Kratos.THICKNESS, 1.0)
        material.SetValue(MPM.MATERIAL_POINTS_PER_ELEMENT, 4)
        material.SetValue(Kratos.CONSTITUTIVE_LAW, MPM.HyperElasticNeoHookeanPlaneStrain2DLaw())
        part = body.CreateSubModelPart("Body")
        node = lambda i, j: 1 + i + j * (cells + 1)
        for target in (grid, part):
            for j in range(cells + 1):
                for i in range(cells + 1):
                    target.CreateNewNode(node(i, j), i / cells, j / cells, 0.0)
        properties = {grid: grid.CreateNewProperties(0), part: material}
        offset = {grid: 0, part: cells * cells}
        for target in (grid, part):
            for j in range(cells):
                for i in range(cells):
                    corners = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)]
                    number = 1 + offset[target] + i + j * cells
                    target.CreateNewElement("Element2D4N", number, corners, properties[target])
        self.solver.PrepareModelPart()
        self.solver.AddDofs()
        for wall in grid.Nodes:
            wall.Fix(Kratos.DISPLACEMENT_Z)
            if wall.X0 in (0.0, 1.0):
                wall.Fix(Kratos.DISPLACEMENT_X)
            if wall.Y0 in (0.0, 1.0):
                wall.Fix(Kratos.DISPLACEMENT_Y)
        self.solver.Initialize()
        self.points = list(self.solver.material_point_model_part.Elements)
        self.info = grid.ProcessInfo
        self.info[Kratos.DELTA_TIME] = dt
        self.place(exact, cells)

    def place(self, exact, cells):
        """Moves the points from Gauss points to the middles of quarter cells, and gives them the state at time zero."""
        gauss = self.get(MPM.MP_COORD)
        corner = numpy.floor(gauss * cells)
        self.X = (corner + numpy.where(gauss * cells - corner < 0.5, 0.25, 0.75)) / cells
        u, v, a, F = exact.start(self.X)
        self.set(MPM.MP_DISPLACEMENT, u)
        self.set(MPM.MP_VELOCITY, v)
        self.set(MPM.MP_ACCELERATION, a)
        self.set(MPM.MP_COORD, self.X)
        # The weight of a Gauss point of a square is that of a quarter cell.
        self.solver._SearchElement()
        self.deform(F)
        self.set(MPM.MP_COORD, self.X + u)

    def deform(self, F):
        """Gives the points a symmetric deformation gradient, for which Kratos has no input."""
        assert (F == F.transpose(0, 2, 1)).all()
        self.info[MPM.IS_COMPRESSIBLE] = True
        for point, gradient in zip(self.points, F):
            self.follow(point, gradient - numpy.eye(2))

    def follow(self, point, H):
        """Updates the stress of a point whose cell moves by the displacement gradient H within a time step."""
        for corner in point.GetGeometry():
            velocity = H @ [corner.X, corner.Y] / self.info[Kratos.DELTA_TIME]
            corner.SetSolutionStepValue(Kratos.VELOCITY, [*velocity, 0.0])
        point.CalculateOnIntegrationPoints(MPM.CALCULATE_EXPLICIT_MP_STRESS, self.info)

    def get(self, variable):
        """A vector or the components of a tensor for each point; a column for what has one value."""
        values = [point.CalculateOnIntegrationPoints(variable, self.info)[0] for point in self.points]
        values = numpy.array(values, dtype=float).reshape(len(self.points), -1)
        is_position = variable in (MPM.MP_COORD, MPM.MP_DISPLACEMENT, MPM.MP_VELOCITY)
        return numpy.ascontiguousarray(values[:, :2]) if is_position else values

    def set(self, variable, vectors):
        for point, (x, y) in zip(self.points, vectors.tolist()):
            point.SetValuesOnIntegrationPoints(variable, [[x, y, 0.0]], self.info)

    def step(self, b):
        """A step under a body force at the points."""
        self.set(MPM.MP_VOLUME_ACCELERATION, b)
        self.solver.AdvanceInTime(self.info[Kratos.TIME])
        self.solver.InitializeSolutionStep()
        self.solver.Predict()
        if not self.solver.SolveSolutionStep():
            raise FloatingPointError("the step did not converge")
        self.solver.FinalizeSolutionStep()


def diagonal(stress, density, exact):
    """F and P, where they are diagonal, from Cauchy stress: J sigma = lambda ln J + mu (F^2 - 1)."""
    lam = exact.E * exact.nu / ((1 + exact.nu) * (1 - 2 * exact.nu))
    mu = exact.E / (2 * (1 + exact.nu))
    J = exact.rho0 / density
    F, P = numpy.zeros((len(J), 4)), numpy.zeros((len(J), 4))
    for i in range(2):
        tau = J * stress[:, i]
        F[:, 3 * i] = numpy.sqrt(1 + (tau - lam * numpy.log(J)) / mu)
        P[:, 3 * i] = tau / F[:, 3 * i]
    return F, P


def run(name, cells, folder, scheme="usl", amplitude=0.001, cfl=0.4, frames=11, periods=1.0):
    """Steps, points, and the seconds that Kratos took for the steps."""
    exact = Exact(name, amplitude)
    folder.mkdir(parents=True, exist_ok=True)
    end = periods * exact.period
    between = int(numpy.ceil(end / (cfl / cells / exact.speed) / (frames - 1) - 1e-9)) if frames else 1
    steps = between * (frames - 1) if frames else int(numpy.ceil(end / (cfl / cells / exact.speed) - 1e-9))
    dt = end / steps
    solver = Solver(exact, cells, scheme, dt)
    b = exact.body_force(solver.X)
    recording = Recording(folder, "particles", exact.name, exact.parameters)
    seconds = 0.0
    for step in range(steps + 1):
        if step % between == 0:
            stress, density = solver.get(MPM.MP_CAUCHY_STRESS_VECTOR), solver.get(MPM.MP_DENSITY)[:, 0]
            xx, yy, xy = stress.T[:3]
            arrays = {
                "reference_position": padded(solver.X),
                "displacement": padded(solver.get(MPM.MP_DISPLACEMENT)),
                "velocity": padded(solver.get(MPM.MP_VELOCITY)),
                "cauchy": numpy.column_stack([xx, xy, xy, yy]),
                "density": density,
            }
            if name == "axis-aligned":
                arrays["F"], arrays["P"] = diagonal(stress, density, exact)
            recording.write(step * dt, solver.get(MPM.MP_COORD), arrays)
        force = b((step + FORCE_AT[scheme]) * dt)
        started = time.process_time()
        solver.step(force)
        seconds += time.process_time() - started
    return steps, len(solver.points), seconds


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", choices=["axis-aligned", "swirl"])
    parser.add_argument("cells", type=int)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scheme", choices=FORCE_AT, default="usl")
    parser.add_argument("--amplitude", type=float, default=0.001)
    parser.add_argument("--cfl", type=float, default=0.4)
    parser.add_argument("--periods", type=float, default=1.0)
    parser.add_argument("--frames", type=int, default=11, help="frames; 0 is one for each step")
    options = parser.parse_args(arguments)
    Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
    steps, points, seconds = run(**vars(options))
    print(f"{options.name}, {options.cells} cells, {options.scheme}: {steps} steps of {points} points, {seconds:.2f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
