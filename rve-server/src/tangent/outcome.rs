//! Results of operator computations.

use protocol::Tensor4;

/// A tangent operator with the shortcuts that were needed to get it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentOutcome {
    /// `d sigma_ij / d F_kl`, Pa.
    pub operator: Tensor4,
    /// Whether the operator requested failed and another stands in its place: the uniform-strain operator, or the truss-like one
    /// for operators by perturbation.
    pub fallback: bool,
    /// Whether mechanisms of the network had to be held by a small stiffness of their own.
    pub regularised: bool,
}

impl TangentOutcome {
    /// An operator that needed no shortcut.
    pub(crate) fn exact(operator: Tensor4) -> Self {
        Self { operator, fallback: false, regularised: false }
    }
}

/// An operator and what finding it cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OperatorEvaluation {
    /// The operator.
    pub outcome: TangentOutcome,
    /// Contact-force evaluations of all perturbations; none for operators that need the network alone.
    pub force_evaluations: u64,
}

impl OperatorEvaluation {
    /// An operator that needed no evaluation of contact forces.
    pub(crate) fn without_evaluations(outcome: TangentOutcome) -> Self {
        Self { outcome, force_evaluations: 0 }
    }
}
