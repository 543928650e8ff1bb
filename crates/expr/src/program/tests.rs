//! Every operation against the mathematics that its name says, at one place and at several side by side.

use super::{Dependence, Operation, OperationCount, Program, Slot};
use crate::{Ast, Function, Graph, RangeOfInputs, Rational};
use mmsmith_scalar_functions::ScalarFunctions;

/// Each operation on the two inputs, what it is, and what it counts as: sums, products, quotients, roots and calls.
type Case = (Operation, Value, [usize; 5]);
type Value = fn(f64, f64) -> f64;

fn cases() -> Vec<Case> {
    let (x, y) = (Slot::at(0), Slot::at(1));
    let third = Rational::new(1.into(), 3.into());
    let mut cases: Vec<Case> = vec![
        (Operation::Input(0), |x, _| x, [0, 0, 0, 0, 0]),
        (Operation::Input(1), |_, y| y, [0, 0, 0, 0, 0]),
        (Operation::Number(third.clone()), |_, _| 1.0 / 3.0, [0, 0, 0, 0, 0]),
        (Operation::Pi, |_, _| std::f64::consts::PI, [0, 0, 0, 0, 0]),
        (Operation::Add(x, y), |x, y| x + y, [1, 0, 0, 0, 0]),
        (Operation::Sub(x, y), |x, y| x - y, [1, 0, 0, 0, 0]),
        (Operation::Mul(x, y), |x, y| x * y, [0, 1, 0, 0, 0]),
        (Operation::Div(x, y), |x, y| x / y, [0, 0, 1, 0, 0]),
        (Operation::Neg(y), |_, y| -y, [1, 0, 0, 0, 0]),
        (Operation::Sqrt(x), |x, _| x.sqrt(), [0, 0, 0, 1, 0]),
        (Operation::Power(x, third), |x, _| x.powf(1.0 / 3.0), [0, 0, 0, 0, 1]),
        (Operation::Atan2(x, y), |x, y| x.polar_angle(y), [0, 0, 0, 0, 1]),
        // What one operation takes, and what is left of it (T. J. Dekker, 1971).
        (Operation::SumError(x, y), |x, y| two_sum(x, y), [5, 0, 0, 0, 0]),
        (Operation::ProductError(x, y), |x, y| x.mul_add(y, -(x * y)), [7, 5, 0, 0, 0]),
    ];
    let functions: [(Function, Value); 13] = [
        (Function::Sin, |x, _| x.sine()),
        (Function::Cos, |x, _| x.cosine()),
        (Function::Tan, |x, _| libm::tan(x)),
        (Function::Asin, |x, _| libm::asin(x)),
        (Function::Acos, |x, _| libm::acos(x)),
        (Function::Atan, |x, _| libm::atan(x)),
        (Function::Sinh, |x, _| libm::sinh(x)),
        (Function::Cosh, |x, _| libm::cosh(x)),
        (Function::Tanh, |x, _| libm::tanh(x)),
        (Function::Exp, |x, _| x.exponential()),
        (Function::Ln, |x, _| x.logarithm()),
        (Function::Ln1p, |x, _| x.log_1p()),
        (Function::Expm1, |x, _| x.exp_m1()),
    ];
    let call = |(function, value)| (Operation::Call(function, x), value, [0, 0, 0, 0, 1]);
    cases.extend(functions.map(call));
    cases
}

/// `a + b` less its rounded value, of the larger and the smaller of the two.
fn two_sum(a: f64, b: f64) -> f64 {
    let (large, small) = if a.abs() > b.abs() { (a, b) } else { (b, a) };
    small - ((large + small) - large)
}

const PLACES: [[f64; 4]; 2] = [[0.3, 0.8, 2.1, 1e-9], [0.7, -0.4, 1e-17, 5.3]];

