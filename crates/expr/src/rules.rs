//! Rules by which derivation and lowering choose among forms of the same value: one row each, with the specifications that need it.
//!
//! `cargo xtask ablation` switches each rule off, and holds the specifications that lose their digits, or whose work grows, against the row.
//! A new rule needs a row and a specification that is lost without it.

use std::cell::Cell;

/// The good that a rule does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Serves {
    /// Without it an entry of a field is beyond `K = 8` at a drawn point.
    Digits,
    /// Without it the body force takes a quarter more work, or more.
    Work,
}

/// A rule with its reasons.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// The rule.
    pub rule: Rule,
    /// Its name in the table of the book.
    pub name: &'static str,
    /// The form before it.
    pub before: &'static str,
    /// The form after it.
    pub after: &'static str,
    /// Why the form is better.
    pub why: &'static str,
    /// The good that it does.
    pub serves: Serves,
    /// The specifications that are lost without it, in alphabetical order: all of those in the repository.
    pub needed_by: &'static [&'static str],
}

macro_rules! rules {
    ($($serves:ident $rule:ident $name:literal: $before:literal => $after:literal, $why:literal, $needed_by:expr;)+) => {
        /// A rule.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Rule {
            $(#[doc = concat!("`", $before, "` as `", $after, "`: ", $why, ".")] $rule,)+
        }

        impl Rule {
            /// Every rule.
            pub const ALL: &[Row] = &[$(Row {
                rule: Rule::$rule,
                name: $name,
                before: $before,
                after: $after,
                why: $why,
                serves: Serves::$serves,
                needed_by: &$needed_by,
            },)+];
        }
    };
}

