//! The same biaxial test with the open FEM x DEM code and with ours: a cell that the other code's own script has prepared, the same
//! mesh, steps, contact law and number of processes; time and error of both against our own tight run.

mod incumbent;

use crate::effort::Effort;
use crate::program::{ProgramRun, WORKERS, run_scene};
use crate::repeat::median;
use crate::report::Report;
use crate::table::Table;
use anyhow::Context;
use charts::{Chart, Scale};
use incumbent::{Incumbent, IncumbentRun, REMEDY};
use std::fs;
use std::path::Path;

/// What is compressed.
#[derive(Clone, Debug)]
struct Specimen {
    /// Width and height, m.
    size: [f64; 2],
    /// Q8 elements over width and height.
    elements: [usize; 2],
    steps: usize,
    /// Axial strain of a step.
    strain_per_step: f64,
    /// On both sides, Pa.
    pressure: f64,
}

/// Settings of ours, and what `--set` gets.
const SETTINGS: [(&str, &[&str]); 7] = [
    ("error 2e-2", &["rve.error=2e-2"]),
    ("error 1e-2", &["rve.error=1e-2"]),
    ("error 5e-3", &["rve.error=5e-3"]),
    ("error 2e-3", &["rve.error=2e-3"]),
    ("error 1e-3", &["rve.error=1e-3"]),
    ("draft", &["rve.accuracy=\"draft\""]),
    ("default", &["rve.accuracy=\"default\""]),
];

/// What both are compared with.
const REFERENCE: [&str; 4] = [
    "rve.accuracy=\"tight\"",
    "solver.force_tolerance=1e-5",
    "solver.displacement_tolerance=1e-3",
    "error_estimate.enabled=false",
];

/// Measures over as many prepared cells as the effort allows.
///
/// # Errors
/// A run fails, or the report cannot be written.
pub(super) fn run(effort: &Effort, report: &mut Report) -> anyhow::Result<()> {
    let mut table = Table::new([
        "cell",
        "code",
        "setting",
        "wall_s",
        "processor_s",
        "rms_error",
        "largest_error",
        "estimated_error",
        "wall_ratio",
        "processor_ratio",
        "runs",
    ]);
    let Some(incumbent) = Incumbent::find() else {
        report.note(&format!("Not measured: the open FEM x DEM code is not installed here. {REMEDY}"))?;
        table.row(std::array::from_fn::<_, 11, _>(|_| "".into()));
        report.table("femxdem", "not measured", &table)?;
        return Ok(());
    };
    let specimen = Specimen {
        size: [0.05, 0.10],
        elements: effort.choose([2, 4], [1, 1]),
        steps: effort.choose(10, 1),
        strain_per_step: effort.choose(1e-3, 1e-4),
        pressure: 1e5,
    };
    report.note(&format!(
        "{} x {} Q8 elements ({} cells of 400 discs), {} steps of {:.0e} axial strain, {WORKERS} processes. Errors of the mean vertical \
         stress after each step, relative to our tight run. Times from the start of the program to its end, medians.",
        specimen.elements[0],
        specimen.elements[1],
        4 * specimen.elements[0] * specimen.elements[1],
        specimen.steps,
        specimen.strain_per_step,
    ))?;
    let seeds = if effort.full { 1..=3 } else { 1..=1 };
    let mut chart = Chart::new(
        "FEM x DEM: error over time",
        ("processor time, s", Scale::Logarithmic),
        ("error of the mean stress, root mean square", Scale::Logarithmic),
    );
    for seed in seeds {
        let folder = tempfile::tempdir().context("a folder for the runs")?;
        let measured = measure(&incumbent, seed, &specimen, effort, folder.path())?;
        let name = format!("seed {seed}");
        for one in measured.ours.iter().chain([&measured.theirs]) {
            let fastest = median(&measured.theirs.wall) / median(&one.wall);
            let least = median(&measured.theirs.processor) / median(&one.processor);
            table.row([
                name.as_str().into(),
                one.code.into(),
                one.setting.as_str().into(),
                median(&one.wall).into(),
                median(&one.processor).into(),
                one.errors.0.into(),
                one.errors.1.into(),
                one.estimated.into(),
                fastest.into(),
                least.into(),
                one.wall.len().into(),
            ]);
        }
        let place = |one: &Measured| [median(&one.processor), one.errors.0];
        let steered: Vec<&Measured> = measured.ours.iter().filter(|ours| ours.setting.starts_with("error")).collect();
        chart.curve(&format!("Grainspan, {name}"), steered.iter().map(|one| place(one)));
        chart.curve(
            &format!("the same, as estimated, {name}"),
            steered.iter().map(|one| [median(&one.processor), one.estimated]),
        );
        chart.curve(&format!("open FEM x DEM code, {name}"), [place(&measured.theirs)]);
    }
    report.table("femxdem", "ratios: the other code's time over that of the row", &table)?;
    report.chart("femxdem", &chart)?;
    report.note("`estimated_error` is what the run itself says of its mean stress after the last step, relative to the pressure.")?;
    Ok(())
}

/// One setting of one code.
struct Measured {
    code: &'static str,
    setting: String,
    wall: Vec<f64>,
    processor: Vec<f64>,
    /// Root mean square over the steps, largest.
    errors: (f64, f64),
    /// By the run itself; NaN if it makes no estimate.
    estimated: f64,
}

/// All settings on one cell.
struct OnCell {
    ours: Vec<Measured>,
    theirs: Measured,
}