#[test]
fn every_operation_is_what_it_says() {
    let inputs = [Operation::Input(0), Operation::Input(1)];
    for (operation, expected, count) in cases() {
        let all: Vec<Operation> = inputs.iter().chain([&operation]).cloned().collect();
        let place = Dependence { position: true, time: false };
        let program = Program::from_parts(all, vec![place; 3], vec![Slot::at(2)]).compacted();
        let found = operation.row(&PLACES, &PLACES);
        for n in 0..4 {
            let at = [PLACES[0][n], PLACES[1][n]];
            let value = expected(at[0], at[1]);
            let same = |x: f64| x == value || (x.is_nan() && value.is_nan());
            assert!(same(found[n]), "{operation:?} at {at:?}: {}, not {value}", found[n]);
            assert!(same(program.evaluate(&at)[0]), "{operation:?} at {at:?} in a program");
        }
        let [additions, multiplications, divisions, square_roots, calls] = count;
        let once = OperationCount { additions, multiplications, divisions, square_roots, calls };
        assert_eq!(OperationCount::of(&operation), once, "{operation:?}");
        let mut thrice = OperationCount::default();
        (0..3).for_each(|_| thrice.count(&operation));
        assert_eq!(thrice.total(), 3 * count.iter().sum::<usize>(), "{operation:?}");
        let all = program.operations_by_stage(program.outputs());
        assert_eq!((all.point, all.fixed.total(), all.both.total()), (once, 0, 0));
    }
    assert!(Operation::Input(2).row(&PLACES, &[])[0].is_nan());
}

/// Multiples of a half have exact sines and cosines of `Pi` times them, however large they are.
#[test]
fn sines_and_cosines_of_multiples_of_pi() {
    let at = |operation: Operation, x: f64| operation.row(&[], &[[x]])[0];
    for n in [-7_i32, -4, -1, 0, 1, 2, 3, 4, 5, 6, 1_000_003, -1_000_002] {
        let quarter = [0.0, 1.0, 0.0, -1.0];
        let x = f64::from(n) / 2.0;
        let place = usize::try_from(n.rem_euclid(4)).unwrap();
        assert_eq!(at(Operation::SinPi(Slot::at(0)), x), quarter[place], "{x}");
        assert_eq!(at(Operation::CosPi(Slot::at(0)), x), quarter[(place + 1) % 4], "{x}");
    }
    for n in -40..40 {
        let x = f64::from(n) / 16.0;
        let angle = x * std::f64::consts::PI;
        assert!((at(Operation::SinPi(Slot::at(0)), x) - angle.sin()).abs() < 2e-15, "{x}");
        assert!((at(Operation::CosPi(Slot::at(0)), x) - angle.cos()).abs() < 2e-15, "{x}");
    }
}

/// Next to one the first argument has the digits, next to zero the second.
#[test]
fn logarithms_of_both_lose_no_digits() {
    let operation = Operation::LnOfBoth(Slot::at(0), Slot::at(1));
    let at = |x: f64, y: f64| operation.row(&[], &[[x], [y]])[0];
    for (x, y, expected) in [
        (1e-20, 1.0, 1e-20),
        (-1e-20, 1.0, -1e-20),
        (-1.0, 1e-20, 1e-20_f64.ln()),
        (-0.75, 0.25, 0.25_f64.ln()),
        (-0.5, 0.5, (-0.5_f64).ln_1p()),
        (3.0, 4.0, 4.0_f64.ln()),
    ] {
        assert!((at(x, y) / expected - 1.0).abs() < 1e-15, "{x}, {y}: {}", at(x, y));
    }
    // Down to -1/2 only the first is looked at, below only the second.
    assert!((at(-0.5, f64::NAN) / (-0.5_f64).ln_1p() - 1.0).abs() < 1e-15);
    assert!((at((-0.5_f64).next_down(), 3.0) / 3.0_f64.ln() - 1.0).abs() < 1e-15);
}

/// Sines and cosines of what contains `Pi` as a factor are taken of the rest, of which the argument is reduced exactly.
#[test]
fn where_pi_is_a_factor_it_is_left_out() {
    for (text, without) in [
        ("sin(Pi*x)", true),
        ("cos(2*Pi*x)", true),
        ("sin(Pi*x/3)", true),
        ("cos(Pi/3)", true),
        ("sin(Pi*(x + y))", true),
        ("sin(Pi*(1 + x))", true),
        // A sum with a multiple of `Pi` in it has no factor of it.
        ("cos(Pi*(Pi*x + y))", true),
        ("sin(Pi*(1 + Pi*x))", true),
        ("sin(x)", false),
        ("cos(x/3)", false),
        ("cos(Pi*x + y)", false),
        ("sin(x/Pi)", false),
        ("cos(Pi^2*x)", false),
        ("sin(3*Pi^2*x)", false),
        ("cos(Pi^2)", false),
        ("sin(2*sqrt(Pi))", false),
    ] {
        let mut graph = Graph::new();
        let inputs = ["x", "y"].map(|name| (graph.symbol(name), Dependence::default()));
        let expr =
            graph.build(&Ast::parse(text).unwrap(), &mut |g, name| Ok(g.symbol(name))).unwrap();
        let program = Program::lower(&mut graph, &inputs, &[], &[expr]);
        let found = program
            .operations()
            .iter()
            .any(|o| matches!(o, Operation::SinPi(_) | Operation::CosPi(_)));
        assert_eq!(found, without, "{text}: {:?}", program.operations());
    }
}

