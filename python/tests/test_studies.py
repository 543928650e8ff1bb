"""The commands as functions, tables of orders, the audit, the pytest fixture."""

import json
import math
import signal
import subprocess
import sys
import textwrap
import time

import numpy
import pytest

import mmsmith

pytest_plugins = ["pytester"]


def mms(*words):
    return subprocess.run(["mms", *words], capture_output=True, text=True, check=False)


def without_times(document):
    """A document without what differs from call to call: times, and rates."""
    if isinstance(document, dict):
        return {key: without_times(value) for key, value in document.items() if not key.endswith("_s")}
    return [without_times(entry) for entry in document] if isinstance(document, list) else document


CALLS = [
    (
        lambda: mmsmith.run("ring", shape="cpdi2", layout="body-fitted", cells=8, periods=0.1),
        "run ring --shape cpdi2 --layout body-fitted --cells 8 --periods 0.1",
    ),
    (
        lambda: mmsmith.converge(mmsmith.load("axis-aligned-1d", A=0.05), cells=numpy.array([8, 16]), periods=0.5),
        "converge axis-aligned-1d --set A=0.05 --cells 8,16 --periods 0.5",
    ),
    (lambda: mmsmith.run("bar", set={"A": 0.05}, cells=8, periods=0.1, quiet=None), "run bar --set A=0.05 --cells 8 --periods 0.1"),
    (lambda: mmsmith.load("skew-2d").check(points=40), "check skew-2d --points 40"),
    (lambda: mmsmith.load("skew-2d").explain(), "explain skew-2d"),
]


@pytest.mark.parametrize(("call", "line"), CALLS)
def test_a_function_gives_the_json_of_its_command(call, line, tmp_path, capfd):
    document = call()
    assert capfd.readouterr() == ("", "")
    mms(*line.split(), "--json", str(tmp_path / "result.json"))
    expected = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert without_times(document) == without_times(expected)


REFUSALS = [
    (lambda: mmsmith.run("rign"), "run rign"),
    (lambda: mmsmith.run("ring", cells=0), "run ring --cells=0"),
    (lambda: mmsmith.run("ring", cell=8), "run ring --cell=8"),
    (lambda: mmsmith.run("ring", set={"B": 1}), "run ring --set=B=1"),
    (lambda: mmsmith.score("ring", "none.vtu", cells=8), "score ring none.vtu --cells=8"),
]


@pytest.mark.parametrize(("call", "line"), REFUSALS)
def test_an_exception_has_the_message_of_the_command(call, line):
    with pytest.raises(mmsmith.Error) as caught:
        call()
    shown = mms(*line.split(), "--color", "never")
    assert shown.returncode == 2 and str(caught.value)
    assert str(caught.value).splitlines()[0] in shown.stderr


def test_ctrl_c_ends_a_long_call():
    script = textwrap.dedent(
        """
        import mmsmith
        print("begun", flush=True)
        try:
            mmsmith.run("ring", cells=256, periods=1000, threads=1)
        except KeyboardInterrupt:
            print("interrupted", flush=True)
        print(mmsmith.run("ring", cells=8, periods=0.01)["result"]["status"])
        """
    )
    # What runs in the background of a shell ignores the signal, and so would its children.
    child = subprocess.Popen(
        [sys.executable, "-c", script],
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert child.stdout is not None and child.stdout.readline() == "begun\n"
    time.sleep(1.0)
    child.send_signal(signal.SIGINT)
    # What was interrupted does not keep the next call from its work.
    assert child.communicate(timeout=120)[0].split() == ["interrupted", "ok"]


def test_orders_of_errors():
    table = mmsmith.orders([0.4, 0.2, 0.1], {"u": [16e-3, 4e-3, 1e-3], "F": [4e-1, 2e-1, 1e-1]})
    assert table.order("u") == pytest.approx((2.0, 2.0)) and table.order("F") == pytest.approx((1.0, 1.0))
    assert str(table).splitlines()[-1].split() == ["0.1", "1.000e-03", "2.00", "1.000e-01", "1.00"]
    assert table._repr_html_().count("<tr>") == 4
    mmsmith.assert_order(table, u=2, F=1)
    with pytest.raises(AssertionError, match=r"u: order 2.00, expected 3 \(tolerance 0.1\)\n.*h") as failed:
        mmsmith.assert_order(table, u=3)
    assert str(table) in str(failed.value)
    assert math.isnan(mmsmith.orders([2, 1], [1.0, 0.0]).order("u")[0])
    with pytest.raises(AssertionError, match="order nan"):
        mmsmith.assert_order(mmsmith.orders([2, 1], [1.0, math.inf]), u=1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: mmsmith.orders([1, 2], [1, 1]), "each is smaller than the one before it"),
        (lambda: mmsmith.orders([2, 1], {"F": [1]}), "F has 1 errors for 2 grid spacings"),
        (lambda: mmsmith.assert_order(mmsmith.orders([2, 1], [4, 1]), F=1), "there are no errors of F; there are those of u"),
        (lambda: mmsmith.assert_order(mmsmith.orders([2, 1], [4, 1])), "an expected order such as u=2"),
    ],
)
def test_orders_that_make_no_sense_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_orders_of_a_study():
    document = mmsmith.converge("axis-aligned-1d", cells=[16, 32], periods=0.25)
    table = mmsmith.orders(document, norm="l2")
    assert table.order("u")[-1] == pytest.approx(document["orders"]["u"]["l2"]["local"][-1])
    mmsmith.assert_order(document, u=document["orders"]["u"]["linf"]["local"][-1], tolerance=1e-9)


