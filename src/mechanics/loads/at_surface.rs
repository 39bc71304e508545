//! The points at which shape functions of loaded surface points are evaluated, and the offsets that continue them to the surface.

use super::Loads;
use crate::approximation::AtSurface;
use crate::grid::Grid;
use crate::mechanics::sweep::Points;
use crate::particles::Particles;
use crate::shape::SURFACE_DEPTH;
use crate::tensor::{Vector, cofactor, identity};
use std::collections::{BTreeMap, HashMap};

/// Distances that differ relatively by less than this count as equal, so that rounding does not choose the nearest particle.
const SAME: f64 = 1e-6;

/// The evaluation points of all particles, with loaded surface points continued to the surface. Surface points lie slightly below the
/// surface (by `SURFACE_DEPTH`), in the cell of the body.
pub(crate) fn at_surface_points<'a, const D: usize>(
    mut points: Points<'a, D>,
    particles: &Particles<D>,
    loads: &Loads<D>,
    grid: &Grid<D>,
    at_surface: AtSurface<'_>,
) -> Points<'a, D> {
    let reference = particles.reference();
    let of_surface = loads.surface.iter().flat_map(|load| &load.points).chain(&loads.contacts.points);
    let on_surface: BTreeMap<u32, Vector<f64, D>> = of_surface
        .filter(|point| !particles.is_solid(point.particle))
        .map(|point| {
            let f = identity::<f64, D>() + reference.displacement_gradient(point.particle);
            let normal = cofactor(&f) * point.normal;
            let outward = normal.try_normalize(0.0).unwrap_or(normal);
            (point.particle as u32, reference.position[point.particle] + outward * (SURFACE_DEPTH * grid.spacing))
        })
        .collect();
    let below: HashMap<u32, Vector<f64, D>> = match at_surface {
        AtSurface::NearestParticle if !on_surface.is_empty() => nearest(particles, grid, on_surface.keys().copied()),
        _ => HashMap::new(),
    };
    for (&p, x) in &below {
        points.positions.to_mut()[p as usize] = *x;
    }
    points.extrapolation = on_surface.into_iter().map(|(p, x)| (p, x - points.positions[p as usize])).collect();
    points
}

/// For each point, the mean position of the nearest particles of its body, among particles at most a cell away. A point without such
/// particles has no entry.
fn nearest<const D: usize>(
    particles: &Particles<D>,
    grid: &Grid<D>,
    points: impl Iterator<Item = u32> + Clone,
) -> HashMap<u32, Vector<f64, D>> {
    let position = particles.reference().position;
    let cell = |p: usize| grid.cell(&position[p]).unwrap_or([0; D]);
    let around = |p: usize| grid.around(cell(p), 1).map(|cell| grid.id(cell));
    let mut beside: HashMap<u64, Vec<u32>> = HashMap::new();
    points.clone().flat_map(|p| around(p as usize)).for_each(|cell| _ = beside.entry(cell).or_default());
    for p in (0..particles.len()).filter(|&p| particles.is_solid(p)) {
        beside.entry(grid.id(cell(p))).and_modify(|list| list.push(p as u32));
    }
    let mut found = HashMap::new();
    for point in points {
        let (own, x) = (particles.body[point as usize], position[point as usize]);
        let of_body = |q: &&u32| particles.body[**q as usize] == own;
        let near: Vec<(f64, u32)> = around(point as usize)
            .flat_map(|cell| beside.get(&cell).into_iter().flatten().filter(of_body))
            .map(|&q| ((position[q as usize] - x).norm(), q))
            .collect();
        let least = near.iter().map(|(distance, _)| *distance).fold(f64::INFINITY, f64::min);
        let same: Vec<_> = near.into_iter().filter(|(distance, _)| *distance <= least * (1.0 + SAME)).collect();
        if !same.is_empty() {
            let sum: Vector<f64, D> = same.iter().map(|(_, q)| position[*q as usize]).sum();
            found.insert(point, sum / same.len() as f64);
        }
    }
    found
}
