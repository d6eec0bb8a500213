//! Remarks on keys that are allowed but probably not what was meant.

use macro_solver::mesh::ElementKind;
use macro_solver::problem::{Amplitude, Applied, PathControl, Problem, Procedure, Stage, Tolerances};

/// Tolerances above this are reported.
const LOOSEST: f64 = 0.1;

/// Fewest steps in a period of a sine that can meet both of its turns, and its zeros between them.
const FEWEST_STEPS: f64 = 4.0;

/// A step ends at a turn of a history if it is no farther away than this share of a step.
const SAME_TIME: f64 = 1e-6;

/// All remarks, one line each, none twice.
pub(super) fn remarks_on(problem: &Problem) -> Vec<String> {
    let mut remarks = loose_tolerances(problem);
    remarks.extend(volumetric_locking(problem));
    for stage in &problem.stages {
        remarks.extend(averages_of_nothing(problem, stage));
        remarks.extend(turns_between_steps(problem, stage));
    }
    let mut told = Vec::new();
    for remark in remarks {
        if !told.contains(&remark) {
            told.push(remark);
        }
    }
    told
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

/// Elements that cannot keep their volume at all points while they change their shape: with pore fluid they are far too stiff.
fn volumetric_locking(problem: &Problem) -> Option<String> {
    problem.pore_fluid?;
    let locks = |kind: &ElementKind| !kind.is_quadratic() && !kind.needs_hourglass_control();
    let kind = problem.mesh.kinds_present().into_iter().find(locks)?;
    Some(format!(
        "pore fluid makes elements `{}` lock: pressures are far too high; take elements with mid-side nodes or one point",
        kind.keyword()
    ))
}

/// A radius that reaches no other Gauss point: the results are those without averages.
fn averages_of_nothing(problem: &Problem, stage: &Stage) -> Option<String> {
    let settings = stage.nonlocal.as_ref()?;
    problem.averages_nothing(stage).then(|| {
        format!(
            "nonlocal.radius = {:e} m is below the distance of neighbouring Gauss points: nothing is averaged; take a larger radius or a \
             finer mesh",
            settings.radius
        )
    })
}

/// Histories that turn where no step ends, so that their extremes are not met.
fn turns_between_steps(problem: &Problem, stage: &Stage) -> Vec<String> {
    if matches!(stage.procedure, Procedure::Dynamic(_)) || stage.control.path != PathControl::Load {
        return Vec::new();
    }
    let of_stage = if problem.stages.len() > 1 { format!("stage '{}': ", stage.name) } else { String::new() };
    let found = stage.conditions.iter().filter_map(|Applied { history, .. }| turn_between_steps(history, stage));
    found.map(|remark| format!("{of_stage}{remark}")).collect()
}

fn turn_between_steps(history: &Amplitude, stage: &Stage) -> Option<String> {
    let (increments, duration) = (stage.control.increments as f64, stage.duration);
    match history {
        Amplitude::Sine { frequency, .. } => {
            let periods = frequency * duration;
            (increments < FEWEST_STEPS * periods).then(|| {
                let steps = increments / periods;
                format!(
                    "a sine of {frequency} Hz has {steps:.2} steps in a period: its turns are cut off; take loading.increments = {} or more",
                    (10.0 * periods).ceil()
                )
            })
        }
        Amplitude::Table(points) => {
            let turns = points.windows(3).filter(|around| {
                let [before, at, after] = [around[0][1], around[1][1], around[2][1]];
                (at - before) * (after - at) < 0.0
            });
            let times = turns.map(|around| around[1][0]).filter(|time| (0.0..duration).contains(time));
            let is_missed = |time: &f64| {
                let steps = time / duration * increments;
                (steps - steps.round()).abs() > SAME_TIME
            };
            let time = times.into_iter().find(is_missed)?;
            Some(format!(
                "a history by table turns at {time} s, where no step of {} s ends: its turn is cut off; take loading.increments for which \
                 one does",
                duration / increments
            ))
        }
        // A rate is integrated exactly.
        Amplitude::Constant
        | Amplitude::Ramp { .. }
        | Amplitude::Smooth { .. }
        | Amplitude::SmoothRamp { .. }
        | Amplitude::Rate(_) => None,
    }
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
        let table = |increments: u32, time: f64| {
            let loading = format!("loading={{ duration = 4.0, increments = {increments} }}");
            remarks(&[
                &format!("pressure.0.history={{ table = [[0, 1], [{time}, 2], [3, 0.5], [5, 0.5]] }}"),
                &loading,
            ])
        };
        assert_eq!(table(8, 1.0), Vec::<String>::new());
        assert_eq!(table(20, 1.2), Vec::<String>::new(), "1.2 is the end of the sixth step but for rounding");
        let cut = table(8, 1.2);
        assert!(cut.len() == 1 && cut[0].contains("turns at 1.2 s, where no step of 0.5 s ends"), "{cut:?}");
        let pressure = "{ set = 'left', value = 1e5, history = { sine = { frequency = 500.0 } } }";
        let dynamic = format!(
            "stage=[{{ name = 'still' }}, {{ name = 'swing', procedure = 'dynamic', pressure = [{pressure}] }}]"
        );
        assert_eq!(remarks(&[&dynamic]), Vec::<String>::new(), "time steps are far smaller");
    }

    #[test]
    fn averages_that_reach_no_neighbour_are_told() {
        let formulation = "solver.formulation=corotational";
        assert_eq!(remarks(&[formulation, "nonlocal.radius=0.03"]), Vec::<String>::new());
        let small = remarks(&[formulation, "nonlocal.radius=0.01"]);
        assert!(small.len() == 1 && small[0].contains("nothing is averaged"), "{small:?}");
    }
}
