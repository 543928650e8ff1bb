//! Studies as comma-separated values.

use std::fmt::Write;

use mmsmith_verify::{Moment, Order, PerField, PerNorm, Study, Sums, Temporal};

use crate::table;

/// One line for each row: numbers in shortest round-trip form, `nan` where there is none; right of each error its rate
/// against the row before, two decimals, `nan` where there is none, as readers of numbers want it.
pub(crate) fn text(study: &Study) -> String {
    let mut text = "cells,h,dt,cfl,steps,particles,wall_s,particle_steps_per_s,status".to_owned();
    head(&mut text, &study.orders);
    for (index, row) in study.rows.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "{},{:?},{:?},{:?},{},{},{:?},{:?},{}",
            row.cells,
            row.h,
            row.dt,
            row.cfl,
            row.steps,
            row.particles,
            row.wall_s,
            row.particle_steps_per_s,
            quoted(&row.status.to_string())
        );
        values(&mut text, index, &row.errors, &study.orders);
    }
    text
}

/// As [`text`], for differences on one grid.
pub(crate) fn temporal(temporal: &Temporal) -> String {
    let mut text = "cells,h,dt,cfl,steps,status".to_owned();
    head(&mut text, &temporal.orders);
    for (index, row) in temporal.rows.iter().enumerate() {
        let _ = write!(
            text,
            "{},{:?},{:?},{:?},{},{}",
            row.cells,
            row.h,
            row.dt,
            row.cfl,
            row.steps,
            quoted(&row.status.to_string())
        );
        values(&mut text, index, &row.differences, &temporal.orders);
    }
    text
}

/// A run's history: a line that says what is what, the header, and a line for each moment; `nan` where there is no number.
pub(crate) fn history(history: &[Moment]) -> String {
    let axes = history.first().map_or(0, |moment| moment.exact.momentum.len());
    let names = |of: &str| {
        let momenta = ["x", "y", "z"].iter().take(axes).map(|axis| format!(",{of}momentum_{axis}"));
        format!(",{of}kinetic_energy,{of}strain_energy") + &momenta.collect::<String>()
    };
    let mut text = format!(
        "# u and strain energy at time; kinetic energy and momentum at velocity_time, where the scheme stores velocities; \
         exact_: the exact motion at the same particles and times; drift = solver - exact\n\
         step,time,velocity_time,u_linf,u_l2,u_l1{}{}\n",
        names(""),
        names("exact_")
    );
    for Moment { step, time, velocity_time, u, computed, exact } in history {
        let _ = write!(text, "{step}");
        let sums = |sums: &Sums| {
            let energies = [sums.kinetic_energy, sums.strain_energy];
            energies.into_iter().chain(sums.momentum.iter().copied()).collect::<Vec<_>>()
        };
        let errors = u.iter().map(|(_, value)| *value);
        let values = [*time, *velocity_time].into_iter().chain(errors);
        for value in values.chain(sums(computed)).chain(sums(exact)) {
            let _ = match value.is_finite() {
                true => write!(text, ",{value:?}"),
                false => write!(text, ",nan"),
            };
        }
        text.push('\n');
    }
    text
}

pub(crate) fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

fn head(text: &mut String, orders: &PerField<PerNorm<Order>>) {
    for (field, norms) in orders.iter() {
        for (norm, _) in norms.iter() {
            let _ = write!(text, ",{field}_{norm},{field}_{norm}_rate");
        }
    }
    text.push('\n');
}

fn values(
    text: &mut String,
    index: usize,
    errors: &PerField<PerNorm<f64>>,
    orders: &PerField<PerNorm<Order>>,
) {
    for ((_, norms), (_, orders)) in errors.iter().zip(orders.iter()) {
        for ((_, value), (_, order)) in norms.iter().zip(orders.iter()) {
            let value = if value.is_finite() { format!("{value:?}") } else { "nan".into() };
            let local = index.checked_sub(1).and_then(|pair| order.local[pair]);
            let rate = local.map_or_else(|| "nan".into(), |rate| table::rate(Some(rate)));
            let _ = write!(text, ",{value},{rate}");
        }
    }
    text.push('\n');
}
