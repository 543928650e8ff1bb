//! Laws that a specification states as text: the response, rates of internal variables, and their values at the start.
//!
//! Texts become programs of `mmsmith-expr`, whose operations run over any [`Number`]. The stress of an energy comes by dual numbers in the
//! deformation gradient, not by symbols.

use std::f64::consts::PI;

use mmsmith_expr::{
    Ast, AstKind, Dependence, Expr, Function, Graph, Operation, Program, nearest_f64,
};
use mmsmith_scalar_functions::ScalarFunctions;
use mmsmith_vocabulary::{Components, Response, Stated};
use thiserror::Error;

use crate::law::{Branch, Kinematics, LawWithHistory, kinds_of};
use crate::number::has_derivative;
use crate::number::{Dual, Number};
use crate::tensor::{Space, Tensor, symmetric_product, tensor, trace};

/// Why a text is no law with a history.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum StatedHistoryError {
    /// Components along curvilinear coordinates.
    #[error(
        "the components of this law turn from place to place with the coordinates, while internal variables, rates and given fields are \
         followed in Cartesian ones: state the law in J, I1 and I2, or the solution with coordinates = 'cartesian'"
    )]
    Curvilinear,
    /// A stress has as many rows and columns as there are dimensions.
    #[error("a stress in {dimension} dimension(s) has {dimension} x {dimension} components")]
    Shape {
        /// The dimensions.
        dimension: usize,
    },
    /// A name has two meanings.
    #[error("'{name}' has a meaning of its own in laws: choose another name for it")]
    TakenName {
        /// The name.
        name: String,
    },
    /// The text is no expression of what there is.
    #[error("{of}, '{text}': {message}")]
    Text {
        /// The use of the text.
        of: String,
        /// The text.
        text: String,
        /// The mistake.
        message: String,
    },
    /// A function whose slopes cannot be formed.
    #[error("{of} uses {function}, whose slope has no formula here: write the law without it")]
    NoSlope {
        /// The use of the text.
        of: String,
        /// The function.
        function: &'static str,
    },
}

/// A measure of the deformation or of its rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Measure {
    F(usize, usize),
    C(usize, usize),
    J,
    I1,
    I2,
    /// The rate of `F`.
    RateOfF(usize, usize),
    /// The rate of `J`.
    RateOfJ,
    /// The rate of deformation in space.
    D(usize, usize),
}

impl Measure {
    fn all(dimension: usize) -> Vec<(String, Self)> {
        let mut all = vec![("J".into(), Self::J), ("I1".into(), Self::I1), ("I2".into(), Self::I2)];
        all.push(("Jdot".into(), Self::RateOfJ));
        for (i, j) in (0..dimension * dimension).map(|m| (m / dimension, m % dimension)) {
            let (row, column) = (i + 1, j + 1);
            all.push((format!("F{row}{column}"), Self::F(i, j)));
            all.push((format!("C{row}{column}"), Self::C(i, j)));
            all.push((format!("Fdot{row}{column}"), Self::RateOfF(i, j)));
            all.push((format!("d{row}{column}"), Self::D(i, j)));
        }
        all
    }

    fn is_rate(self) -> bool {
        matches!(self, Self::RateOfF(..) | Self::RateOfJ | Self::D(..))
    }
}

/// An operation over any number; operands are places of earlier ones.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Number(f64),
    Input(usize),
    Add(usize, usize),
    Sub(usize, usize),
    Mul(usize, usize),
    Div(usize, usize),
    Neg(usize),
    Sqrt(usize),
    Power(usize, f64),
    SinPi(usize),
    CosPi(usize),
    Call(Function, usize),
    Atan2(usize, usize),
    LnOfBoth(usize, usize),
    SumError(usize, usize),
    ProductError(usize, usize),
}

/// Texts as operations.
#[derive(Clone, Debug, PartialEq)]
struct Steps {
    steps: Vec<Step>,
    outputs: Vec<usize>,
    /// The inputs that are read and are measures of the deformation.
    measures: Vec<(usize, Measure)>,
}

