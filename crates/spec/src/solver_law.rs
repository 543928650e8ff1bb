//! The law of a specification as a solver needs it, with texts where the library has no law of the kind.

use crate::law::energy::{INVARIANTS, component_names, rate_names};
use crate::law::energy_text;
use crate::law::prestress;
use crate::tensor::Matrix;
use crate::{Around, Coordinates, Domain, Law, Spec, Variation};
use mmsmith_expr::{Expr, Graph};
use mmsmith_vocabulary::{Components, Internal, Law as ForSolver, Response, Stated, WithMemory};

impl Spec {
    /// The law as a solver needs it: one that the specification states in text, with the parameters in it. Positions in its text are
    /// Cartesian.
    #[must_use]
    pub fn law_for_solver(&self) -> ForSolver<Expr> {
        let law = match &self.variation {
            Some(variation) => self.varied(variation),
            None => self.law_in_own_coordinates(),
        };
        let law = match &self.prestress {
            Some(prestress) => self.with_prestress(law, prestress),
            None => law,
        };
        match law {
            ForSolver::Stated(stated) => ForSolver::Stated(self.with_places_given(stated)),
            law => law,
        }
    }

    /// The law that a specification makes of one of the library.
    fn varied(&self, variation: &Variation) -> ForSolver<Expr> {
        let constants = variation.constants.iter();
        let own = Stated {
            response: Response::Energy(variation.energy.clone()),
            components: Components::Cartesian,
            constants: constants.map(|(row, value)| (row.name.to_owned(), *value)).collect(),
            given: Vec::new(),
            internal: Vec::new(),
            across: variation.across.clone(),
        };
        if !self.has_fields_in(variation) {
            return ForSolver::Stated(own);
        }
        self.law_in_own_coordinates()
    }

    fn has_fields_in(&self, variation: &Variation) -> bool {
        variation.constants.iter().any(|(_, value)| self.is_field(*value))
    }

    /// A law with the energy `S : E` of a stress at the start.
    fn with_prestress(&self, law: ForSolver<Expr>, S: &Matrix) -> ForSolver<Expr> {
        let mut stated = match law {
            ForSolver::Stated(stated) => stated,
            ForSolver::Library(material) => Stated {
                response: Response::Energy(energy_text(&material, self.dimension)),
                components: Components::Cartesian,
                constants: self
                    .material
                    .constants()
                    .into_iter()
                    .map(|(row, value)| (row.name.to_owned(), value))
                    .collect(),
                given: Vec::new(),
                internal: Vec::new(),
                across: None,
            },
            law @ ForSolver::WithMemory(_) => return law,
        };
        if let Response::Energy(text) = &mut stated.response {
            *text += &prestress::energy(S);
        }
        if let Some(across) = &mut stated.across {
            across.in_space += &prestress::energy(S);
        }
        stated.constants.extend(prestress::constants(S));
        if self.coordinates != Coordinates::Cartesian {
            stated.components = Components::Curvilinear;
        }
        ForSolver::Stated(stated)
    }

    /// A law whose text names positions and the time in given fields alone, in Cartesian coordinates.
    fn with_places_given(&self, mut law: Stated<Expr>) -> Stated<Expr> {
        let coordinates = self.coordinates.coordinate_names(self.dimension);
        let places: Vec<String> =
            coordinates.iter().copied().chain(["t"]).map(str::to_owned).collect();
        let mut texts: Vec<&mut String> = match &mut law.response {
            Response::Energy(text) => vec![text],
            Response::Stress(rows) => rows.iter_mut().flatten().collect(),
        };
        texts.extend(law.internal.iter_mut().map(|variable| &mut variable.rate));
        let mut used = Vec::new();
        for text in texts {
            let changed = replaced(text, |word| {
                let place = places.iter().position(|place| place == word)?;
                if !used.contains(&place) {
                    used.push(place);
                }
                Some(format!("{word}_here"))
            });
            *text = changed;
        }
        used.sort_unstable();
        let of_places =
            used.into_iter().map(|k| (format!("{}_here", places[k]), places[k].clone()));
        law.given = of_places.chain(law.given).collect();
        let distance = match self.coordinates {
            Coordinates::Cartesian => return law,
            Coordinates::Polar | Coordinates::Cylindrical | Coordinates::Axisymmetric => {
                "(sqrt(X^2 + Y^2))"
            }
            Coordinates::Spherical => "(sqrt(X^2 + Y^2 + Z^2))",
        };
        let angle = match self.coordinates {
            Coordinates::Spherical => "(atan2(sqrt(X^2 + Y^2), Z))",
            _ => "(atan2(Y, X))",
        };
        let cartesian = |word: &str| match word {
            "R" => Some(distance.to_owned()),
            "theta" if coordinates.contains(&"theta") => Some(angle.to_owned()),
            "phi" if coordinates.contains(&"phi") => Some("(atan2(Y, X))".to_owned()),
            _ => None,
        };
        for (_, text) in &mut law.given {
            *text = replaced(text, cartesian);
        }
        for variable in &mut law.internal {
            variable.initial = replaced(&variable.initial, cartesian);
        }
        law
    }

