//! Element tests that geotechnics asks of a soil: strength, earth pressure at rest, shear at constant volume, cyclic shear. L-6, L-7.

use super::geotechnics::{mobilised, strength, strength_run};
use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;

pub(super) const FIGURE: Figure = Figure {
    name: "geotechnics-cells",
    source: "Jaky; trends",
    shows: "one cell: strength, earth pressure at rest, shear at constant volume of dense and loose, cyclic shear",
    run_time: ("10 s", "5 min"),
    entries: &[("L-6", "cell gains"), ("L-7", "earth pressure at rest")],
    runs,
    evaluate,
};

fn runs(size: Size) -> Vec<Run> {
    let run = |name: &str, file: &'static str| Run::new(name, file, Command::Element(None), size);
    let undrained = "scenes/geotechnics/constant-volume-shear.toml";
    vec![
        strength_run(size),
        // Jaky's formula is for normally consolidated soil: a loose packing, not one that is denser than its pressure makes it.
        loose(run("strength-loose", "scenes/geotechnics/element-biaxial.toml")),
        loose(run("rest", "scenes/geotechnics/rest-compression.toml")),
        run("dense", undrained).set("packing=\"../../packings/discs-400-dense.json\"").set("contact.modulus=6e7"),
        loose(run("loose", undrained)),
        run("cyclic", "scenes/geotechnics/cyclic-shear.toml"),
    ]
}

/// The same run with the loose packing.
fn loose(run: Run) -> Run {
    run.set("packing=\"../../packings/discs-400-loose.json\"").set("contact.modulus=6e7")
}

/// Shear stress over mean pressure, kPa.
fn path(run: &Finished) -> Result<Curve, ReproduceError> {
    let table = run.table()?;
    let [xx, yy, xy] = [table.column("sigma_xx")?, table.column("sigma_yy")?, table.column("sigma_xy")?];
    Ok((0..xx.len()).map(|row| [-(xx[row] + yy[row]) / 2e3, xy[row] / 1e3]).collect())
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let mut mobilisation = Chart::new(
        "Biaxial test of the cell",
        ("axial compression", Scale::Linear),
        ("sine of the mobilised friction angle", Scale::Linear),
    );
    mobilisation.curve("cell", mobilised(results.run("strength")?)?);
    mobilisation.curve("loose, 400 discs", mobilised(results.run("strength-loose")?)?);
    let loose_strength = strength(results.run("strength-loose")?)?;
    let strength = strength(results.run("strength")?)?;

    let table = results.run("rest")?.table()?;
    let [xx, yy] = [table.column("sigma_xx")?, table.column("sigma_yy")?];
    let ratio: Curve = yy.iter().zip(&xx).map(|(yy, xx)| [-yy / 1e3, xx / yy]).collect();
    let rest = ratio.last().map_or(f64::NAN, |point| point[1]);
    let mut at_rest = Chart::new(
        "Confined compression, loose packing",
        ("vertical stress, kPa", Scale::Linear),
        ("horizontal over vertical stress", Scale::Linear),
    );
    let jaky = 1.0 - loose_strength.late;
    at_rest.reference("1 - sin(phi), 10 to 20 % strain", ratio.iter().map(|point| [point[0], jaky]));
    at_rest.curve("cell", ratio);

    let mut undrained = Chart::new(
        "Simple shear at constant volume",
        ("mean pressure, kPa", Scale::Linear),
        ("shear stress, kPa", Scale::Linear),
    );
    let dense = path(results.run("dense")?)?;
    let change = |path: &Curve| path.last().map_or(f64::NAN, |point| point[0]) - path[0][0];
    let (gain, lowest) =
        (change(&dense), |path: &Curve| path.iter().map(|point| point[0]).fold(f64::INFINITY, f64::min));
    undrained.curve("dense", dense);
    let loose = path(results.run("loose")?)?;
    let (loss, least) = (change(&loose), lowest(&loose));
    undrained.curve("loose", loose);

    let mut cyclic = Chart::new(
        "Cyclic simple shear, vertical stress constant",
        ("shear angle", Scale::Linear),
        ("shear stress, kPa", Scale::Linear),
    );
    let table = results.run("cyclic")?.table()?;
    cyclic.curve("cell", table.curve("F_xy", "sigma_xy")?.into_iter().map(|[angle, stress]| [angle, stress / 1e3]));
    let comparisons = vec![
        Comparison::reported("friction angle, peak", "degrees", strength.peak.asin().to_degrees()),
        Comparison::reported("friction angle, 10 to 20 %", "degrees", strength.late.asin().to_degrees()),
        Comparison::reported(
            "friction angle of the loose cell, 10 to 20 %",
            "degrees",
            loose_strength.late.asin().to_degrees(),
        ),
        Comparison::new("earth pressure at rest", "-", Theirs::Value(jaky), "Jaky", rest, Tolerance::Absolute(0.1)),
        Comparison::holds("the dense cell gains pressure at constant volume", "trend", gain > 0.0),
        Comparison::reported("change of pressure, dense", "kPa", gain),
        Comparison::holds("the loose cell gains less", "trend", loss < gain),
        Comparison::reported("change of pressure, loose", "kPa", loss),
        Comparison::reported("lowest pressure, loose", "kPa", least),
    ];
    let charts = vec![("", mobilisation), ("rest", at_rest), ("constant-volume", undrained), ("cyclic", cyclic)];
    Ok(Outcome { charts, comparisons, notes: results.notes(), ..Outcome::default() })
}
