"""Steps a second of MLS-MPM in space (quadratic splines, APIC, neo-Hookean) written in NVIDIA warp, on its CPU device.

    python warp_mls3d.py f64|f32 CELLS STEPS REPEATS

A unit cube with sliding walls and eight particles a cell, which are stored cell by cell. Source of the method: Hu et al., ACM TOG 37 (2018) 150.
"""

import json
import math
import sys
import time

import numpy as np
import warp as wp

precision, cells, steps, repeats = sys.argv[1], *map(int, sys.argv[2:5])
wp.config.quiet = True
wp.init()
Real, numpy_real = (wp.float64, np.float64) if precision == "f64" else (wp.float32, np.float32)
Vector = wp.types.vector(length=3, dtype=Real)
Matrix = wp.types.matrix(shape=(3, 3), dtype=Real)

PAD = 3
SIDE = cells + 2 * PAD + 1
h = 1.0 / cells
E, NU, RHO = 1.0e4, 0.3, 1.0
LAMBDA, MU = E * NU / ((1 + NU) * (1 - 2 * NU)), E / (2 * (1 + NU))
WAVE = math.sqrt((LAMBDA + 2 * MU) / RHO)
volume = (0.5 * h) ** 3

spacing, per_spacing, dt = wp.constant(Real(h)), wp.constant(Real(1 / h)), wp.constant(Real(0.2 * h / WAVE))
mass, lam, mu = wp.constant(Real(RHO * volume)), wp.constant(Real(LAMBDA)), wp.constant(Real(MU))
of_stress = wp.constant(Real(-0.2 * h / WAVE * volume * 4 / h**2))
of_affine = wp.constant(Real(4 / h**2))
zero, half, one, two = (wp.constant(Real(value)) for value in (0.0, 0.5, 1.0, 2.0))
three_halves, three_quarters = wp.constant(Real(1.5)), wp.constant(Real(0.75))
first_wall, last_wall, pad = wp.constant(PAD), wp.constant(PAD + cells), wp.constant(Real(PAD))


@wp.func
def spline(place: Real):
    return Vector(
        half * (three_halves - place) * (three_halves - place),
        three_quarters - (place - one) * (place - one),
        half * (place - half) * (place - half),
    )


@wp.func
def apart(place: Real):
    return Vector(-place * spacing, (one - place) * spacing, (two - place) * spacing)


@wp.kernel
def clear(masses: wp.array3d(dtype=Real), momenta: wp.array3d(dtype=Vector)):
    i, j, k = wp.tid()
    masses[i, j, k] = zero
    momenta[i, j, k] = Vector(zero, zero, zero)


@wp.kernel
def p2g(
    x: wp.array(dtype=Vector),
    v: wp.array(dtype=Vector),
    C: wp.array(dtype=Matrix),
    F: wp.array(dtype=Matrix),
    masses: wp.array3d(dtype=Real),
    momenta: wp.array3d(dtype=Vector),
):
    p = wp.tid()
    at = x[p] * per_spacing + Vector(pad, pad, pad)
    i0, j0, k0 = int(at[0] - half), int(at[1] - half), int(at[2] - half)
    wx, wy, wz = spline(at[0] - Real(i0)), spline(at[1] - Real(j0)), spline(at[2] - Real(k0))
    dx, dy, dz = apart(at[0] - Real(i0)), apart(at[1] - Real(j0)), apart(at[2] - Real(k0))
    I = wp.identity(n=3, dtype=Real)
    tau = mu * (F[p] * wp.transpose(F[p]) - I) + lam * wp.log(wp.determinant(F[p])) * I
    affine = of_stress * tau + mass * C[p]
    momentum = mass * v[p]
    for i in range(3):
        for j in range(3):
            for k in range(3):
                w = wx[i] * wy[j] * wz[k]
                wp.atomic_add(momenta, i0 + i, j0 + j, k0 + k, w * (momentum + affine * Vector(dx[i], dy[j], dz[k])))
                wp.atomic_add(masses, i0 + i, j0 + j, k0 + k, w * mass)


