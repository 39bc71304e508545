//! The consistent tangent K(φ)·u, matrix-free: the terms are linearised at φ and applied, and K is never assembled (eqs. 30, 34, 38).

use crate::lanes::LANES;
use crate::material::Law;
use crate::mechanics::constitutive::{Form, Laws};
use crate::mechanics::linearized::{CellRows, Linearized};
use crate::mechanics::mass::Mass;
use crate::mechanics::residual::{Equilibrium, Inadmissible};
use crate::mechanics::sweep::{Connectivity, Group, Quadratic};
use crate::mechanics::terms::Piece;
use crate::mechanics::trial::Trial;
use crate::parallel;
use crate::particles::{Body, Particles};
use crate::pooled::Pooled;
use crate::solver::{LinearOperator, Linearization, LocalForm, OnDevice};
use crate::space::Space;
use crate::tensor::{Tensor, Vector};
use std::sync::Arc;

/// The linearisation K(φ) as an operator.
///
/// ```
/// use bfree::mechanics::check::direction;
/// use bfree::tensor::Vector;
///
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let simulation = scene.build::<2>("scenes".as_ref())?;
/// let coming = simulation.next_step()?;
/// let (equilibrium, count) = (coming.equilibrium(), coming.nodes().len());
/// let phi: Vec<_> = direction::<2>(count, 1).iter().map(|x| x * 0.01).collect();
/// let tangent = equilibrium.tangent(None, &phi)?;
/// let times = |u: &[Vector<f64, 2>]| {
///     let mut out = vec![Vector::zeros(); u.len()];
///     tangent.product(u, &mut out);
///     out
/// };
/// // All loads have a potential, so K is symmetric: w·Ku = u·Kw.
/// let dot = |a: &[Vector<f64, 2>], b: &[Vector<f64, 2>]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
/// let (u, w) = (direction(count, 2), direction(count, 3));
/// let (ku, kw) = (times(&u), times(&w));
/// assert!((dot(&w, &ku) - dot(&u, &kw)).abs() < 1e-13 * (dot(&ku, &ku) * dot(&w, &w)).sqrt());
/// // K_II is the force on node I under its own motion.
/// let mut unit = vec![Vector::zeros(); count];
/// unit[30] = Vector::from([1.0, 0.0]);
/// let column = tangent.diagonal_blocks()[30].column(0).into_owned();
/// assert!((times(&unit)[30] - column).norm() < 1e-13 * column.norm());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Tangent<'a, const D: usize> {
    /// M̃, the particles, and their shape functions.
    pub(super) mass: Mass<'a, D>,
    pub(super) space: Arc<Space<D>>,
    pub(super) data: Linearized<D>,
    pub(super) has_inertia: bool,
}

impl<'a, const D: usize> Tangent<'a, D> {
    pub(super) fn connectivity(&self) -> &'a Connectivity<D> {
        self.mass.connectivity
    }

    /// K u on the free degrees of freedom. `u` must be zero on prescribed degrees of freedom.
    pub fn product(&self, u: &[Vector<f64, D>], out: &mut [Vector<f64, D>]) {
        self.product_under(u, None, out);
    }

    /// K u, with given changes of the pressures of averaged cells in place of those that u causes.
    pub(super) fn product_under(&self, u: &[Vector<f64, D>], pressures: Option<&[f64]>, out: &mut [Vector<f64, D>]) {
        parallel::fill(out, Vector::zeros());
        let extended = self.space.extended_in_pool(u);
        self.data.add_product(&self.mass, extended.as_deref().unwrap_or(u), pressures, out);
        mutant!("unknowns: forces stay at nodes that follow": { return self.space.clear_prescribed(out); });
        self.space.followers().restrict(out);
        self.space.clear_prescribed(out);
    }

    /// The averaged cells whose dilatation is an unknown of its own.
    pub(super) fn mixed_cells(&self) -> Option<&CellRows<D>> {
        self.data.mixed()
    }

    /// K_II of every active node. Values that are prescribed or follow inner nodes have the row and column of the identity.
    pub fn diagonal_blocks(&self) -> Pooled<Tensor<f64, D>> {
        let mut blocks: Pooled<Tensor<f64, D>> = self.connectivity().field();
        self.data.add_blocks_at_nodes(&self.mass, &mut blocks);
        self.space.restrict_blocks(&mut blocks);
        let functions = |particle| self.space.functions(self.connectivity(), particle);
        self.data.add_blocks_of_functions(&functions, &mut blocks);
        if self.data.has_quadratic(&self.mass) {
            let quadratic = |group: Group<'_>, form: &mut Quadratic| self.data.add_quadratic(&self.mass, group, form);
            let on_device = self.particles_on_device(|gpu| self.data.rows_without_cells_on_device(gpu));
            if !on_device.is_some_and(|particles| particles.add_diagonal_blocks(bytemuck::cast_slice_mut(&mut blocks)))
            {
                self.connectivity().blocks(&mut blocks, &quadratic);
            }
            self.add_followers(&quadratic, &mut blocks);
        }
        self.space.finish_blocks(&mut blocks);
        blocks
    }

    /// Corrects the blocks of inner nodes for the outer nodes that follow them.
    fn add_followers(&self, quadratic: &(dyn Fn(Group<'_>, &mut Quadratic) + Sync), blocks: &mut [Tensor<f64, D>]) {
        mutant!("unknowns: the diagonal blocks lack the nodes that follow": { return; });
        if self.space.followers().is_empty() {
            return;
        }
        let reached = self.space.reached(self.connectivity());
        let corrections = |group: Group<'_>| {
            let mut added = Vec::new();
            if group.particles.iter().any(|&p| reached[p as usize]) {
                let mut form = Quadratic::zero();
                quadratic(group, &mut form);
                for (lane, &p) in group.particles.iter().enumerate().filter(|(_, p)| reached[**p as usize]) {
                    self.space.add_followers(self.connectivity(), p as usize, &form, lane, &mut added);
                }
            }
            added
        };
        let added = self.connectivity().map_groups(corrections);
        added.into_iter().flatten().for_each(|(node, block)| blocks[node] += block);
    }
}

