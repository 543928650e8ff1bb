"""Stretches a material point of Kratos along X, turns it by a right angle in a thousand steps, and prints its Cauchy stress.

    python turn.py

A law that is isotropic turns the stress with the body: XX and YY change places. Each step is the explicit stress update of one
point in a cell whose nodes move as a rigid body.
"""

import math

import numpy
from solve import MPM, Exact, Kratos, Solver

STEPS = 1000

Kratos.Logger.GetDefaultOutput().SetSeverity(Kratos.Logger.Severity.WARNING)
solver = Solver(Exact("axis-aligned", 1e-9), 1, "usl", 1e-6)
point = solver.points[0]


def tell(what):
    xx, yy, xy = point.CalculateOnIntegrationPoints(MPM.MP_CAUCHY_STRESS_VECTOR, solver.info)[0]
    print(f"{what}: XX {xx:.0f}, YY {yy:.0f}, XY {xy:.0f}")


solver.follow(point, numpy.diag([0.1, 0.0]))
tell("stretched by a tenth")
angle = math.pi / 2 / STEPS
turn = numpy.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
for _ in range(STEPS):
    solver.follow(point, turn - numpy.eye(2))
tell("and turned by a right angle")