    /// As [`law_for_solver`](Self::law_for_solver), with positions in the coordinates of the specification.
    fn law_in_own_coordinates(&self) -> ForSolver<Expr> {
        let graph = &self.graph;
        let print = |expr: Expr| graph.print(expr);
        if let (Law::Library(elastic), Some(memory)) = (&self.material, &self.memory) {
            return ForSolver::WithMemory(WithMemory { elastic: *elastic, memory: memory.clone() });
        }
        let mut given: Vec<(String, String)> = Vec::new();
        let mut of_given = Vec::new();
        for field in &self.given {
            given.push((field.name.clone(), print(field.value)));
            of_given.push(field.value);
        }
        let (response, mut of_response, is_stress) = match &self.material {
            Law::Library(material) => {
                let is_graded = self.has_graded_constants();
                let has_directions = !material.row().is_isotropic;
                if !is_graded && (!has_directions || self.coordinates == Coordinates::Cartesian) {
                    return ForSolver::Library(*material);
                }
                // The library's laws have their directions along Cartesian axes; here they turn from place to place.
                let response = Response::Energy(energy_text(material, self.dimension));
                let constants = self.material.constants().into_iter();
                let components = match self.coordinates {
                    Coordinates::Cartesian => Components::Cartesian,
                    _ if has_directions => Components::Curvilinear,
                    _ => Components::Cartesian,
                };
                if !is_graded {
                    return ForSolver::Stated(Stated {
                        response,
                        components,
                        constants: constants
                            .map(|(row, value)| (row.name.to_owned(), value))
                            .collect(),
                        given,
                        internal: Vec::new(),
                        across: None,
                    });
                }
                let constants: Vec<(String, Expr)> =
                    constants.map(|(row, value)| (row.name.to_owned(), value)).collect();
                // A constant that is a field hides a parameter of its name, which its own text may use.
                let mut of_constants = of_given.clone();
                for (name, value) in &constants {
                    given.push((format!("{name}_here"), print(*value)));
                    of_constants.push(*value);
                }
                let Response::Energy(text) = response else { return ForSolver::Library(*material) };
                let names: Vec<String> = constants.iter().map(|(name, _)| name.clone()).collect();
                let response = Response::Energy(with_suffix(&text, &names, "_here"));
                let given_names = self.given.iter().map(|field| field.name.as_str());
                return ForSolver::Stated(Stated {
                    response,
                    components,
                    constants: self.parameters_in(&of_constants, given_names),
                    given,
                    internal: Vec::new(),
                    across: None,
                });
            }
            Law::Energy { W } => (Response::Energy(print(*W)), vec![*W], false),
            Law::Stress { P } => {
                let row = |row: &Vec<Expr>| row.iter().map(|&entry| print(entry)).collect();
                (Response::Stress(P.iter().map(row).collect()), P.concat(), true)
            }
        };
        let names = ["F", "C"].map(|letter| component_names(letter, 3).concat()).concat();
        let rates = rate_names(3);
        let has_components = graph
            .symbols_in(&of_response)
            .into_iter()
            .filter_map(|symbol| graph.symbol_name(symbol))
            .any(|name| names.iter().any(|known| known == name));
        let components = match self.coordinates {
            Coordinates::Cartesian => Components::Cartesian,
            _ if is_stress || has_components => Components::Curvilinear,
            _ => Components::Cartesian,
        };
        let internal: Vec<Internal> = self
            .internal
            .iter()
            .map(|variable| Internal {
                name: variable.name.clone(),
                rate: print(variable.rate),
                initial: print(variable.initial),
            })
            .collect();
        of_response
            .extend(self.internal.iter().flat_map(|variable| [variable.rate, variable.initial]));
        of_response.extend(&of_given);
        let own = self.given.iter().map(|field| field.name.as_str());
        let own = own.chain(self.internal.iter().map(|variable| variable.name.as_str()));
        let own =
            own.chain(names.iter().map(String::as_str)).chain(rates.iter().map(String::as_str));
        let constants = self.parameters_in(&of_response, own.chain(INVARIANTS));
        ForSolver::Stated(Stated { response, components, constants, given, internal, across: None })
    }

