//! The keys that say how the solver goes: `[solver]` and `[loading]`, for the run and for its stages.

use super::document::Document;
use super::input_error::InputError;
use super::schema::{
    AdaptKeyword, ComponentKeyword, ControlTable, EquationKeyword, FormulationKeyword, HourglassKeyword,
    LoadingTable, PredictorKeyword, SolverTable,
};
use super::strategies::{criteria, preset, refine};
use macro_solver::element::hourglass::HourglassControl;
use macro_solver::formulation::Formulation;
use macro_solver::problem::{
    EquationSolver, PathControl, Predictor, Problem, SecantGates, Stabilisation, StepControl, StepRule, Strategy,
    Tolerances,
};
use protocol::TangentKind;
use toml::Spanned;

/// What holds for the whole run.
pub(super) fn equations(problem: &mut Problem, table: &SolverTable) {
    if let Some(keyword) = &table.formulation {
        problem.formulation = formulation(*keyword.get_ref());
    }
    if let Some(keyword) = &table.equations {
        problem.equations = match keyword.get_ref() {
            EquationKeyword::Direct => EquationSolver::Direct,
            EquationKeyword::Iterative => EquationSolver::Iterative,
        };
    }
    let coefficient = table.hourglass_coefficient.as_ref().map(|given| *given.get_ref());
    let coefficient = coefficient.unwrap_or(problem.hourglass.coefficient());
    problem.hourglass =
        match table.hourglass.as_ref().map_or_else(HourglassKeyword::default, |given| *given.get_ref()) {
            HourglassKeyword::Stiffness => HourglassControl::Stiffness { coefficient },
            HourglassKeyword::Viscous => HourglassControl::Viscous { coefficient },
        };
}

/// Refuses keys of a stage that can only hold for the whole run.
///
/// # Errors
/// The first such key.
pub(super) fn refuse_equations(document: &Document, table: &SolverTable) -> Result<(), InputError> {
    let spans = [
        table.formulation.as_ref().map(Spanned::span),
        table.equations.as_ref().map(Spanned::span),
        table.hourglass_coefficient.as_ref().map(Spanned::span),
        table.hourglass.as_ref().map(Spanned::span),
    ];
    match spans.into_iter().flatten().next() {
        None => Ok(()),
        Some(span) => Err(document
            .error_at(span, "this can only be chosen for the whole run")
            .hint("move it to the table [solver] at the top of the scene")),
    }
}

fn formulation(keyword: FormulationKeyword) -> Formulation {
    match keyword {
        FormulationKeyword::SmallStrain => Formulation::SmallStrain,
        FormulationKeyword::TotalLagrangian => Formulation::TotalLagrangian,
        FormulationKeyword::Updated => Formulation::UpdatedLagrangian,
        FormulationKeyword::Corotational => Formulation::Corotational,
    }
}

/// Changes what the keys of a table say.
///
/// # Errors
/// Keys about creep through snaps where nothing creeps.
pub(super) fn step_control(
    document: &Document,
    control: &mut StepControl,
    table: &LoadingTable,
) -> Result<(), InputError> {
    replace(&mut control.increments, &table.increments);
    replace(&mut control.min, &table.smallest_increment);
    replace(&mut control.growth, &table.growth);
    replace(&mut control.cut, &table.cut);
    replace(&mut control.target_iterations, &table.easy_iterations);
    replace(&mut control.max_iterations, &table.max_iterations);
    match table.adapt {
        Some(AdaptKeyword::Easy) => control.rule = StepRule::Easy,
        Some(AdaptKeyword::Target) => control.rule = StepRule::Target,
        None => {}
    }
    if let Some(path) = &table.control {
        control.path = path_control(path);
    }
    stabilisation(document, control, table)
}

/// Whether and how stages creep through snaps; `control` knows already what a step prescribes.
fn stabilisation(document: &Document, control: &mut StepControl, table: &LoadingTable) -> Result<(), InputError> {
    let switch = table.stabilise.as_ref().map(Spanned::span);
    let settings = [&table.stabilise_after, &table.stabilise_increments];
    let drag = table.stabilise_drag.as_ref().map(Spanned::span);
    let setting = settings.into_iter().flatten().map(Spanned::span).chain(drag).next();
    if let Some(span) = switch.or(setting.clone()).filter(|_| control.path != PathControl::Load) {
        return Err(document
            .error_at(span, "where the load factor is an unknown, steps are never stabilised")
            .hint("leave this key out, or let the steps prescribe the load: control = \"load\""));
    }
    match table.stabilise.as_ref().map(|given| *given.get_ref()) {
        Some(false) => control.stabilisation = None,
        Some(true) => control.stabilisation = control.stabilisation.or(Some(Stabilisation::default())),
        None => {}
    }
    match (&mut control.stabilisation, setting) {
        (None, Some(span)) => Err(document
            .error_at(span, "this says how steps are stabilised, and stabilise = false says that they are not")
            .hint("leave this key out, or write stabilise = true beside it")),
        (None, None) => Ok(()),
        (Some(stabilisation), _) => {
            let after = table.stabilise_after.as_ref().map(|after| *after.get_ref());
            stabilisation.after = after.or(stabilisation.after);
            replace(&mut stabilisation.most_increments, &table.stabilise_increments);
            replace(&mut stabilisation.drag, &table.stabilise_drag);
            Ok(())
        }
    }
}

