//! Weights over distance.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the influence of a neighbour falls with `q = distance / radius`; nothing from `q = 1` on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kernel {
    /// `(1 - q^2)^2`, [Liu2015] appendix A. Erratum: its Fourier transform changes sign (first at `k radius` = 5.763,
    /// 6.380, 6.988 in one, two, three dimensions), so a wave of the mesh may be averaged to its opposite and then
    /// grows without bound; only radii below about twice the point distance are stable.
    Bell,
    /// `(1 - q)^4 (4 q + 1)`, Wendland's C2 function: its transform is positive in up to three dimensions.
    #[default]
    Wendland,
    /// `(1 - q)^2`: positive as well, with a kink at the point itself.
    Cone,
}

protocol::keywords! {
    pub Kernel {
        Bell => "bell",
        Wendland => "wendland",
        Cone => "cone",
    }
}

impl Kernel {
    /// Weight at `q >= 0`, 1 at 0.
    pub fn weight(self, q: f64) -> f64 {
        if q >= 1.0 {
            return 0.0;
        }
        let rest = 1.0 - q;
        match self {
            Self::Bell => (1.0 - q * q) * (1.0 - q * q),
            Self::Wendland => rest.powi(4) * (4.0 * q + 1.0),
            Self::Cone => rest * rest,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use claims::Claim;

    /// `integral of w(q) q^power dq` by the midpoint rule.
    fn moment(kernel: Kernel, power: i32) -> f64 {
        let cells = 200_000;
        let width = 1.0 / f64::from(cells);
        (0..cells).map(|cell| (f64::from(cell) + 0.5) * width).map(|q| kernel.weight(q) * q.powi(power) * width).sum()
    }

    /// K-2: norms 16/15, pi/3, 32 pi/105 of the bell in one, two, three dimensions, and second moments per axis R^2/7,
    /// R^2/8, R^2/9.
    #[test]
    fn moments_of_the_bell_are_those_of_its_integrals() {
        use std::f64::consts::PI;
        let norms =
            [2.0 * moment(Kernel::Bell, 0), 2.0 * PI * moment(Kernel::Bell, 1), 4.0 * PI * moment(Kernel::Bell, 2)];
        for (norm, expected) in norms.iter().zip([16.0 / 15.0, PI / 3.0, 32.0 * PI / 105.0]) {
            Claim::of("K-2", "norm of the bell in one, two and three dimensions").value(*norm, expected).within(1e-8);
        }
        let seconds = [
            2.0 * moment(Kernel::Bell, 2) / norms[0],
            PI * moment(Kernel::Bell, 3) / norms[1],
            4.0 * PI / 3.0 * moment(Kernel::Bell, 4) / norms[2],
        ];
        for (second, expected) in seconds.iter().zip([1.0 / 7.0, 1.0 / 8.0, 1.0 / 9.0]) {
            Claim::of("K-2", "second moment of the bell by quadrature").value(*second, expected).within(1e-8);
        }
    }

    #[test]
    fn kernels_fall_from_one_to_zero() {
        for kernel in Kernel::ALL {
            assert_eq!(kernel.weight(0.0), 1.0);
            assert_eq!(kernel.weight(1.0), 0.0);
            let values: Vec<f64> = (0..=20).map(|tick| kernel.weight(f64::from(tick) / 20.0)).collect();
            assert!(values.is_sorted_by(|first, second| first > second), "{}", kernel.keyword());
        }
    }
}
