"""Fields at arrays of points: bits, shapes, refusals, threads."""

import importlib.util
import inspect
import json
import multiprocessing
import pickle
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy
import pytest

import mmsmith

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = sorted(path.stem for path in (ROOT / "mms-specs").glob("*.toml"))
# Nothing was generated from these.
FILES = [
    ROOT / "tests/data/specs" / f"{name}.toml"
    for name in (
        "cylindrical",
        "ring-solved",
        "rotating-cylindrical",
        "shell-triaxial",
        "spherical",
        "materials/skew-2d-energy",
        "materials/ring-hencky",
        "materials/axis-aligned-3d-gent",
        "materials/skew-2d-arruda-boyce",
        "materials/shell-st-venant-kirchhoff",
    )
]
FIELDS = "uvaHFJPb"


def by_eval(name, X, t, folder):
    """Every field as `mms eval` writes it."""
    points = folder / "points.json"
    points.write_text(json.dumps([{"X": list(x), "t": t} for x in X]), encoding="utf-8")
    command = ["mms", "eval", str(name), "--points", str(points), "--npy", str(folder / "npy")]
    subprocess.run(command, check=True, capture_output=True)
    return {field: numpy.load(folder / "npy" / f"{field}.npy") for field in FIELDS}


@pytest.mark.parametrize("name", [*LIBRARY, *FILES], ids=lambda name: Path(name).stem)
def test_fields_have_the_bits_of_mms_eval(name, tmp_path):
    solution = mmsmith.load(name)
    X = solution.sample(10_000)
    t = 0.37 * solution.period
    exact = by_eval(name, X, t, tmp_path)
    at = solution.points(X)
    for field in FIELDS:
        values = getattr(solution, field)(X, t)
        assert values.tobytes() == exact[field].tobytes(), field
        staged = getattr(at, field)(t)
        if field == "b":
            assert abs(staged - values).max() <= 1e-9 * abs(values).max()
        else:
            assert staged.tobytes() == values.tobytes(), field


def test_parameters_and_what_is_known_of_a_solution():
    ring = mmsmith.load("ring", A=0.05)
    assert ring.parameters["A"] == 0.05
    assert ring.domain == mmsmith.Annulus(0.5, 1.0)
    assert ring.boundaries["outer"] == "traction-free"
    assert (ring.dimension, ring.law_name, ring.density) == (2, "neo-hookean", 4.0)
    assert set(ring.law) == {"lambda", "mu"}
    assert mmsmith.load("skew-2d").domain == mmsmith.Box((0.0, 0.0), (1.0, 1.0))
    assert repr(ring) == "mmsmith.load('ring', A=0.05)"
    inside = numpy.linalg.norm(ring.sample(500), axis=1)
    assert ((inside >= 0.5) & (inside <= 1.0)).all() and (ring.sample(500) >= 0).all()


def test_traction_is_stress_on_the_normal():
    shell = mmsmith.load("sphere-shell")
    surface = next(name for name, condition in shell.boundaries.items() if condition == "prescribed-traction")
    R = getattr(shell.domain, surface)
    X = shell.sample(50)
    X *= R / numpy.linalg.norm(X, axis=1, keepdims=True)
    normal = X / R * (1 if surface == "outer" else -1)
    t = 0.3 * shell.period
    expected = numpy.einsum("pij,pj->pi", shell.P(X, t), normal)
    assert numpy.allclose(shell.traction(surface, X, t), expected, rtol=1e-12, atol=1e-9 * abs(expected).max())
    with pytest.raises(mmsmith.Error, match="sphere-shell has no surface 'rim'; it has .*outer"):
        shell.traction("rim", X, t)


def test_any_layout_of_points_gives_the_same():
    ring = mmsmith.load("ring")
    X = ring.sample(101)
    b = ring.b(X, 1e-3)
    wide = numpy.zeros((202, 4))
    wide[::2, 1:3] = X
    for same in (numpy.asfortranarray(X), wide[::2, 1:3], X.tolist(), X[::-1][::-1]):
        assert ring.b(same, 1e-3).tobytes() == b.tobytes()
    single = X.astype(numpy.float32)
    assert ring.b(single, 1e-3).tobytes() == ring.b(single.astype(float), 1e-3).tobytes()
    assert ring.b(X, 1e-3).tobytes() == ring.b(X, numpy.float64(1e-3)).tobytes()


def test_no_points_give_no_values():
    ring = mmsmith.load("ring")
    X = numpy.empty((0, 2))
    assert ring.b(X, 0.0).shape == (0, 2) and ring.F(X, 0.0).shape == (0, 2, 2) and ring.J(X, 0.0).shape == (0,)
    at = ring.points(X)
    assert at.b(0.0).shape == (0, 2) and at.u(0.0).shape == (0, 2) and len(at) == 0
    assert ring.traction("outer", X, 0.0).shape == (0, 2)


