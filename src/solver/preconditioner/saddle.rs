//! A preconditioner for systems in motions and pressures, [A Bᵀ; B −C]. The iterations of GMRES depend neither on C nor much on the grid.
//!
//! With γ of the cells, the system is equivalent to
//!
//! ```text
//! [A + Bᵀ γ B  Bᵀ ] [u]   [r_u + Bᵀ γ r_v]
//! [B           −C′] [q] = [r_v           ],   q = (1 − γ C) p,  C′ = C/(1 − γ C).
//! ```
//!
//! Its lower triangle is solved with approximate inverses: multigrid for A + Bᵀ γ B, and a Schur complement S for B (A + Bᵀ γ B)⁻¹ Bᵀ + C′:
//!
//! ```text
//! u = M⁻¹ (r_u + Bᵀ γ r_v),  q = −S⁻¹ (r_v − B u)
//! ```

use super::chebyshev::{Chebyshev, largest, smooth};
use super::{LocalForm, Preconditioner};
use crate::aggregation::{Extension, Followers, Occupied, Pieces};
use crate::solver::{LinearOperator, Linearization, SaddlePoint};
use crate::tensor::{Tensor, Vector};
use std::collections::{HashMap, HashSet};

/// Bounds of the degree of the polynomials that invert coupled parts of the Schur complement. Between them it is the number of cells across the
/// grid.
const LEAST: usize = 24;
const MOST: usize = 100;

/// A cell with more than this share of its volume counts as full.
const FULL: f64 = 0.999;

/// The largest v̂, in volumes of the largest cell. Where all nodes of a cell are held, B_c K_II⁻¹ B_cᵀ is 0.
const STIFFEST: f64 = 100.0;

/// The cells of a system in motions and pressures, one entry for each. Lengths are in the user's unit, unless they are said to be in cells.
#[derive(Clone, Debug, Default)]
pub struct PressureCells {
    /// The nodes and the occupied cells of the grid, without tangents.
    pub occupied: LocalForm,
    /// Whether the occupied cells and nodes have masses.
    pub inertia: bool,
    /// Index of the cell; 0 along axes that do not exist.
    pub index: Vec<[u32; 3]>,
    /// Centroid, in cells from the origin of the grid.
    pub centroid: Vec<[f64; 3]>,
    /// ∂v/∂(∇u) with gradients in units of 1/h, D×D, column by column.
    pub pull: Vec<f64>,
    /// v
    pub volume: Vec<f64>,
    /// G
    pub shear: Vec<f64>,
    /// B_c K_II⁻¹ B_cᵀ, with the diagonal blocks K_II of A + Bᵀ γ B.
    pub softness: Vec<f64>,
    /// k = 1/C, the change of pressure per change of volume.
    pub stiffness: Vec<f64>,
    /// γ
    pub augmented: Vec<f64>,
    /// The change of v that belongs to a unit of the unknown of the cell.
    pub unit: Vec<f64>,
    /// The residual of the cell per difference of volumes.
    pub weight: Vec<f64>,
}

/// Bytes of the Schur complement of `cells` cells.
pub(crate) fn bytes(cells: usize, dimension: usize) -> usize {
    let (index, number, corners) = (size_of::<u32>(), size_of::<f64>(), 1 << dimension);
    // The entries at 2^D nodes each, the data of PressureCells, and vectors of the parts.
    cells * (corners * (4 * index + (dimension + 1) * number) + 3 * index + (dimension.pow(2) + 18) * number)
}

/// The block-triangular preconditioner over a preconditioner of A + Bᵀ γ B. For systems without pressures it is that preconditioner.
pub struct Saddle<const D: usize> {
    motions: Box<dyn Preconditioner>,
    schur: Option<Schur<D>>,
}

impl<const D: usize> Saddle<D> {
    /// The preconditioner over one of A + Bᵀ γ B.
    pub fn over(motions: Box<dyn Preconditioner>) -> Self {
        Self { motions, schur: None }
    }
}

impl<const D: usize> Preconditioner for Saddle<D> {
    fn prepare<'a>(&'a mut self, tangent: &'a dyn Linearization) -> Box<dyn LinearOperator + 'a> {
        let Some(system) = tangent.saddle_point() else { return self.motions.prepare(tangent) };
        let schur = self.schur.get_or_insert_with(|| Schur::new(system.cells()));
        Box::new(Triangle { system, schur, motions: self.motions.prepare(system.augmented()) })
    }
}

/// The solve with the lower triangle.
struct Triangle<'a, const D: usize> {
    system: &'a dyn SaddlePoint,
    schur: &'a Schur<D>,
    motions: Box<dyn LinearOperator + 'a>,
}

