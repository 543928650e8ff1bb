"""A fixture for tests of solvers.

    @pytest.mark.manufactured("ring", cells=(8, 16, 32), u=2)
    def test_the_solver_is_of_second_order(manufactured):
        manufactured.check(solve)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pytest

from mmsmith._audit import Solver, check_order
from mmsmith._orders import no_errors_of
from mmsmith._solution import Array, Solution, load


@dataclass(frozen=True)
class Manufactured:
    """A solution, and the orders that a solver should have with it."""

    solution: Solution
    cells: Sequence[int]
    tolerance: float
    norm: str
    orders: Mapping[str, float]

    @property
    def points(self) -> Array:
        """A thousand reference positions within the body."""
        return self.solution.sample(1000)

    def check(self, solver: Solver) -> None:
        """Runs `solver(solution, cells)` on each grid, and asserts the orders; the message has the table of errors.

        The solver gives what `mmsmith.measure` takes, or errors by field.
        """
        __tracebackhide__ = True
        check_order(solver, self.solution, self.cells, self.tolerance, self.norm, self.orders)


def pytest_configure(config: pytest.Config) -> None:
    """Makes the mark known."""
    line = "manufactured(solution, cells=(8, 16, 32), tolerance=0.1, norm='linf', **orders): what the fixture of this name has"
    config.addinivalue_line("markers", line)


@pytest.fixture
def manufactured(request: pytest.FixtureRequest) -> Manufactured:
    """The solution and the expected orders that the mark of the same name says."""
    mark = request.node.get_closest_marker("manufactured")
    if mark is None or len(mark.args) != 1:
        pytest.fail("the fixture takes a mark with a solution: @pytest.mark.manufactured('ring', u=2)", pytrace=False)
    orders = dict(mark.kwargs)
    cells = orders.pop("cells", (8, 16, 32))
    tolerance, norm = orders.pop("tolerance", 0.1), orders.pop("norm", "linf")
    for name, order in orders.items():
        if not isinstance(order, (int, float)):
            said = f"@pytest.mark.manufactured(..., {name}={order!r}): {order!r} is no order"
            pytest.fail(f"{said}; {no_errors_of(name, list('uvFP'))}", pytrace=False)
    (solution,) = mark.args
    if not isinstance(solution, Solution):
        solution = load(solution)
    return Manufactured(solution, cells, tolerance, norm, orders or {"u": 2})