const NAMES: [&str; 8] = ["a", "b", "k", "t", "s", "x", "y", "z"];

/// Program for `text`, as nested operations; parameters are a, b, k, times t, s, places x, y, z, and r means `sqrt(x^2 + y^2)`.
fn lowered(text: &str) -> String {
    let mut graph = Graph::new();
    graph.range_of_inputs = RangeOfInputs::Wide;
    let inputs = NAMES.map(|name| {
        let (time, position) = ("ts".contains(name), "xyz".contains(name));
        (graph.symbol(name), Dependence { position, time })
    });
    let mut build = |text: &str| {
        graph.build(&Ast::parse(text).unwrap(), &mut |g, name| Ok(g.symbol(name))).unwrap()
    };
    let (radius, expr) = (build("sqrt(x^2 + y^2)"), build(text));
    let definitions = [(build("r"), radius)];
    let program = Program::lower(&mut graph, &inputs, &definitions, &[expr]);
    let mut shown: Vec<String> = Vec::new();
    for operation in program.operations() {
        let of = |slot: &Slot| shown[slot.index()].as_str();
        shown.push(match operation {
            Operation::Number(number) => number.to_string(),
            Operation::Pi => "Pi".into(),
            Operation::Input(index) => NAMES[*index].into(),
            Operation::Add(a, b) => format!("({} + {})", of(a), of(b)),
            Operation::Sub(a, b) => format!("({} - {})", of(a), of(b)),
            Operation::Mul(a, b) => format!("({}*{})", of(a), of(b)),
            Operation::Div(a, b) => format!("({}/{})", of(a), of(b)),
            Operation::Neg(a) => format!("-{}", of(a)),
            Operation::Sqrt(a) => format!("sqrt({})", of(a)),
            Operation::Power(a, exponent) => format!("{}^{exponent}", of(a)),
            Operation::SinPi(a) => format!("sin(Pi {})", of(a)),
            Operation::CosPi(a) => format!("cos(Pi {})", of(a)),
            Operation::Call(function, a) => format!("{}({})", function.name(), of(a)),
            Operation::Atan2(a, b) => format!("atan2({}, {})", of(a), of(b)),
            Operation::LnOfBoth(a, b) => format!("lnboth({}, {})", of(a), of(b)),
            Operation::SumError(a, b) => format!("sumerror({}, {})", of(a), of(b)),
            Operation::ProductError(a, b) => format!("producterror({}, {})", of(a), of(b)),
        });
    }
    shown[program.outputs()[0].index()].clone()
}

