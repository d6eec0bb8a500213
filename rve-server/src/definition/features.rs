//! Parts of definitions that not every engine follows.

use super::packing_file::PackingFile;
use super::{AnyDefinition, AtStepCap, Criterion, Damping, SolverName};
use crate::contact::{Rotations, TangentialUnloading};

/// A part of a definition that an engine follows only if its capabilities say so (`features`), by its key in scenes. What every engine has
/// to follow is not among them: grains, stiffnesses, friction, cohesion, accuracy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EngineFeature {
    /// Rolling stiffness and friction.
    RollingResistance,
    /// A packing with the rolling moments of its contacts, version 2 of the file.
    RollingMoments,
    /// Viscosity of the contacts.
    ContactDamping,
    /// Another effect of unloading on the tangential force than the default.
    Unloading,
    /// Grains that only translate.
    BlockedRotations,
    /// Another equilibrium criterion than the default.
    Criterion,
    /// Trials that are refused when the step cap ends them.
    AtStepCap,
    /// A bound on the force evaluations of a trial.
    MaxEvaluations,
    /// Another way to equilibrium than the default.
    Solver,
    /// Another damping than the default.
    Damping,
    /// Relaxation of increments of exactly zero.
    ZeroIncrements,
}

protocol::keywords! {
    pub EngineFeature {
        RollingResistance => "contact.rolling_stiffness",
        RollingMoments => "packing.rolling_moments",
        ContactDamping => "contact.damping",
        Unloading => "contact.unloading",
        BlockedRotations => "contact.rotations",
        Criterion => "rve.criterion",
        AtStepCap => "rve.at_step_cap",
        MaxEvaluations => "rve.max_evaluations",
        Solver => "rve.solver",
        Damping => "rve.damping",
        ZeroIncrements => "economy.zero_increments",
    }
}

impl EngineFeature {
    /// Whether an engine without it solves another problem. The others are ways to the same equilibrium, of which every engine has one.
    pub fn is_part_of_the_problem(self) -> bool {
        match self {
            Self::RollingResistance
            | Self::RollingMoments
            | Self::ContactDamping
            | Self::Unloading
            | Self::BlockedRotations
            | Self::Criterion
            | Self::AtStepCap
            | Self::MaxEvaluations => true,
            Self::Solver | Self::Damping | Self::ZeroIncrements => false,
        }
    }

    /// Whether a definition makes use of it.
    pub fn is_used_by(self, definition: &AnyDefinition) -> bool {
        let (contact, options) = (definition.contact(), definition.options());
        match self {
            Self::RollingResistance => contact.rolling_stiffness > 0.0 || contact.rolling_friction > 0.0,
            Self::RollingMoments => definition.packing_version() != PackingFile::VERSION,
            Self::ContactDamping => contact.damping > 0.0,
            Self::Unloading => contact.unloading.is_some_and(|unloading| unloading != TangentialUnloading::default()),
            Self::BlockedRotations => contact.rotations == Rotations::Blocked,
            Self::Criterion => options.criterion != Criterion::default(),
            Self::AtStepCap => options.at_step_cap != AtStepCap::default(),
            Self::MaxEvaluations => options.max_evaluations.is_some(),
            Self::Solver => options.solver != SolverName::default(),
            Self::Damping => options.damping != Damping::default(),
            Self::ZeroIncrements => options.relax_zero_increments,
        }
    }
}
