//! Names that follow from the name of a solution.

/// The names that a solution has in Rust.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Names {
    /// The module, in snake case.
    pub module: String,
    /// The type, in camel case.
    pub solution: String,
    /// The type of its parameters.
    pub parameters: String,
}

impl Names {
    /// The names for a valid solution name such as `axis-aligned`.
    #[must_use]
    pub fn of(name: &str) -> Self {
        let solution: String = name
            .split('-')
            .map(|word| {
                let mut letters = word.chars();
                let first = letters.next().map(|c| c.to_ascii_uppercase());
                first.into_iter().chain(letters).collect::<String>()
            })
            .collect();
        let parameters = format!("{solution}Parameters");
        Names { module: name.replace('-', "_"), solution, parameters }
    }
}
