"""The commands of `mms` as functions: a keyword is an option.

Written by `mms reference --python`. Do not edit.
"""

import os
from collections.abc import Iterable, Mapping
from typing import Literal

from mmsmith._invoke import Named, Progress, invoke, named
from mmsmith._results import Check, Convergence, Result, Run, Score, Stability, Tradeoff

#: The commands that write JSON.
WITH_JSON = frozenset({"list", "check", "explain", "coverage", "eval", "run", "converge", "stability", "tradeoff", "score"})

#: The commands that take values of parameters.
WITH_SET = frozenset({"check", "gen", "eval", "run", "converge", "stability", "tradeoff", "score"})


@named
def check(
    *solutions: Named,
    points: int | None = None,
    thorough: bool = False,
    seconds: float | str | None = None,
    state: str | os.PathLike[str] | None = None,
    set: Mapping[str, float] | None = None,
    json: str | os.PathLike[str] | None = None,
    progress: Progress = None,
) -> Check:
    """Compare every field of a solution with the field below it; all solutions when none is named.

    Args:
        solutions: What `load` gave, names, or paths of specifications.
        points: Number of sample points in the body and on each surface [default: 300], or with thorough of points that are drawn in each
            class of inputs before the search [default: 300, or 30 with seconds].
        thorough: Search for the largest rounding error of every field against arbitrary precision instead: among ordinary inputs, tiny
            amplitudes, late times, at the boundary, near inversion, near and far from the origin.
        seconds: Search for so long in each solution [default: 128 evaluations for each point drawn].
        state: Keep the state of each search in this folder, and go on where it was.
        set: Give a parameter another value than its default.
        json: Keep the JSON of the result in this file.
        progress: Called with the share that is done and a line about the work under way. True: a line on standard error. Default: True
            where standard error is a terminal.
    """
    return invoke(Check, "check", solutions, locals())


@named
def explain(
    solution: Named,
    /,
    *,
    compare: bool = False,
    json: str | os.PathLike[str] | None = None,
    progress: Progress = None,
) -> Result:
    """Tell what a solution models, what it exercises, and what its body force costs.

    Args:
        solution: What `load` gave, a name, or the path of a specification.
        compare: Run five schemes on 64, 128 and 256 cells for a part of a period too, and tell what they take beside what is predicted.
        json: Keep the JSON of the result in this file.
        progress: Called with the share that is done and a line about the work under way. True: a line on standard error. Default: True
            where standard error is a terminal.
    """
    return invoke(Result, "explain", (solution,), locals())


