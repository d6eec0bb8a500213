//! A square sparse matrix of 3x3 blocks, one block row and column per grain.

/// Two displacements and one scaled spin of a grain.
pub(super) const BLOCK: usize = 3;

/// One block, `[row][column]`.
pub(super) type Block = [[f64; BLOCK]; BLOCK];

/// Blocks in compressed column order; the pattern is symmetric and holds every diagonal block.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BlockMatrix {
    /// Where each block column begins in `rows` and `blocks`; one more entry than there are grains.
    pub columns: Vec<usize>,
    /// Block row of each block, ascending within a column.
    pub rows: Vec<usize>,
    /// Values of each block, `[row][column]`.
    pub blocks: Vec<Block>,
}

impl BlockMatrix {
    /// A zero matrix for `grains` grains in which every pair has a block at both places.
    pub(super) fn with_pattern(grains: usize, pairs: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut columns_of_rows: Vec<Vec<usize>> = (0..grains).map(|grain| vec![grain]).collect();
        for (first, second) in pairs {
            columns_of_rows[first].push(second);
            columns_of_rows[second].push(first);
        }
        let mut columns = vec![0];
        let mut rows = Vec::new();
        for mut column in columns_of_rows {
            column.sort_unstable();
            column.dedup();
            rows.extend(column);
            columns.push(rows.len());
        }
        let blocks = vec![[[0.0; BLOCK]; BLOCK]; rows.len()];
        Self { columns, rows, blocks }
    }

    /// Number of block rows.
    pub(super) fn grains(&self) -> usize {
        self.columns.len() - 1
    }

    /// The block at (`row`, `column`), which must belong to the pattern.
    pub(super) fn block_mut(&mut self, row: usize, column: usize) -> &mut Block {
        let range = self.columns[column]..self.columns[column + 1];
        let place = self.rows[range.clone()].binary_search(&row).expect("the pattern holds every contact");
        &mut self.blocks[range.start + place]
    }

    /// Makes the equation of scalar unknown `component` of `grain` read `diagonal * x = 0`.
    pub(super) fn pin(&mut self, grain: usize, component: usize, diagonal: f64) {
        for place in self.columns[grain]..self.columns[grain + 1] {
            for row in &mut self.blocks[place] {
                row[component] = 0.0;
            }
            let neighbour = self.rows[place];
            self.block_mut(grain, neighbour)[component] = [0.0; BLOCK];
        }
        self.block_mut(grain, grain)[component][component] = diagonal;
    }

    /// Adds `stiffness` to every diagonal value.
    pub(super) fn shift_diagonal(&mut self, stiffness: f64) {
        for grain in 0..self.grains() {
            let block = self.block_mut(grain, grain);
            for (component, row) in block.iter_mut().enumerate() {
                row[component] += stiffness;
            }
        }
    }

    /// Largest absolute value of `loads - matrix * answers` in each column; NaN if anything is NaN.
    pub(super) fn residual_norms<const COLUMNS: usize>(
        &self,
        loads: &[[f64; COLUMNS]],
        answers: &[[f64; COLUMNS]],
    ) -> [f64; COLUMNS] {
        let mut residual = loads.to_vec();
        for grain in 0..self.grains() {
            for place in self.columns[grain]..self.columns[grain + 1] {
                for (row, block_row) in self.blocks[place].iter().enumerate() {
                    let target = &mut residual[BLOCK * self.rows[place] + row];
                    for (component, coefficient) in block_row.iter().enumerate() {
                        for (value, answer) in target.iter_mut().zip(&answers[BLOCK * grain + component]) {
                            *value -= coefficient * answer;
                        }
                    }
                }
            }
        }
        let mut norms = [0.0_f64; COLUMNS];
        for row in &residual {
            for (norm, value) in norms.iter_mut().zip(row) {
                // Neither a NaN in the residual nor one in the norm is ever dropped.
                let keeps = norm.is_nan() || value.abs() <= *norm;
                *norm = if keeps { *norm } else { value.abs() };
            }
        }
        norms
    }
}
