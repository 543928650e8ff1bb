"""Solves a problem of the library in the plane with NairnMPM, for `mms score` to measure.

    python solve.py axis-aligned|swirl|ring CELLS FOLDER [--shape SHAPE] [--method METHOD] [--amplitude A] [--cfl X] ...

The variable NAIRN_MPM names the program NairnMPM, which is built from its sources. Of mmsmith only the generated C header is
used: for the body force, the constants and the start. Grid, law, equations of motion and time integration are those of NairnMPM.

NairnMPM has no initial stress, so that a motion has to start from F = I. `swirl` does. `axis-aligned` and `ring` have their cosines of
time turned into sines, and their specifications are written to FOLDER.

NairnMPM takes the force of a material point as an expression of time. The force at a fixed X is periodic: the expression is
its Fourier series, to a part in 1e10 of the largest force.

FOLDER gets the input, input.xml; the archives; and a recording, particles.pvd: displacement, velocity, F and Cauchy stress of the points.
"""

import argparse
import os
import resource
import struct
import subprocess
import sys
from pathlib import Path

import numpy

sys.path.insert(0, str(Path(__file__).parents[1]))
from exact import Exact, Recording, padded

SPECIFICATIONS = Path(__file__).parents[3] / "mms-specs"
PROGRAM = os.environ.get("NAIRN_MPM", "NairnMPM")
METHODS = {"usf": 0, "usavg": 2, "usl": 3}
SHAPES = ["Classic", "uGIMP", "lCPDI", "qCPDI", "Finite", "B2GIMP", "B2SPLINE", "B2CPDI"]
AMPLITUDES = {"axis-aligned": 0.001, "swirl": 0.05, "ring": 0.001}
# Times at which a force is sampled in a period, and the part of the largest coefficient below which terms are left out.
SAMPLES = 64
NEGLIGIBLE = 1e-10
# Two cells beyond the walls for the functions that reach over them.
MARGIN = 2

INPUT = """<?xml version='1.0'?>
<!DOCTYPE JANFEAInput SYSTEM "NairnMPM.dtd">
<JANFEAInput version='3'>
  <Header>
    <Description>{name}</Description>
    <Analysis>10</Analysis>
    <ConsistentUnits length="m" mass="kg" time="s"/>
  </Header>
  <MPMHeader>
    <MPMMethod>{method}</MPMMethod>
    <GIMP type="{shape}"/>
    <Timing step="{dt!r}" max="{end!r}" CFL="{most_cfl}"/>
    <ArchiveGroup time="{archive!r}"/>
    <ArchiveRoot>archive/points.</ArchiveRoot>
    <MPMArchiveOrder>iYYYYNNNNNNNNNNNNY</MPMArchiveOrder>
    <DefGradTerms>{terms}</DefGradTerms>{skip}
  </MPMHeader>
  <Mesh output="file">
    <Grid xmin="{low!r}" xmax="{high!r}" ymin="{low!r}" ymax="{high!r}" thickness="1">
      <Horiz nx="{count}" {walls}/>
      <Vert ny="{count}" {walls}/>
    </Grid>
  </Mesh>
  <MaterialPoints>
    <PointList>
{points}
    </PointList>
  </MaterialPoints>
  <Material Type="28" Name="body">
    <rho>{rho!r}</rho>
    <E>{E!r}</E>
    <nu>{nu!r}</nu>
    <UJOption>2</UJOption>
  </Material>
  <ParticleBCs>
{loads}
  </ParticleBCs>{tasks}
</JANFEAInput>
"""
FMPM = """
  <CustomTasks>
    <Schedule name="PeriodicXPIC">
      <Parameter name="{kind}Order">{order}</Parameter>
      <Parameter name="periodicSteps">1</Parameter>
    </Schedule>
  </CustomTasks>"""


