//! `mms converge`: orders of accuracy.

use anyhow::{Result, bail};
use mmsmith_verify::{Case, Status, Study, Sweep, converge as measure};
use serde_json::{Value, json};

use super::{Model, caption, case, settings, with_threads};
use crate::arguments::{ConvergeOptions, Extent, SchemeOptions};
use crate::json::Output;
use crate::library::Selection;
use crate::progress::Bar;
use crate::table::{self, Table};
use crate::terminal;

pub(crate) fn converge(options: &ConvergeOptions) -> Result<bool> {
    let scheme = &options.scheme;
    let selection = Selection::new(&options.name, &scheme.parameters.set)?;
    let sweep = sweep(options)?;
    let model = Model::new(&selection, scheme.precision)?;
    let base = case(scheme, options.cells[0])?;
    let extent = model.admit(&sweep.cases(&base))?;
    let output = Output::prepare_if(scheme.json.as_ref())?;
    with_threads(scheme.threads, || {
        let study = {
            let bar = Bar::new();
            let mut show = |progress: mmsmith_verify::Progress| {
                let what = match &sweep {
                    Sweep::Cells(cells) => format!("{} cells", cells[progress.case]),
                    Sweep::Cfls(cfls) => format!("CFL {}", cfls[progress.case]),
                };
                bar.show(&what, progress);
            };
            measure(&model.exact, model.arithmetic(), &base, &sweep, &mut show)?
        };
        let mut text = caption(&selection, scheme, extent);
        for (field, table) in tables(&study, &sweep) {
            text += &format!("\nerror of {field}\n{}", table.text());
        }
        text += &stops(&study);
        terminal::say(&text)?;
        if let Some(output) = output {
            output.write(&document(&selection, scheme, extent, &base, &sweep, &study))?;
        }
        Ok(true)
    })
}

/// A study as it is written to JSON.
pub(super) fn document(
    selection: &Selection,
    scheme: &SchemeOptions,
    extent: Option<Extent>,
    base: &Case,
    sweep: &Sweep,
    study: &Study,
) -> Value {
    let settings = match sweep {
        Sweep::Cells(cells) => settings(selection, scheme, extent, cells, base.cfl),
        Sweep::Cfls(cfls) => settings(selection, scheme, extent, base.cells, cfls),
    };
    json!({
        "schema": "mmsmith.converge/1",
        "settings": settings,
        "rows": study.rows,
        "orders": study.orders,
    })
}

fn sweep(options: &ConvergeOptions) -> Result<Sweep> {
    if options.cfls.is_empty() {
        return Ok(Sweep::Cells(options.cells.clone()));
    }
    if options.cells.len() != 1 {
        bail!("--cfls: orders in time are measured on one grid, such as --cells 32");
    }
    Ok(Sweep::Cfls(options.cfls.clone()))
}

/// One table for each field: a row a case, and the rate right of each norm.
pub(super) fn tables(study: &Study, sweep: &Sweep) -> [(&'static str, Table); 4] {
    let (errors, orders) = (study.rows.iter().map(|row| row.errors.named()), study.orders.named());
    let errors: Vec<_> = errors.collect();
    std::array::from_fn(|field| {
        let header = [
            "cells",
            "particles",
            "h",
            "CFL",
            "linf",
            "rate",
            "l2",
            "rate",
            "l1",
            "rate",
            "status",
        ];
        let mut table = Table::new(0, header);
        let (name, order) = orders[field];
        for (index, row) in study.rows.iter().enumerate() {
            let mut cells = vec![
                row.cells.to_string(),
                row.particles.to_string(),
                table::error(row.h),
                format!("{:.4}", row.cfl),
            ];
            for ((_, value), (_, order)) in errors[index][field].1.named().iter().zip(order.named())
            {
                let local = index.checked_sub(1).and_then(|pair| order.local[pair]);
                cells.extend([table::error(**value), table::rate(local)]);
            }
            cells.push(if row.status == Status::Ok { "ok" } else { "STOPPED" }.into());
            table.row(cells);
        }
        let step = if matches!(sweep, Sweep::Cells(_)) { "h" } else { "dt" };
        let mut fit = vec![format!("fit in {step}"), String::new(), String::new(), String::new()];
        for (_, order) in order.named() {
            fit.extend([String::new(), table::rate(order.fit)]);
        }
        table.row(fit);
        (name, table)
    })
}

/// A line for each case that did not reach its end time.
pub(super) fn stops(study: &Study) -> String {
    let stopped = study.rows.iter().filter(|row| row.status != Status::Ok);
    stopped
        .map(|row| {
            format!("STOPPED with {} cells, CFL {:.4}: {}\n", row.cells, row.cfl, row.status)
        })
        .collect()
}
