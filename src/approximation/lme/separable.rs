//! LME on a box of nodes: a product of one-dimensional LME functions, each of which needs the root of one scalar equation.

use super::starts::Starts;
use crate::approximation::interior::{
    Column, FURTHEST, InCells, InLanes, Interior, NODES, Rows, SETTLED, distance, evaluate,
};
use crate::approximation::product::Place;
use crate::approximation::{ApproximationError, AtSurface, AxisWeights, Separable, Validate};
use crate::grid::Axis;
use crate::lanes::Lane;
use std::sync::Arc;

/// LME on the nodes of the box |D_k| < R_a, R_a = h sqrt(−ln TOL₀ / γ̂).
///
/// On a box log Z is a sum over the axes, so N factorises. The box is cut at the walls and always holds the nodes of the particle's cell.
/// So for large γ̂ the functions become linear functions. The family works for every γ̂ and at every point of the grid.
///
/// ## One axis
/// Let a and b = 1 − a be the distances from the two nodes of the cell. The other nodes are j = 1, 2, … spacings further away: D = a + j on
/// the lower side, D = −(b + j) on the upper side. With μ = λ − γ̂(a − b) and q = exp μ the weights are, up to a common factor,
///
/// ```text
/// q gⱼ qʲ  below,    gⱼ q⁻ʲ  above,    gⱼ = exp(−γ̂ j(j+1))
/// ```
///
/// so the position enters through a and b only. Σ N D = 0 means that both sides have equal moments:
///
/// ```text
/// f(μ) = μ + ln Σⱼ (a + j) gⱼ qʲ − ln Σⱼ (b + j) gⱼ q⁻ʲ = 0
/// ```
///
/// f increases with a slope of at least 1, so the root μ* satisfies |μ* − μ| ≤ |f(μ)|. One evaluation gives a bracket, and a Newton method
/// confined to the bracket cannot fail. f is nearly linear, also next to a wall, where λ → ∞. So at most five evaluations of f are
/// needed.
///
/// Away from walls μ depends only on the distance a. A table then gives a first q. Two Newton steps follow, written in q, without an
/// exponential or a logarithm.
///
/// ```
/// use bfree::approximation::{AxisWeights, Lme, Separable};
/// use bfree::grid::Axis;
///
/// // The larger γ̂, the fewer nodes: R_a = h sqrt(−ln TOL₀ / γ̂), and in the limit the hats.
/// let axis = Axis { origin: 0.0, spacing: 1.0, cells: 40 };
/// let seen = |gamma: f64| {
///     let mut weights = AxisWeights::default();
///     Lme::new(gamma, 1e-6).axis(&axis, 20.3, &mut weights).map(|()| weights.values)
/// };
/// assert_eq!((seen(0.8)?.len(), seen(3.0)?.len()), (8, 4));
/// let hats = seen(50.0)?;
/// assert!(hats.len() == 2 && (hats[0] - 0.7).abs() < 1e-14, "{hats:?}");
/// # Ok::<(), bfree::approximation::ApproximationError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Lme {
    /// γ̂
    pub(super) gamma: f64,
    /// TOL₀
    pub(super) tolerance: f64,
    /// R_a/h
    pub(super) radius: f64,
    /// exp(−2γ̂) = gⱼ gⱼ₋₂ / gⱼ₋₁²
    decay: f64,
    /// The table of q away from walls.
    starts: Option<Arc<Starts>>,
}

/// The number of nodes beyond those of the cell, on the lower and on the upper side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Reach {
    pub lower: u32,
    pub upper: u32,
}

/// The smallest TOL₀ that the family accepts. Such a weight is far below round-off next to 1, and still far from underflow.
const SMALLEST_TOLERANCE: f64 = 1e-100;

/// Largest number of iterations of the bracketed Newton method; bisection alone would need fewer.
const ITERATIONS: usize = 200;

