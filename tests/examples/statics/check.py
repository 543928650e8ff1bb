"""Solves `skew-2d` at rest with finite elements of degree 1 and 2, and compares the orders with theory.

    python check.py MMS FOLDER

The deformation of a time stays: its force is static_force, -Div P, of the NumPy file that `mms gen` writes. Neo-Hookean
plane strain by Newton's method with scikit-fem, quadrilaterals, the motion prescribed all around. The mean-square error of u on the
finest pair of meshes must fall with order 2 for degree 1 and with order 3 for degree 2, to a tenth; and it must not where the force
lacks its last share, as with a factor of 0.99. Exit status: 0 where that holds, else 1.
"""

import sys
from pathlib import Path

import numpy
import skfem
from skfem.helpers import ddot, dot, grad, transpose

sys.path.insert(0, str(Path(__file__).parents[1]))
from at_rest import solution  # noqa: E402

TIME = 0.008
CELLS = (4, 8, 16)


def inverse(F):
    J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    return J, numpy.array([[F[1, 1], -F[0, 1]], [-F[1, 0], F[0, 0]]]) / J


def product(A, B):
    return numpy.einsum("ik...,kj...->ij...", A, B)


def solve(exact, cells, degree, share=1.0):
    """The mean-square error of u, and the rounds of Newton's method."""
    lam, mu = exact.lambda_(), exact.mu()
    places = numpy.linspace(0.0, 1.0, cells + 1)
    element = skfem.ElementVector({1: skfem.ElementQuad1, 2: skfem.ElementQuad2}[degree]())
    basis = skfem.Basis(skfem.MeshQuad.init_tensor(places, places), element, intorder=2 * degree + 2)
    at_points = lambda field: numpy.moveaxis(field(numpy.moveaxis(basis.global_coordinates().value, 0, -1), TIME), -1, 0)
    load, motion = share * at_points(exact.static_force), at_points(exact.u)

    @skfem.BilinearForm
    def stiffness(u, v, w):
        F = grad(w["now"]) + numpy.eye(2)[:, :, None, None]
        J, G = inverse(F)
        step = grad(u)
        bent = transpose(product(product(G, step), G))
        stress = mu * step + (mu - lam * numpy.log(J)) * bent + lam * ddot(transpose(G), step) * transpose(G)
        return ddot(stress, grad(v))

    @skfem.LinearForm
    def residual(v, w):
        F = grad(w["now"]) + numpy.eye(2)[:, :, None, None]
        J, G = inverse(F)
        P = mu * (F - transpose(G)) + lam * numpy.log(J) * transpose(G)
        return dot(load, v) - ddot(P, grad(v))

    # The component that each degree of freedom is of.
    component = numpy.empty(basis.N, dtype=int)
    for dofs in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        for i in range(2):
            component[dofs[i::2]] = i
    u = numpy.zeros(basis.N)
    around = basis.get_dofs().all()
    at_nodes = exact.u(basis.doflocs.T, TIME)[numpy.arange(basis.N), component]
    rounds = 0
    for rounds in range(1, 30):
        now = basis.interpolate(u)
        change = at_nodes - u
        change[basis.complement_dofs(around)] = 0.0
        step = skfem.solve(*skfem.condense(stiffness.assemble(basis, now=now), residual.assemble(basis, now=now), x=change, D=around))
        u += step
        if numpy.max(numpy.abs(step)) < 1e-11:
            break
    error = basis.interpolate(u).value - motion
    return numpy.sqrt(numpy.sum(error**2 * basis.dx)), rounds


def main(mms, folder):
    exact = solution(mms, "skew-2d", folder)
    failed = False
    for degree in (1, 2):
        for share in (1.0, 0.99):
            errors = []
            for cells in CELLS:
                error, rounds = solve(exact, cells, degree, share)
                errors.append(error)
            order = numpy.log2(errors[-2] / errors[-1])
            right = abs(order - (degree + 1)) <= 0.1
            passed = right == (share == 1.0)
            failed |= not passed
            print(
                f"{'passed' if passed else 'FAILED'}: degree {degree}, {share} of the force: order {order:.3f} in u, errors "
                f"{', '.join(f'{error:.3e}' for error in errors)}, {rounds} rounds at the last"
            )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
