"""Plants mistakes in the tangent of finite elements, tells them by the exponent of Newton's method, and names them.

    python tangents.py MMS FOLDER

Solves `skew-2d` at rest with quadrilaterals and Newton's method in NumPy. With the right tangent `mms score --newton` must find the residuals
quadratic, and with each mistake not; `mms diagnose --tangent` must name each one by the values of dP/dF at some points, or, where the law's
tangent is right and what is beside it is not, say so. Exit status: 0 where all that holds, else 1.
"""

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve

sys.path.insert(0, str(Path(__file__).parents[1]))
from at_rest import solution  # noqa: E402

TIME = 0.008
CELLS = 8
I = numpy.eye(2)

# A function of F[..., i, J] and the moduli each, that gives dP_iJ/dF_kL as [..., i, J, k, L].


def stress(F, lam, mu):
    turned = numpy.swapaxes(numpy.linalg.inv(F), -1, -2)
    logarithm = numpy.log(numpy.linalg.det(F))[..., None, None]
    return mu * (F - turned) + lam * logarithm * turned


def right(F, lam, mu):
    G = numpy.linalg.inv(F)
    logarithm = numpy.log(numpy.linalg.det(F))[..., None, None, None, None]
    turned = numpy.einsum("...Jk,...Li->...iJkL", G, G)
    return mu * unit(F) + (mu - lam * logarithm) * turned + lam * numpy.einsum("...Ji,...Lk->...iJkL", G, G)


def unit(F):
    return numpy.broadcast_to(numpy.einsum("ik,JL->iJkL", I, I), F.shape + (2, 2))


def without_geometric_stiffness(F, lam, mu):
    S = numpy.linalg.inv(F) @ stress(F, lam, mu)
    return right(F, lam, mu) - numpy.einsum("ik,...JL->...iJkL", I, S)


def at_rest(F, lam, mu):
    return right(numpy.broadcast_to(I, F.shape), lam, mu)


def st_venant_kirchhoff(F, lam, mu):
    C = numpy.swapaxes(F, -1, -2) @ F
    E = 0.5 * (C - I)
    S = lam * numpy.trace(E, axis1=-2, axis2=-1)[..., None, None] * I + 2.0 * mu * E
    material = lam * numpy.einsum("...iJ,...kL->...iJkL", F, F)
    material = material + mu * numpy.einsum("...ij,...kj,JL->...iJkL", F, F, I) + mu * numpy.einsum("...iL,...kJ->...iJkL", F, F)
    return material + numpy.einsum("ik,...JL->...iJkL", I, S)


def exchanged_moduli(F, lam, mu):
    return right(F, mu, lam)


def plane_stress(F, lam, mu):
    return right(F, 2.0 * lam * mu / (lam + 2.0 * mu), mu)


def without_logarithm(F, lam, mu):
    G = numpy.linalg.inv(F)
    return mu * unit(F) + mu * numpy.einsum("...Jk,...Li->...iJkL", G, G) + lam * numpy.einsum("...Ji,...Lk->...iJkL", G, G)


def not_transposed(F, lam, mu):
    G = numpy.linalg.inv(F)
    logarithm = numpy.log(numpy.linalg.det(F))[..., None, None, None, None]
    turned = numpy.einsum("...ki,...JL->...iJkL", G, G)
    return mu * unit(F) + (mu - lam * logarithm) * turned + lam * numpy.einsum("...Ji,...Lk->...iJkL", G, G)


def one_sided_differences(F, lam, mu, step=2e-2):
    A = numpy.empty(F.shape + (2, 2))
    for k in range(2):
        for L in range(2):
            beside = F.copy()
            beside[..., k, L] += step
            A[..., k, L] = (stress(beside, lam, mu) - stress(F, lam, mu)) / step
    return A


def symmetric_in_pairs(F, lam, mu):
    A = right(F, lam, mu)
    A = 0.5 * (A + numpy.swapaxes(A, -4, -3))
    return 0.5 * (A + numpy.swapaxes(A, -2, -1))


# What is planted, the function, and the name that `mms diagnose` has to find.
LAWS = {
    "none": (right, None),
    "geometric stiffness dropped": (without_geometric_stiffness, "geometric-stiffness-dropped"),
    "tangent at rest": (at_rest, "tangent-at-rest"),
    "tangent of another law": (st_venant_kirchhoff, "law-st-venant-kirchhoff"),
    "lambda and mu exchanged": (exchanged_moduli, "moduli-exchanged"),
    "lambda of plane stress": (plane_stress, "plane-stress"),
    "ln J forgotten": (without_logarithm, "logarithm-missing"),
    "dF not transposed": (not_transposed, "variation-not-transposed"),
    "one-sided differences with a step of 0.02": (one_sided_differences, "differences"),
    "made symmetric in each pair": (symmetric_in_pairs, "minor-symmetries"),
}
# Mistakes beside the law, whose tangent is right.
BESIDE = ("F-bar", "unsymmetric term of F-bar dropped", "matrix of the first iteration kept")


