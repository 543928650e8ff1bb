//! Planted faults: mistakes that solvers typically contain, to show that the tests catch them.
//!
//! With the feature `planted-faults`, `with` plants a fault in every simulation that its closure sets up on the same thread, and
//! in no other: simulations beside it and tests on other threads stay sound. Without the feature no fault can be planted,
//! [`Planted`] has no size, and all its questions are constants.

use mmsmith_lanes::tensor::{determinant, inverse_transpose};
use mmsmith_vocabulary::{Flow, Material};
use nalgebra::{RealField, SMatrix, SVector};

/// The mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Forces from sigma V0 instead of tau V0.
    CauchyStress,
    /// The first normal component of the stress enters the forces with the opposite sign.
    NormalStressSign,
    /// One shear component of the stress enters the forces with the opposite sign.
    ShearStressSign,
    /// The nominal stress taken for the first Piola-Kirchhoff stress in the forces.
    NominalStress,
    /// `J - 1` for `ln J`.
    LinearLogarithm,
    /// `P` transposed in the law.
    TransposedLaw,
    /// The moduli handed to the solver exchanged.
    LambdaForMu,
    /// Young's modulus handed to the solver a millionth too large.
    StiffnessOff,
    /// The body force computed, and never applied.
    NoBodyForce,
    /// The body force at the end of the step.
    LateBodyForce,
    /// The body force at the current instead of the reference position.
    BodyForceAtCurrentPosition,
    /// The body force times reference volume instead of mass.
    BodyForcePerVolume,
    /// The position moved by the particle's own velocity.
    OwnVelocity,
    /// The position moved by a millionth too little.
    PositionOff,
    /// Walls leave the acceleration.
    WallsKeepAcceleration,
    /// Walls leave the velocity.
    WallsKeepVelocity,
    /// Nodes beyond walls keep their mass.
    GhostMassLost,
    /// Centred differences that start with the velocity at time 0 and a whole acceleration.
    NoHalfStep,
    /// `F + dt L` for `(I + dt L) F`.
    AdditiveStretch,
    /// The velocity gradient transposed.
    GradientTransposed,
    /// GIMP boxes scaled by J, by the same factor along all axes.
    SizeFromJacobian,
    /// Particles read the grid from where their velocity takes them.
    WeightsOfNewPosition,
    /// Particles in the last cell contribute nothing to the last node they reach; of three nodes the middle one gets its part.
    LastNodeSkipped,
    /// One sum of a step in single precision.
    SinglePrecision,
    /// The velocity taken from the grid instead of its change.
    PicForFlip,
    /// MUSL that updates F with the velocity before it is projected anew.
    NoReprojection,
    /// USF with the stress of F at the start of the step.
    StressOfOldStretch,
    /// Total frame: the mass matrix without its outermost band.
    MassBandDropped,
    /// Total frame: the first integration weight a thousandth too large.
    WeightOff,
    /// Total frame: the first part of the composed step cut after three digits.
    StageOff,
    /// Total frame: time stands still during the stages of a step.
    StagesAtOneTime,
    /// Total frame: mirror images beyond walls keep the sign of the component across.
    MirrorSign,
    /// Total frame: the hoop stress left out of the radial balance.
    HoopStressDropped,
    /// Total frame: the shear stress left out of the balance around.
    HoopShearDropped,
    /// Total frame: the hoop stress around the third axis left out of the balance along meridians.
    CotangentDropped,
    /// Total frame: given tractions with the wrong sign.
    TractionSign,
    /// Total frame: the inertia of sides with a given motion left out of the balance inside.
    BoundaryInertiaDropped,
    /// Total frame: sides with a given motion late by a stage.
    LateBoundary,
    /// Statics: the stiffness without the stress of the deformation that is reached.
    GeometricStiffnessDropped,
    /// Corners of CPDI2 that are never moved.
    CornersStay,
    /// APIC without its affine part.
    AffinePartDropped,
    /// The terms of XPIC all with the same sign.
    XpicSign,
    /// Yeoh's law: the derivative of the second power without its 2.
    YeohFactor,
    /// Yeoh's law: the third power with the opposite sign.
    YeohSign,
    /// Gent's law: the slope of the energy without its half.
    GentFactor,
    /// Gent's law: the logarithm with the opposite sign.
    GentSign,
    /// Arruda and Boyce's law: the locking stretch for its square.
    ArrudaBoyceFactor,
    /// Arruda and Boyce's law: the pressure with the opposite sign.
    ArrudaBoyceSign,
    /// Orthotropic elasticity: shears of the strain for those of engineers, which are twice as large.
    OrthotropicFactor,
    /// Orthotropic elasticity: a normal stress from the strain across with the opposite sign.
    OrthotropicSign,
    /// Ogden's law: powers of squared stretches for those of stretches.
    OgdenFactor,
    /// Ogden's law: the first power with the opposite sign.
    OgdenSign,
    /// Holzapfel, Gasser and Ogden's law: the derivative of the square in the exponential without its 2.
    HolzapfelGasserOgdenFactor,
    /// Holzapfel, Gasser and Ogden's law: fibres at the opposite angle.
    HolzapfelGasserOgdenSign,
    /// A law that the specification states: shear stresses without the part that symmetric components of C share.
    StatedFactor,
    /// A law that the specification states: the first normal stress with the opposite sign.
    StatedSign,
    /// Flow by von Mises: the size of the deviator held against the yield stress without the root of two thirds.
    YieldRootDropped,
    /// Flow by von Mises: softening instead of hardening.
    HardeningSign,
    /// Flow by von Mises: the plastic strain is never advanced.
    PlasticStrainStays,
    /// Flow by von Mises, in the plane and on a line: the elastic strain out of the plane left out.
    AcrossDropped,
    /// Laws with memory: the stress of the elastic part alone, for the whole deformation.
    ElasticPartAlone,
    /// Maxwell elements: all relax in half of their time.
    RelaxationTime,
    /// Maxwell elements: stresses that decay, and take up no change of shape.
    ShareDropped,
    /// Flow by von Mises: the plastic strain advanced by the multiplier, without the root of two thirds.
    PlasticStrainRoot,
    /// Flow by von Mises: the multiplier of a material that does not harden.
    MultiplierWithoutHardening,
    /// Flow by von Mises: linear hardening for that of a power.
    HardeningExponent,
    /// Flow by von Mises: the shear strain of flow left out of the trial state.
    TrialShearDropped,
    /// Flow beyond the yield stress: half of its time.
    OverstressTime,
    /// Flow beyond the yield stress: the overstress to the power one.
    OverstressExponent,
    /// Flow beyond the yield stress: the drag for its double.
    OverstressDrag,
    /// Maxwell elements: only the first one counts.
    LastElementsDropped,
    /// Maxwell elements: shares of the whole stress, that of changes of volume too.
    ShareOfPressure,
    /// Maxwell elements: stresses that never decay.
    DecayDropped,
    /// Maxwell elements: beside an elastic law that keeps their shares.
    ShareTwice,
    /// Maxwell elements: second Piola-Kirchhoff stresses added to first ones.
    PushForwardDropped,
    /// Projected volume: each particle's own J for the projected one.
    JacobianForTheta,
    /// Projected volume: sums that count all particles alike, whatever their volumes.
    VolumesLeftOut,
    /// Projected volume, in the plane: the third root of the change of volume for the square root.
    VolumeRoot,
}

