//! The items of one solution, and the files that hold them.

use crate::code::Code;
use crate::function::{Translator, fill, float};
use crate::names::Names;
use crate::text::{meaning, one_line};
use mmsmith_expr::Slot;
use mmsmith_spec::{Boundary, Condition, DeriveError, Spec, Surface};
use mmsmith_stage::{Block, Measures, Shape, Staged, Stages};
use mmsmith_vocabulary::{Components, Law, Response, Stated};
use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::{format_ident, quote};
use std::cell::RefCell;

/// The items of a solution; `runtime` is the path to the crate `mmsmith_runtime`, or to one that has all of it.
///
/// # Errors
///
/// [`DeriveError`] where a field is nowhere defined.
pub fn items(spec: &Spec, runtime: &TokenStream) -> Result<TokenStream, DeriveError> {
    Ok(Code::new(spec)?.items(runtime))
}

impl Code<'_> {
    /// The items of the solution in Rust; `runtime` is the path to the crate `mmsmith_runtime`, or to one that has all of it.
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
    /// For functions of the solution itself.
    translator: Translator<'a>,
    /// As in [`Translator`].
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
            }

            #inherent

            #[allow(unused_variables, clippy::all, clippy::pedantic)]
            impl<T: #runtime::Real> #runtime::Solution<T, #dimension> for #solution<T> {
                #solution_items
            }

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

            impl<T: #runtime::Real> From<#solution<T>> for #runtime::AnySolution<T> {
                fn from(solution: #solution<T>) -> Self {
                    #runtime::AnySolution::#variant(::std::boxed::Box::new(solution))
                }
            }
        }
    }

    fn parameter_names(&self) -> Vec<Ident> {
        self.spec.parameters.iter().map(|p| identifier(&p.name)).collect()
    }

    fn parameter_items(&self, parameters: &Ident, solution: &str) -> TokenStream {
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

    fn inherent_items(&self, solution: &Ident, parameters: &Ident) -> TokenStream {
        let runtime = self.runtime;
        let spec = self.spec;
        let (name, title, reference) =
            (&spec.name, one_line(&spec.title), one_line(&spec.reference));
        let coordinates = spec.coordinates.name();
        let dimension = Literal::usize_unsuffixed(spec.dimension);
        let specification = &spec.source;
        let entries = spec.parameters.iter().map(|p| {
            let (name, unit, range) = (&p.name, one_line(&p.unit), one_line(&p.range));
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
            quote!(value.is_finite() #(#bounds)*)
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
                    Ok(#solution { parameters, fixed: [#(#fixed_values,)*] })
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

                /// The parameters.
                #[must_use]
                pub fn parameters(&self) -> &#parameters<T> {
                    &self.parameters
                }
            }
        }
    }

    /// The functions of the trait `BodyForceStages`, and how many values there are of the time and of the point.
    fn body_force_stages(&self) -> (TokenStream, Literal, Literal) {
        let vector = self.vector();
        let stages = &self.staged.body_force;
        let (of_time, time) = self.time_stage("body_force_time", stages);
        let (of_point, point) = self.point_stage("body_force_point", stages);
        let (statements, values) = self.translator.statements_if_near(&self.staged.staged(stages));
        let result = self.shaped(Shape::Vector, &values);
        let items = quote! {
            #of_time
            #of_point
            #[inline(always)]
            fn body_force_staged<const NEAR: bool>(
                &self,
                time: &[T; #time],
                point: &[T; #point],
            ) -> #vector {
                #statements
                #result
            }
        };
        (items, time, point)
    }

    /// Where the body force has a form for lattices: the statement that takes it for points that are one, and the
    /// implementation of the trait `BodyForceOnLattice`.
    fn body_force_on_lattice(&self, solution: &Ident) -> Option<(TokenStream, TokenStream)> {
        let lattice = self.staged.lattice.as_ref()?;
        let (runtime, vector) = (self.runtime, self.vector());
        let largest = |count: fn(&Stages) -> usize| -> usize {
            lattice.layers().iter().map(count).max().unwrap_or(0)
        };
        let counts = [Stages::time_count, Stages::point_count, Stages::output_count].map(largest);
        let [time, point, layer] = counts.map(Literal::usize_unsuffixed);
        let dimension = Literal::usize_unsuffixed(self.spec.dimension);
        let of_time = lattice.layers().first()?;
        let (time_statements, time_values) =
            self.translator.statements(&self.staged.time_stage(of_time));
        // One array type for all axes: what one has to spare is zero.
        let of_axes = |count: usize, blocks: Vec<Block<'_>>| {
            let arms = blocks.iter().enumerate().map(|(axis, block)| {
                let axis = Literal::usize_unsuffixed(axis);
                let (statements, mut values) = self.translator.statements(block);
                values.resize(count, quote!(T::zero()));
                quote!(#axis => { #statements [#(#values),*] })
            });
            let count = Literal::usize_unsuffixed(count);
            quote!(match axis { #(#arms)* _ => [T::zero(); #count] })
        };
        let layers = lattice.layers().iter();
        let of_points = of_axes(
            counts[1],
            layers.clone().map(|layer| self.staged.point_stage(layer)).collect(),
        );
        let of_layers = of_axes(counts[2], layers.map(|layer| self.staged.staged(layer)).collect());
        let (statements, values) = self.translator.statements(&self.staged.of_layers(lattice));
        let b = self.shaped(Shape::Vector, &values);
        let choice = quote! {
            if let ::std::option::Option::Some(lattice) = lattice {
                return ::std::boxed::Box::new(
                    #runtime::LatticePoints::<Self, T, #dimension, #time, #point, #layer>::new(*self, lattice),
                );
            }
        };
        let items = quote! {
            #[allow(unused_variables, clippy::all, clippy::pedantic)]
            impl<T: #runtime::Real>
                #runtime::BodyForceOnLattice<T, #dimension, #time, #point, #layer> for #solution<T>
            {
                #[inline]
                fn lattice_time(&self, t: T) -> [T; #time] {
                    #time_statements
                    [#(#time_values),*]
                }
                #[inline]
                fn lattice_coordinate(&self, axis: usize, X: &#vector) -> [T; #point] {
                    #of_points
                }
                #[inline]
                fn lattice_layer(
                    &self,
                    axis: usize,
                    time: &[T; #time],
                    point: &[T; #point],
                ) -> [T; #layer] {
                    #of_layers
                }
                #[inline(always)]
                fn lattice_body_force(
                    &self,
                    time: &[T; #time],
                    layers: [&[T; #layer]; #dimension],
                ) -> #vector {
                    #statements
                    #b
                }
            }
        };
        Some((choice, items))
    }

    /// The functions of the trait `StateStages`, and how many values there are of the time, of the time of the velocity,
    /// and of the point.
    fn state_stages(&self) -> (TokenStream, Literal, Literal, Literal) {
        let runtime = self.runtime;
        let n = Literal::usize_unsuffixed(self.spec.dimension);
        let Staged { state, velocity, .. } = self.staged;
        let (of_time, time) = self.time_stage("state_time", state);
        let (of_velocity_time, velocity_time) = self.time_stage("velocity_time", velocity);
        let (of_point, point) = self.point_stage("state_point", state);
        let (statements, values) = self.translator.statements_if_near(&self.staged.staged(state));
        let (u, tensors) = values.split_at(self.spec.dimension);
        let (F, P) = tensors.split_at(tensors.len() / 2);
        let u = self.shaped(Shape::Vector, u);
        let [F, P] = [F, P].map(|values| self.shaped(Shape::Matrix, values));
        let (v_statements, values) =
            self.translator.statements_if_near(&self.staged.staged(velocity));
        let v = self.shaped(Shape::Vector, &values);
        let items = quote! {
            #of_time
            #of_velocity_time
            #of_point
            #[inline(always)]
            fn state_staged<const NEAR: bool>(
                &self,
                time: &[T; #time],
                velocity_time: &[T; #velocity_time],
                point: &[T; #point],
            ) -> #runtime::State<T, #n> {
                // In a block of its own: its values belong to another time.
                let v = {
                    let time = velocity_time;
                    #v_statements
                    #v
                };
                #statements
                #runtime::State { u: #u, v, F: #F, P: #P }
            }
        };
        (items, time, velocity_time, point)
    }

    /// A function for what `stages` keep of the time, and how many values these are.
    fn time_stage(&self, name: &str, stages: &Stages) -> (TokenStream, Literal) {
        let (name, count) =
            (format_ident!("{name}"), Literal::usize_unsuffixed(stages.time_count()));
        let (statements, values) = self.translator.statements(&self.staged.time_stage(stages));
        let function = quote! {
            #[inline]
            fn #name(&self, t: T) -> [T; #count] {
                #statements
                [#(#values),*]
            }
        };
        (function, count)
    }

    /// A function for what `stages` keep of a point, and how many values these are.
    fn point_stage(&self, name: &str, stages: &Stages) -> (TokenStream, Literal) {
        let (name, count) =
            (format_ident!("{name}"), Literal::usize_unsuffixed(stages.point_count()));
        let vector = self.vector();
        let (statements, values) = self.translator.statements(&self.staged.point_stage(stages));
        let function = quote! {
            #[inline]
            fn #name(&self, X: &#vector) -> [T; #count] {
                #statements
                [#(#values),*]
            }
        };
        (function, count)
    }

    /// The type of vectors.
    fn vector(&self) -> TokenStream {
        let runtime = self.runtime;
        let n = Literal::usize_unsuffixed(self.spec.dimension);
        quote!(#runtime::nalgebra::SVector<T, #n>)
    }

    /// Values as a scalar, a vector or a matrix.
    fn shaped(&self, shape: Shape, values: &[TokenStream]) -> TokenStream {
        let runtime = self.runtime;
        let n = Literal::usize_unsuffixed(self.spec.dimension);
        match shape {
            Shape::Scalar => quote!(#(#values)*),
            Shape::Vector => quote!(#runtime::nalgebra::SVector::<T, #n>::new(#(#values),*)),
            Shape::Matrix => quote!(#runtime::nalgebra::SMatrix::<T, #n, #n>::new(#(#values),*)),
        }
    }

    fn solution_items(&self) -> TokenStream {
        let runtime = self.runtime;
        let n = Literal::usize_unsuffixed(self.spec.dimension);
        let vector = self.vector();
        let matrix = quote!(#runtime::nalgebra::SMatrix<T, #n, #n>);
        let mut items = TokenStream::new();
        for field in &self.staged.fields {
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
                let (letter, value) = (
                    format_ident!("{}", field.name.letter()),
                    self.shaped(field.name.shape(), own),
                );
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
        items.extend(self.traction());
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
                quote! {
                    #runtime::Law::Library(#runtime::Material::#variant { #(#constants)* #volumetric })
                }
            }
            Law::Stated(Stated { response, components, constants }) => {
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
                quote! {
                    #runtime::Law::Stated(#runtime::Stated {
                        response: #runtime::Response::#response,
                        components: #runtime::Components::#components,
                        constants: vec![#(#constants),*],
                    })
                }
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
        }
    }
}

fn boundary(runtime: &TokenStream, boundary: &Boundary) -> TokenStream {
    let surface = surface_value(runtime, boundary.surface);
    let condition = match boundary.condition {
        Condition::Sliding => quote!(Sliding),
        Condition::Symmetry => quote!(Symmetry),
        Condition::TractionFree => quote!(TractionFree),
        Condition::PrescribedTraction => quote!(PrescribedTraction),
        Condition::PrescribedMotion => quote!(PrescribedMotion),
    };
    quote! {
        #runtime::Boundary {
            surface: #surface,
            condition: #runtime::Condition::#condition,
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
    }
}

/// A parameter name as an identifier; names that are Rust keywords become raw identifiers. (Specifications refuse the
/// words that cannot be raw, as `self`.)
fn identifier(name: &str) -> Ident {
    // Reserved since edition 2024, which the parser does not know.
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
