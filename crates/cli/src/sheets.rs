//! Studies and histories as sheets of numbers.

use mmsmith_verify::{Moment, Order, PerField, PerNorm, Row, Study, Sums, Temporal, TemporalRow};

use crate::report::{Sheet, number};
use crate::table;

/// One line for each row: numbers in shortest round-trip form, `nan` where there is none; right of each error its rate
/// against the row before, two decimals, `nan` where there is none, as readers of numbers want it.
pub(crate) fn study(study: &Study) -> Sheet {
    let first = "cells,h,dt,cfl,steps,particles,wall_s,particle_steps_per_s,status";
    let mut sheet = Sheet::new(first.split(',').map(str::to_owned).chain(names(&study.orders)));
    for (index, row) in study.rows.iter().enumerate() {
        let Row { cells, h, dt, cfl, steps, particles, wall_s, particle_steps_per_s, .. } = row;
        let first = [
            cells.to_string(),
            number(*h),
            number(*dt),
            number(*cfl),
            steps.to_string(),
            particles.to_string(),
            number(*wall_s),
            number(*particle_steps_per_s),
            row.status.to_string(),
        ];
        sheet.row(first.into_iter().chain(values(index, &row.errors, &study.orders)));
    }
    sheet
}

/// As [`study`], for differences on one grid.
pub(crate) fn temporal(temporal: &Temporal) -> Sheet {
    let first = "cells,h,dt,cfl,steps,status";
    let mut sheet = Sheet::new(first.split(',').map(str::to_owned).chain(names(&temporal.orders)));
    for (index, row) in temporal.rows.iter().enumerate() {
        let TemporalRow { cells, h, dt, cfl, steps, status, differences } = row;
        let first = [
            cells.to_string(),
            number(*h),
            number(*dt),
            number(*cfl),
            steps.to_string(),
            status.to_string(),
        ];
        sheet.row(first.into_iter().chain(values(index, differences, &temporal.orders)));
    }
    sheet
}

/// A run's history: a line that says what is what, the header, and a line for each moment; `nan` where there is no number.
/// Momenta are by axis; of a body of revolution along the radius, around the axis and along it.
pub(crate) fn history(history: &[Moment], is_of_revolution: bool) -> Sheet {
    let axes = history.first().map_or(0, |moment| moment.exact.momentum.len());
    let names = if is_of_revolution { ["R", "theta", "Z"] } else { ["x", "y", "z"] };
    let sums = |of: &'static str| {
        let momenta = names.into_iter().take(axes).map(|axis| format!("momentum_{axis}"));
        let energies = ["kinetic_energy", "strain_energy"].map(str::to_owned);
        energies.into_iter().chain(momenta).map(move |name| format!("{of}{name}"))
    };
    let first = ["step", "time", "velocity_time", "u_linf", "u_l2", "u_l1"].map(str::to_owned);
    let mut sheet = Sheet::new(first.into_iter().chain(sums("")).chain(sums("exact_")));
    sheet.remark = Some(
        "u and strain energy at time; kinetic energy and momentum at velocity_time, where the scheme stores velocities; \
         exact_: the exact motion at the same particles and times; drift = solver - exact"
            .into(),
    );
    for Moment { step, time, velocity_time, u, computed, exact } in history {
        let sums = |sums: &Sums| {
            let energies = [sums.kinetic_energy, sums.strain_energy];
            energies.into_iter().chain(sums.momentum.iter().copied()).collect::<Vec<_>>()
        };
        let errors = u.iter().map(|(_, value)| *value);
        let values = [*time, *velocity_time].into_iter().chain(errors);
        let values = values.chain(sums(computed)).chain(sums(exact)).map(number);
        sheet.row([step.to_string()].into_iter().chain(values));
    }
    sheet
}

fn names(orders: &PerField<PerNorm<Order>>) -> impl Iterator<Item = String> {
    orders.iter().flat_map(|(field, norms)| {
        norms
            .iter()
            .flat_map(move |(norm, _)| [format!("{field}_{norm}"), format!("{field}_{norm}_rate")])
    })
}

fn values(
    index: usize,
    errors: &PerField<PerNorm<f64>>,
    orders: &PerField<PerNorm<Order>>,
) -> impl Iterator<Item = String> {
    errors.iter().zip(orders.iter()).flat_map(move |((_, norms), (_, orders))| {
        norms.iter().zip(orders.iter()).flat_map(move |((_, value), (_, order))| {
            let local = index.checked_sub(1).and_then(|pair| order.local[pair]);
            let rate = local.map_or_else(|| "nan".into(), |rate| table::rate(Some(rate)));
            [number(*value), rate]
        })
    })
}
