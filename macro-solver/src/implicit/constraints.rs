//! Which displacement components are prescribed in a stage, and the numbering of the rest.
//!
//! Degrees of freedom are numbered `dimension * node + axis`. Prescribed ones are eliminated: unknowns are the free ones in
//! ascending order.

use crate::problem::{Amplitude, Moment, Origin, Prescribed};

/// Split of the degrees of freedom.
#[derive(Clone, Debug)]
pub(crate) struct Constraints {
    paths: Vec<Option<Path>>,
    histories: Vec<Amplitude>,
    unknowns: Vec<Option<usize>>,
    free: Vec<usize>,
}

/// Displacement of one degree of freedom over a stage: `start + change x factor`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Path {
    start: f64,
    change: f64,
    history: usize,
}

impl Constraints {
    /// From what is prescribed at every degree of freedom and the displacements at the beginning of the stage, m.
    pub(crate) fn new(prescribed: &[Option<Prescribed<'_>>], start: &[f64]) -> Self {
        let mut histories: Vec<Amplitude> = Vec::new();
        let mut paths = Vec::with_capacity(prescribed.len());
        for (given, &start) in prescribed.iter().zip(start) {
            paths.push(given.map(|given| {
                let known = histories.iter().position(|history| history == given.history);
                let history = known.unwrap_or_else(|| {
                    histories.push(given.history.clone());
                    histories.len() - 1
                });
                let change = match given.origin {
                    Origin::Stage => given.value,
                    Origin::Run => given.value - start,
                };
                Path { start, change, history }
            }));
        }
        let free: Vec<usize> = (0..paths.len()).filter(|&dof| paths[dof].is_none()).collect();
        let mut unknowns = vec![None; paths.len()];
        for (unknown, &dof) in free.iter().enumerate() {
            unknowns[dof] = Some(unknown);
        }
        Self { paths, histories, unknowns, free }
    }

    /// Degrees of freedom, free and prescribed.
    pub(crate) fn count(&self) -> usize {
        self.paths.len()
    }

    /// Free degrees of freedom, ascending.
    pub(crate) fn free(&self) -> &[usize] {
        &self.free
    }

    /// Unknown of a degree of freedom, `None` when prescribed.
    pub(crate) fn unknown(&self, dof: usize) -> Option<usize> {
        self.unknowns[dof]
    }

    /// Prescribed total displacement at a moment of the stage, m.
    pub(crate) fn prescribed(&self, dof: usize, moment: Moment) -> Option<f64> {
        self.paths[dof].map(|path| path.start + path.change * self.histories[path.history].factor(moment))
    }

    /// The free components of a vector over all degrees of freedom.
    pub(crate) fn restrict(&self, all: &[f64]) -> Vec<f64> {
        self.free.iter().map(|&dof| all[dof]).collect()
    }

    /// A vector over all degrees of freedom that is zero at prescribed ones.
    pub(crate) fn expand(&self, free: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.count()];
        for (&dof, value) in self.free.iter().zip(free) {
            all[dof] = *value;
        }
        all
    }
}
