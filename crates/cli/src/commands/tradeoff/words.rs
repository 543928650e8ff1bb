//! Settings of a sweep in words: for people, for JSON, and as options of `mms run`.

use mmsmith_verify::{
    CflSpeed, Coordinates, Effect, Entry, Frame, Integrator, Layout, MassMatrix, Placement, Range,
    Setting, SettingName, TimeEffect, Transfer,
};
use serde_json::{Value, json};

fn is_total(setting: &Setting) -> bool {
    setting.case.frame != Frame::Updated
}

/// The weights.
fn shape(setting: &Setting) -> String {
    match setting.case.frame {
        Frame::Updated => setting.case.shape.to_string(),
        Frame::Total(total) => format!("bspline{}", total.scheme.degree),
    }
}

fn layout(setting: &Setting) -> &'static str {
    match (setting.case.frame, setting.case.placement) {
        (Frame::Updated, Placement::Lattice) => "lattice",
        (Frame::Updated, Placement::BodyFitted) => "body-fitted",
        (Frame::Total(total), _) => match total.layout {
            Layout::Lattice => "lattice",
            Layout::Gauss => "gauss",
        },
    }
}

fn mass(setting: &Setting) -> &'static str {
    match setting.case.frame {
        Frame::Total(total) if total.scheme.mass == MassMatrix::Consistent => "consistent",
        _ => "lumped",
    }
}

fn grid(setting: &Setting) -> &'static str {
    match setting.case.frame {
        Frame::Updated => "cartesian",
        Frame::Total(total) => match total.coordinates {
            Coordinates::Cartesian => "cartesian",
            Coordinates::Polar => "polar",
            Coordinates::Spherical => "spherical",
        },
    }
}

fn composition(setting: &Setting) -> usize {
    match setting.case.frame {
        Frame::Updated => 2,
        Frame::Total(total) => total.scheme.composition.order(),
    }
}

/// What settings are drawn and tabulated alike: the weights, the frame, and whether particles fit the body.
pub(super) fn kind(setting: &Setting) -> String {
    let mut text = shape(setting);
    if is_total(setting) {
        text += ", total Lagrangian";
    } else if setting.case.placement == Placement::BodyFitted {
        text += ", body-fitted";
    }
    text
}

/// The scheme: everything but grid and time step.
pub(super) fn scheme(setting: &Setting) -> String {
    let case = &setting.case;
    let mut parts = vec![match is_total(setting) {
        true => {
            format!("{}, total Lagrangian, order {} in time", shape(setting), composition(setting))
        }
        false => format!("{} + {}", shape(setting), case.integrator),
    }];
    if is_total(setting) && mass(setting) == "lumped" {
        parts.push("lumped mass".into());
    }
    if case.transfer != Transfer::Flip {
        parts.push(case.transfer.to_string());
    }
    if layout(setting) != "lattice" {
        parts.push(layout(setting).into());
    }
    parts.push(format!("ppc {}", case.per_cell));
    if setting.single {
        parts.push("f32".into());
    }
    if setting.threads > 1 {
        parts.push(format!("{} threads", setting.threads));
    }
    parts.join(", ")
}

/// The scheme with its grid and time step.
pub(super) fn line(setting: &Setting) -> String {
    format!("{} cells, CFL {}, {}", setting.case.cells, setting.case.cfl, scheme(setting))
}

/// The options of `mms run` that run a setting.
pub(super) fn options(setting: &Setting) -> String {
    let case = &setting.case;
    let mut text = format!("--cells {} --shape {}", case.cells, shape(setting));
    if is_total(setting) {
        let (mass, composition) = (mass(setting), composition(setting));
        text +=
            &format!(" --formulation total-lagrangian --mass {mass} --composition {composition}");
    } else if case.integrator != Integrator::Cd {
        text += &format!(" --integrator {}", case.integrator);
    }
    if case.transfer != Transfer::Flip {
        text += &format!(" --transfer {}", case.transfer);
    }
    for (option, value, usual) in
        [("--layout", layout(setting), "lattice"), ("--grid", grid(setting), "cartesian")]
    {
        if value != usual {
            text += &format!(" {option} {value}");
        }
    }
    text += &format!(" --ppc {} --cfl {}", case.per_cell, case.cfl);
    if setting.single {
        text += " --precision f32";
    }
    text + &format!(" --threads {}", setting.threads)
}

/// The scheme as it is written to JSON, in the words of the options.
pub(super) fn document(setting: &Setting) -> Value {
    let case = &setting.case;
    json!({
        "frame": if is_total(setting) { "total" } else { "updated" },
        "shape": shape(setting),
        "integrator": case.integrator.to_string(),
        "mass": mass(setting),
        "composition": composition(setting),
        "layout": layout(setting),
        "grid": grid(setting),
        "transfer": case.transfer.to_string(),
        "start": case.start.to_string(),
        "ppc": case.per_cell,
        "cfl_asked": case.cfl,
        "cfl_speed": match case.cfl_speed { CflSpeed::Bar => "bar", CflSpeed::PWave => "p-wave" },
        "precision": if setting.single { "f32" } else { "f64" },
        "threads": setting.threads,
    })
}

/// What the change of a setting did.
pub(super) fn effect(effect: &Effect, from: &Entry, to: &Entry) -> String {
    let (a, b) = (&from.setting, &to.setting);
    let value = |setting: &Setting| match effect.setting {
        SettingName::Cells => format!("{} cells", setting.case.cells),
        SettingName::Cfl => format!("CFL {}", setting.case.cfl),
        SettingName::Ppc => format!("ppc {}", setting.case.per_cell),
        SettingName::Shape => shape(setting),
        SettingName::Integrator if is_total(setting) => {
            format!("order {} in time", composition(setting))
        }
        SettingName::Integrator => setting.case.integrator.to_string(),
        SettingName::Transfer => setting.case.transfer.to_string(),
        SettingName::Layout => layout(setting).to_owned(),
        SettingName::Mass => format!("{} mass", mass(setting)),
        SettingName::Precision => (if setting.single { "f32" } else { "f64" }).to_owned(),
        SettingName::Threads => format!("{} thread(s)", setting.threads),
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
