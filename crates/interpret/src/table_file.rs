//! Fields that follow from histories as a file of text, which hosts read.
//!
//! All words and numbers are separated by white space, and each kind of thing begins a line of its own, so that a list-directed read in
//! Fortran and `fscanf` in C are enough. Positions come first and coefficients last, in the order in which they are used.

use crate::history::{
    Chart, Histories, HistoryProblem, LARGEST_ERROR, OverAxes, Tables, first_entries,
};
use crate::{InterpretError, Interpreted, resolve};
use mmsmith_history::{AtPoint, HistoryError, Table};
use mmsmith_spec::{Coordinates, Spec};
use mmsmith_stage::Staged;
use mmsmith_threads::parallel::*;
use std::fmt::Write;
use thiserror::Error;

/// The version of the format.
const VERSION: u32 = 1;

/// The shape of a tabulated field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldShape {
    /// One number.
    Scalar,
    /// One for each dimension.
    Vector,
    /// A row for each dimension.
    Matrix,
    /// A symmetric tensor in space: its entries 11, 22, 33, 12, 13, 23.
    Symmetric,
}

impl FieldShape {
    /// The word of the file.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Vector => "vector",
            Self::Matrix => "matrix",
            Self::Symmetric => "symmetric",
        }
    }

    /// How many numbers it has.
    #[must_use]
    pub fn size(self, dimension: usize) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Vector => dimension,
            Self::Matrix => dimension * dimension,
            Self::Symmetric => 6,
        }
    }
}

/// A tabulated field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TabulatedField {
    /// `b`, `P`, the name of an internal variable, or the stem of those that are a tensor's entries.
    pub name: String,
    /// Its shape.
    pub shape: FieldShape,
}

/// A file of the body force, the stress and the internal variables of a solution.
#[derive(Clone, Debug, PartialEq)]
pub struct TableFile {
    /// The fields, in the order of the file: `b`, `P`, then the internal variables.
    pub fields: Vec<TabulatedField>,
    /// The number of space dimensions.
    pub dimension: usize,
    /// The internal variables by name.
    pub variables: Vec<String>,
    /// Pieces in time and polynomials in each; none where points have series of their own.
    pub in_time: Option<[usize; 2]>,
    /// Where the table ends.
    pub end: f64,
    /// The error that was told, as a share of the largest value of each field.
    pub error: f64,
    content: String,
}

/// The places of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Over<'a> {
    /// All of the body, in Cartesian coordinates and components.
    Body,
    /// The same; of an axisymmetric body the places are radius, angle and height, and the components those along them.
    HalfPlane,
    /// These points alone.
    Points(&'a [Vec<f64>]),
}

/// Why there is no such file.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TableFileError {
    /// The solution cannot be built.
    #[error(transparent)]
    Solution(#[from] InterpretError),
    /// The stress is a formula.
    #[error("the stress is a formula of position and time, which needs no table")]
    NoHistory,
    /// A history cannot be followed.
    #[error(transparent)]
    History(#[from] HistoryError),
    /// Fields with a front, which no polynomial follows.
    #[error(
        "no table over the body is accurate, because particles begin or stop to flow on the way"
    )]
    Front,
    /// Fields with finer waves than the polynomials of a table.
    #[error(
        "no table over the body is accurate: its polynomials miss the fields by {error:.1e} of their largest values, where {most:.0e} are allowed, \
         because the motion or the density has finer waves than these polynomials follow"
    )]
    Rough {
        /// The error.
        error: f64,
        /// The largest error of a table.
        most: f64,
    },
    /// A table has an end.
    #[error(
        "a table ends at some time, and here the end is {0}: write a finite period in [time], such as period = 1"
    )]
    End(f64),
    /// A point whose history cannot be followed.
    #[error("the history of point {0} (counted from 0) cannot be followed")]
    Point(usize),
}

impl TableFile {
    /// Tabulates the fields for some periods of the solution.
    ///
    /// # Errors
    ///
    /// [`TableFileError`] where the solution cannot be built, or where fields are not smooth enough for a table over the body.
    pub fn new<'a>(
        spec: &Spec,
        staged: &Staged,
        overrides: impl IntoIterator<Item = (&'a str, f64)>,
        periods: f64,
        over: Over<'_>,
    ) -> Result<Self, TableFileError> {
        let values = resolve(spec, overrides).map_err(InterpretError::from)?;
        Self::of_values(spec, staged, values, periods, over)
    }

