"""Histories of particles of the library in 256 bits, by another way, beside those of mms.

    python histories.py MMS [--points COUNT] [--solutions NAME,...]

At drawn places and times the internal variables and P of `mms eval`, and b at a tenth of them at least, are within 1e-12 of their tensor's
largest entry over all points. 1,000 points a solution if COUNT does not say otherwise.

The motions and laws are written out here. Flow is followed in F^p itself, whose rate needs no frame pulled back, and where the front has
an exponent by the yield stress; times at which particles begin and stop to flow are roots. The integrator is the midpoint rule of Gragg,
extrapolated (Hairer, Norsett and Wanner, "Solving Ordinary Differential Equations I", section II.9), in steps of one length. Slopes in X
are differences over 2^-80 of trajectories with the same steps. At every twentieth point half the steps, whose error is 2^20 times as
large, and the closed forms of `bar-j2` and `block-maxwell` are beside it. Needs gmpy2.

Exit status: 0 where all agree, 1 where any does not, 2 for a wrong call.
"""

import argparse
import json
import multiprocessing
import random
import subprocess
import sys
import time
from pathlib import Path

import gmpy2
from gmpy2 import cos, exp, log, mpfr, sin, sqrt

gmpy2.get_context().precision = 256
BOUND = 1e-12
STEP = mpfr(2) ** -80
PI = gmpy2.const_pi()
ONE, ZERO = mpfr(1), mpfr(0)
# Powers of the length of a step in the error: twice so many.
LEVELS = 10


def step(rate, t, z, length):
    """From t to t + length."""
    first, row = rate(t, z), []
    for level in range(1, LEVELS + 1):
        h = length / (2 * level)
        before, now = z, [a + h * b for a, b in zip(z, first)]
        for k in range(1, 2 * level):
            before, now = now, [a + 2 * h * b for a, b in zip(before, rate(t + k * h, now))]
        # Polynomials in the square of the step, by Aitken and Neville.
        new = [now]
        for j in range(1, level):
            factor = 1 / ((mpfr(level) / (level - j)) ** 2 - 1)
            new.append([a + factor * (a - b) for a, b in zip(new[-1], row[j - 1])])
        row = new
    return row[-1]


def root(f, low, high):
    """Where f, which is positive at one end alone, is zero: by halves, then by the method of secants."""
    at_low = f(low)
    for _ in range(8):
        middle = (low + high) / 2
        value = f(middle)
        if (value > 0) == (at_low > 0):
            low, at_low = middle, value
        else:
            high = middle
    a, b, at_a, at_b = low, high, at_low, f(high)
    for _ in range(20):
        if at_b == 0 or abs(b - a) <= abs(b) * mpfr(2) ** -245 or at_a == at_b:
            break
        a, b, at_a, at_b = b, b - at_b * (b - a) / (at_b - at_a), at_b, None
        at_b = f(b)
    return b


def product(A, B):
    (a, b, c), (d, e, f), (g, h, i) = B
    return [[p * a + q * d + r * g, p * b + q * e + r * h, p * c + q * f + r * i] for p, q, r in A]


def transposed(A):
    return [list(row) for row in zip(*A)]


def inverse(A):
    cofactor = lambda i, j: A[(i + 1) % 3][(j + 1) % 3] * A[(i + 2) % 3][(j + 2) % 3] - A[(i + 1) % 3][(j + 2) % 3] * A[(i + 2) % 3][(j + 1) % 3]
    of = [[cofactor(i, j) for j in range(3)] for i in range(3)]
    det = sum(A[0][j] * of[0][j] for j in range(3))
    return [[of[j][i] / det for j in range(3)] for i in range(3)]


def diagonal(*entries):
    return [[mpfr(entry) if i == j else ZERO for j in range(3)] for i, entry in enumerate(entries)]


