//! Functions in Rust whose values come from the table of the fields that follow from histories.

use super::Generator;
use mmsmith_stage::FieldName;
use proc_macro2::{Literal, TokenStream};
use quote::{format_ident, quote};

impl Generator<'_> {
    /// The field of the solution that holds its table: a type, and the value before there is one.
    pub(super) fn table_member(&self) -> (TokenStream, TokenStream) {
        if self.code.table.is_none() {
            return (TokenStream::new(), TokenStream::new());
        }
        let runtime = self.runtime;
        let dimension = Literal::usize_unsuffixed(self.spec.dimension);
        let member = quote! {
            /// The table of the fields that follow from histories.
            table: ::std::option::Option<&'static #runtime::HistoryTable<#dimension>>,
        };
        (member, quote!(table: ::std::option::Option::None,))
    }

    /// The function that reads the table, and the one that gives it.
    pub(super) fn table_items(&self) -> TokenStream {
        let Some(table) = &self.code.table else { return TokenStream::new() };
        let runtime = self.runtime;
        let dimension = Literal::usize_unsuffixed(self.spec.dimension);
        let digest = &table.digest;
        let about = format!(
            " With the table `{}`, which stays in memory until the program ends; without it stresses and forces are not numbers.",
            self.code.table_file()
        );
        quote! {
            #[doc = #about]
            ///
            /// # Errors
            ///
            /// `TableError` where the file cannot be read, or is another table.
            pub fn with_table(
                mut self,
                path: impl ::std::convert::AsRef<::std::path::Path>,
            ) -> Result<Self, #runtime::TableError> {
                let table = #runtime::HistoryTable::read(path.as_ref(), #digest)?;
                self.table = ::std::option::Option::Some(::std::boxed::Box::leak(::std::boxed::Box::new(table)));
                Ok(self)
            }

            /// The fields at a position as series in time; none without a table, or at points that it does not have.
            #[must_use]
            pub fn series(&self, X: &[f64; #dimension]) -> ::std::option::Option<#runtime::PointSeries<#dimension>> {
                self.table?.series(X)
            }
        }
    }

    /// A field of the trait that the table has; nothing for other fields.
    pub(super) fn tabulated_field(&self, field: FieldName) -> Option<TokenStream> {
        if !self.code.is_tabulated(field) {
            return None;
        }
        let runtime = self.runtime;
        let n = Literal::usize_unsuffixed(self.spec.dimension);
        let (method, kind, of_series) = match field {
            FieldName::BodyForce => ("body_force", quote!(SVector<T, #n>), "body_force"),
            _ => ("first_piola_kirchhoff", quote!(SMatrix<T, #n, #n>), "stress"),
        };
        let (method, of_series) = (format_ident!("{method}"), format_ident!("{of_series}"));
        Some(quote! {
            fn #method(&self, X: &#runtime::nalgebra::SVector<T, #n>, t: T) -> #runtime::nalgebra::#kind {
                let place: [f64; #n] = ::std::array::from_fn(|i| X[i].to_f64());
                match self.series(&place) {
                    Some(series) => series.#of_series(t),
                    None => <#runtime::nalgebra::#kind>::repeat(T::nearest(f64::NAN)),
                }
            }
        })
    }

    /// The functions of the trait for internal variables, and for many points.
    pub(super) fn tabulated_items(&self) -> TokenStream {
        let Some(table) = &self.code.table else { return TokenStream::new() };
        let runtime = self.runtime;
        let n = Literal::usize_unsuffixed(self.spec.dimension);
        let (names, count) = (&table.variables, Literal::usize_unsuffixed(table.variables.len()));
        quote! {
            fn internal_variables(&self) -> ::std::vec::Vec<String> {
                vec![#(#names.to_owned()),*]
            }
            fn internal(&self, X: &#runtime::nalgebra::SVector<T, #n>, t: T) -> ::std::vec::Vec<T> {
                let place: [f64; #n] = ::std::array::from_fn(|i| X[i].to_f64());
                match self.series(&place) {
                    Some(series) => series.internal(t),
                    None => vec![T::nearest(f64::NAN); #count],
                }
            }
            fn body_force_on(
                &self,
                X: &[#runtime::nalgebra::SVector<T, #n>],
                _lattice: ::std::option::Option<#runtime::Lattice<T, #n>>,
            ) -> ::std::boxed::Box<dyn #runtime::BodyForceAtPoints<T, #n> + '_> {
                ::std::boxed::Box::new(#runtime::TabulatedPoints::new(self.table, X))
            }
        }
    }

    /// The density at a place, where it depends on it.
    pub(super) fn density_at(&self) -> TokenStream {
        let Some(density) = self.staged.density_here else { return TokenStream::new() };
        let vector = self.vector();
        let (statements, values) =
            self.translator.statements(&self.staged.after_parameters(&[density]));
        quote! {
            fn density_at(&self, X: &#vector) -> T {
                #statements
                #(#values)*
            }
        }
    }
}
