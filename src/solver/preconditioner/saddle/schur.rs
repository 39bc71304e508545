//! The approximate Schur complement of a system in motions and pressures.

use super::cells::PressureCells;
use crate::pooled::Pool;
use crate::solver::LinearOperator;
use crate::solver::preconditioner::chebyshev::{Chebyshev, largest, smooth};
use crate::solver::preconditioner::hats::nodes_of;
use crate::tensor::{Tensor, Vector};
use rustc_hash::FxHashMap;

/// Bounds of the degree of the polynomials that invert coupled parts of the Schur complement. Between them it is the number of cells across the
/// grid.
const LEAST: usize = 24;
const MOST: usize = 100;

/// Bytes of the Schur complement of `cells` cells.
pub(crate) fn bytes(cells: usize, dimension: usize) -> usize {
    let (index, number, corners) = (size_of::<u32>(), size_of::<f64>(), 1 << dimension);
    // The entries at 2^D nodes each, the data of PressureCells, and vectors of the parts.
    cells * (corners * (4 * index + (dimension + 1) * number) + 3 * index + (dimension.pow(2) + 18) * number)
}

/// The approximate inverse of the Schur complement,
///
/// ```text
/// S⁻¹ = ½ (S₀ + C′)⁻¹ + (C′ + v²/(G v̂ + γ v²))⁻¹ + (S_m + C′)⁻¹
/// S₀ = ½ d/2^d Σ_I b_I b_Iᵀ/a_I + Σ_I m_I m_Iᵀ/Σ (m_I/v),  S_m = Σ_I b_I b_Iᵀ/M_I
/// ```
///
/// Exactly, (B (A + Bᵀ γ B)⁻¹ Bᵀ)⁻¹ = (B A⁻¹ Bᵀ)⁻¹ + γ. Half of the first inverse comes from S₀, and half from each cell alone: S₀ vanishes on
/// checkerboards and must not amplify them alone. Inertia adds an inverse (Cahouet and Chabard, Int. J. Numer. Methods Fluids 8, 1988).
///
/// S₀ is a model: sums run over the nodes I of hat functions, whatever the functions of the body. b_I are the volume changes of the cells, a_I
/// the stiffness of the node, m_c = v/(2^d 2 G v̂) for the 2^d cells at a node, and v̂ = v²/(G B_c K_II⁻¹ B_cᵀ) over the median of v̂/v in full
/// cells. In full cells both parts of S₀ add up to v/2G for waves along an axis, and both vanish for a checkerboard, as B Bᵀ does. S_m has the
/// masses M_I of the nodes, and is absent without inertia.
#[derive(Debug)]
pub(super) struct Schur<const D: usize> {
    pub(super) cells: PressureCells,
    /// The entries b_I: the cell and the node.
    pulls: Vec<(u32, u32, Vector<f64, D>)>,
    /// The entries m_I: the cell and the corner.
    means: Vec<(u32, u32, f64)>,
    /// C′
    compliance: Vec<f64>,
    /// C′ + v²/(G v̂ + γ v²)
    alone: Vec<f64>,
    stiff: Coupled<D>,
    inert: Option<Coupled<D>>,
    polynomial: Chebyshev,
    pool: Pool,
}

/// A part of the Schur complement that couples cells.
#[derive(Debug, Default)]
struct Coupled<const D: usize> {
    /// The factor of b_I b_Iᵀ for every node; 0 where a motion is no unknown.
    soft: Vec<Vector<f64, D>>,
    /// 1/Σ (m_I/v) of every corner; empty if the part has no means.
    totals: Vec<f64>,
    /// The diagonal, with C′.
    diagonal: Vec<f64>,
    largest: f64,
}

impl<const D: usize> Coupled<D> {
    /// z = r over the diagonal
    fn scale(&self, r: &[f64], z: &mut [f64]) {
        z.iter_mut().zip(r).zip(&self.diagonal).for_each(|((z, r), d)| *z = r / d);
    }
}

/// A coupled part and C′, as an operator.
struct Sum<'a, const D: usize>(&'a Schur<D>, &'a Coupled<D>);

impl<const D: usize> LinearOperator for Sum<'_, D> {
    fn apply(&self, p: &[f64], v: &mut [f64]) {
        let Self(schur, part) = self;
        v.iter_mut().zip(&schur.compliance).zip(p).for_each(|((v, c), p)| *v = c * p);
        let mut forces = vec![Vector::<f64, D>::zeros(); part.soft.len()];
        schur.pulls.iter().for_each(|&(cell, node, b)| forces[node as usize] += b * p[cell as usize]);
        forces.iter_mut().zip(&part.soft).for_each(|(force, soft)| force.component_mul_assign(soft));
        schur.pulls.iter().for_each(|(cell, node, b)| v[*cell as usize] += b.dot(&forces[*node as usize]));
        if part.totals.is_empty() {
            return;
        }
        let mut sums = vec![0.0; part.totals.len()];
        schur.means.iter().for_each(|&(cell, corner, m)| sums[corner as usize] += m * p[cell as usize]);
        sums.iter_mut().zip(&part.totals).for_each(|(sum, total)| *sum *= total);
        schur.means.iter().for_each(|&(cell, corner, m)| v[cell as usize] += m * sums[corner as usize]);
    }
}

