//! C++17 source: a header for any scalar type.

use super::tables;
use crate::c_names::{c_name, members};
use crate::code::Code;
use crate::listing::{Given, Item, Refusal, commented};
use crate::names::Names;
use crate::runtime::{Primitive, Routine, WithRuntime};
use crate::target::{Called, Target, Unwritable, Written};
use crate::text::{c_number, c_string, push_index};
use mmsmith_stage::{Operand, Shape};
use std::borrow::Cow;

const REMARKS: &str = "\
C++17, this header alone. mms::NAME::Solution s(p); with mms::NAME::Parameters p; p.A = 0.1; has u, v, a, H, F, J, P, b, rho0_b, static_force, sigma, S and tractions as \
s.u(X, t), and constants as s.density(). It throws std::invalid_argument for parameters that are not admissible. X is anything that X[i] reads: \
an array, a pointer, a Point of deal.II, a Vector of MFEM, a tensor of smith; results are std::array, of rows for matrices, of X's scalar type. \
That may be a dual number: it needs arithmetic with double, comparisons, functions that argument-dependent look-up finds, and a conversion to \
double or a member `value` or `val`. Types whose arithmetic gives expression templates are not served.
With double the results are those of the C header bit for bit, where the compiler keeps every rounding (-ffp-contract=off where the processor \
fuses products and sums, and no -ffast-math).";

const SUPPORT: &str = r#"
#include <array>
#include <cmath>
#include <stdexcept>
#include <type_traits>
#include <utility>

#ifndef MMSMITH_CPP
#define MMSMITH_CPP 1
namespace mms {
namespace support {

template <class Point>
using Scalar = std::decay_t<decltype(std::declval<const Point &>()[0])>;

template <class T, class = void>
struct has_value : std::false_type {};
template <class T>
struct has_value<T, std::void_t<decltype(std::declval<const T &>().value)>> : std::true_type {};

// The number without derivatives.
template <class T>
double plain(const T &x)
{
    if constexpr (std::is_convertible_v<T, double>) {
        return static_cast<double>(x);
    } else if constexpr (has_value<T>::value) {
        return plain(x.value);
    } else {
        return plain(x.val);
    }
}

template <class T, class U>
T make(const U &x)
{
    if constexpr (std::is_convertible_v<U, T>) {
        return x;
    } else {
        T made{};
        made = x;
        return made;
    }
}

template <class A, class B>
auto choose(bool first, const A &a, const B &b)
{
    using Common = std::conditional_t<std::is_arithmetic_v<A>, B, A>;
    return first ? make<Common>(a) : make<Common>(b);
}

template <class T>
double nearest(const T &x)
{
    return std::nearbyint(plain(x));
}

template <class T>
double exponent(const T &x)
{
    int e = 0;
    std::frexp(plain(x), &e);
    return e;
}

template <class T>
T scaled(const T &x, double e)
{
    if constexpr (std::is_same_v<T, double>) {
        return std::ldexp(x, static_cast<int>(e));
    } else {
        return x * std::ldexp(1.0, static_cast<int>(e));
    }
}

template <class T>
T size(const T &x)
{
    return x < 0.0 ? T(-x) : x;
}

// The Y of A Y = R by Gauss's elimination with the largest pivots.
template <class T, std::size_t d>
std::array<std::array<T, d>, d> solved(std::array<std::array<T, d>, d> A, std::array<std::array<T, d>, d> R)
{
    for (std::size_t k = 0; k < d; ++k) {
        std::size_t largest = k;
        for (std::size_t i = k + 1; i < d; ++i) {
            largest = std::abs(plain(A[i][k])) > std::abs(plain(A[largest][k])) ? i : largest;
        }
        std::swap(A[k], A[largest]);
        std::swap(R[k], R[largest]);
        for (std::size_t i = 0; i < d; ++i) {
            const T share = A[i][k] / A[k][k];
            for (std::size_t j = 0; j < d && i != k; ++j) {
                A[i][j] = A[i][j] - share * A[k][j];
                R[i][j] = R[i][j] - share * R[k][j];
            }
        }
    }
    for (std::size_t i = 0; i < d; ++i) {
        for (std::size_t j = 0; j < d; ++j) {
            R[i][j] = R[i][j] / A[i][i];
        }
    }
    return R;
}

}  // namespace support
}  // namespace mms
#endif
"#;

