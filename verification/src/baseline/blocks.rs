//! Block compressed sparse rows.

use bfree::mechanics::sweep::Supports;
use bfree::tensor::{Tensor, Vector};
use rayon::prelude::*;

/// The sparsity of the tangent: the pairs of nodes that share a particle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    /// `columns[starts[I]..starts[I + 1]]` are the neighbours of node I.
    starts: Vec<usize>,
    columns: Vec<u32>,
}

/// The tangent has more pairs of nodes than the allowed memory holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the assembled tangent has more than {allowed} blocks; take a smaller problem")]
pub struct TooManyBlocks {
    /// The largest number of blocks allowed.
    pub allowed: usize,
}

impl Pattern {
    /// The pattern of the active nodes `0..count`.
    ///
    /// # Errors
    /// The pattern has more than `allowed` blocks.
    pub fn new<const D: usize>(supports: &Supports<D>, count: usize, allowed: usize) -> Result<Self, TooManyBlocks> {
        let mut rows: Vec<Vec<u32>> = vec![Vec::new(); count];
        let mut list = Vec::new();
        for p in 0..supports.particles() {
            list.clear();
            list.extend(supports.of(p).map(|(node, _, _)| node as u32));
            for &row in &list {
                let row = &mut rows[row as usize];
                row.extend_from_slice(&list);
                // Neighbouring particles list the same nodes, so the lists are shortened on the way.
                if row.len() > 4096 {
                    row.sort_unstable();
                    row.dedup();
                }
            }
        }
        let (mut starts, mut columns) = (vec![0], Vec::new());
        for (node, mut row) in rows.into_iter().enumerate() {
            row.push(node as u32);
            row.sort_unstable();
            row.dedup();
            columns.extend_from_slice(&row);
            starts.push(columns.len());
            if columns.len() > allowed {
                return Err(TooManyBlocks { allowed });
            }
        }
        Ok(Self { starts, columns })
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// Whether there is no block.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// The neighbours of node `row`, ascending.
    pub fn row(&self, row: usize) -> &[u32] {
        &self.columns[self.starts[row]..self.starts[row + 1]]
    }

    /// Number of nodes.
    pub fn rows(&self) -> usize {
        self.starts.len() - 1
    }
}

/// A sparse matrix of D×D blocks.
#[derive(Clone, Debug)]
pub struct BlockMatrix<'a, const D: usize> {
    pattern: &'a Pattern,
    blocks: Vec<Tensor<f64, D>>,
}

impl<'a, const D: usize> BlockMatrix<'a, D> {
    /// A matrix of zero blocks.
    pub fn zeros(pattern: &'a Pattern) -> Self {
        Self { pattern, blocks: vec![Tensor::zeros(); pattern.len()] }
    }

    /// K_IJ += block. A pair outside the pattern is ignored; a pattern made from the same supports contains every pair.
    #[inline]
    pub fn add(&mut self, row: usize, column: usize, block: &Tensor<f64, D>) {
        if let Ok(place) = self.pattern.row(row).binary_search(&(column as u32)) {
            self.blocks[self.pattern.starts[row] + place] += block;
        }
    }

    /// K_IJ, zero outside the pattern.
    pub fn get(&self, row: usize, column: usize) -> Tensor<f64, D> {
        match self.pattern.row(row).binary_search(&(column as u32)) {
            Ok(place) => self.blocks[self.pattern.starts[row] + place],
            Err(_) => Tensor::zeros(),
        }
    }

    /// out = K u
    pub fn product(&self, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        out.par_iter_mut().enumerate().with_min_len(64).for_each(|(row, out)| {
            let blocks = &self.blocks[self.pattern.starts[row]..self.pattern.starts[row + 1]];
            let mut sum = Vector::zeros();
            for (&column, block) in self.pattern.row(row).iter().zip(blocks) {
                sum += block * u[column as usize];
            }
            *out = sum;
        });
    }

    /// Memory of the matrix and its pattern.
    pub fn bytes(&self) -> usize {
        size_of_val(self.blocks.as_slice())
            + size_of_val(self.pattern.columns.as_slice())
            + size_of_val(self.pattern.starts.as_slice())
    }

    /// Every block: (I, J, K_IJ).
    pub fn iter(&self) -> impl Iterator<Item = (usize, usize, &Tensor<f64, D>)> {
        (0..self.pattern.rows()).flat_map(move |row| {
            let range = self.pattern.starts[row]..self.pattern.starts[row + 1];
            self.pattern
                .row(row)
                .iter()
                .zip(&self.blocks[range])
                .map(move |(&column, block)| (row, column as usize, block))
        })
    }

    /// The largest difference of two entries, over the largest entry of the two diagonal blocks of its row and column: √(K_II K_JJ).
    /// (An entry by itself may be small by cancellation between particles.)
    pub fn difference(&self, other: &Self) -> f64 {
        let size = |node: usize| self.get(node, node).amax();
        let mut largest: f64 = 0.0;
        for (row, column, block) in self.iter() {
            let scale = (size(row) * size(column)).sqrt();
            let difference = (block - other.get(row, column)).amax();
            if difference > 0.0 || difference.is_nan() {
                let relative = difference / scale;
                largest = if relative > largest || relative.is_nan() { relative } else { largest };
            }
        }
        largest
    }
}
