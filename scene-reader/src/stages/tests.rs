use crate::Scene;
use macro_solver::problem::{Amplitude, Condition, Origin, Rate, RateHistory, SmoothRamp, Stabilisation, Stage};
use std::path::Path;

fn stages(more: &[&str]) -> Result<Vec<Stage>, String> {
    stages_of("compression-shear", more)
}

/// Cells of spheres are solved for in another way unless the scene names an operator, a strategy or a control of the load.
#[test]
fn the_default_strategy_depends_on_the_cells() {
    let quasi = |scene: &str, more: &[&str]| stages_of(scene, more).unwrap()[0].strategy.quasi_newton.is_some();
    assert!(!quasi("biaxial-small", &[]) && quasi("single-hexahedron-biaxial", &[]));
    assert!(
        !quasi("single-hexahedron-biaxial", &["solver.tangent=truss_like_slip"])
            && !quasi("single-hexahedron-biaxial", &["solver.strategy=newton"])
    );
}

/// Tangents that leave out that contacts slide get more iterations before one of them is committed.
#[test]
fn iterates_are_committed_later_with_stiff_tangents() {
    let after = |more: &[&str]| {
        let stages = stages_of("biaxial-small", more).unwrap();
        stages
            .last()
            .and_then(|stage| stage.control.stabilisation)
            .and_then(|settings| settings.commit_iterates_after)
    };
    assert_eq!((after(&[]), after(&["solver.strategy=slip_secant"])), (Some(3), Some(3)));
    for strategy in ["quasi_newton", "newton", "modified_newton"] {
        assert_eq!(after(&[&format!("solver.strategy={strategy}")]), Some(5), "{strategy}");
    }
    assert_eq!(after(&["solver.strategy=newton", "loading.commit_iterates_after=2"]), Some(2));
}

fn stages_of(scene: &str, more: &[&str]) -> Result<Vec<Stage>, String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../scenes/{scene}.toml"));
    let overrides: Vec<String> = more.iter().map(|&text| text.to_owned()).collect();
    Scene::load(&path, &overrides).map(|scene| scene.problem.stages).map_err(|error| error.to_string())
}

/// `(set, value, history)` of the pressures.
fn pressures(stage: &Stage) -> Vec<(&str, f64, &Amplitude)> {
    let values = stage.conditions.iter().filter_map(|applied| match &applied.condition {
        Condition::Pressure { sides, value, .. } => Some((sides.as_str(), *value, &applied.history)),
        _ => None,
    });
    values.collect()
}

#[test]
fn loads_stay_are_replaced_and_end_from_stage_to_stage() {
    let stages = stages(&[]).unwrap();
    let lengths: Vec<_> =
        stages.iter().map(|stage| (stage.name.as_str(), stage.control.increments, stage.duration)).collect();
    assert_eq!(lengths, [("compression", 4, 60.0), ("shear", 10, 600.0)]);
    assert_eq!(stages.iter().map(|stage| stage.tolerances.force).collect::<Vec<_>>(), [2e-3, 5e-3]);
    let fading = Amplitude::Ramp { from: 1.0, to: 0.0 };
    let [left, right, top] = ["left", "right", "top"].map(|set| (set, 1e5, &fading));
    let grown = |set| (set, 2e5, &Amplitude::RAMP);
    assert_eq!(pressures(&stages[0]), [left, right, top, grown("left"), grown("right"), grown("top")]);
    let kept = |set| (set, 2e5, &Amplitude::Constant);
    assert_eq!(pressures(&stages[1]), [kept("left"), kept("right")]);
}

#[test]
fn supports_are_held_where_they_are_unless_a_stage_moves_them() {
    let more = ["stage.0.boundary=[{ set = 'bottom', platen = 'smooth', displacement = { y = 1e-4 } }]"];
    let stages = stages(&more).unwrap();
    let bottom = |stage: &Stage| {
        let found = stage.conditions.iter().filter_map(|applied| match &applied.condition {
            Condition::Platen { nodes, displacement, .. } if nodes == "bottom" => {
                Some((*displacement, applied.history.clone(), applied.origin))
            }
            _ => None,
        });
        found.collect::<Vec<_>>()
    };
    assert_eq!(bottom(&stages[0]), [(1e-4, Amplitude::RAMP, Origin::Stage)]);
    assert_eq!(bottom(&stages[1]), [(0.0, Amplitude::Constant, Origin::Stage)]);
}

