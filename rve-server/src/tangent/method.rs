//! How each kind of operator is found. The only place that maps a [`TangentKind`] to code.

use super::sliding::{Sliding, SlidingSet};
use protocol::TangentKind;

/// How an operator is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Method {
    /// No operator is wanted.
    None,
    /// The contact network of the trial state is enough.
    Frozen(FrozenMethod),
    /// The grain solver answers small perturbations of the trial.
    Perturbation(Perturbation),
}

/// How an operator of a frozen network is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FrozenMethod {
    /// One sparse solve: every grain finds its own translation and rotation.
    Network(Sliding),
    /// The mean strain is forced upon all grains.
    UniformStrain(UniformStrain),
}

/// Operators of uniform strain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UniformStrain {
    /// UKO.
    Plain(Form),
    /// KAO.
    Augmented(Form),
}

/// Which form of a formula of [Argilaga2018].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// Made objective and symmetric.
    Objective,
    /// As printed.
    Printed,
}

/// Operators by perturbation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Perturbation {
    /// DEMQO.
    QuasiStatic,
    /// CTO.
    Consistent(Difference),
    /// AEO.
    ElasticAverage,
    /// UKO with factors from a CTO: UCKO and UCKO-2DOF.
    Calibrated(Factors, Form),
}

/// Finite differences.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Difference {
    /// One perturbation in each direction.
    Forward,
    /// One perturbation each way.
    Central,
}

/// Calibration factors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Factors {
    /// One for both stiffnesses.
    Single,
    /// One for `k_n` and one for `k_t`.
    Pair,
}

impl Method {
    /// The method of a kind.
    pub(crate) fn of(kind: TangentKind) -> Self {
        match kind {
            TangentKind::None => Self::None,
            TangentKind::TrussLike => network(Sliding::Sticks),
            TangentKind::TrussLikeSlip => network(Sliding::Slips(SlidingSet::OfRamp)),
            TangentKind::TrussLikeSlipAtRest => network(Sliding::Slips(SlidingSet::AtRest)),
            TangentKind::TrussLikeReleased => network(Sliding::Released(SlidingSet::OfRamp)),
            TangentKind::TrussLikeReleasedAtRest => network(Sliding::Released(SlidingSet::AtRest)),
            TangentKind::Kruyt => uniform_strain(UniformStrain::Plain(Form::Objective)),
            TangentKind::KruytPrinted => uniform_strain(UniformStrain::Plain(Form::Printed)),
            TangentKind::KruytAugmented => uniform_strain(UniformStrain::Augmented(Form::Objective)),
            TangentKind::KruytAugmentedPrinted => uniform_strain(UniformStrain::Augmented(Form::Printed)),
            TangentKind::KruytCalibrated => calibrated(Factors::Single, Form::Objective),
            TangentKind::KruytCalibratedPrinted => calibrated(Factors::Single, Form::Printed),
            TangentKind::KruytTwiceCalibrated => calibrated(Factors::Pair, Form::Objective),
            TangentKind::KruytTwiceCalibratedPrinted => calibrated(Factors::Pair, Form::Printed),
            TangentKind::QuasiStatic => Self::Perturbation(Perturbation::QuasiStatic),
            TangentKind::Consistent => Self::Perturbation(Perturbation::Consistent(Difference::Forward)),
            TangentKind::ConsistentCentral => Self::Perturbation(Perturbation::Consistent(Difference::Central)),
            TangentKind::ElasticAverage => Self::Perturbation(Perturbation::ElasticAverage),
        }
    }
}

impl FrozenMethod {
    /// PSTLO, `truss_like`.
    pub(crate) const TRUSS_LIKE: Self = Self::Network(Sliding::Sticks);

    /// As [`TRUSS_LIKE`](Self::TRUSS_LIKE) with contacts that slip if they slid in the ramp, `truss_like_slip`.
    pub(crate) const TRUSS_LIKE_SLIP: Self = Self::Network(Sliding::Slips(SlidingSet::OfRamp));

    /// UKO made symmetric, `kruyt`.
    pub(crate) const KRUYT: Self = Self::UniformStrain(UniformStrain::Plain(Form::Objective));
}

fn network(sliding: Sliding) -> Method {
    Method::Frozen(FrozenMethod::Network(sliding))
}

fn uniform_strain(operator: UniformStrain) -> Method {
    Method::Frozen(FrozenMethod::UniformStrain(operator))
}

fn calibrated(factors: Factors, form: Form) -> Method {
    Method::Perturbation(Perturbation::Calibrated(factors, form))
}

/// Whether an operator needs the grain solver and not only the contact network of the trial state.
pub fn needs_grain_solver(kind: TangentKind) -> bool {
    matches!(Method::of(kind), Method::Perturbation(_))
}
