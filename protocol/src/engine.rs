//! The contract of an RVE engine: what any grain solver, ours or foreign, must be able to do.
//!
//! A **trial is a pure function** of (committed state, target, options): it returns the same bits in any worker, and it
//! does not change the committed state. The whole project relies on this.

use crate::identity::{ContentId, DefinitionId};
use crate::observed::{Observables, Observed, OptionalResult};
use crate::tensor::{Tensor2, Tensor4};
use bytemuck::{Pod, Zeroable};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::time::Instant;
use thiserror::Error;

/// Which tangent operator a trial returns with its stress. Always `C_ijkl = d sigma_ij / d F_kl` with `F` relative to
/// the trial's own end state. Numbers are part of the wire: new kinds are appended.
///
/// Kinds ending in `_printed` are the formulas as printed in [Argilaga2018], kept for comparison; the objective forms
/// beside them are the ones to use. "At rest" means that the sliding contacts are those at the Coulomb limit in the
/// relaxed end state instead of those that slid in the ramp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[repr(u32)]
pub enum TangentKind {
    /// Nothing: the stress alone.
    #[default]
    None = 0,
    /// PSTLO, the prestressed truss-like operator of [Argilaga2018] appendix B: all contacts stick.
    TrussLike = 1,
    /// As `truss_like`, but a contact that was at the Coulomb limit during this trial's own ramp slips
    /// non-associatively and has no tangential stiffness. Not symmetric.
    TrussLikeSlip = 2,
    /// UKO made symmetric: uniform strain in all grains, [Argilaga2018] eq. 13. Erratum: the
    /// printed tangential part uses the full displacement gradient and is not objective. Far too stiff;
    /// the fallback when a network operator is singular.
    Kruyt = 3,
    /// UKO as printed, [Argilaga2018] eq. 13.
    KruytPrinted = 4,
    /// UCKO: `kruyt` times one factor calibrated by a CTO in the first step, [Argilaga2018] eq. 16.
    KruytCalibrated = 5,
    /// UCKO on the printed UKO.
    KruytCalibratedPrinted = 6,
    /// UCKO-2DOF: `kruyt` with one factor for `k_n` and one for `k_t`, [Argilaga2018] eq. 17.
    KruytTwiceCalibrated = 7,
    /// UCKO-2DOF on the printed UKO.
    KruytTwiceCalibratedPrinted = 8,
    /// KAO made symmetric: uniform strain and rotation with prestress, [Argilaga2018] eq. 18.
    KruytAugmented = 9,
    /// KAO as printed.
    KruytAugmentedPrinted = 10,
    /// DEMQO: small perturbations from the end state without sliding, [Argilaga2018] eq. 20.
    QuasiStatic = 11,
    /// CTO by one-sided perturbations of the whole step, [Argilaga2018] eq. 6.
    Consistent = 12,
    /// CTO by central perturbations.
    ConsistentCentral = 13,
    /// AEO: running average of the CTOs of the first committed steps, then frozen.
    ElasticAverage = 14,
    /// As `truss_like`, but contacts that slid in the ramp keep no tangential stiffness along their slip. Symmetric.
    TrussLikeReleased = 15,
    /// As `truss_like_released` with the sliding contacts of the relaxed state.
    TrussLikeReleasedAtRest = 16,
    /// As `truss_like_slip` with the sliding contacts of the relaxed state.
    TrussLikeSlipAtRest = 17,
}

crate::keywords! {
    pub TangentKind {
        None => "none",
        TrussLike => "truss_like",
        TrussLikeSlip => "truss_like_slip",
        Kruyt => "kruyt",
        KruytPrinted => "kruyt_printed",
        KruytCalibrated => "kruyt_calibrated",
        KruytCalibratedPrinted => "kruyt_calibrated_printed",
        KruytTwiceCalibrated => "kruyt_twice_calibrated",
        KruytTwiceCalibratedPrinted => "kruyt_twice_calibrated_printed",
        KruytAugmented => "kruyt_augmented",
        KruytAugmentedPrinted => "kruyt_augmented_printed",
        QuasiStatic => "quasi_static",
        Consistent => "consistent",
        ConsistentCentral => "consistent_central",
        ElasticAverage => "elastic_average",
        TrussLikeReleased => "truss_like_released",
        TrussLikeReleasedAtRest => "truss_like_released_at_rest",
        TrussLikeSlipAtRest => "truss_like_slip_at_rest",
    }
}

impl TangentKind {
    /// The kind with this wire number.
    pub fn from_wire(number: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u32 == number)
    }
}

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
    /// does not say [`Capabilities::reduces_friction`] gets 0 only.
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

/// Wall time since `start`, ns; `u64::MAX` for times that are longer than it can hold.
pub fn nanoseconds_since(start: Instant) -> u64 {
    u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX)
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