def logarithm(B):
    """Of a symmetric tensor: in a plane by its eigenvalues, in space next to the identity by the series of 2 artanh((B - I)(B + I)^-1)."""
    if not any((B[0][2], B[1][2])):
        m, half, c = (B[0][0] + B[1][1]) / 2, (B[0][0] - B[1][1]) / 2, B[0][1]
        d = sqrt(half * half + c * c)
        high, low = log(m + d), log(m - d)
        mean, part = (high + low) / 2, (high - low) / (2 * d) if d > 0 else ZERO
        return [[mean + part * half, part * c, ZERO], [part * c, mean - part * half, ZERO], [ZERO, ZERO, log(B[2][2])]]
    move = lambda by: [[B[i][j] + (by if i == j else 0) for j in range(3)] for i in range(3)]
    Z = product(move(-1), inverse(move(1)))
    square, power, total, k = product(Z, Z), Z, Z, 1
    while max(abs(entry) for row in power for entry in row) > mpfr(2) ** -260:
        power, k = product(power, square), k + 2
        total = [[total[i][j] + power[i][j] / k for j in range(3)] for i in range(3)]
    return [[2 * entry for entry in row] for row in total]


class Memory:
    """A solution: `kinematics(X, t)` gives F and its rate in space, and `acceleration(X, t)`. Rates of z are `rate(X, t, z)`."""

    dimension, radial, period = 2, False, ONE / 50

    def __init__(self):
        E, nu = mpfr(10000), mpfr(0.3)
        self.mu, self.lam, self.rho0, self.c = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu)), ONE, mpfr(100)

    # Steps in a period, and whether flow goes on without an end.
    steps = 16

    def after(self, X, t, steps):
        """The variables at a time."""
        length, at, z = self.period / steps, ZERO, self.start(X)
        while at < t:
            to = min(at + length, t)
            z, at = step(lambda t, z: self.rate(X, t, z), at, z, to - at), to
        return z

    def fields(self, X, t, steps):
        """Internal variables by names, and P."""
        F = self.kinematics(X, t)[0]
        z = self.after(X, t, steps)
        return self.internal(z), self.stress(F, z)


def waves(self, X, t, r, dr, ddr, A):
    """A sin(pi X) cos(pi Y) r, A cos(pi X) sin(pi Y) r / 2."""
    (sx, cx), (sy, cy) = [(sin(PI * x), cos(PI * x)) for x in X[:2]]
    H = [[PI * A * cx * cy, -PI * A * sx * sy, ZERO], [-PI * A * sx * sy / 2, PI * A * cx * cy / 2, ZERO], [ZERO] * 3]
    F = [[H[i][j] * r + (i == j) for j in range(3)] for i in range(3)]
    return F, [[entry * dr for entry in row] for row in H], [A * sx * cy * ddr, A * cx * sy * ddr / 2]


class Flow(Memory):
    """Hencky's law and flow by von Mises; z is F^p, row by row, and alpha."""

    yields, hardening, is_on_yield = mpfr(50), mpfr(500), True

    def start(self, X):
        l = exp(self.yields / (2 * sqrt(mpfr(3)) * self.mu))
        return [entry for row in (diagonal(1 / l, l, 1) if self.is_on_yield else diagonal(1, 1, 1)) for entry in row] + [ZERO]

    def elastic(self, F, z):
        """F_e and the deviator of its logarithmic strain."""
        Fe = product(F, inverse([z[0:3], z[3:6], z[6:9]]))
        e = [[entry / 2 for entry in row] for row in logarithm(product(Fe, transposed(Fe)))]
        mean = (e[0][0] + e[1][1] + e[2][2]) / 3
        return Fe, [[e[i][j] - (mean if i == j else 0) for j in range(3)] for i in range(3)], 3 * mean

    def beyond(self, F, z):
        _, e, _ = self.elastic(F, z)
        size = 2 * self.mu * sqrt(sum(entry * entry for row in e for entry in row))
        return size - sqrt(mpfr(2) / 3) * (self.yields + self.hardening * z[9])

    def multiplier(self, F, dF, n, size, alpha):
        d = product(dF, inverse(F))
        along = sum(n[i][j] * d[i][j] for i in range(3) for j in range(3))
        assert along > 0, "flow ends"
        return along / (1 + self.hardening / (3 * self.mu))

    def rate(self, X, t, z):
        F, dF = self.kinematics(X, t)[:2]
        Fe, e, _ = self.elastic(F, z)
        norm = sqrt(sum(entry * entry for row in e for entry in row))
        n = [[entry / norm for entry in row] for row in e]
        gamma = self.multiplier(F, dF, n, 2 * self.mu * norm, z[9])
        rate = product(product(product(inverse(Fe), n), Fe), [z[0:3], z[3:6], z[6:9]])
        return [gamma * entry for row in rate for entry in row] + [sqrt(mpfr(2) / 3) * gamma]

    def stress(self, F, z):
        _, e, sum_of_e = self.elastic(F, z)
        kappa = self.lam + 2 * self.mu / 3
        tau = [[2 * self.mu * e[i][j] + (kappa * sum_of_e if i == j else 0) for j in range(3)] for i in range(3)]
        return product(tau, transposed(inverse(F)))

    def internal(self, z):
        Fp = [z[0:3], z[3:6], z[6:9]]
        G = inverse(product(transposed(Fp), Fp))
        return {"G": [G[0][0], G[1][1], G[2][2], G[0][1], G[0][2], G[1][2]], "alpha": [z[9]]}


