//! Contacts of bodies in a step, with walls and with each other, for reports. `mechanics::reference` decides on resets.

use super::Simulation;
use crate::approximation::ShapeFunction;
use crate::material::{Law, p_wave_modulus};
use crate::mechanics::sweep::Connectivity;
use crate::tensor::{Tensor, Vector};
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// Particles with |N| below this value do not contribute to a node.
const NO_PART: f64 = 1e-9;

/// Number of cells over which the gap between two bodies is searched.
const FARTHEST: u32 = 4;

/// The mean normal stress across an interface is a tension above this share of the mean stress there.
const TENSION: f64 = 0.1;

/// The strain below which a stress counts as zero.
const NO_STRAIN: f64 = 1e-6;

/// Distance in spacings between the centroids of both sides of an interface, below which its normal is undefined.
const ENCLOSED: f64 = 0.25;

/// Two bodies that share nodes, at the end of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedNodes {
    /// Numbers of the bodies, the lower one first.
    pub bodies: [u32; 2],
    /// The smallest distance between the surfaces, in grid spacings: the distance of the two nearest particles less half of both widths.
    /// `None` from four spacings on.
    pub gap: Option<f64>,
    /// The mean normal stress between the bodies where it is a tension (force per area): the shared nodes hold the bodies together. `None`
    /// under pressure, at rest, and where one body encloses the other.
    pub tension: Option<f64>,
}

/// The particles of each of two bodies that contribute to shared nodes.
type Interface = [BTreeSet<usize>; 2];

/// The present volume, and the stress if there is one, of particles at shared nodes.
type States<const D: usize> = BTreeMap<usize, (f64, Option<Tensor<f64, D>>)>;

impl<const D: usize, L: Law, A: ShapeFunction> Simulation<D, L, A> {
    /// All pairs of bodies that share nodes.
    pub(crate) fn shared_nodes(&self, connectivity: &Connectivity<D>) -> Vec<SharedNodes> {
        let (interfaces, particles) = (self.interfaces(connectivity), &self.particles);
        let places: BTreeSet<usize> = interfaces.values().flatten().flatten().copied().collect();
        let state = |p| (particles.present_volume(p), self.cauchy_stress(p).ok());
        let states = particles.parts.of_some(connectivity.processes(), places.iter().copied(), state);
        let states = places.into_iter().zip(states).collect();
        let of = |(bodies, sides)| SharedNodes {
            bodies,
            gap: self.gap(&sides, &states),
            tension: self.tension(bodies, &sides, &states),
        };
        interfaces.into_iter().map(of).collect()
    }

    /// The particles that contribute to nodes of another body, by pairs of bodies.
    fn interfaces(&self, connectivity: &Connectivity<D>) -> BTreeMap<[u32; 2], Interface> {
        let mut found: BTreeMap<[u32; 2], Interface> = BTreeMap::new();
        // Bodies of different fields share no nodes.
        let fields: BTreeSet<u32> = self.bodies.iter().map(|body| body.field).collect();
        if fields.len() == self.bodies.len() {
            return found;
        }
        let (particles, processes) = (&self.particles, connectivity.processes());
        let solid = || connectivity.own_particles().filter(|&p| particles.is_solid(p));
        let nodes = |p: usize| connectivity.of(p).filter(|(_, n, _)| n.abs() > NO_PART).map(|(node, ..)| node);
        // The lowest and the highest body at each node.
        let mut span = vec![[u32::MAX, 0]; connectivity.nodes()];
        for p in solid() {
            let own = particles.body[p];
            nodes(p).for_each(|node| span[node] = [span[node][0].min(own), span[node][1].max(own)]);
        }
        let reached = (0..).zip(&span).filter(|(_, [low, high])| low <= high);
        let (reached, _) = processes.joined(reached.map(|(node, &[low, high])| [node, low, high]).collect());
        for [node, low, high] in reached {
            let [lowest, highest] = &mut span[node as usize];
            (*lowest, *highest) = (low.min(*lowest), high.max(*highest));
        }
        // The particles at nodes of several bodies, body by body.
        let at_shared = |p: usize| {
            let at_nodes = nodes(p).filter(|&node| span[node][0] < span[node][1]);
            at_nodes.map(move |node| [node as u64, p as u64])
        };
        let (at_shared, _) = processes.joined(solid().flat_map(at_shared).collect());
        let mut shared: BTreeMap<u64, BTreeMap<u32, Vec<usize>>> = BTreeMap::new();
        for [node, p] in at_shared {
            shared.entry(node).or_default().entry(particles.body[p as usize]).or_default().push(p as usize);
        }
        for bodies in shared.values() {
            for (&one, of_one) in bodies {
                for (&other, of_other) in bodies.range(one + 1..) {
                    let [lower, upper] = found.entry([one, other]).or_default();
                    lower.extend(of_one);
                    upper.extend(of_other);
                }
            }
        }
        found
    }

