//! The study as one page: HTML that needs no network and no script.

use std::fmt::Write;
use std::path::Path;

use anyhow::{Context, Result};
use mmsmith_solutions::{CATALOGUE, Description};
use mmsmith_verify::{Field, Row, Sweep};

use super::claims::{Claim, difference_orders, told_orders};
use super::section::{Section, captioned};
use super::{
    CELLS, DENSITY, DIFFERENCES, Differences, GENTLE, GENTLE_GRID, GRID, PROBLEMS, Results,
    SMALL_STEP, SMALL_STEP_CELLS, SPACE, TIME, compare, difference_plot, difference_tables,
    errors_with_units, name, pictures, space_plot, stopped, tables, time_plot, verdict_table,
};
use crate::checksum::sha256;
use crate::svg::escape;
use crate::table::{self, Table};
use crate::{machine, number};

const STYLE: &str = include_str!("report.css");

/// The whole page; `out` holds the particle files that the pictures show.
pub(super) fn html(
    out: &Path,
    results: &[Results],
    gentle: &[Differences],
    claims: &[Claim],
    sections: &[Section],
) -> Result<String> {
    let confirmed = claims.iter().filter(|claim| claim.confirmed).count();
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <link rel=\"icon\" href=\"data:,\">\n\
         <title>Time integration for GIMP: the original study, again</title>\n<style>\n{STYLE}</style>\n</head>\n\
         <body>\n<header>\n<h1>Time integration for GIMP: the original study, again</h1>\n\
         <p>P. Wallstedt and J. Guilkey, <cite>Evaluation of Time Integration Schemes for the Generalized \
         Interpolation Material Point Method</cite>, measured by mmsmith {}. {confirmed} of {} claims are confirmed.</p>\n\
         </header>\n<nav aria-label=\"Contents\">\n<ul>\n<li><a href=\"#claims\">The claims of the study</a></li>\n\
         <li><a href=\"#sum\">Sum of 2?</a></li>\n",
        env!("CARGO_PKG_VERSION"),
        claims.len()
    );
    for one in results {
        let _ = writeln!(page, "<li><a href=\"#{0}\">{0}</a></li>", one.problem);
    }
    for section in sections {
        let _ = writeln!(page, "<li><a href=\"#{}\">{}</a></li>", section.id, section.title);
    }
    page += "<li><a href=\"#setting\">How it was measured</a></li>\n</ul>\n</nav>\n<main>\n";
    page += &claims_section(claims);
    page += &sum_section(results, gentle);
    for one in results {
        page += &problem_section(out, one)?;
    }
    for section in sections {
        page += &section.html();
    }
    page += &setting_section()?;
    page += "</main>\n</body>\n</html>\n";
    Ok(page)
}

fn claims_section(claims: &[Claim]) -> String {
    let mut table = Table::new(5, ["verdict", "claim", "measured", "confirmed if", "depends on"]);
    for claim in claims {
        let cells = [claim.verdict(), claim.text, &claim.measured, claim.criterion, claim.depends];
        table.row(cells);
    }
    let caption = "Claims, what was measured, and what the verdict depends on";
    format!(
        "<section id=\"claims\" class=\"claims\">\n<h2>The claims of the study</h2>\n{}</section>\n",
        table.html(caption)
    )
}

