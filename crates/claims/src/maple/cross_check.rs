//! Entries of a listing against derived expressions, in high precision.

use crate::maple::{BuildError, Listing};
use mmsmith_expr::{Expr, Graph, Rational, nearest_f64};
use mmsmith_oracle::{Oracle, OracleError, Point, scientific};
use num_traits::{Signed, Zero};
use std::collections::BTreeMap;
use std::fmt;
use thiserror::Error;

/// Digits to which both sides are computed where precision has to be raised for them.
const SETTLED_DIGITS: usize = 60;
/// Digits beyond which two values count as equal: the digits that [`Oracle::settle`] makes sure of.
const MOST_DIGITS: f64 = SETTLED_DIGITS as f64;
/// Agreement to this many digits at every point verifies a component.
const VERIFIED_DIGITS: f64 = 40.0;

/// A listing, and the derived expressions to compare it with.
#[derive(Clone, Copy, Debug)]
pub struct CrossCheck<'a> {
    /// The graph of the derived expressions.
    pub graph: &'a Graph,
    /// Definitions of further symbols, such as the polar radius.
    pub definitions: &'a [(Expr, Expr)],
    /// The listing.
    pub listing: &'a Listing,
    /// The free names of the listing, as expressions of the graph.
    pub names: &'a BTreeMap<String, Expr>,
    /// Which entries of the listing should equal which derived expressions.
    pub targets: &'a [Target],
}

/// An entry of a listing and the expression that it should equal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    /// The entry, such as `b[0]`.
    pub entry: String,
    /// The derived expression.
    pub derived: Expr,
}

/// The reason why nothing could be compared.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CrossCheckError {
    /// The listing has no meaning in the graph.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The listing lacks an entry.
    #[error("the listing assigns no {entry}; it assigns {assigned}")]
    Missing {
        /// The entry.
        entry: String,
        /// The names that the listing assigns; temporaries are left out where there are entries with indices.
        assigned: String,
    },
    /// One side has no value at a point.
    #[error("{entry} has no value at {place}: {cause}")]
    Value {
        /// The entry.
        entry: String,
        /// The point.
        place: String,
        /// The reason.
        cause: Box<OracleError>,
    },
    /// The precision is not offered.
    #[error(transparent)]
    Oracle(OracleError),
    /// There was no point to compare at.
    #[error("a cross-check needs at least one point")]
    NoPoints,
}

/// Results, component by component.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// An outcome for each target, in their order.
    pub components: Vec<Component>,
    /// Entries with indices that the listing assigns without a target.
    pub unchecked: Vec<String>,
}

impl Report {
    /// Whether every component is verified: agrees to 40 digits or more at every point.
    #[must_use]
    pub fn verified(&self) -> bool {
        self.components
            .iter()
            .all(|component| matches!(component.verdict, Verdict::Verified { .. }))
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for component in &self.components {
            writeln!(f, "{component}")?;
        }
        if !self.unchecked.is_empty() {
            writeln!(f, "not compared: {}", self.unchecked.join(", "))?;
        }
        Ok(())
    }
}

/// The outcome for one target.
#[derive(Clone, Debug, PartialEq)]
pub struct Component {
    /// The entry, such as `b[0]`.
    pub entry: String,
    /// The number of points at which it was compared.
    pub points: usize,
    /// The outcome of the comparison.
    pub verdict: Verdict,
}

/// Whether two expressions are equal.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// They agree to 40 digits or more at every point.
    Verified {
        /// The digits at the worst point; 60 are computed.
        digits: f64,
    },
    /// They differ.
    Refuted {
        /// The digits to which they agree at the worst point; negative where they differ by more than their size.
        digits: f64,
        /// The number of points at which they differ.
        differing: usize,
        /// The worst point: inputs by name with their values.
        place: Vec<(String, f64)>,
        /// The listing's value there.
        listing: Rational,
        /// The derived value there.
        derived: Rational,
    },
}

impl fmt::Display for Component {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Component { entry, points, verdict } = self;
        match verdict {
            Verdict::Verified { digits } => {
                write!(f, "{entry} verified to {digits:.0} digits at {points} points")
            }
            Verdict::Refuted { digits, differing, place, listing, derived } => {
                let place: Vec<String> =
                    place.iter().map(|(name, value)| format!("{name} = {value:?}")).collect();
                write!(
                    f,
                    "{entry} differs at {differing} of {points} points, most at {}: the listing gives {}, the derivation {} ({:.1} digits in common)",
                    place.join(", "),
                    scientific(listing, 20),
                    scientific(derived, 20),
                    digits.max(0.0)
                )
            }
        }
    }
}

