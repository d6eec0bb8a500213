//! Which displacement components are prescribed, and the numbering of the rest.
//!
//! Degrees of freedom are numbered `dimension * node + axis`. Prescribed ones are eliminated: unknowns are the free ones in
//! ascending order.

/// Split of the degrees of freedom.
#[derive(Clone, Debug)]
pub(super) struct Constraints {
    final_values: Vec<Option<f64>>,
    unknowns: Vec<Option<usize>>,
    free: Vec<usize>,
}

impl Constraints {
    /// From the displacement of every degree of freedom at load 1, m; `None` where free.
    pub(super) fn new(final_values: Vec<Option<f64>>) -> Self {
        let free: Vec<usize> = (0..final_values.len()).filter(|&dof| final_values[dof].is_none()).collect();
        let mut unknowns = vec![None; final_values.len()];
        for (unknown, &dof) in free.iter().enumerate() {
            unknowns[dof] = Some(unknown);
        }
        Self { final_values, unknowns, free }
    }

    /// Degrees of freedom, free and prescribed.
    pub(super) fn count(&self) -> usize {
        self.final_values.len()
    }

    /// Free degrees of freedom, ascending.
    pub(super) fn free(&self) -> &[usize] {
        &self.free
    }

    /// Unknown of a degree of freedom, `None` when prescribed.
    pub(super) fn unknown(&self, dof: usize) -> Option<usize> {
        self.unknowns[dof]
    }

    /// Prescribed total displacement at a load factor, m.
    pub(super) fn prescribed(&self, dof: usize, load: f64) -> Option<f64> {
        self.final_values[dof].map(|value| value * load)
    }

    /// The free components of a vector over all degrees of freedom.
    pub(super) fn restrict(&self, all: &[f64]) -> Vec<f64> {
        self.free.iter().map(|&dof| all[dof]).collect()
    }

    /// A vector over all degrees of freedom that is zero at prescribed ones.
    pub(super) fn expand(&self, free: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.count()];
        for (&dof, value) in self.free.iter().zip(free) {
            all[dof] = *value;
        }
        all
    }
}
