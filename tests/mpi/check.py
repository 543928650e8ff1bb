"""Runs that several processes simulate together, against the same runs of one process: results, histories and particle files to the bit.
So end runs of which a process is killed, once they go on.

    check.py [--quick even|odd] MMS FOLDER MPIRUN...    such as: check.py target/mpi/release/mms target/mpi/runs mpirun --oversubscribe

With --quick every second run is made but for the longest, each with one small number of processes, and none is killed.
"""

import argparse
import json
import math
import os
import random
import shutil
import signal
import subprocess
import time
from pathlib import Path

import meshio
import numpy as np

parser = argparse.ArgumentParser()
parser.add_argument("--quick", choices=["even", "odd"])
parser.add_argument("mms", type=Path)
parser.add_argument("folder", type=Path)
parser.add_argument("mpirun", nargs=argparse.REMAINDER)
options = parser.parse_args()
MMS, FOLDER, MPIRUN = options.mms.resolve(), options.folder, options.mpirun
COUNTS = [1, 2, 3, 4, 7]
SHAPES = ["linear", "ugimp", "gimp", "bspline2", "bspline3", "cpdi", "cpdi2"]
TRANSFERS = ["flip", "apic", "xpic2"]
INTEGRATORS = ["cd", "usl", "usf", "musl"]
REVOLUTION = Path(__file__).resolve().parents[1] / "data" / "specs" / "revolution"
PLANE = ["axis-aligned", "ring", "swirl", "skew-2d"]

# Each shape with each transfer, on a problem and with an integrator of their own; f32; whole rings; space, with rows for seven processes.
CASES = [
    f"{PLANE[(s + t) % 3]} --cells 64 --periods 0.05 --shape {shape} --transfer {transfer} --integrator {INTEGRATORS[(s + 2 * t) % 4]}"
    for s, shape in enumerate(SHAPES)
    for t, transfer in enumerate(TRANSFERS)
] + [
    "axis-aligned --cells 64 --periods 0.05 --precision f32",
    "ring --cells 64 --periods 0.05 --precision f32 --shape bspline2 --transfer apic",
    "ring --cells 64 --periods 0.1 --extent full",
    "ring --cells 64 --periods 0.1 --shape cpdi2 --layout body-fitted",
    "axis-aligned-3d --cells 64 --periods 0.005",
    "ring --cells 64 --periods 0.1 --shape cpdi2 --layout clipped --grid-angle 20",
    "swirl --cells 64 --periods 0.1 --shape bspline3 --layout clipped --transfer apic --integrator usf",
    "skew-2d --cells 64 --periods 0.1 --shape bspline2 --layout clipped --transfer xpic2 --integrator musl --grid-shift 0.3",
    "sphere-shell --cells 64 --periods 0.005 --shape cpdi2 --layout clipped",
    # In the half plane of a body of revolution.
    f"{REVOLUTION}/ring-in-walls.toml --cells 64 --periods 0.05",
    f"{REVOLUTION}/ring-in-walls.toml --cells 64 --periods 0.05 --shape cpdi2 --layout clipped",
    # It is turned inside out.
    "axis-aligned --cells 64 --shape linear --integrator usl --cfl 1.9",
]

# Processes along several axes, also in a box that is long enough to be cut across axis 0.
CUBE, LONG = Path(__file__).resolve().parents[2] / "mms-specs" / "axis-aligned-3d.toml", FOLDER.resolve() / "long-box.toml"
GRIDS = [
    ("2x2", "axis-aligned --cells 128 --periods 0.02 --transfer apic --integrator usl"),
    ("2x3", "ring --cells 128 --periods 0.02 --shape cpdi2 --layout clipped --grid-angle 20"),
    ("2x2x2", f"{LONG} --cells 8 --periods 0.01"),
    ("3x2", "swirl --cells 192 --periods 0.02 --shape bspline2 --transfer xpic2 --integrator musl"),
    ("1x2x2", "axis-aligned-3d --cells 24 --periods 0.01 --shape cpdi --integrator usf"),
    ("2x1x2", f"{LONG} --cells 8 --periods 0.01 --shape cpdi2"),
    ("1x2x2", f"{LONG} --cells 8 --periods 0.01 --precision f32"),
]


