//! Cells of grains in one process, as a worker solves them: requests in, answers and sealed states out.

use anyhow::Context;
use protocol::{Observables, RveEngine, TangentKind, Tensor2, TrialOptions, TrialRequest};
use rve_server::contact::ContactTable;
use rve_server::definition::{AnyDefinition, Packing, RveOptions};
use rve_server::engine::GrainEngine;
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::Path;

/// Strain of one increment: compression along the last axis, half of it as extension along the first.
const STRAIN: f64 = 1e-3;

/// When a result is requested.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Asked {
    #[default]
    Never,
    /// With the last increment alone.
    Last,
    /// With all increments but the last.
    Before,
    /// With every increment.
    Every,
}

impl Asked {
    fn at(self, increment: u32, of: u32) -> bool {
        match self {
            Self::Never => false,
            Self::Last => increment == of,
            Self::Before => increment < of,
            Self::Every => true,
        }
    }
}

/// What a process does: a path of `increments`, each solved for all cells in one batch and committed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct CellPlan {
    /// The packing, as JSON.
    pub(super) packing: String,
    /// `[contact]`.
    pub(super) contact: ContactTable,
    /// `[rve]`.
    pub(super) options: RveOptions,
    /// Increments; 0 leaves the start of the process alone.
    pub(super) increments: u32,
    /// Cells of a batch.
    pub(super) cells: u32,
    /// Tangent operator.
    pub(super) tangent: (TangentKind, Asked),
    /// Observables.
    pub(super) observables: (Observables, Asked),
}

/// What `--helper trials PLAN` does: works off the plan in a file and prints how many force evaluations it took.
///
/// # Errors
/// There is no such plan, or a trial fails.
pub(crate) fn follow(plan: &Path) -> anyhow::Result<u64> {
    let plan: CellPlan = serde_json::from_slice(&fs::read(plan).context("the plan")?).context("the plan")?;
    let packing = Packing::from_json("packing", &plan.packing)?;
    let definition = AnyDefinition::new(packing, plan.contact.clone(), plan.options.clone()).to_protocol();
    let mut solver = GrainEngine.create(&definition)?;
    let mut first = Vec::new();
    solver.snapshot(&mut first);
    let mut states = vec![first; plan.cells as usize];
    let (mut evaluations, mut tangents) = (0, 0);
    for increment in 1..=plan.increments {
        let wanted = |asked: Asked| asked.at(increment, plan.increments);
        let options = TrialOptions {
            tangent: if wanted(plan.tangent.1) { plan.tangent.0 } else { TangentKind::None },
            observables: if wanted(plan.observables.1) { plan.observables.0 } else { Observables::NONE },
            ..TrialOptions::default()
        };
        let requests: Vec<TrialRequest<'_>> = states
            .iter()
            .enumerate()
            .map(|(cell, state)| TrialRequest { definition: definition.id(), state, target: target(cell), options })
            .collect();
        let answers = solver.solve_batch(&requests).into_iter().collect::<Result<Vec<_>, _>>()?;
        states.clear();
        for (answer, state) in answers {
            evaluations += answer.cost.force_evaluations;
            tangents += u64::from(answer.tangent.is_some());
            states.push(state);
        }
    }
    let expected = (1..=plan.increments).filter(|one| plan.tangent.1.at(*one, plan.increments)).count() as u64;
    anyhow::ensure!(tangents == expected * u64::from(plan.cells), "{tangents} tangents were returned");
    Ok(evaluations)
}

/// The displacement gradient of one increment; cells differ by per cent.
fn target(cell: usize) -> Tensor2 {
    let strain = STRAIN * (1.0 + 0.01 * cell as f64);
    let mut target = Tensor2::ZERO;
    target.0[0] = 0.5 * strain;
    target.0[4] = -strain;
    target
}
