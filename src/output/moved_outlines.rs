//! The outlines of bodies in the plane, moved by the particles near them, for pictures: `bodies_*.vtu`.

use super::Reference;
use super::fields::padded;
use super::vtu::{Array, Snapshot};
use super::vtu_writer::Head;
use crate::particles::Particles;
use crate::tensor::{Vector, identity};

/// The largest number of particles that pictures show as cells. More particles are drawn as discs, and need no outline.
pub(crate) const MAX_CELLS: usize = 20_000;

/// Particles that are farther from a corner than the nearest particle by this part of a grid spacing do not move the corner.
const REACH: f64 = 0.5;

/// A closed line around a body, or around a hole in it.
#[derive(Debug)]
struct Line<const D: usize> {
    body: u32,
    /// The particles that move each corner.
    corners: Vec<Vec<Part<D>>>,
}

/// The part of a particle in the motion of a corner X of the undeformed body: its id, its weight w, and X − X_p. The position of the corner
/// is Σ w (x + F (X − X_p)), the mean of the linear motions of particles near it.
type Part<const D: usize> = (u32, f64, Vector<f64, D>);

/// The outlines of all bodies.
#[derive(Debug)]
pub(crate) struct MovedOutlines<const D: usize>(Vec<Line<D>>);

impl<const D: usize> MovedOutlines<D> {
    /// The outlines of the bodies of `particles`; `None` if they have none, or need none.
    pub(crate) fn of(particles: &Particles<D>, reference: &Reference<D>, spacing: f64) -> Option<Self> {
        let solid: Vec<usize> = (0..particles.len()).filter(|&p| particles.is_solid(p)).collect();
        if particles.outlines.is_empty() || solid.len() > MAX_CELLS {
            return None;
        }
        let lines = particles.outlines.iter().map(|outline| {
            let of_body = solid.iter().filter(|&&p| particles.body[p] == outline.body);
            let mut near: Vec<(u32, Vector<f64, D>)> = of_body
                .map(|&p| particles.id[p])
                .filter_map(|id| Some((id, *reference.position.get(id as usize)?)))
                .collect();
            // After a restart, the particles lie in another order.
            near.sort_unstable_by_key(|(id, _)| *id);
            let corners = outline.corners.iter().map(|at| parts(at, &near, REACH * spacing)).collect();
            Line { body: outline.body, corners }
        });
        Some(Self(lines.collect()))
    }

    /// The outlines at the time of `head`, as segments in the order of the lines.
    pub(crate) fn at(&self, particles: &Particles<D>, head: &Head) -> Snapshot {
        let places = particles.places();
        let (mut points, mut bodies) = (Vec::new(), Vec::new());
        for line in &self.0 {
            let corners: Vec<[f64; 3]> = line.corners.iter().map(|corner| moved(corner, particles, &places)).collect();
            let next = corners.iter().cycle().skip(1);
            points.extend(corners.iter().zip(next).flat_map(|(from, to)| [*from, *to]));
            bodies.resize(points.len(), f64::from(line.body));
        }
        let arrays = vec![Array::scalar("body", bodies, true)];
        Snapshot { time: head.time, background: head.background, points, arrays, corners: 2 }
    }
}

/// The parts in the motion of the corner X = `at` of some of the particles `near`: their ids and places X_p in the undeformed body.
fn parts<const D: usize>(at: &Vector<f64, D>, near: &[(u32, Vector<f64, D>)], reach: f64) -> Vec<Part<D>> {
    let nearest = near.iter().map(|(_, x)| (at - x).norm()).fold(f64::INFINITY, f64::min);
    // The weight falls to zero at the reach, so no corner jumps from one particle to another.
    let weight = |distance: f64| (1.0 - (distance / (nearest + reach)).powi(2)).max(0.0).powi(2);
    let weighted = near.iter().map(|(id, x)| (*id, weight((at - x).norm()), at - x));
    let mut parts: Vec<Part<D>> = weighted.filter(|(_, weight, _)| *weight > 0.0).collect();
    let sum: f64 = parts.iter().map(|(_, weight, _)| weight).sum();
    parts.iter_mut().for_each(|(_, weight, _)| *weight /= sum);
    parts
}

/// The position of a corner.
fn moved<const D: usize>(parts: &[Part<D>], particles: &Particles<D>, places: &[u32]) -> [f64; 3] {
    let of = |(id, weight, from): &Part<D>| {
        let p = places[*id as usize] as usize;
        let f = identity::<f64, D>() + particles.displacement_gradient[p];
        (particles.position[p] + f * from) * *weight
    };
    padded(&parts.iter().map(of).sum::<Vector<f64, D>>())
}