rules! {
    Digits SplitAtZero "values at zero": "mu F - mu/F" => "mu (H + H/F), with F = 1 + H",
        "terms that do not vanish with H cancel in symbols",
        [
            "anisotropic-polar", "axis-aligned-3d-hencky", "axis-aligned-3d-ogden",
            "axis-aligned-hencky", "axis-aligned-mooney-rivlin", "ring-mooney-rivlin",
            "skew-2d-energy", "skew-2d-mooney-rivlin", "skew-2d-ogden", "skew-2d-stress",
            "skew-3d-mooney-rivlin", "stress-of-gradient", "stretch-nearly-incompressible",
            "tube-hencky", "tube-nearly-incompressible", "tube-of-constant-area",
            "twist-nearly-incompressible",
        ];
    Digits Vanishing "zeros": "a sum that multiplies out to zero" => "0",
        "rounding would leave something where there is nothing",
        [
            "rigid-motion", "stretch-nearly-incompressible", "torsion",
            "tube-nearly-incompressible", "tube-of-constant-area", "turn-nearly-incompressible",
            "twist-nearly-incompressible", "vortex",
        ];
    Digits Cancel "moduli": "(lambda + 2 mu - E) u" => "2 nu lambda u",
        "differences of moduli cancel in symbols, against the inertia above all",
        [
            "axis-aligned", "axis-aligned-1d", "axis-aligned-3d", "axis-aligned-3d-gent",
            "axis-aligned-3d-hencky", "axis-aligned-hencky", "inverting",
        ];
    Digits CommonAngles "common angles": "sin(2 a) - 2 sin(a) cos(a)" => "0",
        "zeros show that double angles hide",
        ["stream-function"];
    Digits ConstantAndTerm "bumps": "1 - cos(a)" => "2 sin(a/2)^2",
        "a sum that vanishes with its slope has no digit left there",
        ["bumps", "free-of-divergence", "hyperbolic-of-root", "start-from-rest", "vanishing-sums"];
    Digits TwoTerms "two waves": "cos(a) - cos(b)" => "-2 sin((a + b)/2) sin((a - b)/2)",
        "a sum that vanishes with its slope has no digit left there",
        ["vanishing-sums"];
    Digits WavesOfOneSize "shear of waves": "A k cos(a) - A k cos(b)" => "a product, as for two waves",
        "the shear strain may vanish with its slope",
        ["one-direction-alone"];
    Digits LogBesideOne "logarithms": "ln(1 + x)" => "log1p(x)",
        "1 + x has lost the digits of a small x",
        ["vanishing-sums"];
    Digits Exponentials "fronts": "1 - tanh(x), exp(x)/(1 + exp(x))^2" => "2/(1 + exp(2 x)), 1/(4 cosh(x/2)^2)",
        "differences of nearly equal numbers, and quotients of numbers that overflow",
        ["front-hyperbolic", "front-logistic"];
    Digits LogOfExponential "logarithms of fronts": "ln(1 + exp(x))" => "max(x, 0) + log1p(exp(-|x|))",
        "exp(x) overflows",
        ["front-logistic"];
    Digits SumsWithin "sums within functions": "cos(c Pi t + Pi/3)" => "f(a) + e (f'(a) + e f''(a)/2), a + e the sum",
        "late the rounding of a phase is large, and the answers of several to t may cancel",
        [
            "front-logistic", "one-direction-alone", "phases-in-time", "shear-of-waves",
            "shear-of-waves-orthotropic", "waves-of-one-size",
        ];
    Digits Turn "turns": "F F^T - I of H" => "N + N^T + S N^T + N S^T + N N^T, with H = S + N and I + S a rotation",
        "next to a turn the strain is small",
        ["torsion", "twist-nearly-incompressible"];
    Digits Shortened "squares of sines": "sin(a)^2 + cos(a)^2" => "1",
        "parts of a turn cancel in symbols",
        ["torsion", "twist-nearly-incompressible", "vortex"];
    Digits DoubledStrain "shear strains": "H_ij + M_ij" => "(H_ij + H_ji) - (H^T M)_ij",
        "terms of H + H^T cancel in symbols, and the rest is of second order",
        ["free-of-divergence", "multiples-of-angles", "one-direction-alone"];
    Digits SecondOrder "constant volume": "tr H" => "-(sum of the minors of H), where J = 1",
        "the first order of tr H is zero there",
        ["tube-of-constant-area"];
    Digits LogOfBoth "logarithms of stretches": "log1p(J - 1)" => "ln(J) where J < 1/2 is a product",
        "next to inversion J - 1 has lost the digits of J",
        ["shell-hencky", "sphere-shell"];
    Digits Quotients "quotients of stretches": "dJ/dF, J" => "products of the stretches",
        "next to inversion stretches above and below cancel in symbols",
        [
            "axis-aligned-3d-hencky", "axis-aligned-hencky", "axis-aligned-mooney-rivlin",
            "shell-hencky",
        ];
    Digits PressureApart "pressure apart": "Q P Q^T" => "p I + Q (P - p I) Q^T",
        "next to incompressibility the pressure is large, and cancels where components are turned",
        [
            "cylindrical", "ring-hencky", "ring-nu", "rotating-cylindrical", "shell-hencky",
            "sphere-shell", "tube-hencky",
        ];
    Digits Transverse "both angles": "P_tt and P_pp each turned" => "P_tt (I - e_R e_R^T), where they are equal",
        "nobody can tell the angles apart on the axis",
        ["shell-hencky", "shell-st-venant-kirchhoff", "sphere-shell"];
    Digits Factored "solved coefficients": "c1 R + c2 R^2 + c3 R^3" => "factors R - Ri and Newton's form in differences",
        "coefficients are huge where the places are next to each other",
        ["ring-solved", "solved-slab", "solved-thin-ring"];
    Digits GivenValues "given values": "numerator/denominator" => "interpolation of the values that conditions give, and a rest",
        "the denominator may nearly vanish where the displacement does not",
        ["ring-solved", "solved-thin-ring"];
    Work WholeDivergence "whole divergence": "linear part and remainder" => "Div P in one form, where nothing joins with the inertia",
        "the split is of use for what cancels against the inertia alone",
        ["bumps", "cylindrical", "rotating-cylindrical", "skew-3d", "spherical", "swirl"];
    Work Isochoric "isochoric laws": "W(J^(-2/3) I1) in components" => "the chain rule over J and I1",
        "Piola's identity leaves six terms of some hundred",
        [
            "axis-aligned-3d-arruda-boyce", "axis-aligned-3d-gent", "axis-aligned-3d-yeoh",
            "lambda-zero", "skew-2d-arruda-boyce", "skew-2d-holzapfel-gasser-ogden",
            "skew-3d-holzapfel-gasser-ogden",
        ];
    Work Invariants "laws of J and I1": "W(J, I1) in components" => "the chain rule over J and I1",
        "Piola's identity leaves few terms",
        ["skew-2d-mooney-rivlin"];
    Work PrincipalStretches "principal stretches": "W(a, b) in components" => "the chain rule over J and (a - b)^2/(2 a b)",
        "every even function of ln(a/b) is one of these",
        ["skew-2d-hencky", "skew-2d-ogden"];
    Work CommonFactors "common factors": "a x + a y" => "a (x + y)",
        "factors of the parameters are multiplied once",
        ["ringing-bar"];
    Work Reciprocals "reciprocals": "x/d, y/d^2" => "x r, y r^2, with r = 1/d",
        "a product takes an eighth of the time of a quotient",
        [
            "anisotropic-polar", "axis-aligned-3d", "axis-aligned-3d-arruda-boyce",
            "axis-aligned-3d-gent", "axis-aligned-3d-yeoh", "axis-aligned-mooney-rivlin",
            "lambda-zero", "ring-mooney-rivlin", "skew-2d-arruda-boyce",
            "skew-3d-holzapfel-gasser-ogden", "skew-3d-mooney-rivlin", "tube-hencky",
            "tube-nearly-incompressible", "tube-of-constant-area",
        ];
    Work Gather "gathered factors": "t (a x + b y)" => "(t a) x + (t b) y",
        "what does not depend on the place is multiplied once a step",
        [
            "axis-aligned-3d-hencky", "rigid-motion", "ringing-bar",
            "shear-nearly-incompressible", "skew-2d-linear-elastic",
        ];
    Work Separate "layers of lattices": "operations for each point" => "sums of products of values of one coordinate each",
        "points of a lattice share their coordinates",
        [
            "axis-aligned", "axis-aligned-3d", "axis-aligned-3d-hencky", "axis-aligned-hencky",
            "axis-aligned-mooney-rivlin", "front-arctan", "inverting", "phases-in-time",
            "rigid-motion", "shear-nearly-incompressible", "stretch-nearly-incompressible",
            "torsion", "twist-nearly-incompressible",
        ];
}

thread_local! {
    static OFF: Cell<Option<Rule>> = const { Cell::new(None) };
}

impl Rule {
    /// Whether the rule is off in this thread.
    pub fn is_off(self) -> bool {
        OFF.get() == Some(self)
    }
}

/// The result of `make`, in which one rule is off.
pub fn without<R>(rule: Option<Rule>, make: impl FnOnce() -> R) -> R {
    struct Before(Option<Rule>);
    impl Drop for Before {
        fn drop(&mut self) {
            OFF.set(self.0);
        }
    }
    let _before = Before(OFF.replace(rule));
    make()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ast, Graph, Program};

    #[test]
    fn a_rule_is_off_as_long_as_it_is_asked_for() {
        let value = || {
            let mut graph = Graph::new();
            let x = graph.symbol("x");
            let bump = Ast::parse("1 - cos(x)").unwrap();
            let bump = graph.build(&bump, &mut |_, _| Ok(x)).unwrap();
            Program::lower(&mut graph, &[(x, Default::default())], &[], &[bump]).evaluate(&[1e-9])
                [0]
        };
        assert_eq!(value(), 5e-19);
        assert_eq!(without(Some(Rule::ConstantAndTerm), value), 0.0);
        assert_eq!(value(), 5e-19);
    }
}
