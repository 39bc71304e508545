//! The mean dilatation of the particles of a cell: Θ = Σ V_p ΔJ_p / Σ V_p. V_p is the volume at the last grid reset, ΔJ_p the volume ratio
//! since then. A particle belongs to the cell that it was in at that reset. Each body in a cell has a mean of its own. With
//! aggregation, the particles of a hardly filled cell belong to a better filled cell ([`joined_cells`](super::joined_cells)).
//!
//! A particle stores θ. Its stress depends on θ = Θ θ_r, where θ_r is the value at the last grid reset, the product of the Θ of all earlier
//! grids. So stresses are continuous at a grid reset. The reference configuration keeps θ_r.

use crate::lanes::LANES;
use crate::material::{Law, p_wave_modulus};
use crate::mechanics::joined_cells::{Content, Key, joined_cells};
use crate::mechanics::sweep::{Connectivity, Number};
use crate::mechanics::trial::Trial;
use crate::particles::{Body, Particles};
use crate::scalar::Real;
use crate::tensor::{Deformation, Vector};

/// The entry of a particle without a cell.
const NONE: u32 = u32::MAX;

/// A particle of a cell: its index in memory, and its slot in the transfer loop, [`LANES`] · group + lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Member {
    pub particle: u32,
    pub slot: u32,
}

/// The units of a cell whose dilatation is an unknown of its own. κ is θ (θ U′)′ at θ = 1: Λ in Ciarlet's law, K in logarithmic strains.
/// The unknown is a length and its residual a force, like those of nodes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    /// G/h, the residual per difference of volumes.
    pub force: f64,
    /// G/(κ h), the change of Θ per unit of the unknown. The pressure changes by G/h.
    pub dilatation: f64,
    /// The effective G = ½ (M − κ), with the modulus M of uniaxial strain.
    pub shear: f64,
}

impl Scale {
    /// The smallest κ and G, relative to the modulus of uniaxial strain.
    const SMALLEST: f64 = 1e-9;

    fn of<L: Law>(body: &Body<L>, spacing: f64) -> Self {
        let modulus = p_wave_modulus(&body.law);
        let bulk = body.response::<f64>(0.0).map_or(modulus, |of| of.stiffness).max(Self::SMALLEST * modulus);
        let shear = (0.5 * (modulus - bulk)).max(Self::SMALLEST * modulus);
        Self { force: shear / spacing, dilatation: shear / (bulk * spacing), shear }
    }
}

/// The particles whose volume ratios are averaged, cell by cell.
#[derive(Debug, Default)]
pub(crate) struct Cells {
    /// Sorted by cell and id, so that sums do not depend on the order of particles in memory.
    members: Vec<Member>,
    /// The index of the first member of each cell; at the end, the number of members.
    starts: Vec<u32>,
    /// The cell of each particle.
    of: Vec<u32>,
    /// Surface points, which have no volume, each with the nearest cell.
    beside: Vec<(usize, usize)>,
    /// Σ V_p
    volumes: Vec<f64>,
    /// The grid's id of every cell.
    pub ids: Vec<u64>,
    /// The units of every cell.
    pub scales: Vec<Scale>,
}

/// The cell and the body of a particle, its id, and its place.
type Keyed = (Key, u32, Member);

/// The particles of averaged cells, sorted by cell and id. With aggregation, no particle is in a cell that its body hardly fills,
/// if there is a better filled cell next to it. Without aggregation, hardly filled cells have a motion of their own, and thus a pressure.
fn keyed<const D: usize>(particles: &Particles<D>, averages: &[bool], connectivity: &Connectivity<D>) -> Vec<Keyed> {
    let (grid, reference) = (connectivity.grid(), particles.reference());
    let mut keyed: Vec<Keyed> = Vec::new();
    connectivity.each_group(|group| {
        for (lane, &particle) in group.particles.iter().enumerate() {
            let (p, slot) = (particle as usize, (group.number * LANES + lane) as u32);
            let body = particles.body[p];
            let averaged = averages[body as usize] && particles.is_solid(p);
            if let Some(cell) = grid.cell(&reference.position[p]).filter(|_| averaged) {
                keyed.push(((grid.id(cell), body), particles.id[p], Member { particle, slot }));
            }
        }
    });
    keyed.sort_unstable_by_key(|&(key, id, _)| (key, id));
    mutant!("mean dilatation: hardly filled cells have a dilatation of their own": { return keyed; });
    if connectivity.extension().is_none() {
        return keyed;
    }
    let content = |&(key, _, member): &Keyed| {
        let p = member.particle as usize;
        Content { key, volume: reference.volume(p), position: reference.position[p] }
    };
    let contents: Vec<Content<D>> = keyed.iter().map(content).collect();
    let joined = joined_cells(grid, &contents);
    for (key, ..) in &mut keyed {
        if let Ok(at) = joined.binary_search_by_key(key, |&(from, _)| from) {
            *key = joined[at].1;
        }
    }
    keyed.sort_unstable_by_key(|&(key, id, _)| (key, id));
    keyed
}