    /// The smallest distance between particles of both sides, less half of their widths, in spacings.
    fn gap(&self, [one, other]: &Interface, states: &States<D>) -> Option<f64> {
        let (grid, particles) = (&self.grid, &self.particles);
        let mut cells: HashMap<u64, Vec<usize>> = HashMap::new();
        for &p in other {
            if let Some(cell) = grid.cell(&particles.position[p]) {
                cells.entry(grid.id(cell)).or_default().push(p);
            }
        }
        let width = |p: usize| states[&p].0.powf(1.0 / D as f64);
        let mut least = f64::INFINITY;
        for reach in 0..=FARTHEST {
            for &p in one {
                let x = &particles.position[p];
                let around = grid.cell(x).into_iter().flat_map(|cell| grid.around(cell, reach));
                for &q in around.filter_map(|cell| cells.get(&grid.id(cell))).flatten() {
                    let apart = (particles.position[q] - x).norm() - 0.5 * (width(p) + width(q));
                    least = least.min(apart / grid.spacing);
                }
            }
            // Particles farther out are farther apart, and half of both widths is less than a spacing.
            if least + 1.0 <= f64::from(reach) {
                break;
            }
        }
        Some(least).filter(|gap| gap.is_finite())
    }

    /// The mean of n·σ·n over the particles of both sides, if it is a tension. The normal n points from the first side to the second.
    fn tension(&self, bodies: [u32; 2], sides: &Interface, states: &States<D>) -> Option<f64> {
        let (particles, h) = (&self.particles, self.grid.spacing);
        let middle = |side: &BTreeSet<usize>| {
            let volume: f64 = side.iter().map(|&p| particles.volume[p]).sum();
            side.iter().map(|&p| particles.position[p] * particles.volume[p]).sum::<Vector<f64, D>>() / volume
        };
        let across = middle(&sides[1]) - middle(&sides[0]);
        let n = Some(across).filter(|across| across.norm() > ENCLOSED * h)?.normalize();
        let (mut volume, mut normal, mut squares) = (0.0, 0.0, 0.0);
        for &p in sides.iter().flatten() {
            let stress = states[&p].1?;
            volume += particles.volume[p];
            normal += particles.volume[p] * n.dot(&(stress * n));
            squares += particles.volume[p] * stress.norm_squared();
        }
        let (normal, mean) = (normal / volume, (squares / volume).sqrt());
        let softer = bodies.map(|body| p_wave_modulus(&self.bodies[body as usize].law));
        let some = NO_STRAIN * softer[0].min(softer[1]);
        Some(normal).filter(|&normal| normal > TENSION * mean && normal > some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discs_share_nodes_beside_each_other_and_not_two_spacings_apart() -> Result<(), Box<dyn std::error::Error>> {
        let scene = crate::scene::read_file("scenes/collision.json".as_ref(), &[])?;
        let mut simulation = scene.build::<2>("scenes".as_ref())?;
        let shared = |of: &Simulation<2>| -> Result<_, Box<dyn std::error::Error>> {
            Ok(of.shared_nodes(&Connectivity::new(&of.approximation, &of.grid, &of.particles.position)?.0))
        };
        assert!(shared(&simulation)?.is_empty());
        let particles = &mut simulation.particles;
        let second = particles.position.iter_mut().zip(&particles.body).filter(|(_, body)| **body == 1);
        second.for_each(|(x, _)| x[0] -= 2.0);
        let found = shared(&simulation)?;
        assert_eq!((found.len(), found[0].bodies, found[0].tension), (1, [0, 1], None));
        assert!(found[0].gap.is_some_and(|gap| gap.abs() < 1.0));
        Ok(())
    }
}
