//! The trace of a local iteration that stops early: the response jumps.
//!
//! A law that iterates until its residual is below a tolerance answers with an error of up to that tolerance. The error depends smoothly on
//! the input while the number of iterations stays the same, and the response jumps where this number changes. The derivative of the error
//! is what a tangent misses that is consistent with the converged equations. A tangent with a mistake, of a law that is converged, shows the
//! same deviation without jumps. So a jump is the evidence: its size T, at the distance d from the state, is the size of the error, and
//! T / d is the size of its derivative.

use crate::difference::finite;
use crate::law::CallFailed;

/// The greatest deviation, over ‖C‖, that a loose local iteration may explain.
pub(crate) const LOOSE: f64 = 1e-4;

/// The derivative of the error of a loose iteration is at most this multiple of T / d.
const SLOPE: f64 = 30.0;

/// The values from which the next one is predicted.
const NODES: usize = 7;

/// A value that differs from its prediction by this many times the noise shows a jump or a kink.
const MISFIT: f64 = 30.0;

/// The first step of the walk, over its length.
const FIRST: f64 = 1e-5;

/// A step of the walk below this part of its distance holds nothing but a jump or a kink.
const FINEST: f64 = 1e-13;

/// The greatest number of calls on one side.
const CALLS: usize = 200;

/// A jump of the response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    /// The greatest component of the jump T, in the unit of the response.
    pub size: f64,
    /// The perturbation d at which it happens.
    pub distance: f64,
}

impl Jump {
    /// The deviation that the jump explains: 30 T / d.
    pub(super) fn slope(self) -> f64 {
        SLOPE * self.size / self.distance
    }
}

/// The response along a straight line, and what is known of it.
pub(super) struct Line<'a> {
    /// f(0).
    pub value: &'a [f64],
    /// The greatest noise of f.
    pub noise: f64,
    /// The length of the walk.
    pub length: f64,
    /// The deviation that a jump must explain.
    pub deviation: f64,
}

impl Line<'_> {
    /// Looks for the nearest jump that explains the deviation.
    ///
    /// The walk goes outwards from 0. It predicts each value from the last seven. If a value fits, the step grows, otherwise it is halved.
    /// When the step is next to nothing, the misfit is a jump or a kink. A kink ends the walk, because the response is continuous there.
    pub fn nearest_jump(&self, f: &mut dyn FnMut(f64) -> Result<Vec<f64>, CallFailed>) -> Option<Jump> {
        let mut step = FIRST * self.length;
        let mut nodes = vec![(0.0, self.value.to_vec())];
        for _ in 0..CALLS {
            let (last, ref before) = nodes[nodes.len() - 1];
            if last >= self.length {
                return None;
            }
            step = step.min(self.length - last);
            let h = last + step;
            let value = finite(f(h), self.value.len()).ok()?;
            if nodes.len() < NODES || self.fits(&nodes, h, &value) {
                nodes.push((h, value));
                if nodes.len() > NODES {
                    nodes.remove(0);
                    step *= 1.5;
                }
            } else if step > FINEST * h {
                step *= 0.5;
            } else {
                let size = value.iter().zip(before).fold(0.0_f64, |size, (a, b)| size.max((a - b).abs()));
                let jump = Jump { size, distance: h };
                let continuous = MISFIT * self.noise + 10.0 * steepest(&nodes) * step;
                if size > continuous && jump.slope() > self.deviation {
                    return Some(jump);
                }
                nodes = vec![(h, value)];
                step = FIRST * self.length;
            }
        }
        None
    }

    /// Whether `value` is near the polynomial through `nodes`: as near as the noise allows, or nearer than a jump that explains anything.
    fn fits(&self, nodes: &[(f64, Vec<f64>)], h: f64, value: &[f64]) -> bool {
        let weights = weights(nodes, h);
        let amplification: f64 = weights.iter().map(|weight| weight.abs()).sum();
        let allowed = (MISFIT * amplification * self.noise).max(0.1 * self.deviation * h / SLOPE);
        (0..value.len()).all(|i| {
            let predicted: f64 = weights.iter().zip(nodes).map(|(weight, (_, value))| weight * value[i]).sum();
            (value[i] - predicted).abs() <= allowed
        })
    }
}

/// The steepest slope between the nodes.
fn steepest(nodes: &[(f64, Vec<f64>)]) -> f64 {
    let mut steepest = 0.0_f64;
    for ((a, before), (b, after)) in nodes.iter().zip(nodes.iter().skip(1)) {
        let greatest = before.iter().zip(after).fold(0.0_f64, |greatest, (x, y)| greatest.max((y - x).abs()));
        steepest = steepest.max(greatest / (b - a));
    }
    steepest
}

/// The weights of Lagrange's interpolation: L_j(h) = Π_{m ≠ j} (h − h_m) / (h_j − h_m).
fn weights(nodes: &[(f64, Vec<f64>)], h: f64) -> Vec<f64> {
    let weight = |j: usize| {
        let others = (0..nodes.len()).filter(|m| *m != j);
        others.map(|m| (h - nodes[m].0) / (nodes[j].0 - nodes[m].0)).product()
    };
    (0..nodes.len()).map(weight).collect()
}