impl Cells {
    /// Upper bound of the bytes per particle.
    pub(crate) const BYTES: usize =
        size_of::<Member>() + 2 * size_of::<u32>() + size_of::<f64>() + size_of::<u64>() + size_of::<Scale>();

    /// The cells of the bodies with mean dilatation; `None` if there is no such body.
    pub(crate) fn of<const D: usize, L: Law>(
        particles: &Particles<D>,
        bodies: &[Body<L>],
        connectivity: &Connectivity<D>,
    ) -> Option<Self> {
        let averages: Vec<bool> = bodies.iter().map(Body::averages).collect();
        if !averages.contains(&true) {
            return None;
        }
        let (grid, reference) = (connectivity.grid(), particles.reference());
        let keyed = keyed(particles, &averages, connectivity);
        let mut cells = Self {
            members: keyed.iter().map(|&(.., member)| member).collect(),
            starts: vec![0],
            of: vec![NONE; particles.len()],
            ..Self::default()
        };
        let scales: Vec<Scale> = bodies.iter().map(|body| Scale::of(body, grid.spacing)).collect();
        let mut keys = Vec::new();
        for same in keyed.chunk_by(|one, next| one.0 == next.0) {
            keys.push(same[0].0);
            let mut volume = 0.0;
            for (.., Member { particle, .. }) in same {
                cells.of[*particle as usize] = cells.volumes.len() as u32;
                volume += reference.volume(*particle as usize);
            }
            cells.ids.push(same[0].0.0);
            cells.scales.push(scales[same[0].0.1 as usize]);
            cells.volumes.push(volume);
            cells.starts.push(cells.starts[cells.volumes.len() - 1] + same.len() as u32);
        }
        for p in (0..particles.len()).filter(|&p| !particles.is_solid(p) && averages[particles.body[p] as usize]) {
            let (x, body) = (&reference.position[p], particles.body[p]);
            let around = grid.cell(x).into_iter().flat_map(|cell| grid.around(cell, 1));
            let near = around.filter_map(|cell| {
                let number = keys.binary_search(&(grid.id(cell), body)).ok()?;
                let middle = grid.position(cell) + Vector::repeat(0.5 * grid.spacing);
                Some((number, (x - middle).norm_squared()))
            });
            let nearest = near.min_by(|a, b| a.1.total_cmp(&b.1));
            cells.beside.extend(nearest.map(|(number, _)| (p, number)));
        }
        Some(cells)
    }

    /// The members of every cell, with their total volume at the last grid reset.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (&[Member], f64)> {
        let ranges = self.starts.windows(2).map(|ends| ends[0] as usize..ends[1] as usize);
        ranges.map(|range| &self.members[range]).zip(self.volumes.iter().copied())
    }

    /// For every cell, the sum of the numbers of its members. `of_slots` has the numbers by group and lane.
    pub(crate) fn sums(&self, of_slots: &[[f64; LANES]]) -> Vec<f64> {
        let number = |slot: usize| of_slots[slot / LANES][slot % LANES];
        self.iter().map(|(members, _)| members.iter().map(|member| number(member.slot as usize)).sum()).collect()
    }

    /// The cell of a particle, if it has one.
    #[inline(always)]
    pub(crate) fn cell(&self, particle: u32) -> Option<usize> {
        Some(self.of[particle as usize]).filter(|&cell| cell != NONE).map(|cell| cell as usize)
    }

    /// Θ − 1 of every cell after the nodal motion since the last grid reset; 0 in a cell that is turned inside out.
    pub(crate) fn changes<T: Number, const D: usize>(
        &self,
        particles: &Particles<D>,
        connectivity: &Connectivity<D>,
        motion: &[Vector<T, D>],
    ) -> Vec<T> {
        let reference = particles.reference();
        let grown = connectivity.evaluate(motion, |p, _, g| Deformation::new(g).j * T::lit(reference.volume(p)));
        let mean = |(members, volume): (&[Member], f64)| {
            let sum = members.iter().fold(T::zero(), |sum, member| sum + grown[member.particle as usize]);
            let change = sum * T::lit(1.0 / volume);
            if change.value() > -1.0 { change } else { T::zero() }
        };
        self.iter().map(mean).collect()
    }
}

