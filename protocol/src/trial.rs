//! A trial: what is asked of it besides its stress, and what it returns.

use crate::observed::{Observables, Observed};
use crate::tangent_kind::TangentKind;
use crate::tensor::{Tensor2, Tensor4};
use bytemuck::{Pod, Zeroable};
use serde::{Deserialize, Serialize};

/// Most increments that the doors to other codes take for one trial: a count that is out of its bounds would keep a worker for hours.
pub const MOST_RAMP_STEPS: u32 = 1_000_000;

/// Options of a trial: results wanted in addition to the stress, and the number of increments, which must not vary within a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrialOptions {
    /// The tangent operator wanted.
    pub tangent: TangentKind,
    /// Number of increments in which the deformation is applied. 0 lets the engine choose from its strain per step.
    /// A macro step fixes it for all its iterations: the stress would jump with the strain otherwise.
    pub ramp_steps: u32,
    /// Optional results wanted.
    pub observables: Observables,
    /// Share by which the friction between the grains is below that of the definition, 0 to 1: with 1 there is none. An engine that
    /// does not say [`Capabilities::reduces_friction`](crate::capabilities::Capabilities::reduces_friction) gets 0 only.
    pub friction_reduction: f64,
}

/// Cheap results that every trial returns. Dimensionless unless stated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, Serialize, Deserialize)]
#[repr(C)]
pub struct Scalars {
    /// Void volume over grain volume.
    pub void_ratio: f64,
    /// 2 x contacts over grains.
    pub coordination_number: f64,
    /// Value of the engine's equilibrium criterion at the end.
    pub unbalanced_force_ratio: f64,
    /// Largest overlap over the smaller grain diameter of its contact.
    pub max_overlap_ratio: f64,
    /// Cell volume over initial cell volume.
    pub volume_ratio: f64,
}

/// What a trial cost. Counts are deterministic; times are not and never reach a result file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable, Serialize, Deserialize)]
#[repr(C)]
pub struct Cost {
    /// Contact-force evaluations, also called DEM steps.
    pub force_evaluations: u64,
    /// Ramp increments used.
    pub ramp_steps: u64,
    /// Time in the grain solver, ns.
    pub solve_nanoseconds: u64,
    /// Time in the tangent operator, ns.
    pub tangent_nanoseconds: u64,
}

/// Shortcuts and fallbacks of a trial; each is counted and shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TrialFlags(pub u32);

crate::keyword::bits! {
    TrialFlags {
        /// The step cap ended the relaxation before the criterion was met; the stress is the best available. How far it got:
        /// the whole strain, [`Cost::ramp_steps`], [`Scalars::unbalanced_force_ratio`], [`Cost::force_evaluations`].
        NOT_EQUILIBRATED = 1 => "not_equilibrated",
        /// The requested tangent was not found and another one was returned instead: the uniform-strain operator
        /// [`Kruyt`](TangentKind::Kruyt) where an operator of the network was singular, not finite or not credible;
        /// [`TrussLike`](TangentKind::TrussLike) where a perturbation failed or did not come to rest.
        TANGENT_FALLBACK = 2 => "tangent_fallback",
        /// A network tangent needed a diagonal shift to be solvable.
        TANGENT_REGULARISED = 4 => "tangent_regularised",
        /// An overlap exceeded 10 % of a grain diameter: units or stiffness are probably wrong.
        LARGE_OVERLAP = 8 => "large_overlap",
        /// No load-bearing contacts: the cell has come apart, or what forces are left in it are a vanishing share of what it once
        /// carried and in no balance. The stress is that of the forces left, the stiffness zero.
        NO_LOAD_BEARING_CONTACTS = 16 => "no_load_bearing_contacts",
        /// The result equals the committed state because the target was exactly zero; nothing was solved.
        SKIPPED_NULL_TARGET = 32 => "skipped_null_target",
        /// The relaxation made no headway and went on with another damping. The answer is as good as any other unless
        /// [`NOT_EQUILIBRATED`](Self::NOT_EQUILIBRATED) is set too.
        DAMPING_CHANGED = 64 => "damping_changed",
        /// The event-driven solver answered by the stored linear response of the state: no contact changed its mode.
        ELASTIC_INCREMENT = 128 => "elastic_increment",
        /// The event-driven solver answered by new linear responses, because contacts changed their modes or none was stored.
        EVENT_INCREMENT = 256 => "event_increment",
        /// The event-driven solver did not apply, found no answer or would not pay, and relaxation answered.
        HANDED_OVER = 512 => "handed_over",
    }
}

impl TrialFlags {
    /// All flags that say how an answer was found and nothing about its quality.
    pub const COURSE: Self = Self(Self::ELASTIC_INCREMENT.0 | Self::EVENT_INCREMENT.0 | Self::HANDED_OVER.0);

    /// The flags that are not among those of `other`.
    #[must_use]
    pub fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Whether all bits of `other` are set.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Sets the bits of `other`.
    pub fn insert(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

/// The result of one trial.
#[derive(Clone, Debug, PartialEq)]
pub struct TrialResult {
    /// Cauchy stress at the end, Pa, tension positive.
    pub stress: Tensor2,
    /// The tangent requested, Pa; `None` when none was requested.
    pub tangent: Option<Box<Tensor4>>,
    /// Cheap scalars.
    pub scalars: Scalars,
    /// Optional results; only those requested are meaningful.
    pub observed: Observed,
    /// What it cost.
    pub cost: Cost,
    /// Shortcuts taken.
    pub flags: TrialFlags,
}
