"""Solves the ring or the vortex with scikit-fem, for `mms score` to measure.

    python solve.py ring|vortex CELLS FOLDER [--include DIR] [--frames N] [--cfl X]

Total-Lagrangian finite elements on a body-fitted polar mesh of bilinear quadrilaterals, lumped mass, explicit central
differences. Of mmsmith only the generated C header is used: for the body force, the constants, and initial and
prescribed values. Geometry, material, equations of motion and time integration are scikit-fem's and this file's own.

Written into FOLDER are two recordings:

    nodes.pvd       the mesh, its points at current positions; displacement and velocity at the nodes, and the
                    deformation gradient averaged there (lumped projection)
    quadrature.pvd  the 2 x 2 points of each element; displacement, and deformation gradient and first Piola-Kirchhoff
                    stress as the element has them: piecewise, and of first order

Elements are 1/CELLS of the solution's cell length across.
"""

import argparse
import ctypes
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import meshio
import numpy
import skfem
from skfem.helpers import ddot, dot, grad

# Time step times wave speed over element size. The vortex shears by six, and the stiffness that a reference element meets
# grows with the square of that.
CFL = {"ring": 0.3, "vortex": 0.05}

HERE = Path(__file__).parent
INCLUDE = HERE.parents[2] / "crates" / "solutions" / "include"


class Exact:
    """The generated header, compiled."""

    def __init__(self, name, include):
        with tempfile.TemporaryDirectory() as folder:
            library = Path(folder) / "exact.so"
            flags = ["-O2", "-shared", "-fPIC", "-ffp-contract=off", f"-I{include}"]
            names = [f'-DHEADER="mmsmith/{name}.h"', f"-DNAME={name}"]
            compiler = os.environ.get("CC", "cc")
            subprocess.run([compiler, *flags, *names, HERE / "exact.c", "-o", library, "-lm"], check=True)
            self.library = ctypes.CDLL(str(library))
        self.library.prepare.restype = ctypes.c_char_p
        self.library.point_count.restype = ctypes.c_size_t
        message = self.library.prepare()
        if message:
            raise ValueError(message.decode())
        constants = numpy.empty(8)
        self.library.constants(pointer(constants))
        self.lam, self.mu, self.rho0, self.inner, self.outer, self.period, self.speed, self.cell_length = map(
            float, constants
        )

    def motion(self, X, t):
        """u and v at reference positions X of shape (2, ...)."""
        rows = numpy.ascontiguousarray(X.reshape(2, -1).T)
        u, v = numpy.empty_like(rows), numpy.empty_like(rows)
        count = ctypes.c_size_t(len(rows))
        self.library.motion(ctypes.c_double(t), count, pointer(rows), pointer(u), pointer(v))
        return u.T.reshape(X.shape), v.T.reshape(X.shape)

    def body_force(self, X):
        """b at fixed positions X of shape (2, ...), as a function of time."""
        rows = numpy.ascontiguousarray(X.reshape(2, -1).T)
        count = ctypes.c_size_t(len(rows))
        kept = numpy.empty((self.library.point_count(), len(rows)))
        self.library.points(count, pointer(rows), pointer(kept))
        b = numpy.empty_like(rows)

        def at(t):
            self.library.body_force(ctypes.c_double(t), count, pointer(kept), pointer(b))
            return b.T.reshape(X.shape)

        return at


def pointer(array):
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def polar_mesh(inner, outer, across, around, angle):
    """Quadrilaterals between two circles over an angle; closed where it is the full one."""
    is_closed = angle == 2 * numpy.pi
    columns = around if is_closed else around + 1
    R, theta = numpy.meshgrid(
        numpy.linspace(inner, outer, across + 1), numpy.arange(columns) * (angle / around), indexing="ij"
    )
    X = numpy.stack([(R * numpy.cos(theta)).ravel(), (R * numpy.sin(theta)).ravel()])
    if not is_closed:
        # The cosine of a right angle is not zero in floating point.
        X[0, columns - 1 :: columns] = 0.0
    i, j = (index.ravel() for index in numpy.meshgrid(numpy.arange(across), numpy.arange(around), indexing="ij"))
    node = lambda i, j: i * columns + j % columns
    return skfem.MeshQuad(X, numpy.stack([node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)]))


def first_piola_kirchhoff(F, lam, mu):
    """Neo-Hookean, in plane strain: tau = lambda ln(J) I + mu (F F^T - I), P = tau F^-T."""
    J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
    if not (J > 0).all():
        raise FloatingPointError("an element is inside out")
    inverse_transposed = numpy.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]]) / J
    return mu * F + (lam * numpy.log(J) - mu) * inverse_transposed


@skfem.LinearForm
def force(v, w):
    return dot(w.b, v) - ddot(w.P, grad(v))