def ramp(self, t):
    """1 - cos(pi c t/4) + c t/4, with two derivatives."""
    w = PI * self.c / 4
    return 1 - cos(w * t) + self.c * t / 4, w * sin(w * t) + self.c / 4, w * w * cos(w * t)


class Bar(Flow):
    dimension = 1

    def start(self, X):
        l = exp(self.yields / (3 * self.mu))
        return [entry for row in diagonal(1 / l, sqrt(l), sqrt(l)) for entry in row] + [ZERO]

    def kinematics(self, X, t):
        A, B, (r, dr, ddr) = mpfr(0.02), mpfr(0.1), ramp(self, t)
        H = B + A * PI * cos(PI * X[0])
        return diagonal(1 + H * r, 1, 1), diagonal(H * dr, 0, 0), [(B * X[0] + A * sin(PI * X[0])) * ddr]

    def closed(self, X, t, z):
        """By how much alpha misses 2 mu ln F/(3 mu + H)."""
        return abs(z[9] - 2 * self.mu * log(self.kinematics(X, t)[0][0][0]) / (3 * self.mu + self.hardening))


class Block(Flow):
    A, B = mpfr(0.02), mpfr(0.1)

    def kinematics(self, X, t):
        A, B, (r, dr, ddr) = self.A, self.B, ramp(self, t)
        x, y = X[:2]
        s, c, sy, cy = sin(PI * x), cos(PI * x), sin(PI * y / 2), cos(PI * y / 2)
        H = [[B + A * PI * c * cy, -A * PI / 2 * s * sy, ZERO], [2 * A * x * y, A * x * x - B, ZERO], [ZERO] * 3]
        u = [B * x + A * s * cy, -B * y + A * x * x * y]
        if self.dimension == 3:
            H[2] = [-A * PI / 4 * sin(PI * X[2]) * sin(PI * x / 2), ZERO, A * PI / 2 * cos(PI * X[2]) * cos(PI * x / 2)]
            u.append(A * sin(PI * X[2]) * cos(PI * x / 2) / 2)
        F = [[H[i][j] * r + (i == j) for j in range(3)] for i in range(3)]
        return F, [[entry * dr for entry in row] for row in H], [entry * ddr for entry in u]


class BlockInSpace(Block):
    dimension = 3


class Perzyna(Flow):
    yields, is_on_yield, steps = mpfr(20), False, 32

    def kinematics(self, X, t):
        w = PI * self.c
        return waves(self, X, t, sin(w * t), w * cos(w * t), -w * w * sin(w * t), mpfr(0.02))

    def multiplier(self, F, dF, n, size, alpha):
        over = size - sqrt(mpfr(2) / 3) * (self.yields + self.hardening * alpha)
        return (over / 200) ** 3 / mpfr(0.02)

    def after(self, X, t, steps):
        length, at, z, flows, began = self.period / steps, ZERO, self.start(X), False, False
        f = lambda t, z: self.beyond(self.kinematics(X, t)[0], z)
        rate = lambda t, z: self.rate(X, t, z)
        while at < t:
            # Next to the yield surface in short steps, so that no time without flow is passed over.
            over = f(at, z)
            parts = 1 if flows and over > 60 else 8 if abs(over) > 6 else 64
            to = min(at + length / parts, t)
            new = step(rate, at, z, to - at) if flows else z
            if (f(to, new) < 0) == flows:
                # Where the particle begins or stops; the place where it has just begun is no end.
                low = at + (to - at) / 64 if began else at
                of = lambda s: f(s, step(rate, at, z, s - at) if flows else z)
                if (of(low) > 0) == flows:
                    to = root(of, low, to)
                    new = step(rate, at, z, to - at) if flows else z
                    flows = began = not flows
                    z, at = new, to
                    continue
            z, at, began = new, to, False
        return z


