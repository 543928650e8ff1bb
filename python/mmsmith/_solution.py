"""Exact fields at arrays of points."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy
from numpy.typing import ArrayLike, NDArray

from mmsmith import _commands, _mmsmith

Array = NDArray[numpy.float64]


class Constant(float):
    """A number that may be called for itself, since it is a method in the modules that `mms gen` writes: `s.density()`."""

    def __call__(self) -> float:
        """The number."""
        return float(self)

    # Type checkers hold a number of another class for unequal to whole numbers otherwise.
    def __eq__(self, other: object) -> bool:
        return float(self) == other

    __hash__ = float.__hash__


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


Shape = TypeVar("Shape", Box, Annulus)


class Solution:
    """A manufactured solution, its parameters fixed.

    Positions `X` are reference positions, an array of shape (n, dimension), or of any shape whose last axis has the coordinates; `t` is
    a time, or an array with a time for each point. The fields of n points are arrays of shape (n, dimension) for u, v, a and b,
    (n, dimension, dimension) for H, F and P, and (n,) for J. Units are those of the specification. `out` takes the values where it is
    given: an array of float64, C-contiguous, of the shape of the result.

    The NumPy module that `mms gen` writes has the same names, constants as methods: `s.density()` works with both. The constants of the
    law and the tractions have names of their own too, as there: `s.mu()`, `s.X_upper_traction(X, t)`.
    """

    def __init__(self, fields: _mmsmith.Fields, source: str, given: dict[str, float]) -> None:
        self._fields = fields
        self._source = source
        self._given = given

    def u(self, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """Displacement, a length."""
        return self._field("u", X, t, out)

    def v(self, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """Velocity."""
        return self._field("v", X, t, out)

    def a(self, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """Acceleration."""
        return self._field("a", X, t, out)

    def b(self, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """Body force per unit mass: rho0 a = Div P + rho0 b."""
        return self._field("b", X, t, out)

    def H(self, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """Displacement gradient, H[p, i, J] = du_i/dX_J."""
        return self._field("H", X, t, out)

    def F(self, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """Deformation gradient, I + H."""
        return self._field("F", X, t, out)

    def P(self, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """First Piola-Kirchhoff stress, P[p, i, J]: force in direction i per reference area with normal J."""
        return self._field("P", X, t, out)

    def J(self, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """det F."""
        return self._field("J", X, t, out)

    def rho0_b(self, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """Body force per unit reference volume."""
        return _product(self.density, self.b(X, t, out))

    def static_force(self, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """-Div P, the force per reference volume that holds the deformation of time t at rest."""
        return _static(self.density, self.b(X, t, out), self.a(X, t))

    def sigma(self, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """Cauchy stress, P F^T/J."""
        return _cauchy(self.P(X, t, out), self.F(X, t), self.J(X, t))

    def S(self, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """Second Piola-Kirchhoff stress, F^-1 P."""
        return _second(self.P(X, t, out), self.F(X, t))

    def traction(self, surface: str, X: ArrayLike, t: float | ArrayLike, out: Array | None = None) -> Array:
        """Traction P N at points of a surface, force per reference area: `inner`, `outer`, `X-lower`, `Y-upper` and so on."""
        X = self._positions(X)
        return _evaluated(lambda X, t, out: self._fields.traction(surface, X, t, out), X, t, _result(out, X.shape, X))

    @property
    def internal_variables(self) -> list[str]:
        """Names of the internal variables of the law; none for elastic laws."""
        return self._fields.internal_variables

    def internal(self, X: ArrayLike, t: float | ArrayLike) -> dict[str, Array]:
        """Internal variables by name, each with a value a point: `alpha` is the plastic strain, `G11` and so on the entries of (F^p^T F^p)^-1."""
        X = self._positions(X)
        names = self.internal_variables
        shape = (*X.shape[:-1], len(names))
        values = _evaluated(self._fields.internal, X, t, _result(None, shape, X))
        return {name: values[..., k] for k, name in enumerate(names)}

    def points(self, X: ArrayLike) -> "Points":
        """The solution at points that stay: what depends on these alone is computed once."""
        X = self._positions(X)
        return Points(self._fields.at(X.reshape(-1, self.dimension)), X.shape, self.density)

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

    check = _commands.check
    explain = _commands.explain

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
        """The condition on each surface: `sliding`, `symmetry`, `traction-free`, `prescribed-traction`, `prescribed-motion`.

        By component it is the like of `normal prescribed-motion, tangential traction-free`.
        """
        return dict(self._fields.boundaries)

    @property
    def law(self) -> dict[str, float]:
        """The constants of the constitutive law, by the names that specifications use."""
        return self._fields.law

    @property
    def lambda_(self) -> Constant:
        """First Lame constant, of a law that has it."""
        return self._law_constant("lambda")

    @property
    def mu(self) -> Constant:
        """Shear modulus, of a law that has it."""
        return self._law_constant("mu")

    def lower(self) -> list[float]:
        """The corner of a box with the smallest coordinates."""
        return list(self._shape_of(Box).lower)

    def upper(self) -> list[float]:
        """The corner of a box with the largest coordinates."""
        return list(self._shape_of(Box).upper)

    def inner(self) -> float:
        """The inner radius of a ring or a shell."""
        return self._shape_of(Annulus).inner

    def outer(self) -> float:
        """The outer radius of a ring or a shell."""
        return self._shape_of(Annulus).outer

    @property
    def law_name(self) -> str:
        """The constitutive law, by the name that specifications use."""
        return self._fields.law_name

    @property
    def density(self) -> Constant:
        """Mass per reference volume."""
        return Constant(self._fields.density)

    @property
    def wave_speed(self) -> Constant:
        """The speed that CFL numbers refer to."""
        return Constant(self._fields.wave_speed)

    @property
    def period(self) -> Constant:
        """The time in which the motion repeats."""
        return Constant(self._fields.period)

    @property
    def cell_length(self) -> Constant:
        """The length that a number of cells divides."""
        return Constant(self._fields.cell_length)

    def __repr__(self) -> str:
        given = "".join(f", {name}={value!r}" for name, value in self._given.items())
        fault = "" if self.fault is None else f".with_fault({self.fault!r})"
        return f"mmsmith.load({self._source!r}{given}){fault}"

    def __eq__(self, other: object) -> bool:
        return self._identity() == other._identity() if isinstance(other, Solution) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._identity())

    def __reduce__(self) -> tuple[Any, ...]:
        return _restored, (self._source, self._given, self.fault)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._law_names(), *self._tractions()]

    if not TYPE_CHECKING:

        def __getattr__(self, name):
            # Before there are fields nothing can be looked up in them.
            if name.startswith("_"):
                raise AttributeError(name)
            if name in self._law_names():
                return self._law_constant(name)
            if name in self._tractions():
                surface = self._tractions()[name]
                return lambda X, t, out=None: self.traction(surface, X, t, out)
            raise AttributeError(f"the solution {self.name} has no '{name}'")

    def _identity(self) -> tuple[Any, ...]:
        return (self._source, tuple(sorted(self.parameters.items())), self.fault)

    def _law_names(self) -> list[str]:
        return [name for name in self.law if name != "lambda"]

    def _tractions(self) -> dict[str, str]:
        """The surfaces by the names that their tractions have in generated code."""
        domain = self.domain
        faces = [f"{axis}-{side}" for axis in "XYZ"[: self.dimension] for side in ("lower", "upper")]
        surfaces = faces if isinstance(domain, Box) else ["inner", "outer", *(face for face in faces if face in self.boundaries)]
        return {f"{surface.replace('-', '_')}_traction": surface for surface in surfaces}

    def _law_constant(self, name: str) -> Constant:
        if name not in self.law:
            raise AttributeError(f"the law of {self.name} has no {name}; it has {', '.join(self.law) or 'no constants'}")
        return Constant(self.law[name])

    def _shape_of(self, shape: type[Shape]) -> Shape:
        domain = self.domain
        if not isinstance(domain, shape):
            kind = "a box: it has lower() and upper()" if isinstance(domain, Box) else "no box: it has inner() and outer()"
            raise _mmsmith.Error(f"the body of {self.name} is {kind}")
        return domain

    def _words(self, command: str) -> list[str]:
        """The words of a command line that mean this solution."""
        if self.fault is not None:
            raise _mmsmith.Error(f"{self!r} is no solution that a command can take: its fields have a fault")
        if command not in _commands.WITH_SET:
            # An explanation is of the defaults.
            if self._given and command != "explain":
                raise _mmsmith.Error(f"mms {command} takes no values of parameters; give it {self._source!r} in place of {self!r}")
            return [self._source]
        return [self._source, *(f"--set={name}={value!r}" for name, value in self._given.items())]

    def _field(self, letter: str, X: ArrayLike, t: float | ArrayLike, out: Array | None) -> Array:
        X = self._positions(X)
        out = _result(out, _shape(letter, X.shape), X)
        return _evaluated(lambda X, t, out: self._fields.evaluate(letter, X, t, out), X, t, out)

    def _positions(self, X: ArrayLike) -> Array:
        X = numpy.asarray(X)
        if not numpy.can_cast(X.dtype, numpy.float64, "safe"):
            raise TypeError(f"X has the type {X.dtype}; it must be float64, or a type of numbers that float64 holds")
        if X.ndim == 0 or X.shape[-1] != self.dimension:
            expected = f"(n, {self.dimension}), a row for each point, or (..., {self.dimension})"
            raise ValueError(f"X has the shape {X.shape}; {self.name} has {self.dimension} dimensions: it must be {expected}")
        return numpy.ascontiguousarray(X, dtype=numpy.float64)


class Points:
    """A solution at points that stay, as `Solution.points` makes it.

    The fields have the shapes of `Solution`'s. b equals that of `Solution` but for rounding; the others have the same bits.
    """

    def __init__(self, fields: _mmsmith.FieldsAtPoints, shape: tuple[int, ...], density: float) -> None:
        self._fields = fields
        self._shape = shape
        self._density = density

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

    def rho0_b(self, t: float, out: Array | None = None) -> Array:
        """Body force per unit reference volume."""
        return _product(self._density, self.b(t, out))

    def static_force(self, t: float, out: Array | None = None) -> Array:
        """-Div P, the force per reference volume that holds the deformation of time t at rest."""
        return _static(self._density, self.b(t, out), self.a(t))

    def sigma(self, t: float, out: Array | None = None) -> Array:
        """Cauchy stress, P F^T/J."""
        return _cauchy(self.P(t, out), self.F(t), self.J(t))

    def S(self, t: float, out: Array | None = None) -> Array:
        """Second Piola-Kirchhoff stress, F^-1 P."""
        return _second(self.P(t, out), self.F(t))

    def __len__(self) -> int:
        return self._shape[0]

    def _field(self, letter: str, t: float, out: Array | None) -> Array:
        out = _result(out, _shape(letter, self._shape), None)
        self._fields.evaluate(letter, time_of(t), out)
        return out


def load(name: str | os.PathLike[str], /, **parameters: float) -> Solution:
    """The solution of that name, or of the specification in that file, with values in place of its parameters' defaults.

    Names and paths are those that `mms` takes: a path ends in .toml or has a separator. Raises `Error` where there is none, where
    the specification is wrong, or where a parameter is unknown or out of its range.
    """
    source = os.fspath(name)
    given = {key: float(value) for key, value in parameters.items()}
    return Solution(_mmsmith.Fields(source, given), source, given)


def _restored(source: str, given: dict[str, float], fault: str | None) -> Solution:
    """A solution that was pickled."""
    solution = load(source, **given)
    return solution if fault is None else solution.with_fault(fault)


def _shape(letter: str, positions: tuple[int, ...]) -> tuple[int, ...]:
    if letter == "J":
        return positions[:-1]
    return (*positions, positions[-1]) if letter in "HFP" else positions


def _evaluated(evaluate: Callable[[Array, float, Array], None], X: Array, t: float | ArrayLike, out: Array) -> Array:
    """The values at points in any arrangement, at one time or each at its own."""
    points = X.reshape(-1, X.shape[-1])
    if numpy.ndim(t) == 0:
        evaluate(points, time_of(t), out)
        return out
    try:
        times = numpy.broadcast_to(numpy.asarray(t, dtype=numpy.float64), X.shape[:-1]).ravel()
    except ValueError:
        given = f"t has the shape {numpy.shape(t)}"
        raise TypeError(f"{given}; it must be one number, or an array with a number for each point, {X.shape[:-1]}") from None
    values = out.reshape(len(points), -1)
    for time in numpy.unique(times):
        chosen = times == time if time == time else numpy.isnan(times)
        part = numpy.empty((int(chosen.sum()), values.shape[1]))
        evaluate(numpy.ascontiguousarray(points[chosen]), float(time), part)
        values[chosen] = part
    return out


def _product(density: float, b: Array) -> Array:
    b *= density
    return b


def _static(density: float, b: Array, a: Array) -> Array:
    b -= a
    b *= density
    return b


def _cauchy(P: Array, F: Array, J: Array) -> Array:
    P[...] = numpy.einsum("...ik,...jk->...ij", P, F) / J[..., None, None]
    return P


def _second(P: Array, F: Array) -> Array:
    P[...] = numpy.linalg.solve(F, P)
    return P


def time_of(t: float | ArrayLike) -> float:
    """The one time that is meant for all points."""
    try:
        return float(t)  # type: ignore[arg-type]
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
