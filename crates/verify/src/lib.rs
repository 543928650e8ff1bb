//! Measures how far field code and a solver are from a manufactured solution.
//!
//! Solutions come from [`mmsmith_runtime`], the solver is [`mmsmith_mpm`], files are those of [`mmsmith_vtk`].
//!
//! - [`check`] compares the fields of a solution with each other, by finite differences and by the solver's own
//!   constitutive law, and the declared boundary conditions at sampled boundary points.
//! - [`coverage()`] measures which terms of the momentum balance a solution exercises.
//! - A case is put on its grid once, as [`Discretized`], which plans, runs and times it.
//! - [`run`] simulates one [`Case`] and measures the errors of displacement, velocity, deformation gradient and
//!   stress; [`converge`] does so for a series of grids or time steps and adds the orders of accuracy.
//!   A run's [history](Moment) has energies and momentum as well, of the run and of the exact motion.
//! - [`score()`] measures what another solver wrote to files, in the same norms.
//! - [`Discretized::differences`] measures the error of time stepping alone, and [`verdicts`] judges orders.
//! - [`tradeoff()`] measures error against cost over all schemes that fit a solution, and [`CostModel`] predicts what a run takes.
//! - [`stability()`] finds the largest stable time step of a scheme.
//! - [`evaluate()`] gives the exact fields at a point.
//!
//! Everything here takes a solution as a value, never by its name, and knows nothing of terminals or arguments.
//! Lengths, times and stresses are in the units of the solution; errors are not divided by anything.

mod across;
mod axis;
mod blind;
mod body;
mod case;
mod check;
mod checkpoint;
mod clock;
mod cost;
mod coverage;
mod difference;
mod dimension;
mod discretized;
mod distortion;
mod drive;
mod error;
mod evaluate;
mod field_row;
mod flow;
mod frames;
mod growth;
mod half_plane;
mod history;
mod interrupt;
mod inverse;
mod inversion;
mod kept_stress;
mod measurement;
mod named;
mod observe;
mod on_grid;
mod order;
mod points;
mod precision;
mod record;
mod refinement;
mod remedy;
mod run;
mod scene;
mod scheme;
mod score;
mod side_on_grid;
mod stability;
mod state_of_stress;
mod stated_law;
mod statics;
mod study;
mod tangent;
mod temporal;
mod timing;
mod total;
mod tradeoff;
mod unit_system;
mod updated;
mod usual_step;
mod verdict;
mod waves;
mod whole_file;

pub use axis::OnAxis;
pub use blind::{BlindSpot, blind_spots};
pub use body::forgotten_cell_length;
pub use case::{Arithmetic, Case, CflSpeed, Extent, InSinglePrecision};
pub use check::{
    BLUNT, Change, CheckError, CheckReport, Finding, NoBody, OWN_ERROR_FACTOR, TOLERANCE, Verdict,
    body_of, check, has_body,
};
pub use checkpoint::{CheckpointError, CheckpointFolder, Checkpoints};
pub use cost::{Cost, CostModel};
pub use coverage::{Part, Share, coverage, smallest_set};
pub use discretized::{Discretized, run};
pub use distortion::{Distortion, distortion};
pub use error::{CaseError, SceneError, StudyError};
pub use evaluate::{BEYOND_LAW, evaluate, evaluate_with_tangent};
pub use field_row::FieldRow;
pub use flow::{flows_smoothly, has_flow, has_memory, history_of};
pub use frames::{FrameOutput, Snapshot};
pub use growth::{
    A_DIGIT, Grown, Growth, GrowthError, GrowthSettings, Harm, MOST_GROWTH, WaveGrowth,
    extremes_of, growth, harmful_growth, lambda_over_mu,
};
pub use half_plane::{is_axisymmetric, needs_space, turns_about_axis};
pub use history::{MOST_MOMENTS, Moment, Sums, energy_drift};
pub use interrupt::{allow, interrupt};
pub use inversion::{Inversion, inversion};
pub use mmsmith_galerkin::{
    Composition, Coordinates, LINEAR, Layout, MassMatrix, QUADRATIC, newton_exponent,
};
pub use mmsmith_laws::{ReturnMap, Volume};
pub use mmsmith_measure::norms::{Field, Norm, PerField, PerNorm};
pub use mmsmith_mpm::{Division, PassTime, Profile, StepError};
pub use mmsmith_mpm::{Integrator, Registers, Shape, Transfer};
pub use mmsmith_ranks::{Ranks, Sent, arranged, gather};
pub use mmsmith_vtk::Provenance;
pub use named::{Named, names};
pub use observe::{Failure, FailureKind, Observed};
pub use on_grid::Plan;
pub use order::{Order, orders_above};
pub use record::{Record, TemporalRecord};
pub use refinement::uneven_refinement;
pub use remedy::{Attempt, Remedy, remedy};
pub use run::{Outputs, Progress, Row, RunTraffic, Status};
pub use scene::{loaded_instead, needs_total_frame};
pub use scheme::{Choice, Formulation, GridPose, Placement, Scheme, Start, Total, Updated};
pub use score::{
    AgainstError, Agreement, Convergence, Deformation, DifferenceRow, Differences, Exchange, Input,
    Integrated, IntegratedOrders, Judgement, Lag, LawRow, LawVerdict, Placing, Points, Quantity,
    RecordedMotion, Remark, Resolution, Role, Score, ScoreError, ScoreOptions, ScoreRow, Source,
    Times, against, compare_recordings, score,
};
pub use stability::{
    Criteria, Search, SearchProgress, StabilityRow, is_stable, p_wave_limit, stability,
};
pub use state_of_stress::Extremes;
pub use statics::{
    StaticCase, StaticErrors, StaticPlan, StaticProblem, StaticRow, StaticState, StaticStep,
    StaticStudy, expected_of_statics, is_at_rest, usual_moment,
};
pub use study::{Study, Sweep, converge};
pub use tangent::{
    JudgedTangent, NamedTangentMistake, TANGENT_MISTAKES, TangentMistake, TangentSample,
    WrongEntry, judge_tangent,
};
pub use temporal::{Temporal, TemporalRow};
pub use timing::Timing;
pub use total::{POLAR_ANGLES, has_uneven_density};
pub use tradeoff::{
    Against, Cheapest, Chosen, Effect, Entry, Goal, LADDER, MARGIN, Machine, Range, Repeat,
    RepeatOutcome, RunOutcome, Setting, SettingName, Skip, TOLERANCES, TimeEffect, Tradeoff,
    differences, extrapolate, families, leading, list, listed, median, pareto, tradeoff,
};
pub use unit_system::UnitPowers;
pub use usual_step::{
    LARGEST_USUAL_CFL, OnPWaves, USUAL_CFL, UsualStep, on_p_waves, stiffest, usual_step,
};
pub use verdict::{
    Behaviour, Expected, ORDER_TOLERANCE, Values, Verdict as OrderVerdict, expected_in_space,
    expected_in_time, verdicts, verdicts_above,
};
pub use whole_file::WholeFile;
