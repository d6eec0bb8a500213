//! Remarks on keys that are allowed but probably not what was meant.

use macro_solver::mesh::{ElementKind, Seam, SeamKind};
use macro_solver::problem::{
    Amplitude, Applied, Axis, Condition, Origin, Platen, Problem, Procedure, Stage, Tolerances,
};
use std::collections::BTreeMap;

/// Tolerances above this are reported.
const LOOSEST: f64 = 0.1;

/// Fewest steps in a period of a sine.
const FEWEST_STEPS: f64 = 4.0;

/// Share of the range of a history that steps may leave out.
const LEFT_OUT: f64 = 0.05;

/// Moments between two steps at which a history without a table is looked at.
const BETWEEN_STEPS: usize = 32;

/// Share of the shortest waves of a mesh below which averages leave too little of them: where cells differ, the strains of points are off by half.
const LEAST_WAVES_LEFT: f64 = 0.02;

/// All remarks, one line each, none twice.
pub(super) fn remarks_on(problem: &Problem) -> Vec<String> {
    let mut remarks = loose_tolerances(problem);
    remarks.extend(volumetric_locking(problem));
    remarks.extend(columns_of_bricks(problem));
    remarks.extend(problem.mesh.seams().iter().map(not_joined));
    for stage in &problem.stages {
        remarks.extend(averages_of_nothing(problem, stage));
        remarks.extend(averages_without_own_share(problem, stage));
        remarks.extend(turns_between_steps(problem, stage));
        remarks.extend(absorbing_sides_that_are_held(problem, stage));
        remarks.extend(supports_that_move_far(problem, stage));
        remarks.extend(supports_that_begin_with_a_jump(problem, stage));
        remarks.extend(platens_along_their_side(problem, stage));
    }
    let mut told = Vec::new();
    for remark in remarks {
        if !told.contains(&remark) {
            told.push(remark);
        }
    }
    told
}

/// Parts of a mesh that lie next to each other and do not move together, unless links join them: stresses there are wrong.
fn not_joined(seam: &Seam) -> String {
    let Seam { kind, count, nodes: [node, other], place: [x, y, z] } = seam;
    let (what, remedy) = match kind {
        SeamKind::CoincidentNodes => (
            format!("nodes at the same place (pairs: {count}), such as {node} and {other}"),
            "join the parts of the geometry before meshing (in Gmsh `Coherence;`), or link the nodes",
        ),
        SeamKind::HangingNode => (
            format!(
                "nodes on a side of an element that does not have them ({count}), such as {node} on the side with {other}"
            ),
            "let neighbours have the same nodes, or link them",
        ),
        SeamKind::QuadrilateralOnTriangles => (
            format!("quadrilaterals covered by triangles ({count}), such as that with the nodes {node} and {other}"),
            "mesh with tetrahedra or hexahedra only",
        ),
        SeamKind::SideOfMany => (
            format!("sides of three elements or more ({count}), such as that with the nodes {node} and {other}"),
            "mesh every part of the body once",
        ),
    };
    format!("the mesh is not joined everywhere: {what}, at ({x:.4e}, {y:.4e}, {z:.4e}) m; {remedy}")
}

/// Tolerances at which a step is accepted that is not in balance: results differ by some 10 %, and nothing else would say so.
fn loose_tolerances(problem: &Problem) -> Vec<String> {
    let of_stage = |stage: &Stage| {
        let Tolerances { force, displacement, .. } = stage.tolerances;
        [("force_tolerance", force), ("displacement_tolerance", displacement)]
    };
    let loose = problem.stages.iter().flat_map(of_stage).filter(|(_, value)| *value > LOOSEST);
    loose
        .map(|(key, value)| {
            format!("solver.{key} = {value:e} accepts steps that are not in balance; 1e-2 is loose already")
        })
        .collect()
}

