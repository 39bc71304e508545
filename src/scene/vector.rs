//! Vectors in a scene: lists of numbers, one for each dimension.

use crate::problems::{Number, Problems};
use crate::tensor::Vector;

/// Checks a direction. The largest component must lie between 1e-100 and 1e100 in size, so that the length is finite and not zero.
pub(super) fn check_normal(problems: &mut Problems, path: &str, normal: &[f64], dimension: usize) -> bool {
    if !problems.vector(path, normal, dimension) {
        return false;
    }
    let largest = normal.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    problems.require(largest >= 1e-100, path, "the zero vector", "must have a direction")
}

/// Checks the axis of a rotation: needed in 3D, and not allowed in 2D.
pub(super) fn check_axis(problems: &mut Problems, path: &str, axis: Option<&[f64]>, dimension: usize) -> bool {
    let axis_path = format!("{path}.axis");
    match (axis, dimension) {
        (Some(axis), 3) => return check_normal(problems, &axis_path, axis, dimension),
        (None, 2) => return true,
        (None, 3) => problems.refuse(path, "a rotation without an axis", "give its \"axis\", a direction"),
        (Some(_), 2) => problems.refuse(&axis_path, "an axis", "in 2D it is z: remove it"),
        _ => problems.refuse(path, "a rotation", "a line has no directions to turn in"),
    }
    false
}

/// The components as a vector. There must be `D`, as in every scene that has passed its checks.
pub(super) fn vector<const D: usize>(components: &[f64]) -> Vector<f64, D> {
    Vector::from_column_slice(components)
}

/// The vector; `None` if it is not allowed, with the reason in `problems`.
pub(super) fn checked<const D: usize>(problems: &mut Problems, path: &str, x: &[f64]) -> Option<Vector<f64, D>> {
    problems.vector(path, x, D).then(|| vector(x))
}

/// The direction; `None` if it is not allowed, with the reason in `problems`.
pub(super) fn direction<const D: usize>(problems: &mut Problems, path: &str, n: &[f64]) -> Option<Vector<f64, D>> {
    check_normal(problems, path, n, D).then(|| vector(n))
}

/// The corners of a box, the lower one first; `None` if they are not allowed, with the reasons in `problems`.
pub(super) fn corners<const D: usize>(
    problems: &mut Problems,
    path: &str,
    min: &[f64],
    max: &[f64],
) -> Option<[Vector<f64, D>; 2]> {
    let lower = checked::<D>(problems, &format!("{path}.min"), min);
    let upper = checked::<D>(problems, &format!("{path}.max"), max);
    let (min, max) = (lower?, upper?);
    for k in 0..D {
        let allowed = format!("must be greater than min[{k}] = {}", Number(min[k]));
        problems.require(max[k] > min[k], &format!("{path}.max[{k}]"), Number(max[k]), allowed);
    }
    (0..D).all(|k| max[k] > min[k]).then_some([min, max])
}
