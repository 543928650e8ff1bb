"""Pages of the book whose programs need a host that is not here: all that can be run of them is run."""

import ast
import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import mmsmith

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"(?:<!-- file: (?P<file>\S+) -->\n|<!-- (?P<mark>[^>]*) -->\n)```(?P<language>\w+)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)

# In place of a user's solver: exact values with an error of an order that the environment says.
SOLVER = """#!{python}
import os, sys
import mmsmith
skew = mmsmith.load("skew-2d")
cells = int(sys.argv[1])
X = skew.sample(50)
print("t,X,Y,ux,uy")
for step in range(5):
    t = step / 4 * skew.period
    u = skew.u(X, t) * (1 + cells ** -float(os.environ.get("ORDER", "2")))
    for (x, y), (a, b) in zip(X.tolist(), u.tolist()):
        print(f"{{t!r}},{{x!r}},{{y!r}},{{a!r}},{{b!r}}")
"""


def blocks(page):
    return list(BLOCK.finditer((ROOT / "docs/src" / page).read_text(encoding="utf-8")))


def saved(page, name):
    return next(block["text"] for block in blocks(page) if block["file"] == name)


def program(page):
    return next(block["text"] for block in blocks(page) if block["language"] == "python")


def lines_of(name):
    """What the service of that file runs, as far as it is about orders."""
    yaml = pytest.importorskip("yaml")
    document = yaml.safe_load(saved("guide/ci.md", name))
    if name.startswith(".github"):
        lines = [step["run"] for step in document["jobs"]["orders"]["steps"] if "run" in step]
    else:
        lines = document["verify"]["before_script"] + document["verify"]["script"]
    assert any("pip install ./mmsmith/python" in line for line in lines) and "pytest" in lines
    return [line for line in lines if "verify-" in line]


@pytest.mark.parametrize("name", [".github/workflows/verify.yml", ".gitlab-ci.yml"])
@pytest.mark.parametrize(("order", "status"), [("2", 0), ("1", 1), ("0", 1)])
def test_the_files_for_ci_judge_a_solver(name, order, status, tmp_path):
    (tmp_path / "build").mkdir()
    solver = tmp_path / "build/solver"
    solver.write_text(SOLVER.format(python=sys.executable), encoding="utf-8")
    solver.chmod(0o755)
    lines = lines_of(name)
    assert len(lines) == 2
    done = subprocess.run(
        ["sh", "-e", "-c", "\n".join(lines)], cwd=tmp_path, env={**os.environ, "ORDER": order}, capture_output=True, text=True, check=False
    )
    assert done.returncode == status, done.stdout + done.stderr
    assert (tmp_path / "score.json").exists()


FEBIO = """#!{python}
import sys, xml.etree.ElementTree
import numpy
sys.path.insert(0, ".")
from block_numpy import Solution
root = xml.etree.ElementTree.parse(sys.argv[1]).getroot()
X = numpy.array([[float(x) for x in node.text.split(",")] for node in root.find("Mesh/Nodes")])
used = {{int(n) for brick in root.find("Mesh/Elements") for n in brick.text.split(",")}}
assert used == set(range(1, len(X) + 1))
assert root.find("Loads/body_load/force").text and len(root.findall("Boundary/bc")) == 3
cells = round(len(X) ** (1 / 3)) - 1
u = Solution().u(X, 0.0) + 1 / cells**2
with open(root.find("Output/logfile/node_data").get("file"), "w") as file:
    file.write("*Step = 1\\n" + "".join(f"{{n + 1}} {{x!r}} {{y!r}} {{z!r}}\\n" for n, (x, y, z) in enumerate(u.tolist())))
"""


