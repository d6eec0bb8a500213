//! Large shear: a cell whose vectors have become long and nearly parallel is described by shorter ones.
//!
//! `Y2 -> Y2 - k Y1` leaves the tiling as it is; the cell shifts of all contacts change with it, nothing else does. A
//! reduction happens at the end of a trial, so that every trial starts from a cell that is as square as its tiling
//! allows.

use super::neighbours::PairKey;
use super::periodic::Cell;
use super::state::{ContactRecord, GrainState};
use crate::space::{Components, Space, Tensor};

/// A vector is reduced by another when its part along it exceeds this many lengths of the other. More than the one half
/// that the rounding leaves, so that a cell which shears to and fro is not reduced every time.
const LARGEST_SKEW: f64 = 1.0;

/// Steps after which a cell whose vectors rounding keeps apart is left as it is.
const MOST_STEPS: u32 = 200;

/// Share of its square by which a vector has to become shorter: more than rounding.
const SHORTER: f64 = 1e-12;

/// One step: the vector in `row` loses `count` times the vector in `by`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Step {
    row: usize,
    by: usize,
    count: i32,
}

/// The state with a cell reduced as far as it needs to be; most states come back as they are.
pub(crate) fn reduced<S: Space>(mut state: GrainState<S>) -> GrainState<S> {
    let steps = steps(&mut state.cell);
    if steps.is_empty() {
        return state;
    }
    let mut contacts: Vec<(ContactRecord<S>, Option<S::Spin>)> = state
        .contacts
        .iter()
        .enumerate()
        .map(|(place, contact)| relabelled(contact, state.rolling_moments.get(place).copied(), &steps))
        .collect();
    contacts.sort_unstable_by_key(|(contact, _)| contact.key());
    state.rolling_moments = contacts.iter().filter_map(|(_, moment)| *moment).collect();
    state.contacts = contacts.into_iter().map(|(contact, _)| contact).collect();
    if let Some(events) = &mut state.events {
        events.forget_response();
    }
    state
}

/// Reduces the cell and returns how. Each step shortens a vector; vectors that rounding keeps apart are left as they are in the end.
fn steps<S: Space>(cell: &mut Cell<S>) -> Vec<Step> {
    let mut steps = Vec::new();
    while let Some(step) = next_step(cell).filter(|_| steps.len() < MOST_STEPS as usize) {
        take(cell, step);
        steps.push(step);
    }
    steps
}

/// A cell with the same tiling and the shortest vectors that it can have: in space, vectors that are short in pairs may still have shorter
/// sums with two others. Vectors that differ by more than numbers can tell are given up on.
pub(crate) fn shortened<S: Space>(mut cell: Cell<S>) -> Cell<S> {
    for _ in 0..MOST_STEPS {
        let Some(step) = next_step(&cell) else { break };
        take(&mut cell, step);
    }
    for _ in 0..MOST_STEPS {
        let Some((row, shorter)) = shorter_vector(&cell) else { break };
        cell.rows[row] = shorter;
    }
    cell
}

/// A row that becomes shorter with the other rows added or taken off once each, and what it becomes.
fn shorter_vector<S: Space>(cell: &Cell<S>) -> Option<(usize, S::Vector)> {
    let dimension = S::Tensor::DIMENSION;
    for row in 0..dimension {
        for number in 0..3i32.pow(dimension as u32) {
            let counts = [number % 3 - 1, number / 3 % 3 - 1, number / 9 - 1];
            let others = (0..dimension).filter(|other| *other != row);
            let sum =
                others.fold(cell.rows[row], |sum, other| sum.minus(cell.rows[other].times(f64::from(counts[other]))));
            if sum.dot(sum) < (1.0 - SHORTER) * cell.rows[row].dot(cell.rows[row]) {
                return Some((row, sum));
            }
        }
    }
    None
}

fn take<S: Space>(cell: &mut Cell<S>, step: Step) {
    let (vector, other) = (cell.rows[step.row], cell.rows[step.by]);
    cell.rows[step.row] = vector.minus(other.times(f64::from(step.count)));
}

fn next_step<S: Space>(cell: &Cell<S>) -> Option<Step> {
    for row in 0..S::Tensor::DIMENSION {
        for by in (0..S::Tensor::DIMENSION).filter(|by| *by != row) {
            let (vector, other) = (cell.rows[row], cell.rows[by]);
            let skew = vector.dot(other) / other.dot(other);
            if skew.abs() > LARGEST_SKEW {
                return Some(Step { row, by, count: skew.round() as i32 });
            }
        }
    }
    None
}