@named
def run(
    solution: Named,
    /,
    *,
    cells: int | None = None,
    shape: Literal["linear", "ugimp", "gimp", "bspline2", "bspline3", "cpdi", "cpdi2", "bspline4", "bspline5"] | None = None,
    formulation: Literal["updated-lagrangian", "total-lagrangian"] | None = None,
    mass: Literal["lumped", "consistent"] | None = None,
    composition: Literal[2, 4, 6] | None = None,
    layout: Literal["lattice", "body-fitted", "clipped", "gauss"] | None = None,
    grid: Literal["cartesian", "polar", "spherical"] | None = None,
    cfl_speed: Literal["bar", "p-wave"] | None = None,
    integrator: Literal["usf", "usl", "musl", "usavg", "cd"] | None = None,
    transfer: str | None = None,
    start: Literal["exact", "data", "halved"] | None = None,
    ppc: int | None = None,
    cfl: float | None = None,
    periods: float | None = None,
    extent: Literal["quarter", "full"] | None = None,
    offset: float | None = None,
    grid_angle: float | None = None,
    grid_shift: float | None = None,
    precision: Literal["f64", "f32"] | None = None,
    set: Mapping[str, float] | None = None,
    threads: int | None = None,
    json: str | os.PathLike[str] | None = None,
    vtk: str | os.PathLike[str] | None = None,
    frames: int | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    every: int | None = None,
    history: str | os.PathLike[str] | None = None,
    plot: str | os.PathLike[str] | None = None,
    picture: str | os.PathLike[str] | None = None,
    at: float | None = None,
    stress: Literal["von-mises", "pressure", "xx", "yy", "zz", "xy", "xz", "yz", "radial", "hoop"] | None = None,
    progress: Progress = None,
) -> Run:
    """Run one simulation and measure its errors.

    Args:
        solution: What `load` gave, a name, or the path of a specification.
        cells: Number of cells along the solution's cell length; where nothing is said 32, and 16 for a solid in three dimensions in a total
            frame that is not given either.
        shape: Weights between particles and grid; where nothing is said gimp, and bspline3 in the total Lagrangian formulation.
            `linear`: Hat functions at the particle's point.
            `ugimp`: GIMP weights of fixed size.
            `gimp`: GIMP weights that follow the particle's stretch.
            `bspline2`: Quadratic splines.
            `bspline3`: Cubic splines.
            `cpdi`: Parallelograms that deform with the particle.
            `cpdi2`: Quadrilaterals (in space hexahedra) whose corners neighbours share.
            `bspline4`: Quartic splines (total Lagrangian).
            `bspline5`: Quintic splines (total Lagrangian).
        formulation: Formulation: updated Lagrangian, with the weights of the current configuration anew in each step, or total Lagrangian,
            with those of the reference configuration throughout. Where nothing is said the updated one, and the total one for a solution
            with a condition that only that one models.
            `updated-lagrangian`: Updated Lagrangian: weights anew in each step, from the current configuration.
            `total-lagrangian`: Total Lagrangian: weights once, from the reference configuration.
        mass: Mass matrix of the total Lagrangian formulation; consistent where nothing is said.
            `lumped`: Row sums on the diagonal.
            `consistent`: Integrated over the particles.
        composition: Order of the symmetric composition of leapfrog in the total Lagrangian formulation; where nothing is said 4, and 6 for
            splines of degree 4 and 5.
            `2`: Leapfrog.
            `4`: Five stages.
            `6`: Nine stages.
        layout: Where the particles lie; Gauss points in the total Lagrangian formulation only, body-fitted and clipped ones in the updated
            one only. Where nothing is said a lattice, and Gauss points in the total Lagrangian formulation for a body that is not held
            between sliding walls.
            `lattice`: Centres of equal parts of a cell.
            `body-fitted`: Polar cells of equal angle that end at the rims (rings, updated Lagrangian).
            `clipped`: A lattice clipped with the boundary of the body: polygons or polyhedra on shared corners (updated Lagrangian, not on
                a line).
            `gauss`: Gauss-Legendre points (total Lagrangian).
        grid: Coordinates of the background grid; where nothing is said polar for rings and spherical for shells in the total Lagrangian
            formulation.
            `cartesian`: Cartesian.
            `polar`: Radius and angle.
            `spherical`: Radius, polar angle and azimuth, without a cone of 45 degrees about the third axis.
        cfl_speed: Speed that the CFL number refers to; where nothing is said bar, and p-wave with a number that is not given either in a
            total Lagrangian formulation that is not.
            `bar`: That of waves in a bar, sqrt(E/rho0), unless the solution has its own.
            `p-wave`: That of P-waves in the undeformed solid, sqrt((lambda + 2 mu)/rho0).
        integrator: Time integrator. Default: cd.
            `usf`: Update stress first.
            `usl`: Update stress last.
            `musl`: Update stress last, with the velocity projected again.
            `usavg`: Stress updated by halves, before the forces and after.
            `cd`: Centred differences.
        transfer: Velocities from the grid to the particles: flip, pic, apic, or xpic2, xpic3, ... with a filter of that order. Default:
            flip.
        start: First velocity of the cd integrator; others ignore it. Default: halved.
            `exact`: The exact velocity half a step before time zero.
            `data`: Velocity and acceleration at time zero.
            `halved`: Velocity at time zero, first acceleration halved.
        ppc: Particles in a cell along each direction; where nothing is said 2, and one more than the degree with Gauss points.
        cfl: Time step times wave speed over grid spacing; where nothing is said 0.4, and one that suits the splines in a total frame that
            is not given either.
        periods: End time in periods of the solution. Default: 1.
        extent: How much of a ring or a shell is modelled; the part between planes of symmetry where there are such.
            `quarter`: The part between the planes of symmetry.
            `full`: All of it.
        offset: Shift of the particles' lattice along every axis, in units of their distance, from -0.5 to 0.5. Default: 0.
        grid_angle: Angle of the background grid against the body in degrees, counter-clockwise; particles are then clipped with its
            boundary. Default: 0.
        grid_shift: Shift of the background grid against the body along each axis, in cells from -1 to 1; particles are then clipped with
            its boundary. Default: 0.
        precision: Precision of the solver; errors are always measured in f64. Default: f64.
            `f64`: Double.
            `f32`: Single.
        set: Give a parameter another value than its default.
        threads: Number of threads; all cores when left out.
        json: Keep the JSON of the result in this file.
        vtk: Write particle files (.vtu, and a .pvd that lists them) to this folder.
        frames: Number of particle files, spread evenly from the first state to the last. Default: 20.
        checkpoint: Write all that the next step needs to this folder every so often; after a kill, `mms resume DIR` goes on from there.
        every: Steps between checkpoints. Default: 1000.
        history: Write errors of u, energies and momentum of the particles and of the exact motion over time to this file as comma-separated
            values, at up to 1000 evenly spread steps; json then has them too.
        plot: Draw the energy gained and lost against the exact motion over time to this SVG file.
        picture: Draw the particles, coloured by their Cauchy stress, to this SVG file; those in space as they are seen along the third
            axis.
        at: The time of the picture in periods of the solution, at most periods; the end when left out.
        stress: The stress that gives the particles of the picture their colours. Default: von-mises.
            `von-mises`: Von Mises' equivalent stress.
            `pressure`: Pressure, positive in compression.
            `xx`: Normal stress along the first axis.
            `yy`: Normal stress along the second axis.
            `zz`: Normal stress along the third axis.
            `xy`: Shear stress.
            `xz`: Shear stress.
            `yz`: Shear stress.
            `radial`: Normal stress away from the third axis.
            `hoop`: Normal stress around the third axis.
        progress: Called with the share that is done and a line about the work under way. True: a line on standard error. Default: True
            where standard error is a terminal.
    """
    return invoke(Run, "run", (solution,), locals())