/// C++, with the names of the parameters.
struct Cpp {
    members: Vec<String>,
}

impl Target for Cpp {
    type Places = ();

    const STATEMENT: [&'static str; 2] = ["const auto ", ";\n"];

    fn literal(&self, value: f64) -> String {
        c_number(value)
    }

    fn function(&self, function: Called) -> Cow<'static, str> {
        let (Called::Library(name) | Called::Support(name)) = function;
        format!("{name}({})", if function.takes_two() { "#, #" } else { "#" }).into()
    }

    fn operand(&self, text: &mut String, operand: Operand<'_>, (): ()) {
        let (name, index) = match operand {
            Operand::Time => return text.push('t'),
            Operand::Parameter(index) => return text.extend(["par.", &self.members[index]]),
            Operand::Coordinate(index) => ("X[", index),
            Operand::Kept(_, index) => ("fixed[", index),
            _ => return,
        };
        text.push_str(name);
        push_index(text, index);
        text.push(']');
    }
}

impl WithRuntime for Cpp {
    fn primitive(&self, primitive: Primitive) -> &'static str {
        match primitive {
            Primitive::Choose => "support::choose(#, #, #)",
            Primitive::Less => "(# < #)",
            Primitive::AtMost => "(# <= #)",
            Primitive::Equal => "(# == #)",
            Primitive::Abs => "support::size(#)",
            Primitive::Nearest => "support::nearest(#)",
            Primitive::Exponent => "support::exponent(#)",
            Primitive::Scaled => "support::scaled(#, #)",
        }
    }
}

const REFUSAL: Refusal = Refusal {
    finite: "std::isfinite(#)",
    and: "&&",
    side: "#",
    lines: "        if (!(#)) {\n            throw std::invalid_argument(#);\n        }\n",
    string: c_string,
};

pub(crate) fn source(code: &Code<'_>) -> Result<String, Unwritable> {
    let spec = code.spec;
    let space = c_name(&Names::of(&spec.name).module);
    let guard = format!("MMSMITH_{}_HPP", space.to_ascii_uppercase());
    let cpp = Cpp { members: members(&spec.parameters) };
    let remarks = REMARKS.replace("NAME", &space);
    let mut text = commented(&code.head_for_host(&remarks), "//", 118);
    text += &format!(
        "#ifndef {guard}\n#define {guard} 1\n{SUPPORT}{}\nnamespace mms {{\nnamespace {space} {{\n\n",
        tables::cpp::reader(code)
    );
    // Beside the functions that argument-dependent look-up finds for types of a host.
    let library = [
        "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cos", "cosh", "erf", "exp",
        "expm1", "log", "log1p", "pow", "sin", "sinh", "sqrt", "tan", "tanh",
    ];
    for name in library {
        text += &format!("using std::{name};\n");
    }
    for routine in code.routines(&cpp) {
        text += &cpp.routine(&routine);
    }
    text += "\nstruct Parameters {\n";
    for (parameter, (member, about)) in
        spec.parameters.iter().zip(cpp.members.iter().zip(code.parameter_lines()))
    {
        text += &commented(&[about], "    //", 118);
        text += &format!("    double {member} = {};\n", cpp.literal(parameter.default));
    }
    text += &format!(
        "}};\n\nclass Solution {{\npublic:\n    static constexpr int dimension = {};\n\n",
        spec.dimension
    );
    text += "    explicit Solution(const Parameters &parameters = Parameters()) : par(parameters), fixed()\n    {\n";
    let Written { lines, outputs: fixed } =
        code.admitted(&cpp, "        ", (), &REFUSAL, |index| {
            format!("par.{}", cpp.members[index])
        });
    text += &lines;
    for (index, value) in fixed.iter().enumerate() {
        text += &format!("        fixed[{index}] = {value};\n");
    }
    text += "    }\n";
    text += &tables::cpp::members(code);
    for item in code.functions() {
        text += &match item.of_table {
            None => cpp.item(code, &item),
            Some(of_table) => tables::cpp::item(code, &item, of_table),
        };
    }
    let d = spec.dimension;
    let density = if code.has_graded_density() { "rho0(X)" } else { "density()" };
    let volume = code.volume_by(["J(X, t)", "F_zz(X, t)"]);
    text += &format!(
        "
    // body force per unit reference volume
    template <class Point>
    std::array<support::Scalar<Point>, {d}> rho0_b(const Point &X, double t) const
    {{
        auto force = b(X, t);
        for (auto &entry : force) {{
            entry = {density} * entry;
        }}
        return force;
    }}

    // -Div P, the force per reference volume that holds the deformation of time t at rest
    template <class Point>
    std::array<support::Scalar<Point>, {d}> static_force(const Point &X, double t) const
    {{
        auto force = b(X, t);
        const auto acceleration = a(X, t);
        for (int i = 0; i < {d}; ++i) {{
            force[i] = {density} * (force[i] - acceleration[i]);
        }}
        return force;
    }}

    // Cauchy stress
    template <class Point>
    std::array<std::array<support::Scalar<Point>, {d}>, {d}> sigma(const Point &X, double t) const
    {{
        const auto gradient = F(X, t);
        auto stress = P(X, t), product = stress;
        const auto volume = {volume};
        for (int i = 0; i < {d}; ++i) {{
            for (int j = 0; j < {d}; ++j) {{
                auto sum = stress[i][0] * gradient[j][0];
                for (int k = 1; k < {d}; ++k) {{
                    sum = sum + stress[i][k] * gradient[j][k];
                }}
                product[i][j] = sum / volume;
            }}
        }}
        return product;
    }}

    // second Piola-Kirchhoff stress
    template <class Point>
    std::array<std::array<support::Scalar<Point>, {d}>, {d}> S(const Point &X, double t) const
    {{
        return support::solved(F(X, t), P(X, t));
    }}

private:
    Parameters par;
    std::array<double, {}> fixed;
{}}};

}}  // namespace {space}
}}  // namespace mms

