//! Files in languages that have functions: their content, and the text at their heads.

use crate::code::Code;
use crate::runtime::{Routine, WithRuntime, routines};
use crate::table::OfTable;
use crate::target::{Called, Target, Written};
use crate::text::{comment, meaning, with};
use mmsmith_expr::{Operation, Slot};
use mmsmith_spec::{Coordinates, Parameter};
use mmsmith_stage::{Block, FieldName, Measures, Shape, TubeMeasures};
use mmsmith_vocabulary::Law;
use std::collections::BTreeSet;

/// A function of a file.
pub(crate) struct Item {
    pub(crate) name: String,
    /// Its value in words.
    pub(crate) about: String,
    pub(crate) shape: Shape,
    pub(crate) given: Given,
    /// The part of the table that it takes; its values are computed otherwise.
    pub(crate) of_table: Option<OfTable>,
    outputs: Vec<Slot>,
}

/// The arguments of a function beside the solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Given {
    /// No arguments.
    Nothing,
    /// A position.
    Position,
    /// A position and a time.
    PositionAndTime,
}

impl Item {
    /// Its operations.
    pub(crate) fn block<'a>(&self, code: &'a Code<'_>) -> Block<'a> {
        code.staged.after_parameters(&self.outputs)
    }
}

impl Item {
    /// A function of position and time whose values are those of the table.
    pub(crate) fn of_table(name: String, about: String, shape: Shape, of_table: OfTable) -> Self {
        let (given, outputs) = (Given::PositionAndTime, Vec::new());
        Item { name, about, shape, given, of_table: Some(of_table), outputs }
    }

    /// The slots of its entries, row by row.
    pub(crate) fn outputs(&self) -> &[Slot] {
        &self.outputs
    }

    /// The entries at the default parameters, of a function that depends on the parameters alone.
    pub(crate) fn values(&self, code: &Code<'_>) -> Vec<f64> {
        code.values(&self.outputs)
    }
}

