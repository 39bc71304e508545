//! A dense matrix of any size, in rows.

use std::ops::{Index, IndexMut};

/// A matrix, stored row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Matrix {
    /// The number of rows: components of the stress or residual.
    pub rows: usize,
    /// The number of columns: components of the strain or unknowns.
    pub columns: usize,
    /// The entries, row by row.
    pub entries: Vec<f64>,
}

impl Matrix {
    /// A matrix of zeros.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self { rows, columns, entries: vec![0.0; rows * columns] }
    }

    /// The matrix with these entries.
    pub fn from_entries(rows: usize, columns: usize, entry: impl Fn(usize, usize) -> f64) -> Self {
        let entries = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        Self { rows, columns, entries: entries.map(|(row, column)| entry(row, column)).collect() }
    }

    /// The matrix with these columns, which have `rows` entries each.
    pub fn from_columns(rows: usize, columns: &[Vec<f64>]) -> Self {
        Self::from_entries(rows, columns.len(), |row, column| columns[column][row])
    }

    /// A matrix of the same size with other entries.
    pub fn mapped(&self, entry: impl Fn(usize, usize) -> f64) -> Self {
        Self::from_entries(self.rows, self.columns, entry)
    }

    /// The greatest absolute value of the entries; 0 for an empty matrix.
    pub fn greatest(&self) -> f64 {
        self.entries.iter().fold(0.0, |greatest, entry| greatest.max(entry.abs()))
    }

    /// The product with a vector, which has a component for each column.
    pub fn times(&self, vector: &[f64]) -> Vec<f64> {
        let row = |row: usize| (0..self.columns).map(|column| self[(row, column)] * vector[column]).sum();
        (0..self.rows).map(row).collect()
    }
}

impl Index<(usize, usize)> for Matrix {
    type Output = f64;

    fn index(&self, (row, column): (usize, usize)) -> &f64 {
        &self.entries[row * self.columns + column]
    }
}

impl IndexMut<(usize, usize)> for Matrix {
    fn index_mut(&mut self, (row, column): (usize, usize)) -> &mut f64 {
        &mut self.entries[row * self.columns + column]
    }
}
