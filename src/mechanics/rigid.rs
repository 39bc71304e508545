//! Rigid-body modes that no prescribed motion suppresses. With inertia they are ordinary motions. Without inertia, a load that works on
//! such a mode has no equilibrium.

use crate::grid::Grid;
use crate::material::Law;
use crate::mechanics::residual::Equilibrium;
use crate::mechanics::sweep::Connectivity;
use crate::mechanics::terms::Step;
use crate::solver::rigid_motions;
use crate::space::Nodes;
use crate::tensor::Vector;
use nalgebra::{DMatrix, DVector};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{Display, Formatter};

/// Relative tolerance. A mode is free if the prescribed degrees of freedom see less than this part of it. A mode is loaded if more than
/// this part of the loads works on it.
const NOTHING: f64 = 1e-9;

/// Bodies with a loaded rigid-body mode that no prescribed degree of freedom suppresses.
#[derive(Clone, Debug, PartialEq)]
pub struct Loose {
    /// Names of the bodies; several if the bodies touch.
    pub bodies: Vec<String>,
    /// The axis of a loaded translation; `None` if the loads turn the bodies.
    pub axis: Option<usize>,
}

impl Display for Loose {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let bodies = self.bodies.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ");
        match self.axis {
            Some(axis) => {
                write!(f, "nothing holds {bodies} along {}, and the loads push there", ["x", "y", "z"][axis.min(2)])
            }
            None => write!(f, "nothing keeps {bodies} from turning, and the loads turn it"),
        }
    }
}

/// The first group of touching bodies (bodies that share nodes) with a free and loaded rigid-body mode.
pub(crate) fn loose<const D: usize, L: Law>(
    grid: &Grid<D>,
    equilibrium: &Equilibrium<'_, D, L>,
    nodes: &Nodes,
) -> Option<Loose> {
    let Step { connectivity, particles, bodies, .. } = equilibrium.step;
    let positions: Vec<Vector<f64, D>> = nodes.positions(grid).map(|(_, x)| x).collect();
    let group = groups(connectivity, positions.len());
    let force = equilibrium.external_force(&vec![Vector::zeros(); positions.len()]).ok()?;
    let mut of_group: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    group.iter().enumerate().for_each(|(node, &root)| of_group.entry(root).or_default().push(node));
    for (root, members) in of_group {
        let held = equilibrium.prescribed.iter().filter(|dof| group[dof.node] == root);
        let held = held.map(|dof| (dof.node, dof.component));
        if let Some(axis) = pushed(&positions, &members, held, &force) {
            let of_root = |&p: &usize| connectivity.of(p).next().is_some_and(|(node, ..)| group[node] == root);
            let found: BTreeSet<u32> =
                (0..connectivity.particles()).filter(of_root).map(|p| particles.body[p]).collect();
            let bodies = found.into_iter().map(|body| bodies[body as usize].name.clone()).collect();
            return Some(Loose { bodies, axis });
        }
    }
    None
}

/// For each node, the smallest node that particles connect it with.
fn groups<const D: usize>(connectivity: &Connectivity<D>, count: usize) -> Vec<usize> {
    fn root(parent: &mut [usize], mut node: usize) -> usize {
        while parent[node] != node {
            parent[node] = parent[parent[node]];
            node = parent[node];
        }
        node
    }
    let mut parent: Vec<usize> = (0..count).collect();
    for p in 0..connectivity.particles() {
        let mut last = None;
        for (node, ..) in connectivity.of(p) {
            let one = root(&mut parent, node);
            let other = last.map_or(one, |last| root(&mut parent, last));
            parent[one.max(other)] = one.min(other);
            last = Some(node);
        }
    }
    (0..count).map(|node| root(&mut parent, node)).collect()
}

