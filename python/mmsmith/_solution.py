"""Exact fields at arrays of points."""

import os
from dataclasses import dataclass
from typing import Any

import numpy
from numpy.typing import ArrayLike, NDArray

from mmsmith import _mmsmith
from mmsmith._studies import command

Array = NDArray[numpy.float64]


@dataclass(frozen=True)
class Box:
    """The axis-aligned box between two corners."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]


@dataclass(frozen=True)
class Annulus:
    """The points between two distances from the origin: a ring in the plane, a shell in space."""

    inner: float
    outer: float


class Solution:
    """A manufactured solution, its parameters fixed.

    Positions `X` are reference positions, an array of shape (n, dimension); `t` is a time. The fields of n points are arrays of
    shape (n, dimension) for u, v, a and b, (n, dimension, dimension) for H, F and P, and (n,) for J. Units are those of the
    specification. `out` takes the values where it is given: an array of float64, C-contiguous, of the shape of the result.
    """

    def __init__(self, fields: _mmsmith.Fields, source: str, given: dict[str, float]) -> None:
        self._fields = fields
        self._source = source
        self._given = given

    def u(self, X: ArrayLike, t: float, out: Array | None = None) -> Array:
        """Displacement, a length."""
        return self._field("u", X, t, out)

    def v(self, X: ArrayLike, t: float, out: Array | None = None) -> Array:
        """Velocity."""
        return self._field("v", X, t, out)

    def a(self, X: ArrayLike, t: float, out: Array | None = None) -> Array:
        """Acceleration."""
        return self._field("a", X, t, out)

    def b(self, X: ArrayLike, t: float, out: Array | None = None) -> Array:
        """Body force per unit mass: rho0 a = Div P + rho0 b."""
        return self._field("b", X, t, out)

    def H(self, X: ArrayLike, t: float, out: Array | None = None) -> Array:
        """Displacement gradient, H[p, i, J] = du_i/dX_J."""
        return self._field("H", X, t, out)

    def F(self, X: ArrayLike, t: float, out: Array | None = None) -> Array:
        """Deformation gradient, I + H."""
        return self._field("F", X, t, out)

    def P(self, X: ArrayLike, t: float, out: Array | None = None) -> Array:
        """First Piola-Kirchhoff stress, P[p, i, J]: force in direction i per reference area with normal J."""
        return self._field("P", X, t, out)

    def J(self, X: ArrayLike, t: float, out: Array | None = None) -> Array:
        """det F."""
        return self._field("J", X, t, out)

    def traction(self, surface: str, X: ArrayLike, t: float, out: Array | None = None) -> Array:
        """Traction P N at points of a surface, force per reference area: `inner`, `outer`, `X-lower`, `Y-upper` and so on."""
        X = self._positions(X)
        out = _result(out, X.shape, X)
        self._fields.traction(surface, X, _time(t), out)
        return out

    def points(self, X: ArrayLike) -> "Points":
        """The solution at points that stay: what depends on these alone is computed once."""
        X = self._positions(X)
        return Points(self._fields.at(X), *X.shape)

    def sample(self, n: int, seed: int = 0) -> Array:
        """Reference positions within the body, of shape (n, dimension), evenly spread; the same for the same seed."""
        random = numpy.random.default_rng(seed)
        domain = self.domain
        if isinstance(domain, Box):
            return random.uniform(domain.lower, domain.upper, (n, self.dimension))
        direction = random.normal(size=(n, self.dimension))
        for axis, name in enumerate("XYZ"[: self.dimension]):
            # The other side of a plane of symmetry is not modelled.
            if f"{name}-lower" in self.boundaries:
                direction[:, axis] = abs(direction[:, axis])
        volume = random.uniform(domain.inner**self.dimension, domain.outer**self.dimension, (n, 1))
        X: Array = volume ** (1 / self.dimension) * direction / numpy.linalg.norm(direction, axis=1, keepdims=True)
        return X

    def with_fault(self, fault: str) -> "Solution":
        """The same solution with a mistake in its fields, one of `mmsmith.faults()`: a test that is worth anything fails with it.

        Raises `NoEffect` where the fault changes no field of this solution.
        """
        return Solution(self._fields.with_fault(fault), self._source, self._given)

    def check(self, **options: Any) -> dict[str, Any]:
        """`mms check`: every field compared with the one below it; a dict with `passed`."""
        return command("check", self, **options)

    def explain(self, **options: Any) -> dict[str, Any]:
        """`mms explain`: what the solution models and exercises, with the defaults of its parameters."""
        if self.fault is not None:
            self._words()
        return command("explain", self._source, **options)

    @property
    def name(self) -> str:
        """The name in the specification."""
        return self._fields.name

    @property
    def title(self) -> str:
        """The solution in a line."""
        return self._fields.title

    @property
    def fault(self) -> str | None:
        """The mistake that is planted, if any is."""
        return self._fields.fault

    @property
    def dimension(self) -> int:
        """The number of space dimensions."""
        return self._fields.dimension

    @property
    def parameters(self) -> dict[str, float]:
        """The values of all parameters."""
        return self._fields.parameters

    @property
    def domain(self) -> Box | Annulus:
        """The body's shape in the reference configuration."""
        if self._fields.radii is not None:
            return Annulus(*self._fields.radii)
        assert self._fields.corners is not None
        lower, upper = self._fields.corners
        return Box(tuple(lower), tuple(upper))

    @property
    def boundaries(self) -> dict[str, str]:
        """The condition on each surface: `sliding`, `symmetry`, `traction-free`, `prescribed-traction`, `prescribed-motion`."""
        return dict(self._fields.boundaries)

    @property
    def law(self) -> dict[str, float]:
        """The constants of the constitutive law, by the names that specifications use."""
        return self._fields.law

    @property
    def law_name(self) -> str:
        """The constitutive law, by the name that specifications use."""
        return self._fields.law_name

    @property
    def density(self) -> float:
        """Mass per reference volume."""
        return self._fields.density

    @property
    def wave_speed(self) -> float:
        """The speed that CFL numbers refer to."""
        return self._fields.wave_speed

    @property
    def period(self) -> float:
        """The time in which the motion repeats."""
        return self._fields.period

    @property
    def cell_length(self) -> float:
        """The length that a number of cells divides."""
        return self._fields.cell_length

    def __repr__(self) -> str:
        given = "".join(f", {name}={value!r}" for name, value in self._given.items())
        fault = "" if self.fault is None else f".with_fault({self.fault!r})"
        return f"mmsmith.load({self._source!r}{given}){fault}"

    def _words(self) -> list[str]:
        """The words of a command line that mean this solution."""
        if self.fault is not None:
            raise _mmsmith.Error(f"{self!r} is no solution that a command can take: its fields have a fault")
        return [self._source, *(f"--set={name}={value!r}" for name, value in self._given.items())]

    def _field(self, letter: str, X: ArrayLike, t: float, out: Array | None) -> Array:
        X = self._positions(X)
        out = _result(out, _shape(letter, *X.shape), X)
        self._fields.evaluate(letter, X, _time(t), out)
        return out

    def _positions(self, X: ArrayLike) -> Array:
        X = numpy.asarray(X)
        if not numpy.can_cast(X.dtype, numpy.float64, "safe"):
            raise TypeError(f"X has the type {X.dtype}; it must be float64, or a type of numbers that float64 holds")
        if X.ndim != 2 or X.shape[1] != self.dimension:
            expected = f"(n, {self.dimension}), a row for each point"
            raise ValueError(f"X has the shape {X.shape}; {self.name} has {self.dimension} dimensions: it must be {expected}")
        return numpy.ascontiguousarray(X, dtype=numpy.float64)