/// Slow factors and terms first, the constant of a sum last, a factor of several terms once, a quotient for all that is below,
/// powers by squares, a sign where it costs nothing.
#[test]
fn operations_and_their_order() {
    for (text, expected) in [
        ("-3", "-3"),
        ("-x", "-x"),
        ("2*x", "(2*x)"),
        ("-2*x", "-(2*x)"),
        ("x/3", "(1/3*x)"),
        ("-x/3", "-(1/3*x)"),
        ("2*x/3", "(2/3*x)"),
        ("x - y", "(x - y)"),
        ("-x - y", "-(x + y)"),
        ("-x + y", "-(x - y)"),
        ("y - x", "-(x - y)"),
        ("-x - y - z", "-((x + y) + z)"),
        ("1 + x", "(x + 1)"),
        ("1 - x", "(1 - x)"),
        ("-1 - x", "-(x + 1)"),
        ("-1 + x", "-(1 - x)"),
        ("1 + x - y", "((x - y) + 1)"),
        ("2 - x - y", "(2 - (x + y))"),
        ("x^2", "(x*x)"),
        ("x^3", "((x*x)*x)"),
        ("x^7", "((((x*x)*x)*((x*x)*x))*x)"),
        ("x^6", "(((x*x)*x)*((x*x)*x))"),
        ("1/x", "(1/x)"),
        ("1/x^2", "(1/(x*x))"),
        ("x/y^2", "(x/(y*y))"),
        ("a/x", "(a/x)"),
        ("x/a", "((1/a)*x)"),
        ("sqrt(x)", "sqrt(x)"),
        ("x^(3/2)", "(x*sqrt(x))"),
        ("x^(5/2)", "((x*x)*sqrt(x))"),
        ("x^(1/3)", "x^1/3"),
        ("x^(-1/2)", "(1/sqrt(x))"),
        ("x^(-2/3)", "(1/x^2/3)"),
        ("x^(4/3)", "x^4/3"),
        ("1/(a*x)", "((1/a)/x)"),
        ("a*b*t*x*y", "(((a*b)*t)*(x*y))"),
        ("x*t*a*y*s*b", "(((a*b)*(t*s))*(x*y))"),
        ("a/b*t/s*x/y", "(((a/b)*(t/s))*(x/y))"),
        ("t/x", "(t/x)"),
        ("1/(a*t*x)", "(((1/a)/t)/x)"),
        ("x*y/(t*z)", "((1/t)*((x*y)/z))"),
        ("a*x + a*y", "(a*(x + y))"),
        ("a*x + b*y + a*z", "((a*(x + z)) + (b*y))"),
        ("a*x - a*y", "(a*(x - y))"),
        ("-a*x - a*y", "-(a*(x + y))"),
        ("a*x + a*t", "(a*(t + x))"),
        ("2*a*x + 2*a*y + 3*b*x*y", "(((2*a)*(x + y)) + ((3*b)*(x*y)))"),
        ("2*x + 2*y + 3*z", "((2*(x + y)) + (3*z))"),
        ("x*t + y*t + z", "(z + (t*(x + y)))"),
        ("x*t - y*t + z", "(z + (t*(x - y)))"),
        ("x*y + x*z + y*z", "((x*(y + z)) + (y*z))"),
        ("x^2*y + x^2*z + x*y", "(x*((y*(x + 1)) + (x*z)))"),
        ("x*sin(t) + y*sin(t) - z*cos(t)", "((sin(t)*(x + y)) - (cos(t)*z))"),
        ("x + t + a", "((a + t) + x)"),
        ("x*t + x + t + a + b", "(((a + b) + x) + (t*(x + 1)))"),
        ("a - t - x", "((a - t) - x)"),
        ("-a - t + x*t", "-(a + (t*(1 - x)))"),
        ("r", "sqrt(((x*x) + (y*y)))"),
        ("r^2", "((x*x) + (y*y))"),
        ("r^3", "(((x*x) + (y*y))*sqrt(((x*x) + (y*y))))"),
        ("r^4*x", "(x*(((x*x) + (y*y))*((x*x) + (y*y))))"),
        ("1/r", "(1/sqrt(((x*x) + (y*y))))"),
        ("1/r^2", "(1/((x*x) + (y*y)))"),
        ("x/r^3", "(x/(((x*x) + (y*y))*sqrt(((x*x) + (y*y)))))"),
        ("lnboth(x, 1 + x)", "lnboth(x, (x + 1))"),
        ("atan2(y, x)", "atan2(y, x)"),
        ("sin(Pi*x)", "sin(Pi x)"),
        ("sin(x)", "sin(x)"),
        ("cos(2*Pi*x)", "cos(Pi (2*x))"),
        ("sin(a*x)", "sin((a*x))"),
        (
            "sin(x + y)",
            "(sin((x + y)) + (sumerror(x, y)*(cos((x + y)) - ((1/2*sumerror(x, y))*sin((x + y))))))",
        ),
        (
            "cos(x - 3*y)",
            "(cos((x - (3*y))) - ((sumerror(x, -(3*y)) - producterror(3, y))*(sin((x - (3*y))) + ((1/2*(sumerror(x, -(3*y)) - producterror(3, y)))*cos((x - (3*y)))))))",
        ),
        (
            "sin(1/3*x)",
            "(sin((1/3*x)) + (((1/54043195528445952*x) + producterror(1/3, x))*(cos((1/3*x)) - ((1/2*((1/54043195528445952*x) + producterror(1/3, x)))*sin((1/3*x))))))",
        ),
        ("exp(x + 1)", "(exp((1 + x))*((sumerror(1, x)*(1 + (1/2*sumerror(1, x)))) + 1))"),
        (
            "sinh(-x + y)",
            "-(cosh((x - y))*(tanh((x - y)) + (sumerror(x, -y)*(1 + ((1/2*sumerror(x, -y))*tanh((x - y)))))))",
        ),
        (
            "cosh(2 - x)",
            "(cosh((2 - x))*((sumerror(2, -x)*(tanh((2 - x)) + (1/2*sumerror(2, -x)))) + 1))",
        ),
        ("tan(x + y)", "tan((x + y))"),
        (
            "sin(x + t)",
            "(sin((t + x)) + (sumerror(t, x)*(cos((t + x)) - ((1/2*sumerror(t, x))*sin((t + x))))))",
        ),
        (
            "sin(Pi*(x + y))",
            "(sin(Pi (x + y)) + ((Pi*sumerror(x, y))*(cos(Pi (x + y)) - ((1/2*(Pi*sumerror(x, y)))*sin(Pi (x + y))))))",
        ),
        (
            "cos(Pi*(1 - x/3))",
            "(cos(Pi (1 - (1/3*x))) - ((Pi*((sumerror(1, -(1/3*x)) - (1/54043195528445952*x)) - producterror(1/3, x)))*(sin(Pi (1 - (1/3*x))) + ((1/2*(Pi*((sumerror(1, -(1/3*x)) - (1/54043195528445952*x)) - producterror(1/3, x))))*cos(Pi (1 - (1/3*x)))))))",
        ),
        ("exp(-x - y)", "(exp((-x - y))*((sumerror(-x, -y)*(1 + (1/2*sumerror(-x, -y)))) + 1))"),
        ("x*(1 + y)", "(x*(y + 1))"),
        ("2*(1 + y)", "(2*(y + 1))"),
        ("(1 + y)/2", "(1/2*(y + 1))"),
        ("(x + y)*(x - y)", "((x + y)*(x - y))"),
        ("a*(x + y) + b*(x - y)", "((a*(x + y)) + (b*(x - y)))"),
        ("(a + b)*x", "((a + b)*x)"),
        ("(a + b)*x + (a + b)*y", "((a + b)*(x + y))"),
        ("a*x*(1 + y) + a*t", "(a*(t + (x*(y + 1))))"),
        ("1 + a*x + a*y", "((a*(x + y)) + 1)"),
        ("Pi*x", "(Pi*x)"),
        ("Pi*x + Pi*y", "(Pi*(x + y))"),
        ("x + 0.1", "(1/10*((10*x) + 1))"),
        ("x/10 + y/5 - 1/3", "-(1/30*(10 - (3*(x + (2*y)))))"),
        ("k*x*t - k*y*t + k*z*t + x", "(x + (k*(t*((x - y) + z))))"),
    ] {
        assert_eq!(lowered(text), expected, "{text}");
    }
}