impl Code<'_> {
    /// Whether the density depends on the place, so that there is a function `rho0` of it.
    pub(crate) fn has_graded_density(&self) -> bool {
        self.staged.density_here.is_some()
    }

    /// The values of the stage of the parameters, at their defaults.
    pub(crate) fn fixed_values(&self) -> Vec<f64> {
        self.values(self.staged.fixed())
    }

    /// Values that depend on the parameters alone, at their defaults.
    fn values(&self, slots: &[Slot]) -> Vec<f64> {
        // Coordinates and time, which no operation reads.
        let nowhere = vec![0.0; self.spec.dimension + 1];
        let defaults = self.spec.parameters.iter().map(|p| p.default);
        let inputs: Vec<f64> = nowhere.into_iter().chain(defaults).collect();
        self.staged.program().part(slots).evaluate(&inputs)
    }

    /// The stretch across in words.
    fn about_across(&self) -> &'static str {
        match self.spec.dimension {
            1 => {
                "stretch across the line, the same in both directions: there is no stress along them"
            }
            _ => {
                "stretch across the plane, by which the thickness changes: there is no stress along it"
            }
        }
    }

    /// The ratio of volumes, in the names of fields.
    pub(crate) fn volume_ratio(&self) -> &'static str {
        match (self.staged.across, self.spec.dimension) {
            (None, _) => "J",
            (Some(_), 1) => "(J F_zz^2)",
            (Some(_), _) => "(J F_zz)",
        }
    }

    /// The ratio of volumes by calls of the fields `J` and `F_zz`.
    pub(crate) fn volume_by(&self, [J, F_zz]: [&str; 2]) -> String {
        match (self.staged.across, self.spec.dimension) {
            (None, _) => J.to_owned(),
            (Some(_), 1) => format!("({J} * {F_zz} * {F_zz})"),
            (Some(_), _) => format!("({J} * {F_zz})"),
        }
    }

    /// A sentence on the directions left out.
    fn assumption(&self) -> &'static str {
        match (self.staged.across, self.spec.dimension) {
            (None, _) if self.spec.coordinates == Coordinates::Axisymmetric => {
                "The body is one of revolution: nothing depends on the angle, and the stretch and the stress around the axis are those along theta."
            }
            (None, _) => "In two dimensions the deformation is plane strain.",
            (Some(_), 1) => {
                "There is no stress across the line (uniaxial stress): P, b and tractions are per unit of area before the deformation, J is \
                 the stretch along the line, and the stretch across is F_zz."
            }
            (Some(_), _) => {
                "There is no stress across the plane (plane stress): P, b and tractions are per unit of thickness before the deformation, J \
                 is the ratio of areas, and the thickness changes by F_zz."
            }
        }
    }

    /// Fields, strain energy, tractions and constants, in the order of files.
    pub(crate) fn functions(&self) -> Vec<Item> {
        let staged = &self.staged;
        let at_points = |name: String, about: String, shape, outputs| Item {
            name,
            about,
            shape,
            given: Given::PositionAndTime,
            of_table: None,
            outputs,
        };
        let fields = staged.fields.iter().map(|field| {
            let (letter, about) = (field.name.letter(), field.name.in_words());
            let mut item =
                at_points(letter.into(), about.into(), field.name.shape(), field.outputs.clone());
            if self.is_tabulated(field.name) {
                let is_force = field.name == FieldName::BodyForce;
                item.of_table = Some(if is_force { OfTable::BodyForce } else { OfTable::Stress });
            }
            item
        });
        let energy = staged.energy.map(|energy| {
            let about = "strain energy per reference volume";
            at_points("W".into(), about.into(), Shape::Scalar, vec![energy])
        });
        let across = staged.across.map(|stretch| {
            at_points("F_zz".into(), self.about_across().into(), Shape::Scalar, vec![stretch])
        });
        let tangent = staged.tangent.iter().map(|slope| {
            let [k, L] = slope.component.map(|index| index + 1);
            let about = format!(
                "dP/dF{k}{L}, the derivative of P with respect to F{k}{L}: a column of the tangent"
            );
            at_points(format!("dPdF{k}{L}"), about, Shape::Matrix, slope.outputs.clone())
        });
        let tractions = staged.tractions.iter().map(|traction| {
            let surface = traction.surface.to_string();
            let about = format!("traction on the surface {surface}, force per reference area");
            let name = format!("{}_traction", surface.replace('-', "_"));
            at_points(name, about, Shape::Vector, traction.outputs.clone())
        });
        let constants = &staged.constants;
        let constant = |name: &str, about: &str, slots: &[Slot]| Item {
            name: name.into(),
            about: about.into(),
            shape: if slots.len() == 1 { Shape::Scalar } else { Shape::Vector },
            given: Given::Nothing,
            of_table: None,
            outputs: slots.to_vec(),
        };
        let corner =
            |name, about, slots| Item { shape: Shape::Vector, ..constant(name, about, slots) };
        let mut all: Vec<Item> =
            fields.chain(energy).chain(across).chain(tangent).chain(tractions).collect();
        all.extend(self.tabulated_items());
        all.extend([
            constant(
                "cell_length",
                "the length that a cell count divides",
                &[constants.cell_length],
            ),
            constant("density", "mass per reference volume", &[constants.density]),
            constant("wave_speed", "the speed that CFL numbers refer to", &[constants.wave_speed]),
            constant("period", "the time in which the motion repeats", &[constants.period]),
        ]);
        if let Some(density) = staged.density_here {
            let about =
                "mass per reference volume at a place; density has it in the middle of the body";
            let given = Given::Position;
            all.push(Item { given, ..constant("rho0", about, &[density]) });
        }
        // A host that runs a stated law has its own constants for it.
        if let Law::Library(material) = &constants.law {
            let named = material.row().constants.iter().zip(material.values());
            all.extend(named.map(|(own, slot)| constant(own.name, own.meaning, &[slot])));
        }
        match &constants.domain {
            Measures::Box { lower, upper } => all.extend([
                corner("lower", "the body's corner of smallest coordinates", lower),
                corner("upper", "the body's corner of largest coordinates", upper),
            ]),
            Measures::Annulus { inner, outer } => all.extend([
                constant("inner", "the body's inner radius", &[*inner]),
                constant("outer", "the body's outer radius", &[*outer]),
            ]),
            Measures::Tube(measures) => {
                let TubeMeasures { inner, outer, lower, upper, around } = measures.clone();
                all.extend([
                    constant("inner", "the body's inner radius", &[inner]),
                    constant("outer", "the body's outer radius", &[outer]),
                    constant("lower", "the body's smallest Z", &[lower]),
                    constant("upper", "the body's largest Z", &[upper]),
                ]);
                if let Some([from, to]) = around.angles() {
                    all.extend([
                        constant("first_angle", "the body's smallest angle", &[from]),
                        constant("last_angle", "the body's largest angle", &[to]),
                    ]);
                }
            }
        }
        all
    }

    /// The functions that the solution's operations call and the host lacks.
    pub(crate) fn routines(&self, target: &impl WithRuntime) -> Vec<Routine> {
        let mut roots = BTreeSet::new();
        for operation in self.staged.program().operations() {
            let called = match operation {
                Operation::Call(function, _) => Called::of(*function),
                Operation::SinPi(_) => Called::Support("sin_pi"),
                Operation::CosPi(_) => Called::Support("cos_pi"),
                Operation::LnOfBoth(..) => Called::Support("ln_of_both"),
                Operation::SumError(..) => Called::Support("sum_error"),
                Operation::ProductError(..) => Called::Support("product_error"),
                _ => continue,
            };
            if let Called::Support(name) = called {
                roots.insert(name);
            }
        }
        routines(target, &roots.into_iter().collect::<Vec<_>>())
    }

    /// The head of a file, a line each: the solution, its origin, remarks of `host`, and the conventions on which the agreement of a
    /// run depends.
    pub(crate) fn head_for_host(&self, host: &str) -> Vec<String> {
        let spec = self.spec;
        let mut lines = vec![format!("{}.", spec.title)];
        lines.extend(self.head());
        lines.push(String::new());
        lines.extend(self.formulas());
        for boundary in &spec.boundaries {
            let condition = boundary.condition.to_string().replace("prescribed-", "prescribed ");
            lines.push(format!("surface {}: {condition}", boundary.surface));
        }
        if !spec.reference.is_empty() {
            lines.push(format!("Source: {}.", spec.reference));
        }
        lines.push(String::new());
        lines.extend(host.lines().map(str::to_owned));
        lines.extend(self.about_table());
        let coordinates = match self.is_of_half_plane {
            true => {
                "coordinates: X is {R, theta, Z}, the REFERENCE radius, an angle on which nothing depends, and the height; components are \
                 those along e_R, e_theta and e_Z at X, also of the current state: u is the displacement of X in this basis. Integrals over \
                 the half plane have the weight 2 pi R."
            }
            false => {
                "coordinates: X is the REFERENCE position, in Cartesian components. A host that gives the current position x = X + u has to \
                 find X first."
            }
        };
        lines.extend(
            format!("
force: b is per unit MASS; rho0_b = density b is per unit REFERENCE volume; per unit current volume it is rho0_b/VOLUME. The balance \
is rho0 a = Div P + rho0 b, so that it stands on the side of the stresses, with a plus sign.
{coordinates}
stress: P is the first Piola-Kirchhoff stress, P[i][J] with i spatial and J reference, and the traction P N is per reference area. The nominal \
stress is P transposed; the Cauchy stress is P F^T/VOLUME.
time: t is the time of the state whose accelerations the force causes: the old time of an explicit step with centred differences, the new \
time of an implicit step, and for generalised-alpha schemes the time at which they balance momentum. A static problem has the deformation of a time t that stays, with the force -Div P = rho0 (b - a), static_force; a load \
factor is that time.
ASSUMED Units are those of the parameters; with SI units: u, X in m, P in Pa, b in m/s^2.")
                .replace("VOLUME", self.volume_ratio())
                .replace("ASSUMED", self.assumption())
                .lines()
                .map(str::to_owned),
        );
        lines.iter().map(|line| comment(line)).collect()
    }

    /// Meanings of parameters, a line each.
    pub(crate) fn parameter_lines(&self) -> Vec<String> {
        let about = |p: &Parameter| {
            let meaning = meaning(&p.name, &p.description, &p.unit, &p.range);
            comment(&format!("{}: {meaning}", p.name))
        };
        self.spec.parameters.iter().map(about).collect()
    }

    /// The lines that refuse inadmissible parameters, the lines of the stage of the parameters, and the values of that stage; `named`
    /// gives the language's name of a parameter by its number.
    pub(crate) fn admitted<T: Target>(
        &self,
        target: &T,
        margin: &str,
        places: T::Places,
        refusal: &Refusal,
        named: impl Fn(usize) -> String,
    ) -> Written {
        let spec = self.spec;
        let mut lines = String::new();
        for (index, parameter) in spec.parameters.iter().enumerate() {
            let name = named(index);
            let mut condition = with(refusal.finite, [&name]);
            for bound in &parameter.bounds {
                let (sign, limit) = (bound.relation.sign(), target.literal(bound.limit));
                condition += &format!(" {} {name} {sign} {limit}", refusal.and);
            }
            let mut message =
                format!("{} of {} must be a finite number", parameter.name, spec.name);
            if !parameter.range.is_empty() {
                message += &format!(" {}", parameter.range);
            }
            lines += &with(refusal.lines, [&condition, &(refusal.string)(&message)]);
            if self.table.is_some() {
                let held = target.literal(parameter.default);
                let message = format!(
                    "the table of {} holds for {} = {} alone; write it anew by mms gen {} --set {}=...",
                    spec.name, parameter.name, parameter.default, spec.name, parameter.name
                );
                let condition = format!("{name} == {held}");
                lines += &with(refusal.lines, [&condition, &(refusal.string)(&message)]);
            }
        }
        let written = target.block(&self.staged.fixed_stage(), margin, places);
        lines += &written.lines;
        let (sides, fixed) = written.outputs.split_at(2 * spec.requirements.len());
        for (requirement, side) in spec.requirements.iter().zip(sides.chunks(2)) {
            let [left, right] = [0, 1].map(|index| with(refusal.side, [&side[index]]));
            let condition = format!("{left} {} {right}", requirement.relation.sign());
            let message =
                format!("the parameters of {} must satisfy {}", spec.name, requirement.text);
            lines += &with(refusal.lines, [&condition, &(refusal.string)(&message)]);
        }
        Written { lines, outputs: fixed.to_vec() }
    }
}

