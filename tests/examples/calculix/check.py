"""Solves a block at rest with CalculiX, whose body force comes from the generated file, and looks at the order.

    python check.py MMS SOURCES FOLDER

SOURCES is the folder `src` of CalculiX 2.20 where it was built, with its archive `ccx_2.20.a`: a user subroutine is compiled in. The law
is that of St. Venant and Kirchhoff, which CalculiX has for *ELASTIC with NLGEOM. The motion is prescribed all around. The
mean-square error of u at the nodes inside must fall with an order of 2 for linear bricks and of 3 for those with twenty nodes, less a
tenth; and it must not where the force lacks its last share. Exit status: 0 where that holds, else 1.
"""

import importlib.util
import itertools
import re
import subprocess
import sys
from pathlib import Path

import numpy

HERE = Path(__file__).parent
CELLS = {"C3D8": (4, 8, 16), "C3D20": (2, 4, 8)}
DEGREE = {"C3D8": 1, "C3D20": 2}
# Corners and middles of edges, in halves of the edge, as CalculiX counts them.
NODES = [
    (0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2),
    (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2),
    (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1),
]  # fmt: skip


def solution(mms, folder):
    for target in ("numpy", "calculix"):
        subprocess.run([mms, "gen", HERE.parent / "block.toml", "--target", target, "--out", folder], check=True, stdout=subprocess.DEVNULL)
    spec = importlib.util.spec_from_file_location("block_numpy", folder / "block_numpy.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Solution()


def program(sources, folder, share):
    """CalculiX with the generated user subroutine, for a static step, with the force times `share`."""
    routine = (folder / "block_calculix.f90").read_text()
    for of, by in (("is_static = .false.", "is_static = .true."), ("f = values(jltyp)", f"f = {share}_dp * values(jltyp)")):
        assert routine.count(of) == 1
        routine = routine.replace(of, by)
    (folder / "dload.f90").write_text(routine)
    # The archive has a subroutine of the same name: the first one counts.
    libraries = ["-Wl,--allow-multiple-definition", "-lspooles", "-lpthread", "-larpack", "-llapack", "-lblas", "-lm", "-fopenmp"]
    command = ["gfortran", "-O2", "-ffp-contract=off", "-o", "ccx", "dload.f90", sources / "ccx_2.20.o", sources / "ccx_2.20.a"]
    subprocess.run([*command, *libraries], cwd=folder, check=True)
    return folder / "ccx"


def solve(exact, ccx, folder, kind, cells):
    """The mean-square error of the displacements of the nodes inside."""
    numbers, elements = {}, []
    for cell in itertools.product(range(cells), repeat=3):
        places = [tuple(2 * c + n for c, n in zip(cell, node)) for node in NODES[: int(kind[3:])]]
        elements.append([numbers.setdefault(place, len(numbers) + 1) for place in places])
    X = numpy.array(list(numbers)) / (2 * cells)
    u = exact.u(X, 0.0)
    outside = numpy.any((X == 0.0) | (X == 1.0), axis=1)
    lines = ["*NODE, NSET=ALL", *(f"{n + 1}, {x[0]!r}, {x[1]!r}, {x[2]!r}" for n, x in enumerate(X.tolist()))]
    lines.append(f"*ELEMENT, TYPE={kind}, ELSET=BODY")
    for number, nodes in enumerate(elements, 1):
        # At most 16 numbers stand in a line.
        own = [number, *nodes]
        lines += [", ".join(map(str, own[:16])) + ("," if len(own) > 16 else "")]
        lines += [", ".join(map(str, own[16:]))] if len(own) > 16 else []
    E = exact.mu() * (3 * exact.lambda_() + 2 * exact.mu()) / (exact.lambda_() + exact.mu())
    nu = exact.lambda_() / (2 * (exact.lambda_() + exact.mu()))
    lines += ["*MATERIAL, NAME=BLOCK", "*ELASTIC", f"{E!r}, {nu!r}", "*DENSITY", f"{exact.density()!r}"]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=BLOCK", "*STEP, NLGEOM", "*STATIC, DIRECT", "1., 1.", "*BOUNDARY"]
    # A number has at most 20 characters.
    lines += [f"{n + 1}, {i + 1}, {i + 1}, {u[n, i]:.12g}" for n in numpy.flatnonzero(outside) for i in range(3)]
    lines += ["*DLOAD", *(f"BODY, B{axis}NU, 1." for axis in "XYZ"), "*NODE PRINT, NSET=ALL", "U", "*END STEP"]
    (folder / "block.inp").write_text("\n".join(lines) + "\n")
    with open(folder / "ccx.log", "w") as log:
        subprocess.run([ccx, "block"], cwd=folder, check=True, stdout=log, stderr=log)
    text = (folder / "block.dat").read_text()
    rows = numpy.array([[float(x) for x in line.split()] for line in text.splitlines() if re.match(r"\s+\d+\s+[-\d]", line)])
    found = numpy.empty_like(u)
    found[rows[:, 0].astype(int) - 1] = rows[:, 1:4]
    return numpy.sqrt(numpy.mean((found - u)[~outside] ** 2))


def main(mms, sources, folder):
    folder = Path(folder).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    exact = solution(mms, folder)
    failed = False
    for share in (1.0, 0.9):
        ccx = program(Path(sources).resolve(), folder, share)
        for kind, cells in CELLS.items():
            errors = [solve(exact, ccx, folder, kind, n) for n in cells]
            order = numpy.log2(errors[-2] / errors[-1])
            right = order >= DEGREE[kind] + 1 - 0.1
            passed = right == (share == 1.0)
            failed |= not passed
            told = ", ".join(f"{error:.3e}" for error in errors)
            print(f"{'passed' if passed else 'FAILED'}: {kind}, {share} of the force: order {order:.3f} in u, errors {told}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
