//! The pool behind the user materials, which a host cannot open by a call: it is described by environment variables.

use crate::ffi_boundary::Failure;
use crate::functions::GrainspanPool;
use crate::gather::Gather;
use grain_pool::{PoolError, RvePool, State, Trial};
use protocol::{MOST_RAMP_STEPS, TangentKind, Tensor2, TrialOptions, TrialResult};
use std::env::VarError;
use std::str::FromStr;
use std::sync::OnceLock;

/// Name of the variable with the path of the executable.
const PROGRAM: &str = "GRAINSPAN_PROGRAM";
/// Name of the variable with the path of a TOML file with `packing`, `[contact]`, `[rve]`.
const CELL: &str = "GRAINSPAN_CELL";
/// Name of the variable with the number of worker processes; without it one per core.
const WORKERS: &str = "GRAINSPAN_WORKERS";
/// Name of the variable with the increments in which a cell applies each deformation; without it the cell chooses.
const RAMP_STEPS: &str = "GRAINSPAN_RAMP_STEPS";
/// Name of the variable that tells what the strains of a host are: `finite` (usual), `lagrange` or `small`.
const STRAINS: &str = "GRAINSPAN_STRAINS";
/// Name of the variable with the tangent operator of user materials, by its number.
const TANGENT: &str = "GRAINSPAN_TANGENT";

/// What the strains of a host are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Strains {
    /// Deformation gradients; equilibrium in the deformed body, by Cauchy's stress.
    Finite,
    /// Deformation gradients; equilibrium in the undeformed body, by the second Piola-Kirchhoff stress.
    Lagrange,
    /// Symmetric gradients of displacements; equilibrium in the undeformed body.
    Small,
}

/// What answers the user materials.
pub(crate) struct Material {
    pub(crate) pool: RvePool,
    calls: Gather<Trial, Result<TrialResult, Failure>>,
    ramp_steps: u32,
    pub(crate) strains: Strains,
    tangent: TangentKind,
}

/// Strain out of the plane that is rounding: hosts such as CalculiX make solids of elements in plane strain, and tie their faces.
const NO_STRAIN: f64 = 1e-9;

impl Material {
    /// The target of a cell: of discs the part in their plane.
    ///
    /// # Errors
    /// Strains out of the plane of discs, which have no stiffness there.
    pub(crate) fn target_of_cell(&self, target: &Tensor2) -> Result<Tensor2, Failure> {
        if self.pool.dimension() != 2 {
            return Ok(*target);
        }
        in_plane(target)
    }

    /// The tangent operator that hosts get where they do not say more.
    pub(crate) fn tangent(&self) -> TangentKind {
        self.tangent
    }

    /// What is requested of a trial with this tangent.
    pub(crate) fn options(&self, tangent: TangentKind) -> TrialOptions {
        TrialOptions { tangent, ramp_steps: self.ramp_steps, ..TrialOptions::default() }
    }

    /// A point in the initial state of the cell.
    ///
    /// # Errors
    /// See [`PoolError`].
    pub(crate) fn new_state(&self) -> Result<State, Failure> {
        Ok(self.pool.new_states(0, 1)?[0])
    }

    /// The response of one point. Calls that come from several threads are answered together.
    ///
    /// # Errors
    /// A refusal, lost workers.
    pub(crate) fn trial(&self, state: State, target: Tensor2, options: TrialOptions) -> Result<TrialResult, Failure> {
        let answer = self.calls.call(Trial { state, target, options }, |trials| self.batch(trials));
        answer.unwrap_or_else(|| Err(PoolError::Closed.into()))
    }

    /// The responses of several points. A refusal of one point is none of the others.
    fn batch(&self, trials: &[Trial]) -> Vec<Result<TrialResult, Failure>> {
        match self.pool.trial(trials) {
            Ok(results) => results.into_iter().map(Ok).collect(),
            Err(PoolError::Refused { .. }) if trials.len() > 1 => {
                trials.iter().flat_map(|trial| self.batch(std::slice::from_ref(trial))).collect()
            }
            Err(error) => {
                let failure = Failure::from(error);
                trials.iter().map(|_| Err(failure.clone())).collect()
            }
        }
    }
}

/// The value of an environment variable, if it is set.
///
/// # Errors
/// It is not text.
fn optional(name: &str) -> Result<Option<String>, Failure> {
    match std::env::var(name) {
        Ok(text) => Ok(Some(text)),
        Err(VarError::NotPresent) => Ok(None),
        Err(VarError::NotUnicode(_)) => {
            Err(Failure::input(format!("the environment variable {name} is not UTF-8 text")))
        }
    }
}

