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
    free: Vec<Free>,
}

/// A free column, with x > 0, and its columns of the factors Q R of the free columns.
struct Free {
    column: usize,
    x: f64,
    q: DVector<f64>,
    /// Down to the diagonal.
    r: Vec<f64>,
}

impl NonnegativeLeastSquares {
    /// A problem without columns: x = 0.
    pub(crate) fn new(b: DVector<f64>) -> Self {
        Self { columns: Vec::new(), sizes: Vec::new(), rest: b, free: Vec::new() }
    }

    /// Adds a column of A, which must not be 0.
    pub(crate) fn offer(&mut self, column: DVector<f64>) {
        let size = column.norm();
        self.columns.push(column / size);
        self.sizes.push(size);
    }

    /// The columns with x > 0, numbered in the order they were offered, and their x.
    pub(crate) fn solution(&self) -> impl Iterator<Item = (usize, f64)> {
        self.free.iter().map(|free| (free.column, free.x / self.sizes[free.column]))
    }

    /// Solves with all offered columns, from the last solution, until |A x − b| ≤ `least`. Returns |A x − b|.
    pub(crate) fn solve(&mut self, least: f64) -> f64 {
        let mut refused = self.are_free();
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
            if self.free_one(best, 0.0) && self.descend() {
                // The column is free now, so columns refused before may be of use.
                refused = self.are_free();
            }
        }
        self.rest.norm()
    }

    /// Whether each offered column is free.
    fn are_free(&self) -> Vec<bool> {
        let mut are_free = vec![false; self.columns.len()];
        self.free.iter().for_each(|free| are_free[free.column] = true);
        are_free
    }

    /// Frees a column with this x; `false` if the column depends on the free columns.
    fn free_one(&mut self, column: usize, x: f64) -> bool {
        let mut direction = self.columns[column].clone();
        let mut r = vec![0.0; self.free.len()];
        // Gram–Schmidt; twice is enough.
        for _ in 0..2 {
            for (Free { q, .. }, r) in self.free.iter().zip(&mut r) {
                let along = q.dot(&direction);
                direction.axpy(-along, q, 1.0);
                *r += along;
            }
        }
        let left = direction.norm();
        if left <= INDEPENDENT {
            return false;
        }
        r.push(left);
        self.free.push(Free { column, x, q: direction / left, r });
        true
    }

    /// Moves x to the least-squares solution over the free columns. A column whose x would become negative on the way is bound.
    /// `false` if the newest column is bound too.
    fn descend(&mut self) -> bool {
        let newest = self.free.last().map(|free| free.column);
        while !self.free.is_empty() {
            let step = self.step();
            let falls = |(i, (free, step)): (usize, (&Free, &f64))| (free.x + step <= 0.0).then(|| (i, -free.x / step));
            let first = self.free.iter().zip(&step).enumerate().filter_map(falls).min_by(|a, b| a.1.total_cmp(&b.1));
            mutant!("solver: non-negative least squares step below zero": first = first.filter(|_| false));
            let length = first.map_or(1.0, |(_, length)| length);
            for (free, step) in self.free.iter_mut().zip(&step) {
                free.x += length * step;
                self.rest.axpy(-length * step, &self.columns[free.column], 1.0);
            }
            let Some((bound, _)) = first else { break };
            self.bind(bound);
        }
        self.free.last().map(|free| free.column) == newest
    }

    /// R⁻¹ Qᵀ (b − A x)
    fn step(&self) -> Vec<f64> {
        let mut step: Vec<f64> = self.free.iter().map(|free| free.q.dot(&self.rest)).collect();
        for (k, Free { r, .. }) in self.free.iter().enumerate().rev() {
            step[k] /= r[k];
            for i in 0..k {
                step[i] -= r[i] * step[k];
            }
        }
        step
    }

    /// Binds the free column at `place`: x = 0. The free columns after it get new factors.
    fn bind(&mut self, place: usize) {
        for (i, Free { column, x, .. }) in self.free.split_off(place).into_iter().enumerate() {
            if i == 0 || !self.free_one(column, x) {
                self.rest.axpy(x, &self.columns[column], 1.0);
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