    /// Not generic, so that trajectories are compiled with this crate, and not with a caller that may not be optimised.
    fn of_values(
        spec: &Spec,
        staged: &Staged,
        values: Vec<f64>,
        periods: f64,
        over: Over<'_>,
    ) -> Result<Self, TableFileError> {
        match spec.dimension {
            1 => Self::of::<1>(spec, staged, values, periods, over),
            2 => Self::of::<2>(spec, staged, values, periods, over),
            _ => Self::of::<3>(spec, staged, values, periods, over),
        }
    }

    fn of<const D: usize>(
        spec: &Spec,
        staged: &Staged,
        values: Vec<f64>,
        periods: f64,
        over: Over<'_>,
    ) -> Result<Self, TableFileError> {
        let built = Interpreted::<f64, D>::new(spec, staged, values.clone())?;
        let end = periods * built.period;
        if !end.is_finite() || end <= 0.0 {
            return Err(TableFileError::End(end));
        }
        let histories = built.history.ok_or(TableFileError::NoHistory)?;
        let fields = fields(&histories.names);
        let mut content = head(spec, &values);
        let (error, in_time) = if let Over::Points(points) = over {
            let all = at_points(&histories, points, end)?;
            let error = all.iter().fold(0.0_f64, |most, (_, tail)| most.max(*tail));
            measures(&mut content, D, [end, error], &fields);
            let _ = write!(content, "chart points\nframe cartesian\npoints {}\n", all.len());
            for (X, (series, _)) in points.iter().zip(&all) {
                series_of_point(&mut content, X, series, fields_size(&fields, D));
            }
            (error, None)
        } else {
            let tables = Tables::new(&histories, end, histories.tolerance_of_files())?;
            let why = || match tables.error.is_nan() {
                true => TableFileError::Front,
                false => TableFileError::Rough { error: tables.error, most: LARGEST_ERROR },
            };
            let table = tables.table.as_ref().ok_or_else(why)?;
            measures(&mut content, D, [end, tables.error], &fields);
            let is_in_half_plane =
                over == Over::HalfPlane && spec.coordinates == Coordinates::Axisymmetric;
            let of = (&histories, spec.coordinates, is_in_half_plane);
            let in_time = match table {
                OverAxes::One(table) => over_body(&mut content, table, of),
                OverAxes::Two(table) => over_body(&mut content, table, of),
                OverAxes::Three(table) => over_body(&mut content, table, of),
            };
            (tables.error, Some(in_time))
        };
        Ok(Self { fields, dimension: D, variables: histories.names, in_time, end, error, content })
    }

    /// The text after the digest in the file.
    #[must_use]
    pub fn content(&self) -> &str {
        &self.content
    }

    /// The text of the file, with a digest by which sources know their table.
    #[must_use]
    pub fn text(&self, digest: &str) -> String {
        format!("mmsmith-table {VERSION}\ndigest {digest}\n{}", self.content)
    }
}

/// Body force and stress, then internal variables, tensors among them as one field each.
fn fields(names: &[String]) -> Vec<TabulatedField> {
    let field = |name: &str, shape| TabulatedField { name: name.to_owned(), shape };
    let mut fields = vec![field("b", FieldShape::Vector), field("P", FieldShape::Matrix)];
    let tensors = first_entries(names);
    let mut place = 0;
    while let Some(first) = names.get(place) {
        let stem = first.strip_suffix("11").filter(|_| tensors.contains(&place));
        let (name, shape) =
            stem.map_or((first.as_str(), FieldShape::Scalar), |stem| (stem, FieldShape::Symmetric));
        fields.push(field(name, shape));
        place += shape.size(1);
    }
    fields
}

fn fields_size(fields: &[TabulatedField], dimension: usize) -> usize {
    fields.iter().map(|field| field.shape.size(dimension)).sum()
}

/// The solution and its parameters.
fn head(spec: &Spec, values: &[f64]) -> String {
    let mut text = format!("solution {}\nparameters {}\n", spec.name, values.len());
    for (parameter, value) in spec.parameters.iter().zip(values) {
        let _ = writeln!(text, "{} {value:e}", parameter.name);
    }
    text
}

