//! Lists of different lengths in one array.

use std::ops::Range;

/// A list for each row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Lists<T> {
    /// The first entry of each row; at the end, the number of entries.
    starts: Vec<u32>,
    entries: Vec<T>,
}

impl<T> Default for Lists<T> {
    fn default() -> Self {
        Self { starts: vec![0], entries: Vec::new() }
    }
}

impl<T> Lists<T> {
    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Adds a row.
    pub(crate) fn push(&mut self, row: impl IntoIterator<Item = T>) {
        self.entries.extend(row);
        self.starts.push(self.entries.len() as u32);
    }

    /// The places of a row's entries.
    pub(crate) fn range(&self, row: usize) -> Range<usize> {
        self.starts[row] as usize..self.starts[row + 1] as usize
    }

    /// The entries of a row.
    pub(crate) fn row(&self, row: usize) -> &[T] {
        &self.entries[self.range(row)]
    }

    /// The row of each entry.
    pub(crate) fn owners(&self) -> Vec<u32> {
        (0..self.len()).flat_map(|row| std::iter::repeat_n(row as u32, self.range(row).len())).collect()
    }
}

impl Lists<u32> {
    /// The first entry of each row, and at the end the number of entries; the entries, row by row.
    pub(crate) fn arrays(&self) -> [&[u32]; 2] {
        [&self.starts, &self.entries]
    }

    /// For each number below `count`, the places at which it stands, ascending.
    pub(crate) fn of_places(numbers: &[u32], count: usize) -> Self {
        let mut starts = vec![0; count + 1];
        numbers.iter().for_each(|&number| starts[number as usize + 1] += 1);
        (0..count).for_each(|number| starts[number + 1] += starts[number]);
        let (mut next, mut entries) = (starts.clone(), vec![0; numbers.len()]);
        for (&number, place) in numbers.iter().zip(0..) {
            let next = &mut next[number as usize];
            entries[*next as usize] = place;
            *next += 1;
        }
        Self { starts, entries }
    }

    /// For each number below `count`, the rows that have it, ascending.
    pub(crate) fn transposed(&self, count: usize) -> Self {
        let owners = self.owners();
        Self::of_places(&self.entries, count).map(|place| owners[place as usize])
    }

    /// The rows that have an entry.
    pub(crate) fn without_empty_rows(mut self) -> Self {
        self.starts.dedup();
        self.starts.shrink_to_fit();
        self
    }

    /// `f` of every entry.
    pub(crate) fn map(mut self, f: impl Fn(u32) -> u32) -> Self {
        self.entries.iter_mut().for_each(|entry| *entry = f(*entry));
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transpose_has_ascending_rows() {
        let mut lists = Lists::default();
        [vec![2, 0], vec![], vec![2]].into_iter().for_each(|row| lists.push(row));
        assert_eq!((lists.len(), lists.row(0), lists.owners()), (3, &[2, 0][..], vec![0, 0, 2]));
        let transposed = lists.transposed(3);
        assert_eq!(transposed.arrays(), [&[0, 1, 1, 3][..], &[0, 0, 2]]);
        assert_eq!(transposed.without_empty_rows().arrays(), [&[0, 1, 3][..], &[0, 0, 2]]);
    }
}