@named
def converge(
    solution: Named,
    /,
    *,
    cells: int | Iterable[int],
    cfls: float | Iterable[float] | None = None,
    expect: float | str | Mapping[str, float] | None = None,
    tolerance: float | None = None,
    out: str | os.PathLike[str] | None = None,
    shard: str | None = None,
    plot: str | os.PathLike[str] | None = None,
    csv: str | os.PathLike[str] | None = None,
    markdown: str | os.PathLike[str] | None = None,
    latex: str | os.PathLike[str] | None = None,
    shape: Literal["linear", "ugimp", "gimp", "bspline2", "bspline3", "cpdi", "cpdi2", "bspline4", "bspline5"] | None = None,
    formulation: Literal["updated-lagrangian", "total-lagrangian"] | None = None,
    mass: Literal["lumped", "consistent"] | None = None,
    composition: Literal[2, 4, 6] | None = None,
    layout: Literal["lattice", "body-fitted", "clipped", "gauss"] | None = None,
    grid: Literal["cartesian", "polar", "spherical"] | None = None,
    cfl_speed: Literal["bar", "p-wave"] | None = None,
    integrator: Literal["usf", "usl", "musl", "usavg", "cd"] | None = None,
    transfer: str | None = None,
    start: Literal["exact", "data", "halved"] | None = None,
    ppc: int | None = None,
    cfl: float | None = None,
    periods: float | None = None,
    extent: Literal["quarter", "full"] | None = None,
    offset: float | None = None,
    grid_angle: float | None = None,
    grid_shift: float | None = None,
    precision: Literal["f64", "f32"] | None = None,
    set: Mapping[str, float] | None = None,
    threads: int | None = None,
    json: str | os.PathLike[str] | None = None,
    progress: Progress = None,
) -> Convergence:
    """Measure orders of accuracy over grids (cells 16,32,64) or time steps (cells 32 cfls 0.1,0.2,0.4).

    Args:
        solution: What `load` gave, a name, or the path of a specification.
        cells: Cell counts, separated by commas; one of them with cfls.
        cfls: CFL numbers, separated by commas, for orders in time on one grid.
        expect: Orders to be met in place of those that theory promises: a number for u, or by field and norm, such as u=2,F=1,P.l1=1. With
            cfls they are orders in time, of the differences on one grid. A missed order, promised or asked for, gives exit status 1.
        tolerance: How far the order on the finest pair may be from the expected one; 0.1 when left out.
        out: Keep every finished case in this folder, and take from it what is there: a study that was killed goes on where it stopped, and
            several processes may share one.
        shard: Compute those cases alone that fall to shard I of N, by predicted cost, and write no table: the shards of a study run on as
            many machines, in any order, and the same command without this option prints the table. mms batch writes the script.
        plot: Draw the displacement error to this SVG file.
        csv: Write the tables to this file as comma-separated values.
        markdown: Write the tables to this Markdown file.
        latex: Write the tables to this LaTeX file, for the package booktabs.
        shape: Weights between particles and grid; where nothing is said gimp, and bspline3 in the total Lagrangian formulation.
            `linear`: Hat functions at the particle's point.
            `ugimp`: GIMP weights of fixed size.
            `gimp`: GIMP weights that follow the particle's stretch.
            `bspline2`: Quadratic splines.
            `bspline3`: Cubic splines.
            `cpdi`: Parallelograms that deform with the particle.
            `cpdi2`: Quadrilaterals (in space hexahedra) whose corners neighbours share.
            `bspline4`: Quartic splines (total Lagrangian).
            `bspline5`: Quintic splines (total Lagrangian).
        formulation: Formulation: updated Lagrangian, with the weights of the current configuration anew in each step, or total Lagrangian,
            with those of the reference configuration throughout. Where nothing is said the updated one, and the total one for a solution
            with a condition that only that one models.
            `updated-lagrangian`: Updated Lagrangian: weights anew in each step, from the current configuration.
            `total-lagrangian`: Total Lagrangian: weights once, from the reference configuration.
        mass: Mass matrix of the total Lagrangian formulation; consistent where nothing is said.
            `lumped`: Row sums on the diagonal.
            `consistent`: Integrated over the particles.
        composition: Order of the symmetric composition of leapfrog in the total Lagrangian formulation; where nothing is said 4, and 6 for
            splines of degree 4 and 5.
            `2`: Leapfrog.
            `4`: Five stages.
            `6`: Nine stages.
        layout: Where the particles lie; Gauss points in the total Lagrangian formulation only, body-fitted and clipped ones in the updated
            one only. Where nothing is said a lattice, and Gauss points in the total Lagrangian formulation for a body that is not held
            between sliding walls.
            `lattice`: Centres of equal parts of a cell.
            `body-fitted`: Polar cells of equal angle that end at the rims (rings, updated Lagrangian).
            `clipped`: A lattice clipped with the boundary of the body: polygons or polyhedra on shared corners (updated Lagrangian, not on
                a line).
            `gauss`: Gauss-Legendre points (total Lagrangian).
        grid: Coordinates of the background grid; where nothing is said polar for rings and spherical for shells in the total Lagrangian
            formulation.
            `cartesian`: Cartesian.
            `polar`: Radius and angle.
            `spherical`: Radius, polar angle and azimuth, without a cone of 45 degrees about the third axis.
        cfl_speed: Speed that the CFL number refers to; where nothing is said bar, and p-wave with a number that is not given either in a
            total Lagrangian formulation that is not.
            `bar`: That of waves in a bar, sqrt(E/rho0), unless the solution has its own.
            `p-wave`: That of P-waves in the undeformed solid, sqrt((lambda + 2 mu)/rho0).
        integrator: Time integrator. Default: cd.
            `usf`: Update stress first.
            `usl`: Update stress last.
            `musl`: Update stress last, with the velocity projected again.
            `usavg`: Stress updated by halves, before the forces and after.
            `cd`: Centred differences.
        transfer: Velocities from the grid to the particles: flip, pic, apic, or xpic2, xpic3, ... with a filter of that order. Default:
            flip.
        start: First velocity of the cd integrator; others ignore it. Default: halved.
            `exact`: The exact velocity half a step before time zero.
            `data`: Velocity and acceleration at time zero.
            `halved`: Velocity at time zero, first acceleration halved.
        ppc: Particles in a cell along each direction; where nothing is said 2, and one more than the degree with Gauss points.
        cfl: Time step times wave speed over grid spacing; where nothing is said 0.4, and one that suits the splines in a total frame that
            is not given either.
        periods: End time in periods of the solution. Default: 1.
        extent: How much of a ring or a shell is modelled; the part between planes of symmetry where there are such.
            `quarter`: The part between the planes of symmetry.
            `full`: All of it.
        offset: Shift of the particles' lattice along every axis, in units of their distance, from -0.5 to 0.5. Default: 0.
        grid_angle: Angle of the background grid against the body in degrees, counter-clockwise; particles are then clipped with its
            boundary. Default: 0.
        grid_shift: Shift of the background grid against the body along each axis, in cells from -1 to 1; particles are then clipped with
            its boundary. Default: 0.
        precision: Precision of the solver; errors are always measured in f64. Default: f64.
            `f64`: Double.
            `f32`: Single.
        set: Give a parameter another value than its default.
        threads: Number of threads; all cores when left out.
        json: Keep the JSON of the result in this file.
        progress: Called with the share that is done and a line about the work under way. True: a line on standard error. Default: True
            where standard error is a terminal.
    """
    return invoke(Convergence, "converge", (solution,), locals())