/// A contact in terms of the new vectors: `s_row Y_row + s_by Y_by = s_row (Y_row - k Y_by) + (s_by + k s_row) Y_by`.
fn relabelled<S: Space>(
    contact: &ContactRecord<S>,
    moment: Option<S::Spin>,
    steps: &[Step],
) -> (ContactRecord<S>, Option<S::Spin>) {
    let mut shift = contact.shift;
    for step in steps {
        shift[step.by] += step.count * shift[step.row];
    }
    renamed(contact, moment, shift)
}

/// A contact whose end grain is `shift` cells away in terms of other vectors of the same lattice, under its canonical name.
pub(crate) fn renamed<S: Space>(
    contact: &ContactRecord<S>,
    moment: Option<S::Spin>,
    shift: S::Shift,
) -> (ContactRecord<S>, Option<S::Spin>) {
    let key = PairKey::<S>::canonical(contact.origin, contact.end, shift);
    // A grain that touches its own image has one of two names; the other one exchanges its roles.
    let is_swapped = key.shift != shift;
    let tangential_force = S::seen_from(contact.tangential_force, is_swapped);
    let moment = moment.map(|moment| if is_swapped { moment.times(-1.0) } else { moment });
    (ContactRecord { origin: key.origin, end: key.end, shift: key.shift, tangential_force }, moment)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::{Discs, Spheres};

    #[test]
    fn skewed_cells_become_short_and_branches_stay() {
        let cell = Cell::<Spheres> { rows: [[2.0, 0.0, 0.0], [5.3, 1.5, 0.0], [-7.1, 3.9, 1.0]] };
        let shifts = [[0, 1, 0], [1, -1, 1], [0, 0, 1], [2, 1, -1]];
        let state = GrainState::<Spheres> {
            cell,
            positions: vec![[0.0; 3]; 2],
            rotations: vec![[0.0; 3]; 2],
            contacts: shifts
                .map(|shift| ContactRecord {
                    origin: 0,
                    end: 1,
                    shift,
                    tangential_force: [f64::from(shift[0]), 0.0, 1.0],
                })
                .to_vec(),
            rolling_moments: shifts.map(|shift| [0.0, 0.0, f64::from(shift[2])]).to_vec(),
            dissipation: 0.0,
            damping: 0.0,
            initial_measure: 3.0,
            unbalanced: 0.0,
            largest_load: 0.0,
            bears_load: true,
            operators: Default::default(),
            events: None,
        };
        let mut branches: Vec<_> = state
            .contacts
            .iter()
            .zip(&state.rolling_moments)
            .map(|(c, m)| (state.cell.translation(c.shift), c.tangential_force, *m))
            .collect();
        let after = reduced(state);
        assert!((after.cell.measure() - 3.0).abs() < 1e-14);
        for (row, by) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
            let (vector, other) = (after.cell.rows[row], after.cell.rows[by]);
            assert!(vector.dot(other).abs() <= other.dot(other), "{:?}", after.cell.rows);
        }
        assert!(after.contacts.is_sorted_by_key(ContactRecord::key));
        for (contact, moment) in after.contacts.iter().zip(&after.rolling_moments) {
            let branch = after.cell.translation(contact.shift);
            let place = branches
                .iter()
                .position(|(b, f, m)| b.minus(branch).norm() < 1e-14 && *f == contact.tangential_force && m == moment)
                .expect("every branch is still there, with its force");
            branches.swap_remove(place);
        }
        assert!(branches.is_empty());
    }

    /// Short in pairs, but (-1, -2, -2) of them is a fifth as long as the shortest sum in which each is taken at most once.
    #[test]
    fn the_shortest_translation_is_among_the_shortened_vectors() {
        let cell =
            Cell::<Spheres> { rows: [[1.845, 4.769, 0.863], [2.361, -1.697, -1.406], [-3.320, -0.624, 0.739]] };
        assert_eq!(next_step(&cell), None);
        let short = shortened(cell);
        let shortest = short.rows.iter().map(|row| row.norm()).fold(f64::INFINITY, f64::min);
        assert!((shortest - cell.translation([-1, -2, -2]).norm()).abs() < 1e-12, "{shortest}");
        assert!((short.measure().abs() - cell.measure().abs()).abs() < 1e-9);
    }

    #[test]
    fn moderate_cells_are_left_alone() {
        let state = GrainState::<Discs> {
            cell: Cell { rows: [[1.0, 0.0], [0.9, 1.0]] },
            positions: vec![[0.0; 2]],
            rotations: vec![0.0],
            contacts: vec![ContactRecord { origin: 0, end: 0, shift: [0, 1], tangential_force: 1.0 }],
            rolling_moments: vec![],
            dissipation: 0.0,
            damping: 0.0,
            initial_measure: 1.0,
            unbalanced: 0.0,
            largest_load: 0.0,
            bears_load: true,
            operators: Default::default(),
            events: None,
        };
        assert_eq!(reduced(state.clone()), state);
    }
}