impl Lme {
    /// The functions with locality γ̂ (0.8 … 4 are usual) and support tolerance TOL₀ (1e-6 is usual).
    pub fn new(gamma: f64, tolerance: f64) -> Self {
        let radius = (-tolerance.ln() / gamma).sqrt();
        let mut lme = Self { gamma, tolerance, radius, decay: (-2.0 * gamma).exp(), starts: None };
        lme.starts = Starts::new(gamma, radius, |place| lme.table_entry(place)).map(Arc::new);
        lme
    }

    /// The number of nodes with |D| < R_a beyond those of the cell, limited by the ends of the axis.
    #[inline]
    pub(super) fn reach(&self, axis: &Axis, place: &Place) -> Reach {
        let Reach { lower, upper } = self.free_reach(place);
        Reach { lower: lower.min(place.cell), upper: upper.min(axis.cells - 1 - place.cell) }
    }

    /// The number of nodes with |D| < R_a beyond those of the cell, on an axis without ends.
    #[inline]
    fn free_reach(&self, place: &Place) -> Reach {
        // These nodes have j < R − d. The cast saturates, and turns NaN into 0.
        let count = |distance: f64| ((self.radius - distance).ceil() - 1.0).max(0.0) as u32;
        Reach { lower: count(place.below), upper: count(place.above) }
    }

    /// Σⱼ (d + j) gⱼ qʲ and Σⱼ j (d + j) gⱼ qʲ for j = 0 … `reach`.
    #[inline]
    fn moments(&self, distance: f64, reach: u32, q: f64) -> (f64, f64) {
        let (mut sum, mut slope) = (distance, 0.0);
        self.weights(reach, q, |j, weight| {
            let moment = (distance + j) * weight;
            sum += moment;
            slope += j * moment;
        });
        (sum, slope)
    }

    /// Calls `visit(j, gⱼ qʲ)` for j = 1 … `reach`, by the recurrence gⱼ₊₁/gⱼ = exp(−2γ̂)ʲ⁺¹.
    #[inline]
    fn weights(&self, reach: u32, q: f64, mut visit: impl FnMut(f64, f64)) {
        let (mut weight, mut ratio) = (1.0, q);
        for j in 1..=reach {
            ratio *= self.decay;
            weight *= ratio;
            visit(f64::from(j), weight);
        }
    }

    /// gⱼ qʲ for j = 0 … M, zero for nodes out of reach, with |D| = d + j ≥ R.
    #[inline(always)]
    fn weights_within<T: Lane, const M: usize>(&self, distance: T, q: T) -> [T; FURTHEST + 1] {
        let room = distance.constant(self.radius) - distance;
        let mut weights = [distance.constant(0.0); FURTHEST + 1];
        weights[0] = distance.constant(1.0);
        let (mut weight, mut ratio) = (weights[0], q);
        for j in 1..=M {
            ratio = ratio * q.constant(self.decay);
            weight = weight * ratio;
            weights[j] = q.constant(j as f64).where_less(room, weight, q.constant(0.0));
        }
        weights
    }

    /// Σⱼ (d + j) gⱼ qʲ and Σⱼ j (d + j) gⱼ qʲ for the nodes within reach.
    #[inline(always)]
    fn moments_within<T: Lane, const M: usize>(&self, distance: T, q: T) -> (T, T) {
        let weights = self.weights_within::<T, M>(distance, q);
        let (mut sum, mut slope) = (distance, distance.constant(0.0));
        for j in 1..=M {
            let moment = (distance + q.constant(j as f64)) * weights[j];
            sum = sum + moment;
            slope = slope + q.constant(j as f64) * moment;
        }
        (sum, slope)
    }

    /// f and f' at μ.
    #[inline]
    fn balance(&self, place: &Place, reach: Reach, mu: f64) -> (f64, f64) {
        let q = mu.exp();
        let (lower, lower_slope) = self.moments(place.below, reach.lower, q);
        let (upper, upper_slope) = self.moments(place.above, reach.upper, q.recip());
        (mu + (lower / upper).ln(), 1.0 + lower_slope / lower + upper_slope / upper)
    }