#[test]
fn histories_are_read_and_defects_have_their_place() {
    let with = |history: &str| stages(&[&format!("stage.1.boundary.0.history={history}")]);
    let moved = |history: &str| with(history).unwrap()[1].conditions.last().unwrap().history.clone();
    assert_eq!(moved("{ table = [[0, 0], [300, 1.5]] }"), Amplitude::Table(vec![[0.0, 0.0], [300.0, 1.5]]));
    assert_eq!(moved("{ sine = { frequency = 0.1 } }"), Amplitude::Sine { frequency: 0.1, phase: 0.0 });
    let error = with("{ table = [[0, 0], [0, 1]] }").unwrap_err();
    assert!(error.contains("history=") && error.contains("times of a table increase"), "{error}");
    let error = stages(&["stage.1.remove=[\"cap\"]"]).unwrap_err();
    assert!(error.contains("no condition 'cap'") && error.contains("bottom_left, left, right, lid"), "{error}");
    let error = stages(&["stage.1.name=compression"]).unwrap_err();
    assert!(error.contains("cannot name a stage"), "{error}");
    let error = stages(&["stage.1.solver.equations=iterative"]).unwrap_err();
    assert!(error.contains("whole run"), "{error}");
    let error = stages(&["stage.1.loading.cut=2.0"]).unwrap_err();
    assert!(error.contains("stage.1.loading.cut must be above 0 and below 1, not 2"), "{error}");
    let error = stages(&["loading.cut=2.0"]).unwrap_err();
    assert!(error.contains("--set loading.cut"), "{error}");
}

/// Unused tables were taken in silence, and loads after a stage with an unknown load factor were those of the factor 1.
#[test]
fn tables_of_other_procedures_and_stages_after_an_unknown_load_are_refused() {
    for (key, procedure) in [("dynamics.time_step=1e-5", "dynamic"), ("relaxation.hits=5", "relaxation")] {
        for key in [key.to_owned(), format!("stage.0.{key}")] {
            let error = stages(&[&key]).unwrap_err();
            assert!(error.contains("not used") && error.contains(&format!("procedure = \"{procedure}\"")), "{error}");
        }
    }
    let control = "stage.0.loading.control={ arc_length = { first_load = 0.1 } }";
    let error = stages(&[control]).unwrap_err();
    assert!(error.contains("no stage can follow 'compression'"), "{error}");
    assert_eq!(stages(&[&control.replace("stage.0", "stage.1")]).unwrap().len(), 2);
    // For all stages, of which the first cannot find a load factor.
    assert_eq!(stages(&[&control.replace("stage.0.", ""), "stage.0.procedure=relaxation"]).unwrap().len(), 2);
}

#[test]
fn smooth_histories_are_read_and_loads_that_they_replace_fade_likewise() {
    let of_bottom = |keys: &str| {
        let table = format!("stage.1.boundary=[{{ set = 'bottom', platen = 'smooth', {keys} }}]");
        stages(&[&table]).map(|stages| stages[1].conditions.last().unwrap().clone())
    };
    let moved = |history: &str| of_bottom(&format!("displacement = {{ y = 1e-3 }}, history = {history}"));
    assert_eq!(moved("'smooth'").unwrap().history, Amplitude::SMOOTH);
    let shape = SmoothRamp { start: 0.1, stop: 0.0 };
    let early = Amplitude::SmoothRamp { from: 0.0, to: 1.0, shape };
    assert_eq!(moved("{ smooth_ramp = { start = 0.1 } }").unwrap().history, early);
    let error = moved("{ smooth_ramp = { start = 0.6, stop = 0.5 } }").unwrap_err();
    assert!(error.contains("together at most 1"), "{error}");
    let stages = stages(&["stage.0.pressure.0.history=smooth"]).unwrap();
    let set = stages[0].conditions.iter().filter_map(|applied| match &applied.condition {
        Condition::Pressure { sides, .. } if sides == "left" => Some(applied.history.clone()),
        _ => None,
    });
    assert_eq!(set.collect::<Vec<_>>(), [Amplitude::Smooth { from: 1.0, to: 0.0 }, Amplitude::SMOOTH]);
}

