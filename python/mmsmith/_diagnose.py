"""Which mistake does a solver make? It is given fields with the opposite mistake, one after another, until its errors fall as they should."""

import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy

from mmsmith import _mmsmith
from mmsmith._factors import fitted
from mmsmith._handed import rows
from mmsmith._orders import Orders, orders
from mmsmith._search import Search, Solver, order_of, size_of
from mmsmith._solution import Solution, load
from mmsmith._tables import as_html, as_text

#: Errors of this share are alike.
_ALIKE = 0.02
#: Densities that cannot be told from a factor of another origin.
_LIKE_FACTORS = (0.25, 0.5, 1.0, 2.0, 4.0)


@dataclass(frozen=True)
class Cause:
    """A mistake that explains the errors of a solver."""

    #: The name in the table of `mms diagnose --list`.
    name: str
    #: The order of accuracy once the mistake is countered; None where the mistake was found without another run.
    order: float | None
    #: The mistake, and where to look in the code.
    text: str
    #: The error on the finest grid once the mistake is countered, by field.
    errors: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Diagnosis:
    """What is wrong with a solver.

    `passed` says that its errors fall as expected. Else `causes` has the mistakes that explain them, the best first, `single` whether one
    mistake alone does; `orders` are those with the right fields, `tried` has the order with each mistake countered, `not_tried` why a
    mistake was not looked for, `notes` what else has to be known.
    """

    passed: bool
    causes: tuple[Cause, ...]
    orders: Orders
    tried: dict[str, float]
    not_tried: dict[str, str]
    notes: tuple[str, ...]
    seconds: float

    def _lines(self) -> list[str]:
        if self.passed:
            lines = [f"nothing is wrong: the errors fall as expected ({self._orders()})"]
        elif not self.causes:
            lines = [f"the errors do not fall as expected ({self._orders()}), and none of the {len(self.tried)} mistakes that were tried explains it"]
        else:
            best = self.causes[0]
            lines = [f"{best.text}"]
            if best.order is not None:
                lines.append(f"  order {self._orders()} with the right fields, {best.order:.2f} with the opposite mistake in the fields")
            lines += [f"or: {other.text}" + ("" if other.order is None else f" (order {other.order:.2f})") for other in self.causes[1:4]]
        return [*lines, *self.notes]

    def _orders(self) -> str:
        return ", ".join(f"{name} {self.orders.order(name)[-1]:.2f}" for name in self.orders.errors)

    def __str__(self) -> str:
        return "\n".join([*self._lines(), str(self.orders)])

    def _repr_html_(self) -> str:
        rows = [["mistake", "order with the opposite in the fields", "what to look for"]]
        rows += [[one.name, "" if one.order is None else f"{one.order:.2f}", one.text] for one in self.causes]
        return "".join(f"<p>{line}</p>" for line in self._lines()) + (as_html(rows) if self.causes else "") + self.orders._repr_html_()

    def table(self) -> str:
        """Every mistake that was tried, with the order once it is countered."""
        rows = sorted(self.tried.items(), key=lambda row: -row[1] if row[1] == row[1] else numpy.inf)
        return as_text([["mistake", "order"], *([name, f"{order:.2f}"] for name, order in rows)])


def _seeing(right: Solution) -> tuple[Solution | None, list[str]]:
    """The same solution with parameters that hide less, and what they show."""
    shown, given = [], dict(right._given)

    def other(value: float, changes: Callable[[Solution], bool], text: str, candidates: Sequence[str]) -> None:
        for name in candidates:
            try:
                changed = load(right._source, **{**given, name: value})
            except _mmsmith.Error:
                continue
            if changes(changed):
                given[name] = value
                shown.append(f"{name} = {value:g} ({text})")
                return

    parameters = right.parameters
    if right.density in _LIKE_FACTORS:
        text = "1 hides a force per volume" if right.density == 1 else f"{right.density:g} looks like a factor of weights"
        same = [name for name, value in parameters.items() if value == right.density]
        other(3.0, lambda one: one.density != right.density, f"a density of {text}", same)
    if right.law.get("lambda") == 0:
        zeros = [name for name, value in parameters.items() if value == 0]
        other(0.3, lambda one: one.law.get("lambda", 0.0) > 0, "nu = 0 hides lambda", zeros)
    if not shown:
        return None, []
    return load(right._source, **given), shown


