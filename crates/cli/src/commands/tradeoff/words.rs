//! Settings of a sweep in words: for people, for JSON, and as options of `mms run`.

use mmsmith_verify::{
    Coordinates, Effect, Entry, Formulation, Integrator, Layout, MassMatrix, Named, Placement,
    Range, Scheme, Setting, SettingName, TimeEffect, Transfer, Updated,
};
use serde_json::{Value, json};

use crate::number;

fn precision(setting: &Setting) -> &'static str {
    if setting.single { "f32" } else { "f64" }
}

/// A formulation in words.
pub(super) fn formulation(formulation: Formulation) -> &'static str {
    match formulation {
        Formulation::Updated => "updated Lagrangian",
        Formulation::Total => "total Lagrangian",
    }
}

/// Kind of a setting, by which it is drawn and tabulated: the weights, the formulation, and whether particles fit the body.
pub(super) fn kind(setting: &Setting) -> String {
    let scheme = &setting.case.scheme;
    let shape = scheme.shape();
    match scheme {
        Scheme::Total(_) => format!("{shape}, total Lagrangian"),
        Scheme::Updated(Updated { placement: Placement::Lattice { .. }, .. }) => shape,
        Scheme::Updated(updated) => format!("{shape}, {}", updated.placement.name()),
    }
}

/// The scheme: everything but grid and time step.
pub(super) fn scheme(setting: &Setting) -> String {
    let scheme = &setting.case.scheme;
    let shape = scheme.shape();
    let mut told = Vec::new();
    match scheme {
        Scheme::Updated(Updated { integrator, transfer, .. }) => {
            told.push(format!("{shape} + {integrator}"));
            if *transfer != Transfer::Flip {
                told.push(transfer.to_string());
            }
        }
        Scheme::Total(total) => {
            let order = total.composition.order();
            told.push(format!("{shape}, total Lagrangian, order {order} in time"));
            if total.mass == MassMatrix::Lumped {
                told.push(format!("{} mass", total.mass.name()));
            }
        }
    }
    if !is_lattice(scheme) {
        told.push(scheme.layout().into());
    }
    told.push(format!("ppc {}", setting.case.per_cell));
    if setting.single {
        told.push(precision(setting).into());
    }
    if setting.threads > 1 {
        told.push(format!("{} threads", setting.threads));
    }
    told.join(", ")
}

/// Whether the particles lie as they do by default.
fn is_lattice(scheme: &Scheme) -> bool {
    match scheme {
        Scheme::Updated(updated) => matches!(updated.placement, Placement::Lattice { .. }),
        Scheme::Total(total) => total.layout == Layout::Lattice,
    }
}

/// The scheme with its grid and time step.
pub(super) fn line(setting: &Setting) -> String {
    format!("{} cells, CFL {}, {}", setting.case.cells, setting.case.cfl, scheme(setting))
}

/// The options of `mms run` that run a setting.
pub(super) fn options(setting: &Setting) -> String {
    let case = &setting.case;
    let mut text = format!("--cells {} --shape {}", case.cells, case.scheme.shape());
    match case.scheme {
        Scheme::Updated(Updated { integrator, transfer, .. }) => {
            if integrator != Integrator::Cd {
                text += &format!(" --integrator {integrator}");
            }
            if transfer != Transfer::Flip {
                text += &format!(" --transfer {transfer}");
            }
        }
        Scheme::Total(total) => {
            text += &format!(
                " --formulation total-lagrangian --mass {} --composition {}",
                total.mass.name(),
                total.composition.order()
            );
        }
    }
    if !is_lattice(&case.scheme) {
        text += &format!(" --layout {}", case.scheme.layout());
    }
    if let Some(total) = case.scheme.total()
        && total.coordinates != Coordinates::Cartesian
    {
        text += &format!(" --grid {}", total.coordinates.name());
    }
    text += &format!(" --ppc {} --cfl {}", case.per_cell, case.cfl);
    if setting.single {
        text += &format!(" --precision {}", precision(setting));
    }
    text + &format!(" --threads {}", setting.threads)
}

/// The scheme as it is written to JSON, in the words of the options.
pub(super) fn document(setting: &Setting) -> Value {
    let case = &setting.case;
    let mut document = json!(case.scheme);
    for (name, value) in [
        ("ppc", json!(case.per_cell)),
        ("cfl_asked", json!(case.cfl)),
        ("cfl_speed", json!(case.cfl_speed.name())),
        ("precision", json!(precision(setting))),
        ("threads", json!(setting.threads)),
    ] {
        document[name] = value;
    }
    document
}