impl Steps {
    fn of(program: &Program, measures: &[(String, Measure)]) -> Self {
        let step = |operation: &Operation| {
            use Operation as O;
            let at = |slot: &mmsmith_expr::Slot| slot.index();
            match operation {
                O::Number(value) => Step::Number(nearest_f64(value)),
                O::Pi => Step::Number(PI),
                O::Input(index) => Step::Input(*index),
                O::Add(a, b) => Step::Add(at(a), at(b)),
                O::Sub(a, b) => Step::Sub(at(a), at(b)),
                O::Mul(a, b) => Step::Mul(at(a), at(b)),
                O::Div(a, b) => Step::Div(at(a), at(b)),
                O::Neg(a) => Step::Neg(at(a)),
                O::Sqrt(a) => Step::Sqrt(at(a)),
                O::Power(a, exponent) => Step::Power(at(a), nearest_f64(exponent)),
                O::SinPi(a) => Step::SinPi(at(a)),
                O::CosPi(a) => Step::CosPi(at(a)),
                O::Call(function, a) => Step::Call(*function, at(a)),
                O::Atan2(a, b) => Step::Atan2(at(a), at(b)),
                O::LnOfBoth(a, b) => Step::LnOfBoth(at(a), at(b)),
                O::SumError(a, b) => Step::SumError(at(a), at(b)),
                O::ProductError(a, b) => Step::ProductError(at(a), at(b)),
            }
        };
        let steps: Vec<Step> = program.operations().iter().map(step).collect();
        let is_read = |index: usize| steps.contains(&Step::Input(index));
        let measures = measures.iter().enumerate().filter(|(index, _)| is_read(*index));
        let measures = measures.map(|(index, (_, measure))| (index, *measure)).collect();
        let outputs = program.outputs().iter().map(|slot| slot.index()).collect();
        Self { steps, outputs, measures }
    }

    /// Writes the outputs.
    fn run<N: Number>(&self, inputs: &[N], mut output: impl FnMut(usize, N)) {
        let mut values: Vec<N> = Vec::with_capacity(self.steps.len());
        for step in &self.steps {
            let value = match *step {
                Step::Number(value) => N::constant(value),
                Step::Input(index) => inputs[index],
                Step::Add(a, b) => values[a] + values[b],
                Step::Sub(a, b) => values[a] - values[b],
                Step::Mul(a, b) => values[a] * values[b],
                Step::Div(a, b) => values[a] / values[b],
                Step::Neg(a) => -values[a],
                Step::Sqrt(a) => values[a].sqrt(),
                Step::Power(a, exponent) => values[a].powf(exponent),
                Step::SinPi(a) => of_pi(values[a], Function::Sin),
                Step::CosPi(a) => of_pi(values[a], Function::Cos),
                Step::Call(function, a) => values[a].call(function),
                Step::Atan2(y, x) => angle(values[y], values[x]),
                Step::LnOfBoth(x, y) => {
                    if values[x].value() < -0.5 {
                        values[y].ln()
                    } else {
                        values[x].call(Function::Ln1p)
                    }
                }
                // What rounding takes has no slope.
                Step::SumError(a, b) => N::constant(values[a].value().sum_error(values[b].value())),
                Step::ProductError(a, b) => {
                    N::constant(values[a].value().product_error(values[b].value()))
                }
            };
            values.push(value);
        }
        for (place, &slot) in self.outputs.iter().enumerate() {
            output(place, values[slot]);
        }
    }
}

/// `sin(Pi x)` or `cos(Pi x)`.
fn of_pi<N: Number>(x: N, function: Function) -> N {
    let nearest = x.value().round();
    let value = (x - N::constant(nearest)).times(PI).call(function);
    if nearest.rem_euclid(2.0) == 0.0 { value } else { -value }
}

/// `atan2(y, x)`.
fn angle<N: Number>(y: N, x: N) -> N {
    let (at_y, at_x) = (y.value(), x.value());
    if at_x.abs() >= at_y.abs() {
        let turn = if at_x >= 0.0 { 0.0 } else { PI.copysign(at_y) };
        (y / x).call(Function::Atan) + N::constant(turn)
    } else {
        N::constant((0.5 * PI).copysign(at_y)) - (x / y).call(Function::Atan)
    }
}

/// A law that a specification states. Its constants are those of the law by their names, then those of `X`, `Y`, `Z` and `t` that its texts
/// use.
#[derive(Clone, Debug)]
pub struct StatedHistory {
    dimension: usize,
    constants: Vec<String>,
    internal: Vec<String>,
    is_energy: bool,
    response: Steps,
    rates: Steps,
    initial: Steps,
    /// Inputs: measures, then internal variables, then constants.
    measures: usize,
}