def test_not_a_number_stays_where_it_is():
    ring = mmsmith.load("ring")
    X = ring.sample(40)
    u = ring.u(X, 1e-3)
    X[7, 1] = numpy.nan
    after = ring.u(X, 1e-3)
    assert numpy.isnan(after[7]).any()
    assert numpy.delete(after, 7, axis=0).tobytes() == numpy.delete(u, 7, axis=0).tobytes()
    assert numpy.isnan(ring.b(X, numpy.nan)).any()


REFUSALS = [
    (lambda ring, X: ring.b(X[:, :1], 0.0), ValueError, r"X has the shape \(9, 1\); ring has 2 dimensions: it must be \(n, 2\)"),
    (lambda ring, X: ring.b(3.0, 0.0), ValueError, r"shape \(\)"),
    (lambda ring, X: ring.b(X, [0.0, 1.0]), TypeError, r"t has the shape \(2,\); it must be one number, or an array .*\(9,\)"),
    (lambda ring, X: ring.lower(), mmsmith.Error, r"no box: it has inner\(\) and outer\(\)"),
    (lambda ring, X: ring.dimensoin, AttributeError, "ring has no 'dimensoin'"),
    (lambda ring, X: mmsmith.load("bar", rho0=2.0).kappa, AttributeError, "bar has no 'kappa'"),
    (lambda ring, X: ring.points(X.T), ValueError, r"shape \(2, 9\)"),
    (lambda ring, X: ring.b(X.astype(complex), 0.0), TypeError, "X has the type complex128"),
    (lambda ring, X: ring.b([["a", "b"]], 0.0), TypeError, "X has the type <U1"),
    (lambda ring, X: ring.b(X, X), TypeError, "it must be one number"),
    (lambda ring, X: ring.b(X, 0.0, out=numpy.empty((9, 3))), ValueError, r"out has the shape \(9, 3\); the result has \(9, 2\)"),
    (lambda ring, X: ring.F(X, 0.0, out=numpy.empty((9, 2))), ValueError, r"shape \(9, 2\); the result has \(9, 2, 2\)"),
    (lambda ring, X: ring.b(X, 0.0, out=numpy.empty((9, 2), "f4")), TypeError, "out is an array of float32"),
    (lambda ring, X: ring.b(X, 0.0, out=[0.0]), TypeError, "out is a list"),
    (lambda ring, X: ring.b(X, 0.0, out=numpy.empty((9, 2), order="F")), ValueError, "not C-contiguous"),
    (lambda ring, X: ring.b(X, 0.0, out=numpy.broadcast_to(0.0, (9, 2))), ValueError, "out cannot be written"),
    (lambda ring, X: ring.b(X, 0.0, out=X), ValueError, "out shares memory with X"),
    (lambda ring, X: mmsmith.load("rign"), mmsmith.Error, "there is no solution 'rign'; did you mean 'ring'"),
    (lambda ring, X: mmsmith.load("ring", B=1), mmsmith.Error, "ring has no parameter 'B'; it has A, E, rho0, Ri, Ro"),
    (lambda ring, X: mmsmith.load("ring", E=-1), mmsmith.Error, "parameter E = -1.0 of ring is not admissible"),
    (lambda ring, X: mmsmith.load("ring", Ri=2), mmsmith.Error, "Ri < Ro"),
    (lambda ring, X: mmsmith.load("no/such.toml"), mmsmith.Error, "cannot read no/such.toml"),
    (lambda ring, X: ring.with_fault("none"), mmsmith.Error, "there is no fault 'none'; there are: body-force-sign"),
    (lambda ring, X: ring.with_fault("stress-transposed"), mmsmith.NoEffect, "changes no field of ring"),
    (lambda ring, X: ring.with_fault("body-force-sign").check(), mmsmith.Error, "its fields have a fault"),
]


@pytest.mark.parametrize(("call", "kind", "message"), REFUSALS)
def test_what_is_wrong_is_said(call, kind, message):
    ring = mmsmith.load("ring")
    with pytest.raises(kind, match=message):
        call(ring, ring.sample(9))


def test_a_specification_that_is_wrong_is_shown(tmp_path):
    text = (ROOT / "mms-specs/ring.toml").read_text(encoding="utf-8")
    (tmp_path / "wrong.toml").write_text(text.replace("displacement", "displacment"), encoding="utf-8")
    with pytest.raises(mmsmith.Error, match="displacment") as caught:
        mmsmith.load(tmp_path / "wrong.toml")
    shown = subprocess.run(["mms", "check", str(tmp_path / "wrong.toml")], capture_output=True, text=True, check=False).stderr
    assert str(caught.value) in shown


