//! The C header of a solution: `c.h` with the solution's own parts between its signs `@`.

use super::tables::c::{TABLE, kept_of_series};
use crate::c_names::members;
use crate::code::Code;
use crate::listing::{Given, Item, Refusal, commented};
use crate::names::Names;
use crate::runtime::{Line, Primitive, Routine, WithRuntime};
use crate::table::OfTable;
use crate::target::{Called, Target, Written};
use crate::text::{c_number, c_string, filled, push_index};
use mmsmith_expr::Function;
use mmsmith_stage::{Block, Operand, Shape, Stage};
use std::borrow::Cow;

const HEADER: &str = include_str!("c.h");

const REMARKS: &str = "\
C99, C++ and CUDA. MMSMITH_FN is what functions are declared with, `static inline` where nothing else is defined before. Matrices are row-major: \
entry [i*NAME_dimension + J], row i spatial, column J reference.
NAME_parameters p = NAME_defaults(); gives the parameters, to be changed at will; then, once a run,
message = NAME_prepare(&s, &p); is a null pointer, or says what is wrong with the parameters.
NAME_u, _v, _a, _H, _F, _J, _P, _b compute one field, NAME_fields all of them; the traction on a surface, at points X of it, has a function of its own.
The body force at points that stay: NAME_point_array once a run, NAME_b_array once a step, or for single points NAME_at_point once a run, \
NAME_at_time once a step, NAME_b_staged. All ways give the same bits.
Results equal those of the Rust functions bit for bit, but for functions that are named below, where the compiler keeps every rounding: -ffp-contract=off where the processor fuses \
products and sums (nvcc: -fmad=false), and no -ffast-math. A graphics processor has last bits of its own in functions of <math.h>.";

const REFUSAL: Refusal = Refusal {
    finite: "isfinite(#)",
    and: "&&",
    side: "#",
    lines: "    if (!(#)) {\n        return #;\n    }\n",
    string: c_string,
};

impl Code<'_> {
    /// The text of the solution's C header.
    #[must_use]
    pub fn header_source(&self) -> String {
        let (spec, staged) = (self.spec, &self.staged);
        let (name, force) = (Names::of(&spec.name).module, &staged.body_force);
        let [times, points] = match &self.table {
            None => [force.time_count(), force.point_count()],
            Some(table) => kept_of_series(table, spec.dimension),
        };
        let c = C { members: members(&spec.parameters) };
        let items = |given: Given| -> String {
            let items = self.functions().into_iter().filter(|item| item.given == given);
            items.map(|item| c.item(self, &item, &name)).collect()
        };
        let results = staged.fields.iter().flat_map(|field| match field.name.shape() {
            _ if self.is_tabulated(field.name) => Vec::new(),
            Shape::Scalar => vec![format!("out->{} = ", field.name.letter())],
            _ => entries(&format!("out->{}", field.name.letter()), field.outputs.len()),
        });
        filled(HEADER, |place| match place {
            "head" => self.c_head(&name),
            "GUARD" => format!("MMSMITH_{}_H", name.to_ascii_uppercase()),
            "NAME" => name.clone(),
            "d" => spec.dimension.to_string(),
            "routines" => self.routines(&c).iter().map(routine).collect(),
            "parameter_count" => spec.parameters.len().to_string(),
            "time_count" => times.to_string(),
            "point_count" => points.to_string(),
            "fixed_length" => staged.fixed_count().max(1).to_string(),
            "time_length" => times.max(1).to_string(),
            "point_length" => points.max(1).to_string(),
            // There is no empty structure in C.
            "parameters" if c.members.is_empty() => {
                "    double unused; /* there are no parameters */\n".into()
            }
            "defaults" if c.members.is_empty() => "    p.unused = 0.0;\n".into(),
            "parameters" => (self.parameter_lines().iter().zip(&c.members))
                .map(|(about, member)| format!("    double {member}; /* {about} */\n"))
                .collect(),
            "defaults" => (spec.parameters.iter().zip(&c.members))
                .map(|(p, member)| format!("    p.{member} = {};\n", c_number(p.default)))
                .collect(),
            "field_values" => (staged.fields.iter())
                .map(|field| {
                    let (shape, d) = (field.name.shape(), spec.dimension);
                    let argument = argument(field.name.letter(), shape, shape.entries(d));
                    format!("    {argument}; /* {} */\n", field.name.in_words())
                })
                .collect(),
            "prepare" => {
                let named = |index: usize| format!("p->{}", c.members[index]);
                let Written { lines, outputs } = self.admitted(&c, "    ", "p->", &REFUSAL, named);
                let fixed = results_in(&outputs, entries("s->fixed", outputs.len().max(1)));
                let no_table = match &self.table {
                    None => "",
                    Some(_) => "    memset(&s->table, 0, sizeof s->table);\n",
                };
                format!("{lines}    s->par = *p;\n{fixed}{no_table}")
            }
            "fields" => items(Given::PositionAndTime) + &items(Given::Position),
            "constants" => items(Given::Nothing),
            "table_reader" | "table_member" | "read_table" | "series" if self.table.is_none() => {
                String::new()
            }
            "table_reader" => TABLE.into(),
            "table_member" => "    mmsmith_table table;\n".into(),
            "read_table" => self.c_read_table(&name),
            "series" => self.c_series(&name),
            "all_fields" => {
                let formulas =
                    c.body(&["s", "X", "t"], &staged.all_fields(), results.clone().collect());
                let tabulated = staged.fields.iter().filter(|f| self.is_tabulated(f.name));
                let call = |field: &mmsmith_stage::Field| {
                    let letter = field.name.letter();
                    format!("    {name}_{letter}(s, X, t, out->{letter});\n")
                };
                formulas + &tabulated.map(call).collect::<String>()
            }
            "at_time" | "at_point" | "b_staged" if self.table.is_some() => self.c_stage(place),
            "at_time" => {
                c.body(&["s", "t"], &staged.time_stage(force), entries("time.values", times.max(1)))
            }
            "at_point" => {
                c.body(&["s", "X"], &staged.point_stage(force), entries("point", points.max(1)))
            }
            "b_staged" => {
                let given = ["s", "time", "point", "stride"];
                c.body(&given, &staged.staged(force), entries("b", spec.dimension))
            }
            other => format!("@{other}@"),
        })
    }

    fn c_head(&self, name: &str) -> String {
        let mut lines = self.head_for_host(&REMARKS.replace("NAME", name));
        let called = |function: &&Function| {
            function.is_of_another_library() && self.calls(|f| f == **function)
        };
        let foreign = Function::ALL.iter().filter(called).filter_map(|function| function.math_h());
        lines.extend(foreign.map(|name| {
            format!("Of {name} the Rust functions have the last bits of another library.")
        }));
        commented(&lines, " *", 115)
    }
}

