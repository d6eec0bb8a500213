//! The types of the header, field by field.

use protocol::Observed;
use std::ffi::{c_char, c_int, c_void};

/// `grainspan_cell`.
#[derive(Debug)]
#[repr(C)]
#[expect(missing_docs, reason = "the header explains every field")]
pub struct Cell {
    pub dimension: u32,
    pub grains: u32,
    pub thickness: f64,
    pub periodicity: [f64; 9],
    pub centres: *const f64,
    pub radii: *const f64,
    pub normal_stiffness: f64,
    pub modulus: f64,
    pub stiffness_ratio: f64,
    pub friction: f64,
    pub cohesion: f64,
    pub strain_per_step: f64,
    pub tolerance: f64,
    pub definition: *const c_char,
}

/// `grainspan_trial_options`.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
#[expect(missing_docs, reason = "the header explains every field")]
pub struct TrialOptions {
    pub tangent: u32,
    pub ramp_steps: u32,
    pub observables: u32,
    pub reserved: u32,
}

/// `grainspan_answer`. `observed` is `grainspan_observed`, which has the fields of replies.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
#[expect(missing_docs, reason = "the header explains every field")]
pub struct Answer {
    pub stress: [f64; 9],
    pub tangent: [f64; 81],
    pub void_ratio: f64,
    pub coordination_number: f64,
    pub unbalanced_force_ratio: f64,
    pub max_overlap_ratio: f64,
    pub volume_ratio: f64,
    pub force_evaluations: u64,
    pub ramp_steps: u64,
    pub flags: u32,
    pub reserved: u32,
    pub observed: Observed,
}

impl Answer {
    /// All zero.
    pub fn blank() -> Self {
        Self {
            stress: [0.0; 9],
            tangent: [0.0; 81],
            void_ratio: 0.0,
            coordination_number: 0.0,
            unbalanced_force_ratio: 0.0,
            max_overlap_ratio: 0.0,
            volume_ratio: 0.0,
            force_evaluations: 0,
            ramp_steps: 0,
            flags: 0,
            reserved: 0,
            observed: Observed::default(),
        }
    }
}

/// `grainspan_engine`. Every function may be null in C; a table with a null one is refused.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
#[expect(missing_docs, reason = "the header explains every field")]
pub struct EngineTable {
    pub name: *const c_char,
    pub version: *const c_char,
    pub plane: u32,
    pub space: u32,
    pub linear: u32,
    pub hertz_mindlin: u32,
    pub largest_target: f64,
    pub create: Option<unsafe extern "C" fn(*const Cell, *mut c_char, usize) -> *mut c_void>,
    pub trial: Option<
        unsafe extern "C" fn(*mut c_void, *const f64, *const TrialOptions, *mut Answer, *mut c_char, usize) -> c_int,
    >,
    pub commit: Option<unsafe extern "C" fn(*mut c_void)>,
    pub rollback: Option<unsafe extern "C" fn(*mut c_void)>,
    pub snapshot: Option<unsafe extern "C" fn(*const c_void, c_int, *mut u8, usize) -> usize>,
    pub restore: Option<unsafe extern "C" fn(*mut c_void, *const u8, usize, *mut c_char, usize) -> c_int>,
    pub release: Option<unsafe extern "C" fn(*mut c_void)>,
    pub observables: *const c_char,
    pub features: *const c_char,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sizes as a C compiler gives them for the header, on machines with 64-bit pointers.
    #[test]
    fn types_have_the_sizes_of_the_header() {
        let sizes = [size_of::<Cell>(), size_of::<TrialOptions>(), size_of::<Answer>(), size_of::<EngineTable>()];
        assert_eq!(sizes, [168, 16, 1000, 112]);
    }
}
