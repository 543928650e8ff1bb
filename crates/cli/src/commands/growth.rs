//! Growth of disturbances of the exact motion, as commands tell it that do not measure it alone.

use mmsmith_solutions::AnySolution;
use mmsmith_verify::{
    A_DIGIT, Extremes, Growth, GrowthError, GrowthSettings, Harm, MOST_GROWTH, Volume, extremes_of,
    growth, harmful_growth, lambda_over_mu,
};
use serde_json::{Map, Value, json};

use super::problem::Problem;
use crate::library::Selection;
use crate::number;

/// Digits of numbers in sentences.
const DIGITS: usize = 2;

/// Solutions whose volume does not change, which have no large pressure at any Poisson's ratio.
const ISOCHORIC: &str = "shears, shears-3d or ring-isochoric";

/// Points times steps of a run that a command takes which does something else: about half a second.
pub(crate) const MOST_GROWTH_WORK: f64 = 2.5e6;

/// Cells where the usual ones take more than that.
const COARSE: usize = 6;

/// A factor in words: `1600 times`.
pub(crate) fn times(factor: f64) -> String {
    match factor {
        factor if factor > MOST_GROWTH => "more than 1e16 times".to_owned(),
        factor if factor >= 1e5 => format!("{factor:.1e} times"),
        factor => format!("{} times", number::rounded(factor, DIGITS)),
    }
}

/// A motion with less pressure, in words.
pub(crate) fn instead(selection: &Selection, periods: f64) -> String {
    let own = smaller(selection, periods);
    let own = own.map(|A| {
        format!("--set A={} (a pressure of two shear moduli at most), or ", number::exact(A))
    });
    format!("{}a motion with J = 1, as {ISOCHORIC}", own.unwrap_or_default())
}

/// The largest amplitude, rounded down to one digit, whose pressure stays harmless.
fn smaller(selection: &Selection, periods: f64) -> Option<f64> {
    const HALVINGS: usize = 12;
    let (_, present) = selection.parameters().iter().find(|(name, _)| *name == "A")?;
    let is_harmless = |share: f64| {
        let changed = selection.with(&[("A".to_owned(), share * present)]).ok()?;
        let found = extremes_of(&changed.build().ok()?, periods)?;
        Some(found.are_harmless())
    };
    let (mut harmless, mut harmful) = (1e-6, 1.0);
    if !is_harmless(harmless)? || is_harmless(harmful)? {
        return None;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * f64::sqrt(harmless * harmful) + 0.25 * (harmless + harmful);
        if is_harmless(middle)? { harmless = middle } else { harmful = middle }
    }
    Some(one_digit_of(harmless * present))
}

/// The number with one significant digit at or next below a number above zero.
fn one_digit_of(number: f64) -> f64 {
    let power = number.log10().floor() as i32;
    let unit = |power: i32| format!("1e{power}").parse::<f64>().unwrap_or(number);
    // By way of text, so that it is the nearest number to its digits.
    let digit = (number / unit(power)).floor();
    format!("{digit}e{power}").parse().unwrap_or(number)
}

/// Causes of errors that lie in the motion and the material, not in the scheme: disturbances that grow, and locking next to
/// incompressibility. Nothing in ordinary motions.
pub(crate) struct Warnings {
    growth: Option<(Harm, String)>,
    /// Lame's constants' quotient, where it is large.
    locking: Option<f64>,
}

/// Lame's constants' quotient lambda/mu from which on schemes without a cure are said to lock: `nu = 0.495`.
const LOCKING: f64 = 100.0;

/// The cure of locking, as a sentence.
const CURE: &str = "--volume projected is against it.";

impl Warnings {
    /// Measures them for a problem, once.
    pub(crate) fn of(problem: &Problem) -> Self {
        let Problem { selection, model, settled } = problem;
        let found = Self::until(selection, &model.exact, settled.case.periods);
        match settled.case.volume {
            Volume::Pointwise => found,
            Volume::Projected => found.without_locking(),
        }
    }

    /// As [`of`](Self::of), until so many periods.
    pub(crate) fn until(selection: &Selection, exact: &AnySolution<f64>, periods: f64) -> Self {
        let growth = harmful_growth(exact, periods);
        Self {
            growth: growth.map(|found| (found, instead(selection, periods))),
            locking: lambda_over_mu(exact).filter(|quotient| *quotient > LOCKING),
        }
    }

    /// The warnings for a scheme that has a cure for locking, or may have one.
    pub(crate) fn without_locking(self) -> Self {
        Self { locking: None, ..self }
    }

    /// How much errors grow; one where they do not.
    pub(crate) fn factor(&self) -> f64 {
        self.growth.as_ref().map_or(1.0, |(found, _)| found.factor)
    }

    /// Two numbers by which warnings are compared: the growth of errors, and lambda/mu where it locks.
    pub(crate) fn severity(&self) -> (f64, f64) {
        (self.factor(), self.locking.unwrap_or_default())
    }

    /// Why orders that are missed prove nothing, where errors grow.
    pub(crate) fn not_judged(&self) -> Option<String> {
        let (found, instead) = self.growth.as_ref()?;
        Some(format!(
            "Orders are not judged: errors grow {} in this motion, whatever the scheme. Judge by {instead}.",
            grown(found)
        ))
    }

