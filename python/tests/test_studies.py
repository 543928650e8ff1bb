"""The commands as functions, tables of orders, the audit, the pytest fixture."""

import json
import math
import pickle
import re
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy
import pytest

import mmsmith
from mmsmith import _invoke

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
    (lambda: mmsmith.run("bar", set={"A": 0.05}, cells=8, periods=0.1, history=None), "run bar --set A=0.05 --cells 8 --periods 0.1"),
    (lambda: mmsmith.load("skew-2d").check(points=40), "check skew-2d --points 40"),
    (
        lambda: mmsmith.converge("bar", cells=[8, 16], periods=0.1, expect={"u": 3, "v": 2}, tolerance=0.5),
        "converge bar --cells 8,16 --periods 0.1 --expect u=3,v=2 --tolerance 0.5",
    ),
    (lambda: mmsmith.command("list"), "list"),
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
    (lambda: mmsmith.run("rign"), mmsmith.Error, "there is no solution 'rign'; did you mean 'ring'"),
    (lambda: mmsmith.run("ring", cells=0), mmsmith.Error, "invalid value '0' for 'cells': it must be a whole number, at least 1$"),
    (lambda: mmsmith.run("ring", shape="gmip"), mmsmith.Error, "(?s)'shape'.*cpdi2.*a similar value exists: 'gimp'$"),
    (lambda: mmsmith.run("ring", cels=8), TypeError, r"^run\(\) has no keyword 'cels'; did you mean 'cells'\?$"),
    (lambda: mmsmith.run("ring", colour=8), TypeError, r"^run\(\) has no keyword 'colour'; there are: cells, shape"),
    (lambda: mmsmith.load("ring").check(point=8), TypeError, r"^check\(\) has no keyword 'point'; did you mean 'points'\?$"),
    (lambda: mmsmith.converge("ring"), TypeError, "missing 1 required keyword-only argument: 'cells'"),
    (lambda: mmsmith.command("run", "ring", cell=8), mmsmith.Error, "(?s)unexpected argument 'cell' found.*a similar argument exists: 'cells'$"),
    (lambda: mmsmith.run("ring", set={"B": 1}), mmsmith.Error, "ring has no parameter 'B'; it has A, E"),
    (lambda: mmsmith.score("ring", "none.vtu", cells=8), mmsmith.Error, "none.vtu"),
    (lambda: mmsmith.run("ring", layout="gauss", formulation="updated-lagrangian"), mmsmith.Error, "formulation total-lagrangian"),
    (lambda: mmsmith.command("coverage", mmsmith.load("ring", A=0.05)), mmsmith.Error, r"give it 'ring' in place of mmsmith.load\('ring', A=0.05\)"),
]


@pytest.mark.parametrize(("call", "kind", "message"), REFUSALS)
def test_a_refusal_speaks_python(call, kind, message):
    with pytest.raises(kind, match=message) as caught:
        call()
    assert not any(word in str(caught.value) for word in ("--", "Usage", "try 'mms"))


MESSAGES = [
    ("try a smaller time step (--cfl 0.1), or --layout gauss.", "try a smaller time step (cfl=0.1), or layout gauss."),
    ("`--set rho0=1`; --cells 16,32,64.", "`set={\"rho0\": 1}`; cells=[16, 32, 64]."),
    ("--points reference and --cells 8", "points reference and cells=8"),
    ("a required argument was not provided: --cells <N,...>", "a required argument was not provided: cells"),
    ("dt -- 3 and a--b stay", "dt -- 3 and a--b stay"),
]


@pytest.mark.parametrize(("message", "expected"), MESSAGES)
def test_options_in_messages_become_keywords(message, expected):
    assert _invoke.in_python(message) == expected


def test_a_type_checker_knows_the_keywords(tmp_path):
    mypy = pytest.importorskip("mypy.api")
    (tmp_path / "right.py").write_text(
        textwrap.dedent(
            """
            import mmsmith
            ring = mmsmith.load("ring")
            mmsmith.run(ring, cells=8, shape="gimp", set={"A": 0.1}).errors["u"]["linf"] / 2
            mmsmith.converge("ring", cells=[8, 16], expect="u=2", progress=print).order("u") / ring.density()
            mmsmith.score("ring", "a.csv", "b.csv", cells=(8, 16)).passed
            ring.check(points=8).require()
            ring.explain(compare=False)
            """
        ),
        encoding="utf-8",
    )
    wrong = ["run('ring', cels=8)", "run('ring', shape='gmip')", "converge('ring')", "load('ring').check(point=8)", "load('ring').dimensoin"]
    (tmp_path / "wrong.py").write_text("import mmsmith\n" + "".join(f"mmsmith.{line}\n" for line in wrong), encoding="utf-8")
    report, errors, status = mypy.run(["--strict", f"--cache-dir={tmp_path / 'cache'}", str(tmp_path / "right.py")])
    assert status == 0, report + errors
    report, _, _ = mypy.run(["--strict", f"--cache-dir={tmp_path / 'cache'}", str(tmp_path / "wrong.py")])
    assert [int(line.split(":")[1]) for line in report.splitlines() if ": error:" in line] == [2, 3, 4, 5, 6], report


