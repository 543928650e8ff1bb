"""Runs that several processes simulate together, against the same runs of one process: results, histories and particle files to the bit.

    check.py MMS FOLDER MPIRUN...    such as: check.py target/mpi/release/mms target/mpi/runs mpirun --oversubscribe
"""

import json
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np

MMS, FOLDER, MPIRUN = Path(sys.argv[1]).resolve(), Path(sys.argv[2]), sys.argv[3:]
COUNTS = [1, 2, 3, 4, 7]
SHAPES = ["linear", "ugimp", "gimp", "bspline2", "bspline3", "cpdi", "cpdi2"]
TRANSFERS = ["flip", "apic", "xpic2"]
INTEGRATORS = ["cd", "usl", "usf", "musl"]
PLANE = ["axis-aligned", "ring", "swirl", "skew-2d"]

# Each shape with each transfer, on a problem and with an integrator of their own; f32; whole rings; space.
CASES = [
    f"{PLANE[(s + t) % 3]} --cells 64 --periods 0.05 --shape {shape} --transfer {transfer} --integrator {INTEGRATORS[(s + 2 * t) % 4]}"
    for s, shape in enumerate(SHAPES)
    for t, transfer in enumerate(TRANSFERS)
] + [
    "axis-aligned --cells 64 --periods 0.05 --precision f32",
    "ring --cells 64 --periods 0.05 --precision f32 --shape bspline2 --transfer apic",
    "ring --cells 64 --periods 0.1 --extent full",
    "ring --cells 64 --periods 0.1 --shape cpdi2 --layout body-fitted",
    "axis-aligned-3d --cells 56 --periods 0.01",
    # It is turned inside out.
    "axis-aligned --cells 64 --shape linear --integrator usl --cfl 1.9",
]


def lasting(value):
    """What a document says but for times, rates, threads and processes."""
    if isinstance(value, dict):
        drop = ("wall_s", "cpu_s", "particle_steps_per_s", "threads", "ranks")
        return {key: lasting(entry) for key, entry in value.items() if key not in drop}
    return [lasting(entry) for entry in value] if isinstance(value, list) else value


def run(count, arguments, threads=1):
    """The result and the history of a run; `count` is none for a process that no launcher starts."""
    result, history = FOLDER / "result.json", FOLDER / "history.csv"
    start = [] if count is None else [*MPIRUN, "-n", str(count)]
    command = [*start, str(MMS), "run", *arguments.split(), "--threads", str(threads)]
    subprocess.run([*command, "--json", str(result), "--history", str(history)], check=True, stdout=subprocess.DEVNULL)
    return lasting(json.loads(result.read_text())), history.read_text()


def particles(pieces):
    """All arrays of the particles in some files, in the order of their numbers."""
    meshes = [meshio.read(piece) for piece in pieces]
    order = np.argsort(np.concatenate([mesh.point_data["id"] for mesh in meshes]).ravel())
    arrays = {name: np.concatenate([mesh.point_data[name] for mesh in meshes])[order] for name in meshes[0].point_data}
    return arrays | {"points": np.concatenate([mesh.points for mesh in meshes])[order]}


def check_files():
    """Particle files in pieces hold what those of one process do, also for a reader that opens them as one."""
    for count in (None, 3):
        start = [] if count is None else [*MPIRUN, "-n", str(count)]
        command = [*start, str(MMS), "run", "ring", "--cells", "64", "--periods", "0.1", "--frames", "3"]
        subprocess.run([*command, "--vtk", str(FOLDER / f"particles-{count}")], check=True, stdout=subprocess.DEVNULL)
    for frame in range(3):
        whole = particles([FOLDER / f"particles-None/ring-{frame:06}.vtu"])
        pieces = sorted((FOLDER / "particles-3").glob(f"ring-{frame:06}-*.vtu"))
        assert len(pieces) == 3, pieces
        parts = particles(pieces)
        assert whole.keys() == parts.keys()
        assert all(np.array_equal(whole[name], parts[name]) for name in whole), frame
        try:
            import pyvista
        except ImportError:
            continue
        joined = pyvista.read(FOLDER / f"particles-3/ring-{frame:06}.pvtu")
        order = np.argsort(joined["id"])
        assert np.array_equal(joined["displacement"][order], whole["displacement"])


FOLDER.mkdir(parents=True, exist_ok=True)
check_files()
for number, case in enumerate(CASES):
    alone = run(None, case)
    assert run(None, case, threads=2) == alone, case
    for count in COUNTS:
        assert run(count, case) == alone, f"{count} processes: {case}"
    print(f"{number + 1} of {len(CASES)}, same bits with {', '.join(map(str, COUNTS))} processes: {case}", flush=True)
