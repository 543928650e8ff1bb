//! The C header of a solution.

use crate::c_names::members;
use crate::code::Code;
use crate::function::digits;
use crate::listing::{self, Item};
use crate::module::Names;
use crate::target::{Called, Target, Written};
use crate::text::{c_string, comment, meaning, push_index};
use mmsmith_expr::{CSupport, Function, RustCall};
use mmsmith_spec::{Boundary, Condition, Parameter, Surface};
use mmsmith_stage::{Block, Operand, Shape, Stage, Staged};
use std::borrow::Cow;

/// What every header needs: macros, and `sin(pi x)` as the crate of the solutions computes it.
const SUPPORT: &str = include_str!("support.h");

/// What rounding takes from sums and products.
const ROUNDING: &str = include_str!("rounding.h");

/// The logarithm of one plus a small number, as the crate of the solutions computes it.
const LOGARITHM: &str = include_str!("logarithm.h");

/// The logarithm of one plus a small number less that number, by the functions of the former.
const LOGARITHM_REST: &str = include_str!("logarithm_rest.h");

/// What laws need that have the logarithm of the stretch.
const LOG_RATIO: &str = include_str!("log_ratio.h");

/// What laws need that have powers of the stretches.
const COSH_SQRT: &str = include_str!("cosh_sqrt.h");

/// What laws need whose fibres carry no compression.
const POSITIVE_PART: &str = include_str!("positive_part.h");

/// The width of comments.
const WIDTH: usize = 115;

impl Code<'_> {
    /// The text of the solution's C header.
    #[must_use]
    pub fn header_source(&self) -> String {
        let prefix = Names::of(&self.spec.name).module;
        let members = members(&self.spec.parameters);
        let dimension = self.spec.dimension;
        let language = C { members };
        Header {
            code: self,
            staged: &self.staged,
            prefix,
            language,
            dimension,
            text: String::new(),
        }
        .write()
    }
}

struct Header<'a> {
    code: &'a Code<'a>,
    staged: &'a Staged,
    /// What all names begin with.
    prefix: String,
    language: C,
    dimension: usize,
    text: String,
}