/// Elements that cannot keep their volume at all points while they change their shape: with pore fluid they are far too stiff, or right in the mean
/// only.
fn volumetric_locking(problem: &Problem) -> Option<String> {
    problem.pore_fluid?;
    let is_linear = |kind: &ElementKind| !kind.is_quadratic() && !kind.needs_hourglass_control();
    let is_full = |kind: &ElementKind| matches!(kind, ElementKind::Q8Full | ElementKind::H20Full);
    let present = || problem.mesh.kinds_present().into_iter();
    if let Some(kind) = present().find(is_linear) {
        return Some(format!(
            "pore fluid makes elements `{}` lock: pressures are far too high; take elements with mid-side nodes or one point",
            kind.keyword()
        ));
    }
    let kind = present().find(is_full)?;
    let reduced = if kind == ElementKind::Q8Full { ElementKind::Q8 } else { ElementKind::H20 };
    Some(format!(
        "pore pressures alternate between the points of elements `{}`, the more the stiffer the fluid, and only their means are right; take `{}`",
        kind.keyword(),
        reduced.keyword()
    ))
}

/// Bricks with reduced integration in a column one element wide: motions of several of them need no energy, which neighbours across would
/// prevent.
fn columns_of_bricks(problem: &Problem) -> Option<String> {
    const NODES_OF_SIDE: usize = 8;
    let mesh = &problem.mesh;
    if mesh.elements.is_empty() || mesh.kinds.iter().any(|kind| *kind != ElementKind::H20) {
        return None;
    }
    let mut elements_of_node: Vec<Vec<usize>> = vec![Vec::new(); mesh.nodes.len()];
    for (element, nodes) in mesh.elements.iter().enumerate() {
        nodes.iter().for_each(|&node| elements_of_node[node].push(element));
    }
    let is_in_column = |(element, nodes): (usize, &Vec<usize>)| {
        let mut shared: BTreeMap<usize, usize> = BTreeMap::new();
        let others = nodes.iter().flat_map(|&node| &elements_of_node[node]).filter(|other| **other != element);
        others.for_each(|other| *shared.entry(*other).or_default() += 1);
        shared.retain(|_, count| *count >= NODES_OF_SIDE);
        // Neighbours on opposite sides have no node in common; round a corner they have.
        let is_on_both =
            |node: &usize| elements_of_node[*node].iter().filter(|other| shared.contains_key(other)).count() > 1;
        shared.len() <= 2 && !nodes.iter().any(is_on_both)
    };
    mesh.elements.iter().enumerate().all(is_in_column).then(|| {
        "elements `h20` in a column one element wide have motions that need no energy; take `h20_full`, or two elements across".to_owned()
    })
}

/// How a remark on a stage begins: with its name, where there are several.
fn beginning(problem: &Problem, stage: &Stage) -> String {
    if problem.stages.len() > 1 { format!("stage '{}': ", stage.name) } else { String::new() }
}

/// A radius that reaches no other Gauss point: the results are those without averages.
fn averages_of_nothing(problem: &Problem, stage: &Stage) -> Option<String> {
    let settings = stage.nonlocal.as_ref()?;
    let of_stage = beginning(problem, stage);
    problem.averages_nothing(stage).then(|| {
        format!(
            "{of_stage}nonlocal.radius = {:e} m is below the distance of neighbouring Gauss points: nothing is averaged; take a larger radius or a \
             finer mesh",
            settings.radius
        )
    })
}

/// Averages over so many points that strains which alternate from element to element are hardly left: equilibrium between cells that differ
/// then needs ever larger ones (docs/concepts/theory.md, section 7).
fn averages_without_own_share(problem: &Problem, stage: &Stage) -> Option<String> {
    let left = problem.shortest_waves_left(stage).filter(|left| *left < LEAST_WAVES_LEFT)?;
    Some(format!(
        "{}nonlocal.radius reaches over several elements, and only {left:.1e} of strains that alternate between neighbours is left in the averages: \
         where cells differ, strains of single points grow as the mesh gets finer; take nonlocal.local_share = 0.1",
        beginning(problem, stage)
    ))
}

