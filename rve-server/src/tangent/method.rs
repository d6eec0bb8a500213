//! How each kind of operator is found. The only place that maps a [`TangentKind`] to code.

use super::sliding::{Sliding, SlidingSet};
use protocol::TangentKind;

/// How an operator is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Method {
    /// No operator is wanted.
    None,
    /// One sparse solve: every grain of the frozen network finds its own translation and rotation.
    Network(Sliding),
    /// The mean strain is forced upon all grains of the frozen network.
    UniformStrain(UniformStrain),
    /// The grain solver answers small perturbations of the trial.
    Perturbation(Perturbation),
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
            TangentKind::TrussLike => Self::Network(Sliding::Sticks),
            TangentKind::TrussLikeSlip => Self::Network(Sliding::Slips(SlidingSet::OfRamp)),
            TangentKind::TrussLikeSlipAtRest => Self::Network(Sliding::Slips(SlidingSet::AtRest)),
            TangentKind::TrussLikeReleased => Self::Network(Sliding::Released(SlidingSet::OfRamp)),
            TangentKind::TrussLikeReleasedAtRest => Self::Network(Sliding::Released(SlidingSet::AtRest)),
            TangentKind::Kruyt => Self::UniformStrain(UniformStrain::Plain(Form::Objective)),
            TangentKind::KruytPrinted => Self::UniformStrain(UniformStrain::Plain(Form::Printed)),
            TangentKind::KruytAugmented => Self::UniformStrain(UniformStrain::Augmented(Form::Objective)),
            TangentKind::KruytAugmentedPrinted => Self::UniformStrain(UniformStrain::Augmented(Form::Printed)),
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

fn calibrated(factors: Factors, form: Form) -> Method {
    Method::Perturbation(Perturbation::Calibrated(factors, form))
}

/// Whether an operator needs the grain solver and not only the contact network of the trial state.
pub fn needs_grain_solver(kind: TangentKind) -> bool {
    matches!(Method::of(kind), Method::Perturbation(_))
}
