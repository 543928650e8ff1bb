"""Compares a series of particle frames, bit for bit, with what its writer says it holds.

    python read_back.py SERIES.pvd REFERENCE.json

Every frame is read with meshio, with pyvista as a file of its own, and with pyvista through the .pvd file at the
frame's time. Compared are times, steps, cells, names, shapes, types and the bits of every number. The reference is

    { "frames": [ { "file": "name-000000.vtu", "time": t, "step": k, "points": [[x, y, z], ...],
                    "arrays": { "name": { "kind": "scalar|vector|tensor|id", "values": [...] } } } ] }

with numbers in a form that reads back exactly (the shortest one that does, for example).

Exit status: 0 where all agrees, 1 where anything differs or cannot be read, 2 for a wrong call.
"""

import json
import sys
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy
import pyvista

KINDS = {
    "scalar": (numpy.float64, ()),
    "vector": (numpy.float64, (3,)),
    "tensor": (numpy.float64, (9,)),
    "id": (numpy.uint64, ()),
}
VTK_VERTEX = 1


class Tally:
    """Counts comparisons and prints those that fail."""

    def __init__(self):
        self.passed = 0
        self.failed = 0

    def check(self, what, agrees, difference=""):
        if agrees:
            self.passed += 1
        else:
            self.failed += 1
            print(f"FAILED {what}: {difference}")

    def equal(self, what, found, expected):
        self.check(what, found == expected, f"found {found!r}, expected {expected!r}")

    def attempt(self, what, action):
        """The action's result, or None where it fails, which counts."""
        try:
            return action()
        # A reader reports a bad file by any exception, meshio even by SystemExit.
        except (Exception, SystemExit) as error:
            self.check(what, False, f"{type(error).__name__}: {error}")
            return None

    def same_bits(self, what, found, expected):
        """Compares type, shape and bits of two arrays."""
        if found is None:
            return self.check(what, False, "missing")
        found = numpy.asarray(found)
        if (found.dtype, found.shape) != (expected.dtype, expected.shape):
            difference = f"found {found.dtype}{found.shape}, expected {expected.dtype}{expected.shape}"
            return self.check(what, False, difference)
        differs = bits(found) != bits(expected)
        if not differs.any():
            return self.check(what, True)
        first = tuple(int(i) for i in numpy.argwhere(differs)[0])
        self.check(
            what,
            False,
            f"{differs.sum()} of {differs.size} values differ, the first at {first}: "
            f"found {found[first]!r}, expected {expected[first]!r}",
        )


def bits(array):
    return numpy.ascontiguousarray(array).view(numpy.uint64)


def compare(tally, label, frame, points, point_data, field_data):
    """Compares what one reader found in a frame with the reference."""
    expected_points = numpy.array(frame["points"], dtype=numpy.float64).reshape(-1, 3)
    tally.same_bits(f"{label}: points", points, expected_points)
    tally.equal(f"{label}: array names", sorted(point_data), sorted(frame["arrays"]))
    for name, array in frame["arrays"].items():
        dtype, tail = KINDS[array["kind"]]
        # Whole numbers go straight to uint64: on the way through a float they would lose bits.
        expected = numpy.array(array["values"], dtype=dtype).reshape((-1, *tail))
        tally.same_bits(f"{label}: {name}", point_data.get(name), expected)
    for name, value, dtype in [
        ("TimeValue", frame["time"], numpy.float64),
        ("Cycle", frame["step"], numpy.int64),
    ]:
        tally.same_bits(f"{label}: {name}", field_data.get(name), numpy.array([value], dtype=dtype))


def compare_meshio(tally, label, frame, path):
    mesh = tally.attempt(label, lambda: meshio.read(path))
    if mesh is None:
        return
    compare(tally, label, frame, mesh.points, mesh.point_data, mesh.field_data)
    cells = [(block.type, block.data.tolist()) for block in mesh.cells]
    vertices = [[particle] for particle in range(len(frame["points"]))]
    tally.check(f"{label}: cells", cells == [("vertex", vertices)], "not one vertex a particle")


def compare_pyvista(tally, label, frame, read):
    mesh = tally.attempt(label, read)
    if mesh is None:
        return
    compare(tally, label, frame, mesh.points, dict(mesh.point_data), dict(mesh.field_data))
    particles = len(frame["points"])
    tally.check(
        f"{label}: cells",
        mesh.celltypes.tolist() == [VTK_VERTEX] * particles
        and mesh.cell_connectivity.tolist() == list(range(particles)),
        "not one vertex a particle",
    )


def compare_series(tally, series, frames):
    """Compares the .pvd file's own text, then what pyvista makes of it."""
    root = tally.attempt(series.name, lambda: ElementTree.parse(series).getroot())
    if root is None:
        return
    listed = root.findall("./Collection/DataSet")
    tally.equal(
        f"{series.name}: files",
        [entry.get("file") for entry in listed],
        [frame["file"] for frame in frames],
    )
    times = numpy.array([frame["time"] for frame in frames], dtype=numpy.float64)
    texts = [entry.get("timestep") for entry in listed]
    found = tally.attempt(f"{series.name}: times", lambda: numpy.array(texts, dtype=numpy.float64))
    tally.same_bits(f"{series.name}: times", found, times)

    reader = tally.attempt(series.name, lambda: pyvista.get_reader(series))
    if reader is None:
        return
    found = numpy.array(reader.time_values, dtype=numpy.float64)
    tally.same_bits(f"{series.name}: times in pyvista", found, times)
    if len(found) != len(frames):
        return
    for point, frame in enumerate(frames):

        def read(point=point):
            reader.set_active_time_point(point)
            (mesh,) = reader.read()
            return mesh

        compare_pyvista(tally, f"{series.name} at time {frame['time']!r}: pyvista", frame, read)


def main(arguments):
    if len(arguments) != 2:
        print("usage: python read_back.py SERIES.pvd REFERENCE.json", file=sys.stderr)
        return 2
    series, reference = map(Path, arguments)
    try:
        frames = json.loads(reference.read_text(encoding="utf-8"))["frames"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        print(f"{reference}: no reference: {type(error).__name__}: {error}", file=sys.stderr)
        return 2

    tally = Tally()
    tally.check(str(reference), len(frames) > 0, "it holds no frames")
    for frame in frames:
        path = series.parent / frame["file"]
        compare_meshio(tally, f"{frame['file']}: meshio", frame, path)
        compare_pyvista(tally, f"{frame['file']}: pyvista", frame, lambda path=path: pyvista.read(path))
    compare_series(tally, series, frames)
    print(f"{tally.passed} passed, {tally.failed} failed")
    return 1 if tally.failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
