//! Steps for the laws, and the tensors of their formulas.

use tangent_check::convention::Tensor;
use tangent_check::law::Step;
use tangent_check::library::Signature;
use tangent_check::tensor::{IDENTITY, ZERO, product, rotation_about, sum, trace, transposed};

pub fn double_dot(a: &Tensor, b: &Tensor) -> f64 {
    trace(&product(a, &transposed(b)))
}

/// A turn about the axis (1, 2, 2)/3.
fn rotation(angle: f64) -> Tensor {
    rotation_about([1.0, 2.0, 2.0].map(|x| x * angle / 3.0))
}

/// A turn about the third axis, which stays in the plane.
fn plane_rotation(angle: f64) -> Tensor {
    let [sine, cosine] = [angle.sin(), angle.cos()];
    [[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]
}

/// λ tr E 1 + 2 μ E
pub fn hooke(λ: f64, μ: f64, strain: &Tensor) -> Tensor {
    sum(&sum(&ZERO, λ * trace(strain), &IDENTITY), 2.0 * μ, strain)
}

pub fn green_lagrange(f: &Tensor) -> Tensor {
    let difference = sum(&product(&transposed(f), f), -1.0, &IDENTITY);
    sum(&ZERO, 0.5, &difference)
}

/// A step with stretch, shear, rotation and a change of volume, in the plane or out of it. The strains belong to no deformation; a law reads
/// either them or F.
pub fn general_step(signature: &Signature, plane: bool) -> Step {
    let out = if plane { 0.0 } else { 1.0 };
    let gradient_before =
        [[1.05, 0.1, -0.03 * out], [0.02, 0.97, 0.04 * out], [0.01 * out, 0.05 * out, 1.0 + 0.02 * out]];
    let stretch = [[1.2, 0.15, 0.1 * out], [0.15, 0.9, -0.05 * out], [0.1 * out, -0.05 * out, 1.0 + 0.1 * out]];
    let turn = if plane { plane_rotation } else { rotation };
    Step {
        time: 0.25,
        length: 0.5,
        number: 3,
        gradient_before,
        gradient: product(&turn(0.6), &stretch),
        strain: [[3e-3, 1e-3, -2e-3 * out], [1e-3, -1e-3, 5e-4 * out], [-2e-3 * out, 5e-4 * out, 1e-3 * out]],
        strain_increment: [[4e-3, 3e-3, 1e-3 * out], [3e-3, -2e-3, 2e-3 * out], [1e-3 * out, 2e-3 * out, 1e-3 * out]],
        rotation: turn(0.3),
        stress: vec![0.0; signature.convention.stress.pairs.len()],
        state: signature.state_at_rest.clone(),
    }
}

pub fn assert_close(found: &[f64], wanted: &[f64], tolerance: f64, what: &str) {
    assert_eq!(found.len(), wanted.len(), "{what}");
    let greatest = |numbers: &[f64]| numbers.iter().fold(0.0, |greatest: f64, number| greatest.max(number.abs()));
    let differences: Vec<f64> = found.iter().zip(wanted).map(|(found, wanted)| found - wanted).collect();
    let relative = greatest(&differences) / greatest(wanted);
    assert!(relative <= tolerance, "{what}: off by {relative:e}\n{found:?}\n{wanted:?}");
}