/// Additions and products count once, quotients and roots eight times, calls forty times; what is done once for given
/// parameters does not count.
#[test]
fn costs_of_programs() {
    for (text, cost) in [
        ("x + y", 1),
        ("x - y*t", 2),
        ("x*y*z*t", 3),
        ("x/t", 9),
        ("sqrt(x)", 8),
        ("t + sqrt(s)*sqrt(t)", 18),
        ("tan(x)", 40),
        ("tan(t) + exp(s)", 81),
        ("x^(1/3)", 40),
        ("a + b", 0),
        ("sin(a)*b + x", 1),
        ("x*y + t*s + sin(a) + y*t", 5),
        ("exp(t*x)*y*t/(s + t) + s/y", 61),
    ] {
        let mut graph = Graph::new();
        let inputs = NAMES.map(|name| {
            let (time, position) = ("ts".contains(name), "xyz".contains(name));
            (graph.symbol(name), Dependence { position, time })
        });
        let ast = Ast::parse(text).unwrap();
        let expr = graph.build(&ast, &mut |g, name| Ok(g.symbol(name))).unwrap();
        let program = Program::lower(&mut graph, &inputs, &[], &[expr]);
        let stages = program.operations_by_stage(program.outputs());
        let found = stages.time.cost() + stages.point.cost() + stages.both.cost();
        assert_eq!(found, cost, "{text}: {:?}", program.operations());
    }
}
