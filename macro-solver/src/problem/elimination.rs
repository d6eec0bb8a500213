//! Linear equations between displacements, solved for some of them: Gauss-Jordan elimination on sparse rows.
//!
//! Unknowns that belong to no node go first, then of every equation the component with the largest coefficient (the last
//! one among equals) becomes dependent. No dependent component is left on any right-hand side.

use super::constraint_equations::Equation;
use super::{Amplitude, Origin, Prescribed, ProblemError};
use std::collections::BTreeMap;

/// Coefficients below this share of the largest of their equation are rounding.
const ROUNDING: f64 = 1e-11;

/// A component of displacement that follows from others: `change = sum of coefficient x change + sum of value x factor`,
/// changes counted from the beginning of the stage.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Dependent<'a> {
    /// The component.
    pub(crate) dof: usize,
    /// Free components that it follows, with coefficients, ascending.
    pub(crate) masters: Vec<(usize, f64)>,
    /// What is added, m, with its history.
    pub(crate) given: Vec<(f64, &'a Amplitude)>,
}

/// What an equation speaks of; auxiliary unknowns come first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Column {
    Auxiliary(usize),
    Dof(usize),
}

#[derive(Clone, Debug)]
struct Row<'a> {
    terms: BTreeMap<Column, f64>,
    given: Vec<(f64, &'a Amplitude)>,
    /// Largest coefficient that it began with.
    scale: f64,
    /// Number of the condition that it comes from.
    condition: usize,
}

impl<'a> Row<'a> {
    fn new(equation: &Equation<'a>, prescribed: &[Option<Prescribed<'a>>]) -> Result<Self, ProblemError> {
        let mut row = Self { terms: BTreeMap::new(), given: Vec::new(), scale: 0.0, condition: equation.condition };
        row.add_given(equation.value, equation.history);
        for &(dof, coefficient) in &equation.terms {
            match prescribed[dof] {
                None => *row.terms.entry(Column::Dof(dof)).or_insert(0.0) += coefficient,
                Some(Prescribed { value, origin: Origin::Stage, history }) => {
                    row.add_given(-coefficient * value, history)
                }
                Some(_) => {
                    return Err(ProblemError::MultiPointConstraint {
                        reason: "a linked component is led back to where the run began",
                        remedy: "let its displacement count from the stage",
                    }
                    .of_condition(equation.condition));
                }
            }
        }
        for &(number, coefficient) in &equation.auxiliary {
            *row.terms.entry(Column::Auxiliary(number)).or_insert(0.0) += coefficient;
        }
        let coefficients = equation.terms.iter().chain(&equation.auxiliary).map(|(_, coefficient)| coefficient.abs());
        row.scale = coefficients.fold(0.0, f64::max);
        row.forget_rounding();
        Ok(row)
    }

    fn add_given(&mut self, value: f64, history: &'a Amplitude) {
        if value == 0.0 {
            return;
        }
        match self.given.iter_mut().find(|(_, known)| *known == history) {
            Some((sum, _)) => *sum += value,
            None => self.given.push((value, history)),
        }
    }

    /// Adds `factor` times another equation and forgets what rounding has left.
    fn add(&mut self, other: &Self, factor: f64) {
        for (&column, coefficient) in &other.terms {
            *self.terms.entry(column).or_insert(0.0) += factor * coefficient;
        }
        for &(value, history) in &other.given {
            self.add_given(factor * value, history);
        }
        self.scale = self.scale.max(factor.abs() * other.scale);
        self.forget_rounding();
    }

    /// Leaves out terms that have cancelled, up to rounding.
    fn forget_rounding(&mut self) {
        let least = ROUNDING * self.scale;
        self.terms.retain(|_, coefficient| coefficient.abs() > least);
    }

    fn scaled(&mut self, factor: f64) {
        self.terms.values_mut().for_each(|coefficient| *coefficient *= factor);
        self.given.iter_mut().for_each(|(value, _)| *value *= factor);
        self.scale *= factor.abs();
    }

    fn coefficient(&self, column: Column) -> f64 {
        self.terms.get(&column).copied().unwrap_or(0.0)
    }
}