/// Prescribed displacements larger than the body: most likely another unit, and otherwise no element survives them.
fn supports_that_move_far(problem: &Problem, stage: &Stage) -> Option<String> {
    let nodes = &problem.mesh.nodes;
    let extent = |axis: usize| {
        let along = nodes.iter().map(|node| node[axis]);
        along.clone().fold(f64::NEG_INFINITY, f64::max) - along.fold(f64::INFINITY, f64::min)
    };
    let dimension = problem.mesh.dimension.count();
    let size = (0..dimension).map(extent).fold(0.0, f64::max);
    let prescribed = problem.prescribed_displacements(stage).ok()?;
    // Of a velocity or an acceleration the history has the displacement for a value of 1, which may be largest at any time.
    let evenly = (0..=BETWEEN_STEPS).map(|number| number as f64 / BETWEEN_STEPS as f64);
    let moments: Vec<f64> =
        evenly.chain(stage.conditions.iter().flat_map(|applied| extremes(applied, stage))).collect();
    let apart = |axis: usize, load: f64| {
        let given = prescribed.iter().skip(axis).step_by(dimension).flatten();
        let [least, most] = range(given.map(|given| given.value * given.history.factor(stage.moment(load))));
        // What is carried along as a whole may go anywhere.
        most - least
    };
    let axes = (0..dimension).flat_map(|axis| moments.iter().map(move |load| (axis, *load)));
    let apart = axes.map(|(axis, load)| apart(axis, load)).fold(0.0, f64::max);
    (apart >= size).then(|| {
        let of_stage = beginning(problem, stage);
        format!(
            "{of_stage}supports move by {apart:e} m against each other, and the body is {size:e} m large: are the displacements in m?"
        )
    })
}

/// Shares of a stage at which the history of a support is largest and smallest, of tables and sines; the others are met at evenly spaced moments.
fn extremes(applied: &Applied, stage: &Stage) -> Vec<f64> {
    match (&applied.condition, &applied.history) {
        (Condition::Displacement { .. } | Condition::Platen { .. }, Amplitude::Table(points)) => {
            let by_factor = |one: &&[f64; 2], other: &&[f64; 2]| one[1].total_cmp(&other[1]);
            let within = || points.iter().filter(|[time, _]| (0.0..=stage.duration).contains(time));
            let found = [within().min_by(by_factor), within().max_by(by_factor)];
            found.into_iter().flatten().map(|[time, _]| time / stage.duration).collect()
        }
        (Condition::Displacement { .. } | Condition::Platen { .. }, history @ Amplitude::Sine { .. }) => {
            history.turns(stage.duration, 2)
        }
        _ => Vec::new(),
    }
}

/// Smooth platens that move within the plane of their own side: they drag its nodes along and leave them free across it.
fn platens_along_their_side(problem: &Problem, stage: &Stage) -> Vec<String> {
    let remark = |applied: &Applied| {
        let Condition::Platen { nodes, contact: Platen::Smooth, axis, displacement } = &applied.condition else {
            return None;
        };
        let places = problem.nodes(nodes).ok()?;
        let extent = |axis: Axis| {
            let [least, most] = range(places.iter().map(|&node| problem.mesh.nodes[node][axis.index()]));
            most - least
        };
        let axes = Axis::ALL.into_iter().take(problem.mesh.dimension.count());
        let across = axes.filter(|other| other != axis).find(|other| extent(*other) == 0.0)?;
        (*displacement != 0.0 && extent(*axis) > 0.0).then(|| {
            format!(
                "{}the smooth platen of '{nodes}' moves along {}, within its own side, and leaves it free along {}: it presses the body if its \
                 displacement is along {2}; leave `platen` out if it is to drag the side",
                beginning(problem, stage),
                ['x', 'y', 'z'][axis.index()],
                ['x', 'y', 'z'][across.index()]
            )
        })
    };
    stage.conditions.iter().filter_map(remark).collect()
}

/// Supports of a motion whose displacement does not begin at 0: they go all the way within the first time step.
fn supports_that_begin_with_a_jump(problem: &Problem, stage: &Stage) -> Option<String> {
    if !matches!(stage.procedure, Procedure::Dynamic(_)) {
        return None;
    }
    let prescribed = problem.prescribed_displacements(stage).ok()?;
    let from_the_stage = prescribed.iter().flatten().filter(|given| given.origin == Origin::Stage);
    let jumps = from_the_stage.map(|given| (given.value * given.history.factor(stage.moment(0.0))).abs());
    let largest = jumps.fold(0.0, f64::max);
    (largest > 0.0).then(|| {
        let of_stage = beginning(problem, stage);
        format!(
            "{of_stage}a support moves by {largest:e} m within the first time step, since the history of its displacement does not begin at 0; \
             begin it there, or prescribe the velocity"
        )
    })
}

