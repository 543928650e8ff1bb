"""Does a test of a solver catch mistakes? It is run with each of them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mmsmith import _mmsmith
from mmsmith._orders import measure, orders, require
from mmsmith._solution import Solution, load
from mmsmith._tables import as_html, as_markdown, as_text

#: Runs a solver on a grid and gives what `measure` takes; or the errors themselves, by field.
Solver = Callable[[Solution, int], Mapping[str, Any]]

#: Faults that a solver meets: in the body force, the tractions, and the velocity that it starts from. The others are in fields
#: that only a comparison reads.
FAULTS = (
    "body-force-sign",
    "body-force-per-volume",
    "body-force-per-current-volume",
    "body-force-late",
    "body-force-at-current-position",
    "body-force-without-inertia",
    "body-force-without-stress",
    "body-force-exchanged",
    "body-force-of-transposed-stress",
    "body-force-of-kirchhoff-stress",
    "body-force-of-density-one",
    "lame-exchanged",
    "lame-of-plane-stress",
    "traction-dropped",
    "traction-sign",
)


def check_order(solver: Solver, solution: Solution, cells: Sequence[int], tolerance: float, norm: str, expected: Mapping[str, float]) -> None:
    """The test that the pytest fixture and `audit` run: a solver's orders on several grids."""
    __tracebackhide__ = True
    results = [solver(solution, count) for count in cells]
    errors = [measure(solution, result, norm) if "X" in result else result for result in results]
    by_field = {field: [row[field] for row in errors] for field in errors[0]}
    about = f"{solution.name} on {', '.join(map(str, cells))} cells"
    require(orders([solution.cell_length / count for count in cells], by_field), expected, tolerance, about)


@dataclass(frozen=True)
class Audit:
    """What a test caught of each fault with each solution: `caught`, `missed`, or `blind`, where the fault changes no field."""

    outcomes: dict[str, dict[str, str]]
    instead: dict[str, tuple[str, ...]]

    @property
    def caught(self) -> list[str]:
        """The faults that some solution showed."""
        return [fault for fault, row in self.outcomes.items() if "caught" in row.values()]

    @property
    def missed(self) -> list[str]:
        """The faults that no solution showed."""
        return [fault for fault, row in self.outcomes.items() if "caught" not in row.values()]

    def _rows(self) -> list[list[str]]:
        names = list(next(iter(self.outcomes.values()), {}))
        return [["fault", *names], *([fault, *row.values()] for fault, row in self.outcomes.items())]

    def markdown(self) -> str:
        """The outcomes as a Markdown table."""
        return as_markdown(self._rows())

    def __str__(self) -> str:
        lines = [as_text(self._rows()), f"your test catches {len(self.caught)} of {len(self.outcomes)}"]
        for fault in self.missed:
            why = "missed" if "missed" in self.outcomes[fault].values() else "these solutions are blind to it"
            others = self.instead.get(fault, ())
            lines.append(f"  {fault}: {why}" + (f"; it changes fields of {', '.join(others)}" if others else ""))
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return as_html(self._rows())


def audit(
    solver: Solver,
    *solutions: str | Solution,
    cells: Sequence[int] = (8, 16),
    tolerance: float = 0.25,
    norm: str = "linf",
    faults: Sequence[str] = FAULTS,
    **expected: float,
) -> Audit:
    """Runs the test "the errors of this solver fall with these orders" with each fault in the fields that the solver is given.

    `solver(solution, cells)` gives what `measure` takes, or errors by field; `expected` has the orders, such as u=2. A fault is
    caught where the order is missed or the solver raises an exception. Raises AssertionError where the test fails with the right
    fields, since then nothing can be said of it.
    """
    expected = expected or {"u": 2}
    loaded = [load(one) if isinstance(one, str) else one for one in solutions]
    for solution in loaded:
        try:
            check_order(solver, solution, cells, tolerance, norm, expected)
        except AssertionError as error:
            raise AssertionError(f"the test fails with the right fields of {solution.name}; mmsmith.diagnose names the mistake in the solver:\n{error}") from None
    outcomes: dict[str, dict[str, str]] = {}
    for fault in faults:
        outcomes[fault] = {}
        for solution in loaded:
            outcomes[fault][solution.name] = _outcome(solver, solution, fault, cells, tolerance, norm, expected)
    missed = [fault for fault, row in outcomes.items() if "caught" not in row.values()]
    dimensions = {solution.dimension for solution in loaded}
    given = {solution.name for solution in loaded}
    return Audit(outcomes, {fault: _shown_by(fault, dimensions, given) for fault in missed})


def _outcome(
    solver: Solver, solution: Solution, fault: str, cells: Sequence[int], tolerance: float, norm: str, expected: Mapping[str, float]
) -> str:
    try:
        faulty = solution.with_fault(fault)
    except _mmsmith.NoEffect:
        return "blind"
    if not _differ(solution, faulty):
        return "blind"
    try:
        check_order(solver, faulty, cells, tolerance, norm, expected)
    except Exception:
        # An exception of the solver fails the test as an order does.
        return "caught"
    return "missed"


def _differ(solution: Solution, faulty: Solution) -> bool:
    """Whether a fault shows at the values that the parameters have; that of a force per volume does not where the density is one."""
    X = solution.sample(50)
    surfaces = [surface for surface, condition in solution.boundaries.items() if "prescribed-traction" in condition]
    for share in (0.13, 0.37, 0.81):
        t = share * solution.period
        one, other = (
            [*(getattr(each, field)(X, t) for field in "uvaHFJPb"), *(each.traction(surface, X, t) for surface in surfaces)]
            for each in (solution, faulty)
        )
        if any(abs(a - b).max() > 1e-9 * abs(a).max() for a, b in zip(one, other, strict=True)):
            return True
    return False


def _shown_by(fault: str, dimensions: set[int], given: set[str]) -> tuple[str, ...]:
    """The solutions that have other fields with a fault, of the dimensions that the solver has been run in."""
    names = []
    for name in _mmsmith.solutions():
        try:
            solution = load(name)
            if name not in given and solution.dimension in dimensions:
                if _differ(solution, solution.with_fault(fault)):
                    names.append(name)
        except _mmsmith.Error:
            continue
    return tuple(names)