def test_functions_have_the_options_of_the_command_line():
    written = (Path(mmsmith.__file__).parent / "_commands.py").read_text(encoding="utf-8")
    assert written == mms("reference", "--python").stdout


def test_long_work_is_told_of():
    told = []
    mmsmith.run("ring", cells=128, periods=1.0, threads=1, progress=lambda share, what: told.append((share, what)))
    shares = [share for share, _ in told]
    assert shares and shares == sorted(shares) and 0 <= shares[0] and shares[-1] <= 1
    assert all("step" in what for _, what in told)

    class Enough(Exception):
        pass

    def stop(share, what):
        raise Enough

    with pytest.raises(Enough):
        mmsmith.run("ring", cells=256, periods=1000, threads=1, progress=stop)


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


def test_a_run_is_a_dict_and_more():
    run = mmsmith.run("bar", cells=8, periods=0.1)
    assert run.passed is True and run.status == "ok" and run.errors == run["result"]["errors"]
    run.require()
    assert json.loads(json.dumps(run)) == run and pickle.loads(pickle.dumps(run)) == run
    assert str(run).splitlines()[:2] == ["run bar, 8 cells: passed", "error  linf       l2         l1"]
    assert repr(run) == "<run bar, 8 cells: passed>" and run._repr_html_().count("<tr>") == 5
    table = run.to_pandas()
    assert table.shape[0] == 1 and table["u_linf"][0] == run.errors["u"]["linf"] and table["cells"][0] == 8


def test_bodies_at_rest_have_all_that_runs_have():
    run = mmsmith.run("skew-2d", cells=4, static=True)
    assert run.passed is True and run.status == "ok" and run.verdict == "passed" and run.errors["u"]["l2"] > 0.0
    run.require()
    assert str(run).startswith("run skew-2d, 4 cells: passed")
    orders = mmsmith.converge("skew-2d", cells=[4, 8], static=True, shape="bspline2")
    assert orders.verdict == "passed" and not orders.reasons()


def test_a_run_that_stops_does_not_pass():
    stopped = mmsmith.run("axis-aligned", set={"A": 0.24}, cells=8, cfl=3.0)
    assert stopped.passed is False and stopped.status != "ok"
    with pytest.raises(mmsmith.NotPassed) as caught:
        stopped.require()
    assert str(caught.value).startswith("run axis-aligned, 8 cells: ") and stopped.status in str(caught.value).splitlines()[0]
    assert caught.value.result is stopped
    row = mmsmith.converge("axis-aligned", set={"A": 0.24}, cells=[8, 16], cfl=3.0)
    assert row.passed is False and "8 cells: " in str(row).splitlines()[0]


def test_a_missed_order_is_seen():
    missed = mmsmith.converge("axis-aligned-1d", cells=[8, 16], periods=0.25, expect="u=3")
    assert missed.passed is False
    with pytest.raises(AssertionError) as caught:
        missed.require()
    first, *table = str(caught.value).splitlines()
    assert re.match(r"convergence axis-aligned-1d on 8, 16 cells: order of u is 1\.\d\d \(linf\), .* expected 3 \(tolerance 0.1\)", first) or (
        first.startswith("convergence axis-aligned-1d on 8, 16 cells: order of u is") and first.endswith("expected 3 (tolerance 0.1)")
    )
    assert len(table) == 3
    met = mmsmith.converge("axis-aligned-1d", cells=[8, 16], periods=0.25, expect={"u": 2}, tolerance=0.3)
    assert met.passed is True
    met.require()
    assert met.order("u") == met.orders["u"]["linf"][-1] == pytest.approx(mmsmith.orders(met).order("u")[-1])
    assert met.errors["u"]["l2"][1] == met["rows"][1]["errors"]["u"]["l2"]
    table = pickle.loads(pickle.dumps(met)).to_pandas()
    assert list(table["cells"]) == [8, 16] and math.isnan(table["u_linf_order"][0]) and table["u_linf_order"][1] == met.order("u")
    assert not any(isinstance(value, (dict, list)) for value in table.to_numpy().ravel())
    assert len(str(met).splitlines()) == 4 and met._repr_html_().count("<tr>") == 3


def test_orders_in_time_are_over_time_steps():
    study = mmsmith.converge("axis-aligned-1d", cells=8, cfls=[0.1, 0.2, 0.4], periods=0.25)
    table = mmsmith.orders(study)
    assert table.sign == "dt" and table.h[0] > table.h[-1]
    assert table.order("u") == pytest.approx(study["temporal"]["orders"]["u"]["linf"]["local"][::-1])
    assert str(study).splitlines()[1].split()[0] == "cfl"


