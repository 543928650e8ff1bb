"""Explicit finite elements in the plane with NumPy, and mistakes that can be planted in them.

Bilinear quadrilaterals on the unit square, lumped mass, central differences with staggered velocities, neo-Hookean.
"""

import numpy as np

CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
GAUSS = np.array([[x, y] for x in (-1, 1) for y in (-1, 1)]) / np.sqrt(3)

#: The mistake in words, and the cause that has to be named first: one of several where they are the same thing.
MISTAKES = {
    "b subtracted": "force-sign",
    "P transposed": "stress-transposed",
    "tau for P": "stress-kirchhoff",
    "sigma for P": "stress-cauchy",
    "S for P": "stress-second-piola-kirchhoff",
    "J P for P": "stress-times-J",
    "dN/dx with P": "stress-with-current-gradients",
    "lambda and mu exchanged": "moduli-exchanged",
    "lambda of plane stress": "plane-stress",
    "E and nu for lambda and mu": "E-and-nu-for-lambda-and-mu",
    "K for lambda": "bulk-modulus-for-lambda",
    "mu without 1/2": "mu-doubled",
    "law of small strains": "law-small-strain",
    "J - 1 for ln J": "law-neo-hookean-volume-change",
    "log10 for ln": "law-logarithm-to-base-10",
    "F^-1 for F^-T": "law-inverse-not-transposed",
    "C for B": "law-right-for-left-cauchy-green",
    "shear doubled": "stress-shear-doubled",
    "dN/dX without the 2 of 2/h": "shape-gradients-halved",
    "weights of 1/2": "internal-force-halved",
    "mass halved": "internal-force-doubled",
    "mass without density": "internal-force-without-density",
    "rho0 b for b": "force-per-volume",
    "rho0^2 b for b": "force-per-volume-twice",
    "b/rho0 for b": "force-per-mass",
    "b at t + dt": "force-step-ahead",
    "b at t - dt": "force-step-behind",
    "b at t + dt/2": "force-half-step-ahead",
    "b at x": "force-at-current-position",
    "b at centres": "force-half-a-cell-off",
    "b of X and Y exchanged": "force-coordinates-exchanged",
    "components of b exchanged": "force-components-exchanged",
    "b of the start": "force-frozen",
    "b_Y forgotten": "force-component-unused",
    "v(0) for v(-dt/2)": "initial-velocity-half-step-ahead",
    "starts at rest": "initial-velocity-missing",
    "starts undeformed": "initial-displacement-unused",
    "boundary late": "boundary-step-behind",
    "boundary early": "boundary-step-ahead",
    "boundary held": "boundary-unused",
    "boundary at x": "boundary-at-current-position",
    "du/dx for du/dX": "law-of-spatial-gradient",
    "symmetric part of F": "law-of-symmetric-part",
    "mu too large by a half": "mu-factor",
    "K - mu for lambda": "bulk-modulus-without-two-thirds",
    "b at 2 t": "force-at-twice-the-time",
    "gravity added": "force-with-gravity",
    "components of the boundary exchanged": "boundary-components-exchanged",
    "v for u on the boundary": "boundary-velocity-for-displacement",
    "a step too few": "result-step-behind",
    "time passed by": "result-time",
    "traction forgotten": "traction-unused",
    "traction subtracted": "traction-sign",
    "traction whole at both nodes": "traction-doubled",
    "traction per current length": "traction-per-current-area",
    "traction late": "traction-step-behind",
}


def first_piola_kirchhoff(F, lam, mu, mistake):
    if mistake == "du/dx for du/dX":
        F = 2 * np.eye(2) - np.linalg.inv(F)
    if mistake == "symmetric part of F":
        F = (F + np.swapaxes(F, -1, -2)) / 2
    J = np.linalg.det(F)[..., None, None]
    inverse = np.linalg.inv(F)
    f = inverse if mistake == "F^-1 for F^-T" else np.swapaxes(inverse, -1, -2)
    log = np.log10(J) if mistake == "log10 for ln" else J - 1 if mistake == "J - 1 for ln J" else np.log(J)
    P = mu * (F - f) + lam * log * f
    transposed = np.swapaxes(F, -1, -2)
    one = np.eye(2)
    if mistake == "law of small strains":
        strain = (F + transposed) / 2 - one
        P = lam * np.trace(strain, axis1=-2, axis2=-1)[..., None, None] * one + 2 * mu * strain
    if mistake == "C for B":
        P = (mu * (transposed @ F - one) + lam * log * one) @ f
    if mistake == "P transposed":
        P = np.swapaxes(P, -1, -2)
    if mistake == "tau for P":
        P = P @ transposed
    if mistake == "sigma for P":
        P = P @ transposed / J
    if mistake == "S for P":
        P = inverse @ P
    if mistake == "J P for P":
        P = J * P
    if mistake == "dN/dx with P":
        P = P @ f
    if mistake == "a pressure of its own":
        # In no list: no cause may be named.
        P = P + 0.02 * lam * (J - 1) * np.eye(2)
    if mistake == "shear doubled":
        P = P * np.array([[1, 2], [2, 1]])
    return P


