//! What of a Gauss point goes into a checkpoint: everything that a later step can see. Between two steps no trial is
//! held and no sample is kept, and the counters of a step start again with it.

use super::pore_fluid::Fluid;
use super::secant::ReferenceModuli;
use super::{Point, Points};
use crate::checkpoint::CheckpointError;
use crate::formulation::{AveragedModuli, Operator};
use crate::nonlocal::NonlocalLayer;
use nalgebra::Matrix3;
use protocol::{Cost, Observed, Scalars, Tensor2, TrialFlags, TrialResult};
use serde::{Deserialize, Serialize};

/// One Gauss point after an accepted step.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct PointRecord {
    deformation: Vec<f64>,
    stress: Vec<f64>,
    moduli: Vec<f64>,
    /// Own, seen and strain part of the moduli with averages, where points are coupled.
    averaged: Option<[Vec<f64>; 3]>,
    tangent: Vec<f64>,
    reference: Option<[f64; 3]>,
    correction: Option<Vec<f64>>,
    last_step: Vec<f64>,
    /// Bulk modulus, Pa, and reference of the pore fluid.
    fluid: Option<[f64; 2]>,
    ramp_steps: u32,
    /// Share by which the friction of the committed state is below that of the definition.
    committed_reduction: f64,
    evaluations: u64,
    cost: Cost,
    answer: Option<AnswerRecord>,
}

/// An accepted answer without its tangent, which the point holds itself.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct AnswerRecord {
    stress: Tensor2,
    scalars: Scalars,
    observed: Observed,
    cost: Cost,
    flags: TrialFlags,
}

impl Points {
    /// Every point, by number.
    pub(crate) fn records(&self) -> Vec<PointRecord> {
        self.points.iter().map(Point::record).collect()
    }

    /// Strain increments of the last committed step; empty without neighbours.
    pub(crate) fn previous_strains(&self) -> Vec<Vec<f64>> {
        let strains = self.neighbours.as_ref().map_or(&[][..], NonlocalLayer::previous);
        strains.iter().map(|strain| strain.as_slice().to_vec()).collect()
    }

    /// Takes up the strain increments of the last committed step.
    pub(crate) fn restore_strains(&mut self, section: &str, strains: &[Vec<f64>]) -> Result<(), CheckpointError> {
        let expected = if self.neighbours.is_some() { self.points.len() } else { 0 };
        if strains.len() != expected {
            return Err(CheckpointError::unfit(section, "it was written with other neighbourhoods"));
        }
        let mut restored = vec![Matrix3::zeros(); expected];
        for (strain, values) in restored.iter_mut().zip(strains) {
            copy(section, strain.as_mut_slice(), values)?;
        }
        if let Some(neighbours) = &mut self.neighbours {
            neighbours.commit(restored);
        }
        Ok(())
    }

    /// Takes up every point.
    pub(crate) fn restore(&mut self, section: &str, records: Vec<PointRecord>) -> Result<(), CheckpointError> {
        if records.len() != self.points.len() {
            let reason = format!("{} Gauss points instead of {}", records.len(), self.points.len());
            return Err(CheckpointError::unfit(section, reason));
        }
        for (point, record) in self.points.iter_mut().zip(records) {
            *point = Point::new();
            point.restore(section, record)?;
        }
        Ok(())
    }
}

impl Point {
    fn record(&self) -> PointRecord {
        PointRecord {
            deformation: self.deformation.as_slice().to_vec(),
            stress: self.response.stress.as_slice().to_vec(),
            moduli: self.response.moduli.as_slice().to_vec(),
            averaged: self.averaged.as_ref().map(|averaged| {
                [&averaged.own, &averaged.seen, &averaged.strain].map(|part| part.as_slice().to_vec())
            }),
            tangent: self.tangent.as_slice().to_vec(),
            reference: self.reference.map(|reference| [reference.norm, reference.vertical, reference.shear]),
            correction: self.correction.as_ref().map(|correction| correction.as_slice().to_vec()),
            last_step: self.last_step.as_slice().to_vec(),
            fluid: self.fluid.map(|fluid| [fluid.bulk_modulus, fluid.reference]),
            ramp_steps: self.ramp_steps,
            committed_reduction: self.committed_reduction,
            evaluations: self.evaluations,
            cost: self.cost,
            answer: self.answer.as_ref().map(|answer| AnswerRecord {
                stress: answer.stress,
                scalars: answer.scalars,
                observed: answer.observed,
                cost: answer.cost,
                flags: answer.flags,
            }),
        }
    }

    fn restore(&mut self, section: &str, record: PointRecord) -> Result<(), CheckpointError> {
        copy(section, self.deformation.as_mut_slice(), &record.deformation)?;
        self.trial_deformation = self.deformation;
        copy(section, self.response.stress.as_mut_slice(), &record.stress)?;
        self.committed_stress = self.response.stress;
        copy(section, self.last_step.as_mut_slice(), &record.last_step)?;
        self.fluid = record.fluid.map(|[bulk_modulus, reference]| Fluid { bulk_modulus, reference });
        if let Some(values) = &record.correction {
            let mut correction = Box::new(Operator::zeros());
            copy(section, correction.as_mut_slice(), values)?;
            self.correction = Some(correction);
        }
        copy(section, self.response.moduli.as_mut_slice(), &record.moduli)?;
        if let Some(parts) = &record.averaged {
            let mut averaged =
                AveragedModuli { own: Operator::zeros(), seen: Operator::zeros(), strain: Operator::zeros() };
            let targets = [&mut averaged.own, &mut averaged.seen, &mut averaged.strain];
            for (target, values) in targets.into_iter().zip(parts) {
                copy(section, target.as_mut_slice(), values)?;
            }
            self.averaged = Some(Box::new(averaged));
        }
        copy(section, self.tangent.as_mut_slice(), &record.tangent)?;
        self.reference = record.reference.map(|[norm, vertical, shear]| ReferenceModuli { norm, vertical, shear });
        self.ramp_steps = record.ramp_steps;
        (self.committed_reduction, self.answered_reduction) =
            (record.committed_reduction, record.committed_reduction);
        self.evaluations = record.evaluations;
        self.cost = record.cost;
        self.answer = record.answer.map(|answer| TrialResult {
            stress: answer.stress,
            tangent: None,
            scalars: answer.scalars,
            observed: answer.observed,
            cost: answer.cost,
            flags: answer.flags,
        });
        Ok(())
    }
}

/// Copies numbers that must be as many as expected.
pub(crate) fn copy(section: &str, into: &mut [f64], from: &[f64]) -> Result<(), CheckpointError> {
    if into.len() != from.len() {
        let reason = format!("{} numbers instead of {}", from.len(), into.len());
        return Err(CheckpointError::unfit(section, reason));
    }
    into.copy_from_slice(from);
    Ok(())
}
