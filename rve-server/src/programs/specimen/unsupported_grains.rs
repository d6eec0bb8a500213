//! Grains that bear nothing: balance is balance of forces that are borne.

/// What tells that grains fly: no contact bears them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UnsupportedGrains {
    /// Sum of the normal forces of all contacts, N.
    pub(super) normal_force: f64,
    /// Largest force on a grain, N.
    pub(super) largest_force: f64,
    /// Largest weight of a grain that nothing touches, N; 0 without gravity.
    pub(super) free_weight: f64,
    /// J.
    pub(super) kinetic_energy: f64,
    /// Energy that has been turned over so far, J.
    pub(super) turnover: f64,
}

impl UnsupportedGrains {
    /// Whether grains fly while no contact bears anything, with forces or without, or fall under their weight while others are pressed
    /// together: no ratio to a mean contact force tells of that. Kinetic energy is quadratic in what the limit of the balance bounds.
    pub(super) fn are_in_the_air(&self, limit: f64) -> bool {
        let coasts = self.kinetic_energy > limit * limit * self.turnover;
        let falls = self.free_weight > 0.0;
        falls || (self.normal_force == 0.0 && (self.largest_force > 0.0 || coasts))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grains_that_fall_or_coast_are_in_the_air_and_those_that_lie_or_are_borne_are_not() {
        let at_rest = UnsupportedGrains { turnover: 1e-3, ..UnsupportedGrains::default() };
        let in_the_air = |grains: UnsupportedGrains| grains.are_in_the_air(1e-3);
        assert!(!in_the_air(at_rest));
        assert!(in_the_air(UnsupportedGrains { largest_force: 1e-3, ..at_rest }), "it falls");
        assert!(in_the_air(UnsupportedGrains { kinetic_energy: 2e-9, ..at_rest }), "it coasts");
        assert!(!in_the_air(UnsupportedGrains { kinetic_energy: 5e-10, ..at_rest }), "what the limit leaves");
        assert!(
            !in_the_air(UnsupportedGrains { kinetic_energy: 1e-4, largest_force: 1.0, normal_force: 2.0, ..at_rest }),
            "it is borne"
        );
        let pressed = UnsupportedGrains { normal_force: 1e3, largest_force: 1e-2, free_weight: 1e-2, ..at_rest };
        assert!(in_the_air(pressed), "one falls among others that are pressed");
        assert!(!in_the_air(UnsupportedGrains { free_weight: 0.0, ..pressed }));
    }
}