class Solver:
    def __init__(self, name, cells, exact):
        self.exact = exact
        size = exact.cell_length / cells
        across = round((exact.outer - exact.inner) / size)
        self.full = name == "vortex"
        angle = 2 * numpy.pi if self.full else numpy.pi / 2
        # Whole numbers that double with the cells; elements are then about as wide as high.
        around = 6 * cells if self.full else cells
        self.mesh = polar_mesh(exact.inner, exact.outer, across, around, angle)
        element = skfem.ElementVector(skfem.ElementQuad1())
        self.basis = skfem.Basis(self.mesh, element, intorder=3)
        self.X = self.basis.doflocs[:, ::2]
        assert (self.basis.doflocs[:, ::2] == self.basis.doflocs[:, 1::2]).all()
        self.X_quadrature = self.basis.global_coordinates().value
        scalar = skfem.Basis(self.mesh, skfem.ElementQuad1(), intorder=3)
        self.scalar = scalar
        self.volume = skfem.asm(skfem.LinearForm(lambda v, w: v), scalar)
        self.mass = exact.rho0 * numpy.repeat(self.volume, 2)
        self.b = exact.body_force(self.X_quadrature)
        R = numpy.hypot(*self.X)
        if self.full:
            self.held = (R < exact.inner * 1.000001) | (R > exact.outer * 0.999999)
        # The quarter's planes of symmetry.
        self.on_planes = numpy.stack([self.X[0] == 0.0, self.X[1] == 0.0])

    def state(self, u):
        """Interpolated displacement, F and P at the quadrature points."""
        field = self.basis.interpolate(u)
        F = field.grad + numpy.eye(2)[:, :, None, None]
        return field.value, F, first_piola_kirchhoff(F, self.exact.lam, self.exact.mu)

    def acceleration(self, P, t):
        f = skfem.asm(force, self.basis, b=self.exact.rho0 * self.b(t), P=P)
        return f / self.mass

    def constrain(self, rows, exact_rows):
        """Prescribed values at the nodes, as (2, nodes): the rims of the vortex, the ring's planes of symmetry."""
        if self.full:
            rows[:, self.held] = exact_rows[:, self.held]
        else:
            rows[self.on_planes] = 0.0

    def averaged(self, values):
        """A field at the quadrature points, averaged to the nodes."""
        form = skfem.LinearForm(lambda v, w: w.value * v)
        return skfem.asm(form, self.scalar, value=values) / self.volume


def rows_of(dofs):
    return dofs.reshape(-1, 2).T


def dofs_of(rows):
    return rows.T.ravel()


class Recording:
    """A .pvd list that grows with its frames."""

    def __init__(self, folder, name):
        self.folder, self.name, self.listed = folder, name, []

    def write(self, t, points, cells, arrays):
        file = f"{self.name}-{len(self.listed):04}.vtu"
        mesh = meshio.Mesh(padded(points), cells, point_data=arrays)
        mesh.write(self.folder / file, file_format="vtu", binary=True, compression="zlib")
        self.listed.append(f'    <DataSet timestep="{t!r}" part="0" file="{file}"/>\n')
        text = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
        text += "  <Collection>\n" + "".join(self.listed) + "  </Collection>\n</VTKFile>\n"
        (self.folder / f"{self.name}.pvd").write_text(text, encoding="ascii")


def padded(rows):
    """(2, n) as n vectors of three components."""
    return numpy.column_stack([rows[0].ravel(), rows[1].ravel(), numpy.zeros(rows[0].size)])


def by_rows(tensor, normal):
    """(2, 2, n) as n tensors of nine components, row by row."""
    full = numpy.zeros((tensor[0, 0].size, 9))
    for i in range(2):
        for j in range(2):
            full[:, 3 * i + j] = tensor[i, j].ravel()
    full[:, 8] = normal
    return full


def run(name, cells, folder, include=INCLUDE, frames=11, cfl=None):
    exact = Exact(name, include)
    solver = Solver(name, cells, exact)
    folder.mkdir(parents=True, exist_ok=True)
    nodes, quadrature = Recording(folder, "nodes"), Recording(folder, "quadrature")
    longest = (cfl or CFL[name]) * exact.cell_length / cells / exact.speed
    # Whole steps from frame to frame.
    between = int(numpy.ceil(exact.period / longest / (frames - 1)))
    steps = between * (frames - 1)
    dt = exact.period / steps

    u, v0 = exact.motion(solver.X, 0.0)
    u = dofs_of(u)
    v_half = None
    for step in range(steps + 1):
        t = step * dt
        u_quadrature, F, P = solver.state(u)
        a = solver.acceleration(P, t)
        exact_v = exact.motion(solver.X, t)[1]
        # The velocity of this very time, between the half steps.
        v = dofs_of(v0) if step == 0 else v_half + dt / 2 * a
        if step % between == 0:
            v_rows = rows_of(v).copy()
            solver.constrain(v_rows, exact_v)
            averaged = numpy.array([[solver.averaged(F[i, j]) for j in range(2)] for i in range(2)])
            arrays = {
                "displacement": padded(rows_of(u)),
                "velocity": padded(v_rows),
                "deformation_gradient": by_rows(averaged, 1.0),
            }
            nodes.write(t, solver.X + rows_of(u), [("quad", solver.mesh.t.T)], arrays)
            arrays = {
                "displacement": padded(u_quadrature),
                "deformation_gradient": by_rows(F, 1.0),
                # The stress normal to the plane: lambda ln J.
                "first_piola_kirchhoff": by_rows(P, exact.lam * numpy.log(numpy.linalg.det(F.T)).T.ravel()),
            }
            count = u_quadrature[0].size
            vertices = [("vertex", numpy.arange(count)[:, None])]
            quadrature.write(t, solver.X_quadrature + u_quadrature, vertices, arrays)
        v_half = v + dt / 2 * a
        rows = rows_of(u + dt * v_half).copy()
        solver.constrain(rows, exact.motion(solver.X, t + dt)[0])
        # What the constraints changed belongs to the velocity as well.
        v_half = (dofs_of(rows) - u) / dt
        u = dofs_of(rows)
    return steps, dt


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", choices=["ring", "vortex"])
    parser.add_argument("cells", type=int)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--include", type=Path, default=INCLUDE)
    parser.add_argument("--frames", type=int, default=11)
    parser.add_argument("--cfl", type=float)
    options = parser.parse_args(arguments)
    steps, dt = run(**vars(options))
    print(f"{options.name}, {options.cells} cells: {steps} steps of {dt!r}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
