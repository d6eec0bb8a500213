//! The order in which grains are eliminated, the fill that follows, and its grouping into supernodes.
//!
//! All of it is a function of the graph of touching grains alone.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMatRef;
use faer::sparse::linalg::amd;

/// Most grains of a supernode: wider ones are cut, which bounds the dense work on the diagonal.
const WIDEST: usize = 8;

/// Block rows of explicit zeros that each column may get when supernodes are merged. More of them, or wider supernodes, cost
/// more than they save: 8 instead of 2 adds 5 %, 24 adds a third (400 discs).
const SLACK: usize = 2;

/// Neighbouring columns of the factor with the same rows below.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Supernode {
    /// First place.
    pub first: usize,
    /// Number of grains.
    pub width: usize,
    /// Range of its rows below in [`Elimination::rows`].
    pub rows: std::ops::Range<usize>,
}

/// Order and fill.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Elimination {
    /// Grain eliminated at each place.
    pub grain_at: Vec<usize>,
    /// Place of each grain.
    pub place_of: Vec<usize>,
    /// In order of elimination.
    pub supernodes: Vec<Supernode>,
    /// Supernode of each place.
    pub supernode_of: Vec<usize>,
    /// Places below each supernode, ascending.
    pub rows: Vec<usize>,
}

impl Elimination {
    /// Orders the grains by approximate minimum degree and finds the fill. `None` if the ordering fails.
    pub(super) fn of(grains: usize, pairs: &[[usize; 2]]) -> Option<Self> {
        let graph = Graph::of(grains, pairs);
        let (grain_at, place_of) = minimum_degree(&graph)?;
        Some(Self::in_order(&graph, grain_at, place_of))
    }

    fn in_order(graph: &Graph, grain_at: Vec<usize>, place_of: Vec<usize>) -> Self {
        let fill = Fill::of(graph, &grain_at, &place_of);
        let mut elimination =
            Self { grain_at, place_of, supernodes: Vec::new(), supernode_of: Vec::new(), rows: Vec::new() };
        elimination.group(&fill);
        elimination
    }

    /// Number of places.
    pub(super) fn grains(&self) -> usize {
        self.grain_at.len()
    }

    fn group(&mut self, fill: &Fill) {
        let mut first = 0;
        while first < self.grains() {
            let mut last = first;
            let mut zeros = 0;
            while last + 1 < self.grains()
                && last + 1 - first < WIDEST
                && fill.below(last).first() == Some(&(last + 1))
            {
                zeros += fill.below(last + 1).len() + 1 - fill.below(last).len();
                if zeros > SLACK {
                    break;
                }
                last += 1;
            }
            let start = self.rows.len();
            self.rows.extend_from_slice(fill.below(last));
            let width = last + 1 - first;
            self.supernode_of.extend(std::iter::repeat_n(self.supernodes.len(), width));
            self.supernodes.push(Supernode { first, width, rows: start..self.rows.len() });
            first = last + 1;
        }
    }
}

/// Touching grains in compressed columns, each grain its own neighbour.
struct Graph {
    starts: Vec<usize>,
    neighbours: Vec<usize>,
}

impl Graph {
    fn of(grains: usize, pairs: &[[usize; 2]]) -> Self {
        let mut starts = vec![0; grains + 1];
        for &[first, second] in pairs {
            starts[first + 1] += 1;
            starts[second + 1] += 1;
        }
        for grain in 0..grains {
            starts[grain + 1] += starts[grain] + 1;
        }
        let mut next = starts.clone();
        let mut neighbours = vec![0; starts[grains]];
        let mut add = |grain: usize, neighbour: usize| {
            neighbours[next[grain]] = neighbour;
            next[grain] += 1;
        };
        // Pairs ascend, so that smaller neighbours come first, then the grain itself, then larger ones.
        for &[first, second] in pairs {
            add(second, first);
        }
        for grain in 0..grains {
            add(grain, grain);
        }
        for &[first, second] in pairs {
            add(first, second);
        }
        Self { starts, neighbours }
    }

    fn of_grain(&self, grain: usize) -> &[usize] {
        &self.neighbours[self.starts[grain]..self.starts[grain + 1]]
    }
}

fn minimum_degree(graph: &Graph) -> Option<(Vec<usize>, Vec<usize>)> {
    let grains = graph.starts.len() - 1;
    let pattern = SymbolicSparseColMatRef::new_checked(grains, grains, &graph.starts, None, &graph.neighbours);
    let (mut grain_at, mut place_of) = (vec![0; grains], vec![0; grains]);
    let mut memory = MemBuffer::new(amd::order_scratch::<usize>(grains, graph.neighbours.len()));
    let stack = MemStack::new(&mut memory);
    amd::order(&mut grain_at, &mut place_of, pattern, amd::Control::default(), stack).ok()?;
    Some((grain_at, place_of))
}

/// The rows of each column of the factor.
struct Fill {
    starts: Vec<usize>,
    rows: Vec<usize>,
}

impl Fill {
    /// A pivot's fill is its own links and the fill of every earlier pivot whose first link it is.
    fn of(graph: &Graph, grain_at: &[usize], place_of: &[usize]) -> Self {
        let grains = grain_at.len();
        let mut starts = vec![0];
        let mut rows: Vec<usize> = Vec::new();
        let mut first_child = vec![usize::MAX; grains];
        let mut next_sibling = vec![usize::MAX; grains];
        let mut seen_by = vec![usize::MAX; grains];
        for pivot in 0..grains {
            let first = rows.len();
            for &neighbour in graph.of_grain(grain_at[pivot]) {
                let row = place_of[neighbour];
                if row > pivot && seen_by[row] != pivot {
                    seen_by[row] = pivot;
                    rows.push(row);
                }
            }
            let mut child = first_child[pivot];
            while child != usize::MAX {
                for slot in starts[child]..starts[child + 1] {
                    let row = rows[slot];
                    if row > pivot && seen_by[row] != pivot {
                        seen_by[row] = pivot;
                        rows.push(row);
                    }
                }
                child = next_sibling[child];
            }
            rows[first..].sort_unstable();
            if let Some(&parent) = rows.get(first) {
                next_sibling[pivot] = first_child[parent];
                first_child[parent] = pivot;
            }
            starts.push(rows.len());
        }
        Self { starts, rows }
    }

    fn below(&self, place: usize) -> &[usize] {
        &self.rows[self.starts[place]..self.starts[place + 1]]
    }
}
