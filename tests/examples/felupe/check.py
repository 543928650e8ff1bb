"""Verifies three materials with memory of FElupe, which others wrote, by the orders of their errors.

    python check.py

Blocks in plane strain at rest, whose load grows in steps: bilinear quadrilaterals, the motion prescribed all around, and the force
`static_force`, rho0 (b - a), at the quadrature points. Of mmsmith are the specifications beside this file, fields and initial values; meshes,
materials, state variables and Newton's method are FElupe's.

- `j2.toml`: `LinearElasticPlasticIsotropicHardening`, a radial return; backward Euler, of order 1 in the time step.
- `prony.toml`: `linear_elastic_viscoelastic`, exponentials over steps of constant strain rates, of order 2.
- `viscoelastic.toml`: `finite_strain_viscoelastic`, an explicit solution of an implicit step (Shutov, Landgraf and Ihlemann 2013), of order 1.

Where the steps shrink with h^2, or with h for the second, errors against the exact solution must fall with order 2 in u, to a tenth, and with
1 at least in stresses and internal variables, to a tenth, all at the quadrature points. On one grid the differences between runs whose steps
are halved must fall with the order of the material, to 0.15. Mistakes planted around the first material must be told by the fields that
they spoil. Exit status: 0 where all that holds, else 1.
"""

import functools
import sys
from pathlib import Path

import felupe
import mmsmith
import numpy


@functools.cache
def solution(name):
    """The solution of a file beside this one; its tables of histories are made once."""
    return mmsmith.load(Path(__file__).parent / f"{name}.toml")


def plane(components):
    """Symmetric tensors of shape (3, 3, ...) of their components 11, 22, 12 and 33."""
    xx, yy, xy, zz = numpy.broadcast_arrays(*components)
    none = numpy.zeros_like(xx)
    return numpy.array([[xx, xy, none], [xy, yy, none], [none, none, zz]])


class Plastic:
    name, order = "j2", 1
    steps = (16, 32, 64, 128)

    def __init__(self, law=None, forgets=()):
        self.exact = solution(self.name)
        values = self.exact.parameters
        E, nu, self.yield_stress, H = (values[name] for name in ("E", "nu", "sy", "H"))
        self.mu = E / (2 * (1 + nu))
        self.H = H
        if law is None:
            self.material = felupe.LinearElasticPlasticIsotropicHardening(E=E, nu=nu, sy=self.yield_stress, K=H)
        else:
            lam = E * nu / ((1 + nu) * (1 - 2 * nu))
            self.material = felupe.MaterialStrain(law, λ=lam, μ=self.mu, σy=self.yield_stress, K=H, statevars=(1, (3, 3)))

    def start(self, shape):
        """Equivalent plastic strain, plastic strain, strain and stress, on the yield surface."""
        stress = self.yield_stress / numpy.sqrt(3) * numpy.array([[0.8, 0.6, 0.0], [0.6, -0.8, 0.0], [0.0, 0.0, 0.0]])
        values = numpy.concatenate([[0.0], -stress.ravel() / (2 * self.mu), numpy.zeros(9), stress.ravel()])
        return values[:, None, None] * numpy.ones(shape)

    def bodies(self, field, dt):
        shape = (field.region.quadrature.npoints, field.region.mesh.ncells)
        return [felupe.SolidBody(self.material, field, statevars=self.start(shape))]

    def internal(self, X, t):
        """The exact plastic strain and its equivalent."""
        values = self.exact.internal(X, t)
        H = self.exact.H(X, t)
        strain = [H[..., 0, 0], H[..., 1, 1], (H[..., 0, 1] + H[..., 1, 0]) / 2, numpy.zeros(len(X))]
        mean = (strain[0] + strain[1]) / 3
        s = [values["s11"], values["s22"], values["s12"], -values["s11"] - values["s22"]]
        deviator = [strain[0] - mean, strain[1] - mean, strain[2], -mean]
        return {
            "e": plane([d - part / (2 * self.mu) for d, part in zip(deviator, s)]),
            "alpha": values["alpha"],
        }

    def found(self, bodies):
        state = bodies[0].results.statevars.reshape(28, -1)
        return {"e": state[1:10].reshape(3, 3, -1), "alpha": state[0]}


