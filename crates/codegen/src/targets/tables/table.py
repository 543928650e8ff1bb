
import itertools
import os

import numpy as np


def _polynomials(x, count):
    values = [XP.ones_like(x), x]
    while len(values) < count:
        values.append(2.0 * x * values[-1] - values[-2])
    return XP.stack(values[:count], axis=-1)


class _Table:
    # Fields as Chebyshev series in coordinates of the body, and in pieces of the time; or as series in time at some points alone.
    SIZES = {"scalar": lambda d: 1, "vector": lambda d: d, "matrix": lambda d: d * d, "symmetric": lambda d: 6}

    def __init__(self, path, digest, missing, another, broken):
        try:
            with open(path, encoding="ascii") as file:
                words = file.read().split()
        except OSError as error:
            raise OSError(f"{missing}: {error}") from error
        if words[:2] != ["mmsmith-table", "1"]:
            raise ValueError(broken)
        if words[2:4] != ["digest", digest]:
            raise ValueError(another)
        try:
            self._read(iter(words[4:]))
        except (StopIteration, ValueError, KeyError) as error:
            raise ValueError(broken) from error

    def _read(self, words):
        def after(name, kind=str):
            if next(words) != name:
                raise ValueError(name)
            return kind(next(words))

        def numbers(count):
            values = np.fromiter(itertools.islice(words, count), dtype=float)
            if values.size != count:
                raise ValueError("numbers are missing")
            return values

        after("solution")
        for _ in range(2 * after("parameters", int)):
            next(words)
        self.end, _, self.dimension = after("end", float), after("error", float), after("dimension", int)
        self.fields, quantities = [], 0
        for _ in range(after("fields", int)):
            next(words)
            shape = next(words)
            first, quantities = quantities, quantities + self.SIZES[shape](self.dimension)
            self.fields.append((first, quantities, shape))
        self.chart, self.frame = after("chart"), after("frame")
        if self.chart == "points":
            self._read_points(after("points", int), words, numbers, quantities)
            return
        axes = [(int(next(words)), float(next(words)), float(next(words)), int(next(words))) for _ in range(after("axes", int))]
        self.axes, self.nodes = axes, math.prod(count for *_, count in axes)
        pieces, in_time = after("pieces", int), int(next(words))
        self.knots = XP.asarray(numbers(pieces + 1))
        self.coefficients = XP.asarray(numbers(after("coefficients", int)).reshape(quantities, pieces, in_time, self.nodes))

    def _read_points(self, count, words, numbers, quantities):
        places, knots, series, self.nodes = [], [], [], count
        for _ in range(count):
            places.append(numbers(self.dimension))
            pieces, in_time = int(next(words)), int(next(words))
            knots.append(numbers(pieces + 1))
            series.append(numbers(quantities * pieces * in_time).reshape(quantities, pieces, in_time))
        most = max(len(own) for own in knots)
        self.places = XP.asarray(np.array(places))
        self.knots = XP.asarray(np.array([np.pad(own, (0, most - len(own)), constant_values=np.inf) for own in knots]))
        self.coefficients = XP.asarray(np.array([np.pad(own, ((0, 0), (0, most - 1 - own.shape[1]), (0, 0))) for own in series]))

    def _along(self, X):
        # The polynomials of all nodes at positions, axis 0 fastest; not numbers far from the body.
        q = list(X)
        if self.chart == "annulus" and self.dimension > 1:
            from_axis, angle = XP.hypot(X[0], X[1]), XP.arctan2(X[1], X[0])
            angle = XP.where(angle < 0.0, angle + 2.0 * math.pi, angle)
            q = [from_axis, angle] if self.dimension == 2 else [XP.hypot(from_axis, X[2]), XP.arctan2(from_axis, X[2]), angle]
        if self.chart == "tube":
            q = [XP.hypot(X[0], X[1]), XP.arctan2(X[1], X[0]), X[2]]
        basis = XP.ones_like(q[0])[..., None]
        for axis, low, high, count in self.axes:
            if self.chart == "tube" and axis == 1:
                q[1] = q[1] + 2.0 * math.pi * XP.round((0.5 * (low + high) - q[1]) / (2.0 * math.pi))
            x = (2.0 * q[axis] - low - high) / (high - low)
            own = _polynomials(XP.where(XP.abs(x) <= 1.1, x, XP.nan), count)
            basis = (own[..., :, None] * basis[..., None, :]).reshape(*basis.shape[:-1], -1)
        return basis

    def _point_of(self, X):
        # The number of the point at each position, and whether there is one.
        place = XP.stack(X, axis=-1)[..., None, :]
        least = 1e-3 * XP.max(XP.abs(self.places)) + 1e-300
        off = XP.max(XP.abs(place - self.places) / (XP.abs(self.places) + least), axis=-1)
        return XP.argmin(off, axis=-1), XP.min(off, axis=-1) <= 1e-9

    def _turned(self, X, values, shape):
        # Values (..., entries, terms) in Cartesian components.
        if self.frame == "cartesian" or shape == "scalar":
            return values
        one, zero = XP.ones_like(X[0]), XP.zeros_like(X[0])
        s = XP.hypot(X[0], X[1])
        cosine, sine = X[0] / s, X[1] / s
        if self.frame == "polar":
            Q = [[cosine, -sine, zero], [sine, cosine, zero], [zero, zero, one]]
        else:
            r = XP.hypot(s, X[2])
            Q = [[X[0] / r, X[2] / r * cosine, -sine], [X[1] / r, X[2] / r * sine, cosine], [X[2] / r, -s / r, zero]]
        d = 3 if shape == "symmetric" else self.dimension
        Q = XP.stack([XP.stack(row[:d], axis=-1) for row in Q[:d]], axis=-2)
        if shape == "vector":
            return XP.einsum("...ia,...ak->...ik", Q, values)
        places = {(0, 0): 0, (1, 1): 1, (2, 2): 2, (0, 1): 3, (0, 2): 4, (1, 2): 5}
        own = [[i * d + j if shape == "matrix" else places[min(i, j), max(i, j)] for j in range(d)] for i in range(d)]
        full = values[..., np.array(own), :]
        turned = XP.einsum("...ia,...abk,...jb->...ijk", Q, full, Q)
        entries = [(i, j) for i in range(d) for j in range(d)] if shape == "matrix" else list(places)
        return XP.stack([turned[..., i, j, :] for i, j in entries], axis=-2)

    def series(self, X, field):
        # The knots and the coefficients (..., entries, pieces, polynomials) of a field at positions, which are a list of coordinates.
        first, last, shape = self.fields[field]
        if self.chart == "points":
            number, is_known = self._point_of(X)
            own = XP.where(is_known[..., None, None, None], self.coefficients[number][..., first:last, :, :], XP.nan)
            return self.knots[number], own
        coefficients = self.coefficients[first:last]
        own = self._along(X) @ coefficients.reshape(-1, self.nodes).T
        own = own.reshape(*own.shape[:-1], last - first, -1)
        return self.knots, self._turned(X, own, shape).reshape(*own.shape[:-2], *coefficients.shape[:-1])

    def at(self, series, t):
        # The entries of a field at times, last axis; not numbers before the start and after the end.
        knots, own = series
        t = XP.asarray(t, dtype=float)
        shape = XP.broadcast_shapes(XP.shape(t), own.shape[:-3])
        t, own = XP.broadcast_to(t, shape), XP.broadcast_to(own, shape + own.shape[-3:])
        knots = XP.broadcast_to(knots, shape + knots.shape[-1:])
        piece = XP.sum(knots[..., 1:-1] <= t[..., None], axis=-1)
        low, high = (XP.take_along_axis(knots, (piece + k)[..., None], axis=-1)[..., 0] for k in (0, 1))
        is_known = (t >= -1e-12 * self.end) & (t <= self.end * (1.0 + 1e-12))
        x = XP.where(is_known, (2.0 * t - low - high) / (high - low), XP.nan)
        of_piece = XP.take_along_axis(own, piece[..., None, None, None], axis=-2)[..., 0, :]
        return XP.sum(of_piece * _polynomials(x, own.shape[-1])[..., None, :], axis=-1)

    def field(self, X, t, field):
        # A field at positions, a list of coordinates, and times.
        shape = XP.broadcast_shapes(*(XP.shape(x) for x in X), XP.shape(t))
CHUNKS

class _Points:
    # Fields at positions that stay, each a series in time that is formed once: s.points(X).b(t).
    def __init__(self, solution, X):
        self._table, self._X, self._series = solution.table, _position(X, solution.DIMENSION), {}

    def _field(self, field, t):
        if field not in self._series:
            self._series[field] = self._table.series(self._X, field)
        return self._table.at(self._series[field], t)

    def b(self, t):
        # body force
        return self._field(0, t)

    def P(self, t):
        # first Piola-Kirchhoff stress
        flat = self._field(1, t)
        d = self._table.dimension
        return flat.reshape(*flat.shape[:-1], d, d)

    def internal(self, t):
        # all internal variables, last axis
        return XP.concatenate([self._field(field, t) for field in range(2, len(self._table.fields))], axis=-1)
