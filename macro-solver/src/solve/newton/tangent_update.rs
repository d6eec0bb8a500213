//! When tangents are requested, and when the global matrix is factorized with them.

use crate::problem::TangentUpdate;
use protocol::TangentKind;
use serde::{Deserialize, Serialize};

/// Out-of-balance force over reactions and loads beyond which an iterate is far from equilibrium, as where a body loses or finds its
/// contacts: every iterate then gets its own tangents.
const ROUGH: f64 = 0.1;

/// Share of the out-of-balance force that an iteration leaves at most where the material is smooth.
const SMOOTH: f64 = 0.5;

/// Iterations in which the out-of-balance force grows after which an attempt goes on with tangents of the frozen network. A contact that slid in the
/// ramp of one iterate sticks in that of the next; tangents that let it slide are then too soft, and the corrections overshoot.
const MOST_GROWTHS: u32 = 2;

/// State of the tangents in use.
#[derive(Clone, Debug)]
pub(in crate::solve) struct TangentUpdater {
    tangent_update: TangentUpdate,
    /// Whether point tangents change between renewals, by secant corrections.
    corrected: bool,
    /// The next evaluation asks for tangents.
    due: bool,
    /// Tangents have come that no factorization has seen.
    fresh: bool,
    /// Iterations since the factorization.
    uses: usize,
    last_residual: Option<f64>,
    /// Of the rules that ask where iterations are slow: the attempt is not smooth, and every further iterate gets tangents.
    is_rough: bool,
    /// Whether the attempt has contracted at every iterate as that of a smooth material does, whatever the rule.
    is_smooth: bool,
    /// Accepted iterates of the attempt that are farther from balance than the one before.
    growths: u32,
}

/// What of it outlives a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::solve) struct TangentUpdaterRecord {
    due: bool,
    is_rough: bool,
    uses: u64,
}

impl TangentUpdater {
    pub(in crate::solve) fn new(tangent_update: TangentUpdate, corrected: bool) -> Self {
        // Secants correct the tangents of every iterate; without them there is nothing to correct.
        let tangent_update = match tangent_update {
            TangentUpdate::EachStepOrSlow { .. }
            | TangentUpdate::SecondIterate
            | TangentUpdate::SecondIterateOrSlow { .. }
                if corrected =>
            {
                TangentUpdate::Always
            }
            update @ (TangentUpdate::Always
            | TangentUpdate::WhenSlow { .. }
            | TangentUpdate::EachStep
            | TangentUpdate::EachStepOrSlow { .. }
            | TangentUpdate::SecondIterate
            | TangentUpdate::SecondIterateOrSlow { .. }
            | TangentUpdate::Once) => update,
        };
        // Nothing is known about a step before the first.
        Self {
            tangent_update,
            corrected,
            due: true,
            fresh: true,
            uses: 0,
            last_residual: None,
            is_rough: true,
            is_smooth: false,
            growths: 0,
        }
    }

    /// The initial state has been evaluated; `suffices` if its tangents are of the kind that is wanted.
    pub(in crate::solve) fn started(&mut self, suffices: bool) {
        self.due = !(suffices && self.tangent_update == TangentUpdate::Once);
    }

    /// Kind to ask for at the next evaluation.
    pub(in crate::solve) fn kind(&self, wanted: TangentKind) -> TangentKind {
        if !self.due {
            TangentKind::None
        } else if self.diverges() {
            without_slip(wanted)
        } else {
            wanted
        }
    }

    /// Whether the iterations of the attempt lead away from balance, of the rules that ask where iterations are slow.
    fn diverges(&self) -> bool {
        self.growths >= MOST_GROWTHS && self.asks_where_slow()
    }

    /// Whether the global matrix is to be factorized at the iterate just evaluated.
    pub(in crate::solve) fn factorizes(&self) -> bool {
        self.fresh || self.corrected || self.tangent_update == TangentUpdate::Always
    }

    /// An attempt begins; `again` after a failed one.
    pub(in crate::solve) fn begin_attempt(&mut self, again: bool) {
        self.last_residual = None;
        self.growths = 0;
        let was_rough = std::mem::replace(&mut self.is_rough, again);
        self.is_smooth = !again;
        self.due = match self.tangent_update {
            TangentUpdate::Always | TangentUpdate::EachStep | TangentUpdate::EachStepOrSlow { .. } => true,
            TangentUpdate::SecondIterate | TangentUpdate::SecondIterateOrSlow { .. } => again || was_rough,
            TangentUpdate::WhenSlow { .. } | TangentUpdate::Once => again || self.due,
        };
    }

    /// Supports, links or loads turn back: tangents of the step before, in which contacts slid the other way, mislead.
    pub(in crate::solve) fn turned(&mut self) {
        self.due |= self.asks_where_slow() || self.tangent_update == TangentUpdate::SecondIterate;
    }