/// A fault in a law of the library, as what it makes of constants.
#[cfg(feature = "planted-faults")]
struct InLaw {
    fault: Fault,
    /// The law's name in specifications.
    law: &'static str,
    constants: &'static [&'static str],
    change: Change,
}

/// Change of a constant.
#[cfg(feature = "planted-faults")]
enum Change {
    Times(f64),
    Root,
}

#[cfg(feature = "planted-faults")]
const IN_LAWS: &[InLaw] = &[
    in_law(Fault::YeohFactor, "yeoh", &["c2"], Change::Times(0.5)),
    in_law(Fault::YeohSign, "yeoh", &["c3"], Change::Times(-1.0)),
    in_law(Fault::GentFactor, "gent", &["mu"], Change::Times(2.0)),
    in_law(Fault::GentSign, "gent", &["mu"], Change::Times(-1.0)),
    in_law(Fault::ArrudaBoyceFactor, "arruda-boyce", &["N"], Change::Root),
    in_law(Fault::ArrudaBoyceSign, "arruda-boyce", &["kappa"], Change::Times(-1.0)),
    in_law(Fault::OrthotropicFactor, "orthotropic", &["c44", "c55", "c66"], Change::Times(0.5)),
    in_law(Fault::OrthotropicSign, "orthotropic", &["c12"], Change::Times(-1.0)),
    in_law(Fault::OgdenFactor, "ogden", &["alpha1", "alpha2", "alpha3"], Change::Times(2.0)),
    in_law(Fault::OgdenSign, "ogden", &["alpha1"], Change::Times(-1.0)),
    in_law(
        Fault::HolzapfelGasserOgdenFactor,
        "holzapfel-gasser-ogden",
        &["k1"],
        Change::Times(0.5),
    ),
    in_law(
        Fault::HolzapfelGasserOgdenSign,
        "holzapfel-gasser-ogden",
        &["angle"],
        Change::Times(-1.0),
    ),
];

