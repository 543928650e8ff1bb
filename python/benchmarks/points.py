"""Nanoseconds a point of the ring's body force from Python; `cargo bench --package mmsmith-interpret` measures the same in Rust."""

import statistics
import time

import numpy

import mmsmith

POINTS, TIMES = 1_000_000, 9


def tell(what, call):
    seconds = []
    for n in range(TIMES):
        begun = time.perf_counter()
        call(1e-3 * n)
        seconds.append(time.perf_counter() - begun)
    print(f"{what:<28} {statistics.median(seconds) / POINTS * 1e9:6.1f} ns a point")


ring = mmsmith.load("ring")
X = ring.sample(POINTS)
at, out = ring.points(X), numpy.empty((POINTS, 2))
tell("points().b(t, out=out)", lambda t: at.b(t, out=out))
tell("points().b(t)", at.b)
tell("b(X, t)", lambda t: ring.b(X, t))