impl<const D: usize, L: Law> Equilibrium<'_, D, L> {
    /// Linearises the residual at φ: one piece, or `None` for the whole.
    ///
    /// Example: [`Tangent`].
    ///
    /// # Errors
    /// det F ≤ 0. The error names the particle with the smallest id.
    pub fn tangent(
        &self,
        piece: impl Into<Option<Piece>>,
        phi: &[Vector<f64, D>],
    ) -> Result<Tangent<'_, D>, Inadmissible> {
        self.tangent_at(piece.into(), Trial::motion(phi))
    }

    /// The linearisation at a trial state. In the mixed form it is A + Bᵀ γ B ([`mixed`](crate::mechanics::mixed)).
    pub(super) fn tangent_at(
        &self,
        piece: Option<Piece>,
        at: Trial<'_, f64, D>,
    ) -> Result<Tangent<'_, D>, Inadmissible> {
        let data = self.terms.linearize(piece, Trial { phi: &self.space.extended(at.phi), ..at })?;
        let has_inertia = !self.step.nodal.is_static();
        Ok(Tangent { mass: self.step.mass(), space: self.space.clone(), data, has_inertia })
    }
}

/// Bytes of the linearised tangent of all particles. With `discrete_gradient` it is that of the mean stress of a step.
///
/// ```
/// use bfree::mechanics::{sweep::Connectivity, tangent::tangent_bytes};
///
/// let scene = bfree::scene::read_file("scenes/rebound.json".as_ref(), &[])?;
/// let simulation = scene.build::<2>("scenes".as_ref())?;
/// let (particles, bodies) = (&simulation.particles, &simulation.bodies);
/// let (connectivity, _) = Connectivity::new(&simulation.approximation, &simulation.grid, &particles.position)?;
/// // A neo-Hookean particle in 2D needs A, the symmetric B, κ and q: 9 numbers.
/// assert!(tangent_bytes(particles, bodies, &connectivity, false) >= 9 * size_of::<f64>() * particles.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn tangent_bytes<const D: usize, L: Law>(
    particles: &Particles<D>,
    bodies: &[Body<L>],
    connectivity: &Connectivity<D>,
    discrete_gradient: bool,
) -> usize {
    let form: Form = Laws { particles, bodies, dt: 0.0, discrete_gradient }.form();
    connectivity.groups() * form.rows(D) * LANES * size_of::<f64>()
}

impl<const D: usize> LinearOperator for Tangent<'_, D> {
    fn apply(&self, x: &[f64], y: &mut [f64]) {
        self.product(bytemuck::cast_slice(x), bytemuck::cast_slice_mut(y));
    }
}

impl<const D: usize> Linearization for Tangent<'_, D> {
    fn diagonal_blocks(&self) -> Pooled<f64> {
        Self::diagonal_blocks(self).into_numbers()
    }

    fn on_device(&self) -> Option<Box<dyn OnDevice + '_>> {
        Some(Box::new(self.device_tangent()?))
    }

    fn local_form(&self) -> Option<LocalForm> {
        Some(self.on_cells())
    }
}
