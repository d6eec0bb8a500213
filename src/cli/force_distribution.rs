//! The distribution P(f) of the normal contact forces of a cell.

use charts::{Chart, ChartError, Scale};
use rve_server::homogenization::picture::CellPicture;
use std::fmt::Write as _;

/// Width of a class over the mean force.
const CLASS: f64 = 0.25;

/// Probability density of the normal force over its mean, in classes of a quarter of the mean.
pub(super) struct ForceDistribution {
    /// Middle of each class, force over mean force, and density; classes that hold no contact are left out.
    classes: Vec<[f64; 2]>,
    /// Mean compression of the contacts that press, N.
    mean: f64,
}

impl ForceDistribution {
    /// Of the contacts that press on each other. Those that attract are left out, as is a contact without force.
    pub(super) fn of(picture: &CellPicture) -> Self {
        let forces: Vec<f64> =
            picture.contacts.iter().map(|contact| -contact.normal_force).filter(|force| *force > 0.0).collect();
        let count = forces.len() as f64;
        let mean = forces.iter().sum::<f64>() / count;
        let mut classes: Vec<usize> = forces.iter().map(|force| (force / mean / CLASS) as usize).collect();
        classes.sort_unstable();
        let density = |class: &[usize]| [(class[0] as f64 + 0.5) * CLASS, class.len() as f64 / count / CLASS];
        Self { classes: classes.chunk_by(|one, other| one == other).map(density).collect(), mean }
    }

    /// Rows `force_over_mean,density,force`, the last one in N.
    pub(super) fn to_csv(&self) -> String {
        let mut text = "force_over_mean,density,force\n".to_owned();
        for [force, density] in &self.classes {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{force},{density},{:e}", force * self.mean);
        }
        text
    }

    /// The curve over half logarithmic axes, on which exponential tails are straight.
    ///
    /// # Errors
    /// The chart cannot be drawn.
    pub(super) fn to_svg(&self, title: &str) -> Result<String, ChartError> {
        let x = ("normal force over its mean", Scale::Linear);
        let mut chart = Chart::new(&format!("{title}: forces of the contacts"), x, ("density", Scale::Logarithmic));
        chart.curve("contacts that press", self.classes.clone());
        chart.to_svg()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rve_server::homogenization::picture::ContactLine;

    /// Contacts with these normal forces, compression positive.
    fn picture(forces: &[f64]) -> CellPicture {
        let line = |force: &f64| ContactLine {
            grains: [0, 1],
            from: [0.0; 3],
            to: [1.0, 0.0, 0.0],
            normal_force: -force,
            tangential_force: 0.0,
            force: [-force, 0.0, 0.0],
            overlap: 0.0,
            is_sliding: false,
        };
        CellPicture {
            outline: Vec::new(),
            dimension: 2,
            cell: vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            centres: vec![[0.0; 3]; 2],
            radii: vec![1.0; 2],
            rotations: vec![[0.0; 3]; 2],
            rattlers: vec![false; 2],
            contacts: forces.iter().map(line).collect(),
        }
    }

    #[test]
    fn the_density_has_the_integral_one_and_counts_what_presses() {
        // Mean 4 of the pressing ones: 0.25, 0.25, 0.5 and 3 times the mean.
        let found = ForceDistribution::of(&picture(&[1.0, 1.0, 2.0, 12.0, -5.0, 0.0]));
        assert_eq!(found.classes, [[0.375, 2.0], [0.625, 1.0], [3.125, 1.0]]);
        assert_eq!(found.classes.iter().map(|class| CLASS * class[1]).sum::<f64>(), 1.0);
        assert!(found.to_csv().ends_with("3.125,1,1.25e1\n"), "{}", found.to_csv());
    }

    /// The quantiles of an exponential distribution give its density within the spread of the classes.
    #[test]
    fn exponential_forces_have_an_exponential_density() {
        let forces: Vec<f64> = (0..40_000).map(|number| -(1.0 - (f64::from(number) + 0.5) / 40_000.0).ln()).collect();
        let found = ForceDistribution::of(&picture(&forces));
        for [force, density] in found.classes.iter().filter(|class| class[0] < 4.0) {
            assert!((density / (-force).exp() - 1.0).abs() < 0.01, "{force} {density}");
        }
    }

    #[test]
    fn a_cell_without_contacts_has_an_empty_picture() {
        let found = ForceDistribution::of(&picture(&[]));
        assert!(found.classes.is_empty() && found.to_csv().lines().count() == 1);
        assert!(!found.to_svg("none").unwrap().contains("NaN"));
    }
}
