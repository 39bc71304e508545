//! Small problems with known answers.

use crate::solver::testing::Dense;
use crate::solver::{Linearization, NonlinearProblem};
use crate::space::vector::norm;

#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("x = {0} is outside")]
pub struct Outside(pub f64);

/// R, its magnitude, Π and K as plain functions.
pub struct Problem<R, M, W, K> {
    pub residual: R,
    pub magnitude: M,
    pub potential: W,
    pub tangent: K,
}

impl<R, M, W, K> NonlinearProblem for Problem<R, M, W, K>
where
    R: Fn(&[f64]) -> Result<Vec<f64>, Outside>,
    M: Fn(&[f64]) -> f64,
    W: Fn(&[f64]) -> Option<(f64, f64)>,
    K: Fn(&[f64]) -> Dense,
{
    type Inadmissible = Outside;
    fn residual(&self, x: &[f64], r: &mut [f64]) -> Result<(), Outside> {
        r.copy_from_slice(&(self.residual)(x)?);
        Ok(())
    }
    fn magnitude(&self, x: &[f64]) -> Result<f64, Outside> {
        Ok((self.magnitude)(x))
    }
    fn potential(&self, x: &[f64]) -> Option<Result<(f64, f64), Outside>> {
        (self.potential)(x).map(Ok)
    }
    fn linearize(&self, x: &[f64]) -> Result<Box<dyn Linearization + '_>, Outside> {
        Ok(Box::new((self.tangent)(x)))
    }
}

/// One unknown, no potential, contributions of magnitude 1.
pub fn scalar(
    residual: impl Fn(f64) -> Result<f64, Outside>,
    derivative: impl Fn(f64) -> f64,
) -> impl NonlinearProblem<Inadmissible = Outside> {
    Problem {
        residual: move |x: &[f64]| Ok(vec![residual(x[0])?]),
        magnitude: |_: &[f64]| 1.0,
        potential: |_: &[f64]| None,
        tangent: move |x: &[f64]| Dense(vec![vec![derivative(x[0])]]),
    }
}

pub(crate) fn rosenbrock(conservative: bool) -> impl NonlinearProblem<Inadmissible = Outside> {
    Problem {
        residual: |x: &[f64]| {
            let valley = x[1] - x[0] * x[0];
            Ok(vec![2.0 * (x[0] - 1.0) - 400.0 * x[0] * valley, 200.0 * valley])
        },
        magnitude: |x: &[f64]| 400.0 * (x[0].abs() + 1.0).powi(3),
        potential: move |x: &[f64]| {
            let (a, b) = (x[0] - 1.0, x[1] - x[0] * x[0]);
            let value = a * a + 100.0 * b * b;
            conservative.then_some((value, value))
        },
        tangent: |x: &[f64]| {
            let off = -400.0 * x[0];
            Dense(vec![vec![2.0 - 400.0 * x[1] + 1200.0 * x[0] * x[0], off], vec![off, 200.0]])
        },
    }
}

/// Springs in a row, fixed at the first end and loaded at the free end. The n unknowns are u, the elongations g, and the force
/// k g (1 − g²/2ℓ² + g⁴/2ℓ⁴): softening, then hardening.
pub(crate) fn springs(k: f64, l: f64, load: f64, n: usize) -> impl NonlinearProblem<Inadmissible = Outside> {
    let elongation = |u: &[f64], i: usize| u[i] - if i == 0 { 0.0 } else { u[i - 1] };
    let terms = move |g: f64| {
        let s = (g / l) * (g / l);
        [k * g, -0.5 * k * g * s, 0.5 * k * g * s * s]
    };
    Problem {
        residual: move |u: &[f64]| {
            let mut r = vec![0.0; n];
            for i in 0..n {
                let force = terms(elongation(u, i)).iter().sum::<f64>();
                r[i] += force;
                if i > 0 {
                    r[i - 1] -= force;
                }
            }
            r[n - 1] -= load;
            Ok(r)
        },
        magnitude: move |u: &[f64]| {
            let force = |i| terms(elongation(u, i)).iter().map(|f| f.abs()).sum::<f64>();
            let sums: Vec<f64> = (0..n).map(|i| force(i) + if i + 1 < n { force(i + 1) } else { load.abs() }).collect();
            norm(&sums)
        },
        potential: move |u: &[f64]| {
            let (mut value, mut magnitude) = (-load * u[n - 1], (load * u[n - 1]).abs());
            for i in 0..n {
                let g = elongation(u, i);
                for (term, power) in terms(g).into_iter().zip([2.0, 4.0, 6.0]) {
                    value += term * g / power;
                    magnitude += (term * g / power).abs();
                }
            }
            Some((value, magnitude))
        },
        tangent: move |u: &[f64]| {
            let stiffness = |i: usize| {
                let s = (elongation(u, i) / l) * (elongation(u, i) / l);
                k * (1.0 - 1.5 * s + 2.5 * s * s)
            };
            Dense::from_fn(n, |i, j| match i.abs_diff(j) {
                0 => stiffness(i) + if i + 1 < n { stiffness(i + 1) } else { 0.0 },
                1 => -stiffness(i.max(j)),
                _ => 0.0,
            })
        },
    }
}

/// Π = Σ ¼ x⁴ − ½ x² + ½ i y²: hills with a valley on either side, and directions along which Π only rises.
pub(crate) fn hills(n: usize, with_potential: bool) -> impl NonlinearProblem<Inadmissible = Outside> {
    Problem {
        residual: move |x: &[f64]| {
            Ok((0..n).map(|i| if i.is_multiple_of(2) { x[i].powi(3) - x[i] } else { i as f64 * x[i] }).collect())
        },
        magnitude: |_: &[f64]| 1.0,
        potential: move |x: &[f64]| {
            let of = |i: usize| {
                if i.is_multiple_of(2) { 0.25 * x[i].powi(4) - 0.5 * x[i] * x[i] } else { 0.5 * i as f64 * x[i] * x[i] }
            };
            with_potential.then(|| ((0..n).map(of).sum(), (0..n).map(|i| of(i).abs()).sum()))
        },
        tangent: move |x: &[f64]| {
            let of = |i: usize| if i.is_multiple_of(2) { 3.0 * x[i] * x[i] - 1.0 } else { i as f64 };
            Dense::from_fn(n, |i, j| if i == j { of(i) } else { 0.0 })
        },
    }
}
