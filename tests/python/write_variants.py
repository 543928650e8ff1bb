"""Writes one small recording in every variant of the formats that `mms score` reads.

    python write_variants.py FOLDER

The recording is exact but for known errors: the ring of the library (`mms-specs/ring.toml`, default parameters, the density
1) at two times, on 6 points, with 1e-3 added to the displacement, 1e-2 to the velocity (x), 1e-4 to F[0][0] and 1 to P[1][1] of
the second frame. The files in `ok` were written by meshio, VTK (as ParaView writes) and pyvista. In each folder of `err`
is damaged or senseless input, in each of `findings` one with something to be told; their `call.txt` holds the arguments
of `mms score ring --set rho0=1` and, line by line, what it must say.
"""

import base64
import re
import struct
import sys
import zlib
from pathlib import Path

import meshio
import numpy
import pyvista
import vtk

E, A, RI, RO = 1.0e4, 0.1, 0.5, 1.0
C = numpy.sqrt(E)
TIMES = [0.0, 0.004]


def ring(X, t):
    """u, v, F, P at reference positions X, row by row."""
    R = numpy.linalg.norm(X, axis=1)
    d = RO**2 * (3 * RI - RO)
    T, dT = A * numpy.cos(C * numpy.pi * t), -A * C * numpy.pi * numpy.sin(C * numpy.pi * t)
    g = (1 + (RO - R) ** 2 * (2 * R + RO - 3 * RI) / d)
    slope = 6 * (R - RI) * (R - RO) / d
    N = X / R[:, None]
    u = (T * g)[:, None] * N
    v = (dT * g)[:, None] * N
    NN = N[:, :, None] * N[:, None, :]
    F = numpy.eye(2) + (T * slope)[:, None, None] * NN + (T * g / R)[:, None, None] * (numpy.eye(2) - NN)
    P = E / 2 * (F - numpy.linalg.inv(F).transpose(0, 2, 1))
    return u, v, F, P


def points():
    radii, angles = numpy.meshgrid(numpy.linspace(0.6, 0.9, 2), numpy.linspace(0.2, 1.3, 3))
    return numpy.stack([radii.ravel() * numpy.cos(angles.ravel()), radii.ravel() * numpy.sin(angles.ravel())], 1)


def padded(vectors):
    return numpy.hstack([vectors, numpy.zeros((len(vectors), 1))])


def tensor(matrices, last):
    full = numpy.zeros((len(matrices), 3, 3))
    full[:, :2, :2] = matrices
    full[:, 2, 2] = last
    return full.reshape(-1, 9)


def frames():
    """Positions and arrays at each time."""
    X = points()
    for index, t in enumerate(TIMES):
        u, v, F, P = ring(X, t)
        if index == 1:
            u = u + [1e-3, 0]
            v = v + [1e-2, 0]
            F = F + [[1e-4, 0], [0, 0]]
            P = P + [[0, 0], [0, 1]]
        arrays = {
            "displacement": padded(u),
            "velocity": padded(v),
            "F": tensor(F, 1),
            "P": tensor(P, 0),
            "reference_position": padded(X),
            "id": numpy.arange(len(X), dtype=numpy.int64) * 3 + 7,
        }
        yield t, padded(X + u), arrays


def grid(x, arrays, t=None):
    cells = numpy.hstack([numpy.ones((len(x), 1), int), numpy.arange(len(x))[:, None]]).ravel()
    mesh = pyvista.UnstructuredGrid(cells, numpy.full(len(x), 1, numpy.uint8), x)
    for name, values in arrays.items():
        mesh.point_data[name] = values
    if t is not None:
        mesh.field_data["TimeValue"] = numpy.array([t])
    return mesh


def pvd(folder, name, files):
    lines = "".join(
        f'<DataSet timestep="{t!r}" group="" part="0" file="{file}"/>\n' for t, file in zip(TIMES, files)
    )
    text = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
    (folder / name).write_text(f"{text}{lines}</Collection>\n</VTKFile>\n", encoding="ascii")