@named
def stability(
    solution: Named,
    /,
    *,
    cells: int | None = None,
    over: Mapping[str, Iterable[float | str]] | None = None,
    width: float | None = None,
    lower: float | None = None,
    upper: float | None = None,
    error_multiple: float | None = None,
    energy_rate: float | None = None,
    at: float | None = None,
    search: Literal["random"] | None = None,
    samples: int | None = None,
    seed: int | None = None,
    plot: str | os.PathLike[str] | None = None,
    csv: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    shard: str | None = None,
    shape: Literal["linear", "ugimp", "gimp", "bspline2", "bspline3", "cpdi", "cpdi2", "bspline4", "bspline5"] | None = None,
    formulation: Literal["updated-lagrangian", "total-lagrangian"] | None = None,
    mass: Literal["lumped", "consistent"] | None = None,
    composition: Literal[2, 4, 6] | None = None,
    layout: Literal["lattice", "body-fitted", "clipped", "gauss"] | None = None,
    grid: Literal["cartesian", "polar", "spherical"] | None = None,
    cfl_speed: Literal["bar", "p-wave"] | None = None,
    integrator: Literal["usf", "usl", "musl", "usavg", "cd"] | None = None,
    transfer: str | None = None,
    start: Literal["exact", "data", "halved"] | None = None,
    ppc: int | None = None,
    cfl: float | None = None,
    periods: float | None = None,
    extent: Literal["quarter", "full"] | None = None,
    offset: float | None = None,
    grid_angle: float | None = None,
    grid_shift: float | None = None,
    precision: Literal["f64", "f32"] | None = None,
    set: Mapping[str, float] | None = None,
    threads: int | None = None,
    json: str | os.PathLike[str] | None = None,
    progress: Progress = None,
) -> Stability:
    """Find the largest stable CFL number by bisection, over one or two settings or parameters.

    Args:
        solution: What `load` gave, a name, or the path of a specification.
        cells: Number of cells along the solution's cell length. Default: 32.
        over: What to vary, one or two of them: NAME=VALUE,VALUE,... with the name amplitude, units (mass, length where L is one, and time
            change by powers of two), a parameter of the solution, or cells, ppc, offset, periods, precision, shape, integrator, start.
        width: How close the stable and the unstable CFL number come, on P-waves, whose number is the larger one. Default: 0.01.
        lower: CFL number to start from; an eighth of P-waves' when left out. It is halved until it is stable.
        upper: CFL number that is thought unstable; P-waves' own when left out. It is raised until it is unstable.
        error_multiple: A run is unstable with an error of u above this multiple of a reference run's, at an eighth of P-waves' time step.
            Default: 10.
        energy_rate: A run is unstable if it gains, in a period, more than this multiple of the exact motion's largest energy. Default: 1.
        at: Judge the run at this CFL number alone; exit status 1 if it is unstable.
        search: Look for failures among random settings with CFL numbers up to cfl on P-waves, which are believed stable; exit status 1 if
            there are any.
            `random`: Settings drawn from a seed.
        samples: Number of random settings. Default: 100.
        seed: Seed of the random settings. Default: 1.
        plot: Draw the limits to this SVG file: a line over one setting, a map over two.
        csv: Write the table to this file as comma-separated values.
        out: Keep every finished case in this folder, and take from it what is there: a study that was killed goes on where it stopped, and
            several processes may share one.
        shard: Compute those cases alone that fall to shard I of N, by predicted cost, and write no table: the shards of a study run on as
            many machines, in any order, and the same command without this option prints the table. mms batch writes the script.
        shape: Weights between particles and grid; where nothing is said gimp, and bspline3 in the total Lagrangian formulation.
            `linear`: Hat functions at the particle's point.
            `ugimp`: GIMP weights of fixed size.
            `gimp`: GIMP weights that follow the particle's stretch.
            `bspline2`: Quadratic splines.
            `bspline3`: Cubic splines.
            `cpdi`: Parallelograms that deform with the particle.
            `cpdi2`: Quadrilaterals (in space hexahedra) whose corners neighbours share.
            `bspline4`: Quartic splines (total Lagrangian).
            `bspline5`: Quintic splines (total Lagrangian).
        formulation: Formulation: updated Lagrangian, with the weights of the current configuration anew in each step, or total Lagrangian,
            with those of the reference configuration throughout. Where nothing is said the updated one, and the total one for a solution
            with a condition that only that one models.
            `updated-lagrangian`: Updated Lagrangian: weights anew in each step, from the current configuration.
            `total-lagrangian`: Total Lagrangian: weights once, from the reference configuration.
        mass: Mass matrix of the total Lagrangian formulation; consistent where nothing is said.
            `lumped`: Row sums on the diagonal.
            `consistent`: Integrated over the particles.
        composition: Order of the symmetric composition of leapfrog in the total Lagrangian formulation; where nothing is said 4, and 6 for
            splines of degree 4 and 5.
            `2`: Leapfrog.
            `4`: Five stages.
            `6`: Nine stages.
        layout: Where the particles lie; Gauss points in the total Lagrangian formulation only, body-fitted and clipped ones in the updated
            one only. Where nothing is said a lattice, and Gauss points in the total Lagrangian formulation for a body that is not held
            between sliding walls.
            `lattice`: Centres of equal parts of a cell.
            `body-fitted`: Polar cells of equal angle that end at the rims (rings, updated Lagrangian).
            `clipped`: A lattice clipped with the boundary of the body: polygons or polyhedra on shared corners (updated Lagrangian, not on
                a line).
            `gauss`: Gauss-Legendre points (total Lagrangian).
        grid: Coordinates of the background grid; where nothing is said polar for rings and spherical for shells in the total Lagrangian
            formulation.
            `cartesian`: Cartesian.
            `polar`: Radius and angle.
            `spherical`: Radius, polar angle and azimuth, without a cone of 45 degrees about the third axis.
        cfl_speed: Speed that the CFL number refers to; where nothing is said bar, and p-wave with a number that is not given either in a
            total Lagrangian formulation that is not.
            `bar`: That of waves in a bar, sqrt(E/rho0), unless the solution has its own.
            `p-wave`: That of P-waves in the undeformed solid, sqrt((lambda + 2 mu)/rho0).
        integrator: Time integrator. Default: cd.
            `usf`: Update stress first.
            `usl`: Update stress last.
            `musl`: Update stress last, with the velocity projected again.
            `usavg`: Stress updated by halves, before the forces and after.
            `cd`: Centred differences.
        transfer: Velocities from the grid to the particles: flip, pic, apic, or xpic2, xpic3, ... with a filter of that order. Default:
            flip.
        start: First velocity of the cd integrator; others ignore it. Default: halved.
            `exact`: The exact velocity half a step before time zero.
            `data`: Velocity and acceleration at time zero.
            `halved`: Velocity at time zero, first acceleration halved.
        ppc: Particles in a cell along each direction; where nothing is said 2, and one more than the degree with Gauss points.
        cfl: Time step times wave speed over grid spacing; where nothing is said 0.4, and one that suits the splines in a total frame that
            is not given either.
        periods: End time in periods of the solution. Default: 1.
        extent: How much of a ring or a shell is modelled; the part between planes of symmetry where there are such.
            `quarter`: The part between the planes of symmetry.
            `full`: All of it.
        offset: Shift of the particles' lattice along every axis, in units of their distance, from -0.5 to 0.5. Default: 0.
        grid_angle: Angle of the background grid against the body in degrees, counter-clockwise; particles are then clipped with its
            boundary. Default: 0.
        grid_shift: Shift of the background grid against the body along each axis, in cells from -1 to 1; particles are then clipped with
            its boundary. Default: 0.
        precision: Precision of the solver; errors are always measured in f64. Default: f64.
            `f64`: Double.
            `f32`: Single.
        set: Give a parameter another value than its default.
        threads: Number of threads; all cores when left out.
        json: Keep the JSON of the result in this file.
        progress: Called with the share that is done and a line about the work under way. True: a line on standard error. Default: True
            where standard error is a terminal.
    """
    return invoke(Stability, "stability", (solution,), locals())