#[test]
fn velocities_and_accelerations_are_read_and_are_one_of_three() {
    let of_bottom = |keys: &str| {
        let table = format!("stage.1.boundary=[{{ set = 'bottom', platen = 'smooth', {keys} }}]");
        stages(&[&table]).map(|stages| stages[1].conditions.last().unwrap().clone())
    };
    let rate = |rate, history| Amplitude::Rate(Box::new(RateHistory::new(rate, history)));
    let steady = of_bottom("velocity = { y = 2e-3 }").unwrap();
    assert_eq!(steady.history, rate(Rate::Velocity, Amplitude::Constant));
    assert!(matches!(steady.condition, Condition::Platen { displacement: 2e-3, .. }), "{steady:?}");
    let shaken = of_bottom("acceleration = { y = 1 }, history = { sine = { frequency = 0.1 } }").unwrap();
    let sine = Amplitude::Sine { frequency: 0.1, phase: 0.0 };
    assert_eq!(shaken.history, rate(Rate::Acceleration, sine));
    for (keys, said) in [
        ("velocity = { y = 1 }, displacement = { y = 1 }", "one of displacement, velocity and acceleration"),
        ("history = 'ramp'", "prescribes displacement, velocity or acceleration"),
        ("velocity = { y = 1 }, from = 'run'", "leads to a displacement"),
        ("velocity = { x = 1, y = 1 }", "along its normal only"),
        ("acceleration = { y = 1 }, history = { table = [[1, 0], [0, 0]] }", "times of a table increase"),
    ] {
        let error = of_bottom(keys).expect_err(keys);
        assert!(error.contains(said), "{keys}: {error}");
    }
    // A support that has had a velocity is held afterwards.
    let first = stages(&["stage.0.boundary=[{ set = 'bottom', platen = 'smooth', velocity = { y = 1e-5 } }]"]);
    let held = first.unwrap()[1].conditions.iter().find_map(|applied| match &applied.condition {
        Condition::Platen { nodes, displacement, .. } if nodes == "bottom" => {
            Some((*displacement, applied.history.clone()))
        }
        _ => None,
    });
    assert_eq!(held, Some((0.0, Amplitude::Constant)));
}

#[test]
fn friction_goes_on_from_stage_to_stage() {
    let of = |more: &[&str], stage: usize| {
        let stages = stages(more).unwrap();
        let found = stages[stage].conditions.iter().filter_map(|applied| match &applied.condition {
            Condition::Friction { elements, from, to } => {
                Some((elements.clone(), *from, *to, applied.history.clone()))
            }
            _ => None,
        });
        found.collect::<Vec<_>>()
    };
    let all = |from, to, history| vec![("all".to_owned(), from, to, history)];
    let first = "stage.0.friction=[{ factor = 0.6 }]";
    assert_eq!(of(&[first], 0), all(1.0, 0.6, Amplitude::RAMP));
    assert_eq!(of(&[first], 1), all(0.6, 0.6, Amplitude::Constant), "it stays as it was at the end of its stage");
    let second = "stage.1.friction=[{ factor = 0.2, history = 'constant' }]";
    assert_eq!(of(&[first, second], 1), all(0.6, 0.2, Amplitude::Constant));
    let back = "stage.1.friction=[{ factor = 1 }]";
    assert_eq!(of(&[first, back], 1), all(0.6, 1.0, Amplitude::RAMP));
    let half = "stage.0.friction=[{ factor = 0.6, history = { table = [[0, 0], [60, 0.5]] } }]";
    assert_eq!(of(&[half], 1), all(0.8, 0.8, Amplitude::Constant));
    assert!(of(&[first, "stage.1.remove=['all']"], 1).is_empty());
    // What is replaced before it has acted has changed nothing, unless it acts from the start.
    let (ramped, constant) = ("friction=[{ factor = 0.25 }]", "friction=[{ factor = 0.25, history = 'constant' }]");
    let replaced = "stage.0.friction=[{ factor = 1 }]";
    assert_eq!(of(&[ramped, replaced], 0), all(1.0, 1.0, Amplitude::RAMP));
    assert_eq!(of(&[constant, replaced], 0), all(0.25, 1.0, Amplitude::RAMP));
    let error = stages(&["stage.0.friction=[{ factor = 1.2 }]"]).unwrap_err();
    assert!(error.contains("stage.0.friction.0.factor must be at least 0 and at most 1"), "{error}");
}

