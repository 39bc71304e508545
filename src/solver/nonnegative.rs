//! Non-negative least squares, min |A x − b| over x ≥ 0, by Lawson and Hanson's active-set method (Solving Least Squares Problems, 1974,
//! ch. 23).

use nalgebra::DVector;

/// A column of length 1 is independent of the free columns if orthogonalisation against them leaves more than this length.
const INDEPENDENT: f64 = 1e-8;

/// The problem, and its solution over the columns offered so far.
pub(crate) struct NonnegativeLeastSquares {
    /// The offered columns, scaled to length 1. So the next column is chosen by how far it alone reduces |A x − b|, whatever its size.
    columns: Vec<DVector<f64>>,
    /// Lengths of the columns before scaling.
    sizes: Vec<f64>,
    /// b − A x
    rest: DVector<f64>,
    /// The free columns, with x > 0, and their x.
    free: Vec<usize>,
    x: Vec<f64>,
    /// The factors Q R of the free columns: the columns of Q, and the columns of R down to its diagonal.
    q: Vec<DVector<f64>>,
    r: Vec<Vec<f64>>,
}

impl NonnegativeLeastSquares {
    /// A problem without columns: x = 0.
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

    /// Adds a column of A, which must not be 0.
    pub(crate) fn offer(&mut self, column: DVector<f64>) {
        let size = column.norm();
        self.columns.push(column / size);
        self.sizes.push(size);
    }

    /// The columns with x > 0, numbered in the order they were offered, and their x.
    pub(crate) fn solution(&self) -> impl Iterator<Item = (usize, f64)> {
        self.free.iter().zip(&self.x).map(|(&column, x)| (column, x / self.sizes[column]))
    }

    /// Solves with all offered columns, from the last solution, until |A x − b| ≤ `least`. Returns |A x − b|.
    pub(crate) fn solve(&mut self, least: f64) -> f64 {
        let mut refused = vec![false; self.columns.len()];
        self.free.iter().for_each(|&column| refused[column] = true);
        // Each step lowers |A x − b| in exact arithmetic. The limit guards against round-off.
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
                // The column is free now, so columns refused before may be of use.
                refused.fill(false);
                self.free.iter().for_each(|&column| refused[column] = true);
            }
        }
        self.rest.norm()
    }

    /// Frees a column; `false` if it depends on the free columns.
    fn free_one(&mut self, column: usize) -> bool {
        let mut direction = self.columns[column].clone();
        let mut above = vec![0.0; self.q.len()];
        // Gram–Schmidt; twice is enough.
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

    /// Moves x to the least-squares solution over the free columns. A column whose x would become negative on the way is bound.
    /// `false` if the newest column is bound too.
    fn descend(&mut self) -> bool {
        let newest = self.free.last().copied();
        while !self.free.is_empty() {
            let step = self.step();
            let falls = |(i, (x, step)): (usize, (&f64, &f64))| (x + step <= 0.0).then(|| (i, -x / step));
            let first = self.x.iter().zip(&step).enumerate().filter_map(falls).min_by(|a, b| a.1.total_cmp(&b.1));
            mutant!("solver: non-negative least squares step below zero": first = first.filter(|_| false));
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

    /// Binds the free column at `place`: x = 0.
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

    /// The solution x ≥ 0 is the least-squares solution over some subset of columns. So the least |A x − b| over all subsets with a
    /// non-negative solution is the reference.
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
            // Some columns are offered at the start, others after a first solution.
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