/// Why a trial or a definition was refused. The committed state is unchanged in every case.
#[derive(Clone, Debug, Error, PartialEq, Serialize, Deserialize)]
pub enum RveError {
    /// NaN or infinity in the target.
    #[error("the target deformation is not finite")]
    TargetNotFinite,
    /// `det F <= 0`.
    #[error("the target deformation turns the cell inside out: det F = {determinant:.6e}")]
    TargetInverted {
        /// Determinant of `F`.
        determinant: f64,
    },
    /// The target is farther than the engine accepts in one trial.
    #[error(
        "the target deformation |H| = {norm:.3e} exceeds the limit {limit:.3e} of one trial (`rve.largest_target`); use smaller steps"
    )]
    TargetTooLarge {
        /// Size of the target; an engine may leave pure rotation out of it.
        norm: f64,
        /// Limit of the engine.
        limit: f64,
    },
    /// The engine takes no step as large as this one, for a reason of its own.
    #[error("{0}; use smaller steps")]
    StepTooLarge(String),
    /// The solver produced NaN or infinity.
    #[error("the grain solver produced a non-finite value after {force_evaluations} force evaluations")]
    NotFinite {
        /// Force evaluations until then.
        force_evaluations: u64,
    },
    /// The step cap ended the solver before the grains were in equilibrium, and the options accept no result then.
    #[error(
        "the grains did not come to rest: strain {strain:.3e} of {target:.3e} applied in {increments} of {of} increments, \
         with a force ratio of {unbalanced:.2e} (tolerance {tolerance:.2e}) at the end of {force_evaluations} force evaluations; \
         use smaller steps, or raise the step cap: rve.max_steps, or rve.max_evaluations where it is given"
    )]
    NotEquilibrated {
        /// Largest component of the stretch that was applied.
        strain: f64,
        /// The same of the target.
        #[serde(rename = "asked")]
        target: f64,
        /// Increments of the ramp that were done.
        increments: u64,
        /// Increments of the whole ramp.
        of: u64,
        /// Value of the engine's equilibrium criterion when it gave up.
        unbalanced: f64,
        /// Value that it had to reach.
        tolerance: f64,
        /// Force evaluations spent.
        force_evaluations: u64,
    },
    /// The engine cannot deliver a requested result.
    #[error("{0} is not supported by this engine")]
    Unsupported(String),
    /// The definition does not describe a usable RVE.
    #[error("{0}")]
    Definition(String),
    /// A snapshot was refused.
    #[error("{0}")]
    Snapshot(String),
    /// No trial to commit.
    #[error("commit without a trial")]
    NothingToCommit,
    /// The engine broke down (a panic, an answer too large to send): a defect of the engine, not of the request.
    #[error("the engine broke down: {0}")]
    EngineFault(String),
}

impl RveError {
    /// What an engine that has one friction only says to a trial.
    ///
    /// # Errors
    /// [`RveError::Unsupported`] where the friction is to be reduced.
    pub fn refuse_reduced_friction(options: &TrialOptions) -> Result<(), Self> {
        match options.friction_reduction {
            0.0 => Ok(()),
            _ => Err(Self::Unsupported("friction that changes during the run".into())),
        }
    }

    /// Force evaluations spent before the refusal, as far as it says.
    pub fn force_evaluations(&self) -> u64 {
        match self {
            Self::NotFinite { force_evaluations } | Self::NotEquilibrated { force_evaluations, .. } => {
                *force_evaluations
            }
            Self::TargetNotFinite
            | Self::TargetInverted { .. }
            | Self::TargetTooLarge { .. }
            | Self::StepTooLarge(_)
            | Self::Unsupported(_)
            | Self::Definition(_)
            | Self::Snapshot(_)
            | Self::NothingToCommit
            | Self::EngineFault(_) => 0,
        }
    }
}

/// Definition of an RVE: opaque to everyone but the engine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Definition {
    /// Engine-specific description (packing, contact law, options).
    #[serde(with = "serde_bytes")]
    pub bytes: Vec<u8>,
}

impl Definition {
    /// Its content identity.
    pub fn id(&self) -> ContentId {
        ContentId::of(&self.bytes)
    }
}

/// What a snapshot of an engine holds. Both are opaque bytes to everybody else.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SnapshotKind {
    /// The whole state: restoring it costs no solving.
    #[default]
    State,
    /// The path of committed targets: restoring it solves them again from the initial state, unless the worker still
    /// holds the end of the path. Costs grow with the length of the run.
    Path,
}

