//! Compression to J = 1e-6, stretch and shear of 1e3, rotation by any angle; and deformations that no body can have.

use super::points::{Errors, Rounding, judge, laws};
use super::strains::ROUNDINGS;
use super::{Outcome, SOLVABLE, refused, rows};
use crate::check::regime::rotation;
use crate::random::Random;
use crate::report::{Bound, Report};
use bfree::material::{MaterialState, NonPositiveJacobian};
use bfree::tensor::{Tensor, determinant, identity};
use std::f64::consts::PI;

pub(super) fn run(outcome: &mut Outcome) {
    let columns = ["quantity", "beforehand", "law", "D", "deformation", "case"];
    let mut report = Report::new(
        "large deformations: roundings, in eps, that the errors of W and S amount to",
        &columns,
    )
    .as_matrix(&[0, 1], 4, 5);
    dimension::<1>(&mut report);
    dimension::<2>(&mut report);
    dimension::<3>(&mut report);
    report.note("Along the axes F is exact, and an error is judged by a rounding of each of its entries. Where it is turned, and under shear, by");
    report
        .note("eps |H| |dS/dH|; where it is stretched and turned, by eps of the products in det F too, which cancel.");
    outcome.reports.push(report);

    let mut report = rows("deformations no body can have: answers that are not a refusal");
    impossible::<1>(&mut report);
    impossible::<2>(&mut report);
    impossible::<3>(&mut report);
    outcome.reports.push(report);
}

fn dimension<const D: usize>(report: &mut Report) {
    let mut push = |deformation: &str, case: &str, h: &Tensor<f64, D>, rounding: Rounding| {
        for (name, law) in &laws() {
            let Errors { energy, stress, .. } = judge::<D>(law, h, rounding);
            for (quantity, value) in [("W", energy), ("S", stress)] {
                let labels = [quantity, SOLVABLE, name, &D.to_string(), deformation, case];
                report.push(&labels, value, Bound::AtMost(ROUNDINGS));
            }
        }
    };
    let mut random = Random::new(53);
    let along = |stretch: f64, axes: usize| {
        Tensor::<f64, D>::from_fn(|i, k| if i == k && i < axes { stretch - 1.0 } else { 0.0 })
    };
    let turn = |h: &Tensor<f64, D>, random: &mut Random| {
        let (q, r) = (rotation::<D>(random), rotation::<D>(random));
        q * (identity::<f64, D>() + h) * r - identity::<f64, D>()
    };
    for exponent in 1..=6 {
        let jacobian = 10.0_f64.powi(-exponent);
        let case = format!("J = 1e-{exponent}");
        push("compressed along x", &case, &along(jacobian, 1), Rounding::Entries);
        push("compressed from all sides", &case, &along(jacobian.powf(1.0 / D as f64), D), Rounding::Entries);
        if D > 1 {
            push("compressed and turned", &case, &turn(&along(jacobian, 1), &mut random), Rounding::Displacement);
        }
    }
    for size in [10.0, 100.0, 1000.0] {
        let case = format!("{size}");
        push("stretched along x", &case, &along(size, 1), Rounding::Entries);
        push("stretched to all sides", &case, &along(size, D), Rounding::Entries);
        if D > 1 {
            push("stretched and turned", &case, &turn(&along(size, 1), &mut random), Rounding::Products);
            let mut shear = Tensor::zeros();
            shear[(0, D - 1)] = size;
            push("sheared", &case, &shear, Rounding::Displacement);
            push("sheared and turned", &case, &turn(&shear, &mut random), Rounding::Displacement);
        }
    }
    if D > 1 {
        for (name, strain) in [("rotated", 0.0), ("rotated, strain 1e-6", 1e-6), ("rotated, strain 1e-12", 1e-12)] {
            for twelfth in 1..=24 {
                let angle = PI * f64::from(twelfth) / 12.0;
                let strained = identity::<f64, D>() + random.tensor::<D>() * strain;
                let h = plane_rotation::<D>(angle) * strained - identity::<f64, D>();
                push(name, &format!("{twelfth} pi/12"), &h, Rounding::Displacement);
            }
        }
    }
}

/// A rotation by `angle` from the first axis to the last one.
fn plane_rotation<const D: usize>(angle: f64) -> Tensor<f64, D> {
    let (sin, cos) = angle.sin_cos();
    let mut q = identity::<f64, D>();
    (q[(0, 0)], q[(D - 1, D - 1)]) = (cos, cos);
    (q[(0, D - 1)], q[(D - 1, 0)]) = (-sin, sin);
    q
}

/// F with det F ≤ 0, or with entries that are not finite, by kind.
pub(super) fn bad<const D: usize>() -> Vec<(&'static str, Vec<Tensor<f64, D>>)> {
    let first = |stretch: f64| {
        let mut f = identity::<f64, D>();
        f[(0, 0)] = stretch;
        f
    };
    let mut random = Random::new(59);
    let mirrored = (0..50).map(|_| {
        loop {
            let f = random.tensor::<D>() * 2.0;
            if determinant(&f) < -0.01 {
                return f;
            }
        }
    });
    vec![
        ("det F = 0", vec![first(0.0), Tensor::zeros()]),
        ("det F = -1e-6 .. -1e3", [1e-6, 1e-3, 1.0, 1e3].map(|x| first(-x)).into()),
        // J² = det C > 0: a code that used C would accept these.
        ("mirrored, det C > 0", mirrored.collect()),
        ("not a number", vec![first(f64::NAN), Tensor::from_element(f64::NAN)]),
        ("infinite", vec![first(f64::INFINITY), first(f64::NEG_INFINITY)]),
    ]
}

fn impossible<const D: usize>(report: &mut Report) {
    for (case, list) in bad::<D>() {
        let answers = list.iter().map(|f| MaterialState::new(f - identity::<f64, D>()).admissible());
        let what = format!("one point, D = {D}");
        refused(report, &what, case, "NonPositiveJacobian", answers, |NonPositiveJacobian { det_f }| {
            // The error must state the cause: not positive, or not finite.
            !(*det_f > 0.0 && det_f.is_finite())
        });
    }
}
