//! Laws of the library that a specification changes: by what holds along the directions that the dimension leaves out, by another
//! energy of a change of volume, and by a stress at the start.
//!
//! With no stress across, the stretch across follows from `P_zz = 0`, and the energy of the plane is the energy in space at this stretch:
//! its derivative is the stress of the plane, since the energy in space does not change with the stretch across there. Linear
//! elasticity and the laws of St. Venant, Kirchhoff and Hencky keep their form, with another first Lame constant. The neo-Hookean law
//! becomes `mu/2 (I1 - 3) + V(J)` with `V' = -mu F_zz^2/J`; `V` is written so that nothing cancels next to incompressibility.

use crate::Diagnostic;
use crate::document::{Document, MaterialTable, PrestressEntry, Text};
use crate::law::energy::{component_names, named};
use crate::law::{energy_in_space_without_shear_across, energy_text};
use crate::solver_law::replaced;
use crate::spec::{Law, Reader};
use crate::tensor::Matrix;
use mmsmith_expr::{Expr, Graph};
use mmsmith_vocabulary::{Across, Constant, Material, Volumetric};
use toml::Spanned;

/// A law of the library as a specification changes it.
#[derive(Clone, Debug)]
pub struct Variation {
    /// The name of the law.
    pub law: &'static str,
    /// The assumption on the directions left out, where it is not that nothing stretches along them.
    pub assumption: Option<&'static str>,
    /// The energy, in the names of `constants` and the measures of the deformation.
    pub(crate) energy: String,
    /// The constants of the law in space, and what else the energy uses.
    pub constants: Vec<(&'static Constant, Expr)>,
    /// The stretch across, and the law in space, where there is no stress across.
    pub(crate) across: Option<Across>,
    /// The law in lines for people.
    pub(crate) lines: Vec<String>,
}

impl Variation {
    /// The law and its constants in lines for people.
    pub(crate) fn formulas(&self, graph: &Graph) -> Vec<String> {
        let assumed = self.assumption.map(|assumption| {
            let across = if assumption == "plane stress" {
                "P_zz = 0: the thickness changes by F_zz"
            } else {
                "P_yy = P_zz = 0: the width changes by F_yy = F_zz"
            };
            format!("{assumption}, {across}")
        });
        let constants = self.constants.iter();
        let values = constants
            .map(|(constant, value)| format!("{} = {}", constant.name, graph.print(*value)));
        assumed.into_iter().chain(self.lines.iter().cloned()).chain(values).collect()
    }
}

/// Assumptions on the directions that the dimension leaves out.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Assumption {
    /// Nothing stretches along them.
    Strain,
    /// There is no stress along them.
    Stress,
}

impl Assumption {
    /// Each by its name in this dimension.
    fn names(dimension: usize) -> [(&'static str, Self); 2] {
        match dimension {
            1 => [("uniaxial-strain", Self::Strain), ("uniaxial-stress", Self::Stress)],
            _ => [("plane-strain", Self::Strain), ("plane-stress", Self::Stress)],
        }
    }
}

/// The first Lame constant with which a law has the stress of the plane, or of the line.
const FREE: Constant = Constant {
    name: "lambda_free",
    meaning: "first Lame constant with no stress across",
    usual: "",
};

/// Laws that close where there is no stress across.
const CLOSED: &str = "'linear-elastic', 'st-venant-kirchhoff', 'hencky', and 'neo-hookean' with volumetric = 'mixed' or 'quadratic'";

impl Reader<'_> {
    /// The line that states an assumption, for keys and values by which others state it.
    pub(crate) fn meant_assumption(&self, key: &str, value: &str) -> Option<String> {
        let key = key.to_ascii_lowercase().replace('_', "-");
        let value = value.to_ascii_lowercase();
        let is_key = matches!(
            key.as_str(),
            "plane"
                | "plane-stress"
                | "plane-strain"
                | "stress-state"
                | "thickness"
                | "uniaxial"
                | "hypothesis"
                | "section"
        );
        let is_strain = key.contains("strain") || value.contains("strain");
        let wanted = if is_strain { Assumption::Strain } else { Assumption::Stress };
        let names = Assumption::names(self.dimension);
        let (name, _) = names.iter().find(|(_, assumption)| *assumption == wanted)?;
        (is_key && self.dimension < 3).then(|| format!("write assumption = '{name}' here"))
    }