def specification(name, folder):
    """The solution that NairnMPM can start: a name of the library, or a file in the folder."""
    text = (SPECIFICATIONS / f"{name}.toml").read_text(encoding="utf-8")
    started = text.replace("cos(c*Pi*t)", "sin(c*Pi*t)") if name != "swirl" else text
    if started == text:
        return name, name
    own = f"{name}-sine"
    # The listing that checks the library's solution does not hold for this one.
    started = started.replace(f"name = '{name}'", f"name = '{own}'").split("\n# The slides' code")[0]
    started += "\n[time]\nperiod = '2/c'\nwave-speed = 'c'\n" if "[time]" not in started else ""
    path = folder / f"{own}.toml"
    path.write_text(started, encoding="utf-8")
    return own, path


def placed(name, cells):
    """The middles of quarter cells in the body."""
    middles = (numpy.arange(2 * cells) + 0.5) / (2 * cells)
    X = numpy.column_stack([axis.ravel() for axis in numpy.meshgrid(middles, middles)])
    if name == "ring":
        R = numpy.hypot(*X.T)
        X = X[(R > 0.5) & (R < 1.0)]
    return numpy.ascontiguousarray(X)


def series(exact, X, mass, late):
    """The force on each point along both axes, as text with the variable t."""
    times = numpy.arange(SAMPLES) / SAMPLES * exact.period
    b = exact.body_force(X)
    forces = numpy.array([mass * b(t + late) for t in times])
    terms = numpy.fft.rfft(forces, axis=0) / SAMPLES
    terms[1:] *= 2
    least = NEGLIGIBLE * abs(terms).max()
    angular = 2 * numpy.pi / exact.period

    def expression(terms):
        text = ""
        for k, term in enumerate(terms):
            for value, function in ((term.real, "cos"), (-term.imag, "sin")):
                if abs(value) > least:
                    text += f"{value:+.16e}" + (f"*{function}({k * angular!r}*t)" if k else "")
        return text or "0"

    for point in range(len(X)):
        yield expression(terms[:, point, 0]), expression(terms[:, point, 1])


def read_archive(path, count):
    """Position, velocity, Cauchy stress and F of the points, as NairnMPM archives them in the plane."""
    data = path.read_bytes()[64:]
    record = struct.Struct("=i d h 2x 2d 2d 2d 2d 4d 4d d")
    assert len(data) == count * record.size, (len(data) / count, record.size)
    rows = numpy.array([row[3:] for row in record.iter_unpack(data)])
    position, velocity, stress, strain = rows[:, 2:4], rows[:, 6:8], rows[:, 8:12], rows[:, 12:16]
    # The angle and the initial angle, in degrees, tell F21 - F12: see ArchiveData.cpp.
    turn = numpy.pi / 90 * (rows[:, 16] - rows[:, 0])
    F = numpy.empty((count, 4))
    F[:, 0], F[:, 3] = 1 + strain[:, 0], 1 + strain[:, 1]
    F[:, 1], F[:, 2] = (strain[:, 3] - turn) / 2, (strain[:, 3] + turn) / 2
    xx, yy, _, xy = stress.T
    return position, velocity, F, numpy.column_stack([xx, xy, xy, yy])


