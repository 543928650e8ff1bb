//! Julia source.

use super::tables;
use crate::code::Code;
use crate::listing::{Given, Item, Refusal, commented};
use crate::names::Names;
use crate::runtime::{Primitive, Routine, WithRuntime};
use crate::target::{Called, Target, Unwritable, Written};
use crate::text::{digits, julia_string};
use mmsmith_expr::Function;
use mmsmith_stage::{Operand, Shape};
use std::borrow::Cow;

const REMARKS: &str = "\
Julia, this file alone: include(\"FILE\"); s = MODULE.Solution(\"A\" => 0.1); MODULE.u(s, X, t), and so v, a, H, F, J, P, b, rho0_b, static_force, sigma, S and tractions; \
constants as MODULE.density(s). X is anything that X[1] reads: a Point or VectorValue of Gridap, a Vec of Ferrite, an SVector, a tuple. Vectors are \
tuples, matrices tuples of rows: VectorValue(MODULE.b(s, X, t)...), Vec(MODULE.b(s, X, t)). Numbers of any type that has Julia's functions serve, dual \
numbers among them.
Julia has its own elementary functions, which differ from the C library's in last bits.";

struct Julia;

impl Target for Julia {
    type Places = ();

    const STATEMENT: [&'static str; 2] = ["", "\n"];

    fn literal(&self, value: f64) -> String {
        let sign = if value.is_sign_negative() { "-" } else { "" };
        let size = value.abs();
        let text = if size.is_infinite() {
            format!("{sign}Inf")
        } else {
            format!("{sign}{}", digits(size))
        };
        if sign.is_empty() { text } else { format!("({text})") }
    }

    fn function(&self, function: Called) -> Cow<'static, str> {
        match function.or_library() {
            // Julia's logarithm throws for negative numbers, where other languages return NaN.
            Called::Support("far_logarithm") | Called::Library("log") => "mmsmith_log(#)".into(),
            Called::Library("pow") => "#^#".into(),
            Called::Library("atan2") => "atan(#, #)".into(),
            Called::Library(name) => format!("{name}(#)").into(),
            Called::Support(name) => {
                format!("mmsmith_{name}({})", if function.takes_two() { "#, #" } else { "#" })
                    .into()
            }
        }
    }

    fn operand(&self, text: &mut String, operand: Operand<'_>, (): ()) {
        match operand {
            Operand::Time => text.push('t'),
            // Indices count from one.
            Operand::Coordinate(index) => *text += &format!("X[{}]", index + 1),
            Operand::Parameter(index) => *text += &format!("s.par[{}]", index + 1),
            Operand::Kept(_, index) => *text += &format!("s.fixed[{}]", index + 1),
            _ => {}
        }
    }
}

impl WithRuntime for Julia {
    fn primitive(&self, primitive: Primitive) -> &'static str {
        match primitive {
            Primitive::Choose => "ifelse(#, #, #)",
            Primitive::Less => "(# < #)",
            Primitive::AtMost => "(# <= #)",
            Primitive::Equal => "(# == #)",
            Primitive::Abs => "abs(#)",
            Primitive::Nearest => "round(#)",
            // Never called: the logarithm is Julia's own.
            Primitive::Exponent | Primitive::Scaled => "",
        }
    }
}

const REFUSAL: Refusal = Refusal {
    finite: "isfinite(#)",
    and: "&&",
    side: "#",
    lines: "    (#) || throw(ArgumentError(#))\n",
    string: julia_string,
};

