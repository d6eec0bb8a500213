//! [Argilaga2018] eqs. 9 to 21: tangent operators of one cell at the first step and at 1.5 %, as ratios. T-7.

use crate::cli::reproduce::prelude::*;
use crate::cli::reproduce::results::Table;

pub(super) const FIGURE: Figure = Figure {
    name: "argilaga2018-operators",
    source: "[Argilaga2018] eqs. 9 to 21",
    shows: "tangent operators of one cell of 400 discs at the first step and at 1.5 %",
    run_time: ("1 min", "5 min"),
    entries: &[("T-7", "of PSTLO over UKO"), ("T-2", "violation of objectivity")],
    runs,
    evaluate,
};

/// The paper's names and ours.
const KINDS: [(&str, &str); 10] = [
    ("CTO", "consistent"),
    ("DEMQO", "quasi_static"),
    ("PSTLO", "truss_like"),
    ("UKO", "kruyt"),
    ("UKO as printed", "kruyt_printed"),
    ("UCKO", "kruyt_calibrated"),
    ("UCKO-2DOF", "kruyt_twice_calibrated"),
    ("KAO as printed", "kruyt_augmented_printed"),
    ("KAO", "kruyt_augmented"),
    ("AEO", "elastic_average"),
];

/// Rows of the curve: after the first step, and at 1.5 %.
const FIRST: usize = 1;
const LATE: usize = 38;

/// Perturbations of CTOs of cells that are relaxed to 1e-3 only, as those of the paper: eq. 10 is a CTO of noise.
const PERTURBATIONS: [&str; 2] = ["1e-5", "1e-6"];

fn runs(size: Size) -> Vec<Run> {
    let run = |name: String, kind: &'static str| {
        Run::new(name, "scenes/argilaga2018/operators.toml", Command::Element(Some(kind)), size)
    };
    let rough = |perturbation: &str| {
        run(format!("rough-{perturbation}"), "consistent")
            .set("rve.tolerance=1e-3")
            .set(format!("rve.operator.perturbation={perturbation}"))
            .set("path=[{ increments = 1, strain = { yy = -2.0e-4 }, stress = { xx = -1.0e5 } }]")
    };
    KINDS.into_iter().map(|(_, kind)| run(kind.to_owned(), kind)).chain(PERTURBATIONS.map(rough)).collect()
}

/// An operator at every row; components as `[11, 12, 21, 22]` squared.
struct Operator(Vec<[[f64; 4]; 4]>);

impl Operator {
    fn of(table: &Table) -> Result<Self, ReproduceError> {
        let pairs = ["11", "12", "21", "22"];
        let mut rows = vec![[[0.0; 4]; 4]; table.column("F_xx")?.len()];
        for (i, row) in pairs.iter().enumerate() {
            for (j, column) in pairs.iter().enumerate() {
                for (operator, value) in rows.iter_mut().zip(table.column(&format!("C_{row}{column}"))?) {
                    operator[i][j] = value;
                }
            }
        }
        Ok(Self(rows))
    }

    /// `C_1111`, Pa.
    fn along(&self, row: usize) -> f64 {
        self.0[row][0][0]
    }

    /// `C_1111 + C_2222`, Pa.
    fn trace(&self, row: usize) -> f64 {
        self.0[row][0][0] + self.0[row][3][3]
    }

    /// `C_1111` over `C_2222`.
    fn along_over_across(&self, row: usize) -> f64 {
        self.0[row][0][0] / self.0[row][3][3]
    }

    /// Share of a component on the diagonal that is lost from the first step to 1.5 %: 0 for `C_1111`, 3 for `C_2222`.
    fn loss(&self, place: usize) -> f64 {
        1.0 - self.0[LATE][place][place] / self.0[FIRST][place][place]
    }

    /// Bulk modulus in the plane, Pa.
    fn bulk(&self, row: usize) -> f64 {
        let c = &self.0[row];
        (c[0][0] + c[0][3] + c[3][0] + c[3][3]) / 4.0
    }