    /// Whether slow iterations have further iterates ask for tangents.
    fn asks_where_slow(&self) -> bool {
        matches!(
            self.tangent_update,
            TangentUpdate::EachStepOrSlow { .. } | TangentUpdate::SecondIterateOrSlow { .. }
        )
    }

    /// All points have answered.
    pub(in crate::solve) fn evaluated(&mut self) {
        self.fresh |= self.due;
        let is_rough = self.is_rough && self.asks_where_slow();
        self.due = is_rough || self.tangent_update == TangentUpdate::Always;
    }

    /// Whether every iteration of the attempt has left at most [`SMOOTH`] of the out-of-balance force, none of them was far from
    /// equilibrium or rejected, and it is the first at its step.
    pub(in crate::solve) fn is_smooth(&self) -> bool {
        self.is_smooth
    }

    /// The global matrix has been factorized.
    pub(in crate::solve) fn factorized(&mut self) {
        self.fresh = false;
        self.uses = 0;
    }

    /// Judges the tangents in use by the out-of-balance force of an accepted iterate, N, and its ratio to the forces that it is
    /// measured by.
    pub(in crate::solve) fn judge(&mut self, residual: f64, force_ratio: f64) {
        self.uses += 1;
        let is_first = self.last_residual.is_none();
        let slow = |contraction: f64| self.last_residual.is_some_and(|last| residual > contraction * last);
        self.growths += u32::from(slow(1.0));
        self.is_smooth &= !slow(SMOOTH) && force_ratio <= ROUGH;
        let is_worn = match self.tangent_update {
            TangentUpdate::WhenSlow { contraction, most_uses } => slow(contraction) || self.uses >= most_uses,
            TangentUpdate::EachStepOrSlow { contraction } => {
                self.is_rough |= slow(contraction) || force_ratio > ROUGH;
                self.is_rough
            }
            TangentUpdate::SecondIterateOrSlow { contraction } => {
                self.is_rough |= slow(contraction) || force_ratio > ROUGH;
                is_first || self.is_rough
            }
            TangentUpdate::SecondIterate => is_first,
            TangentUpdate::Always | TangentUpdate::EachStep | TangentUpdate::Once => false,
        };
        // Tangents that this very iterate has brought are as good as they get; where the attempt is rough, the next one needs its own.
        self.due |= is_worn && (!self.fresh || self.is_rough && self.asks_where_slow());
        self.last_residual = Some(residual);
    }

    /// An iterate has been rejected: where tangents mislead that far, the next one gets its own.
    pub(in crate::solve) fn rejected(&mut self) {
        (self.is_rough, self.is_smooth) = (true, false);
        self.due |= self.asks_where_slow();
    }

    pub(in crate::solve) fn record(&self) -> TangentUpdaterRecord {
        TangentUpdaterRecord { due: self.due, is_rough: self.is_rough, uses: self.uses as u64 }
    }

    pub(in crate::solve) fn restore(&mut self, record: TangentUpdaterRecord) {
        (self.due, self.is_rough) = (record.due, record.is_rough);
        self.uses = usize::try_from(record.uses).unwrap_or(usize::MAX);
    }

    /// Whether the next step may use the factors in place.
    pub(in crate::solve) fn keeps_factors(&self) -> bool {
        self.tangent_update.keeps() && !self.fresh
    }

    /// The factors of an earlier process are in place again.
    pub(in crate::solve) fn keep_factors(&mut self) {
        self.fresh = false;
    }
}

