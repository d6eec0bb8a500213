//! Keys of `[solver]` about strategies by name, renewal of tangents, quasi-Newton pairs and convergence criteria.

use super::document::Document;
use super::input_error::InputError;
use super::schema::{CriterionKeyword, RenewalKeyword, SolverTable};
use macro_solver::problem::{
    Criteria, DisplacementMeasure, ForceMeasure, NamedStrategy, QuasiNewton, Renewal, Strategy, Tolerances,
};

/// Replaces `strategy` by the one that the table names, if it names one.
///
/// # Errors
/// There is no strategy of that name.
pub(super) fn preset(document: &Document, strategy: &mut Strategy, table: &SolverTable) -> Result<(), InputError> {
    let Some(name) = &table.strategy else { return Ok(()) };
    let named = NamedStrategy::of_keyword(name.get_ref()).ok_or_else(|| {
        let names: Vec<&str> = NamedStrategy::ALL.into_iter().map(NamedStrategy::keyword).collect();
        document
            .error_at(name.span(), format!("there is no strategy '{}'", name.get_ref()))
            .hint(format!("there are: {}; docs/concepts/strategies.md compares them", names.join(", ")))
    })?;
    *strategy = named.preset();
    Ok(())
}

/// Applies the detailed keys.
pub(super) fn refine(strategy: &mut Strategy, table: &SolverTable) {
    match table.renewal {
        Some(RenewalKeyword::Always) => strategy.renewal = Renewal::Always,
        Some(RenewalKeyword::WhenSlow) => strategy.renewal = Renewal::WHEN_SLOW,
        Some(RenewalKeyword::EachStep) => strategy.renewal = Renewal::EachStep,
        Some(RenewalKeyword::Once) => strategy.renewal = Renewal::Once,
        None => {}
    }
    if let Renewal::WhenSlow { contraction, most_uses } = &mut strategy.renewal {
        *contraction = table.renewal_contraction.as_ref().map_or(*contraction, |given| *given.get_ref());
        *most_uses = table.renewal_uses.as_ref().map_or(*most_uses, |given| *given.get_ref());
    }
    if let Some(pairs) = &table.quasi_newton_pairs {
        let settings = strategy.quasi_newton.unwrap_or_default();
        let pairs = *pairs.get_ref();
        strategy.quasi_newton = (pairs > 0).then_some(QuasiNewton { pairs, ..settings });
    }
    if let Some(grid) = &table.target_grid {
        strategy.target_grid = (*grid.get_ref() != 0.0).then_some(*grid.get_ref());
    }
}

/// Applies the keys about convergence beyond the two tolerances.
pub(super) fn criteria(tolerances: &mut Tolerances, table: &SolverTable) {
    if let Some(energy) = &table.energy_tolerance {
        tolerances.energy = *energy.get_ref();
    }
    let Some(keywords) = &table.criteria else { return };
    let mut criteria = Criteria { force: None, displacement: None, energy: false };
    for keyword in keywords.get_ref() {
        match keyword {
            CriterionKeyword::Force => criteria.force = Some(ForceMeasure::Largest),
            CriterionKeyword::ForceOverReactions => criteria.force = Some(ForceMeasure::Reactions),
            CriterionKeyword::Displacement => criteria.displacement = Some(DisplacementMeasure::FullStep),
            CriterionKeyword::CorrectionOverStep => criteria.displacement = Some(DisplacementMeasure::Step),
            CriterionKeyword::Energy => criteria.energy = true,
        }
    }
    tolerances.criteria = criteria;
}
