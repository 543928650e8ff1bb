"""Solves a block at rest with CalculiX, whose body force comes from the generated file, and looks at the order.

    python check.py MMS SOURCES FOLDER

SOURCES is the folder `src` of CalculiX 2.20 where it was built, with its archive `ccx_2.20.a`: a user subroutine is compiled in. The law
is that of St. Venant and Kirchhoff, which CalculiX has for *ELASTIC with NLGEOM. The motion is prescribed all around. The
mean-square error of u at the nodes inside must fall with an order of 2 for linear bricks and of 3 for those with twenty nodes, less a
tenth; and it must not where the force lacks its last share. Exit status: 0 where that holds, else 1.
"""

import re
import subprocess
import sys
from pathlib import Path

import numpy

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
from at_rest import Block, generate, judge, moduli, solution  # noqa: E402

CELLS = {"C3D8": (4, 8, 16), "C3D20": (2, 4, 8)}
DEGREE = {"C3D8": 1, "C3D20": 2}


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
    block = Block(cells, int(kind[3:]))
    X, u = block.X, exact.u(block.X, 0.0)
    lines = ["*NODE, NSET=ALL", *(f"{n + 1}, {x[0]!r}, {x[1]!r}, {x[2]!r}" for n, x in enumerate(X.tolist()))]
    lines.append(f"*ELEMENT, TYPE={kind}, ELSET=BODY")
    for number, nodes in enumerate(block.elements, 1):
        # At most 16 numbers stand in a line.
        own = [number, *nodes]
        lines += [", ".join(map(str, own[:16])) + ("," if len(own) > 16 else "")]
        lines += [", ".join(map(str, own[16:]))] if len(own) > 16 else []
    E, nu = moduli(exact)
    lines += ["*MATERIAL, NAME=BLOCK", "*ELASTIC", f"{E!r}, {nu!r}", "*DENSITY", f"{exact.density()!r}"]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=BLOCK", "*STEP, NLGEOM", "*STATIC, DIRECT", "1., 1.", "*BOUNDARY"]
    # A number has at most 20 characters.
    lines += [f"{n + 1}, {i + 1}, {i + 1}, {u[n, i]:.12g}" for n in numpy.flatnonzero(block.outside) for i in range(3)]
    lines += ["*DLOAD", *(f"BODY, B{axis}NU, 1." for axis in "XYZ"), "*NODE PRINT, NSET=ALL", "U", "*END STEP"]
    (folder / "block.inp").write_text("\n".join(lines) + "\n")
    with open(folder / "ccx.log", "w") as log:
        subprocess.run([ccx, "block"], cwd=folder, check=True, stdout=log, stderr=log)
    text = (folder / "block.dat").read_text()
    rows = numpy.array([[float(x) for x in line.split()] for line in text.splitlines() if re.match(r"\s+\d+\s+[-\d]", line)])
    found = numpy.empty_like(u)
    found[rows[:, 0].astype(int) - 1] = rows[:, 1:4]
    return block.error(found, u)


def main(mms, sources, folder):
    folder = Path(folder).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    specification = HERE.parent / "block.toml"
    generate(mms, specification, "calculix", folder)
    exact = solution(mms, specification, folder)
    passed = True
    for share in (1.0, 0.9):
        ccx = program(Path(sources).resolve(), folder, share)
        for kind, cells in CELLS.items():
            errors = [solve(exact, ccx, folder, kind, n) for n in cells]
            passed &= judge(f"{kind}, {share} of the force", errors, lambda order: order >= DEGREE[kind] + 0.9, share == 1.0)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