class Prony:
    name, order = "prony", 2
    steps = (8, 16, 32)

    def __init__(self):
        self.exact = solution(self.name)

    def bodies(self, field, dt):
        values = self.exact.parameters
        E, nu, shares = values["E"], values["nu"], [values["g1"], values["g2"]]
        bulk, mu = E / (3 * (1 - 2 * nu)), E / (2 * (1 + nu))
        slow = (1 - sum(shares)) * mu
        material = felupe.MaterialStrain(
            felupe.linear_elastic_viscoelastic,
            λ=bulk - 2 / 3 * slow,
            μ=slow,
            G=[share * mu for share in shares],
            τ=[values["tau1"], values["tau2"]],
            Δt=dt,
            statevars=((2, 3, 3),),
        )
        return [felupe.SolidBody(material, field)]

    def internal(self, X, t):
        return {}

    def found(self, bodies):
        return {}


class Viscoelastic:
    name, order = "viscoelastic", 1
    steps = (16, 32, 64)

    def __init__(self):
        self.exact = solution(self.name)

    def bodies(self, field, dt):
        values = self.exact.parameters
        shape = (field.region.quadrature.npoints, field.region.mesh.ncells)
        behind = felupe.Hyperelastic(felupe.finite_strain_viscoelastic, mu=values["G"], eta=values["eta"], dtime=dt, nstatevars=6)
        unity = numpy.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])[:, None, None] * numpy.ones(shape)
        spring = felupe.NeoHooke(mu=values["mu"], bulk=values["K"])
        return [felupe.SolidBody(behind, field, statevars=unity), felupe.SolidBody(spring, field)]

    def internal(self, X, t):
        c = self.exact.internal(X, t)
        return {"Ci": plane([c["c11"], c["c22"], c["c12"], 1 / (c["c11"] * c["c22"] - c["c12"] ** 2)])}

    def found(self, bodies):
        xx, xy, _, yy, _, zz = bodies[0].results.statevars.reshape(6, -1)
        return {"Ci": plane([xx, yy, xy, zz])}


def solve(case, cells, steps):
    """What FElupe computes at the end: positions, displacements and stresses at the quadrature points, and the internal variables."""
    exact = case.exact
    mesh = felupe.Rectangle(n=cells + 1)
    region = felupe.RegionQuad(mesh)
    displacement = felupe.FieldPlaneStrain(region, dim=2)
    field = felupe.FieldContainer([displacement])
    rows = lambda values: numpy.moveaxis(values.reshape(*values.shape[:-2], -1), -1, 0)
    X = rows(felupe.Field(region, dim=2, values=mesh.points).interpolate())
    points = exact.points(X)
    bodies = case.bodies(field, exact.period / steps)
    load = felupe.PointLoad(field, numpy.arange(mesh.npoints))
    around = felupe.Boundary(displacement, mask=numpy.any((mesh.points == 0) | (mesh.points == 1), axis=1))
    fixed, free = felupe.dof.partition(field, {"around": around})
    for step in range(1, steps + 1):
        t = step * exact.period / steps
        force = points.static_force(t).T.reshape(2, region.quadrature.npoints, mesh.ncells)
        assembled = felupe.IntegralForm([force], v=field, dV=region.dV, grad_v=[False]).assemble()
        load.update(assembled.toarray().reshape(-1, 2))
        motion = exact.u(mesh.points, t).ravel()
        felupe.newtonraphson(items=[*bodies, load], dof0=fixed, dof1=free, ext0=motion[fixed], tol=1e-10, verbose=0)
    stress = sum(body.results.stress[0] for body in bodies)
    fields = {"u": rows(displacement.interpolate())[:, :2], "P": rows(stress)[:, :2, :2]}
    return {"X": X, "t": exact.period, **fields}, case.found(bodies)


def distance(one, other):
    """The mean-square length of differences of shape (..., points)."""
    return float(numpy.sqrt(numpy.mean(numpy.sum((one - other).reshape(-1, one.shape[-1]) ** 2, axis=0))))


def errors(case, cells, steps):
    result, state = solve(case, cells, steps)
    told = mmsmith.measure(case.exact, result, "l2")
    exact = case.internal(result["X"], result["t"])
    return told | {name: distance(values, exact[name]) for name, values in state.items()}