/// Compares entries of a listing with derived expressions at `points`, which give every input a value.
///
/// Digits are counted relative to the larger of the two values.
///
/// # Errors
///
/// [`CrossCheckError`] where the listing has no meaning, lacks an entry, or a side has no value at a point.
pub fn cross_check(
    check: &CrossCheck<'_>,
    points: impl IntoIterator<Item = Vec<(Expr, Rational)>>,
) -> Result<Report, CrossCheckError> {
    let mut graph = check.graph.clone();
    let built = check.listing.build(&mut graph, check.names)?;
    let mut sides = Vec::new();
    for target in check.targets {
        let Some(&listed) = built.get(&target.entry) else {
            let entry = target.entry.clone();
            return Err(CrossCheckError::Missing { entry, assigned: assigned(check.listing) });
        };
        sides.push([listed, target.derived]);
    }
    let mut oracle = Oracle::new(Oracle::USUAL_BITS).map_err(CrossCheckError::Oracle)?;
    let mut worst: Vec<Option<Worst>> = vec![None; sides.len()];
    let mut count = 0;
    for values in points {
        count += 1;
        let point = Point { graph: &graph, definitions: check.definitions, values: &values };
        for ((side, worst), target) in sides.iter().zip(&mut worst).zip(check.targets) {
            let found = oracle.settle(&point, side, SETTLED_DIGITS);
            let found = found.map_err(|error| CrossCheckError::Value {
                entry: target.entry.clone(),
                place: place(&graph, &values)
                    .iter()
                    .map(|(name, value)| format!("{name} = {value:?}"))
                    .collect::<Vec<_>>()
                    .join(", "),
                cause: Box::new(error),
            })?;
            let [listing, derived] = [found[0].clone(), found[1].clone()];
            let digits = digits_in_common(&listing, &derived);
            let differing = worst.as_ref().map_or(0, |w| w.differing);
            let differing = differing + usize::from(digits < VERIFIED_DIGITS);
            match worst {
                Some(worst) if worst.digits <= digits => worst.differing = differing,
                _ => {
                    let values = values.clone();
                    *worst = Some(Worst { digits, differing, values, listing, derived });
                }
            }
        }
    }
    if count == 0 {
        return Err(CrossCheckError::NoPoints);
    }
    let components = check.targets.iter().zip(worst).filter_map(|(target, worst)| {
        let Worst { digits, differing, values, listing, derived } = worst?;
        let verdict = if differing == 0 {
            Verdict::Verified { digits }
        } else {
            let place = place(&graph, &values);
            Verdict::Refuted { digits, differing, place, listing, derived }
        };
        Some(Component { entry: target.entry.clone(), points: count, verdict })
    });
    let components = components.collect();
    let unchecked = built.keys().filter(|name| {
        name.contains('[') && !check.targets.iter().any(|target| target.entry == **name)
    });
    Ok(Report { components, unchecked: unchecked.cloned().collect() })
}

/// The point of least agreement so far.
#[derive(Clone, Debug)]
struct Worst {
    digits: f64,
    differing: usize,
    values: Vec<(Expr, Rational)>,
    listing: Rational,
    derived: Rational,
}

fn assigned(listing: &Listing) -> String {
    let targets = listing.assignments.iter().map(|assignment| assignment.target.as_str());
    let entries: Vec<&str> = targets.clone().filter(|target| target.contains('[')).collect();
    if entries.is_empty() { targets.collect::<Vec<_>>().join(", ") } else { entries.join(", ") }
}

fn place(graph: &Graph, values: &[(Expr, Rational)]) -> Vec<(String, f64)> {
    values
        .iter()
        .map(|(input, value)| {
            (graph.symbol_name(*input).unwrap_or_default().to_owned(), nearest_f64(value))
        })
        .collect()
}

/// `-log10(|a - b| / max(|a|, |b|))`, at most the number of computed digits.
fn digits_in_common(a: &Rational, b: &Rational) -> f64 {
    let difference = (a - b).abs();
    if difference.is_zero() {
        return MOST_DIGITS;
    }
    let scale = a.abs().max(b.abs());
    (-nearest_f64(&(difference / scale)).log10()).min(MOST_DIGITS)
}