def run(
    name, cells, folder, shape="B2SPLINE", method="usavg", amplitude=None, cfl=0.4, frames=11, periods=1.0,
    late=0.0, terms=2, fmpm=0, skip=False,
):  # fmt: skip
    """Steps, points, the seconds that NairnMPM took, and the solution to score against."""
    amplitude = AMPLITUDES[name] if amplitude is None else amplitude
    folder.mkdir(parents=True, exist_ok=True)
    for stale in folder.glob("archive/*"):
        stale.unlink()
    (folder / "archive").mkdir(exist_ok=True)
    own, source = specification(name, folder)
    exact = Exact(own, amplitude, source)
    end = periods * exact.period
    between = int(numpy.ceil(end / (cfl / cells / exact.speed) / (frames - 1) - 1e-9))
    steps = between * (frames - 1)
    dt = end / steps
    X = placed(name, cells)
    u, v, _, F = exact.start(X)
    assert abs(u).max() < 1e-14 and abs(F - numpy.eye(2)).max() < 1e-13
    # The ring moves out by its amplitude, the square not at all.
    above = MARGIN + (int(numpy.ceil(amplitude * cells)) if name == "ring" else 0)
    h = 1 / cells
    point = '      <mp matl="1" thick="1" lpx="0.5" lpy="0.5"><pt x="{!r}" y="{!r}"/><vel x="{!r}" y="{!r}"/></mp>'
    # A rectangle about each point: the element `load`, which names the number of a point, ends the program by a segmentation
    # fault where its value is a function (MPMReadHandler.cpp stores a base class's pointer as that of the derived class).
    load = '    <LdRect xmin="{!r}" xmax="{!r}" ymin="{!r}" ymax="{!r}">{}</LdRect>'
    push = '<LoadBC dir="{}" style="6" function="{}"/>'
    mass = exact.rho0 / (2 * cells) ** 2
    loads = []
    for (x, y), force in zip(X.tolist(), series(exact, X, mass, late * dt)):
        pushes = "".join(push.format(axis + 1, text) for axis, text in enumerate(force))
        loads.append(load.format(x - h / 8, x + h / 8, y - h / 8, y + h / 8, pushes))
    text = INPUT.format(
        name=own,
        method=METHODS[method],
        shape=shape,
        dt=dt,
        # The program ends with the first step past this time.
        end=end - dt / 2,
        most_cfl=0.9,
        archive=between * dt * (1 - 1e-9),
        terms=terms,
        skip="\n    <SkipPostExtrapolation/>" if skip else "",
        low=-MARGIN * h,
        high=1 + above * h,
        count=cells + MARGIN + above,
        walls='symmin="0"' if name == "ring" else 'symmin="0" symmax="1"',
        points="\n".join(point.format(*map(float, row)) for row in numpy.hstack([X, v])),
        loads="\n".join(loads),
        rho=exact.rho0,
        E=exact.E,
        nu=exact.nu,
        tasks=FMPM.format(kind="FMPM" if fmpm > 0 else "XPIC", order=abs(fmpm)) if fmpm else "",
    )
    (folder / "input.xml").write_text(text, encoding="ascii")
    with open(folder / "log", "w", encoding="utf-8") as log:
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        subprocess.run([PROGRAM, "-np", "1", "input.xml"], cwd=folder, check=True, stdout=log, stderr=log)
        seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    recording = Recording(folder, "particles", own, exact.parameters)
    archives = {}
    for path in folder.glob("archive/points.*"):
        if path.suffix[1:].isdigit():
            archives[int(path.suffix[1:])] = path
    assert sorted(archives) == list(range(0, steps + 1, between)), sorted(archives)
    for step, path in sorted(archives.items()):
        x, v, F, cauchy = read_archive(path, len(X))
        arrays = {"reference_position": padded(X), "displacement": padded(x - X), "velocity": padded(v)}
        recording.write(step * dt, x, arrays | {"F": F, "cauchy": cauchy})
    return steps, len(X), seconds, source


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", choices=AMPLITUDES)
    parser.add_argument("cells", type=int)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--shape", choices=SHAPES, default="B2SPLINE")
    parser.add_argument("--method", choices=METHODS, default="usavg")
    parser.add_argument("--amplitude", type=float)
    parser.add_argument("--cfl", type=float, default=0.4)
    parser.add_argument("--periods", type=float, default=1.0)
    parser.add_argument("--frames", type=int, default=11)
    parser.add_argument("--late", type=float, default=0.0, help="time steps that are added to the time of the force")
    parser.add_argument("--terms", type=int, default=2, help="terms of the exponential that updates F")
    parser.add_argument("--fmpm", type=int, default=0, help="order of FMPM; 0 is FLIP; of XPIC, where negative")
    parser.add_argument("--skip", action="store_true", help="no second extrapolation before the last strain update")
    options = parser.parse_args(arguments)
    steps, points, seconds, source = run(**vars(options))
    print(f"{source}, {options.cells} cells: {steps} steps of {points} points, {seconds:.2f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
