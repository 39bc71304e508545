//! A check of columns by extrapolated differences. It stands in for the shipped one, so that these tests depend on diagnosis alone.

use std::collections::BTreeMap;
use tangent_check::finding::{Finding, Reason, Verdict};
use tangent_check::matrix::Matrix;
use tangent_check::roads::Perturbation;

/// Measured tangents by the name of their state. They do not depend on what is claimed.
pub type Known = BTreeMap<String, (Matrix, Matrix, bool)>;

/// Ridders' extrapolation of one kind of difference quotient; the ratio of its error from level to level is `base`.
fn extrapolated(quotients: &[Vec<f64>], base: f64, noise: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let rows = quotients[0].len();
    let mut best = (vec![f64::NAN; rows], vec![f64::INFINITY; rows]);
    for row in 0..rows {
        let mut above: Vec<f64> = Vec::new();
        for (level, quotient) in quotients.iter().enumerate() {
            let mut line = vec![quotient[row]];
            for order in 1..=level.min(5) {
                let factor = base.powi(order as i32);
                let next = (factor * line[order - 1] - above[order - 1]) / (factor - 1.0);
                let change = (next - line[order - 1]).abs().max((next - above[order - 1]).abs()).max(noise[level]);
                if change < best.1[row] {
                    (best.0[row], best.1[row]) = (next, change);
                }
                line.push(next);
            }
            above = line;
        }
    }
    best
}

/// Derivative and errors of one column, and whether both sides differ.
fn column(value: &[f64], k: usize, f: &mut Perturbation) -> (Vec<f64>, Vec<f64>, bool) {
    let mut quotients = [Vec::new(), Vec::new(), Vec::new()];
    let mut noise = Vec::new();
    let size = value.iter().fold(0.0_f64, |size, x| size.max(x.abs()));
    for level in 0..16 {
        let h = 0.02 * 0.5_f64.powi(level);
        let Ok([forward, backward]) = f(k, h).and_then(|a| Ok([a, f(k, -h)?])) else {
            continue;
        };
        let quotient = |a: &[f64], b: &[f64], h: f64| a.iter().zip(b).map(|(a, b)| (a - b) / h).collect::<Vec<f64>>();
        quotients[0].push(quotient(&forward, &backward, 2.0 * h));
        quotients[1].push(quotient(&forward, value, h));
        quotients[2].push(quotient(&backward, value, -h));
        // Rounding of F moves the stress by ε times the tangent.
        let tangent = quotients[0].last().unwrap().iter().fold(0.0_f64, |size, x| size.max(x.abs()));
        noise.push(4.0 * f64::EPSILON * size.max(tangent) / h);
    }
    let [central, forward, backward] = [4.0, 2.0, 2.0]
        .iter()
        .zip(&quotients)
        .map(|(base, q)| extrapolated(q, *base, &noise))
        .collect::<Vec<_>>()
        .try_into()
        .unwrap();
    let differ = |a: &(Vec<f64>, Vec<f64>), b: &(Vec<f64>, Vec<f64>)| {
        (0..value.len()).any(|row| (a.0[row] - b.0[row]).abs() > 10.0 * (a.1[row] + b.1[row]))
    };
    let kink = differ(&forward, &backward) || differ(&central, &forward);
    (central.0, central.1, kink)
}

/// Checks a claimed tangent. What is known of the state from before is not measured again.
pub fn check(known: &mut Known, name: &str, claimed: &Matrix, value: &[f64], f: &mut Perturbation) -> Finding {
    if !known.contains_key(name) {
        let mut measured = Matrix::zeros(claimed.rows, claimed.columns);
        let mut errors = measured.clone();
        let mut any_kink = false;
        for k in 0..claimed.columns {
            let (derivative, error, kink) = column(value, k, f);
            any_kink |= kink;
            for row in 0..claimed.rows {
                measured[(row, k)] = derivative[row];
                errors[(row, k)] = error[row];
            }
        }
        known.insert(name.to_string(), (measured, errors, any_kink));
    }
    let (measured, errors, kink) = known[name].clone();
    let deviates = |k: usize| {
        let deviation = (claimed.entries[k] - measured.entries[k]).abs();
        deviation.is_nan() || deviation > 10.0 * errors.entries[k]
    };
    let accurate = errors.greatest() < 1e-6 * measured.greatest();
    let (verdict, reason) = if kink || !accurate {
        (Verdict::NotChecked, Some(if kink { Reason::Kink } else { Reason::TooNoisy(errors.greatest()) }))
    } else if (0..claimed.entries.len()).any(deviates) {
        (Verdict::Wrong, None)
    } else {
        (Verdict::Consistent, None)
    };
    Finding {
        name: name.to_string(),
        verdict,
        reason,
        worst: None,
        deviation: 0.0,
        error: errors.greatest(),
        noise: 0.0,
        control: None,
        calls: 0,
        claimed: claimed.clone(),
        measured,
        errors,
    }
}