/// Solves the equations for dependent components; prescribed ones count as known.
///
/// # Errors
/// Equations that contradict one another or what is prescribed.
pub(crate) fn dependents<'a>(
    equations: &[Equation<'a>],
    prescribed: &[Option<Prescribed<'a>>],
) -> Result<Vec<Dependent<'a>>, ProblemError> {
    let mut rows = equations.iter().map(|equation| Row::new(equation, prescribed)).collect::<Result<Vec<_>, _>>()?;
    let largest = rows.iter().flat_map(|row| &row.given).fold(0.0, |most: f64, (value, _)| most.max(value.abs()));
    let auxiliaries = equations.iter().flat_map(|equation| &equation.auxiliary).map(|(number, _)| number + 1).max();
    for number in 0..auxiliaries.unwrap_or(0) {
        let column = Column::Auxiliary(number);
        let size = |row: &Row<'_>| row.coefficient(column).abs();
        let pivot = (0..rows.len()).max_by(|&one, &other| size(&rows[one]).total_cmp(&size(&rows[other])));
        // Only one row can tell it: this one, which then says nothing else.
        if let Some(pivot) = pivot.filter(|&pivot| size(&rows[pivot]) > 0.0) {
            let row = rows.remove(pivot);
            clear(&mut rows, &row, column);
        }
    }
    let mut solved: Vec<(usize, Row<'a>)> = Vec::new();
    while let Some(mut row) = (!rows.is_empty()).then(|| rows.remove(0)) {
        let leading = row.terms.iter().max_by(|one, other| one.1.abs().total_cmp(&other.1.abs()));
        let Some((&column @ Column::Dof(dof), &coefficient)) = leading else {
            if row.given.iter().any(|(value, _)| value.abs() > 1e-9 * largest) {
                return Err(ProblemError::MultiPointConstraint {
                    reason: "the linked displacements contradict one another or what is prescribed",
                    remedy: "leave one of the components free, or end what an earlier stage prescribes there (`remove`)",
                }
                .of_condition(row.condition));
            }
            continue;
        };
        row.scaled(1.0 / coefficient);
        clear(&mut rows, &row, column);
        for (_, earlier) in &mut solved {
            let factor = earlier.coefficient(column);
            if factor != 0.0 {
                earlier.add(&row, -factor);
            }
        }
        solved.push((dof, row));
    }
    solved.sort_by_key(|(dof, _)| *dof);
    Ok(solved.into_iter().map(|(dof, row)| dependent(dof, &row)).collect())
}

/// Takes a column out of rows.
fn clear<'a>(rows: &mut [Row<'a>], pivot: &Row<'a>, column: Column) {
    for row in rows {
        let factor = row.coefficient(column) / pivot.coefficient(column);
        if factor != 0.0 {
            row.add(pivot, -factor);
            row.terms.remove(&column);
        }
    }
}

fn dependent<'a>(dof: usize, row: &Row<'a>) -> Dependent<'a> {
    let masters = row.terms.iter().filter_map(|(&column, &coefficient)| match column {
        Column::Dof(master) if master != dof => Some((master, -coefficient)),
        Column::Auxiliary(_) | Column::Dof(_) => None,
    });
    Dependent { dof, masters: masters.collect(), given: row.given.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RAMP: &Amplitude = &Amplitude::RAMP;

    fn equation(terms: &[(usize, f64)], auxiliary: &[(usize, f64)], value: f64) -> Equation<'static> {
        Equation { terms: terms.to_vec(), auxiliary: auxiliary.to_vec(), value, history: RAMP, condition: 3 }
    }

    /// Three nodes on a line with a slope and a middle: one dependent on the slope that the other two make.
    #[test]
    fn unknowns_without_a_node_are_eliminated_first() {
        let line = |dof: usize, arm: f64| equation(&[(dof, 1.0)], &[(0, -1.0), (1, -arm)], 0.0);
        let found = dependents(&[line(0, -1.0), line(1, 0.0), line(2, 1.0)], &[None; 3]).unwrap();
        assert_eq!(found.len(), 1);
        let Dependent { dof, masters, given } = &found[0];
        assert!(*dof == 1 && given.is_empty(), "{found:?}");
        assert!(masters.iter().all(|(_, share)| (share - 0.5).abs() < 1e-15) && masters.len() == 2);
    }

    #[test]
    fn chains_end_at_free_components_and_prescribed_ones_are_numbers() {
        let moved = Prescribed { value: 3.0, origin: Origin::Stage, history: RAMP };
        let chain = [equation(&[(2, 1.0), (1, -1.0)], &[], 0.5), equation(&[(1, 1.0), (0, -1.0)], &[], 0.25)];
        let found = dependents(&chain, &[None, None, None]).unwrap();
        assert_eq!(found[0], Dependent { dof: 1, masters: vec![(0, 1.0)], given: vec![(0.25, RAMP)] });
        assert_eq!(found[1], Dependent { dof: 2, masters: vec![(0, 1.0)], given: vec![(0.75, RAMP)] });
        let found = dependents(&chain, &[Some(moved), None, None]).unwrap();
        assert_eq!(found[1], Dependent { dof: 2, masters: vec![], given: vec![(3.75, RAMP)] });
        let all = [Some(moved), Some(moved), None];
        let is_refused = |found: Result<Vec<Dependent<'_>>, ProblemError>| {
            let error = found.unwrap_err();
            matches!(error, ProblemError::Condition { number: 3, .. })
                && matches!(error.cause(), ProblemError::MultiPointConstraint { .. })
        };
        assert!(is_refused(dependents(&chain, &all)), "3 is not 3.25");
        let nothing = equation(&[(0, 1.0), (0, -1.0)], &[], 0.0);
        assert_eq!(
            dependents(std::slice::from_ref(&nothing), &[None; 3]).unwrap(),
            [],
            "terms that cancel link nothing"
        );
        let contradiction = [Equation { value: 1.0, ..nothing }];
        assert!(is_refused(dependents(&contradiction, &[None; 3])));
        let twice = [chain[0].clone(), chain[0].clone(), chain[1].clone()];
        assert_eq!(dependents(&twice, &[None, None, None]).unwrap().len(), 2, "said twice is said once");
    }
}
