//! A study as comma-separated values.

use std::fmt::Write;

use mmsmith_verify::Study;

/// One line for each row; numbers in shortest round-trip form, empty where there is none.
pub(crate) fn text(study: &Study) -> String {
    let mut text = "cells,h,dt,cfl,steps,particles,wall_s,particle_steps_per_s,status".to_owned();
    if let Some(row) = study.rows.first() {
        for (field, norms) in row.errors.named() {
            for (norm, _) in norms.named() {
                text += &format!(",{field}_{norm}");
            }
        }
    }
    text.push('\n');
    for row in &study.rows {
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "{},{:?},{:?},{:?},{},{},{:?},{:?},\"{}\"",
            row.cells,
            row.h,
            row.dt,
            row.cfl,
            row.steps,
            row.particles,
            row.wall_s,
            row.particle_steps_per_s,
            row.status.to_string().replace('"', "\"\"")
        );
        for (_, norms) in row.errors.named() {
            for (_, value) in norms.named() {
                text.push(',');
                if value.is_finite() {
                    let _ = write!(text, "{value:?}");
                }
            }
        }
        text.push('\n');
    }
    text
}