def study(case, cells):
    """Errors and their orders as the grid and the steps are refined together."""
    # So that the errors of the steps fall with h^2 as well.
    counts = [count if case.order == 2 else count**2 // 8 for count in cells]
    rows = [errors(case, *pair) for pair in zip(cells, counts)]
    table = mmsmith.orders([1 / count for count in cells], {name: [row[name] for row in rows] for name in rows[0]})
    print(f"{case.name}: {cells} cells, {counts} steps, against the exact solution\n{table}", flush=True)
    return table


def study_of_steps(case, cells, counts):
    """Differences between runs on one grid whose steps are halved, and their orders."""
    runs = [{**result, **state} for result, state in (solve(case, cells, count) for count in counts)]
    names = [name for name in runs[0] if name not in ("X", "t")]
    last = lambda run, name: numpy.moveaxis(run[name], 0, -1) if name in "uP" else run[name]
    differences = {name: [distance(last(one, name), last(other, name)) for one, other in zip(runs, runs[1:])] for name in names}
    table = mmsmith.orders([1 / count for count in counts[:-1]], differences)
    print(f"{case.name}: {cells} cells, {counts} steps, differences of neighbours\n{table}", flush=True)
    return table


def yields(case):
    """Whether the exact body flows everywhere and always: the least s:strain' in units of |s| |strain'|, and the yield condition's residual."""
    exact, least, residual = case.exact, numpy.inf, 0.0
    X = exact.sample(200)
    dt = 1e-4 * exact.period
    for t in numpy.linspace(0.02, 1.0, 25) * exact.period:
        values = exact.internal(X, t)
        xx, yy, xy = values["s11"], values["s22"], values["s12"]
        s = plane([xx, yy, xy, -xx - yy])
        H = (exact.H(X, t) - exact.H(X, t - dt)) / dt
        rate = plane([H[:, 0, 0], H[:, 1, 1], (H[:, 0, 1] + H[:, 1, 0]) / 2, 0.0])
        length = lambda tensor: numpy.sqrt(numpy.sum(tensor**2, axis=(0, 1)))
        least = min(least, numpy.min(numpy.sum(s * rate, axis=(0, 1)) / (length(s) * length(rate))))
        limit = numpy.sqrt(2 / 3) * (case.yield_stress + case.H * values["alpha"])
        residual = max(residual, numpy.max(numpy.abs(length(s) / limit - 1)))
    return float(least), float(residual)


def without_two_thirds(dε, εn, σn, ζn, λ, μ, σy, K, **kwargs):
    """Hardening of K in place of 2/3 K, in the multiplier as in the yield condition."""
    return felupe.linear_elastic_plastic_isotropic_hardening(dε, εn, σn, ζn, λ, μ, σy, 3 / 2 * K, **kwargs)


def forgetting(*forgotten):
    """The law with state variables that are not carried on from one step to the next: 0 is alpha, 1 the plastic strain."""

    def law(dε, εn, σn, ζn, *arguments, **kwargs):
        before = [values.copy() for values in ζn]
        tangent, stress, state = felupe.linear_elastic_plastic_isotropic_hardening(dε, εn, σn, ζn, *arguments, **kwargs)
        return tangent, stress, [before[k] if k in forgotten else values for k, values in enumerate(state)]

    return law
# Each mistake, and the fields whose order from 4 to 8 cells tells it: they have order 1 without.
MISTAKES = {
    "2/3 of the hardening dropped": (without_two_thirds, ["P", "e", "alpha"]),
    "alpha not carried on": (forgetting(0), ["P", "e", "alpha"]),
    "plastic strain not carried on": (forgetting(1), ["e"]),
}


def orders():
    for case in (Plastic(), Prony(), Viscoelastic()):
        table = study(case, (4, 8, 16))
        for field in table.errors:
            found = table.order(field)[-1]
            if field == "u":
                assert abs(found - 2) <= 0.1, f"{case.name}: order {found:.3f} in u, expected 2 +/- 0.1"
            else:
                assert found >= 0.9, f"{case.name}: order {found:.3f} in {field}, expected 1 at least"
        table = study_of_steps(case, 3, case.steps)
        for field in table.errors:
            found = table.order(field)[-1]
            assert abs(found - case.order) <= 0.15, f"{case.name}: order {found:.3f} in steps, of {field}, expected {case.order} +/- 0.15"


def planted():
    for mistake, (law, fields) in MISTAKES.items():
        print(f"planted: {mistake}")
        table = study(Plastic(law), (4, 8))
        told = [field for field in table.errors if field != "u" and table.order(field)[-1] < 0.75]
        assert told == fields, f"{mistake}: told by {told}, expected {fields}"


def main():
    try:
        least, residual = yields(Plastic())
        print(f"j2: the least s:e'/(|s| |e'|) is {least:.3f}, and the yield condition holds to {residual:.1e}")
        assert least > 0.5 and residual < 1e-10
        orders()
        planted()
    except AssertionError as error:
        print(f"FAILED: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
