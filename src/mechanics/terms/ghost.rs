//! Ghost stiffness: the cure of cells that a body cuts. Nodes beyond a free face feel next to nothing of it, and without inertia nothing
//! else holds them: rows of the tangent nearly vanish, and with smooth functions the answer itself is spoiled.
//!
//! Π = ½ Σ k |Δφ_{i−1} − 2 Δφ_i + Δφ_{i+1}|²  over triples of nodes along an axis that contain a node with little of a body,
//! k = max(γ (1 − 2f), s (l − 10 f)) (Λ + 2G) h^{D−2},  f < ½ the least share of a cell that one of the three has.
//!
//! A load on points of a surface also reaches nodes that next to nothing of the body holds. On a grid that is made anew they give way
//! again in every step, and the points run ahead of the body. So these are tied, without ghost stiffness too: l is the share of a cell that
//! a layer of thickness h over the points has, and s = 1. Without inertia grids are kept, nothing runs ahead, and s = 1e-3. From a node
//! that nothing else sees a tie takes no stiffness: it hands the load on, with its moment.
//!
//! Neither is there where outer nodes follow inner ones ([`aggregation`](crate::aggregation)).
//!
//! It is zero for every affine Δφ: momentum, moment of momentum, turning as a whole and the patch test stay exact.

use super::{Freezing, Frozen, Given, Reason, Role, Step, Sum, Term, Unit, summed};
use crate::material::Law;
use crate::mechanics::loads::SurfacePoint;
use crate::mechanics::point::{Inadmissible, Part};
use crate::mechanics::sweep::{Laned, Number};
use crate::solver::Bend;
use crate::tensor::{Tensor, Vector, identity, scaled};

/// A node whose volume is less than this share of that of the loaded layer at it is tied to its neighbours: it cannot carry the load alone.
const LOOSE: f64 = 0.1;

/// s without inertia.
const WITHOUT_INERTIA: f64 = 1e-3;

/// Second differences at nodes with little of a body, with their stiffness.
pub struct Ghost {
    bends: Vec<Bend>,
}

impl Ghost {
    pub(super) fn of<const D: usize, L: Law>(step: &Step<'_, D, L>) -> Option<Self> {
        let on_surfaces = |point: &&SurfacePoint<D>| !step.particles.is_solid(point.particle);
        let points = || step.loads.surface.iter().flat_map(|load| &load.points).filter(on_surfaces);
        let (at_all, loaded) = (step.ghost > 0.0, points().next().is_some());
        // Where outer nodes follow inner ones, none is left alone with a load.
        if step.supports.extension().is_some() || !at_all && !loaded {
            return None;
        }
        let (grid, nodes) = (step.supports.grid(), step.supports.active());
        // Volume, and volume times modulus, of what each node has of the bodies.
        // What cells do not resist in the mean, their second differences shall not resist either.
        let averaged = |body: usize| step.bodies[body].mean_stiffness();
        let moduli: Vec<f64> = (0..step.bodies.len()).map(|body| step.modulus(body) - averaged(body)).collect();
        let volume = |p: usize| step.particles.present_volume(p);
        let spread = |value: &(dyn Fn(usize) -> f64 + Sync)| {
            let mut share: Vec<Vector<f64, 1>> = vec![Vector::zeros(); nodes.len()];
            step.supports.spread(&mut share, |p| Vector::from([value(p)]));
            share
        };
        let mut layers = vec![Vector::zeros(); nodes.len()];
        if loaded {
            let mut areas = vec![0.0; step.particles.len()];
            points().for_each(|point| areas[point.particle] = point.area);
            layers = spread(&|p| areas[p] * grid.spacing);
        }
        let (volumes, stiff) = (spread(&volume), spread(&|p| volume(p) * moduli[step.particles.body[p] as usize]));
        let h = grid.spacing;
        // Beyond a wall there is nothing to fill.
        let cell = |node: usize| {
            let index = grid.index(nodes.ids()[node]);
            let at_walls = (0..D).filter(|&k| index[k] == 0 || index[k] == grid.cells[k]).count();
            h.powi(D as i32) * 0.5_f64.powi(at_walls as i32)
        };
        let filled = |node: usize| volumes[node][0] / cell(node);
        let strength = if step.nodal.is_static() { WITHOUT_INERTIA } else { 1.0 };
        let tied = |node: usize| strength * (layers[node][0] - volumes[node][0].max(0.0) / LOOSE) / cell(node);
        let modulus =
            |node: usize| if volumes[node][0] > 0.0 { stiff[node][0] / volumes[node][0] } else { f64::INFINITY };
        let softest_body = moduli.iter().copied().filter(|&modulus| modulus > 0.0).fold(f64::INFINITY, f64::min);
        let mut bends = Vec::new();
        for axis in 0..D {
            let beside = |node: usize, by: i64| {
                let mut index = grid.index(nodes.ids()[node]);
                let moved = i64::from(index[axis]) + by;
                index[axis] = u32::try_from(moved).ok().filter(|&moved| moved <= grid.cells[axis])?;
                nodes.number(grid.id(index))
            };
            let low = (0..nodes.len()).filter(|&node| (at_all && filled(node) < 0.5) || tied(node) > 0.0);
            let mut centres: Vec<usize> =
                low.flat_map(|node| [-1, 0, 1].into_iter().filter_map(move |by| beside(node, by))).collect();
            centres.sort_unstable();
            centres.dedup();
            for centre in centres {
                let (Some(before), Some(after)) = (beside(centre, -1), beside(centre, 1)) else { continue };
                let all = [before, centre, after];
                let least = all.into_iter().map(filled).fold(f64::INFINITY, f64::min);
                let most = all.into_iter().map(tied).fold(0.0, f64::max);
                let of_all = all.into_iter().map(modulus).fold(f64::INFINITY, f64::min);
                let softest = if of_all.is_finite() { of_all } else { softest_body };
                if softest.is_finite() {
                    let factor = (step.ghost * (1.0 - 2.0 * least.max(0.0))).max(most);
                    let stiffness = factor * softest * h.powi(D as i32 - 2);
                    bends.push(Bend { nodes: all.map(|node| node as u32), stiffness });
                }
            }
        }
        (at_all || !bends.is_empty()).then_some(Self { bends })
    }
}