/// A function of `runtime.txt`, the same in every header that has it.
fn routine(routine: &Routine) -> String {
    let guard = format!("MMSMITH_{}", routine.name.to_ascii_uppercase());
    let arguments: Vec<String> =
        routine.arguments.iter().map(|name| format!("double {name}")).collect();
    format!(
        "#ifndef {guard}\n#define {guard} 1\n\n/* {} */\nMMSMITH_FN double mmsmith_{}({})\n{{\n{}}}\n\n#endif\n\n",
        routine.about,
        routine.name,
        arguments.join(", "),
        lines(&routine.body, "    ")
    )
}

fn lines(body: &[Line], margin: &str) -> String {
    let line = |line: &Line| match line {
        Line::Step(step) => {
            let kind = if step.is_condition { "int" } else { "double" };
            format!("{margin}const {kind} {} = {};\n", step.name, step.value)
        }
        Line::If(condition, then) => {
            let then = lines(then, &format!("{margin}    "));
            format!("{margin}if ({condition}) {{\n{then}{margin}}}\n")
        }
        Line::Return(value) => format!("{margin}return {value};\n"),
    };
    body.iter().map(line).collect()
}

/// The entries of an array, each as the left side of an assignment.
fn entries(array: &str, count: usize) -> Vec<String> {
    (0..count).map(|index| format!("{array}[{index}] = ")).collect()
}

/// The declaration of an argument.
fn argument(name: &str, shape: Shape, count: usize) -> String {
    match shape {
        Shape::Scalar => format!("double {name}"),
        _ => format!("double {name}[{count}]"),
    }
}

/// Assigns values to their places; an array without values has a zero.
fn results_in(values: &[String], places: Vec<String>) -> String {
    let values = values.iter().map(String::as_str).chain(std::iter::repeat("0.0"));
    places.iter().zip(values).map(|(place, value)| format!("    {place}{value};\n")).collect()
}

/// C, with the names of the parameters as members of their structure.
struct C {
    members: Vec<String>,
}