/// Absorbing sides whose motion is given: it reflects waves, whatever dampers there do.
fn absorbing_sides_that_are_held(problem: &Problem, stage: &Stage) -> Vec<String> {
    let Procedure::Dynamic(settings) = &stage.procedure else { return Vec::new() };
    let (Ok(prescribed), dimension) = (problem.prescribed_displacements(stage), problem.mesh.dimension.count())
    else {
        return Vec::new();
    };
    let of_stage = beginning(problem, stage);
    let is_held = |set: &String| {
        let nodes = problem.sides(set).unwrap_or_default().iter().flat_map(|side| problem.mesh.side_nodes(*side));
        let mut components = nodes.flat_map(|node| dimension * node..dimension * (node + 1));
        components.all(|component| prescribed[component].is_some())
    };
    let held = settings.absorbing.iter().filter(|set| is_held(set));
    held.map(|set| {
        format!(
            "{of_stage}dynamics.absorbing has no effect on '{set}', where all displacements are given, so that waves are reflected; release \
             them, or take another side"
        )
    })
    .collect()
}

/// Histories whose extremes lie where no step ends.
fn turns_between_steps(problem: &Problem, stage: &Stage) -> Vec<String> {
    if matches!(stage.procedure, Procedure::Dynamic(_)) || stage.finds_load_factor() {
        return Vec::new();
    }
    let of_stage = beginning(problem, stage);
    let acting = stage.conditions.iter().filter(|applied| applied.changes());
    let found = acting.filter_map(|Applied { history, .. }| turn_between_steps(history, stage));
    found.map(|remark| format!("{of_stage}{remark}")).collect()
}

fn turn_between_steps(history: &Amplitude, stage: &Stage) -> Option<String> {
    let increments = stage.control.increments;
    let step = stage.duration / increments as f64;
    if let Amplitude::Sine { frequency, .. } = history
        && FEWEST_STEPS * frequency * step > 1.0
    {
        let steps = 1.0 / (frequency * step);
        return Some(format!(
            "a sine of {frequency} Hz has {steps:.2} steps in a period; take loading.increments = {} or more",
            (10.0 * frequency * stage.duration).ceil()
        ));
    }
    let at = |load: f64| history.factor(stage.moment(load));
    let knots: Vec<f64> = match history {
        Amplitude::Table(points) => points.iter().map(|[time, _]| time / stage.duration).collect(),
        _ => Vec::new(),
    };
    let fine = |from: f64, to: f64| {
        let [first, last] = [from, to].map(|share| knots.partition_point(|knot| *knot < share));
        let within = knots[first..last].iter().copied();
        let between = (1..BETWEEN_STEPS).map(move |number| from + (to - from) * number as f64 / BETWEEN_STEPS as f64);
        within.chain(between)
    };
    let end = |number: usize| number as f64 / increments as f64;
    // What a step passes by: how far the history goes beyond its values at both ends of the step.
    let passed = (0..increments).map(|number| {
        let [from, to] = [end(number), end(number + 1)];
        let [least, most] = range([at(from), at(to)].into_iter());
        let [lowest, highest] = range(fine(from, to).map(at));
        (highest - most).max(least - lowest)
    });
    let passed = passed.fold(0.0, f64::max);
    let whole = range((0..=increments).map(end).chain(fine(0.0, 1.0)).map(at));
    let left_out = passed / (whole[1] - whole[0]);
    // Of a constant history 0 / 0.
    (left_out > LEFT_OUT).then(|| {
        format!(
            "steps of {step:.4} s leave out {:.0} % of the range of a history, which turns between them; take loading.increments for which \
             steps end at its turns",
            100.0 * left_out
        )
    })
}

/// Smallest and largest value.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], value| [least.min(value), most.max(value)])
}

#[cfg(test)]
mod tests {
    use crate::weak_element as scene;

    fn remarks(more: &[&str]) -> Vec<String> {
        scene(more).unwrap().remarks
    }