    /// The starting value of μ. Wide functions (γ̂ < 1.5) with nodes on both sides start at λ = 0, others at the root for three nodes.
    #[inline]
    fn guess(&self, place: &Place, reach: Reach) -> f64 {
        let (a, b) = (place.below, place.above);
        if self.gamma < 1.5 && reach.lower > 0 && reach.upper > 0 {
            return self.gamma * (b - a);
        }
        // q (a + g₁(1+a) q) = b: the nearer node of the cell has another node behind it.
        let root = |a: f64, b: f64, reach: u32| {
            let behind = if reach > 0 { self.decay } else { 0.0 };
            2.0 * b / (a + (a * a + 4.0 * b * (1.0 + a) * behind).sqrt())
        };
        if a <= b { root(a, b, reach.lower).ln() } else { -root(b, a, reach.upper).ln() }
    }

    /// μ, the root of f. Some node must have D > 0, and some node D < 0.
    #[inline]
    fn solve(&self, place: &Place, reach: Reach) -> f64 {
        let start = self.guess(place, reach);
        let mut mu = start;
        let (mut f, mut slope) = self.balance(place, reach, mu);
        let (mut low, mut high) = (mu - f.max(0.0), mu - f.min(0.0));
        for _ in 0..ITERATIONS {
            let newton = mu - f / slope;
            let inside = newton >= low && newton <= high;
            let next = if inside { newton } else { 0.5 * (low + high) };
            let step = (next - mu).abs();
            mu = next;
            if step <= SETTLED && inside || step == 0.0 {
                break;
            }
            (f, slope) = self.balance(place, reach, mu);
            // For γ̂ << 1 a sum may overflow far from the root. Since f increases, the side of the start then tells the sign of f.
            let above = if f.is_finite() { f > 0.0 } else { mu > start };
            if above {
                high = mu;
                low = low.max(mu - f);
            } else {
                low = mu;
                high = high.min(mu - f);
            }
        }
        mu
    }

    /// q and dq/da away from walls: f depends on a directly and through μ, so dμ/da = −(∂f/∂a)/(∂f/∂μ).
    fn table_entry(&self, place: &Place) -> [f64; 2] {
        let reach = self.free_reach(place);
        let mu = self.solve(place, reach);
        let q = mu.exp();
        let total = |reach: u32, q: f64| {
            let mut sum = 1.0;
            self.weights(reach, q, |_, weight| sum += weight);
            sum
        };
        let (lower, lower_slope) = self.moments(place.below, reach.lower, q);
        let (upper, upper_slope) = self.moments(place.above, reach.upper, q.recip());
        let direct = total(reach.lower, q) / lower + total(reach.upper, q.recip()) / upper;
        [q, -q * direct / (1.0 + lower_slope / lower + upper_slope / upper)]
    }

    /// λ in units of 1/h; infinite on a wall.
    pub(super) fn multiplier(&self, place: &Place, reach: Reach) -> f64 {
        self.solve(place, reach) + self.gamma * (place.below - place.above)
    }
}

impl Validate for Lme {
    fn validate(&self, _dimension: usize) -> Result<(), ApproximationError> {
        let refused = |parameter, value, allowed| Err(ApproximationError::Parameter { parameter, value, allowed });
        if !(self.gamma > 0.0 && self.gamma.is_finite()) {
            refused("the locality γ of max-ent", self.gamma, "finite and > 0")
        } else if !(SMALLEST_TOLERANCE..1.0).contains(&self.tolerance) {
            refused("the support tolerance of max-ent", self.tolerance, ">= 1e-100 and < 1")
        } else {
            Ok(())
        }
    }
}

impl InLanes for Lme {
    /// R_a/h
    fn radius(&self) -> f64 {
        self.radius
    }

    fn evaluate(&self, points: &InCells, out: Rows<'_>) -> usize {
        match self.radius.ceil() as usize {
            0..=2 => evaluate::<1>(self, self.radius, points, out),
            3 => evaluate::<2>(self, self.radius, points, out),
            4 => evaluate::<3>(self, self.radius, points, out),
            _ => evaluate::<FURTHEST>(self, self.radius, points, out),
        }
    }
}