/// The loaded rigid-body mode of the nodes `members` that the degrees of freedom `held` leave free; `None` if there is none. `Some(axis)`
/// is a translation, `Some(None)` any other mode.
fn pushed<const D: usize>(
    positions: &[Vector<f64, D>],
    members: &[usize],
    held: impl Iterator<Item = (usize, usize)>,
    force: &[Vector<f64, D>],
) -> Option<Option<usize>> {
    let centre = members.iter().map(|&node| positions[node]).sum::<Vector<f64, D>>() / members.len() as f64;
    let size = members.iter().map(|&node| (positions[node] - centre).norm()).fold(f64::MIN_POSITIVE, f64::max);
    // Rotations are about the centre, in units of the size.
    let motions = |node: usize| rigid_motions(&((positions[node] - centre) / size));
    let count = D * (D + 1) / 2;
    // G = Σ m mᵀ over the held degrees of freedom, with m the rigid-body modes there. q·Gq is the held part of a mode q.
    let mut gram = DMatrix::<f64>::zeros(count, count);
    for (node, component) in held {
        let seen = DVector::from_iterator(count, motions(node).iter().map(|motion| motion[component]));
        gram += &seen * seen.transpose();
    }
    let mut work = DVector::<f64>::zeros(count);
    let mut most = 0.0;
    for &node in members {
        for (work, motion) in work.iter_mut().zip(motions(node)) {
            *work += force[node].dot(&motion);
        }
        most += force[node].norm();
    }
    let loaded = |work: f64| work.abs() > NOTHING * most;
    // Components are held along axes. A free translation is therefore along an axis.
    if let Some(axis) = (0..D).find(|&k| gram[(k, k)] == 0.0 && loaded(work[k])) {
        return Some(Some(axis));
    }
    let bound = NOTHING * gram.trace();
    let modes = gram.symmetric_eigen();
    let free = modes.eigenvalues.iter().zip(modes.eigenvectors.column_iter()).filter(|(held, _)| **held <= bound);
    free.into_iter().any(|(_, mode)| loaded(mode.dot(&work))).then_some(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners of a unit square, held at `held` and loaded at one corner.
    fn square(held: &[(usize, usize)], corner: usize, load: [f64; 2]) -> Option<Option<usize>> {
        let positions = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(Vector::from);
        let mut force = [Vector::zeros(); 4];
        force[corner] = Vector::from(load);
        pushed(&positions, &[0, 1, 2, 3], held.iter().copied(), &force)
    }

    #[test]
    fn a_column_falls_without_its_floor() -> Result<(), Box<dyn std::error::Error>> {
        let scene = crate::scene::read_file("scenes/column_static.json".as_ref(), &[])?;
        let mut simulation = scene.build::<2>("scenes".as_ref())?;
        let found = |of: &crate::simulation::Simulation<2>| -> Result<_, Box<dyn std::error::Error>> {
            let next = of.next_step()?;
            Ok(loose(&of.grid, &next.equilibrium(), next.nodes()))
        };
        assert_eq!(found(&simulation)?, None);
        simulation.loads.prescribed.clear();
        assert_eq!(found(&simulation)?.and_then(|loose| loose.axis), Some(1));
        Ok(())
    }

    #[test]
    fn a_square_is_loose_only_where_it_is_pushed() {
        let floor = [(0, 1), (1, 1)];
        // On a smooth floor the square stands, slides when pushed sideways, and stands again against a wall.
        assert_eq!(square(&floor, 3, [0.0, -1.0]), None);
        assert_eq!(square(&floor, 3, [1.0, 0.0]), Some(Some(0)));
        assert_eq!(square(&[(0, 0), (0, 1), (1, 1)], 3, [1.0, 0.0]), None);
        // On a hinge the square turns, unless the load points at the hinge.
        let hinge = [(0, 0), (0, 1)];
        assert_eq!(square(&hinge, 1, [0.0, -1.0]), Some(None));
        assert_eq!(square(&hinge, 3, [1.0, 1.0]), None);
        // Nothing holds the square.
        assert_eq!(square(&[], 2, [0.0, -2.0]), Some(Some(1)));
        assert_eq!(square(&[], 2, [0.0, 0.0]), None);
    }
}
