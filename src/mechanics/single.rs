//! The consistent tangent in single precision, for Krylov methods inside a Newton method in double precision.
//!
//! It has no units: gradients are taken in units of 1/h, and all is divided by a power of two near its largest entries, so that
//! single precision neither over- nor underflows in any set of units.

use crate::material::{ClosedTangent, FrozenTangent, Law};
use crate::mechanics::residual::{Equilibrium, Inadmissible};
use crate::mechanics::sweep::SingleTangents;
use crate::mechanics::tangent::{FrozenPressure, closed_form};
use crate::pooled::Pooled;
use crate::solver::{DiagonalBlocks, LinearOperator, Linearization};
use crate::tensor::{Deformation, Tensor, Vector, identity, scaled};

/// K(Δφ)/s in single precision, frozen.
///
/// ```
/// use bfree::mechanics::{check::direction, sweep::Supports, transfer::Nodal};
/// use bfree::solver::{Linearization, Precision};
/// use bfree::tensor::Vector;
///
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let simulation = scene.build::<2>("scenes".as_ref())?;
/// let (particles, grid, dt) = (&simulation.particles, &simulation.grid, simulation.clock.step());
/// let (approximation, positions) = (&simulation.approximation, &particles.position);
/// let (supports, nodes) = Supports::with_precision(approximation, grid, positions, Precision::Mixed)?;
/// let nodal = Nodal::project(particles, &supports, nodes.len(), 1.0)?;
/// let equilibrium = simulation.equilibrium(&supports, &nodal, &[], simulation.settings.newmark.alphas(dt), dt);
/// let (dphi, u) = (vec![Vector::zeros(); nodes.len()], direction::<2>(nodes.len(), 2));
/// // s (K/s) u in single precision is K u to about 1e-6.
/// let single = equilibrium.single_tangent(&dphi)?.ok_or("neo-Hooke has a closed tangent")?;
/// let (mut rough, mut exact) = (vec![Vector::zeros(); nodes.len()], vec![Vector::zeros(); nodes.len()]);
/// single.product(&u.iter().map(|u| u.map(|x| x as f32)).collect::<Vec<_>>(), &mut rough);
/// equilibrium.tangent(&dphi)?.product(&u, &mut exact);
/// let error = |(a, b): (&Vector<f32, 2>, &Vector<f64, 2>)| (a.map(f64::from) * single.scale() - b).norm_squared();
/// let size: f64 = exact.iter().map(|x| x.norm_squared()).sum();
/// assert!((rough.iter().zip(&exact).map(error).sum::<f64>() / size).sqrt() < 1e-6);
/// assert_eq!(single.scale().log2().fract(), 0.0); // a power of two
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Single<'a, const D: usize, L: Law> {
    equilibrium: &'a Equilibrium<'a, D, L>,
    /// s, a power of two.
    scale: f64,
    frozen: SingleTangents<D>,
    pressures: Vec<FrozenPressure<D>>,
    /// α₁ ε m_I / s; empty without inertia.
    lumped: Pooled<f32>,
}

impl<const D: usize, L: Law> Equilibrium<'_, D, L> {
    /// Freezes the tangent at Δφ in single precision; `None` if the supports are not prepared for it, or a law has no closed tangent.
    ///
    /// Example: [`Single`].
    ///
    /// # Errors
    /// The first particle with det F ≤ 0.
    pub fn single_tangent(&self, dphi: &[Vector<f64, D>]) -> Result<Option<Single<'_, D, L>>, Inadmissible> {
        let Some(both) = closed_form::<D, L>(self.bodies) else { return Ok(None) };
        let Some(h) = self.supports.unit() else { return Ok(None) };
        let scale = self.size(h);
        let weight = |p: usize| self.alphas.a1 * self.consistent_mass(p).unwrap_or(0.0) / scale;
        let inertia: Option<&(dyn Fn(usize) -> f64 + Sync)> = (self.lumping < 1.0).then_some(&weight);
        let frozen = self.supports.single_tangents(&self.laws(), dphi, both, inertia, scale);
        let frozen = match frozen {
            Some(Ok(frozen)) => frozen,
            Some(Err(Some(inadmissible))) => return Err(inadmissible),
            Some(Err(None)) | None => return Ok(None),
        };
        let lumped = self.supports.pool().collect(self.lumped_weights().map(|weight| (weight / scale) as f32));
        Ok(Some(Single { equilibrium: self, scale, frozen, pressures: self.frozen_pressures(dphi), lumped }))
    }

    /// A power of two near the largest entries of K: those of a particle at rest, and of the inertia.
    fn size(&self, h: f64) -> f64 {
        let at_rest = Deformation::new(Tensor::<f64, D>::zeros());
        let volume = self.particles.volume.iter().fold(0.0, |largest: f64, v| largest.max(*v));
        let stiffness = self.bodies.iter().filter_map(|body| body.law.freeze(&identity(), &at_rest, volume).closed());
        let stiffness = stiffness.map(|form: ClosedTangent<f64, D>| form.bulk.abs() + form.right[0][0].abs());
        let mass = self.nodal.mass.iter().fold(0.0, |largest: f64, m| largest.max(*m));
        let largest = stiffness.fold(0.0, f64::max) / (h * h) + self.alphas.a1 * mass;
        if largest > 0.0 && largest.is_finite() { largest.log2().round().exp2() } else { 1.0 }
    }
}

impl<const D: usize, L: Law> Single<'_, D, L> {
    /// K_II/s of every active node; a prescribed degree of freedom has the identity's row and column.
    fn diagonal_blocks(&self) -> Pooled<Tensor<f64, D>> {
        let eq = self.equilibrium;
        let mut single: Pooled<Tensor<f32, D>> = eq.supports.field();
        for (block, &m) in single.iter_mut().zip(&self.lumped) {
            *block = scaled(&identity::<f32, D>(), m);
        }
        eq.supports.add_single_blocks(&self.frozen, &mut single);
        let mut blocks = eq.supports.pool().collect(single.iter().map(|block| block.map(f64::from)));
        let mut pressure = vec![Tensor::zeros(); if self.pressures.is_empty() { 0 } else { blocks.len() }];
        for point in &self.pressures {
            point.add_blocks(eq.supports, &mut pressure);
        }
        for (block, pressure) in blocks.iter_mut().zip(&pressure) {
            *block += pressure / self.scale;
        }
        eq.prescribe_blocks(&mut blocks);
        blocks
    }

    /// K u/s on the free degrees of freedom (u is taken as zero on the prescribed ones).
    pub fn product(&self, u: &[Vector<f32, D>], out: &mut [Vector<f32, D>]) {
        let eq = self.equilibrium;
        out.fill(Vector::zeros());
        for ((out, u), &m) in out.iter_mut().zip(u).zip(&self.lumped) {
            *out = u * m;
        }
        eq.supports.single_product(&self.frozen, u, out);
        for point in &self.pressures {
            point.add_product(eq.supports, u, out, self.scale);
        }
        eq.clear_prescribed(out);
    }
}

impl<const D: usize, L: Law> LinearOperator<f32> for Single<'_, D, L> {
    fn apply(&self, x: &[f32], y: &mut [f32]) {
        self.product(bytemuck::cast_slice(x), bytemuck::cast_slice_mut(y));
    }
}

impl<const D: usize, L: Law> DiagonalBlocks for Single<'_, D, L> {
    fn diagonal_blocks(&self) -> Pooled<f64> {
        Self::diagonal_blocks(self).into_numbers()
    }
}

impl<const D: usize, L: Law> Linearization<f32> for Single<'_, D, L> {
    fn scale(&self) -> f64 {
        self.scale
    }
}
