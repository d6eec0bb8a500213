//! [Liu2015] section 3.1 and Table II: the cell of 4096 spheres as given, its moduli as secants over strain, and which number is which.

use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Table;

pub(super) const FIGURE: Figure = Figure {
    name: "liu2015-moduli",
    source: "[Liu2015] section 3.1, Table II",
    shows: "the cell of 4096 spheres as given; its bulk, shear and Young's modulus at 416 kPa as secants over strain",
    run_time: ("10 s", "2 min"),
    entries: &[],
    runs,
    evaluate,
};

/// Table II: Young's modulus, Poisson's ratio, bulk and shear modulus, MPa. The printed order of the numbers is scrambled; only this
/// assignment is consistent.
const YOUNG: f64 = 584.0;
const POISSON: f64 = 0.2;
const BULK: f64 = 335.0;
const SHEAR: f64 = 241.0;

const SOURCE: &str = "[Liu2015] Table II";

/// Where the cell is described.
const SOURCE_OF_CELL: &str = "[Liu2015] section 3.1";

/// How pictures of the packing as given are called.
const GIVEN: &str = "increment-0000";

fn runs(size: Size) -> Vec<Run> {
    // All 4096 spheres in both sizes, under a shear that is nothing: only the packing as given is drawn.
    let cell = Run::new("cell", "scenes/liu2015/cell-shear.toml", Command::Contacts(At::Start), size)
        .set("packing=\"../../packings/spheres-4096.json\"")
        .set("path.0.increments=1")
        .set("path.0.strain.xy=1e-6");
    vec![
        cell,
        Run::new("shear", "scenes/liu2015/moduli-shear.toml", Command::Element(None), size),
        Run::new("triaxial", "scenes/liu2015/moduli-triaxial.toml", Command::Element(None), size),
    ]
}

/// Secant modulus in MPa over strain: stress change of a component over that of a deformation component, since `row`.
fn secant(table: &Table, row: usize, stress: &str, deformation: &str) -> Result<Curve, ReproduceError> {
    let (stress, deformation) = (table.column(stress)?, table.column(deformation)?);
    let point = |later: usize| {
        let strain = deformation[later] - deformation[row];
        [strain.abs(), (stress[later] - stress[row]) / strain / 1e6]
    };
    Ok((row + 1..stress.len()).map(point).collect())
}

/// The cell as given, before anything is done to it.
fn cell_as_given(table: &Table) -> Result<Vec<Comparison>, ReproduceError> {
    let first = |column: &str| -> Result<f64, ReproduceError> { Ok(table.column(column)?[0]) };
    let compare = |quantity: &str, unit, theirs, ours, tolerance| {
        Comparison::new(quantity, unit, Theirs::Value(theirs), SOURCE_OF_CELL, ours, tolerance)
    };
    let void_ratio = first("void_ratio")?;
    let pressure = -mean_stress(table)?[0] / 1e3;
    let mut apart: f64 = 0.0;
    for column in ["sigma_xx", "sigma_yy", "sigma_zz"] {
        apart = apart.max((-first(column)? / 1e3 - pressure).abs() / pressure);
    }
    // Tolerances as those of the cells of [Liu2018].
    Ok(vec![
        compare("porosity of the cell", "-", 0.338, void_ratio / (1.0 + void_ratio), Tolerance::Absolute(0.01)),
        compare("coordination number of the cell", "-", 5.6, first("coordination_number")?, Tolerance::Absolute(0.1)),
        compare("mean pressure of the cell", "kPa", 416.0, pressure, Tolerance::Relative(0.01)),
        Comparison::reported("largest difference of a normal stress from the mean pressure, over it", "-", apart),
        Comparison::reported("anisotropy of the contacts of the cell", "-", first("fabric_anisotropy")?),
    ])
}

