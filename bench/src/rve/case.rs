//! The cells that are strained, and their paths.

use super::window::Window;
use rve_server::contact::ContactTable;

/// One packing, law and path. Paths have strain control only, so that all settings are measured on the same strains.
#[derive(Clone, Debug)]
pub(super) struct Case {
    /// Name in tables and file names.
    pub(super) name: &'static str,
    /// One line for people.
    pub(super) about: &'static str,
    /// The packing file.
    pub(super) packing: &'static str,
    /// The table `[contact]`.
    pub(super) contact: &'static str,
    /// Displacement gradient of one row, relative to the row before, row-major.
    pub(super) gradient: [f64; 9],
    /// Strain of one row.
    pub(super) row_strain: f64,
    /// Windows in which the error is taken.
    pub(super) windows: &'static [Window],
    /// `[rve]` of the reference.
    pub(super) reference: &'static str,
    /// Law and path for the other programs; none for cases that only Grainspan runs.
    pub(super) peer: Option<PeerLaw>,
}

/// Law and path as the other programs have them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PeerLaw {
    /// k_n = 1000, k_t = 500, friction 0.5; constant-area biaxial strain.
    LinearBiaxial,
    /// Hertz-Mindlin with E = 1e4 and Poisson ratio 0.2, friction 0.5, incremental tangential force; simple shear.
    HertzShear,
}

const DISCS: &str = "law = 'linear'\nnormal_stiffness = 1000.0\nstiffness_ratio = 0.5\nfriction = 0.5";

/// Logarithmic strains +1e-3 and -1e-3.
const BIAXIAL: [f64; 9] =
    [0.001_000_500_166_708_384_6, 0.0, 0.0, 0.0, -0.000_999_500_166_625_008_3, 0.0, 0.0, 0.0, 0.0];

/// E = 1e4, Poisson ratio 0.2.
const SPHERES: &str = "law = 'hertz_mindlin'\nshear_modulus = 4166.666666666667\npoisson_ratio = 0.2\nfriction = 0.5\n\
                       unloading = 'incremental'";

const SHEAR: [f64; 9] = [0.0, 1e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];

/// The start, the rise to the peak, and the rest until the strain `end`.
const fn up_to(end: f64) -> [Window; 3] {
    [
        Window { name: "start", after: 0.0, until: 0.003 },
        Window { name: "to_peak", after: 0.003, until: 0.01 },
        Window { name: "after", after: 0.01, until: end },
    ]
}

/// All cases, in the order of the report.
pub(super) const CASES: &[Case] = &[
    Case {
        name: "discs-400",
        about: "400 discs, k_n/p = 1000, marginally rigid; constant-area biaxial strain to 2.4 % (case A)",
        packing: include_str!("../../../tests/data/case-a/packing.json"),
        contact: DISCS,
        gradient: BIAXIAL,
        row_strain: 1e-3,
        windows: &up_to(0.024),
        reference: "strain_per_step = 1e-8\ntolerance = 1e-8",
        peer: Some(PeerLaw::LinearBiaxial),
    },
    Case {
        name: "discs-1000",
        about: "1000 discs, k_n/p = 1000; constant-area biaxial strain to 2.4 %",
        packing: include_str!("../../../tests/data/throughput/discs-1000.json"),
        contact: DISCS,
        gradient: BIAXIAL,
        row_strain: 1e-3,
        windows: &up_to(0.024),
        reference: "strain_per_step = 2e-8\ntolerance = 1e-7",
        peer: None,
    },
    Case {
        name: "spheres-1000",
        about: "1000 spheres, Hertz-Mindlin, (E*/p)^(2/3) = 300; simple shear at constant volume to 3 % (case B)",
        packing: include_str!("../../../tests/data/case-b/packing.json"),
        contact: SPHERES,
        gradient: SHEAR,
        row_strain: 1e-3,
        windows: &up_to(0.03),
        reference: "strain_per_step = 5e-8\ntolerance = 1e-7",
        peer: Some(PeerLaw::HertzShear),
    },
    Case {
        name: "spheres-4096",
        about: "4096 glass spheres after [Liu2015] 3.1; simple shear at constant volume to 1.5 %",
        packing: include_str!("../../../packings/spheres-4096.json"),
        contact: "law = 'hertz_mindlin'\nshear_modulus = 29.0e9\npoisson_ratio = 0.15\nfriction = 0.5",
        gradient: SHEAR,
        row_strain: 1e-3,
        windows: &up_to(0.015),
        reference: "strain_per_step = 1e-7\ntolerance = 1e-6",
        peer: None,
    },
];

impl Case {
    /// Rows from the start to the end of the last window.
    pub(super) fn rows(&self) -> u32 {
        (self.strain() / self.row_strain).round() as u32
    }

    /// Strain at the end of the last window.
    pub(super) fn strain(&self) -> f64 {
        self.windows.iter().fold(0.0, |most: f64, window| most.max(window.until))
    }

    /// The contact law.
    ///
    /// # Panics
    /// When the text of the case is no contact table, which a test excludes.
    pub(super) fn contact(&self) -> ContactTable {
        toml::from_str(self.contact).expect("the texts of the cases are tested")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_have_laws_packings_and_windows_that_follow_each_other() {
        for case in CASES {
            case.contact().validate().unwrap();
            assert!(case.rows() >= 10 && case.windows.len() == 3, "{}", case.name);
            assert!(case.windows.is_sorted_by(|first, second| first.until == second.after));
            assert!(case.packing.contains("grainspan-packing"));
        }
    }
}
