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
const KINDS: [(&str, &str); 8] = [
    ("CTO", "consistent"),
    ("DEMQO", "quasi_static"),
    ("PSTLO", "truss_like"),
    ("UKO", "kruyt"),
    ("UKO as printed", "kruyt_printed"),
    ("UCKO", "kruyt_calibrated"),
    ("UCKO-2DOF", "kruyt_twice_calibrated"),
    ("KAO as printed", "kruyt_augmented_printed"),
];

/// Rows of the curve: after the first step, and at 1.5 %.
const FIRST: usize = 1;
const LATE: usize = 38;

fn runs(size: Size) -> Vec<Run> {
    let run = |(_, kind): (&str, &'static str)| {
        Run::new(kind, "scenes/argilaga2018/operators.toml", Command::Element(Some(kind)), size)
    };
    KINDS.map(run).into()
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

fn evaluate(results: &Results, _: Size) -> Result<Outcome, ReproduceError> {
    let tables = KINDS.map(|(_, kind)| results.run(kind).and_then(|run| run.table()));
    let tables = tables.into_iter().collect::<Result<Vec<_>, _>>()?;
    let operators = tables.iter().map(Operator::of).collect::<Result<Vec<_>, _>>()?;
    let [cto, demqo, pstlo, uko, printed, ..] = &operators[..] else {
        return Err(ReproduceError::NotFound("the figure has too few operators".to_owned()));
    };
    let compression: Vec<f64> = tables[0].column("F_yy")?.iter().map(|stretch| 1.0 - stretch).collect();
    let mut chart = Chart::new(
        "[Argilaga2018]: C_1111 of one cell over the path, by operator",
        ("axial compression", Scale::Linear),
        ("C_1111, MPa", Scale::Linear),
    );
    // The last one is the first in another form, too close to be told apart.
    for ((name, _), operator) in KINDS.iter().zip(&operators) {
        let values = (0..compression.len()).map(|row| [compression[row], operator.along(row) / 1e6]);
        chart.curve(name, values);
    }
    let [xx, yy] = [tables[0].column("sigma_xx")?, tables[0].column("sigma_yy")?];
    let broken = |operator: &Operator| {
        let c = &operator.0[FIRST];
        (c[1][2] - c[1][1] - (xx[FIRST] - yy[FIRST])).abs() / operator.shear(FIRST)
    };
    let ratio = |quantity: &str, theirs, source, ours, tolerance| {
        Comparison::new(quantity, "-", Theirs::Value(theirs), source, ours, Tolerance::Absolute(tolerance))
    };
    let derived = "[Argilaga2018] eqs. 9 to 21";
    let comparisons = vec![
        ratio(
            "c_x = C_1111 of CTO over UKO, first step",
            0.8045,
            derived,
            cto.along(FIRST) / uko_printed(printed),
            0.04,
        ),
        ratio("C_1111 of DEMQO over CTO, first step", 1.002, derived, demqo.along(FIRST) / cto.along(FIRST), 0.02),
        ratio(
            "C_1111 of PSTLO over DEMQO, first step",
            1.0,
            "equal by T-1",
            pstlo.along(FIRST) / demqo.along(FIRST),
            0.01,
        ),
        ratio("K of PSTLO over UKO, first step", 0.883, derived, pstlo.bulk(FIRST) / uko.bulk(FIRST), 0.045),
        ratio("G of PSTLO over UKO, first step", 0.7205, derived, pstlo.shear(FIRST) / uko.shear(FIRST), 0.036),
        ratio(
            "C_1122 over C_1111 of DEMQO, first step",
            0.096,
            derived,
            demqo.0[FIRST][0][3] / demqo.along(FIRST),
            0.03,
        ),
        ratio(
            "loss of C_1111 + C_2222 of UKO as printed at 1.5 %",
            0.177,
            derived,
            1.0 - printed.trace(LATE) / printed.trace(FIRST),
            0.05,
        ),
        ratio(
            "C_1212 of UKO as printed over C_1111 (erratum to eq. 13)",
            1.0,
            derived,
            printed.0[FIRST][1][1] / printed.along(FIRST),
            0.05,
        ),
        Comparison::reported("violation of objectivity over G, CTO; theirs 9 %", "-", broken(cto)),
        Comparison::reported("violation of objectivity over G, DEMQO; theirs 9 %", "-", broken(demqo)),
        Comparison::new(
            "violation of objectivity over G, PSTLO",
            "-",
            Theirs::Value(0.0),
            "identity C_1221 - C_1212 = s11 - s22",
            broken(pstlo),
            Tolerance::Absolute(1e-3),
        ),
    ];
    Ok(Outcome { charts: vec![("", chart)], comparisons, notes: results.notes(), ..Outcome::default() })
}

fn uko_printed(printed: &Operator) -> f64 {
    printed.along(FIRST)
}
