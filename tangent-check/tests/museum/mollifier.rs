//! ipc-toolkit, pull request 239 (7 June 2026): two mistakes in the shape derivative of nearly parallel edges.
//!
//! Our residual: edges p = P + u_p and q = Q + u_q with the gap r = R + u_r. The displacements u are fixed, and the shape (P, Q, R) moves.
//! The potential is m(s, ε) f(r): the mollifier m = (2 − s/ε) s/ε with s = |p × q|² and ε = ½ |P|² |Q|², and the barrier
//! f = −(d − d̂)² ln(d/d̂) of d = |r|². The force is f ∇ᵤm + m ∇ᵤf. Its derivative by the shape is
//!
//! f ∂(∇ᵤm)/∂X + ∇ᵤm ⊗ ∇ᵤf + ∇ᵤf ⊗ ∇ᵤm + ∇ᵤf ⊗ (∂m/∂ε ∇ε) + m ∇ᵤ²f.
//!
//! Before, first mistake: ∂m/∂ε ∇ᵤm for ∂m/∂ε ∇ε. Second mistake: without ∇ᵤf ⊗ ∇ᵤm. Both stand in the rows of r and the columns of P and Q.
//! In ipc-toolkit, ε has the factor 10⁻³ and r depends on both edges; there the matrix is the transpose of ours.

use crate::check::{all, assert_consistent, assert_wrong, vector_finding};
use tangent_check::matrix::Matrix;

const THRESHOLD: f64 = 0.5;
const REACH: f64 = 4.0;

/// The components of P, Q and R, or of p, q and r.
pub type Shape = [f64; 9];

/// Which mistakes are repaired.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Repairs {
    /// ∇ε for ∇ᵤm.
    pub factor: bool,
    /// ∇ᵤf ⊗ ∇ᵤm.
    pub term: bool,
}

type Vector = [f64; 3];