/// The answer to the question that the study leaves open.
fn sum_section(results: &[Results], gentle: &[Differences]) -> String {
    let Some(square) = results.first() else { return String::new() };
    let order = |value: Option<f64>| value.map_or("none".into(), |order| format!("{order:.2}"));
    let usl = square.space.iter().find(|one| one.name() == "gimp+usl");
    let at_fixed_cfl = usl.and_then(|one| one.study.orders.u.linf.local.last().copied().flatten());
    let small = square.small_step.study.orders.u.linf.local.last().copied().flatten();
    let small_l2 = square.small_step.study.orders.u.l2.local.last().copied().flatten();
    let in_time = told_orders(&difference_orders(&square.differences, "gimp+usl"));
    let cd = told_orders(&difference_orders(gentle, "gimp+cd"));
    let cd_usual = told_orders(&difference_orders(&square.differences, "gimp+cd"));
    let figure = captioned(
        &difference_plot(&format!("Difference in time, A = {GENTLE}"), gentle),
        &format!(
            "A run against the run with half its time step, on one grid of {GENTLE_GRID} cells, at the amplitude \
             {GENTLE}. Dashed grey: slopes 1 and 2."
        ),
    );
    let usual = captioned(
        &difference_plot("Difference in time, A = 0.1", &square.differences),
        &format!("The same at the study's amplitude on {GRID} cells."),
    );
    let mut small_step = String::new();
    let sweep = Sweep::Cells(SMALL_STEP_CELLS.to_vec());
    let [(_, table), ..] = tables(&square.small_step.study, &sweep, &square.small_step.verdicts);
    small_step += &errors_with_units(table, Field::Displacement)
        .html(&format!("{}: error of u of gimp+usl at CFL {SMALL_STEP}", square.problem));
    let mut differences = String::new();
    for one in gentle {
        let [(_, table), ..] = difference_tables(&one.found, &one.verdicts);
        differences += &errors_with_units(table, Field::Displacement).html(&format!(
            "Difference of u, {}, A = {GENTLE}, {GENTLE_GRID} cells",
            name(one.scheme)
        ));
    }
    format!(
        "<section id=\"sum\">\n<h2>Sum of 2?</h2>\n\
         <p>The study finds that USL loses one spatial order and gains one temporal, and asks whether the orders sum \
         to 2. They do not: the error of USL is a term in h² plus a term in dt, and the orders in h and dt are 2 and 1.</p>\n\
         <ul>\n\
         <li>At a fixed CFL number dt shrinks with h, and the term in dt becomes one in h. On the finest pair of grids \
         the order in h is {} at CFL 0.4.</li>\n\
         <li>At CFL {SMALL_STEP} the term in dt is small, and the order in h is {} in L_inf and {} in L2 on the finest pair. \
         No spatial order was lost.</li>\n\
         <li>By differences on one grid, where the spatial error drops out, the order of USL in dt is {in_time}.</li>\n\
         <li>For CD the order in dt is {cd}, at the amplitude {GENTLE} on {GENTLE_GRID} cells. At the amplitude 0.1 on {GRID} \
         cells it is {cd_usual}; no order shows there.</li>\n</ul>\n\
         <p>The order of CD falls as dt becomes smaller. A likely reason, not proved here, lies in the scheme: particles are \
         moved with the nodal acceleration as it is, while their velocities keep what interpolation and the projection with \
         lumped masses leave of it. If the two differ by a term in h², a term dt h² joins the one in dt², and is what \
         remains for dt → 0 on one grid. Total errors hide all this: the spatial error dominates, and has the opposite \
         sign.</p>\n\
         <div class=\"figures\">\n{figure}{usual}</div>\n{small_step}{differences}</section>\n",
        order(at_fixed_cfl),
        order(small),
        order(small_l2),
    )
}

fn problem_section(out: &Path, results: &Results) -> Result<String> {
    let problem = results.problem;
    let description = describe(problem)?;
    let mut text = format!(
        "<section id=\"{problem}\">\n<h2>{problem}</h2>\n<p>{}</p>\n",
        escape(description.title)
    );
    let mut parameters = Table::new(1, ["parameter", "value", "unit"]);
    for parameter in description.parameters {
        let (density, value) = DENSITY;
        parameters.row([
            parameter.name.to_owned(),
            number::exact(if parameter.name == density { value } else { parameter.default }),
            if parameter.unit.is_empty() { "1".to_owned() } else { parameter.unit.to_owned() },
        ]);
    }
    text += &parameters.html(&format!("{problem}: parameters"));

    text += "<h3>Convergence</h3>\n<div class=\"figures\">\n";
    text += &captioned(
        &space_plot(results),
        &format!(
            "Largest error of u over all particles and steps, on {} cells, at CFL 0.4. Dashed grey: slopes 1 and 2.",
            CELLS.map(|cells| cells.to_string()).join(", ")
        ),
    );
    text += &captioned(
        &time_plot(results),
        &format!(
            "The same on {GRID} cells over the time step: mostly the spatial error, up to the limit of stability."
        ),
    );
    // That of the first problem stands with the question that it answers.
    if problem != PROBLEMS[0] {
        text += &captioned(
            &difference_plot(&format!("{problem}: difference in time"), &results.differences),
            &format!(
                "A run against the run with half its time step, on {GRID} cells: what the time step alone does."
            ),
        );
    }
    text += "</div>\n<h3>Stress</h3>\n<div class=\"figures\">\n";
    for picture in pictures::all(problem, out)? {
        text += &captioned(&picture.svg, &picture.caption);
    }
    text += "</div>\n<h3>Tables</h3>\n";
    let cells = |row: &Row| row.cells.to_string();
    let cfl = |row: &Row| format!("{:.4}", row.cfl);
    text += &compare(&results.space, "cells", cells)
        .html(&format!("{problem}: L_inf error of u [m] and its order in h"));
    text += &compare(&results.time, "CFL", cfl)
        .html(&format!("{problem}: L_inf error of u [m] and its order in dt, {GRID} cells"));
    if let Some(table) = stopped(&[&results.space, &results.time]) {
        text += &table.html(&format!("{problem}: runs that stopped"));
    }
    let best = &results.space[0];
    text += &verdict_table(&best.verdicts, "h", true)
        .html(&format!("{problem}: what each field of {} shows in space, at CFL 0.4", best.name()));
    if does_not_converge(results) {
        text += "<p>The L_inf error of F does not converge here: particles at the stair-stepped rim keep an error of \
                 their own, however fine the grid.</p>\n";
    }
    let sweep = Sweep::Cells(CELLS.to_vec());
    for (field, table) in tables(&best.study, &sweep, &best.verdicts) {
        let caption = format!("{problem}: error of {field}, {}", best.name());
        text += &errors_with_units(table, field).html(&caption);
    }
    for one in &results.differences {
        let [(_, table), ..] = difference_tables(&one.found, &one.verdicts);
        let caption = format!("{problem}: difference of u, {}, {GRID} cells", name(one.scheme));
        text += &errors_with_units(table, Field::Displacement).html(&caption);
    }
    text += &files(results);
    text += "</section>\n";
    Ok(text)
}

