"""Files of `mms gen` in the hands of their hosts, at 1,000 points a solution (or MMSMITH_POINTS), beside `mms eval`.

    python hosts.py MMS FOLDER [--solutions NAME|FILE,...] HOST...

Hosts: c, cpp, rust, cuda, fortran, abaqus, calculix, numpy, jax, ufl, moose, kratos, febio, julia, openfoam. Exit status: 0 where all agree, 1 where any does not.

Differences are told in units of 2^-52 of the largest entry of the field over all points; LARGEST says what a host may have. Zero
means the same bits. Fields that a file takes from a table, as the stress of a material with memory is not a formula, have to be within
1e-12 of their largest entry, or the error that the table tells.
"""

import importlib.util
import json
import math
import os
import re
import subprocess
import sys
import xml.etree.ElementTree
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
SPECS = HERE.parents[1] / "mms-specs"
FIELDS = {"u": 1, "v": 1, "a": 1, "H": 2, "F": 2, "J": 0, "P": 2, "b": 1}
POINTS = int(os.environ.get("MMSMITH_POINTS", "1000"))
LARGEST = {"c": 0, "cpp": 0, "rust": 0, "cuda": 16, "fortran": 0, "calculix": 0, "numpy": 16, "jax": 16, "ufl": 32, "moose": 32, "kratos": 32, "febio": 32, "julia": 16}
# Functions that C and Rust have from different libraries, as the module of NumPy calls them.
OF_LIBRARY = r"math\.erf|np\.(?:tan|arcsin|arccos|arctan2?|sinh|cosh|tanh)\b"


class Refused(Exception):
    """The host has no words for the solution, and `mms gen` says so by the name of the function."""


def call(command, **options):
    done = subprocess.run([str(word) for word in command], capture_output=True, **options)
    if done.returncode != 0 and (b" have no form of " in done.stderr or b" has no expression; " in done.stderr):
        raise Refused(done.stderr.decode())
    if done.returncode != 0 and b"no table over the body is accurate" in done.stderr:
        raise NeedsPoints(done.stderr.decode())
    if done.returncode != 0:
        # What it has printed may be numbers.
        told = [text.decode(errors="replace") for text in (done.stderr, done.stdout)]
        raise SystemExit(f"{' '.join(str(word) for word in command)}: {told[0][-3000:]}{told[1][-500:]}")
    return done.stdout