impl Header<'_> {
    fn write(mut self) -> String {
        let guard = format!("MMSMITH_{}_H", self.prefix.to_ascii_uppercase());
        self.introduction();
        self.line(&format!("#ifndef {guard}"));
        self.line(&format!("#define {guard} 1\n"));
        self.line("#include <math.h>");
        self.line("#include <stddef.h>\n");
        self.text += SUPPORT;
        if self.code.forms_rounding_errors() {
            self.text += ROUNDING;
        }
        for (support, text) in [
            (CSupport::Logarithm, LOGARITHM),
            (CSupport::LogarithmRest, LOGARITHM_REST),
            (CSupport::LogRatio, LOG_RATIO),
            (CSupport::CoshSqrt, COSH_SQRT),
            (CSupport::PositivePart, POSITIVE_PART),
        ] {
            let needs = |needed: CSupport| {
                needed == support
                    || needed == CSupport::LogarithmRest && support == CSupport::Logarithm
            };
            if self.code.calls(|function| function.c_support().is_some_and(needs)) {
                self.text += text;
            }
        }
        self.line("");
        self.types();
        self.prepare();
        let (fields, constants): (Vec<Item>, Vec<Item>) = self
            .code
            .functions()
            .into_iter()
            .partition(|item| item.given == listing::Given::PositionAndTime);
        fields.iter().for_each(|item| self.function(item));
        self.all_fields();
        self.stages();
        constants.iter().for_each(|item| self.function(item));
        self.line("#if defined(__clang__)\n#pragma STDC FP_CONTRACT DEFAULT\n#endif\n");
        self.line(&format!("#endif /* {guard} */"));
        self.text
    }

    fn line(&mut self, text: &str) {
        self.text += text;
        self.text.push('\n');
    }

    /// A block comment, each line made harmless and broken between words.
    fn comment(&mut self, lines: &[String]) {
        let mut broken = Vec::new();
        for line in lines {
            let mut text = String::new();
            for word in comment(line).split(' ').filter(|word| !word.is_empty()) {
                if text.len() + 1 + word.len() > WIDTH {
                    broken.push(std::mem::take(&mut text));
                    text.push_str("   ");
                }
                text.push(' ');
                text += word;
            }
            broken.push(text);
        }
        let end = if broken.len() == 1 { " */" } else { "\n */" };
        self.line(&format!("/*{}{end}", broken.join("\n *")));
    }

    fn introduction(&mut self) {
        let (spec, prefix) = (self.code.spec, self.prefix.clone());
        let mut lines = vec![format!("{}.", spec.title)];
        lines.extend(self.code.head());
        lines.push(String::new());
        lines.extend(self.code.formulas());
        for boundary in &spec.boundaries {
            lines.push(format!(
                "surface {}: {}",
                surface_name(boundary.surface),
                condition(boundary)
            ));
        }
        if !spec.reference.is_empty() {
            lines.push(String::new());
            lines.push(format!("Source: {}.", spec.reference));
        }
        let conventions = format!(
            "
X is the reference position, x = X + u the current one, in Cartesian components; t is the time.
u displacement, v = du/dt, a = d2u/dt2, H displacement gradient, F = I + H deformation gradient, J = det F,
P first Piola-Kirchhoff stress (traction on a surface with reference normal N: P N), b body force per unit mass:
rho0 a_i = sum_J dP_iJ/dX_J + rho0 b_i. In two dimensions the deformation is plane strain.
Matrices are row-major: entry [i*{prefix}_dimension + J], row i spatial, column J reference.
Units are those of the parameters; with SI units: u, X in m, P in Pa, b in m/s^2.

{prefix}_parameters p = {prefix}_defaults(); gives the parameters, to be changed at will; then, once a run,
message = {prefix}_prepare(&s, &p); is a null pointer, or says what is wrong with the parameters.
{prefix}_u, _v, _a, _H, _F, _J, _P, _b compute one field, {prefix}_fields all of them;
the traction on a surface, at points X of it, has a function of its own.
The body force at points that stay: {prefix}_point_array once a run, {prefix}_b_array once a step, or for single points
{prefix}_at_point once a run, {prefix}_at_time once a step, {prefix}_b_staged. All ways give the same bits.

C99, C++ and CUDA. MMSMITH_FN is what functions are declared with, `static inline` where nothing else is defined
before. Results equal those of the Rust functions bit for bit where the compiler keeps every rounding:
-ffp-contract=off where the processor fuses products and sums (nvcc: -fmad=false), and no -ffast-math."
        );
        lines.extend(conventions.lines().map(str::to_owned));
        let foreign = |function: &Function| {
            matches!(function.rust(), RustCall::Library(_)) && self.code.calls(|f| f == *function)
        };
        let foreign: Vec<&str> =
            Function::ALL.iter().copied().filter(foreign).map(Function::c).collect();
        if !foreign.is_empty() {
            let names = foreign.join(", ");
            lines.push(format!(
                "Of {names} the Rust functions have the last bits of another library."
            ));
        }
        self.comment(&lines);
    }

    fn types(&mut self) {
        let (prefix, d) = (self.prefix.clone(), self.dimension);
        let (parameters, fixed, time, point) = (
            self.language.members.len(),
            self.staged.fixed_count(),
            self.staged.body_force.time_count(),
            self.staged.body_force.point_count(),
        );
        self.comment(&["Space dimensions, and the numbers of parameters and of values that the stages of b keep.".into()]);
        self.line(&format!(
            "enum {{\n    {prefix}_dimension = {d},\n    {prefix}_parameter_count = {parameters},\n    \
             {prefix}_time_count = {time},\n    {prefix}_point_count = {point}\n}};\n"
        ));
        self.line(&format!("typedef struct {prefix}_parameters {{"));
        for (parameter, member) in
            self.code.spec.parameters.iter().zip(self.language.members.clone())
        {
            let Parameter { name, description, unit, range, .. } = parameter;
            let about = comment(&meaning(name, description, unit, range));
            self.line(&format!("    double {member}; /* {about} */"));
        }
        if self.language.members.is_empty() {
            self.line("    double unused; /* there are no parameters */");
        }
        self.line(&format!("}} {prefix}_parameters;\n"));
        self.comment(&["The parameters, and the values that depend on them only.".into()]);
        let count = fixed.max(1);
        self.line(&format!(
            "typedef struct {prefix}_solution {{\n    {prefix}_parameters par;\n    double fixed[{count}];\n}} {prefix}_solution;\n"
        ));
        self.comment(&["What the body force needs of the time alone.".into()]);
        let count = time.max(1);
        self.line(&format!(
            "typedef struct {prefix}_time_values {{\n    double values[{count}];\n}} {prefix}_time_values;\n"
        ));
        self.line(&format!("typedef struct {prefix}_field_values {{"));
        for field in &self.staged.fields {
            let shape = self.shape(field.name.shape());
            self.text += &format!(
                "    double {}{shape}; /* {} */\n",
                field.name.letter(),
                field.name.in_words()
            );
        }
        self.line(&format!("}} {prefix}_field_values;\n"));
    }

    fn prepare(&mut self) {
        let prefix = self.prefix.clone();
        let spec = self.code.spec;
        self.line(&format!("MMSMITH_FN {prefix}_parameters {prefix}_defaults(void)\n{{"));
        self.line(&format!("    {prefix}_parameters p;"));
        for (parameter, member) in spec.parameters.iter().zip(self.language.members.clone()) {
            self.line(&format!("    p.{member} = {};", literal(parameter.default)));
        }
        if self.language.members.is_empty() {
            self.line("    p.unused = 0.0;");
        }
        self.line("    return p;\n}\n");

        self.comment(&["Checks the parameters and computes what depends on them only. Returns a null pointer, or a \
                        message that says what is not admissible; *s is then as it was."
            .into()]);
        self.line(&format!(
            "MMSMITH_FN const char *{prefix}_prepare({prefix}_solution *s, const {prefix}_parameters *p)\n{{"
        ));
        for (parameter, member) in spec.parameters.iter().zip(self.language.members.clone()) {
            let bounds: String = parameter
                .bounds
                .iter()
                .map(|bound| {
                    format!(" && p->{member} {} {}", bound.relation.sign(), literal(bound.limit))
                })
                .collect();
            let mut message =
                format!("{} of {} must be a finite number", parameter.name, spec.name);
            if !parameter.range.is_empty() {
                message += &format!(" {}", parameter.range);
            }
            self.line(&format!("    if (!(mmsmith_is_finite(p->{member}){bounds})) {{"));
            self.line(&format!("        return {};\n    }}", c_string(&message)));
        }
        let staged = self.staged;
        let block = staged.fixed_stage();
        let outputs = self.statements(&block, "    ", Places::PREPARE);
        let (sides, fixed) = outputs.split_at(2 * spec.requirements.len());
        for (requirement, side) in spec.requirements.iter().zip(sides.chunks(2)) {
            let message =
                format!("the parameters of {} must satisfy {}", spec.name, requirement.text);
            let sign = requirement.relation.sign();
            self.line(&format!("    if (!({} {sign} {})) {{", side[0], side[1]));
            self.line(&format!("        return {};\n    }}", c_string(&message)));
        }
        if self.language.members.is_empty() {
            self.line("    (void)p;");
        }
        self.line("    s->par = *p;");
        for (index, value) in fixed.iter().enumerate() {
            self.line(&format!("    s->fixed[{index}] = {value};"));
        }
        if fixed.is_empty() {
            self.line("    s->fixed[0] = 0.0;");
        }
        self.line("    return 0;\n}\n");
    }

    /// A function of the solution, and of a position and a time where its values depend on them.
    fn function(&mut self, item: &Item) {
        let (prefix, d, name) = (&self.prefix, self.dimension, &item.name);
        // Results go to an argument that is called as the quantity.
        let result = name.rsplit('_').next().unwrap_or(name);
        let joint = if result == name { ", " } else { ",\n    " };
        let (given, read) = match item.given {
            listing::Given::Nothing => (String::new(), &[Given::Solution][..]),
            listing::Given::PositionAndTime => (
                format!(", const double X[{d}], double t"),
                &[Given::Solution, Given::Position, Given::Time][..],
            ),
        };
        let (returned, argument) = match item.shape {
            Shape::Scalar => ("double", String::new()),
            shape => ("void", format!("{joint}double {result}{}", self.shape(shape))),
        };
        let head = format!(
            "/* {} */\nMMSMITH_FN {returned} {prefix}_{name}(const {prefix}_solution *s{given}{argument})\n{{",
            item.about
        );
        self.line(&head);
        let code = self.code;
        let block = item.block(code);
        self.unread(&block, read);
        for (index, value) in self.statements(&block, "    ", Places::SINGLE).iter().enumerate() {
            self.line(&match item.shape {
                Shape::Scalar => format!("    return {value};"),
                _ => format!("    {result}[{index}] = {value};"),
            });
        }
        self.line("}\n");
    }

    fn all_fields(&mut self) {
        let (prefix, d, staged) = (self.prefix.clone(), self.dimension, self.staged);
        self.line("/* all fields */");
        self.line(&format!(
            "MMSMITH_FN void {prefix}_fields(const {prefix}_solution *s, const double X[{d}], double t, \
             {prefix}_field_values *out)\n{{"
        ));
        let block = staged.all_fields();
        self.unread(&block, &[Given::Solution, Given::Position, Given::Time]);
        let outputs = self.statements(&block, "    ", Places::SINGLE);
        let mut outputs = outputs.iter();
        for field in &staged.fields {
            for (index, value) in outputs.by_ref().take(field.outputs.len()).enumerate() {
                self.line(&match field.name.shape() {
                    Shape::Scalar => format!("    out->{} = {value};", field.name.letter()),
                    _ => format!("    out->{}[{index}] = {value};", field.name.letter()),
                });
            }
        }
        self.line("}\n");
    }

    fn stages(&mut self) {
        let (prefix, d, staged) = (self.prefix.clone(), self.dimension, self.staged);
        let (times, points) = (staged.body_force.time_count(), staged.body_force.point_count());
        let shown = points.max(1);

        self.comment(&["What the body force needs of the time alone.".into()]);
        self.line(&format!(
            "MMSMITH_FN {prefix}_time_values {prefix}_at_time(const {prefix}_solution *s, double t)\n{{"
        ));
        self.line(&format!("    {prefix}_time_values time;"));
        let block = staged.time_stage(&staged.body_force);
        self.unread(&block, &[Given::Solution, Given::Time]);
        let outputs = self.statements(&block, "    ", Places::SINGLE);
        for (index, value) in outputs.iter().enumerate() {
            self.line(&format!("    time.values[{index}] = {value};"));
        }
        if times == 0 {
            self.line("    time.values[0] = 0.0;");
        }
        self.line("    return time;\n}\n");

        self.comment(&[format!(
            "What the body force needs of the position alone, {points} values."
        )]);
        self.line(&format!(
            "MMSMITH_FN void {prefix}_at_point(const {prefix}_solution *s, const double X[{d}], double point[{shown}])\n{{"
        ));
        let block = staged.point_stage(&staged.body_force);
        self.unread(&block, &[Given::Solution, Given::Position]);
        let outputs = self.statements(&block, "    ", Places::SINGLE);
        for (index, value) in outputs.iter().enumerate() {
            self.line(&format!("    point[{index}] = {value};"));
        }
        if points == 0 {
            self.line("    point[0] = 0.0;");
        }
        self.line("}\n");

        self.comment(&[
            "The body force from the values of one time and of one point. Value m of the point is point[m*stride]:".into(),
            format!("stride 1 after {prefix}_at_point; for point p of {prefix}_point_array pass point + p and stride n."),
        ]);
        self.line(&format!(
            "MMSMITH_FN void {prefix}_b_staged(const {prefix}_solution *s, const {prefix}_time_values *time,\n    \
             const double *point, size_t stride, double b[{d}])\n{{"
        ));
        let block = staged.staged(&staged.body_force);
        self.unread(&block, &[Given::Solution, Given::TimeValues, Given::PointValues]);
        if !block.reads(|operand| matches!(operand, Operand::Kept(Stage::Point, 1..))) {
            self.line("    (void)stride;");
        }
        let outputs = self.statements(&block, "    ", Places::STAGED);
        for (index, value) in outputs.iter().enumerate() {
            self.line(&format!("    b[{index}] = {value};"));
        }
        self.line("}\n");

        self.comment(&[
            "What the body force needs of n positions alone: X[p*dimension + i] is component i of point p, and value m of".into(),
            format!("point p goes to point[m*n + p]. The array `point` has n*{prefix}_point_count entries."),
        ]);
        self.line(&format!(
            "MMSMITH_FN void {prefix}_point_array(const {prefix}_solution *s, size_t n, const double *MMSMITH_RESTRICT X,\n    \
             double *MMSMITH_RESTRICT point)\n{{"
        ));
        if points == 0 {
            self.line("    (void)s;\n    (void)n;\n    (void)X;\n    (void)point;\n}\n");
        } else {
            self.point_loop(points);
        }

        self.comment(&[
            format!("The body force at time t of the points first, ..., first + count - 1 out of the n of {prefix}_point_array;"),
            "component i of point p goes to b[p*dimension + i].".into(),
        ]);
        self.line(&format!(
            "MMSMITH_FN void {prefix}_b_array(const {prefix}_solution *s, double t, size_t n,\n    \
             const double *MMSMITH_RESTRICT point, size_t first, size_t count, double *MMSMITH_RESTRICT b)\n{{"
        ));
        self.line(&format!("    const {prefix}_time_values time = {prefix}_at_time(s, t);"));
        // Each of them is read here: the cheapest choice of what to keep has no other.
        for m in 0..points {
            self.line(&format!("    const double *const point{m} = point + {m} * n;"));
        }
        self.line("    const size_t end = first + count;\n    size_t p;");
        if points == 0 {
            self.line("    (void)point;\n    (void)n;");
        }
        if !block.reads(|operand| Given::TimeValues.is(operand)) {
            self.line("    (void)time;");
        }
        self.line("    for (p = first; p < end; ++p) {");
        let outputs = self.statements(&block, "        ", Places::ARRAY);
        for (index, value) in outputs.iter().enumerate() {
            self.line(&format!("        b[p * {d} + {index}] = {value};"));
        }
        self.line("    }\n}\n");
    }

    /// The rest of the function that fills the array of the points.
    fn point_loop(&mut self, points: usize) {
        let (prefix, d) = (self.prefix.clone(), self.dimension);
        self.line("    size_t p, m;\n    for (p = 0; p < n; ++p) {");
        self.line(&format!("        double values[{points}];"));
        self.line(&format!("        {prefix}_at_point(s, X + p * {d}, values);"));
        self.line(&format!("        for (m = 0; m < {points}; ++m) {{"));
        self.line("            point[m * n + p] = values[m];\n        }\n    }\n}\n");
    }

    fn shape(&self, shape: Shape) -> String {
        match shape {
            Shape::Scalar => String::new(),
            Shape::Vector => format!("[{}]", self.dimension),
            Shape::Matrix => format!("[{}]", self.dimension * self.dimension),
        }
    }

    /// Names what a block has no use for, so that compilers do not warn.
    fn unread(&mut self, block: &Block<'_>, given: &[Given]) {
        for given in given {
            if !block.reads(|operand| given.is(operand)) {
                self.line(&format!("    (void){};", given.name()));
            }
        }
    }

    /// Writes the statements of a block; returns its outputs as expressions.
    fn statements(&mut self, block: &Block<'_>, margin: &str, places: Places) -> Vec<String> {
        let Written { lines, outputs } = self.language.block(block, margin, places);
        self.text += &lines;
        outputs
    }
}