    #[test]
    fn turns_that_no_step_meets_are_told() {
        let sine = |increments: u32| {
            let loading = format!("loading={{ duration = 4.0, increments = {increments} }}");
            remarks(&["pressure.0.history={ sine = { frequency = 0.5, phase = 1.5707963267948966 } }", &loading])
        };
        assert_eq!(sine(8), Vec::<String>::new());
        let cut = sine(7);
        assert!(cut.len() == 1 && cut[0].contains("3.50 steps in a period") && cut[0].contains("= 20"), "{cut:?}");
        let history = |history: &str, increments: u32| {
            let loading = format!("loading={{ duration = 4.0, increments = {increments} }}");
            remarks(&[&format!("pressure.0.history={history}"), &loading])
        };
        let table = |increments, time: f64| {
            history(&format!("{{ table = [[0, 1], [{time}, 2], [3, 0.5], [5, 0.5]] }}"), increments)
        };
        assert_eq!(table(8, 1.0), Vec::<String>::new());
        assert_eq!(table(20, 1.2), Vec::<String>::new(), "1.2 is the end of the sixth step but for rounding");
        let cut = table(8, 1.2);
        assert!(cut.len() == 1 && cut[0].contains("steps of 0.5000 s leave out 11 %"), "{cut:?}");
        // A plateau between two steps, and a sine whose steps lie beside its turns.
        let pulse = history("{ table = [[0, 1], [1.1, 1], [1.2, 3], [1.3, 3], [1.4, 1]] }", 4);
        assert!(pulse.len() == 1 && pulse[0].contains("leave out 100 %"), "{pulse:?}");
        assert!(
            history("{ sine = { frequency = 0.5, phase = 0.7853981633974483 } }", 8)[0].contains("leave out 15 %")
        );
        // Cycles within the range that the steps meet.
        let cycles = history("{ table = [[0, 0], [0.5, 0.2], [1, 0], [1.5, 0.2], [2, 0], [4, 0.5]] }", 4);
        assert!(cycles.len() == 1 && cycles[0].contains("leave out 40 %"), "{cycles:?}");
        let still = remarks(&[
            "boundary.0.history={ sine = { frequency = 0.5 } }",
            "loading={ duration = 4.0, increments = 5 }",
        ]);
        assert_eq!(still, Vec::<String>::new(), "a support that is held");
        let pressure = "{ set = 'left', value = 1e5, history = { sine = { frequency = 500.0 } } }";
        let dynamic = format!(
            "stage=[{{ name = 'still' }}, {{ name = 'swing', procedure = 'dynamic', pressure = [{pressure}] }}]"
        );
        assert_eq!(remarks(&[&dynamic]), Vec::<String>::new(), "time steps are far smaller");
    }

    #[test]
    fn supports_that_begin_with_a_jump_are_told() {
        let moved = |history: &str, procedure: &str| {
            let boundary = format!("{{ set = 'right', displacement = {{ x = -1e-5 }}, history = {history} }}");
            let stages = format!(
                "stage=[{{ name = 'still' }}, {{ name = 'swing', procedure = '{procedure}', boundary = [{boundary}], loading = {{ duration = \
                 1e-3 }} }}]"
            );
            remarks(&[&stages])
        };
        let jump = moved("{ sine = { frequency = 500.0, phase = 1.5707963267948966 } }", "dynamic");
        assert!(jump.len() == 1 && jump[0].contains("1e-5 m within the first time step"), "{jump:?}");
        assert_eq!(moved("{ sine = { frequency = 500.0 } }", "dynamic"), Vec::<String>::new());
        assert_eq!(moved("\"constant\"", "implicit"), Vec::<String>::new());
    }

    #[test]
    fn columns_of_bricks_with_reduced_integration_are_told() {
        let told = |mesh: &str| {
            let path =
                std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/geotechnics/triaxial-rough.toml");
            let overrides = [mesh.to_owned()];
            let scene = crate::Scene::load_in_size(&path, Some("small"), &overrides).unwrap();
            scene.remarks.iter().any(|remark| remark.contains("motions that need no energy"))
        };
        assert!(
            told("mesh.elements=[1, 4, 1]")
                && told("mesh.elements=[1, 1, 1]")
                && !told("mesh.elements=[2, 2, 1]")
                && !told("mesh.elements=[2, 2, 2]")
                && !told("mesh.element=h20_full")
        );
    }

    #[test]
    fn averages_that_reach_no_neighbour_are_told() {
        let formulation = "solver.formulation=corotational";
        assert_eq!(remarks(&[formulation, "nonlocal.radius=0.03"]), Vec::<String>::new());
        let small = remarks(&[formulation, "nonlocal.radius=0.01"]);
        assert!(small.len() == 1 && small[0].contains("nothing is averaged"), "{small:?}");
    }