class Maxwell(Memory):
    """Elements; z has the six entries of Q of each."""

    def start(self, X):
        return [ZERO] * (6 * len(self.elements))

    def rate(self, X, t, z):
        F, dF = self.kinematics(X, t)[:2]
        S = six(self.relaxing_rate(F, dF))
        return [g * s - Q / tau for k, (g, tau) in enumerate(self.elements) for s, Q in zip(S, z[6 * k :])]

    def internal(self, z):
        return {f"Q{k + 1}_": z[6 * k : 6 * k + 6] for k in range(len(self.elements))}

    def sums(self, relaxing, rest, z):
        share = 1 - sum(g for g, _ in self.elements)
        Q = [sum(z[entry::6]) for entry in range(6)]
        Q = [[Q[0], Q[3], Q[4]], [Q[3], Q[1], Q[5]], [Q[4], Q[5], Q[2]]]
        return [[rest[i][j] + share * relaxing[i][j] + Q[i][j] for j in range(3)] for i in range(3)]


def six(A):
    return [A[0][0], A[1][1], A[2][2], A[0][1], A[0][2], A[1][2]]


class LinearMaxwell(Maxwell):
    elements = [(mpfr(0.3), mpfr(0.002)), (mpfr(0.2), mpfr(0.02))]

    def kinematics(self, X, t):
        w = PI * self.c
        return waves(self, X, t, sin(w * t), w * cos(w * t), -w * w * sin(w * t), mpfr(0.01))

    def deviator(self, H):
        mean = (H[0][0] + H[1][1] + H[2][2]) / 3
        return [[self.mu * (H[i][j] + H[j][i] - (2 * mean if i == j else 0)) for j in range(3)] for i in range(3)]

    def relaxing_rate(self, F, dF):
        return self.deviator(dF)

    def stress(self, F, z):
        H = [[F[i][j] - (i == j) for j in range(3)] for i in range(3)]
        p = (self.lam + 2 * self.mu / 3) * (H[0][0] + H[1][1] + H[2][2])
        return self.sums(self.deviator(H), diagonal(p, p, p), z)

    def closed(self, X, t, z):
        w, worst = PI * self.c, ZERO
        # The strain at sin = 1.
        F = self.kinematics(X, 1 / (2 * self.c))[0]
        s = six(self.deviator([[F[i][j] - (i == j) for j in range(3)] for i in range(3)]))
        for k, (g, tau) in enumerate(self.elements):
            size = g * w * tau / (1 + (w * tau) ** 2) * (cos(w * t) + w * tau * sin(w * t) - exp(-t / tau))
            worst = max(worst, *(abs(Q - size * s) for Q, s in zip(z[6 * k :], s)))
        return worst / self.mu


class OwnLaw(Memory):
    dimension = 1

    def kinematics(self, X, t):
        w, A = PI * self.c, mpfr(0.02)
        r, dr, ddr = sin(w * t), w * cos(w * t), -w * w * sin(w * t)
        H = A * PI * cos(PI * X[0])
        return diagonal(1 + H * r, 1, 1), diagonal(H * dr, 0, 0), [A * sin(PI * X[0]) * ddr]

    def start(self, X):
        return [ZERO]

    def rate(self, X, t, z):
        return [(log(self.kinematics(X, t)[0][0][0]) - z[0]) / mpfr(0.005)]

    def internal(self, z):
        return {"q": z}

    def stress(self, F, z):
        l = F[0][0]
        return diagonal((10000 * log(l) + 5000 * (log(l) - z[0])) / l, 0, 0)


