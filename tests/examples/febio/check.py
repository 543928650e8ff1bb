"""Solves a block at rest with FEBio, whose body load and displacements are the generated expressions, and looks at the order.

    python check.py MMS FEBIO FOLDER

FEBIO is the program of FEBio 4. Its expressions have to be allowed more than 511 characters: see the page of the book. The law is
neo-Hookean. The motion is prescribed all around. The mean-square error of u at the nodes inside must fall with an order of 2 for linear
bricks and of 3 for those with twenty nodes, less a tenth; and it must not where the force lacks its last share. Exit status: 0
where that holds, else 1.
"""

import subprocess
import sys
import xml.etree.ElementTree
from pathlib import Path

import numpy

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
from at_rest import Block, generate, judge, moduli, solution  # noqa: E402

CELLS = {"hex8": (5, 10), "hex20": (2, 4)}
DEGREE = {"hex8": 1, "hex20": 2}


def solve(exact, written, febio, folder, kind, cells, share):
    """The mean-square error of the displacements of the nodes inside."""
    block = Block(cells, int(kind[3:]))
    X, u = block.X, exact.u(block.X, 0.0)
    E, nu = moduli(exact)
    force = written.find("body_load/force").text
    motion = [entry.text for entry in written.find("field[@name='u']")]
    nodes = "\n".join(f'<node id="{n + 1}">{x[0]!r},{x[1]!r},{x[2]!r}</node>' for n, x in enumerate(X.tolist()))
    bricks = "\n".join(f'<elem id="{n}">{",".join(map(str, own))}</elem>' for n, own in enumerate(block.elements, 1))
    around = ",".join(str(n + 1) for n in numpy.flatnonzero(block.outside))
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
    return block.error(found, u)


def main(mms, febio, folder):
    folder = Path(folder).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    specification = folder / "block.toml"
    specification.write_text((HERE.parent / "block.toml").read_text().replace("'st-venant-kirchhoff'", "'neo-hookean'"))
    generate(mms, specification, "febio", folder)
    exact, written = solution(mms, specification, folder), xml.etree.ElementTree.parse(folder / "block_febio.xml").getroot()
    passed = True
    for share in (1.0, 0.9):
        for kind, cells in CELLS.items():
            errors = [solve(exact, written, Path(febio).resolve(), folder, kind, n, share) for n in cells]
            passed &= judge(f"{kind}, {share} of the force", errors, lambda order: order >= DEGREE[kind] + 0.9, share == 1.0)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