def diagnose(
    solver: Solver,
    solution: str | Solution,
    cells: Sequence[int] = (8, 16),
    tolerance: float = 0.25,
    norm: str = "linf",
    dt: Mapping[int, float] | None = None,
    seconds: float = 50.0,
    **expected: float,
) -> Diagnosis:
    """Finds the mistake in a solver whose errors do not fall as they should.

    `solver(solution, cells)` takes a solution with body force, initial and boundary values, and gives what `measure` takes: `X`, `t`, and
    computed fields such as `u`. `expected` has the orders, such as u=2. The solver is run with the right fields. Where the order is
    missed, it is run with fields that have the opposite of one mistake after another: the mistake that it makes is the one whose opposite
    makes it right. Time steps are learnt from the times for which it asks; `dt` gives them by cells where that is not enough. The runs end
    after about so many `seconds`.
    """
    begin = clock.perf_counter()
    right = load(solution) if isinstance(solution, str) else solution
    if len(cells) < 2 or any(fine <= coarse for coarse, fine in zip(cells, cells[1:], strict=False)):
        raise ValueError(f"cells is {list(cells)}; an order takes two grids or more, the coarsest first, such as (8, 16)")
    expected = expected or {"u": 2}

    def search(one: Solution, share: float = 1.0) -> tuple[Search, dict[int, dict[str, float]]]:
        made = Search(solver, one, cells, expected, tolerance, norm, dt or {}, share, begin + seconds)
        return made, made.with_right_fields()

    made, errors = search(right)
    notes: list[str] = []
    table = _table(right, errors, expected)
    seeing, shown = _seeing(right)
    if _falls(errors, expected, tolerance):
        if seeing is None or right.density not in (1.0,) and right.law.get("lambda") != 0:
            return Diagnosis(True, (), table, {}, {}, tuple(_blind(right)), clock.perf_counter() - begin)
        made, errors = search(seeing)
        if _falls(errors, expected, tolerance):
            notes = [f"also with {', '.join(shown)}", *_blind(seeing)]
            return Diagnosis(True, (), table, {}, {}, tuple(notes), clock.perf_counter() - begin)
        notes = [f"the errors fall with the parameters given, but not with {', '.join(shown)}"]
        right, table = seeing, _table(seeing, errors, expected)
    elif seeing is not None:
        made_seeing, of_seeing = search(seeing)
        if not _falls(of_seeing, expected, tolerance):
            made, errors, right = made_seeing, of_seeing, seeing
            notes = [f"mistakes were looked for with {', '.join(shown)}"]
    made, errors = _bounded(search, made, errors, notes)
    right = made.right
    singles = made.single()
    causes = [one for one in singles if made.explains(one, errors)]
    if not causes and made.share == 1 and any(order_of(errors, field) < -0.3 for field in expected):
        # It may grow without bound, only slowly.
        shorter, of_shorter = search(right, 1 / 8)
        of_less_time = shorter.single() if all(numpy.isfinite(size_of(error)) for error in of_shorter.values()) else []
        if any(shorter.explains(one, of_shorter) for one in of_less_time):
            made, singles, errors = shorter, of_less_time, of_shorter
            causes = [one for one in singles if made.explains(one, errors)]
            notes.append("the error grows with the grid; mistakes were looked for in an eighth of the time")
    sizes = {count: size_of(error) for count, error in errors.items()}
    unused = [] if causes else made.unused()
    factors = [] if causes or unused else fitted(made, sizes)
    if not causes and not unused and not factors and singles:
        causes = [pair for pair in made.pairs(singles) if made.explains(pair, errors)]
        if causes:
            notes.append("no single mistake of the list explains it; two at once do")
    first = next(iter(expected))
    told = [_cause(made, one, first) for one in causes]
    told = [Cause(name, None, made.rows[name].text) for name in unused] + told
    told += [Cause(one.name, one.order, one.text, one.errors) for one in factors]
    if not told:
        notes.append("no single mistake of the list explains it: perhaps there are two at once, or it is not in the list (mmsmith.causes())")
    tied = [one.name for one in told[1:] if one.errors and abs(size_of(one.errors) / size_of(told[0].errors or {first: numpy.inf}) - 1) < _ALIKE]
    if tied:
        notes.append(f"not told apart with this solution: {', '.join([told[0].name, *tied])}")
    notes += _blind(right)
    tried = {name: made.order(tuple(name.split(" and ")), first) for name in made.found}
    return Diagnosis(False, tuple(told), table, tried, made.not_tried, tuple(notes), clock.perf_counter() - begin)


