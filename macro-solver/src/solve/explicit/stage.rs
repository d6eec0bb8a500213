//! A dynamic stage among the stages of a run: the parts of the solver that the integrator moves, and its reports.

use crate::checkpoint::CheckpointError;
use crate::model::body::by_node;
use crate::observer::{Convergence, DynamicsView, Outcome};
use crate::problem::Procedure;
use crate::problem::dynamics::DynamicSettings;
use crate::solve::accepted::{AcceptedState, Counters};
use crate::solve::driver::{Session, Solver};
use crate::solve::explicit::stage_context::StageContext;
use crate::solve::explicit::{Integrator, IntegratorRecord};

impl Solver<'_> {
    /// Follows the motion to the end of the stage. Steps of the run are its reports; a checkpoint is kept with each.
    pub(in crate::solve) fn integrate(
        &mut self,
        settings: &DynamicSettings,
        session: &mut Session<'_>,
    ) -> Result<(), Outcome> {
        let (mut integrator, mut counters) = match self.integrator.take() {
            Some(under_way) => (under_way, Counters::of(&self.statistics)),
            None => self.begin(settings, session)?,
        };
        let mut reported = integrator.done();
        while !integrator.is_done() {
            integrator.advance(&mut self.context(settings), session.material)?;
            if integrator.is_reported(settings.reporting) {
                self.step += 1;
                integrator = self.report(integrator, reported, &counters, session)?;
                (counters, reported) = (Counters::of(&self.statistics), integrator.done());
                self.points.start_step();
                self.integrator = Some(integrator);
                self.save_step(session);
                integrator = self.integrator.take().expect("just put there");
            }
        }
        self.integrator = Some(integrator);
        Ok(())
    }

    /// Starts the integrator; a run that begins with it reports its first instant as step 0. The counters are those from which the next
    /// report counts: in later stages it takes what the start has cost.
    fn begin(
        &mut self,
        settings: &DynamicSettings,
        session: &mut Session<'_>,
    ) -> Result<(Integrator, Counters), Outcome> {
        let mut counters = Counters::of(&self.statistics);
        let handover = std::mem::take(&mut self.handover);
        let mut integrator = Integrator::start(&mut self.context(settings), handover, session.material)?;
        if self.stage == 0 {
            self.check_start_of_motion()
                .map_err(|defect| Outcome::DidNotConverge { reason: format!("initial state: {defect}") })?;
            integrator = self.report(integrator, 0, &counters, session)?;
            counters = Counters::of(&self.statistics);
            self.points.start_step();
            self.integrator = Some(integrator);
            self.save_step(session);
            integrator = self.integrator.take().expect("just put there");
        }
        Ok((integrator, counters))
    }

    fn context<'s>(&'s mut self, settings: &'s DynamicSettings) -> StageContext<'s> {
        StageContext {
            problem: self.problem,
            stage: &self.problem.stages[self.stage],
            settings,
            body: &mut self.body,
            points: &mut self.points,
            constraints: &self.constraints,
            loads: &self.loads,
            frictions: &self.frictions,
            statistics: &mut self.statistics,
        }
    }

    /// Reports the state of the instant; `reported` is the number of the instant reported before.
    fn report(
        &mut self,
        mut integrator: Integrator,
        reported: u64,
        before: &Counters,
        session: &mut Session<'_>,
    ) -> Result<Integrator, Outcome> {
        let load = integrator.load(self.stage());
        let step_size = load - self.load;
        self.load = load;
        self.note_accuracy(None, session);
        let dimension = self.body.mesh().dimension.count();
        let (added_mass, mass) = integrator.added_mass();
        let state = AcceptedState {
            load,
            stage_fraction: load,
            step_size,
            iterations: usize::try_from(integrator.done() - reported).unwrap_or(usize::MAX),
            force_ratio: 0.0,
            displacement_ratio: 0.0,
            convergence: Convergence::Full,
            gradients: integrator.gradients_since_report(),
            reactions: integrator.reactions(),
            loads: integrator.loads(),
            hourglass_energy: integrator.hourglass_energy(),
            dynamics: Some(DynamicsView {
                velocities: &by_node(dimension, integrator.velocity()),
                accelerations: &by_node(dimension, integrator.acceleration()),
                energy: integrator.energy(),
                time_step: integrator.step(),
                stable_step: integrator.stable_step(),
                added_mass,
                mass,
            }),
        };
        // The state that a stage begins with is no step.
        self.statistics.steps += u64::from(integrator.done() > reported);
        self.report_accepted(&state, before, session)?;
        integrator.reported();
        Ok(integrator)
    }

    /// Takes up the integrator of a checkpoint; everything else of the solver has been.
    pub(in crate::solve) fn restore_integrator(
        &mut self,
        section: &str,
        record: Option<IntegratorRecord>,
    ) -> Result<(), CheckpointError> {
        let Some(record) = record else { return Ok(()) };
        let Procedure::Dynamic(settings) = &self.problem.stages[self.stage].procedure else {
            return Err(CheckpointError::unfit(
                section,
                "it stands in a dynamic stage, which the scene does not have",
            ));
        };
        self.integrator = Some(Integrator::restore(section, record, &self.context(settings))?);
        Ok(())
    }
}