def lasting(value):
    """What a document says but for times, rates, threads and processes, and for settings that run instead, which one process alone tries."""
    if isinstance(value, dict):
        drop = ("wall_s", "cpu_s", "particle_steps_per_s", "threads", "ranks", "advice")
        return {key: lasting(entry) for key, entry in value.items() if key not in drop}
    return [lasting(entry) for entry in value] if isinstance(value, list) else value


def launched(count):
    """How a command line begins that starts so many processes; none where no launcher does."""
    return [] if count is None else [*MPIRUN, "-n", str(count)]


def run(count, arguments, threads=1):
    """The result and the history of a run; `count` is none for a process that no launcher starts."""
    result, history = FOLDER / "result.json", FOLDER / "history.csv"
    command = [*launched(count), str(MMS), "run", *arguments.split(), "--threads", str(threads)]
    result.unlink(missing_ok=True)
    ended = subprocess.run([*command, "--json", str(result), "--history", str(history)], stdout=subprocess.DEVNULL)
    told = json.loads(result.read_text())
    # A run that stopped has a result all the same.
    assert (ended.returncode == 0) == (told["passed"] is not False), f"exit status {ended.returncode}: {arguments}"
    return lasting(told), history.read_text()


def particles(pieces):
    """All arrays of the particles in some files, in the order of their numbers."""
    meshes = [meshio.read(piece) for piece in pieces]
    order = np.argsort(np.concatenate([mesh.point_data["id"] for mesh in meshes]).ravel())
    arrays = {name: np.concatenate([mesh.point_data[name] for mesh in meshes])[order] for name in meshes[0].point_data}
    return arrays | {"points": np.concatenate([mesh.points for mesh in meshes])[order]}


def check_files():
    """Particle files in pieces hold what those of one process do, also for a reader that opens them as one."""
    for count in (None, 3):
        command = [*launched(count), str(MMS), "run", "ring", "--cells", "64", "--periods", "0.1", "--frames", "3"]
        picture = ["--picture", str(FOLDER / f"picture-{count}.svg"), "--at", "0.05"]
        subprocess.run([*command, *picture, "--vtk", str(FOLDER / f"particles-{count}")], check=True, stdout=subprocess.DEVNULL)
    assert len({(FOLDER / f"picture-{count}.svg").read_text() for count in (None, 3)}) == 1
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


# Runs that are killed so often, each time at a random moment, and go on with other numbers of processes.
KILLED = [
    (7, "axis-aligned --cells 64 --periods 4 --every 3"),
    (7, "ring --cells 64 --periods 2 --shape cpdi2 --layout body-fitted --every 5"),
    (6, "swirl --cells 64 --periods 2 --transfer apic --integrator musl --every 7"),
    (5, "ring --cells 64 --periods 1 --shape cpdi2 --layout clipped --transfer apic --every 6"),
]


def processes(folder):
    """The processes of a run that keeps its state in a folder, by their ranks, and whether OpenMPI has started them."""
    found, is_openmpi = {}, False
    for entry in Path("/proc").iterdir():
        try:
            words = (entry / "cmdline").read_bytes().split(b"\0")
            environment = (entry / "environ").read_bytes().split(b"\0")
        except OSError:
            continue
        if words[0] == str(MMS).encode() and str(folder).encode() in words:
            names = (b"OMPI_COMM_WORLD_RANK=", b"PMI_RANK=")
            ranks = [int(line.split(b"=")[1]) for line in environment if line.startswith(names)]
            found[ranks[0] if ranks else 0] = int(entry.name)
            is_openmpi |= any(line.startswith(b"OMPI_") for line in environment)
    return found, is_openmpi


