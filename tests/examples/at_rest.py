"""What tests of solvers at rest share: solutions by their NumPy files, and a block of bricks for programs that read an input file."""

import importlib.util
import itertools
import subprocess
from pathlib import Path

import numpy

# Corners and middles of edges, in halves of the edge, as Abaqus, CalculiX and FEBio count them.
NODES = [
    (0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2),
    (1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2),
    (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1),
]  # fmt: skip


class Block:
    """The unit cube in `cells` bricks an edge, of 8 or 20 nodes: places X, elements as numbers from 1 on, which nodes are outside."""

    def __init__(self, cells, nodes):
        numbers, self.elements = {}, []
        for cell in itertools.product(range(cells), repeat=3):
            places = [tuple(2 * c + n for c, n in zip(cell, node)) for node in NODES[:nodes]]
            self.elements.append([numbers.setdefault(place, len(numbers) + 1) for place in places])
        self.X = numpy.array(list(numbers)) / (2 * cells)
        self.outside = numpy.any((self.X == 0.0) | (self.X == 1.0), axis=1)

    def error(self, found, u):
        """The mean-square error of the nodes inside."""
        return numpy.sqrt(numpy.mean((found - u)[~self.outside] ** 2))


def generate(mms, specification, target, folder):
    subprocess.run([mms, "gen", specification, "--target", target, "--out", folder], check=True, stdout=subprocess.DEVNULL)


def solution(mms, specification, folder):
    """The solution of a specification by its NumPy file."""
    generate(mms, specification, "numpy", folder)
    name = Path(specification).stem.replace("-", "_")
    spec = importlib.util.spec_from_file_location(name, Path(folder) / f"{name}_numpy.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Solution()


def moduli(exact):
    """Young's modulus and Poisson's ratio."""
    lam, mu = exact.lambda_(), exact.mu()
    return mu * (3 * lam + 2 * mu) / (lam + mu), lam / (2 * (lam + mu))


def judge(what, errors, is_right, expected):
    """Prints errors and the order of the last pair; whether it is right, as expected or not."""
    order = numpy.log2(errors[-2] / errors[-1])
    passed = is_right(order) == expected
    told = ", ".join(f"{error:.3e}" for error in errors)
    print(f"{'passed' if passed else 'FAILED'}: {what}: order {order:.3f}, errors {told}")
    return passed
