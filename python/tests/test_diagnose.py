"""A solver that is right is told so; one with a mistake is told which."""

import sys
from pathlib import Path

import numpy
import pytest

import mmsmith

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests/examples/diagnose"))

import plane  # noqa: E402


def planted(mistake):
    return lambda solution, cells: plane.solve(solution, cells, mistake)


def test_nothing_is_wrong_with_a_right_solver():
    diagnosis = mmsmith.diagnose(plane.solve, "skew-2d")
    assert diagnosis.passed and diagnosis.causes == ()
    assert "nothing is wrong" in str(diagnosis)


# Where the density is one, a force per volume is a force per mass; where it is four, it is a factor of weights.
@pytest.mark.parametrize("density", [1.0, 4.0])
@pytest.mark.parametrize("mistake", ["P transposed", "rho0 b for b"])
def test_a_mistake_is_named(mistake, density):
    diagnosis = mmsmith.diagnose(planted(mistake), mmsmith.load("skew-2d", rho0=density), cells=(6, 12), u=2)
    assert not diagnosis.passed
    first = diagnosis.causes[0]
    assert first.name == plane.MISTAKES[mistake]
    assert first.text == mmsmith.causes()[first.name]
    assert first.text in str(diagnosis) and first.name in diagnosis._repr_html_()


def test_two_mistakes_at_once_are_told():
    class Subtracted:
        """A second mistake, between the solution and the solver."""

        def __init__(self, solution):
            self._solution = solution

        def __getattr__(self, name):
            return getattr(self._solution, name)

        def b(self, X, t):
            return -self._solution.b(X, t)

    diagnosis = mmsmith.diagnose(lambda solution, cells: plane.solve(Subtracted(solution), cells, "P transposed"), "skew-2d", cells=(6, 12))
    assert not diagnosis.passed
    assert "no single mistake" in str(diagnosis)
    assert set(diagnosis.causes[0].name.split(" and ")) == {"stress-transposed", "force-sign"}


@pytest.mark.parametrize("mistake", ["mu too large by a half", "time passed by"])
def test_a_size_that_is_in_no_list_is_fitted(mistake):
    diagnosis = mmsmith.diagnose(planted(mistake), "skew-2d", cells=(6, 12), seconds=300)
    assert diagnosis.causes[0].name == plane.MISTAKES[mistake]
    assert mistake != "mu too large by a half" or "1.5 times" in diagnosis.causes[0].text


def test_what_vanishes_with_the_cells_explains_no_error_that_stays():
    diagnosis = mmsmith.diagnose(planted("a pressure of its own"), "skew-2d", cells=(8, 16))
    assert not diagnosis.passed
    assert diagnosis.causes == ()


def test_what_cannot_be_seen_is_not_tried_and_said():
    diagnosis = mmsmith.diagnose(planted("b subtracted"), "skew-2d", cells=(6, 12))
    assert diagnosis.not_tried["law-neo-hookean"].startswith("blind")
    assert diagnosis.not_tried["traction-sign"] == "the solver does not ask for tractions"


def test_a_solution_that_is_handed_out_has_all_that_a_solution_has():
    seen = []

    def solve(solution, cells):
        X = solution.sample(5)
        out = numpy.empty((5, 2))
        assert solution.b(X, 0.1, out) is out
        at = solution.points(X)
        assert numpy.allclose(at.b(0.1), out, rtol=1e-9)
        assert len(at) == 5 and set(solution.boundaries.values()) == {"prescribed-motion"}
        assert solution.traction("X-upper", X, 0.1).shape == (5, 2)
        with pytest.raises(ValueError, match="dimension"):
            solution.u(X[:, :1], 0.0)
        seen.append(solution)
        return {"X": X, "t": 0.1, "u": solution.u(X, 0.1) * (1 + 1 / cells**2)}

    assert mmsmith.diagnose(solve, "skew-2d").passed
    assert all(isinstance(one, mmsmith.Solution) for one in seen)


def test_errors_in_place_of_fields_are_refused():
    with pytest.raises(ValueError, match="diagnose needs X, t"):
        mmsmith.diagnose(lambda solution, cells: {"u": 1.0}, "skew-2d")
    with pytest.raises(ValueError, match="two grids"):
        mmsmith.diagnose(plane.solve, "skew-2d", cells=(8,))