def ring(X, T, Ri=mpfr(0.5), Ro=ONE):
    """Stretches less one along the radius and around, and the displacement, for each unit of T/2."""
    R = X[0]
    return -2 * Ri / R**2 + 1 / Ro, 2 * Ri / R**2 + 1 / Ro - Ri / (Ro * R), 2 * Ri / R + R / Ro - Ri / Ro


class RingOfSimo(Maxwell):
    radial = True

    def __init__(self):
        super().__init__()
        self.mu, self.kappa, self.elements = mpfr(4000), mpfr(8000), [(mpfr(0.4), mpfr(0.005))]
        self.c = sqrt(self.mu)
        self.period = 2 / self.c

    def kinematics(self, X, t):
        w, (along, around, u) = PI * self.c, ring(X, t)
        r, dr, ddr = (mpfr(0.05) / 2 * f for f in (sin(w * t), w * cos(w * t), -w * w * sin(w * t)))
        return diagonal(1 + along * r, 1 + around * r, 1), diagonal(along * dr, around * dr, 0), [u * ddr]

    def relaxing(self, F):
        """mu J^(-2/3) (I - tr(C)/3 C^-1), along the axes."""
        C = [F[i][i] ** 2 for i in range(3)]
        factor = self.mu / gmpy2.cbrt(C[0] * C[1] * C[2])
        return [factor * (1 - sum(C) / (3 * entry)) for entry in C]

    def relaxing_rate(self, F, dF):
        C = [F[i][i] ** 2 for i in range(3)]
        dC = [2 * F[i][i] * dF[i][i] for i in range(3)]
        factor = self.mu / gmpy2.cbrt(C[0] * C[1] * C[2])
        shrinks = sum(d / entry for d, entry in zip(dC, C)) / 3
        of = lambda c, d: -shrinks * (1 - sum(C) / (3 * c)) - sum(dC) / (3 * c) + sum(C) * d / (3 * c * c)
        return diagonal(*(factor * of(c, d) for c, d in zip(C, dC)))

    def stress(self, F, z):
        J = F[0][0] * F[1][1] * F[2][2]
        p = self.pressure(J)
        S = self.sums(diagonal(*self.relaxing(F)), diagonal(*(p / F[i][i] ** 2 for i in range(3))), z)
        return product(F, S)

    def pressure(self, J):
        return self.kappa * log(J)


class RingThatFlows(Memory):
    """Along the axes: z is the logarithm of F^p. What has been allowed tells alpha, so that nothing else is integrated."""

    # Rates have poles next to the time at which flow begins.
    radial, steps, yields, hardening = True, 128, mpfr(100), mpfr(300)

    def kinematics(self, X, t):
        w, (along, around, u) = PI * self.c / 2, ring(X, t)
        A = mpfr(0.02) / 2
        r, dr, ddr = (A / 2 * f for f in (1 - cos(w * t), w * sin(w * t), w * w * cos(w * t)))
        return diagonal(1 + along * r, 1 + around * r, 1), diagonal(along * dr, around * dr, 0), [u * ddr]

    def strain(self, F, z):
        e = [log(F[i][i]) - z[i] for i in range(3)]
        return e, [entry - sum(e) / 3 for entry in e]

    def root_of_alpha(self, F, z):
        """w = alpha^(1/3) = (k - sy)/K with k = sqrt(3/2) |s|."""
        _, s = self.strain(F, z)
        return (sqrt(mpfr(3) / 2) * 2 * self.mu * sqrt(sum(entry * entry for entry in s)) - self.yields) / self.hardening

    def rate(self, X, t, z):
        F, dF = self.kinematics(X, t)[:2]
        _, s = self.strain(F, z)
        norm = sqrt(sum(entry * entry for entry in s))
        n = [entry / norm for entry in s]
        w = self.root_of_alpha(F, z)
        along = sum(n[i] * dF[i][i] / F[i][i] for i in range(3))
        assert along > 0, "flow ends"
        gamma = along * w**2 / (w**2 + self.hardening / (9 * self.mu))
        return [gamma * entry for entry in n]

    def after(self, X, t, steps):
        none = [ZERO] * 3
        left = lambda t: -self.root_of_alpha(self.kinematics(X, t)[0], none)
        if left(t) >= 0:
            return [*none, ZERO]
        at, z, length = root(left, t / 1024, t), none, self.period / steps
        while at < t:
            to = min(at + length, t)
            z, at = step(lambda t, z: self.rate(X, t, z), at, z, to - at), to
        return [*z, self.root_of_alpha(self.kinematics(X, t)[0], z) ** 3]

    def internal(self, z):
        return {"G": [*(exp(-2 * entry) for entry in z[:3]), ZERO, ZERO, ZERO], "alpha": [z[3]]}

    def stress(self, F, z):
        e, s = self.strain(F, z)
        mean = (self.lam + 2 * self.mu / 3) * sum(e)
        return diagonal(*((2 * self.mu * s[i] + mean) / F[i][i] for i in range(3)))