def solve(solution, cells, mistake="", periods=0.4):
    """Displacements at the nodes after so many periods."""
    h = 1 / cells
    line = np.arange(cells + 1)
    X = np.array([[i, j] for j in line for i in line]) * h
    first = np.array([j * (cells + 1) + i for j in range(cells) for i in range(cells)])
    elements = first[:, None] + np.array([0, 1, cells + 2, cells + 1])
    scale = 1 / h if mistake == "dN/dX without the 2 of 2/h" else 2 / h
    other = CORNERS[:, ::-1]
    gradients = CORNERS / 4 * (1 + other * GAUSS[:, None, ::-1]) * scale
    weight = h * h / (8 if mistake == "weights of 1/2" else 4)

    rho, lam, mu = solution.density, solution.law["lambda"], solution.law["mu"]
    E, nu = mu * (3 * lam + 2 * mu) / (lam + mu), lam / (2 * (lam + mu))
    speed = np.sqrt((lam + 2 * mu) / rho)
    if mistake == "lambda and mu exchanged":
        lam, mu = mu, lam
    if mistake == "lambda of plane stress":
        lam = E * nu / (1 - nu**2)
    if mistake == "E and nu for lambda and mu":
        lam, mu = E, nu
    if mistake == "K for lambda":
        lam = E / (3 * (1 - 2 * nu))
    if mistake == "mu too large by a half":
        mu = 1.5 * mu
    if mistake == "K - mu for lambda":
        lam = E / (3 * (1 - 2 * nu)) - mu
    if mistake == "mu without 1/2":
        mu = E / (1 + nu)
    mass = np.zeros(len(X))
    density = {"mass without density": 1.0, "mass halved": rho / 2}.get(mistake, rho)
    np.add.at(mass, elements, density * h * h / 4)

    loaded = [side for side, condition in solution.boundaries.items() if condition == "prescribed-traction"]
    sides = {"X-lower": X[:, 0] == 0, "X-upper": X[:, 0] == 1, "Y-lower": X[:, 1] == 0, "Y-upper": X[:, 1] == 1}
    held = np.any([on for side, on in sides.items() if side not in loaded], axis=0)
    period = solution.period
    steps = int(np.ceil(periods * period * speed / (0.3 * h)))
    dt = periods * period / steps
    end = steps * dt
    if mistake == "time passed by":
        # Of the length that stability allows, so that the last step ends beyond the end.
        dt = 0.3 * h / speed

    def load(u, t):
        force = np.zeros_like(X)
        if mistake == "traction late":
            t = t - dt
        for side in loaded if mistake != "traction forgotten" else []:
            nodes = np.flatnonzero(sides[side])
            pairs = np.stack([nodes[:-1], nodes[1:]], axis=1)
            for place in (-1 / np.sqrt(3), 1 / np.sqrt(3)):
                shares = np.array([1 - place, 1 + place]) / 2
                if mistake == "traction whole at both nodes":
                    shares = 2 * shares
                points = np.einsum("a,eai->ei", shares / shares.sum(), X[pairs])
                length = np.full(len(pairs), h)
                if mistake == "traction per current length":
                    ends = (X + u)[pairs]
                    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
                traction = solution.traction(side, points, t) * length[:, None] / 2
                np.add.at(force, pairs, shares[None, :, None] * traction[:, None, :])
        return -force if mistake == "traction subtracted" else force

    def body_force(u, t):
        at = {"b at t + dt": t + dt, "b at t - dt": t - dt, "b at t + dt/2": t + dt / 2, "b of the start": 0.0, "b at 2 t": 2 * t}.get(mistake, t)
        place = {"b at x": X + u, "b at centres": X + h / 2, "b of X and Y exchanged": X[:, ::-1]}.get(mistake, X)
        b = solution.b(place, at)
        b = {"b subtracted": -b, "rho0 b for b": rho * b, "rho0^2 b for b": rho**2 * b, "b/rho0 for b": b / rho, "components of b exchanged": b[:, ::-1]}.get(mistake, b)
        if mistake == "gravity added":
            b = b - [0, 9.81]
        return b * [1, 0] if mistake == "b_Y forgotten" else b

    def acceleration(u, t):
        F = np.eye(2) + np.einsum("eai,qaJ->eqiJ", u[elements], gradients)
        P = first_piola_kirchhoff(F, lam, mu, mistake)
        force = load(u, t)
        np.add.at(force, elements, -weight * np.einsum("eqiJ,qaJ->eai", P, gradients))
        return force / mass[:, None] + body_force(u, t)

    u, v = solution.u(X, 0.0), solution.v(X, 0.0 if mistake == "v(0) for v(-dt/2)" else -dt / 2)
    if mistake == "starts at rest":
        v = np.zeros_like(X)
    if mistake == "starts undeformed":
        u = np.where(held[:, None], u, 0.0)
    for step in range(steps - 1 if mistake == "a step too few" else steps):
        t = step * dt
        v = v + dt * acceleration(u, t)
        place = X[held] + u[held] if mistake == "boundary at x" else X[held]
        u = u + dt * v
        if mistake == "boundary held":
            u[held] = solution.u(X[held], 0.0)
        elif mistake == "v for u on the boundary":
            u[held] = solution.v(X[held], t + dt)
        elif mistake == "components of the boundary exchanged":
            u[held] = solution.u(X[held], t + dt)[:, ::-1]
        else:
            u[held] = solution.u(place, t + {"boundary late": 0.0, "boundary early": 2 * dt}.get(mistake, dt))
    return {"X": X, "t": end, "u": u}
