"""Results of commands: the JSON as a dict, with names for what is asked for most."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from mmsmith._orders import NotPassed, Orders, orders
from mmsmith._tables import Rows, as_html, as_text

#: The fields whose errors are shown.
SHOWN = ("u", "v", "F", "P")


class Result(dict[str, Any]):
    """What a command found: the dict that its JSON is, `result["rows"]` and so on, and what all results have beside it."""

    def __init__(self, document: Mapping[str, Any], passed: bool = True) -> None:
        super().__init__(document)
        self._ended_well = passed

    @property
    def passed(self) -> bool | None:
        """Whether what was checked holds: False where the command ends with the status 1. None where `score` cannot tell."""
        passed: bool | None = self.get("passed", self._ended_well)
        return passed

    @property
    def verdict(self) -> str:
        """The judgement in a word or two."""
        verdict = self.get("verdict")
        if isinstance(verdict, Mapping) and "kind" in verdict:
            return str(verdict["kind"])
        return {True: "passed", False: "failed", None: "cannot-tell"}[self.passed]

    @property
    def settings(self) -> dict[str, Any]:
        """The settings that were used, defaults among them."""
        settings: dict[str, Any] = self.get("settings", {})
        return settings

    @property
    def solution(self) -> str:
        """The name of the solution, or the names of several."""
        return ", ".join(self.settings.get("solutions", [self.settings.get("solution", "")]))

    def reasons(self) -> list[str]:
        """Why the result did not pass, a line each; empty where it did."""
        return [] if self.passed else [self.verdict]

    def require(self) -> None:
        """Raises `NotPassed`, an AssertionError with the reasons and the table, unless the result passed."""
        __tracebackhide__ = True
        if not self.passed:
            raise NotPassed("\n".join([f"{self.about()}: {'; '.join(self.reasons())}", self.table()]), self)

    def about(self) -> str:
        """What was done, in a few words."""
        return " ".join(filter(None, [self.__class__.__name__.lower(), self.solution]))

    def table(self) -> str:
        """The rows as text."""
        return as_text(self._cells())

    def records(self) -> list[dict[str, Any]]:
        """The rows as dicts without dicts in them: the entry linf of the errors of u is `u_linf`."""
        return [flat(row) for row in self.get("rows", [])]

    def to_pandas(self, part: str | None = None) -> Any:
        """The rows as a `pandas.DataFrame`, a column for each number; or another part of the result, such as the `history` of a run."""
        try:
            import pandas  # type: ignore[import-untyped, import-not-found, unused-ignore]
        except ImportError:
            raise ImportError("to_pandas() needs pandas: pip install pandas. Without it there is records()") from None
        return pandas.DataFrame(self.records() if part is None else self[part])

    def _cells(self) -> Rows:
        if "rows" not in self:
            return [["", ""], *([key, _cell(value)] for key, value in flat(self).items() if _is_plain(value))]
        records = [{key: value for key, value in record.items() if _is_plain(value)} for record in self.records()]
        names = list(dict.fromkeys(name for record in records for name in record))
        return [names, *([_cell(record.get(name)) for name in names] for record in records)]

    def __str__(self) -> str:
        return "\n".join([f"{self.about()}: {self._judged()}", self.table()]).rstrip()

    def __repr__(self) -> str:
        return f"<{self.about()}: {self._judged()}>"

    def _repr_html_(self) -> str:
        return f"<p>{_escaped(self.about())}: <b>{_escaped(self._judged())}</b></p>" + as_html(self._cells())

    def _judged(self) -> str:
        return "; ".join(self.reasons()) or self.verdict


def _status(row: dict[str, Any]) -> str:
    # Rows of bodies at rest tell what stopped them alone.
    return str(row.get("status") or row.get("stopped") or "ok")


class Run(Result):
    """One simulation."""

    @property
    def status(self) -> str:
        """`ok`, or what stopped the run, with step and particle; of a body at rest why its load was not reached."""
        return _status(self["result"])

    @property
    def passed(self) -> bool | None:
        """Whether the run came to its end, with an error below the motion itself."""
        passed: bool | None = self.get("passed", self.status == "ok" and self._ended_well)
        return passed

    @property
    def errors(self) -> dict[str, dict[str, float]]:
        """The errors by field and norm: `errors["u"]["linf"]`. Not a number where the run has none."""
        return {field: {norm: _number(value) for norm, value in norms.items()} for field, norms in (self["result"]["errors"] or {}).items()}

    def reasons(self) -> list[str]:
        """Why the result did not pass, a line each; empty where it did."""
        return [] if self.passed else [self.status if self.status != "ok" else self.verdict]

    def about(self) -> str:
        """What was done, in a few words."""
        return f"run {self.solution}, {self['result']['cells']} cells"

    def records(self) -> list[dict[str, Any]]:
        """The row of the run, as a dict without dicts in it."""
        return [flat(self["result"])]

    def _cells(self) -> Rows:
        norms = ["linf", "l2", "l1"]
        return [["error", *norms], *([field, *(_cell(by_norm.get(norm)) for norm in norms)] for field, by_norm in self.errors.items())]


class OverGrids(Result):
    """Errors on several grids."""

    @property
    def errors(self) -> dict[str, dict[str, tuple[float, ...]]]:
        """The errors by field and norm, from the first grid to the last: `errors["u"]["linf"][-1]`."""
        found: dict[str, dict[str, tuple[float, ...]]] = {}
        for field in self._fields():
            by_row = [(row.get("errors") or {}).get(field) or {} for row in self.get("rows", [])]
            norms = dict.fromkeys(norm for row in by_row for norm in row)
            found[field] = {norm: tuple(_number(row.get(norm)) for row in by_row) for norm in norms}
        return found

    @property
    def orders(self) -> dict[str, dict[str, tuple[float, ...]]]:
        """The orders by field and norm, from each grid to the next: `orders["u"]["linf"][-1]` is that of the finest pair."""
        return {
            field: {norm: tuple(_number(value) for value in found["local"]) for norm, found in norms.items()}
            for field, norms in (self.get("orders") or {}).items()
        }

    def order(self, field: str = "u", norm: str = "linf") -> float:
        """The order on the finest pair of grids; not a number where there is none."""
        local = self.orders.get(field, {}).get(norm, ())
        return local[-1] if local else math.nan

    def over_h(self, norm: str = "linf") -> Orders:
        """The errors in one norm over the grid spacing, as `mmsmith.orders` gives them."""
        return orders(self, norm=norm)

    def plot(self, axes: Any = None, norm: str = "linf") -> Any:
        """Errors over the grid spacing by matplotlib, with marks of slopes; gives the axes."""
        axes = self.over_h(norm).plot(axes)
        axes.set_title(self.about())
        return axes

    def about(self) -> str:
        """What was done, in a few words."""
        grids = dict.fromkeys(str(row["cells"]) for row in self.get("rows", []) if row.get("cells") is not None)
        return super().about() + (f" on {', '.join(grids)} cells" if grids else "")

    def _fields(self) -> list[str]:
        return list(dict.fromkeys(field for row in self.get("rows", []) for field, of in (row.get("errors") or {}).items() if of))

    def records(self) -> list[dict[str, Any]]:
        """The rows as dicts without dicts in them: errors as `u_linf`, orders against the row before as `u_linf_order`."""
        records = super().records()
        for field, norms in self.orders.items():
            for norm, local in norms.items():
                # Rows that cannot be judged have no part in orders.
                if len(local) == len(records) - 1:
                    for record, order in zip(records, (math.nan, *local), strict=True):
                        record[f"{field}_{norm}_order"] = order
        return records

    def _cells(self) -> Rows:
        fields = [field for field in SHOWN if field in self._fields()] or self._fields()
        records = self.records()
        differ = [label for label in ("cells", "cfl", "file") if len({str(record.get(label)) for record in records}) > 1]
        label = next(iter(differ), "h")
        rows = [[label, *(cell for field in fields for cell in (field, "order"))]]
        for record in records:
            row = [_cell(record.get(label))]
            for field in fields:
                row += [_cell(record.get(f"{field}_linf")), _order(record.get(f"{field}_linf_order"))]
            rows.append(row)
        return rows


class Convergence(OverGrids):
    """Orders of accuracy of a scheme of `mms`."""

    @property
    def passed(self) -> bool | None:
        """Whether the orders that were expected, or are promised, are met, and all runs came to their end."""
        to_the_end = all(_status(row) == "ok" for row in self.get("rows", []))
        passed: bool | None = self.get("passed", self._ended_well and to_the_end)
        return passed

    def reasons(self) -> list[str]:
        """The orders that were missed, a line each, and the runs that stopped."""
        if self.passed:
            return []
        missed = []
        for field, norms in self.get("verdicts", {}).items():
            failed = {norm: verdict for norm, verdict in norms.items() if verdict.get("passed") is False}
            for expected in dict.fromkeys(verdict["expected"] for verdict in failed.values() if verdict["expected"] is not None):
                found = [f"{_order(v['finest']) or 'none'} ({norm})" for norm, v in failed.items() if v["expected"] == expected]
                tolerance = next(iter(failed.values()))["tolerance"]
                missed.append(f"order of {field} is {', '.join(found)}, expected {expected:g} (tolerance {tolerance:g})")
        stopped = [f"{row['cells']} cells: {_status(row)}" for row in self.get("rows", []) if _status(row) != "ok"]
        return [*missed, *stopped] or [str(self.get("not_judged", self.verdict))]


class Score(OverGrids):
    """Errors and orders of what another solver wrote."""

    def reasons(self) -> list[str]:
        """The verdict, and what is wrong with the recordings, a line each."""
        if self.passed:
            return []
        return [self.verdict, *(finding["message"] for finding in self.get("findings", []) if finding.get("problem"))]


class Stability(Result):
    """The largest stable CFL number over one or two settings."""

    def _cells(self) -> Rows:
        names = [*self.get("over", []), "cfl_max", "p_wave_cfl", "failure_kind"]
        return [names, *([_cell(record.get(name)) for name in names] for record in self.records())]


class Tradeoff(Result):
    """Errors against cost."""

    @property
    def front(self) -> list[dict[str, Any]]:
        """The rows that no other row beats in both error and cost, flat as in `records`."""
        records = self.records()
        return [records[index] for index in self.get("front", [])]

    def _cells(self) -> Rows:
        names = ["shape", "integrator", "transfer", "frame", "layout", "ppc", "cells", "cfl", "error", "wall_s"]
        return [names, *([_cell(row.get(name)) for name in names] for row in self.front)]


class Check(Result):
    """Every field held against the field below it."""

    def reasons(self) -> list[str]:
        """The comparisons that failed, a line each."""
        if self.passed:
            return []
        return [
            f"{record['solution']}: {record['what']} against {record['against']}: {record['verdict']}"
            for record in self.records()
            if record.get("verdict", "passed") != "passed"
        ] or [self.verdict]

    def records(self) -> list[dict[str, Any]]:
        """The comparisons, or the largest rounding errors that a thorough search found, one a dict."""
        return [
            {"solution": one.get("solution", ""), **flat(found)}
            for one in self.get("results", [])
            for found in one.get("findings", one.get("accuracy", []))
        ]

    def _cells(self) -> Rows:
        names = ["solution", "what", "against", "difference", "allowed", "verdict"]
        if any("field" in record for record in self.records()):
            names = ["solution", "class", "field", "K"]
        return [names, *([_cell(record.get(name)) for name in names] for record in self.records())]


def flat(row: Mapping[str, Any]) -> dict[str, Any]:
    """A dict without dicts in it: names are joined by underscores, those of errors without the word."""

    def entries(prefix: str, value: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
        for key, entry in value.items():
            name = prefix + key
            if isinstance(entry, Mapping):
                yield from entries("" if name == "errors" else f"{name}_", entry)
            else:
                yield name, entry

    return dict(entries("", row))


def _is_plain(value: Any) -> bool:
    return value is None or isinstance(value, (str, int, float))


def _number(value: float | None) -> float:
    # What is not finite is null in JSON.
    return math.nan if value is None else float(value)


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.3e}" if value != 0 and not 1e-2 <= abs(value) < 1e4 else f"{value:.4g}"
    return str(value)


def _order(value: float | None) -> str:
    return "" if value is None or math.isnan(value) else f"{value:.2f}"


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