@named
def tradeoff(
    solution: Named,
    /,
    *,
    budget: float | str | None = None,
    cells: int | Iterable[int] | None = None,
    cfls: float | Iterable[float] | None = None,
    tolerance: float | None = None,
    time: float | str | None = None,
    field: Literal["u", "v", "f", "p"] | None = None,
    norm: Literal["linf", "l2", "l1"] | None = None,
    against: Literal["wall", "cpu", "steps", "memory"] | None = None,
    periods: float | None = None,
    threads: int | None = None,
    set: Mapping[str, float] | None = None,
    json: str | os.PathLike[str] | None = None,
    csv: str | os.PathLike[str] | None = None,
    plot: str | os.PathLike[str] | None = None,
    advice: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
    shard: str | None = None,
    progress: Progress = None,
) -> Tradeoff:
    """Measure error against cost over all schemes that fit, name the cheapest setting for an error, and say what each setting buys.

    Args:
        solution: What `load` gave, a name, or the path of a specification.
        budget: Time for everything, such as 90s, 2m or 1h; it is used up, for timings repeated if for nothing better. Default: 2m.
        cells: Run every scheme that fits on these cell counts, whatever that takes, in place of a sweep within a budget; cases so stated
            can be shared out with shard.
        cfls: CFL numbers for cells. Default: 0.4.
        tolerance: Name the cheapest setting with at most this error, and run it once more to confirm it; exit status 1 if there is none.
        time: Name the most accurate setting whose steps take at most this time, and run it once more to confirm it; exit status 1 if there
            is none.
        field: Field whose error counts. Errors of u are divided by the amplitude A where the solution has one. Default: u.
            `u`: Displacement.
            `v`: Velocity.
            `f`: Deformation gradient.
            `p`: First Piola-Kirchhoff stress.
        norm: Norm of the error. Default: linf.
            `linf`: Largest over particles.
            `l2`: Root of the mean square.
            `l1`: Mean.
        against: Cost that the error is held against. Default: wall.
            `wall`: Wall-clock time of the steps.
            `cpu`: Processor time of the steps.
            `steps`: Number of steps.
            `memory`: Memory, estimated.
        periods: End time in periods of the solution. Default: 1.
        threads: Number of threads; 1 when left out, and all cores for comparison.
        set: Give a parameter another value than its default.
        json: Keep the JSON of the result in this file.
        csv: Write all settings to this file as comma-separated values.
        plot: Draw error against cost, with the front, to this SVG file.
        advice: Write a page of advice to this Markdown file, with the figure behind each sentence.
        out: Keep every finished case in this folder, and take from it what is there: a study that was killed goes on where it stopped, and
            several processes may share one.
        shard: Compute those cases alone that fall to shard I of N, by predicted cost, and write no table: the shards of a study run on as
            many machines, in any order, and the same command without this option prints the table. mms batch writes the script.
        progress: Called with the share that is done and a line about the work under way. True: a line on standard error. Default: True
            where standard error is a terminal.
    """
    return invoke(Tradeoff, "tradeoff", (solution,), locals())