def test_other_results_are_tables_too():
    limits = mmsmith.stability("axis-aligned-1d", cells=8, over={"nu": [0, 0.3]}, periods=0.1)
    assert list(limits.to_pandas()["nu"]) == [0.0, 0.3] and str(limits).splitlines()[1].split()[:2] == ["nu", "cfl_max"]
    cost = mmsmith.tradeoff("axis-aligned-1d", budget="1s")
    assert len(cost.front) == len(cost["front"]) and cost.front[0]["error"] > cost.front[-1]["error"]
    check = mmsmith.check("ring", "skew-2d", points=20)
    assert {record["solution"] for record in check.records()} == {"ring", "skew-2d"} and "du/dt" in str(check)
    assert mmsmith.load("ring").explain()["title"] in str(mmsmith.explain("ring"))


def test_a_score_is_plotted_with_slopes(tmp_path):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    for cells in (8, 16):
        mmsmith.run("skew-2d", cells=cells, periods=0.1, frames=3, vtk=tmp_path / str(cells))
    score = mmsmith.score("skew-2d", tmp_path / "8", tmp_path / "16", cells=[8, 16], periods=0.1)
    axes = score.plot(norm="l2")
    assert [label.get_text() for label in axes.get_xticklabels()] == ["0.125", "0.0625"]
    assert [mark.get_text() for mark in axes.texts] == [str(round(score.order(field, "l2"))) for field in "uvFP"]
    assert len(axes.patches) == 4 and axes.get_title() == "score skew-2d on 8, 16 cells"


def test_orders_of_errors():
    table = mmsmith.orders([0.4, 0.2, 0.1], {"u": [16e-3, 4e-3, 1e-3], "F": [4e-1, 2e-1, 1e-1]})
    assert table.order("u") == pytest.approx((2.0, 2.0)) and table.order("F") == pytest.approx((1.0, 1.0))
    assert str(table).splitlines()[-1].split() == ["0.1", "1.000e-03", "2.00", "1.000e-01", "1.00"]
    assert table._repr_html_().count("<tr>") == 4
    mmsmith.assert_order(table, u=2, F=1)
    with pytest.raises(mmsmith.NotPassed, match=r"^order of u is 2.00, expected 3 \(tolerance 0.1\)\nh") as failed:
        mmsmith.assert_order(table, u=3)
    assert str(table) in str(failed.value)
    assert math.isnan(mmsmith.orders([2, 1], [1.0, 0.0]).order("u")[0])
    with pytest.raises(AssertionError, match="order of u is nan"):
        mmsmith.assert_order(mmsmith.orders([2, 1], [1.0, math.inf]), u=1)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: mmsmith.orders([1, 2], [1, 1]), "each is smaller than the one before it"),
        (lambda: mmsmith.orders([2, 1], {"F": [1]}), "F has 1 errors for 2 grid spacings"),
        (lambda: mmsmith.assert_order(mmsmith.orders([2, 1], [4, 1]), F=1), "there are no errors of F; there are those of u"),
        (lambda: mmsmith.assert_order(mmsmith.orders([2, 1], [4, 1]), tolerence=1), "there are no errors of tolerence; did you mean 'tolerance'"),
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
    right = mmsmith.load(solution.name, **solution.parameters)
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

        @pytest.mark.manufactured("ring", cell=(4, 8))
        def test_misspelt(manufactured):
            manufactured.check(solve)

        def test_no_mark(manufactured):
            pass
        """
    )
    result = pytester.runpytest_subprocess("--strict-markers")
    result.assert_outcomes(passed=1, failed=1, errors=2)
    result.stdout.fnmatch_lines_random(
        [
            "*(..., cell=(4, 8)): (4, 8) is no order; there are no errors of cell; did you mean 'cells'?*",
            "*the fixture takes a mark*",
            "E * mmsmith.NotPassed: ring on 4, 8 cells: order of u is 2.00, expected 3 (tolerance 0.1)",
            "*h * u * order*",
            "FAILED *test_third_order - *",
        ]
    )
    # The lines of the test and of the message, and none of the package.
    said = "\n".join(result.outlines)
    assert not any(line in said for line in ("def check", "def require", "raise NotPassed", "_orders.py"))


def test_the_command_is_in_the_package(tmp_path):
    # The commit follows, where the package was built in a repository.
    assert re.fullmatch(rf"mms {re.escape(mmsmith.__version__)}( \(\w+( with changes)?\))?\n", mms("--version").stdout)
    assert mms("check", "ring", "--points", "20").returncode == 0
    refused = mms("check", "rign")
    assert refused.returncode == 2 and "did you mean 'ring'" in refused.stderr
    shown = mms("run", "ring", "--cells", "8", "--periods", "0.05", "--vtk", str(tmp_path / "run-8"))
    assert shown.returncode == 0, shown.stderr
    scored = mms("score", "ring", str(tmp_path / "run-8"), "--cells", "8")
    assert scored.returncode == 0 and "8 cells" in shown.stdout and "P " in scored.stdout