impl Cells {
    /// Θ − 1 of every cell: that of its own unknown, if it has one, or that of the motion.
    pub(crate) fn changes_at<T: Number, const D: usize>(
        &self,
        particles: &Particles<D>,
        connectivity: &Connectivity<D>,
        at: Trial<'_, T, D>,
    ) -> Vec<T> {
        if at.dilatation.is_empty() {
            return self.changes(particles, connectivity, at.phi);
        }
        let own = at.dilatation.iter().zip(&self.scales);
        own.map(|(&unknown, scale)| unknown * T::lit(scale.dilatation)).collect()
    }

    /// Θ − 1 of every cell from the present θ of its particles.
    pub(crate) fn changes_now<const D: usize>(&self, particles: &Particles<D>) -> Vec<f64> {
        let reference = particles.reference();
        let of = |(members, _): (&[Member], f64)| {
            let p = members[0].particle as usize;
            let before = reference.dilatation(p);
            (particles.dilatation(p) - before) / (1.0 + before)
        };
        self.iter().map(of).collect()
    }

    /// The unknowns of the cells from the present θ of their particles.
    pub(crate) fn unknowns<const D: usize>(&self, particles: &Particles<D>) -> Vec<f64> {
        self.changes_now(particles).iter().zip(&self.scales).map(|(change, scale)| change / scale.dilatation).collect()
    }
}

/// θ − 1 of θ = Θ θ_n, from Θ − 1 and θ_n − 1.
#[inline(always)]
pub(crate) fn total<T: Real>(change: T, before: f64) -> T {
    mutant!("mean dilatation: that of earlier grids is forgotten": { return change; });
    change + T::lit(before) + change * T::lit(before)
}

/// θ − 1 of all particles after the nodal motion since the last grid reset; empty if no body has mean dilatation.
pub(crate) fn after<const D: usize, L: Law>(
    particles: &Particles<D>,
    bodies: &[Body<L>],
    connectivity: &Connectivity<D>,
    at: Trial<'_, f64, D>,
) -> Vec<f64> {
    let Some(cells) = Cells::of(particles, bodies, connectivity) else { return Vec::new() };
    let (changes, reference) = (cells.changes_at(particles, connectivity, at), particles.reference());
    let seen = |p: usize, cell: usize| total(changes[cell], reference.dilatation(p));
    let of = |p: usize| cells.cell(p as u32).map_or(0.0, |cell| seen(p, cell));
    let mut all: Vec<f64> = (0..particles.len()).map(of).collect();
    // Surface points take the mean of the nearest cell, so that their stresses are those of the body.
    cells.beside.iter().for_each(|&(p, cell)| all[p] = seen(p, cell));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::aggregation::Extension;
    use crate::approximation::Linear;
    use crate::grid::Grid;
    use crate::material::{Lame, NeoHookean};
    use crate::particles::Dilatation;

    /// Two particles fill a cell, and one fills a tenth of the next cell.
    #[test]
    fn hardly_filled_cells_are_joined_only_with_aggregation() -> Result<(), Box<dyn std::error::Error>> {
        let grid = Grid { origin: Vector::from([0.0]), spacing: 1.0, cells: [4] };
        let mut particles = Particles::<1>::default();
        for (x, volume) in [(0.25, 0.5), (0.75, 0.5), (1.05, 0.1)] {
            particles.push_without_inertia(Vector::from([x]), volume, volume, 0);
        }
        let law = NeoHookean::ciarlet(Lame::new(100.0, 1.0)?);
        let bodies = [Body { name: "bar".into(), law, density: 1.0, dilatation: Dilatation::MeanDilatation, field: 0 }];
        let cells = |connectivity: &Connectivity<1>| {
            let cells = Cells::of(&particles, &bodies, connectivity);
            let counts = |cells: Cells| cells.iter().map(|(members, _)| members.len()).collect::<Vec<_>>();
            cells.map(counts)
        };
        let (connectivity, _) = Connectivity::new(&Linear, &grid, &particles.position)?;
        assert_eq!(cells(&connectivity), Some(vec![2, 1]));
        assert_eq!(cells(&connectivity.with_extension(Extension::default())), Some(vec![3]));
        Ok(())
    }
}
