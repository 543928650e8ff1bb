"""Solves a plate at rest with OpenFOAM, whose force and motion are the generated fragments, and looks at the order.

    python check.py MMS SOURCES FOLDER

SOURCES are those of OpenFOAM 1912, whose libraries are installed: the fragments are compiled when the case runs. The solver is
solidDisplacementFoam with the term `fvOptions.d2dt2(D)`, which it lacks; its equation is per mass. The law is linear, in plane strain. The
mean-square error of D must fall with order 2, to 0.15; and it must not where the fragment is told that the equation is per
volume. Exit status: 0 where that holds, else 1.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
from at_rest import generate, judge, moduli, solution  # noqa: E402

CELLS = (8, 16, 32)
FILES = {
    "system/controlDict": """libs ("libfvOptions.so"); application solidDisplacementFoam; startFrom startTime; startTime 0; stopAt endTime; endTime 1; deltaT 1;
        writeControl timeStep; writeInterval 1; writeFormat ascii; writePrecision 15; timePrecision 6;""",
    "system/fvSchemes": """d2dt2Schemes { default steadyState; } ddtSchemes { default steadyState; } gradSchemes { default leastSquares; }
        divSchemes { default none; div(sigmaD) Gauss linear; } laplacianSchemes { default none; laplacian(DD,D) Gauss linear corrected; }
        interpolationSchemes { default linear; } snGradSchemes { default none; }""",
    "system/fvSolution": """solvers { "(D|T)" { solver PCG; preconditioner DIC; tolerance 1e-12; relTol 0.01; } }
        stressAnalysis { compactNormalStress yes; nCorrectors 2000; D 1e-10; }""",
    "constant/thermalProperties": """C { type uniform; value 1; } k { type uniform; value 1; } alpha { type uniform; value 1; } thermalStress no;""",
}
HEAD = "FoamFile {{ version 2.0; format ascii; class {}; object {}; }}\n"


def foam(sources, command, folder, own_code=False):
    """Runs a command among the sources' variables, with the libraries that are installed; OpenFOAM compiles no code for root."""
    libraries = subprocess.run(["sh", "-c", "dirname $(ldconfig -p | sed -n 's/.*=> //p' | grep -m1 libfiniteVolume.so)"], capture_output=True, text=True)
    place = libraries.stdout.strip() or "/usr/lib"
    script = f"source {sources}/etc/bashrc > /dev/null 2>&1; export FOAM_LIBBIN={place} PATH=/usr/bin:$WM_DIR:$PATH; {command}"
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("WM_", "FOAM_"))}
    with open(folder / "log", "a", encoding="utf-8") as log:
        who = []
        if own_code and os.geteuid() == 0:
            subprocess.run(["chown", "-R", "nobody", folder], check=True)
            who = ["setpriv", "--reuid", "nobody", "--clear-groups"]
        done = subprocess.run([*who, "bash", "-c", script], cwd=folder, stdout=log, stderr=log, env=environment)
    if done.returncode != 0:
        raise SystemExit(f"{command}: see {folder / 'log'}")


def solver(sources, folder):
    """solidDisplacementFoam with forces, built among the sources."""
    own = folder / "solver"
    shutil.copytree(sources / "applications/solvers/stressAnalysis/solidDisplacementFoam", own, dirs_exist_ok=True)
    text = (own / "solidDisplacementFoam.C").read_text()
    for of, by in (
        ('#include "fvCFD.H"', '#include "fvCFD.H"\n#include "fvOptions.H"'),
        ('#include "createFields.H"', '#include "createFields.H"\n    #include "createFvOptions.H"'),
        ("                  + divSigmaExp\n", "                  + divSigmaExp\n                  + fvOptions.d2dt2(D)\n"),
    ):
        assert text.count(of) == 1, of
        text = text.replace(of, by)
    (own / "solidDisplacementFoam.C").write_text(text)
    files = "tractionDisplacement/tractionDisplacementFvPatchVectorField.C\nsolidDisplacementFoam.C\n"
    (own / "Make/files").write_text(f"{files}EXE = {folder}/solidFoam\n")
    libraries = ("OpenFOAM", "finiteVolume", "meshTools", "OSspecific/POSIX", "fvOptions", "sampling")
    names = " ".join(f"$WM_PROJECT_DIR/src/{name}" for name in libraries)
    foam(sources, f"make -C $WM_DIR/src && for library in {names}; do wmakeLnInclude $library; done", folder)
    foam(sources, "wmakeLnInclude solver/tractionDisplacement; cd solver && wmake", folder)
    return folder / "solidFoam"