/// Effect of the change of a setting.
pub(super) fn effect(effect: &Effect, from: &Entry, to: &Entry) -> String {
    let (a, b) = (&from.setting, &to.setting);
    let value = |setting: &Setting| match effect.setting {
        SettingName::Cells => format!("{} cells", setting.case.cells),
        SettingName::Cfl => format!("CFL {}", setting.case.cfl),
        SettingName::Ppc => format!("ppc {}", setting.case.per_cell),
        SettingName::Shape => setting.case.scheme.shape(),
        SettingName::Integrator => match setting.case.scheme {
            Scheme::Updated(updated) => updated.integrator.to_string(),
            Scheme::Total(total) => format!("order {} in time", total.composition.order()),
        },
        SettingName::Transfer => {
            let updated = setting.case.scheme.updated();
            updated.map_or(Transfer::Flip, |updated| updated.transfer).to_string()
        }
        SettingName::Layout => setting.case.scheme.layout().to_owned(),
        SettingName::Mass => {
            let total = setting.case.scheme.total();
            format!("{} mass", total.map_or(MassMatrix::Lumped, |total| total.mass).name())
        }
        SettingName::Precision => precision(setting).to_owned(),
        SettingName::Threads => number::counted(setting.threads, "thread"),
    };
    // Where runs are too short, or scatter by as much as they differ, their time says nothing, and neither does this.
    let time = match effect.time {
        TimeEffect::Factor(range) => format!("{} times the time, ", factors(range, 2)),
        TimeEffect::WithinScatter(_) | TimeEffect::TooShort => String::new(),
    };
    let gains = effect.error.most <= 0.9;
    let remark = match effect.setting {
        SettingName::Cfl if !gains => "; a shorter step gains nothing here",
        SettingName::Cells if !gains => "; a finer grid gains nothing here",
        _ => "",
    };
    let of = match effect.setting {
        SettingName::Cells => format!("CFL {}, {}", a.case.cfl, scheme(a)),
        _ => line(a),
    };
    let of = match effect.pairs {
        1 => of,
        pairs => format!("{of}, the finest of {pairs} pairs of runs"),
    };
    format!("{} to {}: {time}{}{remark} (from {of})", value(a), value(b), error(effect.error))
}

/// One factor where both ends of a range are as good as one, or both.
fn factors(range: Range, digits: usize) -> String {
    match range.most / range.least {
        ratio if ratio < 1.05 => format!("{:.digits$}", range.middle()),
        _ => format!("{:.digits$} to {:.digits$}", range.least, range.most),
    }
}

/// A factor of the error.
fn error(range: Range) -> String {
    let Range { least, most } = range;
    let percent = |factor: f64| 100.0 * (factor - 1.0);
    if most < 1.0 / 1.5 {
        let gained = Range { least: 1.0 / most, most: 1.0 / least };
        return format!("the error {} times smaller", factors(gained, 1));
    }
    if least > 1.5 {
        return format!("the error {} times larger", factors(range, 1));
    }
    if percent(least).abs() < 0.05 && percent(most).abs() < 0.05 {
        return "the same error".into();
    }
    match (percent(least), percent(most)) {
        (least, most) if most - least < 0.1 && most < 0.0 => {
            format!("the error {:.1} % smaller", -least)
        }
        (least, most) if most - least < 0.1 => format!("the error {most:.1} % larger"),
        (least, most) => format!("the error changed by {least:+.1} to {most:+.1} %"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_told_with_their_spread() {
        let range = |least, most| Range { least, most };
        assert_eq!(factors(range(2.0, 2.0), 2), "2.00");
        assert_eq!(factors(range(1.9, 2.1), 2), "1.90 to 2.10");
        assert_eq!(error(range(0.25, 0.25)), "the error 4.0 times smaller");
        assert_eq!(error(range(0.2, 0.25)), "the error 4.0 to 5.0 times smaller");
        assert_eq!(error(range(2.0, 3.0)), "the error 2.0 to 3.0 times larger");
        assert_eq!(error(range(1.0, 1.0001)), "the same error");
        assert_eq!(error(range(0.9, 0.9)), "the error 10.0 % smaller");
        assert_eq!(error(range(0.9, 1.2)), "the error changed by -10.0 to +20.0 %");
    }
}
