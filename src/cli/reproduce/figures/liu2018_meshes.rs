//! [Liu2018] Figs. 4 to 7: meshes against a simulation of all grains. Part of J-1.

use super::liu2018::biaxial;
use crate::cli::reproduce::field::Fields;
use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2018-meshes",
    source: "[Liu2018] Figs. 4 to 7",
    shows: "stress ratio, its spread over the points, contacts, anisotropy and strain for meshes from 1 x 1 on, against all grains",
    run_time: ("15 s", "4 min"),
    entries: &[("J-1", "")],
    runs,
    evaluate,
};

/// The quantity of Fig. 7, and that of the whole test.
const INCREMENT: &str = "equivalent_strain_increment";
const STRAIN: &str = "shear_strain";

fn meshes(size: Size) -> &'static [(usize, usize)] {
    match size {
        Size::Small => &[(1, 1), (1, 2), (2, 4)],
        Size::Paper => &[(1, 1), (1, 2), (2, 4), (4, 8)],
    }
}

fn name((across, up): (usize, usize)) -> String {
    format!("mesh-{across}x{up}")
}

fn runs(size: Size) -> Vec<Run> {
    let scene = "scenes/liu2018/biaxial.toml";
    let mesh = |&(across, up): &(usize, usize)| {
        // Past the peak finer meshes have snaps that no step passes; the curve ends where the run does.
        Run::new(name((across, up)), scene, Command::Stopping, size)
            .set(format!("mesh.elements=[{across}, {up}]"))
            .set(format!("output.fields=['{INCREMENT}']"))
    };
    let grains = Run::new("grains", "scenes/liu2018/grains-biaxial.toml", Command::Specimen, size);
    meshes(size).iter().map(mesh).chain([grains]).collect()
}

fn evaluate(results: &Results, size: Size) -> Result<Outcome, ReproduceError> {
    let x = ("axial compression", Scale::Linear);
    let mut chart = Chart::new("[Liu2018] Fig. 4: meshes", x, ("|(s11 - s22) / (s11 + s22)|", Scale::Linear));
    let mut contacts = Chart::new("[Liu2018] Fig. 5a: meshes", x, ("contacts per grain", Scale::Linear));
    let mut anisotropy = Chart::new("[Liu2018] Fig. 5b: meshes", x, ("anisotropy of the contacts", Scale::Linear));
    let y = ("standard deviation over the points", Scale::Linear);
    let mut deviation = Chart::new("[Liu2018] Fig. 6: spread of |(s11 - s22) / (s11 + s22)|", x, y);
    let (mut strains, mut increments) = (Vec::new(), Vec::new());
    let mut deviations = Vec::new();
    let mut comparisons = Vec::new();
    let mut curves = Vec::new();
    for &mesh in meshes(size) {
        let run = results.run(&name(mesh))?;
        let biaxial = biaxial(run)?;
        let curve = biaxial.ratio;
        let top = peak(&curve)?;
        let label = format!("{} x {} elements", mesh.0, mesh.1);
        comparisons.push(Comparison::new(
            format!("peak stress ratio, {label}"),
            "-",
            Theirs::Value(0.39),
            "[Liu2018] section 4.4 (2 x 4)",
            top[1],
            Tolerance::Absolute(0.03),
        ));
        comparisons.push(Comparison::reported(format!("strain at the peak, {label}"), "-", top[0]));
        contacts.curve(&label, biaxial.contacts);
        anisotropy.curve(&label, biaxial.anisotropy);
        deviation.curve(&label, biaxial.deviation.clone());
        deviations.push(biaxial.deviation);
        strains.push(last_field(run, mesh, STRAIN)?);
        let increment = last_field(run, mesh, INCREMENT)?;
        comparisons.push(Comparison::reported(
            format!("incremental equivalent strain of the last step, largest over mean, {label}"),
            "-",
            concentration(&increment),
        ));
        increments.push(increment);
        chart.curve(&label, curve.clone());
        curves.push(curve);
    }
    let highest = curves.iter().flatten().map(|point| point[1]).fold(0.0, f64::max);
    comparisons.push(Comparison::new(
        "largest difference of two meshes up to 5 % strain, over the peak",
        "-",
        Theirs::Value(0.0),
        "[Liu2018] section 4.2, band of J-1",
        spread(&curves) / highest,
        Tolerance::Absolute(0.03),
    ));
    for (&mesh, own) in meshes(size).iter().zip(&deviations) {
        comparisons.push(Comparison::reported(
            format!("spread of the stress ratio over the points, 5 to 10 % strain, {} x {} elements", mesh.0, mesh.1),
            "-",
            mean_between(own, 0.05, 0.1),
        ));
    }
    if let [.., coarse, fine] = &deviations[..]
        && size == Size::Paper
    {
        comparisons.push(Comparison::holds(
            "the spread over the points is larger on 4 x 8 elements than on 2 x 4",
            "[Liu2018] section 4.2",
            mean_between(fine, 0.0, 0.1) > mean_between(coarse, 0.0, 0.1),
        ));
    }
    if let [.., coarse, fine] = &increments[..] {
        comparisons.push(Comparison::holds(
            "the incremental equivalent strain of the last step is more localised on the finest mesh than on the next",
            "[Liu2018] section 4.2, Fig. 7",
            concentration(fine) > concentration(coarse),
        ));
    }
    let grains = grains(results.run("grains")?)?;
    let top = peak(&grains)?;
    comparisons.push(Comparison::new(
        "peak stress ratio of all grains, between smooth walls",
        "-",
        Theirs::Value(0.39),
        "[Liu2018] Fig. 4 (boundary grains under servo control)",
        top[1],
        Tolerance::Absolute(0.03),
    ));
    chart.curve("all grains, smooth walls", grains);
    chart.published("[Liu2018]: largest value 0.39 at 7.3 %", [[0.073, 0.39]]);
    anisotropy.published("[Liu2018]: 0.27 at 7.3 %, 2 x 4 elements", [[0.073, 0.27]]);
    let map = |title: &str, quantity: &str, panels| Map { title: title.into(), quantity: quantity.into(), panels };
    let increment = map(
        "[Liu2018] Fig. 7: meshes, elements and compression",
        "incremental equivalent strain of the last step",
        increments,
    );
    let strain = map("Meshes, elements and compression", "shear strain since the start", strains);
    Ok(Outcome {
        charts: vec![("", chart), ("contacts", contacts), ("anisotropy", anisotropy), ("spread", deviation)],
        maps: vec![("map", strain), ("increment", increment)],
        comparisons,
        notes: results.notes(),
        ..Outcome::default()
    })
}

