//! A solution in Rust: its items, and the files that hold them.

mod language;
mod parameters;
mod solution;
mod stages;
mod tabulated;

use self::language::{Translator, fill};
use crate::code::Code;
use crate::names::Names;
use crate::text::one_line;
use mmsmith_spec::{DeriveError, Spec};
use mmsmith_stage::{Shape, Staged};
use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::{format_ident, quote};
use std::cell::RefCell;

/// The items of a solution; `runtime` is the path to the crate `mmsmith_runtime`, or to a crate that has all its items.
///
/// # Errors
///
/// [`DeriveError`] where a field is nowhere defined.
pub fn items(spec: &Spec, runtime: &TokenStream) -> Result<TokenStream, DeriveError> {
    Ok(Code::new(spec)?.items(runtime))
}

impl Code<'_> {
    /// The items of the solution in Rust; `runtime` is the path to the crate `mmsmith_runtime`, or to a crate that has all its items.
    #[must_use]
    pub fn items(&self, runtime: &TokenStream) -> TokenStream {
        self.items_with(runtime, None)
    }

    fn items_with(
        &self,
        runtime: &TokenStream,
        blocks: Option<&RefCell<Vec<String>>>,
    ) -> TokenStream {
        let names = self.spec.parameters.iter().map(|p| identifier(&p.name)).collect();
        let translator = Translator::new("self.parameters", names, runtime, blocks);
        Generator { code: self, staged: &self.staged, spec: self.spec, runtime, translator, blocks }
            .items()
    }

    /// The text of the solution's module within the crate of the solutions.
    #[must_use]
    pub fn module_source(&self) -> String {
        self.source_with(&quote!(crate), &[])
    }

    /// The text of a module for any crate that depends on `mmsmith-runtime`.
    #[must_use]
    pub fn standalone_source(&self) -> String {
        let needs = "The crate that has this module depends on `mmsmith-runtime`.";
        self.source_with(&quote!(::mmsmith_runtime), &[needs])
    }

    fn source_with(&self, runtime: &TokenStream, remarks: &[&str]) -> String {
        let head = self.head();
        let lines = head.iter().map(String::as_str).chain(remarks.iter().copied());
        let header: String = lines.map(|line| format!("//! {}\n", one_line(line))).collect();
        let blocks = RefCell::default();
        let text = pretty(self.items_with(runtime, Some(&blocks)));
        header + "\n" + &fill(&text, &blocks.into_inner())
    }
}

/// Tokens as formatted text. What this crate generates always parses; if it did not, the raw tokens tell why.
pub(crate) fn pretty(items: TokenStream) -> String {
    match syn::parse2::<syn::File>(items.clone()) {
        Ok(file) => prettyplease::unparse(&file),
        Err(_) => items.to_string(),
    }
}

struct Generator<'a> {
    code: &'a Code<'a>,
    staged: &'a Staged,
    spec: &'a Spec,
    runtime: &'a TokenStream,
    /// The translator for functions of the solution itself.
    translator: Translator<'a>,
    /// The blocks behind placeholders, as in [`Translator`].
    blocks: Option<&'a RefCell<Vec<String>>>,
}

