//! Several observers in a row.

use macro_solver::checkpoint::{Archive, CheckpointError};
use macro_solver::observer::{
    CutBack, FieldsView, IterationReport, Observer, Run, Stabilised, StepReport, StopRequest,
};
use macro_solver::problem::{Problem, Stage};

/// Reports everything to each observer, in order. The first that requests a stop ends the round: the observers after it have not
/// seen the step, and the run ends.
pub(super) struct ObserverChain<'a>(pub(super) Vec<&'a mut dyn Observer>);

impl Observer for ObserverChain<'_> {
    fn started(&mut self, problem: &Problem) -> Result<(), StopRequest> {
        self.0.iter_mut().try_for_each(|observer| observer.started(problem))
    }

    fn stage_started(&mut self, number: usize, stage: &Stage) {
        self.0.iter_mut().for_each(|observer| observer.stage_started(number, stage));
    }

    fn iterated(&mut self, report: &IterationReport) {
        self.0.iter_mut().for_each(|observer| observer.iterated(report));
    }

    fn accepted(&mut self, report: &StepReport, fields: &FieldsView<'_>) -> Result<(), StopRequest> {
        self.0.iter_mut().try_for_each(|observer| observer.accepted(report, fields))
    }

    fn cut_back(&mut self, event: &CutBack) {
        self.0.iter_mut().for_each(|observer| observer.cut_back(event));
    }

    fn stabilised(&mut self, event: &Stabilised) {
        self.0.iter_mut().for_each(|observer| observer.stabilised(event));
    }

    fn iterates_committed(&mut self, event: &Stabilised) {
        self.0.iter_mut().for_each(|observer| observer.iterates_committed(event));
    }

    fn finished(&mut self, run: &Run) {
        self.0.iter_mut().for_each(|observer| observer.finished(run));
    }

    fn save(&self, archive: &mut Archive) {
        self.0.iter().for_each(|observer| observer.save(archive));
    }

    fn restore(&mut self, archive: &Archive) -> Result<(), CheckpointError> {
        self.0.iter_mut().try_for_each(|observer| observer.restore(archive))
    }
}
