//! Findings from histories of internal variables, for people and for JSON.

use mmsmith_solutions::{AnySolution, HistoryReport, Smoothness};
use mmsmith_verify::flows_smoothly;
use serde_json::{Value, json};

use crate::table;

/// The smoothness of the body force in a word.
fn word(smoothness: Smoothness) -> &'static str {
    match smoothness {
        Smoothness::Jump => "jump",
        Smoothness::Kink => "kink",
        Smoothness::Smooth => "smooth",
    }
}

/// Where the body flows, and what that means for orders.
pub(super) fn text(report: &HistoryReport, exact: &AnySolution<f64>) -> String {
    let HistoryReport { particles, always, onsets, unloadings, least_margin, smoothness, .. } =
        *report;
    let mut text = String::new();
    if !report.flows {
        return format!("  history: {}\n", tables(report.table_error));
    }
    if least_margin == f64::INFINITY && report.yield_condition == 0.0 && always == 0 {
        text += &format!("  history: none of {particles} particles flows: the body is elastic\n");
    } else if always == particles {
        text += &format!("  history: all of {particles} particles flow from the start to the end");
        if least_margin.is_finite() {
            text += &format!(
                ", the stress grows by {least_margin:.2} of the rate of deformation at least"
            );
        }
        text.push('\n');
    } else {
        text += &format!(
            "  history: of {particles} particles {always} flow from the start, {onsets} begin later, {unloadings} stop\n"
        );
    }
    if onsets + unloadings > 0 {
        text += match smoothness {
            // The root is there: only a second beginning jumps.
            Smoothness::Jump if flows_smoothly(exact) => {
                "    where a particle flows again after a stop b jumps, also with hardening by a root of alpha, which is smooth at alpha = 0 alone: \
                 orders are not judged; with a motion that goes on in one direction they are\n"
            }
            Smoothness::Jump => {
                "    where a particle begins to flow b jumps: orders are not judged; with hardening sy + K*alpha^(1/3), or with \
                 [start] on-yield = true and a motion that goes on in one direction, they are\n"
            }
            Smoothness::Kink => {
                "    where particles begin or stop, b is continuous and its slopes are not: second order shows, higher ones do not\n"
            }
            Smoothness::Smooth => {
                "    where particles begin or stop, the slopes of b are continuous: second order shows\n"
            }
        };
    }
    text += &format!(
        "    |f| of flowing particles {} of the yield stress, |det G - 1| {}, {}\n",
        table::error(report.yield_condition),
        table::error(report.volume),
        tables(report.table_error)
    );
    text
}

/// How exact the series are that a solver is driven by.
fn tables(error: f64) -> String {
    match error.is_finite() {
        true => format!("tables within {} of each field", table::error(error)),
        false => "each particle with series of its own".into(),
    }
}

/// The report as JSON.
pub(super) fn document(report: &HistoryReport) -> Value {
    json!({
        "flows": report.flows,
        "particles": report.particles,
        "always": report.always,
        "onsets": report.onsets,
        "unloadings": report.unloadings,
        "least_margin": report.least_margin.is_finite().then_some(report.least_margin),
        "body_force_at_changes": word(report.smoothness),
        "yield_condition": report.yield_condition,
        "volume": report.volume,
        "table_error": report.table_error.is_finite().then_some(report.table_error),
    })
}