pub(crate) fn source(code: &Code<'_>) -> Result<String, Unwritable> {
    if code.calls(|function| function == Function::Erf) {
        let (function, solution) = (Function::Erf.name().to_owned(), code.spec.name.clone());
        return Err(Unwritable::Function { target: "julia", function, solution });
    }
    let spec = code.spec;
    let names = Names::of(&spec.name);
    let module = format!("Mms{}", names.solution);
    let remarks =
        REMARKS.replace("MODULE", &module).replace("FILE", &format!("{}.jl", names.module));
    let mut text = commented(&code.head_for_host(&remarks), "#", 118);
    text += &format!(
        "\nmodule {module}\n\nmmsmith_log(x) = x > 0 ? log(x) : x == 0 ? oftype(float(x), -Inf) : oftype(float(x), NaN)\n"
    );
    for routine in code.routines(&Julia) {
        text += &julia_routine(&routine);
    }
    text += "\n# The fields for given parameters:\n";
    text += &commented(&code.parameter_lines(), "#", 118);
    let (count, kept) = (spec.parameters.len(), code.staged.fixed_count());
    text += &format!(
        "struct Solution\n    par::NTuple{{{count},Float64}}\n    fixed::NTuple{{{kept},Float64}}\nend\n"
    );
    let named: Vec<String> = spec
        .parameters
        .iter()
        .map(|p| format!("{} => {}", julia_string(&p.name), Julia.literal(p.default)))
        .collect();
    text += &format!(
        "
const DIMENSION = {}
const DEFAULTS = Pair{{String,Float64}}[{}]

function Solution(given::Pair...)
    values = Dict{{String,Float64}}(DEFAULTS)
    for (name, value) in given
        haskey(values, name) || throw(ArgumentError(\"no parameter $name; there are $(join(first.(DEFAULTS), \", \"))\"))
        values[name] = value
    end
    s = (par = Tuple(values[name] for name in first.(DEFAULTS)),)
",
        spec.dimension,
        named.join(", ")
    );
    let Written { lines, outputs: fixed } =
        code.admitted(&Julia, "    ", (), &REFUSAL, |index| format!("s.par[{}]", index + 1));
    text += &lines;
    text += &format!("    return Solution(s.par, {})\nend\n", tuple(&fixed));
    text += &tables::julia::reader(code);
    for item in code.functions() {
        text += &match item.of_table {
            None => julia_item(code, &item),
            Some(of_table) => tables::julia::item(code, &item, of_table),
        };
    }
    let d = spec.dimension;
    let density = if code.has_graded_density() { "rho0(s, X)" } else { "density(s)" };
    let volume = code.volume_by(["J(s, X, t)", "F_zz(s, X, t)"]);
    text += &format!(
        "
# body force per unit reference volume
rho0_b(s, X, t) = {density} .* b(s, X, t)

# -Div P, the force per reference volume that holds the deformation of time t at rest
static_force(s, X, t) = {density} .* (b(s, X, t) .- a(s, X, t))

# Cauchy stress
function sigma(s, X, t)
    gradient, volume, stress = F(s, X, t), {volume}, P(s, X, t)
    return ntuple(i -> ntuple(j -> sum(stress[i][k] * gradient[j][k] for k in 1:{d}) / volume, {d}), {d})
end

# second Piola-Kirchhoff stress
function S(s, X, t)
    gradient, stress = F(s, X, t), P(s, X, t)
    second = [gradient[i][j] for i in 1:{d}, j in 1:{d}] \\ [stress[i][j] for i in 1:{d}, j in 1:{d}]
    return ntuple(i -> ntuple(j -> second[i, j], {d}), {d})
end

end # module
"
    );
    Ok(text)
}

fn tuple(entries: &[String]) -> String {
    format!("({})", entries.iter().map(|entry| format!("{entry},")).collect::<String>())
}

fn julia_routine(routine: &Routine) -> String {
    let mut text = format!(
        "\n# {}\nfunction mmsmith_{}({})\n",
        routine.about,
        routine.name,
        routine.arguments.join(", ")
    );
    for step in &routine.steps {
        text += &format!("    {} = {}\n", step.name, step.value);
    }
    text + &format!("    return {}\nend\n", routine.result)
}

fn julia_item(code: &Code<'_>, item: &Item) -> String {
    let given = match item.given {
        Given::Nothing => "s",
        Given::Position => "s, X",
        Given::PositionAndTime => "s, X, t",
    };
    let mut text = format!("\n# {}\nfunction {}({given})\n", item.about, item.name);
    let Written { lines, outputs } = Julia.block(&item.block(code), "    ", ());
    text += &lines;
    let value = match item.shape {
        Shape::Scalar => outputs.concat(),
        Shape::Vector => tuple(&outputs),
        Shape::Matrix => tuple(&outputs.chunks(code.spec.dimension).map(tuple).collect::<Vec<_>>()),
    };
    text + &format!("    return {value}\nend\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_text_ends_a_string(text in r#"(["\\\n\r $%'&]|\PC){0,200}"#) {
            let literal = julia_string(&text);
            let inner = &literal[1..literal.len() - 1];
            prop_assert!(inner.is_ascii() && !inner.contains('\n'));
            let mut characters = inner.chars();
            while let Some(c) = characters.next() {
                // Quotation marks and dollar signs are escaped, and the last backslash escapes something.
                prop_assert!(!['"', '$'].contains(&c), "{literal}");
                if c == '\\' {
                    prop_assert!(characters.next().is_some(), "{literal}");
                }
            }
        }
    }
}
