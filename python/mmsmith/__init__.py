"""Manufactured solutions for large-deformation solid mechanics.

`load` gives the exact fields of a solution at arrays of points. `run`, `converge`, `stability`, `tradeoff`, `score`, `check` and
`explain` do what the commands of `mms` do. `orders` and `assert_order` judge a solver of your own, `audit` judges the test that judges it,
and `diagnose` finds the mistake in a solver whose errors do not fall.
"""

from mmsmith import _mmsmith
from mmsmith._audit import Audit, audit
from mmsmith._commands import check, converge, explain, run, score, stability, tradeoff
from mmsmith._diagnose import Cause, Diagnosis, causes, diagnose
from mmsmith._invoke import command
from mmsmith._mmsmith import Error, NoEffect, __version__
from mmsmith._orders import NotPassed, Orders, assert_order, measure, orders
from mmsmith._results import Check, Convergence, Result, Run, Score, Stability, Tradeoff
from mmsmith._solution import Annulus, Box, Constant, Points, Solution, load

__all__ = [
    "Annulus",
    "Audit",
    "Box",
    "Cause",
    "Check",
    "Constant",
    "Convergence",
    "Diagnosis",
    "Error",
    "NoEffect",
    "NotPassed",
    "Orders",
    "Points",
    "Result",
    "Run",
    "Score",
    "Solution",
    "Stability",
    "Tradeoff",
    "__version__",
    "assert_order",
    "audit",
    "causes",
    "check",
    "command",
    "converge",
    "diagnose",
    "explain",
    "faults",
    "load",
    "measure",
    "orders",
    "run",
    "score",
    "solutions",
    "stability",
    "tradeoff",
]


def faults() -> dict[str, str]:
    """The faults that `Solution.with_fault` plants, with a line about each."""
    return dict(_mmsmith.faults())


def solutions() -> list[str]:
    """The names of all solutions that `load` finds without a path."""
    return _mmsmith.solutions()