impl<const D: usize> Schur<D> {
    pub(super) fn new(cells: PressureCells) -> Self {
        let pulls = cells.pulls();
        let across = cells.occupied.grid.iter().copied().max().unwrap_or(1) as usize;
        let (count, degree) = (cells.volume.len(), across.clamp(LEAST, MOST));
        let mut schur = Self {
            pulls,
            means: Vec::new(),
            compliance: vec![0.0; count],
            alone: Vec::new(),
            stiff: Coupled::default(),
            inert: None,
            // The residual of a Chebyshev polynomial of degree n on [λ/part, λ] is about 2 exp(−2 n/√part), here 2 exp(−3.3).
            polynomial: Chebyshev { degree, part: (0.6 * degree as f64).powi(2), largest: 0.0 },
            pool: Pool::default(),
            cells,
        };
        let share = 0.5 * D as f64 / f64::from(1 << D);
        let mut stiff = schur.coupled(&schur.stiffness_of_nodes(), share);
        let at = |c: usize| (schur.cells.volume[c], schur.cells.shear[c], schur.cells.augmentation[c]);
        let effective = schur.cells.effective_volumes();
        for (c, effective) in effective.iter().enumerate() {
            let ((v, shear, gamma), compliance) = (at(c), 1.0 / schur.stiffness(c));
            schur.compliance[c] = compliance / (1.0 - gamma * compliance);
            schur.alone.push(schur.compliance[c] + v * v / (shear * effective + gamma * v * v));
        }
        schur.take_means(&effective, &mut stiff);
        let inert = schur.masses_of_nodes().map(|masses| schur.coupled(&masses, 1.0));
        schur.inert = inert.map(|part| schur.finished(part));
        schur.stiff = schur.finished(stiff);
        schur
    }

    /// k, at least a little more than γ.
    pub(super) fn stiffness(&self, cell: usize) -> f64 {
        self.cells.stiffness[cell].max(1.001 * self.cells.augmentation[cell])
    }

    /// a_I of every node.
    fn stiffness_of_nodes(&self) -> Vec<f64> {
        let mut stiffness = vec![0.0; self.cells.occupied.nodes.len()];
        for &(cell, node, b) in &self.pulls {
            let cell = cell as usize;
            stiffness[node as usize] += self.cells.shear[cell] / self.cells.volume[cell] * b.norm_squared();
        }
        stiffness
    }

    /// The inertia of every node; `None` without inertia.
    fn masses_of_nodes(&self) -> Option<Vec<f64>> {
        let occupied = Some(&self.cells.occupied).filter(|_| self.cells.inertia)?;
        let blocks: &[Tensor<f64, D>] = bytemuck::cast_slice(&occupied.blocks);
        let mut masses: Vec<f64> = blocks.iter().map(|block| block[(0, 0)]).collect();
        let numbers: FxHashMap<[u32; 3], usize> = occupied.nodes.iter().copied().zip(0..).collect();
        for (index, mass) in occupied.cells.iter().zip(&occupied.masses) {
            for node in nodes_of::<D>(*index).filter_map(|corner| numbers.get(&corner)) {
                masses[*node] += mass / f64::from(1 << D);
            }
        }
        Some(masses)
    }

    /// share Σ_I b_I b_Iᵀ/a_I
    fn coupled(&self, stiffness: &[f64], share: f64) -> Coupled<D> {
        let held = &self.cells.occupied.prescribed;
        let factor = |node: usize, i: usize| {
            let free = !held[node * D + i] && stiffness[node] > 0.0;
            if free { share / stiffness[node] } else { 0.0 }
        };
        let soft: Vec<Vector<f64, D>> =
            (0..stiffness.len()).map(|node| Vector::from_fn(|i, _| factor(node, i))).collect();
        let mut diagonal = vec![0.0; self.cells.volume.len()];
        for &(cell, node, b) in &self.pulls {
            diagonal[cell as usize] += b.dot(&b.component_mul(&soft[node as usize]));
        }
        Coupled { soft, diagonal, ..Coupled::default() }
    }

    /// A part with C′ in its diagonal, and its largest eigenvalue.
    fn finished(&self, mut part: Coupled<D>) -> Coupled<D> {
        part.diagonal.iter_mut().zip(&self.compliance).for_each(|(d, c)| *d += c);
        part.largest = largest(&Sum(self, &part), &|r: &[f64], z: &mut [f64]| part.scale(r, z), part.diagonal.len());
        part
    }

