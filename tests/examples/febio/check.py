"""Solves a block at rest with FEBio, whose body load and displacements are the generated expressions, and looks at the order.

    python check.py MMS FEBIO FOLDER

FEBIO is the program of FEBio 4. Its expressions have to be allowed more than 511 characters: see the page of the book. The law is
neo-Hookean. The motion is prescribed all around. The mean-square error of u at the nodes inside must fall with an order of 2 for linear
bricks and of 3 for those with twenty nodes, less a tenth; and it must not where the force lacks its last share. Exit status: 0
where that holds, else 1.
"""

import importlib.util
import itertools
import subprocess
import sys
import xml.etree.ElementTree
from pathlib import Path

import numpy

HERE = Path(__file__).parent
CELLS = {"hex8": (5, 10), "hex20": (2, 4)}
DEGREE = {"hex8": 1, "hex20": 2}
# Corners and middles of edges, in halves of the edge, as FEBio counts them.
NODES = [
    (0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2),
    (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2),
    (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1),
]  # fmt: skip


def solution(mms, folder):
    text = (HERE.parent / "block.toml").read_text().replace("'st-venant-kirchhoff'", "'neo-hookean'")
    (folder / "block.toml").write_text(text)
    for target in ("numpy", "febio"):
        subprocess.run([mms, "gen", folder / "block.toml", "--target", target, "--out", folder], check=True, stdout=subprocess.DEVNULL)
    spec = importlib.util.spec_from_file_location("block_numpy", folder / "block_numpy.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Solution(), xml.etree.ElementTree.parse(folder / "block_febio.xml").getroot()


def solve(exact, written, febio, folder, kind, cells, share):
    """The mean-square error of the displacements of the nodes inside."""
    numbers, elements = {}, []
    for cell in itertools.product(range(cells), repeat=3):
        places = [tuple(2 * c + n for c, n in zip(cell, node)) for node in NODES[: int(kind[3:])]]
        elements.append([numbers.setdefault(place, len(numbers) + 1) for place in places])
    X = numpy.array(list(numbers)) / (2 * cells)
    u = exact.u(X, 0.0)
    outside = numpy.any((X == 0.0) | (X == 1.0), axis=1)
    E = exact.mu() * (3 * exact.lambda_() + 2 * exact.mu()) / (exact.lambda_() + exact.mu())
    nu = exact.lambda_() / (2 * (exact.lambda_() + exact.mu()))
    force = written.find("body_load/force").text
    motion = [entry.text for entry in written.find("field[@name='u']")]
    nodes = "\n".join(f'<node id="{n + 1}">{x[0]!r},{x[1]!r},{x[2]!r}</node>' for n, x in enumerate(X.tolist()))
    bricks = "\n".join(f'<elem id="{n}">{",".join(map(str, own))}</elem>' for n, own in enumerate(elements, 1))
    around = ",".join(str(n + 1) for n in numpy.flatnonzero(outside))
    conditions = "\n".join(
        f'<bc type="prescribed displacement" node_set="around"><dof>{axis}</dof><value lc="1" type="math">{value}</value></bc>'
        for axis, value in zip("xyz", motion)
    )
    (folder / "block.feb").write_text(f"""<?xml version="1.0" encoding="UTF-8"?>
<febio_spec version="4.0">
<Module type="solid"/>
<Control><analysis>STATIC</analysis><time_steps>4</time_steps><step_size>0.25</step_size>
<solver type="solid"><dtol>1e-9</dtol><etol>1e-16</etol><rtol>0</rtol><qn_method type="BFGS"><max_ups>0</max_ups></qn_method></solver></Control>
<Globals><Constants><T>0</T><R>0</R><Fc>0</Fc></Constants></Globals>
<Material><material id="1" name="block" type="neo-Hookean"><density>{exact.density()!r}</density><E>{E!r}</E><v>{nu!r}</v></material></Material>
<Mesh><Nodes name="all">
{nodes}
</Nodes><Elements type="{kind}" name="body">
{bricks}
</Elements><NodeSet name="around">{around}</NodeSet></Mesh>
<MeshDomains><SolidDomain name="body" mat="block"/></MeshDomains>
<Boundary>
{conditions}
</Boundary>
<Loads><body_load type="body force"><force lc="1" type="math">{force}</force></body_load></Loads>
<LoadData><load_controller id="1" type="loadcurve"><interpolate>LINEAR</interpolate><points><pt>0,0</pt><pt>1,{share}</pt></points></load_controller>
</LoadData>
<Output><logfile><node_data file="u.txt" data="ux;uy;uz" delim=" "/></logfile></Output>
</febio_spec>
""")
    with open(folder / "log", "w") as log:
        subprocess.run([febio, "block.feb"], cwd=folder, check=True, stdout=log, stderr=log)
    rows = [line.split() for line in (folder / "u.txt").read_text().splitlines() if line and not line.startswith("*")]
    found = numpy.array([[float(x) for x in row[1:4]] for row in rows[-len(X) :]])
    return numpy.sqrt(numpy.mean((found - u)[~outside] ** 2))


def main(mms, febio, folder):
    folder = Path(folder).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    exact, written = solution(mms, folder)
    failed = False
    for share in (1.0, 0.9):
        for kind, cells in CELLS.items():
            errors = [solve(exact, written, Path(febio).resolve(), folder, kind, n, share) for n in cells]
            order = numpy.log2(errors[-2] / errors[-1])
            right = order >= DEGREE[kind] + 1 - 0.1
            passed = right == (share == 1.0)
            failed |= not passed
            told = ", ".join(f"{error:.3e}" for error in errors)
            print(f"{'passed' if passed else 'FAILED'}: {kind}, {share} of the force: order {order:.3f} in u, errors {told}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