impl Separable for Lme {
    #[inline]
    fn axis(&self, axis: &Axis, x: f64, out: &mut AxisWeights) -> Result<(), ApproximationError> {
        self.validate(1)?;
        let place = Place::new(axis, x)?;
        let reach = self.reach(axis, &place);
        // All nodes lie on one side, so λ → ±∞. The limit is N = 1 at the wall, with the slopes of the linear functions.
        let on_lower_wall = place.below < f64::MIN_POSITIVE && reach.lower == 0;
        let on_upper_wall = place.above < f64::MIN_POSITIVE && reach.upper == 0;
        if on_lower_wall || on_upper_wall {
            out.hats(&place, axis.spacing);
            return Ok(());
        }

        if self.starts.is_some() && reach == self.free_reach(&place) {
            let start = Interior::start(self, place.below);
            let column = self.column::<f64, FURTHEST>(place.below, place.above, start, axis.spacing);
            if column.correction <= SETTLED {
                let nodes = FURTHEST - reach.lower as usize..FURTHEST + 2 + reach.upper as usize;
                out.start(place.cell - reach.lower);
                out.values.extend_from_slice(&column.values[nodes.clone()]);
                out.derivatives.extend_from_slice(&column.derivatives[nodes]);
                return Ok(());
            }
        }

        let mu = self.solve(&place, reach);
        let (q, p) = (mu.exp(), (-mu).exp());
        // This common factor keeps the larger of the two weights in the cell at 1.
        let (lower, upper) = if q >= 1.0 { (1.0, p) } else { (q, 1.0) };
        out.start(place.cell - reach.lower);
        self.weights(reach.lower, q, |j, weight| out.push(lower * weight, place.below + j));
        out.values.reverse();
        out.derivatives.reverse();
        out.push(lower, place.below);
        out.push(upper, -place.above);
        self.weights(reach.upper, p, |j, weight| out.push(upper * weight, -(place.above + j)));

        normalise(&mut out.values, &mut out.derivatives, axis.spacing);
        Ok(())
    }

    fn in_lanes(&self) -> Option<&dyn InLanes> {
        (self.starts.is_some() && self.validate(1).is_ok()).then_some(self)
    }

    fn at_surface(&self) -> AtSurface<'_> {
        AtSurface::NearestParticle
    }

    fn width(&self) -> usize {
        // At most ceil(2R) nodes have |D| < R. The two nodes of the cell are always listed.
        ((2.0 * self.radius).ceil() as usize).max(2)
    }
}

/// Turns weights into N = weight/Z, and D into ∇N = −N J⁻¹ D with J = Σ N D². D and J are taken about r = Σ N D, which is zero up to
/// round-off. So Σ ∇N = 0 and Σ x ∇N = 1 do not depend on the accuracy of λ.
#[inline(always)]
fn normalise<T: Lane>(values: &mut [T], derivatives: &mut [T], spacing: f64) {
    let Some(&like) = values.first() else { return };
    let c = |x: f64| like.constant(x);
    let z = c(1.0) / values.iter().fold(c(0.0), |sum, &value| sum + value);
    let mut r = c(0.0);
    for (value, distance) in values.iter_mut().zip(&*derivatives) {
        *value = *value * z;
        r = r + *value * *distance;
    }
    let mut j = c(0.0);
    for (value, distance) in values.iter().zip(&mut *derivatives) {
        *distance = *distance - r;
        j = j + *value * *distance * *distance;
    }
    let scale = c(-1.0) / (j * c(spacing));
    mutant!("shapes: max-ent gradients have the other sign": scale = c(1.0) / (j * c(spacing)));
    for (value, distance) in values.iter().zip(derivatives) {
        *distance = *distance * (*value * scale);
    }
}