    /// The law that specifications make of one of the library, and what it is in words.
    pub(crate) fn variation(
        &mut self,
        document: &Document,
        law: &Law,
    ) -> Result<Option<(Law, Variation)>, Diagnostic> {
        let table = document.material.get_ref();
        let assumption = self.assumption(table, law)?;
        let (Some(material), is_free) = (of_library(law), assumption.is_some()) else {
            return Ok(None);
        };
        let chosen = match (&table.volumetric, material) {
            (Some(word), Material::NeoHookean { .. }) => {
                self.choice(word, "volumetric part", Volumetric::NAMES)?
            }
            _ => Volumetric::default(),
        };
        if !is_free && chosen == Volumetric::default() {
            return Ok(None);
        }
        let span = assumption.or(table.volumetric.as_ref()).map_or(0..0, Spanned::span);
        self.refuse_memory_beside(table, "a changed law", &span)?;
        if is_free {
            self.refuse_fields(law, &span)?;
        }
        let assumption = match (is_free, self.dimension) {
            (false, _) => None,
            (true, 1) => Some("uniaxial stress"),
            (true, _) => Some("plane stress"),
        };
        let n = self.dimension;
        match material {
            Material::NeoHookean { .. } => {
                let Some(neo_hookean) = NeoHookean::new(n, is_free, chosen) else {
                    let message = "the neo-Hookean law with (ln J)^2 has no closed form without stress across: the stretch there solves \
                                   mu (F_zz^2 - 1) + lambda ln(J F_zz) = 0";
                    let help = "write volumetric = 'mixed', or 'quadratic', which close and agree with it at small strain";
                    return Err(self.scope.source.error(message, span, Some(help.into())));
                };
                let constants = law.constants();
                let W = named(&mut self.scope.graph, &neo_hookean.energy, &constants);
                let variation = Variation {
                    law: law.name(),
                    assumption,
                    energy: neo_hookean.energy,
                    constants,
                    across: neo_hookean.across,
                    lines: neo_hookean.lines,
                };
                Ok(Some((Law::Energy { W }, variation)))
            }
            Material::LinearElastic { lambda, mu }
            | Material::StVenantKirchhoff { lambda, mu }
            | Material::Hencky { lambda, mu } => {
                let free = self.free_lambda(document, [lambda, mu])?;
                let material =
                    material.map_named(|name, value| if name == "lambda" { free } else { value });
                let mut constants = law.constants();
                constants.push((&FREE, free));
                let variation = Variation {
                    law: law.name(),
                    assumption,
                    energy: with_free(&energy_text(&material, n)),
                    constants,
                    across: Some(Across {
                        stretch: with_free(&stretch(&material, n)),
                        in_space: energy_in_space_without_shear_across(&material, n),
                    }),
                    lines: vec![
                        material.row().formula.replace("lambda", FREE.name),
                        format!("F_zz = {}", with_free(&stretch(&material, n))),
                    ],
                };
                Ok(Some((Law::Library(material), variation)))
            }
            _ => {
                let message =
                    format!("the law '{}' has no closed form without stress across", law.name());
                let help = format!("laws that close: {CLOSED}");
                Err(self.scope.source.error(message, span, Some(help)))
            }
        }
    }

