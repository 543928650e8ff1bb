"""Manufactured solutions for large-deformation solid mechanics.

`load` gives the exact fields of a solution at arrays of points. `run`, `converge`, `stability`, `tradeoff` and `score` do what the
commands of `mms` do. `orders` and `assert_order` judge a solver of your own, `audit` judges the test that judges it, and
`diagnose` finds the mistake in a solver whose errors do not fall.
"""

from mmsmith import _mmsmith
from mmsmith._audit import Audit, audit
from mmsmith._diagnose import Cause, Diagnosis, causes, diagnose
from mmsmith._mmsmith import Error, NoEffect, __version__
from mmsmith._orders import Orders, assert_order, measure, orders
from mmsmith._solution import Annulus, Box, Points, Solution, load
from mmsmith._studies import command, converge, run, score, stability, tradeoff

__all__ = [
    "Annulus",
    "Audit",
    "Box",
    "Cause",
    "Diagnosis",
    "Error",
    "NoEffect",
    "Orders",
    "Points",
    "Solution",
    "__version__",
    "assert_order",
    "audit",
    "causes",
    "command",
    "converge",
    "diagnose",
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