fn path_control(table: &ControlTable) -> PathControl {
    match table.clone() {
        ControlTable::Load => PathControl::Load,
        ControlTable::ArcLength(arc) => {
            let component = arc.component.map(ComponentKeyword::axis);
            PathControl::ArcLength { first_load: arc.first_load, measured: arc.set.map(|set| (set, component)) }
        }
        ControlTable::Indirect(indirect) => PathControl::Indirect {
            nodes: indirect.set,
            relative_to: indirect.relative_to,
            axis: indirect.component.axis(),
            growth: indirect.growth,
        },
    }
}

/// Changes what the keys of a table say.
pub(super) fn tolerances(tolerances: &mut Tolerances, table: &SolverTable) {
    replace(&mut tolerances.force, &table.force_tolerance);
    replace(&mut tolerances.displacement, &table.displacement_tolerance);
    criteria(tolerances, table);
}

fn replace<T: Copy>(target: &mut T, given: &Option<Spanned<T>>) {
    if let Some(given) = given {
        *target = *given.get_ref();
    }
}

/// Changes what the keys of a table say.
///
/// # Errors
/// An operator with which the solver cannot work.
pub(super) fn strategy(document: &Document, strategy: &mut Strategy, table: &SolverTable) -> Result<(), InputError> {
    preset(document, strategy, table)?;
    if let Some(tangent) = &table.tangent {
        if *tangent.get_ref() == TangentKind::None {
            return Err(document
                .error_at(tangent.span(), "the solver cannot work without a tangent operator")
                .hint("use \"truss_like_slip\", \"truss_like\" or another operator of docs/scene.md"));
        }
        strategy.tangent = *tangent.get_ref();
    }
    match table.predictor {
        Some(PredictorKeyword::Linear) => strategy.predictor = Predictor::Linear,
        Some(PredictorKeyword::Tangent) => strategy.predictor = Predictor::Tangent,
        None => {}
    }
    if let Some(secant) = table.secant {
        let gates = strategy.secant.unwrap_or_default();
        strategy.secant = secant.enabled.then_some(SecantGates {
            min_change: secant.min_change.unwrap_or(gates.min_change),
            max_ratio: secant.max_ratio.unwrap_or(gates.max_ratio),
            floor: secant.floor.unwrap_or(gates.floor),
            carried: secant.carried.unwrap_or(gates.carried),
        });
    }
    if let Some(floor) = &table.tangent_floor {
        strategy.tangent_floor = (*floor.get_ref() != 0.0).then_some(*floor.get_ref());
    }
    refine(strategy, table);
    replace(&mut strategy.capped_change, &table.capped_change);
    strategy.keep_unchanged = table.keep_unchanged.unwrap_or(strategy.keep_unchanged);
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
            "rve.operator.probe=2e-6",
            "rve.operator.quasi_static_probe=3e-7",
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
        let gates = strategy.secant.unwrap();
        assert_eq!((gates.floor, gates.max_ratio), (0.3, 2.0));
        assert_eq!(self::strategy(&["solver.tangent_floor=0"]).tangent_floor, None, "0 takes the floor away");
        assert_eq!(self::strategy(&["solver.secant={ enabled = false, floor = 0.3 }"]).secant, None);
    }

    #[test]
    fn defects_of_operators_name_their_key() {
        let reason = |more: &str| scene(&[more]).err().unwrap_or_else(|| panic!("{more} was accepted"));
        let refused = reason("solver.tangent=none");
        assert!(refused.contains("without a tangent") && refused.contains("truss_like_slip"), "{refused}");
        let refused = reason("solver.tangent=trusslike");
        assert!(refused.contains("trusslike") && refused.contains("truss_like"), "{refused}");
        for (defect, said) in [
            ("solver.tangent_floor=-0.1", "solver.tangent_floor"),
            ("solver.tangent_floor=1.5", "solver.tangent_floor"),
            ("solver.tangent_flor=0.1", "tangent_flor"),
            ("rve.operator.probe=0", "rve.operator.perturbation"),
            ("rve.operator.probe=0.1", "too large"),
            ("rve.operator.quasi_static_probe=-1e-6", "rve.operator.quasi_static_perturbation"),
            ("rve.operator.quasi_static_tolerance=nan", "rve.operator.quasi_static_tolerance"),
            ("rve.operator.average_steps=0", "at least 1"),
            ("rve.operator.probes=1e-6", "probes"),
        ] {
            let refused = reason(defect);
            assert!(refused.contains(said), "{defect}: {refused}");
        }
    }
}
