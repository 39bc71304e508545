//! The hat functions of a cell.

use crate::tensor::Vector;

/// The index of each corner of a cell.
pub(super) fn nodes_of<const D: usize>(index: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..1_u32 << D).map(move |corner| std::array::from_fn(|k| index[k] + (corner >> k & 1)))
}

/// The corners of a cell, each with its hat function and the gradient of this function at a place in the cell. Lengths are in cells.
pub(super) fn corners<const D: usize>(
    index: [u32; 3],
    place: [f64; 3],
) -> impl Iterator<Item = ([u32; 3], f64, Vector<f64, D>)> {
    let local: [f64; D] = std::array::from_fn(|k| (place[k] - f64::from(index[k])).clamp(0.0, 1.0));
    nodes_of::<D>(index).map(move |node| {
        let upper = |k: usize| node[k] > index[k];
        let hat = |k: usize| if upper(k) { local[k] } else { 1.0 - local[k] };
        let slope = |k: usize| {
            let others: f64 = (0..D).filter(|&other| other != k).map(hat).product();
            if upper(k) { others } else { -others }
        };
        (node, (0..D).map(hat).product(), Vector::from_fn(|k, _| slope(k)))
    })
}