class Points:
    """A solution at points that stay, as `Solution.points` makes it.

    The fields have the shapes of `Solution`'s. b equals that of `Solution` but for rounding; the others have the same bits.
    """

    def __init__(self, fields: _mmsmith.FieldsAtPoints, count: int, dimension: int) -> None:
        self._fields = fields
        self._shape = (count, dimension)

    def u(self, t: float, out: Array | None = None) -> Array:
        """Displacement, a length."""
        return self._field("u", t, out)

    def v(self, t: float, out: Array | None = None) -> Array:
        """Velocity."""
        return self._field("v", t, out)

    def a(self, t: float, out: Array | None = None) -> Array:
        """Acceleration."""
        return self._field("a", t, out)

    def b(self, t: float, out: Array | None = None) -> Array:
        """Body force per unit mass."""
        return self._field("b", t, out)

    def H(self, t: float, out: Array | None = None) -> Array:
        """Displacement gradient."""
        return self._field("H", t, out)

    def F(self, t: float, out: Array | None = None) -> Array:
        """Deformation gradient."""
        return self._field("F", t, out)

    def P(self, t: float, out: Array | None = None) -> Array:
        """First Piola-Kirchhoff stress."""
        return self._field("P", t, out)

    def J(self, t: float, out: Array | None = None) -> Array:
        """det F."""
        return self._field("J", t, out)

    def __len__(self) -> int:
        return self._shape[0]

    def _field(self, letter: str, t: float, out: Array | None) -> Array:
        out = _result(out, _shape(letter, *self._shape), None)
        self._fields.evaluate(letter, _time(t), out)
        return out


def load(name: str | os.PathLike[str], /, **parameters: float) -> Solution:
    """The solution of that name, or of the specification in that file, with values in place of its parameters' defaults.

    Names and paths are those that `mms` takes: a path ends in .toml or has a separator. Raises `Error` where there is none, where
    the specification is wrong, or where a parameter is unknown or out of its range.
    """
    source = os.fspath(name)
    given = {key: float(value) for key, value in parameters.items()}
    return Solution(_mmsmith.Fields(source, given), source, given)


def _shape(letter: str, count: int, dimension: int) -> tuple[int, ...]:
    if letter == "J":
        return (count,)
    return (count, dimension, dimension) if letter in "HFP" else (count, dimension)


def _time(t: float) -> float:
    try:
        return float(t)
    except TypeError:
        raise TypeError(f"t is {t!r}; it must be one number: all points are evaluated at the same time") from None


def _result(out: Array | None, shape: tuple[int, ...], X: Array | None) -> Array:
    if out is None:
        return numpy.empty(shape)
    if not isinstance(out, numpy.ndarray) or out.dtype != numpy.float64:
        kind = f"an array of {out.dtype}" if isinstance(out, numpy.ndarray) else f"a {type(out).__name__}"
        raise TypeError(f"out is {kind}; it must be an array of float64")
    if out.shape != shape:
        raise ValueError(f"out has the shape {out.shape}; the result has {shape}")
    if not out.flags.writeable or not out.flags.c_contiguous:
        kind = "be written" if not out.flags.writeable else "take values row by row: it is not C-contiguous"
        raise ValueError(f"out cannot {kind}; numpy.empty({shape}) makes an array that can")
    if X is not None and numpy.may_share_memory(out, X):
        raise ValueError("out shares memory with X, which is read while out is written; give another array")
    return out
