"""The commands of `mms` as functions: a keyword is an option.

Written by `mms reference --python`. Do not edit.
"""

import os
from collections.abc import Iterable, Mapping
from typing import Literal

from mmsmith._invoke import Named, Progress, invoke, named
from mmsmith._results import Check, Convergence, Result, Run, Score, Stability, Tradeoff

#: The commands that write JSON.
WITH_JSON = frozenset({"list", "explain", "coverage", "check", "eval", "run", "converge", "stability", "tradeoff", "score", "diagnose", "doctor"})

#: The commands that take values of parameters.
WITH_SET = frozenset({"check", "gen", "eval", "run", "converge", "stability", "tradeoff", "score", "diagnose"})


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
    """Check every field by numerical differentiation: v against du/dt, F against du/dX, b against a - Div P/rho0.

    Args:
        solutions: What `load` gave, names, or paths of specifications.
        points: Number of sample points in the body and on each surface; with thorough of points drawn in each class of inputs before the
            search. Default: 300; 30 with seconds.
        thorough: Compare every field with arbitrary precision at points that are drawn, which decide, and search for the largest rounding
            errors, which are told: among ordinary inputs, tiny amplitudes, late times, at the boundary, near inversion and near the origin.
        seconds: Time of the search in each solution. Default: 128 evaluations for each point drawn.
        state: Keep the state of each search in this folder, and continue from the state there.
        set: Value of a parameter, in place of its default.
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
    cells: int | Iterable[int] | None = None,
    compare: bool = False,
    json: str | os.PathLike[str] | None = None,
    progress: Progress = None,
) -> Result:
    """Describe a solution: its formulas, the terms of the momentum balance that it tests, the cost of a run.

    Args:
        solution: What `load` gave, a name, or the path of a specification.
        cells: Numbers of cells, separated by commas, of more runs to predict: their particles, time, memory and threads of use.
        compare: Compare predicted and measured times: five schemes on 64, 128 and 256 cells, for a part of a period.
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
    shape: Literal["linear", "ugimp", "gimp", "bspline2", "bspline3", "gimp-bspline2", "cpdi", "cpdi2", "bspline4", "bspline5"] | None = None,
    formulation: Literal["updated-lagrangian", "total-lagrangian"] | None = None,
    mass: Literal["lumped", "consistent"] | None = None,
    composition: Literal[2, 4, 6] | None = None,
    return_map: Literal["exponential", "midpoint"] | None = None,
    volume: Literal["pointwise", "projected"] | None = None,
    layout: Literal["lattice", "body-fitted", "clipped", "gauss"] | None = None,
    grid: Literal["cartesian", "polar", "cylindrical", "spherical"] | None = None,
    cfl_speed: Literal["bar", "p-wave", "viscous"] | None = None,
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
    static: bool = False,
    dynamic: bool = False,
    load_steps: int | None = None,
    moment: float | None = None,
    along: Mapping[str, Iterable[float | str]] | None = None,
    vtk: str | os.PathLike[str] | None = None,
    frames: int | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    process_grid: str | None = None,
    every: int | None = None,
    history: str | os.PathLike[str] | None = None,
    profile: bool = False,
    plot: str | os.PathLike[str] | None = None,
    picture: str | os.PathLike[str] | None = None,
    at: float | None = None,
    stress: Literal["von-mises", "pressure", "xx", "yy", "zz", "xy", "xz", "yz", "radial", "hoop"] | None = None,
    progress: Progress = None,
) -> Run:
    """Run one simulation and measure its errors.

    Args:
        solution: What `load` gave, a name, or the path of a specification.
        cells: Number of cells along the solution's cell length. Default: 32; 16 in 3D if mms chose the total Lagrangian formulation itself.
        shape: Shape functions: the weights between particles and grid. Default: gimp; bspline3 in the total Lagrangian formulation.
            `linear`: Hat functions at the particle's point.
            `ugimp`: GIMP weights of fixed size.
            `gimp`: GIMP weights that follow the particle's stretch.
            `bspline2`: Quadratic splines.
            `bspline3`: Cubic splines.
            `gimp-bspline2`: Quadratic splines averaged over the particle's box.
            `cpdi`: Parallelograms that deform with the particle.
            `cpdi2`: Quadrilaterals (in space hexahedra) whose corners neighbours share.
            `bspline4`: Quartic splines (total Lagrangian).
            `bspline5`: Quintic splines (total Lagrangian).
        formulation: Formulation: updated Lagrangian evaluates the shape functions in the current configuration in every step, total
            Lagrangian once in the reference configuration. Default: updated-lagrangian; total-lagrangian if only this formulation can model
            a boundary condition of the solution.
            `updated-lagrangian`: Updated Lagrangian: weights anew in each step, from the current configuration.
            `total-lagrangian`: Total Lagrangian: weights once, from the reference configuration.
        mass: Mass matrix of the total Lagrangian formulation. Default: consistent.
            `lumped`: Row sums on the diagonal.
            `consistent`: Integrated over the particles.
        composition: Order of time stepping in the total Lagrangian formulation, by a symmetric composition of leapfrog steps. Default: 4; 6
            for splines of degree 4 and 5.
            `2`: Leapfrog.
            `4`: Five stages.
            `6`: Nine stages.
        return_map: Return map of a law with flow. Default: exponential.
            `exponential`: The direction of flow at the end of a step: first order in time.
            `midpoint`: The direction of flow at the middle of a step: second order in time.
        volume: Change of volume: projected is against locking next to incompressibility. Default: pointwise.
            `pointwise`: The stress of a particle follows from its own change of volume.
            `projected`: The change of volume and the mean stress are projected onto fewer functions, as F-bar methods do: against locking
                next to incompressibility.
        layout: Positions of the particles. gauss: total Lagrangian formulation only; body-fitted, clipped: updated Lagrangian formulation
            only. Default: lattice; gauss in the total Lagrangian formulation, unless all sides are sliding walls.
            `lattice`: Centres of equal parts of a cell.
            `body-fitted`: Polar cells of equal angle that end at the rims (rings, updated Lagrangian).
            `clipped`: A lattice clipped with the boundary of the body: polygons or polyhedra on shared corners (updated Lagrangian, not on
                a line).
            `gauss`: Gauss-Legendre points (total Lagrangian).
        grid: Coordinates of the background grid. Default: cartesian; in the total Lagrangian formulation polar for rings and spherical for
            shells.
            `cartesian`: Cartesian.
            `polar`: Radius and angle.
            `cylindrical`: Radius, angle and height.
            `spherical`: Radius, polar angle and azimuth, without a cone of 45 degrees about the third axis.
        cfl_speed: Wave speed in the CFL number. Default: bar; viscous if the stress follows the rate of the deformation; p-wave if mms
            chose both the total Lagrangian formulation and the CFL number itself, or a CFL number of less than 0.4.
            `bar`: Speed of waves in a bar, sqrt(E/rho0), unless the specification states a wave speed.
            `p-wave`: Speed of P-waves in the undeformed solid, sqrt((lambda + 2 mu)/rho0).
            `viscous`: Speed of P-waves made larger by the viscosity of the law on narrow cells: v + sqrt(c^2 + v^2), where v = 2 eta/(rho0
                h).
        integrator: Time integrator. Default: cd.
            `usf`: Update stress first.
            `usl`: Update stress last.
            `musl`: Update stress last, with the velocity projected again.
            `usavg`: Stress updated by halves, before the forces and after.
            `cd`: Centred differences.
        transfer: Transfer of velocities from the grid to the particles: flip, pic, apic, or xpic2, xpic3, ... (a filter of that order).
            Default: flip.
        start: First velocity of the integrator cd in the updated Lagrangian formulation; refused elsewhere. Default: halved.
            `exact`: The exact velocity half a step before time zero.
            `data`: Velocity and acceleration at time zero.
            `halved`: Velocity at time zero, first acceleration halved.
        ppc: Particles per cell and direction. Default: 2; with Gauss points the degree of the splines plus 1.
        cfl: CFL number: time step times wave speed over grid spacing. Default: 0.4, or less if that exceeds 0.6 on the fastest P-waves of
            the motion; in the total Lagrangian formulation a number that suits the splines.
        periods: End time, in periods of the solution. Default: 1.
        extent: Part of a ring or a shell that is simulated. Default: the part between its planes of symmetry, if it has any.
            `quarter`: The part between the planes of symmetry: a quarter of a ring, an eighth of a shell.
            `full`: All of it.
        offset: Shift of the lattice of particles along every axis, in particle distances, from -0.5 to 0.5. Default: 0.
        grid_angle: Angle from the body to the background grid in degrees, counter-clockwise. Particles are then clipped at the boundary of
            the body. Default: 0.
        grid_shift: Shift of the background grid along each axis, in cells, from -1 to 1. Particles are then clipped at the boundary of the
            body. Default: 0.
        precision: Precision of the solver; errors are always measured in f64. Default: f64.
            `f64`: Double.
            `f32`: Single.
        set: Value of a parameter, in place of its default.
        threads: Number of threads. Default: all cores.
        json: Keep the JSON of the result in this file.
        static: Solve for the equilibrium from rest by Newton's method, in the reference configuration: with the body force without inertia,
            b - a, at the moment of moment. Default where nothing of the solution moves, unless an option of runs through time is given.
        dynamic: Step through time from the exact state, though nothing of the solution moves.
        load_steps: Load steps of equal length; one that Newton's method does not take is halved. Default: 1.
        moment: Moment of the motion that is held, in periods of the solution. Default: 0.25, or another one where the body passes through
            rest then.
        along: Load levels of an equilibrium, one after the other: values of a parameter, or of moment, as NAME=VALUE,VALUE,...; each begins
            at the equilibrium of the one before, the first one at rest.
        vtk: Write particle files (.vtu, and a .pvd that lists them) to this folder; from rest, one of the equilibrium.
        frames: Number of particle files, spread evenly from the first state to the last. Default: 20.
        checkpoint: Write checkpoints to this folder; after a kill, `mms resume DIR` continues from the last one.
        process_grid: Processes along each axis, such as 2x4, where mpirun starts several. Default: those whose fullest has the least to do.
        every: Steps between checkpoints. Default: 1000.
        history: Write errors of u, energies and momentum over time to this CSV file, of the particles and of the exact motion, at up to
            1000 evenly spread steps; json then has them too.
        profile: Say how long each pass of the steps took, and how many threads the tiles of particles keep busy.
        plot: Draw the difference of the energy from the exact one over time to this SVG file.
        picture: Draw the particles, coloured by their Cauchy stress, to this SVG file; in 3D seen along the third axis, of a body of
            revolution its half plane.
        at: Time of the picture in periods of the solution, at most periods. Default: the end of the run.
        stress: Stress that the colours of the picture show. Default: von-mises.
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
    shape: Literal["linear", "ugimp", "gimp", "bspline2", "bspline3", "gimp-bspline2", "cpdi", "cpdi2", "bspline4", "bspline5"] | None = None,
    formulation: Literal["updated-lagrangian", "total-lagrangian"] | None = None,
    mass: Literal["lumped", "consistent"] | None = None,
    composition: Literal[2, 4, 6] | None = None,
    return_map: Literal["exponential", "midpoint"] | None = None,
    volume: Literal["pointwise", "projected"] | None = None,
    layout: Literal["lattice", "body-fitted", "clipped", "gauss"] | None = None,
    grid: Literal["cartesian", "polar", "cylindrical", "spherical"] | None = None,
    cfl_speed: Literal["bar", "p-wave", "viscous"] | None = None,
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
    static: bool = False,
    dynamic: bool = False,
    load_steps: int | None = None,
    moment: float | None = None,
    progress: Progress = None,
) -> Convergence:
    """Measure orders of accuracy over grids (cells 16,32,64) or time steps (cells 32 cfls 0.1,0.2,0.4).

    Args:
        solution: What `load` gave, a name, or the path of a specification.
        cells: Numbers of cells, separated by commas: at least two for an order, three for a verdict on it; one with cfls.
        cfls: CFL numbers, separated by commas: orders in time on one grid.
        expect: Expected orders: a number for u, or by field and norm, such as u=2,F=1,P.l1=1; with cfls orders in time, of the differences
            on one grid. A missed order gives exit status 1. Default: the orders of theory.
        tolerance: Largest distance of the order on the finest pair of grids from the expected order. Default: 0.1.
        out: Keep every finished case in this folder, and read finished cases from it: a study that was killed continues where it stopped,
            and several processes may share the folder.
        shard: Compute only the cases of shard I of N, of about equal predicted cost, and write no table. The shards of a study run on as
            many machines, in any order; the same command without this option prints the table. mms batch writes the script.
        plot: Draw the displacement error to this SVG file.
        csv: Write the tables to this file as comma-separated values.
        markdown: Write the tables to this Markdown file.
        latex: Write the tables to this LaTeX file, for the package booktabs.
        shape: Shape functions: the weights between particles and grid. Default: gimp; bspline3 in the total Lagrangian formulation.
            `linear`: Hat functions at the particle's point.
            `ugimp`: GIMP weights of fixed size.
            `gimp`: GIMP weights that follow the particle's stretch.
            `bspline2`: Quadratic splines.
            `bspline3`: Cubic splines.
            `gimp-bspline2`: Quadratic splines averaged over the particle's box.
            `cpdi`: Parallelograms that deform with the particle.
            `cpdi2`: Quadrilaterals (in space hexahedra) whose corners neighbours share.
            `bspline4`: Quartic splines (total Lagrangian).
            `bspline5`: Quintic splines (total Lagrangian).
        formulation: Formulation: updated Lagrangian evaluates the shape functions in the current configuration in every step, total
            Lagrangian once in the reference configuration. Default: updated-lagrangian; total-lagrangian if only this formulation can model
            a boundary condition of the solution.
            `updated-lagrangian`: Updated Lagrangian: weights anew in each step, from the current configuration.
            `total-lagrangian`: Total Lagrangian: weights once, from the reference configuration.
        mass: Mass matrix of the total Lagrangian formulation. Default: consistent.
            `lumped`: Row sums on the diagonal.
            `consistent`: Integrated over the particles.
        composition: Order of time stepping in the total Lagrangian formulation, by a symmetric composition of leapfrog steps. Default: 4; 6
            for splines of degree 4 and 5.
            `2`: Leapfrog.
            `4`: Five stages.
            `6`: Nine stages.
        return_map: Return map of a law with flow. Default: exponential.
            `exponential`: The direction of flow at the end of a step: first order in time.
            `midpoint`: The direction of flow at the middle of a step: second order in time.
        volume: Change of volume: projected is against locking next to incompressibility. Default: pointwise.
            `pointwise`: The stress of a particle follows from its own change of volume.
            `projected`: The change of volume and the mean stress are projected onto fewer functions, as F-bar methods do: against locking
                next to incompressibility.
        layout: Positions of the particles. gauss: total Lagrangian formulation only; body-fitted, clipped: updated Lagrangian formulation
            only. Default: lattice; gauss in the total Lagrangian formulation, unless all sides are sliding walls.
            `lattice`: Centres of equal parts of a cell.
            `body-fitted`: Polar cells of equal angle that end at the rims (rings, updated Lagrangian).
            `clipped`: A lattice clipped with the boundary of the body: polygons or polyhedra on shared corners (updated Lagrangian, not on
                a line).
            `gauss`: Gauss-Legendre points (total Lagrangian).
        grid: Coordinates of the background grid. Default: cartesian; in the total Lagrangian formulation polar for rings and spherical for
            shells.
            `cartesian`: Cartesian.
            `polar`: Radius and angle.
            `cylindrical`: Radius, angle and height.
            `spherical`: Radius, polar angle and azimuth, without a cone of 45 degrees about the third axis.
        cfl_speed: Wave speed in the CFL number. Default: bar; viscous if the stress follows the rate of the deformation; p-wave if mms
            chose both the total Lagrangian formulation and the CFL number itself, or a CFL number of less than 0.4.
            `bar`: Speed of waves in a bar, sqrt(E/rho0), unless the specification states a wave speed.
            `p-wave`: Speed of P-waves in the undeformed solid, sqrt((lambda + 2 mu)/rho0).
            `viscous`: Speed of P-waves made larger by the viscosity of the law on narrow cells: v + sqrt(c^2 + v^2), where v = 2 eta/(rho0
                h).
        integrator: Time integrator. Default: cd.
            `usf`: Update stress first.
            `usl`: Update stress last.
            `musl`: Update stress last, with the velocity projected again.
            `usavg`: Stress updated by halves, before the forces and after.
            `cd`: Centred differences.
        transfer: Transfer of velocities from the grid to the particles: flip, pic, apic, or xpic2, xpic3, ... (a filter of that order).
            Default: flip.
        start: First velocity of the integrator cd in the updated Lagrangian formulation; refused elsewhere. Default: halved.
            `exact`: The exact velocity half a step before time zero.
            `data`: Velocity and acceleration at time zero.
            `halved`: Velocity at time zero, first acceleration halved.
        ppc: Particles per cell and direction. Default: 2; with Gauss points the degree of the splines plus 1.
        cfl: CFL number: time step times wave speed over grid spacing. Default: 0.4, or less if that exceeds 0.6 on the fastest P-waves of
            the motion; in the total Lagrangian formulation a number that suits the splines.
        periods: End time, in periods of the solution. Default: 1.
        extent: Part of a ring or a shell that is simulated. Default: the part between its planes of symmetry, if it has any.
            `quarter`: The part between the planes of symmetry: a quarter of a ring, an eighth of a shell.
            `full`: All of it.
        offset: Shift of the lattice of particles along every axis, in particle distances, from -0.5 to 0.5. Default: 0.
        grid_angle: Angle from the body to the background grid in degrees, counter-clockwise. Particles are then clipped at the boundary of
            the body. Default: 0.
        grid_shift: Shift of the background grid along each axis, in cells, from -1 to 1. Particles are then clipped at the boundary of the
            body. Default: 0.
        precision: Precision of the solver; errors are always measured in f64. Default: f64.
            `f64`: Double.
            `f32`: Single.
        set: Value of a parameter, in place of its default.
        threads: Number of threads. Default: all cores.
        json: Keep the JSON of the result in this file.
        static: Solve for the equilibrium from rest by Newton's method, in the reference configuration: with the body force without inertia,
            b - a, at the moment of moment. Default where nothing of the solution moves, unless an option of runs through time is given.
        dynamic: Step through time from the exact state, though nothing of the solution moves.
        load_steps: Load steps of equal length; one that Newton's method does not take is halved. Default: 1.
        moment: Moment of the motion that is held, in periods of the solution. Default: 0.25, or another one where the body passes through
            rest then.
        progress: Called with the share that is done and a line about the work under way. True: a line on standard error. Default: True
            where standard error is a terminal.
    """
    return invoke(Convergence, "converge", (solution,), locals())


@named
def stability(
    solution: Named,
    /,
    *,
    exact: bool = False,
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
    shape: Literal["linear", "ugimp", "gimp", "bspline2", "bspline3", "gimp-bspline2", "cpdi", "cpdi2", "bspline4", "bspline5"] | None = None,
    formulation: Literal["updated-lagrangian", "total-lagrangian"] | None = None,
    mass: Literal["lumped", "consistent"] | None = None,
    composition: Literal[2, 4, 6] | None = None,
    return_map: Literal["exponential", "midpoint"] | None = None,
    volume: Literal["pointwise", "projected"] | None = None,
    layout: Literal["lattice", "body-fitted", "clipped", "gauss"] | None = None,
    grid: Literal["cartesian", "polar", "cylindrical", "spherical"] | None = None,
    cfl_speed: Literal["bar", "p-wave", "viscous"] | None = None,
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
        exact: Measure how much small disturbances of the exact motion grow until the end time, whatever the scheme: by the balance of
            momentum linearised about it, in waves and for the worst of all disturbances. Of the scheme's options it takes periods, and
            shape for the splines' degree; growth for programs has a schema of its own.
        cells: Number of cells along the solution's cell length. Default: 32; with exact 24 in one dimension, 12 in the plane, 5 in space.
        over: Setting to vary, as NAME=VALUE,VALUE,...; at most two. Names: amplitude; units (mass, length if the solution has a length L,
            and time change by powers of two); a parameter of the solution; cells, ppc, offset, periods, precision, shape, integrator,
            start.
        width: Largest distance between the stable and the unstable CFL number, on the speed of P-waves. Default: 0.01.
        lower: CFL number to start from; halved until a run is stable. Default: 1/8 of the number at which a P-wave crosses one cell in one
            step.
        upper: CFL number that is expected to be unstable; raised until a run is. Default: the number at which a P-wave crosses one cell in
            one step.
        error_multiple: A run is unstable if its error of u exceeds this multiple of the error of the reference run, at CFL 0.125 on
            P-waves. The part of that error which its steps cause grows with the order of the integrator first: accuracy lost in time is no
            instability. Default: 10.
        energy_rate: A run is unstable if its energy, in excess of the exact energy and of the reference run's excess, grows faster than
            this multiple of the largest exact energy per period. Laws without a strain energy, as those with memory, have no such limit.
            Default: 1.
        at: Run at this CFL number only; exit status 1 if the run is unstable.
        search: Look for unstable runs among random settings with CFL numbers up to cfl on P-waves, which should be stable; exit status 1 if
            there are any.
            `random`: Settings drawn from a seed.
        samples: Number of random settings. Default: 100.
        seed: Seed of the random settings. Default: 1.
        plot: Draw the limits to this SVG file: a line over one setting, a map over two.
        csv: Write the table to this file as comma-separated values.
        out: Keep every finished case in this folder, and read finished cases from it: a study that was killed continues where it stopped,
            and several processes may share the folder.
        shard: Compute only the cases of shard I of N, of about equal predicted cost, and write no table. The shards of a study run on as
            many machines, in any order; the same command without this option prints the table. mms batch writes the script.
        shape: Shape functions: the weights between particles and grid. Default: gimp; bspline3 in the total Lagrangian formulation.
            `linear`: Hat functions at the particle's point.
            `ugimp`: GIMP weights of fixed size.
            `gimp`: GIMP weights that follow the particle's stretch.
            `bspline2`: Quadratic splines.
            `bspline3`: Cubic splines.
            `gimp-bspline2`: Quadratic splines averaged over the particle's box.
            `cpdi`: Parallelograms that deform with the particle.
            `cpdi2`: Quadrilaterals (in space hexahedra) whose corners neighbours share.
            `bspline4`: Quartic splines (total Lagrangian).
            `bspline5`: Quintic splines (total Lagrangian).
        formulation: Formulation: updated Lagrangian evaluates the shape functions in the current configuration in every step, total
            Lagrangian once in the reference configuration. Default: updated-lagrangian; total-lagrangian if only this formulation can model
            a boundary condition of the solution.
            `updated-lagrangian`: Updated Lagrangian: weights anew in each step, from the current configuration.
            `total-lagrangian`: Total Lagrangian: weights once, from the reference configuration.
        mass: Mass matrix of the total Lagrangian formulation. Default: consistent.
            `lumped`: Row sums on the diagonal.
            `consistent`: Integrated over the particles.
        composition: Order of time stepping in the total Lagrangian formulation, by a symmetric composition of leapfrog steps. Default: 4; 6
            for splines of degree 4 and 5.
            `2`: Leapfrog.
            `4`: Five stages.
            `6`: Nine stages.
        return_map: Return map of a law with flow. Default: exponential.
            `exponential`: The direction of flow at the end of a step: first order in time.
            `midpoint`: The direction of flow at the middle of a step: second order in time.
        volume: Change of volume: projected is against locking next to incompressibility. Default: pointwise.
            `pointwise`: The stress of a particle follows from its own change of volume.
            `projected`: The change of volume and the mean stress are projected onto fewer functions, as F-bar methods do: against locking
                next to incompressibility.
        layout: Positions of the particles. gauss: total Lagrangian formulation only; body-fitted, clipped: updated Lagrangian formulation
            only. Default: lattice; gauss in the total Lagrangian formulation, unless all sides are sliding walls.
            `lattice`: Centres of equal parts of a cell.
            `body-fitted`: Polar cells of equal angle that end at the rims (rings, updated Lagrangian).
            `clipped`: A lattice clipped with the boundary of the body: polygons or polyhedra on shared corners (updated Lagrangian, not on
                a line).
            `gauss`: Gauss-Legendre points (total Lagrangian).
        grid: Coordinates of the background grid. Default: cartesian; in the total Lagrangian formulation polar for rings and spherical for
            shells.
            `cartesian`: Cartesian.
            `polar`: Radius and angle.
            `cylindrical`: Radius, angle and height.
            `spherical`: Radius, polar angle and azimuth, without a cone of 45 degrees about the third axis.
        cfl_speed: Wave speed in the CFL number. Default: bar; viscous if the stress follows the rate of the deformation; p-wave if mms
            chose both the total Lagrangian formulation and the CFL number itself, or a CFL number of less than 0.4.
            `bar`: Speed of waves in a bar, sqrt(E/rho0), unless the specification states a wave speed.
            `p-wave`: Speed of P-waves in the undeformed solid, sqrt((lambda + 2 mu)/rho0).
            `viscous`: Speed of P-waves made larger by the viscosity of the law on narrow cells: v + sqrt(c^2 + v^2), where v = 2 eta/(rho0
                h).
        integrator: Time integrator. Default: cd.
            `usf`: Update stress first.
            `usl`: Update stress last.
            `musl`: Update stress last, with the velocity projected again.
            `usavg`: Stress updated by halves, before the forces and after.
            `cd`: Centred differences.
        transfer: Transfer of velocities from the grid to the particles: flip, pic, apic, or xpic2, xpic3, ... (a filter of that order).
            Default: flip.
        start: First velocity of the integrator cd in the updated Lagrangian formulation; refused elsewhere. Default: halved.
            `exact`: The exact velocity half a step before time zero.
            `data`: Velocity and acceleration at time zero.
            `halved`: Velocity at time zero, first acceleration halved.
        ppc: Particles per cell and direction. Default: 2; with Gauss points the degree of the splines plus 1.
        cfl: CFL number: time step times wave speed over grid spacing. Default: 0.4, or less if that exceeds 0.6 on the fastest P-waves of
            the motion; in the total Lagrangian formulation a number that suits the splines.
        periods: End time, in periods of the solution. Default: 1.
        extent: Part of a ring or a shell that is simulated. Default: the part between its planes of symmetry, if it has any.
            `quarter`: The part between the planes of symmetry: a quarter of a ring, an eighth of a shell.
            `full`: All of it.
        offset: Shift of the lattice of particles along every axis, in particle distances, from -0.5 to 0.5. Default: 0.
        grid_angle: Angle from the body to the background grid in degrees, counter-clockwise. Particles are then clipped at the boundary of
            the body. Default: 0.
        grid_shift: Shift of the background grid along each axis, in cells, from -1 to 1. Particles are then clipped at the boundary of the
            body. Default: 0.
        precision: Precision of the solver; errors are always measured in f64. Default: f64.
            `f64`: Double.
            `f32`: Single.
        set: Value of a parameter, in place of its default.
        threads: Number of threads. Default: all cores.
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
    """Measure error against cost over all schemes that fit, and name the cheapest setting for an error.

    Args:
        solution: What `load` gave, a name, or the path of a specification.
        budget: Time of the whole command, such as 90s, 2m or 1h; what is left is used to repeat timings. Default: 2m.
        cells: Run every scheme that fits on these numbers of cells, in place of a sweep within a budget; such cases can be distributed with
            shard.
        cfls: CFL numbers for cells. Default: 0.4.
        tolerance: Name the cheapest setting with at most this error, and run it once more to confirm; exit status 1 if there is none.
        time: Name the most accurate setting whose steps take at most this time, and run it once more to confirm; exit status 1 if there is
            none.
        field: Field whose error is compared. Errors of u are divided by the amplitude A, if the solution has this parameter. Default: u.
            `u`: Displacement.
            `v`: Velocity.
            `f`: Deformation gradient.
            `p`: First Piola-Kirchhoff stress.
        norm: Norm of the error. Default: linf.
            `linf`: Largest over particles.
            `l2`: Root of the mean square.
            `l1`: Mean.
        against: Cost. Default: wall.
            `wall`: Wall-clock time of the steps.
            `cpu`: Processor time of the steps.
            `steps`: Number of steps.
            `memory`: Memory, estimated.
        periods: End time, in periods of the solution. Default: 1.
        threads: Number of threads. Default: 1, and all cores for comparison.
        set: Value of a parameter, in place of its default.
        json: Keep the JSON of the result in this file.
        csv: Write all settings to this file as comma-separated values.
        plot: Draw error against cost, with the front, to this SVG file.
        advice: Write a page of advice to this Markdown file, with the figure behind each sentence.
        out: Keep every finished case in this folder, and read finished cases from it: a study that was killed continues where it stopped,
            and several processes may share the folder.
        shard: Compute only the cases of shard I of N, of about equal predicted cost, and write no table. The shards of a study run on as
            many machines, in any order; the same command without this option prints the table. mms batch writes the script.
        progress: Called with the share that is done and a line about the work under way. True: a line on standard error. Default: True
            where standard error is a terminal.
    """
    return invoke(Tradeoff, "tradeoff", (solution,), locals())


@named
def score(
    solution: Named,
    /,
    *files: str | os.PathLike[str],
    newton: str | os.PathLike[str] | None = None,
    each: bool = False,
    map: Mapping[str, str] | None = None,
    points: Literal["auto", "current", "reference"] | None = None,
    time: float | None = None,
    times: float | Iterable[float] | None = None,
    times_from: str | os.PathLike[str] | None = None,
    frame_step: float | None = None,
    origin: float | Iterable[float] | None = None,
    length_unit: float | None = None,
    time_unit: float | None = None,
    axes: str | Iterable[str] | None = None,
    inside: bool = False,
    velocity_lag: float | Iterable[float] | None = None,
    periods: float | None = None,
    cells: int | Iterable[int] | None = None,
    h: float | Iterable[float] | None = None,
    expect: float | str | Mapping[str, float] | None = None,
    tolerance: float | None = None,
    differences: float | Iterable[float] | None = None,
    against: str | None = None,
    cfl: float | None = None,
    set: Mapping[str, float] | None = None,
    threads: int | None = None,
    json: str | os.PathLike[str] | None = None,
    progress: Progress = None,
) -> Score:
    """Measure errors and orders of another solver from its output files.

    Args:
        solution: What `load` gave, a name, or the path of a specification.
        files: The recordings, one for each resolution: lists, folders, or files.
        newton: Judge how the residuals of Newton's method fall, which tests the tangent: a CSV log with the columns step, iteration and
            residual, of which the first two may be left out; the first residual of a step is that before any iteration. Needs no solution.
        each: Each file is a recording of its own.
        map: Role of an array that has no usual name. Roles: displacement, velocity, deformation_gradient, displacement_gradient,
            first_piola_kirchhoff, cauchy, kirchhoff, J, density, reference_position, id.
        points: Meaning of the points in the files. Default: auto.
            `auto`: Reference positions if they stay while displacements change, else current ones.
            `current`: Current positions.
            `reference`: Reference positions.
        time: Time of a single frame that does not state it.
        times: Times of the frames that do not tell them, one for each frame, the same for all recordings.
        times_from: Times of the frames from a file: its column time or t, or plain numbers.
        frame_step: Time from each frame to the next; the first frame is at t = 0.
        origin: Place of the solution's origin in the files, in the solution's unit of length.
        length_unit: Unit of lengths in the files, in that of the solution: 0.001 for millimetres beside metres. Default: 1.
        time_unit: Unit of times in the files, in that of the solution: 0.001 for milliseconds beside seconds. Default: 1.
        axes: Axes of the files that are the solution's, such as x,z. Default: x,y,z, as many as there are dimensions.
        inside: Leave out points outside the body, such as particles of walls.
        velocity_lag: Times by which velocities lag behind their frame, one for all recordings or one for each: half a time step in
            staggered schemes. Default: 0.
        periods: Time in which frames are expected, in periods of the solution. Default: 1.
        cells: Cell counts along the solution's cell length, one for each recording.
        h: Mesh sizes, one for each recording. Default: estimated from the particles.
        expect: Orders to be met: a number for u, or by field and norm, such as u=2,v=1,cauchy.l2=1. A missed order gives exit status 1.
            Default: the error of every recorded field must fall, with an L2 order of at least 0.5.
        tolerance: How far the order on the finest pair may be from the expected one. Default: 0.1.
        differences: Orders in time: compare each recording with the next one in place of the exact solution. The recordings differ in their
            time steps only; the values are these steps, in a constant ratio.
        against: Run mms with this shape function and integrator on the same grids, and compare the errors digit by digit.
        cfl: CFL number of the runs for against. Default: 0.4.
        set: Value of a parameter, in place of its default.
        threads: Number of threads. Default: all cores.
        json: Keep the JSON of the result in this file.
        progress: Called with the share that is done and a line about the work under way. True: a line on standard error. Default: True
            where standard error is a terminal.
    """
    return invoke(Score, "score", (solution, *files), locals())
