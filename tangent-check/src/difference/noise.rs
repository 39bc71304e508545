//! The noise of a function, from tables of its differences.

use super::{Ladder, Refused, finite};
use crate::law::CallFailed;

/// The spacings of the tables that measure the noise, over h₀: 1e-10, 1e-8 and 1e-6 for h₀ = 0.04. Single precision shows at the widest.
const SPACINGS: [f64; 3] = [2.5e-9, 2.5e-7, 2.5e-5];

/// The points of a table that measures the noise.
const POINTS: usize = 6;

/// A table whose differences fall to this part from order to order shows a smooth function, not noise.
const DECAY: f64 = 0.25;

/// The noise of each component of `f` near 0: the standard deviation of its round-off, in the unit of `f`.
///
/// The k-th differences Δᵏf of six values at equal, tiny spacing contain nothing but noise, with σ² = (k!)²/(2k)! mean((Δᵏf)²).
/// The greatest σ over k = 3, 4, 5 is taken, then the smaller one of both sides of 0, because a kink spoils one side, and then the greatest
/// over the spacings 1e-10, 1e-8 and 1e-6 (for h₀ = 0.04). The result is at least ε |f(0)|. It costs 30 calls.
///
/// `f(t, h)` is the value at h for the spacing number t = 0, 1, 2. Each may have a direction of its own: round-off differs from one to the
/// other, since h adds to a number of another size.
///
/// # Errors
/// No table on either side could be filled, `f` changed the number of its components, or the ladder is not valid.
pub fn noise(
    f: &mut dyn FnMut(usize, f64) -> Result<Vec<f64>, CallFailed>,
    value_at_zero: &[f64],
    ladder: Ladder,
) -> Result<Vec<f64>, CallFailed> {
    ladder.check()?;
    let mut failure = None;
    let mut greatest: Option<Vec<f64>> = None;
    for (t, spacing) in SPACINGS.into_iter().enumerate() {
        let mut least: Option<Vec<f64>> = None;
        for side in [1.0, -1.0] {
            match table_noise(&mut |h| f(t, h), value_at_zero, side * spacing * ladder.first) {
                Ok(noise) => least = Some(combine(least, noise, f64::min)),
                Err(Refused::Size(failed)) => return Err(failed),
                Err(Refused::Level(failed)) => failure = Some(failed),
            }
        }
        if let Some(noise) = least {
            greatest = Some(combine(greatest, noise, f64::max));
        }
    }
    let floor = value_at_zero.iter().map(|value| f64::EPSILON * value.abs()).collect();
    match (greatest, failure) {
        (None, Some(failure)) => Err(failure),
        (noise, _) => Ok(combine(noise, floor, f64::max)),
    }
}

fn combine(before: Option<Vec<f64>>, noise: Vec<f64>, choose: fn(f64, f64) -> f64) -> Vec<f64> {
    match before {
        Some(before) => before.into_iter().zip(noise).map(|(a, b)| choose(a, b)).collect(),
        None => noise,
    }
}

/// The noise from one table of six values at `spacing`.
fn table_noise(
    f: &mut dyn FnMut(f64) -> Result<Vec<f64>, CallFailed>,
    value_at_zero: &[f64],
    spacing: f64,
) -> Result<Vec<f64>, Refused> {
    let size = value_at_zero.len();
    let mut table = vec![value_at_zero.to_vec()];
    for point in 1..POINTS {
        table.push(finite(f(point as f64 * spacing), size)?);
    }
    let mut orders: Vec<Vec<f64>> = vec![];
    let mut gamma = 1.0;
    for k in 1..POINTS {
        let order = k as f64;
        // γ_k = γ_{k−1} k² / (2k (2k − 1))
        gamma *= order / (2.0 * (2.0 * order - 1.0));
        for row in 0..POINTS - k {
            for i in 0..size {
                table[row][i] = table[row + 1][i] - table[row][i];
            }
        }
        let deviation = |i: usize| {
            let squares: f64 = table[..POINTS - k].iter().map(|values| values[i] * values[i]).sum();
            (gamma * squares / (POINTS - k) as f64).sqrt()
        };
        orders.push((0..size).map(deviation).collect());
    }
    // A smooth function shows in the lower differences: each falls far below the one before. What does not fall is noise.
    let length = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>().sqrt();
    let falls = |higher: &[f64], lower: &[f64]| length(higher) < DECAY * length(lower);
    let [.., third, fourth, fifth] = &orders[..] else { return Ok(vec![0.0; size]) };
    Ok(match (falls(fourth, third), falls(fifth, fourth)) {
        (true, true) => vec![0.0; size],
        (true, false) => (0..size).map(|i| fourth[i].max(fifth[i])).collect(),
        (false, _) => (0..size).map(|i| third[i].max(fourth[i]).max(fifth[i])).collect(),
    })
}