impl C {
    /// The lines of a function with the arguments `given` that writes its values to `places`.
    fn body(&self, given: &[&str], block: &Block<'_>, places: Vec<String>) -> String {
        // Arguments that are not read are named, so that compilers do not warn.
        let unread = given.iter().filter(|given| !block.reads(|o| origin(o).contains(given)));
        let mut text: String = unread.map(|name| format!("    (void){name};\n")).collect();
        let Written { lines, outputs } = self.block(block, "    ", "s->par.");
        text += &lines;
        text + &results_in(&outputs, places)
    }

    /// A function of the solution; it takes a position and a time where its values depend on them.
    fn item(&self, code: &Code<'_>, item: &Item, prefix: &str) -> String {
        let (name, d) = (&item.name, code.spec.dimension);
        let count = match item.of_table {
            None => item.outputs().len(),
            Some(OfTable::Internal) => code.variable_count(),
            Some(_) => item.shape.entries(d),
        };
        // The argument for results has the name of the quantity.
        let result = name.rsplit('_').next().unwrap_or(name);
        let joint = if result == name { ", " } else { ",\n    " };
        let (given, read) = match item.given {
            Given::Nothing => (String::new(), &["s"][..]),
            Given::Position => (format!(", const double X[{d}]"), &["s", "X"][..]),
            Given::PositionAndTime => {
                (format!(", const double X[{d}], double t"), &["s", "X", "t"][..])
            }
        };
        let (returned, argument, places) = match item.shape {
            Shape::Scalar => ("double", String::new(), vec!["return ".into()]),
            shape => {
                ("void", joint.to_owned() + &argument(result, shape, count), entries(result, count))
            }
        };
        format!(
            "/* {} */\nMMSMITH_FN {returned} {prefix}_{name}(const {prefix}_solution *s{given}{argument})\n{{\n{}}}\n\n",
            item.about,
            match item.of_table {
                None => self.body(read, &item.block(code), places),
                Some(of_table) => code.c_of_table(of_table, prefix),
            }
        )
    }
}

/// The arguments of a function that contain an operand.
fn origin(operand: Operand<'_>) -> &'static [&'static str] {
    match operand {
        Operand::Coordinate(_) => &["X"],
        Operand::Time => &["t"],
        Operand::Parameter(_) | Operand::Kept(Stage::Fixed, _) => &["s"],
        Operand::Kept(Stage::Time, _) => &["time"],
        Operand::Kept(Stage::Point, 0) => &["point"],
        Operand::Kept(Stage::Point, _) => &["point", "stride"],
        _ => &[],
    }
}

impl Target for C {
    /// Text before the name of a parameter.
    type Places = &'static str;

    const STATEMENT: [&'static str; 2] = ["const double ", ";\n"];

    fn literal(&self, value: f64) -> String {
        c_number(value)
    }

    fn function(&self, function: Called) -> Cow<'static, str> {
        let (family, name) = match function {
            Called::Library(name) => ("", name),
            Called::Support(name) => ("mmsmith_", name),
        };
        let arguments = if function.takes_two() { "#, #" } else { "#" };
        format!("{family}{name}({arguments})").into()
    }

    fn operand(&self, text: &mut String, operand: Operand<'_>, parameters: &'static str) {
        let (before, index, after) = match operand {
            Operand::Time => return text.push('t'),
            Operand::Parameter(index) => return text.extend([parameters, &self.members[index]]),
            Operand::Coordinate(index) => ("X[", index, "]"),
            Operand::Kept(Stage::Fixed, index) => ("s->fixed[", index, "]"),
            Operand::Kept(Stage::Time, index) => ("time->values[", index, "]"),
            Operand::Kept(Stage::Point, 0) => return text.push_str("point[0]"),
            Operand::Kept(Stage::Point, 1) => return text.push_str("point[stride]"),
            Operand::Kept(Stage::Point, index) => ("point[", index, " * stride]"),
            // The header has no form for lattices.
            _ => return,
        };
        text.push_str(before);
        push_index(text, index);
        text.push_str(after);
    }
}

impl WithRuntime for C {
    fn primitive(&self, primitive: Primitive) -> &'static str {
        match primitive {
            Primitive::Choose => "(# ? # : #)",
            Primitive::Less => "# < #",
            Primitive::AtMost => "# <= #",
            Primitive::Equal => "# == #",
            Primitive::Abs => "fabs(#)",
            Primitive::Nearest => "mmsmith_nearest(#)",
            Primitive::Exponent => "(ilogb(#) + 1.0)",
            Primitive::Scaled => "ldexp(#, (int)(#))",
        }
    }
}
