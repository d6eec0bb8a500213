//! Cost of one DEM step and the stress along a constant-area path, for a packing file.
//!
//! `cargo run --release -p grainspan-rve-server --example step_cost -- PACKING.json K_N K_T/K_N MU INCREMENT COUNT [ACCURACY]`
//! drives the cell by `diag(exp(e), exp(-e))` and prints stress, force evaluations and microseconds per evaluation.

#![expect(clippy::print_stdout, reason = "a program for people")]

use protocol::{Observables, RveSolver, Tensor2, TrialOptions};
use rve_server::contact::ContactTable;
use rve_server::definition::{Accuracy, Criterion, Damping, GrainDefinition, PackingFile, RveOptions};
use rve_server::engine::GrainRve;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, rest @ ..] = arguments.as_slice() else {
        return Err("usage: step_cost PACKING.json K_N K_T/K_N MU INCREMENT COUNT [ACCURACY]".into());
    };
    let number = |index: usize, fallback: f64| rest.get(index).map_or(Ok(fallback), |text| text.parse::<f64>());
    let contact = ContactTable::linear(number(0, 1e3)?, number(1, 0.5)?, number(2, 0.5)?);
    let (increment, count) = (number(3, 1e-3)?, number(4, 20.0)? as usize);
    let accuracy = match rest.get(5).map(String::as_str) {
        Some("draft") => Accuracy::Draft,
        Some("tight") => Accuracy::Tight,
        _ => Accuracy::Default,
    };
    let mut options = RveOptions { accuracy, ..RveOptions::default() };
    for word in rest.iter().skip(6) {
        match word.as_str() {
            "local" => options.damping = Damping::Local,
            "rms" => options.criterion = Criterion::RmsForce,
            "energy" => options.criterion = Criterion::Energy,
            value => options.strain_per_step = Some(value.parse()?),
        }
    }
    let packing: PackingFile = PackingFile::read(path.as_ref())?;
    let mut cell = GrainRve::new(&GrainDefinition { packing, contact, options })?;

    let given = cell.observe(Observables::ALL).unwrap();
    println!("strain,s_xx,s_xy,s_yx,s_yy,unbalanced,coordination,steps,microseconds_per_step,flags");
    let options = TrialOptions { observables: Observables::ALL, ..TrialOptions::default() };
    let report = |strain: f64, answer: &protocol::TrialResult| {
        let [[xx, xy], [yx, yy]] = answer.stress.plane();
        println!(
            "{strain:.4e},{xx:.10e},{xy:.6e},{yx:.6e},{yy:.10e},{:.2e},{:.3},{},{:.2},{}",
            answer.scalars.unbalanced_force_ratio,
            answer.scalars.coordination_number,
            answer.cost.force_evaluations,
            answer.cost.solve_nanoseconds as f64 * 1e-3 / answer.cost.force_evaluations as f64,
            answer.flags.0,
        );
    };
    report(0.0, &given);
    for step in 1..=count {
        let target = Tensor2::from_plane([[increment.exp_m1(), 0.0], [0.0, (-increment).exp_m1()]]);
        let answer = cell.trial(&target, &options)?;
        cell.commit()?;
        report(increment * step as f64, &answer);
    }
    Ok(())
}
