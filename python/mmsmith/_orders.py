"""Errors over grids: orders of accuracy, and the judgement on them."""

import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy

from mmsmith._tables import as_html, as_text

if TYPE_CHECKING:
    from mmsmith._solution import Solution


class NotPassed(AssertionError):
    """What was expected does not hold. The message has the reasons, and then the table; `result` is what was judged."""

    def __init__(self, message: str, result: Any = None) -> None:
        super().__init__(message)
        self.result = result


# As users read it in the message of a test.
NotPassed.__module__ = "mmsmith"


@dataclass(frozen=True)
class Orders:
    """Errors over grids, and the order from each grid to the next: log(e/e') / log(h/h')."""

    h: tuple[float, ...]
    errors: dict[str, tuple[float, ...]]
    #: The sign of the steps in tables and plots: `h`, or `dt` for orders in time.
    sign: str = "h"

    def order(self, field: str) -> tuple[float, ...]:
        """The order of a field from each grid to the next finer one; not a number where an error is zero or none."""
        e = self.errors[field]
        pairs = zip(self.h, self.h[1:], e, e[1:], strict=False)
        return tuple(
            math.log(e / e_fine) / math.log(h / h_fine) if 0 < e < math.inf and 0 < e_fine < math.inf else math.nan
            for h, h_fine, e, e_fine in pairs
        )

    def _cells(self) -> list[list[str]]:
        head = [self.sign, *(cell for field in self.errors for cell in (field, "order"))]
        rows = [head]
        for index, h in enumerate(self.h):
            row = [f"{h:.4g}"]
            for field, errors in self.errors.items():
                row += [f"{errors[index]:.3e}", f"{self.order(field)[index - 1]:.2f}" if index > 0 else ""]
            rows.append(row)
        return rows

    def __str__(self) -> str:
        return as_text(self._cells())

    def _repr_html_(self) -> str:
        return as_html(self._cells())

    def to_pandas(self) -> Any:
        """The table as a `pandas.DataFrame` over the steps."""
        import pandas  # type: ignore[import-untyped, import-not-found, unused-ignore]

        columns: dict[str, tuple[float, ...]] = {}
        for field, errors in self.errors.items():
            columns |= {field: errors, f"{field}_order": (math.nan, *self.order(field))}
        return pandas.DataFrame(columns, index=pandas.Index(self.h, name=self.sign))

    def plot(self, axes: Any = None) -> Any:
        """Errors over h in a double-logarithmic plot by matplotlib, which has to be there; gives its axes.

        Beside the finest pair of each field stands the triangle of the nearest whole order.
        """
        from matplotlib import pyplot, ticker

        if axes is None:
            axes = pyplot.subplots()[1]
        for field, errors in self.errors.items():
            finest = self.order(field)[-1] if len(self.h) > 1 else math.nan
            (line,) = axes.loglog(self.h, errors, marker="o", label=f"{field}, order {finest:.2f}")
            if math.isfinite(finest) and finest >= 0.5:
                self._mark_slope(axes, errors[-1], round(finest), line.get_color())
        axes.xaxis.set_major_locator(ticker.FixedLocator(list(self.h)))
        axes.xaxis.set_major_formatter(ticker.FixedFormatter([f"{h:.3g}" for h in self.h]))
        axes.xaxis.set_minor_locator(ticker.NullLocator())
        axes.yaxis.set_minor_formatter(ticker.NullFormatter())
        axes.set_xlabel(self.sign)
        axes.set_ylabel("error")
        axes.legend()
        return axes

    def _mark_slope(self, axes: Any, error: float, order: int, color: str) -> None:
        """A triangle below the line, over half of the way from the finest step to the one before."""
        from matplotlib import patches

        left, bottom = self.h[-1], 0.6 * error
        right = math.sqrt(left * self.h[-2])
        top = bottom * (right / left) ** order
        axes.add_patch(patches.Polygon([(left, bottom), (right, bottom), (right, top)], fill=False, edgecolor=color, linewidth=0.8))
        axes.annotate(str(order), (right, math.sqrt(bottom * top)), (3, 0), textcoords="offset points", va="center", color=color)


def orders(
    h: Sequence[float] | Mapping[str, Any], errors: Mapping[str, Sequence[float]] | Sequence[float] | None = None, norm: str = "linf"
) -> Orders:
    """The orders of errors over grid spacings, the coarsest first.

    `errors` has the errors of each field, or those of u alone. In place of both stands what `converge` or `score` gave: then the errors
    are those in the norm `linf`, `l2` or `l1`.
    """
    if isinstance(h, Mapping):
        return _of_document(h, norm)
    if errors is None:
        raise TypeError("orders(h, errors) needs errors beside h; or give what converge or score gave")
    by_field = errors if isinstance(errors, Mapping) else {"u": errors}
    for field, values in by_field.items():
        if len(values) != len(h):
            raise ValueError(f"{field} has {len(values)} errors for {len(h)} grid spacings")
    if any(not coarse > fine > 0 for coarse, fine in zip(h, h[1:], strict=False)):
        raise ValueError(f"h is {list(h)}; grid spacings are positive, and each is smaller than the one before it")
    return Orders(_numbers(h), {field: _numbers(values) for field, values in by_field.items()})


