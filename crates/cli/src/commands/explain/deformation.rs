//! How strongly a motion deforms its cells, and whether the usual scheme follows it.

use anyhow::Result;
use mmsmith_verify::{Case, Discretized, Distortion, Outputs, Row, distortion};
use serde_json::{Value, json};

use crate::commands::problem::Model;
use crate::commands::remedy::{Advice, Given};
use crate::commands::scheme::Settled;
use crate::number;

/// The shear from which on the usual scheme is tried: a simple shear by 56 degrees.
const STRONG_SHEAR: f64 = 1.5;
/// Grids that it is tried on: the first that fits the body and is little work.
const GRIDS: [usize; 6] = [24, 16, 12, 8, 6, 4];
/// Particles times steps of that.
const MOST_WORK: f64 = 6e6;

/// The strongest deformation of a motion, and where it is strong how the usual scheme fares.
pub(super) struct Deformation {
    found: Distortion,
    tried: Option<(Row, Option<Advice>)>,
}

impl Deformation {
    /// That of a solution; nothing where its body is not known here.
    pub(super) fn of(name: &str, model: &Model, settled: &Settled) -> Result<Option<Self>> {
        let Some(found) = distortion(&model.exact) else { return Ok(None) };
        let tried = match found.shear >= STRONG_SHEAR {
            true => tried(Given::plain(name), model, &settled.case)?,
            false => None,
        };
        Ok(Some(Self { found, tried }))
    }

    pub(super) fn text(&self) -> String {
        let Distortion { largest_stretch, least_stretch, shear } = self.found;
        let [largest, least, shear] =
            [largest_stretch, least_stretch, shear].map(|value| number::rounded(value, 3));
        let mut text = format!(
            "\nlargest deformation, at sampled places and times of a period\n  principal stretches from {least} to {largest}, \
             shear up to {shear}\n"
        );
        if let Some((row, advice)) = &self.tried {
            text += &format!(
                "  Such a shear draws cells out along it. The usual scheme on {} cells{}: {}\n",
                row.cells,
                if row.status.passed() == Some(true) { "" } else { " does not run" },
                row.status
            );
            text += &advice.as_ref().map(Advice::text).unwrap_or_default();
        }
        text
    }

    pub(super) fn document(&self) -> Value {
        let Distortion { largest_stretch, least_stretch, shear } = self.found;
        let mut document = json!({
            "largest_stretch": largest_stretch,
            "least_stretch": least_stretch,
            "shear": shear,
        });
        if let Some((row, advice)) = &self.tried {
            document["usual_scheme"] = json!({
                "cells": row.cells,
                "status": row.status,
                "advice": advice.as_ref().map(Advice::document),
            });
        }
        document
    }
}

/// A run of the usual scheme on a small grid, and what runs instead where it stopped; nothing where no grid is small enough.
fn tried(given: Given<'_>, model: &Model, usual: &Case) -> Result<Option<(Row, Option<Advice>)>> {
    let on = |cells| model.discretized(&Case { cells, ..*usual }).ok();
    let is_little = |case: &Discretized<'_>| case.plan().work() <= MOST_WORK;
    let Some(case) = GRIDS.into_iter().filter_map(on).find(is_little) else { return Ok(None) };
    let mut quiet = |_| {};
    let row = case.run(&mut Outputs::new(&mut quiet))?;
    let advice = Advice::seek(given, model, case.case(), &row)?;
    Ok(Some((row, advice)))
}