/// Description of a problem by the library.
fn describe(problem: &str) -> Result<&'static Description> {
    let found = CATALOGUE.iter().copied().find(|known| known.name == problem);
    found.with_context(|| format!("the library has no solution '{problem}'"))
}

/// Whether the largest error of F on the finest grid is no smaller than on the coarsest.
fn does_not_converge(results: &Results) -> bool {
    let rows = &results.space[0].study.rows;
    match (rows.first(), rows.last()) {
        (Some(first), Some(last)) => last.errors.F.linf >= first.errors.F.linf,
        _ => false,
    }
}

/// Links to the data of a problem, relative to the page.
fn files(results: &Results) -> String {
    let problem = results.problem;
    let mut stems: Vec<String> = Vec::new();
    let schemes = SPACE.map(|one| ("space", one)).into_iter();
    let schemes = schemes.chain(TIME.map(|one| ("time", one)));
    let schemes = schemes.chain([("small-step", results.small_step.scheme)]);
    let schemes = schemes.chain(DIFFERENCES.map(|one| ("differences", one)));
    let gentle = DIFFERENCES.map(|one| ("gentle", one)).into_iter();
    let gentle = gentle.filter(|_| problem == PROBLEMS[0]);
    for (kind, (shape, integrator)) in schemes.chain(gentle) {
        stems.push(format!("{kind}-{shape}-{integrator}"));
    }
    let mut text = format!(
        "<h3>Files</h3>\n<ul>\n<li>particles of gimp+cd: <a href=\"{problem}/particles/{problem}.pvd\">{problem}.pvd</a></li>\n"
    );
    for stem in stems {
        let _ = writeln!(
            text,
            "<li>{stem}: <a href=\"{problem}/{stem}.json\">JSON</a>, <a href=\"{problem}/{stem}.csv\">CSV</a></li>"
        );
    }
    text += "</ul>\n";
    text
}

fn setting_section() -> Result<String> {
    let mut table = Table::new(2, ["what", "value"]);
    table.row(["version".to_owned(), format!("mmsmith {}", env!("CARGO_PKG_VERSION"))]);
    table.row(["processor".to_owned(), machine::processor()]);
    table.row(["cores".to_owned(), machine::cores().to_string()]);
    table.row(["threads".to_owned(), rayon::current_num_threads().to_string()]);
    for problem in PROBLEMS {
        let text = describe(problem)?.specification;
        table.row([format!("SHA-256 of {problem}.toml"), sha256(text)]);
    }
    let rate = table::rate(Some(2.0));
    Ok(format!(
        "<section id=\"setting\">\n<h2>How it was measured</h2>\n\
         <p>Both problems with the parameters given, one period, 2 particles per cell and direction, CFL 0.4 on the bar \
         wave speed where it is not varied, f64, cd from the velocity at time zero with a halved first acceleration. The \
         error of a particle is (x - X) - u(X, t). L_inf is its largest magnitude over all particles and steps; L2 and L1 \
         are taken over the particles at each step, then the largest over the steps.</p>\n\
         <p>A rate is ln(e<sub>i</sub>/e<sub>i-1</sub>) / ln(h<sub>i</sub>/h<sub>i-1</sub>), in time with dt for h; a rate of {rate} \
         means second order. The slope in a legend is that of the least-squares line through all points. Rows in \
         parentheses are outside the asymptotic range, in which the local orders agree with the one on the finest pair \
         within 0.1; where no row is in parentheses, no such range was found or all rows are in it, and the table of \
         verdicts says which. The verdict on an expected order refers to the finest pair. A difference is that of a run \
         and the run with half its time step, the largest over five times, so that its slope over dt is the order in \
         time.</p>\n{}</section>\n",
        table.html("Program, machine and specifications")
    ))
}