/// Names of coordinates and of the time.
const PLACES: [&str; 4] = ["X", "Y", "Z", "t"];

/// Reads texts of one law.
struct Reader {
    graph: Graph,
    measures: Vec<(String, Measure)>,
    /// Variables and constants.
    symbols: Vec<String>,
    internal: Vec<String>,
    given: Vec<(String, Expr)>,
}

/// Which names a text may use beside constants, given fields and places.
#[derive(Clone, Copy, PartialEq)]
enum Scope {
    /// None.
    Places,
    /// All but rates.
    Deformation,
    All,
}

impl Reader {
    fn read(&mut self, of: String, text: &str, scope: Scope) -> Result<Expr, StatedHistoryError> {
        let fail = |message: String| StatedHistoryError::Text {
            of: of.clone(),
            text: text.to_owned(),
            message,
        };
        let ast = Ast::parse(text).map_err(|error| fail(error.to_string()))?;
        let Self { graph, measures, symbols, internal, given } = self;
        if let Some(variable) = wrong_derivative(&ast, &|name| {
            internal.iter().any(|known| known == name)
                || measures.iter().any(|(known, _)| known == name)
        }) {
            return Err(fail(format!(
                "diff by '{variable}' would miss what depends on it through other fields: write the derivative out"
            )));
        }
        let mut names = |graph: &mut Graph, name: &str| -> Result<Expr, String> {
            let measure = measures.iter().find(|(known, _)| known == name).map(|pair| pair.1);
            let is_internal = internal.iter().any(|known| known == name);
            if let Some((_, expr)) = given.iter().find(|(known, _)| known == name) {
                return Ok(*expr);
            }
            if (measure.is_some() || is_internal) && scope == Scope::Places {
                return Err(format!(
                    "'{name}' changes with the deformation; here only coordinates, constants and given fields have a value"
                ));
            }
            if measure.is_some_and(Measure::is_rate) && scope == Scope::Deformation {
                return Err(format!(
                    "an energy cannot depend on the rate '{name}': state the stress instead"
                ));
            }
            if measure.is_some()
                || is_internal
                || symbols.iter().any(|known| known == name)
                || PLACES.contains(&name)
            {
                return Ok(graph.symbol(name));
            }
            let known = measures.iter().map(|pair| &pair.0).chain(symbols.iter());
            let known = known.chain(given.iter().map(|pair| &pair.0)).map(String::as_str);
            let known: Vec<&str> = known.chain(PLACES).collect();
            Err(format!("'{name}' is not one of {}", known.join(", ")))
        };
        graph.build(&ast, &mut names).map_err(|error| fail(error.message))
    }
}

/// A variable of a `diff` in the text that `may` does not allow.
fn wrong_derivative(ast: &Ast, may: &impl Fn(&str) -> bool) -> Option<String> {
    let inner = |ast: &Ast| wrong_derivative(ast, may);
    match &ast.kind {
        AstKind::Number(_) | AstKind::Name(_) => None,
        AstKind::Sum(parts) | AstKind::Product(parts) => {
            parts.iter().find_map(|(_, part)| inner(part))
        }
        AstKind::Power(base, exponent) => inner(base).or_else(|| inner(exponent)),
        AstKind::Call(name, arguments) => {
            let variables = if name == "diff" { arguments.get(1..) } else { None };
            let wrong = variables.unwrap_or_default().iter().find_map(|ast| match &ast.kind {
                AstKind::Name(name) if !may(name) => Some(name.clone()),
                _ => None,
            });
            wrong.or_else(|| arguments.iter().find_map(inner))
        }
    }
}

