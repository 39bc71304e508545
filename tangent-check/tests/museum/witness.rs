//! A plain central difference. It shares no code with the checker, and has a tolerance.

use crate::algebra::{ORDER, vector};
use tangent_check::convention::{Measure, Tensor};
use tangent_check::law::{Law, Step};
use tangent_check::matrix::Matrix;
use tangent_check::tensor::{IDENTITY, ZERO, determinant, from_entries, inverse, norm, product, sum, transposed};

const STEP: f64 = 1e-5;

/// The columns [f(k, h) − f(k, −h)]/2h.
pub fn columns(rows: usize, columns: usize, f: &mut dyn FnMut(usize, f64) -> Vec<f64>) -> Matrix {
    let mut measured = Matrix::zeros(rows, columns);
    for column in 0..columns {
        let (plus, minus) = (f(column, STEP), f(column, -STEP));
        for row in 0..rows {
            measured[(row, column)] = (plus[row] - minus[row]) / (2.0 * STEP);
        }
    }
    measured
}

/// max |claimed − measured| / max |measured|, and its row and column.
pub fn worst(claimed: &Matrix, measured: &Matrix) -> (f64, usize, usize) {
    let mut worst = (0.0, 0, 0);
    for row in 0..measured.rows {
        for column in 0..measured.columns {
            let deviation = (claimed[(row, column)] - measured[(row, column)]).abs() / measured.greatest();
            if deviation.is_nan() || deviation > worst.0 {
                worst = (deviation, row, column);
            }
        }
    }
    worst
}

/// The largest deviation of a law's tangent in a step.
pub fn law(law: &mut dyn Law, step: &Step) -> (f64, usize, usize) {
    let claimed = law.respond(step).expect("a response").tangent;
    let measured = columns(6, 6, &mut |column, h| change(law, step, column, h));
    worst(&claimed, &measured)
}

/// The stress whose derivative is the law's tangent, moved by h along a component of the strain.
fn change(law: &mut dyn Law, step: &Step, column: usize, h: f64) -> Vec<f64> {
    let unit = strain(column);
    match law.convention().measure {
        Measure::CauchyByStrain => {
            let strain_increment = sum(&step.strain_increment, h, &unit);
            stress(law, &Step { strain_increment, ..step.clone() })
        }
        Measure::SecondPiolaByGreen => {
            // F' = R' U' with any R', as S depends on C alone: Fᵀ F + 2 h B = F'ᵀ F'.
            let c = sum(&product(&transposed(&step.gradient), &step.gradient), 2.0 * h, &unit);
            stress(law, &Step { gradient: root(&c), ..step.clone() })
        }
        Measure::JaumannKirchhoff | Measure::Truesdell => {
            let before = step.gradient;
            let stretch = sum(&sum(&IDENTITY, h, &unit), 0.5 * h * h, &product(&unit, &unit));
            let gradient = product(&stretch, &before);
            let growth = determinant(&gradient) / determinant(&before);
            let moved = stress(law, &Step { gradient, ..step.clone() });
            let tensor = crate::algebra::symmetric_tensor(&moved);
            match law.convention().measure {
                Measure::Truesdell => {
                    let back = inverse(&stretch).expect("a stretch");
                    vector(&product(&product(&back, &scale(growth, &tensor)), &back))
                }
                _ => vector(&scale(growth, &tensor)),
            }
        }
        other => panic!("no law of the museum has {other:?}"),
    }
}

fn scale(factor: f64, a: &Tensor) -> Tensor {
    a.map(|row| row.map(|entry| factor * entry))
}

fn stress(law: &mut dyn Law, step: &Step) -> Vec<f64> {
    law.respond(step).expect("a response").stress
}

/// ½ (e_i ⊗ e_j + e_j ⊗ e_i): engineering shear 1.
fn strain(column: usize) -> Tensor {
    let (i, j) = ORDER[column];
    let mut unit = ZERO;
    unit[i][j] += 0.5;
    unit[j][i] += 0.5;
    unit
}

/// √C by Newton's iteration.
fn root(c: &Tensor) -> Tensor {
    let mut root = IDENTITY;
    for _ in 0..30 {
        let other = product(&inverse(&root).expect("a root"), c);
        root = from_entries(|i, j| 0.25 * (root[i][j] + root[j][i] + other[i][j] + other[j][i]));
    }
    assert!(norm(&sum(&product(&root, &root), -1.0, c)) < 1e-12);
    root
}