#[test]
fn stages_switch_averages_on_and_off_and_change_them() {
    let radii = |more: &[&str]| {
        let formulation = "solver.formulation=corotational";
        let stages = stages(&[&[formulation], more].concat()).unwrap();
        stages.iter().map(|stage| stage.nonlocal.as_ref().map(|averages| averages.radius)).collect::<Vec<_>>()
    };
    let top = "nonlocal.radius=0.02";
    assert_eq!(radii(&[]), [None, None]);
    assert_eq!(radii(&[top]), [Some(0.02), Some(0.02)]);
    assert_eq!(radii(&[top, "stage.0.nonlocal.enabled=false"]), [None, Some(0.02)]);
    assert_eq!(radii(&[top, "nonlocal.enabled=false", "stage.1.nonlocal={}"]), [None, Some(0.02)]);
    assert_eq!(radii(&[top, "stage.1.nonlocal.radius=0.03"]), [Some(0.02), Some(0.03)]);
    assert_eq!(radii(&["stage.1.nonlocal={ radius = 0.03, kernel = \"cone\" }"]), [None, Some(0.03)]);
    let error = stages(&["solver.formulation=corotational", "stage.1.nonlocal={}"]).unwrap_err();
    assert!(error.contains("nonlocal.radius = 0 must be a positive length"), "{error}");
    let error = stages(&["stage.1.nonlocal.radius=0.03"]).unwrap_err();
    assert!(error.contains("\"corotational\""), "{error}");
    let error = stages(&["stage.1.nonlocal.reach=0.03"]).unwrap_err();
    assert!(error.contains("reach"), "{error}");
}

#[test]
fn keys_that_are_not_used_are_refused_with_their_place() {
    let refused = |scene: &str, more: &[&str], place: &str, procedure: &str| {
        let error = stages_of(scene, more).err().unwrap_or_else(|| panic!("{scene} with {more:?} was accepted"));
        let place = format!("--set {place}=");
        assert!(error.starts_with(&place) && error.contains("this key is not used"), "{more:?}: {error}");
        assert!(error.contains(&format!("procedure = \"{procedure}\"")), "{more:?}: {error}");
    };
    let of_newton = [
        "loading.control={ arc_length = { first_load = 0.1 } }",
        "loading.stabilise_after=3",
        "loading.max_iterations=9",
        "solver.criteria=[\"force_over_reactions\"]",
        "solver.strategy=newton",
        "solver.displacement_tolerance=1e-3",
    ];
    for key in of_newton {
        let place = key.split('=').next().unwrap();
        refused("biaxial-relaxation", &[key], place, "relaxation");
        refused("shear-column", &[key], place, "dynamic");
        // Where one stage is implicit, the top speaks to that one; the others are not to say it again.
        let mixed = "stage.1.procedure=dynamic";
        let error = stages(&[mixed, "stage.1.solver={}", "stage.1.loading={}", key]).err().unwrap_or_default();
        assert!(error.is_empty() || (key.contains("arc_length") && error.contains("no stage can follow")), "{error}");
        let (own, place) = (format!("stage.1.{key}"), format!("stage.1.{place}"));
        refused("compression-shear", &[mixed, "stage.1.solver={}", "stage.1.loading={}", &own], &place, "dynamic");
    }
    refused("shear-column", &["loading.increments=5"], "loading.increments", "dynamic");
    refused("shear-column", &["solver.force_tolerance=1e-3"], "solver.force_tolerance", "dynamic");
    for key in ["loading.increments=5", "loading.cut=0.3", "solver.force_tolerance=1e-3", "solver.predictor=tangent"]
    {
        assert!(stages_of("biaxial-relaxation", &[key]).is_ok(), "{key}");
    }
}