    /// The assumption that there is no stress across, where it is made.
    fn assumption<'t>(
        &self,
        table: &'t MaterialTable,
        law: &Law,
    ) -> Result<Option<&'t Spanned<String>>, Diagnostic> {
        let Some(word) = &table.assumption else { return Ok(None) };
        let refuse = |message: String, help: String| {
            Err(self.scope.source.error(message, word.span(), Some(help)))
        };
        if self.dimension == 3 {
            return refuse(
                "a body in space has no direction of which something could be assumed".into(),
                "leave this line out".into(),
            );
        }
        let names = Assumption::names(self.dimension);
        if self.choice(word, "assumption", names)? == Assumption::Strain {
            return Ok(None);
        }
        if of_library(law).is_none() {
            return refuse(
                format!("of the law '{}' the stretch across is not known", law.name()),
                format!(
                    "leave this line out and state the law of the {} itself, with the stretch across put in; laws of the library that \
                     close: {CLOSED}",
                    if self.dimension == 1 { "line" } else { "plane" }
                ),
            );
        }
        Ok(Some(word))
    }

    fn refuse_memory_beside(
        &self,
        table: &MaterialTable,
        what: &str,
        span: &std::ops::Range<usize>,
    ) -> Result<(), Diagnostic> {
        if table.flow.is_none() && table.maxwell.is_empty() {
            return Ok(());
        }
        let message = format!("{what} is elastic, and this material flows or has Maxwell elements");
        let help = "leave this line out, or [material.flow] and [[material.maxwell]]";
        Err(self.scope.source.error(message, span.clone(), Some(help.into())))
    }

    fn refuse_fields(&self, law: &Law, span: &std::ops::Range<usize>) -> Result<(), Diagnostic> {
        let constants = law.constants();
        let Some((constant, _)) = constants.iter().find(|(_, value)| self.scope.is_field(*value))
        else {
            return Ok(());
        };
        let message = format!(
            "without stress across the constants are the same everywhere, and '{}' depends on the place or the time",
            constant.name
        );
        let help =
            "write it in parameters alone, or state the energy of the plane with law = 'energy'";
        Err(self.scope.source.error(message, span.clone(), Some(help.into())))
    }

    /// `2 lambda mu/(lambda + 2 mu)` in the plane, `lambda mu/(lambda + mu)` along a line: in Young's modulus and Poisson's ratio where
    /// both constants follow from these.
    fn free_lambda(
        &mut self,
        document: &Document,
        [lambda, mu]: [Expr; 2],
    ) -> Result<Expr, Diagnostic> {
        let table = document.material.get_ref();
        if ["lambda", "mu"].iter().all(|name| table.constants.get(name).is_none()) {
            let mut local = Vec::new();
            for name in ["E", "nu"] {
                if let Some(text) = table.constants.get(name) {
                    local.push((name.to_owned(), self.scope.constant_of_law(text, name)?));
                }
            }
            let usual = if self.dimension == 1 { "E*nu/(1 + nu)" } else { "E*nu/(1 - nu^2)" };
            let span = document.material.span();
            return self.scope.with_names(&local, |scope| scope.usual(usual, "lambda", span));
        }
        let factor = if self.dimension == 1 { 1 } else { 2 };
        let graph = &mut self.scope.graph;
        let factor = graph.integer(factor);
        let times_mu = graph.mul(factor, mu);
        let upper = graph.mul(times_mu, lambda);
        let lower = graph.add(lambda, times_mu);
        Ok(graph.div(upper, lower))
    }

    /// The second Piola-Kirchhoff stress of the undeformed body.
    pub(crate) fn prestress(
        &mut self,
        document: &Document,
        law: &Law,
    ) -> Result<Option<Matrix>, Diagnostic> {
        let table = document.material.get_ref();
        let Some(entry) = &table.prestress else { return Ok(None) };
        let keys = component_names("", self.dimension);
        let listed = |value: &str| {
            let entries: Vec<String> =
                keys.iter().enumerate().map(|(i, row)| format!("{} = '{value}'", row[i])).collect();
            format!("prestress = {{ {} }}", entries.join(", "))
        };
        self.refuse_memory_beside(table, "a body with a stress at the start", &entry.span())?;
        if let Law::Stress { .. } = law {
            let message =
                "the law 'stress' states the whole stress, and with it the one at the start";
            let help =
                "leave prestress out and add F S0 to P: to 11 in the plane F11*S11 + F12*S12";
            return Err(self.scope.source.error(message, entry.span(), Some(help.into())));
        }
        let entries = match entry.get_ref() {
            PrestressEntry::Components(entries) => entries,
            PrestressEntry::Bare(value) => {
                let message = "a stress at the start is given by its components";
                let help = format!(
                    "{}, for one that is the same in all directions; 12 = '...' is a shear stress",
                    listed(value)
                );
                return Err(self.scope.source.error(message, entry.span(), Some(help)));
            }
        };
        let n = self.dimension;
        let mut S = vec![vec![Graph::ZERO; n]; n];
        for (key, text) in &entries.0 {
            let (i, j) = self.place_in_symmetric(key, text, &keys)?;
            S[i][j] = self.scope.constant(text, "a stress at the start")?;
            S[j][i] = S[i][j];
        }
        Ok(Some(S))
    }

    /// The place of a component in the upper triangle.
    fn place_in_symmetric(
        &self,
        key: &Spanned<String>,
        text: &Text,
        keys: &[Vec<String>],
    ) -> Result<(usize, usize), Diagnostic> {
        let of = |name: &str| {
            keys.iter()
                .enumerate()
                .find_map(|(i, row)| Some((i, row.iter().position(|key| key == name)?)))
        };
        let name = key.get_ref().as_str();
        let upper: Vec<String> =
            keys.iter().enumerate().flat_map(|(i, row)| row[i..].to_vec()).collect();
        let refuse = |message: String, help: String| {
            Err(self.scope.source.error(message, key.span(), Some(help)))
        };
        match of(name) {
            Some((i, j)) if i <= j => Ok((i, j)),
            Some((i, j)) => refuse(
                format!("the stress at the start is symmetric, and '{name}' is '{}'", keys[j][i]),
                format!("write {} = '{}' once", keys[j][i], text.value),
            ),
            None => {
                let digits: String = name
                    .chars()
                    .filter_map(|c| match c.to_ascii_uppercase() {
                        'X' | 'R' => Some('1'),
                        'Y' => Some('2'),
                        'Z' => Some('3'),
                        _ => None,
                    })
                    .collect();
                let listed = format!("the components are {}", upper.join(", "));
                let help = match of(&digits) {
                    Some(_) => format!("write {digits} = '{}'; {listed}", text.value),
                    None => listed,
                };
                refuse(format!("there is no stress component '{name}'"), help)
            }
        }
    }
}

