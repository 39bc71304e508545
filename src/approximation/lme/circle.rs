//! LME on a circle of nodes, as in the paper: a D-dimensional Newton method for the Lagrange multipliers of a particle.

use super::separable::Lme;
use crate::approximation::product::{Place, inside};
use crate::approximation::{ApproximationError, Scratch, Separable, ShapeFunction, Support, Validate};
use crate::grid::{Grid, indices};
use crate::tensor::{Tensor, Vector, determinant, identity, inverse, outer};
use argmin::core::{CostFunction, Error, Executor, State};
use argmin::solver::neldermead::NelderMead;

/// LME on the nodes with |D| < R_a = h sqrt(−ln TOL₀ / γ̂), the circle (sphere) of the paper, cut at the walls.
///
/// 1. Connectivity (Algorithm 3): rounding gives the closest node. The nodes within the circle are kept from the rings around this node.
/// 2. λ = argmin log Z (eq. 25), by Newton's method from the λ of the separable functions. An Armijo line search shortens the steps. The
///    iteration ends when the error is at round-off. If Newton's method fails, a Nelder–Mead search without derivatives finds λ, and
///    Newton's method refines it.
/// 3. N, and ∇N = −N J⁻¹ D with J centred (eq. 27).
///
/// On a wall λ is infinite, so a particle there is moved inside by 1e-14 h. The position then has an error of this size;
/// Σ ∇N = 0 and Σ x ⊗ ∇N = I have none. For large γ̂ the circle holds too few nodes.
///
/// ```
/// use bfree::approximation::{Lme, LmeCircle, Scratch, ShapeFunction, Support};
/// use bfree::grid::Grid;
/// use bfree::tensor::Vector;
///
/// let circle = LmeCircle::new(1.5, 1e-6);
/// // It leaves out the corners of the box, where N is of the size of TOL₀.
/// let grid = Grid { origin: Vector::zeros(), spacing: 1.0, cells: [20, 20] };
/// let (x, mut scratch) = (Vector::from([10.3, 9.6]), Scratch::default());
/// let (mut on_circle, mut on_box) = (Support::default(), Support::default());
/// circle.evaluate(&grid, &x, &mut scratch, &mut on_circle)?;
/// Lme::new(1.5, 1e-6).evaluate(&grid, &x, &mut scratch, &mut on_box)?;
/// assert!(on_circle.nodes.len() < on_box.nodes.len());
/// let value = |of: &Support<2>| of.nodes.iter().position(|&node| node == [10, 10]).map(|k| of.values[k]);
/// let (a, b) = value(&on_circle).zip(value(&on_box)).ok_or("both see the nearest node")?;
/// assert!((a - b).abs() < 1e-5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct LmeCircle {
    /// The separable functions with equal parameters; their λ is the first guess.
    product: Lme,
}

/// Largest number of Newton steps. Next to a wall, a poor start needs about ln(h/distance) steps.
const NEWTON_STEPS: usize = 100;
/// Convergence tolerance for a Newton step |Δλ|h: after a step below this, the error is about the square of the step.
const LAST_STEP: f64 = 1e-9;

/// Largest number of Nelder–Mead iterations.
const SEARCH_STEPS: u64 = 2000;

impl LmeCircle {
    /// The smallest distance from a wall, in units of h. A particle closer to the wall, or on the wall, is treated at this distance.
    pub(crate) const INSET: f64 = 1e-14;

    /// The functions with locality γ̂ (0.8 … 4 are usual) and support tolerance TOL₀ (1e-6 is usual).
    pub fn new(gamma: f64, tolerance: f64) -> Self {
        Self { product: Lme::new(gamma, tolerance) }
    }

    /// The limit −ln TOL₀ / (1 + (D−1)/4), below which γ̂ must stay. Then R_a² > (1 + (D−1)/4) h². So R_a exceeds the distance from the
    /// middle of a cell's side to the next nodes on either hand. Every particle then lies in the convex hull of its nodes.
    pub(crate) fn largest_gamma(tolerance: f64, dimension: usize) -> f64 {
        -tolerance.ln() / (1.0 + 0.25 * (dimension as f64 - 1.0))
    }

    /// Fills `out` with the nodes in the circle. Their D, in units of h, are stored in place of the gradients.
    fn support<const D: usize>(&self, grid: &Grid<D>, places: &[Place; D], out: &mut Support<D>) {
        let radius = self.product.radius;
        // Ring n holds |k − k₀| ≤ n, and |x − k₀| ≤ ½. So the rings with n < R + ½ reach into the circle.
        let rings = (radius + 0.5).min(f64::from(u32::MAX)) as i64;
        let (mut first, mut count) = ([0; D], [0; D]);
        for k in 0..D {
            let closest = i64::from(places[k].cell) + i64::from(places[k].below > 0.5);
            first[k] = (closest - rings).max(0);
            count[k] = ((closest + rings).min(i64::from(grid.cells[k])) - first[k] + 1) as u64;
        }
        out.clear();
        for at in indices(count) {
            let node: [i64; D] = std::array::from_fn(|k| first[k] + at[k] as i64);
            let distance: [f64; D] = std::array::from_fn(|k| places[k].distance(node[k]));
            if distance.iter().map(|d| d * d).sum::<f64>() < radius * radius {
                out.push(node.map(|index| index as u32), 0.0, distance);
            }
        }
    }
}