class RingThatCreeps(RingThatFlows):
    """Norton's law: z is the logarithm of F^p, and alpha."""

    steps, yields, hardening = 128, None, None

    def kinematics(self, X, t):
        w, (along, around, u) = PI * self.c, ring(X, t)
        r, dr, ddr = (mpfr(0.02) / 2 * f for f in (sin(w * t), w * cos(w * t), -w * w * sin(w * t)))
        return diagonal(1 + along * r, 1 + around * r, 1), diagonal(along * dr, around * dr, 0), [u * ddr]

    def rate(self, X, t, z):
        F, dF = self.kinematics(X, t)[:2]
        _, s = self.strain(F, z)
        square = sum(entry * entry for entry in s) * (2 * self.mu / 200) ** 2
        gamma = square * sqrt(square) / mpfr(0.02)
        # (|s|/drag)^3 s/|s|, which is a polynomial.
        return [*(square * 2 * self.mu / 200 / mpfr(0.02) * entry for entry in s), sqrt(mpfr(2) / 3) * gamma]

    def start(self, X):
        return [ZERO] * 4

    def after(self, X, t, steps):
        """In short steps where the stress passes next to zero, at which its size is not smooth."""
        length, at, z = self.period / steps, ZERO, self.start(X)
        stress = lambda t, z: self.strain(self.kinematics(X, t)[0], z)[1]
        norm = lambda s: sqrt(sum(entry * entry for entry in s))
        while at < t:
            s, h = stress(at, z), mpfr(2) ** -60
            moves = norm([(b - a) / h for a, b in zip(s, stress(at + h, [e + h * r for e, r in zip(z, self.rate(X, at, z))]))])
            most = 32 / mpfr(steps) * norm(s) / moves if at > 0 else length
            to = min(at + min(length, most), t)
            z, at = step(lambda t, z: self.rate(X, t, z), at, z, to - at), to
        return z


SPECS = Path(__file__).resolve().parents[1] / "data/specs/histories"
ALL = {"bar-j2": Bar, "ring-power-law": RingThatCreeps, "bar-own-law": OwnLaw, "ring-j2": RingThatFlows, "ring-simo": RingOfSimo, "block-maxwell": LinearMaxwell,
       "block-j2": Block, "block-perzyna": Perzyna, "block-j2-3d": BlockInSpace}


def turned(A, cosine, sine):
    Q = [[cosine, -sine, ZERO], [sine, cosine, ZERO], [ZERO, ZERO, ONE]]
    return product(product(Q, A), transposed(Q))


