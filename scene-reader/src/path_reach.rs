//! How far an element test strains, as far as its path alone tells.

use crate::tables::PathStrain;
use rve_server::programs::rve_test::ElementTest;

/// A deformation gradient; components that follow from controlled stresses are not known beforehand.
type Known = [[Option<f64>; 3]; 3];

/// Smallest and largest strain of the path, as the study calls it; `None` where controlled stresses decide.
pub(super) fn strain_range(test: &ElementTest, strain: PathStrain) -> Option<[f64; 2]> {
    let mut deformation: Known = std::array::from_fn(|i| std::array::from_fn(|j| Some(f64::from(u8::from(i == j)))));
    let start = strain_of(&deformation, strain)?;
    let [mut lowest, mut highest] = [start; 2];
    for segment in &test.path {
        let (strains, stresses) = (segment.strain.values(), segment.stress.values());
        let step: Known = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let place = 3 * i + j;
                let unit = f64::from(u8::from(i == j));
                stresses[place].is_none().then(|| unit + strains[place].unwrap_or(0.0))
            })
        });
        // Within a segment the deformation is linear: its ends are the extremes.
        for _ in 0..segment.repeat {
            deformation = product(&step, &deformation);
            let here = strain_of(&deformation, strain)?;
            (lowest, highest) = (lowest.min(here), highest.max(here));
        }
    }
    Some([lowest, highest])
}

fn strain_of(deformation: &Known, strain: PathStrain) -> Option<f64> {
    match strain {
        PathStrain::CompressionX => deformation[0][0].map(|stretch| 1.0 - stretch),
        PathStrain::CompressionY => deformation[1][1].map(|stretch| 1.0 - stretch),
        PathStrain::CompressionZ => deformation[2][2].map(|stretch| 1.0 - stretch),
        PathStrain::ShearXy => deformation[0][1],
    }
}

/// The product, where what is not known does not matter behind a zero.
fn product(first: &Known, second: &Known) -> Known {
    let part = |one: Option<f64>, other: Option<f64>| match (one, other) {
        (Some(0.0), _) | (_, Some(0.0)) => Some(0.0),
        (Some(one), Some(other)) => Some(one * other),
        (None, _) | (_, None) => None,
    };
    std::array::from_fn(|i| {
        std::array::from_fn(|j| (0..3).try_fold(0.0, |sum, k| Some(sum + part(first[i][k], second[k][j])?)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(path: &str, strain: PathStrain) -> Option<[f64; 2]> {
        let head = "packing = \"p.json\"\n[contact]\nnormal_stiffness = 1e3\nstiffness_ratio = 0.5\nfriction = 0.5\n";
        strain_range(&ElementTest::from_toml(&format!("{head}{path}")).unwrap(), strain)
    }

    fn of(path: &str, strain: PathStrain) -> Option<f64> {
        range(path, strain).map(|[_, highest]| highest)
    }

    #[test]
    fn strains_that_the_path_prescribes_add_up() {
        let turned = "[[path]]\nincrements = 2\nstrain = { yy = -0.1 }\nstress = { xx = -1e5 }\n\
                      [[path]]\nincrements = 2\nstrain = { yy = 0.05 }\nstress = { xx = -1e5 }\n";
        assert!((of(turned, PathStrain::CompressionY).unwrap() - 0.1).abs() < 1e-12);
        assert_eq!(of(turned, PathStrain::CompressionX), None);
        let extended = turned.replacen("-0.1", "0.02", 1);
        let [lowest, highest] = range(&extended, PathStrain::CompressionY).unwrap();
        assert!((lowest - (1.0 - 1.02 * 1.05)).abs() < 1e-12 && highest == 0.0, "{lowest} {highest}");
        let repeated = "[[path]]\nincrements = 1\nrepeat = 10\nstrain = { xx = -0.01 }\n";
        assert!((of(repeated, PathStrain::CompressionX).unwrap() - (1.0 - 0.99f64.powi(10))).abs() < 1e-12);
        let sheared = "[[path]]\nincrements = 4\nstrain = { xy = 0.2 }\n";
        assert_eq!(of(sheared, PathStrain::ShearXy), Some(0.2));
        let at_stress = "[[path]]\nincrements = 4\nstrain = { xy = 0.2 }\nstress = { yy = -1e5 }\n";
        assert_eq!(of(at_stress, PathStrain::ShearXy), Some(0.2));
        let twice = at_stress.replace("= 4", "= 4\nrepeat = 2");
        assert_eq!(of(&twice, PathStrain::ShearXy), None, "the height that the second shear begins with is free");
    }
}
