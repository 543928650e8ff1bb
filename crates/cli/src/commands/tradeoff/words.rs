//! Settings of a sweep in words: for people, for JSON, and as options of `mms run`.

use mmsmith_verify::{
    CflSpeed, Coordinates, Effect, Entry, Frame, Integrator, Knob, Layout, MassMatrix, Placement,
    Setting, Transfer,
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
        false => format!("{} + {}", shape(setting), case.integrator.to_string()),
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
        text += &format!(" --integrator {}", case.integrator.to_string());
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

/// What a knob did.
pub(super) fn effect(effect: &Effect, from: &Entry, to: &Entry) -> String {
    let (a, b) = (&from.setting, &to.setting);
    let value = |setting: &Setting| match effect.knob {
        Knob::Cells => format!("{} cells", setting.case.cells),
        Knob::Cfl => format!("CFL {}", setting.case.cfl),
        Knob::Ppc => format!("ppc {}", setting.case.per_cell),
        Knob::Shape => shape(setting),
        Knob::Integrator if is_total(setting) => format!("order {} in time", composition(setting)),
        Knob::Integrator => setting.case.integrator.to_string(),
        Knob::Transfer => setting.case.transfer.to_string(),
        Knob::Layout => layout(setting).to_owned(),
        Knob::Mass => format!("{} mass", mass(setting)),
        Knob::Precision => (if setting.single { "f32" } else { "f64" }).to_owned(),
        Knob::Threads => format!("{} thread(s)", setting.threads),
    };
    let percent = 100.0 * (effect.error - 1.0);
    let error = match effect.error {
        factor if factor < 1.0 / 1.5 => format!("the error {:.1} times smaller", 1.0 / factor),
        factor if factor > 1.5 => format!("the error {factor:.1} times larger"),
        _ if percent.abs() < 0.05 => "the same error".into(),
        _ if percent < 0.0 => format!("the error {:.1} % smaller", -percent),
        _ => format!("the error {percent:.1} % larger"),
    };
    let remark = match effect.knob {
        Knob::Cfl if effect.error > 0.9 => "; a shorter step gains nothing here",
        Knob::Cells if effect.error > 0.9 => "; a finer grid gains nothing here",
        _ => "",
    };
    let of = match effect.knob {
        Knob::Cells => format!("CFL {}, {}", a.case.cfl, scheme(a)),
        _ => line(a),
    };
    format!(
        "{} to {}: {:.2} times the time, {error}{remark} (from {of})",
        value(a),
        value(b),
        effect.time
    )
}
