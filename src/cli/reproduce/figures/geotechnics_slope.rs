//! Infinite dry slope whose friction is reduced until it fails, against the friction angle of its cells. L-5.

use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Finished;

pub(super) const FIGURE: Figure = Figure {
    name: "geotechnics-slope",
    source: "closed form",
    shows: "infinite slopes: sliding over the share of the friction that is taken away, and the friction angle of the cell that is left",
    run_time: ("20 s", "2 min"),
    entries: &[("L-5", "")],
    runs,
    evaluate,
};

/// Tangents of the slopes.
const SLOPES: [f64; 3] = [0.2, 0.3, 0.4];
/// Coefficients of friction of the cell that is sheared.
const FRICTIONS: [f64; 8] = [0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5];
/// Friction between the grains of the slopes at the start.
const FRICTION: f64 = 0.5;
/// Pressure across the slopes, Pa, and weight across them, N/m3.
const PRESSURE: f64 = 1.0e5;
const WEIGHT: f64 = 2.0e4;
/// Thickness of the layer, m.
const THICKNESS: f64 = 2.0;

fn slope_name(tangent: f64) -> String {
    format!("slope of {:.1} degrees", tangent.atan().to_degrees())
}

fn cell_name(friction: f64) -> String {
    format!("friction {friction}")
}

fn runs(size: Size) -> Vec<Run> {
    let slope = |tangent: f64| {
        Run::new(slope_name(tangent), "scenes/geotechnics/slope-friction.toml", Command::Stopping, size)
            .set(format!("stage.0.body_force.0.value.x={}", tangent * WEIGHT))
            .set(format!("stage.0.traction.0.value.x={}", tangent * PRESSURE))
    };
    let cell = |friction: f64| {
        Run::new(cell_name(friction), "scenes/geotechnics/element-shear.toml", Command::Element(None), size)
            .set(format!("contact.friction={friction}"))
    };
    SLOPES.map(slope).into_iter().chain(FRICTIONS.map(cell)).collect()
}

/// Sliding of the top over the thickness, over the share of the friction that has been taken away.
fn sliding(run: &Finished) -> Result<Curve, ReproduceError> {
    let curve = run.table()?.stage("friction")?.curve("load", "sliding")?;
    // The first row is the end of the stage before, at which all friction is there.
    Ok(curve
        .iter()
        .enumerate()
        .map(|(row, [share, way])| [if row == 0 { 0.0 } else { *share }, way / THICKNESS])
        .collect())
}

/// Friction angle of the cell, degrees: largest ratio of the stresses along and across the plane of simple shear.
fn friction_angle(run: &Finished) -> Result<f64, ReproduceError> {
    let table = run.table()?;
    let (along, across) = (table.column("sigma_xy")?, table.column("sigma_yy")?);
    let ratios = along.iter().zip(across).map(|(along, across)| (along / across).abs());
    Ok(ratios.fold(0.0, f64::max).atan().to_degrees())
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let mut angles = Curve::new();
    for friction in FRICTIONS {
        angles.push([friction, friction_angle(results.run(&cell_name(friction))?)?]);
    }
    let mut slides = Chart::new(
        "Infinite slopes whose friction is reduced",
        ("share of the friction that is taken away", Scale::Linear),
        ("sliding of the top over the thickness", Scale::Linear),
    );
    let (mut limits, mut shares, mut comparisons) = (Curve::new(), Vec::new(), Vec::new());
    for tangent in SLOPES {
        let name = slope_name(tangent);
        let curve = sliding(results.run(&name)?)?;
        let share = curve.last().map_or(f64::NAN, |point| point[0]);
        let left = FRICTION * (1.0 - share);
        slides.curve(&name, curve);
        let steepness = tangent.atan().to_degrees();
        limits.push([left, steepness]);
        shares.push(share);
        let quantity = format!("{name}: friction angle of the cell with the friction that is left");
        let (theirs, ours) = (Theirs::Value(steepness), value_at(&angles, left));
        comparisons.push(Comparison::new(quantity, "degrees", theirs, "closed form", ours, Tolerance::Absolute(2.0)));
        comparisons.push(Comparison::reported(format!("{name}: share of the friction to spare"), "-", share));
    }
    let falls = shares.windows(2).all(|pair| pair[0] > pair[1]);
    comparisons.push(Comparison::holds("a steeper slope has less to spare", "closed form", falls));
    let mut strengths = Chart::new(
        "Friction angle of the cell, and slopes at their limit",
        ("friction between grains", Scale::Linear),
        ("angle, degrees", Scale::Linear),
    );
    strengths.curve("cell in simple shear", angles);
    strengths.curve("slopes at their limit", limits);
    let charts = vec![("", slides), ("angles", strengths)];
    Ok(Outcome { charts, comparisons, notes: results.notes(), ..Outcome::default() })
}