/// C, given what the parameters are called.
struct C {
    members: Vec<String>,
}

impl Target for C {
    type Places = Places;

    const STATEMENT: [&'static str; 2] = ["const double ", ";\n"];

    fn literal(&self, value: f64) -> String {
        literal(value)
    }

    fn function(&self, function: Called) -> Cow<'static, str> {
        let (family, name) = match function {
            Called::Library(name) => ("", name),
            Called::Support(name) => ("mmsmith_", name),
        };
        let arguments = if function.takes_two() { "#, #" } else { "#" };
        format!("{family}{name}({arguments})").into()
    }

    fn operand(&self, text: &mut String, operand: Operand<'_>, places: Places) {
        let (before, index, after) = match operand {
            Operand::Temporary(_) | Operand::Number(_) | Operand::Pi => return,
            Operand::Time => return text.push('t'),
            Operand::Parameter(index) => {
                return text.extend([places.parameters, &self.members[index]]);
            }
            Operand::Coordinate(index) => ("X[", index, "]"),
            Operand::Kept(Stage::Fixed, index) => ("s->fixed[", index, "]"),
            Operand::Kept(Stage::Time, index) => {
                text.push_str(places.time);
                ("values[", index, "]")
            }
            Operand::Kept(Stage::Point, index) => match (places.in_array, index) {
                (true, _) => ("point", index, "[p]"),
                (false, 0) => return text.push_str("point[0]"),
                (false, 1) => return text.push_str("point[stride]"),
                (false, _) => ("point[", index, " * stride]"),
            },
            // The header has no form for lattices.
            Operand::Kept(Stage::Layer(_), index) => ("layer[", index, "]"),
        };
        text.push_str(before);
        push_index(text, index);
        text.push_str(after);
    }
}

