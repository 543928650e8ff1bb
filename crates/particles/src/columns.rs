//! The columns of particles, stated once: sort, split, gather, move between processes, save and resume follow from the rows of `columns!`.
//!
//! A column has the same number of successive elements for each particle, its share: one, none where a run does without the column, or
//! as many as a law has internal variables.

use bytemuck::{Pod, cast_slice};
use mmsmith_lanes::simd::Lanes;
use mmsmith_ranks::Move;
use mmsmith_threads::disjoint::{DisjointColumn, PartColumn, Partition, Run, Runs};
use nalgebra::{SMatrix, SVector};

/// Work on a column, whatever its elements are.
pub trait EachColumn {
    /// `share` is how many elements a particle has.
    fn column<E: Pod>(&mut self, share: usize, column: &mut Vec<E>);
}

/// Replaces the elements by those of the particles that are here after the move.
impl EachColumn for &Move {
    fn column<E: Pod>(&mut self, share: usize, column: &mut Vec<E>) {
        *column = self.all_shares(share, column);
    }
}

macro_rules! columns {
    (
        fixed { $($(#[$fixed_doc:meta])* $fixed:ident: $Fixed:ty,)* }
        moving { $($(#[$moving_doc:meta])* $moving:ident: $Moving:ty,)* }
    ) => {
        /// State of the particles as a structure of arrays; the index is the particle's id and never changes.
        #[derive(Clone, Debug, PartialEq)]
        pub struct Particles<T, const D: usize> {
            $($(#[$fixed_doc])* pub $fixed: Vec<$Fixed>,)*
            $($(#[$moving_doc])* pub $moving: Vec<$Moving>,)*
            /// Reference half-size l0 of every particle's box, along each axis.
            pub half_size: SVector<T, D>,
        }

        impl<T: nalgebra::RealField, const D: usize> Default for Particles<T, D> {
            /// No particles.
            fn default() -> Self {
                Self {
                    $($fixed: Vec::new(),)*
                    $($moving: Vec::new(),)*
                    half_size: SVector::zeros(),
                }
            }
        }

        /// The shares of the columns that steps change.
        #[derive(Clone, Copy, Debug)]
        pub struct Shares {
            $(#[doc = concat!("Elements of `", stringify!($moving), "` that a particle has.")] pub $moving: usize,)*
        }

        impl Shares {
            /// One element in each column.
            pub const ONE: Self = Self { $($moving: 1,)* };
        }

        impl<T: Copy, const D: usize> Particles<T, D> {
            /// The particles at some places, in that order.
            pub fn some(&self, places: &[u32]) -> Self {
                let count = self.X.len();
                Self {
                    $($fixed: some(&self.$fixed, count, places),)*
                    $($moving: some(&self.$moving, count, places),)*
                    half_size: self.half_size,
                }
            }
        }

        impl<T: Lanes, const D: usize> Particles<T, D> {
            /// The columns that stay, and those that steps change.
            pub fn split(&mut self) -> (Fixed<'_, T, D>, Moving<'_, T, D>) {
                let count = self.X.len();
                (
                    Fixed { $($fixed: &self.$fixed,)* },
                    Moving { count, $($moving: &mut self.$moving,)* },
                )
            }

            /// The columns that steps change, as bytes.
            pub fn moving_bytes(&self) -> Vec<&[u8]> {
                vec![$(cast_slice(&self.$moving),)*]
            }

            /// Works on every column.
            pub fn each(&mut self, shares: &Shares, work: &mut impl EachColumn) {
                $(work.column(1, &mut self.$fixed);)*
                $(work.column(shares.$moving, &mut self.$moving);)*
            }

            /// Gives columns without elements their share, every element zero.
            pub fn fill(&mut self, shares: &Shares) {
                let zero = MovingColumns::<T, D>::zero(self.X.len(), shares);
                $(if self.$moving.is_empty() {
                    self.$moving = zero.$moving;
                })*
            }

            /// Takes the columns that steps change from others.
            pub fn replace_moving(&mut self, columns: MovingColumns<T, D>) {
                $(self.$moving = columns.$moving;)*
            }
        }

        /// The columns that stay.
        #[derive(Clone, Copy)]
        pub struct Fixed<'a, T, const D: usize> {
            $($(#[$fixed_doc])* pub $fixed: &'a [$Fixed],)*
        }

        /// The columns that steps change, of some successive particles.
        pub struct Moving<'a, T, const D: usize> {
            count: usize,
            $($(#[$moving_doc])* pub $moving: &'a mut [$Moving],)*
        }

        impl<'a, T, const D: usize> Moving<'a, T, D> {
            /// Takes the first particles away, as many as there are and no more than `count`.
            pub fn split_off(&mut self, count: usize) -> Moving<'a, T, D> {
                let (all, count) = (self.count.max(1), count.min(self.count));
                self.count -= count;
                Moving {
                    count,
                    $($moving: {
                        let elements = self.$moving.len() / all * count;
                        self.$moving.split_off_mut(..elements).unwrap_or_default()
                    },)*
                }
            }
        }

        /// The columns that steps change, apart from particles.
        pub struct MovingColumns<T, const D: usize> {
            $($(#[$moving_doc])* pub $moving: Vec<$Moving>,)*
        }

        impl<T: Lanes, const D: usize> MovingColumns<T, D> {
            /// How many columns there are.
            pub const COUNT: usize = [$(stringify!($moving)),*].len();

            /// Columns without particles.
            pub fn none() -> Self {
                Self { $($moving: Vec::new(),)* }
            }

            /// Columns of `count` particles, every element zero.
            fn zero(count: usize, shares: &Shares) -> Self {
                Self { $($moving: vec![<$Moving as bytemuck::Zeroable>::zeroed(); count * shares.$moving],)* }
            }

            /// Works on every column.
            pub fn each(&mut self, shares: &Shares, work: &mut impl EachColumn) {
                $(work.column(shares.$moving, &mut self.$moving);)*
            }

            /// The first particles of those whose shares these are.
            pub fn first(&mut self, count: usize, shares: &Shares) -> Moving<'_, T, D> {
                Moving { count, $($moving: &mut self.$moving[..count * shares.$moving],)* }
            }
        }

        /// The columns that steps change, whose elements belong to the parts of a partition.
        pub struct DisjointMoving<'a, T, const D: usize> {
            $($moving: DisjointColumn<'a, $Moving>,)*
            partition: &'a Partition,
        }

        impl<'a, T: Lanes, const D: usize> DisjointMoving<'a, T, D> {
            /// `None` where the partition does not have each particle once.
            pub fn new(partition: &'a mut Partition, moving: Moving<'a, T, D>) -> Option<Self> {
                let whole = partition.whole()?;
                Some(Self {
                    $($moving: whole.column(moving.$moving)?,)*
                    partition: whole.partition(),
                })
            }

            /// The elements of a part: once, then `None`, as for a part that does not exist.
            pub fn take(&self, part: usize) -> Option<PartMoving<'_, T, D>> {
                let indices = self.partition.part(part)?;
                Some(PartMoving {
                    indices,
                    runs: Runs::new(indices),
                    $($moving: self.$moving.take(part)?,)*
                })
            }
        }

        /// The columns that steps change, of the particles of a part.
        pub struct PartMoving<'a, T, const D: usize> {
            indices: &'a [u32],
            /// Runs of the particles that were copied last.
            runs: Runs<'a>,
            $($moving: PartColumn<'a, $Moving>,)*
        }

        impl<'a, T: Lanes, const D: usize> PartMoving<'a, T, D> {
            /// The numbers of the particles.
            pub fn indices(&self) -> &'a [u32] {
                self.indices
            }

            /// The particles from a place on in memory, if they lie side by side there.
            #[inline(always)]
            pub fn contiguous(&mut self, place: usize, count: usize) -> Option<Moving<'_, T, D>> {
                let run = Run::find(self.indices, place, count)?;
                Some(Moving { count, $($moving: self.$moving.run(run),)* })
            }

            /// Copies so many particles from a place on.
            #[inline(always)]
            pub fn gather(&mut self, place: usize, count: usize, copies: &mut MovingColumns<T, D>) {
                self.runs.find(place, count);
                $(self.$moving.gather(&self.runs, &mut copies.$moving);)*
            }

            /// Copies back those that were copied last.
            #[inline(always)]
            pub fn scatter(&mut self, copies: &MovingColumns<T, D>) {
                $(self.$moving.scatter(&self.runs, &copies.$moving);)*
            }
        }
    };
}

columns! {
    fixed {
        /// Reference positions, lengths.
        X: SVector<T, D>,
        /// Masses.
        mass: T,
        /// Reference volumes V0 (areas in 2D, lengths in 1D).
        volume: T,
    }
    moving {
        /// Current positions, lengths.
        x: SVector<T, D>,
        /// Velocities.
        v: SVector<T, D>,
        /// Deformation gradients `F[i][J] = dx_i/dX_J`.
        F: SMatrix<T, D, D>,
        /// APIC: affine velocities per cell; empty with other transfers.
        affine: SMatrix<T, D, D>,
        /// Internal variables of the law, those of a particle one after the other; empty where the law has none.
        internal: T,
    }
}

impl<T: Lanes, const D: usize> MovingColumns<T, D> {
    /// Columns of `count` particles that are not deformed, every other element zero.
    pub fn at_rest(count: usize, shares: &Shares) -> Self {
        Self { F: vec![SMatrix::identity(); count], ..Self::zero(count, shares) }
    }
}

/// The elements of the particles at some places of `count`, in that order.
fn some<E: Copy>(all: &[E], count: usize, places: &[u32]) -> Vec<E> {
    let share = all.len() / count.max(1);
    let mut some = Vec::with_capacity(share * places.len());
    for &place in places {
        some.extend_from_slice(&all[place as usize * share..][..share]);
    }
    some
}

impl<'a, T, const D: usize> Moving<'a, T, D> {
    /// Number of particles.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether there are no particles.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Pieces of `size` particles, each with the place of its first one here.
    pub fn pieces(mut self, size: usize) -> impl Iterator<Item = (usize, Self)> {
        let mut first = 0;
        std::iter::from_fn(move || {
            let piece = self.split_off(size);
            let start = first;
            first += piece.len();
            (!piece.is_empty()).then_some((start, piece))
        })
    }
}