fn measure(
    incumbent: &Incumbent,
    seed: u64,
    specimen: &Specimen,
    effort: &Effort,
    folder: &Path,
) -> anyhow::Result<OnCell> {
    incumbent.prepare(seed, folder)?;
    let scene = folder.join("scene.toml");
    fs::write(&scene, scene_text(specimen, folder)?)?;
    let settings = |list: &[&str]| list.iter().map(|setting| (*setting).to_owned()).collect::<Vec<_>>();
    let reference = run_scene(&scene, &settings(&REFERENCE), &folder.join("reference"))?;
    let reference = reference.column("vertical")?.to_vec();
    let rounds = effort.choose(5, 1);
    let mut runs: Vec<Vec<ProgramRun>> = vec![Vec::new(); SETTINGS.len()];
    for _ in 0..rounds {
        for (place, (_, list)) in SETTINGS.iter().enumerate() {
            runs[place].push(run_scene(&scene, &settings(list), &folder.join(format!("ours-{place}")))?);
        }
    }
    let mut ours = Vec::new();
    for ((setting, _), runs) in SETTINGS.iter().zip(&runs) {
        ours.push(Measured {
            code: "Grainspan",
            setting: (*setting).to_owned(),
            wall: runs.iter().map(|run| run.cost.wall).collect(),
            processor: runs.iter().map(|run| run.cost.processor).collect(),
            errors: errors(runs[0].column("vertical")?, &reference),
            estimated: runs[0].summary["accuracy"]["estimated_error_of_mean"].as_f64().unwrap_or(f64::NAN),
        });
    }
    let rounds = if effort.full { 3 } else { 1 };
    let runs: Vec<IncumbentRun> =
        (0..rounds).map(|_| incumbent.run(specimen, folder)).collect::<anyhow::Result<_>>()?;
    let theirs = Measured {
        code: "open FEM x DEM code",
        setting: "its example".to_owned(),
        wall: runs.iter().map(|run| run.cost.wall).collect(),
        processor: runs.iter().map(|run| run.cost.processor).collect(),
        errors: errors(&runs[0].vertical, &reference),
        estimated: f64::NAN,
    };
    Ok(OnCell { ours, theirs })
}

/// Root mean square and largest relative difference over the steps, without the initial state.
fn errors(curve: &[f64], reference: &[f64]) -> (f64, f64) {
    if curve.len() != reference.len() || curve.len() < 2 {
        return (f64::NAN, f64::NAN);
    }
    let relative: Vec<f64> =
        curve.iter().zip(reference).skip(1).map(|(one, other)| (one / other - 1.0).abs()).collect();
    let square = relative.iter().map(|error| error * error).sum::<f64>() / relative.len() as f64;
    (square.sqrt(), relative.into_iter().fold(0.0, f64::max))
}

/// The specimen as a scene, with the contact law of the prepared cell.
fn scene_text(specimen: &Specimen, folder: &Path) -> anyhow::Result<String> {
    let law: serde_json::Value =
        serde_json::from_slice(&fs::read(folder.join("law.json"))?).context("the contact law")?;
    let number = |key: &str| law[key].as_f64().with_context(|| format!("the contact law has no {key}"));
    let Specimen { size: [width, height], elements: [columns, rows], steps, strain_per_step, pressure } = *specimen;
    let (modulus, ratio, friction) = (number("modulus")?, number("stiffness_ratio")?, number("friction")?);
    let compression = strain_per_step * steps as f64 * height;
    Ok(format!(
        r#"name = "femxdem"
packing = "packing.json"
[mesh]
generator = "block"
size = [{width:e}, {height:e}]
elements = [{columns}, {rows}]
element = "q8"
[contact]
law = "linear"
modulus = {modulus:e}
stiffness_ratio = {ratio:e}
friction = {friction:e}
[[boundary]]
set = "bottom"
platen = "smooth"
displacement = {{ y = 0.0 }}
[[boundary]]
set = "bottom_left"
displacement = {{ x = 0.0 }}
[[boundary]]
set = "top"
platen = "smooth"
displacement = {{ y = -{compression:e} }}
[[pressure]]
set = "left"
value = {pressure:e}
[[pressure]]
set = "right"
value = {pressure:e}
[loading]
increments = {steps}
[[probe]]
name = "vertical"
kind = "mean_stress"
component = "yy"
"#
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_relative_and_leave_out_the_initial_state() {
        let (square, largest) = errors(&[7.0, 1.01, 2.0], &[1.0, 1.0, 2.0]);
        assert!((square - 0.01 / 2f64.sqrt()).abs() < 1e-12 && (largest - 0.01).abs() < 1e-12);
        assert!(errors(&[1.0], &[1.0]).0.is_nan(), "nothing to compare");
    }

    #[test]
    fn the_specimen_is_a_sound_scene() {
        let folder = tempfile::tempdir().unwrap();
        let law = r#"{"modulus": 6e8, "stiffness_ratio": 0.8, "friction": 0.5463}"#;
        fs::write(folder.path().join("law.json"), law).unwrap();
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        fs::copy(root.join("packings/discs-100.json"), folder.path().join("packing.json")).unwrap();
        let specimen =
            Specimen { size: [0.05, 0.1], elements: [2, 4], steps: 10, strain_per_step: 1e-3, pressure: 1e5 };
        let scene = folder.path().join("scene.toml");
        fs::write(&scene, scene_text(&specimen, folder.path()).unwrap()).unwrap();
        assert!(scene_reader::Scene::load(&scene, &[]).is_ok());
    }
}
