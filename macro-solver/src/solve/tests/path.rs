//! Softening, snap-through and snap-back against closed forms: columns whose cells lose their stiffness.
//!
//! With equal bulk and shear modulus `G` nothing moves sideways, and the force per area of a cell shortened to `s` times its
//! height is `G (s^3 - s)`: it grows in compression up to `s = 3^-1/2` and falls beyond.

use super::*;
use crate::material::altered::{Altered, EachAnswer};
use crate::observer::Outcome;
use crate::problem::{PathControl, Predictor, ProblemError, Strategy};
use crate::solve::newton::path::PathConstraint;

const MODULUS: f64 = 1.0e7;

/// Force per area of a cell of stiffness `factor`.
fn force(factor: f64, shortened: f64) -> f64 {
    factor * MODULUS * (shortened.powi(3) - shortened)
}

/// The state of a cell that is stiff enough to stay before its peak.
fn shortened_under(factor: f64, pressed: f64) -> f64 {
    let (mut low, mut high) = (3.0f64.powf(-0.5), 1.0);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if force(factor, middle) < pressed { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// All points from one on are stiffer.
struct Stiffer {
    from: usize,
    factor: f64,
}

impl EachAnswer for Stiffer {
    fn change(&mut self, trial: &PointTrial, answer: &mut TrialResult) {
        if trial.point >= self.from {
            answer.stress.0.iter_mut().for_each(|component| *component *= self.factor);
            let moduli = answer.tangent.iter_mut().flat_map(|tangent| tangent.0.iter_mut());
            moduli.for_each(|modulus| *modulus *= self.factor);
        }
    }
}

/// `cells` squares on top of each other; the node set `joint` lies on the lowest.
fn column(cells: usize, loading: Condition, path: PathControl) -> Problem {
    let mut mesh = block(ElementKind::Q4, 1, cells);
    let joint = (0..mesh.nodes.len()).filter(|&node| (mesh.nodes[node][1] - 1.0).abs() < 1e-9).collect();
    mesh.node_sets.insert("joint".into(), joint);
    let conditions = vec![
        Condition::fixed("bottom", Axis::Y),
        Condition::fixed("left", Axis::X),
        Condition::fixed("right", Axis::X),
        loading,
    ];
    let mut problem = Problem::new(mesh, conditions);
    let stage = &mut problem.stages[0];
    stage.control.path = path;
    stage.control.increments = 30;
    stage.tolerances = Tolerances::both(1e-9, 1e-9);
    // A floor under the tangent would hide the softening that is to be followed.
    stage.strategy = Strategy { tangent_floor: None, capped_change: 0.3, ..Strategy::default() };
    problem
}

fn material(problem: &Problem, factor: f64) -> Altered<ElasticMaterial, Stiffer> {
    let material = ElasticMaterial::new(ElasticLaw::SaintVenant, MODULUS, MODULUS, problem.point_count());
    Altered { material, alteration: Stiffer { from: 4, factor } }
}

/// Load factor and joint's height over the steps, the start first.
fn path_of(problem: &Problem, factor: f64) -> Vec<[f64; 2]> {
    #[derive(Default)]
    struct Watch(Vec<[f64; 2]>, Vec<usize>);
    impl Observer for Watch {
        fn started(&mut self, problem: &Problem) -> Result<(), StopRequest> {
            self.1.clone_from(&problem.mesh.node_sets["joint"]);
            Ok(())
        }
        fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
            self.0.push([report.load, 1.0 + fields.displacements[self.1[0]][1]]);
            Ok(())
        }
    }
    let mut watch = Watch::default();
    let finished = solve(problem, &mut material(problem, factor), &mut watch);
    assert!(matches!(finished.outcome, Outcome::Completed), "{:?}", finished.outcome);
    watch.0
}

fn pressed(value: f64) -> Condition {
    Condition::Traction { sides: "top".into(), value: [0.0, -value, 0.0] }
}

fn indirect(growth: f64) -> PathControl {
    PathControl::Indirect { nodes: "joint".into(), relative_to: Some("bottom".into()), axis: Axis::Y, growth }
}

/// The load of a single cell rises to its peak and falls, under both controls and both predictors; the load itself cannot
/// be raised beyond it.
#[test]
fn a_cell_is_followed_over_its_peak() {
    let arc = |measured: Option<(String, Option<Axis>)>| {
        let (set, component) = measured.map_or((None, None), |(set, component)| (Some(set), component));
        PathControl::ArcLength { first_load: 0.1, set, component }
    };
    let peak = 2.0 / 27.0f64.sqrt();
    let paths = [indirect(-0.75), arc(None), arc(Some(("top".to_owned(), Some(Axis::Y))))];
    for (control, predictor) in
        paths.into_iter().flat_map(|path| [Predictor::Linear, Predictor::Tangent].map(|one| (path.clone(), one)))
    {
        let mut problem = column(1, pressed(MODULUS), control.clone());
        problem.stages[0].strategy.predictor = predictor;
        if control != indirect(-0.75) {
            problem.stages[0].control.increments = 14;
        }
        let path = path_of(&problem, 1.0);
        for [load, height] in &path {
            let exact = -force(1.0, *height) / MODULUS;
            assert!((load - exact).abs() < 1e-7, "{control:?}: load {load} at {height}, exactly {exact}");
        }
        let highest = path.iter().map(|[load, _]| *load).fold(0.0, f64::max);
        let last = path.last().unwrap()[0];
        assert!(highest > 0.97 * peak && highest <= peak + 1e-7 && last < 0.8 * peak, "{control:?}: {path:?}");
    }
    let mut raised = column(1, pressed(MODULUS), PathControl::Load);
    raised.stages[0].control.min = 1e-3;
    let stuck = solve(&raised, &mut material(&raised, 1.0), &mut Recorder::default());
    assert!(matches!(stuck.outcome, Outcome::DidNotConverge { .. }));
    assert!(stuck.load <= peak + 1e-3, "{}", stuck.load);
}

/// A soft cell under six stiffer ones, shortened from above: once the soft cell gives way the others spring back, further
/// than it shortens, so that the prescribed displacement itself has to turn around.
#[test]
fn a_column_that_snaps_back_is_followed() {
    let (cells, factor) = (7, 1.5);
    let moved = Condition::Displacement { nodes: "top".into(), axis: Axis::Y, value: -2.0 };
    let problem = column(cells, moved, indirect(-0.75));
    let path = path_of(&problem, factor);
    let mut turns_back = false;
    for pair in path.windows(2) {
        turns_back |= pair[1][0] < pair[0][0] - 1e-3;
    }
    assert!(turns_back, "{path:?}");
    for [load, height] in path {
        let other = shortened_under(factor, force(1.0, height));
        let exact = ((1.0 - height) + (cells - 1) as f64 * (1.0 - other)) / 2.0;
        assert!((load - exact).abs() < 1e-7, "load {load} at {height}, exactly {exact}");
    }
}

/// Without a set the arc length measures all nodes, by the component that is named: it was not looked at.
#[test]
fn an_arc_length_without_a_set_is_that_of_all_nodes() {
    let problem = |set: Option<&str>, component| {
        let control = PathControl::ArcLength { first_load: 0.1, set: set.map(str::to_owned), component };
        let mut problem = column(2, pressed(MODULUS), control);
        let all = (0..problem.mesh.nodes.len()).collect();
        problem.mesh.node_sets.insert("all".to_owned(), all);
        problem
    };
    let weights = |set, component| {
        let problem = problem(set, component);
        match PathConstraint::new(&problem, &problem.stages[0]).unwrap() {
            Some(PathConstraint::Length { weights, .. }) => weights,
            other => panic!("{other:?}"),
        }
    };
    for (component, pattern) in [(None, [1.0, 1.0]), (Some(Axis::X), [1.0, 0.0]), (Some(Axis::Y), [0.0, 1.0])] {
        assert_eq!(weights(None, component), weights(Some("all"), component), "{component:?}");
        assert_eq!(weights(None, component)[..2], pattern, "{component:?}");
    }
    let deep = problem(None, Some(Axis::Z)).validate().unwrap_err().to_string();
    assert!(deep.contains("no direction z"), "{deep}");
}

/// It was cut back ten times, and the hint was to take smaller steps.
#[test]
fn a_control_that_measures_nothing_the_load_moves_ends_the_run_at_once() {
    let of = |nodes: &str, relative_to: Option<&str>| PathControl::Indirect {
        nodes: nodes.into(),
        relative_to: relative_to.map(str::to_owned),
        axis: Axis::Y,
        growth: -0.1,
    };
    let held = PathControl::ArcLength { first_load: 0.1, set: Some("bottom".into()), component: Some(Axis::Y) };
    for control in [of("top", Some("top")), of("bottom", None), held] {
        let problem = column(2, pressed(MODULUS), control);
        let run = solve(&problem, &mut material(&problem, 1.0), &mut Recorder::default());
        assert!(matches!(run.outcome, Outcome::Refused(ProblemError::NothingMeasured)), "{:?}", run.outcome);
        assert_eq!(run.statistics.cut_backs, 0);
    }
}