/// The text by which a language refuses parameters.
pub(crate) struct Refusal {
    /// Whether `#` is a finite number.
    pub(crate) finite: &'static str,
    /// The operator that joins conditions.
    pub(crate) and: &'static str,
    /// The form of `#` in which the two sides of a condition are compared.
    pub(crate) side: &'static str,
    /// Lines that refuse the parameters unless the first `#` holds, with the second as the message.
    pub(crate) lines: &'static str,
    /// A literal of text.
    pub(crate) string: fn(&str) -> String,
}

/// Lines broken between words, each with a sign before it.
pub(crate) fn commented(lines: &[String], sign: &str, width: usize) -> String {
    let mut text = String::new();
    for line in lines {
        let mut own = sign.to_owned();
        for word in line.split(' ').filter(|word| !word.is_empty()) {
            if own.len() + 1 + word.len() > width && own.len() > sign.len() + 3 {
                text += &own;
                text.push('\n');
                own = format!("{sign}  ");
            }
            // A word that is longer than a line is cut.
            let mut rest = word;
            own.push(' ');
            while own.len() + rest.len() > width {
                let mut cut = width.saturating_sub(own.len());
                while !rest.is_char_boundary(cut) {
                    cut += 1;
                }
                let (now, later) = rest.split_at(cut);
                text.extend([own.as_str(), now, "\n"]);
                own = format!("{sign}   ");
                rest = later;
            }
            own += rest;
        }
        text += own.trim_end();
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Every line of a comment begins as one, and has no more characters than it may.
        #[test]
        fn no_text_leaves_a_comment(
            text in r#"([-*/!#"\\\n\r =<>$&']|\PC){0,300}"#,
            sign in prop::sample::select(vec!["!", "#", "//", "    !"]),
        ) {
            let lines = commented(&[comment(&text), comment(&text)], sign, 60);
            for line in lines.lines() {
                prop_assert!(line.starts_with(sign), "{line:?}");
                let rest = &line[sign.len()..];
                // Text that follows the sign directly may be a directive.
                prop_assert!(rest.is_empty() || rest.starts_with(' '), "{line:?}");
                prop_assert!(line.len() <= 64 && !line.ends_with('\\'), "{line:?}");
            }
            prop_assert!(!lines.contains('\r'));
        }
    }
}