/// The dual function log Z(λ) of one particle.
#[derive(Clone, Copy)]
struct Dual<'a, const D: usize> {
    gamma: f64,
    /// D of each node, in units of h.
    distances: &'a [[f64; D]],
}

/// log Z and its derivatives, r = Σ N D and J = Σ N (D − r) ⊗ (D − r).
struct Moments<const D: usize> {
    log_z: f64,
    r: Vector<f64, D>,
    j: Tensor<f64, D>,
}

impl<const D: usize> Dual<'_, D> {
    /// −γ̂|D|² + λ·D
    fn exponent(&self, lambda: &Vector<f64, D>, distance: &[f64; D]) -> f64 {
        (0..D).map(|k| (lambda[k] - self.gamma * distance[k]) * distance[k]).sum()
    }

    /// log Z = log Σ exp(−γ̂|D|² + λ·D), with the largest exponent factored out.
    fn log_z(&self, lambda: &Vector<f64, D>) -> f64 {
        let exponents = || self.distances.iter().map(|distance| self.exponent(lambda, distance));
        let largest = exponents().fold(f64::NEG_INFINITY, f64::max);
        largest + exponents().map(|e| (e - largest).exp()).sum::<f64>().ln()
    }

    fn moments(&self, lambda: &Vector<f64, D>) -> Moments<D> {
        let log_z = self.log_z(lambda);
        let values = || {
            self.distances.iter().map(|distance| {
                ((self.exponent(lambda, distance) - log_z).exp(), Vector::<f64, D>::from_column_slice(distance))
            })
        };
        let r: Vector<f64, D> = values().map(|(n, distance)| distance * n).sum();
        let j = values().map(|(n, distance)| outer(&(distance - r), &(distance - r)) * n).sum();
        Moments { log_z, r, j }
    }

    /// λ by a damped Newton method in at most `steps` steps; `None` if the method fails.
    fn newton(&self, start: Vector<f64, D>, steps: usize) -> Option<Vector<f64, D>> {
        let mut lambda = start;
        for _ in 0..steps {
            let Moments { log_z, r, j } = self.moments(&lambda);
            let step = -solve(&j, &r)?;
            if step.amax() <= LAST_STEP {
                return Some(lambda + step);
            }
            let slope = r.dot(&step);
            // If log Z changes by less than its own round-off, the full step is right.
            let rounding = 8.0 * f64::EPSILON * (1.0 + log_z.abs());
            let mut t = 1.0;
            while self.log_z(&(lambda + step * t)) > log_z + 1e-4 * t * slope + rounding {
                t *= 0.5;
                if t < 1e-10 {
                    return None;
                }
            }
            lambda += step * t;
        }
        None
    }

    /// λ by the Nelder–Mead simplex search, accurate to about the square root of round-off.
    fn search(&self, start: Vector<f64, D>) -> Option<Vector<f64, D>> {
        let around = (0..D).map(|k| start + identity::<f64, D>().column(k));
        let simplex = std::iter::once(start).chain(around).map(|vertex| vertex.as_slice().to_vec()).collect();
        let search = Executor::new(*self, NelderMead::new(simplex));
        let result = search.configure(|state| state.max_iters(SEARCH_STEPS)).timer(false).run().ok()?;
        let best = result.state().get_best_param()?;
        (best.len() == D).then(|| Vector::from_column_slice(best))
    }

    /// λ = argmin log Z by Newton's method in at most `steps` steps. If this method fails, the search finds λ, and Newton's method refines
    /// it.
    fn minimize(&self, start: Vector<f64, D>, steps: usize) -> Option<Vector<f64, D>> {
        self.newton(start, steps).or_else(|| self.newton(self.search(start)?, NEWTON_STEPS))
    }
}

impl<const D: usize> CostFunction for Dual<'_, D> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, lambda: &Vec<f64>) -> Result<f64, Error> {
        // The search compares costs, and a comparison with NaN means nothing.
        let log_z = self.log_z(&Vector::from_column_slice(lambda));
        Ok(if log_z.is_finite() { log_z } else { f64::MAX })
    }
}

/// J⁻¹ b; `None` unless det J > 0 and the result is finite. Cofactors make the result insensitive to the scale of J along each axis.
fn solve<const D: usize>(j: &Tensor<f64, D>, b: &Vector<f64, D>) -> Option<Vector<f64, D>> {
    let x = inverse(j) * b;
    (determinant(j) > 0.0 && x.iter().all(|x| x.is_finite())).then_some(x)
}

/// Moves a particle inside if it is closer to a wall than [`LmeCircle::INSET`]. The distance to the wall node stays accurate.
fn inset(place: Place, cells: u32) -> Place {
    const INSET: f64 = LmeCircle::INSET;
    if place.cell == 0 && place.below < INSET {
        Place { below: INSET, above: 1.0 - INSET, ..place }
    } else if place.cell + 1 == cells && place.above < INSET {
        Place { below: 1.0 - INSET, above: INSET, ..place }
    } else {
        place
    }
}