    #[test]
    fn averages_that_leave_nothing_of_short_waves_are_told() {
        let told = |more: &str| {
            let fine = ["mesh.element=q4_single", "mesh.elements=[10, 20]", "solver.formulation=corotational", more];
            let found = remarks(&fine);
            found.iter().any(|remark| remark.contains("take nonlocal.local_share = 0.1"))
        };
        assert!(told("nonlocal={ radius = 0.05 }") && !told("nonlocal={ radius = 0.01 }"));
        assert!(!told("nonlocal={ radius = 0.05, local_share = 0.1 }"));
        assert!(!told("nonlocal={ radius = 0.05, adjoint = true }"));
    }

    #[test]
    fn elements_that_cannot_keep_their_volume_are_told() {
        let told =
            |element: &str| remarks(&[&format!("mesh.element={element}"), "pore_fluid={ bulk_modulus = 1e9 }"]);
        assert!(told("q4")[0].contains("`q4` lock"));
        assert!(told("q8_full")[0].contains("take `q8`"));
        assert_eq!([told("q8"), told("t6"), told("q4_single")].concat(), Vec::<String>::new());
    }

    #[test]
    fn supports_that_move_farther_than_the_body_is_large_are_told() {
        let moved = |top: f64| {
            let held = "{ set = 'bottom', displacement = { x = 0.0, y = 0.1 } }";
            let boundary = format!("boundary=[{held}, {{ set = 'top', displacement = {{ y = {top} }} }}]");
            remarks(&["tilting_platen=[]", &boundary])
        };
        let far = moved(-0.1);
        assert!(far.len() == 1 && far[0].starts_with("supports move by 2e-1 m"), "{far:?}");
        assert_eq!(moved(0.095), Vec::<String>::new(), "the body is carried along");
        // Thirty-two periods: at all evenly spaced moments it is where it began.
        let swinging = remarks(&[
            "stage=[{ name = 'still' }, { name = 'swing', procedure = 'dynamic', loading = { duration = 32.0 }, \
             boundary = [{ set = 'right', displacement = { x = 1.0 }, history = { sine = { frequency = 1.0 } } }] }]",
        ]);
        assert!(swinging.iter().any(|remark| remark.contains("supports move by 1e0 m")), "{swinging:?}");
        let driven = |velocity: f64| {
            let boundary = format!("[{{ set = 'right', velocity = {{ x = {velocity} }} }}]");
            let loading = "loading = { duration = 1e-3 }";
            remarks(&[&format!(
                "stage=[{{ name = 'still' }}, {{ name = 'push', procedure = 'dynamic', boundary = {boundary}, {loading} }}]"
            )])
        };
        let told = |remarks: Vec<String>| remarks.iter().any(|remark| remark.contains("supports move by"));
        assert!(told(driven(-500.0)) && !told(driven(-0.5)), "0.5 m and 0.5 mm");
    }

    #[test]
    fn platens_that_move_within_their_side_are_told() {
        let told = |platen: &str| {
            let boundary =
                format!("boundary=[{{ set = 'bottom', displacement = {{ x = 0.0, y = 0.0 }} }}, {platen}]");
            remarks(&["tilting_platen=[]", &boundary])
        };
        let along = told("{ set = 'top', platen = 'smooth', displacement = { x = 1e-3 } }");
        assert!(along.len() == 1 && along[0].contains("free along y"), "{along:?}");
        for meant in [
            "{ set = 'top', platen = 'smooth', displacement = { y = -1e-3 } }",
            "{ set = 'top', platen = 'rough', displacement = { x = 1e-3 } }",
            "{ set = 'top', displacement = { x = 1e-3 } }",
        ] {
            assert_eq!(told(meant), Vec::<String>::new(), "{meant}");
        }
    }

    /// Dampers there did nothing but change the account of the energy.
    #[test]
    fn absorbing_sides_that_are_held_are_told() {
        let told = |more: &[&str]| {
            let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/shear-column.toml");
            let overrides: Vec<String> = more.iter().map(|&text| text.to_owned()).collect();
            let remarks = crate::Scene::load(&path, &overrides).unwrap().remarks;
            remarks.iter().any(|remark| remark.contains("dynamics.absorbing has no effect on 'top'"))
        };
        assert!(!told(&["dynamics.absorbing=['top']"]));
        let held = "boundary.1={ set = 'top', displacement = { x = 0.0, y = 0.0 } }";
        assert!(told(&["dynamics.absorbing=['top']", held]));
    }
}