fn part(shape: &Shape, number: usize) -> Vector {
    std::array::from_fn(|i| shape[3 * number + i])
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// m, ∂m/∂s, ∂m/∂ε, ∂²m/∂s², ∂²m/∂s∂ε.
struct Mollifier {
    value: f64,
    by_s: f64,
    by_threshold: f64,
    by_s_s: f64,
    by_s_threshold: f64,
}

impl Mollifier {
    fn new(s: f64, threshold: f64) -> Self {
        let x = s / threshold;
        Self {
            value: (2.0 - x) * x,
            by_s: 2.0 * (1.0 - x) / threshold,
            by_threshold: -2.0 * x * (1.0 - x) / threshold,
            by_s_s: -2.0 / (threshold * threshold),
            by_s_threshold: -2.0 * (1.0 - 2.0 * x) / (threshold * threshold),
        }
    }
}

/// s, and ∇s by p and q.
fn cross_squared(p: Vector, q: Vector) -> (f64, [f64; 6]) {
    let (pp, qq, pq) = (dot(p, p), dot(q, q), dot(p, q));
    let gradient =
        std::array::from_fn(
            |i| if i < 3 { 2.0 * (qq * p[i] - pq * q[i]) } else { 2.0 * (pp * q[i - 3] - pq * p[i - 3]) },
        );
    (pp * qq - pq * pq, gradient)
}

/// ∇²s by p and q.
fn cross_squared_hessian(p: Vector, q: Vector, row: usize, column: usize) -> f64 {
    let (i, j) = (row % 3, column % 3);
    let unit = if i == j { 1.0 } else { 0.0 };
    match (row < 3, column < 3) {
        (true, true) => 2.0 * (dot(q, q) * unit - q[i] * q[j]),
        (false, false) => 2.0 * (dot(p, p) * unit - p[i] * p[j]),
        (true, false) => 2.0 * (2.0 * p[i] * q[j] - q[i] * p[j] - dot(p, q) * unit),
        (false, true) => 2.0 * (2.0 * q[i] * p[j] - p[i] * q[j] - dot(p, q) * unit),
    }
}

/// ε, and ∇ε by P and Q.
fn threshold(shape: &Shape) -> (f64, [f64; 6]) {
    let (p, q) = (part(shape, 0), part(shape, 1));
    let (pp, qq) = (dot(p, p), dot(q, q));
    let gradient = std::array::from_fn(|i| 2.0 * THRESHOLD * if i < 3 { p[i] * qq } else { pp * q[i - 3] });
    (THRESHOLD * pp * qq, gradient)
}

/// f and its first two derivatives by d.
fn barrier(d: f64) -> [f64; 3] {
    let (short, log) = (d - REACH, (d / REACH).ln());
    [
        -short * short * log,
        -2.0 * short * log - short * short / d,
        -2.0 * log - 4.0 * short / d + short * short / (d * d),
    ]
}

fn moved(shape: &Shape, displacement: &Shape) -> Shape {
    std::array::from_fn(|i| shape[i] + displacement[i])
}

/// f ∇ᵤm + m ∇ᵤf where a component of the shape grows by h.
pub fn force(shape: &Shape, displacement: &Shape, component: usize, h: f64) -> Vec<f64> {
    let mut shape = *shape;
    shape[component] += h;
    let position = moved(&shape, displacement);
    let r = part(&position, 2);
    let (s, s_gradient) = cross_squared(part(&position, 0), part(&position, 1));
    let m = Mollifier::new(s, threshold(&shape).0);
    let [f, f_d, _] = barrier(dot(r, r));
    let edges = s_gradient.iter().map(|slope| f * m.by_s * slope);
    edges.chain(r.iter().map(|r| m.value * 2.0 * f_d * r)).collect()
}

/// The derivative of the force by the shape.
pub fn tangent(repairs: Repairs, shape: &Shape, displacement: &Shape) -> Matrix {
    let position = moved(shape, displacement);
    let (p, q, r) = (part(&position, 0), part(&position, 1), part(&position, 2));
    let (s, s_gradient) = cross_squared(p, q);
    let (epsilon, epsilon_gradient) = threshold(shape);
    let m = Mollifier::new(s, epsilon);
    let [f, f_d, f_dd] = barrier(dot(r, r));
    let f_gradient = r.map(|r| 2.0 * f_d * r);
    let m_gradient = s_gradient.map(|slope| m.by_s * slope);
    let mut tangent = Matrix::zeros(9, 9);
    for i in 0..6 {
        for j in 0..6 {
            tangent[(i, j)] = f
                * (m.by_s_s * s_gradient[i] * s_gradient[j]
                    + m.by_s * cross_squared_hessian(p, q, i, j)
                    + m.by_s_threshold * s_gradient[i] * epsilon_gradient[j]);
        }
    }
    for i in 0..3 {
        for j in 0..3 {
            let unit = if i == j { 2.0 * f_d } else { 0.0 };
            tangent[(6 + i, 6 + j)] = m.value * (unit + 4.0 * f_dd * r[i] * r[j]);
        }
        for j in 0..6 {
            tangent[(j, 6 + i)] = m_gradient[j] * f_gradient[i];
            let second_factor = if repairs.factor { epsilon_gradient[j] } else { m_gradient[j] };
            let split_off = if repairs.term { m_gradient[j] } else { 0.0 };
            tangent[(6 + i, j)] = f_gradient[i] * (split_off + m.by_threshold * second_factor);
        }
    }
    tangent
}

const SHAPE: Shape = [1.0, 0.1, 0.0, 1.1, 0.2, 0.1, 0.2, 0.3, 1.1];
const DISPLACEMENT: Shape = [0.1, 0.05, -0.1, 0.0, 0.1, 0.2, 0.1, 0.0, 0.05];

#[test]
fn before_the_rows_of_the_gap_are_wrong() {
    let block = all(9, 9).into_iter().filter(|&(row, column)| row >= 6 && column < 6).collect();
    for (factor, term, deviation) in [(false, false, 1.72), (true, false, 1.00), (false, true, 0.72)] {
        let claimed = tangent(Repairs { factor, term }, &SHAPE, &DISPLACEMENT);
        let finding = vector_finding(&claimed, &mut |k, h| force(&SHAPE, &DISPLACEMENT, k, h));
        assert_wrong(&finding, &[(8, 2)], &block);
        assert!((finding.deviation - deviation).abs() < 0.01, "{}", finding.deviation);
    }
}

#[test]
fn after_both_repairs_the_derivative_is_right() {
    let claimed = tangent(Repairs { factor: true, term: true }, &SHAPE, &DISPLACEMENT);
    assert_consistent(&vector_finding(&claimed, &mut |k, h| force(&SHAPE, &DISPLACEMENT, k, h)));
}
