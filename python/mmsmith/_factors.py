"""Mistakes of unknown size: a factor, or a time, that is fitted to the errors."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy

from mmsmith._handed import Array, Asked, Handed
from mmsmith._search import Search, order_of, size_of

#: A factor so near to one is none.
_NONE = 0.005
#: Fits of a factor on a grid; the response of a body is nearly proportional to a change of its forces.
_FITS = 3
#: What is fitted must leave so much less of the error.
_LEAVES = 0.3
#: On the coarsest grid, where the errors of the method are larger.
_LEAVES_COARSE = 0.6
#: A result belongs to a time that is so many steps off at most.
_STEPS_OFF = 2.0


@dataclass(frozen=True)
class Fitted:
    """A mistake of a size that was fitted, and the errors that its opposite leaves."""

    name: str
    text: str
    order: float
    errors: dict[str, float]


@dataclass(frozen=True)
class _Family:
    name: str
    #: The cause whose opposite is the change for a factor of two; none where damping is countered.
    cause: str
    #: Whether that change is one of the field itself, which the inverse of the factor counters.
    is_of_field: bool
    text: str


_FAMILIES = (
    _Family("force-factor", "force-halved", True, "the body force enters with {size:.3g} times its size. Look at the factors and weights where b is added"),
    _Family("traction-factor", "traction-halved", True, "tractions enter with {size:.3g} times their size. Look at the factors and weights where they are added"),
    _Family("mu-factor", "mu-doubled", False, "mu has {size:.3g} times its size. Look at the constants of the law, mu = E/(2 (1 + nu))"),
    _Family("lambda-factor", "lambda-doubled", False, "lambda has {size:.3g} times its size. Look at the constants of the law, lambda = E nu/((1 + nu)(1 - 2 nu))"),
    _Family("internal-force-factor", "internal-force-doubled", False, "the internal force has {size:.3g} times its size. Look at E, weights and determinants"),
    _Family("mass-factor", "mass-doubled", False, "the mass has {size:.3g} times its size. Look at the density and the weights of the mass"),
    _Family("damping", "", False, "the motion is damped by {rate:.3g} v. Look at damping and artificial viscosity that were left on"),
)


def fitted(search: Search, sizes: dict[int, float]) -> list[Fitted]:
    """The factors, and the times of results, that restore the order; the best first."""
    found = [one for one in (_time_of_result(search, sizes), *(_factor(search, family, sizes) for family in _FAMILIES)) if one is not None]
    return sorted(found, key=lambda one: size_of(one.errors))


def _restores(search: Search, errors: dict[int, dict[str, float]], sizes: dict[int, float]) -> bool:
    last = search.cells[-1]
    orders = all(order_of(errors, field) >= order - search.tolerance for field, order in search.expected.items())
    return orders and size_of(errors[last]) < _LEAVES * sizes[last]


def _factor(search: Search, family: _Family, sizes: dict[int, float]) -> Fitted | None:
    right = search.right
    if family.cause:
        if family.cause in search.not_tried or family.cause not in search.found:
            return None
        changed = search.changed([family.cause])
    else:
        changed = right

    def hand(share: float) -> Callable[[Asked, str, Array, float], Array]:
        def handed(ask: Asked, letter: str, X: Array, t: float) -> Array:
            values = ask(letter, X, t)
            if not family.cause:
                return values + share * ask("v", X, t) if letter == "b" else values
            if letter != "b" and not letter.startswith("traction"):
                return values
            surface = letter.partition(":")[2]
            other = changed.traction(surface, X, t) if surface else changed.b(X, t)
            return values + share * (other - values)

        return handed

    def deviation(share: float, count: int) -> tuple[Array | None, dict[str, float]]:
        errors, result = search.run(Handed(right, right, hand(share), search.share), count)
        if result is None or "u" not in result:
            return None, errors
        u = numpy.asarray(result["u"], float)
        exact = right.u(numpy.asarray(result["X"], float), float(result["t"]))
        return ((u - exact).ravel() if numpy.isfinite(u).all() else None), errors

    unit = 0.25 if family.cause else 0.5 / float(right.period)
    share, shares = unit, []
    coarse, fine = search.cells[0], search.cells[-1]
    for count in (coarse, fine):
        if not search.has_time({count: _FITS + 1, fine: 3}):
            return None
        at_rest = deviation(0.0, count)[0]
        if at_rest is None:
            return None
        for _ in range(_FITS if count == coarse else 1):
            at = deviation(share, count)[0]
            if at is None or share == 0.0:
                return None
            slope = (at - at_rest) / share
            square = float(slope @ slope)
            if not square > 0.0:
                return None
            share = -float(at_rest @ slope) / square
        shares.append(share)
        if count == coarse and not _is_less(deviation(share, count)[0], at_rest):
            return None
    # The errors of the method draw a fit away, with the square of the cells.
    ratio = (fine / coarse) ** 2
    share = (ratio * shares[1] - shares[0]) / (ratio - 1)
    if abs(share) < _NONE * unit / 0.25 or family.cause and 1 + share <= 0:
        return None
    errors = {count: deviation(share, count)[1] for count in search.cells}
    if _restores(search, errors, sizes) and search.has_time({2 * fine: 1}):
        errors[2 * fine] = deviation(share, 2 * fine)[1]
    if not _restores(search, errors, sizes):
        return None
    size = 1 / (1 + share) if family.is_of_field else 1 + share
    text = family.text.format(size=size, rate=share)
    return Fitted(family.name, text, order_of(errors, next(iter(search.expected))), errors[max(errors)])


def _is_less(fitted: Array | None, at_rest: Array) -> bool:
    return fitted is not None and bool(numpy.linalg.norm(fitted) < _LEAVES_COARSE * numpy.linalg.norm(at_rest))


def _time_of_result(search: Search, sizes: dict[int, float]) -> Fitted | None:
    """Times that the results belong to, in the place of those that they tell."""
    right = search.right
    errors, told = {}, []
    for count in search.cells:
        result = search.results.get(count)
        dt = search.dt.get(count, numpy.nan)
        if result is None or "u" not in result or not dt > 0 or set(search.expected) != {"u"}:
            return None
        X, t, u = numpy.asarray(result["X"], float), float(result["t"]), numpy.asarray(result["u"], float)
        if not numpy.isfinite(u).all():
            return None
        later = 0.0
        for _ in range(10):
            v = right.v(X, t + later)
            square = float((v * v).sum())
            if not square > 0.0:
                return None
            later += float(((u - right.u(X, t + later)) * v).sum()) / square
            if not abs(later) <= _STEPS_OFF * dt:
                return None
        errors[count] = search.measured({**result, "t": t + later})
        told.append(f"{later / dt:+.2f} time steps on {count} cells")
    if not _restores(search, errors, sizes):
        return None
    text = f"the result belongs to another time than it tells: {', '.join(told)}. Look at the number of steps, at the last one of them, and at the time that is told with the result"
    return Fitted("result-time", text, order_of(errors, "u"), errors[max(errors)])