@wp.kernel
def update(masses: wp.array3d(dtype=Real), momenta: wp.array3d(dtype=Vector)):
    i, j, k = wp.tid()
    m = masses[i, j, k]
    if m > zero:
        v = momenta[i, j, k] / m
        if i <= first_wall or i >= last_wall:
            v = Vector(zero, v[1], v[2])
        if j <= first_wall or j >= last_wall:
            v = Vector(v[0], zero, v[2])
        if k <= first_wall or k >= last_wall:
            v = Vector(v[0], v[1], zero)
        momenta[i, j, k] = v


@wp.kernel
def g2p(
    x: wp.array(dtype=Vector),
    v: wp.array(dtype=Vector),
    C: wp.array(dtype=Matrix),
    F: wp.array(dtype=Matrix),
    velocities: wp.array3d(dtype=Vector),
):
    p = wp.tid()
    at = x[p] * per_spacing + Vector(pad, pad, pad)
    i0, j0, k0 = int(at[0] - half), int(at[1] - half), int(at[2] - half)
    wx, wy, wz = spline(at[0] - Real(i0)), spline(at[1] - Real(j0)), spline(at[2] - Real(k0))
    dx, dy, dz = apart(at[0] - Real(i0)), apart(at[1] - Real(j0)), apart(at[2] - Real(k0))
    velocity = Vector(zero, zero, zero)
    affine = Matrix(zero, zero, zero, zero, zero, zero, zero, zero, zero)
    for i in range(3):
        for j in range(3):
            for k in range(3):
                w = wx[i] * wy[j] * wz[k]
                of_node = velocities[i0 + i, j0 + j, k0 + k]
                velocity += w * of_node
                affine += (of_affine * w) * wp.outer(of_node, Vector(dx[i], dy[j], dz[k]))
    v[p] = velocity
    C[p] = affine
    x[p] = x[p] + dt * velocity
    F[p] = (wp.identity(n=3, dtype=Real) + dt * affine) * F[p]


inside = (np.indices((2, 2, 2)).reshape(3, -1).T + 0.5) * (0.5 * h)
corners = np.indices((cells, cells, cells)).reshape(3, -1).T * h
X = (corners[:, None, :] + inside[None, :, :]).reshape(-1, 3)
count = len(X)
speeds = 0.02 * WAVE * math.pi * np.sin(math.pi * X)
masses = wp.zeros((SIDE, SIDE, SIDE), dtype=Real, device="cpu")
momenta = wp.zeros((SIDE, SIDE, SIDE), dtype=Vector, device="cpu")


def at_start():
    array = lambda values, dtype: wp.array(values.astype(numpy_real), dtype=dtype, device="cpu")
    identities = np.tile(np.eye(3), (count, 1, 1))
    return array(X, Vector), array(speeds, Vector), wp.zeros(count, dtype=Matrix, device="cpu"), array(identities, Matrix)


def step(x, v, C, F):
    wp.launch(clear, (SIDE, SIDE, SIDE), inputs=[masses, momenta], device="cpu")
    wp.launch(p2g, count, inputs=[x, v, C, F, masses, momenta], device="cpu")
    wp.launch(update, (SIDE, SIDE, SIDE), inputs=[masses, momenta], device="cpu")
    wp.launch(g2p, count, inputs=[x, v, C, F, momenta], device="cpu")


step(*at_start())
rates = []
for _ in range(repeats):
    particles = at_start()
    step(*particles)
    begun = time.perf_counter()
    for _ in range(steps):
        step(*particles)
    rates.append(count * steps / (time.perf_counter() - begun) / 1e6)
J = np.linalg.det(particles[3].numpy())
assert np.isfinite(J).all() and (J > 0).all(), "a particle is inside out"
print(json.dumps({"code": "warp, MLS-MPM in space", "cells": cells, "steps": steps, "mups_median": float(np.median(rates))}))
