//! The assignment of particles to lanes and windows, and the bytes stored for them.

use super::*;

/// The number of windows of each kind (nodes along each axis, particles).
fn windows<const D: usize>(cells: [u32; D], per_axis: u32) -> Vec<([usize; 3], usize, usize)> {
    let (grid, positions) = regular(cells, per_axis);
    let (connectivity, _) = Connectivity::new(&Approximation::from(Linear), &grid, &positions).unwrap();
    let mut all = connectivity.windows();
    all.sort_unstable();
    all.chunk_by(|a, b| a == b).map(|same| (same[0].0, same[0].1, same.len())).collect()
}

#[test]
fn a_regular_layout_fills_the_vector_lanes() {
    // Eight particles per cell, 2×2×2 nodes; four per cell, two adjacent cells; two per cell, four adjacent cells.
    assert_eq!(windows([6, 5, 4], 2), [([2, 2, 2], 8, 120)]);
    assert_eq!(windows([32, 20], 2), [([3, 2, 1], 8, 320)]);
    assert_eq!(windows([64], 2), [([5, 1, 1], 8, 16)]);
    // One particle per cell: adjacent cells of at most six nodes, in one row of one block (32 cells in 1D, 16 in 2D, 4 in 3D).
    assert_eq!(windows([64], 1), [([3, 1, 1], 2, 2), ([6, 1, 1], 5, 12)]);
    assert_eq!(windows([32, 3], 1), [([2, 2, 1], 1, 6), ([6, 2, 1], 5, 18)]);
    assert_eq!(windows([8, 2, 2], 1), [([5, 2, 2], 4, 8)]);
    // Nine or more in a cell: a group of eight, and the rest.
    assert_eq!(windows([3, 1], 3), [([2, 2, 1], 1, 3), ([2, 2, 1], 8, 3)]);
    assert_eq!(windows([2], 9), [([2, 1, 1], 1, 2), ([2, 1, 1], 8, 2)]);
    // Cells apart do not share a window.
    let grid = Grid::<1> { origin: Vector::zeros(), spacing: 1.0, cells: [64] };
    let apart = [0.5, 2.5, 3.5].map(|x| Vector::from([x]));
    let (connectivity, _) = Connectivity::new(&Approximation::from(Linear), &grid, &apart).unwrap();
    assert_eq!(connectivity.windows(), [([2, 1, 1], 1), ([3, 1, 1], 2)]);
    let (plain, _) = Connectivity::plain(&Approximation::from(Linear), &grid, &apart).unwrap();
    assert!(plain.windows().is_empty());
}

fn bytes_are_those_of_the_arrays<const D: usize>() -> Result<(), Failure> {
    let (grid, positions) = regular([3; D], 2);
    let (plain, _) = Connectivity::plain(&Approximation::from(Linear), &grid, &positions)?;
    let entries: usize = (0..positions.len()).map(|p| plain.of(p).count()).sum();
    // An entry is a node, N and ∇N. Each particle stores its position in memory and the start of its entries.
    assert_eq!(plain.bytes(), entries * (4 + 8 + 8 * D) + 4 * positions.len() + 8 * (positions.len() + 1));
    // Weights of every window, eight lanes wide; the particles of each lane; a slot of each particle; the nodes three times.
    let (tiled, nodes) = Connectivity::new(&Approximation::from(Linear), &grid, &positions)?;
    let windows = tiled.windows();
    let weights: usize = windows.iter().map(|(width, _)| 2 * 64 * width[..D].iter().sum::<usize>()).sum();
    let least = weights + windows.len() * (8 * 4 + 12) + 4 * positions.len() + 12 * nodes.len();
    assert!((least..least + 512).contains(&tiled.bytes()), "{} for at least {least}", tiled.bytes());
    Ok(())
}

fn frozen_bytes_are_those_of_the_tangent<const D: usize>(law: &Material) -> Result<(), Failure> {
    let (grid, positions) = regular([3; D], 2);
    let shape = Approximation::from(Linear);
    let (tiled, _) = Connectivity::new(&shape, &grid, &positions)?;
    let (plain, _) = Connectivity::plain(&shape, &grid, &positions)?;
    let mut particles = Particles::default();
    positions.iter().for_each(|&x| particles.push(x, Vector::zeros(), 1.0, 1.0, 0));
    // A, the upper triangle of B, κ and q; also b and c if the law has them; 𝔸 itself without a closed form.
    let triangle = D * (D + 1) / 2;
    let closed = law.closed(&identity(), &MaterialState::new(Tensor::<f64, D>::zeros()), 1.0).ok_or("a closed form")?;
    let ClosedTangent { factors, .. } = closed;
    let numbers = D * D + triangle + 2 + if factors.is_some() { 2 * triangle } else { 0 };
    let (bodies, general) = ([body(law.clone())], [body(Watched::unlisted(law.clone(), false))]);
    // Eight lanes per group, full or not.
    let lanes = 8 * tiled.windows().len();
    assert_eq!(tangent_bytes(&particles, &bodies, &tiled, false), lanes * numbers * 8, "{D}D {law:?}");
    assert_eq!(tangent_bytes(&particles, &general, &tiled, false), lanes * D.pow(4) * 8, "{D}D {law:?} by ℂmat");
    let lanes = 8 * positions.len().div_ceil(8);
    assert_eq!(tangent_bytes(&particles, &bodies, &plain, false), lanes * numbers * 8);
    Ok(())
}

#[test]
fn bytes_are_counted_as_they_are_stored() -> Result<(), Failure> {
    bytes_are_those_of_the_arrays::<1>()?;
    bytes_are_those_of_the_arrays::<2>()?;
    bytes_are_those_of_the_arrays::<3>()?;
    for law in closed_laws(Lame::new(1.0, 1.0)?) {
        frozen_bytes_are_those_of_the_tangent::<1>(&law)?;
        frozen_bytes_are_those_of_the_tangent::<2>(&law)?;
        frozen_bytes_are_those_of_the_tangent::<3>(&law)?;
    }
    Ok(())
}