def _bounded(
    search: Callable[..., tuple[Search, dict[int, dict[str, float]]]], made: Search, errors: dict[int, dict[str, float]], notes: list[str]
) -> tuple[Search, dict[int, dict[str, float]]]:
    """A search whose runs with the right fields have an end, where these have none: over a shorter time, or with a smaller motion."""
    right, first = made.right, made.cells[0]
    largest = max(abs(right.u(right.sample(200), share * right.period)).max() for share in (0.1, 0.25, 0.4, 0.5))

    def is_bounded(errors: Mapping[int, Mapping[str, float]]) -> bool:
        return all(numpy.isfinite(size_of(error)) for error in errors.values()) and size_of(errors[first]) < 5 * largest

    if is_bounded(errors):
        return made, errors
    for share in (1 / 8, 1 / 64):
        shorter, of_shorter = search(right, share)
        if is_bounded(of_shorter):
            notes.append(f"the runs grow without bound or end with an error; mistakes were looked for in {share:g} of the time")
            return shorter, of_shorter
    for name, value in right.parameters.items():
        smaller = _smaller(right, name, value / 8)
        if smaller is not None:
            gentler, of_gentler = search(smaller)
            if is_bounded(of_gentler):
                notes.append(f"the runs grow without bound or end with an error; mistakes were looked for with {name} = {value / 8:g}")
                return gentler, of_gentler
    if made.error:
        notes.append(f"the run ended with {made.error}")
    return made, errors


def _smaller(right: Solution, name: str, value: float) -> Solution | None:
    """The solution with a parameter that is an eighth, where that makes the displacement an eighth."""
    try:
        changed = load(right._source, **{**right._given, name: value})
    except _mmsmith.Error:
        return None
    X, t = right.sample(40), 0.13 * right.period
    return changed if changed.period == right.period and numpy.allclose(8 * changed.u(X, t), right.u(X, t), rtol=1e-9, atol=0) else None


def causes() -> dict[str, str]:
    """The mistakes that `diagnose` looks for, with what each is and where to look."""
    return {row.name: row.text for row in rows().values()}


def _cause(made: Search, names: tuple[str, ...], field: str) -> Cause:
    known = made.found[" and ".join(names)]
    text = "; and ".join(made.rows[name].text for name in names)
    return Cause(" and ".join(names), made.order(names, field), text, known[max(known)])


def _falls(errors: Mapping[int, Mapping[str, float]], expected: Mapping[str, float], tolerance: float) -> bool:
    return all(order_of(errors, field) >= order - tolerance for field, order in expected.items())


def _table(right: Solution, errors: Mapping[int, Mapping[str, float]], expected: Mapping[str, float]) -> Orders:
    by_field = {field: [errors[count].get(field, numpy.nan) for count in errors] for field in expected}
    return orders([right.cell_length / count for count in errors], by_field)


def _blind(right: Solution) -> list[str]:
    """What no test with this solution can see."""
    X = right.sample(50)
    P = [right.P(X, share * right.period) for share in (0.13, 0.37)]
    notes = []
    if right.dimension > 1 and all(abs(p - numpy.swapaxes(p, 1, 2)).max() <= 1e-9 * abs(p).max() for p in P):
        notes.append(f"{right.name} cannot show a transposed stress, since P is symmetric; skew-2d and skew-3d can")
    return notes