impl<const D: usize> LinearOperator for Triangle<'_, D> {
    fn apply(&self, r: &[f64], z: &mut [f64]) {
        let cells = &self.schur.cells;
        let nodal = r.len() - cells.volume.len();
        let ((r_u, r_c), (u, y)) = (r.split_at(nodal), z.split_at_mut(nodal));
        let volumes: Vec<f64> = r_c.iter().zip(&cells.weight).map(|(r, weight)| r / weight).collect();
        let pressures: Vec<f64> = volumes.iter().zip(&cells.augmented).map(|(v, gamma)| v * gamma).collect();
        let mut f = vec![0.0; nodal];
        self.system.forces(&pressures, &mut f);
        f.iter_mut().zip(r_u).for_each(|(f, r)| *f += r);
        self.motions.apply(&f, u);
        let mut left = vec![0.0; volumes.len()];
        self.system.volume_changes(u, &mut left);
        left.iter_mut().zip(&volumes).for_each(|(left, v)| *left -= v);
        self.schur.solve(&left, y);
        mutant!("saddle: the pressures have the other sign": { y.iter_mut().for_each(|y| *y = -*y); });
        for (c, y) in y.iter_mut().enumerate() {
            // δp = q/(1 − γ/k) = k unit y
            *y /= (self.schur.stiffness(c) - cells.augmented[c]) * cells.unit[c];
        }
    }
}

