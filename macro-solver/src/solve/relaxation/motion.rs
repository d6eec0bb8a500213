//! Dynamic relaxation of [Liu2018] section 2.3: a damped motion whose end is the equilibrium.
//!
//! `M U'' + a M U' + F_int = F_ext` by central differences with half-step velocities,
//! `V+ = [(2 - a dt) V- + 2 dt M^-1 (F_ext - F_int)] / (2 + a dt)`, `U+ = U + dt V+`, `a = 2 xi w`. Nothing of the motion is
//! physical: masses and time serve to find the equilibrium.
//!
//! Errata. As printed (eqs 25-28) one frequency `w` serves for the damping and for the step. It is a Rayleigh quotient, near the
//! lowest frequency of the body, while the step must obey the highest: the printed scheme diverges on all but the
//! coarsest meshes. And it stops by kinetic energy alone, which also vanishes where a slow motion turns round. Here
//! ([`RelaxationForm::Corrected`]) the step comes from the element bound, the damping from the quotient of the increments
//! from one iterate to the next, and an end needs the balance of forces beside the kinetic energy, several times in a row.

use crate::problem::relaxation::{RelaxationForm, RelaxationSettings};

/// Out-of-balance force over loads and reactions that is no more than rounding.
const ROUNDING: f64 = 1e-13;

/// Largest kinetic energy of a critically damped motion of frequency `w` over a distance `u` that begins at rest, over `m w^2 u^2 / 2`:
/// the speed is `w^2 u t exp(-w t)`, largest at `w t = 1`.
const OF_DAMPED_MOTION: f64 = 0.135_335_283_236_612_7;

/// Motion towards one equilibrium. Vectors run over all degrees of freedom.
#[derive(Clone, Debug)]
pub(crate) struct Relaxation<'a> {
    settings: &'a RelaxationSettings,
    /// Of every degree of freedom, kg.
    masses: &'a [f64],
    is_free: &'a [bool],
    /// Bound of the highest frequency, rad/s.
    highest: f64,
    /// Frequency of the damping, rad/s; the last that made sense.
    frequency: f64,
    velocity: Vec<f64>,
    kinetic: f64,
    largest_kinetic: f64,
    /// Kinetic energy that the motion from the last equilibrium would have without a first iterate that anticipates it.
    kinetic_of_step: f64,
    hits: usize,
}

impl<'a> Relaxation<'a> {
    /// At rest.
    pub(crate) fn new(
        settings: &'a RelaxationSettings,
        masses: &'a [f64],
        is_free: &'a [bool],
        highest: f64,
    ) -> Self {
        Self {
            settings,
            masses,
            is_free,
            highest,
            frequency: highest,
            velocity: vec![0.0; masses.len()],
            kinetic: 0.0,
            largest_kinetic: 0.0,
            kinetic_of_step: 0.0,
            hits: 0,
        }
    }

    /// Takes the damping frequency from displacements and the forces that resist them: `w^2 = u.f / u.M u`. In the corrected
    /// form both are changes from one iterate to the next at free degrees of freedom: the quotient of the mode that moves, in
    /// which stresses that were there before play no part. A quotient that is not positive, as softening gives, keeps the last
    /// one; none exceeds the highest frequency.
    pub(crate) fn observe(&mut self, displacements: &[f64], forces: &[f64]) {
        let counts = |dof: usize| self.is_free[dof] || self.settings.form == RelaxationForm::AsPrinted;
        let sum = |of: &dyn Fn(usize) -> f64| (0..self.masses.len()).filter(|dof| counts(*dof)).map(of).sum::<f64>();
        let work = sum(&|dof| displacements[dof] * forces[dof]);
        let inertia = sum(&|dof| self.masses[dof] * displacements[dof] * displacements[dof]);
        let square = work / inertia;
        if square > 0.0 && square.is_finite() {
            self.frequency = square.sqrt().min(self.highest);
        }
    }

    /// Time step, s.
    pub(crate) fn step(&self) -> f64 {
        let (ratio, safety) = (self.settings.damping_ratio, self.settings.safety);
        match self.settings.form {
            RelaxationForm::Corrected => safety * 2.0 / self.highest,
            RelaxationForm::AsPrinted => safety * 2.0 / self.frequency * ((ratio * ratio + 1.0).sqrt() - ratio),
        }
    }

    /// The step over the critical one; above 1 the motion grows without bound.
    pub(crate) fn step_ratio(&self) -> f64 {
        0.5 * self.step() * self.highest
    }

    /// Displacements of the next step, m, under the out-of-balance force (internal minus external), N.
    pub(crate) fn advance(&mut self, residual: &[f64]) -> Vec<f64> {
        let step = self.step();
        let damping = 2.0 * self.settings.damping_ratio * self.frequency * step;
        for dof in 0..self.velocity.len() {
            if self.is_free[dof] {
                let pushed = 2.0 * step * residual[dof] / self.masses[dof];
                self.velocity[dof] = ((2.0 - damping) * self.velocity[dof] - pushed) / (2.0 + damping);
            }
        }
        self.kinetic = self.velocity.iter().zip(self.masses).map(|(v, m)| 0.5 * m * v * v).sum();
        self.largest_kinetic = self.largest_kinetic.max(self.kinetic);
        self.velocity.iter().map(|velocity| step * velocity).collect()
    }

    /// Takes the displacements since the last equilibrium, m. In the corrected form they tell how much kinetic energy there is to lose: a first
    /// iterate that is nearly right leaves a motion of what the cells scatter, which never dies away.
    pub(crate) fn note_displacement(&mut self, displacements: &[f64]) {
        let inertia: f64 = (0..displacements.len())
            .filter(|&dof| self.is_free[dof] && self.settings.form == RelaxationForm::Corrected)
            .map(|dof| self.masses[dof] * displacements[dof] * displacements[dof])
            .sum();
        self.kinetic_of_step = OF_DAMPED_MOTION * 0.5 * self.frequency * self.frequency * inertia;
    }