def test_errors_are_lengths_of_differences():
    ring = mmsmith.load("ring")
    X, t = ring.sample(10), 1e-3
    wrong = ring.u(X, t)
    wrong[3] += (3e-3, 4e-3)
    result = {"X": X, "t": t, "u": wrong, "F": ring.F(X, t)}
    assert mmsmith.measure(ring, result) == pytest.approx({"u": 5e-3, "F": 0.0})
    assert mmsmith.measure(ring, result, "l2")["u"] == pytest.approx(5e-3 / math.sqrt(10))
    assert mmsmith.measure(ring, {**result, "u": wrong * math.inf})["u"] == math.inf
    with pytest.raises(ValueError, match=r"F has the shape \(10, 2\); at these points it must be \(10, 2, 2\)"):
        mmsmith.measure(ring, {**result, "F": wrong})


def plotted(axes):
    return [line.get_label() for line in axes.get_lines()]


def test_a_table_is_plotted():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    assert plotted(mmsmith.orders([0.2, 0.1], [4.0, 1.0]).plot()) == ["u, order 2.00"]


def interpolating(solution, cells):
    """A "solver" whose error is the curvature of the exact motion over a cell, and one hundredth of b, which it reads as a force."""
    h = solution.cell_length / cells
    X, t = solution.sample(200), 0.3 * solution.period
    right = mmsmith.load(solution.name)
    off = 0.01 * (solution.b(X, t) - right.b(X, t)) / abs(right.b(X, t)).max()
    return {"X": X, "t": t, "u": solution.u(X, t) * (1 + h**2) + off}


def test_an_audit_counts_what_a_test_catches():
    faults = ["body-force-sign", "traction-sign", "stress-transposed", "body-force-of-transposed-stress"]
    audit = mmsmith.audit(interpolating, "ring", faults=faults, u=2)
    assert audit.outcomes["body-force-sign"] == {"ring": "caught"}
    assert audit.outcomes["stress-transposed"] == {"ring": "blind"}
    assert audit.missed == faults[1:]
    text = str(audit)
    assert "your test catches 1 of 4" in text
    line = next(line for line in text.splitlines() if line.startswith("  stress-transposed"))
    assert "blind" in line and "skew-2d" in line
    both = mmsmith.audit(interpolating, "ring", "skew-2d", faults=faults, u=2)
    # The test does not look at stress.
    assert both.outcomes["stress-transposed"] == {"ring": "blind", "skew-2d": "missed"}
    assert both.outcomes["body-force-of-transposed-stress"] == {"ring": "blind", "skew-2d": "caught"}
    assert both.markdown().splitlines()[2] == "| body-force-sign | caught | caught |"
    with pytest.raises(AssertionError, match="the test fails with the right fields of ring"):
        mmsmith.audit(interpolating, "ring", u=3)
    # A force per volume is one per mass where the density is one.
    one = mmsmith.load("ring", rho0=1.0)
    assert mmsmith.audit(interpolating, one, faults=["body-force-per-volume"], u=2).outcomes["body-force-per-volume"]["ring"] == "blind"


def test_a_solver_is_tested_in_three_lines(pytester):
    pytester.makepyfile(
        """
        import mmsmith, pytest

        def solve(solution, cells):
            X, t = solution.sample(100), 1e-3
            return {"X": X, "t": t, "u": solution.u(X, t) * (1 + 1 / cells**2)}

        @pytest.mark.manufactured("ring", cells=(4, 8), u=2)
        def test_second_order(manufactured):
            assert manufactured.points.shape == (1000, 2)
            manufactured.check(solve)

        @pytest.mark.manufactured(mmsmith.load("ring", A=0.05), cells=(4, 8), u=3)
        def test_third_order(manufactured):
            manufactured.check(solve)

        def test_no_mark(manufactured):
            pass
        """
    )
    result = pytester.runpytest_subprocess("--strict-markers")
    result.assert_outcomes(passed=1, failed=1, errors=1)
    result.stdout.fnmatch_lines(["*the fixture takes a mark*", "*u: order 2.00, expected 3 (tolerance 0.1)*", "*h * u * order*"])


def test_the_command_is_in_the_package(tmp_path):
    assert mms("--version").stdout == f"mms {mmsmith.__version__}\n"
    assert mms("check", "ring", "--points", "20").returncode == 0
    refused = mms("check", "rign")
    assert refused.returncode == 2 and "did you mean 'ring'" in refused.stderr
    shown = mms("run", "ring", "--cells", "8", "--periods", "0.05", "--vtk", str(tmp_path / "run-8"))
    assert shown.returncode == 0, shown.stderr
    scored = mms("score", "ring", str(tmp_path / "run-8"), "--cells", "8")
    assert scored.returncode == 0 and "8 cells" in shown.stdout and "P " in scored.stdout