/// The value of an environment variable.
///
/// # Errors
/// It is not set, or is not text.
fn named(name: &str) -> Result<String, Failure> {
    optional(name)?.ok_or_else(|| Failure::input(format!("the environment variable {name} is not set")))
}

/// A whole number from an environment variable, if it is set.
///
/// # Errors
/// It is no whole number.
fn number<T: FromStr>(name: &str) -> Result<Option<T>, Failure> {
    let Some(text) = optional(name)? else { return Ok(None) };
    let wrong =
        |_| Failure::input(format!("{name} = \"{text}\" is not a whole number; unset it for the usual choice"));
    text.trim().parse().map(Some).map_err(wrong)
}

/// Refuses more increments than a trial may have; `name` is where the number comes from.
///
/// # Errors
/// It is larger.
pub(crate) fn expect_ramp_steps(name: &str, number: u32) -> Result<(), Failure> {
    if number <= MOST_RAMP_STEPS {
        return Ok(());
    }
    Err(Failure::input(format!(
        "{name} = {number}: a deformation is applied in at most {MOST_RAMP_STEPS} increments; 0 lets the cell choose"
    )))
}

/// The part of a displacement gradient that cells of discs take.
///
/// # Errors
/// It strains out of their plane, or holds a NaN there.
fn in_plane(target: &Tensor2) -> Result<Tensor2, Failure> {
    let out_of_plane = (0..9).filter(|place| place / 3 == 2 || place % 3 == 2).map(|place| target.0[place].abs());
    // In this order a NaN is larger than any number.
    let largest = out_of_plane.max_by(f64::total_cmp).unwrap_or(0.0);
    if largest.is_nan() || largest > NO_STRAIN {
        return Err(Failure::input(format!(
            "cells of discs serve plane strain alone, and this step strains by {largest:.1e} out of their plane; take a packing of \
             spheres for solids and axial symmetry"
        )));
    }
    Ok(Tensor2::from_plane(target.plane()))
}

fn open() -> Result<Material, Failure> {
    let ramp_steps = number(RAMP_STEPS)?.unwrap_or(0);
    expect_ramp_steps(RAMP_STEPS, ramp_steps)?;
    let strains = match optional(STRAINS)?.as_deref() {
        None | Some("finite") => Strains::Finite,
        Some("lagrange") => Strains::Lagrange,
        Some("small") => Strains::Small,
        Some(other) => {
            return Err(Failure::input(format!(
                "{STRAINS} = \"{other}\": \"finite\", \"lagrange\" and \"small\" are known"
            )));
        }
    };
    let tangent = match number(TANGENT)? {
        None => TangentKind::TrussLikeSlip,
        // Hosts need a tangent, so that "none" is no choice.
        Some(other) => {
            TangentKind::from_wire(other).filter(|tangent| *tangent != TangentKind::None).ok_or_else(|| {
                Failure::input(format!("{TANGENT} = {other} is no tangent operator; unset it for the usual one, 2"))
            })?
        }
    };
    let pool = GrainspanPool::open(&named(PROGRAM)?, &[named(CELL)?], number(WORKERS)?.unwrap_or(0))?;
    Ok(Material { pool: pool.pool, calls: Gather::new(), ramp_steps, strains, tangent })
}

/// The material of this process, opened at the first call.
///
/// # Errors
/// Why there is none; later calls get the same error.
pub(crate) fn material() -> Result<&'static Material, Failure> {
    static OPENED: OnceLock<Result<Material, Failure>> = OnceLock::new();
    let opened = OPENED.get_or_init(open).as_ref();
    opened.map_err(Failure::clone)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// It took half an hour that nobody could interrupt.
    #[test]
    fn a_count_of_increments_out_of_bounds_is_refused() {
        assert!(expect_ramp_steps("ramp_steps", MOST_RAMP_STEPS).is_ok());
        let error = expect_ramp_steps("ramp_steps", 4_000_000_000).unwrap_err().text;
        assert!(error.contains("ramp_steps = 4000000000"), "{error}");
    }

    #[test]
    fn cells_of_discs_take_strains_in_their_plane_alone() {
        let with = |place: usize, value: f64| {
            let mut target = Tensor2::from_plane([[1e-4, 2e-4], [0.0, -1e-3]]);
            target.0[place] = value;
            in_plane(&target)
        };
        assert_eq!(with(0, 3e-4).unwrap().plane(), [[3e-4, 2e-4], [0.0, -1e-3]]);
        assert!(with(8, 1e-3).unwrap_err().text.contains("strains by 1.0e-3 out of their plane"));
        // It was taken for no strain.
        for place in [2, 5, 6, 7, 8] {
            assert!(with(place, f64::NAN).is_err(), "{place}");
        }
    }
}