class Elements:
    """Quadrilaterals on the unit square: shape gradients [q, a, J] of one element, at four points and at the centre."""

    def __init__(self, cells):
        self.cells, h = cells, 1.0 / cells
        place = 0.5 + numpy.array([-1.0, 1.0]) / numpy.sqrt(12.0)
        points = numpy.array([(x, y) for y in place for x in place])
        self.gradients = numpy.array([self.slopes(*point) for point in points]) / h
        self.at_centre = self.slopes(0.5, 0.5) / h
        self.values = numpy.array([self.shapes(*point) for point in points])
        self.volume = h * h / 4
        corner = numpy.arange(cells + 1)
        self.X = numpy.stack(numpy.meshgrid(corner, corner, indexing="ij"), axis=-1).reshape(-1, 2) * h
        first = (numpy.arange(cells)[:, None] * (cells + 1) + numpy.arange(cells)).ravel()
        self.nodes = numpy.stack([first, first + cells + 1, first + 1, first + cells + 2], axis=1)
        self.points = numpy.einsum("qa,eai->eqi", self.values, self.X[self.nodes])
        self.dofs = (2 * self.nodes[:, :, None] + numpy.arange(2)).reshape(len(self.nodes), 8)
        self.around = numpy.repeat(numpy.any((self.X < 1e-9) | (self.X > 1 - 1e-9), axis=1), 2)

    @staticmethod
    def shapes(x, y):
        return numpy.array([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y])

    @staticmethod
    def slopes(x, y):
        return numpy.array([(y - 1, x - 1), (1 - y, -x), (-y, 1 - x), (y, x)])


def solve(exact, elements, tangent, beside=None):
    """The residuals, the deformation gradients that the law is asked for at last, and the tangents there."""
    lam, mu = exact.lambda_(), exact.mu()
    load = elements.volume * numpy.einsum("qa,eqi->eai", elements.values, exact.static_force(elements.points, TIME)).reshape(-1, 8)
    u = numpy.zeros(2 * len(elements.X))
    given = exact.u(elements.X, TIME).ravel()
    free = ~elements.around
    residuals, matrix = [], None
    for _ in range(60):
        own = u[elements.dofs].reshape(-1, 4, 2)
        F = I + numpy.einsum("eai,qaJ->eqiJ", own, elements.gradients)
        ratio, asked = 1.0, F
        if beside and "F-bar" in beside:
            centre = I + numpy.einsum("eai,aJ->eiJ", own, elements.at_centre)
            ratio = numpy.sqrt(numpy.linalg.det(centre)[:, None] / numpy.linalg.det(F))[..., None, None]
            asked = ratio * F
        P, A = stress(asked, lam, mu) / ratio, tangent(asked, lam, mu)
        # The derivative along the degree of freedom k of node b.
        along = numpy.einsum("eqiJkL,qbL->eqiJbk", A, elements.gradients)
        if beside == "F-bar":
            G, of_centre = numpy.linalg.inv(F), numpy.linalg.inv(centre)
            change = numpy.einsum("eLk,bL->ebk", of_centre, elements.at_centre)[:, None]
            change = 0.5 * (change - numpy.einsum("eqLk,qbL->eqbk", G, elements.gradients))
            scaled = numpy.einsum("eqiJkL,eqkL->eqiJ", A, F) - P
            along = along + numpy.einsum("eqiJ,eqbk->eqiJbk", scaled, change)
        forces = load - elements.volume * numpy.einsum("eqiJ,qaJ->eai", P, elements.gradients).reshape(-1, 8)
        residual = numpy.zeros(len(u))
        numpy.add.at(residual, elements.dofs, forces)
        if matrix is None or beside != "matrix of the first iteration kept":
            entries = elements.volume * numpy.einsum("eqiJbk,qaJ->eaibk", along, elements.gradients)
            rows, columns = (numpy.broadcast_to(n, (len(u[elements.dofs]), 8, 8)) for n in (elements.dofs[:, :, None], elements.dofs[:, None]))
            matrix = coo_matrix((entries.ravel(), (rows.ravel(), columns.ravel()))).tocsr()
        step = numpy.where(free, 0.0, given - u)
        right_side = residual - matrix @ step
        residuals.append(float(numpy.linalg.norm((right_side if not residuals else residual)[free])))
        if residuals[-1] < 1e-11 * residuals[0]:
            break
        step[free] = spsolve(matrix[free][:, free].tocsc(), right_side[free])
        u = u + step
    return residuals, asked, A


def write(path, elements, F, A):
    """Tangents at some points, with the deformation gradients that they belong to."""
    pairs = [f"{i}{j}" for i in (1, 2) for j in (1, 2)]
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["X", "Y", "t", *(f"F{pair}" for pair in pairs), *(f"dP{P}dF{own}" for P in pairs for own in pairs)])
        for element in range(5, len(F), 13):
            rows.writerow([*elements.points[element, 0], TIME, *F[element, 0].ravel(), *A[element, 0].ravel()])


def told(command):
    found = subprocess.run([*command, "--json", "-"], capture_output=True, text=True, check=False)
    return json.loads(found.stdout)


def main(mms, folder):
    folder = Path(folder)
    exact = solution(mms, "skew-2d", folder)
    elements = Elements(CELLS)
    failed = False
    kit = [(name, None, *own) for name, own in LAWS.items()] + [(name, name, right, None) for name in BESIDE]
    for name, beside, tangent, expected in kit:
        residuals, F, A = solve(exact, elements, tangent, beside)
        log, values = folder / "residuals.csv", folder / "tangent.csv"
        log.write_text("".join(["residual\n", *(f"{r!r}\n" for r in residuals)]))
        write(values, elements, F, A)
        history = told([mms, "score", "--newton", str(log)])["histories"][0]
        judged = told([mms, "diagnose", "skew-2d", "--tangent", str(values)])
        named = [cause["name"] for cause in judged["causes"]]
        is_quadratic = name in ("none", "F-bar")
        passed = (history["verdict"] == "quadratic") == is_quadratic
        passed &= judged["passed"] == (expected is None) and named[:1] == ([expected] if expected else [])
        failed |= not passed
        exponent = "-" if history["exponent"] is None else f"{history['exponent']:.2f}"
        print(
            f"{'passed' if passed else 'FAILED'}: {name}: {history['verdict']}, exponent {exponent}, {len(residuals)} residuals; "
            f"named {', '.join(named) or 'nothing in the law'}, which differs by {judged['error']:.1e}"
        )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
