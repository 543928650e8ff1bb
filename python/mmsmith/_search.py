"""The runs of a solver with one mistake countered after another."""

import time as clock
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy
from numpy.typing import NDArray

from mmsmith import _mmsmith
from mmsmith._handed import Array, Asked, Handed, Row, counter, rows, time_step
from mmsmith._orders import measure
from mmsmith._solution import Annulus, Solution

#: Runs a solver on a grid and gives what `measure` takes.
Solver = Callable[[Solution, int], Mapping[str, Any]]

#: A solver whose order is lower than expected by no more is run on a third grid before it is judged.
_NEAR = 0.7
#: How many causes are run on the second grid, the third grid, and in pairs with all others.
_SECOND, _THIRD, _PAIRED = 24, 5, 5
#: Errors that fall with a lower order are not those of a mistake that vanishes with the cells.
_VANISHING = 0.4
#: Two causes at once must leave so much less than each of them alone.
_PAIR_LEAVES = 0.5
#: By so much a field is changed to see whether a solver uses it.
_NUDGE = 1.01


class Search:
    """The runs of one solver with one solution."""

    def __init__(
        self,
        solver: Solver,
        right: Solution,
        cells: Sequence[int],
        expected: Mapping[str, float],
        tolerance: float,
        norm: str,
        dt: Mapping[int, float],
        share: float,
        until: float,
    ) -> None:
        self.solver, self.right, self.cells = solver, right, list(cells)
        self.expected, self.tolerance, self.norm, self.share, self.until = expected, tolerance, norm, share, until
        self.dt = dict(dt)
        self.rows = rows()
        self.calls: list[tuple[str, float]] = []
        self.not_tried: dict[str, str] = {}
        self.found: dict[str, dict[int, dict[str, float]]] = {}
        self.result: Mapping[str, Any] | None = None
        self.results: dict[int, Mapping[str, Any] | None] = {}
        self.seconds: dict[int, float] = {}
        self.error = ""
        self._fields: dict[str, Solution] = {}

    def run(self, handed: Handed, count: int) -> tuple[dict[str, float], Mapping[str, Any] | None]:
        """The errors against the right fields; infinite where the solver raises an exception or has no numbers."""
        begin = clock.perf_counter()
        try:
            with warnings.catch_warnings(), numpy.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                result = self.solver(handed, count)
        except Exception as error:
            self.error = f"{type(error).__name__}: {error}"
            return dict.fromkeys(self.expected, numpy.inf), None
        finally:
            self.seconds[count] = max(self.seconds.get(count, 0.0), clock.perf_counter() - begin)
        if "X" not in result or "t" not in result:
            raise ValueError("the solver gives no X and t, or no computed fields; diagnose needs X, t, and fields such as u, not errors: they are those of the right solution")
        return self.measured(result), result

    def measured(self, result: Mapping[str, Any]) -> dict[str, float]:
        """The errors of a result against the right fields."""
        kept = {key: value for key, value in result.items() if key in ("X", "t") or key in self.expected}
        return measure(self.right, kept, self.norm)

    def with_right_fields(self) -> dict[int, dict[str, float]]:
        """The errors on every grid; the time steps and the calls of the solver are kept."""
        errors = {}
        for count in self.cells:
            handed = Handed(self.right, self.right, share=self.share)
            errors[count], result = self.run(handed, count)
            self.dt.setdefault(count, time_step(handed.calls))
            self.results[count] = result
            if count == self.cells[0]:
                self.calls, self.result = handed.calls, result
        return errors

    def h(self, count: int) -> float:
        return self.right.cell_length / count

    def changed(self, names: Sequence[str]) -> Solution:
        """The solution with those causes countered that need other fields."""
        names = [name for name in names if self.rows[name].kind in ("fields", "memory")]
        if not names:
            return self.right
        key = "+".join(names)
        if key not in self._fields:
            self._fields[key] = Solution(self.right._fields.against(names), self.right._source, self.right._given)
        return self._fields[key]

    def handed(self, names: Sequence[str], count: int) -> Handed:
        hands = [hand for name in names if (hand := counter(self.rows[name], self.right, self.dt.get(count, numpy.nan), self.h(count)))]
        if len(hands) < 2:
            return Handed(self.right, self.changed(names), hands[0] if hands else None, self.share)
        first, second = hands[:2]

        def both(ask: Asked, letter: str, X: Array, t: float) -> Array:
            return first(lambda *asked: second(ask, *asked), letter, X, t)

        return Handed(self.right, self.changed(names), both, self.share)

    def errors(self, names: tuple[str, ...], count: int) -> dict[str, float]:
        """The errors on a grid with these causes countered."""
        known = self.found.setdefault(" and ".join(names), {})
        if count not in known:
            known[count] = self.run(self.handed(names, count), count)[0]
        return known[count]

    def order(self, names: tuple[str, ...], field: str) -> float:
        """The order from the last grid but one to the last of those that were run."""
        known = self.found[" and ".join(names)]
        return order_of(known, field)

    def restores(self, names: tuple[str, ...], slack: float = 0.0) -> bool:
        return all(self.order(names, field) >= order - self.tolerance - slack for field, order in self.expected.items())

    def explains(self, names: tuple[str, ...], right: Mapping[int, Mapping[str, float]]) -> bool:
        """Whether the order is restored by a cause that can be one of these errors with the right fields.

        What vanishes with the cells, as a shift by a time step, leaves no error that stays: there it cancels a part of another error on one grid
        and none on the next.
        """
        vanishing = all(self.rows[name].kind in ("time", "cell") for name in names)
        stays = any(order_of(right, field) < _VANISHING for field in self.expected)
        return self.restores(names) and not (vanishing and stays)

    def size(self, names: tuple[str, ...], count: int) -> float:
        """The errors on a grid as one number."""
        return size_of(self.errors(names, count))

    def admissible(self) -> list[str]:
        """The causes that can be tried; the others are told."""
        names = []
        moves = self.dt.get(self.cells[0], numpy.nan) > 0
        asked = {letter.partition(":")[0] for letter, _ in self.calls}
        for name, row in self.rows.items():
            if row.kind == "unused":
                continue
            if row.kind in ("time", "impulse") and not moves:
                self.not_tried[name] = "the solver asks for fields at one time; give its time steps, dt={8: 0.01, 16: 0.005}, if it has any"
            elif (missing := _letter(row)) and missing not in asked:
                self.not_tried[name] = f"the solver does not ask for {_SPOKEN[missing]}"
            elif not self.is_asked_in_time(row):
                self.not_tried[name] = f"the solver does not ask for {_SPOKEN[missing]} at that time"
            elif not self.differs(name):
                self.not_tried[name] = f"blind: with this solution and these parameters it changes no field ({self.right.name})"
            else:
                names.append(name)
        return names

    def is_asked_in_time(self, row: Row) -> bool:
        """Whether a solver asks for a field of its boundary after the start, and for one of the start then."""
        dt = self.dt.get(self.cells[0], numpy.nan)
        is_late = {t > 0.75 * dt for letter, t in self.calls if letter == _letter(row)}
        if not dt > 0 or _letter(row) not in ("u", "v") or row.kind not in ("time", "motion"):
            return True
        return (row.of != "initial-velocity") in is_late

    def differs(self, name: str) -> bool:
        """Whether a solver is given other fields where a cause is countered."""
        row = self.rows[name]
        try:
            changed = self.changed([name])
        except _mmsmith.NoEffect:
            return False
        dt = self.dt.get(self.cells[0], numpy.nan)
        hand = counter(row, self.right, dt, self.h(self.cells[0]))
        X = self.right.sample(40)
        surfaces = [surface for surface, condition in self.right.boundaries.items() if "prescribed-traction" in condition]
        letters = [*"uvb", *(f"traction:{surface}" for surface in surfaces)]
        right, handed = (Handed(self.right, one) for one in (self.right, changed))
        for t in (0.0, 0.13 * self.right.period, 0.37 * self.right.period):
            for letter in letters:
                points = X if len(letter) == 1 else _on(self.right, letter.partition(":")[2], X)
                one = right._of_changed(letter, points, t)
                other = handed._of_changed(letter, points, t) if hand is None else hand(handed._of_changed, letter, points, t)
                if abs(one - other).max() > 1e-9 * abs(one).max():
                    return True
        return False

    def has_time(self, runs: Mapping[int, int]) -> bool:
        return clock.perf_counter() + sum(self.seconds.get(count, 0.0) * many for count, many in runs.items()) < self.until

    def single(self) -> list[tuple[str, ...]]:
        """The causes by what countering them leaves of the error: first those that restore the order."""
        coarse, *finer = self.cells
        names: list[tuple[str, ...]] = []
        for name in self.admissible():
            # With time left for the second grid, and for what is fitted.
            if self.has_time({coarse: 40, finer[-1]: 12}):
                self.errors((name,), coarse)
                names.append((name,))
            else:
                self.not_tried[name] = "there was no time for it; give more, seconds=300"
        best = sorted(names, key=lambda one: self.size(one, coarse))
        tried: list[tuple[str, ...]] = []
        for one in best[:_SECOND]:
            if not numpy.isfinite(self.size(one, coarse)) or not self.has_time({finer[0]: 1}):
                break
            for count in finer:
                self.errors(one, count)
            tried.append(one)
        return self.ranked(self.refined(tried))

    def refined(self, tried: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
        """Runs those next to the order on one more grid, all of them or none."""
        last = self.cells[-1]
        near = sorted((one for one in tried if self.restores(one, _NEAR)), key=lambda one: self.size(one, last))[:_THIRD]
        finest = 2 * last
        growth = self.seconds.get(last, 0.0) / max(self.seconds.get(self.cells[0], 0.0), 1e-6)
        self.seconds.setdefault(finest, self.seconds.get(last, 0.0) * min(max(growth, 2.0), 16.0))
        if len(near) > 0 and self.has_time({finest: len(near)}):
            if finest not in self.dt:
                handed = Handed(self.right, self.right, share=self.share)
                self.run(handed, finest)
                self.dt[finest] = time_step(handed.calls)
            for one in near:
                self.errors(one, finest)
        return tried

    def ranked(self, tried: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
        finest = max((count for one in tried for count in self.found[" and ".join(one)]), default=0)

        table = list(self.rows)

        def key(one: tuple[str, ...]) -> tuple[bool, bool, float, list[int]]:
            known = self.found[" and ".join(one)]
            size = size_of(known[max(known)])
            # Mistakes that are not told apart, in the order of the table.
            about = round(float(numpy.log(size)) / 0.02) if 0 < size < numpy.inf else size
            return not self.restores(one), finest not in known, about, [table.index(name) for name in one]

        return sorted(tried, key=key)

    def pairs(self, singles: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
        """Two causes at once: the most promising with all others, as long as there is time."""
        coarse, *finer = self.cells
        names = [name for name in self.rows if coarse in self.found.get(name, {})]
        best = sorted(names, key=lambda name: self.size((name,), coarse))[:_PAIRED]
        tried: list[tuple[str, ...]] = []
        for first in best:
            for second in names:
                pair = (first, second)
                if first == second or " and ".join(reversed(pair)) in self.found or not self.has_time({coarse: 1, finer[-1]: 6}):
                    continue
                try:
                    self.errors(pair, coarse)
                except _mmsmith.NoEffect:
                    continue
                tried.append(pair)
        tried = sorted(tried, key=lambda one: self.size(one, coarse))[:_SECOND]
        done: list[tuple[str, ...]] = []
        for one in tried:
            if not self.has_time({finer[-1]: 1}):
                break
            for count in finer:
                self.errors(one, count)
            done.append(one)
        return [one for one in self.ranked(self.refined(done)) if self.is_less_than_its_parts(one)]

    def is_less_than_its_parts(self, pair: tuple[str, ...]) -> bool:
        """Whether both causes count: a pair of which one does nothing is that other one."""
        last = self.cells[-1]
        return all(self.size(pair, last) < _PAIR_LEAVES * self.size((name,), last) for name in pair)

    def unused(self) -> list[str]:
        """The fields that should have an effect on the result, and have none."""
        right, dt = self.right, self.dt.get(self.cells[0], numpy.nan)
        start = 0.5 * dt if dt > 0 else 0.0
        X = right.sample(200)
        end = 0.4 * right.period
        loaded = [surface for surface, condition in right.boundaries.items() if "prescribed-traction" in condition]
        moved = [surface for surface, condition in right.boundaries.items() if "prescribed-motion" in condition]
        is_late = {"u": False, "v": False, "b": False, "traction": False}
        for letter, t in self.calls:
            kind = letter.partition(":")[0]
            is_late[kind] = is_late.get(kind, False) or t > start
        before_start = any(letter == "u" and t < -start for letter, t in self.calls)
        found = []

        def ignores(which: Callable[[str, float], bool], component: int | None = None, within: bool = False) -> bool:
            def nudged(ask: Asked, letter: str, X: Array, t: float) -> Array:
                values = ask(letter, X, t)
                if not which(letter.partition(":")[0], t):
                    return values
                if within:
                    inside = ~numpy.any([_is_on(right, surface, X) for surface in moved], axis=0) if moved else numpy.ones(len(X), bool)
                    return numpy.where(inside[:, None], _NUDGE * values, values)
                factor = numpy.full(right.dimension, _NUDGE) if component is None else numpy.ones(right.dimension)
                factor[component if component is not None else slice(None)] = _NUDGE
                return values * factor

            if not any(which(letter.partition(":")[0], t) for letter, t in self.calls):
                return True
            result = self.run(Handed(right, right, nudged, self.share), self.cells[0])[1]
            if result is None or self.result is None:
                return False
            return all(numpy.array_equal(result[key], self.result[key]) for key in self.expected)

        b = abs(right.b(X, end)).max(axis=0)
        if b.max() > 0:
            if ignores(lambda letter, t: letter == "b"):
                found.append("force-unused")
            elif dt > 0 and ignores(lambda letter, t: letter == "b" and t > start):
                found.append("force-frozen")
            elif any(ignores(lambda letter, t: letter == "b", i) for i in range(right.dimension) if b[i] > 1e-9 * b.max()):
                found.append("force-component-unused")
        tractions = [abs(right.traction(surface, _on(right, surface, X), end)).max() for surface in loaded]
        if tractions and max(tractions) > 0 and self.is_wrong_on(loaded):
            if ignores(lambda letter, t: letter == "traction"):
                if not any(letter in ("P", "F") for letter, _ in self.calls):
                    found.append("traction-unused")
            elif dt > 0 and ignores(lambda letter, t: letter == "traction" and t > start):
                found.append("traction-frozen")
        if moved and not is_late["v"] and self.is_wrong_on(moved) and ignores(lambda letter, t: letter == "u" and t > start):
            found.append("boundary-unused")
        v, u = abs(right.v(X, 0.0)).max(), abs(right.u(X, 0.0)).max()
        largest = max(abs(right.v(X, share * right.period)).max() for share in (0.1, 0.25, 0.4))
        is_moving = dt > 0
        if is_moving and v > 1e-6 * largest and not before_start and ignores(lambda letter, t: letter == "v" and t <= start):
            found.append("initial-velocity-unused")
        largest = max(abs(right.u(X, share * right.period)).max() for share in (0.1, 0.25, 0.4))
        if is_moving and u > 1e-6 * largest and ignores(lambda letter, t: letter == "u" and t <= start, within=True):
            found.append("initial-displacement-unused")
        return found

    def is_wrong_on(self, surfaces: Sequence[str]) -> bool:
        """Whether the displacement on surfaces is wrong by a part of the motion; true where no point of the result is on them."""
        if self.result is None or "u" not in self.result:
            return True
        X, t = numpy.asarray(self.result["X"]), float(self.result["t"])
        on = numpy.zeros(len(X), bool)
        for surface in surfaces:
            on |= _is_on(self.right, surface, X)
        if not on.any():
            return True
        exact = self.right.u(X[on], t)
        return bool(abs(numpy.asarray(self.result["u"])[on] - exact).max() > 0.02 * abs(exact).max())


#: What a solver asks for, in words.
_SPOKEN = {"b": "a body force", "u": "u", "v": "v", "traction": "tractions"}


def _letter(row: Row) -> str:
    """The field that a solver must ask for, if a cause is to be seen."""
    if row.kind == "fields":
        starts = {"initial-velocity": "v", "traction": "traction"}
        return next((letter for start, letter in starts.items() if row.name.startswith(start)), "b")
    if row.kind == "motion":
        return "v" if row.of == "velocity" else "u"
    if row.of == "everything":
        return "b"
    of = {"boundary": "u", "boundary-velocity": "v", "initial-velocity": "v", "traction": "traction"}
    return of.get(row.of, "b")


def size_of(errors: Mapping[str, float]) -> float:
    sizes = list(errors.values())
    return float(numpy.linalg.norm(sizes)) if numpy.isfinite(sizes).all() else numpy.inf


def order_of(known: Mapping[int, Mapping[str, float]], field: str) -> float:
    counts = sorted(known)[-2:]
    if len(counts) < 2:
        return numpy.nan
    coarse, fine = (known[count][field] for count in counts)
    if not (0 < fine < numpy.inf and 0 < coarse < numpy.inf):
        return numpy.nan
    return float(numpy.log(coarse / fine) / numpy.log(counts[1] / counts[0]))


def _on(right: Solution, surface: str, X: Array) -> Array:
    """The points moved to a surface."""
    X = X.copy()
    domain = right.domain
    if surface in ("inner", "outer"):
        assert isinstance(domain, Annulus)
        X *= getattr(domain, surface) / numpy.linalg.norm(X, axis=1, keepdims=True)
        return X
    axis, side = "XYZ".index(surface[0]), surface[2:]
    X[:, axis] = 0.0 if isinstance(domain, Annulus) else getattr(domain, side)[axis]
    return X


def _is_on(right: Solution, surface: str, X: Array) -> NDArray[numpy.bool_]:
    return numpy.asarray(abs(X - _on(right, surface, X)).max(axis=1) < 1e-9 * right.cell_length)