impl StatedHistory {
    /// The law of the texts in a number of dimensions.
    ///
    /// # Errors
    ///
    /// [`StatedHistoryError`].
    pub fn new<T>(law: &Stated<T>, dimension: usize) -> Result<Self, StatedHistoryError> {
        if law.components == Components::Curvilinear {
            return Err(StatedHistoryError::Curvilinear);
        }
        let measures = Measure::all(dimension);
        let constants = law.constants.iter().map(|(name, _)| name.clone());
        let internal: Vec<String> = law.internal.iter().map(|own| own.name.clone()).collect();
        let symbols: Vec<String> = internal.iter().cloned().chain(constants).collect();
        let given = law.given.iter().map(|(name, _)| name);
        let mut seen: Vec<&str> = measures.iter().map(|(name, _)| name.as_str()).collect();
        seen.extend(PLACES);
        seen.push("Pi");
        for name in symbols.iter().chain(given) {
            if seen.contains(&name.as_str()) {
                return Err(StatedHistoryError::TakenName { name: name.clone() });
            }
            seen.push(name);
        }
        let mut reader = Reader {
            graph: Graph::new(),
            measures,
            symbols,
            internal: internal.clone(),
            given: Vec::new(),
        };
        for (name, text) in &law.given {
            let expr = reader.read(format!("the given field '{name}'"), text, Scope::Places)?;
            reader.given.push((name.clone(), expr));
        }
        let of_response = |reader: &mut Reader| match &law.response {
            Response::Energy(text) => {
                Ok(vec![reader.read("the energy".into(), text, Scope::Deformation)?])
            }
            Response::Stress(rows) => {
                let is_square =
                    rows.len() == dimension && rows.iter().all(|row| row.len() == dimension);
                if !is_square {
                    return Err(StatedHistoryError::Shape { dimension });
                }
                let texts = rows.iter().flatten().enumerate().map(|(place, text)| {
                    let (i, j) = (place / dimension + 1, place % dimension + 1);
                    reader.read(format!("the stress P{i}{j}"), text, Scope::All)
                });
                texts.collect()
            }
        };
        let response = of_response(&mut reader)?;
        let is_energy = matches!(law.response, Response::Energy(_));
        let mut of_internal = |text: fn(&mmsmith_vocabulary::Internal) -> &str, what, scope| {
            let read = |own: &mmsmith_vocabulary::Internal| {
                reader.read(format!("the {what} of '{}'", own.name), text(own), scope)
            };
            law.internal.iter().map(read).collect::<Result<Vec<Expr>, _>>()
        };
        let rates = of_internal(|own| &own.rate, "rate", Scope::All)?;
        let initial = of_internal(|own| &own.initial, "value at the start", Scope::Places)?;
        let Reader { mut graph, measures, symbols, .. } = reader;
        let all: Vec<Expr> = response.iter().chain(&rates).chain(&initial).copied().collect();
        let used = graph.symbols_in(&all);
        let mut constants = symbols[internal.len()..].to_vec();
        for place in PLACES {
            let symbol = graph.symbol(place);
            if used.contains(&symbol) {
                constants.push(place.to_owned());
            }
        }
        let names = measures.iter().map(|(name, _)| name).chain(&internal).chain(&constants);
        let inputs: Vec<(Expr, Dependence)> =
            names.map(|name| (graph.symbol(name), Dependence::default())).collect();
        let mut steps = |outputs: &[Expr], of: &str, twice: bool| {
            let program = Program::lower(&mut graph, &inputs, &[], outputs);
            for operation in program.operations() {
                if let Operation::Call(function, _) = *operation
                    && !has_derivative(function, twice)
                {
                    let function = function.name();
                    return Err(StatedHistoryError::NoSlope { of: of.to_owned(), function });
                }
            }
            Ok(Steps::of(&program, &measures))
        };
        Ok(Self {
            dimension,
            is_energy,
            response: steps(&response, "the response", is_energy)?,
            rates: steps(&rates, "the rate of an internal variable", false)?,
            initial: steps(&initial, "the start of an internal variable", false)?,
            measures: measures.len(),
            constants,
            internal,
        })
    }

    fn space(&self) -> Space {
        if self.dimension < 3 { Space::Plane } else { Space::Whole }
    }