    /// Shear modulus against `u_x,y = u_y,x`, Pa.
    fn shear(&self, row: usize) -> f64 {
        let c = &self.0[row];
        (c[1][1] + c[1][2] + c[2][1] + c[2][2]) / 4.0
    }
}

/// Factors of `k_n` and `k_t` of UCKO-2DOF ([Argilaga2018] eq. 17), from it and the symmetric UKO: with `k_t = k_n` the tangential part
/// has the negative `C_1122` of the normal one, so that the sums over the contacts cancel.
fn factors(twice_calibrated: &[[f64; 4]; 4], uko: &[[f64; 4]; 4]) -> [f64; 2] {
    let (c, u) = (twice_calibrated, uko);
    [(c[0][0] + c[0][3]) / u[0][0], (c[1][1] - c[0][3]) / u[1][1]]
}

/// The largest change of a component from one operator to the other, over `C_1111` of the first.
fn largest_change(from: &[[f64; 4]; 4], to: &[[f64; 4]; 4]) -> f64 {
    let pairs = from.as_flattened().iter().zip(to.as_flattened());
    pairs.map(|(one, other)| (other - one).abs()).fold(0.0, f64::max) / from[0][0]
}

/// How far CTOs of cells that are not relaxed well are from the CTO, by the size of the perturbation.
fn noise(results: &Results, cto: &[[f64; 4]; 4]) -> Result<Vec<Comparison>, ReproduceError> {
    let row = |perturbation: &str| {
        let rough = Operator::of(&results.run(&format!("rough-{perturbation}"))?.table()?)?;
        Ok(Comparison::new(
            format!(
                "CTO of cells relaxed to 1e-3, perturbation {perturbation}: largest change of a component over C_1111"
            ),
            "-",
            Theirs::Value(10.37),
            "[Argilaga2018] eqs. 9, 10: point B against A",
            largest_change(cto, &rough.0[FIRST]),
            Tolerance::Nothing,
        ))
    };
    PERTURBATIONS.into_iter().map(row).collect()
}

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let tables = KINDS.map(|(_, kind)| results.run(kind).and_then(|run| run.table()));
    let tables = tables.into_iter().collect::<Result<Vec<_>, _>>()?;
    let operators = tables.iter().map(Operator::of).collect::<Result<Vec<_>, _>>()?;
    let compression: Vec<f64> = tables[0].column("F_yy")?.iter().map(|stretch| 1.0 - stretch).collect();
    let axial = over_path("C_1111", &compression, &operators, Operator::along);
    // Forms of UKO and KAO, too close to be told apart here, part in shear.
    let shear = over_path("C_1212", &compression, &operators, |operator, row| operator.0[row][1][1]);
    let [xx, yy] = [tables[0].column("sigma_xx")?, tables[0].column("sigma_yy")?];
    let stress_difference = xx[FIRST] - yy[FIRST];
    let [cto, demqo, pstlo, uko, printed, _, twice_calibrated, kao_printed, kao, aeo] = &operators[..] else {
        return Err(ReproduceError::NotFound("the figure has too few operators".to_owned()));
    };
    let mut comparisons = Vec::new();
    comparisons.extend(calibrated(cto, uko, printed, twice_calibrated));
    comparisons.extend(measured(cto, demqo, pstlo, uko, aeo));
    comparisons.extend(uko_at_late_strain(printed));
    comparisons.extend(kao_against_uko(kao_printed, kao, printed, uko));
    comparisons.extend(objectivity(stress_difference, [cto, demqo, aeo], [pstlo, kao_printed]));
    comparisons.extend(noise(results, &cto.0[FIRST])?);
    Ok(Outcome {
        charts: vec![("", axial), ("shear", shear)],
        comparisons,
        notes: results.notes(),
        ..Outcome::default()
    })
}