@named
def score(
    solution: Named,
    /,
    *files: str | os.PathLike[str],
    each: bool = False,
    map: Mapping[str, str] | None = None,
    points: Literal["auto", "current", "reference"] | None = None,
    time: float | None = None,
    velocity_lag: float | None = None,
    periods: float | None = None,
    cells: int | Iterable[int] | None = None,
    h: float | Iterable[float] | None = None,
    differences: float | Iterable[float] | None = None,
    against: str | None = None,
    cfl: float | None = None,
    set: Mapping[str, float] | None = None,
    threads: int | None = None,
    json: str | os.PathLike[str] | None = None,
    progress: Progress = None,
) -> Score:
    """Measure errors and orders of what another solver wrote (.vtu, .vtp, .vtk, .pvd, .csv).

    Args:
        solution: What `load` gave, a name, or the path of a specification.
        files: The recordings, one for each resolution: lists, folders, or files.
        each: Each file is a recording of its own.
        map: What an array is that has no usual name. Roles: displacement, velocity, deformation_gradient, first_piola_kirchhoff, cauchy,
            kirchhoff, J, density, reference_position, id.
        points: What the points of the files are. Default: auto.
            `auto`: Reference positions if they stay while displacements change, else current ones.
            `current`: Current positions.
            `reference`: Reference positions.
        time: The time of single frames that do not tell it.
        velocity_lag: By how much velocities lag behind their frame's time: half a time step for staggered schemes. Default: 0.
        periods: The time in which frames are expected, in periods of the solution. Default: 1.
        cells: Cell counts along the solution's cell length, one for each recording.
        h: Mesh sizes, one for each recording; estimated from the particles when neither is given.
        differences: Compare each recording with the next one instead of the exact solution, for orders in time: they differ in nothing but
            the time steps, which these are, each the same part of the one before.
        against: Run mms itself with this shape function and integrator on the same grids, and compare the errors digit by digit.
        cfl: Time step times wave speed over grid spacing of those runs, as of the recordings. Default: 0.4.
        set: Give a parameter another value than its default.
        threads: Number of threads; all cores when left out.
        json: Keep the JSON of the result in this file.
        progress: Called with the share that is done and a line about the work under way. True: a line on standard error. Default: True
            where standard error is a terminal.
    """
    return invoke(Score, "score", (solution, *files), locals())