impl Interior for Lme {
    #[inline(always)]
    fn start(&self, below: f64) -> f64 {
        self.starts.as_ref().map_or(f64::NAN, |starts| starts.at(below))
    }

    /// Two Newton steps in μ from the tabulated q: Δμ = −f/f' with f = −ln(U/(qL)) = −2 artanh t, t = (U − qL)/(U + qL). A step multiplies
    /// q by exp Δμ. The steps are so small that polynomials give artanh and exp to the last digit.
    #[inline(always)]
    fn column<T: Lane, const M: usize>(&self, below: T, above: T, start: T, spacing: f64) -> Column<T> {
        let c = |x: f64| below.constant(x);
        let (mut q, mut step) = (start, start);
        for _ in 0..2 {
            let (lower, lower_slope) = self.moments_within::<T, M>(below, q);
            let (upper, upper_slope) = self.moments_within::<T, M>(above, c(1.0) / q);
            let t = (upper - q * lower) / (upper + q * lower);
            step = c(2.0) * t * (c(1.0) + t * t * c(1.0 / 3.0)) / (c(1.0) + lower_slope / lower + upper_slope / upper);
            q = q + q * step * (c(1.0) + c(0.5) * step);
        }
        let p = c(1.0) / q;
        // This common factor keeps the larger of the two weights in the cell at 1.
        let (lower, upper) = (q.where_less(c(1.0), q, c(1.0)), q.where_less(c(1.0), c(1.0), p));
        let (on_lower, on_upper) = (self.weights_within::<T, M>(below, q), self.weights_within::<T, M>(above, p));
        let (mut values, mut derivatives) = ([c(0.0); NODES], [c(0.0); NODES]);
        for j in 0..=M {
            values[M - j] = lower * on_lower[j];
            values[M + 1 + j] = upper * on_upper[j];
            derivatives[M - j] = distance::<T, M>(M - j, below, above);
            derivatives[M + 1 + j] = distance::<T, M>(M + 1 + j, below, above);
        }
        normalise(&mut values[..2 * M + 2], &mut derivatives[..2 * M + 2], spacing);
        Column { values, derivatives, correction: step.abs() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_leads_to_the_root_that_is_found_without_it() {
        let axis = Axis { origin: 0.0, spacing: 1.0, cells: 40 };
        for (gamma, tolerance) in [(0.3, 1e-2), (0.8, 1e-6), (1.8, 1e-10), (3.0, 1e-6), (4.0, 1e-2), (9.9, 1e-16)] {
            let lme = Lme::new(gamma, tolerance);
            let without = Lme { starts: None, ..lme.clone() };
            let mut plain = AxisWeights::default();
            let mut found = 0;
            for i in 0..=1000 {
                let x = 20.0 + f64::from(i) / 1000.0;
                let place = Place::new(&axis, x).expect("inside");
                let reach = lme.reach(&axis, &place);
                let start = lme.start(place.below);
                let column = lme.column::<f64, FURTHEST>(place.below, place.above, start, axis.spacing);
                let settled = column.correction <= SETTLED;
                found += usize::from(settled);
                without.axis(&axis, x, &mut plain).expect("inside");
                let nodes = FURTHEST - reach.lower as usize..FURTHEST + 2 + reach.upper as usize;
                assert_eq!((plain.first, plain.values.len()), (place.cell - reach.lower, nodes.len()));
                let both = [(&column.values, &plain.values), (&column.derivatives, &plain.derivatives)];
                for (a, b) in both.into_iter().flat_map(|(a, b)| a[nodes.clone()].iter().zip(b)).filter(|_| settled) {
                    assert!((a - b).abs() < 4e-15, "gamma {gamma}, x {x}: {a} {b}");
                }
                let outside = |x: &[f64]| x[..nodes.start].iter().chain(&x[nodes.end..]).all(|&x| x == 0.0);
                assert!(outside(&column.values) && outside(&column.derivatives));
            }
            assert!(found > 950, "gamma {gamma}, TOL {tolerance}: {found} of 1001");
        }
    }
}
