//! Every operation against the mathematics that its name says, at one place and at several side by side.

use super::{Dependence, Operation, OperationCount, Program, Slot};
use crate::{Ast, Function, Graph, Rational};

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
        (Operation::Atan2(x, y), |x, y| x.atan2(y), [0, 0, 0, 0, 1]),
        // What one operation takes, and what is left of it (T. J. Dekker, 1971).
        (Operation::SumError(x, y), |x, y| two_sum(x, y), [5, 0, 0, 0, 0]),
        (Operation::ProductError(x, y), |x, y| x.mul_add(y, -(x * y)), [7, 5, 0, 0, 0]),
    ];
    let functions: [(Function, Value); 13] = [
        (Function::Sin, |x, _| x.sin()),
        (Function::Cos, |x, _| x.cos()),
        (Function::Tan, |x, _| x.tan()),
        (Function::Asin, |x, _| x.asin()),
        (Function::Acos, |x, _| x.acos()),
        (Function::Atan, |x, _| x.atan()),
        (Function::Sinh, |x, _| x.sinh()),
        (Function::Cosh, |x, _| x.cosh()),
        (Function::Tanh, |x, _| x.tanh()),
        (Function::Exp, |x, _| x.exp()),
        (Function::Ln, |x, _| x.ln()),
        (Function::Ln1p, |x, _| x.ln_1p()),
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