    /// Kinetic energy over the largest that there was, or that a motion from the last equilibrium without a first iterate would have had; 0 if
    /// nothing has moved.
    pub(crate) fn kinetic_ratio(&self) -> f64 {
        let largest = self.largest_kinetic.max(self.kinetic_of_step);
        if largest > 0.0 { self.kinetic / largest } else { 0.0 }
    }

    /// Whether the motion has come to rest, for an out-of-balance force over loads and reactions that is to be below a tolerance. Where it
    /// is down to rounding, as from a first iterate that was exact, the motion is rounding too and has no kinetic energy to lose.
    pub(crate) fn is_settled(&mut self, force_ratio: f64, tolerance: f64) -> bool {
        let is_still = self.kinetic_ratio() <= self.settings.kinetic_tolerance || force_ratio <= ROUNDING;
        let holds = is_still && (force_ratio <= tolerance || self.settings.form == RelaxationForm::AsPrinted);
        self.hits = if holds { self.hits + 1 } else { 0 };
        self.hits >= self.settings.hits
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use claims::Claim;

    /// S-11: prestress makes the total quotient negative and softening the one of increments; neither is taken.
    #[test]
    fn frequencies_that_make_no_sense_are_not_taken() {
        let settings = RelaxationSettings::default();
        let mut relaxation = Relaxation::new(&settings, &[2.0, 2.0], &[true, true], 10.0);
        assert_eq!(relaxation.frequency, 10.0);
        relaxation.observe(&[1.0, 0.0], &[8.0, 0.0]);
        assert_eq!(relaxation.frequency, 2.0);
        relaxation.observe(&[1.0, 0.0], &[-8.0, 5.0]);
        relaxation.observe(&[0.0, 0.0], &[0.0, 0.0]);
        relaxation.observe(&[1.0, 0.0], &[f64::NAN, 0.0]);
        Claim::of("S-11", "frequency after estimates that make no sense")
            .value(relaxation.frequency, 2.0)
            .within(0.0);
        relaxation.observe(&[1.0, 0.0], &[1e9, 0.0]);
        assert_eq!(relaxation.frequency, 10.0);
    }

    /// What is left of an exact first iterate never dies away: each residual is as large as the one before.
    #[test]
    fn a_motion_of_rounding_errors_is_at_rest() {
        let settings = RelaxationSettings::default();
        let mut relaxation = Relaxation::new(&settings, &[1.0], &[true], 20.0);
        let settled = (0..100).position(|step: i32| {
            let residual = if step % 2 == 0 { 1e-16 } else { -1e-16 };
            relaxation.advance(&[residual]);
            relaxation.is_settled(1e-16, 1e-4)
        });
        assert_eq!(settled, Some(settings.hits - 1));
    }

    /// A first iterate that is right to the scatter of the cells: what is left has as much kinetic energy as at its start, far less than a motion
    /// over the displacement of the step would have had.
    #[test]
    fn a_motion_of_scatter_is_at_rest_where_the_step_is_large() {
        let settings = RelaxationSettings::default();
        let settled = |way: f64| {
            let mut relaxation = Relaxation::new(&settings, &[1.0], &[true], 20.0);
            (0..100).position(|step: i32| {
                let residual = if step % 2 == 0 { 1e-4 } else { -1e-4 };
                relaxation.advance(&[residual]);
                relaxation.note_displacement(&[way]);
                relaxation.is_settled(1e-4, 1e-3)
            })
        };
        assert_eq!(settled(1.0), Some(settings.hits - 1));
        assert_eq!(settled(1e-9), None);
    }

    /// The constant is the largest kinetic energy of a critically damped mass.
    #[test]
    fn a_critically_damped_motion_has_the_kinetic_energy_of_its_displacement() {
        let settings = RelaxationSettings { safety: 0.01, ..Default::default() };
        let (way, frequency) = (0.3, 2.0);
        let mut relaxation = Relaxation::new(&settings, &[1.5], &[true], 2.0);
        let mut place = 0.0;
        for _ in 0..1000 {
            place += relaxation.advance(&[1.5 * frequency * frequency * (place - way)])[0];
        }
        relaxation.note_displacement(&[way]);
        let ratio = relaxation.kinetic_of_step / relaxation.largest_kinetic;
        assert!((ratio - 1.0).abs() < 0.02 && (place - way).abs() < 1e-3, "{ratio}");
    }

    /// One mass on one spring, critically damped: the known number of steps, and no end at a turning point.
    #[test]
    fn a_single_mass_comes_to_rest_in_balance() {
        let settings = RelaxationSettings { damping_ratio: 0.05, kinetic_tolerance: 1e-2, ..Default::default() };
        let mut relaxation = Relaxation::new(&settings, &[1.0], &[true], 20.0);
        let (mut place, mut turned, mut steps) = (0.0, 0, 0);
        loop {
            let residual = 4.0 * place - 4.0;
            relaxation.observe(&[place], &[4.0 * place]);
            place += relaxation.advance(&[residual])[0];
            turned += usize::from(relaxation.kinetic_ratio() < 1e-2);
            steps += 1;
            if relaxation.is_settled((4.0 * place - 4.0f64).abs(), 1e-4) {
                break;
            }
            assert!(steps < 10_000);
        }
        assert!((place - 1.0).abs() < 1e-4 && turned > 6, "{place} after {steps} steps, {turned} at rest");
    }
}
