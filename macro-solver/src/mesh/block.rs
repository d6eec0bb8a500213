//! A structured rectangle of elements with named sides and corners.

use super::{Edge, ElementKind, Mesh, MeshError};
use std::collections::BTreeMap;

/// A rectangle with its lower left corner at the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Extent along x, m.
    pub width: f64,
    /// Extent along y, m.
    pub height: f64,
    /// Elements along x.
    pub columns: usize,
    /// Elements along y.
    pub rows: usize,
    /// Kind of the elements.
    pub kind: ElementKind,
}

impl Block {
    /// Generates the mesh. Elements are numbered row by row from the lower left.
    ///
    /// Node sets: `left`, `right`, `bottom`, `top`, `bottom_left`, `bottom_right`, `top_left`, `top_right`, `all`.
    /// Edge sets: `left`, `right`, `bottom`, `top`.
    ///
    /// # Errors
    /// [`MeshError::Block`] for sizes that are not positive and finite or counts of zero.
    pub fn mesh(&self) -> Result<Mesh, MeshError> {
        let sound = |length: f64| length.is_finite() && length > 0.0;
        if !sound(self.width) || !sound(self.height) || self.columns == 0 || self.rows == 0 {
            return Err(MeshError::Block {
                width: self.width,
                height: self.height,
                columns: self.columns,
                rows: self.rows,
            });
        }
        let lattice = Lattice::new(self);
        Ok(Mesh {
            nodes: lattice.positions(self),
            elements: lattice.elements(self),
            kind: self.kind,
            node_sets: lattice.node_sets(),
            edge_sets: self.edge_sets(),
        })
    }

    fn edge_sets(&self) -> BTreeMap<String, Vec<Edge>> {
        let row = |row: usize, local: usize| {
            (0..self.columns).map(|column| Edge { element: row * self.columns + column, local }).collect()
        };
        let column = |column: usize, local: usize| {
            (0..self.rows).map(|row| Edge { element: row * self.columns + column, local }).collect()
        };
        BTreeMap::from([
            ("bottom".to_owned(), row(0, 0)),
            ("right".to_owned(), column(self.columns - 1, 1)),
            ("top".to_owned(), row(self.rows - 1, 2)),
            ("left".to_owned(), column(0, 3)),
        ])
    }
}

/// The grid of possible node places: one per half element for Q8 (without the element centres), per element for Q4.
struct Lattice {
    columns: usize,
    rows: usize,
    stride: usize,
    numbers: Vec<Option<usize>>,
}

impl Lattice {
    fn new(block: &Block) -> Self {
        let stride = match block.kind {
            ElementKind::Q4 => 1,
            ElementKind::Q8 => 2,
        };
        let (columns, rows) = (stride * block.columns + 1, stride * block.rows + 1);
        let mut next = 0;
        let numbers = (0..columns * rows)
            .map(|place| {
                let centre = stride == 2 && (place % columns) % 2 == 1 && (place / columns) % 2 == 1;
                (!centre).then(|| {
                    next += 1;
                    next - 1
                })
            })
            .collect();
        Self { columns, rows, stride, numbers }
    }

    fn number(&self, column: usize, row: usize) -> usize {
        self.numbers[row * self.columns + column].expect("element centres are never asked for")
    }

    fn positions(&self, block: &Block) -> Vec<[f64; 2]> {
        let mut positions = Vec::new();
        for row in 0..self.rows {
            for column in 0..self.columns {
                if self.numbers[row * self.columns + column].is_some() {
                    let x = block.width * column as f64 / (self.columns - 1) as f64;
                    let y = block.height * row as f64 / (self.rows - 1) as f64;
                    positions.push([x, y]);
                }
            }
        }
        positions
    }

    fn elements(&self, block: &Block) -> Vec<Vec<usize>> {
        let corners = [(0, 0), (2, 0), (2, 2), (0, 2)];
        let sides = [(1, 0), (2, 1), (1, 2), (0, 1)];
        let mut elements = Vec::with_capacity(block.columns * block.rows);
        for row in 0..block.rows {
            for column in 0..block.columns {
                let node = |&(right, up): &(usize, usize)| {
                    let half = 2 / self.stride;
                    self.number(self.stride * column + right / half, self.stride * row + up / half)
                };
                let mut nodes: Vec<usize> = corners.iter().map(node).collect();
                if block.kind == ElementKind::Q8 {
                    nodes.extend(sides.iter().map(node));
                }
                elements.push(nodes);
            }
        }
        elements
    }

    fn node_sets(&self) -> BTreeMap<String, Vec<usize>> {
        let (right, top) = (self.columns - 1, self.rows - 1);
        let select = |keep: &dyn Fn(usize, usize) -> bool| -> Vec<usize> {
            (0..self.columns * self.rows)
                .filter(|place| keep(place % self.columns, place / self.columns))
                .filter_map(|place| self.numbers[place])
                .collect()
        };
        BTreeMap::from([
            ("all".to_owned(), select(&|_, _| true)),
            ("left".to_owned(), select(&|column, _| column == 0)),
            ("right".to_owned(), select(&|column, _| column == right)),
            ("bottom".to_owned(), select(&|_, row| row == 0)),
            ("top".to_owned(), select(&|_, row| row == top)),
            ("bottom_left".to_owned(), select(&|column, row| column == 0 && row == 0)),
            ("bottom_right".to_owned(), select(&|column, row| column == right && row == 0)),
            ("top_left".to_owned(), select(&|column, row| column == 0 && row == top)),
            ("top_right".to_owned(), select(&|column, row| column == right && row == top)),
        ])
    }
}
