//! The solution strategies that are compared.

use crate::effort::Effort;
use macro_solver::problem::{NamedStrategy, Predictor, Strategy};
use protocol::TangentKind;

/// A named solution strategy.
#[derive(Clone, Debug)]
pub(super) struct Variant {
    /// Name in tables.
    pub(super) name: String,
    /// The choices.
    pub(super) strategy: Strategy,
}

/// Targets are rounded to this share of the step's largest strain in the variants named `rounded`.
const GRID: f64 = 1e-6;

/// The project's own strategies.
pub(super) fn own() -> Vec<Variant> {
    let named = |named: NamedStrategy| Variant { name: named.keyword().to_owned(), strategy: named.preset() };
    NamedStrategy::ALL.into_iter().map(named).collect()
}

/// The same with rounded targets, those that are worth it.
pub(super) fn rounded() -> Vec<Variant> {
    let worth_it = [NamedStrategy::SlipNewton, NamedStrategy::SlipSecant, NamedStrategy::PointSecant];
    let round = |named: NamedStrategy| Variant {
        name: format!("{}_rounded", named.keyword()),
        strategy: Strategy { target_grid: Some(GRID), ..named.preset() },
    };
    worth_it.into_iter().map(round).collect()
}

/// Full Newton with each of the eight operators of [Argilaga2018] and its predictor.
pub(super) fn operators() -> Vec<Variant> {
    let operators = [
        ("CTO", TangentKind::Consistent),
        ("AEO", TangentKind::ElasticAverage),
        ("UKO", TangentKind::Kruyt),
        ("UCKO", TangentKind::KruytCalibrated),
        ("UCKO-2DOF", TangentKind::KruytTwiceCalibrated),
        ("KAO", TangentKind::KruytAugmented),
        ("DEMQO", TangentKind::QuasiStatic),
        ("PSTLO", TangentKind::TrussLike),
    ];
    let newton = NamedStrategy::Newton.preset();
    let variant = |(name, tangent): (&str, TangentKind)| Variant {
        name: name.to_owned(),
        strategy: Strategy { tangent, predictor: Predictor::Tangent, ..newton.clone() },
    };
    operators.into_iter().map(variant).collect()
}

/// Variants of a quick look.
const QUICK: [&str; 3] = ["slip_newton", "slip_secant_rounded", "PSTLO"];

/// Those that the command line names, which may be none of these; if it names nothing but `parts` of the study, all of them or those of a
/// quick look.
pub(super) fn chosen(variants: Vec<Variant>, effort: &Effort, parts: &[&str]) -> Vec<Variant> {
    let names_variants = effort.only.iter().any(|only| !parts.contains(&only.as_str()));
    let wanted = |variant: &Variant| match names_variants {
        true => effort.names(&variant.name),
        false => !effort.quick || QUICK.contains(&variant.name.as_str()),
    };
    variants.into_iter().filter(wanted).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_the_command_line_chooses() {
        let all = || [own(), rounded(), operators()].concat();
        let mut names: Vec<String> = all().into_iter().map(|variant| variant.name).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), all().len());
        let effort = |only: &[&str], quick| Effort {
            quick,
            full: false,
            stability: crate::stability_options::Options::default(),
            only: only.iter().map(|&name| name.to_owned()).collect(),
        };
        assert_eq!(chosen(all(), &effort(&[], false), &["element"]).len(), names.len());
        assert_eq!(chosen(all(), &effort(&["element", "UKO", "newton"], false), &["element"]).len(), 2);
        assert_eq!(chosen(all(), &effort(&[], true), &["element"]).len(), 3);
    }
}
