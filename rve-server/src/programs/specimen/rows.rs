//! What a run measures: lengths, stresses, rows of the table, pictures.

use super::assembly::Joinable;
use super::results::{Shown, SpecimenPicture, SpecimenRow};
use super::run::Run;
use super::stage::{Sheared, Stage};
use super::wall::Wall;
use crate::contact::ContactLaw;
use crate::homogenization::picture::ContactLine;

impl<S: Joinable, C: ContactLaw<S>> Shown for Run<'_, S, C> {
    fn grains(&self) -> SpecimenPicture {
        self.picture()
    }

    fn contacts(&self) -> Vec<ContactLine> {
        self.dynamics.body.contact_lines()
    }
}

impl<S: Joinable, C: ContactLaw<S>> Run<'_, S, C> {
    /// Distance of the walls of an axis, or its period, m.
    pub(super) fn length(&self, axis: usize) -> f64 {
        match self.walls[axis] {
            Some([low, high]) => {
                let place = |wall: usize| self.dynamics.walls[wall].point.as_ref()[axis];
                place(high) - place(low)
            }
            None => self.dynamics.body.period(axis).map_or(self.sides[axis], |period| period[axis]),
        }
    }

    /// Area of a wall, m2.
    pub(super) fn area(&self, axis: usize) -> f64 {
        (0..S::DIMENSION).filter(|other| *other != axis).map(|other| self.length(other)).product::<f64>()
            * self.thickness
    }

    /// Mean normal stress of both walls of an axis, Pa, tension positive.
    pub(super) fn wall_stress(&self, axis: usize) -> f64 {
        self.walls[axis].map_or(0.0, |[low, high]| {
            let force = |wall: usize| self.dynamics.walls[wall].normal_force();
            -0.5 * (force(low) + force(high)) / self.area(axis)
        })
    }

    /// Wall of an axis, 0 or 1, that weight presses the grains on.
    pub(super) fn floor(&self, axis: usize) -> Option<usize> {
        let down = self.dynamics.motion.gravity[axis];
        (down != 0.0).then_some(usize::from(down > 0.0))
    }

    /// Normal stress of the walls of an axis that a target stress moves, Pa, tension positive: of both, or of the one opposite the floor.
    pub(super) fn servo_stress(&self, axis: usize) -> f64 {
        match (self.walls[axis], self.floor(axis)) {
            (Some(pair), Some(floor)) => -self.dynamics.walls[pair[1 - floor]].normal_force() / self.area(axis),
            _ => self.wall_stress(axis),
        }
    }

    /// Shear strain, displacement of the upper side over the distance of both at the start, and shear stress of the walls, Pa:
    /// the mean of both walls' forces along their planes over their area, positive if the upper wall drags the grains along
    /// the axis; 0 where the axis is periodic.
    pub(super) fn shear(&self, sheared: Sheared) -> [f64; 2] {
        let Sheared { side, along, .. } = sheared;
        match self.walls[side] {
            Some(pair) => {
                let [low, high] = pair.map(|wall| &self.dynamics.walls[wall]);
                let slid = high.slid.as_ref()[along] - low.slid.as_ref()[along];
                let force = 0.5 * (low.force.as_ref()[along] - high.force.as_ref()[along]);
                [slid / self.sides[side], force / self.area(side)]
            }
            None => {
                let moved =
                    self.dynamics.body.period(side).map_or(0.0, |period| period[along]) - self.leans[side][along];
                [moved / self.sides[side], 0.0]
            }
        }
    }

    /// Difference of what both walls bear along a shear, over what they bear across it: what damping and inertia of the grains between them take.
    /// 0 where the axis is periodic, and where another one has walls, which bear a part of the shear.
    pub(super) fn shear_difference(&self, sheared: Sheared) -> f64 {
        let Some(pair) = self.walls[sheared.side] else { return 0.0 };
        if (0..S::DIMENSION).any(|axis| axis != sheared.side && self.walls[axis].is_some()) {
            return 0.0;
        }
        let [low, high] = pair.map(|wall| &self.dynamics.walls[wall]);
        let normal = 0.5 * (low.normal_force() + high.normal_force()).abs();
        let left = (low.force.as_ref()[sheared.along] + high.force.as_ref()[sheared.along]).abs();
        if normal > 0.0 { left / normal } else { 0.0 }
    }

    /// Largest unbalanced force over mean contact force; 0 where no contact bears anything.
    pub(super) fn unbalanced(&self) -> f64 {
        let contacts = &self.dynamics.contacts;
        if contacts.contacts == 0 || contacts.normal_force == 0.0 {
            return 0.0;
        }
        self.last.largest_force / (contacts.normal_force / contacts.contacts as f64)
    }

    /// Volume of the box, m3.
    pub(super) fn volume(&self) -> f64 {
        (0..S::DIMENSION).map(|axis| self.length(axis)).product::<f64>() * self.thickness
    }

    /// Love-Weber stress of the contacts between grains, Pa.
    pub(super) fn contact_stress(&self) -> [f64; 6] {
        let (sum, volume) = (self.dynamics.body.stress_sum(), self.volume());
        [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
            .map(|(i, j): (usize, usize)| 0.5 * (sum[i][j] + sum[j][i]) / volume)
    }

    /// A row of the table.
    pub(super) fn row(&self, stage: &Stage) -> SpecimenRow {
        let body = &self.dynamics.body;
        let contacts = &self.dynamics.contacts;
        let volume = self.volume();
        let at_walls: usize = self.dynamics.walls.iter().map(Wall::contacts).sum();
        let inside = contacts.contacts.saturating_sub(at_walls as u64) as f64;
        SpecimenRow {
            stage: stage.name.clone(),
            step: self.dynamics.steps,
            time: self.dynamics.time,
            strain: std::array::from_fn(|axis| self.length(axis) / self.sides[axis] - 1.0),
            wall_stress: std::array::from_fn(|axis| self.wall_stress(axis)),
            contact_stress: self.contact_stress(),
            void_ratio: (volume - self.solid) / self.solid,
            coordination_number: 2.0 * inside / body.grains.len() as f64,
            fabric_anisotropy: crate::preparation::anisotropy_of_fabric(&body.fabric(), S::DIMENSION),
            sliding_fraction: contacts.sliding as f64 / inside.max(1.0),
            unbalanced_force_ratio: self.unbalanced(),
            kinetic_energy: self.last.kinetic_energy,
            elastic_energy: contacts.elastic_energy,
            friction_work: self.dynamics.works[0],
            viscous_work: self.dynamics.works[1],
            damping_work: self.dynamics.works[2],
            max_overlap_ratio: 0.5 * contacts.largest_overlap,
            wall_work: self.dynamics.wall_work,
            shear: self.sheared.iter().map(|sheared| self.shear(*sheared)).collect(),
            shear_work: self.dynamics.shear_work,
            gravity_work: self.dynamics.works[3],
            missing_energy: self.dynamics.missing_energy(),
        }
    }

    /// The grains as they are.
    pub(super) fn picture(&self) -> SpecimenPicture {
        let spread = |components: &[f64]| {
            let mut all = [0.0; 3];
            all[..components.len()].copy_from_slice(components);
            all
        };
        let grains = &self.dynamics.body.grains;
        SpecimenPicture {
            centres: grains.iter().map(|grain| spread(grain.position.as_ref())).collect(),
            radii: grains.iter().map(|grain| grain.radius).collect(),
            rotations: self
                .dynamics
                .rotations
                .iter()
                .map(|rotation| match rotation.as_ref() {
                    [about_z] => [0.0, 0.0, *about_z],
                    components => spread(components),
                })
                .collect(),
            velocities: grains.iter().map(|grain| spread(grain.velocity.as_ref())).collect(),
        }
    }
}