/// How a function refers to what is not computed in it.
#[derive(Clone, Copy)]
struct Places {
    /// What stands before the name of a parameter.
    parameters: &'static str,
    /// What stands before the values of the time.
    time: &'static str,
    /// Whether point `p` is one of an array.
    in_array: bool,
}

impl Places {
    const PREPARE: Places = Places { parameters: "p->", ..Places::SINGLE };
    const SINGLE: Places = Places { parameters: "s->par.", time: "time.", in_array: false };
    const STAGED: Places = Places { time: "time->", ..Places::SINGLE };
    const ARRAY: Places = Places { in_array: true, ..Places::SINGLE };
}

/// What a function is given.
#[derive(Clone, Copy)]
enum Given {
    Solution,
    Position,
    Time,
    TimeValues,
    PointValues,
}

impl Given {
    fn name(self) -> &'static str {
        match self {
            Given::Solution => "s",
            Given::Position => "X",
            Given::Time => "t",
            Given::TimeValues => "time",
            Given::PointValues => "point",
        }
    }

    /// Whether the operand is found in it.
    fn is(self, operand: Operand<'_>) -> bool {
        match operand {
            Operand::Temporary(_)
            | Operand::Number(_)
            | Operand::Pi
            | Operand::Kept(Stage::Layer(_), _) => false,
            Operand::Coordinate(_) => matches!(self, Given::Position),
            Operand::Time => matches!(self, Given::Time),
            Operand::Parameter(_) | Operand::Kept(Stage::Fixed, _) => {
                matches!(self, Given::Solution)
            }
            Operand::Kept(Stage::Time, _) => matches!(self, Given::TimeValues),
            Operand::Kept(Stage::Point, _) => matches!(self, Given::PointValues),
        }
    }
}

/// A double; negative ones with a minus sign.
fn literal(value: f64) -> String {
    let sign = if value.is_sign_negative() { "-" } else { "" };
    let magnitude = if value.is_infinite() { "HUGE_VAL".into() } else { digits(value.abs()) };
    format!("{sign}{magnitude}")
}

pub(crate) fn surface_name(surface: Surface) -> String {
    let axis = |axis: usize| ["X", "Y", "Z"].get(axis).copied().unwrap_or_default();
    match surface {
        Surface::Lower(i) => format!("{}-lower", axis(i)),
        Surface::Upper(i) => format!("{}-upper", axis(i)),
        Surface::Inner => "inner".into(),
        Surface::Outer => "outer".into(),
    }
}

pub(crate) fn condition(boundary: &Boundary) -> &'static str {
    match boundary.condition {
        Condition::Sliding => "sliding",
        Condition::Symmetry => "symmetry",
        Condition::TractionFree => "traction-free",
        Condition::PrescribedTraction => "prescribed traction",
        Condition::PrescribedMotion => "prescribed motion",
    }
}