    /// Lines of them.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        if let Some((found, instead)) = &self.growth {
            text += &format!(
                "warning: errors grow {} in this motion, whatever the scheme: {}. Errors and orders below that floor tell of the motion, and \
                 are not judged.\n  Judge by {instead}; mms stability --exact tells more.\n",
                grown(found),
                cause(&found.extremes),
            );
        }
        if let Some(quotient) = self.locking {
            text += &format!(
                "warning: lambda/mu is {}: without a projected change of volume schemes lock, so that errors of u are several times, and those of P \
                 thousands of times, what they are at nu = 0.3.\n  {}\n",
                number::rounded(quotient, DIGITS),
                CURE
            );
        }
        text
    }

    /// Puts them among results, where there are some.
    pub(crate) fn insert(&self, results: &mut Map<String, Value>) {
        if let Some((found, instead)) = &self.growth {
            let mut document = json!(found);
            document["instead"] = json!(instead);
            results.insert("growth".into(), document);
        }
        if let Some(quotient) = self.locking {
            results.insert("locking".into(), json!({ "lambda_over_mu": quotient }));
        }
    }
}

/// The cause that drives disturbances on.
fn cause(extremes: &Extremes) -> String {
    match extremes.wave_stiffness > 0.0 {
        true => format!(
            "its pressure of up to {} shear moduli drives every disturbance on",
            number::rounded(extremes.pressure_over_mu, DIGITS)
        ),
        false => "plane waves lose their stiffness in it, so that the law is not elliptic there"
            .to_owned(),
    }
}

/// A factor of growth in words, and whether it is measured.
fn grown(found: &Harm) -> String {
    match found.measured {
        true => times(found.factor),
        false => format!("up to {} (an estimate)", times(found.factor)),
    }
}

/// Pressure, shear and the growth of a coarse wave, as `check` and `explain` tell them.
pub(crate) struct Told {
    extremes: Option<Extremes>,
    /// None where nothing drives a disturbance on.
    growth: Option<Result<Growth, GrowthError>>,
}

impl Told {
    /// Until so many periods, with at most so much work; beyond it it is said that it was left out.
    pub(crate) fn measure(exact: &AnySolution<f64>, periods: f64, most_work: f64) -> Self {
        let extremes = extremes_of(exact, periods);
        if extremes.as_ref().is_some_and(Extremes::are_harmless) {
            return Self { extremes, growth: None };
        }
        let settings = GrowthSettings {
            periods,
            cells: None,
            degree: None,
            waves: 1,
            iterations: 0,
            most_work: Some(most_work),
        };
        let on = |cells: Option<usize>| growth(exact, &GrowthSettings { cells, ..settings });
        // Next to incompressibility steps are short.
        let found = match on(None) {
            Err(GrowthError::Work { .. }) => on(Some(COARSE)),
            found => found,
        };
        Self { extremes, growth: Some(found) }
    }

    /// Lines of it.
    pub(crate) fn text(&self, margin: &str) -> String {
        let mut text = String::new();
        if let Some(extremes) = &self.extremes {
            text += &format!("{margin}{}\n", of_extremes(extremes));
        }
        text += &match &self.growth {
            None => format!(
                "{margin}the exact motion is stable: its pressure is too small to drive a disturbance on, and all plane waves are stiff\n"
            ),
            Some(Ok(found)) if found.extremes.wave_stiffness <= 0.0 => format!(
                "{margin}the exact motion is UNSTABLE: a disturbance in one wave grows {} in a period, and shorter waves grow more\n",
                times(found.factor)
            ),
            Some(Ok(found)) if found.factor < A_DIGIT => format!(
                "{margin}the exact motion is stable: a disturbance in one wave grows {} in a period\n",
                times(found.factor)
            ),
            Some(Ok(found)) => format!(
                "{margin}the exact motion is UNSTABLE: a disturbance in one wave grows {} in a period, which costs every scheme {:.1} digits\n",
                times(found.factor),
                found.digits
            ),
            Some(Err(reason)) => {
                let elsewhere = match reason {
                    GrowthError::Work { .. } => " (mms stability --exact does)",
                    _ => "",
                };
                format!(
                    "{margin}growth of disturbances of the exact motion not measured: {reason}{elsewhere}\n"
                )
            }
        };
        text
    }

    /// It for programs.
    pub(crate) fn document(&self) -> Value {
        let mut document = Map::new();
        if let Some(extremes) = &self.extremes {
            document.insert("extremes".into(), json!(extremes));
        }
        match &self.growth {
            None => {}
            Some(Ok(found)) => {
                document.insert("factor".into(), json!(found.factor));
                document.insert("digits".into(), json!(found.digits));
            }
            Some(Err(reason)) => {
                document.insert("not_measured".into(), json!(reason.to_string()));
            }
        }
        document.into()
    }
}

/// Largest pressure and shear in words.
pub(crate) fn of_extremes(extremes: &Extremes) -> String {
    let Extremes { pressure, pressure_over_mu, shear, change_of_volume, .. } = extremes;
    let lost = match extremes.wave_stiffness > 0.0 {
        true => String::new(),
        false => format!(
            "; plane waves lose their stiffness, which falls to {} of that at rest: the law is not elliptic there, and the shortest waves grow most",
            number::rounded(extremes.wave_stiffness, DIGITS)
        ),
    };
    format!(
        "largest pressure {}, {} shear moduli; largest shear {}; largest |J - 1| {}{lost}",
        number::rounded(*pressure, DIGITS),
        number::rounded(*pressure_over_mu, DIGITS),
        number::rounded(*shear, DIGITS),
        number::rounded(*change_of_volume, DIGITS)
    )
}
