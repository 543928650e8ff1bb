//! Fortran 2008 source: a module.

use super::tables;
use crate::code::Code;
use crate::listing::{Given, Item, Refusal, commented};
use crate::names::Names;
use crate::runtime::{Primitive, Routine, WithRuntime};
use crate::target::{Called, Target, Unwritable, Written};
use crate::text::{digits, fortran_string};
use mmsmith_spec::Parameter;
use mmsmith_stage::{Operand, Shape};
use std::borrow::Cow;

const REMARKS: &str = "\
Fortran 2008, this file alone. use MODULE, only: solution, parameters, prepare, b; then type(solution) :: s; p%A = 0.1; call prepare(s, p, message), \
whose message is empty where the parameters are admissible; values = b(s, X, t). All functions are pure and can be renamed where they are used: \
only: ring_b => b. Matrices have rows first: P(i, J).
Results are those of the C header bit for bit where the compiler keeps every rounding (gfortran: -ffp-contract=off where the processor fuses \
products and sums, and neither -ffast-math nor -Ofast).";

/// Fortran, with the names of the parameters as components of their type.
struct Fortran {
    members: Vec<String>,
}

impl Target for Fortran {
    type Places = ();

    const STATEMENT: [&'static str; 2] = ["", "\n"];

    fn literal(&self, value: f64) -> String {
        let size = value.abs();
        let text =
            if size.is_infinite() { "infinity".into() } else { format!("{}_dp", digits(size)) };
        if value.is_sign_negative() { format!("(-{text})") } else { text }
    }

    fn function(&self, function: Called) -> Cow<'static, str> {
        match function {
            Called::Library("pow") => "#**#".into(),
            Called::Library("log1p") => "c_log1p(#)".into(),
            Called::Library("expm1") => "c_expm1(#)".into(),
            Called::Library(name) | Called::Support(name) => {
                format!("{name}({})", if function.takes_two() { "#, #" } else { "#" }).into()
            }
        }
    }

    fn operand(&self, text: &mut String, operand: Operand<'_>, (): ()) {
        match operand {
            Operand::Time => text.push('t'),
            Operand::Parameter(index) => text.extend(["s%par%", &self.members[index]]),
            // Array indices count from one.
            Operand::Coordinate(index) => *text += &format!("X({})", index + 1),
            Operand::Kept(_, index) => *text += &format!("s%fixed({})", index + 1),
            _ => {}
        }
    }
}

impl WithRuntime for Fortran {
    fn primitive(&self, primitive: Primitive) -> &'static str {
        match primitive {
            Primitive::Choose => "choose(#, #, #)",
            Primitive::Less => "(# < #)",
            Primitive::AtMost => "(# <= #)",
            Primitive::Equal => "(# == #)",
            Primitive::Abs => "abs(#)",
            Primitive::Nearest => "nearest_whole(#)",
            Primitive::Exponent => "real(exponent(#), dp)",
            Primitive::Scaled => "scale(#, int(#))",
        }
    }
}

/// Names of components. Fortran does not distinguish small and capital letters, and a name starts with a letter.
fn members(parameters: &[Parameter]) -> Vec<String> {
    let mut taken: Vec<String> = Vec::new();
    for parameter in parameters {
        let start = if parameter.name.starts_with('_') { "p" } else { "" };
        let mut member: String = start.chars().chain(parameter.name.chars()).take(55).collect();
        while taken.iter().any(|other| other.eq_ignore_ascii_case(&member)) {
            member.push('_');
        }
        taken.push(member);
    }
    taken
}

const REFUSAL: Refusal = Refusal {
    // A bound that holds for finite numbers, and neither for infinite numbers nor for NaN.
    finite: "abs(#) <= huge(1.0_dp)",
    and: ".and.",
    side: "#",
    lines: "    if (.not. (#)) then\n      message = #\n      return\n    end if\n",
    string: fortran_string,
};

pub(super) fn module_name(code: &Code<'_>) -> String {
    format!("mms_{}", Names::of(&code.spec.name).module).chars().take(50).collect()
}

pub(crate) fn source(code: &Code<'_>) -> Result<String, Unwritable> {
    let remarks = REMARKS.replace("MODULE", &module_name(code));
    Ok(with_head(code, &remarks, "") + &module(code))
}

/// The head of a file, after a line `start`.
pub(super) fn with_head(code: &Code<'_>, remarks: &str, start: &str) -> String {
    start.to_owned() + &commented(&code.head_for_host(remarks), "!", 110)
}

/// User subroutines of a host around the module: `template` with the solution of the default parameters, which they share, and with
/// names.
pub(super) fn user_subroutines(code: &Code<'_>, template: &str) -> String {
    template
        .replace("  PREPARED\n", include_str!("prepared.f90"))
        .replace("    TABLE\n", &tables::fortran::reading(code))
        .replace("MODULE", &module_name(code))
        .replace("DIMENSION", &code.spec.dimension.to_string())
}