    /// The inputs of steps.
    fn inputs<N: Number>(
        &self,
        steps: &Steps,
        F: &Tensor<N>,
        rate: Option<&Tensor<N>>,
        z: &[N],
        constants: &[N],
    ) -> Vec<N> {
        let space = self.space();
        let mut inputs = vec![N::constant(0.0); self.measures];
        let needs = |which: fn(Measure) -> bool| steps.measures.iter().any(|(_, m)| which(*m));
        let C = needs(|m| matches!(m, Measure::C(..) | Measure::I1 | Measure::I2))
            .then(|| symmetric_product(space, F));
        let spin = |rate: &Tensor<N>| space.product(rate, &space.inverse(F));
        let l = if needs(|m| matches!(m, Measure::RateOfJ | Measure::D(..))) {
            rate.map(spin)
        } else {
            None
        };
        let zero = N::constant(0.0);
        let entry = |A: Option<&Tensor<N>>, i: usize, j: usize| A.map_or(zero, |A| A[i][j]);
        for &(place, measure) in &steps.measures {
            inputs[place] = match measure {
                Measure::F(i, j) => F[i][j],
                Measure::C(i, j) => entry(C.as_ref(), i, j),
                Measure::J => space.determinant(F),
                Measure::I1 => C.as_ref().map_or(zero, trace),
                Measure::I2 => C.as_ref().map_or(zero, |C| {
                    let sum = trace(C);
                    (sum * sum - space.contraction_with_transpose(C, C)).times(0.5)
                }),
                Measure::RateOfF(i, j) => entry(rate, i, j),
                Measure::RateOfJ => l.as_ref().map_or(zero, |l| trace(l) * space.determinant(F)),
                Measure::D(i, j) => (entry(l.as_ref(), i, j) + entry(l.as_ref(), j, i)).times(0.5),
            };
        }
        inputs.extend_from_slice(z);
        inputs.extend_from_slice(constants);
        inputs
    }

    /// `dW/dF` in `M` components, row by row.
    fn of_energy<N: Number, const M: usize>(
        &self,
        F: &Tensor<N>,
        constants: &[N],
        z: &[N],
    ) -> Tensor<N> {
        let D = self.dimension;
        let of = |value: N| Dual { value, slopes: [N::constant(0.0); M] };
        let mut dual = tensor(|i, j| of(F[i][j]));
        for i in 0..D {
            for j in 0..D {
                dual[i][j].slopes[i * D + j] = N::constant(1.0);
            }
        }
        let lift = |numbers: &[N]| -> Vec<Dual<N, M>> { numbers.iter().map(|&n| of(n)).collect() };
        let inputs = self.inputs(&self.response, &dual, None, &lift(z), &lift(constants));
        let mut P = tensor(|_, _| N::constant(0.0));
        self.response.run(&inputs, |_, W: Dual<N, M>| {
            for i in 0..D {
                for j in 0..D {
                    P[i][j] = W.slopes[i * D + j];
                }
            }
        });
        P
    }
}

impl LawWithHistory for StatedHistory {
    fn constants(&self) -> Vec<String> {
        self.constants.clone()
    }

    fn constants_change(&self) -> bool {
        true
    }

    fn variables(&self) -> Vec<String> {
        self.internal.clone()
    }

    fn groups(&self) -> Vec<usize> {
        kinds_of(&self.internal)
    }

    fn initial<N: Number>(&self, constants: &[N], _: &Tensor<f64>) -> Vec<N> {
        let zero = N::constant(0.0);
        let mut inputs = vec![zero; self.measures + self.internal.len()];
        inputs.extend_from_slice(constants);
        let mut z = vec![zero; self.internal.len()];
        self.initial.run(&inputs, |place, value| z[place] = value);
        z
    }

    fn rate<N: Number>(
        &self,
        at: &Kinematics<N>,
        constants: &[N],
        z: &[N],
        _: Branch,
        rates: &mut [N],
    ) {
        let inputs = self.inputs(&self.rates, &at.F, Some(&at.rate), z, constants);
        self.rates.run(&inputs, |place, value| rates[place] = value);
    }

    fn first_piola_kirchhoff<N: Number>(
        &self,
        at: &Kinematics<N>,
        constants: &[N],
        z: &[N],
    ) -> Tensor<N> {
        if self.is_energy {
            return match self.dimension {
                1 => self.of_energy::<N, 1>(&at.F, constants, z),
                2 => self.of_energy::<N, 4>(&at.F, constants, z),
                _ => self.of_energy::<N, 9>(&at.F, constants, z),
            };
        }
        let inputs = self.inputs(&self.response, &at.F, Some(&at.rate), z, constants);
        let mut P = tensor(|_, _| N::constant(0.0));
        let D = self.dimension;
        self.response.run(&inputs, |place, value| P[place / D][place % D] = value);
        P
    }
}