/// Largest value of the elements over their mean; the elements of a panel are equally large at the start.
fn concentration(panel: &Panel) -> f64 {
    let values = || panel.patches.iter().map(|patch| patch.1);
    values().fold(f64::NEG_INFINITY, f64::max) / (values().sum::<f64>() / panel.patches.len() as f64)
}

/// A field of the elements at the last step with fields, by the mesh and the compression of that step.
fn last_field(run: &Finished, mesh: (usize, usize), field: &str) -> Result<Panel, ReproduceError> {
    let last = Fields::steps(run).last().copied().unwrap_or(0);
    let compression = value_at(&run.table()?.curve("step", "axial_compression")?, last as f64);
    let fields = Fields::read(run, last)?;
    let patches = fields.outlines()?.into_iter().zip(fields.element_values(field)?).collect();
    Ok(Panel { name: format!("{} x {}, {:.1} %", mesh.0, mesh.1, 100.0 * compression), patches })
}

/// Largest difference between two curves at the same strain up to 5 %, of those that reach it; NaN if fewer than two do.
fn spread(curves: &[Curve]) -> f64 {
    let reaches = |curve: &&Curve| curve.last().is_some_and(|point| point[0] >= 0.05 * (1.0 - 1e-9));
    let whole: Vec<&Curve> = curves.iter().filter(reaches).collect();
    if whole.len() < 2 {
        return f64::NAN;
    }
    let at = |strain: f64| {
        let values = whole.iter().map(move |curve| value_at(curve, strain)).filter(|value| value.is_finite());
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    (1..=25).map(|step| at(0.002 * f64::from(step))).map(|(low, high)| high - low).fold(0.0, f64::max)
}

/// The biaxial stage of the specimen: stress ratio over the compression since its begin.
fn grains(run: &Finished) -> Result<Curve, ReproduceError> {
    let table = run.table()?.stage("biaxial")?;
    let stress = table.column("wall_sigma_xx")?.into_iter().zip(table.column("wall_sigma_yy")?);
    let strain = table.column("strain_yy")?;
    let compression = strain.iter().map(|strain_yy| 1.0 - (1.0 + strain_yy) / (1.0 + strain[0]));
    Ok(compression.zip(stress).map(|(x, (xx, yy))| [x, liu_ratio(yy / xx)]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_that_stop_early_are_not_compared() {
        let up_to = |end: f64, level: f64| -> Curve { vec![[0.0, 0.0], [0.5 * end, level], [end, level]] };
        assert!((spread(&[up_to(0.1, 0.4), up_to(0.1, 0.3)]) - 0.1).abs() < 1e-12);
        assert!(spread(&[up_to(0.1, 0.4), up_to(0.01, 0.3)]).is_nan());
        assert!((spread(&[up_to(0.1, 0.4), up_to(0.02, 0.1), up_to(0.1, 0.4)])).abs() < 1e-12);
    }
}