/// The module of the fields.
pub(super) fn module(code: &Code<'_>) -> String {
    let (spec, name) = (code.spec, module_name(code));
    let fortran = Fortran { members: members(&spec.parameters) };
    let items = code.functions();
    let mut text = format!(
        "module {name}
  use, intrinsic :: iso_fortran_env, only: dp => real64, int64
  implicit none
  private
  public :: dp, parameters, solution, prepare, rho0_b, static_force, sigma, pk2, solved
"
    );
    text += &items.iter().map(|item| format!("  public :: {}\n", item.name)).collect::<String>();
    text += &tables::fortran::public_names(code);
    text += &format!(
        "
  integer, parameter, public :: dimension_of_space = {}
  real(dp), parameter :: infinity = transfer(9218868437227405312_int64, 1.0_dp)

  type :: parameters
",
        spec.dimension
    );
    for (parameter, (member, about)) in
        spec.parameters.iter().zip(fortran.members.iter().zip(code.parameter_lines()))
    {
        text += &commented(&[about], "    !", 110);
        text += &format!("    real(dp) :: {member} = {}\n", fortran.literal(parameter.default));
    }
    text += &format!(
        "  end type

{}  type :: solution
    type(parameters) :: par
    real(dp) :: fixed({}) = 0.0_dp
{}  end type
",
        tables::fortran::types(code),
        code.staged.fixed_count().max(1),
        if code.table.is_some() { "    type(table) :: fields_of_histories\n" } else { "" }
    );
    let body = fortran.body(code, &items);
    for name in ["log1p", "expm1"] {
        if body.contains(&format!("c_{name}(")) {
            text += &format!(
                "
  interface
    pure real(c_double) function c_{name}(x) bind(c, name=\"{name}\")
      use, intrinsic :: iso_c_binding, only: c_double
      real(c_double), value, intent(in) :: x
    end function
  end interface
"
            );
        }
    }
    text + "\ncontains\n" + &body + &format!("end module {name}\n")
}

impl Fortran {
    fn body(&self, code: &Code<'_>, items: &[Item]) -> String {
        let d = code.spec.dimension;
        let mut text = String::from(
            "
  elemental real(dp) function choose(first, a, b)
    logical, intent(in) :: first
    real(dp), intent(in) :: a, b
    if (first) then
      choose = a
    else
      choose = b
    end if
  end function

  ! The nearest whole number, of two the even one: from 1.5 times 2**52 on doubles are whole numbers.
  elemental real(dp) function nearest_whole(x)
    real(dp), intent(in) :: x
    real(dp), parameter :: shift = 6755399441055744.0_dp
    nearest_whole = anint(x)
    if (abs(x) < 2251799813685248.0_dp) nearest_whole = (x + shift) - shift
  end function
",
        );
        for routine in code.routines(self) {
            text += &self.routine(&routine);
        }
        text += "
  ! Checks the parameters and computes what depends on them only; the message is empty where they are admissible.
  pure subroutine prepare(s, p, message)
    type(solution), intent(inout) :: s
    type(parameters), intent(in) :: p
    character(:), allocatable, intent(out) :: message
";
        let block = code.staged.fixed_stage();
        text += &temporaries(&block);
        text += "    message = \"\"\n    s%par = p\n";
        let Written { lines, outputs: fixed } =
            code.admitted(self, "    ", (), &REFUSAL, |index| format!("p%{}", self.members[index]));
        text += &lines;
        for (index, value) in fixed.iter().enumerate() {
            text += &format!("    s%fixed({}) = {value}\n", index + 1);
        }
        text += "  end subroutine\n";
        text += &tables::fortran::procedures(code);
        for item in items {
            text += &match item.of_table {
                None => self.item(code, item),
                Some(of_table) => tables::fortran::item(code, item, of_table),
            };
        }
        let density = if code.has_graded_density() { "rho0(s, X)" } else { "density(s)" };
        let volume = code.volume_by(["J(s, X, t)", "F_zz(s, X, t)"]);
        text + &format!(
            "
  ! body force per unit reference volume
  pure function rho0_b(s, X, t) result(values)
    type(solution), intent(in) :: s
    real(dp), intent(in) :: X({d}), t
    real(dp) :: values({d})
    values = {density} * b(s, X, t)
  end function

  ! -Div P, the force per reference volume that holds the deformation of time t at rest
  pure function static_force(s, X, t) result(values)
    type(solution), intent(in) :: s
    real(dp), intent(in) :: X({d}), t
    real(dp) :: values({d})
    values = {density} * (b(s, X, t) - a(s, X, t))
  end function

  ! Cauchy stress
  pure function sigma(s, X, t) result(values)
    type(solution), intent(in) :: s
    real(dp), intent(in) :: X({d}), t
    real(dp) :: values({d}, {d}), stress({d}, {d}), gradient({d}, {d})
    stress = P(s, X, t)
    gradient = F(s, X, t)
    values = matmul(stress, transpose(gradient)) / {volume}
  end function

  ! second Piola-Kirchhoff stress (S and s are one name in Fortran)
  pure function pk2(s, X, t) result(values)
    type(solution), intent(in) :: s
    real(dp), intent(in) :: X({d}), t
    real(dp) :: values({d}, {d}), stress({d}, {d}), gradient({d}, {d})
    integer :: column
    stress = P(s, X, t)
    gradient = F(s, X, t)
    do column = 1, {d}
      values(:, column) = solved(gradient, stress(:, column))
    end do
  end function

  ! The y of A y = r by Gauss's elimination with the largest pivots.
  pure function solved(A, r) result(y)
    real(dp), intent(in) :: A({d}, {d}), r({d})
    real(dp) :: y({d}), M({d}, {d} + 1), row({d} + 1)
    integer :: i, k, largest
    M(:, 1:{d}) = A
    M(:, {d} + 1) = r
    do k = 1, {d}
      largest = k - 1 + maxloc(abs(M(k:, k)), dim=1)
      row = M(largest, :)
      M(largest, :) = M(k, :)
      M(k, :) = row / row(k)
      do i = 1, {d}
        if (i /= k) M(i, :) = M(i, :) - M(i, k) * M(k, :)
      end do
    end do
    y = M(:, {d} + 1)
  end function
"
        )
    }

    fn routine(&self, routine: &Routine) -> String {
        let mut text = format!(
            "\n  ! {}\n  elemental real(dp) function {}({})\n",
            routine.about,
            routine.name,
            routine.arguments.join(", ")
        );
        text += &format!("    real(dp), intent(in) :: {}\n", routine.arguments.join(", "));
        for step in &routine.steps {
            text += &format!(
                "    {} :: {}\n",
                if step.is_condition { "logical" } else { "real(dp)" },
                step.name
            );
        }
        for step in &routine.steps {
            text += &broken(&format!("    {} = {}\n", step.name, step.value));
        }
        text + &broken(&format!("    {} = {}\n", routine.name, routine.result)) + "  end function\n"
    }

    fn item(&self, code: &Code<'_>, item: &Item) -> String {
        let (d, name) = (code.spec.dimension, &item.name);
        let (arguments, declared) = match item.given {
            Given::Nothing => ("", ""),
            Given::Position => (", X", ""),
            Given::PositionAndTime => (", X, t", ", t"),
        };
        let mut text = format!(
            "\n  ! {}\n  pure function {name}(s{}) result(values)\n    type(solution), intent(in) :: s\n",
            item.about, arguments
        );
        if item.given != Given::Nothing {
            text += &format!("    real(dp), intent(in) :: X({d}){declared}\n");
        }
        text += &match item.shape {
            Shape::Scalar => "    real(dp) :: values\n".to_owned(),
            Shape::Vector => format!("    real(dp) :: values({d})\n"),
            Shape::Matrix => format!("    real(dp) :: values({d}, {d})\n"),
        };
        let block = item.block(code);
        text += &temporaries(&block);
        let Written { lines, outputs } = self.block(&block, "    ", ());
        text += &lines;
        for (index, value) in outputs.iter().enumerate() {
            text += &match item.shape {
                Shape::Scalar => format!("    values = {value}\n"),
                Shape::Vector => format!("    values({}) = {value}\n", index + 1),
                Shape::Matrix => {
                    format!("    values({}, {}) = {value}\n", index / d + 1, index % d + 1)
                }
            };
        }
        text + "  end function\n"
    }
}

/// The declarations of the values of a block.
fn temporaries(block: &mmsmith_stage::Block<'_>) -> String {
    let names: Vec<String> = block.steps().map(|(index, _)| format!("t{index}")).collect();
    names.chunks(12).map(|some| format!("    real(dp) :: {}\n", some.join(", "))).collect()
}

/// A statement, continued in further lines where it is long.
fn broken(statement: &str) -> String {
    let mut text = String::new();
    let mut length = 0;
    for word in statement.split_inclusive(' ') {
        if length + word.len() > 110 {
            text += "&\n      ";
            length = 6;
        }
        text += word;
        length += word.len();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_text_ends_a_string(text in r#"(["\\\n\r $%'&]|\PC){0,200}"#) {
            for line in fortran_string(&text).split('\n') {
                let piece = line.trim_start().trim_end_matches(" // &");
                let inner = piece.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
                let marks = inner.map(|inner| inner.replace("\"\"", ""));
                prop_assert!(marks.is_some_and(|rest| !rest.contains(['"', '\\'])), "{line}");
                prop_assert!(line.is_ascii() && line.len() <= 132, "{line}");
            }
        }
    }
}
