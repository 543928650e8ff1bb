//! Items of a solution in Rust that the solver asks for: fields, tractions, law, domain and boundaries.

use super::Generator;
use mmsmith_expr::Slot;
use mmsmith_spec::{Around, Boundary, ComponentCondition, Condition, Form, Surface};
use mmsmith_stage::{Measures, Shape, TubeMeasures};
use mmsmith_vocabulary::{
    Across, Components, Element, Flow, Internal, Law, Material, Memory, Overstress, Response,
    Stated, WithMemory,
};
use proc_macro2::{Literal, TokenStream};
use quote::{format_ident, quote};

impl Generator<'_> {
    pub(super) fn solution_items(&self) -> TokenStream {
        let runtime = self.runtime;
        let n = Literal::usize_unsuffixed(self.spec.dimension);
        let vector = self.vector();
        let matrix = quote!(#runtime::nalgebra::SMatrix<T, #n, #n>);
        let mut items = TokenStream::new();
        for field in &self.staged.fields {
            if let Some(of_table) = self.tabulated_field(field.name) {
                items.extend(of_table);
                continue;
            }
            let method = format_ident!("{}", field.name.in_code());
            let block = self.staged.after_parameters(&field.outputs);
            let (statements, values) = self.translator.statements(&block);
            let result = self.shaped(field.name.shape(), &values);
            let result_type = match field.name.shape() {
                Shape::Scalar => quote!(T),
                Shape::Vector => vector.clone(),
                Shape::Matrix => matrix.clone(),
            };
            items.extend(quote! {
                #[inline]
                fn #method(&self, X: &#vector, t: T) -> #result_type {
                    #statements
                    #result
                }
            });
        }
        let (statements, values) = self.translator.statements(&self.staged.all_fields());
        let mut values = values.as_slice();
        let entries: Vec<TokenStream> = self
            .staged
            .fields
            .iter()
            .map(|field| {
                let (own, rest) = values.split_at(field.outputs.len());
                values = rest;
                let letter = format_ident!("{}", field.name.letter());
                let value = if self.code.is_tabulated(field.name) {
                    let method = format_ident!("{}", field.name.in_code());
                    quote!(#runtime::Solution::<T, #n>::#method(self, X, t))
                } else {
                    self.shaped(field.name.shape(), own)
                };
                quote!(#letter: #value)
            })
            .collect();
        items.extend(quote! {
            fn fields(&self, X: &#vector, t: T) -> #runtime::Fields<T, #n> {
                #statements
                #runtime::Fields { #(#entries,)* }
            }
        });

        if let Some(energy) = self.staged.energy {
            let (statements, values) =
                self.translator.statements(&self.staged.after_parameters(&[energy]));
            items.extend(quote! {
                fn strain_energy(&self, X: &#vector, t: T) -> Option<T> {
                    #statements
                    Some(#(#values)*)
                }
            });
        }
        if let Some(stretch) = self.staged.across {
            let (statements, values) =
                self.translator.statements(&self.staged.after_parameters(&[stretch]));
            items.extend(quote! {
                fn stretch_across(&self, X: &#vector, t: T) -> T {
                    #statements
                    #(#values)*
                }
            });
        }
        if self.code.table.is_none() {
            items.extend(self.traction());
        }
        items.extend(self.density_at());
        let constants = &self.staged.constants;
        let [cell_length, density, wave_speed, period] =
            [constants.cell_length, constants.density, constants.wave_speed, constants.period]
                .map(|slot| self.constant(slot));
        let law = self.law();
        let domain = self.domain();
        let boundaries = self.spec.boundaries.iter().map(|b| boundary(runtime, b));
        items.extend(quote! {
            fn domain(&self) -> #runtime::Domain<T, #n> {
                #domain
            }
            fn boundaries(&self) -> &[#runtime::Boundary] {
                &[#(#boundaries,)*]
            }
            fn cell_length(&self) -> T {
                #cell_length
            }
            fn law(&self) -> #runtime::Law<T> {
                #law
            }
            fn density(&self) -> T {
                #density
            }
            fn wave_speed(&self) -> T {
                #wave_speed
            }
            fn period(&self) -> T {
                #period
            }
        });
        items
    }

    fn traction(&self) -> TokenStream {
        let runtime = self.runtime;
        let n = Literal::usize_unsuffixed(self.spec.dimension);
        let vector = quote!(#runtime::nalgebra::SVector<T, #n>);
        let arms = self.staged.tractions.iter().map(|traction| {
            let pattern = surface_value(runtime, traction.surface);
            let (statements, values) =
                self.translator.statements(&self.staged.after_parameters(&traction.outputs));
            quote! {
                #pattern => {
                    #statements
                    Some(#runtime::nalgebra::SVector::<T, #n>::new(#(#values),*))
                }
            }
        });
        quote! {
            fn traction(
                &self,
                surface: #runtime::Surface,
                X: &#vector,
                t: T,
            ) -> Option<#vector> {
                match surface {
                    #(#arms)*
                    _ => None,
                }
            }
        }
    }

    /// A parameter-only scalar as an expression: a number, a parameter or a kept value.
    fn constant(&self, slot: Slot) -> TokenStream {
        let (statements, values) =
            self.translator.statements(&self.staged.after_parameters(&[slot]));
        if statements.is_empty() {
            quote!(#(#values)*)
        } else {
            quote!({ #statements #(#values)* })
        }
    }

    fn law(&self) -> TokenStream {
        let runtime = self.runtime;
        match &self.staged.constants.law {
            Law::Library(material) => {
                let material = self.material(material);
                quote!(#runtime::Law::Library(#material))
            }
            Law::Stated(Stated { response, components, constants, given, internal, across }) => {
                let response = match response {
                    Response::Energy(W) => quote!(Energy(#W.to_owned())),
                    Response::Stress(P) => {
                        let rows = P.iter().map(|row| quote!(vec![#(#row.to_owned()),*]));
                        quote!(Stress(vec![#(#rows),*]))
                    }
                };
                let components = match components {
                    Components::Cartesian => quote!(Cartesian),
                    Components::Curvilinear => quote!(Curvilinear),
                };
                let constants = constants.iter().map(|(name, slot)| {
                    let value = self.constant(*slot);
                    quote!((#name.to_owned(), #value))
                });
                let given =
                    given.iter().map(|(name, text)| quote!((#name.to_owned(), #text.to_owned())));
                let internal = internal.iter().map(|Internal { name, rate, initial }| {
                    quote!(#runtime::Internal {
                        name: #name.to_owned(),
                        rate: #rate.to_owned(),
                        initial: #initial.to_owned(),
                    })
                });
                let across = match across {
                    None => quote!(None),
                    Some(Across { stretch, in_space }) => quote!(Some(#runtime::Across {
                        stretch: #stretch.to_owned(),
                        in_space: #in_space.to_owned(),
                    })),
                };
                quote! {
                    #runtime::Law::Stated(#runtime::Stated {
                        response: #runtime::Response::#response,
                        components: #runtime::Components::#components,
                        constants: vec![#(#constants),*],
                        given: vec![#(#given),*],
                        internal: vec![#(#internal),*],
                        across: #across,
                    })
                }
            }
            Law::WithMemory(WithMemory { elastic, memory }) => {
                let elastic = self.material(elastic);
                let memory = self.memory(memory);
                quote! {
                    #runtime::Law::WithMemory(#runtime::WithMemory {
                        elastic: #elastic,
                        memory: #runtime::Memory::#memory,
                    })
                }
            }
        }
    }

    fn material(&self, material: &Material<Slot>) -> TokenStream {
        let runtime = self.runtime;
        let row = material.row();
        let variant = format_ident!("{}", row.variant);
        let constants = row.constants.iter().zip(material.values());
        let constants = constants.map(|(constant, slot)| {
            let (name, value) = (format_ident!("{}", constant.name), self.constant(slot));
            quote!(#name: #value,)
        });
        let volumetric = material.volumetric().map(|chosen| {
            let chosen = format_ident!("{}", chosen.variant());
            quote!(volumetric: #runtime::Volumetric::#chosen,)
        });
        quote!(#runtime::Material::#variant { #(#constants)* #volumetric })
    }

    fn memory(&self, memory: &Memory<Slot>) -> TokenStream {
        let runtime = self.runtime;
        let constant = |slot: Slot| self.constant(slot);
        match memory {
            Memory::Flow(flow) => {
                let Flow { yield_stress, modulus, exponent, .. } = flow.map(constant);
                let is_on_yield = flow.is_on_yield;
                let overstress = match &flow.overstress {
                    None => quote!(None),
                    Some(overstress) => {
                        let Overstress { drag, exponent, time } = overstress.map(constant);
                        quote!(Some(#runtime::Overstress {
                            drag: #drag,
                            exponent: #exponent,
                            time: #time,
                        }))
                    }
                };
                quote!(Flow(#runtime::Flow {
                    yield_stress: #yield_stress,
                    modulus: #modulus,
                    exponent: #exponent,
                    overstress: #overstress,
                    is_on_yield: #is_on_yield,
                }))
            }
            Memory::Maxwell(elements) => {
                let elements = elements.iter().map(|Element { share, time }| {
                    let (share, time) = (constant(*share), constant(*time));
                    quote!(#runtime::Element { share: #share, time: #time })
                });
                quote!(Maxwell(vec![#(#elements),*]))
            }
        }
    }

    fn domain(&self) -> TokenStream {
        let runtime = self.runtime;
        let constants = |slots: &[Slot]| -> Vec<TokenStream> {
            slots.iter().map(|slot| self.constant(*slot)).collect()
        };
        match &self.staged.constants.domain {
            Measures::Box { lower, upper } => {
                let (lower, upper) = (constants(lower), constants(upper));
                quote! {
                    #runtime::Domain::Box {
                        lower: #runtime::nalgebra::SVector::from([#(#lower),*]),
                        upper: #runtime::nalgebra::SVector::from([#(#upper),*]),
                    }
                }
            }
            Measures::Annulus { inner, outer } => {
                let (inner, outer) = (self.constant(*inner), self.constant(*outer));
                quote!(#runtime::Domain::Annulus { inner: #inner, outer: #outer })
            }
            Measures::Tube(measures) => {
                let TubeMeasures { inner, outer, lower, upper, around } =
                    measures.clone().map(|slot| self.constant(slot));
                let around = match around {
                    Around::Axisymmetric => quote!(Axisymmetric),
                    Around::Whole => quote!(Whole),
                    Around::Sector { from, to } => quote!(Sector { from: #from, to: #to }),
                };
                quote! {
                    #runtime::Domain::Tube {
                        inner: #inner,
                        outer: #outer,
                        lower: #lower,
                        upper: #upper,
                        around: #runtime::Around::#around,
                    }
                }
            }
        }
    }
}

fn boundary(runtime: &TokenStream, boundary: &Boundary) -> TokenStream {
    let surface = surface_value(runtime, boundary.surface);
    let one = |condition: ComponentCondition| {
        let name = match condition {
            ComponentCondition::PrescribedMotion => quote!(PrescribedMotion),
            ComponentCondition::PrescribedTraction => quote!(PrescribedTraction),
            ComponentCondition::TractionFree => quote!(TractionFree),
        };
        quote!(#runtime::ComponentCondition::#name)
    };
    // A constant, so that the list of conditions is one.
    let condition = match boundary.condition {
        Condition::Sliding => quote!(#runtime::Condition::Sliding),
        Condition::Symmetry => quote!(#runtime::Condition::Symmetry),
        Condition::TractionFree => quote!(#runtime::Condition::TractionFree),
        Condition::PrescribedTraction => quote!(#runtime::Condition::PrescribedTraction),
        Condition::PrescribedMotion => quote!(#runtime::Condition::PrescribedMotion),
        Condition::Mixed(mixed) => match mixed.form() {
            Form::ByDirection { normal, tangential } => {
                let (normal, tangential) = (one(normal), one(tangential));
                quote!(const { #runtime::Condition::by_direction(#normal, #tangential) })
            }
            Form::ByComponent(of) => {
                let axis = Literal::usize_unsuffixed(boundary.surface.axis().unwrap_or(0));
                let of = of.map(one);
                quote!(const { #runtime::Condition::by_component(#axis, 3, [#(#of),*]) })
            }
        },
    };
    quote! {
        #runtime::Boundary {
            surface: #surface,
            condition: #condition,
        }
    }
}

/// A surface as an expression, and as a pattern.
fn surface_value(runtime: &TokenStream, surface: Surface) -> TokenStream {
    match surface {
        Surface::Lower(axis) => {
            let axis = Literal::usize_unsuffixed(axis);
            quote!(#runtime::Surface::Lower(#axis))
        }
        Surface::Upper(axis) => {
            let axis = Literal::usize_unsuffixed(axis);
            quote!(#runtime::Surface::Upper(#axis))
        }
        Surface::Inner => quote!(#runtime::Surface::Inner),
        Surface::Outer => quote!(#runtime::Surface::Outer),
        Surface::FirstAngle => quote!(#runtime::Surface::FirstAngle),
        Surface::LastAngle => quote!(#runtime::Surface::LastAngle),
    }
}