/// The frozen network in place of an operator of the same network with slip; other operators stay what they are.
fn without_slip(kind: TangentKind) -> TangentKind {
    match kind {
        TangentKind::TrussLikeSlip
        | TangentKind::TrussLikeSlipAtRest
        | TangentKind::TrussLikeReleased
        | TangentKind::TrussLikeReleasedAtRest => TangentKind::TrussLike,
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WANTED: TangentKind = TangentKind::TrussLike;

    /// Kinds asked for over evaluations with these residuals, all within one attempt.
    fn requests(tangent_update: TangentUpdate, residuals: &[f64]) -> String {
        let mut tangents = TangentUpdater::new(tangent_update, false);
        tangents.started(true);
        let mut letters = String::new();
        for attempt in 0..2 {
            tangents.begin_attempt(false);
            for &residual in residuals {
                let asks = tangents.kind(WANTED) == WANTED;
                tangents.evaluated();
                tangents.judge(residual, 0.01);
                let factorizes = tangents.factorizes();
                letters.push(if asks { 'T' } else { 's' });
                if factorizes {
                    tangents.factorized();
                    letters.push('F');
                }
            }
            letters.push(if attempt == 0 { ' ' } else { '.' });
        }
        letters
    }

    #[test]
    fn tangents_are_asked_for_as_the_rule_says() {
        assert_eq!(requests(TangentUpdate::Always, &[1.0, 0.1]), "TFTF TFTF.");
        assert_eq!(requests(TangentUpdate::EachStep, &[1.0, 0.1, 0.01]), "TFss TFss.");
        assert_eq!(
            requests(TangentUpdate::Once, &[1.0, 0.1]),
            "sFs ss.",
            "the elastic ones of the initial state serve"
        );
        assert_eq!(requests(TangentUpdate::WHEN_SLOW, &[1.0, 0.4, 0.15]), "TFss sss.");
        assert_eq!(requests(TangentUpdate::WHEN_SLOW, &[1.0, 0.8, 0.1]), "TFsTF ssTF.");
        let each_step_or_slow = TangentUpdate::EachStepOrSlow { contraction: 0.5 };
        assert_eq!(requests(each_step_or_slow, &[1.0, 0.4, 0.15]), "TFss TFss.");
        assert_eq!(requests(each_step_or_slow, &[1.0, 0.8, 0.1, 0.09]), "TFsTFTF TFsTFTF.");
        assert_eq!(requests(TangentUpdate::SecondIterate, &[1.0, 0.8, 0.7]), "TFss sTFs.", "slow or not");
        assert_eq!(requests(TangentUpdate::SecondIterate, &[1.0]), "TF s.");
        assert_eq!(requests(TangentUpdate::SECOND_ITERATE_OR_SLOW, &[1.0, 0.4, 0.15]), "TFss sTFs.");
        assert_eq!(requests(TangentUpdate::SECOND_ITERATE_OR_SLOW, &[1.0]), "TF s.", "a first iterate in balance");
        assert_eq!(requests(TangentUpdate::SECOND_ITERATE_OR_SLOW, &[1.0, 0.8, 0.1, 0.09]), "TFsTFTF TFsTFTF.");
        let short = TangentUpdate::WhenSlow { contraction: 0.5, most_uses: 2 };
        assert_eq!(requests(short, &[1.0, 0.1, 0.01]), "TFss TFss.");
    }

    #[test]
    fn an_attempt_is_smooth_while_it_contracts_whatever_the_rule() {
        for update in [TangentUpdate::Always, TangentUpdate::WHEN_SLOW, TangentUpdate::SECOND_ITERATE_OR_SLOW] {
            let smooth = |residuals: &[f64], again: bool| {
                let mut tangents = TangentUpdater::new(update, false);
                tangents.begin_attempt(again);
                residuals.iter().for_each(|residual| tangents.judge(*residual, 0.01));
                tangents.is_smooth()
            };
            assert!(smooth(&[1.0, 0.4, 0.1], false));
            assert!(!smooth(&[1.0, 0.8, 0.1], false), "{update:?}");
            assert!(!smooth(&[1.0, 0.4], true), "after a failed attempt");
            let mut tangents = TangentUpdater::new(update, false);
            tangents.begin_attempt(false);
            tangents.judge(1.0, 0.2);
            assert!(!tangents.is_smooth(), "far from equilibrium");
        }
    }

    #[test]
    fn tangents_that_lead_away_twice_lose_their_slip_for_the_rest_of_the_attempt() {
        let kinds = |update: TangentUpdate, wanted: TangentKind, residuals: &[f64]| {
            let mut tangents = TangentUpdater::new(update, false);
            tangents.begin_attempt(true);
            let of_iterates = residuals.iter().map(|&residual| {
                let kind = tangents.kind(wanted);
                tangents.evaluated();
                tangents.judge(residual, 0.01);
                kind
            });
            let of_iterates: Vec<TangentKind> = of_iterates.collect();
            tangents.begin_attempt(true);
            assert_eq!(tangents.kind(wanted), wanted, "the next attempt");
            of_iterates
        };
        let (slip, stick) = (TangentKind::TrussLikeSlip, TangentKind::TrussLike);
        let rule = TangentUpdate::SECOND_ITERATE_OR_SLOW;
        assert_eq!(kinds(rule, slip, &[1.0, 1.1, 0.9, 1.0, 0.2]), [slip, slip, slip, slip, stick]);
        assert_eq!(kinds(rule, slip, &[1.0, 1.1, 0.9, 0.8, 0.7]), [slip; 5], "a single one");
        let consistent = TangentKind::Consistent;
        assert_eq!(kinds(rule, consistent, &[1.0, 1.1, 1.2, 1.3]), [consistent; 4]);
        assert_eq!(kinds(TangentUpdate::Always, slip, &[1.0, 1.1, 1.2, 1.3]), [slip; 4], "full Newton");
    }

    #[test]
    fn a_failed_attempt_renews_and_corrected_tangents_are_always_factorized() {
        let mut tangents = TangentUpdater::new(TangentUpdate::Once, true);
        assert_eq!(tangents.kind(WANTED), WANTED);
        tangents.started(true);
        tangents.begin_attempt(false);
        assert_eq!(tangents.kind(WANTED), TangentKind::None);
        tangents.evaluated();
        tangents.factorized();
        assert!(tangents.factorizes());
        tangents.begin_attempt(true);
        assert_eq!(tangents.kind(WANTED), WANTED);
    }
}