/// The approximate inverse of the Schur complement,
///
/// ```text
/// S⁻¹ = ½ (S₀ + C′)⁻¹ + (C′ + v²/(G v̂ + γ v²))⁻¹ + (S_m + C′)⁻¹
/// S₀ = ½ d/2^d Σ_I b_I b_Iᵀ/a_I + Σ_I m_I m_Iᵀ/Σ (m_I/v),  S_m = Σ_I b_I b_Iᵀ/m_I
/// ```
///
/// Exactly, (B (A + Bᵀ γ B)⁻¹ Bᵀ)⁻¹ = (B A⁻¹ Bᵀ)⁻¹ + γ. Half of the first inverse comes from S₀, and half from each cell alone: S₀ vanishes on
/// checkerboards and must not amplify them alone. Inertia adds an inverse (Cahouet and Chabard, Int. J. Numer. Methods Fluids 8, 1988).
///
/// S₀ is a model: sums run over the nodes I of hat functions, whatever the functions of the body. b_I are the volume changes of the cells, a_I the stiffness of
/// the node, m_c = v/(2^d 2 G v̂) for the 2^d cells at a node, and v̂ = v²/(G B_c K_II⁻¹ B_cᵀ) over the median of v̂/v in full cells. In full cells both
/// parts of S₀ add up to v/2G for waves along an axis, and both vanish for a checkerboard, as B Bᵀ does. S_m is that of the inertia of the nodes,
/// and absent without inertia.
#[derive(Debug)]
struct Schur<const D: usize> {
    cells: PressureCells,
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
    fn new(cells: PressureCells) -> Self {
        let pulls = pulls(&cells);
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
            polynomial: Chebyshev { degree, part: (0.6 * degree as f64).powi(2) },
            cells,
        };
        let share = 0.5 * D as f64 / f64::from(1 << D);
        let mut stiff = schur.coupled(&schur.stiffness_of_nodes(), share);
        let at = |c: usize| (schur.cells.volume[c], schur.cells.shear[c], schur.cells.augmented[c]);
        let effective = effective_volumes(&schur.cells);
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
    fn stiffness(&self, cell: usize) -> f64 {
        self.cells.stiffness[cell].max(1.001 * self.cells.augmented[cell])
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
        let numbers: HashMap<[u32; 3], usize> = occupied.nodes.iter().copied().zip(0..).collect();
        for (index, mass) in occupied.cells.iter().zip(&occupied.masses) {
            let corners = (0..1_u32 << D).map(|corner| std::array::from_fn(|k| index[k] + (corner >> k & 1)));
            for node in corners.filter_map(|corner| numbers.get(&corner)) {
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
        part.largest = largest(&Sum(self, &part), &|r, z| part.scale(r, z), part.diagonal.len());
        part
    }

    /// Adds the means over the cells at each corner.
    fn take_means(&mut self, effective: &[f64], part: &mut Coupled<D>) {
        let mut numbers = HashMap::new();
        for (cell, index) in self.cells.index.iter().enumerate() {
            let (v, shear) = (self.cells.volume[cell], self.cells.shear[cell]);
            let m = v / (f64::from(2 << D) * shear * effective[cell]);
            for corner in 0..1_u32 << D {
                let at: [u32; 3] = std::array::from_fn(|k| index[k] + (corner >> k & 1));
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
    fn solve(&self, v: &[f64], q: &mut [f64]) {
        let inverted = |part: &Coupled<D>| {
            let mut q = vec![0.0; v.len()];
            smooth(self.polynomial, &Sum(self, part), &|r, z| part.scale(r, z), part.largest, v, &mut q, true);
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

/// v̂ of every cell: v²/(G B_c K_II⁻¹ B_cᵀ), divided by the median of its ratio to v in full cells.
fn effective_volumes(cells: &PressureCells) -> Vec<f64> {
    let occupied = &cells.occupied;
    let full: HashSet<[u32; 3]> = occupied
        .cells
        .iter()
        .zip(&occupied.filled)
        .filter(|(_, filled)| **filled > FULL)
        .map(|(cell, _)| *cell)
        .collect();
    let raw = |c: usize| cells.volume[c].powi(2) / (cells.shear[c] * cells.softness[c]);
    let median = |chosen: &dyn Fn(usize) -> bool| {
        let mut all: Vec<f64> = (0..cells.volume.len())
            .filter(|&c| chosen(c))
            .map(|c| raw(c) / cells.volume[c])
            .filter(|x| x.is_finite() && *x > 0.0)
            .collect();
        all.sort_unstable_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    };
    let unit = median(&|c| full.contains(&cells.index[c])).or_else(|| median(&|_| true)).unwrap_or(1.0);
    let largest = cells.volume.iter().copied().fold(0.0, f64::max);
    // Softness is not positive where A + Bᵀ γ B is indefinite.
    let effective = |c: usize| if raw(c) >= 0.0 { (raw(c) / unit).min(STIFFEST * largest) } else { cells.volume[c] };
    (0..cells.volume.len()).map(effective).collect()
}

/// The volume change of each cell under a motion of each hat function, by cell and node. Outer nodes follow inner ones.
fn pulls<const D: usize>(cells: &PressureCells) -> Vec<(u32, u32, Vector<f64, D>)> {
    let occupied = &cells.occupied;
    let numbers: HashMap<[u32; 3], u32> = (0..).zip(&occupied.nodes).map(|(number, &index)| (index, number)).collect();
    let mut followers = Followers::<D>::default();
    if occupied.aggregated {
        let shares = occupied.cells.iter().copied().zip(occupied.filled.iter().copied()).collect();
        let of = Occupied { dimension: D, grid: occupied.grid, nodes: &occupied.nodes, cells: shares };
        let held = occupied.prescribed.iter().enumerate().filter(|(_, held)| **held).map(|(k, _)| (k / D, k % D));
        followers = Followers::new(Extension::new(Pieces::LINEAR, &of).into(), held);
    }
    let mut all: Vec<(u32, u32, Vector<f64, D>)> = Vec::new();
    for (cell, (index, centroid)) in cells.index.iter().zip(&cells.centroid).enumerate() {
        let pull = Tensor::<f64, D>::from_column_slice(&cells.pull[cell * D * D..(cell + 1) * D * D]);
        let first = all.len();
        let mut add = |node: u32, b: Vector<f64, D>| match all[first..].iter_mut().find(|entry| entry.1 == node) {
            Some(entry) => entry.2 += b,
            None => all.push((cell as u32, node, b)),
        };
        for (corner, slope) in slopes::<D>(index, centroid) {
            let Some(&node) = numbers.get(&corner) else { continue };
            let b = pull * slope;
            let Some((follows, leaders)) = followers.row(node as usize) else {
                add(node, b);
                continue;
            };
            let part = |of: bool| Vector::from_fn(|i, _| if follows[i] == of { b[i] } else { 0.0 });
            add(node, part(false));
            leaders.for_each(|(leader, weight)| add(leader as u32, part(true) * weight));
        }
    }
    all
}

/// The corners of a cell, and the gradients of their hat functions at a place in the cell.
fn slopes<const D: usize>(index: &[u32; 3], place: &[f64; 3]) -> impl Iterator<Item = ([u32; 3], Vector<f64, D>)> {
    let local: [f64; D] = std::array::from_fn(|k| (place[k] - f64::from(index[k])).clamp(0.0, 1.0));
    let index = *index;
    (0..1_u32 << D).map(move |corner| {
        let upper = |k: usize| corner >> k & 1 == 1;
        let hat = |k: usize| if upper(k) { local[k] } else { 1.0 - local[k] };
        let slope = |k: usize| {
            let others: f64 = (0..D).filter(|&other| other != k).map(hat).product();
            if upper(k) { others } else { -others }
        };
        (std::array::from_fn(|k| index[k] + (corner >> k & 1)), Vector::from_fn(|k, _| slope(k)))
    })
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
            cells.pull.extend([1.0, 0.0, 0.0, 1.0]);
            for (list, value) in [
                (&mut cells.volume, 1.0),
                (&mut cells.shear, 1.0),
                (&mut cells.softness, 1.0),
                (&mut cells.stiffness, 1e12),
                (&mut cells.augmented, 1.0),
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