fn of_library(law: &Law) -> Option<Material<Expr>> {
    match law {
        Law::Library(material) => Some(*material),
        Law::Energy { .. } | Law::Stress { .. } => None,
    }
}

/// A text in the constant of the plane in the place of that in space.
fn with_free(text: &str) -> String {
    replaced(text, |word| (word == "lambda").then(|| FREE.name.to_owned()))
}

/// The stretch across of a law that keeps its form, in its own constants: `lambda/(2 mu)` is `lambda/(lambda + 2 mu)` of the constants
/// in space for a plane, and Poisson's ratio for a line.
fn stretch(material: &Material<Expr>, dimension: usize) -> String {
    let sum = |letter: &str| {
        let entries: Vec<String> = (1..=dimension).map(|i| format!("{letter}{i}{i}")).collect();
        format!("({} - {dimension})", entries.join(" + "))
    };
    match material {
        Material::LinearElastic { .. } => format!("1 - lambda/(2*mu)*{}", sum("F")),
        Material::StVenantKirchhoff { .. } => format!("sqrt(1 - lambda/(2*mu)*{})", sum("C")),
        _ => "exp(-lambda/(2*mu)*ln(J))".to_owned(),
    }
}

/// The neo-Hookean law with another energy of volume, or without stress across.
struct NeoHookean {
    energy: String,
    across: Option<Across>,
    lines: Vec<String>,
}

