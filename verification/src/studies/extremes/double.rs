//! The reference itself: double-double arithmetic against identities and known digits.

use super::{rows, solvable, worse};
use crate::double_double::DoubleDouble;
use crate::random::Random;
use crate::report::Report;
use num_dual::DualNum;
use num_traits::One;
use std::convert::Infallible;
use twofloat::consts::{LN_10, SQRT_2};

/// The error of a dozen operations, each with a few rounding units.
const BOUND: f64 = 64.0 * DoubleDouble::EPSILON;

pub(super) fn run() -> Report {
    let mut report = rows("double-double arithmetic: errors relative to the result");
    let mut push =
        |what: &str, case: &str, error: f64| solvable(&mut report, what, case, Ok::<_, Infallible>(error), BOUND);
    let mut random = Random::new(41);
    let (mut quotient, mut root, mut product, mut near_one): (f64, f64, f64, f64) = (0.0, 0.0, 0.0, 0.0);
    for _ in 0..1000 {
        let (x, y) = (number(&mut random, 30.0), number(&mut random, 30.0));
        quotient = worse(quotient, difference(x * y / y, x));
        root = worse(root, difference(x.sqrt() * x.sqrt(), x));
        // The logarithms in this sum do not cancel.
        let (a, b) = (number(&mut random, 10.0) + 2.0, number(&mut random, 10.0) + 2.0);
        product = worse(product, difference((a * b).ln(), a.ln() + b.ln()));
        // ln(1 + x) − ln(1 − x) = ln((1 + x)/(1 − x)) = ln(1 + 2x/(1 − x)), for x below and above the switch.
        let (one, x) = (DoubleDouble::one(), DoubleDouble::from(0.9 * random.signed()));
        near_one = worse(near_one, difference(x.ln_1p() - (-x).ln_1p(), (x * 2.0 / (one - x)).ln_1p()));
    }
    push("(x y) / y = x", "1e-30 .. 1e30", quotient);
    push("sqrt(x)^2 = x", "1e-30 .. 1e30", root);
    push("ln(x y) = ln x + ln y", "2 .. 1e10", product);
    push("ln(1+x) - ln(1-x) = ln(1 + 2x/(1-x))", "-0.9 .. 0.9", near_one);
    push("ln 10", "known digits", difference(DoubleDouble::from(10.0).ln(), LN_10.into()));
    push("sqrt 2", "known digits", difference(DoubleDouble::from(2.0).sqrt(), SQRT_2.into()));
    let mut tiny: f64 = 0.0;
    for exponent in [-9, -12, -15, -40] {
        // The next term of the series is below the last digit.
        let x = DoubleDouble::from(10.0_f64.powi(exponent));
        let series = x - x * x / 2.0 + x * x * x / 3.0 - x * x * x * x / 4.0;
        tiny = worse(tiny, difference(x.ln_1p(), series));
    }
    push("ln(1+x) = x - x^2/2 + x^3/3 - x^4/4", "1e-40 .. 1e-9", tiny);
    report
}

/// A number between 10^−decades and 10^decades, with digits in both halves.
fn number(random: &mut Random, decades: f64) -> DoubleDouble {
    let size = 10.0_f64.powf(random.between(-decades, decades));
    DoubleDouble::from(size) + DoubleDouble::from(size * 1e-17 * random.signed())
}

fn difference(a: DoubleDouble, b: DoubleDouble) -> f64 {
    (a - b).magnitude() / b.magnitude()
}