/// End, error, dimension and fields.
fn measures(
    text: &mut String,
    dimension: usize,
    [end, error]: [f64; 2],
    fields: &[TabulatedField],
) {
    let _ = write!(
        text,
        "end {end:e}\nerror {error:e}\ndimension {dimension}\nfields {}\n",
        fields.len()
    );
    for TabulatedField { name, shape } in fields {
        let _ = writeln!(text, "{name} {}", shape.word());
    }
}

/// The table over the body, and its pieces in time and the polynomials in each.
fn over_body<const K: usize, const D: usize>(
    text: &mut String,
    table: &Table<K>,
    (histories, coordinates, is_in_half_plane): (&Histories<D>, Coordinates, bool),
) -> [usize; 2] {
    let grid = table.grid();
    let chart = match histories.chart {
        _ if is_in_half_plane => "box",
        Chart::Box { .. } => "box",
        Chart::Annulus { .. } => "annulus",
        Chart::Tube { .. } => "tube",
    };
    let frame = match coordinates {
        _ if is_in_half_plane => "cartesian",
        Coordinates::Cartesian => "cartesian",
        Coordinates::Polar | Coordinates::Cylindrical | Coordinates::Axisymmetric => "polar",
        Coordinates::Spherical => "spherical",
    };
    let _ = write!(text, "chart {chart}\nframe {frame}\naxes {K}\n");
    for ((axis, [low, high]), count) in histories.axes.iter().zip(grid.range).zip(grid.in_space) {
        let _ = writeln!(text, "{axis} {low:e} {high:e} {count}");
    }
    let in_time = [grid.knots.len().saturating_sub(1), grid.in_time];
    let _ = writeln!(text, "pieces {} {}", in_time[0], in_time[1]);
    line(text, grid.knots.iter().copied());
    let steps = in_time[0] * in_time[1];
    let columns: Vec<&[f64]> = table.columns().collect();
    let _ = writeln!(text, "coefficients {}", columns.iter().map(|c| c.len()).sum::<usize>());
    for (quantity, columns) in columns.chunks(steps.max(1)).enumerate() {
        for column in columns {
            rounded(text, column, NEXT_TO_NOTHING * table.largest(quantity));
        }
    }
    in_time
}

/// Coefficients that are less than this share of the largest value of their quantity are written as zero: a thousandth of the rounding of
/// a double.
const NEXT_TO_NOTHING: f64 = 1.0 / (1_u64 << 62) as f64;

fn rounded(text: &mut String, values: &[f64], least: f64) {
    line(text, values.iter().map(|value| if value.abs() <= least { 0.0 } else { *value }));
}

/// Numbers with as many digits as a double needs, at most 17.
fn line(text: &mut String, values: impl Iterator<Item = f64>) {
    for (place, value) in values.enumerate() {
        let gap = match place {
            0 => "",
            _ if place % 8 == 0 => "\n",
            _ => " ",
        };
        let _ = match value {
            0.0 => write!(text, "{gap}0"),
            _ => write!(text, "{gap}{value:e}"),
        };
    }
    text.push('\n');
}

/// Each point's series in Cartesian components, with the part that it leaves out.
fn at_points<const D: usize>(
    histories: &Histories<D>,
    points: &[Vec<f64>],
    end: f64,
) -> Result<Vec<(AtPoint, f64)>, TableFileError> {
    let of = |(number, X): (usize, &Vec<f64>)| {
        let X = std::array::from_fn(|i| X.get(i).copied().unwrap_or(f64::NAN));
        histories.cartesian_series(X, end).ok_or(TableFileError::Point(number))
    };
    points.par_iter().enumerate().map(of).collect()
}

fn series_of_point(text: &mut String, X: &[f64], series: &AtPoint, quantities: usize) {
    for x in X {
        let _ = write!(text, "{x:e} ");
    }
    let in_time = series.in_time();
    let _ = writeln!(text, "{} {in_time}", series.knots().len().saturating_sub(1));
    line(text, series.knots().iter().copied());
    for quantity in 0..quantities {
        let all = series.coefficients(quantity);
        let largest = all.iter().fold(0.0_f64, |most, c| most.max(c.abs()));
        rounded(text, all, NEXT_TO_NOTHING * largest);
    }
}

impl From<HistoryProblem> for TableFileError {
    fn from(problem: HistoryProblem) -> Self {
        Self::Solution(problem.into())
    }
}
