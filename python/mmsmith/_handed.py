"""The solution that a solver is given to find its mistake: some of its fields have the opposite mistake."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from mmsmith import _mmsmith
from mmsmith._solution import Constant, Points, Solution, time_of

Array = NDArray[numpy.float64]

#: Steps of Newton's method towards a reference position, each of which squares the error.
_SOUGHT = 20


@dataclass(frozen=True)
class Row:
    name: str
    mistake: str
    look: str
    kind: str
    of: str
    steps: float

    @property
    def text(self) -> str:
        return f"{self.mistake}. Look at {self.look}"


def rows() -> dict[str, Row]:
    return {row[0]: Row(*row) for row in _mmsmith.causes()}


#: A field, by its letter or `traction:SURFACE`, at positions and a time.
Asked = Callable[[str, Array, float], Array]


class Handed(Solution):
    """The solution that a solver is given: some of its fields are others, and it is known what was asked for."""

    def __init__(self, right: Solution, changed: Solution, hand: Callable[[Asked, str, Array, float], Array] | None = None, share: float = 1.0) -> None:
        super().__init__(changed._fields, right._source, right._given)
        self._changed = changed
        self._hand = hand
        self._share = share
        #: Whether time steps have begun: what is asked for from then on is no initial value.
        self.is_stepping = False
        self.calls: list[tuple[str, float]] = []

    @property
    def period(self) -> Constant:
        """The time in which the motion repeats, or a part of it."""
        return Constant(self._fields.period * self._share)

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError("this solution cannot be sent to other processes: what the solver asks it for is seen in this one alone")

    def ask(self, letter: str, X: Array, t: float) -> Array:
        """The field that the solver is given."""
        self.calls.append((letter, t))
        self.is_stepping = self.is_stepping or letter not in "uv"
        if self._hand is None:
            return self._of_changed(letter, X, t)
        # At t = 0 once more: a boundary value, which the counter takes for one by its time.
        is_again = letter == "u" and t == 0.0 and self.is_stepping
        return self._hand(self._of_changed, letter, X, numpy.nextafter(t, 1.0) if is_again else t)

    def _of_changed(self, letter: str, X: Array, t: float) -> Array:
        kind, _, surface = letter.partition(":")
        return self._changed.traction(surface, X, t) if surface else Solution._field(self._changed, kind, X, t, None)

    def _field(self, letter: str, X: ArrayLike, t: float | ArrayLike, out: Array | None) -> Array:
        return _into(out, self.ask(letter, self._positions(X), time_of(t)))

    def traction(self, surface: str, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """Traction P N at points of a surface, force per reference area."""
        return _into(out, self.ask(f"traction:{surface}", self._positions(X), time_of(t)))

    def points(self, X: ArrayLike) -> Points:
        """The solution at points that stay."""
        return _HandedPoints(self, self._positions(X))


class _HandedPoints(Points):
    def __init__(self, handed: Handed, X: Array) -> None:
        super().__init__(handed._fields.at(X.reshape(-1, handed.dimension)), X.shape, handed.density)
        self._handed = handed
        self._X = X

    def _field(self, letter: str, t: float, out: Array | None) -> Array:
        if self._handed._hand is None:
            self._handed.calls.append((letter, float(t)))
            return super()._field(letter, t, out)
        return _into(out, self._handed.ask(letter, self._X, float(t)))


def _into(out: Array | None, values: Array) -> Array:
    if out is None:
        return values
    out[...] = values
    return out


def time_step(calls: Sequence[tuple[str, float]]) -> float:
    """The time step of a solver, from the times for which it asked; not a number where it asked for none."""
    for letters in ("b", "traction", "u", "v"):
        times = sorted({t for letter, t in calls if letter.partition(":")[0] == letters})
        steps = numpy.diff(times)
        if len(steps) > 1:
            return float(numpy.median(steps[steps > 1e-9 * steps.max()]))
    return numpy.nan


def _reference(right: Solution, x: Array, t: float) -> Array:
    """The reference positions of the points that are at `x` at the time `t`."""
    X = x - right.u(x, t)
    for _ in range(_SOUGHT):
        step = numpy.linalg.solve(right.F(X, t), (X + right.u(X, t) - x)[..., None])[..., 0]
        X = X - step
        if not abs(step).max() > 1e-14 * (1 + abs(X).max()):
            break
    return X


def counter(row: Row, right: Solution, dt: float, h: float) -> Callable[[Asked, str, Array, float], Array] | None:
    """What a solver is given in place of the fields that it asks for, where these are not other fields of the part in Rust."""

    def is_of(letter: str, t: float) -> bool:
        kind, late = letter.partition(":")[0], t > 0.75 * dt
        late_u = late or 0.0 < t < 1e-300
        return {
            "force": kind == "b",
            "inertia": kind == "b",
            "traction": kind == "traction",
            "boundary": kind == "u" and late_u,
            "boundary-velocity": kind == "v" and late,
            "initial-velocity": kind == "v" and not late,
            "everything": True,
        }[row.of]

    def timed(ask: Asked, letter: str, X: Array, t: float) -> Array:
        if not is_of(letter, t):
            return ask(letter, X, t)
        later = t + row.steps * dt
        if row.of == "inertia":
            return ask(letter, X, t) + ask("a", X, later) - ask("a", X, t)
        return ask(letter, X, later)

    def placed(ask: Asked, letter: str, X: Array, t: float) -> Array:
        if not is_of(letter, t):
            return ask(letter, X, t)
        # Boundary values are those that displacements of the step before are moved to.
        back = dt if row.of == "boundary" and dt > 0 else 0.0
        return ask(letter, _reference(right, X, t - back), t)

    def moved(ask: Asked, letter: str, X: Array, t: float) -> Array:
        late = t > 0.75 * dt or 0.0 < t < 1e-300 or (not dt > 0 and t > 0.0)
        if letter != ("v" if row.of == "velocity" else "u") or not late:
            return ask(letter, X, t)
        u = ask("u", X, t)
        if row.of == "exchanged":
            return numpy.concatenate([u[..., 1::-1], u[..., 2:]], axis=-1)
        return u * {"sign": -1.0, "halved": 2.0, "doubled": 0.5, "velocity": 1.0}[row.of]

    def beside(ask: Asked, letter: str, X: Array, t: float) -> Array:
        return ask(letter, X + row.steps * h if letter == "b" else X, t)

    def pushed(ask: Asked, letter: str, X: Array, t: float) -> Array:
        values = ask(letter, X, t)
        if letter != "b" or t > 0.75 * dt:
            return values
        # A staggered scheme has no velocity at t = 0, but half a step before it.
        return values + ask("v", X, 0.0 if row.steps < 1 else t - dt / 2) / (row.steps * dt)

    return {"time": timed, "place": placed, "motion": moved, "cell": beside, "impulse": pushed}.get(row.kind)
