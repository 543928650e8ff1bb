"""Solves specifications at rest with scikit-fem on the splines of `mms run --static`, and compares the errors digit by digit.

    python same_space.py MMS FOLDER

Splines of degree 1 are the bilinear elements, and those of degree 2 lie in the space of the biquadratic ones: coefficients of these follow from
those of the splines at the nodes. The moved sides have the least-squares fit of `mms`, integrals p + 1 Gauss points a cell and direction. Then both
programs solve the same equations, and the root of the mean square of the error of u at these points, each with the same weight, must agree to 1e-10
of its size. Exit status: 0 where it does, else 1.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy
import skfem
from scipy.interpolate import BSpline
from scipy.sparse import kron
from scipy.sparse.linalg import spsolve
from skfem.helpers import ddot, dot, grad, transpose

sys.path.insert(0, str(Path(__file__).parents[1]))
from at_rest import solution  # noqa: E402

CASES = [("skew-2d", 1, 8), ("skew-2d", 2, 8), ("skew-2d", 2, 16)]
# The moment in periods, and how far the errors may be apart, of their size.
MOMENT, AGREE = 0.25, 1e-10


class Splines:
    """Splines of a degree on cells of equal length between 0 and 1, with Gauss points."""

    def __init__(self, cells, degree):
        self.knots = numpy.concatenate([numpy.zeros(degree), numpy.linspace(0.0, 1.0, cells + 1), numpy.ones(degree)])
        self.degree = degree
        points, weights = numpy.polynomial.legendre.leggauss(degree + 1)
        self.of_cell, self.weights_of_cell = 0.5 * (points + 1.0), 0.5 * weights
        self.points = ((numpy.arange(cells)[:, None] + self.of_cell) / cells).ravel()
        self.weights = numpy.tile(self.weights_of_cell, cells) / cells

    def values(self, places):
        return BSpline.design_matrix(places, self.knots, self.degree)

    def fit(self, values, ends):
        """The coefficients of values at the Gauss points, by least squares, and of those at both ends."""
        N = self.values(self.points).toarray()
        matrix, right = N.T @ (self.weights[:, None] * N), N.T @ (self.weights[:, None] * values)
        c = numpy.empty((N.shape[1], values.shape[1]))
        c[0], c[-1] = ends
        inside = slice(1, -1)
        c[inside] = numpy.linalg.solve(matrix[inside, inside], right[inside] - matrix[inside][:, [0, -1]] @ ends)
        return c


def product(A, B):
    return numpy.einsum("ik...,kj...->ij...", A, B)


def inverse(F):
    J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    return J, numpy.array([[F[1, 1], -F[0, 1]], [-F[1, 0], F[0, 0]]]) / J


def solve(exact, corners, time, cells, degree):
    """The root of the mean square of the error of u at the Gauss points, which are not weighted as in an integral."""
    lam, mu = exact.lambda_(), exact.mu()
    lower, size = numpy.array(corners[0]), numpy.array(corners[1]) - numpy.array(corners[0])
    splines = Splines(cells, degree)
    x, y = (grid.ravel() for grid in numpy.meshgrid(splines.of_cell, splines.of_cell))
    weights = numpy.outer(splines.weights_of_cell, splines.weights_of_cell).ravel()
    places = [numpy.linspace(lower[k], lower[k] + size[k], cells + 1) for k in range(2)]
    element = skfem.ElementVector({1: skfem.ElementQuad1, 2: skfem.ElementQuad2}[degree]())
    basis = skfem.Basis(skfem.MeshQuad.init_tensor(*places), element, quadrature=(numpy.stack([x, y]), weights))
    inside = numpy.moveaxis(basis.global_coordinates().value, 0, -1)
    at_points = lambda field: numpy.moveaxis(field(inside, time), -1, 0)
    load, motion = at_points(exact.static_force), at_points(exact.u)

    @skfem.BilinearForm
    def stiffness(u, v, w):
        J, G = inverse(grad(w["now"]) + numpy.eye(2)[:, :, None, None])
        bent = transpose(product(product(G, grad(u)), G))
        stress = mu * grad(u) + (mu - lam * numpy.log(J)) * bent + lam * ddot(transpose(G), grad(u)) * transpose(G)
        return ddot(stress, grad(v))

    @skfem.LinearForm
    def residual(v, w):
        F = grad(w["now"]) + numpy.eye(2)[:, :, None, None]
        J, G = inverse(F)
        return dot(load, v) - ddot(mu * (F - transpose(G)) + lam * numpy.log(J) * transpose(G), grad(v))

    # From coefficients of splines, by component, to degrees of freedom: the values at the nodes.
    component = numpy.empty(basis.N, dtype=int)
    for dofs in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        for i in range(2):
            component[dofs[i::2]] = i
    along = splines.values(numpy.linspace(0.0, 1.0, degree * cells + 1))
    node = numpy.rint((basis.doflocs.T - lower) / size * degree * cells).astype(int)
    count = along.shape[1]
    row = (node[:, 0] * (degree * cells + 1) + node[:, 1]) * 2 + component
    to_nodes = kron(kron(along, along), numpy.eye(2)).tocsr()[row]

    # The motion of the sides.
    given = numpy.zeros((count, count, 2))
    held = numpy.zeros((count, count, 2), bool)
    for axis in range(2):
        for end in (0, 1):
            X = numpy.full((len(splines.points) + 2, 2), lower[axis] + end * size[axis])
            X[:, 1 - axis] = lower[1 - axis] + size[1 - axis] * numpy.concatenate([[0.0], splines.points, [1.0]])
            values = exact.u(X, time)
            side = (-end, slice(None)) if axis == 0 else (slice(None), -end)
            given[side], held[side] = splines.fit(values[1:-1], values[[0, -1]]), True
    given, free = given.ravel(), ~held.ravel()
    c = numpy.zeros_like(given)
    for _ in range(30):
        now = basis.interpolate(to_nodes @ c)
        matrix = (to_nodes.T @ stiffness.assemble(basis, now=now) @ to_nodes).tocsr()
        step = numpy.where(free, 0.0, given - c)
        right = to_nodes.T @ residual.assemble(basis, now=now) - matrix @ step
        step[free] = spsolve(matrix[free][:, free].tocsc(), right[free])
        c += step
        if numpy.max(numpy.abs(step)) < 1e-14:
            break
    error = basis.interpolate(to_nodes @ c).value - motion
    return numpy.sqrt(numpy.mean(numpy.sum(error**2, axis=0)))


def main(mms, folder):
    failed = False
    for name, degree, cells in CASES:
        shape = {1: "linear", 2: "bspline2"}[degree]
        command = [mms, "run", name, "--static", "--shape", shape, "--cells", str(cells), "--moment", str(MOMENT), "--json", "-"]
        found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        expected = found["result"]["errors"]["u"]["l2"]
        exact = solution(mms, name, folder)
        error = solve(exact, (exact.lower(), exact.upper()), MOMENT * exact.period(), cells, degree)
        apart = abs(error - expected) / expected
        passed = apart <= AGREE
        failed |= not passed
        print(f"{'passed' if passed else 'FAILED'}: {name}, {shape}, {cells} cells: {error:.12e} and {expected:.12e}, apart by {apart:.1e}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