def loaded(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class NeedsPoints(Exception):
    """No table of the body is accurate."""


class Case:
    """A solution with points of its body, and its fields there by `mms eval`."""

    def __init__(self, mms, folder, name):
        # A specification by its name or by its file.
        self.mms, self.given, name = mms, name, Path(name).stem
        self.folder, self.name = folder / name, name
        self.module = name.replace("-", "_")
        self.folder.mkdir(parents=True, exist_ok=True)
        self.points_file = None
        # A body of revolution has points in its half plane.
        self.of_revolution = str(self.given).endswith(".toml") and "'axisymmetric'" in Path(self.given).read_text()
        module = self.first_module()
        self.calls_library = re.search(OF_LIBRARY, module.read_text()) is not None
        solution = loaded(module).Solution()
        self.dimension = solution.DIMENSION
        self.X, self.t = self.points(solution)
        # Where it depends on the place, for each point.
        self.density = solution.rho0(self.X)[:, None] if hasattr(solution, "rho0") else solution.density()
        self.variables, self.worst_of_table = getattr(solution, "INTERNAL", []), 0.0
        if self.points_file:
            self.write_points(self.X)
        # Of a body of revolution the angle means nothing.
        places = self.X[:, [0, 2]] if hasattr(solution, "COORDINATES") else self.X
        rows = [{"X": list(X), "t": t} for X, t in zip(places, self.t)]
        out = call([mms, "eval", self.given, "--points", "-", "--json", "-"], input=json.dumps(rows).encode())
        rows = json.loads(out)["rows"]
        self.exact = {field: np.array([row[field] for row in rows], dtype=float) for field in FIELDS}
        self.exact["internal"] = np.array([[row["internal"][name] for name in self.variables] for row in rows]) if self.variables else None
        self.exact["rho0_b"] = self.density * self.exact["b"]
        self.exact["static_force"] = self.density * (self.exact["b"] - self.exact["a"])
        P, F, J = (self.exact[field] for field in "PFJ")
        # In plane or uniaxial stress volumes change along the directions left out as well.
        across = np.array([row.get("F_zz", 1.0) for row in rows]) ** (3 - self.dimension)
        self.exact["sigma"] = np.einsum("nik,njk->nij", P, F) / (J * across)[:, None, None]
        self.exact["S"] = np.linalg.solve(F, P)

    def generate(self, target, ending):
        points = ["--points", self.points_file] if self.points_file else []
        call([self.mms, "gen", self.given, "--target", target, "--out", self.folder, *points])
        return self.folder / (self.module + ending)

    def first_module(self):
        """The module for NumPy; where no table follows the fields, for points of which the measures of the body are not known yet."""
        try:
            return self.generate("numpy", "_numpy.py")
        except NeedsPoints:
            self.points_file = self.folder / "points.csv"
            self.write_points(np.full((1, 3), 0.7))
            return self.generate("numpy", "_numpy.py")

    def write_points(self, X):
        if self.of_revolution:
            names, X = "RZ", X[:, [0, 2]]
        else:
            names = "XYZ"[: X.shape[1]]
        rows = [",".join(names), *(",".join(repr(float(x)) for x in row) for row in X)]
        self.points_file.write_text("\n".join(rows) + "\n")

    @property
    def table(self):
        return self.folder / f"{self.module}.table"

    @property
    def all_fields(self):
        return {**ALL, "internal": len(self.variables)} if self.variables else ALL

    @property
    def fields(self):
        """The fields of drivers, with their ranks, and with the internal variables if there are some."""
        return {**FIELDS, "internal": len(self.variables)} if self.variables else FIELDS

    def points(self, solution):
        random = np.random.default_rng(20)
        shares = random.random((POINTS, self.dimension))
        if hasattr(solution, "COORDINATES"):
            lower = np.array([solution.inner(), 0.0, solution.lower()])
            upper = np.array([solution.outer(), 2.0 * np.pi, solution.upper()])
            X = lower + shares * (upper - lower)
            if self.points_file:
                X[:, 1] = 0.0
        elif hasattr(solution, "lower") and hasattr(solution, "inner"):
            ends = [solution.first_angle(), solution.last_angle()] if hasattr(solution, "first_angle") else [0.0, 2.0 * np.pi]
            lower = np.array([solution.inner(), ends[0], solution.lower()])
            upper = np.array([solution.outer(), ends[1], solution.upper()])
            radius, angle, height = (lower + shares * (upper - lower)).T
            X = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=-1)
        elif hasattr(solution, "lower"):
            lower, upper = np.array(solution.lower()), np.array(solution.upper())
            X = lower + shares * (upper - lower)
        else:
            radius = solution.inner() + shares[:, :1] * (solution.outer() - solution.inner())
            directions = random.normal(size=(POINTS, self.dimension))
            X = radius * directions / np.linalg.norm(directions, axis=1)[:, None]
        period = solution.period()
        share = random.random(POINTS)
        if getattr(solution, "INTERNAL", []):
            # Right after the start `mms eval` has no history of some stated laws, whose rates are nothing but rounding there.
            share = 0.01 + 0.99 * share
        return X, share * (period if math.isfinite(period) else 1.0)

    def compare(self, found):
        """The largest difference over the fields that were found, in units of 2^-52 of the largest entry."""
        worst = 0.0
        for field, values in found.items():
            exact = self.exact[field]
            values = np.asarray(values, dtype=float).reshape(exact.shape)
            if not np.array_equal(np.isnan(values), np.isnan(exact)):
                return math.inf
            size = np.max(np.abs(exact))
            if field == "static_force":
                # A difference of two forces.
                size = max(size, np.max(np.abs(self.density * self.exact["a"])))
            scale = size * 2.0**-52
            largest = np.max(np.abs(values - exact))
            if self.variables and field in OF_TABLE:
                self.compare_tabulated(field, values, exact, size)
            elif field in ("sigma", "S"):
                # From other results, in an order of the host's own; F may be far from the identity.
                assert largest <= 1e-11 * np.max(np.abs(exact)), f"{self.name}: {field} is off by {largest}"
            elif largest > 0:
                worst = max(worst, largest / scale if scale > 0 else math.inf)
        return worst

    def compare_tabulated(self, field, values, exact, size):
        """Fields of the table, each internal variable beside the largest entry of its tensor."""
        if field == "internal":
            stem = lambda name: re.sub(r"(?<=\D)[123]{2}$", "", name)
            size = np.array([max(np.max(np.abs(exact[:, k])) for k, other in enumerate(self.variables) if stem(other) == stem(name))
                             for name in self.variables])
        size = np.where(size == 0, 1.0, size)
        self.worst_of_table = max(self.worst_of_table, np.max(np.abs(values - exact) / size))
        allowed = max(1e-12, self.told())
        assert self.worst_of_table <= allowed, f"{self.name}: {field} of the table is off by {self.worst_of_table} of its largest entry"

    def told(self):
        """The error that a table tells of itself; a host that is given points has none."""
        line = re.search(r"^error (\S+)$", self.table.read_text(), re.MULTILINE) if self.table.exists() else None
        told = float(line[1]) if line else 0.0
        assert told <= 1e-11, f"{self.name}: the table tells an error of {told}"
        return told

    def packed(self):
        """How many points there are, then each position and time, for drivers."""
        return np.concatenate([[POINTS], np.column_stack([self.X, self.t]).ravel()])

    def unpacked(self, flat, fields):
        """Fields from one row a point."""
        flat = np.frombuffer(flat, dtype=float).reshape(POINTS, -1)
        found, at = {}, 0
        for field, rank in fields.items():
            size = rank if field == "internal" else self.dimension**rank
            found[field], at = flat[:, at : at + size], at + size
        assert at == flat.shape[1], f"{self.name}: {flat.shape[1]} values a point, not {at}"
        return found


