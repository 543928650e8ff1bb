"""A solver to be verified: total-Lagrangian finite elements with scikit-fem.

Bilinear quadrilaterals, lumped mass, explicit central differences, neo-Hookean in plane strain. Of mmsmith it takes body force,
tractions, constants, and initial and prescribed values; geometry, material, equations of motion and time integration are
scikit-fem's and this file's own. A ring is meshed in polar coordinates, a quarter of it.
"""

import numpy
import skfem
from skfem.helpers import ddot, dot, grad

from mmsmith import Annulus

# Time step times wave speed over element size. Where a body shears much, as the vortex does by six, the stiffness that a
# reference element meets grows with the square of that.
CFL = {"vortex": 0.05}


def mesh_of(solution, cells):
    """The mesh, and for each surface which nodes lie on it."""
    size = solution.cell_length / cells
    domain = solution.domain
    if isinstance(domain, Annulus):
        lower, upper = (domain.inner, 0.0), (domain.outer, numpy.pi / 2)
        counts = [round((domain.outer - domain.inner) / size), cells]
        names = [("inner", "outer"), ("Y-lower", "X-lower")]
    else:
        lower, upper = domain.lower, domain.upper
        counts = [round((last - first) / size) for first, last in zip(lower, upper)]
        names = [("X-lower", "X-upper"), ("Y-lower", "Y-upper")]
    axes = [numpy.linspace(first, last, count + 1) for first, last, count in zip(lower, upper, counts)]
    mesh = skfem.MeshQuad.init_tensor(*axes)
    sides = {}
    for axis, (first, last) in enumerate(names):
        sides[first] = mesh.p[axis] == axes[axis][0]
        sides[last] = mesh.p[axis] == axes[axis][-1]
    if isinstance(domain, Annulus):
        R, theta = mesh.p
        mesh = skfem.MeshQuad(numpy.stack([R * numpy.cos(theta), R * numpy.sin(theta)]), mesh.t)
    return mesh, sides


def by_component(solution, surface):
    """The conditions on the components along X and Y: `prescribed-motion`, `prescribed-traction` or `traction-free`."""
    condition = solution.boundaries.get(surface, "prescribed-motion")
    if condition in ("symmetry", "sliding"):
        condition = "normal prescribed-motion, tangential traction-free"
    if "," not in condition:
        return [condition, condition]
    if surface[0] not in "XY":
        raise NotImplementedError(f"{condition} on {surface}: components here are those along X and Y")
    parts = dict(part.split() for part in condition.split(", "))
    return [parts["normal" if axis == surface[0] else "tangential"] for axis in "XY"]


def first_piola_kirchhoff(F, lam, mu):
    """tau = lambda ln(J) I + mu (F F^T - I), P = tau F^-T."""
    J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    if not (J > 0).all():
        raise FloatingPointError("an element is inside out")
    inverse_transposed = numpy.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]]) / J
    return mu * F + (lam * numpy.log(J) - mu) * inverse_transposed


@skfem.LinearForm
def balance(v, w):
    return dot(w.b, v) - ddot(w.P, grad(v))


@skfem.LinearForm
def load(v, w):
    return dot(w.traction, v)


def rows(values):
    """Vectors or tensors of shape (2, ..., elements, points) as (n, 2, ...)."""
    return numpy.moveaxis(values.reshape(*values.shape[:-2], -1), -1, 0)


def solve(solution, cells, periods=0.4, where="nodes"):
    """Displacements at the nodes after so many periods; or displacements, F and P at the points of the elements."""
    mesh, sides = mesh_of(solution, cells)
    element = skfem.ElementVector(skfem.ElementQuad1())
    basis = skfem.Basis(mesh, element, intorder=3)
    inside = basis.global_coordinates().value
    nodes, points = solution.points(mesh.p.T), solution.points(rows(inside))
    scalar = skfem.Basis(mesh, skfem.ElementQuad1(), intorder=3)
    mass = solution.density * skfem.asm(skfem.LinearForm(lambda v, w: v), scalar)[:, None]
    held, loaded = numpy.zeros((mesh.nvertices, 2), bool), []
    for surface, on in sides.items():
        conditions = by_component(solution, surface)
        held[on] |= [condition == "prescribed-motion" for condition in conditions]
        given = numpy.array([condition == "prescribed-traction" for condition in conditions])
        if given.any():
            facets = mesh.boundary_facets()
            basis_of_side = skfem.FacetBasis(mesh, element, facets=facets[on[mesh.facets[:, facets]].all(axis=0)])
            loaded.append((surface, given, basis_of_side))

    def state(u):
        F = basis.interpolate(u.ravel()).grad + numpy.eye(2)[:, :, None, None]
        return F, first_piola_kirchhoff(F, solution.law["lambda"], solution.law["mu"])

    def acceleration(u, t):
        b = solution.density * points.b(t).T.reshape(inside.shape)
        force = skfem.asm(balance, basis, b=b, P=state(u)[1])
        for surface, given, facet_basis in loaded:
            X = facet_basis.global_coordinates().value
            traction = solution.traction(surface, rows(X), t) * given
            force += skfem.asm(load, facet_basis, traction=traction.T.reshape(X.shape))
        return force.reshape(-1, 2) / mass

    end = periods * solution.period
    longest = CFL.get(solution.name, 0.3) * solution.cell_length / cells / solution.wave_speed
    steps = int(numpy.ceil(end / longest))
    dt = end / steps
    u = nodes.u(0.0)
    # Half a step back, so that the first whole one leads to the velocity between the first two times.
    v = nodes.v(0.0) - dt / 2 * acceleration(u, 0.0)
    for step in range(steps):
        v += dt * acceleration(u, step * dt)
        moved = numpy.where(held, nodes.u((step + 1) * dt), u + dt * v)
        v, u = (moved - u) / dt, moved
    if where == "nodes":
        return {"X": mesh.p.T, "t": end, "u": u}
    F, P = state(u)
    return {"X": rows(inside), "t": end, "u": rows(basis.interpolate(u.ravel()).value), "F": rows(F), "P": rows(P)}