/// A component of all operators over the compression, MPa.
fn over_path(
    component: &str,
    compression: &[f64],
    operators: &[Operator],
    value: impl Fn(&Operator, usize) -> f64,
) -> Chart {
    let mut chart = Chart::new(
        &format!("[Argilaga2018]: {component} of one cell over the path, by operator"),
        ("axial compression", Scale::Linear),
        (&format!("{component}, MPa"), Scale::Linear),
    );
    for ((name, _), operator) in KINDS.iter().zip(operators) {
        let points = compression.iter().enumerate();
        chart.curve(name, points.map(|(row, strain)| [*strain, value(operator, row) / 1e6]).collect::<Curve>());
    }
    chart
}

/// A row whose number follows from the operators that the paper prints.
fn derived(quantity: &str, theirs: f64, ours: f64, tolerance: f64) -> Comparison {
    let source = "[Argilaga2018] eqs. 9 to 21";
    Comparison::new(quantity, "-", Theirs::Value(theirs), source, ours, Tolerance::Absolute(tolerance))
}

/// Factors of the calibrated operators at the first step.
fn calibrated(cto: &Operator, uko: &Operator, printed: &Operator, twice_calibrated: &Operator) -> [Comparison; 3] {
    let [normal, tangential] = factors(&twice_calibrated.0[FIRST], &uko.0[FIRST]);
    [
        derived("c_x = C_1111 of CTO over UKO, first step", 0.8045, cto.along(FIRST) / printed.along(FIRST), 0.04),
        derived("c_n of UCKO-2DOF, first step", 0.870, normal, 0.0435),
        derived("c_t of UCKO-2DOF, first step", 0.607, tangential, 0.03),
    ]
}

/// Operators that are measured on the cell, against each other.
fn measured(cto: &Operator, demqo: &Operator, pstlo: &Operator, uko: &Operator, aeo: &Operator) -> [Comparison; 6] {
    [
        derived("C_1111 of AEO over that of CTO at the first step", 0.9778, aeo.along(LATE) / cto.along(FIRST), 0.02),
        derived("C_1111 of DEMQO over CTO, first step", 1.002, demqo.along(FIRST) / cto.along(FIRST), 0.02),
        Comparison::new(
            "C_1111 of PSTLO over DEMQO, first step",
            "-",
            Theirs::Value(1.0),
            "equal by T-1",
            pstlo.along(FIRST) / demqo.along(FIRST),
            Tolerance::Absolute(0.01),
        ),
        derived("K of PSTLO over UKO, first step", 0.883, pstlo.bulk(FIRST) / uko.bulk(FIRST), 0.045),
        derived("G of PSTLO over UKO, first step", 0.7205, pstlo.shear(FIRST) / uko.shear(FIRST), 0.036),
        derived("C_1122 over C_1111 of DEMQO, first step", 0.096, demqo.0[FIRST][0][3] / demqo.along(FIRST), 0.03),
    ]
}

/// UKO as the paper prints it, at 1.5 %.
fn uko_at_late_strain(printed: &Operator) -> [Comparison; 5] {
    let late = &printed.0[LATE];
    [
        derived(
            "loss of C_1111 + C_2222 of UKO as printed at 1.5 %",
            0.177,
            1.0 - printed.trace(LATE) / printed.trace(FIRST),
            0.05,
        ),
        derived("loss of C_1111 of UKO as printed at 1.5 %", 0.2768, printed.loss(0), 0.05),
        derived("loss of C_2222 of UKO as printed at 1.5 %", 0.07666, printed.loss(3), 0.05),
        derived("C_1111 over C_2222 of UKO as printed at 1.5 %", 0.7830, printed.along_over_across(LATE), 0.05),
        Comparison::new(
            "C_1112 over C_2222 of UKO as printed at 1.5 %, 0 in a packing with axes of symmetry",
            "-",
            Theirs::Value(0.01209),
            "[Argilaga2018] eqs. 9 to 21",
            late[0][1] / late[3][3],
            Tolerance::Nothing,
        ),
    ]
}