# Solutions whose C++ is also called with dual numbers.
DUALS = ("skew-2d", "ring", "sphere-shell", "tube-hencky", "skew-2d-ogden", "front-positive-part")
ALL = {**FIELDS, "rho0_b": 1, "static_force": 1, "sigma": 2, "S": 2}
# What a file takes from its table, and what it forms from that.
OF_TABLE = ("P", "b", "internal", "rho0_b", "static_force")


def c(case):
    header = case.generate("c", ".h")
    strict = ["-std=c99", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    defined = [f'-DHEADER="{header}"', f"-DNAME={case.module}"]
    if case.variables:
        parameter = re.search(r"(?m)^    p\.(\w+) = [^0]", header.read_text())[1]
        defined += [f'-DTABLE="{case.table}"', f"-DINTERNAL={len(case.variables)}", f"-DOTHER={parameter}"]
        defined += [] if case.points_file else ["-DSERIES"]
    program = case.folder / "c"
    call(["gcc", *strict, *defined, HERE / "fields.c", "-o", program, "-lm"])
    return case.unpacked(call([program], input=case.packed().tobytes()), case.fields)


def cpp(case):
    header = case.generate("cpp", ".hpp")
    duals = ["-DDUALS"] if case.name in DUALS else []
    strict = ["-std=c++17", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Wpedantic", "-Werror", *duals]
    program = case.folder / "cpp"
    space = re.search(r"namespace (\w+) \{\n\nusing", header.read_text())[1]
    tables = [f'-DTABLE="{case.table}"'] if case.variables else []
    call(["g++", *strict, *tables, f'-DHEADER="{header}"', f"-DSPACE=mms::{space}", HERE / "fields.cc", "-o", program])
    return case.unpacked(call([program], input=case.packed().tobytes()), case.all_fields)


def cuda(case):
    """On a graphics processor. Of the functions of <math.h> it has its own last bits."""
    header = case.generate("c", ".h")
    program = case.folder / "cuda"
    strict = ["-std=c++17", "-fmad=false", "-Werror", "all-warnings", "-Xcompiler", "-Wall,-Wextra"]
    call(["nvcc", *strict, f'-DHEADER="{header}"', f"-DNAME={case.module}", HERE / "fields.cu", "-o", program])
    return case.unpacked(call([program], input=case.packed().tobytes()), FIELDS)


def fortran_program(case, source, driver, points):
    """The values that a driver writes that is compiled with a generated file."""
    place = source.parent / source.stem
    place.mkdir(exist_ok=True)
    module = re.search(r"(?m)^module (\w+)$", source.read_text())[1]
    text = (HERE / driver).read_text().replace("MODULE", module).replace("DIMENSION", str(case.dimension))
    if case.variables:
        # The lines for tables, which other files do not have.
        text = re.sub(r"(?m)^( *)!TABLE ", r"\1", text).replace("TABLE_FILE", case.table.name)
        (place / case.table.name).write_text(case.table.read_text())
    (place / "driver.f90").write_text(text)
    strict = ["-std=f2008", "-O1", "-ffp-contract=off", "-Wall", "-Wno-unused-dummy-argument", "-Wno-unused-function", "-Werror"]
    call(["gfortran", *strict, source, "driver.f90", "-o", "program"], cwd=place)
    points.tofile(place / "points.bin")
    call(["./program"], cwd=place)
    return (place / "values.bin").read_bytes()


def fortran(case):
    return case.unpacked(fortran_program(case, case.generate("fortran", ".f90"), "fields.f90", case.packed()), case.all_fields)


def abaqus(case):
    """The user subroutines, from current coordinates over a period."""
    source = case.generate("abaqus", "_abaqus.f90")
    x = case.X + case.exact["u"]
    points = np.concatenate([[POINTS, case.dimension], np.column_stack([x, case.t]).ravel()])
    flat = fortran_program(case, source, "abaqus.f90", points)
    found = np.frombuffer(flat, dtype=float).reshape(POINTS, 2, case.dimension)
    scale = np.max(np.abs(case.exact["rho0_b"]))
    largest = np.max(np.abs(found - case.exact["rho0_b"][:, None, :]))
    print(f"abaqus   {case.name:18} b(X) from x = X + u: {largest / scale if scale else largest:.1e} of the largest")
    if not largest <= 1e-12 * scale:
        raise SystemExit(f"abaqus: {case.name}: the force at current positions is off by {largest}")
    return {}


def calculix(case):
    return case.unpacked(fortran_program(case, case.generate("calculix", "_calculix.f90"), "calculix.f90", case.packed()), {"rho0_b": 1})


def rust(case):
    """A crate of its own that depends on the run time of solutions; all cases share what is compiled."""
    source = case.generate("rust", ".rs")
    place = case.folder / "rust"
    (place / "src").mkdir(parents=True, exist_ok=True)
    text = source.read_text()
    (place / "src" / "solution.rs").write_text(text)
    name = re.search(r"pub struct (\w+)<T: [:\w]+> \{\s+parameters", text)[1]
    driver = (HERE / "fields.rs").read_text().replace("DIMENSION", str(case.dimension)).replace("SOLUTION", name)
    if case.variables:
        driver = driver.replace("//TABLE ", "").replace("TABLE_FILE", case.table.name)
        (place / case.table.name).write_text(case.table.read_text())
    (place / "src" / "main.rs").write_text("#![allow(non_snake_case, unused)]\n" + driver.replace("//! ", "// "))
    runtime = HERE.parents[1] / "crates" / "runtime"
    (place / "Cargo.toml").write_text(
        f'[package]\nname = "host"\nversion = "0.1.0"\nedition = "2024"\n[dependencies]\nmmsmith-runtime = {{ path = "{runtime}" }}\n[workspace]\n')
    environment = {**os.environ, "CARGO_TARGET_DIR": str(case.folder.parent / "rust-target")}
    flat = call(["cargo", "run", "--quiet", "--offline"], cwd=place, env=environment, input=case.packed().tobytes())
    return case.unpacked(flat, {**case.fields, "rho0_b": 1})


def python_fields(solution, X, t):
    fields = [*ALL, "internal"] if getattr(solution, "INTERNAL", []) else ALL
    return {field: getattr(solution, field)(X, t) for field in fields}


def python_table(case, solution):
    """Series of points have the same values, single variables too; after the end there are none; other tables are refused."""
    if not case.variables:
        return
    points = solution.points(case.X)
    for field in ("b", "P", "internal"):
        one, other = np.asarray(getattr(points, field)(case.t)), np.asarray(getattr(solution, field)(case.X, case.t))
        assert np.allclose(one, other, rtol=0, atol=1e-12 * np.max(np.abs(other))), f"{case.name}: {field} of points"
    last = np.asarray(getattr(solution, f"internal_{case.variables[-1]}")(case.X, case.t))
    assert np.array_equal(last, np.asarray(solution.internal(case.X, case.t))[..., -1])
    with np.errstate(all="ignore"):
        assert np.all(np.isnan(np.asarray(solution.b(case.X, 1.001 * solution.table.end))))
    try:
        type(solution)(**{name: 1.5 * value for name, value in solution.DEFAULTS.items() if value})
    except ValueError as error:
        assert "--set" in str(error) or "must" in str(error), error
    else:
        raise SystemExit(f"{case.name}: values of parameters that the table does not have")


def numpy(case):
    solution = loaded(case.generate("numpy", "_numpy.py")).Solution()
    with np.errstate(all="raise", under="ignore"):
        found = python_fields(solution, case.X, case.t)
    python_table(case, solution)
    return found


def jax(case):
    import jax

    jax.config.update("jax_enable_x64", True)
    solution = loaded(case.generate("jax", "_jax.py")).Solution()
    found = python_fields(solution, case.X, case.t)
    python_table(case, solution)
    if case.points_file:
        return found
    # What JAX differentiates: u gives H, and -Div P gives b.
    gradient = jax.vmap(jax.jacfwd(solution.u))(case.X[:50], case.t[:50])
    assert np.allclose(gradient, case.exact["H"][:50], rtol=0, atol=1e-12), f"{case.name}: jacfwd(u) is not H"
    slope = jax.vmap(jax.jacfwd(solution.P))(case.X[:50], case.t[:50])
    balance = (case.density * case.exact["a"])[:50] - np.einsum("nijj->ni", slope)
    scale = np.max(np.abs(case.exact["rho0_b"])) + np.max(np.abs(case.density * case.exact["a"]))
    assert np.allclose(balance, case.exact["rho0_b"][:50], rtol=0, atol=1e-10 * scale), f"{case.name}: jacfwd(P) is not balanced by b"
    return found


def ufl(case):
    import basix.ufl
    import ufl as language

    solution = loaded(case.generate("ufl", "_ufl.py")).Solution()
    cell = {1: "interval", 2: "triangle", 3: "tetrahedron"}[case.dimension]
    mesh = language.Mesh(basix.ufl.element("Lagrange", cell, 1, shape=(case.dimension,)))
    X, t = language.SpatialCoordinate(mesh), language.Constant(mesh)
    found = {}
    for field, expression in python_fields(solution, X, t).items():
        found[field] = np.array(ufl_value(expression, case.X, case.t))
        if found[field].ndim == 1:
            found[field] = np.broadcast_to(found[field], (POINTS,))
        else:
            found[field] = np.moveaxis(found[field], -1, 0)
    compiled_ufl(case, solution, mesh, X, t)
    return found


def compiled_ufl(case, solution, mesh, X, t):
    """u, P and b at one time by the C code that FEniCSx's form compiler makes, on a cell around the body."""
    import cffi
    from ffcx.codegeneration.jit import compile_expressions

    corner, time = case.X.min(axis=0), case.t[0]
    size = 1.001 * np.sum(case.X.max(axis=0) - corner)
    vertices = np.zeros((case.dimension + 1, 3))
    vertices[:, : case.dimension] = corner + size * np.vstack([np.zeros(case.dimension), np.eye(case.dimension)])
    shares = (case.X - corner) / size
    ffi = cffi.FFI()
    pointer = lambda array: ffi.cast("double *", array.ctypes.data)

    def values(expression, count):
        (compiled,), *_ = compile_expressions([(expression, shares)], cffi_extra_compile_args=["-O1"])
        out = np.zeros(POINTS * count)
        compiled.tabulate_tensor_float64(pointer(out), ffi.NULL, pointer(np.array([time])), pointer(vertices), ffi.NULL, ffi.NULL, ffi.NULL)
        return out.reshape(POINTS, count)

    # The positions that the code sees, to the last bit.
    rows = [{"X": list(position), "t": time} for position in values(X, case.dimension)]
    out = call([case.mms, "eval", case.given, "--points", "-", "--json", "-"], input=json.dumps(rows).encode())
    rows = json.loads(out)["rows"]
    for field in ("u", "P", "b"):
        exact = np.array([row[field] for row in rows], dtype=float).reshape(POINTS, -1)
        found = values(getattr(solution, field)(X, t), exact.shape[1])
        units = np.max(np.abs(found - exact)) / max(np.max(np.abs(exact)), np.max(np.abs(case.exact[field]))) * 2.0**52 if np.any(exact) else 0.0
        assert units <= LARGEST["ufl"], f"ufl: {case.name}: {field} by FFCx is off by {units} units"


def ufl_value(expression, X, t):
    """An expression of UFL at points, each node of its graph once; components first, points last."""
    from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
    from ufl.corealg.traversal import unique_post_traversal

    expression = apply_algebra_lowering(expression)
    functions = {
        "sqrt": np.sqrt, "sin": np.sin, "cos": np.cos, "tan": np.tan, "exp": np.exp, "ln": np.log, "atan": np.arctan, "asin": np.arcsin,
        "acos": np.arccos, "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "erf": np.vectorize(math.erf, otypes=[float]),
    }
    pairs = {"LT": np.less, "LE": np.less_equal, "EQ": np.equal, "Division": np.divide, "Power": np.power, "Product": np.multiply}
    indices = {}

    def evaluated(node, fixed):
        key = (node, tuple(sorted((i, v) for i, v in fixed.items())) if node.ufl_free_indices or fixed else ())
        if key in indices:
            return indices[key]
        kind, parts = type(node).__name__, node.ufl_operands
        if kind == "SpatialCoordinate":
            value = list(X.T)
        elif kind == "Constant":
            value = t
        elif kind in ("IntValue", "FloatValue", "Zero", "ScalarValue"):
            value = np.zeros(node.ufl_shape + (len(t),)) if kind == "Zero" else np.full(len(t), float(node._value))
        elif kind == "Indexed":
            place = [fixed[int(i.count())] if not hasattr(i, "_value") else int(i) for i in parts[1].indices()]
            value = evaluated(parts[0], {})
            for i in place:
                value = value[i]
        elif kind == "ListTensor":
            value = [evaluated(part, fixed) for part in parts]
        elif kind == "ComponentTensor":
            names = [int(i.count()) for i in parts[1].indices()]
            value = np.empty(node.ufl_shape, dtype=object)
            for place in np.ndindex(node.ufl_shape):
                value[place] = evaluated(parts[0], {**fixed, **dict(zip(names, place))})
            value = value.tolist()
        elif kind == "IndexSum":
            name, size = int(parts[1].indices()[0].count()), node.dimension()
            value = sum(evaluated(parts[0], {**fixed, name: k}) for k in range(size))
        elif kind == "Conditional":
            condition, first, other = (evaluated(part, fixed) for part in parts)
            value = np.where(condition, first, other)
        elif kind == "Sum":
            value = evaluated(parts[0], fixed) + evaluated(parts[1], fixed)
        elif kind == "Abs":
            value = np.abs(evaluated(parts[0], fixed))
        elif kind == "Sign":
            value = np.sign(evaluated(parts[0], fixed))
        elif kind == "Atan2":
            value = np.arctan2(evaluated(parts[0], fixed), evaluated(parts[1], fixed))
        elif kind in pairs:
            value = pairs[kind](evaluated(parts[0], fixed), evaluated(parts[1], fixed))
        else:
            value = functions[node._name](evaluated(parts[0], fixed))
        indices[key] = value
        return value

    sys.setrecursionlimit(100_000)
    with np.errstate(all="ignore"):
        # From the leaves on, so that no recursion is deep.
        for node in unique_post_traversal(expression):
            if type(node).__name__ not in ("MultiIndex", "Label") and not node.ufl_free_indices:
                evaluated(node, {})
        return evaluated(expression, {})


def moose(case):
    text = case.generate("moose", ".i").read_text()
    blocks = dict(re.findall(r"\[(mms_\w+)\]\s+type = ParsedFunction\s+expression = '([^']*)'", text))
    prefix = f"mms_{case.module}_"
    names = []
    for field, rank in ALL.items():
        places = np.ndindex((case.dimension,) * rank)
        names += [prefix + field + ("_" if rank else "") + "".join(str(i) for i in place) for place in places]
    (case.folder / "expressions.txt").write_text("".join(" ".join(blocks[name].split()) + "\n" for name in names))
    program = case.folder.parent / "expressions"
    points = np.zeros((POINTS, 4))
    points[:, : case.dimension], points[:, 3] = case.X, case.t
    environment = {**os.environ, "LD_LIBRARY_PATH": os.environ.get("FPARSER_LIB", "")}
    flat = call([program, case.folder / "expressions.txt"], input=points.tobytes(), env=environment)
    assert f"function = {prefix}rho0_b_0" in text
    return case.unpacked(flat, ALL)


def moose_program(folder):
    extra = os.environ.get("FPARSER", "").split()
    call(["g++", "-O1", *extra[:1], HERE / "expressions.cc", "-o", folder / "expressions", *extra[1:], "-lfparser"])


def kratos(case):
    import KratosMultiphysics

    given = json.loads(case.generate("kratos", "_kratos.json").read_text())
    found = {}
    for field in ALL:
        functions = [KratosMultiphysics.GenericFunctionUtility(text) for text in given[field]]
        columns = []
        for X, t in zip(case.X, case.t):
            X = list(X) + [0.0] * (3 - case.dimension)
            columns.append([function.CallFunction(0.0, 0.0, 0.0, t, *X) for function in functions])
        found[field] = columns
    return found


def febio(case):
    """By the program that the variable FEBIO_EVALUATOR names, febio.cc with FEBio's library. Without it the XML is read, and expressions
    with operators and functions of FEBio alone are evaluated as it would."""
    root = xml.etree.ElementTree.parse(case.generate("febio", "_febio.xml")).getroot()
    known = {name: getattr(np, "arc" + name[1:], None) if name[0] == "a" else getattr(np, name, None)
             for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "sqrt")}
    known |= {"ln": np.log, "atan2": np.arctan2, "abs": np.abs, "erf": np.vectorize(math.erf), "t": case.t}
    known |= {axis: case.X[:, i] for i, axis in enumerate("XYZ"[: case.dimension])}

    def value(text):
        words = set(re.findall(r"(?<![\w.])[A-Za-z]\w*", text))
        assert words <= set(known) and not re.search(r"[^\w\s.+\-*/^(),]", text), f"{case.name}: {words - set(known)}"
        return np.broadcast_to(eval(text.replace("^", "**"), {"__builtins__": {}}, known), (POINTS,))

    if "FEBIO_EVALUATOR" in os.environ:
        expressions = case.folder / "febio.txt"
        expressions.write_text("".join(entry.text + "\n" for field in ALL for entry in root.findall(f"field[@name='{field}']/entry")))
        points = np.zeros((POINTS, 4))
        points[:, : case.dimension], points[:, 3] = case.X, case.t
        return case.unpacked(call([os.environ["FEBIO_EVALUATOR"], expressions], input=points.tobytes()), ALL)

    found = {}
    for field in ALL:
        entries = root.findall(f"field[@name='{field}']/entry")
        found[field] = np.column_stack([value(entry.text) for entry in entries])
    # FEBio ends a component at a comma outside of parentheses.
    components, depth = [""], 0
    for letter in root.find("body_load/force").text:
        depth += {"(": 1, ")": -1}.get(letter, 0)
        if letter == "," and depth == 0:
            components.append("")
        else:
            components[-1] += letter
    assert len(components) == 3, case.name
    minus_b = [value(text) for text in components[: case.dimension]]
    assert np.array_equal(np.column_stack(minus_b), -found["b"]), f"{case.name}: the load is not -b"
    return found


def julia(case):
    """In the Julia that the variable JULIA names, a command; without it the syntax alone, by a parser."""
    text = case.generate("julia", ".jl").read_bytes()
    if "JULIA" in os.environ:
        module = re.search(rb"(?m)^module (\w+)$", text)[1].decode()
        numbers = " ".join(repr(number) for number in np.column_stack([case.X, case.t]).ravel().tolist())
        ALL = case.all_fields
        # The chroot of .ci/real-hosts has the table in its own /tmp.
        table = Path(os.environ.get("JULIA_ROOT", "/")) / "tmp" / case.table.name
        if case.variables:
            table.write_text(case.table.read_text())
            text = text.replace(b"Ref(joinpath(@__DIR__, ", b"Ref(joinpath(\"/tmp\", ")
        driver = f"""
            using .{module}: {", ".join(ALL)}
            s = {module}.Solution()
            flat(value) = value isa Number ? [value] : reduce(vcat, map(flat, collect(value)))
            points = reshape(parse.(Float64, split("{numbers}")), {case.dimension + 1}, :)
            for k in 1:size(points, 2)
                X, t = Tuple(points[1:{case.dimension}, k]), points[end, k]
                for field in ({", ".join(ALL)},)
                    write(stdout, Float64.(flat(field(s, X, t))))
                end
            end
            """
        return case.unpacked(call([*os.environ["JULIA"].split(), "-e", "include_string(Main, read(stdin, String))"], input=text + driver.encode()), ALL)
    import tree_sitter
    import tree_sitter_julia

    tree = tree_sitter.Parser(tree_sitter.Language(tree_sitter_julia.language())).parse(text)
    assert not tree.root_node.has_error, f"{case.name}: no Julia"
    functions = set(re.findall(rb"(?m)^function (\w+)\(s, X, t\)", text))
    assert functions >= {field.encode() for field in FIELDS}, f"{case.name}: {functions}"
    return {}


def openfoam(case):
    """The code of the fragments, compiled and run with the few names of OpenFOAM that it calls."""
    case.generate("c", ".h")
    text = case.generate("openfoam", "_openfoam").read_text()
    source, motion = (re.search(rf"(?s)\n    {name}\n    #\{{\n(.*?)\n    #\}};", text)[1] for name in ("codeAddSup", "code"))
    program = case.folder / "openfoam"
    code = (HERE / "openfoam.cc").read_text().replace("HEADER", f"{case.module}.h").replace("ADD_SUP", source).replace("MOTION", motion)
    (case.folder / "openfoam.cc").write_text(code)
    call(["g++", "-std=c++14", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", case.folder / "openfoam.cc", "-o", program])
    points = np.zeros((POINTS, 4))
    points[:, : case.dimension], points[:, 3] = case.X, case.t
    (case.folder / "mms").mkdir(exist_ok=True)
    if case.variables:
        (case.folder / "mms" / case.table.name).write_text(case.table.read_text())
    flat = call([program], input=points.tobytes(), env={**os.environ, "FOAM_CASE": str(case.folder)})
    flat = np.frombuffer(flat, dtype=float).reshape(POINTS, 2, 3)[:, :, : case.dimension]
    # The cells of this host have the volume one half.
    source = -0.5 * case.exact["rho0_b"]
    allowed = 1e-12 * np.max(np.abs(source)) if case.variables else 0.0
    assert np.max(np.abs(flat[:, 0] - source)) <= allowed, f"{case.name}: the source"
    assert np.array_equal(flat[:, 1], case.exact["u"]), f"{case.name}: the motion"
    return {}


def tried(run):
    """The same, with nothing where the host has no words for the solution."""

    def of_case(case):
        try:
            return run(case)
        except Refused:
            return None

    return of_case


def main():
    arguments = sys.argv[1:]
    mms, folder = Path(arguments[0]).resolve(), Path(arguments[1]).resolve()
    hosts = arguments[2:]
    names = sorted(path.stem for path in SPECS.glob("*.toml"))
    if hosts[0] == "--solutions":
        names, hosts = hosts[1].split(","), hosts[2:]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        cases = list(pool.map(lambda name: Case(mms, folder, name), names))
        failed = False
        for host in hosts:
            if host == "moose":
                moose_program(folder)
            run = tried(globals()[host])
            chosen = cases
            compiled = host in ("c", "cpp", "cuda", "fortran", "openfoam", "abaqus", "calculix", "moose")
            results = list((pool.map if compiled else map)(run, chosen))
            refused = [case.name for case, found in zip(chosen, results) if found is None]
            chosen, results = [c for c, f in zip(chosen, results) if f is not None], [f for f in results if f is not None]
            if refused:
                print(f"{host:9}refuses {len(refused)} solutions: {' '.join(refused)}")
            if not chosen:
                continue
            if not any(results):
                print(f"{host:9}{len(chosen)} solutions")
                continue
            worst = {case.name: case.compare(found) for case, found in zip(chosen, results)}
            name = max(worst, key=lambda name: worst[name])
            of_tables = {case.name: case.worst_of_table for case in chosen if case.variables}
            if of_tables:
                print(f"{host:9}of tables: " + " ".join(f"{name} {value:.1e}" for name, value in of_tables.items()))
            same = sum(1 for value in worst.values() if value == 0)
            print(f"{host:9}{len(chosen)} solutions, {POINTS} points each: {same} to the bit; largest difference {worst[name]:.3g} units ({name})")
            for case in chosen:
                # The Rust functions have these of another library.
                allowed = LARGEST[host] + (2 if case.calls_library else 0)
                if not worst[case.name] <= allowed:
                    failed = True
                    print(f"{host}: {case.name}: {worst[case.name]} units of 2^-52 of the largest entry, more than {allowed}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