def test_the_program_for_febio_writes_its_input_and_reads_its_output(tmp_path):
    (tmp_path / "block.toml").write_text(saved("hosts/febio.md", "block.toml"), encoding="utf-8")
    assert mmsmith.check(tmp_path / "block.toml", points=20).passed
    for target in ("febio", "numpy"):
        mmsmith.command("gen", tmp_path / "block.toml", target=target, out=tmp_path)
    (tmp_path / "febio4").write_text(FEBIO.format(python=sys.executable), encoding="utf-8")
    (tmp_path / "febio4").chmod(0o755)
    (tmp_path / "order.py").write_text(program("hosts/febio.md"), encoding="utf-8")
    environment = {**os.environ, "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run([sys.executable, "order.py"], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and done.stdout.endswith("order 2.00\n"), done.stdout + done.stderr


def test_the_case_for_openfoam_is_written_and_its_output_scored(tmp_path):
    for name in ("plate.toml", "case.sh"):
        (tmp_path / name).write_text(saved("hosts/openfoam.md", name), encoding="utf-8")
    (tmp_path / "recording.py").write_text(program("hosts/openfoam.md"), encoding="utf-8")
    plate = mmsmith.load(tmp_path / "plate.toml")
    parameters = plate.parameters
    for n in (16, 32):
        subprocess.run(["sh", "-e", "case.sh", str(n)], cwd=tmp_path, check=True, capture_output=True)
        case = tmp_path / f"plate-{n}"
        files = [path for path in case.rglob("*") if path.is_file()]
        assert len(files) == 10
        for path in files:
            text = re.sub(r"//[^\n]*|/\*.*?\*/|\"[^\"]*\"", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
            assert all(text.count(opened) == text.count(closed) for opened, closed in ("{}", "()", "[]") if path.suffix != ".h"), path
        material = (case / "constant/mechanicalProperties").read_text(encoding="utf-8")
        assert all(f"{sign} {{ type uniform; value {parameters[name]:g}; }}" in material for sign, name in (("rho", "rho0"), ("nu", "nu"), ("E", "E")))
        # As OpenFOAM writes it.
        centres = [((i + 0.5) / n, (j + 0.5) / n) for j in range(n) for i in range(n)]
        D = plate.u(centres, 0.0) + 1e-3 / n**2
        rows = "\n".join(f"({x!r} {y!r} 0)" for x, y in D.tolist())
        (case / "1").mkdir()
        (case / "1/D").write_text(f"internalField   nonuniform List<vector> \n{n * n}\n(\n{rows}\n)\n;\nboundaryField {{}}\n", encoding="utf-8")
        subprocess.run([sys.executable, "recording.py", str(n)], cwd=tmp_path, check=True)
    score = next(line for block in blocks("hosts/openfoam.md") for line in block["text"].splitlines() if line.startswith("mms score"))
    done = subprocess.run(["sh", "-c", score], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_input_for_moose_fits_the_generated_file(tmp_path):
    mmsmith.command("gen", "skew-2d", target="moose", out=tmp_path)
    generated = (tmp_path / "skew_2d.i").read_text(encoding="utf-8")
    page = next(block["text"] for block in blocks("hosts/moose.md") if "[Executioner]" in block["text"])
    depth = 0
    for line in page.splitlines():
        opened, closed = re.fullmatch(r" *\[[A-Za-z_]\S*\]", line), re.fullmatch(r" *\[\]", line)
        depth += bool(opened) - bool(closed)
        assert depth >= 0 and (not line.strip() or opened or closed or re.fullmatch(r" *\w+ = \S.*", line)), line
    assert depth == 0
    commands = "\n".join(block["text"] for block in blocks("hosts/moose.md") if block["language"] == "sh")
    own = re.findall(r"mms_skew_2d_\w+", page + commands)
    assert len(own) >= 4 and all(f"[{name}]" in generated for name in own)
    law = mmsmith.load("skew-2d").law
    assert f"lambda = {law['lambda']!r}" in page and f"mu = {law['mu']!r}" in page


@pytest.mark.parametrize("page", ["hosts/ufl.md", "guide/ci.md", "guide/symptoms.md"])
def test_programs_that_are_not_run_are_python(page):
    for block in blocks(page):
        if block["language"] == "python":
            ast.parse(textwrap.dedent(block["text"]))


def test_the_form_of_the_page_on_ufl_is_one(tmp_path, monkeypatch):
    """The residual and the error are formed by UFL itself, on a square of its own; the mesh, the spaces and the solver are left out."""
    ufl = pytest.importorskip("ufl")
    basix = pytest.importorskip("basix.ufl")
    mmsmith.command("gen", "skew-2d", target="ufl", out=tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    from skew_2d_ufl import Solution

    square = ufl.Mesh(basix.element("Lagrange", "quadrilateral", 1, shape=(2,)))
    V = ufl.FunctionSpace(square, basix.element("Lagrange", "quadrilateral", 2, shape=(2,)))
    names = {"ufl": ufl, "s": Solution(), "X": ufl.SpatialCoordinate(square), "t": 0.0, "u": ufl.Coefficient(V), "v": ufl.TestFunction(V)}
    wanted = ("dx", "F", "inverse", "P", "residual", "off")
    body = next(node for node in ast.parse(program("hosts/ufl.md")).body if isinstance(node, ast.FunctionDef)).body
    for node in body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id in wanted:
            exec(compile(ast.Module([node], []), "page", "exec"), names)
    assert set(wanted) <= set(names)
    derivative = ufl.derivative(names["residual"], names["u"])
    assert len(ufl.algorithms.compute_form_data(derivative).original_form.arguments()) == 2