def write_vtk_xml(folder, name, mode, compressed, header, appended_base64=False, big=False):
    """As ParaView writes: through VTK's own writer."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, (t, x, arrays) in enumerate(frames()):
        writer = vtk.vtkXMLUnstructuredGridWriter()
        writer.SetFileName(str(folder / f"{name}_{number}.vtu"))
        writer.SetInputData(grid(x, arrays, t))
        writer.SetDataMode(mode)
        writer.SetEncodeAppendedData(appended_base64)
        writer.SetHeaderType(header)
        if big:
            writer.SetByteOrderToBigEndian()
        if compressed:
            writer.SetCompressorTypeToZLib()
            # Several blocks, the last one shorter.
            writer.SetBlockSize(128)
        else:
            writer.SetCompressorTypeToNone()
        assert writer.Write() == 1


def write_meshio(folder, file_format, suffix, **options):
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for number, (_, x, arrays) in enumerate(frames()):
        files.append(f"frame_{number}.{suffix}")
        mesh = meshio.Mesh(x, [("vertex", numpy.arange(len(x))[:, None])], point_data=arrays)
        meshio.write(folder / files[-1], mesh, file_format=file_format, **options)
    pvd(folder, "frames.pvd", files)


def write_legacy_vtk(folder, binary, version):
    folder.mkdir(parents=True, exist_ok=True)
    for number, (t, x, arrays) in enumerate(frames()):
        writer = vtk.vtkUnstructuredGridWriter()
        writer.SetFileName(str(folder / f"frame_{number}.vtk"))
        writer.SetInputData(grid(x, arrays, t))
        writer.SetFileVersion(version)
        writer.SetFileTypeToBinary() if binary else writer.SetFileTypeToASCII()
        assert writer.Write() == 1


def write_csv(path, header, columns):
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [",".join(header)]
    for t, x, arrays in frames():
        for p in range(len(x)):
            lines.append(",".join(repr(float(value)) for value in columns(t, x[p], arrays, p)))
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def write_ok(ok):
    L, S = vtk.vtkXMLWriter.UInt64, vtk.vtkXMLWriter.UInt32
    ascii_, binary, appended = vtk.vtkXMLWriter.Ascii, vtk.vtkXMLWriter.Binary, vtk.vtkXMLWriter.Appended
    write_vtk_xml(ok / "vtk-ascii", "a", ascii_, False, S)
    write_vtk_xml(ok / "vtk-base64-32", "a", binary, False, S)
    write_vtk_xml(ok / "vtk-base64-64", "a", binary, False, L)
    write_vtk_xml(ok / "vtk-base64-zlib-32", "a", binary, True, S)
    write_vtk_xml(ok / "vtk-base64-zlib-64", "a", binary, True, L)
    write_vtk_xml(ok / "vtk-base64-big-endian", "a", binary, True, L, big=True)
    write_vtk_xml(ok / "vtk-appended-raw-32", "a", appended, False, S)
    write_vtk_xml(ok / "vtk-appended-raw-64", "a", appended, False, L)
    write_vtk_xml(ok / "vtk-appended-raw-zlib", "a", appended, True, L)
    write_vtk_xml(ok / "vtk-appended-base64", "a", appended, False, S, appended_base64=True)
    write_vtk_xml(ok / "vtk-appended-base64-zlib", "a", appended, True, L, appended_base64=True)
    write_meshio(ok / "meshio-ascii", "vtu", "vtu", binary=False)
    write_meshio(ok / "meshio-base64", "vtu", "vtu", binary=True, compression=None)
    write_meshio(ok / "meshio-zlib", "vtu", "vtu", binary=True, compression="zlib")
    write_meshio(ok / "meshio-legacy-ascii", "vtk42", "vtk", binary=False)
    write_meshio(ok / "meshio-legacy-binary", "vtk42", "vtk", binary=True)
    write_meshio(ok / "meshio-legacy-51", "vtk51", "vtk", binary=True)
    for version in (42, 51):
        write_legacy_vtk(ok / f"vtk-legacy-ascii-{version}", False, version)
        write_legacy_vtk(ok / f"vtk-legacy-binary-{version}", True, version)
    folder = ok / "pyvista-polydata"
    folder.mkdir(parents=True, exist_ok=True)
    for number, (t, x, arrays) in enumerate(frames()):
        cloud = pyvista.PolyData(x)
        for name, values in arrays.items():
            cloud.point_data[name] = values
        cloud.field_data["TimeValue"] = numpy.array([t])
        cloud.save(folder / f"cloud_{number}.vtp")
    tensor_columns = [f"{field}{i}{j}" for field in "FP" for i in (1, 2) for j in (1, 2)]

    def row(t, x, arrays, p):
        plane = [arrays[name][p].reshape(3, 3)[:2, :2].ravel() for name in ("F", "P")]
        vectors = [arrays[name][p][:2] for name in ("displacement", "velocity")]
        return [t, arrays["id"][p], *arrays["reference_position"][p][:2], *x[:2], *numpy.hstack([*vectors, *plane])]

    header = ["t", "id", "X", "Y", "x", "y", "ux", "uy", "vx", "vy", *tensor_columns]
    write_csv(ok / "columns.csv", header, row)


def xml(piece, attributes='byte_order="LittleEndian"', points=None, time=0.0, count=2, kind="UnstructuredGrid"):
    """A small file by hand, the arrays of its points as text."""
    points = points or '<DataArray type="Float64" NumberOfComponents="3" format="ascii">0.5 0 0 0 0.75 0</DataArray>'
    field = f'<FieldData><DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="ascii">{time}</DataArray></FieldData>'
    if time is None:
        field = ""
    return (
        f'<?xml version="1.0"?>\n<VTKFile type="{kind}" version="1.0" {attributes}>\n<{kind}>{field}\n'
        f'<Piece NumberOfPoints="{count}" NumberOfCells="0"><Points>{points}</Points>\n'
        f"<PointData>{piece}</PointData>\n</Piece>\n</{kind}>\n</VTKFile>\n"
    )


def array(values, name="displacement", components=3, form="ascii", kind="Float64"):
    return (
        f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" format="{form}">{values}</DataArray>'
    )


def packed(*parts):
    return base64.b64encode(b"".join(parts)).decode()


def case(folder, arguments, expected, files):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "call.txt").write_text("\n".join([arguments, *expected]) + "\n", encoding="utf-8")
    for name, content in files.items():
        (folder / name).write_bytes(content if isinstance(content, bytes) else content.encode())


def listing(*entries):
    lines = "".join(f'<DataSet timestep="{t}" part="0" file="{file}"/>\n' for t, file in entries)
    return f'<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n{lines}</Collection>\n</VTKFile>\n'


def write_err(err, ok):
    zeros = "0 0 0 0 0 0"
    frame = xml(array(zeros))
    doubles = struct.pack("<6d", *range(6))
    zlib_header = 'byte_order="LittleEndian" header_type="UInt64" compressor="vtkZLibDataCompressor"'
    squeezed = zlib.compress(doubles)

    def one(name, content, *expected, file="a.vtu", options=""):
        case(err / name, f"{file} {options}".strip(), expected, {file: content})

    base = (ok / "meshio-base64" / "frame_0.vtu").read_bytes()
    raw = (ok / "vtk-appended-raw-64" / "a_0.vtu").read_bytes()
    one("xml-cut", base[: len(base) // 2], "a.vtu", "cut off", options="--time 0")
    one("xml-cut-in-tag", base[:40], "a.vtu")
    one("appended-cut", raw[: len(raw) - 700], "a.vtu", "cut off")
    one("appended-cut-at-end", raw[: len(raw) - 30], "a.vtu", "cut off")
    far = re.sub(rb'(Name="displacement"[^>]*offset=")\d+', rb"\g<1>99999", raw)
    one("appended-offset", far, "array `displacement`", "begins at byte 99999 of the appended data")
    near = re.sub(rb'(Name="displacement"[^>]*offset=")\d+', rb"\g<1>8", raw)
    one("appended-header", near, "array `displacement`", "its header promises", "its size says 144")
    one("appended-cut-early", raw[: raw.index(b"<AppendedData")], "a.vtu", "cut off")
    one("ascii-short", xml(array("0 0 0")), "array `displacement`", "3 numbers; its size says 6")
    one("ascii-long", xml(array(zeros + " 0")), "array `displacement`", "7 numbers; its size says 6")
    one("ascii-words", xml(array("0 0 zero 0 0 0")), "array `displacement`", "\"zero\" is no number")
    one(
        "header-wrong",
        xml(array(packed(struct.pack("<I", 40), doubles[:40]), form="binary")),
        "array `displacement`", "promises 40 bytes; its size says 48",
    )
    one(
        "base64-cut",
        xml(array(packed(struct.pack("<I", 48), doubles[:24]), form="binary")),
        "array `displacement`", "promises 48 bytes",
    )
    one("base64-foreign", xml(array("####", form="binary")), "array `displacement`", "is no base64")
    sizes = struct.pack("<4Q", 1, 48, 0, len(squeezed))
    one(
        "zlib-damaged",
        xml(array(packed(sizes) + packed(squeezed[:9] + b"damage" + squeezed[15:]), form="binary"), zlib_header),
        "array `displacement`", "block 1 of 1 does not inflate",
    )
    one(
        "zlib-cut",
        xml(array(packed(sizes) + packed(squeezed[:12]), form="binary"), zlib_header),
        "array `displacement`", "12 of its", "packed bytes",
    )
    one(
        "zlib-too-much",
        xml(array(packed(struct.pack("<4Q", 1, 48, 0, 40)) + packed(zlib.compress(b"0" * 4000000)[:40]), form="binary"), zlib_header),
        "array `displacement`", "does not inflate to the 48 bytes",
    )
    one(
        "zlib-blocks-beyond-measure",
        xml(array(packed(struct.pack("<4Q", 2**62, 2**40, 0, 1)), form="binary"), zlib_header),
        "array `displacement`", "its size says 48",
    )
    one(
        "points-beyond-measure",
        xml(array(zeros), count=10**15),
        "a.vtu, array `", "1000000000000000 x 3 numbers; at most",
    )
    one("points-beyond-counting", xml(array(zeros), count=2**64), "NumberOfPoints", "not a whole number")
    one("lz4", xml(array(zeros), 'compressor="vtkLZ4DataCompressor"'), "vtkLZ4DataCompressor", "zlib")
    one("image", xml(array(zeros), kind="ImageData"), "ImageData", "UnstructuredGrid")
    one("no-xml", "solid cube\n", "a.vtu", "does not begin as XML does")
    one("empty", "", "a.vtu", "empty")
    one("no-particles", xml(array(""), count=0), "a.vtu", "no particle")
    one("no-displacement", xml(array(zeros, name="mass")), "a.vtu", "nothing tells displacements", "--map displacement=NAME")
    one("map-unknown", frame, "there is no array `disp` for displacement", "there are: displacement", options="--map displacement=disp")
    one("map-shape", xml(array(zeros) + array("1 2", "m", 1)), "array `m` has 1 component(s)", "displacement has 2 to 3", options="--map displacement=m")
    one("map-role", frame, "--map", "ROLE=NAME", "deformation_gradient", options="--map stress=displacement")
    one("map-twice", frame, "--map id", "twice", options="--map id=a --map id=b")
    one("no-time", xml(array(zeros), time=None), "a.vtu", "nothing tells its time", "--time")
    one("time-nan", xml(array(zeros), time="nan"), "finite time", "NaN")
    one("time-negative", frame, "--5", options="--time=--5")
    one("time-late", xml(array(zeros), time=5), "do not overlap", "0 to 0.02", "--periods")
    one("time-before", frame, "do not overlap", options="--time -0.01")
    one("cells-count", frame, "--cells has 2 value(s) for 1 recording", options="--cells 8,16")
    one("kind-unknown", "x", "a.dat", ".vtu", ".csv", file="a.dat")
    one("missing", frame, "b.vtu", "cannot read", options="b.vtu")
    one("csv-words", "x,y,ux,uy,t\n0.5,0,a,0,0\n", "line 2, column `ux`", file="a.csv")
    one("csv-ragged", "x,y,ux,uy,t\n0.5,0,0,0\n", "a.csv", "fields", file="a.csv")
    one("csv-no-positions", "ux,uy,t\n0,0,0\n", "no positions", file="a.csv")
    one("csv-no-rows", "x,y,ux,uy\n", "no particle", file="a.csv", options="--time 0")
    one("csv-binary", b"\0" * 99, "no text", file="a.csv")
    one("csv-one-coordinate", "x,ux,uy,t\n0.5,0,0,0\n", "1 coordinate(s)", "has 2", file="a.csv")
    legacy = (ok / "vtk-legacy-binary-42" / "frame_1.vtk").read_bytes()
    one("legacy-cut", legacy[: legacy.index(b"velocity") + 60], "a.vtk", "cut off", file="a.vtk")
    one("legacy-no-head", b"\0" * 99, "a.vtk", "# vtk DataFile", file="a.vtk")
    case(err / "pvd-cut", "a.pvd", ["a.pvd", "cut off"], {"a.pvd": listing((0, "a.vtu"))[:-12], "a.vtu": frame})
    case(err / "pvd-empty", "a.pvd", ["a.pvd", "no frame"], {"a.pvd": listing()})
    case(err / "pvd-itself", "a.pvd", ["a.pvd", "expected .vtu"], {"a.pvd": listing((0, "a.pvd"))})
    case(err / "pvd-missing", "a.pvd", ["gone.vtu", "cannot read"], {"a.pvd": listing((0, "gone.vtu"))})
    case(err / "pvd-words", "a.pvd", ['timestep="soon"'], {"a.pvd": listing(("soon", "a.vtu"))})
    case(err / "pvd-nan", "a.pvd", ["finite time"], {"a.pvd": listing(("nan", "a.vtu"), ("inf", "a.vtu")), "a.vtu": frame})
    case(err / "pvd-parts", "a.pvd", ["several files at time"], {"a.pvd": listing((0, "a.vtu"), (0, "a.vtu")), "a.vtu": frame})
    case(err / "pvd-late", "a.pvd", ["5.0 to 9.0", "do not overlap"], {"a.pvd": listing((5, "a.vtu"), (9, "a.vtu")), "a.vtu": frame})
    case(err / "pvd-one-time", "a.pvd --time 0", ["--time", "2"], {"a.pvd": listing((0, "a.vtu"), (0.01, "a.vtu")), "a.vtu": frame})
    case(err / "folder-of-others", ".", ["no frame"], {"notes.txt": "none"})
    case(err / "folder-of-lists", ".", ["2 .pvd files"], {"a.pvd": listing(), "b.pvd": listing()})
    other = xml(array("0 0 0", name="mass"), count=1, points=array("0.5 0 0"))
    bare = xml(array(zeros, name="mass"))
    case(
        err / "unmatched", "a.pvd", ["b.vtu", "1 particles, the first frame 2", "--map id=NAME"],
        {"a.pvd": listing((0, "a.vtu"), (0.01, "b.vtu")), "a.vtu": bare, "b.vtu": other},
    )
    case(
        err / "shape-changes", "a.pvd", ["b.vtu", "array `displacement` has 1 component(s)"],
        {"a.pvd": listing((0, "a.vtu"), (0.01, "b.vtu")), "a.vtu": frame, "b.vtu": xml(array("0 0", components=1))},
    )
    case(
        err / "array-vanishes", "a.pvd", ["b.vtu", "no array `displacement`, which the first frame has"],
        {"a.pvd": listing((0, "a.vtu"), (0.01, "b.vtu")), "a.vtu": frame, "b.vtu": bare},
    )


def text(values):
    return " ".join(repr(float(value)) for value in numpy.ravel(values))


def write_findings(findings):
    X = points()
    (t, x, arrays), (late, x_late, arrays_late) = frames()
    count = len(X)

    def frame(t, x, arrays, names, kind="Float64", keep=slice(None)):
        body = "".join(
            array(text(arrays[name][keep]) if name != "id" else " ".join(map(str, arrays[name][keep])), name, arrays[name][0].size,
                  kind="Int64" if name == "id" else kind)
            for name in names
        )
        coordinates = f'<DataArray type="{kind}" NumberOfComponents="3" format="ascii">{text(x[keep])}</DataArray>'
        return xml(body, points=coordinates, time=repr(t), count=len(x[keep]))

    def two(name, first, second, *expected, options=""):
        case(findings / name, f". {options}".strip(), expected, {"a_1.vtu": first, "a_2.vtu": second})

    u = ["displacement"]
    broken = dict(arrays_late, displacement=arrays_late["displacement"].copy())
    broken["displacement"][[1, 4], 0] = numpy.nan
    two("not-a-number", frame(t, x, arrays, u), frame(late, x_late, broken, u),
        "PROBLEM: 2 particle(s) whose displacement is not finite: particle 1 of ./a_2.vtu")
    two("single-precision", frame(t, x, arrays, u, "Float32"), frame(late, x_late, arrays_late, u, "Float32"),
        "note: array `displacement` holds 32-bit floats", "note: points are 32-bit floats", "status: ok")
    bare = dict(arrays, mass=numpy.ones((count, 1)))
    bare_late = dict(arrays_late, mass=numpy.ones((count, 1)))
    two("first-frame-by-id", frame(t, x, bare, ["id"]), frame(late, x_late[::-1], {k: v[::-1] for k, v in bare_late.items()}, ["id"]),
        "first frame's positions are taken to be exact at t = 0.0; particles are found again by identity",
        "reference positions: the first frame's positions", "u [m]  1.000e-3  1.000e-3  1.000e-3", "status: ok")
    two("first-frame-by-order", frame(t, x, bare, ["mass"]), frame(late, x_late, bare_late, ["mass"]),
        "found again by order", "u [m]  1.000e-3  1.000e-3  1.000e-3")
    two("missing-particles", frame(t, x, arrays, [*u, "id"]), frame(late, x_late, arrays_late, [*u, "id"], keep=slice(2, None)),
        "PROBLEM: 1 frame(s) hold another number of particles than the first one's 6: ./a_2.vtu holds 4",
        "PROBLEM: 2 particle(s) of the first frame are missing: id 7 of ./a_2.vtu")
    two("repeated-id", frame(t, x, dict(arrays, id=numpy.ones(count, int)), [*u, "id"]), frame(late, x_late, dict(arrays_late, id=numpy.ones(count, int)), [*u, "id"]),
        "PROBLEM: 10 particle(s) have an identity that another one of their frame has, in 2 frames")
    two("points-at-rest", frame(t, padded(X), arrays, u), frame(late, padded(X), arrays_late, u),
        "note: the points do not move while displacements change", "reference positions: the points of the files",
        "u [m]  1.000e-3  1.000e-3  1.000e-3")
    two("points-told", frame(t, padded(X), arrays, u), frame(late, padded(X), arrays_late, u), "u [m]  1.000e-3  1.000e-3  1.000e-3",
        options="--points reference")
    far = padded(X * 1000)
    two("outside-body", frame(t, far + arrays["displacement"], arrays, u), frame(late, far + arrays_late["displacement"], arrays_late, u),
        "note: 12 reference position(s) lie outside the body", "--points reference", "in 2 frames")
    tilted = dict(arrays_late, displacement=arrays_late["displacement"] + [0, 0, 1e-3])
    two("out-of-plane", frame(t, x, arrays, u), frame(late, x_late, tilted, u),
        "PROBLEM: 6 particle(s) whose displacement has a part beyond the solution's 2 dimension(s)")
    two("time-not-finite", frame(t, x, arrays, u), frame(numpy.nan, x_late, arrays_late, u),
        "PROBLEM: 1 frame(s) whose time is not finite are left out", "1 frame(s) from t = 0.0 to 0.0")
    two("partly-outside-time", frame(t, x, arrays, u), frame(late + 0.02, x_late, arrays_late, u),
        "note: 1 of 2 frames lie outside the times 0 to 0.02", "u [m]  1.000e-3  1.000e-3  1.000e-3")
    two("array-of-other-shape", frame(t, x, dict(arrays, P=numpy.ones((count, 1))), [*u, "P"]), frame(late, x_late, dict(arrays_late, P=numpy.ones((count, 1))), [*u, "P"]),
        "note: array `P` has 1 component(s) and is not taken for first_piola_kirchhoff, which has 4 or 9")


if __name__ == "__main__":
    place = Path(sys.argv[1])
    write_ok(place / "ok")
    write_err(place / "err", place / "ok")
    write_findings(place / "findings")