/// What an engine can do; declared in its hello and checked before a run starts.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Capabilities {
    /// Engine name as in snapshots.
    pub engine: String,
    /// Engine version, for people.
    pub version: String,
    /// Space dimensions served, 2 and/or 3.
    pub dimensions: Vec<u32>,
    /// Tangent kinds served beside [`TangentKind::None`].
    pub tangents: Vec<TangentKind>,
    /// Contact laws served, by the keywords of scene files.
    #[serde(default)]
    pub laws: Vec<String>,
    /// What its snapshots hold.
    #[serde(default)]
    pub snapshot: SnapshotKind,
    /// Whether the same request has the same result, bit for bit, in every worker of this engine and version.
    #[serde(default)]
    pub deterministic: bool,
    /// Trials of one definition that a worker solves side by side, in little more time than it takes for one of them; 0 is read as 1.
    #[serde(default)]
    pub side_by_side: u32,
    /// Whether it follows [`TrialOptions::friction_reduction`].
    #[serde(default)]
    pub reduces_friction: bool,
    /// Optional results that it delivers when they are requested, by the keywords of [`OptionalResult`]. Words that are not known stand for
    /// results of later versions.
    #[serde(default)]
    pub observables: Vec<String>,
    /// What it follows of the parts of definitions that not every engine follows, by their keys in scenes. The list of them belongs to
    /// those who write definitions.
    #[serde(default)]
    pub features: Vec<String>,
}

impl Capabilities {
    /// The optional results that the engine does not deliver.
    pub fn lacking(&self) -> Vec<OptionalResult> {
        let is_missing = |result: &OptionalResult| !self.observables.iter().any(|word| word == result.keyword());
        OptionalResult::ALL.into_iter().filter(is_missing).collect()
    }
}

/// One RVE with a committed and at most one trial state.
pub trait RveSolver: Send {
    /// Deforms from the committed state by `target` (`H = F - I`, relative to the committed cell).
    ///
    /// Replaces an earlier trial state; the committed state stays as it is.
    ///
    /// # Errors
    /// See [`RveError`]; there is no trial state afterwards.
    fn trial(&mut self, target: &Tensor2, options: &TrialOptions) -> Result<TrialResult, RveError>;

    /// Makes the trial state the committed state.
    ///
    /// # Errors
    /// [`RveError::NothingToCommit`] without a trial.
    fn commit(&mut self) -> Result<(), RveError>;

    /// Drops the trial state.
    fn rollback(&mut self);

    /// Writes the committed state as a sealed snapshot; `out` is overwritten.
    fn snapshot(&self, out: &mut Vec<u8>);

    /// Writes the trial state as a sealed snapshot; `out` is overwritten.
    ///
    /// # Errors
    /// [`RveError::NothingToCommit`] without a trial.
    fn snapshot_trial(&self, out: &mut Vec<u8>) -> Result<(), RveError>;

    /// Replaces the committed state; drops the trial state.
    ///
    /// # Errors
    /// [`RveError::Snapshot`] with the reason; the committed state is unchanged.
    fn restore(&mut self, bytes: &[u8]) -> Result<(), RveError>;

    /// Identity of everything besides the state that answers depend on. Solvers of one engine with equal identities answer requests for
    /// states of each other's definitions, so that cells that differ in their initial state only are solved together. `None`: the
    /// definition itself.
    fn model_identity(&self) -> Option<ContentId> {
        None
    }

    /// Solves several requests at once, each from a state of its own. Every result is what [`restore`](Self::restore),
    /// [`trial`](Self::trial) and [`snapshot_trial`](Self::snapshot_trial) would give for its request alone, to the
    /// bit; an engine that solves several cells at once overrides this to be faster. The committed state afterwards is
    /// not specified; there is no trial state.
    fn solve_batch(&mut self, requests: &[TrialRequest<'_>]) -> Vec<Result<(TrialResult, Vec<u8>), RveError>> {
        requests.iter().map(|request| solve_alone(self, request)).collect()
    }
}

/// A trial from a state of its own.
#[derive(Clone, Copy, Debug)]
pub struct TrialRequest<'a> {
    /// The definition that the state belongs to: that of the solver, or one with the same [`RveSolver::model_identity`].
    pub definition: DefinitionId,
    /// Sealed snapshot of the committed state.
    pub state: &'a [u8],
    /// The target, relative to the cell of that state.
    pub target: Tensor2,
    /// What to deliver.
    pub options: TrialOptions,
}

/// The result of one request with the sealed snapshot of the trial state.
///
/// # Errors
/// See [`RveError`].
pub fn solve_alone<T: RveSolver + ?Sized>(
    solver: &mut T,
    request: &TrialRequest<'_>,
) -> Result<(TrialResult, Vec<u8>), RveError> {
    solver.restore(request.state)?;
    let answer = solver.trial(&request.target, &request.options)?;
    let mut state = Vec::new();
    let written = solver.snapshot_trial(&mut state);
    solver.rollback();
    written.map(|()| (answer, state))
}

/// Builds RVEs from definitions.
pub trait RveEngine: Send {
    /// What this engine can do.
    fn capabilities(&self) -> Capabilities;

    /// Builds an RVE in its initial committed state.
    ///
    /// # Errors
    /// [`RveError::Definition`] with the reason.
    fn create(&mut self, definition: &Definition) -> Result<Box<dyn RveSolver>, RveError>;
}