def kill(case, kills, rng):
    """Kills a process of a run so often, and compares its end with that of an undisturbed run; gives how often the last checkpoint was named."""
    kept, result, plain = FOLDER / "kept", FOLDER / "killed.json", FOLDER / "result.json"
    shutil.rmtree(kept, ignore_errors=True)
    started = time.monotonic()
    undisturbed = [str(MMS), "run", *case.split(" --every")[0].split(), "--json", str(plain), "--threads", "1"]
    subprocess.run(undisturbed, check=True, stdout=subprocess.DEVNULL)
    whole = time.monotonic() - started
    first = ["run", *case.split(), "--json", str(result), "--checkpoint", str(kept), "--threads", "1"]
    arguments, told, killed, counts = first, 0, 0, []
    while killed < kills:
        counts.append(rng.choice([2, 3, 4]))
        run = subprocess.Popen([*launched(counts[-1]), str(MMS), *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        # Until it steps.
        reached = (kept / "checkpoint").stat().st_mtime if (kept / "checkpoint").exists() else 0
        while run.poll() is None and not ((kept / "checkpoint").exists() and (kept / "checkpoint").stat().st_mtime > reached):
            time.sleep(0.002)
        time.sleep(rng.uniform(0, whole / kills))
        found, asks = processes(kept)
        rank = rng.choice(sorted(found)) if found else None
        assert rank is not None, f"it ended before it was killed {kills} times: {case}\n{run.communicate()[1]}"
        os.kill(found[rank], signal.SIGKILL)
        moment = time.monotonic()
        said = run.communicate(timeout=600)[1]
        took = time.monotonic() - moment
        assert run.returncode != 0 and took < 10, f"{took} s after process {rank} of {counts[-1]} was killed: {case}\n{said}"
        assert not processes(kept)[0], f"some are left after process {rank} of {counts[-1]} was killed: {case}"
        is_told = "last whole checkpoint is of step" in said
        # Not every launcher asks the others to end before it kills them.
        assert is_told or not asks, said
        killed, told = killed + 1, told + is_told
        arguments = ["resume", str(kept), "--threads", "1"]
    counts.append(rng.choice([None, 2, 5]))
    subprocess.run([*launched(counts[-1]), str(MMS), *arguments], check=True, stdout=subprocess.DEVNULL)
    results = [lasting(json.loads(path.read_text())) for path in (plain, result)]
    assert results[0] == results[1], case
    left = sorted(path.name for path in kept.iterdir())
    step = int.from_bytes((kept / "checkpoint").read_bytes()[72:80], "little")
    others = [f"checkpoint-{step}-{rank}" for rank in range(1, counts[-1] or 1)]
    assert left == sorted(["checkpoint", *others, "lock", "run.json"]), left
    return told, counts


def check_kills():
    rng = random.Random(27)
    for kills, case in KILLED:
        told, counts = kill(case, kills, rng)
        print(f"killed {kills} times, {told} of them the last checkpoint was named, with {counts} processes, same bits: {case}", flush=True)


FOLDER.mkdir(parents=True, exist_ok=True)
FOLDER = FOLDER.resolve()
cube = CUBE.read_text()
assert cube.count("upper = [1, 1, 1]") == 1
LONG.write_text(cube.replace("upper = [1, 1, 1]", "upper = [32, 2, 3]"))
check_files()
if not options.quick:
    check_kills()
for number, case in enumerate(CASES):
    is_left_out = "sphere-shell" in case or number % 2 != ["even", "odd"].index(options.quick or "even")
    if options.quick and is_left_out:
        continue
    counts = [3 - number % 2] if options.quick else COUNTS
    alone = run(None, case)
    assert options.quick or run(None, case, threads=2) == alone, case
    for count in counts:
        assert run(count, case) == alone, f"{count} processes: {case}"
    print(f"{number + 1} of {len(CASES)}, same bits with {', '.join(map(str, counts))} processes: {case}", flush=True)
for number, (grid, case) in enumerate(GRIDS):
    # The quick runs have the first three.
    if options.quick and (number > 2 or number % 2 != ["even", "odd"].index(options.quick)):
        continue
    count = math.prod(map(int, grid.split("x")))
    assert run(count, f"{case} --process-grid {grid}") == run(None, case), f"{grid} processes: {case}"
    print(f"same bits with {grid} processes: {case}", flush=True)
