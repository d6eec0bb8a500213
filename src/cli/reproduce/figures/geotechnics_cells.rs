//! Element tests that geotechnics asks of a soil: strength, earth pressure at rest, shear at constant volume, cyclic shear. L-6, L-7, L-8.

use super::geotechnics::{mobilised, strength, strength_run};
use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;

pub(super) const FIGURE: Figure = Figure {
    name: "geotechnics-cells",
    source: "Jaky; trends",
    shows: "one cell: strength, earth pressure at rest, shear at constant volume of dense and loose, cyclic shear",
    run_time: ("10 s", "5 min"),
    entries: &[("L-6", "cell gains"), ("L-7", "earth pressure at rest"), ("L-8", "rule of Masing")],
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

/// Work per volume that cycles of shear lose, J/m3.
struct LostWork {
    /// The first full cycle.
    first: f64,
    /// The last one.
    last: f64,
    /// A full cycle whose branches are the first loading, twice as large.
    masing: f64,
}

/// Work of the cycles of a curve of shear stress over shear angle that begins with a quarter of a cycle and ends with a whole one.
///
/// # Errors
/// The curve is too short.
fn work_of_cycles(curve: &[[f64; 2]]) -> Result<LostWork, ReproduceError> {
    let turns: Vec<usize> = (1..curve.len().saturating_sub(1))
        .filter(|&row| (curve[row][0] - curve[row - 1][0]) * (curve[row + 1][0] - curve[row][0]) < 0.0)
        .chain(curve.len().checked_sub(1))
        .collect();
    let (Some(&[start, _, back]), Some(&[before, _, end])) = (turns.first_chunk(), turns.last_chunk()) else {
        return Err(ReproduceError::NotFound("cycles of shear have fewer than three turning points".to_owned()));
    };
    let loading = &curve[..=start];
    let [angle, stress] = [curve[start][0] - curve[0][0], curve[start][1] - curve[0][1]];
    let above_start = work(loading) - curve[0][1] * angle;
    Ok(LostWork {
        first: work(&curve[start..=back]),
        last: work(&curve[before..=end]),
        masing: 8.0 * (above_start - 0.5 * angle * stress),
    })
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
    let loops: Curve = results.run("cyclic")?.table()?.curve("F_xy", "sigma_xy")?;
    let lost = work_of_cycles(&loops)?;
    cyclic.curve("cell", loops.iter().map(|[angle, stress]| [*angle, stress / 1e3]));
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
        Comparison::new(
            "work lost in the first cycle over that of the rule of Masing",
            "-",
            Theirs::Value(1.0),
            "rule of Masing",
            lost.first / lost.masing,
            Tolerance::Relative(0.1),
        ),
        Comparison::reported("work lost in the last cycle over that in the first", "-", lost.last / lost.first),
    ];
    let charts = vec![("", mobilisation), ("rest", at_rest), ("constant-volume", undrained), ("cyclic", cyclic)];
    Ok(Outcome { charts, comparisons, notes: results.notes(), ..Outcome::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An elastic, ideally plastic body follows the rule: with three times the yield strain each cycle loses `4 x 2 x` the yield stress
    /// times the yield strain.
    #[test]
    fn an_elastoplastic_cycle_loses_what_masing_says() {
        let (mut curve, mut plastic) = (vec![[0.0, 0.0]], 0.0_f64);
        let legs = [3.0, -3.0, 3.0, -3.0, 3.0];
        let mut angle = 0.0;
        for goal in legs {
            let from = angle;
            for step in 1..=600 {
                angle = from + (goal - from) * f64::from(step) / 600.0;
                let attempt: f64 = angle - plastic;
                plastic += attempt - attempt.clamp(-1.0, 1.0);
                curve.push([angle, angle - plastic]);
            }
        }
        let lost = work_of_cycles(&curve).unwrap();
        for work in [lost.first, lost.last, lost.masing] {
            assert!((work - 8.0).abs() < 0.05, "{work}");
        }
        assert!(work_of_cycles(&curve[..700]).is_err());
    }
}