impl NeoHookean {
    /// None where there is no closed form.
    fn new(dimension: usize, is_free: bool, volumetric: Volumetric) -> Option<Self> {
        let in_space = format!("mu/2*(I1 - 3 - 2*ln(J)) + lambda*({})", volumetric.formula());
        let formula = format!("W = {in_space}");
        if !is_free {
            return Some(Self { energy: in_space, across: None, lines: vec![formula] });
        }
        let Closed { strain, volume, stretch, names } = Closed::of(dimension, volumetric)?;
        let mut lines = vec![
            format!("in space {formula}"),
            format!("W = mu/2*({strain}){volume}, F_zz = {stretch}"),
        ];
        let (mut energy, mut stretch) = (format!("mu/2*({strain}){volume}"), stretch.to_owned());
        for (name, text) in names.iter().rev() {
            lines.insert(2, format!("{name} = {text}"));
            let put_in = |text_with: &str| {
                replaced(text_with, |word| (word == *name).then(|| format!("({text})")))
            };
            (energy, stretch) = (put_in(&energy), put_in(&stretch));
        }
        Some(Self { energy, across: Some(Across { stretch, in_space }), lines })
    }
}

/// The energy without stress across: a part in the strain and one in the ratio of areas, or of lengths, `J`.
struct Closed {
    strain: &'static str,
    volume: &'static str,
    stretch: &'static str,
    /// Names in the texts, each with its meaning in names before it and in constants.
    names: &'static [(&'static str, &'static str)],
}

impl Closed {
    /// The stretch is the root next to one of `P_zz = 0`, which is quadratic: in the plane in `F_zz^2` or in the ratio of volumes `theta`,
    /// along a line in the latter. With this ratio `V = integral of -mu F_zz^2/J` is elementary.
    fn of(dimension: usize, volumetric: Volumetric) -> Option<Self> {
        match (dimension, volumetric) {
            (_, Volumetric::Logarithmic) => None,
            (1, Volumetric::Mixed) => Some(Self {
                strain: "J^2 - 1",
                volume: " - (2*mu + lambda)/4*ln(1 + w) - lambda/4*w",
                stretch: "sqrt(1 - lambda/(2*mu)*w)",
                names: &[
                    ("g", "mu/(lambda + mu)"),
                    ("c", "lambda/(lambda + mu)"),
                    ("p", "J^2 - 1"),
                    ("w", "2*g*p/(1 + c*p + sqrt(1 + c*(1 + g)*p))"),
                ],
            }),
            (1, Volumetric::Quadratic) => Some(Self {
                strain: "J^2 - 1",
                volume: " - mu*ln(1 + w) - lambda*(w + w^2/2)",
                stretch: "sqrt(1 - lambda/mu*w*(1 + w))",
                names: &[
                    ("g", "mu/(lambda + mu)"),
                    ("c", "lambda/(lambda + mu)"),
                    ("h", "J - 1"),
                    ("w", "2*g*h/(1 + c*h + sqrt((1 + c*h)^2 + 4*c*g*h*(1 + h)))"),
                ],
            }),
            (_, Volumetric::Mixed) => Some(Self {
                strain: "I1 - 3",
                volume: " + (2*mu + lambda)/4*ln(1 - 2*g*q)",
                stretch: "sqrt((2*mu + lambda)/(2*mu + lambda*J^2))",
                names: &[("g", "mu/(lambda + 2*mu)"), ("q", "(J^2 - 1)/J^2")],
            }),
            (_, Volumetric::Quadratic) => Some(Self {
                strain: "I1 - 3",
                volume: " - mu*ln(1 + w) - lambda/2*w",
                stretch: "(1 + w)/J",
                names: &[
                    ("g", "mu/(lambda + 2*mu)"),
                    ("q", "(J^2 - 1)/J^2"),
                    ("w", "2*g*q/(1 - 2*g*q + sqrt(1 - 4*g^2*q))"),
                ],
            }),
        }
    }
}