    /// Adds the means over the cells at each corner.
    fn take_means(&mut self, effective: &[f64], part: &mut Coupled<D>) {
        let mut numbers = FxHashMap::default();
        for (cell, index) in self.cells.index.iter().enumerate() {
            let (v, shear) = (self.cells.volume[cell], self.cells.shear[cell]);
            let m = v / (f64::from(2 << D) * shear * effective[cell]);
            for at in nodes_of::<D>(*index) {
                let count = numbers.len() as u32;
                let number = *numbers.entry(at).or_insert(count);
                if number == count {
                    part.totals.push(0.0);
                }
                part.totals[number as usize] += m / v;
                self.means.push((cell as u32, number, m));
            }
        }
        part.totals.iter_mut().for_each(|total| *total = total.recip());
        for &(cell, corner, m) in &self.means {
            part.diagonal[cell as usize] += m * m * part.totals[corner as usize];
        }
    }

    /// q = S⁻¹ v
    pub(super) fn solve(&self, v: &[f64], q: &mut [f64]) {
        let inverted = |part: &Coupled<D>| {
            let (mut q, polynomial) = (vec![0.0; v.len()], Chebyshev { largest: part.largest, ..self.polynomial });
            smooth(
                polynomial,
                &self.pool,
                &Sum(self, part),
                &|r: &[f64], z: &mut [f64]| part.scale(r, z),
                v,
                &mut q,
                true,
            );
            q
        };
        q.iter_mut().zip(v).zip(&self.alone).for_each(|((q, v), alone)| *q = v / alone);
        mutant!("saddle: cells are alone in the Schur complement": { return; });
        q.iter_mut().zip(inverted(&self.stiff)).for_each(|(q, stiff)| *q += 0.5 * stiff);
        if let Some(inert) = &self.inert {
            q.iter_mut().zip(inverted(inert)).for_each(|(q, inert)| *q += inert);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Full cells of unit size, v = 1, G and γ = 1.
    fn full(side: u32) -> PressureCells {
        let mut cells = PressureCells::default();
        let occupied = &mut cells.occupied;
        occupied.grid = [side, side, 0];
        occupied.nodes = (0..(side + 1).pow(2)).map(|k| [k % (side + 1), k / (side + 1), 0]).collect();
        occupied.prescribed = vec![false; 2 * occupied.nodes.len()];
        occupied.blocks = vec![0.0; 4 * occupied.nodes.len()];
        for k in 0..side * side {
            let index = [k % side, k / side, 0];
            cells.index.push(index);
            cells.centroid.push(index.map(|i| f64::from(i) + 0.5));
            cells.volume_gradient.extend([1.0, 0.0, 0.0, 1.0]);
            for (list, value) in [
                (&mut cells.volume, 1.0),
                (&mut cells.shear, 1.0),
                (&mut cells.compliance, 1.0),
                (&mut cells.stiffness, 1e12),
                (&mut cells.augmentation, 1.0),
                (&mut cells.unit, 1.0),
                (&mut cells.weight, 1.0),
            ] {
                list.push(value);
            }
        }
        cells
    }

    /// The incompressible limit away from the boundary: v/2G for a constant pressure and for stripes, and nothing for a checkerboard.
    #[test]
    fn the_coupled_part_is_that_of_plane_waves() {
        let side = 8;
        let schur = Schur::<2>::new(full(side));
        let sign = |on: bool| if on { -1.0 } else { 1.0 };
        type Wave = fn(u32, u32) -> bool;
        let waves: [(Wave, f64); 4] =
            [(|_, _| false, 0.5), (|x, _| x % 2 == 1, 0.5), (|_, y| y % 2 == 1, 0.5), (|x, y| (x + y) % 2 == 1, 0.0)];
        for (number, (wave, value)) in waves.into_iter().enumerate() {
            let p: Vec<f64> = (0..side * side).map(|k| sign(wave(k % side, k / side))).collect();
            let mut v = vec![0.0; p.len()];
            Sum(&schur, &schur.stiff).apply(&p, &mut v);
            let inner = |k: &u32| (2..side - 2).contains(&(k % side)) && (2..side - 2).contains(&(k / side));
            for k in (0..side * side).filter(inner).map(|k| k as usize) {
                assert!((v[k] - value * p[k]).abs() < 1e-11, "wave {number}: {} at {k}", v[k]);
            }
        }
        assert!(schur.inert.is_none());
    }

    /// Outside the body a node has no inertia of its own; S_m is the divergence of the inverse mass.
    #[test]
    fn inertia_adds_the_part_of_the_masses() {
        let mut cells = full(8);
        cells.occupied.cells = cells.index.clone();
        (cells.occupied.masses, cells.inertia) = (vec![4.0; 64], true);
        let schur = Schur::<2>::new(cells);
        let part = schur.inert.as_ref().map(|inert| inert.diagonal[27]);
        // Four nodes of mass 4, |b|² = ½
        assert!((part.unwrap_or(0.0) - 4.0 * 0.5 / 4.0).abs() < 1e-10, "{part:?}");
    }
}
