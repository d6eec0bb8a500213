//! What is strained, and along which path.

use super::window::Window;
use rve_server::definition::RveOptions;
use rve_server::element::ElementTest;

/// One packing, law and path. Paths have strain control only, so that all settings answer the same question.
#[derive(Clone, Debug)]
pub(super) struct Case {
    /// Name in tables and file names.
    pub(super) name: &'static str,
    /// One line for people.
    pub(super) about: &'static str,
    /// The packing file.
    pub(super) packing: &'static str,
    /// The element test without `[rve]`; one row a segment.
    pub(super) test: &'static str,
    /// Strain of one row.
    pub(super) row_strain: f64,
    /// Windows in which the error is taken.
    pub(super) windows: &'static [Window],
    /// `[rve]` of the reference.
    pub(super) reference: &'static str,
    /// How the other programs are told about it; none for cases that only we run.
    pub(super) peer: Option<PeerLaw>,
}

/// Law and path in the words of the other programs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PeerLaw {
    /// k_n = 1000, k_t = 500, friction 0.5; constant-area biaxial strain.
    LinearBiaxial,
    /// Hertz-Mindlin with E = 1e4 and Poisson ratio 0.2, friction 0.5, incremental tangential force; simple shear.
    HertzShear,
}

const DISCS_PATH: &str = r#"packing = "packing.json"
[contact]
law = "linear"
normal_stiffness = 1000.0
stiffness_ratio = 0.5
friction = 0.5
[[path]]
repeat = 24
increments = 1
strain = { xx = 0.0010005001667083846, yy = -0.0009995001666250083 }
"#;

const SPHERES_PATH: &str = r#"packing = "packing.json"
[contact]
law = "hertz_mindlin"
shear_modulus = 4166.666666666667
poisson_ratio = 0.2
tangential_unloading = "incremental"
friction = 0.5
[[path]]
repeat = 30
increments = 1
strain = { xy = 1e-3 }
"#;

/// All cases, in the order of the report.
pub(super) const CASES: &[Case] = &[
    Case {
        name: "discs-400",
        about: "400 discs, k_n/p = 1000, marginally rigid; constant-area biaxial strain to 2.4 % (case A)",
        packing: include_str!("../../../../tests/data/case-a/packing.json"),
        test: DISCS_PATH,
        row_strain: 1e-3,
        windows: &[
            Window { name: "start", after: 0.0, until: 0.003 },
            Window { name: "to_peak", after: 0.003, until: 0.01 },
            Window { name: "after", after: 0.01, until: 0.024 },
        ],
        reference: "strain_per_step = 1e-8\ntolerance = 1e-8",
        peer: Some(PeerLaw::LinearBiaxial),
    },
    Case {
        name: "discs-1000",
        about: "1000 discs, k_n/p = 1000; constant-area biaxial strain to 2.4 %",
        packing: include_str!("../../../../tests/data/throughput/discs-1000.json"),
        test: DISCS_PATH,
        row_strain: 1e-3,
        windows: &[
            Window { name: "start", after: 0.0, until: 0.003 },
            Window { name: "to_peak", after: 0.003, until: 0.01 },
            Window { name: "after", after: 0.01, until: 0.024 },
        ],
        reference: "strain_per_step = 2e-8\ntolerance = 1e-7",
        peer: None,
    },
    Case {
        name: "spheres-1000",
        about: "1000 spheres, Hertz-Mindlin, (E*/p)^(2/3) = 300; simple shear at constant volume to 3 % (case B)",
        packing: include_str!("../../../../tests/data/case-b/packing.json"),
        test: SPHERES_PATH,
        row_strain: 1e-3,
        windows: &[
            Window { name: "start", after: 0.0, until: 0.003 },
            Window { name: "to_peak", after: 0.003, until: 0.01 },
            Window { name: "after", after: 0.01, until: 0.03 },
        ],
        reference: "strain_per_step = 5e-8\ntolerance = 1e-7",
        peer: Some(PeerLaw::HertzShear),
    },
];

impl Case {
    /// The element test with solver options.
    ///
    /// # Panics
    /// When the text of the case is not an element test, which a test excludes.
    pub(super) fn test_with(&self, rve: &RveOptions) -> ElementTest {
        let mut test = ElementTest::from_toml(self.test).expect("the texts of the cases are tested");
        test.rve = rve.clone();
        test
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_are_element_tests_with_packings_and_windows_within_their_path() {
        for case in CASES {
            let test = case.test_with(&RveOptions::default());
            assert!(test.path.iter().all(|segment| segment.increments == 1), "{}", case.name);
            let last = test.path.iter().map(|segment| f64::from(segment.repeat)).sum::<f64>() * case.row_strain;
            assert!(case.windows.iter().all(|window| window.after < window.until && window.until <= last + 1e-12));
            assert!(case.packing.contains("grainspan-packing"));
        }
    }
}