/// The second difference of a field.
fn difference<T: Number, const D: usize>(bend: &Bend, field: &[Vector<T, D>]) -> Vector<T, D> {
    let [a, b, c] = bend.nodes.map(|node| field[node as usize]);
    a - b - b + c
}

impl<const D: usize> Term<D> for Ghost {
    const NAME: &'static str = "ghost stiffness";
    const ROLE: Role = Role::Dissipates;

    fn planned(given: Given<'_, D>) -> Vec<Reason> {
        let why = match given.ghost {
            0.0 => "only with ghost_stiffness".into(),
            factor => format!("{factor} of the stiffness, at nodes with less than half a cell of a body"),
        };
        vec![(<Self as Term<D>>::NAME, given.ghost > 0.0, why)]
    }

    fn add_at_nodes<T: Number>(&self, dphi: &[Vector<T, D>], out: &mut [Vector<T, D>]) {
        for bend in &self.bends {
            let force = difference(bend, dphi) * T::lit(bend.stiffness);
            for (node, weight) in bend.nodes.into_iter().zip(Bend::WEIGHTS) {
                out[node as usize] += force * T::lit(weight);
            }
        }
    }

    fn energy<T: Number>(&self, dphi: &[Vector<T, D>]) -> Option<Result<Sum<T>, Inadmissible>> {
        let energy = |bend: &Bend| {
            let difference = difference(bend, dphi);
            T::lit(0.5 * bend.stiffness) * difference.dot(&difference)
        };
        Some(Ok(summed(self.bends.iter().map(energy))))
    }

    fn add_magnitudes_at_nodes(&self, dphi: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        for bend in &self.bends {
            let [a, b, c] = bend.nodes.map(|node| dphi[node as usize].abs());
            let size = (a + b * 2.0 + c) * bend.stiffness;
            for (node, weight) in bend.nodes.into_iter().zip(Bend::WEIGHTS) {
                out[node as usize] += size * weight.abs();
            }
        }
    }

    fn freeze<X: Laned>(&self, _: &[Vector<f64, D>], _: Part, unit: Unit) -> Freezing<'_, X, D> {
        Ok(Some(Box::new(FrozenGhost { bends: &self.bends, factor: 1.0 / unit.scale })))
    }
}

/// It is linear: its tangent is itself.
struct FrozenGhost<'a> {
    bends: &'a [Bend],
    factor: f64,
}

impl<X: Laned, const D: usize> Frozen<X, D> for FrozenGhost<'_> {
    fn add_product_at_nodes(&self, u: &[Vector<X, D>], out: &mut [Vector<X, D>]) {
        for bend in self.bends {
            let k = X::lit(self.factor * bend.stiffness);
            let [a, b, c] = bend.nodes.map(|node| node as usize);
            for i in 0..D {
                let force = (u[a][i] - u[b][i] - u[b][i] + u[c][i]) * k;
                out[a][i] += force;
                out[b][i] -= force + force;
                out[c][i] += force;
            }
        }
    }

    fn add_bends(&self, bends: &mut Vec<Bend>) {
        bends.extend(self.bends.iter().map(|bend| Bend { stiffness: self.factor * bend.stiffness, ..*bend }));
    }

    fn add_blocks_at_nodes(&self, blocks: &mut [Tensor<f64, D>]) {
        for bend in self.bends {
            for (node, weight) in bend.nodes.into_iter().zip(Bend::WEIGHTS) {
                blocks[node as usize] += scaled(&identity(), self.factor * bend.stiffness * weight * weight);
            }
        }
    }
}