impl Generator<'_> {
    fn items(&self) -> TokenStream {
        let names = Names::of(&self.spec.name);
        let solution = format_ident!("{}", names.solution);
        let parameters = format_ident!("{}", names.parameters);
        let runtime = self.runtime;

        let parameter_items = self.parameter_items(&parameters, &names.solution);
        let inherent = self.inherent_items(&solution, &parameters);
        let mut solution_items = self.solution_items();
        if self.code.table.is_some() {
            solution_items.extend(self.tabulated_items());
            return self.all_items(
                &names,
                [parameter_items, inherent, solution_items],
                &TokenStream::new(),
            );
        }
        let (body_force, time, point) = self.body_force_stages();
        let (state, state_time, velocity_time, state_point) = self.state_stages();
        let dimension = Literal::usize_unsuffixed(self.spec.dimension);
        let (on_lattice, lattice_items) = self.body_force_on_lattice(&solution).unzip();
        let lattice =
            format_ident!("{}", if on_lattice.is_some() { "lattice" } else { "_lattice" });
        if on_lattice.is_some() {
            solution_items.extend(quote! {
                fn has_form_on_lattice(&self) -> bool {
                    true
                }
            });
        }
        solution_items.extend(quote! {
            fn body_force_on(
                &self,
                X: &[#runtime::nalgebra::SVector<T, #dimension>],
                #lattice: ::std::option::Option<#runtime::Lattice<T, #dimension>>,
            ) -> ::std::boxed::Box<dyn #runtime::BodyForceAtPoints<T, #dimension> + '_> {
                #on_lattice
                ::std::boxed::Box::new(#runtime::StagedPoints::<Self, T, #time, #point>::new(*self, X))
            }
            fn state_at(
                &self,
                X: &[#runtime::nalgebra::SVector<T, #dimension>],
            ) -> ::std::boxed::Box<dyn #runtime::StateAtPoints<T, #dimension> + '_> {
                ::std::boxed::Box::new(
                    #runtime::StagedStates::<Self, T, #state_time, #velocity_time, #state_point>::new(*self, X),
                )
            }
        });
        let stages = quote! {
            #[allow(unused_variables, clippy::all, clippy::pedantic)]
            impl<T: #runtime::Real> #runtime::BodyForceStages<T, #dimension, #time, #point> for #solution<T> {
                #body_force
            }

            #lattice_items

            #[allow(unused_variables, clippy::all, clippy::pedantic)]
            impl<T: #runtime::Real>
                #runtime::StateStages<T, #dimension, #state_time, #velocity_time, #state_point> for #solution<T>
            {
                #state
            }
        };
        self.all_items(&names, [parameter_items, inherent, solution_items], &stages)
    }

    /// The items of the file around those of stages, which solutions with a table do not have.
    fn all_items(
        &self,
        names: &Names,
        [parameter_items, inherent, solution_items]: [TokenStream; 3],
        stages: &TokenStream,
    ) -> TokenStream {
        let runtime = self.runtime;
        let solution = format_ident!("{}", names.solution);
        let parameters = format_ident!("{}", names.parameters);
        let dimension = Literal::usize_unsuffixed(self.spec.dimension);
        let (table, _) = self.table_member();
        let count = Literal::usize_unsuffixed(self.staged.fixed_count());
        let variant =
            format_ident!("{}", ["One", "Two", "Three"][self.spec.dimension.clamp(1, 3) - 1]);
        let title = doc_line(&self.spec.title);
        let reference = doc_line(&self.spec.reference);
        let summary = format!(" {title}.");
        let source =
            if reference.is_empty() { String::new() } else { format!(" Source: {reference}.") };
        let formulas: Vec<String> = ["```text".to_owned()]
            .into_iter()
            .chain(self.code.formulas())
            .chain(["```".to_owned()])
            .map(|line| format!(" {line}"))
            .collect();
        quote! {
            #parameter_items

            #[doc = #summary]
            #[doc = ""]
            #(#[doc = #formulas])*
            #[doc = ""]
            #[doc = #source]
            #[derive(Clone, Copy, Debug, PartialEq)]
            pub struct #solution<T: #runtime::Real> {
                parameters: #parameters<T>,
                /// What depends on the parameters only.
                fixed: [T; #count],
                #table
            }

            #inherent

            #[allow(unused_variables, clippy::all, clippy::pedantic)]
            impl<T: #runtime::Real> #runtime::Solution<T, #dimension> for #solution<T> {
                #solution_items
            }

            #stages

            impl<T: #runtime::Real> From<#solution<T>> for #runtime::AnySolution<T> {
                fn from(solution: #solution<T>) -> Self {
                    #runtime::AnySolution::#variant(::std::boxed::Box::new(solution))
                }
            }
        }
    }

    /// The type of vectors.
    pub(super) fn vector(&self) -> TokenStream {
        let runtime = self.runtime;
        let n = Literal::usize_unsuffixed(self.spec.dimension);
        quote!(#runtime::nalgebra::SVector<T, #n>)
    }

    /// Values as a scalar, a vector or a matrix.
    pub(super) fn shaped(&self, shape: Shape, values: &[TokenStream]) -> TokenStream {
        let runtime = self.runtime;
        let n = Literal::usize_unsuffixed(self.spec.dimension);
        match shape {
            Shape::Scalar => quote!(#(#values)*),
            Shape::Vector => quote!(#runtime::nalgebra::SVector::<T, #n>::new(#(#values),*)),
            Shape::Matrix => quote!(#runtime::nalgebra::SMatrix::<T, #n, #n>::new(#(#values),*)),
        }
    }
}

/// A parameter name as an identifier; names that are Rust keywords become raw identifiers. (Specifications refuse the
/// words that cannot be raw, as `self`.)
fn identifier(name: &str) -> Ident {
    // `gen` is reserved since edition 2024, which the parser does not know.
    if name == "gen" || syn::parse_str::<Ident>(name).is_err() {
        Ident::new_raw(name, Span::call_site())
    } else {
        Ident::new(name, Span::call_site())
    }
}

/// Text from a specification for a doc comment: one line, no link or markup syntax.
fn doc_line(text: &str) -> String {
    one_line(text)
        .chars()
        .map(|c| match c {
            '[' => '(',
            ']' => ')',
            '<' => '\u{2039}',
            '`' => '\'',
            c => c,
        })
        .collect()
}