impl Validate for LmeCircle {
    fn validate(&self, dimension: usize) -> Result<(), ApproximationError> {
        self.product.validate(dimension)?;
        let Lme { gamma, tolerance, .. } = self.product;
        let limit = Self::largest_gamma(tolerance, dimension);
        let too_small = ApproximationError::SupportTooSmall { gamma, tolerance, dimension, limit };
        if gamma < limit { Ok(()) } else { Err(too_small) }
    }
}

impl ShapeFunction for LmeCircle {
    fn evaluate<const D: usize>(
        &self,
        grid: &Grid<D>,
        x: &Vector<f64, D>,
        _scratch: &mut Scratch,
        out: &mut Support<D>,
    ) -> Result<(), ApproximationError> {
        self.validate(D)?;
        inside(grid, x)?;
        let mut places = [Place { cell: 0, below: 0.0, above: 1.0 }; D];
        let mut start: Vector<f64, D> = Vector::zeros();
        for k in 0..D {
            let axis = grid.axis(k);
            places[k] = inset(Place::new(&axis, x[k])?, axis.cells);
            start[k] = self.product.multiplier(&places[k], self.product.reach(&axis, &places[k]));
        }
        self.support(grid, &places, out);

        let dual = Dual { gamma: self.product.gamma, distances: &out.gradients };
        let failed = |lambda: &Vector<f64, D>| ApproximationError::NoMultipliers {
            gamma: self.product.gamma,
            position: x.as_slice().to_vec(),
            residual: dual.moments(lambda).r.amax(),
        };
        let lambda = dual.minimize(start, NEWTON_STEPS).ok_or_else(|| failed(&start))?;
        let Moments { log_z, r, j } = dual.moments(&lambda);
        if solve(&j, &r).is_none() {
            return Err(failed(&lambda));
        }

        // N = exp(−γ̂|D|² + λ·D)/Z,   ∇N = −N J⁻¹ (D − r)/h
        let scaled_inverse = inverse(&j) / -grid.spacing;
        for (value, distance) in out.values.iter_mut().zip(&out.gradients) {
            *value = (dual.exponent(&lambda, distance) - log_z).exp();
        }
        for (value, gradient) in out.values.iter().zip(&mut out.gradients) {
            let d = Vector::<f64, D>::from_column_slice(gradient) - r;
            *gradient = (scaled_inverse * d * *value).into();
        }
        Ok(())
    }

    fn separable(&self) -> Option<&dyn Separable> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// D of the nodes −2 … 3 along both axes within R of `x`. A wall at −`below` cuts the first axis.
    fn distances(x: [f64; 2], below: i32, radius: f64) -> Vec<[f64; 2]> {
        (-2..=3)
            .flat_map(|k| (-below..=3).map(move |i| [x[0] - f64::from(i), x[1] - f64::from(k)]))
            .filter(|d| d[0].hypot(d[1]) < radius)
            .collect()
    }

    #[test]
    fn without_newton_the_search_finds_the_same_multipliers() {
        for (x, below, gamma) in
            [([0.3, 0.45], 2, 3.0), ([0.5, 0.5], 2, 0.8), ([0.001, 0.2], 0, 4.0), ([0.01, 0.98], 2, 9.0)]
        {
            let nodes = distances(x, below, Lme::new(gamma, 1e-6).radius);
            let dual = Dual { gamma, distances: &nodes };
            let newton = dual.newton(Vector::zeros(), NEWTON_STEPS).expect("inside the hull");
            assert!(dual.moments(&newton).r.amax() < 1e-14);
            assert!(dual.newton(Vector::zeros(), 0).is_none());
            let search = dual.search(Vector::zeros()).expect("the search always answers");
            assert!(dual.moments(&search).r.amax() < 1e-5, "{x:?}: {}", dual.moments(&search).r.amax());
            let fallback = dual.minimize(Vector::zeros(), 0).expect("inside the hull");
            assert!((fallback - newton).amax() < 1e-10, "{x:?}: {fallback} and {newton}");
        }
    }

    #[test]
    fn outside_the_hull_nothing_is_found() {
        // All nodes lie on one side, so log Z falls without limit.
        let nodes = [[0.5, 0.1], [0.5, -0.9], [1.5, 0.1]];
        assert!(Dual { gamma: 3.0, distances: &nodes }.minimize(Vector::zeros(), NEWTON_STEPS).is_none());
    }

    #[test]
    fn the_limit_of_the_locality_falls_with_the_dimension() {
        let [line, plane, space] = [1, 2, 3].map(|dimension| LmeCircle::largest_gamma(1e-6, dimension));
        assert!(line > plane && plane > space);
        assert!(LmeCircle::new(0.999 * plane, 1e-6).validate(2).is_ok());
        assert!(LmeCircle::new(1.001 * plane, 1e-6).validate(2).is_err());
    }
}
