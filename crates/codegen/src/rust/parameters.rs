//! The parameters of a solution in Rust, and how it is made from them.

use super::language::{Translator, float};
use super::{Generator, doc_line, identifier};
use crate::text::{meaning, one_line};
use proc_macro2::{Ident, Literal, TokenStream};
use quote::quote;

impl Generator<'_> {
    pub(super) fn parameter_names(&self) -> Vec<Ident> {
        self.spec.parameters.iter().map(|p| identifier(&p.name)).collect()
    }

    pub(super) fn parameter_items(&self, parameters: &Ident, solution: &str) -> TokenStream {
        let runtime = self.runtime;
        let names = self.parameter_names();
        let docs: Vec<String> = self
            .spec
            .parameters
            .iter()
            .map(|p| {
                let about = meaning(&p.name, &p.description, &p.unit, &p.range);
                format!(" {}.", doc_line(&about))
            })
            .collect();
        let defaults: Vec<TokenStream> =
            self.spec.parameters.iter().map(|p| float(p.default)).collect();
        let summary = format!(" The parameters of [`{solution}`].");
        quote! {
            #[doc = #summary]
            #[derive(Clone, Copy, Debug, PartialEq)]
            #[allow(non_snake_case)]
            pub struct #parameters<T: #runtime::Real> {
                #(#[doc = #docs] pub #names: T,)*
            }

            impl<T: #runtime::Real> Default for #parameters<T> {
                fn default() -> Self {
                    #parameters { #(#names: T::nearest(#defaults),)* }
                }
            }
        }
    }

    pub(super) fn inherent_items(&self, solution: &Ident, parameters: &Ident) -> TokenStream {
        let runtime = self.runtime;
        let spec = self.spec;
        let (name, title, reference) =
            (&spec.name, one_line(&spec.title), one_line(&spec.reference));
        let coordinates = spec.coordinates.name();
        let dimension = Literal::usize_unsuffixed(spec.dimension);
        let specification = &spec.source;
        let entries = spec.parameters.iter().map(|p| {
            let (name, unit) = (&p.name, one_line(&p.unit));
            let range = match &self.code.table {
                None => one_line(&p.range),
                Some(_) => format!("{}, for which the table holds", p.default),
            };
            let description = one_line(&p.description);
            let default = float(p.default);
            quote! {
                #runtime::Parameter {
                    name: #name,
                    default: #default,
                    unit: #unit,
                    admissible: #range,
                    description: #description,
                }
            }
        });
        let names = self.parameter_names();
        let indices: Vec<Literal> = (0..names.len()).map(Literal::usize_unsuffixed).collect();
        let conditions = spec.parameters.iter().map(|p| {
            let bounds = p.bounds.iter().map(|bound| {
                let sign: TokenStream = bound.relation.sign().parse().unwrap_or_default();
                let limit = float(bound.limit);
                quote!(&& value #sign #limit)
            });
            let held = float(p.default);
            let held = self.code.table.as_ref().map(|_| quote!(&& value == #held));
            quote!(value.is_finite() #(#bounds)* #held)
        });

        let translator = Translator::new("parameters", names.clone(), self.runtime, self.blocks);
        let (statements, values) = translator.statements(&self.staged.fixed_stage());
        let (sides, fixed_values) = values.split_at(2 * spec.requirements.len());
        let requirements =
            spec.requirements.iter().zip(sides.chunks(2)).map(|(requirement, side)| {
                let sign: TokenStream = requirement.relation.sign().parse().unwrap_or_default();
                let (left, right, text) = (&side[0], &side[1], one_line(&requirement.text));
                quote! {
                    if !(#left #sign #right) {
                        return Err(Self::DESCRIPTION.requirement_broken(#text, &values));
                    }
                }
            });
        let count = Literal::usize_unsuffixed(names.len());
        let (_, no_table) = self.table_member();
        let table_items = self.table_items();
        quote! {
            #[allow(unused_variables, clippy::all, clippy::pedantic)]
            impl<T: #runtime::Real> #solution<T> {
                /// Name, parameters and source.
                pub const DESCRIPTION: #runtime::Description = #runtime::Description {
                    name: #name,
                    title: #title,
                    reference: #reference,
                    coordinates: #coordinates,
                    dimension: #dimension,
                    parameters: &[#(#entries,)*],
                    specification: #specification,
                };

                /// The solution with the given parameters.
                ///
                /// # Errors
                ///
                /// `ParameterError` for values that are not finite or not admissible.
                pub fn new(parameters: #parameters<T>) -> Result<Self, #runtime::ParameterError> {
                    let values: [f64; #count] = [#(#runtime::Real::to_f64(parameters.#names),)*];
                    #(
                        let value = values[#indices];
                        if !(#conditions) {
                            return Err(Self::DESCRIPTION.out_of_range(#indices, value));
                        }
                    )*
                    #statements
                    #(#requirements)*
                    Ok(#solution { parameters, fixed: [#(#fixed_values,)*], #no_table })
                }

                /// The solution with parameter values in the order of the description; missing ones take their
                /// defaults.
                ///
                /// # Errors
                ///
                /// `ParameterError` for values that are not finite or not admissible.
                pub fn from_values(values: &[f64]) -> Result<Self, #runtime::ParameterError> {
                    let mut parameters = #parameters::<T>::default();
                    #(
                        if let Some(&value) = values.get(#indices) {
                            parameters.#names = T::nearest(value);
                        }
                    )*
                    Self::new(parameters)
                }

                #table_items

                /// The parameters.
                #[must_use]
                pub fn parameters(&self) -> &#parameters<T> {
                    &self.parameters
                }
            }
        }
    }
}