def test_out_takes_the_values():
    ring = mmsmith.load("ring")
    X = ring.sample(20)
    out = numpy.empty((20, 2, 2))
    assert ring.P(X, 1e-3, out=out) is out
    assert out.tobytes() == ring.P(X, 1e-3).tobytes()
    assert ring.points(X).P(1e-3, out=out) is out


def test_threads_share_a_solution():
    ring = mmsmith.load("ring")
    X = ring.sample(5000)
    at = ring.points(X)
    times = [1e-4 * n for n in range(32)]
    alone = [(ring.b(X, t).tobytes(), ring.points(X).F(t).tobytes()) for t in times]
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(lambda t: (ring.b(X, t).tobytes(), at.F(t).tobytes()), times))
    assert together == alone


# With laws and bodies of different kinds.
MODULES = ["ring", "skew-2d", "sphere-shell", *(ROOT / "tests/data/specs/materials" / f"{name}.toml" for name in ("skew-2d-yeoh", "axis-aligned-3d-ogden"))]


@pytest.mark.parametrize("name", MODULES, ids=lambda name: Path(name).stem)
def test_what_is_written_for_the_numpy_module_runs_with_the_package(name, tmp_path):
    assert mmsmith.command("gen", name, target="numpy", out=tmp_path).passed
    (path,) = tmp_path.glob("*.py")
    found = importlib.util.spec_from_file_location("generated", path)
    generated = importlib.util.module_from_spec(found)
    found.loader.exec_module(generated)
    module, package = generated.Solution(), mmsmith.load(name)
    X = package.sample(12)
    t = 0.3 * package.period()
    # The strain energy is no field of the package.
    public = [name for name in dir(module) if name[0].islower() and name not in ("par", "fixed") or len(name) == 1 and name != "W"]
    assert {"density", "period", "wave_speed", "cell_length", "rho0_b", "static_force", "sigma", "S"} <= set(public)
    arrangements = [(X, t), (X.reshape(3, 4, -1), t), (X[0], t), (X, numpy.linspace(0, t, 12))]
    for name in public:
        method = getattr(module, name)
        if len(inspect.signature(method).parameters) == 0:
            assert numpy.allclose(getattr(package, name)(), method(), rtol=1e-14), name
            assert name in dir(package)
            continue
        for X_given, t_given in arrangements:
            exact, values = method(X_given, t_given), getattr(package, name)(X_given, t_given)
            assert values.shape == exact.shape, name
            assert numpy.allclose(values, exact, rtol=1e-11, atol=1e-11 * abs(exact).max()), name
    assert package.density == package.density() and isinstance(package.density, float)
    at = package.points(X)
    for name in ("rho0_b", "static_force", "sigma", "S"):
        assert numpy.allclose(getattr(at, name)(t), getattr(package, name)(X, t), rtol=1e-9, atol=1e-9 * abs(getattr(package, name)(X, t)).max())


def test_equal_solutions_are_equal_and_can_be_sent_to_other_processes():
    ring, same = mmsmith.load("ring", A=0.05), mmsmith.load("ring", A=0.05)
    others = [mmsmith.load("ring"), mmsmith.load("skew-2d"), ring.with_fault("body-force-sign"), "ring"]
    assert ring == same and hash(ring) == hash(same) and all(ring != other for other in others)
    assert mmsmith.load("ring", A=mmsmith.load("ring").parameters["A"]) == mmsmith.load("ring")
    X = ring.sample(20)
    for solution in (ring, others[2]):
        sent = pickle.loads(pickle.dumps(solution))
        assert sent == solution and sent.b(X, 1e-3).tobytes() == solution.b(X, 1e-3).tobytes()
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        (far,) = pool.starmap(ring.b, [(X, 1e-3)])
    assert far.tobytes() == ring.b(X, 1e-3).tobytes()


def test_faults_change_what_they_say():
    skew = mmsmith.load("skew-2d", rho0=2.0)
    X, t = skew.sample(10), 0.3 * skew.period
    assert (skew.with_fault("body-force-sign").b(X, t) == -skew.b(X, t)).all()
    assert (skew.with_fault("stress-transposed").P(X, t) == skew.P(X, t).transpose(0, 2, 1)).all()
    assert skew.with_fault("body-force-late").fault == "body-force-late"
    for fault in mmsmith.faults():
        wrong = skew.with_fault(fault)
        changed = [field for field in FIELDS if not numpy.allclose(getattr(wrong, field)(X, t), getattr(skew, field)(X, t), rtol=1e-7)]
        assert changed or fault.startswith("traction"), fault