def exact(task):
    """Fields in Cartesian components, and what the integrator misses."""
    name, place, t, asks = task
    own = ALL[name]()
    n, t = own.dimension, mpfr(t)
    X = [mpfr(x) for x in place]
    if own.radial:
        R = sqrt(X[0] ** 2 + X[1] ** 2)
        cosine, sine, X = X[0] / R, X[1] / R, [R]
    internal, P = own.fields(X, t, own.steps)
    b = None
    if asks["b"]:
        moved = lambda axis, by: [x + (by if k == axis else 0) for k, x in enumerate(X)]
        sides = [[own.fields(moved(axis, by), t, own.steps)[1] for by in (STEP, -STEP)] for axis in range(len(X))]
        slope = lambda axis, i, j: (sides[axis][0][i][j] - sides[axis][1][i][j]) / (2 * STEP)
        a = own.kinematics(X, t)[2]
        if own.radial:
            along = a[0] - (slope(0, 0, 0) + (P[0][0] - P[1][1]) / X[0]) / own.rho0
            b = [along * cosine, along * sine]
        else:
            b = [a[i] - sum(slope(J, i, J) for J in range(n)) / own.rho0 for i in range(n)]
    missed = 0.0
    if asks["own error"]:
        z, coarse = own.after(X, t, own.steps), own.after(X, t, own.steps // 2)
        size = max(abs(entry) for entry in z) or ONE
        missed = float(max(abs(p - q) for p, q in zip(z, coarse)) / size)
        if hasattr(own, "closed"):
            missed = max(missed, float(own.closed(X, t, z)))
    if own.radial:
        P = turned(P, cosine, sine)
        for stem, values in internal.items():
            if len(values) == 6:
                v = values
                internal[stem] = six(turned([[v[0], v[3], v[4]], [v[3], v[1], v[5]], [v[4], v[5], v[2]]], cosine, sine))
    fields = {**internal, "P": [P[i][j] for i in range(n) for j in range(n)], **({"b": b} if b else {})}
    return fields, missed


def drawn(name, count):
    own, draw = ALL[name](), random.Random(f"{name} in 256 bits")
    points = []
    for _ in range(count):
        place = [draw.random() for _ in range(own.dimension)]
        if own.radial:
            R, angle = 0.5 + 0.5 * place[0], 1.5 * place[1]
            place = [float(R * cos(mpfr(angle))), float(R * sin(mpfr(angle)))]
        points.append((place, draw.random() * float(own.period)))
    return points


def evaluated(mms, name, points):
    rows, file = json.dumps([{"X": X, "t": t} for X, t in points]), SPECS / f"{name}.toml"
    out = subprocess.run([mms, "eval", file if file.exists() else name, "--points", "-", "--json", "-"], input=rows, check=True, capture_output=True, text=True).stdout
    return json.loads(out)["rows"]


def fields_of(row, names):
    """Those of mms in the same order."""
    flat = lambda A: [x for line in A for x in line]
    stems = {"P": flat(row["P"]), "b": row["b"]}
    order = ["11", "22", "33", "12", "13", "23"]
    for stem in names:
        if stem not in stems:
            own = row["internal"]
            stems[stem] = [own[stem]] if stem in own else [own[stem + entry] for entry in order]
    return stems


def main():
    read = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    read.add_argument("mms")
    read.add_argument("--solutions", type=lambda text: text.split(","), default=list(ALL))
    read.add_argument("--points", type=int, default=1000)
    chosen = read.parse_args()
    failed = False
    with multiprocessing.Pool() as pool:
        for name in chosen.solutions:
            began, points = time.monotonic(), drawn(name, chosen.points)
            # b takes three to seven trajectories a point.
            rarely = 10
            tasks = [(name, X, t, {"b": k % rarely == 0, "own error": k % 20 == 0}) for k, (X, t) in enumerate(points)]
            found = pool.map(exact, tasks, chunksize=4)
            rows = evaluated(chosen.mms, name, points)
            sizes, worst = {}, {}
            for fields, _ in found:
                for field, values in fields.items():
                    sizes[field] = max(sizes.get(field, ZERO), *map(abs, values))
            for number, ((fields, _), row) in enumerate(zip(found, rows)):
                own = fields_of(row, fields)
                for field, values in fields.items():
                    missed = max(abs(mpfr(o) - v) for o, v in zip(own[field], values))
                    here = max(missed / sizes[field], ZERO)
                    if here >= worst.get(field, (-1,))[0]:
                        worst[field] = (here, number)
            own_error = max(missed for _, missed in found)
            told = ", ".join(f"{field} {float(most):.1e} (point {number})" for field, (most, number) in worst.items())
            print(f"{name}: {told}; the reference itself {own_error:.0e}; {time.monotonic() - began:.0f} s", flush=True)
            failed |= own_error > 1e-12 or any(most > BOUND for most, _ in worst.values())
    sys.exit(failed)


if __name__ == "__main__":
    main()
