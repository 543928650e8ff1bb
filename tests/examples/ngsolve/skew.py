"""Solves `skew-2d` in time with the finite elements of NGSolve and the NumPy file that `mms gen` writes, and has it scored.

    python skew.py MMS FOLDER CELLS,CELLS,...

The elements and the time steps are those of solve.py, of degree 1; the motion is prescribed all around, at the nodes. The mean-square error
of u on the finest pair of meshes must fall with order 2, to a tenth. Exit status: 0 where it does, else 1.
"""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy
from solve import Recording, Solver

FRAMES = 11
CFL = 0.2


def generated(mms, folder):
    subprocess.run([mms, "gen", "skew-2d", "--target", "numpy", "--out", folder], check=True, stdout=subprocess.DEVNULL)
    spec = importlib.util.spec_from_file_location("skew_2d_numpy", folder / "skew_2d_numpy.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Solution()


def run(exact, cells, folder):
    folder.mkdir(parents=True, exist_ok=True)
    parameters = dict(zip(exact.DEFAULTS, exact.par))
    solver = Solver(SimpleNamespace(**parameters), cells, degree=1)
    nodes = numpy.array([vertex.point for vertex in solver.space.mesh.vertices])
    walls = numpy.array([not free for free in solver.space.components[0].FreeDofs()])

    def prescribe(grid_function, values, where=slice(None)):
        for component, column in zip(grid_function.components, values.T):
            component.vec.FV().NumPy()[where] = column[where]

    between = int(numpy.ceil(exact.period() * exact.wave_speed() * cells / CFL / (FRAMES - 1) - 1e-9))
    steps = between * (FRAMES - 1)
    dt = exact.period() / steps
    prescribe(solver.u, exact.u(nodes, 0.0))
    prescribe(solver.v, exact.v(nodes, 0.0))
    recording = Recording(folder, "quadrature", "skew-2d", parameters)
    for step in range(steps + 1):
        t = step * dt
        # The old time of the step: that of the displacements that the stresses belong to.
        a = solver.acceleration(exact.b(solver.X, t))
        if step > 0:
            solver.v.vec.data += dt / 2 * a
        prescribe(solver.v, exact.v(nodes, t), walls)
        if step % between == 0:
            arrays = solver.arrays(solver.v)
            recording.write(t, solver.X + arrays["displacement"][:, :2], arrays)
        solver.v.vec.data += dt / 2 * a
        solver.u.vec.data += dt * solver.v.vec
        prescribe(solver.u, exact.u(nodes, t + dt), walls)
    return steps


def main(mms, folder, cells):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    exact = generated(mms, folder)
    recordings = [folder / count for count in cells.split(",")]
    for count, recording in zip(cells.split(","), recordings):
        print(f"{count} cells: {run(exact, int(count), recording)} steps", flush=True)
    output = folder / "score.json"
    subprocess.run([mms, "score", "skew-2d", *map(str, recordings), "--cells", cells, "--json", str(output)], check=True)
    order = json.loads(output.read_text(encoding="utf-8"))["orders"]["u"]["l2"]["local"][-1]
    passed = abs(order - 2.0) <= 0.1
    print(f"{'passed' if passed else 'FAILED'}: u: order {order:.3f}, expected 2 +/- 0.1")
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