def _of_document(document: Mapping[str, Any], norm: str) -> Orders:
    """The orders of what `converge` or `score` gave: in time, where steps and not grids differ."""
    # Differences between runs, or between recordings, with other time steps.
    in_time = document["temporal"]["rows"] if document.get("temporal") else document.get("differences")
    sign, key = ("h", "errors") if in_time is None else ("dt", "differences")
    rows = document["rows"] if in_time is None else sorted(in_time, key=lambda row: -row["dt"])
    fields = [field for field in "uvFP" if rows and all((row.get(key) or {}).get(field) for row in rows)]
    found = {field: _numbers([row[key][field][norm] for row in rows]) for field in fields}
    table = orders([row[sign] for row in rows], found)
    return Orders(table.h, table.errors, sign)


def _numbers(values: Sequence[float | None]) -> tuple[float, ...]:
    # What is not finite is null in JSON.
    return tuple(math.nan if value is None else float(value) for value in values)


def assert_order(table: Orders | Mapping[str, Any], *, tolerance: float = 0.1, norm: str = "linf", **expected: float) -> None:
    """Asserts that from the last grid but one to the last the error of each field falls with its order, or with a higher one.

    The order may be lower by `tolerance`. Raises `NotPassed`, an AssertionError whose message has the whole table.
    """
    __tracebackhide__ = True
    about = table.about() if hasattr(table, "about") else ""
    require(table if isinstance(table, Orders) else orders(table, norm=norm), expected, tolerance, about)


#: The keywords beside fields of the functions that expect orders.
KEYWORDS = ("cells", "tolerance", "norm", "faults")


def require(table: Orders, expected: Mapping[str, float], tolerance: float, about: str = "") -> None:
    """What `assert_order` asserts; `about` says whose orders they are."""
    __tracebackhide__ = True
    if len(table.h) < 2 or not expected:
        raise ValueError("an order takes errors on two grids, and an expected order such as u=2")
    wrong = []
    for field, order in expected.items():
        if field not in table.errors:
            raise ValueError(no_errors_of(field, list(table.errors)))
        finest = table.order(field)[-1]
        # Not a number is no order.
        if not finest >= order - tolerance:
            wrong.append(f"order of {field} is {finest:.2f}, expected {order:g} (tolerance {tolerance:g})")
    if wrong:
        raise NotPassed((f"{about}: " if about else "") + "\n".join(["; ".join(wrong), str(table)]), table)


def no_errors_of(name: str, fields: Sequence[str]) -> str:
    """The message on an order of something that has no errors, or on a keyword that is misspelt."""
    near = difflib.get_close_matches(name, [*fields, *KEYWORDS], n=1)
    tip = f"did you mean '{near[0]}'?" if near else f"there are those of {', '.join(fields)}"
    return f"there are no errors of {name}; {tip}"


def measure(solution: "Solution", result: Mapping[str, Any], norm: str = "linf") -> dict[str, float]:
    """The errors of what a solver computed, by field, as `mms score` measures them.

    `result` has the reference positions `X` of shape (..., dimension), the time `t`, and computed fields by their letters in the
    shapes of `Solution`. Of the lengths of the differences at the points, which are more than none, the norm `linf` is the largest,
    `l2` the root of the mean square, `l1` the mean.
    """
    X, t = result["X"], result["t"]
    norms: dict[str, Callable[[Any], float]] = {
        "linf": lambda size: float(size.max()),
        "l2": lambda size: float(numpy.sqrt((size**2).mean())),
        "l1": lambda size: float(size.mean()),
    }
    if len(X) == 0:
        raise ValueError("the result has no points to measure at")
    errors: dict[str, float] = {}
    for field, computed in result.items():
        if field in ("X", "t"):
            continue
        if field not in ("u", "v", "a", "b", "H", "F", "P", "J"):
            raise ValueError(f"there is no field '{field}'; a result has X, t, and fields such as u, v, F and P")
        exact = getattr(solution, field)(X, t)
        computed = numpy.asarray(computed, dtype=numpy.float64)
        if computed.shape != exact.shape:
            raise ValueError(f"{field} has the shape {computed.shape}; at these points it must be {exact.shape}")
        count = numpy.size(X) // solution.dimension
        size = numpy.sqrt(((computed - exact) ** 2).reshape(count, -1).sum(axis=1))
        if norm not in norms:
            raise ValueError(f"there is no norm '{norm}'; there are {', '.join(norms)}")
        errors[field] = norms[norm](size) if numpy.isfinite(size).all() else math.inf
    return errors
