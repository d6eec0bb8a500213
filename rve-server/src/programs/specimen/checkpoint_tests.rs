//! runs that go on from a state have the bits of undisturbed ones.

use super::{
    Checkpoints, SpecimenError, SpecimenEvent, SpecimenRow, SpecimenSummary, SpecimenTest, run_specimen_from,
};
use crate::definition::PackingFile;
use crate::space::{Discs, Spheres};
use claims::Claim;
use std::ops::ControlFlow;
use std::path::Path;

/// Rows with the step of the run that they belong to, states, and the summary.
type Kept = (Vec<SpecimenRow>, Vec<Vec<u8>>, SpecimenSummary);

fn run<S: super::SpecimenFor>(
    test: &SpecimenTest,
    packing: &PackingFile<S>,
    from: Option<&[u8]>,
) -> Result<Kept, SpecimenError> {
    let (mut rows, mut states) = (Vec::new(), Vec::new());
    let checkpoints = Checkpoints { every: Some(700), from };
    let summary = run_specimen_from(test, packing, &checkpoints, &mut |event| {
        match event {
            SpecimenEvent::Row(row, _) => rows.push((*row).clone()),
            SpecimenEvent::State(state) => states.push(state.clone()),
            SpecimenEvent::Progress { .. } | SpecimenEvent::Begun { .. } => {}
        }
        ControlFlow::Continue(())
    })?;
    Ok((rows, states, summary))
}

/// Ends a run at its first event past `step` steps of `stage`: its rows and its last state.
fn stopped<S: super::SpecimenFor>(
    test: &SpecimenTest,
    packing: &PackingFile<S>,
    last: (usize, u64),
) -> (Vec<SpecimenRow>, Vec<u8>) {
    let (mut rows, mut states) = (Vec::new(), Vec::new());
    let checkpoints = Checkpoints { every: Some(u64::MAX), from: None };
    let mut is_over = false;
    let summary = run_specimen_from(test, packing, &checkpoints, &mut |event| {
        match event {
            SpecimenEvent::Row(row, _) => rows.push((*row).clone()),
            SpecimenEvent::State(state) => states.push(state.clone()),
            SpecimenEvent::Progress { stage, step } => is_over |= (*stage, *step) >= last,
            SpecimenEvent::Begun { .. } => {}
        }
        if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(summary.unwrap().is_stopped);
    assert_eq!(states.len(), 1, "one state, at the end");
    (rows, states.remove(0))
}

fn check<S: super::SpecimenFor>(text: &str, file: &str) {
    let test: SpecimenTest = toml::from_str(text).unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../packings").join(file);
    let packing = PackingFile::<S>::read(&path).unwrap();
    let (rows, states, summary) = run(&test, &packing, None).unwrap();
    assert!(states.len() >= 4, "{} states", states.len());
    for (number, state) in states.iter().enumerate() {
        let (late, others, same) = run(&test, &packing, Some(state)).unwrap();
        let from = rows.len() - late.len();
        assert!(from > 0, "state {number}");
        Claim::of("A-10", "rows after going on from a state").holds(late == rows[from..]);
        Claim::of("A-10", "later states after going on from a state").holds(others == states[number + 1..]);
        Claim::of("A-10", "summary after going on from a state").holds(same == summary);
    }
    // A run that a person stops, in the midst of a stage and with its last step.
    for last in [(0, 300), (0, test.stage[0].steps), (1, 0)] {
        let (early, state) = stopped(&test, &packing, last);
        let (late, _, same) = run(&test, &packing, Some(&state)).unwrap();
        let is_same = [early, late].concat() == rows && same == summary;
        Claim::of("A-10", "rows and summary of a run that is stopped by hand and continued").holds(is_same);
    }
    for broken in [&states[0][..states[0].len() - 8], &[][..], &[0xff; 800][..]] {
        assert!(matches!(run(&test, &packing, Some(broken)), Err(SpecimenError::Unfit)));
    }
}

/// Walls with a servo, friction of a stage, glue, shear, rolling contacts with dashpots, scaled masses; a state between two
/// stages is among them.
#[test]
fn a_sheared_layer_goes_on_from_any_of_its_states() {
    check::<Discs>(
        "packing = \"\"\ntiles = [2, 2]\nperiodic = [\"x\"]\n[contact]\nlaw = \"linear\"\nmodulus = 1e8\nstiffness_ratio = 0.5\n\
         friction = 0.5\ndamping = 0.1\nrolling_stiffness = 1.0\nrolling_friction = 0.1\n[walls]\nfriction = 0.3\n\
         [[stage]]\nname = \"press\"\nsteps = 1400\nfriction = 0.1\nrows = 2\nstress = { yy = -1e5 }\n\
         [[stage]]\nname = \"shear\"\nsteps = 2100\nrows = 4\nglue = [\"y\"]\nshear = { xy = 0.02 }\nstress = { yy = -1e5 }\n",
        "discs-100.json",
    );
}

/// Periodic sides that strain and fold, physical masses, spheres.
#[test]
fn a_periodic_specimen_of_spheres_goes_on_from_any_of_its_states() {
    check::<Spheres>(
        "packing = \"\"\ntiles = [1, 1, 1]\nperiodic = [\"x\", \"y\", \"z\"]\n[contact]\nlaw = \"hertz_mindlin\"\n\
         shear_modulus = 29e9\npoisson_ratio = 0.15\nfriction = 0.5\n[motion]\nscaled_masses = false\n\
         [[stage]]\nname = \"shear\"\nsteps = 2800\nrows = 8\nshear = { xz = 0.6, yz = -0.1 }\nstrain = { xx = 0.02 }\n\
         [[stage]]\nname = \"rest\"\nsteps = 1400\nrows = 2\n",
        "spheres-100.json",
    );
}
