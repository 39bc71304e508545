//! The trace of a local iteration that stops early: the response jumps.
//!
//! A law that iterates until its residual is below a tolerance answers with an error of up to that tolerance. The error depends smoothly on
//! the input while the number of iterations stays the same, and the response jumps where this number changes. The derivative of the error
//! is what a tangent misses that is consistent with the converged equations. A tangent with a mistake, of a law that is converged, shows the
//! same deviation without jumps. So a jump is the evidence: its size T, at the distance d from the state, is the size of the error, and
//! T / d is the size of its derivative.

use crate::difference::{Ladder, Refused, finite};
use crate::law::CallFailed;

/// The greatest deviation, over ‖C‖, that a loose local iteration may explain.
pub(super) const LOOSE: f64 = 1e-5;

/// The derivative of the error of a loose iteration, over T / d.
const SLOPE: f64 = 30.0;

/// The inner values from which the next one is predicted.
const NODES: usize = 6;

/// A value that differs from its prediction by this many times the noise shows a jump or a kink.
const MISFIT: f64 = 30.0;

/// Halvings of the interval with the jump.
const HALVINGS: usize = 40;

/// A jump of the response.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jump {
    /// The greatest component of the jump T, in the unit of the response.
    pub size: f64,
    /// The perturbation d at which it happens.
    pub distance: f64,
}

/// The deviation that a jump explains: 30 T / d, at most 1e-5 ‖C‖.
pub(super) fn explained(jump: Jump, scale: f64) -> f64 {
    (SLOPE * jump.size / jump.distance).min(LOOSE * scale)
}

/// Looks for the jump nearest to 0 on one side; `side` is 1 or −1.
///
/// The values at h_i are predicted from the inner ones, from the smallest perturbation outwards. The first interval whose outer value differs
/// from the prediction is halved until it holds nothing but the jump. At a kink nothing is left then.
pub(super) fn nearest_jump(
    f: &mut dyn FnMut(f64) -> Result<Vec<f64>, CallFailed>,
    value_at_zero: &[f64],
    noise: &[f64],
    ladder: Ladder,
    side: f64,
) -> Option<Jump> {
    let mut f = |h: f64| finite(f(side * h), value_at_zero.len());
    let mut nodes = vec![(0.0, value_at_zero.to_vec())];
    let perturbations: Vec<f64> = ladder.perturbations().collect();
    for h in perturbations.into_iter().rev() {
        let value = f(h).ok()?;
        if nodes.len() > NODES {
            let prediction = Prediction { nodes: &nodes, noise };
            if prediction.misfit(h, &value) > 1.0 {
                let (inside, _) = nodes.last()?;
                return halve(&mut f, &prediction, *inside, h).ok()?;
            }
            nodes.remove(1);
        }
        nodes.push((h, value));
    }
    None
}

/// The polynomial through values near 0.
struct Prediction<'a> {
    nodes: &'a [(f64, Vec<f64>)],
    noise: &'a [f64],
}

impl Prediction<'_> {
    /// The greatest difference between `value` and the prediction at h, over what noise and truncation allow.
    fn misfit(&self, h: f64, value: &[f64]) -> f64 {
        let all = weights(self.nodes, h);
        let fewer = weights(&self.nodes[1..], h);
        let amplification: f64 = all.iter().map(|weight| weight.abs()).sum();
        let mut misfit = 0.0_f64;
        for i in 0..value.len() {
            let predict = |weights: &[f64], nodes: &[(f64, Vec<f64>)]| -> f64 {
                weights.iter().zip(nodes).map(|(weight, (_, value))| weight * value[i]).sum()
            };
            let predicted = predict(&all, self.nodes);
            let truncation = (predicted - predict(&fewer, &self.nodes[1..])).abs();
            let allowed = MISFIT * amplification * self.noise[i] + truncation;
            misfit = misfit.max((value[i] - predicted).abs() / allowed);
        }
        misfit
    }
}

/// The weights of Lagrange's interpolation: L_j(h) = Π_{m ≠ j} (h − h_m) / (h_j − h_m).
fn weights(nodes: &[(f64, Vec<f64>)], h: f64) -> Vec<f64> {
    let weight = |j: usize| {
        let others = (0..nodes.len()).filter(|m| *m != j);
        others.map(|m| (h - nodes[m].0) / (nodes[j].0 - nodes[m].0)).product()
    };
    (0..nodes.len()).map(weight).collect()
}

/// Halves the interval between a value that fits and one that does not.
fn halve(
    f: &mut dyn FnMut(f64) -> Result<Vec<f64>, Refused>,
    prediction: &Prediction<'_>,
    mut inside: f64,
    mut outside: f64,
) -> Result<Option<Jump>, Refused> {
    let (mut fits, mut differs) = (f(inside)?, f(outside)?);
    let mut slope = 0.0;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (inside + outside);
        let value = f(middle)?;
        if prediction.misfit(middle, &value) > 1.0 {
            (outside, differs) = (middle, value);
        } else {
            slope = distance(&value, &fits) / (middle - inside);
            (inside, fits) = (middle, value);
        }
    }
    let size = distance(&fits, &differs);
    let noise = prediction.noise.iter().fold(0.0_f64, |greatest, noise| greatest.max(*noise));
    let jumps = size > MISFIT * noise + 10.0 * slope * (outside - inside);
    Ok(jumps.then_some(Jump { size, distance: outside }))
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |greatest, (a, b)| greatest.max((a - b).abs()))
}