    /// The parameters in expressions, which may also use coordinates, the time, and the names in `others`.
    fn parameters_in<'a>(
        &self,
        expressions: &[Expr],
        others: impl Iterator<Item = &'a str>,
    ) -> Vec<(String, Expr)> {
        let coordinates = self.coordinates.coordinate_names(self.dimension);
        let others: Vec<&str> = others.chain(coordinates.iter().copied()).chain(["t"]).collect();
        self.graph
            .symbols_in(expressions)
            .into_iter()
            .filter_map(|symbol| Some((self.graph.symbol_name(symbol)?.to_owned(), symbol)))
            .filter(|(name, _)| !others.contains(&name.as_str()))
            .collect()
    }

    /// An expression of the place in the middle of the body: of a box, or between the two radii on the first axis.
    #[must_use]
    pub fn in_the_middle(&self, graph: &mut Graph, expr: Expr) -> Expr {
        if !self.is_field(expr) {
            return expr;
        }
        let names = self.coordinates.coordinate_names(self.dimension);
        let middle = |graph: &mut Graph, low: Expr, high: Expr| {
            let (sum, two) = (graph.add(low, high), graph.integer(2));
            graph.div(sum, two)
        };
        let place: Vec<Expr> = match &self.domain {
            Domain::Box { lower, upper } => {
                lower.iter().zip(upper).map(|(&low, &high)| middle(graph, low, high)).collect()
            }
            Domain::Annulus { inner, outer } => {
                let radius = middle(graph, *inner, *outer);
                let rest = vec![Graph::ZERO; names.len().saturating_sub(1)];
                [vec![radius], rest].concat()
            }
            Domain::Tube { inner, outer, lower, upper, around } => {
                let angle = match around {
                    Around::Axisymmetric | Around::Whole => Graph::ZERO,
                    Around::Sector { from, to } => middle(graph, *from, *to),
                };
                vec![middle(graph, *inner, *outer), angle, middle(graph, *lower, *upper)]
            }
        };
        let symbols = names.iter().map(|name| graph.symbol(name)).collect::<Vec<_>>();
        graph.replace(expr, &symbols.into_iter().zip(place).collect())
    }

    /// Whether constants of a law of the library depend on the place, the time, or given fields.
    #[must_use]
    pub fn has_graded_constants(&self) -> bool {
        self.material.constants().iter().any(|(_, value)| self.is_field(*value))
    }

    /// Whether the stress depends on more than the deformation and parameters.
    #[must_use]
    pub fn has_memory_or_fields(&self) -> bool {
        self.memory.is_some()
            || match self.law_for_solver() {
                ForSolver::Library(_) => false,
                ForSolver::Stated(stated) => stated.has_memory(),
                ForSolver::WithMemory(_) => true,
            }
    }

    /// Whether the density depends on the place.
    #[must_use]
    pub fn has_graded_density(&self) -> bool {
        self.is_field(self.density)
    }

    /// Whether an expression depends on the place, the time, or given fields.
    pub(crate) fn is_field(&self, expr: Expr) -> bool {
        let coordinates = self.coordinates.coordinate_names(self.dimension);
        let given = self.given.iter().map(|field| field.name.as_str());
        let names: Vec<&str> = coordinates.iter().copied().chain(["t"]).chain(given).collect();
        let symbols = self.graph.symbols_in(&[expr]);
        symbols.iter().filter_map(|s| self.graph.symbol_name(*s)).any(|name| names.contains(&name))
    }

    /// Whether the stress depends on the history of the deformation, so that its fields are no formulas of position and time.
    #[must_use]
    pub fn has_history(&self) -> bool {
        self.memory.is_some() || !self.internal.is_empty()
    }
}

/// A text in which some names have a suffix.
fn with_suffix(text: &str, names: &[String], suffix: &str) -> String {
    replaced(text, |word| names.iter().any(|name| name == word).then(|| format!("{word}{suffix}")))
}

/// A text with other words in the place of some.
pub(crate) fn replaced(text: &str, mut by: impl FnMut(&str) -> Option<String>) -> String {
    let mut changed = String::new();
    let mut word = String::new();
    for c in text.chars().chain([' ']) {
        if c.is_ascii_alphanumeric() || c == '_' {
            word.push(c);
            continue;
        }
        match by(&word) {
            Some(other) => changed.push_str(&other),
            None => changed.push_str(&word),
        }
        word.clear();
        changed.push(c);
    }
    changed.trim_end().to_owned()
}
