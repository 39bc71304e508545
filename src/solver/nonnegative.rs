//! Non-negative least squares: min |A x − b| over x ≥ 0, by Lawson and Hanson's active sets (Solving Least Squares Problems, 1974, ch. 23).

use nalgebra::DVector;

/// What is left of a column of length 1 by those before it, if it is independent of them.
const INDEPENDENT: f64 = 1e-8;

/// The problem, and its solution over the columns that were offered so far.
pub(crate) struct NonnegativeLeastSquares {
    /// Of length 1: the one that is taken next is the one that by itself leaves least, whatever its size was.
    columns: Vec<DVector<f64>>,
    /// How long they were.
    sizes: Vec<f64>,
    /// b − A x
    rest: DVector<f64>,
    /// The columns with x > 0.
    free: Vec<usize>,
    x: Vec<f64>,
    /// Their columns are Q R: those of Q, and those of R down to its diagonal.
    q: Vec<DVector<f64>>,
    r: Vec<Vec<f64>>,
}

impl NonnegativeLeastSquares {
    /// No column yet: x = 0.
    pub(crate) fn new(b: DVector<f64>) -> Self {
        Self {
            columns: Vec::new(),
            sizes: Vec::new(),
            rest: b,
            free: Vec::new(),
            x: Vec::new(),
            q: Vec::new(),
            r: Vec::new(),
        }
    }

    /// One more column of A, not 0.
    pub(crate) fn offer(&mut self, column: DVector<f64>) {
        let size = column.norm();
        self.columns.push(column / size);
        self.sizes.push(size);
    }

    /// The columns with x > 0, in the order they were offered, and their x.
    pub(crate) fn solution(&self) -> impl Iterator<Item = (usize, f64)> {
        self.free.iter().zip(&self.x).map(|(&column, x)| (column, x / self.sizes[column]))
    }

    /// Solves with all columns that were offered, from the last solution, until |A x − b| ≤ `least`; returns what it is.
    pub(crate) fn solve(&mut self, least: f64) -> f64 {
        let mut refused = vec![false; self.columns.len()];
        self.free.iter().for_each(|&column| refused[column] = true);
        // Each step lowers |A x − b|; round-off may not.
        for _ in 0..10 * self.rest.len() {
            if self.rest.norm() <= least {
                break;
            }
            let open = (0..self.columns.len()).filter(|&column| !refused[column]);
            let gains = open.map(|column| (column, self.columns[column].dot(&self.rest)));
            let Some((best, gain)) = gains.max_by(|a, b| a.1.total_cmp(&b.1)) else { break };
            if gain <= 0.0 {
                break;
            }
            refused[best] = true;
            if self.free_one(best) && self.descend() {
                // It is in: what was refused before may be of use now.
                refused.fill(false);
                self.free.iter().for_each(|&column| refused[column] = true);
            }
        }
        self.rest.norm()
    }

    /// Adds a column to those with x > 0; `false` if it depends on them.
    fn free_one(&mut self, column: usize) -> bool {
        let mut direction = self.columns[column].clone();
        let mut above = vec![0.0; self.q.len()];
        // Gram and Schmidt, twice is enough.
        for _ in 0..2 {
            for (q, r) in self.q.iter().zip(&mut above) {
                let along = q.dot(&direction);
                direction.axpy(-along, q, 1.0);
                *r += along;
            }
        }
        let left = direction.norm();
        if left <= INDEPENDENT {
            return false;
        }
        above.push(left);
        self.q.push(direction / left);
        self.r.push(above);
        self.free.push(column);
        self.x.push(0.0);
        true
    }

    /// To the least squares over the columns that are free; those that would become negative on the way are no longer. `false` if the
    /// last one is not free after all.
    fn descend(&mut self) -> bool {
        let newest = self.free.last().copied();
        while !self.free.is_empty() {
            let step = self.step();
            let falls = |(i, (x, step)): (usize, (&f64, &f64))| (x + step <= 0.0).then(|| (i, -x / step));
            let first = self.x.iter().zip(&step).enumerate().filter_map(falls).min_by(|a, b| a.1.total_cmp(&b.1));
            let length = first.map_or(1.0, |(_, length)| length);
            for ((x, step), &column) in self.x.iter_mut().zip(&step).zip(&self.free) {
                *x += length * step;
                self.rest.axpy(-length * step, &self.columns[column], 1.0);
            }
            let Some((bound, _)) = first else { break };
            self.bind(bound);
        }
        self.free.last().copied() == newest
    }

    /// R⁻¹ Qᵀ (b − A x)
    fn step(&self) -> Vec<f64> {
        let mut step: Vec<f64> = self.q.iter().map(|q| q.dot(&self.rest)).collect();
        for k in (0..step.len()).rev() {
            step[k] /= self.r[k][k];
            for i in 0..k {
                step[i] -= self.r[k][i] * step[k];
            }
        }
        step
    }

    /// Takes a column from those with x > 0.
    fn bind(&mut self, place: usize) {
        let gone = self.free.remove(place);
        let x = self.x.remove(place);
        self.rest.axpy(x, &self.columns[gone], 1.0);
        let after = self.free.split_off(place);
        let values = self.x.split_off(place);
        self.q.truncate(place);
        self.r.truncate(place);
        for (column, value) in after.into_iter().zip(values) {
            if self.free_one(column) {
                if let Some(x) = self.x.last_mut() {
                    *x = value;
                }
            } else {
                self.rest.axpy(value, &self.columns[column], 1.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// |A x − b| of all subsets of columns with a solution > 0, the least of them: x ≥ 0 is a least squares of one of them.
    #[test]
    fn no_subset_of_columns_does_better() {
        let mut seed = 1_u64;
        let mut random = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.4
        };
        for _ in 0..50 {
            let columns: Vec<_> = (0..7).map(|_| DVector::from_fn(5, |_, _| random())).collect();
            let b = DVector::from_fn(5, |_, _| random());
            let mut problem = NonnegativeLeastSquares::new(b.clone());
            // Some are there from the start, others come to a solution that is there.
            columns[..4].iter().for_each(|column| problem.offer(column.clone()));
            problem.solve(0.0);
            columns[4..].iter().for_each(|column| problem.offer(column.clone()));
            let found = problem.solve(0.0);
            let mut rest = b.clone();
            for (column, x) in problem.solution() {
                assert!(x > 0.0);
                rest.axpy(-x, &columns[column], 1.0);
            }
            assert!((rest.norm() - found).abs() < 1e-14);
            let subset = |bits: u32| {
                let chosen: Vec<_> = (0..7).filter(|k| bits >> k & 1 == 1).map(|k| columns[k].clone()).collect();
                if chosen.is_empty() {
                    return Some(b.norm());
                }
                let a = nalgebra::DMatrix::from_columns(&chosen);
                let x = a.clone().svd(true, true).solve(&b, 1e-12).ok()?;
                (x.min() >= 0.0).then(|| (&a * x - &b).norm())
            };
            let best = (0..128).filter_map(subset).fold(f64::INFINITY, f64::min);
            assert!(found <= best + 1e-12, "{found} {best}");
        }
    }
}
