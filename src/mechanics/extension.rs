//! The extension E of the bodies: which nodes support too little of a body, and follow others.

use crate::aggregation::{Extension, Occupied, Pieces};
use crate::grid::indices;
use crate::mechanics::sweep::Connectivity;
use crate::parallel;
use crate::particles::Particles;
use crate::tensor::identity;
use rustc_hash::FxHashMap;

/// Upper bound of the length of a particle's domain, in cells. Material need not fill the domain of a particle that is stretched further.
const LONGEST: f64 = 2.0;

/// The extension E of the bodies in a grid, from the volumes of the particles at the last grid reset. A particle fills the cells that its domain overlaps.
/// The filled share of a cell thus changes gradually as particles move into the cell. A cell that holds no particle counts as empty.
pub(crate) fn extension<const D: usize>(
    pieces: Pieces,
    particles: &Particles<D>,
    connectivity: &Connectivity<D>,
) -> Extension {
    let parts = (0..connectivity.field_count()).map(|field| of_field(field, pieces, particles, connectivity));
    Extension::joined(pieces.degree, parts)
}

/// The extension of one nodal field, and the number of its first node.
fn of_field<const D: usize>(
    field: u32,
    pieces: Pieces,
    particles: &Particles<D>,
    connectivity: &Connectivity<D>,
) -> (usize, Extension) {
    let (grid, reference) = (connectivity.grid(), particles.reference());
    let in_field = |p: usize| connectivity.field_of(particles.body[p]) == field;
    let local = |p: usize, k: usize| grid.axis(k).local(reference.position[p][k]).unwrap_or(0.0);
    // The domain is a box. At F = I the box is a cube of the particle's volume. Its edge along axis k grows with |row k of F|.
    let domain = particles.parts.everywhere(connectivity.processes(), |p| {
        let f = identity::<f64, D>() + reference.displacement_gradient(p);
        let side = (particles.volume[p] / grid.spacing.powi(D as i32)).powf(1.0 / D as f64);
        let edges = std::array::from_fn::<_, 3, _>(|k| if k < D { (side * f.row(k).norm()).min(LONGEST) } else { 0.0 });
        [reference.volume(p), edges[0], edges[1], edges[2]]
    });
    // The cells of the particles, and the volumes in all cells that their domains overlap.
    let add = |p: usize, own: &mut Vec<[u32; D]>, volumes: &mut FxHashMap<[u32; D], f64>| {
        let cell = std::array::from_fn(|k| pieces.cell(local(p, k), grid.cells[k]));
        if own.last() != Some(&cell) {
            own.push(cell);
        }
        let [whole, edges @ ..] = domain(p);
        let along: [_; D] = std::array::from_fn(|k| pieces.overlaps(local(p, k), edges[k], grid.cells[k]));
        for which in indices::<D>(std::array::from_fn(|k| along[k].len() as u64)) {
            let parts: [(u32, f64); D] = std::array::from_fn(|k| along[k][which[k] as usize]);
            let volume = volumes.entry(parts.map(|(cell, _)| cell)).or_insert(0.0);
            *volume += whole * parts.iter().map(|(_, part)| part).product::<f64>();
        }
    };
    let parts = parallel::collect(parallel::parts(particles.len()), &|part| {
        let (mut own, mut volumes) = (Vec::new(), FxHashMap::default());
        part.filter(|&p| particles.is_solid(p) && in_field(p)).for_each(|p| add(p, &mut own, &mut volumes));
        (own, volumes)
    });
    let mut volumes: FxHashMap<[u32; D], f64> =
        parts.iter().flat_map(|(own, _)| own).map(|&cell| (cell, 0.0)).collect();
    // A cell takes its volumes in the order of the parts.
    for (cell, more) in parts.into_iter().flat_map(|(_, volumes)| volumes) {
        if let Some(volume) = volumes.get_mut(&cell) {
            *volume += more;
        }
    }
    let share = |(cell, volume): (&[u32; D], &f64)| {
        let whole: f64 = (0..D).map(|k| grid.spacing * pieces.within(cell[k], grid.cells[k])).product();
        (padded(*cell), volume / whole)
    };
    let range = connectivity.nodes_of(field);
    let of_field = connectivity.active().ids().skip(range.start).take(range.len());
    let nodes: Vec<[u32; 3]> = of_field.map(|id| padded(grid.index(id))).collect();
    let cells = volumes.iter().map(share).collect();
    let occupied = Occupied { dimension: D, grid: padded(grid.cells), nodes: &nodes, cells };
    (range.start, Extension::new(pieces, &occupied))
}

/// The index with zeros for axes that do not exist.
pub(crate) fn padded<const D: usize>(index: [u32; D]) -> [u32; 3] {
    std::array::from_fn(|k| index.get(k).copied().unwrap_or(0))
}
