//! Ridders' tableau: Richardson's extrapolation with an error.

use super::estimate::Estimate;

/// An entry has at least this part of the greatest error of its column: a small difference in one entry may be luck.
const SHARE: f64 = 0.1;

/// Ridders' tableau of one difference quotient.
pub(crate) struct Tableau {
    /// The factor rᵖ by which the first extrapolation reduces the leading error.
    factor: f64,
    order: usize,
    /// The last row T_i0, T_i1, … It is empty if the level before is missing.
    pub row: Vec<Vec<f64>>,
    pub best: Estimate,
    /// The greatest error when it last halved, and the perturbation at that level.
    mark: f64,
    pub halved: f64,
}

impl Tableau {
    pub fn new(factor: f64, order: usize, size: usize) -> Self {
        Self { factor, order, row: vec![], best: Estimate::none(size), mark: f64::INFINITY, halved: f64::INFINITY }
    }

    /// Whether nothing was measured.
    pub fn is_empty(&self) -> bool {
        self.best.error.iter().all(|error| error.is_infinite())
    }

    /// Adds the row of the next level h. `floor` is 2 u / h.
    pub fn add(&mut self, h: f64, quotient: Vec<f64>, floor: &[f64]) {
        let last = std::mem::replace(&mut self.row, vec![quotient]);
        let mut factor = 1.0;
        for j in 1..=last.len().min(self.order) {
            factor *= self.factor;
            let [fine, coarse] = [&self.row[j - 1], &last[j - 1]];
            let next: Vec<f64> = fine.iter().zip(coarse).map(|(t, before)| t + (t - before) / (factor - 1.0)).collect();
            if let Some(before) = last.get(j) {
                self.best.improve(&next, [fine, coarse, before], floor);
            }
            self.row.push(next);
        }
        let error = self.best.greatest_error();
        if error <= 0.5 * self.mark {
            self.mark = error;
            self.halved = h;
        }
    }

    /// Whether all errors are below `factor` times the noise. With factor r, no further level can be better.
    pub fn within(&self, factor: f64, floor: &[f64]) -> bool {
        self.best.error.iter().zip(floor).all(|(error, floor)| *error <= factor * floor)
    }
}

impl Estimate {
    /// Takes the components of `next` whose error is smaller: the greatest difference from its `neighbours` in the tableau.
    fn improve(&mut self, next: &[f64], neighbours: [&Vec<f64>; 3], floor: &[f64]) {
        let difference = |i: usize| neighbours.iter().fold(0.0_f64, |greatest, t| greatest.max((next[i] - t[i]).abs()));
        let differences: Vec<f64> = (0..next.len()).map(difference).collect();
        let shared = SHARE * differences.iter().fold(0.0_f64, |greatest, difference| greatest.max(*difference));
        for i in 0..next.len() {
            let error = differences[i].max(floor[i]).max(shared);
            if next[i].is_finite() && error < self.error[i] {
                self.value[i] = next[i];
                self.error[i] = error;
            }
        }
    }
}