def write(case, name, kind, text):
    (case / name).parent.mkdir(parents=True, exist_ok=True)
    (case / name).write_text(HEAD.format(kind, Path(name).name) + text)


def solve(exact, sources, program, case, cells, per_mass):
    """The mean-square error of D at the centres of the cells."""
    # Code of a case that ran before is compiled.
    for name in ("constant", "system", "0", "1"):
        shutil.rmtree(case / name, ignore_errors=True)
    for name, text in FILES.items():
        write(case, name, "dictionary", text)
    (lx, ly), (hx, hy) = exact.lower(), exact.upper()
    corners = " ".join(f"({x!r} {y!r} {z})" for z in ("0", "0.1") for x, y in ((lx, ly), (hx, ly), (hx, hy), (lx, hy)))
    write(case, "system/blockMeshDict", "dictionary", f"""vertices ({corners}); edges (); mergePatchPairs ();
        blocks (hex (0 1 2 3 4 5 6 7) ({cells} {cells} 1) simpleGrading (1 1 1));
        boundary (around {{ type patch; faces ((0 4 7 3) (2 6 5 1) (1 5 4 0) (3 7 6 2)); }} sides {{ type empty; faces ((0 3 2 1) (4 5 6 7)); }});""")
    E, nu = moduli(exact)
    write(case, "constant/mechanicalProperties", "dictionary", f"""rho {{ type uniform; value {exact.density()!r}; }}
        nu {{ type uniform; value {nu!r}; }} E {{ type uniform; value {E!r}; }} planeStress no;""")
    force, motion = (case / "mms/plate_openfoam").read_text().split("\nplate_boundary\n")
    told = "const bool perMass = false;"
    assert told in force
    write(case, "constant/fvOptions", "dictionary", force.replace(told, told.replace("false", str(per_mass).lower())))
    write(case, "0/D", "volVectorField", f"""dimensions [0 1 0 0 0 0 0]; internalField uniform (0 0 0);
        boundaryField {{ sides {{ type empty; }} around {motion} }}""")
    foam(sources, f"blockMesh && {program}", case, own_code=True)
    text = (case / "1/D").read_text()
    block = re.search(r"internalField\s+nonuniform List<vector>\s*\d+\s*\((.*?)\n\)", text, re.S)[1]
    D = numpy.array([[float(x) for x in row.strip("()").split()] for row in block.strip().splitlines()])[:, :2]
    places = (numpy.arange(cells) + 0.5) / cells
    X = numpy.stack(numpy.meshgrid(lx + places * (hx - lx), ly + places * (hy - ly)), axis=-1).reshape(-1, 2)
    return numpy.sqrt(numpy.mean((D - exact.u(X, 0.0)) ** 2))


def main(mms, sources, folder):
    folder, sources = Path(folder).resolve(), Path(sources).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for target in ("openfoam", "c"):
        generate(mms, HERE / "plate.toml", target, folder / "mms")
    exact = solution(mms, HERE / "plate.toml", folder)
    program = solver(sources, folder)
    passed = True
    for per_mass in (True, False):
        case = folder / ("per-mass" if per_mass else "per-volume")
        shutil.rmtree(case, ignore_errors=True)
        shutil.copytree(folder / "mms", case / "mms")
        errors = [solve(exact, sources, program, case, n, per_mass) for n in CELLS]
        passed &= judge(f"force per {case.name[4:]}", errors, lambda order: abs(order - 2) <= 0.15, per_mass)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