#[test]
fn stages_say_how_they_are_stabilised_and_contradictions_are_refused() {
    let stabilisations = |more: &[&str]| {
        let stages = stages(more).unwrap();
        stages.iter().map(|stage| stage.control.stabilisation).collect::<Vec<_>>()
    };
    let (by_default, arc) = (Stabilisation::default(), "loading.control={ arc_length = { first_load = 0.1 } }");
    // Loads grow in the first stage, supports move under constant loads in the second.
    let at_once = Stabilisation::UNDER_MOVING_SUPPORTS;
    assert_eq!(Stabilisation { commit_iterates_after: None, ..at_once }, by_default);
    let early = Stabilisation { after: Some(3), ..by_default };
    let early_here = Stabilisation { after: Some(3), ..at_once };
    assert_eq!(stabilisations(&[]), [Some(by_default), Some(at_once)]);
    let late = |settings: Stabilisation| Some(Stabilisation { after: Some(0), ..settings });
    assert_eq!(stabilisations(&["loading.stabilise_after=0"]), [late(by_default), late(at_once)]);
    assert_eq!(stabilisations(&["loading.stabilise=false"]), [None; 2]);
    // A stage adds to what the top says, and may switch it off or on for itself.
    let more = ["loading.stabilise_after=3", "stage.1.loading.stabilise_increments=7"];
    assert_eq!(stabilisations(&more), [Some(early), Some(Stabilisation { most_increments: 7, ..early_here })]);
    assert_eq!(
        stabilisations(&["loading.stabilise_after=3", "stage.1.loading.stabilise=false"]),
        [Some(early), None]
    );
    let slow = |settings: Stabilisation| Some(Stabilisation { viscosity: 0.3, ..settings });
    assert_eq!(stabilisations(&["loading.stabilise_viscosity=0.3"]), [slow(by_default), slow(at_once)]);
    let error = stages(&["loading.stabilise_viscosity=0"]).unwrap_err();
    assert!(error.contains("loading.stabilise_viscosity") && error.contains("above 0"), "{error}");
    let on = ["stage.1.loading.stabilise=true", "stage.1.loading.stabilise_after=3"];
    assert_eq!(stabilisations(&["loading.stabilise=false", on[0], on[1]]), [None, Some(early_here)]);
    let one_arc = format!("stage.1.{arc}");
    assert_eq!(stabilisations(&["loading.stabilise_after=3", &one_arc])[0], Some(early));
    let back = ["stage.0.loading.control=load", "stage.0.loading.stabilise_after=3"];
    assert_eq!(stabilisations(&[arc, back[0], back[1]])[0], Some(early));

    let refused = |more: &[&str], place: &str, said: [&str; 2]| {
        let error = stages(more).err().unwrap_or_else(|| panic!("{more:?} were accepted"));
        let names_all = error.starts_with(&format!("--set {place}=")) && said.iter().all(|part| error.contains(part));
        assert!(names_all, "{more:?}: {error}");
    };
    let in_vain = ["stabilise = false", "add stabilise = true"];
    for key in ["stabilise_after", "stabilise_increments", "stabilise_viscosity"] {
        let written = format!("loading.{key}=5");
        refused(&["loading.stabilise=false", &written], &format!("loading.{key}"), in_vain);
        let (place, of_stage) = (format!("stage.1.loading.{key}"), format!("stage.1.{written}"));
        refused(&["loading.stabilise=false", &of_stage], &place, in_vain);
    }
    let unknown = ["the load factor is an unknown", "control = \"load\""];
    let indirect = "loading.control={ indirect = { set = 'top', component = 'y', growth = -1e-4 } }";
    for control in [arc, indirect] {
        for key in ["stabilise=true", "stabilise=false", "stabilise_after=3", "stabilise_increments=50"] {
            let (top, stage) = (format!("loading.{key}"), format!("stage.1.loading.{key}"));
            let place = |written: &str| written.split('=').next().unwrap().to_owned();
            refused(&[control, &top], &place(&top), unknown);
            refused(&[control, back[0], &stage], &place(&stage), unknown);
            refused(&[&format!("stage.1.{control}"), &stage], &place(&stage), unknown);
        }
    }
}