#[cfg(feature = "planted-faults")]
const fn in_law(
    fault: Fault,
    law: &'static str,
    constants: &'static [&'static str],
    change: Change,
) -> InLaw {
    InLaw { fault, law, constants, change }
}

/// The fault of one simulation, if it has one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Planted(#[cfg(feature = "planted-faults")] Option<Fault>);

#[cfg(feature = "planted-faults")]
thread_local! {
    static HERE: std::cell::Cell<Option<Fault>> = const { std::cell::Cell::new(None) };
}

/// Plants a fault in all simulations that `build` sets up on this thread.
#[cfg(feature = "planted-faults")]
pub fn with<R>(fault: Fault, build: impl FnOnce() -> R) -> R {
    /// Takes the fault away again, even if `build` panics.
    struct Weed(Option<Fault>);
    impl Drop for Weed {
        fn drop(&mut self) {
            HERE.set(self.0);
        }
    }
    let _weed = Weed(HERE.replace(Some(fault)));
    build()
}

#[cfg(feature = "planted-faults")]
impl Planted {
    /// The fault planted on this thread at present.
    #[must_use]
    pub fn here() -> Self {
        Self(HERE.get())
    }

    /// Whether it is this fault.
    #[inline(always)]
    #[must_use]
    pub fn is(self, fault: Fault) -> bool {
        self.0 == Some(fault)
    }

    /// Whether it is any fault.
    #[inline(always)]
    #[must_use]
    pub fn is_any(self) -> bool {
        self.0.is_some()
    }

    /// Does work on another thread as on the one where this was found.
    pub fn carried<R>(self, work: impl FnOnce() -> R) -> R {
        match self.0 {
            Some(fault) => with(fault, work),
            None => work(),
        }
    }

    /// The law as stresses are formed of it; energies keep their own.
    pub fn law_in_stresses<T: RealField + Copy>(self, material: Material<T>) -> Material<T> {
        if !self.is_any() {
            return material;
        }
        let name = material.row().name;
        let here = |fault: &&InLaw| self.is(fault.fault) && fault.law == name;
        let Some(fault) = IN_LAWS.iter().find(here) else { return material };
        material.map_named(|name, value| match (fault.constants.contains(&name), &fault.change) {
            (false, _) => value,
            (true, Change::Times(factor)) => value * nalgebra::convert::<f64, T>(*factor),
            (true, Change::Root) => value.sqrt(),
        })
    }
}

