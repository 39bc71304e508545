//! Vectors in a scene: lists of numbers, one for each dimension.

use crate::problems::Problems;
use crate::tensor::Vector;

/// Checks a direction. The largest component must lie between 1e-100 and 1e100 in size, so that the length is finite and not zero.
pub(super) fn check_normal(problems: &mut Problems, path: &str, normal: &[f64], dimension: usize) -> bool {
    if !problems.vector(path, normal, dimension) {
        return false;
    }
    let largest = normal.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let ok = largest >= 1e-100;
    problems.require(ok, path, "the zero vector", "must have a direction");
    ok
}

/// The components as a vector; `None` unless there are `D`.
pub(super) fn vector<const D: usize>(components: &[f64]) -> Option<Vector<f64, D>> {
    (components.len() == D).then(|| Vector::from_column_slice(components))
}
