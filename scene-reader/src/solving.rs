//! `[solver]` and `[loading]`, for the run and for its stages: written keys over those that hold otherwise.

use super::document::Document;
use super::input_error::InputError;
use super::tables::SolverTable;
use keys::{Given, Table};
use macro_solver::problem::{EquationSettings, LoadingSettings, NamedStrategy, PathControl, Problem, Stage};

/// Sets what holds for the whole run.
///
/// # Errors
/// A value that does not fit, which the check of the document excludes.
pub(super) fn equations(
    document: &Document,
    problem: &mut Problem,
    given: &Given<SolverTable>,
) -> Result<(), InputError> {
    let settings = given.over(&EquationSettings::of(problem)).map_err(|fault| document.fault(&fault))?;
    let EquationSettings { formulation, equations, hourglass } = settings;
    (problem.formulation, problem.equations, problem.hourglass) = (formulation, equations, hourglass);
    Ok(())
}

/// Refuses keys of a stage, whose tables stand at `place`, that can only hold for the whole run.
///
/// # Errors
/// The first such key.
pub(super) fn refuse_equations(
    document: &Document,
    place: &[&str],
    given: &Given<SolverTable>,
) -> Result<(), InputError> {
    let table = Table::of::<SolverTable>();
    match table.keys.iter().find(|key| key.run_wide && given.has(&key.name)) {
        None => Ok(()),
        Some(key) => Err(document
            .error_at_key(&[place, &["solver", &key.name]].concat(), "this can only be chosen for the whole run")
            .hint("move it to the table [solver] at the top of the scene")),
    }
}

/// Changes what the written keys of `[loading]` say; the table stands below `place`.
///
/// # Errors
/// Keys about stabilisation where nothing is stabilised.
pub(super) fn loading(
    document: &Document,
    stage: &mut Stage,
    place: &[&str],
    given: &Given<LoadingSettings>,
) -> Result<(), InputError> {
    let before = LoadingSettings::of(stage);
    let LoadingSettings { duration, control } = given.over(&before).map_err(|fault| document.fault(&fault))?;
    let settings = ["stabilise_after", "stabilise_increments", "stabilise_viscosity", "commit_iterates_after"];
    let setting = settings.into_iter().find(|key| given.has(key));
    let refuse = |key: &str, problem: &str, hint: &str| {
        Err(document.error_at_key(&[place, &["loading", key]].concat(), problem).hint(hint))
    };
    let switch = given.has("stabilise").then_some("stabilise");
    if let Some(key) = switch.or(setting).filter(|_| control.path != PathControl::Load) {
        return refuse(
            key,
            "where the load factor is an unknown, steps are never stabilised",
            "leave this key out, or let the steps prescribe the load: control = \"load\"",
        );
    }
    if let (None, Some(key)) = (control.stabilisation, setting) {
        return refuse(
            key,
            "this key sets how steps are stabilised, but stabilise = false switches stabilisation off",
            "leave this key out, or add stabilise = true",
        );
    }
    (stage.duration, stage.control) = (duration, control);
    Ok(())
}

/// Changes what the written keys of `[solver]` say.
///
/// # Errors
/// A value that does not fit, which the check of the document excludes.
pub(super) fn solver(document: &Document, stage: &mut Stage, given: &Given<SolverTable>) -> Result<(), InputError> {
    let named: Option<NamedStrategy> = given.get("strategy").map_err(|fault| document.fault(&fault))?;
    if let Some(named) = named {
        stage.strategy = named.preset();
    }
    stage.tolerances = given.over(&stage.tolerances).map_err(|fault| document.fault(&fault))?;
    stage.strategy = given.over(&stage.strategy).map_err(|fault| document.fault(&fault))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::weak_element as scene;
    use macro_solver::problem::Strategy;
    use protocol::TangentKind;
    use rve_server::definition::OperatorOptions;

    fn strategy(more: &[&str]) -> Strategy {
        scene(more).unwrap().problem.stages[0].strategy.clone()
    }

    #[test]
    fn every_operator_can_be_asked_for_by_its_keyword() {
        for kind in TangentKind::ALL.into_iter().filter(|kind| *kind != TangentKind::None) {
            let text = format!("solver.tangent={}", kind.keyword());
            assert_eq!(strategy(&[&text]).tangent, kind);
            // The key goes before the strategy's own operator.
            assert_eq!(strategy(&[&text, "solver.strategy=newton"]).tangent, kind);
        }
        assert_eq!(strategy(&[]).tangent, Strategy::default().tangent);
    }

    #[test]
    fn options_of_operators_arrive_where_they_are_used() {
        let more = [
            "rve.operator.perturbation=2e-6",
            "rve.operator.quasi_static_perturbation=3e-7",
            "rve.operator.quasi_static_tolerance=1e-8",
            "rve.operator.average_steps=3",
            "solver.tangent_floor=0.1",
            "solver.secant={ enabled = true, floor = 0.3, max_ratio = 2.0 }",
        ];
        let scene = scene(&more).unwrap();
        let expected = OperatorOptions {
            perturbation: Some(2e-6),
            quasi_static_perturbation: Some(3e-7),
            quasi_static_tolerance: Some(1e-8),
            average_steps: Some(3),
        };
        for definition in &scene.materials.definitions {
            assert_eq!(definition.options().operator, expected, "every region's cells have them");
        }
        let strategy = &scene.problem.stages[0].strategy;
        assert_eq!(strategy.tangent_floor, Some(0.1));
        let secant = strategy.secant.unwrap();
        assert_eq!((secant.floor, secant.max_ratio), (0.3, 2.0));
        assert_eq!(self::strategy(&["solver.tangent_floor=0"]).tangent_floor, None, "0 takes the floor away");
        assert_eq!(self::strategy(&["solver.secant={ enabled = false, floor = 0.3 }"]).secant, None);
    }

    #[test]
    fn defects_of_operators_name_their_key() {
        let reason = |more: &str| scene(&[more]).err().unwrap_or_else(|| panic!("{more} was accepted"));
        let refused = reason("solver.tangent=none");
        assert!(refused.contains("\"none\" is unknown") && refused.contains("truss_like_slip"), "{refused}");
        let refused = reason("solver.tangent=trusslike");
        assert!(refused.contains("trusslike") && refused.contains("truss_like"), "{refused}");
        for (defect, said) in [
            ("solver.tangent_floor=-0.1", "solver.tangent_floor"),
            ("solver.tangent_floor=1.5", "solver.tangent_floor"),
            ("solver.tangent_flor=0.1", "tangent_flor"),
            ("rve.operator.perturbation=0", "rve.operator.perturbation"),
            ("rve.operator.perturbation=0.1", "at most 0.01"),
            ("rve.operator.quasi_static_perturbation=-1e-6", "rve.operator.quasi_static_perturbation"),
            ("rve.operator.quasi_static_tolerance=nan", "rve.operator.quasi_static_tolerance"),
            ("rve.operator.average_steps=0", "at least 1"),
            ("rve.operator.perturbations=1e-6", "perturbations"),
        ] {
            let refused = reason(defect);
            assert!(refused.contains(said), "{defect}: {refused}");
        }
    }
}
