//! Force increment of one prestressed contact under a small motion: [Argilaga2018] eqs. B.4 to B.11, in two and three dimensions.
//!
//! A motion is the change `db` of the branch vector and the spins of both grains, each spin times its grain's radius so
//! that all unknowns are lengths. With `e` the normal, `l` the length, `P = I - e e^T` and `s = P db - (l_O theta_O + l_E
//! theta_E) x e` the slip, the force on the origin grain changes by
//!
//! `df = (k_n e + c) (e . db) + T s + f_n P db / l - e (f_t . db) / l + (theta . e) (e x f_t)`
//!
//! where the last term, absent in the plane, turns the tangential force with the spin `l theta = l_O theta_O + l_E theta_E`
//! of the pair about the normal. A rolling spring adds `-k_r P (theta_O - theta_E)` to the moment on the origin grain and takes
//! it from that on the end grain; that a rolling moment turns with its contact is left out, it is smaller by the overlap over
//! the radius. The moment on a grain is arm x f_t, and half of any lengthening goes to each arm (contact point in the middle
//! of the overlap). All coefficients but those of the prestress are symmetric.

use crate::tangent::link::{Link, dot, turned};
use crate::tangent::sliding::ContactStiffness;
use crate::tangent::strain::{PAIRS, stretched};

/// Most spins of a grain.
const SPINS: usize = 3;

/// Signs of origin and end grain in `db = u_E - u_O`.
const SIGN: [f64; 2] = [-1.0, 1.0];

/// The linearised contact; `B - D` spins of each side are in use.
#[derive(Clone, Copy, Debug)]
pub(super) struct Response<const D: usize, const B: usize> {
    /// Force per change of the branch vector, `[force][db]`.
    translation: [[f64; D]; D],
    /// Force per scaled spin, `[side][spin]`.
    spin: [[[f64; D]; SPINS]; 2],
    /// Moment over radius per change of the branch vector, `[side][spin]`.
    moment: [[[f64; D]; SPINS]; 2],
    /// Moment over radius per scaled spin, `[side][spin][side][spin]`.
    moment_spin: [[[[f64; SPINS]; 2]; SPINS]; 2],
}

impl<const D: usize, const B: usize> Response<D, B> {
    /// Linearises `link`; `radii` are those of origin and end grain.
    #[inline(always)]
    pub(super) fn of(link: &Link<D>, law: &ContactStiffness<D>, radii: [f64; 2]) -> Self {
        let (e, length, force) = (&link.normal, link.length, &link.tangential_force);
        let lever: [[f64; D]; SPINS] =
            std::array::from_fn(|spin| if spin < B - D { turned(spin, e) } else { [0.0; D] });
        let resistance = lever.map(|lever| law.tangential.map(|row| dot(&row, &lever)));
        let translation = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let unit = if i == j { 1.0 } else { 0.0 };
                (law.normal * e[i] + law.coupling[i]) * e[j]
                    + law.tangential[i][j]
                    + (link.normal_force * (unit - e[i] * e[j]) - e[i] * force[j]) / length
            })
        });
        let turning: [f64; SPINS] = std::array::from_fn(|spin| dot(&lever[spin], force));
        let mut response = Self {
            translation,
            spin: [[[0.0; D]; SPINS]; 2],
            moment: [[[0.0; D]; SPINS]; 2],
            moment_spin: [[[[0.0; SPINS]; 2]; SPINS]; 2],
        };
        for side in 0..2 {
            let arm = link.arms[side] / radii[side];
            for spin in 0..B - D {
                let along = 0.5 * turning[spin] / radii[side] + arm * dot(&lever[spin], &law.coupling);
                let tilt = turned(spin, force);
                let tilt_along = dot(&tilt, e);
                for axis in 0..D {
                    let sideways = (tilt[axis] - tilt_along * e[axis]) / length;
                    response.moment[side][spin][axis] = along * e[axis] + arm * (resistance[spin][axis] - sideways);
                    let twist = if D == 3 { e[spin] * turning[axis] / length } else { 0.0 };
                    response.spin[side][spin][axis] = arm * (twist - resistance[spin][axis]);
                }
                for other in 0..2 {
                    let other_arm = link.arms[other] / radii[other];
                    for other_spin in 0..B - D {
                        let twist = if D == 3 { e[other_spin] * force[spin] / length } else { 0.0 };
                        let slip = -arm * (other_arm * (dot(&lever[spin], &resistance[other_spin]) + twist));
                        response.moment_spin[side][spin][other][other_spin] = slip;
                        if link.rolling_stiffness > 0.0 {
                            // Against the difference of the spins, without its part along the normal.
                            let unit = if spin == other_spin { 1.0 } else { 0.0 };
                            let along = if D == 3 { e[spin] * e[other_spin] } else { 0.0 };
                            let scale = SIGN[side] * SIGN[other] / (radii[side] * radii[other]);
                            response.moment_spin[side][spin][other][other_spin] -=
                                link.rolling_stiffness * scale * (unit - along);
                        }
                    }
                }
            }
        }
        response
    }

    /// The block of the balance equations of grain `row` for the unknowns of grain `column` (0 origin, 1 end).
    #[inline(always)]
    pub(super) fn block(&self, row: usize, column: usize) -> [[f64; B]; B] {
        let mut block = [[0.0; B]; B];
        for i in 0..D {
            for j in 0..D {
                block[i][j] = SIGN[row] * SIGN[column] * self.translation[i][j];
            }
            for spin in 0..B - D {
                block[i][D + spin] = SIGN[row] * self.spin[column][spin][i];
                block[D + spin][i] = -SIGN[column] * self.moment[row][spin][i];
            }
        }
        for spin in 0..B - D {
            for other in 0..B - D {
                block[D + spin][D + other] = -self.moment_spin[row][spin][column][other];
            }
        }
        block
    }

    /// Right-hand sides of the balance equations of grain `row`: minus what each unit strain does to them.
    #[inline(always)]
    pub(super) fn load(&self, row: usize, branch: &[f64; D]) -> [[f64; B]; B] {
        let mut load = [[0.0; B]; B];
        for strain in 0..B {
            let motion = stretched(strain, branch);
            for axis in 0..D {
                load[axis][strain] = -SIGN[row] * dot(&self.translation[axis], &motion);
            }
            for spin in 0..B - D {
                load[D + spin][strain] = dot(&self.moment[row][spin], &motion);
            }
        }
        load
    }

    /// Contribution of each unknown of grain `column` to component `D i + j` of `sum_c df x b`.
    #[inline(always)]
    pub(super) fn stress_share(&self, column: usize, branch: &[f64; D]) -> [[f64; PAIRS]; B] {
        let mut share = [[0.0; PAIRS]; B];
        for i in 0..D {
            for j in 0..D {
                for axis in 0..D {
                    share[axis][D * i + j] = SIGN[column] * self.translation[i][axis] * branch[j];
                }
                for spin in 0..B - D {
                    share[D + spin][D * i + j] = self.spin[column][spin][i] * branch[j];
                }
            }
        }
        share
    }

    /// Component `D i + j` of `sum_c df x b` of each uniform strain without spins.
    #[inline(always)]
    pub(super) fn uniform(&self, branch: &[f64; D]) -> [[f64; B]; PAIRS] {
        let mut change = [[0.0; B]; PAIRS];
        for strain in 0..B {
            let motion = stretched(strain, branch);
            for i in 0..D {
                let force = dot(&self.translation[i], &motion);
                for j in 0..D {
                    change[D * i + j][strain] = force * branch[j];
                }
            }
        }
        change
    }
}