#[cfg(not(feature = "planted-faults"))]
impl Planted {
    /// Nothing.
    #[inline(always)]
    #[must_use]
    pub const fn here() -> Self {
        Self()
    }

    /// No.
    #[inline(always)]
    #[must_use]
    pub const fn is(self, _: Fault) -> bool {
        false
    }

    /// No.
    #[inline(always)]
    #[must_use]
    pub const fn is_any(self) -> bool {
        false
    }

    /// Does the work.
    #[inline(always)]
    pub fn carried<R>(self, work: impl FnOnce() -> R) -> R {
        work()
    }

    /// `material` as it is.
    #[inline(always)]
    pub fn law_in_stresses<T>(self, material: Material<T>) -> Material<T> {
        material
    }
}

#[cfg(not(feature = "planted-faults"))]
const _: () = assert!(size_of::<Planted>() == 0, "a normal build carries nothing");

impl Planted {
    /// The flow of a law as its steps take it.
    #[inline(always)]
    #[must_use]
    pub fn flow(self, mut flow: Flow<f64>) -> Flow<f64> {
        if self.is(Fault::HardeningExponent) {
            flow.exponent = 1.0;
        }
        if let Some(overstress) = &mut flow.overstress {
            if self.is(Fault::OverstressTime) {
                overstress.time *= 0.5;
            }
            if self.is(Fault::OverstressExponent) {
                overstress.exponent = 1.0;
            }
            if self.is(Fault::OverstressDrag) {
                overstress.drag *= 2.0;
            }
        }
        flow
    }

    /// The Kirchhoff stress as it enters the forces.
    #[inline(always)]
    pub fn stress_in_forces<T: RealField + Copy, const D: usize>(
        self,
        mut tau: SMatrix<T, D, D>,
        F: &SMatrix<T, D, D>,
    ) -> SMatrix<T, D, D> {
        if self.is(Fault::CauchyStress) {
            tau /= determinant(F);
        }
        if self.is(Fault::NormalStressSign) {
            tau[(0, 0)] = -tau[(0, 0)];
        }
        if self.is(Fault::ShearStressSign) && D > 1 {
            tau[(0, D - 1)] = -tau[(0, D - 1)];
        }
        if self.is(Fault::NominalStress) {
            tau = inverse_transpose(F, determinant(F)).transpose() * tau * F.transpose();
        }
        tau
    }

    /// The first Piola-Kirchhoff stress as it enters the forces of the total frame.
    #[inline(always)]
    pub fn piola_in_forces<const D: usize>(
        self,
        mut P: SMatrix<f64, D, D>,
        F: &SMatrix<f64, D, D>,
    ) -> SMatrix<f64, D, D> {
        if self.is(Fault::CauchyStress) {
            P /= determinant(F);
        }
        if self.is(Fault::NormalStressSign) {
            P[(0, 0)] = -P[(0, 0)];
        }
        if self.is(Fault::ShearStressSign) && D > 1 {
            P[(0, D - 1)] = -P[(0, D - 1)];
        }
        if self.is(Fault::NominalStress) { P.transpose() } else { P }
    }

    /// A change of position in a step.
    #[inline(always)]
    pub fn change<T: RealField + Copy, const D: usize>(
        self,
        change: SVector<T, D>,
    ) -> SVector<T, D> {
        if self.is(Fault::PositionOff) {
            return change * nalgebra::convert::<f64, T>(1.0 - 1e-6);
        }
        if self.is(Fault::SinglePrecision) {
            let single = |value| nalgebra::convert_unchecked::<T, f64>(value) as f32;
            return change.map(|value| nalgebra::convert(f64::from(single(value))));
        }
        change
    }

    /// The part of a time step that a stage takes.
    #[inline(always)]
    pub fn stage(self, gamma: f64) -> f64 {
        if !self.is(Fault::StageOff) || gamma == 1.0 {
            return gamma;
        }
        // Suzuki's coefficients still add up to one.
        if gamma > 0.0 { 0.414 } else { 1.0 - 4.0 * 0.414 }
    }
}
