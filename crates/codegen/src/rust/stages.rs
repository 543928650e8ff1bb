//! The stages of the body force and of the state in Rust, at points and on lattices.

use super::Generator;
use mmsmith_stage::{Block, Shape, Staged, Stages};
use proc_macro2::{Ident, Literal, TokenStream};
use quote::{format_ident, quote};

impl Generator<'_> {
    /// The functions of the trait `BodyForceStages`, and the numbers of values of the time and of the point.
    pub(super) fn body_force_stages(&self) -> (TokenStream, Literal, Literal) {
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

    /// The statement that uses a body force's form for lattices at points that form a lattice, and the implementation of the trait
    /// `BodyForceOnLattice`; empty for other body forces.
    pub(super) fn body_force_on_lattice(
        &self,
        solution: &Ident,
    ) -> Option<(TokenStream, TokenStream)> {
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
        // All axes have an array of the same type; the elements that an axis does not use are zero.
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

    /// The functions of the trait `StateStages`, and the numbers of values of the time, of the time of the velocity, and of the point.
    pub(super) fn state_stages(&self) -> (TokenStream, Literal, Literal, Literal) {
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
                // In a block of its own, since its values belong to another time.
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

    /// A function for the values that `stages` keep of the time, and the number of these values.
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

    /// A function for the values that `stages` keep of a point, and the number of these values.
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
}