fn mean_stress(table: &Table) -> Result<Vec<f64>, ReproduceError> {
    let [xx, yy, zz] = [table.column("sigma_xx")?, table.column("sigma_yy")?, table.column("sigma_zz")?];
    Ok((0..xx.len()).map(|row| (xx[row] + yy[row] + zz[row]) / 3.0).collect())
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let cell = results.run("cell")?;
    // Of 4096 spheres the picture of the contact forces is a tangle of 4800 lines: the directions of the contacts are drawn alone.
    let net = cell.picture(&format!("contacts/{GIVEN}-normals.svg"))?;
    let drawn = vec![("normals".to_owned(), net.replace(GIVEN, SOURCE_OF_CELL))];
    let sheared = results.run("shear")?.table()?;
    let compressed = results.run("triaxial")?.table()?;
    let mean = mean_stress(&sheared)?;
    let bulk = (mean[1] - mean[0]) / -3.0e-6 / 1e6;
    let shear = secant(&sheared, 1, "sigma_xy", "F_xy")?;
    let young = secant(&compressed, 0, "sigma_yy", "F_yy")?;
    let (first_shear, first_young) = (shear[0][1], young[0][1]);
    let (across, along) = (compressed.column("F_xx")?, compressed.column("F_yy")?);
    let poisson = -(across[1] - 1.0) / (along[1] - 1.0);

    let x = ("strain (shear angle or axial compression)", Scale::Logarithmic);
    let mut chart =
        Chart::new("[Liu2015] Table II: secant moduli of 4096 spheres", x, ("modulus, MPa", Scale::Linear));
    chart.curve("G", shear.clone());
    chart.curve("E", young.clone());
    chart.curve("K", [[1e-5, bulk], [2e-3, bulk]]);
    for (name, level) in [("G", SHEAR), ("E", YOUNG), ("K", BULK)] {
        chart.reference(&format!("[Liu2015] Table II: {name} = {level} MPa"), [[1e-5, level], [2e-3, level]]);
    }
    let compare = |quantity: &str, unit, theirs, ours, tolerance| {
        Comparison::new(quantity, unit, Theirs::Value(theirs), SOURCE, ours, Tolerance::Relative(tolerance))
    };
    let from_their_k_g = 9.0 * BULK * SHEAR / (3.0 * BULK + SHEAR);
    let mut comparisons = cell_as_given(&cell.table()?)?;
    comparisons.extend([
        compare("K at an isotropic strain of 1e-6", "MPa", BULK, bulk, 0.1),
        compare("G, smallest strain (1e-5)", "MPa", SHEAR, first_shear, 0.1),
        compare("E, smallest strain (1e-5)", "MPa", YOUNG, first_young, 0.1),
        compare("nu, smallest strain (1e-5)", "-", POISSON, poisson, 0.1),
        Comparison::reported("shear angle at which the secant G is theirs", "-", crossing(&shear, SHEAR, 0.0)),
        Comparison::reported("compression at which the secant E is theirs", "-", crossing(&young, YOUNG, 0.0)),
        Comparison::new(
            "E that follows from their K and G (assignment of Table II)",
            "MPa",
            Theirs::Value(YOUNG),
            SOURCE,
            from_their_k_g,
            Tolerance::Relative(0.005),
        ),
        Comparison::new(
            "effective-medium K of 5.6 contacts, solid fraction 0.662 (Walton)",
            "MPa",
            Theirs::Value(BULK),
            SOURCE,
            effective_medium_bulk(),
            Tolerance::Relative(0.005),
        ),
    ]);
    Ok(Outcome { charts: vec![("", chart)], drawn, comparisons, notes: results.notes(), ..Outcome::default() })
}

/// Bulk modulus of Hertzian spheres that all deform alike, MPa: `[C^2 phi^2 G^2 p / (18 pi^2 (1 - nu)^2)]^(1/3)`.
fn effective_medium_bulk() -> f64 {
    let (contacts, solid, modulus, poisson, pressure) = (5.6_f64, 0.662_f64, 29.0e9_f64, 0.15_f64, 4.16e5_f64);
    let cube = (contacts * solid * modulus / (std::f64::consts::PI * (1.0 - poisson))).powi(2) * pressure / 18.0;
    cube.cbrt() / 1e6
}

#[cfg(test)]
mod tests {
    #[test]
    fn their_bulk_modulus_is_that_of_the_effective_medium() {
        assert!((super::effective_medium_bulk() - 334.6).abs() < 0.1);
    }
}
