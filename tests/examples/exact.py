"""What drivers of other solvers share: the fields of a solution of the library, and the files that `mms score` reads.

Of mmsmith only the generated C header is used: for the body force, the constants and the start.
"""

import ctypes
import os
import subprocess
import tempfile
from pathlib import Path

import meshio
import numpy

HERE = Path(__file__).parent


class Exact:
    """The generated header of a plane neo-Hookean solution with an amplitude A, compiled; of the library, or a specification."""

    def __init__(self, name, amplitude, source=None):
        with tempfile.TemporaryDirectory() as folder:
            library = Path(folder) / "exact.so"
            # The command on the path, or the one that the variable MMS names.
            gen = [os.environ.get("MMS", "mms"), "gen", str(source or name), "--target", "c"]
            gen += ["--out", str(Path(folder) / "mmsmith")]
            subprocess.run(gen, check=True, stdout=subprocess.DEVNULL)
            flags = ["-O2", "-shared", "-fPIC", "-ffp-contract=off", f"-I{folder}"]
            c_name = name.replace("-", "_")
            names = [f'-DHEADER="mmsmith/{c_name}.h"', f"-DNAME={c_name}"]
            compiler = os.environ.get("CC", "cc")
            subprocess.run([compiler, *flags, *names, HERE / "exact.c", "-o", library, "-lm"], check=True)
            self.library = ctypes.CDLL(str(library))
        self.library.prepare.restype = ctypes.c_char_p
        self.library.point_count.restype = ctypes.c_size_t
        message = self.library.prepare(ctypes.c_double(amplitude))
        if message:
            raise ValueError(message.decode())
        constants = numpy.empty(5)
        self.library.constants(pointer(constants))
        self.rho0, self.period, self.speed, self.E, self.nu = map(float, constants)
        self.name = name
        self.parameters = {"A": amplitude, "E": self.E, "nu": self.nu, "rho0": self.rho0}

    def start(self, X):
        """u, v and a of shape (n, 2), F of shape (n, 2, 2), at time zero."""
        u, v, a, F = numpy.empty_like(X), numpy.empty_like(X), numpy.empty_like(X), numpy.empty((len(X), 2, 2))
        self.library.start(ctypes.c_size_t(len(X)), pointer(X), *map(pointer, (u, v, a, F)))
        return u, v, a, F

    def body_force(self, X):
        """b at fixed positions X of shape (n, 2), as a function of time."""
        count = ctypes.c_size_t(len(X))
        kept = numpy.empty((self.library.point_count(), len(X)))
        self.library.points(count, pointer(X), pointer(kept))
        b = numpy.empty_like(X)

        def at(t):
            self.library.body_force(ctypes.c_double(t), count, pointer(kept), pointer(b))
            return b

        return at


def pointer(array):
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


class Recording:
    """A .pvd list that grows with its frames, which tell the solution and its parameters."""

    def __init__(self, folder, name, solution, parameters):
        self.folder, self.name, self.listed = folder, name, []
        letters = " ".join(str(letter) for letter in solution.encode())
        array = '<DataArray type="{}" Name="{}" NumberOfTuples="{}" format="ascii">{}</DataArray>'
        self.provenance = array.format("UInt8", "solution", len(solution), letters)
        for parameter, value in parameters.items():
            self.provenance += array.format("Float64", f"parameter_{parameter}", 1, repr(float(value)))

    def write(self, t, points, arrays):
        file = f"{self.name}-{len(self.listed):04}.vtu"
        cells = [("vertex", numpy.arange(len(points))[:, None])]
        mesh = meshio.Mesh(padded(points), cells, point_data=arrays)
        mesh.write(self.folder / file, file_format="vtu", binary=True, compression="zlib")
        # meshio has no place for numbers of a whole file.
        text = (self.folder / file).read_text(encoding="ascii")
        grid = "<UnstructuredGrid>"
        assert text.count(grid) == 1
        text = text.replace(grid, f"{grid}<FieldData>{self.provenance}</FieldData>")
        (self.folder / file).write_text(text, encoding="ascii")
        self.listed.append(f'    <DataSet timestep="{t!r}" part="0" file="{file}"/>\n')
        text = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
        text += "  <Collection>\n" + "".join(self.listed) + "  </Collection>\n</VTKFile>\n"
        (self.folder / f"{self.name}.pvd").write_text(text, encoding="ascii")


def padded(rows):
    return numpy.column_stack([rows, numpy.zeros(len(rows))])