/// KAO against UKO, and UKO in shear.
fn kao_against_uko(kao_printed: &Operator, kao: &Operator, printed: &Operator, uko: &Operator) -> [Comparison; 4] {
    [
        derived(
            "C_1111 of KAO as printed over UKO, first step",
            0.9989,
            kao_printed.along(FIRST) / printed.along(FIRST),
            0.01,
        ),
        derived(
            "C_1212 of KAO as printed over C_1111, first step",
            0.5004,
            kao_printed.0[FIRST][1][1] / kao_printed.along(FIRST),
            0.025,
        ),
        Comparison::reported(
            "C_1212 of KAO over that of UKO, both symmetric, first step",
            "-",
            kao.0[FIRST][1][1] / uko.0[FIRST][1][1],
        ),
        derived(
            "C_1212 of UKO as printed over C_1111 (erratum to eq. 13)",
            1.0,
            printed.0[FIRST][1][1] / printed.along(FIRST),
            0.05,
        ),
    ]
}

/// How far operators are from `C_1221 - C_1212 = s11 - s22` at the first step: first those that may break it, then those that must not.
fn objectivity(stress_difference: f64, free: [&Operator; 3], bound: [&Operator; 2]) -> Vec<Comparison> {
    let broken = |operator: &Operator| {
        let c = &operator.0[FIRST];
        (c[1][2] - c[1][1] - stress_difference).abs() / operator.shear(FIRST)
    };
    let reported = ["CTO", "DEMQO", "AEO"].into_iter().zip(free).map(|(name, operator)| {
        let quantity = format!("violation of objectivity over G, {name}; theirs 9 %");
        Comparison::reported(quantity, "-", broken(operator))
    });
    let checked = ["PSTLO", "KAO as printed"].into_iter().zip(bound).map(|(name, operator)| {
        let quantity = format!("violation of objectivity over G, {name}");
        let identity = "identity C_1221 - C_1212 = s11 - s22";
        Comparison::new(quantity, "-", Theirs::Value(0.0), identity, broken(operator), Tolerance::Absolute(1e-3))
    });
    reported.chain(checked).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the printed operators: eqs. 9 and 14, with UCKO-2DOF in shear as it is in a packing without a preferred direction.
    #[test]
    fn the_factors_of_the_paper_follow_from_its_operators() {
        let (uko, normal, tangential): (f64, f64, f64) = (1119.12, 0.870, 0.607);
        let mut of_uko = [[0.0; 4]; 4];
        (of_uko[0][0], of_uko[1][1]) = (uko, uko / 2.0);
        let mut calibrated = [[0.0; 4]; 4];
        (calibrated[0][0], calibrated[0][3]) = (900.3, 73.8);
        calibrated[1][1] = (normal + tangential) * uko / 4.0;
        let found = factors(&calibrated, &of_uko);
        assert!((found[0] - normal).abs() < 1e-3 && (found[1] - tangential).abs() < 1e-3, "{found:?}");
    }

    /// Eqs. 9 and 10.
    #[test]
    fn the_largest_change_is_found_wherever_it_stands() {
        let (mut point_a, mut point_b) = ([[0.0; 4]; 4], [[0.0; 4]; 4]);
        (point_a[0][0], point_b[0][0]) = (900.3, -2077.4);
        (point_a[1][3], point_b[1][3]) = (-6.0, -9341.1);
        assert!((largest_change(&point_a, &point_b) - 10.37).abs() < 0.005);
    }

    #[test]
    fn losses_and_ratios_are_those_of_the_diagonal() {
        let mut rows = vec![[[0.0; 4]; 4]; LATE + 1];
        (rows[FIRST][0][0], rows[FIRST][3][3]) = (1119.12, 1119.56);
        (rows[LATE][0][0], rows[LATE][3][3]) = (809.40, 1033.74);
        let printed = Operator(rows);
        assert!((printed.loss(0) - 0.2768).abs() < 1e-4 && (printed.loss(3) - 0.07666).abs() < 1e-4);
        assert!((printed.along_over_across(LATE) - 0.7830).abs() < 1e-4);
    }
}