#endif  // {guard}
",
        fixed.len().max(1),
        tables::cpp::private_members(code)
    );
    Ok(text)
}

impl Cpp {
    fn routine(&self, routine: &Routine) -> String {
        let types: Vec<String> = routine
            .arguments
            .iter()
            .map(|name| format!("class {}_", name.to_ascii_uppercase()))
            .collect();
        let arguments: Vec<String> = routine
            .arguments
            .iter()
            .map(|name| format!("const {}_ &{name}", name.to_ascii_uppercase()))
            .collect();
        let mut text = format!(
            "\n// {}\ntemplate <{}>\nauto {}({})\n{{\n",
            routine.about,
            types.join(", "),
            routine.name,
            arguments.join(", ")
        );
        for step in &routine.steps {
            text += &format!("    const auto {} = {};\n", step.name, step.value);
        }
        text + &format!("    return {};\n}}\n", routine.result)
    }

    fn item(&self, code: &Code<'_>, item: &Item) -> String {
        let (d, name) = (code.spec.dimension, &item.name);
        let scalar = if item.given == Given::Nothing { "double" } else { "support::Scalar<Point>" };
        let returned = match item.shape {
            Shape::Scalar => scalar.to_owned(),
            Shape::Vector => format!("std::array<{scalar}, {d}>"),
            Shape::Matrix => format!("std::array<std::array<{scalar}, {d}>, {d}>"),
        };
        let block = item.block(code);
        let reads = |such: fn(Operand<'_>) -> bool| block.reads(such);
        let given = match item.given {
            Given::Nothing => String::new(),
            Given::Position => "const Point &X".to_owned(),
            Given::PositionAndTime => {
                let X = if reads(|o| matches!(o, Operand::Coordinate(_))) { "X" } else { "" };
                let t = if reads(|o| matches!(o, Operand::Time)) { "t" } else { "" };
                format!("const Point &{X}, double {t}")
            }
        };
        let mut text = format!("\n    // {}\n", item.about);
        if item.given != Given::Nothing {
            text += "    template <class Point>\n";
        }
        text += &format!("    {returned} {name}({given}) const\n    {{\n");
        let Written { lines, outputs } = self.block(&block, "        ", ());
        text += &lines;
        let made: Vec<String> =
            outputs.iter().map(|entry| format!("support::make<{scalar}>({entry})")).collect();
        let value = match item.shape {
            Shape::Scalar => made.concat(),
            Shape::Vector => format!("{returned}{{{{{}}}}}", made.join(", ")),
            Shape::Matrix => {
                let rows: Vec<String> =
                    made.chunks(d).map(|row| format!("{{{{{}}}}}", row.join(", "))).collect();
                format!("{returned}{{{{{}}}}}", rows.join(", "))
            }
        };
        text + &format!("        return {value};\n    }}\n")
    }
}
